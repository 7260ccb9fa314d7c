"""What is said of the model (``claims.toml``), and how judges take it up."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from typing import Annotated, Any, Self, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    StrictBool,
    TypeAdapter,
    model_validator,
)

from coartic.analysis.claims.data import Cells, Data
from coartic.analysis.claims.register import Claim, Finding, Rule, Section
from coartic.analysis.printed import ENTRIES
from coartic.analysis.words import stated
from coartic.task import builtin_tasks, load_task
from coartic.text import did_you_mean

_APART = ("one-armed", "two-armed")
_REGISTER = stated(__file__, "claims")
REASONS: dict[str, dict[str, Any]] = _REGISTER.pop("margins")
"""Every margin with its value and the reason for it, by name."""
MARGINS: dict[str, float] = {name: float(said["value"]) for name, said in REASONS.items()}

_SELECTED = {
    claim for entry in ENTRIES.values() if entry.role == "constraint" for claim in entry.claims
}
"""Claims that goals which are not printed had to meet to be admitted."""


_HANDS = "[LR]+"
_RUNS = rf"(replay )?(EC[1-4]?|EC[1-4]-[a-z]+)( {_HANDS})?"
Pair = Annotated[str, Field(pattern=rf"^{_RUNS} > ({_RUNS}|initial|best|jerk)$")]
"""Two things that are compared, the first of which is said to be higher."""
Counted = Annotated[str, Field(pattern=rf"^EC[1-4] ((not )?{_HANDS}|EC[1-4])$")]
"""Runs that are counted by their hands."""


def _is_shipped(task: str) -> str:
    if task not in builtin_tasks():
        raise ValueError(f"there is no task {task!r}{did_you_mean(task, builtin_tasks())}")
    return task


ShippedTask = Annotated[str, AfterValidator(_is_shipped)]


class Said(BaseModel):
    """A claim of ``claims.toml``, which says what the fields are."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    statement: Annotated[str, Field(min_length=1)]
    section: Section
    rule: Rule
    test: str = ""
    beside: StrictBool = False
    pairs: dict[ShippedTask, Pair | tuple[Pair, ...]] = {}
    families: tuple[str, ...] = ()
    compared: tuple[Pair, ...] = ()
    unit: str = ""
    runs: dict[ShippedTask, Counted] = {}
    place: str = ""
    quote: str = ""
    figure: str = ""
    fitted: bool
    selected: bool

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        ours = self.section == "Beyond the paper"
        if ours == bool(self.place) or (ours and self.rule != "measured"):
            raise ValueError(
                "what the paper says has a place in it; what it does not say is measured and "
                "stands in section 'Beyond the paper'"
            )
        return self

    def claim(self, name: str, test: str, judge: Callable[[Data], Finding]) -> Claim:
        """The claim with its test in words, and who judges it."""
        return Claim(id=name, judge=judge, **{**vars(self), "test": test})


def _read() -> dict[str, Said]:
    """Every claim by its id."""
    found = {}
    for section, rows in _REGISTER.items():
        for name, row in rows.items():
            apart = "{which}" in row.get("statement", "")
            for which in _APART if apart else ("",):
                own = {
                    key: said[which] if isinstance(said, dict) and which in said else said
                    for key, said in row.items()
                }
                own["statement"] = row.get("statement", "").replace("{which}", which)
                fitted = section == "Two-armed tasks" or which == "two-armed"
                key = f"{name}-{which}" if apart else name
                selected = key in _SELECTED
                found[key] = {**own, "section": section, "fitted": fitted, "selected": selected}
    return TypeAdapter(dict[str, Said]).validate_python(found)


STATEMENTS = _read()
JUDGED: dict[str, Claim] = {}
"""Claims by id as their judges take them up."""
Judging = TypeVar("Judging", bound=Callable[..., Finding])


def decides(name: str, **given: Any) -> Callable[[Judging], Judging]:
    """The function judges the claim with this id.

    It is called with what judges read, and with ``given``: one function may judge claims that
    differ in those. The claim's ``test`` may name margins, constants of the judge's module and
    what the judge is given, so that a threshold is said as it is tested.
    """

    def enter(judge: Judging) -> Judging:
        said = STATEMENTS[name]
        try:
            test = said.test.format(**vars(sys.modules[judge.__module__]) | MARGINS | given)
        except (LookupError, ValueError, AttributeError) as error:
            raise ValueError(f"claim {name}: its test names what nobody states: {error}") from None
        JUDGED[name] = said.claim(name, test, partial(judge, **given))
        return judge

    return enter


def decides_apart(name: str, cells: Cells) -> Callable[[Judging], Judging]:
    """The function judges a claim on those of ``cells`` that are one-armed, and on the others.

    The one-armed tasks are printed, the two-armed ones a reconstruction.
    """

    def enter(judge: Judging) -> Judging:
        for which in _APART:
            two = which == "two-armed"
            own = tuple(cell for cell in cells if (len(load_task(cell[0]).hands) > 1) == two)
            decides(f"{name}-{which}", cells=own)(judge)
        return judge

    return enter
