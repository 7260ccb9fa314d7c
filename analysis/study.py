"""A results folder as data: its runs, cells, tasks, movements and optima.

``load("results/comparison")`` reads a folder. What is computed from it is a plain function of the
study, in the packages beside this file; :func:`cached` makes such a function compute once a study.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, wraps
from pathlib import Path
from typing import Any, Concatenate, ParamSpec, TypeVar

import numpy as np
import pandas as pd

from coartic import Execution, Movement, NotApplicableError, Task, hand_sequences
from coartic.analysis.method_frame import methods_of
from coartic.analysis.optima import BestKnown, best_known, gap_share, restrictions
from coartic.analysis.solutions import Solutions
from coartic.analysis.words import titled_apart
from coartic.errors import CoarticError
from coartic.internal.files import folder_named
from coartic.internal.text import counted, unknown
from coartic.learner.conditions import METHOD_PREFIX
from coartic.motion.trial import ranked_sequences
from coartic.robot import Array
from coartic.runs.method_info import MethodInfo
from coartic.runs.plan import Job, label_of, size_of
from coartic.runs.record import execute_all
from coartic.runs.store import explain_errors, open_store
from coartic.tasks.optima import BASE
from coartic.tasks.task import address_of

CellKey = tuple[str, str]
"""Name of a task, and label of a method: its id with its setting."""


@dataclass(frozen=True, eq=False)
class CellRuns:
    """Runs of one method with its parameters on one task."""

    task: str
    method: str
    setting: str
    runs: pd.DataFrame

    @property
    def label(self) -> str:
        """The method with its setting."""
        return label_of(self.method, self.setting)

    @cached_property
    def good(self) -> pd.DataFrame:
        """The runs that have a solution."""
        solved = self.runs["status"] == "ok"
        return self.runs if solved.all() else self.runs[solved]

    @property
    def all_good(self) -> bool:
        """Whether there are runs, and all of them have a solution."""
        return len(self.good) == len(self.runs) > 0

    @cached_property
    def rewards(self) -> Array:
        """Rewards of the solved runs, shape ``(n,)``, ticks."""
        return self.good.reward.to_numpy(dtype=np.float64)

    @cached_property
    def gaps(self) -> Array:
        """Gaps of the solved runs to the best known reward, shape ``(n,)``, shares of it."""
        return self.good.gap.to_numpy(dtype=np.float64)

    @property
    def gap(self) -> float:
        """Gap of the mean reward to the best known reward; NaN where either is missing."""
        best = self.good.best_known.dropna().unique()
        return float(gap_share(self.rewards.mean(), best[0])) if len(best) else math.nan

    @property
    def has_best_known(self) -> bool:
        """Whether there are runs, and a best known reward to which they can have gaps."""
        return bool(self.runs.best_known.notna().any())


UNITS = {
    **dict.fromkeys(["reward", "replay_reward", "initial_reward", "best_known"], "ticks"),
    **dict.fromkeys(["proven_bound", "movement_ticks"], "ticks"),
    **dict.fromkeys(["build_s", "solve_s", "wall_s", "cpu_s", "time_limit_s"], "s"),
    **{"gap": "share of the best known reward", "other_arm_travel": "rad", "process_peak_mb": "MB"},
}
"""Units of columns of :attr:`Study.runs`, which its ``attrs`` have."""


def typical_run(solved: pd.DataFrame) -> str:
    """Id of the run whose reward is nearest to the median."""
    rewards = solved.reward.to_numpy(dtype=np.float64)
    return str(solved.run_id.iloc[np.abs(rewards - np.median(rewards)).argmin()])


Asked = ParamSpec("Asked")
Computed = TypeVar("Computed")
MOST_EXECUTED = 500
"""Runs of a method on a task whose solutions are executed again for the signatures."""


def check_study(study: object) -> None:
    """Raise CoarticError for what is no study, such as a folder."""
    if not isinstance(study, Study):
        needed = "needed is a study, as coartic.analysis.load(folder) returns it"
        raise CoarticError(f"{needed}, not a {type(study).__name__}")


def cached(
    function: Callable[Concatenate[Study, Asked], Computed],
) -> Callable[Concatenate[Study, Asked], Computed]:
    """A function of a study that computes its result once for each study and its arguments.

    It raises CoarticError for what is no study, such as a folder.
    """

    @wraps(function)
    def once(study: Study, /, *args: Asked.args, **named: Asked.kwargs) -> Computed:
        check_study(study)
        key = function, args, tuple(named.items())
        if key not in study._computed:
            study._computed[key] = function(study, *args, **named)
        result: Computed = study._computed[key]
        return result

    return once


def load(folder: str | Path) -> Study:
    """Read a results folder.

    Raises CoarticError where the folder is not a results folder or is not finished.
    """
    folder = folder_named(folder)
    with open_store(folder) as store:
        plan = store.plan()
        runs = store.runs()
        if len(runs) < size_of(plan):
            raise CoarticError(
                f"{folder} has {len(runs)} of {counted(size_of(plan), 'run')}: it was interrupted. "
                "Repeat the `coartic run` command, which does what is missing."
            )
        return Study(folder, plan, store.made_with(), runs)


def tidy(
    runs: pd.DataFrame, tasks: Mapping[str, Task], optima: Mapping[str, BestKnown]
) -> pd.DataFrame:
    """Return stored runs with columns for facts of their tasks, parameters and gaps.

    A parameter whose name is that of a stored column is left out: ``trials`` are those made,
    ``hands`` those of the solution.
    """
    parameters = {text: json.loads(text) for text in runs.parameters.unique()}
    best = {name: each.reward for name, each in optima.items()}
    rows = [
        {
            **parameters[text],
            "family": tasks[name].family,
            "split": tasks[name].split,
            "goals": len(tasks[name].goals),
        }
        for name, text in zip(runs.task, runs.parameters, strict=True)
    ]
    more = pd.DataFrame(rows, runs.index)
    runs = runs.join(more[[name for name in more if name not in runs]])
    as_it_is = restrictions(runs).base == BASE  # other runs solve another task
    runs["best_known"] = runs.task.map(best).where(as_it_is).astype("Int64")
    runs["gap"] = gap_share(
        *(
            runs[name].astype("Float64").to_numpy(np.float64, na_value=np.nan)
            for name in ("reward", "best_known")
        )
    )
    runs.attrs["units"] = UNITS
    return runs


@dataclass(frozen=True, eq=False, repr=False)
class Study:
    """The stored results of one folder."""

    folder: Path
    plan: Sequence[Job]
    """The cells of the suite, with the seed and the number of runs of each."""
    made_with: dict[str, Any]
    """Versions, platform, commit, command and date of the last ``coartic run``."""
    stored: pd.DataFrame
    """Runs as they are stored."""
    _computed: dict[Any, Any] = field(init=False, default_factory=dict)

    def __repr__(self) -> str:
        runs = counted(len(self.runs), "run")
        return f"Study of {self.folder}: {runs} of suite {self.suite}"

    @property
    def suite(self) -> str:
        """Name of the suite that was run."""
        return self.plan[0].suite

    @cached_property
    def tasks(self) -> dict[str, Task]:
        """The tasks as they were run, by name; titles that several share have the name besides."""
        tasks = {job.cell.task.name: job.cell.task for job in self.plan}
        return {task.name: task for task in titled_apart(tasks.values())}

    @cached_property
    def declared(self) -> dict[str, MethodInfo]:
        """The declarations of the methods that were run, by id."""
        return {job.cell.method.name: job.cell.method for job in self.plan}

    @cached_property
    def optima(self) -> dict[str, BestKnown]:
        """Best known reward by task, with the proven bound and where the reward comes from."""
        return best_known(self.stored, self.tasks.values())

    @cached_property
    def runs(self) -> pd.DataFrame:
        """A row for each run: rewards, hand sequences, what was spent (docs/results.md).

        Of its task ``family``, ``split``, ``goals`` (their number) and ``best_known``; its
        parameters by their names; ``gap`` to the best known reward, as a share.
        """
        return tidy(self.stored, self.tasks, self.optima)

    @cached_property
    def methods(self) -> pd.DataFrame:
        """A row for each method with its setting, by its label, in the order of lists and figures.

        The learner's conditions together are a row as well: EC1 on tasks for one arm and EC4 on
        tasks for two. Columns:

        - ``base``: id of the method without a setting;
        - ``condition``: exploration condition of the learner; empty for other methods;
        - ``setting``: parameters that differ from the defaults, such as ``noise_sd=0.1``;
        - ``parts``: labels of the runs, of which the last that ran on a task counts there;
        - ``title``: its name, the same wherever it is shown;
        - ``algorithm``: what it is a form of;
        - ``kind``: ``"learner"`` (the paper's, under its own conditions), ``"optimum search"``,
          ``"no learning"`` (it makes trials without learning from them), or empty;
        - ``information``: its use of the reward, one of three groups;
        - ``built_in``: whether it is one of coartic's methods;
        - ``stochastic``: whether the seed matters;
        - ``headline``: whether it stands for its algorithm;
        - ``under``: label of the method whose setting or ablation it is, if that ran as well;
        - ``look``: colour and dash in figures.
        """
        return methods_of(self.cells.values(), self.declared)

    @cached_property
    def cells(self) -> dict[CellKey, CellRuns]:
        """Runs by task and label (method with its setting), in the order of the plan."""
        names = ["task", "method", "setting"]
        runs = self.runs.copy(deep=False)
        runs.attrs = {}  # which pandas copies with every column that is taken
        groups = runs.groupby(names, sort=False).indices if len(runs) else {}
        return {
            (key[0], cell.label): CellRuns(*key, runs.iloc[groups.get(key, [])])
            for cell in (job.cell for job in self.plan)
            for key in [(cell.task.name, cell.method.name, cell.setting)]
        }

    @cached
    def sequences(self, task: str) -> pd.DataFrame:
        """The corrective process alone on a task: a row for each hand sequence, best first.

        Columns ``hands``, ``reward`` (missing where it fails) and ``reason``. Empty where there
        are too many sequences to try.
        """
        try:
            names = hand_sequences(self.tasks[task])
        except NotApplicableError:
            names = []
        ranked = ranked_sequences(self.tasks[task], names)
        frame = pd.DataFrame([trial[:3] for trial in ranked], columns=["hands", "reward", "reason"])
        return frame.astype({"reward": "Int64"})

    @cached_property
    def solutions(self) -> pd.DataFrame:
        """One row a movement of each run's solution."""
        with open_store(self.folder) as store:
            return store.solutions()

    def rewards(self) -> Iterator[tuple[str, Array]]:
        """Runs that made trials, each with the reward of every trial, NaN where it failed."""
        with open_store(self.folder) as store:
            yield from store.rewards()

    @cached
    def executed(self, task: str, method: str, *, replay: bool = False) -> Solutions:
        """Solutions of the solved runs of a method on a task, executed again.

        The first 500 of them: signatures say no more with thousands.

        Parameters
        ----------
        task, method : str
            Names as in :attr:`runs`; a setting stands after its method: ``"random search
            half_width=0.5"``.
        replay : bool
            The noiseless trial after learning in place of the solution, of the runs that have one.
            For a learner whose solution is its best trial, it says what is learned without
            selection.

        Raises
        ------
        CoarticError
            There are no runs of the method on the task; the stored movements cannot be executed or
            do not do what is stored of them.
        """
        condition = f"{METHOD_PREFIX}{method}"  # which goes by its own name as well
        if (task, method) not in self.cells and (task, condition) in self.cells:
            method = condition
        if (task, method) not in self.cells:
            on_task = [name for on, name in self.cells if on == task]
            asked = ("method", method, on_task) if on_task else ("task", task, self.tasks)
            raise CoarticError(f"{self.folder}: {unknown(*asked)}")
        stored = self.movements("replay" if replay else "solution")
        ids = map(str, self.cells[task, method].good.run_id)
        solutions = {run_id: stored[run_id] for run_id in ids if run_id in stored}
        executed = []
        with explain_errors(self.folder):
            runs = execute_all(self.tasks[task], list(solutions.values()))
            for (run_id, movements), run in zip(solutions.items(), runs, strict=True):
                ticks = sum(movement.ticks or 0 for movement in movements)
                if not (isinstance(run, Execution) and run.completed and run.ticks == ticks):
                    raise ValueError(f"run {run_id} does not do what is stored of it")
                executed.append(run)
        return Solutions(self.tasks[task], method, tuple(executed), tuple(solutions))

    def configurations(self, task: str, method: str, *, replay: bool = False) -> Array:
        """Postures in which the solved runs of a method hit the goals of a task.

        Parameters
        ----------
        task, method : str
            As in :meth:`executed`.
        replay : bool
            Of the noiseless trial after learning in place of the solution.

        Returns
        -------
        ndarray, shape (runs, G, dof)
            Configurations, length unit (base) and rad (joints); at most 500 runs.
        """
        return self.executed(task, method, replay=replay).configurations

    def signature(self, name: str, *, replay: bool = False) -> pd.Series:
        """A signature of coarticulation of every run.

        Parameters
        ----------
        name : str
            One of ``coartic.analysis.SIGNATURES``: ``"first"``, ``"arm"``, ``"hand"``, ...
        replay : bool
            Of the noiseless trial after learning in place of the solution.

        Returns
        -------
        Series
            By the index of :attr:`runs`; NaN for runs that have none, and for those after the
            first 500 of a method on a task.
        """
        from coartic.analysis.signatures.measures import SIGNATURES

        if name not in SIGNATURES:
            raise CoarticError(unknown("signature", name, SIGNATURES))
        values = pd.Series(np.nan, self.runs.index, name=name)
        for key, cell in self.cells.items():
            executed = self.executed(*key, replay=replay)
            here = cell.runs.index[cell.runs.run_id.isin(executed.run_ids)]
            values[here] = SIGNATURES[name].each(executed)
        return values

    @cached
    def signature_of(self, name: str, task: str, method: str, *, replay: bool = False) -> Array:
        """Return a signature of the runs of a method on a task that have it, shape ``(n,)``."""
        from coartic.analysis.signatures.measures import SIGNATURES

        return SIGNATURES[name].of(self.executed(task, method, replay=replay))

    @cached
    def movements(self, part: str = "solution") -> dict[str, tuple[Movement, ...]]:
        """Movements of the ``solution`` or ``replay`` of the runs that are executed, by run id."""
        with open_store(self.folder) as store:
            return store.movements(part, self.tasks, MOST_EXECUTED)


@cached
def one_by_one(study: Study) -> dict[str, Task]:
    """The tasks that a report has one by one, by name.

    All, but no instances of families, if these are more than eight. A changed task has the name of
    its task before the first dot.
    """
    drawn = {name for name in study.tasks if address_of(name.partition(".")[0]) is not None}
    left_out = drawn if len(drawn) > 8 else ()
    return {name: task for name, task in study.tasks.items() if name not in left_out}
