"""A results folder as data: its runs, cells, tasks, movements and optima.

``load("results/comparison")`` reads a folder. What is computed from it is a plain function of the
study, in the packages beside this file; :func:`cached` makes such a function compute once a study.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property, lru_cache, wraps
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pandas as pd

from coartic import Execution, NotApplicableError, Task, hand_sequences
from coartic.analysis.frames import gaps
from coartic.analysis.optima import best_known, known_optima
from coartic.analysis.trajectories import Trajectories
from coartic.errors import CoarticError
from coartic.files import folder_named
from coartic.motion.initial import ranked_sequences
from coartic.robot import Array
from coartic.runs.plan import Plan, label_of
from coartic.runs.run import PARTS, execute_all, movements_by_run
from coartic.runs.store import RUNS_FILE, explain_errors, open_store
from coartic.tasks.optima import KnownOptimum
from coartic.tasks.task import address_of
from coartic.text import counted, unknown
from coartic.trajectories import spell_out

CellKey = tuple[str, str]
"""Name of a task, and label of a method: its name with its variant."""


@dataclass(frozen=True)
class CellRuns:
    """One method with parameters on one task, and its runs."""

    task: str
    method: str
    variant: str
    runs: pd.DataFrame

    @property
    def label(self) -> str:
        """The method with its variant."""
        return label_of(self.method, self.variant)

    @cached_property
    def good(self) -> pd.DataFrame:
        """The runs that have a solution."""
        solved = self.runs["status"] == "ok"
        return self.runs if solved.all() else self.runs[solved]

    @cached_property
    def rewards(self) -> Array:
        """Rewards of the solved runs, shape ``(n,)``, ticks."""
        return self.good.reward.to_numpy(dtype=np.float64)


def typical_run(cell: CellRuns) -> int:
    """Index among the solved runs of the one whose reward is nearest to their median."""
    return int(np.abs(cell.rewards - np.median(cell.rewards)).argmin())


Computed = TypeVar("Computed")
MOST_EXECUTED = 500
"""Runs of a cell whose solutions are executed again for the signatures."""
MOST_INSTANCES = 8
"""Instances that a report has one by one; more are shown together, by family."""
MOST_TICKS = 100_000_000
"""Of all these solutions; they are kept tick by tick."""


def load(folder: str | Path) -> Study:
    """Read a results folder.

    Raises CoarticError where the folder is not a results folder or is not finished.
    """
    folder = folder_named(folder)
    with open_store(folder) as store:
        plan = store.plan()
        runs = store.frame("runs")
        if len(runs) < plan.size:
            raise CoarticError(
                f"{folder} has {len(runs)} of {counted(plan.size, 'run')}: it was interrupted. "
                "Repeat the `coartic run` command, which does what is missing."
            )
        return Study(folder, plan, store.made_with(), tidy(runs, plan))


def tidy(runs: pd.DataFrame, plan: Plan) -> pd.DataFrame:
    """Stored runs with what is known of their tasks, their parameters and their gaps in columns.

    A parameter whose name is that of a stored column is left out: ``trials`` are those made,
    ``hands`` those of the solution.
    """
    tasks, parameters = plan.tasks, {text: json.loads(text) for text in runs.parameters.unique()}
    known = best_known(runs, tasks, known_optima(runs, tasks))
    rows = [
        {
            **parameters[text],
            "family": tasks[name].family,
            "split": tasks[name].split,
            "goals": len(tasks[name].goals),
            "best_known": known[name].reward if name in known else None,
        }
        for name, text in zip(runs.task, runs.parameters, strict=True)
    ]
    more = pd.DataFrame(rows, runs.index)
    runs = runs.join(more[[name for name in more if name not in runs]])
    runs["best_known"] = runs.get("best_known", pd.Series(dtype="Int64")).astype("Int64")
    return runs.assign(gap=gaps(runs))


@dataclass(frozen=True, eq=False, repr=False)
class Study:
    """The stored results of one folder."""

    folder: Path
    plan: Plan
    """What was asked for."""
    made_with: dict[str, Any]
    """Versions, platform, commit, command and date of the last ``coartic run``."""
    runs: pd.DataFrame
    """One row a run: rewards, hand sequences, what was spent (docs/results.md); of its task
    ``family``, ``split``, ``goals`` (their number) and ``best_known``; its parameters by their
    names; ``gap`` to the best known reward, as a share."""
    _computed: dict[Callable[..., Any], Any] = field(init=False, default_factory=dict)
    _kept: dict[tuple[str, str, str], Trajectories] = field(init=False, default_factory=dict)

    def __repr__(self) -> str:
        runs, cells = counted(len(self.runs), "run"), counted(len(self.cells), "cell")
        return f"Study of {self.folder}: {runs} of suite {self.suite}, {cells}"

    @property
    def suite(self) -> str:
        """Name of the suite that was run."""
        return self.plan.suite

    @cached_property
    def tasks(self) -> dict[str, Task]:
        """The tasks as they were run, by name."""
        return self.plan.tasks

    def sequences(self, task: str) -> pd.DataFrame:
        """The corrective process alone on a task: a row for each hand sequence, best first.

        Columns ``hands``, ``reward`` (missing where it fails) and ``reason``. Empty where there
        are too many sequences to try. Tried once for each task.
        """
        if task not in self._sequences:
            try:
                names = hand_sequences(self.tasks[task])
            except NotApplicableError:
                names = []
            ranked = ranked_sequences(self.tasks[task], names)
            rows = [(hands, trial.reward, trial.reason) for hands, trial in ranked]
            frame = pd.DataFrame(rows, columns=["hands", "reward", "reason"])
            self._sequences[task] = frame.astype({"reward": "Int64"})
        return self._sequences[task]

    @cached_property
    def _sequences(self) -> dict[str, pd.DataFrame]:
        return {}

    @cached_property
    def cells(self) -> dict[CellKey, CellRuns]:
        """Runs by task and label (method with its variant), in the order of the plan."""
        names = ["task", "method", "variant"]
        groups = self.runs.groupby(names, sort=False).indices if len(self.runs) else {}
        return {
            (key[0], cell.label): CellRuns(*key, self.runs.iloc[groups.get(key, [])])
            for cell in self.plan.cells
            for key in [(cell.task.name, cell.method.name, cell.variant)]
        }

    @cached_property
    def solutions(self) -> pd.DataFrame:
        """One row a movement of each run's solution."""
        return self._frame("solutions")

    def rewards(self) -> Iterator[tuple[str, Array]]:
        """Runs that made trials, each with the reward of every trial, NaN where it failed."""
        with open_store(self.folder) as store:
            yield from store.rewards()

    def trajectories(self, task: str, label: str) -> Trajectories:
        """Solutions of a cell, executed again tick by tick, each cell once.

        The first 500 runs that solved the task: signatures say no more with thousands, which
        would fill the memory.
        """
        return self._executed(task, label, "solution")

    def replays(self, task: str, label: str) -> Trajectories:
        """The same for the noiseless trials after learning, of the runs that have one.

        For a learner whose solution is its best trial, they say what is learned without selection.
        """
        return self._executed(task, label, "replay")

    def postures(self, task: str, label: str, *, replay: bool = False) -> Array:
        """Postures in which the solved runs of a method hit the goals of a task.

        Parameters
        ----------
        task, label : str
            Names as in :attr:`runs`.
        replay : bool
            Of the noiseless trial after learning in place of the solution.

        Returns
        -------
        ndarray, shape (runs, G, dof)
            Configurations, length unit (base) and rad (joints); at most 500 runs.
        """
        executions = self._executions((task, label), "replay" if replay else "solution")
        return np.array([execution.configurations for execution in executions.values()])

    def sign(self, name: str, *, replay: bool = False) -> pd.Series:
        """A sign of coarticulation of every run.

        Parameters
        ----------
        name : str
            One of ``coartic.analysis.SIGNS``: ``"first"``, ``"arm"``, ``"hand"``, ...
        replay : bool
            Of the noiseless trial after learning in place of the solution.

        Returns
        -------
        Series
            By the index of :attr:`runs`; NaN for runs that have none, and for those after the
            first 500 of a method on a task.
        """
        from coartic.analysis.signatures.signs import SIGNS

        if name not in SIGNS:
            raise CoarticError(unknown("sign", name, SIGNS))
        values = pd.Series(np.nan, self.runs.index, name=name)
        for key, cell in self.cells.items():
            executed = self.replays(*key) if replay else self.trajectories(*key)
            here = cell.runs.index[cell.runs.run_id.isin(executed.run_ids)]
            values[here] = SIGNS[name].each(executed)
        return values

    def _executed(self, task: str, label: str, part: str) -> Trajectories:
        key = task, label, part
        if key not in self._kept:
            cell, executions = self.cells[task, label], self._executions((task, label), part)
            runs = tuple(spell_out(self.tasks[task], each) for each in executions.values())
            self._kept[key] = Trajectories(
                self.tasks[task], cell.method, cell.variant, runs, run_ids=tuple(executions)
            )
        return self._kept[key]

    def _executions(self, key: CellKey, part: str) -> dict[str, Execution]:
        task, wanted = self.tasks[key[0]], _executed_of(self.cells[key])
        rows, paths = (
            frame[frame.run_id.isin(wanted)] for frame in (self._frame(part), self._frame("paths"))
        )
        with explain_errors(self.folder):
            solutions = movements_by_run(task, rows, paths)
            ids = [run_id for run_id in wanted if run_id in solutions]
            executions = execute_all(task, [solutions[run_id] for run_id in ids])
            executed = {}
            for run_id, execution in zip(ids, executions, strict=True):
                if (
                    not isinstance(execution, Execution)
                    or not execution.completed
                    or execution.ticks != sum(movement.ticks or 0 for movement in solutions[run_id])
                ):
                    raise ValueError(f"run {run_id} does not do what is stored of it")
                executed[run_id] = execution
        return executed

    @cached_property
    def optima(self) -> dict[str, KnownOptimum]:
        """Best known reward by task, with all joints free."""
        return known_optima(self.runs, self.tasks)

    @cached_property
    def best_known(self) -> dict[str, KnownOptimum]:
        """The same, and of an instance of a family without one the best of this folder's runs."""
        return best_known(self.runs, self.tasks, self.optima)

    def _frame(self, view: str) -> pd.DataFrame:
        return _frame(self.folder, view, (self.folder / RUNS_FILE).stat().st_mtime_ns)


def cached(function: Callable[[Study], Computed]) -> Callable[[Study], Computed]:
    """A function of a study that computes its result once for each study."""

    @wraps(function)
    def once(study: Study) -> Computed:
        if function not in study._computed:
            study._computed[function] = function(study)
        result: Computed = study._computed[function]
        return result

    return once


@cached
def one_by_one(study: Study) -> set[str]:
    """Names of the tasks that a report has one by one.

    All, but no instances of families, if these are many. A variant has the name of its task before
    the first dot.
    """
    drawn = {name for name in study.tasks if address_of(name.partition(".")[0]) is not None}
    return set(study.tasks) - (drawn if len(drawn) > MOST_INSTANCES else set())


@lru_cache(maxsize=4)
def _frame(folder: Path, view: str, _: int) -> pd.DataFrame:
    """A view of a folder as it was at a time, or movements and waypoints of the runs that are
    executed: studies of parts of a folder share it."""
    with open_store(folder) as store:
        if view in PARTS:
            table = store.movements(view, MOST_EXECUTED)
        else:
            table = store.waypoints(MOST_EXECUTED) if view == "paths" else store.frame(view)
    if view in PARTS and table.ticks.sum() > MOST_TICKS:
        raise CoarticError(f"the solutions take more than {MOST_TICKS:_} ticks in all")
    return table


def _executed_of(cell: CellRuns) -> list[str]:
    return [str(run_id) for run_id in cell.good.run_id[:MOST_EXECUTED]]
