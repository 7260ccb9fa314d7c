"""``trace.json``: what every number of a report rests on, as it is stored.

It holds numbers and tables as the report has them, and the runs of every cell. The same results
give the same text, wherever they lie: the folder of a file in the command that asked for them is
left out.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Literal, Self

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

from coartic import CoarticError, builtin_tasks
from coartic.analysis.report.document import CellKey, DataTable, Document
from coartic.analysis.report.numbers import Number
from coartic.analysis.results.optima import KnownOptimum
from coartic.record import Environment
from coartic.stored import content_hash
from coartic.tables import Plan
from coartic.text import json_text, shell_line

if TYPE_CHECKING:
    from coartic.analysis.study import Study

FILE = "trace.json"


@dataclass(frozen=True)
class Source:
    """The runs of one cell."""

    task: str
    label: str
    run_ids: tuple[str, ...]
    commits: tuple[str, ...]
    command: str
    """Makes the cell's runs anew; empty where it takes files of the user's own."""
    makes: int
    """Runs that the command makes: those of the method's other variants, too."""


class TraceFile(BaseModel):
    """All of it."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    format: Literal[5] = 5
    specification: str
    """SHA-256 of the suite's specification: tasks, methods, parameters, seed, run ids."""
    environment: Environment
    sources: tuple[Source, ...]
    numbers: tuple[Number, ...]
    optima: tuple[tuple[str, str, KnownOptimum], ...]
    """With task and other arm."""
    tables: tuple[DataTable, ...]

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        named = {cell for table in self.tables for row in table.rows for cell in row.all_cells}
        named.update(*(table.unshown for table in self.tables))
        named.update(*(number.cells for number in self.numbers))
        named.update(*(best.cells for *_, best in self.optima))
        if not named <= {(source.task, source.label) for source in self.sources}:
            raise ValueError("it names cells that it does not have")
        return self


def trace_json(study: Study, document: Document, numbers: Iterable[Number]) -> str:
    """Every macro and table with the cells they rest on, and the runs of those."""
    content = trace_content(study, document.tables(), numbers, document.runs)
    return json_text({"format": content.format} | content.model_dump(exclude_defaults=True))


def trace_content(
    study: Study,
    tables: Iterable[DataTable],
    numbers: Iterable[Number],
    runs: Mapping[CellKey, Sequence[str]],
) -> TraceFile:
    """What these tables and numbers rest on; ``runs``: ids by cell."""
    manifest = study.results.manifest
    first, *rest = (
        Path(word).name if Path(word).is_absolute() else word
        for word in manifest.environment.command
    )
    started = ["python", "-m", "coartic"] if first == "__main__.py" else [first]
    command = (*started, *rest)
    return TraceFile(
        specification=content_hash(manifest.specification.model_dump(mode="json")),
        environment=manifest.environment.model_copy(update={"command": command}),
        sources=tuple(_sources(study, runs, command)),
        numbers=tuple(numbers),
        optima=tuple((task, arm, best) for (task, arm), best in study.optima.items()),
        tables=tuple(tables),
    )


def read_trace(home: Path) -> TraceFile:
    """The trace of the report in ``home``. Raises CoarticError where there is none to be read."""
    try:
        return _parsed((home / FILE).read_bytes())
    except OSError as error:
        raise CoarticError(f"{home / FILE} cannot be read: {error}") from None
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        raise CoarticError(
            f"{home / FILE} is damaged, or of another version ({place}: {first['msg']}); move "
            f"{home} away and make the report again with "
            f"`{shell_line('coartic', 'report', home.parent)}`"
        ) from None


@lru_cache(maxsize=4)
def _parsed(data: bytes) -> TraceFile:
    """Once for all the numbers of a report that are asked for."""
    return TraceFile.model_validate_json(data)


def _sources(
    study: Study, runs_of: Mapping[CellKey, Sequence[str]], asked: tuple[str, ...]
) -> Iterator[Source]:
    commits = study.runs.set_index("run_id").commit.astype(object).fillna("unknown")
    own_files = any(word.endswith((".toml", ".py")) for word in asked)
    makes: Counter[CellKey] = Counter()
    for (task, label), runs in runs_of.items():
        makes[task, study.cells[task, label].method] += len(runs)
    for (task, label), runs in runs_of.items():
        method = study.cells[task, label].method
        made_anew = not own_files and task in builtin_tasks()
        yield Source(
            task,
            label,
            tuple(runs),
            tuple(sorted(set(commits[list(runs)]))),
            command_of(study.results.manifest.specification, task, method) if made_anew else "",
            makes[task, method],
        )


def command_of(plan: Plan, task: str, method: str) -> str:
    """Makes the runs of a method on a task anew, of all its variants."""
    options = {
        "--tasks": task,
        "--methods": method,
        "--runs": plan.runs,
        "--trials": plan.trials,
        "--seed": plan.seed,
        "--out": "NEW",
    }
    asked = [str(word) for option in options.items() for word in option]
    asked += [word for reading in plan.readings for word in ("--reading", reading)]
    # After --, a name is not taken for an option.
    line = [*asked, "--", plan.suite] if plan.suite.startswith("-") else [plan.suite, *asked]
    return shell_line("coartic", "run", *line)
