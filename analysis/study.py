"""Load a results folder as a study: its runs, methods, cells, tasks, movements and optima.

``load("results/comparison")`` reads a folder and returns a :class:`Study`. The tables, the figures
and many other functions of the analysis take this study as an argument.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, lru_cache
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

import numpy as np
import pandas as pd
from pydantic import Field, ValidationError

from coartic import Execution, Movement, NotApplicableError, Task, hand_sequences, initial_hands
from coartic.analysis.contrasts import (
    EXACT,
    OF_CURVE,
    QUANTITIES,
    Values,
    check_contrasts,
    planned_cells,
    rows_of,
)
from coartic.analysis.frames import shares
from coartic.analysis.methods import methods_of, parameters_varied, ranked_as
from coartic.analysis.optima import (
    FRESH_EXECUTIONS,
    BestKnown,
    best_known,
    relative_gap,
    restrictions,
    run_values,
)
from coartic.analysis.signatures import SIGNATURES, Solutions
from coartic.analysis.words import listed, number, slugs, titled_apart
from coartic.errors import CoarticError
from coartic.internal.limits import brief_value
from coartic.internal.text import plain, pluralize, unknown
from coartic.internal.toml_files import read_toml
from coartic.internal.validation import FileData, explain
from coartic.learner.conditions import METHOD_PREFIX
from coartic.method import Information
from coartic.model import WORLD, MotionModel
from coartic.motion.execution import initial_reward
from coartic.motion.initial_hands import best_hands, ranked_sequences
from coartic.motion.solution import corrective_movements
from coartic.robot import Array
from coartic.runs.contrasts import Contrast, Place, Registered
from coartic.runs.method_info import MethodInfo
from coartic.runs.plan import Job, judge_seed, label_of, reference_seed, size_of, world_title
from coartic.runs.record import execute_all, judge
from coartic.runs.rows import places_of
from coartic.runs.shipped import SHIPPED_SUITES, open_results, results_folder
from coartic.runs.store import Store, explain_errors
from coartic.tasks.optima import BASE
from coartic.tasks.task import address_of

CellKey = tuple[str, str]
"""Pair of the name of a task and the label of a method. A label is the id of the method with its
setting, such as ``cma-es/bandit sigma=0.1``."""


UNITS = {
    **dict.fromkeys(["reward", "replay_reward", "initial_reward", "best_known"], "ticks"),
    **dict.fromkeys(["value", "corrective_best", "mean_ticks"], "ticks"),
    **dict.fromkeys(["build_s", "solve_s", "wall_s", "cpu_s", "time_limit_s"], "s"),
    "movement_ticks": "ticks",
    "gap": "share of the best known reward",
    "other_arm_travel": "rad",
    "process_peak_mb": "MiB",
}
"""Maps names of columns of :attr:`Study.runs` to units. Rewards are negative numbers of ticks. The
frame contains this dict in ``attrs["units"]``."""


def _labelled(stored: pd.DataFrame) -> pd.DataFrame:
    """Return stored runs with the columns ``label`` and ``ranked_as`` of :attr:`Study.runs`."""
    runs = stored.assign(label=[*map(label_of, stored.method.tolist(), stored.setting.tolist())])
    return runs.assign(ranked_as=ranked_as(runs))


_AT_THE_END = (
    *("hands", "replay_reward", "replay_hands", "movement_ticks", "forward_kinematics"),
    *("corrections", "failed_trials", "gradients", "solver_iterations", "solution_corrections"),
    *("early_corrections", "late_corrections", "other_arm_travel", "build_s", "solve_s"),
    *("wall_s", "cpu_s", "process_peak_mb"),
)
"""Columns of runs that are known only of a whole run."""


def _cut(
    runs: pd.DataFrame, curves: Mapping[str, tuple[Array, Array]], trials: int
) -> pd.DataFrame:
    """Return runs with what is known of them after some trials.

    Runs that made no more trials, and failed runs, stay as they are. ``curves`` are those of
    :func:`improvements`. A run without a completed trial so far is a failed run.
    """
    longer = (runs.status == "ok") & (runs.trials > trials).fillna(False)
    steps = [curves[run_id] for run_id in runs.run_id[longer]]
    best = [float(best_after(of, trials)) for of in steps]
    last = [float(best_after((of[0], of[0]), trials)) - 1 for of in steps]  # counted from 0
    runs = runs.copy()
    runs.loc[longer, [name for name in _AT_THE_END if name in runs]] = pd.NA
    for name, values in (("reward", best), ("best_trial", last), ("trials", [trials] * len(best))):
        if name in runs:
            known = pd.Series(values, runs.index[longer], dtype=np.float64)
            runs.loc[longer, name] = known.astype("Int64")  # NaN becomes missing
    unsolved = longer & runs.reward.isna()
    runs.loc[unsolved, "status"] = "infeasible"
    runs.loc[unsolved, "reason"] = f"no completed trial in the first {trials}"
    return runs


def _by_trial(runs: pd.DataFrame) -> pd.Series:
    """Return whether the method of each run uses the reward of each trial."""
    return runs.information.str.contains(Information.REWARD_BY_TRIAL.value, regex=False)


def solved(runs: pd.DataFrame) -> pd.DataFrame:
    """Return the runs that have a solution (status ``ok``).

    If all runs have a solution, the frame itself is returned.
    """
    is_solved = runs.status.to_numpy() == "ok"
    return runs if is_solved.all() else runs[is_solved]


def typical_run(runs: pd.DataFrame) -> str:
    """Return the id of the run whose value (column ``value``) is nearest to the median of all runs.

    If several runs are equally near, the first of them is used. All runs must have a solution
    (status ``ok``), and there must be at least one run.
    """
    values = runs.value.to_numpy(dtype=np.float64)
    return str(runs.run_id.iloc[np.abs(values - np.median(values)).argmin()])


Value = TypeVar("Value")
_LAZY = int(pd.__version__.partition(".")[0]) >= 3
"""True if pandas copies the data of a shallow copy as soon as one of the two frames is changed."""


class _Copied(cached_property[Value]):
    """A cached property that returns a copy, so that a user can change what a study returns."""

    if not TYPE_CHECKING:  # the types of cached_property are right

        def __get__(self, study, owner=None):
            value = super().__get__(study, owner)
            return value if study is None else value.copy()

        def __set__(self, study, value):  # without it, Python would not call __get__ again
            raise AttributeError(f"{self.attrname} cannot be set")


class _Frames(Mapping[CellKey, pd.DataFrame]):
    """A read-only dict of frames, which returns a copy of a frame."""

    def __init__(self, frames: dict[CellKey, pd.DataFrame]) -> None:
        self._frames = frames

    def __getitem__(self, key: CellKey) -> pd.DataFrame:
        return self._frames[key].copy(deep=not _LAZY)

    def __iter__(self) -> Iterator[CellKey]:
        return iter(self._frames)

    def __len__(self) -> int:
        return len(self._frames)


Part = Literal["solution", "replay"]
"""Part of a run: its solution, or its replay, which is a trial of a learner after learning, without
exploration noise."""
MAX_EXECUTED = 500
"""Largest number of runs of a method on a task that are executed again and have signatures. These
are the first solved runs, in the order of their numbers."""


def check_study(study: object) -> None:
    """Raise CoarticError if an object is not a :class:`Study` with runs in only one world."""
    if not isinstance(study, Study):
        raise CoarticError(
            f"the study is a {type(study).__name__}; it must be one that "
            "coartic.analysis.load(folder) returns"
        )
    _ = study.world


def load(folder: str | Path, *, against: str = "", after: int | None = None) -> Study:
    """Read a results folder.

    Parameters
    ----------
    folder : str or pathlib.Path
        The folder, or the string ``"shipped"`` or ``"shipped-families"`` for the shipped results of
        suites ``comparison`` and ``families``. A folder of your own with such a name is
        ``"./shipped"``, or a :class:`pathlib.Path`.
    against : str
        Id, label or title of a method of the folder, with which table ``differences`` compares the
        other methods. By default, :func:`.list_differences` chooses the method.
    after : int, optional
        Number of trials of each run after which the study looks (:attr:`Study.after`). By default
        it looks at whole runs.

    Returns
    -------
    Study
        The runs of the folder. Gaps, tables and figures are computed when they are first used.

    Raises
    ------
    CoarticError
        The folder is not a results folder, the folder cannot be read, runs of its suite are
        missing, ``against`` does not name exactly one method, or the runs do not have ``after``
        trials in a world without noise (:func:`after_trials`).
    TypeError
        The folder is neither a string nor a path.

    Examples
    --------
    >>> study = load("results/comparison")  # doctest: +SKIP
    >>> study.runs.groupby("label").gap.mean()  # doctest: +SKIP
    >>> early = load("results/comparison", after=100)  # doctest: +SKIP
    """
    folder = results_folder(folder)
    with open_results(folder) as store:
        plan = store.plan()
        runs = store.runs()
        if len(runs) < size_of(plan):
            raise CoarticError(
                f"{folder} has {len(runs)} of {pluralize(size_of(plan), 'run')}: it was "
                "interrupted, or has only a part of the runs. Repeat the `coartic run` command, "
                "which makes the missing runs, or --include all parts in another folder."
            )
        # A notebook can change its working folder.
        place = folder if str(folder) in SHIPPED_SUITES else folder.absolute()
        study = Study(place, plan, store.made_with(), runs, store.marks(), imports=store.imports(),
                      asked=store.contrasts())  # fmt: skip
    study = replace(study, against=_label_in(study, against)) if against else study
    return study if after is None else after_trials(study, after)


def after_trials(study: Study, trials: int) -> Study:
    """Return a study of what is known of each run after its first trials.

    It has the best trial so far of each run that made more trials, and other runs as they are
    (:attr:`Study.after`). It leaves out

    - worlds with motor noise, where the best trial so far says nothing of the answer;
    - methods whose answer is not their best trial, such as a learner from the rewards of subtasks;
    - contrasts of the folder that are only about these, need an execution, or are read after more
      trials.

    Parameters
    ----------
    study : Study
        A study of whole runs.
    trials : int
        Number of trials, at least 1.

    Raises
    ------
    CoarticError
        ``trials`` is no such number, a run of a method with a number of trials made fewer, or
        nothing is left.
    """
    if type(trials) is not int or trials < 1:
        raise CoarticError(f"after is {brief_value(trials)}; it must be a number of trials from 1")
    check_after(study.plan, trials)
    plan = [job for job in study.plan if not job.cell.model.motor_noise]
    worlds = {job.cell.world for job in plan}
    stored = _labelled(study.stored[study.stored.world.isin(worlds)])
    counted = {job.cell.label for job in plan if job.cell.trials}
    practised = stored[_by_trial(stored) & stored.label.isin(counted) & (stored.status == "ok")]
    made = practised.set_index("label").trials.dropna()
    if len(made) and made.min() < trials:
        raise CoarticError(_FEWER.format(trials, made.idxmin(), made.min(), made.min()))
    longer = stored[(stored.status == "ok") & (stored.trials > trials)]
    curves = improvements(replace(study, plan=plan, stored=study.stored.loc[stored.index]))
    best = [curves[run_id][1][-1] if run_id in curves else math.nan for run_id in longer.run_id]
    other = {*longer.label[longer.reward.to_numpy(np.float64, na_value=np.nan) != best]}
    plan = [job for job in plan if job.cell.label not in other]
    kept = stored.index[~stored.label.isin(other)]
    if not plan:
        raise CoarticError(
            "the answers of all methods are other than their best trials: leave out after"
        )
    places = places_of(job for job in plan if job.of_suite)
    return replace(
        study,
        plan=plan,
        stored=study.stored.loc[kept],
        against=study.against if study.against in {*stored.label[kept]} else "",
        asked=[
            record
            for record in study.asked
            if record.contrast.quantity in OF_CURVE
            and (record.contrast.after or 0) <= trials
            and planned_cells(record.contrast, places)
        ],
        after=trials,
        whole=study,
    )


_FEWER = "after is {}, but a run of {} has {} trials: give at most {}"


def check_after(plan: Sequence[Job], trials: int) -> None:
    """Raise CoarticError if no study after a number of trials can be made of a plan.

    The plan has only runs with motor noise, or a method without noise is asked for fewer trials.
    """
    quiet = [job.cell for job in plan if not job.cell.model.motor_noise]
    if not quiet:
        raise CoarticError(
            "all runs are in worlds with motor noise, where the best trial so far says nothing of "
            "the answer: leave out after"
        )
    counts = {
        cell.trials: cell.label
        for cell in quiet
        if cell.trials and Information.REWARD_BY_TRIAL in cell.method.information
    }
    if counts and (fewest := min(counts)) < trials:
        raise CoarticError(_FEWER.format(trials, counts[fewest], fewest, fewest))


def _label_in(study: Study, name: str) -> str:
    """Return the label of the method that ``name``, as a user may write it, refers to.

    The name is looked up first among the labels of the study's methods, then among their ids, and
    then among their titles. For the learner, ``dual-process/`` at the beginning of an id or a label
    can be left out, as in ``EC4``. Raises CoarticError if the name refers to no row of
    :attr:`Study.methods`, or to more than one.
    """
    methods = methods_of(_labelled(study.stored), study.declared, study.marks)  # without gaps
    for names in (methods.index, methods.method_id, methods.title):
        for wanted in (name, f"{METHOD_PREFIX}{name}"):
            labels = [str(label) for label in methods.index[names == wanted]]
            if len(labels) > 1:
                raise CoarticError(
                    f"method {name!r} is ambiguous; write one of the labels {', '.join(labels)}"
                )
            if labels:
                return labels[0]
    raise CoarticError(unknown("method", name, [*methods.index]))


@dataclass(frozen=True, eq=False, repr=False)
class Study:
    """The stored results of a folder.

    If the folder contains runs in several worlds, :attr:`worlds` contains a study for each world.
    Attributes and functions that compare runs, such as best known rewards, tables and figures, need
    a study of one world. For a study of several worlds they raise CoarticError.

    Frames and dicts of a study are copies: if you change one, no table or figure changes.
    """

    folder: Path
    plan: Sequence[Job]
    """The jobs that the last ``coartic run`` asked for. A job consists of a cell (a task, and a
    method with its setting, in a world), the seed of the suite, and the numbers of the runs."""
    made_with: dict[str, Any]
    """Details of the last ``coartic run`` by name, such as versions, platform, commit, command and
    date."""
    stored: pd.DataFrame
    """Runs as they are stored, a row for each run, in the order of the plan. :attr:`runs` has
    further columns."""
    marks: dict[str, list[str]] = field(default_factory=dict)
    """Maps the id of a method to warnings about it. A warning is a sentence which says that a run
    gave another result when it was made again, or that runs were made with other versions of
    packages. Methods without warnings are left out."""
    against: str = ""
    """Label of the method with which table ``differences`` compares the others. It is empty if the
    user has named no method, or if the method has no runs in the world of this study."""
    imports: dict[str, list[str]] = field(default_factory=dict)
    """Maps the id of a method from a file to the packages that the file imports, as strings such as
    ``numpy 2.1.0``."""
    asked: Sequence[Registered] = ()
    """Contrasts of the folder, which :attr:`contrasts` answers."""
    elsewhere: pd.DataFrame = field(default_factory=pd.DataFrame)
    """Rows like those of :attr:`methods`, for methods that have runs only in other worlds of the
    folder. Table ``not-ranked`` lists them, except searches for the optimum."""
    after: int | None = None
    """Number of trials of each run after which the study looks; None for whole runs. Rewards and
    numbers of trials, and what is computed of them, are then of the first trials. Best known
    rewards are those of whole runs, and so are methods without trials. Hands and other costs of
    runs that made more trials are not known, and no solution is (:meth:`executed`)."""
    whole: Study | None = None
    """The study of whole runs from which a study after some trials is made; otherwise None."""

    @contextmanager
    def _opened(self) -> Iterator[Store]:
        """Open the results again, as long as the folder still has the runs of this study.

        Raises CoarticError if it does not: what follows would belong to other runs.
        """
        with open_results(self.folder) as store:
            if not {*vars(self)["stored"].run_id} <= store.asked_ids():
                raise CoarticError(
                    f"{self.folder} was changed since it was loaded, and lacks runs of then: load "
                    "it again"
                )
            yield store

    def __getstate__(self) -> dict[str, Any]:
        """Return a dict of the fields of the study for pickle, without cached values."""
        return {stored.name: getattr(self, stored.name) for stored in fields(self)}

    def _check_whole(self) -> None:
        """Raise CoarticError if this is no study of whole runs, whose solutions are known."""
        if self.after is not None:
            raise CoarticError(
                f"the study is after {pluralize(self.after, 'trial')}, but solutions are those of "
                "whole runs: load it without after"
            )

    @property
    def suite(self) -> str:
        """Name of the suite that was run."""
        return self.plan[0].suite

    @_Copied
    def worlds(self) -> dict[str, Study]:
        """A dict that maps each world of the folder to a study of its runs.

        A key names the constants in which the world differs from the paper's world, such as
        ``motor_noise=0.01``. The key of the paper's world is the empty string. The paper's world
        comes first, if the folder has it, and the others follow in the order of the suite. For a
        study of one world, the only value is the study itself.
        """
        names = sorted({job.cell.world: None for job in self.plan}, key=bool)  # the paper's first
        whole = self.whole.worlds if self.whole else {}
        if len(names) == 1:
            return {names[0]: self}
        labelled = _labelled(self.stored)
        methods, studies = methods_of(labelled, self.declared, self.marks), dict[str, Study]()
        everywhere = {*labelled.label}
        for world in names:
            plan = [job for job in self.plan if job.cell.world == world]
            here = {job.cell.label for job in plan}
            used = {job.cell.method.name for job in plan}
            elsewhere = everywhere - here
            others = [label for label in methods.index if label in elsewhere]
            studies[world] = Study(
                self.folder,
                plan,
                self.made_with,
                self.stored[self.stored.world == world],
                self.marks,
                self.against if self.against in here else "",
                {name: self.imports[name] for name in self.imports if name in used},
                elsewhere=methods.loc[others],
                after=self.after,
                whole=whole.get(world),
            )
        return studies

    @cached_property
    def world(self) -> str:
        """Name of the study's world, such as ``motor_noise=0.01``; empty for the paper's world.

        The name consists of the constants in which the world differs from the paper's world. Raises
        CoarticError for a study of several worlds.
        """
        names = [*dict.fromkeys(job.cell.world for job in self.plan)]
        if len(names) > 1:
            words = listed(map(world_title, names))
            raise CoarticError(
                f"{self.folder} has runs in {words}, which are not compared. Take the study of one "
                f"world: study.worlds[{names[-1]!r}]"
            )
        return names[0]

    @_Copied
    def models(self) -> dict[str, MotionModel]:
        """A dict that maps the name of each task to the motion model of the world.

        The models of two tasks can differ only in their tolerances, which can depend on the radius
        of the goals. Raises CoarticError for a study of several worlds.
        """
        _ = self.world
        return {job.cell.task.name: job.cell.model for job in self.plan}

    @cached_property
    def is_noisy(self) -> bool:
        """True if the study's world has motor noise.

        Raises CoarticError for a study of several worlds.
        """
        return any(model.motor_noise > 0.0 for model in self.models.values())

    @property
    def folder_in_commands(self) -> str:
        """Path of the results folder, quoted for a shell, for commands that the report shows.

        The path is relative to the working folder. If the results folder is not inside the working
        folder, the result is only the name of the results folder.
        """
        if str(self.folder) in SHIPPED_SUITES:
            return str(self.folder)
        path = Path(os.path.abspath(self.folder))  # without ..
        name = str(path.relative_to(Path.cwd()) if Path.cwd() in path.parents else path.name)
        return quote(f"./{name}" if name in SHIPPED_SUITES else name)

    @property
    def question(self) -> tuple[str, str]:
        """Title and description of a user's suite that was run on its own tasks.

        For any other suite, both are empty strings.
        """
        title, description = self.made_with.get("question", ("", ""))
        return title, description

    @_Copied
    def varied(self) -> pd.DataFrame:
        """Values of the parameters that the study varies (:func:`.parameters_varied`).

        The frame contains a row for each setting, indexed by the label of the setting, and a column
        for each parameter. It is empty if the study does not vary parameters.
        """
        return parameters_varied(self.runs, self.declared)

    @_Copied
    def tasks(self) -> dict[str, Task]:
        """A dict that maps the name of each task to the task, in the order of the plan.

        Titles are changed where necessary, so that no two tasks have the same title
        (:func:`.titled_apart`). In a study of one world, they have the goals' radius of this world.
        """
        is_one = len({job.cell.world for job in self.plan}) == 1
        cells = [job.cell for job in self.plan]
        tasks = {cell.task.name: cell.arena if is_one else cell.task for cell in cells}
        return {task.name: task for task in titled_apart(tasks.values())}

    @_Copied
    def declared(self) -> dict[str, MethodInfo]:
        """A dict that maps the id of each method, without a setting, to its declaration."""
        return {job.cell.method.name: job.cell.method for job in self.plan}

    @_Copied
    def optima(self) -> dict[str, BestKnown]:
        """A dict that maps the name of each task to its best known reward in the study's world.

        Each value is a :class:`.BestKnown`: the reward with its bound and its source. Tasks without
        a best known reward are left out (:func:`.best_known`). If the corrective process with its
        best hands gets a higher reward than the best known reward, the reward of the corrective
        process is used instead. In a world with noise, a reward is minus the mean ticks of 1,000
        executions. Their noise differs from the noise with which runs are judged. Raises
        CoarticError for a study of several worlds.
        """
        if self.whole:
            of_whole = self.whole.worlds[self.world].optima
            return {name: of_whole[name] for name in self.tasks if name in of_whole}
        runs, tasks = self.stored, self.tasks.values()
        if self.is_noisy:
            with self._opened() as store:
                rewards = best_known(
                    runs,
                    tasks,
                    models=self.models,
                    fresh=lambda task, run_ids: self._reference_values(
                        task, store.solutions_of(run_ids)
                    ),
                )
        else:
            rewards = best_known(runs, tasks, models=self.models)
        for name, best in rewards.items():
            alone, hands = self._corrective_reference(name)
            if alone > best.reward:
                source, only_here = "corrective process alone", best.only_here
                reward = alone if self.is_noisy else int(alone)
                rewards[name] = BestKnown(reward, best.bound, hands, source, "", only_here)
        return rewards

    def _reference_values(self, task: str, answers: Sequence[Sequence[Movement]]) -> list[float]:
        """Return minus the mean ticks of 1,000 executions with motor noise, for each answer.

        An answer is a sequence of movements that a method recommends. The seed of the noise is
        :func:`.reference_seed`, which differs from the seeds with which runs are judged
        (:func:`.judge_seed`). A failed execution is counted as in :func:`.judge`.
        """
        seeds = [reference_seed(self.plan[0].seed, task)] * len(answers)
        means, _ = judge(self.tasks[task], answers, self.models[task], seeds, FRESH_EXECUTIONS)
        return [-mean for mean in means.tolist()]

    def _corrective_reference(self, task: str) -> tuple[float, str]:
        """Return the reward of the corrective process with its best hands, and these hands.

        The reward is in negative ticks. In a world with noise it is minus the mean ticks of 1,000
        executions, as for a best known reward. The best hands are those of :attr:`corrective_best`.
        If the corrective process does not complete the task, the reward is NaN, and the hands are
        the empty string.
        """
        if self.is_noisy:
            best = best_hands(self.tasks[task], self.models[task])
            if best is None:
                return math.nan, ""
            return self._reference_values(task, [corrective_movements(best[0])])[0], best[0]
        alone = self.corrective_best[task]
        if math.isnan(alone):
            return alone, ""
        ranked = self.sequences(task)
        known = len(ranked) > 0
        hands = ranked.hands.iloc[0] if known else initial_hands(self.tasks[task])
        return alone, hands

    @_Copied
    def corrective_best(self) -> dict[str, float]:
        """A dict that maps the name of each task to the reward of the corrective process alone.

        The reward is in negative ticks. It is the reward with the best of all hand sequences or,
        for a task with more than 4,096 hand sequences, with the initial hands of the task. It is
        NaN if the corrective process does not complete the task with any of these hands. Shares of
        the possible gain, and reward targets, are measured from this reward.

        In a world with noise, the corrective process is executed with the noise with which the runs
        are judged. This noise depends on the number of the run, so that the reward is a mean over
        the numbers of the runs. It is NaN for a task with more than 4,096 hand sequences that names
        a policy instead of its initial hands. Raises CoarticError for a study of several worlds.
        """
        if self.is_noisy:
            return {
                name: float(np.mean([*values.values()]))
                for name, values in self._corrective_by_number.items()
            }
        alone = {}
        for name, task in self.tasks.items():
            of_hands = self.sequences(name).reward
            highest = max(of_hands.dropna(), default=math.nan)
            initial = None if len(of_hands) else initial_reward(task, self.models[name])
            alone[name] = highest if initial is None else float(initial)
        return alone

    @cached_property
    def _corrective_by_number(self) -> dict[str, dict[int, float]]:
        """A dict of values of the corrective process alone in a world with noise.

        The dict maps the name of each task to a dict that maps numbers of runs to values. The value
        for a number is minus the mean ticks of the corrective process with its best hands, executed
        with the noise with which runs of this number are judged. The value is NaN if the corrective
        process does not complete the task.
        """
        by_task = {}
        for name, runs in self.stored.groupby("task", sort=False).run:
            task, model = self.tasks[str(name)], self.models[str(name)]
            numbers = sorted(map(int, runs.unique()))
            seeds = [judge_seed(self.plan[0].seed, task.name, number) for number in numbers]
            if (best := best_hands(task, model)) is None:
                by_task[task.name] = dict.fromkeys(numbers, math.nan)
                continue
            answers = [corrective_movements(best[0])] * len(seeds)
            means, _ = judge(task, answers, model, seeds)
            by_task[task.name] = dict(zip(numbers, (-means).tolist(), strict=True))
        return by_task

    @_Copied
    def runs(self) -> pd.DataFrame:
        """A row for each run: rewards, hand sequences, costs (docs/results.md).

        Further columns:

        - ``value``: the number that rankings compare, in negative ticks: the reward, or in a world
          with noise minus ``mean_ticks`` (:func:`.run_values`); NaN for a failed run;
        - a column for each constant of the run's world (:data:`.WORLD`);
        - ``label``: label of the method, that is, its id with its setting;
        - ``ranked_as``: name of the row of the ranking to which the run belongs. It differs from
          ``label`` if two conditions of the learner, for one arm and for two arms, share a row;
        - ``budget``: the number of trials that was asked for; missing for a method that does not
          use the reward of each trial or has no parameter ``trials``;
        - ``note``: warnings about the method (:attr:`marks`); empty if there are none;
        - ``family`` and ``split`` of the task, the number of its ``goals``, and ``arms``, the
          number of its hands (1 or 2);
        - ``best_known``: best known reward of the task in the run's world (:attr:`optima`); missing
          if there is none, and for a search that locks other base coordinates than the task does;
        - ``corrective_best``: the entry of the task in :attr:`corrective_best`. In a world with
          noise, it is the value of the corrective process executed with the noise with which the
          run is judged;
        - ``gap``: the difference between the best known reward and the value, divided by the size
          of the best known reward (:func:`.relative_gap`), a fraction; NaN if one of the two is
          missing. In a world with noise it can be negative by chance;
        - a column for each parameter of methods, unless another column has the same name.
          Therefore column ``trials`` is the number of trials that the run made, and column
          ``hands`` contains the hands of the solution.
        """
        if len(self.worlds) > 1:
            parts = [study.runs for study in self.worlds.values()]
            runs = pd.concat(parts).loc[self.stored.index]
            runs.attrs["units"] = UNITS
            return runs
        runs, cells = _labelled(self.stored), [job.cell for job in self.plan]
        if self.after is not None:
            runs = _cut(runs, improvements(self), self.after)
        runs["value"] = run_values(runs)
        runs["note"] = ["; ".join(self.marks.get(name, ())) for name in runs.method]
        rows = [
            {
                **cell.method.defaults,
                **cell.parameters,
                **{name: getattr(cell.model, name) for name in WORLD},
                "radius": cell.arena.radius,
                "family": cell.task.family,
                "split": cell.task.split,
                "goals": len(cell.task.goals),
                "arms": len(cell.task.hands),
                "budget": cell.trials if self.after is None else cell.trials and self.after,
            }
            for cell in cells
        ]
        keys = pd.MultiIndex.from_tuples([(cell.task.name, cell.label) for cell in cells])
        more = pd.DataFrame(rows, keys)
        runs = runs.join(more[[name for name in more if name not in runs]], on=["task", "label"])
        runs["budget"] = runs.budget.where(_by_trial(runs)).astype("Int64")
        as_it_is = restrictions(runs).base == BASE  # other runs solve another task
        best = {name: optimum.reward for name, optimum in self.optima.items()}
        known = runs.task.map(best).where(as_it_is)
        runs["best_known"] = known.astype("Float64" if self.is_noisy else "Int64")
        runs["corrective_best"] = runs.task.map(self.corrective_best).astype(np.float64)
        if self.is_noisy:
            values, pairs = self._corrective_by_number, zip(runs.task, runs.run, strict=True)
            runs["corrective_best"] = [values[task][number] for task, number in pairs]
        of_runs = runs[["value", "best_known"]].astype("Float64")
        runs["gap"] = relative_gap(*of_runs.to_numpy(np.float64, na_value=np.nan).T)
        runs.attrs["units"] = UNITS
        return runs

    @_Copied
    def methods(self) -> pd.DataFrame:
        """A row for each setting of each method, in the order of lists and figures.

        The frame is indexed by label: the id of the method with its setting. If two conditions of
        the learner share a row of the ranking, such as EC1 on tasks for one arm and EC4 on tasks
        for two arms, there is a further row for both together, which copies most columns of the
        second condition. Columns:

        - ``method_id``: id of the method without a setting;
        - ``condition``: id of the learner's exploration condition, such as ``EC4`` (informed
          conditions and ablations have ids of their own); empty for a user's own condition and for
          other methods;
        - ``setting``: parameters that differ from the defaults, such as ``noise_sd=0.1``;
        - ``title``: name on the page, in tables and figures;
        - ``short_title``: name in figures of one column;
        - ``algorithm``: name of the algorithm, which several methods can share;
        - ``is_learner``: True for the paper's learner under the paper's conditions, with any
          setting;
        - ``is_search``: True for searches for the optimum;
        - ``information``: use of the reward: ``using the reward of each trial``, ``using the reward
          as a formula`` or ``not using the reward``;
        - ``built_in``: True for methods of coartic, False for methods from files;
        - ``stochastic``: True if results depend on the seed;
        - ``headline``: True if the method, with any setting, represents its algorithm;
        - ``parent``: label of the method of which this row is a setting or an ablation. It is empty
          for any other row, for a row whose parent has no runs, and for the settings of a study
          that varies parameters;
        - ``style``: names of the colour and the marker in figures, a tuple of two strings. Write
          ``methods["style"]``, because ``methods.style`` is an attribute of pandas.
        """
        return methods_of(self.runs, self.declared, self.marks)

    @property
    def cells(self) -> Mapping[CellKey, pd.DataFrame]:
        """A mapping from each cell to its runs, including failed runs.

        Cells are in the order of the plan. A key is a pair: the name of the task, and the label of
        the method. Raises CoarticError for a study of several worlds.
        """
        return _Frames(shared_cells(self))

    @cached_property
    def _cells(self) -> dict[CellKey, pd.DataFrame]:
        check_study(self)
        runs = self.runs
        runs.attrs = {}  # pandas would copy attrs with each column
        cells = dict[Any, pd.DataFrame]()
        for key, rows in runs.groupby(["task", "label"], sort=False).indices.items():
            is_slice = rows[-1] - rows[0] < len(rows)  # usual; a slice shares memory with the runs
            cells[key] = runs.iloc[slice(rows[0], rows[-1] + 1) if is_slice else rows]
        return cells

    def sequences(self, task: str) -> pd.DataFrame:
        """Return the reward of the corrective process alone on a task, for each hand sequence.

        The corrective process acts in the study's world, but without motor noise.

        Parameters
        ----------
        task : str
            Name of a task of the study.

        Returns
        -------
        DataFrame
            A row for each hand sequence, the highest reward first:

            - ``hands``: the hand sequence, such as ``RRLR``;
            - ``reward``: negative ticks, missing if the trial failed;
            - ``reason``: why the trial failed, otherwise empty.

            Hand sequences whose trials failed come last. The frame has no rows if the task has more
            than 4,096 hand sequences.

        Raises
        ------
        CoarticError
            The study has no task of this name, or has several worlds.
        """
        if task not in self.tasks:
            raise CoarticError(f"{self.folder}: {unknown('task', task, self.tasks)}")
        if task not in self._sequences:
            try:
                names = hand_sequences(self.tasks[task])
            except NotApplicableError:
                names = []
            model = self.models[task]
            ranked = [trial[:3] for trial in ranked_sequences(self.tasks[task], names, model=model)]
            frame = pd.DataFrame(ranked, columns=["hands", "reward", "reason"])
            self._sequences[task] = frame.astype({"reward": "Int64"})
        return self._sequences[task].copy()

    @_Copied
    def solutions(self) -> pd.DataFrame:
        """The stored solutions of all solved runs, with a row for each movement.

        The columns are ``run_id``, ``order``, ``goal``, ``hand``, ``kind``, ``ticks`` and ``path``
        (docs/results.md).
        """
        self._check_whole()
        with self._opened() as store:
            solutions = store.solutions()
        return solutions[solutions.run_id.isin(self.stored.run_id)].reset_index(drop=True)

    def rewards(self) -> Iterator[tuple[str, Array]]:
        """Yield the rewards of all trials (:attr:`after`) of each run with stored rewards.

        Yields
        ------
        (str, ndarray)
            Id of the run, and rewards of the trials of the run in negative ticks, shape
            ``(trials,)``. An entry is NaN if the trial failed, or if the reward of this trial is
            not stored.
        """
        ids = {*self.stored.run_id}
        with self._opened() as store:
            for run_id, rewards in store.rewards():
                if run_id in ids:  # others are in another world
                    yield run_id, rewards[: self.after]

    def executed(self, task: str, method: str, *, replay: bool = False) -> Solutions:
        """Execute the solved runs of a method on a task again, without motor noise.

        All other constants of the model are those of the study's world. In a world with noise, a
        run stores movements without ticks. If such a movement misses its goal, the corrective
        process makes a further movement.

        Parameters
        ----------
        task : str
            Name of the task.
        method : str
            Label of the method: its id with its setting, such as ``"random-search sigma=0.1"``.
            For the learner, ``dual-process/`` can be left out, as in ``"EC4"``.
        replay : bool
            True to execute the replay instead of the solution. The replay is a trial of a learner
            after learning, without exploration noise.

        Returns
        -------
        Solutions
            Executions of the first 500 solved runs. If ``replay`` is True, runs without a replay
            are left out. The arrays are read-only.

        Raises
        ------
        CoarticError
            The study has no runs of the method on the task or has several worlds, it is not of
            whole runs (:attr:`after`), the stored movements cannot be executed, or (in a world
            without noise) their ticks differ from the stored ticks.
        """
        self._check_whole()
        condition = f"{METHOD_PREFIX}{method}"  # conditions of the learner can be short: EC4
        if (task, method) not in shared_cells(self) and (task, condition) in shared_cells(self):
            method = condition
        if (task, method) not in shared_cells(self):
            on_task = [name for on, name in shared_cells(self) if on == task]
            asked = ("method", method, on_task) if on_task else ("task", task, self.tasks)
            raise CoarticError(f"{self.folder}: {unknown(*asked)}")
        if (task, method, replay) in self._executed:
            return self._executed[task, method, replay]
        stored = self.movements("replay" if replay else "solution")
        ids = map(str, solved(shared_cells(self)[task, method]).run_id)
        solutions = {run_id: stored[run_id] for run_id in ids if run_id in stored}
        executed = []
        with explain_errors(self.folder):
            runs = execute_all(self.tasks[task], list(solutions.values()), self.models[task])
            for (run_id, movements), run in zip(solutions.items(), runs, strict=True):
                if not (isinstance(run, Execution) and run.completed):
                    raise ValueError(f"run {run_id} does not complete its task again")
                ticks = sum(movement.ticks or 0 for movement in movements)
                if not self.is_noisy and run.ticks != ticks:
                    raise ValueError(f"run {run_id} does not reproduce its stored ticks")
                run.configurations.setflags(write=False)  # the next caller gets the same run
                executed.append(run)
        solved_runs = Solutions(
            self.tasks[task],
            method,
            tuple(executed),
            tuple(solutions),
            deterministic=not self.methods.stochastic[method],
            model=self.models[task].without_noise(),
        )
        self._executed[task, method, replay] = solved_runs
        return solved_runs

    def configurations(self, task: str, method: str, *, replay: bool = False) -> Array:
        """Return the configurations in which a method's solved runs hit the goals of a task.

        Parameters
        ----------
        task, method : str
            Name of the task, and label of the method (:meth:`executed`).
        replay : bool
            True to use the replay instead of the solution (:meth:`executed`). Runs without a replay
            are left out.

        Returns
        -------
        ndarray, shape (runs, goals, dof)
            Configurations of the first 500 solved runs, in length units (base) and rad (joints).

        Raises
        ------
        CoarticError
            The study has no runs of the method on the task, or its runs cannot be executed again
            (:meth:`executed`).
        """
        return self.executed(task, method, replay=replay).configurations.copy()

    def signature(
        self,
        name: str,
        task: str | None = None,
        method: str | None = None,
        *,
        replay: bool = False,
    ) -> pd.Series:
        """Return a signature of coarticulation for each run.

        Parameters
        ----------
        name : str
            Name of the signature: a key of ``coartic.analysis.SIGNATURES``, such as ``"first"``.
        task, method : str, optional
            Name of a task, and label of a method (:meth:`executed`). If both are passed, only the
            runs of this method on this task are used, otherwise all runs.
        replay : bool
            True to use the replay instead of the solution (:meth:`executed`).

        Returns
        -------
        Series
            Values in the unit of the signature. The index is that of :attr:`runs`, or of the runs
            of the method on the task. A value is NaN if the signature is not defined for the run,
            for a failed run, for a run without a replay if ``replay`` is True, and for all solved
            runs of a method on a task after the first 500.

        Raises
        ------
        CoarticError
            No signature has this name, the study has no runs of the method on the task, or runs
            cannot be executed again (:meth:`executed`).
        """
        if name not in SIGNATURES:
            raise CoarticError(unknown("signature", name, SIGNATURES))
        cells = [*shared_cells(self)] if task is None or method is None else [(task, method)]
        parts = []
        for key in cells:
            if (name, *key, replay) not in self._signatures:
                executed = self.executed(*key, replay=replay)
                runs = shared_cells(self)[executed.task.name, executed.label]
                values = pd.Series(np.nan, runs.index, name=name)
                values[runs.run_id.isin(executed.run_ids)] = SIGNATURES[name].each(executed)
                self._signatures[name, *key, replay] = values
            parts.append(self._signatures[name, *key, replay])
        if len(parts) == 1:
            return parts[0].copy()
        values_of_all: pd.Series = pd.concat(parts)
        return values_of_all.reindex(self.runs.index)

    def amounts(
        self, quantity: str, task: str, method: str, *, after: int | None = None
    ) -> pd.Series:
        """Return a quantity of contrasts for each run of a method on a task.

        Parameters
        ----------
        quantity : str
            A quantity (:func:`contrast`), in ticks, in %, or in the unit of a signature.
        task, method : str
            Name of the task, and label of the method.
        after : int, optional
            Number of trials after which the best trial so far is read, for ``ticks``, ``saved``,
            ``gap`` and ``share``. It does not change methods without trials.

        Returns
        -------
        Series
            Values with the index of the runs of the cell. A value is NaN for a failed run, and for
            a run that has no such value.

        Raises
        ------
        CoarticError
            The study has no such runs or several worlds, no quantity has this name, or the
            quantity is not known after so many trials (:attr:`Study.after`).
        """
        if quantity in SIGNATURES:
            return self.signature(quantity, task, method)
        if quantity not in QUANTITIES:
            raise CoarticError(unknown("quantity", quantity, QUANTITIES))
        if quantity not in OF_CURVE:
            self._check_whole()
        if self.after is not None and (after or 0) > self.after:
            raise CoarticError(f"after is {after}, but the study is after {self.after} trials")
        runs, alone = shared_cells(self)[task, method], self.corrective_best[task]
        values = runs.value.astype(np.float64)
        if after is not None and runs.budget.notna().all():
            curves = improvements(self)
            steps = [curves.get(run_id, (np.empty(0), np.empty(0))) for run_id in runs.run_id]
            values = pd.Series([float(best_after(of, after)) for of in steps], runs.index)
        if quantity in EXACT and self.is_noisy:
            executed = self.executed(task, method)
            ticks = {
                run_id: float(run.ticks)
                for run_id, run in zip(executed.run_ids, executed.runs, strict=True)
            }
            values = -runs.run_id.map(ticks).astype(np.float64)
            best = best_hands(self.tasks[task], self.models[task])
            alone = -float(best[1]) if best else math.nan
        match quantity.split()[0]:
            case "saved":
                return 100 * (1 - values / alone)
            case "gap":
                best_known = runs.best_known.astype(np.float64)
                return pd.Series(100 * relative_gap(values, best_known), runs.index)
            case "share":
                scored = runs if after is None else runs.assign(reward=values)
                return 100 * shares(scored[values.notna()]).reindex(runs.index)
        return -values

    def _values_of(self, asked: Contrast, place: Place) -> Values:
        """Return the values of the runs of a place, in the quantity of a contrast."""
        study, key = self.worlds[place.world], (place.task, place.label)
        if key not in shared_cells(study):
            return Values(np.empty(0), True, [])
        runs = shared_cells(study)[key]
        failed = bool(runs.value.isna().any())
        if failed:
            return Values(np.full(len(runs), np.nan), failed, runs.run_id.tolist())
        amounts = study.amounts(asked.quantity, *key, after=asked.after)
        if asked.quantity in (*SIGNATURES, *EXACT):
            amounts = amounts.iloc[:MAX_EXECUTED]
        if place.stops:  # a run that never took so few ticks is no answer at equal saving
            amounts = amounts.where(runs.reached[: len(amounts)].fillna(True).to_numpy(bool))
        return Values(amounts.to_numpy(np.float64), failed, runs.run_id.tolist())

    @_Copied
    def contrasts(self) -> pd.DataFrame:
        """The answers to the contrasts of the folder, with a row for each cell.

        A cell has the tasks of a family in a world. Columns:

        - ``contrast``, ``says``, ``quantity``, ``expected``: the question;
        - ``asked``: when it was asked: *before its runs*, or *after k of its runs*;
        - ``world`` and ``family`` of the cell. The rows of *all families* are not tested. A task of
          no family has a row of its own: ``family`` is its name, ``median`` is missing, and the
          interval of ``mean`` is over runs;
        - ``tasks``: number of planned tasks; ``n``: number of those with a value; ``yes`` and
          ``equal``: how many of the n lie on the expected side of the bound, and on the bound
          (above 0, and 0, if nothing is expected);
        - ``median`` and ``mean`` over tasks, with the ends of their 95 % intervals;
        - ``p`` of the exact two-sided sign test, and ``p_holm``, corrected over the cells of the
          contrast that the suite plans with at least six tasks;
        - ``verdict``: *shown*, *opposite shown*, *open* or *not tested*; empty without expectation;
        - ``dropped``: tasks with failed or missing runs; ``not_applicable``: tasks on which a run
          has no such value;
        - ``note``: what limits the row;
        - ``run_ids`` of the runs.
        """
        return answers(self, self.asked)

    def movements(self, part: Part = "solution") -> dict[str, tuple[Movement, ...]]:
        """Return a dict that maps ids of runs to the stored movements of solutions or replays.

        ``part`` is ``"solution"`` or ``"replay"``. Only the first 500 solved runs of each method on
        each task are included. For ``"replay"``, runs without a replay are left out.
        """
        self._check_whole()
        if part not in self._movements:
            ids = {*self.stored.run_id}
            with self._opened() as store:
                stored = store.movements(part, MAX_EXECUTED)
            self._movements[part] = {key: stored[key] for key in stored if key in ids}
        return self._movements[part].copy()

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

    @_Copied
    def individual_tasks(self) -> dict[str, Task]:
        """A dict that maps names to tasks, for the tasks that a report shows individually.

        The dict contains all tasks of the study, with one exception: if more than eight of them are
        instances of families (random tasks), all instances are left out. A changed instance, such
        as ``two-armed/v1/i017.radius-0.2``, is treated as an instance.
        """
        drawn = {name for name in self.tasks if address_of(name.partition(".")[0]) is not None}
        left_out = drawn if len(drawn) > 8 else ()
        return {name: task for name, task in self.tasks.items() if name not in left_out}


_ANSWER = (
    *("contrast", "says", "quantity", "expected", "asked", "world", "family", "tasks", "n", "yes"),
    *("equal", "median", "median_low", "median_high", "mean", "mean_low", "mean_high", "p"),
    *("p_holm", "verdict", "dropped", "not_applicable", "note", "run_ids"),
)


def answers(study: Study, asked: Sequence[Registered]) -> pd.DataFrame:
    """Return the answers to contrasts (:attr:`Study.contrasts`)."""
    own = [job for job in study.plan if job.of_suite]
    places, rows = places_of(own), list[dict[str, Any]]()
    cells = study.stored.groupby(["task", "method", "setting", "world"]).date
    dates = {key: of_cell.astype(str).tolist() for key, of_cell in cells}
    keys = [(job.cell.task.name, job.cell.method.name, job.cell.setting, job.cell.world)
            for job in own]  # fmt: skip
    for record in asked:
        of_runs = [
            date
            for key, place in zip(keys, places, strict=True)
            if record.contrast.terms_at(place)
            for date in dates.get(key, ())
        ]
        count = max(record.runs, sum(date < record.date for date in of_runs))
        words = "after all its runs" if count == len(of_runs) else f"after {count} of its runs"
        words = words if count else "before its runs"
        words += "" if record.is_asked else ", and changed or left out since"
        for row in rows_of(record.contrast, places, study._values_of, record.cells):
            rows.append(row | {"asked": words})
    return pd.DataFrame(rows, columns=[*_ANSWER])


def contrast(
    study: Study,
    quantity: str,
    weights: Mapping[str, float] | Sequence[Mapping[str, Any]],
    **keys: Any,
) -> pd.DataFrame:
    """Answer a question about a study, as a table ``[[contrasts]]`` of its suite would ask it.

    Parameters
    ----------
    study : Study
        Results of a folder (:func:`load`), in one world or several.
    quantity : str
        What is compared: ``ticks``, ``saved`` (ticks saved, in % of those of the corrective process
        with its best hands), ``gap`` and ``share`` (in %), ``ticks exact`` and ``saved exact``
        (executed once without motor noise), or the name of a signature.
    weights : mapping of str to float, or sequence of mapping
        Weight of each method, named as its row of the ranking; or, across worlds, a list of tables
        with ``method``, ``weight`` and ``world``.
    **keys
        Further keys of the table: ``expected``, ``tasks``, ``families``, ``worlds``, ``after``.

    Returns
    -------
    DataFrame
        A row for each cell (:attr:`Study.contrasts`).

    Raises
    ------
    CoarticError
        A name, a quantity or a key is wrong.

    Examples
    --------
    >>> study = load("shipped-families")  # doctest: +SKIP
    >>> weights = {"policy-gradient": 1, "learner": -1}  # doctest: +SKIP
    >>> contrast(study, "saved", weights, expected="above 0").verdict  # doctest: +SKIP
    """
    table = {"name": "contrast", "says": "", "quantity": quantity, "weights": weights, **keys}
    try:
        asked = Contrast.model_validate(table)
    except ValidationError as error:
        raise CoarticError(explain(error, Contrast.model_fields)) from None
    return answers(study, later(study, [asked]))


def later(study: Study, contrasts: Sequence[Contrast]) -> list[Registered]:
    """Return contrasts that are asked about finished runs.

    Raises CoarticError if a contrast does not fit the plan of the study.
    """
    checked = check_contrasts(contrasts, places_of(job for job in study.plan if job.of_suite))
    return [Registered(asked, cells, True, _LATE, 0) for asked, cells in checked]


class _File(FileData):
    """A file with questions about finished runs."""

    contrasts: Annotated[tuple[Contrast, ...], Field(min_length=1)]


def with_contrasts(study: Study, path: Path) -> Study:
    """Return a study that also answers the contrasts of a file (TOML).

    Raises CoarticError if the file cannot be read, or a contrast does not fit the study.
    """
    try:
        asked = _File.model_validate(read_toml(path)).contrasts
        return replace(study, asked=[*study.asked, *later(study, asked)])
    except ValidationError as error:
        raise CoarticError(f"{plain(str(path))}: {explain(error, ['contrasts'])}") from None
    except CoarticError as error:
        raise CoarticError(f"{plain(str(path))}: {error}") from None


_LATE = "later"
"""Date of a contrast about finished runs: it comes after each date."""


def shared_cells(study: Study) -> dict[CellKey, pd.DataFrame]:
    """Return the frames of :attr:`Study.cells` themselves, for tables: a copy of each takes long.

    The dict is cached: do not change it.
    """
    return study._cells


@lru_cache(maxsize=4)
def improvements(study: Study) -> dict[str, tuple[Array, Array]]:
    """Return the learning curve of each run: the trials with a new best reward.

    Returns
    -------
    dict of str to (ndarray, ndarray)
        Maps the id of each run to two arrays, shape ``(n,)`` each, for the n trials whose reward
        was higher than that of each earlier trial: the numbers of these trials, counted from 1, and
        their rewards (negative ticks). Runs without stored rewards of trials are left out. The dict
        is cached: do not change it.
    """
    by_run = {}
    for run_id, rewards in study.rewards():
        best = np.fmax.accumulate(np.append(-np.inf, rewards))  # fmax ignores NaN
        trials = 1 + np.flatnonzero(best[1:] > best[:-1])
        by_run[run_id] = trials.astype(np.float64), best[trials]
    return by_run


def best_after(steps: tuple[Array, Array], trials: Any) -> Array:
    """Return the best reward of a run after each given number of trials.

    Parameters
    ----------
    steps : (ndarray, ndarray)
        Learning curve of the run: its entry in the dict of :func:`improvements`.
    trials : array_like of int
        Numbers of trials, an array of any shape.

    Returns
    -------
    ndarray, of the shape of ``trials``
        Best rewards so far, in negative ticks. They are NaN before the first completed trial.
    """
    numbers, rewards = steps
    return np.asarray(np.append(math.nan, rewards)[np.searchsorted(numbers, trials, "right")])


def ending_of(study: Study) -> str:
    """Return the suffix of ids for the world of a study, such as ``-motor-noise-0-01``.

    The ids are those of tables, figures and sections of the page. The suffix is empty for the
    paper's world, and for a study of several worlds.
    """
    worlds = [*study.worlds]
    return f"-{slugs(worlds)[worlds[0]]}" if len(worlds) == 1 and worlds[0] else ""


def when_of(study: Study) -> str:
    """Return the end of a title for a study after some trials, such as ``, after 100 trials``.

    It is empty for a study of whole runs.
    """
    if study.after is None:
        return ""
    return f", after {number(study.after)} trial{'s' * (study.after > 1)}"


def _stored_of(study: Study) -> pd.DataFrame:
    """Return a copy of the stored runs."""
    stored: pd.DataFrame = vars(study)["stored"]
    return stored.copy()


def _set_stored(study: Study, stored: pd.DataFrame) -> None:
    """Set the stored runs, as the constructor does."""
    vars(study)["stored"] = stored


Study.stored = property(_stored_of, _set_stored)  # type: ignore[assignment]
