"""The learner against the others, pair by pair: what is gained and what it costs."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from analysis.comparisons.pairs import RUNS_FOR, PairRow
from analysis.comparisons.targets import SHARES
from analysis.markup import escaped
from analysis.report.document import Column, DataTable, RestsOn, Row, Value
from analysis.report.tables.common import finite, table, table_ids, with_interval
from analysis.words import typographic

if TYPE_CHECKING:
    from analysis.study import Study

_KINDS = ("conditions", "method", "variant")
_OPTIMUM: tuple[RestsOn, ...] = ("runs", "optimum")


def pairwise_table(study: Study, task: str) -> DataTable | None:
    """The learner against the others on one task: differences, tests, effect sizes."""
    return _pairs(
        study,
        task,
        "compared",
        f"The learner against the others on {escaped(task)}.",
        _DIFFERENCES,
        "Difference: mean reward of the first less the second's, with its 95 % BCa interval; "
        "runs: of each, with a solution. One-tailed: the paper's bootstrap test in the direction "
        "expected before looking; two-tailed: permutation test. Holm's correction is over the "
        "rows of this table, each kind of test for itself.",
    )


def cost_table(study: Study, task: str) -> DataTable | None:
    """The same pairs: what the second spends and is told, and how many runs it would take."""
    best = study.optima.get((task, "free"))
    ticks = ", ".join(f"{abs(share * best.reward):.1f}" for share in SHARES) if best else ""
    return _pairs(
        study,
        task,
        "costs",
        f"Reward per unit of experience, computation and information on {escaped(task)}.",
        _COSTS,
        "×: what the second spends in a run over what the first spends, medians of whole runs; "
        "0 where the second spends nothing, and no number where the first does not. Evaluations: "
        "forward kinematics and Jacobians; solve time is wall time of this machine. Told more, "
        "less: letters as in the tables of all methods. Runs: of each, to find a difference of so "
        f"much of the optimum{f' ({ticks} ticks)' if ticks else ''} with power 80 %, one-tailed "
        "at 5 %; smallest: what these runs find so, 0 without spread.",
    )


def reading_of_pairs(study: Study) -> tuple[str, ...]:
    """Who is compared with whom, and what the numbers of the tables do not say."""
    return (
        "Who is compared with whom, and the direction of the one-tailed test, follows from what "
        "the methods are and are told, not from their rewards: more exploration is expected to be "
        "better (as the paper says), so is being told what the learner is not told; a method that "
        "is told the same or less is expected to be worse than the learner. On two-armed tasks "
        "methods are compared with the condition that explores most, EC4, and those that keep "
        "still the arm that is not chosen with EC3 as well, which does so too; variants of a "
        "condition with that condition.",
        "BCa intervals are too short by some points for 20 runs, and not adjusted for the number "
        "of rows. Every method gets the same seed for the same task and run, and the interval is "
        f"that of the pairs.{_pairing(study)}",
        "A deterministic method has one run and no spread: its reward is taken as known, and all "
        "uncertainty is the learner's. A method with one run counts as deterministic where the "
        "learner has more.",
        "Who is higher, lower or not told apart is said by the two-tailed test at 5 %, adjusted "
        "by Holm over all rows of the task; each kind of test is adjusted for itself.",
        "A one-tailed p near 1 speaks for the contrary of what was expected. Tests are of "
        "independent samples; against a known reward the two-tailed one is by the signs of the "
        "differences to it, which takes them as symmetric. Pairs that are positively correlated "
        "make both tests cautious, negatively correlated ones bold.",
        "δ: Cliff's delta, P(first higher) less P(second higher), −1 to 1. P(first higher) counts "
        "ties half. Where the runs do not overlap their interval is Newcombe's.",
        "Runs needed are of the first alone where the second is deterministic; they take rewards "
        "as normal, and correct for nothing. SDs of runs that settle on few levels are "
        "themselves uncertain.",
    )


def _pairing(study: Study) -> str:
    """What sharing seeds does to these runs."""
    known = [row for row in study.pair_rows if row.pairs and finite(row.correlation) is not None]
    parts = []
    for of_variants, text in ((True, "variants of one condition"), (False, "other pairs")):
        rows = [row for row in known if (row.kind == "variant") == of_variants]
        if rows:
            paired, alone = (
                np.array([getattr(row, f"{of}high") - getattr(row, f"{of}low") for row in rows])
                for of in ("", "independent_")
            )
            median = np.median([row.correlation for row in rows])
            correlation = typographic(f"{median:.2f}")
            parts.append(
                f"{text} correlate by {correlation} (median of {len(rows)}), their "
                f"intervals are {np.nanmedian(paired / alone):.2f} times as wide as unpaired ones"
            )
    if not parts:
        return ""
    return (
        " A shared seed gives the same random numbers, which methods that draw them differently "
        "put to different use, so that it pairs little but variants of the learner: here "
        f"{', '.join(parts)}. The paper's design is unpaired, and so are the tests."
    )


_number = partial(Column, kind="number", rests_on=("runs",))
_p = partial(Column, kind="p", digits=4, rests_on=("runs",))
_holm = partial(_p, family="all rows of the table, over which Holm adjusts")
_unprinted = partial(_number, printed=False)
_NAMES = Column("first", "first"), Column("second", "second")
_DIFFERENCES = (
    *_NAMES,
    _unprinted("n_first", "runs of first"),
    _unprinted("n_second", "of second"),
    _number("difference", "difference", unit="ticks", digits=1),
    Column("expected", "first expected", printed=False),
    _p("p_bootstrap", "one-tailed p", printed=False),
    _holm("p_bootstrap_holm", "one-tailed p, Holm", printed=False),
    _p("p_permutation", "two-tailed p", printed=False),
    _holm("p_permutation_holm", "two-tailed p, Holm"),
    _unprinted("delta", "Cliff's δ", digits=2),
    _number("improvement", "P(first higher)", digits=2),
)
_ENDS = {
    "difference": ("low", "high"),
    "delta": ("delta_low", "delta_high"),
    "improvement": ("improvement_low", "improvement_high"),
}
"""Fields of a pair with the ends of their intervals, which :data:`_DIFFERENCES` show."""
_COSTS = (
    *_NAMES,
    _number("difference", "difference", unit="ticks", digits=1),
    _number("trials", "trials", unit="×"),
    _unprinted("movement_ticks", "ticks", unit="×"),
    _number("evaluations", "evaluations", unit="×"),
    _number("solve_s", "solve time", unit="×"),
    Column("told_more", "told more"),
    Column("told_less", "told less"),
    _unprinted("sd_first", "SD of first", unit="ticks", digits=1),
    _unprinted("sd_second", "of second", unit="ticks", digits=1),
    *(
        _number(
            name,
            f"runs for {100 * share:.0f} %",
            digits=0,
            rests_on=_OPTIMUM,
            printed=share == min(SHARES),
        )
        for name, share in RUNS_FOR.items()
    ),
    _unprinted("smallest", "smallest found", unit="ticks", digits=1),
    _unprinted("smallest_share", "of the optimum", kind="share", digits=1, rests_on=_OPTIMUM),
)


def _pairs(
    study: Study, task: str, name: str, caption: str, columns: tuple[Column, ...], note: str
) -> DataTable | None:
    """Conditions, methods, variants; of each the best second first."""
    pairs = sorted(
        (row for row in study.pair_rows if row.task == task),
        key=lambda row: (_KINDS.index(row.kind), row.first, -_or_least(row.mean_second)),
    )
    ends = _ENDS if columns is _DIFFERENCES else {}
    rows = [
        Row(
            f"{pair.first} - {pair.second}",
            tuple(_value(pair, column.name, ends.get(column.name)) for column in columns),
            ((task, pair.first), (task, pair.second)),
        )
        for pair in pairs
    ]
    failed = escaped(", ".join(_failed(pairs)))
    notes = (note, f"Runs without a solution are left out: {failed}.") if failed else (note,)
    return table(f"{name}-{table_ids(study)[task]}", caption, columns, rows, notes)


def _value(pair: PairRow, name: str, ends: tuple[str, str] | None) -> Value:
    """A field, with its interval where that has fields of its own; counts stay whole."""
    value = getattr(pair, name)
    if ends is not None:
        return with_interval(value, *(getattr(pair, end) for end in ends))
    if isinstance(value, str):
        return value or None
    return value if isinstance(value, int) else finite(value)


def _failed(pairs: list[PairRow]) -> Iterator[str]:
    """Methods with runs that have no solution, each once."""
    found = {pair.first: (pair.n_first, pair.runs_first) for pair in pairs}
    found |= {pair.second: (pair.n_second, pair.runs_second) for pair in pairs}
    return (f"{name} solved {n} of {runs}" for name, (n, runs) in found.items() if n < runs)


def _or_least(value: float) -> float:
    return float("-inf") if np.isnan(value) else value
