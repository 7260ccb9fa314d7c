"""What a results folder cannot show, said from its own facts (``limitations.toml``)."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any

from coartic.analysis.generality.sample import one_by_one
from coartic.analysis.markup import code, escaped
from coartic.analysis.methods import LEARNER
from coartic.analysis.published import RUNS, TRIALS
from coartic.analysis.report.document import CellKey
from coartic.analysis.report.summary import unlike_printed
from coartic.analysis.results.optima import ARMS
from coartic.analysis.statistics.estimates import FEWEST
from coartic.analysis.statistics.power import POWER, smallest_difference
from coartic.analysis.statistics.spread import sd
from coartic.analysis.study import Study
from coartic.analysis.words import stated, typographic
from coartic.exploration import CONDITIONS
from coartic.text import counted

_SENTENCES: dict[str, str] = stated(__file__)


def limitations(study: Study) -> tuple[str, ...]:
    """One limitation an item, in the report's inline markup, the gravest first."""
    unlike = escaped("; ".join(unlike_printed(study)))
    return (
        *([_said("not_reproduced", found=unlike)] if unlike else []),
        *_reconstructed(study),
        *_learned(study),
        *_failures(study),
        *_versions(study),
        *_numbers_of_runs(study),
        *_optima(study),
        *_timing_and_model(study),
    )


def _said(sentence: str, **facts: Any) -> str:
    return _SENTENCES[sentence].format(**facts)


def _learned(study: Study) -> Iterator[str]:
    """What a learned reward is, beside what a learner would do without its noise."""
    parts, alone = [], one_by_one(study)
    for (task, label), cell in study.cells.items():
        if task not in alone:
            continue
        replays = cell.good.replay_reward.dropna()
        if label.startswith(LEARNER) and not cell.variant and len(replays) == len(cell.good) > 0:
            learned, replayed = (
                typographic(f"{rewards.mean():.1f}") for rewards in (cell.good.reward, replays)
            )
            name = escaped(f"{task} {label.removeprefix(LEARNER)}")
            parts.append(f"{name} {learned} ({replayed})")
    if parts:
        yield _said("learned", cells="; ".join(parts))


def _reconstructed(study: Study) -> Iterator[str]:
    alone = one_by_one(study)
    if len(alone) < len(study.tasks):
        yield _said("drawn", count=len(study.tasks) - len(alone))
    for name, task in study.tasks.items():
        if name not in alone:
            continue
        entries = task.provenance.items()
        inferred = [
            f"{key} ({entry.source.rstrip('.')})"
            for key, entry in entries
            if entry.status == "inferred"
        ]
        if inferred:
            facts = escaped("; ".join(inferred))
            yield _said("reconstructed", task=escaped(name), inferred=facts)
        chosen = sorted(key for key, entry in entries if entry.status == "chosen")
        if chosen:
            yield _said("chosen", facts=escaped(f"{name}: {', '.join(chosen)}"))


def _failures(study: Study) -> Iterator[str]:
    runs = study.runs
    failed = runs[runs.status != "ok"]
    if not len(failed):
        yield _said("no_failures", runs=counted(len(runs), "run"))
    for key, own in failed.groupby(["task", "status"], sort=False):
        task, status = map(str, key)
        cells = ", ".join(
            f"{code(str(label))} ({count} of {len(study.cells[task, str(label)].runs)})"
            for label, count in own.label.value_counts(sort=False).items()
        )
        others = ", and other reasons" if own.reason.nunique() > 1 else ""
        yield _said(
            "failures",
            task=escaped(task),
            runs=_runs(len(own), "is", "are"),
            status=escaped(status),
            reason=f"{escaped(str(own.reason.iloc[0]))}{others}",
            cells=cells,
        )
    parts = []
    for (task, label), cell in study.cells.items():
        lost, made = int(cell.runs.failed_trials.sum()), int(cell.runs.trials.sum())
        if lost and lost >= 0.01 * made:
            digits = 1 if 0.995 <= lost / made < 1 else 0
            share = _percent(lost / made, digits)
            parts.append(f"{escaped(task)}, {code(label)} {lost} of {made} ({share})")
    if parts:
        yield _said("failed_trials", cells="; ".join(parts))


def _versions(study: Study) -> Iterator[str]:
    runs = study.runs
    known = runs.commit.dropna().astype(str)
    ids = known.str.removesuffix("+").str[:12]
    commits, changed = sorted(set(ids)), sorted(set(ids[known.str.endswith("+")]))
    if len(commits) > 1:
        # Loading refuses folders in which the code behind a method's results differs.
        named = ", ".join(map(code, commits))
        yield _said("mixed_commits", count=len(commits), commits=named)
    if len(known) < len(runs):
        yield _said("unknown_commit", runs=_runs(len(runs) - len(known), "was", "were"))
    if changed:
        yield _said("uncommitted", commits=", ".join(map(code, changed)))
    packages = runs.packages.nunique()
    if packages > 1:
        yield _said("mixed_packages", count=packages)


def _numbers_of_runs(study: Study) -> Iterator[str]:
    specification = study.results.manifest.specification
    learner = {key: cell for key, cell in study.cells.items() if key[1].startswith(LEARNER)}
    if any((cell.runs.trials != TRIALS).any() for cell in learner.values()):
        yield _said("trials", trials=TRIALS)
    alone = one_by_one(study)
    found = [text for key in learner if key[0] in alone for text in _detectable(study, key)]
    if found:
        yield _said("detectable", power=_percent(POWER), cells="; ".join(found))
    few = sorted({len(cell.runs) for cell in learner.values() if len(cell.runs) < RUNS})
    if few:
        ours = f"{few[0]}{'' if len(few) == 1 else f' to {few[-1]}'}"
        yield _said("few_runs", runs=RUNS, ours=ours)
    cells = study.cells.values()
    once = specification.runs > 1 and any(len(cell.runs) == 1 for cell in cells)
    covered = any(len(cell.good) >= FEWEST for cell in cells)
    yield _said(
        "one_seed",
        seed=specification.seed,
        once=_said("run_once") if once else "",
        covered=_said("coverage" if covered else "no_intervals"),
    )


def _detectable(study: Study, key: CellKey) -> Iterator[str]:
    """The difference that as many runs of one of the paper's conditions would show."""
    task, condition = key[0], key[1].removeprefix(LEARNER)
    best = study.optima.get((task, "free"))
    rewards = study.cells[key].rewards
    if len(rewards) < 2 or best is None or not best.reward or sd(rewards) == 0:
        return
    if condition in CONDITIONS:
        ticks = smallest_difference(sd(rewards), sd(rewards), len(rewards))
        share = _percent(ticks / -best.reward, 1)
        yield f"{escaped(task)} {condition} {ticks:.1f} ticks ({share}, n = {len(rewards)})"


def _optima(study: Study) -> Iterator[str]:
    without = [task for task in study.tasks if (task, "free") not in study.optima]
    if without:
        yield _said("no_optimum", tasks=escaped(", ".join(without)))
    alone = one_by_one(study)
    others = [
        best
        for (task, arm), best in study.optima.items()
        if arm == "free" and task not in alone and not best.proven
    ]
    if others:
        bounded = sum(best.bound is not None for best in others)
        drawn = len(study.tasks) - len(alone)
        yield _said("unproven_instances", count=len(others), drawn=drawn, bounded=bounded)
    for task, arm in itertools.product(study.tasks, ARMS):
        best = study.optima.get((task, arm)) if task in alone else None
        if best is not None and not best.proven:
            bound = "" if best.bound is None else f"; none above {best.bound} is proven"
            facts = {"arm": arm, "reward": best.reward, "bound": bound}
            yield _said("unproven", task=escaped(task), **facts)


def _timing_and_model(study: Study) -> Iterator[str]:
    runs, environment = study.runs, study.results.manifest.environment
    cold = ~runs.warm.astype("boolean")  # unknown where it went with the process
    yield _said(
        "times",
        processor=escaped(environment.processor or "an unnamed processor"),
        cores=environment.cores,
        share=_percent(int(cold.sum()) / len(runs)),
        together=_percent(int((runs.together > 1).sum()) / len(runs)),
    )
    yield _said("model")
    yield _said("one_posture")
    if any(len(task.hands) > 1 for task in study.tasks.values()):
        yield _said("arms")


def _runs(count: int, one: str, several: str) -> str:
    return f"{counted(count, 'run')} {one if count == 1 else several}"


def _percent(share: float, digits: int = 0) -> str:
    return f"{100 * share:.{digits}f} %"
