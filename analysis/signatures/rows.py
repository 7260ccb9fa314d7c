"""What a signature is, and one value of it: typed, with the place it belongs to."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Self

from pydantic import BaseModel, ConfigDict, ImportString, model_validator

from coartic.analysis.statistics.estimates import Interval
from coartic.runs.plan import label_of

NO_RUN = "no run has a solution"
ONE_HAND = "the task has one hand"
NO_INITIAL = "the corrective process alone does not complete the task"
ONE_RUN = "one run: no interval"


@dataclass(frozen=True)
class Place:
    """Where in a solution, and between which tasks, a value belongs; what does not apply is
    empty."""

    goal: int | None = None
    """Number of the goal, from 1."""
    hand: str = ""
    """``left``, ``right``, or ``chosen``: the one chosen in each subtask."""
    hands: str = ""
    """Hand sequences of the runs, with their counts where there are several."""
    against: str = ""
    """Task that is the other context."""
    moving: int | None = None
    """Number of the goal that differs between the tasks of a family."""
    joint: str = ""
    neutral: float | None = None
    """Value that says nothing, where that is not 0."""
    longest: int | None = None
    """Ticks that a lead can have at most."""

    def __str__(self) -> str:
        """In words: ``goal 1, right hand, against descending, of at most 141``."""
        parts = [] if self.goal is None else [f"goal {self.goal}"]
        joint = self.joint.replace("_", " ")
        if self.moving is not None:
            kind = "anticipatory" if self.goal is None or self.goal < self.moving else "carry-over"
            parts.append(f"{kind} of goal {self.moving}")
            joint = self.joint
        parts += [f"{self.hand} hand"] if self.hand else []
        parts += [self.hands] if self.hands else []
        parts += [f"against {self.against}"] if self.against else []
        parts += [joint] if joint else []
        parts += [] if self.neutral is None else [f"neutral at {self.neutral:.3f}"]
        parts += [] if self.longest is None else [f"of at most {self.longest}"]
        return ", ".join(parts)


_NOWHERE = Place()


@dataclass(frozen=True, kw_only=True)
class SignatureRow:
    """One value of a signature, or why there is none."""

    task: str = ""
    """Empty, as are method and variant, in what a measure yields: the study fills them in."""
    method: str = ""
    variant: str = ""
    signature: str
    place: Place = _NOWHERE
    value: float = math.nan
    low: float = math.nan
    """Interval at 95 %."""
    high: float = math.nan
    p: float = math.nan
    """Uncorrected."""
    n: int = 0
    """Runs that went into it."""
    unit: str = ""
    """Empty where the signature does not apply."""
    why_not: str = ""
    """Why there is no value, or no interval or test; empty where all is there."""

    @property
    def label(self) -> str:
        """The method with its variant."""
        return label_of(self.method, self.variant)


Rows = Iterator[SignatureRow]
"""What a measure yields."""
Measure = Callable[..., Rows]
"""Takes what is measured (:class:`~.trajectories.Trajectories`, a pair of contexts or a family
of tasks), then the signatures that it measures, in the order of the register."""


class Signature(BaseModel):
    """One signature, as a row of ``register.toml``, which says what the fields are."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    measure: ImportString[Measure]
    unit: str
    range: str = "share of runs"
    by_goal: bool = False
    share: bool = False
    meaning: str
    heading: str
    sources: tuple[str, ...] = ()

    @model_validator(mode="after")
    def _says_its_range(self) -> Self:
        if self.share == ("range" in self.model_fields_set):
            raise ValueError(f"signature {self.name}: it has a range, or is a share of runs")
        return self

    @property
    def extent(self) -> str:
        """Unit and range, and whether there is one of each goal."""
        return self.range + ", by goal" * self.by_goal

    def at(self, place: Place, **values: Any) -> SignatureRow:
        """A value of it, with its unit; ``values`` as :class:`SignatureRow` has them."""
        return SignatureRow(signature=self.name, place=place, **{"unit": self.unit, **values})

    def estimated(self, place: Place, found: Interval, n: int, **values: Any) -> SignatureRow:
        """The same of a value with its interval or test, over so many runs."""
        why = ONE_RUN if n == 1 else ""
        return self.at(place, **{"why_not": why, "n": n, **found._asdict(), **values})


def without(of: Iterable[Signature], why: str, place: Place = _NOWHERE, n: int = 0) -> Rows:
    """That none of them applies."""
    for signature in of:
        yield SignatureRow(signature=signature.name, place=place, n=n, why_not=why)
