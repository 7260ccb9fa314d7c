"""The claims register: what the paper says of its model, each statement with its verdict.

A claim names the place where the paper makes it, the test that decides it, and the runs it
was decided on. *Supported*: what the claim says is seen, and every test it rests on stays
significant at 5 % after Holm's correction over the tests of all claims. *Not supported*: it
is not seen. *Cannot tell*: it is seen without being significant, or the folder lacks the
runs. Below the paper's claims stand comparisons that the paper does not make; they are
measured, not judged.

The tests are the paper's own kind, the one-tailed bootstrap (:mod:`analysis.statistics`);
beside a difference of means stands the probability of improvement, which a change of hand
sequence in some runs moves less.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

import numpy as np
import pandas as pd
from scipy import stats

from analysis.frontier import targets_frame
from analysis.methods import methods_frame
from analysis.optimum import optima
from analysis.published import published_cell, published_exhaustive
from analysis.results import CellRuns, Results
from analysis.signatures import signatures_frame
from analysis.signatures.cell import Cell, cells_of
from analysis.signatures.paths import REVERSAL
from analysis.statistics import (
    Inference,
    bootstrap_test,
    difference_of_means,
    holm,
    mean,
    probability_of_improvement,
)
from analysis.table import Table
from coartic.robot import Array

LEVEL = 0.05
SEED = 0
Verdict = Literal["supported", "not supported", "cannot tell", "measured"]
_LEARNER = "dual-process/"
_SMOOTH = {
    "squared-changes": "least squared configuration changes (Jordan)",
    "acceleration": "least acceleration",
    "jerk": "least jerk (Flash & Hogan)",
}


class MissingError(Exception):
    """The folder lacks what a claim needs."""


@dataclass(frozen=True)
class Finding:
    """What was seen of one claim, before any correction of its tests."""

    holds: bool | None
    """Whether what the claim says is seen; None where nothing is judged."""
    evidence: str
    tests: tuple[Inference, ...] = ()
    """Tests that it rests on."""
    run_ids: tuple[str, ...] = ()


@dataclass(frozen=True)
class Claim:
    """One statement and how it is decided."""

    id: str
    statement: str
    place: str
    """Where the paper makes it; empty for comparisons of our own."""
    test: str
    judge: Callable[[Data], Finding]


@dataclass(frozen=True)
class Judged:
    """A claim with its verdict."""

    claim: Claim
    verdict: Verdict
    evidence: str
    p: tuple[float, ...] = ()
    """Adjusted over the whole register."""
    methods: tuple[str, ...] = ()
    """Tests, in words."""
    run_ids: tuple[str, ...] = ()


@dataclass
class Data:
    """A results folder as the claims read it."""

    results: Results
    used: list[str] = field(default_factory=list)
    """Run ids read since the last claim."""

    @cached_property
    def cells(self) -> dict[tuple[str, str], CellRuns]:
        """Cells by task and label."""
        return {(cell.task, cell.label): cell for cell in self.results.cells}

    @cached_property
    def trajectories(self) -> dict[tuple[str, str], Cell]:
        """Executed solutions by task and label."""
        return {
            (cell.task.name, f"{cell.method} {cell.variant}".strip()): cell
            for cell in cells_of(self.results)
        }

    @cached_property
    def signatures(self) -> pd.DataFrame:
        """All signatures, with the label of each cell."""
        frame = signatures_frame(self.results, seed=SEED)
        return frame.assign(label=(frame.method + " " + frame.variant).str.strip())

    @cached_property
    def methods(self) -> dict[tuple[str, str], dict[str, Any]]:
        """Rows of the table of methods by task and label."""
        return {
            (row["task"], f"{row['method']} {row['variant']}".strip()): {
                str(key): value for key, value in row.items()
            }
            for row in methods_frame(self.results).to_dict("records")
        }

    def runs(self, task: str, method: str) -> pd.DataFrame:
        """Solved runs of a method; raises MissingError where there are none."""
        cell = self.cells.get((task, method))
        if cell is None or not len(cell.good):
            raise MissingError(f"no runs of {method} on {task}")
        self.used += list(cell.good.run_id)
        return cell.good

    def learned(self, task: str, condition: str) -> pd.DataFrame:
        """Runs of the paper's learner."""
        return self.runs(task, _LEARNER + condition)

    def rewards(self, task: str, condition: str) -> Array:
        """Learned rewards, shape ``(runs,)``."""
        return self.learned(task, condition).reward.to_numpy(dtype=np.float64)

    def cell(self, task: str, method: str) -> Cell:
        """Executed solutions; raises MissingError where there are none."""
        self.runs(task, method)
        return self.trajectories[task, method]

    def signature(self, task: str, method: str, name: str, where: str = "") -> dict[str, Any]:
        """The first row of a signature whose ``where`` begins so; MissingError without one."""
        self.runs(task, method)
        frame = self.signatures
        rows = frame[(frame.task == task) & (frame.label == method) & (frame.signature == name)]
        rows = rows[rows["where"].str.startswith(where) & rows.value.notna()]
        if not len(rows):
            raise MissingError(f"{name} of {method} on {task} has no value")
        return {str(key): value for key, value in rows.iloc[0].items()}


def judge(results: Results, claims: Iterable[Claim] | None = None) -> list[Judged]:
    """Every claim with its verdict, p-values corrected over all of them (Holm)."""
    data = Data(results)
    found: list[tuple[Claim, Finding]] = []
    for claim in CLAIMS if claims is None else claims:
        data.used.clear()
        try:
            finding = claim.judge(data)
        except MissingError as missing:
            found.append((claim, Finding(None, f"not in this folder: {missing}")))
            continue
        ids = tuple(dict.fromkeys(data.used))
        found.append((claim, Finding(finding.holds, finding.evidence, finding.tests, ids)))
    adjusted = iter(holm([test.p for _, finding in found for test in finding.tests]))
    judged = []
    for claim, finding in found:
        p = tuple(next(adjusted) for _ in finding.tests)
        judged.append(
            Judged(
                claim,
                _verdict(claim, finding, p),
                finding.evidence,
                p,
                tuple(dict.fromkeys(test.method for test in finding.tests)),
                finding.run_ids,
            )
        )
    return judged


def _verdict(claim: Claim, finding: Finding, p: Sequence[float]) -> Verdict:
    if finding.holds is None:
        return "measured" if not claim.place and finding.run_ids else "cannot tell"
    if not finding.holds:
        return "not supported"
    # A test without a p-value (no spread at all) has nothing to say against what is seen.
    return "cannot tell" if any(value >= LEVEL for value in p) else "supported"


# The paper's claims.

CELLS = (
    ("ascending", "EC1"),
    ("descending", "EC1"),
    ("two-armed-1", "EC2"),
    ("two-armed-1", "EC3"),
    ("two-armed-1", "EC4"),
    ("two-armed-2", "EC3"),
    ("two-armed-2", "EC4"),
)

_BEST = (  # the condition that explores most, by task
    ("ascending", "EC1"),
    ("descending", "EC1"),
    ("two-armed-1", "EC4"),
    ("two-armed-2", "EC4"),
)


def _learning_improves(data: Data) -> Finding:
    tests, parts = [], []
    for task, condition in CELLS:
        runs = data.learned(task, condition)
        initial = float(runs.initial_reward.iloc[0])
        rewards = data.rewards(task, condition)
        tests.append(bootstrap_test(rewards, initial, seed=SEED))
        parts.append(f"{task} {condition} {initial:.0f} to {_interval(mean(rewards, seed=SEED))}")
    return Finding(all(test.estimate > 0 for test in tests), "; ".join(parts), tuple(tests))


def _first_movement_sacrificed(data: Data) -> Finding:
    tests, parts = [], []
    for task in ("ascending", "descending"):
        cell = data.cell(task, f"{_LEARNER}EC1")
        if cell.initial is None:
            raise MissingError(f"the corrective process alone does not complete {task}")
        initial = cell.initial.ticks_by_goal()[0]
        first = [float(run.execution.ticks_by_goal()[0]) for run in cell.runs]
        total = [float(run.execution.ticks) for run in cell.runs]
        tests += [
            bootstrap_test(first, float(initial), seed=SEED),
            bootstrap_test(total, float(cell.initial.ticks), "less", seed=SEED),
        ]
        parts.append(
            f"{task}: first movement {initial} to {_interval(mean(first, seed=SEED))} ticks, "
            f"all {cell.initial.ticks} to {np.mean(total):.1f}"
        )
    holds = all(
        test.estimate > 0 if index % 2 == 0 else test.estimate < 0
        for index, test in enumerate(tests)
    )
    return Finding(holds, "; ".join(parts), tuple(tests))


def _context_matters(data: Data) -> Finding:
    method, where = f"{_LEARNER}EC1", "goal 1"
    data.runs("descending", method)
    row = data.signature("ascending", method, "context dependence", where)
    distance = data.signature("ascending", method, "context distance", where)["value"]
    equivalent = data.signature("ascending", method, "motor-equivalent part", where)["value"]
    other = data.signature("ascending", method, "non-motor-equivalent part", where)["value"]
    apart = row["value"]
    test = Inference(apart, (int(row["n"]),), "permutation test over runs", p=row["p"], seed=SEED)
    return Finding(
        apart > 1.0,
        f"postures at goal 1 lie {distance:.2f} apart, {apart:.1f} pooled SDs; per dimension "
        f"{equivalent:.3f} leave the hand in place and {other:.3f} move it",
        (test,),
    )


def _ec2_sequences(data: Data) -> Finding:
    counts = Counter(data.learned("two-armed-1", "EC2").hands)
    printed = published_cell("two-armed-1", "EC2")
    assert printed is not None
    known = {s.hands: s.runs or 0 for s in printed.sequences}
    total = sum(counts.values())
    table = [
        [known["RRLR"], sum(known.values()) - known["RRLR"]],
        [counts["RRLR"], total - counts["RRLR"]],
    ]
    p = stats.fisher_exact(table).pvalue
    return Finding(
        set(counts) == set(known),
        f"{_counts(counts)} of {total} runs; published {_counts(known)}; RRLR as often: Fisher's "
        f"exact test p = {p:.3g} (two-sided, not part of the verdict)",
    )


def _ec3_alternates(data: Data) -> Finding:
    counts = Counter(data.learned("two-armed-1", "EC3").hands)
    total = sum(counts.values())
    low = stats.binomtest(counts["LRLR"], total).proportion_ci().low
    return Finding(
        set(counts) == {"LRLR"},
        f"{_counts(counts)} of {total} runs; in at least {low:.0%} of all runs (95 %, one end of "
        "the exact interval)",
    )


def _ec3_beats_exhaustive(data: Data) -> Finding:
    rewards = data.rewards("two-armed-1", "EC3")
    table = data.results.sequences
    best = table[(table.task == "two-armed-1") & table.reward.notna()].reward.max()
    if pd.isna(best):
        raise MissingError("the corrective process alone on two-armed-1")
    published = published_exhaustive("two-armed-1")
    assert published is not None
    test = bootstrap_test(rewards, float(best), seed=SEED)
    return Finding(
        test.estimate > 0,
        f"{_interval(mean(rewards, seed=SEED))} against {best:.0f} (published {published[1]})",
        (test,),
    )


def _ec4_beats_ec3(data: Data) -> Finding:
    tests, parts = [], []
    for task in ("two-armed-1", "two-armed-2"):
        test, text = _higher(data, task, "EC4", "EC3")
        tests.append(test)
        parts.append(text)
    return Finding(all(test.estimate > 0 for test in tests), "; ".join(parts), tuple(tests))


def _proficiency_rises(data: Data) -> Finding:
    tests, parts = [], []
    for task, conditions in (
        ("two-armed-1", ("EC2", "EC3", "EC4")),
        ("two-armed-2", ("EC3", "EC4")),
    ):
        runs = data.learned(task, conditions[0])
        rewards = data.rewards(task, conditions[0])
        initial = float(runs.initial_reward.iloc[0])
        tests.append(bootstrap_test(rewards, initial, seed=SEED))
        for lower, higher in itertools.pairwise(conditions):
            tests.append(_higher(data, task, higher, lower)[0])
        means = " < ".join(f"{c} {data.rewards(task, c).mean():.1f}" for c in conditions)
        parts.append(f"{task}: initial {initial:.0f} < {means}")
    return Finding(all(test.estimate > 0 for test in tests), "; ".join(parts), tuple(tests))


def _sequences_change(data: Data) -> Finding:
    tests, parts = [], []
    for task, pair in (("two-armed-1", ("EC2", "EC3")), ("two-armed-2", ("EC3", "EC4"))):
        counts = [Counter(data.learned(task, condition).hands) for condition in pair]
        hands = sorted(set(counts[0]) | set(counts[1]))
        table = np.array([[count[h] for h in hands] for count in counts])
        p = float(stats.fisher_exact(table).pvalue) if len(hands) > 1 else 1.0
        tests.append(
            Inference(
                float(np.abs(np.diff(table / table.sum(axis=1, keepdims=True), axis=0)).sum() / 2),
                tuple(int(n) for n in table.sum(axis=1)),
                "Fisher's exact test of hand sequences by condition",
                p=p,
            )
        )
        parts.append(
            f"{task}: " + ", ".join(f"{c} {_counts(n)}" for c, n in zip(pair, counts, strict=True))
        )
    return Finding(all(test.estimate > 0 for test in tests), "; ".join(parts), tuple(tests))


def _half_choose_rlrr(data: Data) -> Finding:
    counts = Counter(data.learned("two-armed-2", "EC3").hands)
    total = sum(counts.values())
    interval = stats.binomtest(counts["RLRR"], total).proportion_ci()
    narrow = interval.high - interval.low <= 0.3
    inside = interval.low <= 9 / 20 <= interval.high
    return Finding(
        None if inside and not narrow else inside,
        f"{_counts(counts)} of {total} runs: {counts['RLRR'] / total:.0%} [{interval.low:.0%}, "
        f"{interval.high:.0%}] choose RLRR (published 9 of 20)"
        + (
            "; the interval is too wide to tell a half from a fifth"
            if inside and not narrow
            else ""
        ),
    )


def _no_reversal(data: Data) -> Finding:
    parts, none = [], []
    for condition in ("EC2", "EC3"):
        cell = data.cell("two-armed-1", _LEARNER + condition)
        row = data.signature("two-armed-1", _LEARNER + condition, "base reversals", "base x")
        rightward = []
        for run in cell.runs:
            x = np.append(run.task.q0[0], run.configurations[:, 0])
            rightward.append(float((np.maximum.accumulate(x) - x).max()) <= REVERSAL)
        none.append(np.mean(rightward))
        parts.append(
            f"{condition}: {np.mean(rightward):.0%} of runs only move right; "
            f"{row['value']:.2f} reversals a run"
        )
    return Finding(bool(none[0] >= 0.95), "; ".join(parts))


def _resembles(cost: str) -> Callable[[Data], Finding]:
    """Whether learned postures are nearer to the plan of one smoothness cost."""

    def decide(data: Data) -> Finding:
        tests, parts = [], []
        for task in ("ascending", "descending"):
            learner = data.cell(task, f"{_LEARNER}EC1")
            if learner.initial is None:
                raise MissingError(f"the corrective process alone does not complete {task}")
            (plan,) = data.cell(task, f"trajectory-optimisation/{cost}").runs
            planned = plan.execution.configurations

            def apart(q: Array, planned: Array = planned) -> float:
                return float(np.linalg.norm(q - planned, axis=-1).mean())

            initial = apart(learner.initial.configurations)
            learned = [apart(run.execution.configurations) for run in learner.runs]
            tests.append(bootstrap_test(learned, initial, "less", seed=SEED))
            parts.append(f"{task} {initial:.2f} to {np.mean(learned):.2f}")
        return Finding(
            all(test.estimate < 0 for test in tests),
            "mean distance of the postures at the goals to the plan's, initial to learned: "
            + ", ".join(parts),
            tuple(tests),
        )

    return decide


def _less_experience(data: Data) -> Finding:
    parts, holds = [], True
    for task, condition in _BEST:
        data.runs(task, _LEARNER + condition)
        learner = data.methods[task, _LEARNER + condition]
        better, best = [], False
        for cost in ("path-length", *_SMOOTH):
            name = f"trajectory-optimisation/{cost}"
            data.runs(task, name)
            plan = data.methods[task, name]
            holds &= plan["trials"] == 0 and len(plan["told"]) > len(learner["told"])
            if plan["reward"] >= learner["reward"]:
                better.append(f"{cost} ({plan['told']})")
                best = best or cost == "path-length"
        parts.append(
            f"{task}: learner {learner['reward']:.1f} after {learner['trials']:.0f} trials, told "
            f"{learner['told']}; as good or better without any: {', '.join(better) or 'none'}"
        )
        holds &= best
    return Finding(holds, "; ".join(parts))


# What the paper does not compare.


def _to_the_optimum(data: Data) -> Finding:
    known, parts = optima(data.results), []
    for task, condition in CELLS:
        gap = mean(data.rewards(task, condition), seed=SEED)
        arm = "free" if condition in ("EC2", "EC4") else "still"
        best = known.get((task, arm))
        if best is None:
            raise MissingError(f"no optimum of {task} is known")
        left = Inference(
            best.reward - gap.estimate, gap.n, gap.method, best.reward - gap.high,
            best.reward - gap.low, gap.confidence,
        )  # fmt: skip
        parts.append(
            f"{task} {condition}: {_interval(left)} ticks from {best.reward} "
            f"({left.estimate / -best.reward:.1%})"
        )
    return Finding(None, "; ".join(parts))


def _experience(data: Data) -> Finding:
    frame = targets_frame(data.results)
    frame = frame[(frame.spend == "trials") & (frame.share == 0.05)]
    parts = []
    for task, condition in _BEST:
        shown = []
        for method in (_LEARNER + condition, "random-search/climbing", "cma-es/bandit"):
            data.runs(task, method)
            (row,) = frame[(frame.task == task) & (frame.method == method)].to_dict("records")
            median = "never" if math.isinf(row["median"]) else f"{row['median']:.0f} trials"
            shown.append(f"{method} {row['reached']}/{row['runs']}, median {median}")
        parts.append(f"{task}: " + ", ".join(shown))
    return Finding(None, "within 5 % of the optimum: " + "; ".join(parts))


def _shared_signatures(data: Data) -> Finding:
    parts = []
    for method in (
        f"{_LEARNER}EC1",
        "cma-es/bandit",
        "trajectory-optimisation/path-length",
        "trajectory-optimisation/jerk",
        "posture-based/one-goal",
        "nullspace-qp/next-goal",
        "corrective-alone/given",
    ):
        data.runs("descending", method)
        apart = data.signature("ascending", method, "context distance", "goal 1")["value"]
        first = data.signature("ascending", method, "first subtask against initial")["value"]
        total = data.signature("ascending", method, "total against initial")["value"]
        parts.append(f"{method} {apart:.2f} apart, first {first:+.1f}, total {total:+.1f} ticks")
    return Finding(
        None,
        "postures at goal 1 before different successors, and ticks against the initial solution "
        "(ascending): " + "; ".join(parts),
    )


def _higher(data: Data, task: str, higher: str, lower: str) -> tuple[Inference, str]:
    """Test that one condition's mean reward is higher, and what was seen."""
    a, b = data.rewards(task, higher), data.rewards(task, lower)
    test = bootstrap_test(a, b, seed=SEED)
    apart = difference_of_means(a, b, seed=SEED)
    better = probability_of_improvement(a, b, seed=SEED)
    return test, (
        f"{task}: {higher} − {lower} = {_interval(apart)}, P(improvement) {better.estimate:.2f} "
        f"[{better.low:.2f}, {better.high:.2f}]"
    )


def _interval(found: Inference) -> str:
    if math.isnan(found.low):
        return f"{found.estimate:.1f}"
    return f"{found.estimate:.1f} [{found.low:.1f}, {found.high:.1f}]"


def _counts(counts: dict[str, int]) -> str:
    ordered = sorted(counts.items(), key=lambda item: (-item[1], item[0]))
    return ", ".join(f"{hands} {count}" for hands, count in ordered)


_BOOTSTRAP = "one-tailed bootstrap test"

CLAIMS: tuple[Claim, ...] = (
    Claim(
        "learning-improves",
        "Learning improves on the initial solution, on every task and under every condition.",
        "Results, Exploration Conditions 1 to 4",
        f"{_BOOTSTRAP} of learned rewards against the initial reward, seven cells",
        _learning_improves,
    ),
    Claim(
        "first-movement-sacrificed",
        "The first movement gets worse than in the initial solution while the whole gets better.",
        "Results, Exploration Condition 1; Figure 5",
        f"{_BOOTSTRAP}s of the first movement's and of all ticks against the initial solution",
        _first_movement_sacrificed,
    ),
    Claim(
        "context",
        "The same first subtask is done differently in the ascending and the descending task.",
        "Results, Exploration Condition 1; Figure 5",
        "permutation test of context dependence at goal 1; seen where it exceeds 1 pooled SD",
        _context_matters,
    ),
    Claim(
        "ec2-sequences",
        "In two-armed task 1, condition 2 finds RRLR or stays with RRRR, nothing else.",
        "Results, Exploration Condition 2; Figure 6",
        "hand sequences found are just these two",
        _ec2_sequences,
    ),
    Claim(
        "ec3-alternates",
        "In two-armed task 1, condition 3 alternates hands (LRLR) in every run.",
        "Results, Exploration Condition 3; Figure 6",
        "every run has LRLR",
        _ec3_alternates,
    ),
    Claim(
        "ec3-beats-exhaustive",
        "Condition 3 is better than trying every hand sequence with the corrective process alone.",
        "Results, Exploration Condition 3",
        f"{_BOOTSTRAP} against the best corrective-only reward",
        _ec3_beats_exhaustive,
    ),
    Claim(
        "ec4-beats-ec3",
        "Moving the other arm as well is better: condition 4 beats condition 3 on both tasks.",
        "Results, Exploration Condition 4; Figure 8",
        f"{_BOOTSTRAP}s of two samples",
        _ec4_beats_ec3,
    ),
    Claim(
        "proficiency-rises",
        "Reward rises with the number of levels and joints that are explored.",
        "Results, Summary of Two-Armed Task Results; Figure 8",
        f"{_BOOTSTRAP}s of each condition against the next lower one and the initial solution",
        _proficiency_rises,
    ),
    Claim(
        "sequences-change",
        "The hand sequence changes as more is explored.",
        "Results, Summary of Two-Armed Task Results",
        "Fisher's exact tests of sequences: conditions 2 and 3 of task 1, 3 and 4 of task 2",
        _sequences_change,
    ),
    Claim(
        "half-choose-rlrr",
        "In two-armed task 2, about half the runs under condition 3 choose RLRR, not RRRR.",
        "Results, Exploration Condition 3; Figure 7",
        "exact binomial interval holds the published 9/20 and is no wider than 0.3",
        _half_choose_rlrr,
    ),
    Claim(
        "no-reversal",
        "In two-armed task 1 the learned base motion goes right only; the initial one reverses.",
        "Results, Exploration Condition 2; Figure 6",
        "at least 95 % of the runs under condition 2 never move the base left",
        _no_reversal,
    ),
    *(
        Claim(
            f"resembles-{cost}",
            f"Learned movements are similar to those planned for smoothness: {what}.",
            "Methods, The Learning Process",
            f"{_BOOTSTRAP}s: learned postures at the goals are nearer to the plan's than the "
            "initial ones are",
            _resembles(cost),
        )
        for cost, what in _SMOOTH.items()
    ),
    Claim(
        "less-experience",
        "Informed search needs less experience than learning by trial, and more information.",
        "Introduction; Discussion, Integrating Informed and Uninformed Search",
        "planners make no trial, are told more, and the best of them is at least as good",
        _less_experience,
    ),
    Claim(
        "distance-to-optimum",
        "How far the learner stays from the optimum.",
        "",
        "mean gap with BCa interval; the optimum is the condition's own (other arm free or still)",
        _to_the_optimum,
    ),
    Claim(
        "reward-by-experience",
        "What the learner gets from its trials, beside other uninformed search.",
        "",
        "trials to come within 5 % of the optimum, runs that never do counted as censored",
        _experience,
    ),
    Claim(
        "shared-signatures",
        "Which signatures of coarticulation informed and uninformed search share.",
        "",
        "context distance at goal 1 and the first movement's sacrifice, by method",
        _shared_signatures,
    ),
)


def claims_page(results: Results, judged: Sequence[Judged]) -> str:
    """The register as a Markdown page, every claim with its runs."""
    table = Table(
        "Claims",
        ("claim", "verdict", "evidence", "test", "adjusted p", "place"),
        tuple(
            (
                entry.claim.statement,
                entry.verdict,
                entry.evidence,
                entry.claim.test,
                _p_text(entry.p),
                entry.claim.place or "not in the paper",
            )
            for entry in judged
        ),
    )
    specification = results.manifest["specification"]
    tests = sum(not math.isnan(value) for entry in judged for value in entry.p)
    parts = [
        "# Claims",
        f"On suite `{specification['suite']}`, seed {specification['seed']}. {__doc__}",
        table.to_markdown(),
        f"p-values are Holm's, over {tests} tests; of several tests of one claim the largest is "
        "shown. Two-armed tasks are reconstructions (docs/model.md).",
        "## Runs",
        "\n".join(
            f"- {entry.claim.id}: {', '.join(entry.methods) or 'no test'}; "
            f"runs {', '.join(run[:8] for run in entry.run_ids) or 'none'}"
            for entry in judged
        ),
    ]
    return "\n\n".join(parts).replace(":mod:", "") + "\n"


def _p_text(values: Sequence[float]) -> str:
    known = [value for value in values if not math.isnan(value)]
    if not known:
        return "–"
    return f"{max(known):.2g}" + (f" (largest of {len(known)})" if len(known) > 1 else "")
