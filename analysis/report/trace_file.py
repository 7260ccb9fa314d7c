"""``trace.json``: what every number of a report rests on, as it is stored.

Cells are named by their place in the list ``cells``. The same results give the same text,
wherever they lie: the folder of a file in the command that asked for them is left out.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from analysis.markup import words
from analysis.report.document import CellKey, DataTable, Document, RestsOn
from analysis.report.numbers import Number
from analysis.report.tables.methods import READING_OF_METHODS
from analysis.report.text import heads, texts
from coartic import CoarticError
from coartic.stored import content_hash
from coartic.text import json_text, shell_line

if TYPE_CHECKING:
    from analysis.study import Study

FILE = "trace.json"
FORMAT: Literal[4] = 4
Places = tuple[int, ...]


class _Stored(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Suite(_Stored):
    """What was asked for, in few words."""

    name: str
    runs: int
    trials: int | None
    seed: int


class Commit(_Stored):
    """The code that something was made with."""

    id: str
    dirty: bool


class Environment(BaseModel):
    """Where, when and with what results were made."""

    model_config = ConfigDict(frozen=True, extra="allow")

    coartic: str
    commit: Commit | None
    model_code: str
    python: str
    platform: str
    packages: dict[str, str]
    command: tuple[str, ...]


class TracedCell(_Stored):
    """A method with parameters on a task, and its runs."""

    task: str
    label: str
    method: str
    runs: tuple[str, ...]
    commits: tuple[str, ...]


class TracedMacro(_Stored):
    """A number of ``numbers.tex``: its texts by the endings of its macros, and whence it is."""

    texts: dict[str, str]
    meaning: str
    of: str
    how: str
    origin: str
    cells: Places


class TracedOptimum(_Stored):
    """The best reward known of a task, and the folder's own searches that give it."""

    task: str
    other_arm: str
    reward: int
    how: str
    cells: Places


class TracedColumn(_Stored):
    """A table's column."""

    name: str
    head: str
    rests_on: tuple[RestsOn, ...]
    other_arm: str


class TracedRow(_Stored):
    """A table's row: what each column shows, and the cells behind it."""

    texts: tuple[str, ...]
    cells: Places
    cells_by_column: dict[str, Places]


class TracedTable(_Stored):
    """A table."""

    caption: str
    notes: tuple[str, ...]
    columns: tuple[TracedColumn, ...]
    rows: dict[str, TracedRow]


class TraceFile(_Stored):
    """All of it."""

    format: Literal[4] = Field(FORMAT)
    suite: Suite
    specification: str
    """SHA-256 of the suite's specification: tasks, methods, parameters, seed, run ids."""
    environment: Environment
    cells: tuple[TracedCell, ...]
    macros: dict[str, TracedMacro]
    optima: tuple[TracedOptimum, ...]
    tables: dict[str, TracedTable]

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        rows = [(table, row) for table in self.tables.values() for row in table.rows.values()]
        named = [entry.cells for entry in self.macros.values()]
        named += [entry.cells for entry in self.optima]
        named += [cells for _, row in rows for cells in (row.cells, *row.cells_by_column.values())]
        if not {place for places in named for place in places} <= set(range(len(self.cells))):
            raise ValueError("it names cells that it does not have")
        if any(len(row.texts) != len(table.columns) for table, row in rows):
            raise ValueError("a row has not one text a column")
        return self


def trace_json(study: Study, document: Document, numbers: Iterable[Number]) -> str:
    """Every macro and table cell with the cells it rests on, and the runs of those."""
    specification = study.results.manifest.specification
    places = {key: place for place, key in enumerate(document.runs)}

    def of(keys: Iterable[CellKey]) -> Places:
        return tuple(places[key] for key in keys)

    content = TraceFile(
        suite=Suite(
            name=specification.suite,
            runs=specification.runs,
            trials=specification.trials,
            seed=specification.seed,
        ),
        specification=content_hash(specification.model_dump(mode="json")),
        environment=_environment(study),
        cells=tuple(_cells(study, document)),
        macros={
            number.macro: TracedMacro(
                texts=dict(number.companions()),
                meaning=number.meaning,
                of=number.of,
                how=number.how,
                origin=number.origin,
                cells=of(number.cells),
            )
            for number in numbers
        },
        optima=tuple(
            TracedOptimum(
                task=task, other_arm=arm, reward=best.reward, how=best.how, cells=of(best.cells)
            )
            for (task, arm), best in study.optima.items()
        ),
        tables={table.id: _table(table, places) for table in document.tables()},
    )
    return json_text(content.model_dump(mode="json"))


def read_trace(home: Path) -> TraceFile:
    """The trace of the report in ``home``. Raises CoarticError where there is none to be read."""
    again = f"make the report again with `{shell_line('coartic', 'report', home.parent)}`"
    try:
        text = (home / FILE).read_text(encoding="utf-8")
        form = _Header.model_validate_json(text).format
        if form != FORMAT:
            raise CoarticError(
                f"{home / FILE} has format {form}, this version reads {FORMAT}; {again}"
            )
        return TraceFile.model_validate_json(text)
    except (OSError, UnicodeDecodeError) as error:
        raise CoarticError(f"{home / FILE} cannot be read: {error}") from None
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        raise CoarticError(
            f"{home / FILE} is damaged ({place}: {first['msg']}); {again}"
        ) from None


class _Header(BaseModel):
    format: Any = None


def _environment(study: Study) -> Environment:
    content = study.results.manifest.environment.model_dump(mode="json")
    first, *rest = (
        Path(word).name if Path(word).is_absolute() else word for word in content["command"]
    )
    started = ["python", "-m", "coartic"] if first == "__main__.py" else [first]
    return Environment.model_validate({**content, "command": [*started, *rest]})


def _cells(study: Study, document: Document) -> Iterable[TracedCell]:
    commits = study.runs.set_index("run_id").commit.astype(object).fillna("unknown")
    for (task, label), runs in document.runs.items():
        yield TracedCell(
            task=task,
            label=label,
            method=study.cells[task, label].method,
            runs=runs,
            commits=tuple(sorted(set(commits[list(runs)]))),
        )


def _table(table: DataTable, places: dict[CellKey, int]) -> TracedTable:
    return TracedTable(
        caption=table.caption,
        notes=_notes(table),
        columns=tuple(
            TracedColumn(
                name=column.name,
                head=head,
                rests_on=column.rests_on,
                other_arm=column.other_arm,
            )
            for column, head in zip(table.columns, heads(table), strict=True)
        ),
        rows={
            row.key: TracedRow(
                texts=tuple(texts(table, row)),
                cells=tuple(places[key] for key in row.cells),
                cells_by_column={
                    name: tuple(places[key] for key in keys)
                    for name, keys in row.cells_by_column.items()
                },
            )
            for row in table.rows
        },
    )


def _notes(table: DataTable) -> tuple[str, ...]:
    """A table's notes as plain text; those of methods share what stands above them all."""
    above = READING_OF_METHODS if table.id.startswith("methods-") else ()
    return tuple(dict.fromkeys(words(note) for note in (*above, *table.notes)))
