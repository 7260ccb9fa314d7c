"""What a report consists of: sections of prose, tables, figures and a player.

A document holds content and raw values, no presentation:
:mod:`coartic.analysis.report.formats.html`, ``markdown`` and ``latex`` decide how it looks, and
CSV files hold the raw values. Every number of a table names the cells (task, label) it was
computed from, and the document knows the run ids of every cell, so each number leads to its runs.

Strings of prose, items, captions and notes have inline markup (:mod:`coartic.analysis.markup`).
Titles, headers and values are plain text.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar, Literal

from pydantic import ConfigDict

from coartic.analysis.results.folder import CellKey as CellKey
from coartic.analysis.results.optima import OtherArm

RestsOn = Literal["runs", "optimum", "paper", "derived", "ours", "text", "simulation"]
"""What a value comes from: runs of the folder, the optimum of their tasks, what the paper prints,
what follows from that, a choice or an assumption of ours, words of ours, or a simulation that
needs no runs."""

_ID = re.compile(r"[a-z0-9]+([.-][a-z0-9]+)*")


@dataclass(frozen=True)
class Prose:
    """Paragraphs, in inline markup."""

    paragraphs: tuple[str, ...]


@dataclass(frozen=True)
class Bullets:
    """An unordered list, each item in inline markup."""

    items: tuple[str, ...]


@dataclass(frozen=True)
class Estimate:
    """A number with its spread or interval, in the unit of its column."""

    value: float
    sd: float | None = None
    low: float | None = None
    """Lower end of the interval; there are both ends or none."""
    high: float | None = None
    digits: tuple[int, int] | None = None
    """Decimals shown of value and SD, as somebody else printed them; the column's by default."""
    beyond: float | None = None
    """What its infinite numbers are known to exceed, where that is all that is known of them."""

    def __post_init__(self) -> None:
        if (self.low is None) != (self.high is None):
            raise ValueError(f"{self}: an interval has both ends")


Value = float | int | str | Estimate | None
"""A table's raw value. None, like NaN, means that there is none."""


@dataclass(frozen=True)
class Column:
    """One column of a table."""

    __pydantic_config__: ClassVar = ConfigDict(extra="forbid")

    name: str
    """Of the CSV column: a Python identifier, stable."""
    header: str
    kind: Literal["text", "number", "share", "p"] = "text"
    """``share``: a fraction, shown in per cent. ``p``: a p-value, shown as below the
    last digit shown where it is."""
    unit: str = ""
    """Shown with the header; ``share`` needs none."""
    digits: int | None = None
    """Decimals shown, of a share those of the percentage. None: integers whole, others
    with three figures."""
    interval: str = "95 % interval"
    """Header of the intervals, where values have them."""
    rests_on: tuple[RestsOn, ...] = ()
    """What its values were computed from; of numbers there is always something."""
    how: str = ""
    """How its values were obtained, where the table's notes do not say it, in inline markup."""
    family: str = ""
    """Of which rows each value depends on all, not on its own alone, in words."""
    other_arm: OtherArm | Literal["both"] = "free"
    """Of the optimum that it rests on, if it does, or of both."""
    printed: bool = True
    """Whether the LaTeX table has it, which has to fit on a page of paper; a terminal has
    first what paper has."""
    leading: bool = False
    """Whether it is what the table is for: a terminal has it before all but the first two."""

    def __post_init__(self) -> None:
        if not self.name.isidentifier():
            raise ValueError(f"column name {self.name!r} is not an identifier")


@dataclass(frozen=True)
class Row:
    """One row of a table."""

    key: str
    """Names the row in its table; stable, such as the method's label."""
    values: tuple[Value, ...]
    """One per column."""
    cells: tuple[CellKey, ...] = ()
    """What the row's values were computed from."""
    cells_by_column: Mapping[str, tuple[CellKey, ...]] = field(default_factory=dict)
    """By column name, what a value was computed from where it is something else."""
    rests_on: Mapping[str, tuple[RestsOn, ...]] = field(default_factory=dict)
    """By column name, what a value rests on where it is not what its column does."""
    how: str = ""
    """How its values were obtained, beyond what its columns say, in inline markup."""
    other_arm: OtherArm | None = None
    """Of the optimum that its values rest on, where its columns do not say it."""
    family: str = ""
    """Rows of one name are a family; by default all rows of a table."""
    link: str = ""
    """Address within the page that the row's name leads to."""
    group: str = ""
    """What a page says above rows of one kind, which it keeps together."""

    @property
    def all_cells(self) -> set[CellKey]:
        """What any of its values was computed from."""
        return {*self.cells}.union(*self.cells_by_column.values())


@dataclass(frozen=True)
class DataTable:
    """A table of raw values."""

    id: str
    """Stable, such as ``methods-ascending``; the name of its files."""
    caption: str
    columns: tuple[Column, ...]
    rows: tuple[Row, ...]
    notes: tuple[str, ...] = ()
    """Below the table, in inline markup."""
    folded: bool = False
    """Whether a page shows its caption alone until more is asked for."""
    unshown: tuple[CellKey, ...] = ()
    """Of every family, cells that have no row."""
    key: tuple[str, ...] = ()
    """Columns whose values, spaces between, are the rows' keys; none where keys are their own."""

    def __post_init__(self) -> None:
        names = [column.name for column in self.columns]
        if not names or len(set(names)) < len(names):
            raise ValueError(f"table {self.id}: column names {names} must differ")
        if len({row.key for row in self.rows}) < len(self.rows):
            raise ValueError(f"table {self.id}: two rows have the same key")
        for row in self.rows:
            for problem in self._problems(row):
                raise ValueError(f"table {self.id}, row {row.key!r}: {problem}")

    def only(self, shown: Callable[[Column], bool]) -> DataTable:
        """With some of its columns alone."""
        kept = [place for place, column in enumerate(self.columns) if shown(column)]
        rows = (replace(row, values=tuple(row.values[k] for k in kept)) for row in self.rows)
        return replace(self, columns=tuple(self.columns[k] for k in kept), rows=tuple(rows))

    def _problems(self, row: Row) -> Iterator[str]:
        names = [column.name for column in self.columns]
        if len(row.values) != len(names):
            yield f"{len(row.values)} values for {len(names)} columns"
        unknown = (row.cells_by_column.keys() | row.rests_on.keys()) - set(names)
        if unknown:
            yield f"no columns {unknown}"
        for column, value in zip(self.columns, row.values, strict=True):
            if not isinstance(value, float | int | str | Estimate | None):
                of = type(value).__name__
                yield f"{column.name} is {value!r}, a {of}; numbers are Python's"
            elif value is not None and isinstance(value, str) != (column.kind == "text"):
                yield f"{column.name} is of kind {column.kind}, its value is {value!r}"


@dataclass(frozen=True)
class FigureBlock:
    """A figure as the renderers need it."""

    id: str
    """Stable; the name of its files in ``figures/``."""
    title: str
    caption: str
    """In inline markup."""
    alt: str
    """What the figure shows, in plain text, for who cannot see it."""
    svg: str
    """An SVG document."""
    chart: str = ""
    """A specification of Vega-Lite as JSON, which a page of HTML shows in the place of the SVG
    where scripts are on; empty where there is none."""
    narrow: str = ""
    """The same drawn for a narrow page of HTML, an SVG document; empty where one will do."""


Tone = Literal["good", "bad", "open", "plain"]
"""Whether a verdict is in favour, against, undecided, or none."""


@dataclass(frozen=True)
class Verdict:
    """One outcome among several, in words."""

    name: str
    """Of what it was judged, in plain text."""
    verdict: str
    """In plain text."""
    tone: Tone
    link: str = ""
    """Address within the page that says more."""


@dataclass(frozen=True)
class Strip:
    """Verdicts beside each other, in words and colours: a picture made of text."""

    id: str
    title: str
    verdicts: tuple[Verdict, ...]
    counted: bool = False
    """Whether there are so many that a page shows one square each, and the words by count."""


@dataclass(frozen=True)
class PlayerBlock:
    """Movements to be played; only HTML has it."""

    id: str
    title: str
    caption: str
    """In inline markup."""
    data: str
    """JSON as :func:`coartic.analysis.report.player.player_json` makes it."""


Block = Prose | Bullets | DataTable | FigureBlock | PlayerBlock | Strip


@dataclass(frozen=True)
class Section:
    """A section with its blocks, then its subsections."""

    id: str
    title: str
    blocks: tuple[Block, ...] = ()
    sections: tuple[Section, ...] = ()
    folded: bool = False
    """Whether a page shows its title alone until more is asked for."""
    finding: str = ""
    """What was found, in a sentence or two below the title, in inline markup."""
    cards: bool = False
    """Whether its subsections stand beside each other, where a page has room."""

    def walk(self) -> Iterator[Section]:
        """This section and all below it, in order."""
        yield self
        for section in self.sections:
            yield from section.walk()


@dataclass(frozen=True)
class Document:
    """A whole report.

    Raises ValueError where an id is none that can name a file, or is used twice, and where a cell
    is unknown.
    """

    title: str
    sections: tuple[Section, ...]
    lead: str = ""
    """A sentence or two below the title, in inline markup."""
    runs: Mapping[CellKey, tuple[str, ...]] = field(default_factory=dict)
    """Run ids of every cell that a table names."""

    def __post_init__(self) -> None:
        ids = [section.id for section in self.walk()]
        ids += [block.id for block in self.blocks() if not isinstance(block, Prose | Bullets)]
        for name in ids:
            if not _ID.fullmatch(name):
                raise ValueError(f"id {name!r}: small letters and digits, joined by - or .")
            if name == "runs":
                raise ValueError("id 'runs' is kept for the list of runs")
        twice = {name for name in ids if ids.count(name) > 1}
        if twice:
            raise ValueError(
                f"{', '.join(sorted(twice))}: ids are used once, by one section, table or figure"
            )
        for table in self.tables():
            for row in table.rows:
                unknown = (row.all_cells | {*table.unshown}) - self.runs.keys()
                if unknown:
                    raise ValueError(
                        f"table {table.id}, row {row.key!r}: the document has no run ids of "
                        f"{sorted(unknown)}"
                    )

    def walk(self) -> Iterator[Section]:
        """All sections and subsections, in order."""
        for section in self.sections:
            yield from section.walk()

    def blocks(self) -> Iterator[Block]:
        """All blocks, in order."""
        for section in self.walk():
            yield from section.blocks

    def tables(self) -> list[DataTable]:
        """All tables, in order."""
        return [block for block in self.blocks() if isinstance(block, DataTable)]

    def figures(self) -> list[FigureBlock]:
        """All figures, in order."""
        return [block for block in self.blocks() if isinstance(block, FigureBlock)]
