"""Load a results folder as a study: its runs, methods, cells, tasks, movements and optima.

``load("results/comparison")`` reads a folder. The other modules of the analysis have functions that
take the study.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from shlex import quote
from typing import Any, Literal

import numpy as np
import pandas as pd

from coartic import Execution, Movement, NotApplicableError, Task, hand_sequences, initial_hands
from coartic.analysis.methods import methods_of, parameters_varied, ranked_as
from coartic.analysis.optima import BestKnown, best_known, gap_share, restrictions
from coartic.analysis.signatures import SIGNATURES, Solutions
from coartic.analysis.words import titled_apart
from coartic.errors import CoarticError
from coartic.internal.files import folder_named
from coartic.internal.text import counted, unknown
from coartic.learner.conditions import METHOD_PREFIX
from coartic.method import Information
from coartic.motion.execution import initial_reward
from coartic.motion.initial_hands import ranked_sequences
from coartic.robot import Array
from coartic.runs.method_info import MethodInfo
from coartic.runs.plan import Job, label_of, size_of
from coartic.runs.record import execute_all
from coartic.runs.shipped import open_results
from coartic.runs.store import explain_errors
from coartic.tasks.optima import BASE
from coartic.tasks.task import address_of

CellKey = tuple[str, str]
"""Name of a task, and label of a method: its id and setting, as in ``cma-es/bandit sigma=0.1``."""


UNITS = {
    **dict.fromkeys(["reward", "replay_reward", "initial_reward", "best_known"], "ticks"),
    **dict.fromkeys(["build_s", "solve_s", "wall_s", "cpu_s", "time_limit_s"], "s"),
    "movement_ticks": "ticks",
    "noisy_ticks": "ticks",
    "gap": "share of the best known reward",
    "other_arm_travel": "rad",
    "process_peak_mb": "MiB",
}
"""Units of columns of :attr:`Study.runs`. They are also in its ``attrs["units"]``."""


def solved(runs: pd.DataFrame) -> pd.DataFrame:
    """Return the runs with a solution (status ``ok``), or the frame itself if all have one."""
    is_solved = runs.status.to_numpy() == "ok"
    return runs if is_solved.all() else runs[is_solved]


def typical_run(runs: pd.DataFrame) -> str:
    """Return the id of the run whose reward is nearest to the median.

    If there is a tie, it is the first of these runs. All runs must have a solution (status ``ok``).
    """
    rewards = runs.reward.to_numpy(dtype=np.float64)
    return str(runs.run_id.iloc[np.abs(rewards - np.median(rewards)).argmin()])


Part = Literal["solution", "replay"]
"""Part of a run that can be executed."""
MOST_EXECUTED = 500
"""Largest number of runs of a method on a task that are executed again and have signatures."""


def check_study(study: object) -> None:
    """Raise CoarticError if an object, such as the path of a folder, is not a study."""
    if not isinstance(study, Study):
        raise CoarticError(
            "the study must be one that coartic.analysis.load(folder) returns, not a "
            f"{type(study).__name__}"
        )


def load(folder: str | Path, *, against: str = "") -> Study:
    """Read a results folder.

    Parameters
    ----------
    folder : str or pathlib.Path
        The folder, or ``"shipped"`` for the shipped results of suite ``comparison``.
    against : str
        Id, label or title of a method of the folder. Table ``differences`` compares the other
        methods with it.

    Returns
    -------
    Study

    Raises
    ------
    CoarticError
        The folder is not a results folder, runs of its suite are missing, or ``against`` does not
        name exactly one method.
    """
    folder = folder_named(folder)
    with open_results(folder) as store:
        plan = store.plan()
        runs = store.runs()
        if len(runs) < size_of(plan):
            raise CoarticError(
                f"{folder} has {len(runs)} of {counted(size_of(plan), 'run')}: it was interrupted, "
                "or has only a part of the runs. Repeat the `coartic run` command, which makes the "
                "missing runs, or --include all parts in another folder."
            )
        study = Study(folder, plan, store.made_with(), runs, store.marks(), imports=store.imports())
    return replace(study, against=_label_in(study, against)) if against else study


def _label_in(study: Study, name: str) -> str:
    """Return the label of the method that a name means.

    Labels are compared first, then ids, then titles. Ids of the learner's conditions can be short,
    such as ``EC4``. Raises CoarticError if no method, or more than one, has the name.
    """
    methods = study.methods
    for names in (methods.index, methods.base, methods.title):
        for wanted in (name, f"{METHOD_PREFIX}{name}"):
            labels = [str(label) for label in methods.index[names == wanted]]
            if len(labels) > 1:
                raise CoarticError(f"{name} names several methods; use one of {', '.join(labels)}")
            if labels:
                return labels[0]
    raise CoarticError(unknown("method", name, [*methods.index]))


@dataclass(frozen=True, eq=False, repr=False)
class Study:
    """The stored results of a folder."""

    folder: Path
    plan: Sequence[Job]
    """The cells of the suite, with the seed and the number of runs of each."""
    made_with: dict[str, Any]
    """Versions, platform, commit, command and date of the last ``coartic run``."""
    stored: pd.DataFrame
    """Runs as stored, a row for each run. :attr:`runs` has further columns."""
    marks: dict[str, list[str]] = field(default_factory=dict)
    """Warnings about methods, by id: sentences on runs that do not reproduce, and on other versions
    of packages."""
    against: str = ""
    """Label of the method with which table ``differences`` compares the others; may be empty."""
    imports: dict[str, list[str]] = field(default_factory=dict)
    """Names and versions of the packages that files of methods import, by the method's id."""

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields for pickle, without the values that are computed from them."""
        return {stored.name: getattr(self, stored.name) for stored in fields(self)}

    @property
    def suite(self) -> str:
        """Name of the suite that was run."""
        return self.plan[0].suite

    @property
    def folder_in_commands(self) -> str:
        """Path of the results folder for the commands that the report shows, quoted for a shell.

        The path is relative to the working folder. If the results folder is not below the working
        folder, only its name is returned.
        """
        path = Path(os.path.abspath(self.folder))  # without ..
        return quote(str(path.relative_to(Path.cwd()) if Path.cwd() in path.parents else path.name))

    @property
    def question(self) -> tuple[str, str]:
        """Title and description of a user's suite that was run on its own tasks.

        For other suites, both are empty.
        """
        title, description = self.made_with.get("question", ("", ""))
        return title, description

    @cached_property
    def varied(self) -> pd.DataFrame:
        """Values of the parameters that the study varies (:func:`.parameters_varied`).

        It has a row for each label and a column for each parameter. It is empty if the study does
        not vary parameters.
        """
        return parameters_varied(self.runs)

    @cached_property
    def tasks(self) -> dict[str, Task]:
        """Tasks by name; no two have the same title (:func:`.titled_apart`)."""
        tasks = {job.cell.task.name: job.cell.task for job in self.plan}
        return {task.name: task for task in titled_apart(tasks.values())}

    @cached_property
    def declared(self) -> dict[str, MethodInfo]:
        """Declarations of the methods, by id without a setting."""
        return {job.cell.method.name: job.cell.method for job in self.plan}

    @cached_property
    def optima(self) -> dict[str, BestKnown]:
        """Best known rewards with bounds and sources, by name of the task.

        Tasks without a best known reward are left out (:func:`.best_known`). If the reward of
        :attr:`corrective_best` is higher, it replaces the best known reward.
        """
        rewards = best_known(self.stored, self.tasks.values())
        for name, best in rewards.items():
            if (alone := self.corrective_best[name]) > best.reward:
                ranked, source = self.sequences(name), "corrective process alone"
                hands = ranked.hands.iloc[0] if len(ranked) else initial_hands(self.tasks[name])
                rewards[name] = BestKnown(int(alone), best.bound, hands, source, "", best.only_here)
        return rewards

    @cached_property
    def corrective_best(self) -> dict[str, float]:
        """Reward (in negative ticks) of the corrective process alone with its best hands, by task.

        The gain, shares and targets start from this reward. For a task with more than 4,096 hand
        sequences, it is the reward with the task's initial hands. The reward is NaN if the
        corrective process does not complete the task with any of these hands, or if no hands are
        found.
        """
        alone = {}
        for name, task in self.tasks.items():
            of_hands = self.sequences(name).reward
            highest = max(of_hands.dropna(), default=math.nan)
            initial = None if len(of_hands) else initial_reward(task)
            alone[name] = highest if initial is None else float(initial)
        return alone

    @cached_property
    def runs(self) -> pd.DataFrame:
        """A row for each run: rewards, hand sequences, costs (docs/results.md).

        Further columns:

        - ``label``: the method with its setting;
        - ``ranked_as``: the name of its row in the ranking. It differs from ``label`` if two
          conditions of the learner, for one arm and for two arms, share a row;
        - ``budget``: the number of trials that was asked for, missing for methods that do not use
          the reward of each trial;
        - ``note``: warnings about the method (:attr:`marks`), empty if there are none;
        - ``family``, ``split``, number of ``goals`` and number of ``arms`` (1 or 2) of the task;
        - ``best_known``: best known reward of the task, missing if there is none, and for a search
          with another base;
        - ``corrective_best``: as in :attr:`corrective_best`;
        - ``gap``: the gap to the best known reward, as a share of it (:func:`.gaps`);
        - a column for each parameter of methods, unless there is a column of this name already.
          ``trials`` is the number of trials that were made, and ``hands`` are the hands of the
          solution.
        """
        labels = [*map(label_of, self.stored.method, self.stored.setting)]
        runs, cells = self.stored.assign(label=labels), [job.cell for job in self.plan]
        runs["ranked_as"] = ranked_as(runs)
        runs["note"] = ["; ".join(self.marks.get(name, ())) for name in runs.method]
        rows = [
            {
                **cell.method.defaults,
                **cell.parameters,
                "family": cell.task.family,
                "split": cell.task.split,
                "goals": len(cell.task.goals),
                "arms": len(cell.task.hands),
                "budget": cell.trials,
            }
            for cell in cells
        ]
        keys = pd.MultiIndex.from_tuples([(cell.task.name, cell.label) for cell in cells])
        more = pd.DataFrame(rows, keys)
        runs = runs.join(more[[name for name in more if name not in runs]], on=["task", "label"])
        by_trial = runs.information.str.contains(Information.REWARD_BY_TRIAL.value, regex=False)
        runs["budget"] = runs.budget.where(by_trial).astype("Int64")
        as_it_is = restrictions(runs).base == BASE  # other runs solve another task
        best = {name: optimum.reward for name, optimum in self.optima.items()}
        runs["best_known"] = runs.task.map(best).where(as_it_is).astype("Int64")
        runs["corrective_best"] = runs.task.map(self.corrective_best).astype(np.float64)
        rewards = runs[["reward", "best_known"]].astype("Float64")
        runs["gap"] = gap_share(*rewards.to_numpy(np.float64, na_value=np.nan).T)
        runs.attrs["units"] = UNITS
        return runs

    @cached_property
    def methods(self) -> pd.DataFrame:
        """A row for each method with its setting, by label, in the order of lists and figures.

        Two conditions of the learner that are ranked as one, such as EC1 on tasks for one arm and
        EC4 on tasks for two, have a further row, which copies most columns of the second condition.
        Columns:

        - ``base``: id of the method without a setting;
        - ``condition``: id of the learner's condition, such as ``EC4``, also if informed or an
          ablation; empty for a user's own condition and for other methods;
        - ``setting``: parameters that differ from the defaults, such as ``noise_sd=0.1``;
        - ``title``: name on the page, in tables and figures;
        - ``short``: name in figures of one column;
        - ``algorithm``: algorithm of which the method is a form;
        - ``is_learner``: True for the paper's learner under the paper's conditions, with any
          setting;
        - ``is_search``: True for searches for the optimum;
        - ``information``: use of the reward: ``using the reward of each trial``, ``using the reward
          as a formula`` or ``not using the reward``;
        - ``built_in``: True for methods of coartic, False for methods from files;
        - ``stochastic``: True if results depend on the seed;
        - ``headline``: True if the method, with any setting, represents its algorithm;
        - ``under``: if this row is a setting or an ablation of another method, under which lists
          show it, the label of that method; otherwise empty;
        - ``look``: names of colour and marker in figures, a tuple of two strings.
        """
        return methods_of(self.runs, self.declared, self.marks)

    @cached_property
    def cells(self) -> dict[CellKey, pd.DataFrame]:
        """Runs, including failed runs, by task and label, in the plan's order."""
        runs = self.runs.copy(deep=False)
        runs.attrs = {}  # pandas would copy attrs with each column
        cells = dict[Any, pd.DataFrame]()
        for key, rows in runs.groupby(["task", "label"], sort=False).indices.items():
            is_slice = rows[-1] - rows[0] < len(rows)  # usual; a slice shares memory with the runs
            cells[key] = runs.iloc[slice(rows[0], rows[-1] + 1) if is_slice else rows]
        return cells

    def sequences(self, task: str) -> pd.DataFrame:
        """Return the results of the corrective process alone on a task, by hand sequence.

        Parameters
        ----------
        task : str
            Name of a task of the study.

        Returns
        -------
        DataFrame
            A row for each sequence, the best first: ``hands``, ``reward`` (in negative ticks,
            missing if the trial failed) and ``reason`` of the failure. The frame has no rows if the
            task has more than 4,096 sequences. The frame is cached: do not change it.

        Raises
        ------
        CoarticError
            The study has no task of this name.
        """
        if task not in self.tasks:
            raise CoarticError(f"{self.folder}: {unknown('task', task, self.tasks)}")
        if task not in self._sequences:
            try:
                names = hand_sequences(self.tasks[task])
            except NotApplicableError:
                names = []
            ranked = [trial[:3] for trial in ranked_sequences(self.tasks[task], names)]
            frame = pd.DataFrame(ranked, columns=["hands", "reward", "reason"])
            self._sequences[task] = frame.astype({"reward": "Int64"})
        return self._sequences[task]

    @cached_property
    def solutions(self) -> pd.DataFrame:
        """A row for each movement of the solutions of all runs.

        Columns: ``run_id``, ``order``, ``goal``, ``hand``, ``kind``, ``ticks``, ``path``
        (docs/results.md).
        """
        with open_results(self.folder) as store:
            return store.solutions()

    def rewards(self) -> Iterator[tuple[str, Array]]:
        """Yield the id and the rewards of the trials of each run that has stored them.

        Rewards are negative ticks, shape ``(trials,)``. They are NaN for trials that failed, and
        for trials whose reward is not stored.
        """
        with open_results(self.folder) as store:
            yield from store.rewards()

    def executed(self, task: str, method: str, *, replay: bool = False) -> Solutions:
        """Return the solved runs of a method on a task, executed again.

        Parameters
        ----------
        task, method : str
            Name of the task, and label of the method (its id and setting), such as
            ``"random-search sigma=0.1"``. Conditions of the learner can be short: ``"EC4"``.
        replay : bool
            True to execute the replay, a trial without noise after learning, instead of the
            solution.

        Returns
        -------
        Solutions
            Executions of the first 500 solved runs. With ``replay``, runs without a replay are left
            out.

        Raises
        ------
        CoarticError
            The folder has no runs of the method on the task, or the stored movements cannot be
            executed or take other ticks than are stored.
        """
        condition = f"{METHOD_PREFIX}{method}"  # conditions of the learner can be short: EC4
        if (task, method) not in self.cells and (task, condition) in self.cells:
            method = condition
        if (task, method) not in self.cells:
            on_task = [name for on, name in self.cells if on == task]
            asked = ("method", method, on_task) if on_task else ("task", task, self.tasks)
            raise CoarticError(f"{self.folder}: {unknown(*asked)}")
        if (task, method, replay) in self._executed:
            return self._executed[task, method, replay]
        stored = self.movements("replay" if replay else "solution")
        ids = map(str, solved(self.cells[task, method]).run_id)
        solutions = {run_id: stored[run_id] for run_id in ids if run_id in stored}
        executed = []
        with explain_errors(self.folder):
            runs = execute_all(self.tasks[task], list(solutions.values()))
            for (run_id, movements), run in zip(solutions.items(), runs, strict=True):
                ticks = sum(movement.ticks or 0 for movement in movements)
                if not (isinstance(run, Execution) and run.completed and run.ticks == ticks):
                    raise ValueError(f"run {run_id} does not reproduce its stored ticks")
                executed.append(run)
        solved_runs = Solutions(
            self.tasks[task],
            method,
            tuple(executed),
            tuple(solutions),
            deterministic=not self.methods.stochastic[method],
        )
        self._executed[task, method, replay] = solved_runs
        return solved_runs

    def configurations(self, task: str, method: str, *, replay: bool = False) -> Array:
        """Return the postures in which a method's solved runs hit the goals of a task.

        Parameters
        ----------
        task, method : str
            Name of the task, and label of the method (:meth:`executed`).
        replay : bool
            True to use the trial without noise after learning instead of the solution. Runs without
            such a trial are left out.

        Returns
        -------
        ndarray, shape (runs, goals, dof)
            Configurations of the first 500 solved runs, in length units (base) and rad (joints).

        Raises
        ------
        CoarticError
            The folder has no runs of the method on the task, or they cannot be executed again.
        """
        return self.executed(task, method, replay=replay).configurations

    def signature(
        self,
        name: str,
        task: str | None = None,
        method: str | None = None,
        *,
        replay: bool = False,
    ) -> pd.Series:
        """Return a signature of coarticulation for all runs, or those of a method on a task.

        Parameters
        ----------
        name : str
            One of ``coartic.analysis.SIGNATURES``: ``"first"``, ``"arm"``, ``"hand"``, ...
        task, method : str, optional
            Name of a task, and label of a method (its id and setting). Unless both are given, all
            runs are used.
        replay : bool
            True to use the trial without noise after learning instead of the solution.

        Returns
        -------
        Series
            Values by the index of :attr:`runs`. They are NaN for runs without the signature, for
            failed runs, and for all but the first 500 solved runs of a method on a task.

        Raises
        ------
        CoarticError
            The name is unknown, or the folder has no runs of the method on the task.
        """
        if name not in SIGNATURES:
            raise CoarticError(unknown("signature", name, SIGNATURES))
        cells = [*self.cells] if task is None or method is None else [(task, method)]
        parts = []
        for key in cells:
            if (name, *key, replay) not in self._signatures:
                executed = self.executed(*key, replay=replay)
                runs = self.cells[executed.task.name, executed.label]
                values = pd.Series(np.nan, runs.index, name=name)
                values[runs.run_id.isin(executed.run_ids)] = SIGNATURES[name].each(executed)
                self._signatures[name, *key, replay] = values
            parts.append(self._signatures[name, *key, replay])
        if len(parts) == 1:
            return parts[0]
        values_of_all: pd.Series = pd.concat(parts)
        return values_of_all.reindex(self.runs.index)

    def movements(self, part: Part = "solution") -> dict[str, tuple[Movement, ...]]:
        """Return the movements of solutions, or of replays, by run id.

        Only the first 500 solved runs of each method on each task are included. For ``"replay"``,
        runs without a replay are left out.
        """
        if part not in self._movements:
            with open_results(self.folder) as store:
                self._movements[part] = store.movements(part, MOST_EXECUTED)
        return self._movements[part]

    @cached_property
    def _sequences(self) -> dict[str, pd.DataFrame]:
        return {}

    @cached_property
    def _executed(self) -> dict[tuple[str, str, bool], Solutions]:
        return {}

    @cached_property
    def _signatures(self) -> dict[tuple[str, str, str, bool], pd.Series]:
        return {}

    @cached_property
    def _movements(self) -> dict[str, dict[str, tuple[Movement, ...]]]:
        return {}

    @cached_property
    def individual_tasks(self) -> dict[str, Task]:
        """Tasks that a report shows individually, by name.

        If the study has more than eight instances of families, all instances are left out. Changed
        instances, such as ``two-armed/v1/i017.radius-0.2``, count as instances.
        """
        drawn = {name for name in self.tasks if address_of(name.partition(".")[0]) is not None}
        left_out = drawn if len(drawn) > 8 else ()
        return {name: task for name, task in self.tasks.items() if name not in left_out}
