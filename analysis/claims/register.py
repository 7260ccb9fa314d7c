"""The claims that are judged: rows of ``claims.toml``, which says what the fields are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from coartic.analysis.statistics.estimates import Inference
from coartic.analysis.words import read_beside
from coartic.robot import Array

_FILE = read_beside(__file__, "claims")
HISTORY: dict[str, dict[str, Any]] = _FILE.pop("margins")
"""Every margin with its value, the reason for it, and its history where it was changed."""
MARGINS: dict[str, float] = {name: float(row["value"]) for name, row in HISTORY.items()}

Verdict = Literal["supported", "not supported", "undecided", "used to choose the goals"]
Correction = Literal["paper", "beside", "families"]
"""Which claims are corrected together: on the paper's cells, with runs beside them, on families of
random tasks."""

_HANDS = "[LR]+"
_RUNS = rf"(replay )?(EC[1-4]?|EC[1-4]-[a-z]+)( {_HANDS})?"
Pair = Annotated[str, Field(pattern=rf"^{_RUNS} > ({_RUNS}|initial|best|jerk)$")]
"""Two things that are compared, the first of which is said to be higher."""
Counted = Annotated[str, Field(pattern=rf"^EC[1-4] (not )?{_HANDS}$")]
"""Runs that are counted by their hands."""


@dataclass(frozen=True)
class Finding:
    """What was seen of one claim, before any correction of its tests."""

    holds: bool | None
    """Whether what the claim says is seen; None where that cannot be said."""
    evidence: str
    tests: tuple[Inference, ...] = ()
    """Tests that it rests on, turned so that a positive estimate is as claimed."""
    against: tuple[Inference, ...] | None = None
    """Tests of the opposite, any of which refutes it; None: the other tails of ``tests``."""
    samples: tuple[Array, ...] = ()
    """What the tests are of, where they are of instances: their values (n,) less their bound."""


class Claim(BaseModel):
    """One statement of the paper and how it is decided."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    id: str
    section: str
    statement: str
    judge: Annotated[str, Field(pattern=r"^[a-z_]+\.[a-z_0-9]+$")]
    test: str = ""
    exact: bool = False
    fitted: bool = False
    chosen: bool = False
    beside: bool = False
    pairs: Mapping[str, Sequence[Pair]] = {}
    runs: Mapping[str, Counted] = {}
    cells: Mapping[str, Sequence[str]] = {}
    families: Sequence[str] = ()
    compared: Sequence[Pair] = ()
    unit: str = ""
    place: str
    quote: str
    figure: str = ""

    @property
    def correction(self) -> Correction | None:
        """Which claims it is corrected with; None for what is counted exactly."""
        if self.exact:
            return None
        if self.families:
            return "families"
        return "beside" if self.beside else "paper"

    @model_validator(mode="after")
    def _rests_on_what_was_chosen(self) -> Self:
        if self.chosen and not self.fitted:
            raise ValueError(f"{self.id}: goals are chosen for fitted claims alone")
        return self


def _read() -> dict[str, Claim]:
    return {
        name: Claim(id=name, section=section, **row)
        for section, rows in _FILE.items()
        for name, row in rows.items()
    }


CLAIMS: Mapping[str, Claim] = _read()
"""Every claim by its id, in the order of the register."""
