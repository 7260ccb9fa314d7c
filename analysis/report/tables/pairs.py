"""The learner against the others, pair by pair: what is gained and what it costs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np

from analysis.comparisons.pairs import PairRow
from analysis.comparisons.targets import SHARES
from analysis.markup import escaped
from analysis.report.document import Column, DataTable, RestsOn, Row, Value
from analysis.report.tables.common import finite, table, table_ids, with_interval
from analysis.words import typographic

if TYPE_CHECKING:
    from analysis.study import Study

Cell = tuple[Column, Callable[[PairRow], Value]]
"""A column, and its value of a pair."""
_KINDS = ("conditions", "method", "variant")
_RUNS: tuple[RestsOn, ...] = ("runs",)
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


def _number(
    name: str,
    header: str,
    unit: str = "",
    digits: int | None = None,
    rests_on: tuple[RestsOn, ...] = _RUNS,
    printed: bool = True,
) -> Cell:
    column = Column(name, header, "number", unit, digits, rests_on=rests_on, printed=printed)
    return column, lambda row: _value(getattr(row, name))


def _estimate(name: str, header: str, unit: str, digits: int, printed: bool = True) -> Cell:
    """A number with its interval, whose ends are fields of their own."""
    of = "" if name == "difference" else f"{name}_"
    column = Column(name, header, "number", unit, digits, rests_on=_RUNS, printed=printed)
    return column, lambda row: with_interval(
        getattr(row, name), getattr(row, f"{of}low"), getattr(row, f"{of}high")
    )


def _p(name: str, header: str, printed: bool = False) -> Cell:
    column = Column(name, header, "p", digits=4, rests_on=_RUNS, printed=printed)
    return column, lambda row: finite(getattr(row, name))


def _text(name: str, header: str, printed: bool = True) -> Cell:
    return Column(name, header, printed=printed), lambda row: getattr(row, name) or None


def _value(value: float) -> float | int | None:
    """Counts stay whole."""
    return value if isinstance(value, int) else finite(value)


_NAMES = (_text("first", "first"), _text("second", "second"))
_DIFFERENCES = (
    *_NAMES,
    _number("n_first", "runs of first", printed=False),
    _number("n_second", "of second", printed=False),
    _estimate("difference", "difference", "ticks", 1),
    _text("expected", "first expected", printed=False),
    _p("p_bootstrap", "one-tailed p"),
    _p("p_bootstrap_holm", "one-tailed p, Holm"),
    _p("p_permutation", "two-tailed p"),
    _p("p_permutation_holm", "two-tailed p, Holm", printed=True),
    _estimate("delta", "Cliff's δ", "", 2, printed=False),
    _estimate("improvement", "P(first higher)", "", 2),
)
_COSTS = (
    *_NAMES,
    _number("difference", "difference", "ticks", 1),
    _number("trials", "trials", "×"),
    _number("movement_ticks", "ticks", "×", printed=False),
    _number("evaluations", "evaluations", "×"),
    _number("solve_s", "solve time", "×"),
    _text("told_more", "told more"),
    _text("told_less", "told less"),
    _number("sd_first", "SD of first", "ticks", 1, printed=False),
    _number("sd_second", "of second", "ticks", 1, printed=False),
    _number("runs_5", "runs for 5 %", "", 0, _OPTIMUM, printed=False),
    _number("runs_2", "runs for 2 %", "", 0, _OPTIMUM, printed=False),
    _number("runs_1", "runs for 1 %", "", 0, _OPTIMUM),
    _number("smallest", "smallest found", "ticks", 1, printed=False),
    (
        Column("smallest_share", "of the optimum", "share", digits=1, rests_on=_OPTIMUM,
               printed=False),
        lambda row: finite(row.smallest_share),
    ),
)  # fmt: skip


def _pairs(
    study: Study, task: str, name: str, caption: str, cells: tuple[Cell, ...], note: str
) -> DataTable | None:
    """Conditions, methods, variants; of each the best second first."""
    pairs = sorted(
        (row for row in study.pair_rows if row.task == task),
        key=lambda row: (_KINDS.index(row.kind), row.first, -_or_least(row.mean_second)),
    )
    rows = [
        Row(
            f"{pair.first} - {pair.second}",
            tuple(value(pair) for _, value in cells),
            ((task, pair.first), (task, pair.second)),
        )
        for pair in pairs
    ]
    failed = ", ".join(_failed(pairs))
    notes = (
        (note, f"Runs without a solution are left out: {escaped(failed)}.") if failed else (note,)
    )
    name = f"{name}-{table_ids(study)[task]}"
    return table(name, caption, tuple(column for column, _ in cells), rows, notes)


def _failed(pairs: list[PairRow]) -> Iterator[str]:
    """Methods with runs that have no solution, each once."""
    found = {pair.first: (pair.n_first, pair.runs_first) for pair in pairs}
    found |= {pair.second: (pair.n_second, pair.runs_second) for pair in pairs}
    return (f"{name} solved {n} of {runs}" for name, (n, runs) in found.items() if n < runs)


def _or_least(value: float) -> float:
    return float("-inf") if np.isnan(value) else value
