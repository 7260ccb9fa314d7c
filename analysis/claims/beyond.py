"""Comparisons that the paper does not make: measured, not judged."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from analysis.claims.coarticulation import prepared_by_waiting
from analysis.claims.data import (
    ASCENDING,
    BEST,
    CELLS,
    DESCENDING,
    ONE,
    SMOOTH,
    UNINFORMED,
    Data,
    MissingError,
    rewards_of,
)
from analysis.claims.judges.resemblance import CRITERION, TEST, resembles
from analysis.claims.one_armed import CONTROLS, context_distance, sacrifice
from analysis.claims.register import Claim, Finding
from analysis.comparisons.methods import LEARNER, TOLD
from analysis.published import published_cell
from analysis.results.optima import METHODS as OPTIMUM
from analysis.statistics.equivalence import MARGIN, difference
from analysis.statistics.estimates import LEVEL, SEED, Inference, difference_of_means, mean
from analysis.table import NONE, Table, interval, short
from coartic.method import Information

_TASKS = tuple(task for task, _ in BEST)
NEAR = 0.05
"""Share of the optimum within which a run has come near it."""


def _labels(data: Data, wanted: Callable[[str], bool]) -> list[str]:
    """Labels whose row of the methods' table on any task is wanted, in the order of the plan."""
    return list(
        dict.fromkeys(
            label
            for task, label in data.study.cells
            if task in _TASKS
            and not label.startswith(OPTIMUM)
            and wanted(data.study.method_rows[task, label].told)
        )
    )


def _by_task(data: Data, labels: list[str], what: str, cell: Callable[[str, str], str]) -> Table:
    """A row per method: what it is told, and a column per task; a dash where it has no runs."""
    rows = []
    for label in labels:
        shown, told = [], ""
        for task in _TASKS:
            try:
                data.runs(task, label)
            except MissingError:
                shown.append(NONE)
            else:
                shown.append(cell(task, label))
                told = data.study.method_rows[task, label].told
        if set(shown) != {NONE}:
            rows.append((label, told, *shown))
    return Table(what, ("method", "told", *_TASKS), tuple(rows))


def _uninformed(told: str) -> bool:
    return TOLD[Information.REWARD_BY_TRIAL] in told and set(told) <= UNINFORMED


def _experience(data: Data) -> Finding:
    # Methods that keep the other arm still, to the optimum with it still.
    reached = {
        (row["task"], row["method"]): row
        for row in data.study.targets.query("spend == 'trials' and share == @NEAR").to_dict(
            "records"
        )
    }

    def cell(task: str, label: str) -> str:
        row = reached.get((task, label))
        if row is None:
            return NONE
        median = "never" if math.isinf(row["median"]) else f"{row['median']:.0f}"
        reward = data.study.method_rows[task, label].reward
        return f"{row['reached']}/{row['runs']}, {median} ({reward:.1f})"

    for task, condition in BEST:
        data.runs(task, LEARNER + condition)
    table = _by_task(data, _labels(data, _uninformed), "Experience", cell)
    return Finding(
        None,
        f"runs within {NEAR:.0%} of the optimum (of that with the other arm still, for methods "
        "that keep it so), median trials until then, and in brackets the mean reward at the end; "
        "every method that is told no more than the learner",
        table=table,
    )


def _computation(data: Data) -> Finding:
    for task, condition in BEST:
        data.runs(task, LEARNER + condition)

    def cell(task: str, label: str) -> str:
        row = data.study.method_rows[task, label]
        spent = row.evaluations
        each = f", {short(spent / row.trials)} a trial" if row.trials > 1 else ""
        return f"{short(spent)}{each} ({row.reward:.1f})"

    uninformed = _labels(data, _uninformed)
    informed = [
        label
        for label in _labels(data, lambda told: not _uninformed(told))
        if " " not in label and not label.startswith(LEARNER)
    ]
    table = _by_task(data, [*uninformed, *informed], "Computation", cell)
    return Finding(
        None,
        "evaluations of forward kinematics and Jacobian in a run (median), and per trial; in "
        "brackets the mean reward they buy; letters of what is told: docs/methods.md. First "
        "methods that are told no more than the learner, then informed search in its default form",
        table=table,
    )


def _as_printed(data: Data) -> Finding:
    rows, verdicts = [], []
    for task, condition in CELLS:
        printed = published_cell(task, condition)
        assert printed is not None
        groups: list[tuple[str, Any, str | None]] = [("all", printed.summary, None)]
        if len(printed.sequences) > 1:
            groups += [(s.hands, s.summary, s.hands) for s in printed.sequences]
        for name, summary, hands in groups:
            own = rewards_of(data.learned(task, condition, hands))
            if summary is None or not len(own):
                continue
            apart = difference(own, summary)
            known = not math.isnan(apart.low)
            rows.append(
                (
                    task, condition, name, f"{summary.mean:.1f} ({summary.runs})",
                    f"{own.mean():.1f} ({len(own)})", interval(apart, "+.1f"),
                    f"{apart.estimate / -summary.mean:+.1%}", apart.verdict if known else NONE,
                )
            )  # fmt: skip
            if hands is None:
                verdicts.append(f"{task} {condition} {apart.verdict if known else NONE}")
    columns = (
        "task", "condition", "hands", "printed (runs)", "ours (runs)", "difference",
        "share of the printed", f"within ± {MARGIN:.0%}",
    )  # fmt: skip
    table = Table("Learned rewards as printed", columns, tuple(rows))
    return Finding(None, "; ".join(verdicts), table=table)


def _to_the_optimum(data: Data) -> Finding:
    known, rows = data.study.optima, []
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
        share = f"{left.estimate / -best.reward:.1%}"
        rows.append((task, condition, str(best.reward), interval(left), share))
    columns = ("task", "condition", "optimum", "ticks from it", "share")
    return Finding(
        None,
        "; ".join(f"{task} {condition} {share}" for task, condition, _, _, share in rows),
        table=Table("Distance to the optimum", columns, tuple(rows)),
    )


def _proposals(data: Data) -> Finding:
    rows = []
    for task, condition in BEST:
        own = data.rewards(task, condition)
        for variant, what in (
            ("nullspace", "secondary objective in the corrective process's nullspace"),
            ("biased", "noise biased towards the corrective process's suggestion"),
        ):
            other = rewards_of(data.learned(task, f"{condition}-{variant}"))
            apart = difference_of_means(other, own, seed=SEED)
            rows.append((task, condition, what, interval(apart)))
    return Finding(
        None,
        "; ".join(f"{task} {what.split()[0]} {apart}" for task, _, what, apart in rows),
        table=Table("Proposals", ("task", "condition", "change", "gain in reward"), tuple(rows)),
    )


def _absent_without_looking_ahead(data: Data) -> Finding:
    parts = []
    for method in (f"{LEARNER}EC1", *CONTROLS):
        apart, change = context_distance(data, method), sacrifice(data, method)
        if apart is None or change is None:
            raise MissingError(f"this folder lacks runs of {method} on ascending and descending")
        parts.append(
            f"{method}: postures at goal 1 {apart:.2f} apart, first movement {change[0]:+.1f} and "
            f"all {change[1]:+.1f} ticks against the initial solution"
        )
    return Finding(None, "; ".join(parts))


REPRESENTATIVES = (
    ("learner", f"{LEARNER}EC1", f"{LEARNER}EC4"),
    ("CMA-ES", "cma-es/bandit", "cma-es/bandit"),
    (
        "shortest path",
        "trajectory-optimisation/path-length",
        "trajectory-optimisation/path-length",
    ),
    (
        "least squared changes",
        "trajectory-optimisation/squared-changes",
        "trajectory-optimisation/squared-changes",
    ),
    ("least jerk", "trajectory-optimisation/jerk", "trajectory-optimisation/jerk"),
    (
        "two-goal planning",
        "posture-based/two-goals",
        "posture-based/two-goals hands=every, other_arm=free",
    ),
    (
        "one-goal planning",
        "posture-based/one-goal",
        "posture-based/one-goal hands=every, other_arm=free",
    ),
    ("nullspace control", "nullspace-qp/next-goal", "nullspace-qp/next-goal"),
    ("corrective alone", "corrective-alone/given", "corrective-alone/every"),
)
"""Name, label on the one-armed tasks, label on the two-armed ones."""
STEP_APART = 0.1
"""Ten steps of movement: postures (length unit, rad) or shares of a way this far apart count."""
TURN_APART = 0.05
"""Turning angles this far apart count, rad."""
PRESENCE = (
    "presence: *context*, mean postures at goal 1 of the ascending and the descending task "
    "lie more than 0.1 apart (ten steps), with p < 5 % where there are several runs; "
    "*sacrifice*, most runs sacrifice the first subtask of the ascending task (Wilson's interval "
    "lies above one half, where there are several), shown are the mean ticks of the first "
    "movement and of all against the corrective process with the same hands; "
    "*motor-equivalent*, context is present and its motor-equivalent part (per root of dimension) "
    "exceeds the other; *preshaping*, on two-armed task 1 the waiting arm brings its hand nearer "
    "to its next goal, since its own last hit, by more than 0.1 of the initial distance, mean "
    "over goals and runs; *lead*, the contexts are "
    "distinguishable before goal 1 is hit; *turning*, the turning angles of the ascending task "
    "sum to at least 0.05 rad less than the initial solution's. A dash: cannot be said of the "
    "runs in this folder, and not judged where that is so of every method"
)


def _shared_signatures(data: Data) -> Finding:
    data.runs(ASCENDING, f"{LEARNER}EC1")
    data.runs(DESCENDING, f"{LEARNER}EC1")
    rows = []
    for name, one, two in REPRESENTATIVES:
        shown = (
            _context(data, one), _sacrifice(data, one), _equivalence(data, one),
            _preshaping(data, two), _lead(data, one), _turning(data, one),
        )  # fmt: skip
        if set(shown) != {NONE}:
            rows.append((name, _reward(data, one), *shown))
    columns = (
        "method", "reward (ascending)", "context", "sacrifice (first, all)", "motor-equivalent",
        "preshaping", "lead", "turning",
    )  # fmt: skip
    present = (
        f"{column}: {_present([(row[0], row[k]) for row in rows])}"
        for k, column in enumerate(columns[2:], 2)
    )
    table = Table("Signatures", columns, tuple(rows))
    return Finding(None, "; ".join(present), table=table)


def _present(shown: list[tuple[str, str]]) -> str:
    """Methods that show a signature."""
    if all(cell == NONE for _, cell in shown):
        return "not judged"
    return ", ".join(name for name, cell in shown if cell.startswith("yes")) or "none"


def _reward(data: Data, label: str) -> str:
    try:
        return f"{rewards_of(data.runs(ASCENDING, label)).mean():.1f}"
    except MissingError:
        return NONE


def _said(present: bool, numbers: str) -> str:
    return f"{'yes' if present else 'no'}, {numbers}"


def _context_present(data: Data, label: str) -> tuple[bool, float] | None:
    apart = context_distance(data, label)
    if apart is None:
        return None
    try:
        p = data.signature(ASCENDING, label, "context dependence", 1).p
    except MissingError:
        p = math.nan
    return apart > STEP_APART and not p >= LEVEL, apart


def _context(data: Data, label: str) -> str:
    found = _context_present(data, label)
    return NONE if found is None else _said(found[0], f"{found[1]:.2f}")


def _sacrifice(data: Data, label: str) -> str:
    try:
        runs = data.signature(ASCENDING, label, "first subtask sacrificed")
    except MissingError:
        return NONE
    ticks = sacrifice(data, label)
    assert ticks is not None
    low = runs.value if math.isnan(runs.low) else runs.low
    return _said(low > 0.5, f"{ticks[0]:+.1f}, {ticks[1]:+.1f}")


def _equivalence(data: Data, label: str) -> str:
    found = _context_present(data, label)
    if found is None:
        return NONE
    same, other = (
        data.signature(ASCENDING, label, name, 1).value
        for name in ("motor-equivalent part", "non-motor-equivalent part")
    )
    return _said(found[0] and same > other, f"{same:.3f} and {other:.3f}")


def _preshaping(data: Data, label: str) -> str:
    try:
        own = prepared_by_waiting(data.cell(ONE, label))
    except MissingError:
        return NONE
    return _said(own.mean() > STEP_APART, f"{own.mean():+.2f}") if len(own) else NONE


def _lead(data: Data, label: str) -> str:
    try:
        data.runs(ASCENDING, label)
        several = len(data.runs(DESCENDING, label)) > 1
        lead = data.signature(ASCENDING, label, "lead time", 1)
    except MissingError:
        return "no" if context_distance(data, label) is not None and several else NONE
    return _said(lead.value > 0, f"{lead.value:.0f} ticks")


def _turning(data: Data, label: str) -> str:
    try:
        own, initial = (
            sum(data.signature(ASCENDING, name, "turning angle", goal).value for goal in (1, 2))
            for name in (label, "corrective-alone/given")
        )
    except MissingError:
        return NONE
    return _said(own <= initial - TURN_APART, f"{own:.2f} rad")


BEYOND: tuple[Claim, ...] = (
    Claim(
        "learned-rewards-as-printed",
        "How far the learned rewards agree with those that the paper prints.",
        "Beyond the paper",
        f"95 % interval of the difference of means (Welch's) within ± {MARGIN:.0%} of the printed "
        "reward: equivalent, outside: different. EC2 is printed by hand sequence, from which the "
        "mean over all its runs follows",
        _as_printed,
    ),
    Claim(
        "absent-without-looking-ahead",
        "Dependence on context and the sacrifice of the first movement, in methods that do not "
        "look beyond the current goal. (The paper calls the reward for the whole task crucial; no "
        "learner here is rewarded for each subtask instead.)",
        "Beyond the paper",
        "context distance at goal 1, and ticks against the initial solution (ascending)",
        _absent_without_looking_ahead,
    ),
    *(
        Claim(
            f"resembles-{cost}",
            f"Learned movements beside those planned for {what}: whether {CRITERION}.",
            "Beyond the paper",
            TEST,
            resembles(cost),
        )
        for cost, what in SMOOTH.items()
        if cost != "squared-changes"
    ),
    Claim(
        "distance-to-optimum",
        "How far the learner stays from the optimum.",
        "Beyond the paper",
        "mean gap with BCa interval; the optimum is the condition's own (other arm free or still)",
        _to_the_optimum,
    ),
    Claim(
        "reward-by-experience",
        "What uninformed search gets from its trials.",
        "Beyond the paper",
        f"trials to come within {NEAR:.0%} of the optimum: Kaplan-Meier median, runs that never "
        "do counted as censored",
        _experience,
    ),
    Claim(
        "computation",
        "How much each method evaluates.",
        "Beyond the paper",
        "forward kinematics and Jacobians",
        _computation,
    ),
    Claim(
        "proposals",
        "What the paper's proposals for the learner gain.",
        "Beyond the paper",
        "difference of mean learned rewards with BCa interval",
        _proposals,
    ),
    Claim(
        "shared-signatures",
        "Which signatures of coarticulation informed and uninformed search share.",
        "Beyond the paper",
        PRESENCE,
        _shared_signatures,
    ),
)
