"""The runs of a results folder: one SQLite file, ``runs.sqlite``.

``plan`` has a row for each cell that the last ``coartic run`` asked for; ``cells`` has these cells
and the cells of earlier commands. ``results`` has a row for each run, ``movements`` for each
movement of its parts, ``learning`` the rewards of its trials. The views ``runs`` and
``solutions`` show the runs of the plan; docs/results.md lists their columns. One process writes, a
batch of finished runs at a time; whatever interrupts it, a batch is there whole or not at all.
"""

from __future__ import annotations

import fcntl
import itertools
import json
import os
import pickle
import re
import sqlite3
import time
import warnings
import zlib
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_args

import numpy as np
from pydantic import BaseModel, Field, TypeAdapter, ValidationError

from coartic.errors import CoarticError
from coartic.internal.files import make_folder
from coartic.internal.limits import (
    MOST_RUNS,
    MOST_SECONDS,
    MOST_SEED,
    MOST_TRIALS,
    check_limits,
)
from coartic.internal.text import one_line, plain
from coartic.internal.validation import explain_inline
from coartic.method import Meter
from coartic.model import PAPER
from coartic.motion.solution import Movement
from coartic.robot import Array
from coartic.runs.method_info import version_of
from coartic.runs.plan import Cell, Job, hash_of
from coartic.runs.record import (
    COLUMNS,
    EARLIER,
    LATE,
    LONGEST_SOLUTION,
    PREFIXES,
    Outcome,
    Run,
    Score,
    Status,
    Times,
    mark_of,
    movement_data,
    movement_from,
    reward_bytes,
)
from coartic.tasks.task import parse_task

if TYPE_CHECKING:
    import pandas as pd

RUNS_FILE = "runs.sqlite"
FORMAT = 6
"""Number of the format: a change of a table or of a view raises it."""
_APPLICATION = 0x636F6172  # "coar"

_KINDS = {"TEXT": "string", "INTEGER": "Int64", "REAL": "Float64", "BOOLEAN": "boolean"}
_DTYPES: dict[str, Any] = {
    **dict.fromkeys(("hand", "kind", "path"), "string"),
    **dict.fromkeys(("order", "goal", "ticks"), "Int64"),
    **{name: _KINDS[kind.split()[0]] for name, kind, *_ in COLUMNS},
}
"""Types of the columns of views in data frames; all have room for missing values."""
_CELL = TypeAdapter(Cell)
_OF_METHOD = ("title", "citation", "stochastic", "defaults", "origin", "code")
"""Columns of table ``cells`` that are fields of the method."""


def _rule(name: str, kind: str) -> str:
    """Return the condition, in SQL, that SQLite checks for a column of table ``results``, from its
    name and its type, such as ``TEXT NOT NULL``."""
    if kind.startswith("TEXT"):
        letters = f" AND {name} NOT GLOB '*[^LR]*'" if name.endswith("hands") else ""
        return f"typeof({name}) != 'blob'{letters}"
    if kind == "BOOLEAN":
        return f"{name} BETWEEN 0 AND 1"
    limits = "-1e19 AND 0" if name.endswith("reward") else "0 AND 1e19"  # minus a count of ticks
    whole = "" if kind == "REAL" else f" AND typeof({name}) != 'real'"
    return f"{name} BETWEEN {limits}{whole}"


_STORED = ", ".join(
    f"{name} {kind} CHECK ({_rule(name, kind)})" for name, kind, source, _ in COLUMNS if source
)
_IN_VIEW = ", ".join(f'"{name}"' for name, *_ in COLUMNS)
_ASKED = """SELECT position, results.*, suite.name AS suite, task, method, setting,
    information, parameters, code, commit_id AS "commit", packages
    FROM suite JOIN plan JOIN cells ON cells.id = plan.cell JOIN results
    ON results.cell = plan.cell AND suite_seed = suite.seed AND run < plan.runs
    JOIN environments ON environments.id = results.environment"""
_RUNS = f"SELECT {_IN_VIEW} FROM asked ORDER BY position, run"
_SOLUTIONS = """SELECT run_id, "order", goal, hand, kind, ticks, path
    FROM asked JOIN movements ON result_id = asked.id AND part = 'solution'
    ORDER BY position, run, movements."order\""""
_SCHEMA = (
    """CREATE TABLE suite (name TEXT, seed INTEGER, time_limit_s REAL, command TEXT, date TEXT,
    environment INTEGER, plan_hash TEXT)""",
    """CREATE TABLE plan (position INTEGER PRIMARY KEY,
    cell INTEGER NOT NULL UNIQUE REFERENCES cells, runs INTEGER NOT NULL)""",
    """CREATE TABLE cells (id INTEGER PRIMARY KEY, digest TEXT NOT NULL, code TEXT NOT NULL,
    task TEXT NOT NULL, definition TEXT NOT NULL, method TEXT NOT NULL, title TEXT NOT NULL,
    citation TEXT NOT NULL, information TEXT NOT NULL, stochastic INTEGER NOT NULL,
    defaults TEXT NOT NULL, origin TEXT NOT NULL, parameters TEXT NOT NULL, setting TEXT NOT NULL,
    model TEXT NOT NULL, trial_budget INTEGER, UNIQUE (digest, code))""",
    """CREATE TABLE environments (id INTEGER PRIMARY KEY, content TEXT NOT NULL UNIQUE,
    commit_id TEXT, packages TEXT)""",
    f"""CREATE TABLE results (id INTEGER PRIMARY KEY, cell INTEGER NOT NULL REFERENCES cells,
    suite_seed INTEGER NOT NULL, environment INTEGER NOT NULL REFERENCES environments,
    details TEXT NOT NULL, {_STORED}, UNIQUE (cell, suite_seed, run),
    CHECK (status IN {get_args(Status)}),
    CHECK ((status = 'ok') = (reward IS NOT NULL) AND (status = 'ok') = (hands IS NOT NULL)))""",
    """CREATE TABLE movements (result_id INTEGER NOT NULL, part TEXT NOT NULL,
    "order" INTEGER NOT NULL, goal INTEGER NOT NULL, hand TEXT NOT NULL, kind TEXT NOT NULL,
    ticks INTEGER NOT NULL, path TEXT NOT NULL, PRIMARY KEY (result_id, part, "order"))
    WITHOUT ROWID""",
    "CREATE TABLE learning (result_id INTEGER PRIMARY KEY, rewards BLOB NOT NULL)",
    f"CREATE VIEW asked AS {_ASKED}",
    f"CREATE VIEW runs AS {_RUNS}",
    f"CREATE VIEW solutions AS {_SOLUTIONS}",
)
"""Statements that make the tables and views, each as SQLite keeps it. The views are for people and
their scripts: this module asks by the same queries, whatever the views of a file say."""
_PLANNED = (
    """SELECT name, seed, time_limit_s, command, date, content FROM suite
    JOIN environments ON environments.id = environment""",
    "SELECT * FROM plan JOIN cells ON cells.id = cell ORDER BY position",
)
"""Queries of all that a plan says; ``plan_hash`` is a hash of their rows."""

LONGEST_VALUE = 50_000_000  # bytes of a value in the file
LONGEST_TASK = 100_000  # characters of the definition of a task
_LOCKED = "SQLITE_BUSY", "SQLITE_LOCKED"  # beginnings of names of errors
_ROWS_AT_ONCE = 5_000  # of a frame, as objects
_UNIQUE = "run_id", "result", "path"  # columns whose texts differ: others are kept once
WAIT_S = 1.0  # wait for another program
_LONGEST_PATH = 500  # letters of the path of a file; SQLite adds those of its journal


class _Commit(BaseModel):
    id: str
    dirty: bool


class _Surroundings(BaseModel):
    """Facts on the last ``coartic run`` that reports and citations state."""

    coartic: str
    commit: _Commit | None
    processor: str
    cores: int
    command: list[str]
    date: str
    question: Annotated[list[str], Field(min_length=2, max_length=2)] = ["", ""]


class Store:
    """The runs of one results folder."""

    def __init__(self, folder: Path, connection: sqlite3.Connection) -> None:
        self.folder = folder
        self._db = connection
        self._cells = dict[sqlite3.Row, Cell]()  # that were read

    # The plan.

    def begin_as(self, other: Store) -> bool:
        """Replace the content of this store by a copy of another store's content, and return True,
        if this store has no run; else return False."""
        if empty := not self.ids():
            other._db.backup(self._db)
        return empty

    def replace_plan(self, plan: Sequence[Job], made_with: Mapping[str, Any]) -> None:
        """Put a plan, a list of jobs, in place of the earlier plan, whose runs stay in the file.
        ``made_with`` has versions, platform, commit, ``command`` and ``date`` of this command, by
        name. Raises CoarticError if the folder holds another suite."""
        first = plan[0]
        environment = dict(made_with)
        if first.suite_trials is not None:
            environment["suite_trials"] = first.suite_trials
        if first.question is not None:
            environment["question"] = first.question
        suite = {"name": first.suite, "seed": first.seed, "time_limit_s": first.time_limit_s}
        suite |= {name: environment.pop(name) for name in ("command", "date")}
        with self.transaction():
            there = self._one("SELECT name FROM suite")
            if there is not None and there["name"] != first.suite:
                raise CoarticError(
                    f"{self.folder} holds results of suite {there['name']!r}: name another folder "
                    f"for suite {first.suite!r}"
                )
            self._db.execute("DELETE FROM suite")
            self._db.execute("DELETE FROM plan")
            self._insert("suite", suite | {"environment": self._environment(environment)})
            for position, job in enumerate(plan):
                row, (cell, _) = _cell_row(job.cell), self._cell(job.cell)
                # A cell of an earlier command may have had other defaults.
                latest = (_as_text(row["defaults"]), row["setting"], row["origin"], cell)
                query = "UPDATE cells SET defaults = ?, setting = ?, origin = ? WHERE id = ?"
                self._db.execute(query, latest)
                asked = {"position": position, "cell": cell, "runs": job.numbers[-1] + 1}
                self._insert("plan", asked)
            self._db.execute("UPDATE suite SET plan_hash = ?", (self._plan_hash(),))

    def plan(self) -> list[Job]:
        """Return the plan of the folder, a list of the jobs of the last suite, without
        ``question``; ``where`` of their methods is empty. Raises CoarticError if no plan is stored
        yet, or if it is not as written."""
        with explain_errors(self.folder):
            suite = self._suite()
            if suite["plan_hash"] != self._plan_hash():
                raise ValueError("the plan is not as it was written")
            check_limits("the seed", suite["seed"], 0, MOST_SEED)
            if suite["time_limit_s"] is not None:
                check_limits("the time limit", suite["time_limit_s"], 0.0, MOST_SECONDS)
            content = json.loads(suite["content"])
            trials = content.get("suite_trials") if isinstance(content, dict) else None
            if trials is not None:
                check_limits("the suite's number of trials", trials, 1, MOST_TRIALS)
            name, limit_s, plan = suite["name"], suite["time_limit_s"], list[Job]()
            for row in self._db.execute(_PLANNED[1]):
                check_limits("the number of runs", row["runs"], 1, MOST_RUNS)
                cell, numbers = self._read_cell(row), range(row["runs"])
                plan.append(Job(cell, suite["seed"], numbers, limit_s, name, trials))
            if not plan:
                raise ValueError("the plan is empty")
            return plan

    def made_with(self) -> dict[str, Any]:
        """Return versions, platform, commit, ``command`` and ``date`` of the last ``coartic run``,
        by name. Raises CoarticError if no plan is stored yet."""
        with explain_errors(self.folder):
            row = self._suite()
            how = {"command": json.loads(row["command"]), "date": row["date"]}
            content = dict(json.loads(row["content"])) | how
            _Surroundings.model_validate(content, strict=True)
            return content

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """Write all changes of the block of this context, or none if the block fails. A block
        within another block is a part of the outer block. Raises CoarticError for an error of
        SQLite, such as a full disk."""
        if self._db.in_transaction:
            yield
            return
        try:
            self._wait_for("BEGIN IMMEDIATE")
            yield
            self._wait_for("COMMIT")
        except sqlite3.DatabaseError as error:
            raise CoarticError(_explain(self.folder / RUNS_FILE, error)) from None
        finally:
            if self._db.in_transaction:
                self._db.rollback()

    # Ids and counts of runs.

    def present(self) -> list[tuple[int, int, str, float | None]]:
        """Return the runs of the plan that the folder has: for each run the position of its job in
        the plan, from 0, its number, its status and its time limit in s, None for no limit."""
        return self._rows("SELECT position, run, status, time_limit_s FROM asked")

    def stale(self) -> Counter[tuple[str, str, str]]:
        """Return the number of runs of the plan that the folder has from another version or code of
        their method, by a triple: id of the method, other version, and version in the plan."""
        query = """SELECT now.method, old.code, now.code, count(*)
            FROM suite JOIN plan JOIN cells AS now ON now.id = plan.cell
            JOIN cells AS old ON old.digest = now.digest AND old.code != now.code
            JOIN results ON results.cell = old.id AND suite_seed = suite.seed AND run < plan.runs
            WHERE old.id NOT IN (SELECT cell FROM plan) GROUP BY 1, 2, 3"""
        found = Counter[tuple[str, str, str]]()
        for name, old, now, count in self._rows(query):
            found[name, version_of(old), version_of(now)] += count
        return found

    def marks(self) -> dict[str, list[str]]:
        """Return, by id of a method, warnings about its runs of the plan, in sentences
        (:func:`.mark_of`): that files were loaded too late, or results depend on earlier runs."""
        found = defaultdict[str, list[str]](list)
        for kind in (LATE, EARLIER):
            query = f"""SELECT DISTINCT method, value FROM asked, json_each(details, '$.{kind}')
                WHERE json_type(details, '$.{kind}') = 'array' ORDER BY method, value"""
            for method, rows in groupby(self._rows(query), itemgetter(0)):
                found[method].append(mark_of(method, kind, [str(value) for _, value in rows]))
        return dict(found)

    def imports(self) -> dict[str, list[str]]:
        """Return, by id of a method from a file, the packages that its file imports, over all runs
        of the plan, each as a name with a version."""
        query = """SELECT DISTINCT method, value FROM asked
            JOIN environments ON environments.id = environment, json_each(content, '$.imports')
            WHERE json_type(content, '$.imports') = 'array' ORDER BY method, value"""
        rows = groupby(self._rows(query), itemgetter(0))
        return {method: [plain(str(value), 100) for _, value in of] for method, of in rows}

    def others(self) -> Counter[int]:
        """Return the number of runs in the folder that the plan does not ask for, by the seed of
        their suite, with the runs of another version or code of their method (:meth:`stale`)."""
        query = """SELECT suite_seed, count(*) FROM results WHERE id NOT IN (SELECT id FROM asked)
            GROUP BY suite_seed"""
        return Counter(dict(self._rows(query)))

    def ids(self, prefix: str = "") -> list[str]:
        """Return the ids that begin with ``prefix``, of all runs, also of earlier plans."""
        query = "SELECT run_id FROM results WHERE substr(run_id, 1, ?) = ?"
        return [run_id for (run_id,) in self._rows(query, len(prefix), prefix)]

    def results(self) -> list[tuple[str, str]]:
        """Return the id of each run of the plan that the folder has, in the order of the plan, with
        the hash of its outcome."""
        return self._rows("SELECT run_id, result FROM asked ORDER BY position, run")

    # Writing and reading runs.

    def write(self, runs: Iterable[Run]) -> None:
        """Write finished runs, all of them or none, in place of earlier runs of the same cells,
        seeds and numbers. Raises CoarticError if the disk is full or a run does not fit the
        tables."""
        with self.transaction():
            for run in runs:
                try:
                    self._write_run(run)
                except (sqlite3.IntegrityError, sqlite3.DataError, OverflowError) as error:
                    raise CoarticError(
                        f"run {run.id} of {run.cell.method.name} cannot be stored: {error}"
                    ) from None

    def run(self, run_id: str) -> Run:
        """Return a run by its id; ``suite`` of its job and ``where`` of its method are empty.
        Raises CoarticError if the folder has no such run, or its rows do not fit its id."""
        with explain_errors(self.folder):
            row = self._one("SELECT * FROM results WHERE run_id = ?", run_id)
            if row is None:
                raise CoarticError(f"it has no run {run_id}")
            stored_cell = self._one("SELECT * FROM cells WHERE id = ?", row["cell"])
            if stored_cell not in self._cells:
                self._cells[stored_cell] = self._read_cell(stored_cell)
            cell = self._cells[stored_cell]
            environment = self._one("SELECT * FROM environments WHERE id = ?", row["environment"])
            blob = self._one("SELECT rewards FROM learning WHERE result_id = ?", row["id"])
            rewards = _unpack(blob[0], row["trials"]) if blob else np.empty(0)
            meter = {name: row[name] for name in vars(Meter())}
            self._check_lengths("WHERE result_id = ?", row["id"])
            parts: dict[str, list[Movement]] = {part: [] for part in PREFIXES}
            query = """SELECT part, goal, hand, kind, ticks, path FROM movements
                WHERE result_id = ? ORDER BY "order\""""
            for part, *data in self._db.execute(query, (row["id"],)):
                parts[part].append(movement_from(data))
            outcome = Outcome(
                row["status"],
                row["reason"],
                details=dict(json.loads(row["details"])),
                used=tuple(filter(None, row["used"].split(", "))),
                meter=None if row["trials"] is None else Meter(**meter),
                rewards=[None if np.isnan(reward) else int(reward) for reward in rewards.tolist()],
                times=Times(**{name: row[name] for name in vars(Times())}),
                environment=dict(json.loads(environment["content"])),
            )
            scores = {
                part: Score(row[f"{prefix}reward"], row[f"{prefix}hands"], tuple(parts[part]))
                for part, prefix in PREFIXES.items()
                if parts[part]
            }
            if "solution" in scores:
                scores["solution"] = scores["solution"]._replace(
                    corrections=row["solution_corrections"],
                    other_arm_travel=row["other_arm_travel"],
                )
            job = Job(cell, row["suite_seed"], (row["run"],), row["time_limit_s"])
            run = Run(job, outcome, scores, row["date"])
            if (run.id, run.seed) != (run_id, row["seed"]):
                raise ValueError(f"run {run_id} is not the run that its id says")
            return run

    def runs(self) -> pd.DataFrame:
        """Return view ``runs``, a row for each run of the plan that the folder has, in order, as a
        data frame with the columns :data:`.COLUMNS` (nullable types)."""
        return self._frame(_RUNS)

    def solutions(self) -> pd.DataFrame:
        """Return view ``solutions``, a row for each movement of the plan's solutions, as a data
        frame (nullable types). Columns: ``run_id``, ``order`` (from 0), ``goal`` (from 1),
        ``hand``, ``kind``, ``ticks`` and ``path`` (configurations as JSON)."""
        self._check_lengths()
        return self._frame(_SOLUTIONS)

    def movements(self, part: str, most: int) -> dict[str, tuple[Movement, ...]]:
        """Return, by run id, the movements of a part (``solution``, ``initial`` or ``replay``) of
        the first ``most`` ok runs of each cell of the plan; runs without the part are left out."""
        query = """SELECT run_id, goal, hand, kind, ticks, path FROM
            (SELECT *, row_number() OVER (PARTITION BY position ORDER BY run) AS place
            FROM asked WHERE status = 'ok') AS solved
            JOIN movements ON result_id = solved.id AND part = ? WHERE place <= ?
            ORDER BY position, run, "order\""""
        self._check_lengths()
        with explain_errors(self.folder):
            rows = self._execute(query, (part, most))
            return {
                run_id: tuple(movement_from(row[1:]) for row in of_run)
                for run_id, of_run in groupby(map(tuple, rows), itemgetter(0))
            }

    def rewards(self) -> Iterator[tuple[str, Array]]:
        """Yield, for each run of the plan with rewards of trials, its id and its k rewards, shape
        ``(k,)``; NaN stands for a trial that failed or whose reward is not kept."""
        query = """SELECT run_id, rewards, trials FROM asked
            JOIN learning ON result_id = asked.id ORDER BY position, run"""
        with explain_errors(self.folder):
            for run_id, blob, trials in self._execute(query):
                yield run_id, _unpack(blob, trials)

    # Rows.

    def _suite(self) -> Any:
        """Return the row of table ``suite`` on the last ``coartic run``, with the columns of its
        environment. Raises CoarticError if no suite is stored."""
        row = self._one("SELECT * FROM suite LEFT JOIN environments ON id = environment")
        if row is None:
            raise CoarticError("it is not finished; repeat the `coartic run` command")
        return row

    def _write_run(self, run: Run) -> None:
        """Write a run into the tables, in place of an earlier run of its cell, seed and number."""
        cell, code = self._cell(run.cell)
        key = cell, run.job.seed, run.number
        query = "SELECT id FROM results WHERE cell = ? AND suite_seed = ? AND run = ?"
        if earlier := self._one(query, *key):
            for table in ("movements", "learning"):
                self._db.execute(f"DELETE FROM {table} WHERE result_id = ?", (earlier["id"],))
            self._db.execute("DELETE FROM results WHERE id = ?", (earlier["id"],))
        row = run.to_row() | {"cell": cell, "run_id": run.job.run_id(run.number, code)}
        row["environment"] = self._environment(run.outcome.environment or {})
        result = self._insert("results", row)

        names = "goal", "hand", "kind", "ticks", "path"
        for part, score in run.scores.items():
            for order, movement in enumerate(score.movements):
                place = {"result_id": result, "part": part, "order": order}
                data = dict(zip(names, movement_data(movement), strict=True))
                self._insert("movements", place | data)
        if rewards := run.outcome.rewards:
            packer = zlib.compressobj(9, strategy=zlib.Z_FILTERED)
            blob = packer.compress(reward_bytes(rewards)) + packer.flush()
            self._insert("learning", {"result_id": result, "rewards": blob})

    def _read_cell(self, row: Mapping[str, Any]) -> Cell:
        """Return a cell from its row of table ``cells``; ``where`` of its method is empty. Raises
        an error, such as ValueError or TaskError, if the row makes no cell, or a cell with another
        digest, setting or name of its task."""
        method = {name: row[name] for name in _OF_METHOD} | {
            "name": row["method"],
            "defaults": json.loads(row["defaults"]),
            "information": tuple(filter(None, row["information"].split(", "))),
        }
        if len(row["definition"]) > LONGEST_TASK:
            raise ValueError(f"the task of {len(row['definition'])} characters is too long")
        content = {
            "task": parse_task(json.loads(row["definition"]), str(self.folder / RUNS_FILE)),
            "method": method,
            "parameters": json.loads(row["parameters"]),
            "trial_budget": row["trial_budget"],
        }
        cell: Cell = _CELL.validate_python(content)
        named = cell.digest, cell.setting, cell.task.name
        if named != (row["digest"], row["setting"], row["task"]):
            raise ValueError(f"{cell.label} on {cell.task.name} is not the cell that was run")
        return cell

    def _check_lengths(self, condition: str = "", *values: object) -> None:
        """Raise CoarticError if the paths of a part of a run have more than 10,000,000 characters
        together, in all rows of table ``movements``, or in rows that satisfy an SQL ``condition``,
        with ``values`` for its question marks."""
        query = f"""SELECT max(length) FROM (SELECT sum(length(path)) AS length FROM movements
            {condition} GROUP BY result_id, part)"""
        with explain_errors(self.folder):
            if ((self._one(query, *values)[0]) or 0) > LONGEST_SOLUTION:
                raise ValueError("a solution is too long")

    def _plan_hash(self) -> str:
        """Return the hash, 64 hex digits, of the stored plan: settings of the suite, command, date,
        environment and cells."""
        return hash_of([[*row] for query in _PLANNED for row in self._db.execute(query)])

    def _environment(self, content: dict[str, Any]) -> int:
        """Return the id of the row of an environment, the versions, platform and commit of a
        process by name; insert the row if it is missing."""
        commit = content.get("commit")
        row = {
            "content": json.dumps(content, ensure_ascii=False, sort_keys=True),
            "commit_id": commit and commit["id"] + "+" * commit["dirty"],
            "packages": hash_of([content.get("python"), content.get("packages")])[:8],
        }
        stored = self._one("SELECT id FROM environments WHERE content = ?", row["content"])
        return self._insert("environments", row) if stored is None else int(stored["id"])

    def _cell(self, cell: Cell) -> tuple[int, str]:
        """Return the id and the code of the row of a cell; insert the row if it is missing. A row
        that 4.0.0 wrote keeps its code, a hash, and counts as a row of the version for which this
        code stands."""
        for number, code in self._rows("SELECT id, code FROM cells WHERE digest = ?", cell.digest):
            if version_of(code) == cell.method.version:
                return number, code
        return self._insert("cells", _cell_row(cell)), cell.method.code

    def _insert(self, table: str, row: Mapping[str, Any]) -> int:
        """Insert a row, values by column, into a table; return the id of the row, if the table
        has ids. Lists, tuples and dictionaries become JSON."""
        names = ", ".join(f'"{name}"' for name in row)
        marks = ", ".join("?" for _ in row)
        text = f"INSERT INTO {table} ({names}) VALUES ({marks})"
        return int(self._db.execute(text, [*map(_as_text, row.values())]).lastrowid or 0)

    def _execute(self, query: str, values: Sequence[object] = ()) -> sqlite3.Cursor:
        """Execute a query with ``values``, in which ``asked`` is a table of the runs of the
        plan."""
        return self._db.execute(f"WITH asked AS ({_ASKED}) {query}", values)

    def _rows(self, query: str, *values: object) -> list[Any]:
        """Return a list of the rows of a query (:meth:`_execute`). Raises CoarticError if the file
        cannot be read."""
        with explain_errors(self.folder):
            return self._execute(query, values).fetchall()

    def _one(self, query: str, *values: object) -> Any:
        """Return the first row of a query (:meth:`_rows`); None if it has no row."""
        return next(iter(self._rows(query, *values)), None)

    def _frame(self, query: str) -> pd.DataFrame:
        """Return the rows of a query as a data frame, with nullable types."""
        import pandas as pd

        # astype refuses numbers that are too large
        with explain_errors(self.folder), np.errstate(invalid="ignore"):
            rows, parts, once = self._execute(query), list[pd.DataFrame](), dict[str, str]()
            names = [column[0] for column in rows.description]
            while (some := rows.fetchmany(_ROWS_AT_ONCE)) or not parts:
                frame = pd.DataFrame(list(map(tuple, some)), columns=names, dtype=object)
                for name in names:
                    if _DTYPES[name] == "string" and name not in _UNIQUE:
                        frame[name] = [once.setdefault(text, text) for text in frame[name]]
                # Texts that stay among objects that go would keep the memory of all of them.
                unique = {n: pickle.dumps(frame.pop(n).tolist()) for n in names if n in _UNIQUE}
                frame = frame.astype({name: _DTYPES[name] for name in names if name not in unique})
                del some
                for name, texts in unique.items():
                    frame[name] = pd.array(pickle.loads(texts), dtype=_DTYPES[name])
                parts.append(frame[names])
            return pd.concat(parts, ignore_index=True)

    def _wait_for(self, statement: str) -> None:
        """Execute a statement; while another program locks the file, try again, with a warning
        before the third time."""
        for tries in itertools.count():
            if tries == 2:
                warnings.warn(
                    f"another program has {self.folder / RUNS_FILE} open: waiting for it",
                    stacklevel=2,
                )
            try:
                self._db.execute(statement)
                return
            except sqlite3.OperationalError as error:
                if not error.sqlite_errorname.startswith(_LOCKED):
                    raise


def _as_text(value: Any) -> Any:
    """Return a list, a tuple or a dictionary as JSON, and any other value unchanged."""
    is_table = isinstance(value, dict | list | tuple)
    return json.dumps(value, ensure_ascii=False) if is_table else value


def _cell_row(cell: Cell) -> dict[str, Any]:
    """Return the row of a cell in table ``cells``, values by column, without its id."""
    method = vars(cell.method)
    return {name: method[name] for name in _OF_METHOD} | {
        "digest": cell.digest,
        "task": cell.task.name,
        "definition": cell.definition,
        "method": cell.method.name,
        "information": ", ".join(cell.method.information),
        "parameters": cell.parameters,
        "setting": cell.setting,
        "model": PAPER.for_radius(cell.task.radius)._asdict(),
        "trial_budget": cell.trial_budget,
    }


@contextmanager
def open_store(folder: Path) -> Iterator[Store]:
    """Open a results folder for reading in the block of this context. Raises CoarticError if the
    folder has no results, or results in another format, and while a ``coartic run`` writes into it
    (:func:`lock`)."""
    path = folder / RUNS_FILE
    with explain_errors(folder):
        try:
            path.lstat()
        except (FileNotFoundError, NotADirectoryError):
            near = [*folder.parent.glob(RUNS_FILE), *sorted(folder.glob(f"*/{RUNS_FILE}"))][:3]
            meant = " or ".join(str(each.parent) for each in near)
            hint = f"; did you mean {meant}?" if near else ""
            what = f"{folder} is not a results folder: it has no {RUNS_FILE}"
            what = what if os.path.lexists(folder) else f"there is no folder {folder}"
            raise CoarticError(f"{what}{hint}") from None
        _check_files(folder)
        opened = _connect(f"{path.absolute().as_uri()}?mode=rw", 5 * WAIT_S)
    with closing(opened) as connection:
        with explain_errors(folder):
            connection.execute("PRAGMA query_only = ON")
            connection.execute("BEGIN")  # all reads of this block see one state
            if not _has_tables(connection):
                raise CoarticError("it is not finished; repeat the `coartic run` command")
            with lock(folder, shared=True):  # refused while a process writes
                pass
        yield Store(folder, connection)


@contextmanager
def open_content(content: bytes, name: str) -> Iterator[Store]:
    """Open the content of a ``runs.sqlite`` in memory for reading; ``name`` stands for its folder
    in messages."""
    with closing(_connect(":memory:", WAIT_S)) as connection:
        connection.deserialize(content)
        yield Store(Path(name), connection)


@contextmanager
def writing(folder: Path) -> Iterator[Store]:
    """Open a results folder for writing in the block of this context, by this process alone
    (:func:`lock`), and make a missing folder. Raises CoarticError if the folder holds something
    else or cannot be written, and while another process writes into it."""
    with explain_errors(folder):
        visible = (entry for entry in folder.glob("*") if not entry.name.startswith("."))
        if not (folder / RUNS_FILE).exists() and any(visible):
            raise CoarticError(
                f"{folder} is not empty and holds no results of coartic. Choose another folder."
            )
        make_folder(folder)
    with lock(folder):
        with explain_errors(folder):
            _check_files(folder)
            opened = _connect((folder / RUNS_FILE).absolute().as_uri(), WAIT_S)
        with closing(opened) as connection:
            with explain_errors(folder):
                is_there = _has_tables(connection)  # raises before anything is written
                # No write-ahead log, which is unsafe on network disks and adds a file.
                connection.execute("PRAGMA journal_mode = DELETE")
                if not is_there:
                    marks = (
                        f"PRAGMA application_id = {_APPLICATION}; PRAGMA user_version = {FORMAT}"
                    )
                    connection.executescript(";\n".join(["BEGIN", *_SCHEMA, marks, "COMMIT"]))
            yield Store(folder, connection)


@contextmanager
def lock(folder: Path, *, shared: bool = False, command: str = "coartic run") -> Iterator[None]:
    """Lock a folder for this process in the block of this context, or, with ``shared``, share the
    lock with other readers; do nothing where the folder cannot be opened, or the disk has no such
    locks. Raises CoarticError, which names ``command``, if the lock is held elsewhere,
    and without ``shared`` stays so for 1 s."""
    try:
        opened = os.open(folder, os.O_RDONLY)
    except OSError:
        yield
        return
    end = time.monotonic() + (0 if shared else WAIT_S)  # a reader holds the lock for a moment
    try:
        while True:
            try:
                fcntl.flock(opened, fcntl.LOCK_NB | (fcntl.LOCK_SH if shared else fcntl.LOCK_EX))
                break
            except BlockingIOError:
                if time.monotonic() > end:
                    raise CoarticError(
                        f"another `{command}` is at work in {folder}; wait for it, or choose "
                        "another folder"
                    ) from None
                time.sleep(WAIT_S / 20)
            except OSError:
                break
        yield
    finally:
        os.close(opened)


def _connect(where: str, timeout_s: float) -> sqlite3.Connection:
    """Return a connection to a ``file:`` address or ``:memory:`` that waits ``timeout_s``, seconds,
    for a lock."""
    connection = sqlite3.connect(where, timeout=timeout_s, isolation_level=None, uri=True)
    connection.row_factory = sqlite3.Row
    connection.execute("PRAGMA trusted_schema = OFF")
    connection.execute("PRAGMA cell_size_check = ON")
    connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, LONGEST_VALUE)
    return connection


def _check_files(folder: Path) -> None:
    """Raise CoarticError if ``runs.sqlite``, or a file that SQLite keeps next to it, is a symbolic
    link or no regular file; missing files pass."""
    for ending in ("", "-journal", "-wal", "-shm"):
        path = folder / f"{RUNS_FILE}{ending}"
        if path.is_symlink():
            holder = plain(str(Path(os.path.realpath(path)).parent))
            raise CoarticError(f"{path} is a link: name the folder that holds the file, {holder}")
        if path.exists() and not path.is_file():
            kind = "a folder" if path.is_dir() else "a pipe or a device"
            raise CoarticError(
                f"{path} is {kind}, not a file: move it away, or name another folder"
            )


def _has_tables(connection: sqlite3.Connection) -> bool:
    """Return True if the file is marked as coartic's in this format, and False if the file has
    neither this mark nor tables. Additions of other programs pass, except triggers. Raises
    CoarticError for any other file, and ValueError for a row that names a missing row."""
    (application,) = connection.execute("PRAGMA application_id").fetchone()
    (version,) = connection.execute("PRAGMA user_version").fetchone()
    there = {kind for (kind,) in connection.execute("SELECT type FROM sqlite_master")}
    if application != _APPLICATION:
        if there:
            raise CoarticError(
                "it is not a file of coartic, or was restored from a dump: move it away, or copy "
                "the file itself"
            )
        return False
    if version > FORMAT:
        raise CoarticError("it was written by a later version of coartic: update coartic")
    if version < FORMAT:
        raise CoarticError(
            "it was written by coartic 3.0.0 or earlier: version 3.0.0 reads it, or says which "
            "version does; or run the suite again with another --out"
        )
    if "trigger" in there:
        raise CoarticError(
            "it has a trigger, which changes what is written: restore a copy, or run the suite "
            "again with another --out"
        )
    for table, row, missing, _ in connection.execute("PRAGMA foreign_key_check"):
        raise ValueError(f"row {row} of {table} names a row of {missing} that is not there")
    return True


_UNREADABLE = (
    *(OSError, sqlite3.DatabaseError, zlib.error),
    *(ValueError, LookupError, TypeError, OverflowError, RecursionError),
)
"""Errors that a file raises that cannot be used, or whose content coartic did not write."""


@contextmanager
def explain_errors(folder: Path) -> Iterator[None]:
    """Turn an error of the block of this context into a CoarticError that names the file: of the
    system (the file that it names, else ``runs.sqlite`` in ``folder``), of SQLite, a CoarticError
    (kept, as one line, if it names the file or the folder), and any ValueError, LookupError,
    TypeError, OverflowError, RecursionError or error of zlib, which are taken for content that
    coartic does not write. Other errors pass."""
    try:
        yield
    except (CoarticError, *_UNREADABLE) as error:
        raise CoarticError(_explain(folder / RUNS_FILE, error)) from None


_BUSY = "another program has it open: close it there, or wait for it"
_DAMAGED = (
    "it is damaged. Move it away and repeat the `coartic run` command, or restore a copy: the file "
    "itself, no dump, nor a pointer of Git LFS, for which `git lfs pull` brings the file"
)
_SENTENCES = {
    "SQLITE_BUSY": _BUSY,
    "SQLITE_LOCKED": _BUSY,
    "SQLITE_READONLY": "it or its folder cannot be written. If a `coartic run` was interrupted "
    "there, copy the whole folder, and use the copy",
    "SQLITE_READONLY_DBMOVED": "it was removed, renamed or replaced while the suite ran: put it "
    "back, or repeat the command to start again",
    "SQLITE_CORRUPT": _DAMAGED,
    "SQLITE_NOTADB": _DAMAGED,
    "SQLITE_TOOBIG": f"a value has more than {LONGEST_VALUE} bytes, which coartic does not write",
    "SQLITE_IOERR": "the system cannot read or write it, as where a disk, a quota or the limit of "
    "file size (`ulimit -f`) is full: make room, and repeat the command",
    "SQLITE_FULL": "the disk is full: make room, and repeat the command",
}
"""Sentences by SQLite's names of errors, or by the first two words of the names."""


def _explain(path: Path, error: Exception) -> str:
    """Return the sentence of :func:`explain_errors` on an error of the file ``path``."""
    said = plain(str(error), 200) or type(error).__name__
    if isinstance(error, CoarticError):
        said = one_line(str(error))
        named = "|".join(re.escape(str(each)) for each in (path, path.parent))
        if re.search(rf"(?<!\S)({named})(?!\w)", said):  # no point in "3.0.0" is folder "."
            return said
    elif isinstance(error, OSError):
        path, said = Path(error.filename or path), error.strerror or said
    elif isinstance(error, sqlite3.Error):
        name = getattr(error, "sqlite_errorname", "")
        said = _SENTENCES.get(name, _SENTENCES.get("_".join(name.split("_")[:2]), said))
        if name.startswith("SQLITE_CANTOPEN"):
            said = _why_not_opened(path) or said
        if "decode to UTF-8" in said or said.startswith("no such table"):  # cut while it is open
            said = _DAMAGED
    else:
        wrong = explain_inline(error, []) if isinstance(error, ValidationError) else said
        said = f"it holds what coartic does not write ({plain(wrong, 200)})"
    return f"cannot use {plain(str(path))}: {said}"


def _why_not_opened(path: Path) -> str:
    """Return why SQLite cannot open a file, in words; empty if the reason is not known."""
    try:
        path.open("rb").close()
    except FileNotFoundError:
        return "" if os.access(path.parent, os.W_OK) else "its folder may not be written"
    except OSError as error:
        return error.strerror or str(error)
    if len(str(path.absolute())) >= _LONGEST_PATH:
        return f"SQLite takes no path of {_LONGEST_PATH} letters: name a folder higher up"
    return ""


def _unpack(blob: bytes, trials: int | None) -> Array:
    """Return the rewards that a ``blob`` of table ``learning`` holds (:func:`reward_bytes`), shape
    ``(k,)`` with k up to ``trials``; NaN for a trial that failed or whose reward is not kept.
    Raises ValueError for a blob that cannot be unpacked or has more rewards than trials."""
    size = 4 * (1 + min(trials or 0, MOST_TRIALS))
    try:
        packed = zlib.decompressobj()
        content = packed.decompress(blob, size + 1)
        if len(content) > size or not packed.eof:
            raise ValueError
        numbers = np.frombuffer(content, np.uint8).reshape(4, -1).T.copy().view("<u4").ravel()
        best = numbers[:1].view("<i4")
        return np.where(numbers[1:] == 0, np.nan, best + 1.0 - numbers[1:])
    except (zlib.error, ValueError, TypeError):
        raise ValueError(f"the rewards of {trials} trials are damaged") from None
