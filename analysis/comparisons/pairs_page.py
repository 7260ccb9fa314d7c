"""The page of comparisons: methods against each other by task, and over all tasks."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import pandas as pd

from analysis.comparisons.frontier import SHARES
from analysis.comparisons.overall import NEAR, everywhere
from analysis.markup import code, escaped
from analysis.page import Heading, Part, page
from analysis.statistics.estimates import LEVEL, RESAMPLES, Inference
from analysis.table import NONE, Table, interval, short
from coartic.record import SEARCH

if TYPE_CHECKING:
    from analysis.study import Study

_KINDS = {"conditions": 0, "method": 1, "variant": 2}


def comparisons_page(
    study: Study, pairs: pd.DataFrame, overall: pd.DataFrame, scores: pd.DataFrame
) -> str:
    """Markdown of :func:`analysis.comparisons.pairs.pairwise_frame` and
    ``overall_frame``; ``scores`` is what the latter was made of."""
    specification = study.results.manifest.specification
    parts: list[Part] = [
        Heading(1, "Methods against each other"),
        f"On suite {code(specification.suite)}, seed {specification.seed}. Numbers and more "
        "of them: `comparisons.csv`, `across_tasks.csv`, `profiles.csv` (docs/statistics.md).",
    ]
    if len(pairs):
        parts.append(list(_notes(pairs)))
    else:
        parts.append("The folder has no runs of the learner under a condition of the paper.")
    for name, rows in pairs.groupby("task", sort=False):
        mark = " †" if study.results.tasks[str(name)].reconstructed else ""
        parts.append(Heading(2, f"{name}{mark}"))
        parts.append(list(_summary(rows)))
        order = rows.assign(by=rows.kind.map(_KINDS)).sort_values(
            ["by", "first", "mean_second"], ascending=[True, False, False], kind="stable"
        )
        best = study.optima.get((str(name), "free"))
        for table in (
            _inference_table(order),
            _spending_table(order),
            _sizes_table(order, best.reward if best else None),
        ):
            parts += [Heading(3, table.title), table]
    return page([*parts, Heading(2, "Across tasks"), *_across(overall, scores)])


def _notes(pairs: pd.DataFrame) -> Iterator[str]:
    yield (
        "Who is compared with whom, and the direction of the one-tailed test, follows from what "
        "the methods are and are told, not from their rewards: more exploration is expected to be "
        "better (as the paper says), so is being told what the learner is not told; a method that "
        "is told the same or less is expected to be worse than the learner. On two-armed tasks "
        "methods are compared with the condition that explores most, EC4, and those that keep "
        "still the arm that is not chosen with EC3 as well, which does so too; variants of a "
        "condition with that condition."
    )
    yield (
        "Difference: mean reward of the first less the second's, ticks, of runs with a solution, "
        "with its 95 % BCa interval (too short by some points for 20 runs, and not adjusted for "
        "the number of rows). Every method gets the same seed for the same task and run, and "
        "the interval is that of the pairs." + _pairing(pairs)
    )
    yield (
        "A deterministic method has one run and no spread: its reward is taken as known (n = 1), "
        "and all uncertainty is the learner's. A method with one run counts as deterministic "
        "where the learner has more."
    )
    yield (
        "One-tailed p: the paper's kind of test, a bootstrap test of independent samples, in the "
        "direction expected of the first; p near 1 speaks for the contrary. Two-tailed p: "
        "permutation test of independent samples; against a known reward by the signs of the "
        "differences to it, which takes them as symmetric. In brackets adjusted by Holm over all "
        "rows of the task, each kind of test for itself; the lists below are by the two-tailed "
        "test at 5 %, adjusted. Pairs that are positively correlated "
        "make both tests cautious, negatively correlated ones bold."
    )
    yield (
        "δ: Cliff's delta, P(first higher) less P(second higher), −1 to 1. P(first higher) counts "
        "ties half. Where the runs do not overlap their interval is Newcombe's."
    )
    yield (
        "What is spent: the second's median over the first's, of whole runs; *none*: the second "
        "spends nothing of it. Evaluations: forward kinematics and Jacobians. Solve time is wall "
        "time of this machine. Told: kinds of information (letters as in `comparison.md`) that "
        "only the second (+) or only the first (−) gets."
    )
    yield (
        "Runs needed: of each method (of the first alone where the second is deterministic), to "
        "find a difference of so much of the optimum with power 80 % at these SDs, one-tailed at "
        "5 %, normal rewards, no correction. The smallest difference is what the runs at hand "
        "find so. SDs of runs that settle on few levels are themselves uncertain."
    )


def _pairing(pairs: pd.DataFrame) -> str:
    """What sharing seeds does to these runs."""
    known = pairs[(pairs.pairs > 0) & pairs.correlation.notna()]
    if not len(known):
        return ""
    parts = []
    for kind, text in (("variant", "variants of one condition"), ("", "other pairs")):
        rows = known[(known.kind == "variant") == (kind == "variant")]
        wide = (rows.high - rows.low) / (rows.independent_high - rows.independent_low)
        if len(rows):
            parts.append(
                f"{text} correlate by {rows.correlation.median():.2f} (median of {len(rows)}) "
                f"and their intervals are {wide.median():.2f} times as wide as without pairing"
            )
    return (
        " A shared seed gives the same random numbers, which methods that draw them differently "
        "put to different use, so that it pairs little but variants of the learner: here "
        + ", ".join(parts)
        + ". The paper's design is unpaired, and so are the tests."
    )


def _summary(rows: pd.DataFrame) -> Iterator[str]:
    """What the two-tailed tests tell apart, for each condition."""
    tested = rows[rows.p_permutation.notna()]
    least = min(map(_least_p, tested.to_dict("records")), default=0.0) * len(tested)
    if least > LEVEL:
        yield (
            f"**Too few runs to tell anything apart: {len(tested)} permutation tests of so many "
            f"runs have an adjusted p of {min(least, 1.0):.2g} at least.**"
        )
    for (kind, first), own in rows.groupby(["kind", "first"], sort=False):
        told: dict[str, list[str]] = {
            "higher than": [],
            "lower than": [],
            "not told apart from": [],
        }
        untested = []
        for row in own.to_dict("records"):
            p = row["p_permutation_holm"]
            if math.isnan(p):
                untested.append(row["second"])
                continue
            apart = "higher than" if row["difference"] > 0 else "lower than"
            told[apart if p < LEVEL else "not told apart from"].append(row["second"])
        parts = [f"{name} {', '.join(others)}" for name, others in told.items() if others]
        if untested:
            parts.append(f"not tested (too few runs) against {', '.join(untested)}")
        what = {"conditions": "other conditions", "variant": "its variants", "method": "methods"}
        yield escaped(f"{first} and {what[str(kind)]}: {'; '.join(parts)}.")


def _inference_table(rows: pd.DataFrame) -> Table:
    return Table(
        "Differences",
        (
            "first",
            "second",
            "n",
            "difference",
            "expected",
            "one-tailed p (Holm)",
            "two-tailed p (Holm)",
            "δ",
            "P(first higher)",
        ),
        tuple(
            (
                row["first"],
                row["second"],
                f"{_n(row, 'first')}, {_n(row, 'second')}",
                _difference(row),
                row["expected"],
                _p(row, "p_bootstrap"),
                _p(row, "p_permutation"),
                _of(row, "delta", _sizes(row), "+z.2f"),
                _of(row, "improvement", _sizes(row), "z.2f"),
            )
            for row in rows.to_dict("records")
        ),
    )


def _spending_table(rows: pd.DataFrame) -> Table:
    return Table(
        "What the second spends and is told, beside the first",
        (
            "first",
            "second",
            "difference",
            "trials",
            "control ticks",
            "evaluations",
            "solve time",
            "told",
        ),
        tuple(
            (
                row["first"],
                row["second"],
                _difference(row),
                *(
                    _ratio(row[name])
                    for name in ("trials", "movement_ticks", "evaluations", "solve_s")
                ),
                " ".join(
                    sign + row[name]
                    for sign, name in (("+", "told_more"), ("−", "told_less"))
                    if row[name]
                )
                or "the same",
            )
            for row in rows.to_dict("records")
        ),
    )


def _sizes_table(rows: pd.DataFrame, optimum: int | None) -> Table:
    def share(of: float) -> str:
        ticks = f": {of * -optimum:.1f}" if optimum is not None else ""
        return f"runs for {of:.0%}{ticks}"

    return Table(
        "Runs that a difference needs",
        ("first", "second", "SDs", *map(share, SHARES), "smallest difference found"),
        tuple(
            (
                row["first"],
                row["second"],
                ", ".join(
                    NONE if math.isnan(row[name]) else f"{row[name]:.1f}"
                    for name in ("sd_first", "sd_second")
                ),
                *(
                    NONE if math.isnan(runs) else f"{runs:.0f}"
                    for runs in (row["runs_5"], row["runs_2"], row["runs_1"])
                ),
                _smallest(row),
            )
            for row in rows.to_dict("records")
        ),
    )


def _across(overall: pd.DataFrame, scores: pd.DataFrame) -> Iterator[Part]:
    tasks = list(dict.fromkeys(scores.task))
    if len(tasks) < 2:
        known = escaped(", ".join(tasks)) or "none"
        yield f"Needs at least two tasks with known optimum and initial solution; here: {known}."
        return
    if not len(overall):
        yield f"No method ran on all of {escaped(', '.join(tasks))}, the optimum's searches aside."
        return
    yield (
        f"On {escaped(', '.join(tasks))}, each counting the same. Score: 0 the initial solution, "
        "1 the optimum with all joints free; interquartile mean. Gap: mean share of the optimum. "
        "Within: share of runs whose gap is at most so much. 95 % intervals: runs resampled "
        "within tasks (other runs, not other tasks); none for methods that are run once, and none "
        "where the runs of each task all reach a gap or none does. *dual-process (EC1, EC4)*: EC1 "
        "on one-armed tasks, EC4 on two-armed ones; likewise EC3, and variants."
    )
    near = [f"within_{share:.0%}".rstrip("%") for share in NEAR]
    yield Table(
        "Across tasks",
        ("method", "runs", "score", "gap", *(f"within {share:.0%}" for share in NEAR)),
        tuple(
            (
                row["method"],
                f"{row['runs']}" + (f" ({row['failed']} failed)" if row["failed"] else ""),
                _of(row, "score", (row["runs"],), "z.2f"),
                _of(row, "gap", (row["runs"],), ".1%"),
                *(_of(row, name, (row["runs"],), ".0%") for name in near),
            )
            for row in overall.to_dict("records")
        ),
    )
    left = [name for name in dict.fromkeys(scores.method) if name not in everywhere(scores)]
    left = [name for name in left if not name.startswith(SEARCH)]
    if left:
        yield f"Not run on all of these tasks: {escaped(', '.join(left))}."


def _least_p(row: Mapping[Any, Any]) -> float:
    """Smallest p of the two-tailed permutation test of so many runs."""
    n, m = row["n_first"], row["n_second"]
    orders = 2**n if row["interval"] == "against a known value" else math.comb(n + m, n)
    return 2 / min(orders, RESAMPLES + 1)


def _difference(row: Mapping[Any, Any]) -> str:
    paired = row["interval"] == "paired by seed"
    return _of(row, "difference", (row["pairs"],) if paired else _sizes(row), "+z.1f", "")


def _sizes(row: Mapping[Any, Any]) -> tuple[int, ...]:
    if row["interval"] == "against a known value":
        return (row["n_first"],)
    return row["n_first"], row["n_second"]


def _of(
    row: Mapping[Any, Any],
    name: str,
    n: tuple[int, ...],
    style: str,
    prefix: str | None = None,
) -> str:
    """A column with its interval; a dash where it is missing."""
    if math.isnan(row[name]):
        return NONE
    prefix = f"{name}_" if prefix is None else prefix
    return interval(Inference(row[name], n, "", row[f"{prefix}low"], row[f"{prefix}high"]), style)


def _n(row: Mapping[Any, Any], which: str) -> str:
    runs, solved = row[f"runs_{which}"], row[f"n_{which}"]
    return f"{solved}" if solved == runs else f"{solved} of {runs}"


def _p(row: Mapping[Any, Any], name: str) -> str:
    if math.isnan(row[name]):
        return NONE
    return f"{row[name]:.2g} ({row[f'{name}_holm']:.2g})"


def _ratio(value: float) -> str:
    if math.isnan(value):
        return NONE
    return f"× {short(value)}" if value else "none"


def _smallest(row: Mapping[Any, Any]) -> str:
    if math.isnan(row["smallest"]):
        return NONE
    if row["smallest"] == 0:
        return "no spread"
    share = row["smallest_share"]
    return f"{row['smallest']:.1f}" + ("" if math.isnan(share) else f" ({share:.1%})")
