"""Section on settings of methods that ran with several settings."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator

import numpy as np

from coartic.analysis import standings
from coartic.analysis.methods import setting_in_words, title_of
from coartic.analysis.statistics.hypotheses import holm
from coartic.analysis.study import CellRuns, Study
from coartic.analysis.table import Row, Rows, runs_of, table
from coartic.analysis.words import MOST_NAMED, capital, interval, listed, p_value, percent
from coartic.estimates import LEVEL
from coartic.internal.text import counted

BEST, IDENTICAL, LARGER = "smallest gap", "identical in every run", "larger gap"
UNSURE, UNTESTED = "no significant difference", "the runs are too few, or too alike, to tell"
SOME_FAILED = "some runs failed"


def settings_of(study: Study) -> Iterator[tuple[str, dict[str, list[CellRuns]]]]:
    """Yield the id of each method that ran with several settings, and the cells of its settings, on
    the tasks that most settings have."""
    compared, methods = standings.compared(study), study.methods
    single = methods.index[methods.index.isin([*compared]) & (methods.parts.map(len) == 1)]
    for base, of_base in methods.loc[single].groupby("base", sort=False):
        ran_on = [(label, compared[label]) for label in of_base.index]
        widest = standings.widest_tasks(study, ran_on, least=2)
        cells = {label: standings.cells_on(study, label, widest) for label, _ in ran_on}
        cells = {label: of_label for label, of_label in cells.items() if of_label}
        if len(cells) > 1:
            yield str(base), cells


@table(
    "method; setting; gap[]: gap (%) .1; tasks: number of tasks; "
    "comparison: compared with the smallest gap; p_holm: p (corrected) .p; runs"
)
def list_settings(study: Study) -> Rows:
    """List the mean gap of each setting of a method, the smallest gap first.

    ``p_holm`` is of the test of runs paired by seed (:func:`.paired_difference`) that the gap of a
    setting differs from the smallest gap, corrected over the settings of the method (Holm).
    """
    for base, cells in settings_of(study):
        tasks = tuple(cell.task for cell in next(iter(cells.values())))
        gaps, names = standings.gaps_on(study, tasks).set_index("method"), varied(cells)
        best, *others = [label for label in gaps.index if label in cells] or [""]
        tests = {label: standings.paired_difference(study, best, label, tasks) for label in others
                 if not identical(cells[best], cells[label])}  # fmt: skip
        p = dict(zip(tests, holm([test.p for test in tests.values()]), strict=True))
        comparison = {best: BEST} | dict.fromkeys(others, IDENTICAL)
        for label, test in tests.items():
            enough = len(tests) * test.least_p < LEVEL
            comparison[label] = (LARGER if p[label] < LEVEL else UNSURE) if enough else UNTESTED
        for label in sorted(cells, key=[best, *others, *cells].index):
            row: Row = {
                "method": base,
                "setting": names[label],
                "tasks": len(tasks),
                "comparison": comparison.get(label, SOME_FAILED),
                "p_holm": p.get(label, math.nan),
                "runs": sum(len(cell.runs) for cell in cells[label]),
            }
            if label in comparison:
                row |= {name: gaps[name][label] for name in ("gap", "gap_low", "gap_high")}
            yield label, row | runs_of(*cells[label])


def identical(first: list[CellRuns], second: list[CellRuns]) -> bool:
    """Return whether two settings have the same rewards in every run."""
    pairs = zip(first, second, strict=True)
    return all(np.array_equal(one.rewards, other.rewards) for one, other in pairs)


def varied(cells: dict[str, list[CellRuns]]) -> dict[str, str]:
    """Return the parameters in which settings differ, with their values in words, by label."""
    complete = {label: json.loads(of[0].runs.parameters.iloc[0]) for label, of in cells.items()}
    keys = dict.fromkeys(key for parameters in complete.values() for key in parameters)
    several = [key for key in keys if len({repr(each.get(key)) for each in complete.values()}) > 1]
    names = {}
    for label, parameters in complete.items():
        setting = ", ".join(f"{key}={parameters[key]}" for key in several if key in parameters)
        default = "" if cells[label][0].setting else "default"
        words = setting_in_words(setting) if setting else cells[label][0].setting
        names[label] = f"{words} ({default})" if words and default else words or default
    return names


CARD = "{title} has the smallest gap with {setting} ({gap})."
DETAIL = "{title}: gap of {interval} with {setting}{alike}{second}."
SECOND = "; next {gap} with {setting} ({comparison})"


def best_settings(study: Study) -> str:
    """Say which setting of each method has the smallest gap, and whether significantly so."""
    rows, cards, details = list_settings(study), [], []
    for base, of_method in rows.groupby("method", sort=False):
        is_best = of_method.comparison.isin([BEST, IDENTICAL])
        best, others = of_method[is_best], of_method[~is_best & of_method.gap.notna()]
        if best.empty:
            continue
        finding = {
            "title": capital(title_of(str(base))),
            "setting": listed(best.setting),
            "gap": percent(best.gap.iloc[0]),
            "interval": interval(best.iloc[0].to_dict(), "gap", scale=100, unit=" %"),
            "alike": f" each, {IDENTICAL}" * (len(best) > 1),
            "second": "".join(
                SECOND.format(
                    setting=row["setting"],
                    gap=percent(row["gap"]),
                    comparison=", ".join(filter(None, (row["comparison"], p_value(row["p_holm"])))),
                )
                for row in others.head(1).to_dict("records")
            ),
        }
        cards.append(CARD.format(**finding))
        details.append(DETAIL.format(**finding))
    more = len(details) - MOST_NAMED
    ending = [f"And {counted(more, 'method')} more in the table."] * (more > 0)
    return "\n".join([*cards[:1], " ".join([*details[:MOST_NAMED], *ending])]).strip()
