"""Questions of a suite: contrasts between methods, as a suite file writes them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from functools import cached_property
from itertools import chain
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from coartic.internal.text import Line, describe_parameters
from coartic.internal.validation import FileData, described_error
from coartic.model import PAPER, WORLD, differences
from coartic.robot import Finite
from coartic.tasks.families import named_by

_Names = Annotated[tuple[str, ...], Field(min_length=1)]
Side = Literal["above", "below", "within"]


def _world(text: str) -> str:
    """Return the name of a world as runs have it: ``base_weight=4`` becomes ``base_weight=4.0``."""
    constants = dict[str, Any]()
    for part in text.split(",") if text else ():
        name, _, value = map(str.strip, part.partition("="))
        constants[name] = value
        with suppress(ValueError):
            constants[name] = float(value)
    if not constants.keys() <= {*WORLD}:
        return text
    return describe_parameters(differences(PAPER._replace(**constants)))


World = Annotated[str, AfterValidator(_world)]


class Place(NamedTuple):
    """Planned runs of a row on a task."""

    row: str
    label: str
    """Id of the method with its setting."""
    task: str
    family: str
    """Family of the task, such as ``one-armed/v1``; empty for a task of no family."""
    world: str
    runs: int
    stochastic: bool
    trials: int | None
    """Number of trials that is asked for; None for a method without trials."""
    stops: bool
    """True if runs can end before their trials are made (parameter ``until``)."""
    noisy: bool


class Term(FileData):
    """A method with its weight in a contrast."""

    method: str
    """Name of a row of the ranking: the id of a method with its setting, or the name that a block
    gives (``as``)."""
    weight: Finite
    world: World | None = None
    """World of the method's runs, such as ``motor_noise=0.01``; ``""`` for the paper's world. None,
    if each world of the folder is asked by itself."""


def _terms(value: Any) -> Any:
    """Turn a table of methods and weights into a list of terms."""
    if isinstance(value, Mapping):
        value = [{"method": method, "weight": weight} for method, weight in value.items()]
    if not value:
        raise described_error("weights is empty; it must name at least one method")
    return value


def _expected(text: str) -> str:
    """Check the expectation of a contrast."""
    _side_and_bound(text)
    return text


def _side_and_bound(text: str) -> tuple[Side, float]:
    """Read an expectation such as ``above 0``."""
    side, _, bound = text.partition(" ")
    try:
        number = float(bound)
    except ValueError:
        number = float("nan")
    is_good = side in ("above", "below", "within") and abs(number) < float("inf")
    if not is_good or (side == "within" and number <= 0):
        raise described_error(
            f"expected is {text!r}; it must be 'above B', 'below B' or 'within B' with a number B "
            "(above 0 after 'within'), such as 'above 0'"
        )
    return side, number  # type: ignore[return-value]


def bounds_of(expected: str) -> list[float]:
    """Return the bounds of an expectation: one, two for ``within``, none for the empty string."""
    if not expected:
        return []
    side, bound = _side_and_bound(expected)
    return [-bound, bound] if side == "within" else [bound]


class Contrast(FileData):
    """A table ``[[contrasts]]`` of a suite: a question about a weighted sum of methods' means."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9-]+$", max_length=60)]
    """Name of the contrast, of letters, digits and hyphens, unique in the suite."""
    says: Line
    """Sentence that the page prints, such as ``CMA-ES takes fewer ticks than the learner.``"""
    quantity: str
    """What is compared (:data:`.QUANTITIES`, or a signature)."""
    weights: Annotated[tuple[Term, ...], BeforeValidator(_terms)]
    """Weights of the methods: a table such as ``{ "policy-gradient" = 1, "learner" = -1 }``, or a
    list of tables with ``method``, ``weight`` and ``world`` for a contrast across worlds."""
    expected: Annotated[str, AfterValidator(_expected)] | None = None
    """``above B``, ``below B`` or ``within B`` in the unit of the quantity. Without it, the
    contrast is described and not tested."""
    tasks: _Names | None = None
    """Tasks, as in blocks; by default all tasks on which the methods have runs."""
    families: _Names | None = None
    """Families, such as ``one-armed``; by default all."""
    worlds: Annotated[tuple[World, ...], Field(min_length=1)] | None = None
    """Worlds, such as ``""`` (the paper's) and ``motor_noise=0.01``; by default all."""
    after: Annotated[int, Field(ge=1, strict=True)] | None = None
    """Number of trials after which the best trial so far is read, in worlds without noise."""

    @model_validator(mode="after")
    def _check(self) -> Contrast:
        """Raise an error for keys that contradict each other."""
        named = [(term.method, term.world) for term in self.weights]
        if len({*named}) < len(named):
            raise described_error(f"weights of contrast {self.name!r} names a method twice")
        across = [term.world is not None for term in self.weights]
        if any(across) and not all(across):
            raise described_error(
                f"weights of contrast {self.name!r} gives a world to some methods only; give it to "
                "all or to none"
            )
        if any(across) and self.worlds is not None:
            raise described_error(
                f"contrast {self.name!r} has key worlds and worlds in its weights; use one of them"
            )
        return self

    @cached_property
    def named_tasks(self) -> set[str]:
        """Names of the tasks in :attr:`tasks`."""
        return {*chain(*map(named_by, self.tasks or ()))}

    def terms_at(self, place: Place) -> list[Term]:
        """Return the terms that ask about runs of a row on a task in a world."""
        families = {place.family, place.family.split("/")[0]}
        if self.tasks is not None and place.task not in self.named_tasks:
            return []
        if self.families is not None and families.isdisjoint(self.families):
            return []
        return [
            term
            for term in self.weights
            if term.method in (place.row, place.label) and self.asks(term, place.world)
        ]

    def asks(self, term: Term, world: str) -> bool:
        """Return whether a term asks about runs in a world."""
        if term.world is not None:
            return term.world == world
        return self.worlds is None or world in self.worlds

    @property
    def is_across(self) -> bool:
        """True if the methods are in worlds of their own."""
        return self.weights[0].world is not None

    @property
    def side(self) -> Side | None:
        """The expected side of the bound; None for a contrast that is described."""
        return _side_and_bound(self.expected)[0] if self.expected else None

    @property
    def bound(self) -> float:
        """The bound of the expectation; 0 for a contrast that is described."""
        return _side_and_bound(self.expected)[1] if self.expected else 0.0

    @property
    def content(self) -> str:
        """The contrast as JSON without its sentence: two contrasts with equal content are one."""
        return json.dumps(
            self.model_dump(mode="json", exclude={"says"}, exclude_none=True), sort_keys=True
        )


class Registered(NamedTuple):
    """A contrast with the record of a results folder: when it was asked, and of how many runs."""

    contrast: Contrast
    cells: int
    """Number of cells over which p is corrected: those with enough tasks that the suite plans."""
    is_asked: bool
    """False if the suite of the last command does not have the contrast any more."""
    date: str
    """Date and time (UTC) at which ``coartic run`` met the contrast first."""
    runs: int
    """Number of runs that its cells had then."""
