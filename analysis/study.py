"""A results folder as data: its runs, methods, cells, tasks, movements and optima.

``load("results/comparison")`` reads a folder. Other modules of the analysis have functions of a
study.
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
from coartic.analysis.methods import methods_of, parameter_varied, ranked_as
from coartic.analysis.optima import BestKnown, best_known, gap_share, restrictions
from coartic.analysis.signatures import SIGNATURES, Solutions
from coartic.analysis.words import titled_apart
from coartic.errors import CoarticError
from coartic.internal.files import folder_named
from coartic.internal.text import counted, unknown
from coartic.learner.conditions import METHOD_PREFIX
from coartic.method import Information
from coartic.motion.initial_hands import ranked_sequences
from coartic.motion.solution import initial_reward
from coartic.robot import Array
from coartic.runs.method_info import MethodInfo
from coartic.runs.plan import Job, label_of, size_of, trials_in
from coartic.runs.record import execute_all
from coartic.runs.shipped import open_results
from coartic.runs.store import explain_errors
from coartic.tasks.optima import BASE
from coartic.tasks.task import address_of

CellKey = tuple[str, str]
"""Name of a task, and label of a method: its id with its setting, ``cma-es/bandit sigma=0.1``."""


UNITS = {
    **dict.fromkeys(["reward", "replay_reward", "initial_reward", "best_known"], "ticks"),
    **dict.fromkeys(["build_s", "solve_s", "wall_s", "cpu_s", "time_limit_s"], "s"),
    "movement_ticks": "ticks",
    "noisy_ticks": "ticks",
    "gap": "share of the best known reward",
    "other_arm_travel": "rad",
    "process_peak_mb": "MiB",
}
"""Units of columns of :attr:`Study.runs`, also in its ``attrs["units"]``."""


def solved(runs: pd.DataFrame) -> pd.DataFrame:
    """Return the runs with a solution, status ``ok``; the frame itself if all runs have one."""
    have_one = runs.status.to_numpy() == "ok"
    return runs if have_one.all() else runs[have_one]


def typical_run(runs: pd.DataFrame) -> str:
    """Return the id of the run with the reward nearest to the median, the first of several. All
    runs must have a solution, status ``ok``."""
    rewards = runs.reward.to_numpy(dtype=np.float64)
    return str(runs.run_id.iloc[np.abs(rewards - np.median(rewards)).argmin()])


Part = Literal["solution", "replay"]
"""Part of a run that can be executed."""
MOST_EXECUTED = 500
"""Most runs of a method on a task that are executed again, and so have signatures."""


def check_study(study: object) -> None:
    """Raise CoarticError for an object that is no study, such as the path of a folder."""
    if not isinstance(study, Study):
        needed = "needed is a study, as coartic.analysis.load(folder) returns it"
        raise CoarticError(f"{needed}, not a {type(study).__name__}")


def load(folder: str | Path, *, against: str = "") -> Study:
    """Read a results folder, or by the name ``"shipped"`` the shipped results of suite
    ``comparison``. With ``against``, a method of the folder, by id, label or title, table
    ``differences`` compares other methods with this one.

    Raises CoarticError if the folder is no results folder, or lacks runs of its suite, or has no
    method ``against``, or several.
    """
    folder = folder_named(folder)
    with open_results(folder) as store:
        plan = store.plan()
        runs = store.runs()
        if len(runs) < size_of(plan):
            raise CoarticError(
                f"{folder} has {len(runs)} of {counted(size_of(plan), 'run')}: it was interrupted, "
                "or has a part of the runs. Repeat the `coartic run` command, which does what is "
                "missing, or --include all parts in another folder."
            )
        study = Study(folder, plan, store.made_with(), runs, store.marks(), imports=store.imports())
    return replace(study, against=_label_in(study, against)) if against else study


def _label_in(study: Study, name: str) -> str:
    """Return the label of the method that has this label, or else this id or short id such as
    ``EC4``, or else this title in a study. Raises CoarticError if no method has it, or if several
    methods or settings have this id or title, and none this label."""
    methods = study.methods
    for names in (methods.index, methods.base, methods.title):
        for wanted in (name, f"{METHOD_PREFIX}{name}"):
            there = [str(label) for label in methods.index[names == wanted]]
            if len(there) > 1:
                raise CoarticError(f"{name} is several here; name one: {', '.join(there)}")
            if there:
                return there[0]
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
    """Runs as stored, a row for each; :attr:`runs` has further columns."""
    marks: dict[str, list[str]] = field(default_factory=dict)
    """Sentences on what was found against methods, by the method's id: results that differ when a
    run is made again, and other versions of packages."""
    against: str = ""
    """Label of the method with which table ``differences`` compares others; empty if none was
    named."""
    imports: dict[str, list[str]] = field(default_factory=dict)
    """Names and versions of the packages that files of methods import, by the method's id."""

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields for pickle: what was computed from them is left out."""
        return {each.name: getattr(self, each.name) for each in fields(self)}

    @property
    def suite(self) -> str:
        """Name of the suite that was run."""
        return self.plan[0].suite

    @property
    def folder_in_commands(self) -> str:
        """The folder for commands on a page that others read, quoted for a shell: its path from the
        working folder, or its name alone if it is not in there."""
        path = Path(os.path.abspath(self.folder))  # without ..
        return quote(str(path.relative_to(Path.cwd()) if Path.cwd() in path.parents else path.name))

    @property
    def question(self) -> tuple[str, str]:
        """Title and description of a suite of the user's own, run on its own tasks; else two empty
        texts."""
        title, description = self.made_with.get("question", ("", ""))
        return title, description

    @cached_property
    def varied(self) -> tuple[str, dict[str, Any]]:
        """Name of the only parameter in which runs, searches left out, differ, settings of one
        method, and its values by label (:func:`.parameter_varied`); otherwise both empty."""
        return parameter_varied(self.runs)

    @cached_property
    def tasks(self) -> dict[str, Task]:
        """Tasks by name, with titles that differ (:func:`.titled_apart`)."""
        tasks = {job.cell.task.name: job.cell.task for job in self.plan}
        return {task.name: task for task in titled_apart(tasks.values())}

    @cached_property
    def declared(self) -> dict[str, MethodInfo]:
        """Declarations of the methods by id without a setting."""
        return {job.cell.method.name: job.cell.method for job in self.plan}

    @cached_property
    def optima(self) -> dict[str, BestKnown]:
        """Best known rewards by name of the task, with bounds and sources; tasks without a best
        known reward are left out (:func:`.best_known`).

        On the tasks that are kept, a higher reward of :attr:`corrective_best` counts, too.
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
        """Reward, negative ticks, of the corrective process alone with its best hands, by name of
        the task: the zero of gain, share and targets.

        With the task's initial hands where there are over 4,096 hand sequences; NaN if the
        corrective process completes the task with none of these hands, or they cannot be found.
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

        Further columns: ``label``, the method with its setting; ``ranked_as``, the name of its row
        in the ranking, which differs from ``label`` where two conditions of the learner, for one
        arm and for two, are one row; ``budget``, the number of trials that was asked for, missing
        for methods that do not use the reward of each trial; ``family``, ``split``, number of
        ``goals``, of ``arms`` (1 or 2), ``best_known`` reward of the task (missing without one, and
        for a search with another base) and :attr:`corrective_best`; ``gap``, a share of the best
        known reward; and a column for each parameter of methods, unless its name is taken:
        ``trials`` is the number of trials made, ``hands`` the hands of the solution.
        """
        labels = [*map(label_of, self.stored.method, self.stored.setting)]
        runs, cells = self.stored.assign(label=labels), [job.cell for job in self.plan]
        runs["ranked_as"] = ranked_as(runs)
        rows = [
            {
                **cell.method.defaults,
                **cell.parameters,
                "family": cell.task.family,
                "split": cell.task.split,
                "goals": len(cell.task.goals),
                "arms": len(cell.task.hands),
                "budget": trials_in(cell.parameters) or None,
            }
            for cell in cells
        ]
        keys = pd.MultiIndex.from_tuples([(cell.task.name, cell.label) for cell in cells])
        more = pd.DataFrame(rows, keys)
        runs = runs.join(more[[name for name in more if name not in runs]], on=["task", "label"])
        by_trial = runs.information.str.contains(Information.REWARD_BY_TRIAL.value, regex=False)
        runs["budget"] = runs.budget.where(by_trial).astype("Int64")
        as_it_is = restrictions(runs).base == BASE  # other runs solve another task
        best = {name: each.reward for name, each in self.optima.items()}
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
        EC4 on tasks for two, have a further row, with most columns of the second. Columns:

        - ``base``: id of the method without a setting;
        - ``condition``: id of the learner's condition, such as ``EC4``, also of an informed one or
          an ablation; empty for an own condition and other methods;
        - ``setting``: parameters that differ from the defaults, such as ``noise_sd=0.1``;
        - ``title``: name on the page, in tables and figures;
        - ``short``: name in figures of one column;
        - ``algorithm``: algorithm that the method is a form of;
        - ``is_learner``: True for the paper's learner under the paper's conditions, with whatever
          setting;
        - ``is_search``: True for searches for the optimum;
        - ``information``: use of the reward: ``using the reward of each trial``, ``using the reward
          as a formula`` or ``not using the reward``;
        - ``built_in``: True for methods of coartic, False for methods from files;
        - ``stochastic``: True if results depend on the seed;
        - ``headline``: True if the method, with whatever setting, represents its algorithm;
        - ``under``: of a setting or ablation that lists put under its method, the method's label;
          or empty;
        - ``look``: names of colour and mark in figures, a tuple of two texts.
        """
        return methods_of(self.runs, self.declared, self.marks)

    @cached_property
    def cells(self) -> dict[CellKey, pd.DataFrame]:
        """Runs, also failed, by task and label (method with its setting), in the plan's order."""
        runs = self.runs.copy(deep=False)
        runs.attrs = {}  # which pandas copies with every column that is taken
        cells = dict[Any, pd.DataFrame]()
        for key, rows in runs.groupby(["task", "label"], sort=False).indices.items():
            in_turn = rows[-1] - rows[0] < len(rows)  # mostly: a slice shares memory with the runs
            cells[key] = runs.iloc[slice(rows[0], rows[-1] + 1) if in_turn else rows]
        return cells

    def sequences(self, task: str) -> pd.DataFrame:
        """Return the results of the corrective process alone on a task, by hand sequence.

        A row for each sequence, the best first: ``hands``, ``reward`` (negative ticks, missing for
        a failure) and ``reason`` of the failure. No rows if the task has over 4,096 sequences.
        Raises CoarticError for a task that the study does not have. It is cached: do not change it.
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
        """A row for each movement of the solutions: ``run_id``, ``order``, ``goal``, ``hand``,
        ``kind``, ``ticks``, ``path`` (docs/results.md); of all runs of the folder's plan."""
        with open_results(self.folder) as store:
            return store.solutions()

    def rewards(self) -> Iterator[tuple[str, Array]]:
        """Yield the id of each run with rewards of trials, with these rewards, negative
        ticks, shape ``(trials,)``, NaN for a trial that failed or whose reward is not kept."""
        with open_results(self.folder) as store:
            yield from store.rewards()

    def executed(self, task: str, method: str, *, replay: bool = False) -> Solutions:
        """Return the solved runs of a method on a task, executed again.

        Parameters
        ----------
        task, method : str
            Name of the task, and label of the method, its id with its setting:
            ``"random-search sigma=0.1"``; for conditions of the learner also ``"EC4"``.
        replay : bool
            Execute the replay, a noiseless trial after learning, in place of the solution, for runs
            that have a replay.

        Returns
        -------
        Solutions
            Executions of the first 500 solved runs, for ``replay`` only of runs with a replay.

        Raises
        ------
        CoarticError
            The folder has no runs of the method on the task, or the stored movements cannot be
            executed or have other ticks than stored.
        """
        condition = f"{METHOD_PREFIX}{method}"  # which goes by its own name as well
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
                    raise ValueError(f"run {run_id} does not do what is stored of it")
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
        """Return the postures in which the solved runs of a method hit the goals of a task.

        Parameters
        ----------
        task, method : str
            Name of the task, and label of the method (:meth:`executed`).
        replay : bool
            Take the noiseless trial after learning in place of the solution; runs without such a
            trial are left out.

        Returns
        -------
        ndarray, shape (runs, goals, dof)
            Configurations, length unit (base) and rad (joints); of the first 500 solved runs.

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
        """Return a signature of coarticulation of every run, or of the runs of a method on a task.

        Parameters
        ----------
        name : str
            One of ``coartic.analysis.SIGNATURES``: ``"first"``, ``"arm"``, ``"hand"``, ...
        task, method : str, optional
            Name of the only task, and label of the only method, its id with its setting.
        replay : bool
            Take the noiseless trial after learning in place of the solution.

        Returns
        -------
        Series
            By the index of :attr:`runs`; NaN for runs without the signature, failed runs, and runs
            after the first 500 solved ones of a method on a task.

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
        every: pd.Series = pd.concat(parts)
        return every.reindex(self.runs.index)

    def movements(self, part: Part = "solution") -> dict[str, tuple[Movement, ...]]:
        """Return the movements of the ``solution`` or ``replay`` by run id, of the first 500 solved
        runs of each method on each task; for ``replay`` runs without a replay are left out."""
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
        """Tasks that a report shows one by one, by name: all tasks, except that instances of
        families, also changed ones such as ``two-armed/v1/i017.radius-0.2``, are left out if there
        are more than eight instances."""
        drawn = {name for name in self.tasks if address_of(name.partition(".")[0]) is not None}
        left_out = drawn if len(drawn) > 8 else ()
        return {name: task for name, task in self.tasks.items() if name not in left_out}
