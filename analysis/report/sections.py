"""The sections of the page: what each asks, what was found, one picture and one table.

To add one: a row of ``sections.toml``, its sentence in ``sentences.jinja`` and the facts in it in
``facts.py``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import pandas as pd
from pydantic import BaseModel, ConfigDict, TypeAdapter

from coartic import CoarticError
from coartic.analysis.figures import FIGURES, Plot
from coartic.analysis.generality.sample import one_by_one
from coartic.analysis.report import facts
from coartic.analysis.report.text import sentence
from coartic.analysis.study import Study
from coartic.analysis.tables import TABLES
from coartic.analysis.words import read_beside


class Section(BaseModel):
    """A row of ``sections.toml``, which says what the fields are."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    short: str
    title: str
    facts: str = ""
    say: str = ""
    figure: str = ""
    table: str = ""
    caption: str = ""
    note: str = ""
    single: bool = False


SECTIONS: Mapping[str, Section] = TypeAdapter(dict[str, Section]).validate_python(
    read_beside(__file__)
)
"""Every section by its id, in the order of the page."""


@dataclass(frozen=True)
class Filled:
    """A section with what a folder's runs put into it."""

    id: str
    section: Section
    finding: str
    plot: Plot | None
    table: pd.DataFrame | None


def filled(study: Study) -> Iterator[Filled]:
    """The sections that the runs allow, with what belongs to each."""
    for name, section in SECTIONS.items():
        if section.single and not one_by_one(study):
            continue
        table = TABLES[section.table](study) if section.table else None
        if table is not None and not len(table):
            table = None
        plot = drawn(study, section.figure) if section.figure else None
        if plot is not None or table is not None:
            found = getattr(facts, section.facts)(study) if section.facts else None
            finding = "" if found is None or not section.say else sentence(section.say, found)
            yield Filled(name, section, finding, plot, table)


def drawn(study: Study, name: str) -> Plot | None:
    """A figure by its id; None where the runs do not allow it."""
    try:
        return FIGURES[name](study)
    except CoarticError:
        return None
