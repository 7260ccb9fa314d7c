"""What a results folder cannot show, said from its own facts."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from analysis.markup import code, escaped
from analysis.methods import LEARNER
from analysis.published import RUNS, TRIALS
from analysis.report.document import CellKey
from analysis.report.summary import unlike_printed
from analysis.statistics.estimates import FEWEST
from analysis.statistics.power import POWER, smallest_difference
from analysis.statistics.spread import sd
from analysis.words import typographic
from coartic.text import counted

if TYPE_CHECKING:
    from analysis.study import Study


def limitations(study: Study) -> tuple[str, ...]:
    """One limitation an item, in the report's inline markup, the gravest first."""
    return (
        *_unlike(study),
        *_reconstructed(study),
        *_learned(study),
        *_failures(study),
        *_versions(study),
        *_numbers_of_runs(study),
        *_optima(study),
        *_timing(study),
        *_model(study),
    )


def _unlike(study: Study) -> Iterator[str]:
    found = unlike_printed(study)
    if found:
        yield f"*Not reproduced.* {escaped('; '.join(found))}."


def _learned(study: Study) -> Iterator[str]:
    """What a learned reward is, beside what a learner would do without its noise."""
    parts = []
    for (task, label), cell in study.cells.items():
        replays = cell.good.replay_reward.dropna()
        if label.startswith(LEARNER) and not cell.variant and len(replays) == len(cell.good) > 0:
            learned, replayed = (
                typographic(f"{rewards.mean():.1f}") for rewards in (cell.good.reward, replays)
            )
            name = escaped(f"{task} {label.removeprefix(LEARNER)}")
            parts.append(f"{name} {learned} ({replayed})")
    if parts:
        yield (
            "*Learned reward.* The best of a run's trials, exploration noise and chance of hands "
            "included: how we read the paper (docs/model.md). One noiseless trial with what is "
            f"kept gets, in brackets: {'; '.join(parts)}. Both depend on the noise and ε of the "
            "paper's conditions."
        )


def _reconstructed(study: Study) -> Iterator[str]:
    for name, task in study.results.tasks.items():
        entries = task.provenance.items()
        inferred = [
            f"{key} ({entry.source.rstrip('.')})"
            for key, entry in entries
            if entry.status == "inferred"
        ]
        if inferred:
            yield (
                f"*Reconstructed.* {escaped(name)}: not printed in the paper but inferred from "
                f"what is: {escaped('; '.join(inferred))}. Rewards on it, and claims that rest "
                "on it (marked †), depend on that."
            )
        chosen = sorted(key for key, entry in entries if entry.status == "chosen")
        if chosen:
            facts = escaped(f"{name}: {', '.join(chosen)}")
            yield f"*Not the paper's.* {facts} chosen by the task's author."


def _failures(study: Study) -> Iterator[str]:
    runs = study.results.runs
    failed = runs[runs.status != "ok"]
    if not len(failed):
        yield f"*Failures.* None: all {len(runs)} runs have a solution, executed and scored."
    for key, own in failed.groupby(["task", "status"], sort=False):
        task, status = map(str, key)
        cells = ", ".join(
            f"{code(str(label))} ({count} of {len(study.cells[task, str(label)].runs)})"
            for label, count in own.label.value_counts(sort=False).items()
        )
        others = ", and other reasons" if own.reason.nunique() > 1 else ""
        yield (
            f"*Failures.* {escaped(task)}: {_runs(len(own), 'is', 'are')} {escaped(status)} "
            f"({escaped(str(own.reason.iloc[0]))}{others}): {cells}. Means are over runs that "
            "have a solution."
        )
    parts = []
    for (task, label), cell in study.cells.items():
        lost, made = int(cell.runs.failed_trials.sum()), int(cell.runs.trials.sum())
        if lost and lost >= 0.01 * made:
            digits = 1 if 0.995 <= lost / made < 1 else 0
            parts.append(
                f"{escaped(task)}, {code(label)} {lost} of {made} "
                f"({_percent(lost / made, digits)})"
            )
    if parts:
        yield (
            f"*Failed trials.* They did not hit every goal and taught nothing: {'; '.join(parts)}."
        )


def _versions(study: Study) -> Iterator[str]:
    runs = study.results.runs
    known = runs.commit.dropna().astype(str)
    ids = known.str.removesuffix("+").str[:12]
    commits, changed = sorted(set(ids)), sorted(set(ids[known.str.endswith("+")]))
    if len(commits) > 1:
        # Loading refuses folders of which that does not hold.
        yield (
            f"*Mixed versions.* Runs were made at {len(commits)} commits "
            f"({', '.join(map(code, commits))}); the code behind each method's results is the "
            "same in all of them."
        )
    hashed = "each run names the hash of the code behind it."
    if len(known) < len(runs):
        made = _runs(len(runs) - len(known), "was", "were")
        yield f"*Unknown commit.* {made} made outside a checkout; {hashed}"
    if changed:
        yield (
            "*Uncommitted changes.* The checkout was changed when runs were made at "
            f"{', '.join(map(code, changed))}; {hashed}"
        )
    packages = runs.packages.nunique()
    if packages > 1:
        yield f"*Mixed versions.* Runs were made with {packages} sets of library versions."


def _numbers_of_runs(study: Study) -> Iterator[str]:
    specification = study.results.manifest.specification
    learner = {key: cell for key, cell in study.cells.items() if key[1].startswith(LEARNER)}
    if any((cell.runs.trials != TRIALS).any() for cell in learner.values()):
        yield (
            f"*Trials.* The paper's runs have {TRIALS} trials; runs with another number are "
            "not comparable with them, and no claim is judged on them."
        )
    found = [text for key in learner for text in _detectable(study, key)]
    if found:
        yield (
            f"*Number of runs.* Between two samples like these a one-tailed t-test at 5 % finds, "
            f"with probability {_percent(POWER)}, a difference of: {'; '.join(found)}. "
            "Smaller ones may be missed."
        )
    few = sorted({len(cell.runs) for cell in learner.values() if len(cell.runs) < RUNS})
    if few:
        yield (
            f"*Number of runs.* The paper has {RUNS} runs a cell; here are {few[0]}"
            f"{'' if len(few) == 1 else f' to {few[-1]}'}."
        )
    sizes = [len(cell.runs) for cell in study.cells.values()]
    once = "; methods that draw nothing at random were run once and have no spread"
    covered = (
        "95 % BCa intervals of means of 20 runs cover 91 to 95 % (simulated; "
        "docs/statistics.md), of fewer runs less."
        if any(len(cell.good) >= FEWEST for cell in study.cells.values())
        else "No cell has the three runs that an interval takes."
    )
    yield (
        f"*One seed.* All runs derive from seed {specification.seed}"
        f"{once if specification.runs > 1 and 1 in sizes else ''}. {covered}"
    )


def _detectable(study: Study, key: CellKey) -> Iterator[str]:
    """The difference that as many runs of one of the paper's conditions would show."""
    task, condition = key[0], key[1].removeprefix(LEARNER)
    best = study.optima.get((task, "free"))
    rewards = study.cells[key].good.reward.to_numpy(dtype=np.float64)
    if len(rewards) < 2 or best is None or not best.reward or sd(rewards) == 0:
        return
    if condition in ("EC1", "EC2", "EC3", "EC4"):
        ticks = smallest_difference(sd(rewards), sd(rewards), len(rewards))
        share = _percent(ticks / -best.reward, 1)
        yield f"{escaped(task)} {condition} {ticks:.1f} ticks ({share}, n = {len(rewards)})"


def _optima(study: Study) -> Iterator[str]:
    without = [task for task in study.results.tasks if (task, "free") not in study.optima]
    if without:
        yield (
            f"*No optimum.* None is known of {escaped(', '.join(without))}: no gaps, targets or "
            "scores there."
        )
    for task in study.results.tasks:
        for arm in ("free", "still"):
            best = study.optima.get((task, arm))
            if best is not None and not best.proven:
                bound = "" if best.bound is None else f"; none above {best.bound} is proven"
                yield (
                    f"*Optimum not proven.* {escaped(task)}, other arm {arm}: {best.reward} is "
                    f"the best of the searches{bound}."
                )


def _timing(study: Study) -> Iterator[str]:
    runs, environment = study.results.runs, study.results.manifest.environment
    cold = ~runs.warm.astype("boolean")  # unknown where it went with the process
    share = int(cold.sum()) / len(runs)
    yield (
        f"*Times.* Taken on {escaped(environment.processor or 'an unnamed processor')} with "
        f"{environment.cores} cores, one thread a run, runs side by side as far as asked "
        f"for; {_percent(share)} of the runs were the first of their method in their process "
        "and hold its warming up. "
        "Times compare within a folder; counts of evaluations compare between machines."
    )


def _model(study: Study) -> Iterator[str]:
    yield (
        "*Model.* A kinematic robot: no masses, no noise of sensors or muscles, one tick per "
        "control step of constant length in joint space. What is said of movements is said of it."
    )
    yield "*One posture.* Every task starts from one posture, the same in every run."
    if any(len(task.hands) > 1 for task in study.results.tasks.values()):
        yield (
            "*Arms.* No collisions, of the arms with each other or with anything else, are "
            "modelled; the paper mentions none."
        )


def _runs(count: int, one: str, several: str) -> str:
    return f"{counted(count, 'run')} {one if count == 1 else several}"


def _percent(share: float, digits: int = 0) -> str:
    return f"{100 * share:.{digits}f} %"
