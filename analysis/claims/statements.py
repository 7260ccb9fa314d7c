"""What is said of the model (``claims.toml``), and how judges take it up."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from analysis.claims.data import Cells, Data
from analysis.claims.register import Claim, Finding, Judge

_APART = ("one-armed", "two-armed")


def _read() -> dict[str, dict[str, Any]]:
    """Fields of every claim by its id."""
    text = (Path(__file__).parent / "claims.toml").read_text(encoding="utf-8")
    found = {}
    for section, rows in tomllib.loads(text).items():
        for name, row in rows.items():
            apart = "{which}" in row["statement"]
            for which in _APART if apart else ("",):
                own = {k: v[which] if isinstance(v, dict) else v for k, v in row.items()}
                own["statement"] = row["statement"].replace("{which}", which)
                fitted = section == "Two-armed tasks" or which == "two-armed"
                key = f"{name}-{which}" if apart else name
                found[key] = {**own, "section": section, "fitted": fitted}
    return found


STATEMENTS = _read()
JUDGED: dict[str, Claim] = {}
"""Claims by id as their judges take them up."""


def decides(name: str, test: str) -> Callable[[Judge], Judge]:
    """The function judges the claim with this id, by ``test`` (in inline markup)."""

    def enter(judge: Judge) -> Judge:
        JUDGED[name] = Claim(name, test=test, judge=judge, **STATEMENTS[name])
        return judge

    return enter


JudgeOfCells = Callable[[Cells, Data], Finding]


def decides_apart(name: str, test: str, cells: Cells) -> Callable[[JudgeOfCells], JudgeOfCells]:
    """The function judges a claim on those of ``cells`` that are one-armed, and on the others.

    The one-armed tasks are printed, the two-armed ones a reconstruction.
    """

    def enter(judge: JudgeOfCells) -> JudgeOfCells:
        for which in _APART:
            two = which == "two-armed"
            own = tuple(cell for cell in cells if cell[0].startswith("two-armed") == two)
            decides(f"{name}-{which}", test)(partial(judge, own))
        return judge

    return enter
