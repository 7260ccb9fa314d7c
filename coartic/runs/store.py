"""The runs of a results folder: one SQLite file, ``runs.sqlite``.

``plan`` has a row for each cell that the last ``coartic run`` asked for; ``cells`` has these cells
and the cells of earlier commands. ``results`` has a row for each run, ``movements`` for each
movement of its solutions, ``waypoints`` for each waypoint of a movement that follows a path,
``learning`` the rewards of its trials. The views ``runs``, ``solutions`` and ``paths`` show the
runs of the plan; docs/results.md lists their columns. One process writes, a batch of finished runs
at a time; whatever interrupts it, a batch is there whole or not at all.
"""

from __future__ import annotations

import itertools
import json
import os
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
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError

from coartic.errors import CoarticError
from coartic.internal.files import make_folder
from coartic.internal.limits import MOST_RUNS, MOST_TRIALS, check_limits
from coartic.internal.text import one_line, plain
from coartic.internal.validation import explain_inline
from coartic.model import PAPER
from coartic.motion.solution import Movement
from coartic.robot import Array
from coartic.runs.plan import Cell, Job, hash_of
from coartic.runs.record import COLUMNS, PARTS, STATUSES, Run, movements_from
from coartic.tasks.task import Task, parse_task

if TYPE_CHECKING:
    import pandas as pd

RUNS_FILE = "runs.sqlite"
FORMAT = 5
"""Number of the format: a change of a table or of a view raises it."""
_APPLICATION = 0x636F6172  # "coar"
FAILED_TRIAL = -(2**31)
"""Stored in place of the reward of a trial that did not hit every goal."""

_KINDS = {"TEXT": "string", "INTEGER": "Int64", "REAL": "Float64", "BOOLEAN": "boolean"}
_DTYPES: dict[str, Any] = {
    **{column.name: _KINDS[column.kind.split()[0]] for column in COLUMNS},
    **dict.fromkeys(("part", "hand", "kind"), "string"),
    **dict.fromkeys(("result_id", "order", "goal", "ticks"), "Int64"),
}
"""Types of the columns of views in data frames; all have room for missing values."""
_CELL, _JOB = TypeAdapter(Cell), TypeAdapter(Job)
_JOINT = re.compile("base_[xy]|(left|right)_[0-9]{1,3}")
_OF_SEVERAL = bytes.fromhex("d9d505f920a163d7")  # end of a journal that names another file
_STORED = ", ".join(f"{name} {kind}" for name, kind, source, _ in COLUMNS if source)
_IN_VIEW = ", ".join(f'"{column.name}"' for column in COLUMNS)
_SCHEMA = f"""
CREATE TABLE suite (name TEXT, seed INTEGER, time_limit_s REAL, command TEXT, date TEXT,
    environment INTEGER);
CREATE TABLE plan (position INTEGER PRIMARY KEY, cell INTEGER NOT NULL UNIQUE REFERENCES cells,
    runs INTEGER NOT NULL);
CREATE TABLE cells (id INTEGER PRIMARY KEY, digest TEXT NOT NULL, code TEXT NOT NULL,
    task TEXT NOT NULL, definition TEXT NOT NULL, method TEXT NOT NULL, title TEXT NOT NULL,
    citation TEXT NOT NULL, information TEXT NOT NULL, stochastic INTEGER NOT NULL,
    defaults TEXT NOT NULL, origin TEXT NOT NULL, parameters TEXT NOT NULL, setting TEXT NOT NULL,
    model TEXT NOT NULL, trial_budget INTEGER, UNIQUE (digest, code));
CREATE TABLE environments (id INTEGER PRIMARY KEY, content TEXT NOT NULL UNIQUE, commit_id TEXT,
    packages TEXT);
CREATE TABLE results (id INTEGER PRIMARY KEY, cell INTEGER NOT NULL REFERENCES cells,
    suite_seed INTEGER NOT NULL, environment INTEGER NOT NULL REFERENCES environments,
    details TEXT NOT NULL, {_STORED}, UNIQUE (cell, suite_seed, run));
CREATE TABLE movements (result_id INTEGER NOT NULL, part TEXT NOT NULL, "order" INTEGER NOT NULL,
    goal INTEGER NOT NULL, hand TEXT NOT NULL, kind TEXT NOT NULL, ticks INTEGER NOT NULL,
    PRIMARY KEY (result_id, part, "order")) WITHOUT ROWID;
CREATE TABLE waypoints (result_id INTEGER NOT NULL, "order" INTEGER NOT NULL,
    waypoint INTEGER NOT NULL, PRIMARY KEY (result_id, "order", waypoint)) WITHOUT ROWID;
CREATE TABLE learning (result_id INTEGER PRIMARY KEY, rewards BLOB NOT NULL);
CREATE VIEW asked AS SELECT position, results.*, suite.name AS suite, task, method, setting,
    information, parameters, code, commit_id AS "commit", packages
    FROM suite JOIN plan JOIN cells ON cells.id = plan.cell JOIN results
    ON results.cell = plan.cell AND suite_seed = suite.seed AND run < plan.runs
    JOIN environments ON environments.id = results.environment;
CREATE VIEW solved AS SELECT *, row_number() OVER (PARTITION BY position ORDER BY run) AS place
    FROM asked WHERE status = 'ok';
CREATE VIEW runs AS SELECT {_IN_VIEW} FROM asked ORDER BY position, run;
CREATE VIEW solutions AS SELECT run_id, movements.* FROM asked
    JOIN movements ON result_id = asked.id AND part = 'solution' ORDER BY position, run, "order";
CREATE VIEW paths AS SELECT run_id, waypoints.* FROM asked
    JOIN waypoints ON result_id = asked.id ORDER BY position, run, "order", waypoint;
PRAGMA application_id = {_APPLICATION};
PRAGMA user_version = {FORMAT};
"""

_SURROUNDINGS: dict[str, Any] = {
    **dict.fromkeys(("coartic", "model_code", "python", "platform", "processor", "date"), str),
    **{"command": list, "packages": dict, "cores": int, "commit": str},
}
"""Types of the facts about the surroundings of a suite that reports show."""
_LOCKED = "SQLITE_BUSY", "SQLITE_LOCKED"  # beginnings of names of errors
WAIT_S = 1.0  # wait for another program
_LONGEST_PATH = 500  # letters of the path of a file; SQLite adds those of its journal


class Store:
    """The runs of one results folder, from :func:`open_store` or :func:`writing`."""

    def __init__(self, folder: Path, connection: sqlite3.Connection) -> None:
        self.folder = folder
        self._db = connection

    # The plan.

    def begin_as(self, other: Store) -> bool:
        """Become a copy of another store if this store has no run; return True if it has become
        a copy."""
        if empty := not self.ids():
            other._db.backup(self._db)
        return empty

    def replace_plan(
        self, plan: Sequence[Job], environment: dict[str, Any], command: list[str], date: str
    ) -> None:
        """Put a plan in place of the earlier plan. Runs that only the earlier plan asked for stay
        in the file, and no view shows them.

        Raises CoarticError if the folder holds another suite.
        """
        first = plan[0]
        with self.transaction():
            for row in self._db.execute("SELECT name FROM suite"):
                if row["name"] != first.suite:
                    raise CoarticError(
                        f"{self.folder} holds results of suite {row['name']!r}: name another "
                        f"folder for suite {first.suite!r}"
                    )
            self._db.execute("DELETE FROM suite")
            self._db.execute("DELETE FROM plan")
            suite = {"name": first.suite, "seed": first.seed, "time_limit_s": first.time_limit_s}
            ran = {"command": command, "date": date, "environment": self._environment(environment)}
            self._insert("suite", suite | ran)
            for position, job in enumerate(plan):
                row = cell_row(job.cell)
                cell = self._id_of("cells", row, "digest", "code")
                # A cell of an earlier command may have had other defaults.
                latest = (as_text(row["defaults"]), row["setting"], row["origin"], cell)
                query = "UPDATE cells SET defaults = ?, setting = ?, origin = ? WHERE id = ?"
                self._db.execute(query, latest)
                asked = {"position": position, "cell": cell, "runs": job.numbers[-1] + 1}
                self._insert("plan", asked)
            robots = [job.cell.task.robot for job in plan]
            add_joints(self._db, (name for robot in robots for name in robot.joint_names))

    def plan(self) -> list[Job]:
        """Return the plan of the folder. Raises CoarticError if no plan is stored yet."""
        with explain_errors(self.folder):
            suite = self._one("SELECT * FROM suite")
            if suite is None:
                raise CoarticError("it is not finished; repeat the `coartic run` command")
            query = "SELECT * FROM plan JOIN cells ON cells.id = cell ORDER BY position"
            tasks: dict[str, Task] = {}
            jobs = []
            for row in self._db.execute(query):
                check_limits("runs", row["runs"], 1, MOST_RUNS)
                cell = self._read_cell(row)
                if tasks.setdefault(cell.task.name, cell.task) != cell.task:
                    raise ValueError(f"two tasks are called {cell.task.name!r}")
                asked = {"seed": suite["seed"], "time_limit_s": suite["time_limit_s"]}
                asked |= {"cell": cell, "numbers": range(row["runs"]), "suite": suite["name"]}
                jobs.append(_JOB.validate_python(asked))
            return jobs

    def made_with(self) -> dict[str, Any]:
        """Return versions, platform, commit, command line and date of the last ``coartic run``."""
        with explain_errors(self.folder):
            row = self._one(
                "SELECT content, command, date FROM suite JOIN environments ON id = environment"
            )
            how = {"command": json.loads(row["command"]), "date": row["date"]}
            made_with = json.loads(row["content"]) | how
            facts = made_with | {"commit": (made_with["commit"] or {"id": ""})["id"]}
            for name, kind in _SURROUNDINGS.items():
                if not isinstance(facts[name], kind):
                    raise ValueError(f"{name} is {plain(repr(facts[name]), 80)}")
            return dict(made_with)

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """Write all changes of this block, or none if it fails. A block within another block is a
        part of that block.

        Raises CoarticError if the disk is full or the file is gone.
        """
        if self._db.in_transaction:
            yield
            return
        try:
            self._wait_for("BEGIN IMMEDIATE")
            yield
            self._wait_for("COMMIT")
        except sqlite3.DatabaseError as error:
            raise CoarticError(explain(self.folder / RUNS_FILE, error)) from None
        finally:
            if self._db.in_transaction:
                self._db.rollback()

    # Ids and counts of runs.

    def present(self) -> list[tuple[int, int, str, float | None]]:
        """Return the runs of the plan that the folder has: for each run the position of its job in
        the plan, its number, its status and its time limit in s."""
        query = "SELECT position, run, status, time_limit_s FROM asked"
        with explain_errors(self.folder):
            return list(map(tuple, self._db.execute(query)))

    def stale(self) -> int:
        """Return the number of runs of the plan that other code made."""
        query = """SELECT count(*) FROM suite JOIN plan JOIN cells AS now ON now.id = plan.cell
            JOIN cells AS old ON old.digest = now.digest AND old.code != now.code
            JOIN results ON results.cell = old.id AND suite_seed = suite.seed AND run < plan.runs
            WHERE old.id NOT IN (SELECT cell FROM plan)"""
        with explain_errors(self.folder):
            return int(self._one(query)[0])

    def others(self) -> Counter[int]:
        """Return the number of runs that the plan does not ask for, by the seed of their suite."""
        query = """SELECT suite_seed, count(*) FROM results WHERE id NOT IN (SELECT id FROM asked)
            GROUP BY suite_seed"""
        with explain_errors(self.folder):
            return Counter(dict(self._db.execute(query)))

    def ids(self, prefix: str = "") -> list[str]:
        """Return the ids of all runs that begin with ``prefix``, of earlier plans as well."""
        query = "SELECT run_id FROM results WHERE substr(run_id, 1, ?) = ?"
        with explain_errors(self.folder):
            return [run_id for (run_id,) in self._db.execute(query, (len(prefix), prefix))]

    # Writing and reading runs.

    def write(self, runs: Iterable[Run]) -> None:
        """Write finished runs, all of them or none, in place of earlier runs with their ids.

        Raises CoarticError if the disk is full or a run does not fit the tables.
        """
        with self.transaction():
            for run in runs:
                try:
                    self._write_run(run)
                except (sqlite3.IntegrityError, sqlite3.DataError, OverflowError) as error:
                    raise CoarticError(
                        f"run {run.id} of {run.cell.method.name} cannot be stored: {error}"
                    ) from None

    def run(self, run_id: str) -> Run:
        """Return a run by its id. Raises CoarticError if the folder has no such run."""
        with explain_errors(self.folder):
            row = self._one("SELECT * FROM results WHERE run_id = ?", run_id)
            if row is None:
                raise CoarticError(f"it has no run {run_id}")
            cell = self._read_cell(self._one("SELECT * FROM cells WHERE id = ?", row["cell"]))
            environment = self._one("SELECT * FROM environments WHERE id = ?", row["environment"])
            blob = self._one("SELECT rewards FROM learning WHERE result_id = ?", row["id"])
            movements, waypoints = (
                self._db.execute(f"SELECT * FROM {table} WHERE result_id = ?", (row["id"],))
                for table in ("movements", "waypoints")
            )
            rows: dict[str, list[Any]] = {part: [] for part in PARTS}
            for each in movements:
                rows[each["part"]].append(each)
            points = waypoints.fetchall()
            rewards = [] if blob is None else unpack(blob["rewards"], row["trials"]).tolist()
            return Run.from_row(
                row,
                cell,
                json.loads(environment["content"]),
                {part: movements_from(cell.task, rows[part], points) for part in PARTS},
                [None if reward == FAILED_TRIAL else reward for reward in rewards],
            )

    def runs(self) -> pd.DataFrame:
        """Return view ``runs`` as a data frame, with nullable types."""
        with explain_errors(self.folder):
            return checked_runs(self._frame("runs"))

    def solutions(self) -> pd.DataFrame:
        """Return view ``solutions`` as a data frame, with nullable types."""
        with explain_errors(self.folder):
            return self._frame("solutions").drop(columns=["result_id", "part"])

    def movements(
        self, part: str, tasks: Mapping[str, Task], most: int
    ) -> dict[str, tuple[Movement, ...]]:
        """Return the movements of a part (:data:`PARTS`) of runs that are ok, by run id.

        Of each cell only the first ``most`` of these runs count. ``tasks`` holds the tasks of the
        plan by name.
        """
        points: dict[str, list[Any]] = defaultdict(list)
        of_waypoints = """SELECT run_id, waypoints.* FROM solved
            JOIN waypoints ON result_id = solved.id WHERE place <= ?
            ORDER BY position, run, "order", waypoint"""
        of_movements = """SELECT run_id, task, movements.* FROM solved
            JOIN movements ON result_id = solved.id AND part = ? WHERE place <= ?
            ORDER BY position, run, "order\""""
        with explain_errors(self.folder):
            for row in self._db.execute(of_waypoints, (most,)):
                points[row["run_id"]].append(row)
            rows = self._db.execute(of_movements, (part, most))
            return {
                run_id: movements_from(tasks[name], of_run, points[run_id])
                for (run_id, name), of_run in groupby(rows, itemgetter("run_id", "task"))
            }

    def rewards(self) -> Iterator[tuple[str, Array]]:
        """Yield the id of each run of the plan that made trials, with the rewards of its trials,
        shape ``(trials,)``; NaN stands for a failed trial."""
        query = """SELECT run_id, rewards, trials FROM asked
            JOIN learning ON result_id = asked.id ORDER BY position, run"""
        with explain_errors(self.folder):
            for run_id, blob, trials in self._db.execute(query):
                stored = unpack(blob, trials)
                yield run_id, np.where(stored == FAILED_TRIAL, np.nan, stored)

    # Rows.

    def _write_run(self, run: Run) -> None:
        """Write a run into the tables, in place of an earlier run with its id."""
        if earlier := self._one("SELECT id FROM results WHERE run_id = ?", run.id):
            for table in ("movements", "waypoints", "learning"):
                self._db.execute(f"DELETE FROM {table} WHERE result_id = ?", (earlier["id"],))
            self._db.execute("DELETE FROM results WHERE id = ?", (earlier["id"],))
        row = run.to_row()
        row["cell"] = self._id_of("cells", cell_row(run.cell), "digest", "code")
        row["environment"] = self._environment(run.outcome.environment or {})
        result = self._insert("results", row)

        def joints(configuration: Array) -> dict[str, float]:
            return dict(zip(run.cell.task.robot.joint_names, configuration.tolist(), strict=True))

        for part, score in run.scores.items():
            for order, m in enumerate(score.movements):
                assert m.target is not None
                place = {"result_id": result, "order": order}
                facts = {"part": part, "goal": m.goal, "hand": m.hand, "kind": m.kind}
                self._insert("movements", place | facts | {"ticks": m.ticks} | joints(m.target))
                for n, point in enumerate(() if m.waypoints is None else m.waypoints):
                    self._insert("waypoints", place | {"waypoint": n} | joints(point))
        if rewards := run.outcome.rewards:
            stored = [FAILED_TRIAL if reward is None else reward for reward in rewards]
            blob = zlib.compress(np.array(stored, dtype="<i4").tobytes(), level=1)
            self._insert("learning", {"result_id": result, "rewards": blob})

    def _read_cell(self, row: Mapping[str, Any]) -> Cell:
        """Return a cell from its row. Raises ValueError or TaskError if coartic cannot have written
        the row."""
        method = {name: row[name] for name in ("title", "citation", "stochastic", "origin", "code")}
        method |= {"name": row["method"], "defaults": json.loads(row["defaults"])}
        method |= {"information": tuple(filter(None, row["information"].split(", ")))}
        content = {
            "task": parse_task(json.loads(row["definition"]), str(self.folder / RUNS_FILE)),
            "method": method,
            "parameters": json.loads(row["parameters"]),
            "trial_budget": row["trial_budget"],
        }
        cell: Cell = _CELL.validate_python(content)
        if (cell.digest, cell.setting) != (row["digest"], row["setting"]):
            raise ValueError(f"{cell.label} on {cell.task.name} is not the cell that was run")
        return cell

    def _environment(self, content: dict[str, Any]) -> int:
        """Return the id of the row of an environment; insert the row if it is missing."""
        commit = content.get("commit")
        row = {
            "content": json.dumps(content, ensure_ascii=False, sort_keys=True),
            "commit_id": commit and commit["id"] + "+" * commit["dirty"],
            "packages": hash_of([content.get("python"), content.get("packages")])[:8],
        }
        return self._id_of("environments", row, "content")

    def _id_of(self, table: str, row: Mapping[str, Any], *keys: str) -> int:
        """Return the id of the row with the values of these keys; insert the row if it is
        missing."""
        condition = " AND ".join(f"{key} = ?" for key in keys)
        query = f"SELECT id FROM {table} WHERE {condition}"
        stored = self._one(query, *(row[key] for key in keys))
        return self._insert(table, row) if stored is None else int(stored["id"])

    def _insert(self, table: str, row: Mapping[str, Any]) -> int:
        """Insert a row, lists and tables as JSON, and return its id."""
        names = ", ".join(f'"{name}"' for name in row)
        marks = ", ".join("?" for _ in row)
        text = f"INSERT INTO {table} ({names}) VALUES ({marks})"
        return int(self._db.execute(text, [*map(as_text, row.values())]).lastrowid or 0)

    def _one(self, query: str, *values: object) -> Any:
        """Return the first row of a query, or None."""
        return self._db.execute(query, values).fetchone()

    def _frame(self, view: str) -> pd.DataFrame:
        """Return a view as a data frame, with nullable types."""
        import pandas as pd

        rows = self._db.execute(f"SELECT * FROM {view}")
        names = [column[0] for column in rows.description]
        frame = pd.DataFrame(list(map(tuple, rows)), columns=names, dtype=object)
        with np.errstate(invalid="ignore"):  # astype refuses numbers that are too large
            return frame.astype({name: _DTYPES.get(name, "float64") for name in names})  # joints

    def _wait_for(self, statement: str) -> None:
        """Execute a statement as soon as other programs that have the file open allow it."""
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


def as_text(value: Any) -> Any:
    """Return a list or a table as JSON, and any other value as it is."""
    is_table = isinstance(value, dict | list | tuple)
    return json.dumps(value, ensure_ascii=False) if is_table else value


def cell_row(cell: Cell) -> dict[str, Any]:
    """Return the row of a cell in table ``cells``, without its id."""
    method = cell.method
    return {
        "digest": cell.digest,
        "code": method.code,
        "task": cell.task.name,
        "definition": cell.definition,
        "method": method.name,
        "title": method.title,
        "citation": method.citation,
        "information": ", ".join(method.information),
        "stochastic": method.stochastic,
        "defaults": method.defaults,
        "origin": method.origin,
        "parameters": cell.parameters,
        "setting": cell.setting,
        "model": PAPER.for_radius(cell.task.radius)._asdict(),
        "trial_budget": cell.trial_budget,
    }


@contextmanager
def open_store(folder: Path) -> Iterator[Store]:
    """Open a results folder for reading.

    Raises CoarticError if this version of coartic did not write the folder, and while a
    ``coartic run`` writes into it.
    """
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
        check_files(folder)
        opened = connect(f"{path.absolute().as_uri()}?mode=rw", 5 * WAIT_S)
    with closing(opened) as connection:
        with explain_errors(folder):
            connection.execute("PRAGMA query_only = ON")
            connection.execute("BEGIN")  # all reads of this block see one state
            if not has_tables(connection):
                raise CoarticError("it is not finished; repeat the `coartic run` command")
            with lock(folder, shared=True):  # refused while a process writes
                pass
        yield Store(folder, connection)


@contextmanager
def open_content(content: bytes, name: str) -> Iterator[Store]:
    """Open the content of a ``runs.sqlite`` in memory for reading; messages call it ``name``."""
    with closing(connect(":memory:", WAIT_S)) as connection:
        connection.deserialize(content)
        yield Store(Path(name), connection)


@contextmanager
def writing(folder: Path) -> Iterator[Store]:
    """Open a results folder for writing, for this process alone, and make a missing folder.

    Raises CoarticError if the folder holds something else or cannot be written, and while another
    process writes into it.
    """
    with explain_errors(folder):
        visible = (entry for entry in folder.glob("*") if not entry.name.startswith("."))
        if not (folder / RUNS_FILE).exists() and any(visible):
            raise CoarticError(
                f"{folder} is not empty and holds no results of coartic. Choose another folder."
            )
        make_folder(folder)
    with lock(folder):
        with explain_errors(folder):
            check_files(folder)
            opened = connect(str(folder / RUNS_FILE), WAIT_S)
        with closing(opened) as connection:
            with explain_errors(folder):
                is_there = has_tables(connection)  # raises before anything is written
                # No write-ahead log, which is unsafe on network disks and adds a file.
                connection.execute("PRAGMA journal_mode = DELETE")
                if not is_there:
                    connection.executescript(f"BEGIN;{_SCHEMA}COMMIT;")
            yield Store(folder, connection)


@contextmanager
def lock(folder: Path, *, shared: bool = False) -> Iterator[None]:
    """Lock a folder for this process, or share the lock with other readers. Systems and disks
    without such locks are left as they are.

    Raises CoarticError while another process holds the lock.
    """
    try:
        import fcntl

        opened = os.open(folder, os.O_RDONLY)
    except (ImportError, OSError):
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
                        f"another `coartic run` is at work in {folder}; wait for it, or choose "
                        "another folder"
                    ) from None
                time.sleep(WAIT_S / 20)
            except OSError:
                break
        yield
    finally:
        os.close(opened)


def connect(where: str, timeout_s: float) -> sqlite3.Connection:
    """Return a connection to a path or a ``file:`` address that waits ``timeout_s`` for a lock."""
    connection = sqlite3.connect(
        where, timeout=timeout_s, isolation_level=None, uri=where.startswith("file:")
    )
    connection.row_factory = sqlite3.Row
    connection.execute("PRAGMA trusted_schema = OFF")
    connection.execute("PRAGMA cell_size_check = ON")
    return connection


def check_files(folder: Path) -> None:
    """Refuse a results folder whose file would make SQLite change another file.

    Raises CoarticError for a link and for the journal of several databases.
    """
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
        # After a rollback SQLite deletes the file that such a journal names.
        if ending == "-journal" and path.exists() and path.stat().st_size >= len(_OF_SEVERAL):
            with path.open("rb") as file:
                file.seek(-len(_OF_SEVERAL), os.SEEK_END)
                if file.read() == _OF_SEVERAL:
                    raise CoarticError(f"{path} was not written by coartic, and names another file")


def has_tables(connection: sqlite3.Connection) -> bool:
    """Return True if the file has the tables of coartic, and False if the file is empty.

    What other programs add to the file (statistics, indexes, tables, views) is let be, except
    triggers, which change what is written. Raises CoarticError for any other file, and ValueError
    for a row that names a missing row: no view would show its run.
    """

    def schema(of: sqlite3.Connection) -> set[tuple[str, str, str]]:
        rows = of.execute("SELECT type, name, sql FROM sqlite_master")
        return {(kind, name, " ".join((sql or "").split())) for kind, name, sql in rows}

    (application,) = connection.execute("PRAGMA application_id").fetchone()
    (version,) = connection.execute("PRAGMA user_version").fetchone()
    there = schema(connection)
    if application != _APPLICATION:
        if {"cells", "results"} <= {name for _, name, _ in there}:
            raise CoarticError(
                "it was restored from a dump, which keeps neither whose file it is nor its format: "
                "copy the file itself"
            )
        if there:
            raise CoarticError("it is not a file of coartic; move it away")
        return False
    if version > FORMAT:
        raise CoarticError("it was written by a later version of coartic: update coartic")
    if version < FORMAT:
        raise CoarticError(
            "it was written by coartic 2.0.0 or earlier; version 2.0.0 reads it. Run the suite "
            "again with another --out"
        )
    with closing(sqlite3.connect(":memory:")) as ours:
        ours.executescript(_SCHEMA)
        columns = [column[1] for column in connection.execute("PRAGMA table_info(movements)")]
        add_joints(ours, filter(_JOINT.fullmatch, columns))
        triggers = {entry for entry in there if entry[0] == "trigger"}
        for kind, name, _ in sorted((schema(ours) - there) | triggers):
            raise CoarticError(
                f"it is not as coartic makes it: {kind} {plain(name, 80)} is missing or is not "
                "ours. Restore a copy, or run the suite again with another --out."
            )
    for table, row, missing, _ in connection.execute("PRAGMA foreign_key_check"):
        raise ValueError(f"row {row} of {table} names a row of {missing} that is not there")
    return True


def add_joints(connection: sqlite3.Connection, names: Iterable[str]) -> None:
    """Add a column for each of these joints that has no column yet."""
    names = list(dict.fromkeys(names))
    for table in ("movements", "waypoints"):
        there = {column[1] for column in connection.execute(f"PRAGMA table_info({table})")}
        for name in names:
            if name not in there:
                connection.execute(f"ALTER TABLE {table} ADD COLUMN {name} REAL")


UNREADABLE = (
    *(OSError, sqlite3.DatabaseError, zlib.error),
    *(ValueError, KeyError, TypeError, OverflowError, RecursionError),
)
"""Errors that a file raises that cannot be used, or whose content coartic did not write."""


@contextmanager
def explain_errors(folder: Path) -> Iterator[None]:
    """Turn an error of this block into a CoarticError, be it an error of the system, of SQLite or
    of the content of the file."""
    try:
        yield
    except (CoarticError, *UNREADABLE) as error:
        raise CoarticError(explain(folder / RUNS_FILE, error)) from None


def explain(path: Path, error: Exception) -> str:
    """Return a sentence on a file that cannot be used, with advice if SQLite cannot read it."""
    if isinstance(error, CoarticError):
        said = one_line(str(error))
        return said if str(path.parent) in said else f"{path}: {said}"
    if isinstance(error, OSError):
        return f"cannot use {plain(str(error.filename or path))}: {error.strerror or error}"
    kind, is_text = getattr(error, "sqlite_errorname", ""), "decode to UTF-8" in str(error)
    if isinstance(error, sqlite3.OperationalError) and not is_text:
        if kind == "SQLITE_READONLY_DBMOVED":
            return (
                f"{path.parent} was removed, renamed or replaced while the suite ran: put it back, "
                "or repeat the command to start again"
            )
        if kind.startswith(_LOCKED):
            return f"another program has {path} open; close it there, or wait for it"
        if "readonly" in str(error) and path.with_name(f"{path.name}-journal").exists():
            return (
                f"{path} was left in the middle of writing, and cannot be put right, since the "
                "folder cannot be written. Copy the whole folder, and use the copy."
            )
        if kind.startswith("SQLITE_CANTOPEN"):
            return f"cannot use {path}: {why_not_opened(path) or error}"
        return f"cannot use {path}: {error}"
    wrong = explain_inline(error, []) if isinstance(error, ValidationError) else str(error)
    wrong = plain(wrong, 200) or type(error).__name__
    if kind == "SQLITE_NOTADB" and (what := what_it_is(path)):
        return f"{path} is {what}"
    if type(error) is sqlite3.DatabaseError or is_text:  # malformed, no database, or no UTF-8
        return (
            f"{path} is damaged ({wrong}). Move it away and repeat the `coartic run` command, or "
            "restore a copy."
        )
    return f"{path} holds what coartic does not write ({wrong})"


def why_not_opened(path: Path) -> str:
    """Return why SQLite cannot open a file, in words; empty if the system would open the file."""
    try:
        path.open("rb").close()
    except FileNotFoundError:
        return "" if os.access(path.parent, os.W_OK) else "its folder may not be written"
    except OSError as error:
        return error.strerror or str(error)
    if len(str(path.absolute())) >= _LONGEST_PATH:
        return f"SQLite takes no path of {_LONGEST_PATH} letters: name a folder higher up"
    return ""


def what_it_is(path: Path) -> str:
    """Return what a file is that is no database, with what to do; empty for any other file."""
    with path.open("rb") as file:
        begins = file.read(40).lstrip()
    if begins.startswith(b"version https://git-lfs"):
        return "a pointer of Git LFS, not the file: `git lfs pull` brings the file"
    if begins.startswith((b"PRAGMA", b"BEGIN TRANSACTION")):
        return "a dump of a database as text: copy the file itself"
    return ""


def unpack(blob: bytes, trials: int | None) -> NDArray[np.int32]:
    """Return the stored rewards of a run, shape ``(trials,)``: :data:`FAILED_TRIAL` stands for a
    trial that failed or whose reward is not kept.

    Raises ValueError for more rewards than trials.
    """
    size = 4 * min(trials or 0, MOST_TRIALS)
    content = zlib.decompressobj().decompress(blob, size + 1)
    if len(content) > size:
        raise ValueError(f"there are more rewards than {trials} trials")
    return np.frombuffer(content, dtype="<i4")


def checked_runs(runs: pd.DataFrame) -> pd.DataFrame:
    """Return view ``runs`` unchanged. Raises ValueError for a value that no run can have."""
    solved = runs.status == "ok"
    rules = {"status": runs.status.isin(STATUSES)}
    for name in ("reward", "hands"):
        rules[name] = runs[name].notna() == solved
    for name in ("hands", "replay_hands", "initial_hands"):
        rules[f"letters of {name}"] = runs[name].fillna("L").str.fullmatch("[LR]+")
    for name, kind, *_ in COLUMNS:
        if "NOT NULL" in kind:
            rules[f"lack of {name}"] = runs[name].notna()
        if kind.startswith(("INTEGER", "REAL")):
            is_reward = name.endswith("reward") or name == "proven_bound"  # minus a count of ticks
            size = runs[name].fillna(0) * (-1 if is_reward else 1)
            rules[f"size of {name}"] = (size >= 0) & (size < np.inf)
    for name, holds in rules.items():
        if not holds.all():
            raise ValueError(f"run {runs.run_id[~holds].iloc[0]}: {name}")
    return runs
