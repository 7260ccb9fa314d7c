"""The runs of a results folder, in the SQLite file ``runs.sqlite``.

Table ``cells`` contains a row for each cell that a command has asked for. The *plan* of the folder
consists of the cells of the last ``coartic run``; for all other cells, columns ``position`` and
``runs`` are NULL. Table ``results`` contains a row for each run, with the movements of the run and
the rewards of its trials. The views ``runs`` and ``solutions`` show only the runs of the plan;
docs/results.md lists their columns.

Only one process writes at a time. It writes finished runs in batches. After any interruption a
batch is stored completely or not at all.
"""

from __future__ import annotations

import fcntl
import itertools
import json
import os
import sqlite3
import warnings
import zlib
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import replace
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from coartic.errors import CoarticError
from coartic.internal.files import make_folder
from coartic.internal.text import plain
from coartic.internal.validation import explain
from coartic.model import WORLD
from coartic.motion.solution import Movement
from coartic.robot import Array
from coartic.runs.contrasts import Contrast, Registered
from coartic.runs.plan import Cell, Job, hash_of
from coartic.runs.record import (
    COLUMNS,
    NOISE_RULE,
    OF_NOISE,
    UNREPEATED,
    Row,
    movement_from,
    reward_bytes,
)
from coartic.runs.rows import places_of

if TYPE_CHECKING:
    import pandas as pd

RUNS_FILE = "runs.sqlite"
FORMAT = 9
"""Number of the format. A change of a table or a view must increase it."""
OLDEST = 7
"""Oldest format that can be read, the format of version 6.0.0. Version 7.0.0 wrote format 8.
Columns that a format lacks are shown as missing values, except ``world``, which is shown as the
empty string. ``coartic run`` adds these columns to the folder into which it writes."""
_APPLICATION = 0x636F6172  # "coar"

_KINDS = {"TEXT": "string", "INTEGER": "Int64", "REAL": "Float64", "BOOLEAN": "boolean"}
_DTYPES: dict[str, Any] = {
    **dict.fromkeys(("hand", "kind", "path"), "string"),
    **dict.fromkeys(("order", "goal", "ticks"), "Int64"),
    **{name: _KINDS[kind.split()[0]] for name, kind, *_ in COLUMNS},
}
"""Dict that maps the columns of views to their types in data frames. All types allow missing
values."""
_CELL = TypeAdapter(Cell)
_STORED = ", ".join(f"{name} {kind}" for name, kind, source, _ in COLUMNS if source)
_NOISY = {
    name: f"CASE WHEN noise_rule = {NOISE_RULE} THEN {name} END AS {name}" for name in OF_NOISE
}
_IN_VIEW = ", ".join(_NOISY.get(name, f'"{name}"') for name, *_ in COLUMNS)
_SOLUTIONS = """SELECT run_id, key AS "order", json_extract(value, '$[0]') AS goal,
    json_extract(value, '$[1]') AS hand, json_extract(value, '$[2]') AS kind,
    json_extract(value, '$[3]') AS ticks, json_extract(value, '$[4]') AS path
    FROM asked, json_each(movements, '$.solution') ORDER BY position, run, key"""
"""Query of view ``solutions``. The code uses the query instead of the view, because some versions
of SQLite do not call functions of JSON in a view of a file whose schema is not trusted."""
_VIEWS = f"""CREATE VIEW asked AS SELECT position, results.*, suite.name AS suite, task, method,
    setting, information, parameters, code, world, called, "commit", packages
    FROM suite JOIN cells ON runs IS NOT NULL
    JOIN results ON results.cell = cells.id AND suite_seed = suite.seed AND run < runs
    JOIN environments ON environments.id = results.environment;
CREATE VIEW runs AS SELECT {_IN_VIEW} FROM asked ORDER BY position, run;
CREATE VIEW solutions AS {_SOLUTIONS};"""
_NEW_IN_CELLS = {
    "world": "TEXT NOT NULL DEFAULT ''",
    "called": "TEXT NOT NULL DEFAULT ''",
    "of_suite": "BOOLEAN NOT NULL DEFAULT TRUE",
}
"""Dict that maps columns of table ``cells`` that older formats lack to their types."""
_CONTRASTS = """CREATE TABLE IF NOT EXISTS contrasts (content TEXT PRIMARY KEY, says TEXT NOT NULL,
    position INTEGER, cells INTEGER NOT NULL, date TEXT NOT NULL, runs INTEGER NOT NULL);"""
_SCHEMA = f"""BEGIN;
CREATE TABLE suite (name TEXT NOT NULL, seed INTEGER NOT NULL, content TEXT NOT NULL);
CREATE TABLE cells (id TEXT PRIMARY KEY, position INTEGER, runs INTEGER, digest TEXT NOT NULL,
    code TEXT NOT NULL, task TEXT NOT NULL, method TEXT NOT NULL, setting TEXT NOT NULL,
    information TEXT NOT NULL, parameters TEXT NOT NULL, content TEXT NOT NULL,
    {", ".join(f"{name} {kind}" for name, kind in _NEW_IN_CELLS.items())});
{_CONTRASTS}
CREATE TABLE environments (id TEXT PRIMARY KEY, content TEXT NOT NULL, "commit" TEXT,
    packages TEXT);
CREATE TABLE results (cell TEXT NOT NULL REFERENCES cells, suite_seed INTEGER NOT NULL,
    environment TEXT NOT NULL REFERENCES environments, details TEXT NOT NULL,
    movements TEXT NOT NULL, rewards BLOB, {_STORED},
    UNIQUE (cell, suite_seed, run));
{_VIEWS}
PRAGMA application_id = {_APPLICATION}; PRAGMA user_version = {FORMAT}; COMMIT;"""
"""Statements that make the tables and views."""

WAIT_S = 5.0  # wait for another program before a warning
_ROWS_AT_ONCE = 5_000  # rows of a data frame that are Python objects at the same time


class Store:
    """The runs of one results folder."""

    def __init__(
        self, folder: Path, connection: sqlite3.Connection, content: bytes | None = None
    ) -> None:
        """Wrap an open connection.

        ``content`` is the content of the file if the database is in memory, otherwise None.
        """
        self.folder, self.content = folder, content
        self._db = connection

    # The plan.

    def replace_plan(self, plan: Sequence[Job], made_with: Mapping[str, Any]) -> None:
        """Replace the plan of the folder.

        Runs of the earlier plan stay in the file.

        Parameters
        ----------
        plan : sequence of Job
            At least one job. The suite, the seed, the limit of CPU time, ``trials`` and
            ``question`` of the first job are stored for all jobs.
        made_with : mapping of str to object
            Versions, platform, commit, command and date (:func:`.made_with`).

        Raises
        ------
        CoarticError
            The folder has results of another suite, or cannot be written; or a cell would not come
            back from the file as it is (:func:`_checked_row`).
        """
        first = plan[0]
        content = dict(made_with) | {"time_limit_s": first.time_limit_s}
        content |= {"trials": first.trials} if first.trials else {}
        content |= {"question": first.question} if first.question else {}
        with self.transaction():
            for (name,) in self._rows("SELECT name FROM suite"):
                if name != first.suite:
                    raise CoarticError(
                        f"{self.folder} has results of suite {name!r}: choose another folder for "
                        f"suite {first.suite!r}"
                    )
            self._mend_worlds()
            self._db.execute("DELETE FROM suite")
            self._db.execute("UPDATE cells SET position = NULL, runs = NULL")
            self._insert("suite", name=first.suite, seed=first.seed, content=json.dumps(content))
            known = dict[str, Any]()
            for position, job in enumerate(plan):
                place = {"position": position, "runs": job.numbers[-1] + 1}
                names = {"called": job.called, "of_suite": job.of_suite}
                self._insert("cells", **_checked_row(job.cell, known), **place, **names)
            self._register(plan, str(made_with["date"]))

    def _register(self, plan: Sequence[Job], date: str) -> None:
        """Store the contrasts of a plan. Those that are stored already keep their date and runs."""
        self._db.execute("UPDATE contrasts SET position = NULL")
        if not plan[0].contrasts:
            return
        present = Counter(position for position, *_ in self.present())
        places = places_of(plan)
        for position, (contrast, cells) in enumerate(plan[0].contrasts):
            runs = sum(present[k] for k, place in enumerate(places) if contrast.terms_at(place))
            self._db.execute(
                """INSERT INTO contrasts VALUES (?, ?, ?, ?, ?, ?) ON CONFLICT (content)
                DO UPDATE SET says = excluded.says, position = excluded.position,
                    cells = excluded.cells""",
                (contrast.content, contrast.says, position, cells, date, runs),
            )

    def contrasts(self) -> list[Registered]:
        """Return the contrasts that the folder stores, those of the last command first."""
        if not self._columns("contrasts"):  # a file of an older format
            return []
        query = """SELECT content, says, cells, position IS NOT NULL, date, runs FROM contrasts
            ORDER BY position IS NULL, position, date"""
        with explain_errors(self.folder):
            return [
                Registered(
                    Contrast.model_validate({"says": says, **json.loads(content)}),
                    cells,
                    bool(is_asked),
                    date,
                    runs,
                )
                for content, says, cells, is_asked, date, runs in self._rows(query)
            ]

    def _mend_worlds(self) -> None:
        """Write cells again whose world has an integer constant, as version 7.0.0 stored it.

        Their runs stay. Cells and runs get the ids of the world with the same constant as a float.
        """
        query = """SELECT id, content FROM cells WHERE json_valid(content)
            AND 'integer' IN (json_type(content, '$.model.motor_noise'),
                json_type(content, '$.model.base_weight'))"""
        for old_id, content in self._rows(query):
            cell: Cell = _CELL.validate_json(content)
            self._insert("cells", **_cell_row(cell))
            runs = self._rows("SELECT suite_seed, run FROM results WHERE cell = ?", old_id)
            for seed, number in runs:
                self._db.execute(
                    """UPDATE OR REPLACE results SET cell = ?, run_id = ?
                    WHERE cell = ? AND suite_seed = ? AND run = ?""",
                    (cell.id, Job(cell, seed, (number,)).run_id(number), old_id, seed, number),
                )
            self._db.execute("DELETE FROM cells WHERE id = ?", (old_id,))

    def plan(self) -> list[Job]:
        """Return the plan of the folder.

        The runs of each job are numbered from 0. Attribute ``question`` of the jobs is None, and
        attribute ``where`` of their methods is empty. Raises CoarticError if no plan is stored yet,
        or if the stored plan is damaged.
        """
        made_with = self.made_with()
        limits = made_with.get("time_limit_s"), made_with.get("trials")
        here = {*self._columns("cells")}
        new = ", ".join(f"{name}" if name in here else "NULL" for name in ("called", "of_suite"))
        query = f"""SELECT cells.id, cells.content, task, method, seed, runs, name, {new}
            FROM suite JOIN cells ON runs IS NOT NULL ORDER BY position"""
        plan, known = list[Job](), dict[str, Any]()
        with explain_errors(self.folder):
            for cell_id, content, task, method, seed, runs, suite, *of_block in self._rows(query):
                cell = _cell_from(cell_id, content, known)
                if (task, method) != (cell.task.name, cell.method.name):
                    raise ValueError(f"{method} on {task} has another name in its cell")
                called, of_suite = of_block[0] or "", of_block[1] != 0
                job = Job(cell, seed, range(runs), limits[0], suite, limits[1], called)
                plan.append(replace(job, of_suite=of_suite))
        if not plan:
            raise CoarticError(f"the plan of {self.folder} is empty: {_RESUME}")
        return plan

    def made_with(self) -> dict[str, Any]:
        """Return a dict with the environment and the options of the last ``coartic run``.

        The dict contains the entries of :func:`.made_with`, ``time_limit_s`` and, if they are set,
        ``trials`` and ``question`` of the jobs of the plan. Raises CoarticError if no plan is
        stored yet.
        """
        if not (rows := self._rows("SELECT content FROM suite")):
            raise CoarticError(f"{self.folder} is not finished: {_RESUME}")
        with explain_errors(self.folder):
            return dict(json.loads(rows[0][0]))

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """Write all changes of a ``with`` block, or none if the block fails.

        A block within another block is a part of the outer block. Raises CoarticError for an error
        of SQLite, for example if the disk is full.
        """
        if self._db.in_transaction:
            yield
            return
        try:
            self._wait_for("BEGIN IMMEDIATE")
            yield
            self._wait_for("COMMIT")
        except sqlite3.Error as error:
            raise CoarticError(_explain(self.folder / RUNS_FILE, error)) from None
        finally:
            if self._db.in_transaction:
                self._db.rollback()

    # Ids and counts of runs.

    def present(self) -> list[tuple[int, int, str, float | None]]:
        """Return the runs of the plan that are stored in the folder.

        Returns
        -------
        list of tuple
            A tuple ``(position, number, status, time_limit_s)`` for each run, in no defined order.
            ``position`` is the position of the run's job in the plan, from 0. ``time_limit_s`` is
            the limit of CPU time under which the run was made (in s), or None if no limit was set.
        """
        return self._rows("SELECT position, run, status, time_limit_s FROM asked")

    def asked_ids(self) -> set[str]:
        """Return the ids of the runs of the plan that are stored in the folder."""
        return {run_id for (run_id,) in self._rows("SELECT run_id FROM asked")}

    def count_outdated_runs(self) -> Counter[tuple[str, str, str]]:
        """Count the stored runs that another version of a planned method made.

        A run is counted if it differs from a run of the plan only in the version of the method. The
        result is a Counter whose keys are triples: the id of the method, the version (or hash of
        the code) that made the runs, and the version (or hash of the code) in the plan.
        """
        query = """SELECT now.method, old.code, now.code, count(*) FROM suite
            JOIN cells AS now ON now.runs IS NOT NULL
            JOIN cells AS old ON old.digest = now.digest AND old.runs IS NULL
            JOIN results ON results.cell = old.id AND suite_seed = suite.seed AND run < now.runs
            GROUP BY 1, 2, 3"""
        return Counter({(name, old, now): count for name, old, now, count in self._rows(query)})

    def marks(self) -> dict[str, list[str]]:
        """Return a dict that maps ids of methods to lists of warnings about them.

        Only stored runs of the plan are considered, and only methods with a warning are included. A
        warning is a sentence that says one of the following:

        - A run was performed again with another result.
        - Runs were made with other versions of packages that the method's file imports.
        """
        warnings_by_method = defaultdict[str, list[str]](list)
        query = f"""SELECT DISTINCT method, task FROM asked
            WHERE json_extract(details, '$.{UNREPEATED}') IS NOT NULL ORDER BY method, task"""
        for method, rows in groupby(self._rows(query), itemgetter(0)):
            tasks = ", ".join(task for _, task in rows)
            warnings_by_method[method].append(
                f"{method}: another result when a run was made again ({tasks})"
            )
        for method, made, last in self._packages():
            changed = [name for name in made if made[name] != last[name]]
            if changed:
                old_versions = ", ".join(f"{name} {made[name]}" for name in changed)
                new_versions = ", ".join(f"{name} {last[name]}" for name in changed)
                warnings_by_method[method].append(
                    f"{method}: runs were made with {old_versions}; now it has {new_versions}"
                )
        return dict(warnings_by_method)

    def versions(self) -> list[str]:
        """Return the versions of coartic that made the runs of the plan, the oldest runs first."""
        query = """SELECT json_extract(environments.content, '$.coartic') FROM asked
            JOIN environments ON environments.id = environment GROUP BY 1 ORDER BY min(date)"""
        return [str(version) for (version,) in self._rows(query)]

    def imports(self) -> dict[str, list[str]]:
        """Return a dict that maps ids of methods to the packages that their files import.

        The value of a method is a sorted list of strings such as ``numpy 2.1.0``: the packages with
        the versions with which the runs of the plan were made. Built-in methods, and methods whose
        files import no package, are left out.
        """
        by_method = defaultdict[str, dict[str, None]](dict)
        for method, made, _ in self._packages():
            by_method[method] |= dict.fromkeys(
                f"{name} {version}" for name, version in made.items()
            )
        return {method: sorted(packages) for method, packages in by_method.items() if packages}

    def _packages(self) -> Iterator[tuple[str, dict[str, str], dict[str, str]]]:
        """Yield the packages that a method's file imports, for methods with runs in the plan.

        There is an item for each combination of a method and of the versions of packages with which
        some of its runs were made.

        Yields
        ------
        str
            Id of the method.
        dict
            Dict that maps the name of each package to the version with which these runs were made.
        dict
            Dict that maps the name of each package to its version in the last ``coartic run``.
        """
        query = """SELECT DISTINCT asked.method, json_extract(environments.content, '$.imports'),
            json_extract(cells.content, '$.method.packages') FROM asked
            JOIN cells ON cells.id = asked.cell JOIN environments ON environments.id = environment
            WHERE json_extract(environments.content, '$.imports') IS NOT NULL ORDER BY 1, 2"""
        for method, made, last in self._rows(query):
            with explain_errors(self.folder):
                versions = json.loads(made), json.loads(last)
            yield method, *versions

    def others(self) -> int:
        """Return the number of runs in the folder that do not belong to the plan.

        Runs that other versions of a method made (:meth:`count_outdated_runs`) are included.
        """
        query = "SELECT (SELECT count(*) FROM results) - (SELECT count(*) FROM asked)"
        return int(self._rows(query)[0][0])

    def ids(self, prefix: str = "") -> list[str]:
        """Return the ids of stored runs that begin with ``prefix``.

        Runs outside the plan are included.
        """
        query = "SELECT run_id FROM results WHERE substr(run_id, 1, ?) = ?"
        return [run_id for (run_id,) in self._rows(query, len(prefix), prefix)]

    def judged(self) -> list[list[str]]:
        """Return the ids of the runs with mean ticks by the present rule of noise, by cell.

        Cells and runs outside the plan are included.
        """
        return self._in_noise("results JOIN cells ON cells.id = cell", f"= {NOISE_RULE}")

    def results(self) -> dict[str, str]:
        """Return a dict that maps the id of each stored run to its column ``result``."""
        return dict(self._rows("SELECT run_id, result FROM results"))

    # Writing and reading runs.

    def write(self, runs: Iterable[Row]) -> None:
        """Write finished runs, all of them or none.

        Stored runs with the same ids are replaced. The cells of the runs must be stored already
        (:meth:`replace_plan`). Raises CoarticError if the runs cannot be stored, for example
        because the disk is full.
        """
        with self.transaction():
            for run in runs:
                environment = _environment_row(run.environment)
                self._insert("environments", **environment)
                packed = None
                if run.rewards:
                    packer = zlib.compressobj(9, strategy=zlib.Z_FILTERED)
                    packed = packer.compress(reward_bytes(run.rewards)) + packer.flush()
                self._insert(
                    "results",
                    **run.values,
                    cell=run.cell.id,
                    suite_seed=run.job.seed,
                    environment=environment["id"],
                    details=json.dumps(run.details),
                    movements=json.dumps(run.movements, separators=(",", ":")),
                    rewards=packed,
                )

    def check_file(self) -> None:
        """Raise CoarticError if SQLite finds the structure of the file damaged.

        It is also raised if details or movements of a result are not valid JSON. Changed values
        that are still valid are not found.
        """
        broken = "SELECT 1 FROM results WHERE NOT (json_valid(details) AND json_valid(movements))"
        if self._rows("PRAGMA quick_check(1)") != [("ok",)] or self._rows(f"{broken} LIMIT 1"):
            raise CoarticError(f"{plain(str(self.folder / RUNS_FILE))} cannot be used: {_DAMAGED}")

    def include(self, other: Store) -> None:
        """Copy the runs that this folder lacks from another folder.

        Only runs of cells that are in the plan of this folder are copied. Raises CoarticError if
        the other folder cannot be read, or this folder cannot be written.
        """
        file = f"{(other.folder / RUNS_FILE).absolute().as_uri()}?mode=ro"
        with explain_errors(other.folder):
            self._db.execute("ATTACH ? AS other", (":memory:" if other.content else file,))
            if other.content:
                self._db.deserialize(other.content, name="other")
        try:
            with self.transaction():
                for table, condition in (
                    ("environments", "TRUE"),
                    ("results", "cell IN (SELECT id FROM main.cells WHERE runs IS NOT NULL)"),
                ):
                    here = self._columns(table)
                    names = ", ".join(
                        f'"{name}"' for name in self._columns(table, "other") if name in here
                    )
                    self._db.execute(
                        f"""INSERT OR IGNORE INTO main.{table} ({names})
                        SELECT {names} FROM other.{table} WHERE {condition}"""
                    )
                if self._columns("contrasts", "other"):  # the older record of a contrast counts
                    self._db.execute(
                        """INSERT INTO main.contrasts
                        SELECT content, says, NULL, cells, date, runs FROM other.contrasts
                        WHERE TRUE ON CONFLICT (content) DO UPDATE
                        SET date = excluded.date, runs = excluded.runs WHERE excluded.date < date"""
                    )
        finally:
            self._db.execute("DETACH DATABASE other")

    def run(self, run_id: str) -> Row:
        """Return the stored run with a given id.

        Attribute ``suite`` of its job and attribute ``where`` of its method are empty. Values of
        columns that a file of an older format lacks are None. Raises CoarticError if the run is not
        stored in the folder, or if the stored run does not match the id.
        """
        query = """SELECT results.*, cells.content AS cell_content, environments.content AS made
            FROM results JOIN cells ON cells.id = cell
            JOIN environments ON environments.id = environment WHERE run_id = ?"""
        with explain_errors(self.folder):
            row = self._db.execute(query, (run_id,)).fetchone()
            if row is None:
                raise CoarticError(f"{self.folder} does not have run {run_id}")
            there = {*row.keys()}  # a file of an older version lacks columns
            values = {
                name: bool(row[name]) if kind == "BOOLEAN" and row[name] is not None else row[name]
                for name, kind, source, _ in COLUMNS
                if source and name in there
            }
            missing = {name: None for name, _, source, _ in COLUMNS if source}
            cell = _cell_from(row["cell"], row["cell_content"])
            job = Job(cell, row["suite_seed"], (row["run"],), row["time_limit_s"])
            if job.run_id(row["run"]) != run_id:
                raise ValueError(f"run {run_id} does not match its id")
            unpacked = _unpack(row["rewards"])
            failed = np.isnan(unpacked)
            rewards: list[int | None] = np.where(failed, 0, unpacked).astype(np.int64).tolist()
            for trial in np.flatnonzero(failed):
                rewards[trial] = None
            return Row(
                job,
                missing | values,
                json.loads(row["movements"]),
                rewards,
                dict(json.loads(row["details"])),
                dict(json.loads(row["made"])),
            )

    def runs(self) -> pd.DataFrame:
        """Return view ``runs`` as a data frame.

        Returns
        -------
        DataFrame
            A row for each stored run of the plan, in the order of the plan. The columns are those
            of :data:`.COLUMNS`, with nullable types.
        """
        there = {*self._columns("asked")}
        missing = {"world": "'' AS world", "called": "'' AS called"}
        columns = [
            _NOISY.get(name, f'"{name}"')
            if name in there
            else missing.get(name, f'NULL AS "{name}"')
            for name, *_ in COLUMNS
        ]
        return self._frame(f"SELECT {', '.join(columns)} FROM asked ORDER BY position, run")

    def solutions(self) -> pd.DataFrame:
        """Return view ``solutions`` as a data frame.

        Returns
        -------
        DataFrame
            A row for each movement of each solution in the plan. The columns are ``run_id``,
            ``order`` (from 0), ``goal`` (from 1), ``hand``, ``kind``, ``ticks`` and ``path`` (the
            target, or the waypoints of a path, as JSON), with nullable types.
        """
        return self._frame(_SOLUTIONS)

    def movements(self, part: str, most: int) -> dict[str, tuple[Movement, ...]]:
        """Return a dict that maps ids of runs to the movements of one part.

        Parameters
        ----------
        part : {"solution", "initial", "replay"}
            The part of the runs.
        most : int
            Largest number of runs for each cell of the plan. For each cell, the first ``most`` runs
            with status ``ok`` are used; those of them without the part are left out.
        """
        query = """SELECT run_id, json_extract(movements, ?) FROM
            (SELECT run_id, movements, position, run,
            row_number() OVER (PARTITION BY position ORDER BY run) AS place
            FROM asked WHERE status = 'ok') WHERE place <= ? ORDER BY position, run"""
        with explain_errors(self.folder):
            return {
                run_id: tuple(map(movement_from, json.loads(text)))
                for run_id, text in self._db.execute(query, (f"$.{part}", most))
                if text is not None
            }

    def solutions_of(self, run_ids: Iterable[str]) -> list[tuple[Movement, ...]]:
        """Return the movements of the solution of each run. Raises CoarticError for a missing one.

        In contrast to :meth:`run`, nothing else of the runs is read or checked.
        """
        query = "SELECT json_extract(movements, '$.solution') FROM results WHERE run_id = ?"
        with explain_errors(self.folder):
            texts = [self._db.execute(query, (run_id,)).fetchone()[0] for run_id in run_ids]
            return [tuple(map(movement_from, json.loads(text))) for text in texts]

    def rewards(self) -> Iterator[tuple[str, Array]]:
        """Yield the rewards of each run of the plan that has stored rewards.

        Yields
        ------
        str
            Id of the run.
        ndarray, shape (k,)
            Rewards; NaN for a trial that failed or whose reward is not stored.
        """
        query = """SELECT run_id, rewards FROM asked WHERE rewards IS NOT NULL
            ORDER BY position, run"""
        with explain_errors(self.folder):
            for run_id, blob in self._db.execute(query):
                yield run_id, _unpack(blob)

    def outdated_noise(self) -> list[list[str]]:
        """Return the ids of planned runs whose mean ticks follow another rule of noise, by cell."""
        return self._in_noise("asked JOIN cells ON cells.id = cell", f"IS NOT {NOISE_RULE}")

    def _in_noise(self, table: str, rule: str) -> list[list[str]]:
        """Return the ids of solved runs in worlds with motor noise, by cell."""
        if "noise_rule" not in self._columns("results"):  # format 7, which has no noise
            return []
        query = f"""SELECT cells.id, run_id FROM {table} WHERE status = 'ok'
            AND json_extract(cells.content, '$.model.motor_noise') > 0 AND noise_rule {rule}
            ORDER BY cells.id, run"""
        groups = groupby(self._rows(query), itemgetter(0))
        return [[run_id for _, run_id in rows] for _, rows in groups]

    # Rows.

    def _columns(self, table: str, schema: str = "main") -> list[str]:
        """Return the names of the columns of a table or view."""
        return [row[1] for row in self._rows(f"PRAGMA {schema}.table_info({table})")]

    def _insert(self, table: str, **row: Any) -> None:
        """Insert a row into a table, or update the row with the same id if there is one."""
        key = {"cells": "id", "environments": "id", "results": "run_id"}.get(table)
        names, marks = ", ".join(f'"{name}"' for name in row), ", ".join("?" * len(row))
        # Setting the key, even to its own value, would make SQLite check all rows that refer to it.
        updates = ", ".join(f'"{name}" = excluded."{name}"' for name in row if name != key)
        statement = f"INSERT INTO {table} ({names}) VALUES ({marks})"
        statement += f" ON CONFLICT ({key}) DO UPDATE SET {updates}" if key else ""
        self._db.execute(statement, [*row.values()])

    def _rows(self, query: str, *values: object) -> list[Any]:
        """Return the rows of a query as a list of tuples.

        Raises CoarticError if the file cannot be read.
        """
        with explain_errors(self.folder):
            return [tuple(row) for row in self._db.execute(query, values)]

    def _frame(self, query: str) -> pd.DataFrame:
        """Return the rows of a query as a data frame with nullable types."""
        import pandas as pd

        with explain_errors(self.folder):
            rows, parts, interned = self._db.execute(query), list[pd.DataFrame](), dict[Any, Any]()
            names = [column[0] for column in rows.description]
            while (batch := rows.fetchmany(_ROWS_AT_ONCE)) or not parts:
                columns = dict(zip(names, zip(*batch, strict=True), strict=True)) if batch else {}
                parts.append(
                    pd.DataFrame(
                        {
                            # Equal strings share one object.
                            name: pd.array(
                                [
                                    interned.setdefault(value, value)
                                    for value in columns.get(name, ())
                                ]
                                if _DTYPES[name] == "string"
                                else list(columns.get(name, ())),
                                dtype=_DTYPES[name],
                            )
                            for name in names
                        }
                    )
                )
            return pd.concat(parts, ignore_index=True)

    def _wait_for(self, statement: str) -> None:
        """Execute a statement, and repeat it while another program locks the file.

        A warning is given after the first attempt.
        """
        for attempt in itertools.count():
            try:
                self._db.execute(statement)
                return
            except sqlite3.OperationalError as error:
                if error.sqlite_errorname not in ("SQLITE_BUSY", "SQLITE_LOCKED"):
                    raise
            if not attempt:
                warnings.warn(
                    f"another program uses {self.folder / RUNS_FILE}: waiting for it",
                    stacklevel=2,
                )


_RESUME = "repeat the `coartic run` command"


def _cell_row(cell: Cell) -> dict[str, Any]:
    """Return the row of a cell in table ``cells``, except its position in a plan."""
    return {
        "id": cell.id,
        "digest": cell.digest,
        "code": cell.method.code,
        "task": cell.task.name,
        "method": cell.method.name,
        "setting": cell.setting,
        "information": ", ".join(cell.method.information),
        "parameters": json.dumps(cell.parameters, ensure_ascii=False),
        "content": json.dumps(cell.content, ensure_ascii=False),
        "world": cell.world,
    }


def _checked_row(cell: Cell, known: dict[str, Any]) -> dict[str, Any]:
    """Return the row of a cell, from which the same cell is read.

    ``known`` is that of :func:`_cell_from`. Raises CoarticError if the row cannot be written, or if
    another cell is read from it: its runs could not be found again.
    """
    problem = "its values change"
    try:
        row = _cell_row(cell)
        if _cell_from(row["id"], row["content"], known) == cell:
            return row
    except (ValueError, TypeError) as error:
        problem = explain(error) if isinstance(error, ValidationError) else plain(str(error))
    raise CoarticError(
        f"{cell.method.name} on {cell.task.name} cannot be stored and read back ({problem}): write "
        "plain numbers and strings"
    )


def _cell_from(cell_id: str, content: str, known: dict[str, Any] | None = None) -> Cell:
    """Return the cell that is stored as JSON in table ``cells``.

    Attribute ``where`` of the cell's method is empty. ``known`` is a dict that maps the JSON of
    tasks and methods of earlier cells to these objects: the cell shares the equal ones, and its own
    are added. Raises ValueError if ``content`` is not the JSON of a cell with the id ``cell_id``,
    and CoarticError if it is one that :meth:`Store.replace_plan` mends.
    """
    data = json.loads(content)
    keys = {}
    if known is not None and isinstance(data, dict):
        keys = {name: json.dumps(data[name]) for name in ("task", "method") if name in data}
        data |= {name: known[key] for name, key in keys.items() if key in known}
    cell: Cell = _CELL.validate_python(data)
    if known is not None:
        known |= {key: getattr(cell, name) for name, key in keys.items()}
    if cell.id != cell_id:
        if any(type(data["model"].get(name)) is int for name in WORLD):
            raise CoarticError(
                f"version 7.0.0 stored an integer as a constant of a world of {cell.task.name}: "
                f"{_RESUME}, which mends the folder and keeps its runs"
            )
        raise ValueError(f"{cell.label} on {cell.task.name} does not match the id of its cell")
    return cell


def _environment_row(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return the row of an environment in table ``environments``."""
    commit = content.get("commit")
    return {
        "id": hash_of(content)[:16],
        "content": json.dumps(content, ensure_ascii=False, sort_keys=True),
        "commit": commit and commit["id"] + ("+" if commit["dirty"] else ""),
        "packages": hash_of([content.get("python"), content.get("packages")])[:8],
    }


@contextmanager
def open_store(folder: Path) -> Iterator[Store]:
    """Open a results folder for reading, in a ``with`` block.

    Raises CoarticError if the folder has no results, or results in a format that this version
    cannot read.
    """
    path = folder / RUNS_FILE
    with explain_errors(folder):
        if not path.is_file():
            near = [*folder.parent.glob(RUNS_FILE), *sorted(folder.glob(f"*/{RUNS_FILE}"))][:3]
            candidates = " or ".join(str(file.parent) for file in near)
            hint = f"; did you mean {candidates}?" if near else ""
            problem = f"{folder} is not a results folder: it does not contain {RUNS_FILE}"
            if not os.path.lexists(folder):
                problem = f"folder {folder} does not exist"
            raise CoarticError(f"{problem}{hint}")
        opened = _connect(f"{path.absolute().as_uri()}?mode=rw")
    with closing(opened) as connection:
        with explain_errors(folder):
            connection.execute("PRAGMA query_only = ON")
            connection.execute("BEGIN")  # all reads of this block see one state
            if not _has_tables(connection, path):
                raise CoarticError(f"{folder} is not finished: {_RESUME}")
        yield Store(folder, connection)


@contextmanager
def open_content(content: bytes, name: str) -> Iterator[Store]:
    """Open the content of a ``runs.sqlite`` in memory, for reading in a ``with`` block.

    ``name`` stands for the folder in messages.
    """
    with closing(_connect(":memory:")) as connection:
        connection.deserialize(content)
        yield Store(Path(name), connection, content)


@contextmanager
def open_store_for_writing(folder: Path) -> Iterator[Store]:
    """Lock a results folder, and open it for writing in a ``with`` block.

    A missing folder is made, and a file of an older format is updated. Raises CoarticError if the
    folder contains files but no results, if its results are in a format that this version cannot
    read, if it cannot be written, or if another process has locked it.
    """
    path = folder / RUNS_FILE
    with explain_errors(folder):
        if folder.is_dir() and not path.exists() and any(folder.glob("[!.]*")):
            raise CoarticError(
                f"{folder} contains other files, but no results of coartic: choose another folder"
            )
        make_folder(folder)
    with lock(folder):
        with explain_errors(folder):
            opened = _connect(path.absolute().as_uri())
        with closing(opened) as connection:
            with explain_errors(folder):
                has_tables = _has_tables(connection, path)  # raises before anything is written
                # A write-ahead log would be unsafe on network disks, and would add a file.
                connection.execute("PRAGMA journal_mode = DELETE")
                connection.execute("PRAGMA foreign_keys = ON")
                if not has_tables:
                    connection.executescript(_SCHEMA)
                else:
                    _add_columns(connection)
            yield Store(folder, connection)


@contextmanager
def lock(folder: Path, *, command: str = "coartic run") -> Iterator[None]:
    """Lock a folder for this process in a ``with`` block.

    On a disk that does not support locks, the block runs without a lock. If another process has
    locked the folder, CoarticError is raised; the message says that ``command`` uses the folder.
    """
    opened = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(opened, fcntl.LOCK_NB | fcntl.LOCK_EX)
        except BlockingIOError:
            raise CoarticError(
                f"another `{command}` uses {folder}: wait for it, or choose another folder"
            ) from None
        except OSError:  # some network disks do not have locks
            pass
        yield
    finally:
        os.close(opened)


def _connect(where: str) -> sqlite3.Connection:
    """Return a connection to a database: a ``file:`` address, or ``:memory:``."""
    connection = sqlite3.connect(where, timeout=WAIT_S, isolation_level=None, uri=True)
    connection.row_factory = sqlite3.Row
    connection.execute("PRAGMA trusted_schema = OFF")
    return connection


def _has_tables(connection: sqlite3.Connection, path: Path) -> bool:
    """Return whether a file has the tables of coartic; False for an empty file.

    Raises CoarticError for a file that coartic did not write, whose format this version cannot
    read, or whose end is missing.
    """
    (application,) = connection.execute("PRAGMA application_id").fetchone()
    (version,) = connection.execute("PRAGMA user_version").fetchone()
    if application != _APPLICATION:
        if connection.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]:
            raise CoarticError(
                f"{path} was not written by coartic, or was restored from a dump: move it away, or "
                "copy the original file"
            )
        return False
    if version > FORMAT:
        raise CoarticError(f"{path} was written by a later version of coartic: update coartic")
    if version < OLDEST:
        writer = "an earlier version of coartic"
        with suppress(sqlite3.Error, TypeError):
            query = "SELECT max(json_extract(content, '$.coartic')) FROM environments"
            writer = f"coartic {connection.execute(query).fetchone()[0]}"
        raise CoarticError(
            f"{path} was written by {writer}, in a format that this version cannot read: repeat "
            "the `coartic run` command with another --out"
        )
    (pages,) = connection.execute("PRAGMA page_count").fetchone()
    (size,) = connection.execute("PRAGMA page_size").fetchone()
    if path.stat().st_size < pages * size:  # SQLite would read a last page that is cut as zeros
        raise CoarticError(f"{plain(str(path))} cannot be used: {_DAMAGED}")
    return True


def _add_columns(connection: sqlite3.Connection) -> None:
    """Update a file of an older format: add columns, and replace views.

    A file of the present format is not changed.
    """
    (version,) = connection.execute("PRAGMA user_version").fetchone()
    if version == FORMAT:
        return
    stored = {row[1] for row in connection.execute("PRAGMA table_info(results)")}
    added = [
        f"ALTER TABLE results ADD COLUMN {name} {kind};"
        for name, kind, source, _ in COLUMNS
        if source and name not in stored
    ]
    in_cells = {row[1] for row in connection.execute("PRAGMA table_info(cells)")}
    added += [
        f"ALTER TABLE cells ADD COLUMN {name} {kind};"
        for name, kind in _NEW_IN_CELLS.items()
        if name not in in_cells
    ]
    added.append(_CONTRASTS)
    connection.executescript(
        f"""BEGIN; {" ".join(added)}
        DROP VIEW runs; DROP VIEW solutions; DROP VIEW asked; {_VIEWS}
        PRAGMA user_version = {FORMAT}; COMMIT;"""
    )


_UNREADABLE = (
    *(OSError, sqlite3.Error, zlib.error, ValueError, LookupError, TypeError),
    *(ArithmeticError, RecursionError),
)


@contextmanager
def explain_errors(folder: Path) -> Iterator[None]:
    """Turn errors of a ``with`` block into a CoarticError that names the file.

    - For an OSError or an error of SQLite, the message says what the cause is.
    - For a ValueError, LookupError, TypeError, ArithmeticError, RecursionError or error of zlib,
      the message says that coartic did not write the content.
    - Other errors are raised as they are.
    """
    try:
        yield
    except _UNREADABLE as error:
        raise CoarticError(_explain(folder / RUNS_FILE, error)) from None


_BUSY = "another program uses it: close it there, or wait for it"
_DAMAGED = (
    "it is damaged. Move it out of its folder and repeat the `coartic run` command, or restore a "
    "copy of the file (not an SQL dump). If it is a pointer of Git LFS, run `git lfs pull`"
)
_SENTENCES = {
    "SQLITE_BUSY": _BUSY,
    "SQLITE_LOCKED": _BUSY,
    "SQLITE_READONLY": "the file or its folder cannot be written. If a `coartic run` was "
    "interrupted there, copy the whole folder, and use the copy",
    "SQLITE_READONLY_DBMOVED": "it was removed, renamed or replaced while the suite ran: put it "
    "back, or repeat the command to start again",
    "SQLITE_CANTOPEN": "it cannot be opened: check the permissions of the file and its folder",
    "SQLITE_CORRUPT": _DAMAGED,
    "SQLITE_NOTADB": _DAMAGED,
    "SQLITE_IOERR": "the system cannot read or write it. The disk, a quota or the limit of file "
    "size (`ulimit -f`) may be exhausted: make room, and repeat the command",
    "SQLITE_FULL": "the disk is full: make room, and repeat the command",
}
"""Dict that maps the name of an error in SQLite, or the first two words of the name, to an
explanation for the user."""


def _explain(path: Path, error: Exception) -> str:
    """Return the message of :func:`explain_errors` for an error of the file ``path``."""
    problem = plain(str(error), 200) or type(error).__name__
    if isinstance(error, OSError):
        path, problem = Path(error.filename or path), error.strerror or problem
    elif isinstance(error, sqlite3.Error):
        name = getattr(error, "sqlite_errorname", "")
        problem = _SENTENCES.get(name, _SENTENCES.get("_".join(name.split("_")[:2]), problem))
        # The file was cut off while it was open.
        if "decode to UTF-8" in problem or problem.startswith("no such "):
            problem = _DAMAGED
    else:
        wrong = explain(error) if isinstance(error, ValidationError) else problem
        problem = f"its content was not written by coartic ({plain(wrong, 200)})"
    return f"{plain(str(path))} cannot be used: {problem}"


def _unpack(blob: bytes | None) -> Array:
    """Decompress and decode the rewards of k trials (:func:`reward_bytes`), shape ``(k,)``.

    NaN stands for a trial that failed or whose reward is not stored. The result is empty if
    ``blob`` is None. Raises zlib.error or ValueError for a damaged blob.
    """
    if blob is None:
        return np.empty(0)
    numbers = np.frombuffer(zlib.decompress(blob), np.uint8).reshape(4, -1).T.copy().view("<u4")
    best, worse = numbers[:1].view("<i4").ravel(), numbers[1:].ravel()
    return np.where(worse == 0, np.nan, best + 1.0 - worse)
