"""The sentence that counts failed runs behind an answer."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from coartic.analysis.methods import name_of
from coartic.analysis.study import CellRuns
from coartic.analysis.words import number


def failed_runs(cells: Iterable[CellRuns], consequence: str) -> str:
    """A sentence with a leading space; empty where none of the cells' runs failed.

    It counts all runs of the methods of which some failed, and ends with the ``consequence``:
    `` 3 of 40 runs of hill climbing failed and are not counted.``
    """
    runs, failed = Counter[str](), Counter[str]()
    for cell in {(cell.task, cell.label): cell for cell in cells}.values():
        runs[cell.label] += len(cell.runs)
        failed[cell.label] += len(cell.runs) - len(cell.good)
    who = [label for label in failed if failed[label]]
    if not who:
        return ""
    names = " and ".join(map(name_of, who)) if len(who) < 3 else f"{len(who)} methods"
    total = sum(runs[label] for label in who)
    return f" {number(failed.total())} of {number(total)} runs of {names} failed{consequence}."
