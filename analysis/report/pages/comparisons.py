"""The page of comparisons: methods against each other by task, and over all tasks."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from coartic.analysis.comparisons.pairs import PairRow
from coartic.analysis.comparisons.targets import SHARES
from coartic.analysis.markup import code, escaped
from coartic.analysis.report.document import Block, Bullets, DataTable, Document, Prose, Section
from coartic.analysis.report.tables.common import marked, table_ids
from coartic.analysis.report.tables.layout import LAYOUTS, TableLayout
from coartic.analysis.report.tables.methods import overall_table
from coartic.analysis.statistics.estimates import LEVEL, RESAMPLES
from coartic.analysis.study import Study
from coartic.analysis.words import typographic
from coartic.record import SEARCH

_OTHERS = {"conditions": "other conditions", "method": "methods", "variant": "its variants"}
"""What a condition is compared with, by kind of pair, in the order of the tables."""


def comparisons_document(study: Study) -> Document:
    """Pairs of methods task by task, then the methods that ran on all tasks."""
    specification = study.results.manifest.specification
    none = Prose(("The folder has no runs of the learner under a condition of the paper.",))
    about = Bullets(reading_of_pairs(study)) if study.pair_rows else none
    return Document(
        "Methods against each other",
        (
            Section("reading", "Who is compared, and how", (about,)),
            *_tasks(study),
            Section("all-tasks", "Across tasks", tuple(_across(study))),
        ),
        f"On suite {code(specification.suite)}, seed {specification.seed}. Numbers and more "
        "of them: `comparisons.csv`, `across_tasks.csv`, `profiles.csv` (docs/statistics.md).",
        study.run_ids,
    )


def outcome(rows: Sequence[PairRow]) -> Iterator[str]:
    """What the tests of one task tell apart at 5 %, for each condition."""
    tested = [row for row in rows if not math.isnan(row.p) and row.kind != "conditions"]
    least = min(map(_least_p, tested), default=0.0) * len(tested)
    if least > LEVEL:
        yield (
            f"**Too few runs to tell anything apart: {len(tested)} permutation tests of so many "
            f"runs have an adjusted p of {min(least, 1.0):.2g} at least.**"
        )
    groups: dict[tuple[str, str], dict[str, list[str]]] = {}
    for row in rows:
        own = groups.setdefault((row.kind, row.first), {verdict: [] for verdict in _VERDICTS})
        own[_verdict(row)].append(row.second)
    for (kind, first), found in groups.items():
        words = (f"{verdict} {', '.join(names)}" for verdict, names in found.items() if names)
        yield escaped(f"{first} and {_OTHERS[kind]}: {'; '.join(words)}.")


_VERDICTS = _HIGHER, _LOWER, _NOT_APART, _UNTESTED = (
    "higher than",
    "lower than",
    "not told apart from",
    "not tested (too few runs) against",
)


def _verdict(row: PairRow) -> str:
    p = row.p_holm
    if row.kind == "conditions":  # one-tailed: turned where it speaks for the contrary
        p = min(row.p, 1 - row.p)
    if math.isnan(p):
        return _UNTESTED
    if p >= LEVEL:
        return _NOT_APART
    return _HIGHER if row.difference > 0 else _LOWER


def _least_p(row: PairRow) -> float:
    """Smallest p of the two-tailed permutation test of so many runs."""
    n, m = row.n_first, row.n_second
    orders = 2**n if row.interval == "against a known value" else math.comb(n + m, n)
    return 2 / min(orders, RESAMPLES + 1)


def _tasks(study: Study) -> Iterator[Section]:
    ids = table_ids(study)
    for task, rows in itertools.groupby(study.pair_rows, key=lambda row: row.task):
        tables = filter(None, (pairwise_table(study, task), cost_table(study, task)))
        said = Bullets(tuple(outcome(list(rows))))
        yield Section(f"on-{ids[task]}", marked(study, task), (said, *tables))


def _across(study: Study) -> Iterator[Block]:
    tasks = list(dict.fromkeys(study.scores.task))
    names = escaped(", ".join(tasks)) or "none"
    table = overall_table(study)
    (text,) = LAYOUTS["across-tasks"].reading_with(names=names)
    if len(tasks) < 2:
        text = f"Needs at least two tasks with known optimum and initial solution; here: {names}."
    elif table is None:
        text = f"No method ran on all of {names}, the optimum's searches aside."
    yield Prose((text,))
    if table is None:
        return
    yield table
    others = dict.fromkeys(study.scores.method[~study.scores.method.isin(study.overall.method)])
    left = escaped(", ".join(name for name in others if not name.startswith(SEARCH)))
    if left:
        yield Prose((f"Not run on all of these tasks: {left}.",))


def pairwise_table(study: Study, task: str) -> DataTable | None:
    """The learner against the others on one task: differences, tests, effect sizes."""
    return _pairs(study, task, LAYOUTS["compared"])


def cost_table(study: Study, task: str) -> DataTable | None:
    """The same pairs: what the second spends and is told, and how many runs it would take."""
    best = study.optima.get((task, "free"))
    ticks = ", ".join(f"{abs(share * best.reward):.1f}" for share in SHARES) if best else ""
    return _pairs(study, task, LAYOUTS["costs"], ticks=f" ({ticks} ticks)" if ticks else "")


def reading_of_pairs(study: Study) -> tuple[str, ...]:
    """Who is compared with whom, and what the numbers of the tables do not say."""
    return LAYOUTS["compared"].reading_with(pairing=_pairing(study))


def _pairing(study: Study) -> str:
    """What sharing seeds does to these runs."""
    known = [row for row in study.pair_rows if row.pairs and not np.isnan(row.correlation)]
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


def _pairs(study: Study, task: str, layout: TableLayout, **facts: str) -> DataTable | None:
    """Conditions, methods, variants; of each the best second first."""

    def place(row: PairRow) -> tuple[int, str, float]:
        mean = float(np.nan_to_num(row.mean_second, nan=-np.inf))
        return list(_OTHERS).index(row.kind), row.first, -mean

    pairs = sorted((row for row in study.pair_rows if row.task == task), key=place)
    rows = []
    for pair in pairs:
        cells = (task, pair.first), (task, pair.second)
        row = layout.row(f"{pair.first} - {pair.second}", pair, cells)
        rows.append(replace(row, family="conditions" * (pair.kind == "conditions")))
    failed = escaped(", ".join(_failed(pairs)))
    notes = (f"Runs without a solution are left out: {failed}.",) if failed else ()
    return layout.table(rows, table_ids(study)[task], notes=notes, task=escaped(task), **facts)


def _failed(pairs: list[PairRow]) -> Iterator[str]:
    """Methods with runs that have no solution, each once."""
    found = {pair.first: (pair.n_first, pair.runs_first) for pair in pairs}
    found |= {pair.second: (pair.n_second, pair.runs_second) for pair in pairs}
    return (f"{name} solved {n} of {runs}" for name, (n, runs) in found.items() if n < runs)
