"""The result of a run: the outcome that a worker returns, and the row that is stored."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from operator import attrgetter
from types import SimpleNamespace
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, InstanceOf

from coartic.errors import SolutionError
from coartic.internal.limits import real_array
from coartic.method import CORRECTIONS_BY_TENTH, MAX_COUNT, Meter
from coartic.method.as_method import REACHED
from coartic.model import PAPER, MotionModel
from coartic.motion.doors import segment_lengths
from coartic.motion.execution import Execution, execute_many, execute_noisy, other_arm_travel
from coartic.motion.initial_hands import best_hands
from coartic.motion.solution import Movement
from coartic.motion.trials import compiled_task
from coartic.robot import Array
from coartic.runs.plan import Cell, Job
from coartic.tasks.task import Task, hands_of

Status = Literal["ok", "infeasible", "solver-failed", "timeout", "crashed"]
"""Status of a run."""
PREFIXES = {"solution": "", "initial": "initial_", "replay": "replay_"}
"""Dict that maps each part of a run to the prefix of its columns. The parts are ``solution``,
``initial`` (the first trial of a learner) and ``replay`` (a greedy trial after learning)."""
PARTS = tuple(PREFIXES)
NOISY_EXECUTIONS = 100
"""Number of executions from which a solution of a world with motor noise is scored."""
NOISE_RULE = 2
"""Version of the rule of motor noise. Mean ticks that were computed by another version are shown as
missing until they are computed again, so that a column never mixes two versions. Increase the
version with each change of :mod:`coartic.motion.kernels.noise` or of :func:`.judge_seed`."""
OF_NOISE = ("mean_ticks", "failed_executions")
"""Names of the columns that depend on the rule of motor noise."""
UNREPEATED = "made_again"
"""Key in the details of a run that was performed again with another result. The value describes
the first difference."""
_MAX_MOVEMENTS = 10_000
"""Largest number of movements of a solution."""
_MAX_NUMBERS = 400_000
"""Largest number of entries in the start, the targets and the waypoints of a solution."""
MAX_STEPS = 1_000_000
"""Largest number of steps of the movements of a solution. The steps are counted on straight lines
from the start through all targets and waypoints."""


@dataclass(frozen=True)
class Times:
    """Time that a run took, and memory of the process that made it.

    The time of a job is divided equally among the runs of the job.
    """

    wall_s: float | None = None
    """Wall time (in s); None if unknown."""
    cpu_s: float | None = None
    """CPU time (in s); None if unknown."""
    warm: bool | None = None
    """True if the process had run the method before; None if unknown."""
    together: int = 1
    """Number of runs of the job."""
    peak_rss_mib: float | None = None
    """Peak resident memory of the worker so far, including earlier runs (in MiB); None if
    unknown."""


@dataclass(frozen=True)
class Outcome:
    """Result of a run, before it is scored."""

    status: Status
    """``ok``, ``infeasible``, ``solver-failed``, ``timeout`` or ``crashed``."""
    reason: str = ""
    """Why the status is not ``ok``; empty if it is ``ok``."""
    parts: dict[str, list[InstanceOf[Movement]]] = field(default_factory=dict)
    """Dict that maps parts (``solution``, ``initial``, ``replay``) to their movements, as the
    method returned them."""
    details: dict[str, Any] = field(default_factory=dict)
    """Further data from the method, by name."""
    used: tuple[str, ...] = ()
    """Declared information that the method used."""
    meter: Meter | None = None
    """Counts of trials, evaluations and movements; None if the worker gave no usable answer."""
    rewards: list[Annotated[int, Field(gt=-(2**31), lt=2**31)] | None] = field(default_factory=list)
    """Reward of each trial; None if the trial failed or its reward is not stored."""
    times: Times = Times()
    environment: dict[str, Any] | None = None
    """Versions, platform, processor, variables, arithmetic and commit, by name. An entry may be
    left out if it is the same as in the process that scores the run."""


@dataclass(frozen=True)
class Row:
    """A run as it is stored, and shown in view ``runs``."""

    job: Job
    """A job with only this run."""
    values: dict[str, Any]
    """Dict that maps the columns of table ``results`` (:data:`COLUMNS`) to their values.
    ``row["reward"]`` is short for ``row.values["reward"]``."""
    movements: dict[str, list[list[Any]]]
    """Dict that maps parts (``solution``, ``initial``, ``replay``) to the executed movements, each
    as a list (:func:`movement_data`). The dict is empty if the run is not ok. In a world with motor
    noise, the only part is the solution: the movements that the method recommends, without
    ticks."""
    rewards: list[int | None]
    """Reward of each trial; None if the trial failed or its reward is not stored."""
    details: dict[str, Any]
    """Further data from the method, by name. Entry :data:`UNREPEATED` is added if the run was
    performed again with another result."""
    environment: dict[str, Any]
    """Versions, platform, processor, variables, arithmetic and commit, by name."""

    def __getitem__(self, name: str) -> Any:
        """Return the value of a column of table ``results``."""
        return self.values[name]

    @property
    def cell(self) -> Cell:
        """Task, method, parameters and world of the run."""
        return self.job.cell

    @property
    def is_downsampled(self) -> bool:
        """True if rewards of some successful trials are not stored."""
        failed = self["failed_trials"]
        return failed is not None and self.rewards.count(None) > failed

    def part(self, name: str) -> list[Movement]:
        """Return the list of movements of a part; empty if the run lacks the part."""
        return [*map(movement_from, self.movements.get(name, []))]

    def with_values(self, **values: Any) -> Row:
        """Return a copy of the row in which the values of some columns are replaced.

        The columns and their new values are passed as keyword arguments.
        """
        return replace(self, values=self.values | values)

    def downsample(self) -> Row:
        """Return a copy of the row with fewer rewards.

        The copy keeps the reward of each trial that was better than all earlier trials, and that of
        the trial in column ``best_trial``. All other rewards are None. The hash in column
        ``result`` is computed again.
        """
        best, solved, rewards = -math.inf, self["best_trial"], list[int | None]()
        for trial, reward in enumerate(self.rewards):
            better = reward is not None and reward > best
            rewards.append(reward if better or trial == solved else None)
            best = max(best, -math.inf if reward is None else reward)
        status, movements = self["status"], self.movements
        fewer = replace(self, rewards=rewards)
        return fewer.with_values(result=_result_of(status, movements, rewards))


_NOTHING = SimpleNamespace(reward=None, hands=None, corrections=None, other_arm_travel=None)


def row_of(job: Job, outcome: Outcome, executions: Mapping[str, Execution], date: str = "") -> Row:
    """Return the row of a run from its outcome and the executions of its parts.

    The columns in :data:`OF_NOISE` and ``noise_rule`` are None; :func:`judged` sets them.

    Parameters
    ----------
    job : Job
        A job with only this run.
    outcome : Outcome
        The outcome, with its final status.
    executions : mapping of str to Execution
        Dict that maps parts to executions without noise; empty if the run is not ok.
    date : str
        Date and time at the end of the run, UTC.
    """
    number, is_noisy = job.numbers[0], job.cell.model.motor_noise > 0.0
    parts: dict[str, Any] = {part: executions.get(part, _NOTHING) for part in PARTS}
    movements = {
        part: [*map(movement_data, execution.movements)] for part, execution in executions.items()
    }
    if solution := executions.get("solution"):
        task, hands = job.cell.arena, hands_of(solution.hands)
        parts["solution"] = SimpleNamespace(
            reward=None if is_noisy else solution.reward,
            hands=solution.hands,
            corrections=solution.corrections,
            other_arm_travel=other_arm_travel(task, hands, solution.configurations),
        )
        if is_noisy:
            movements["solution"] = [*map(movement_data, outcome.parts["solution"])]
    reward, rewards = parts["solution"].reward, outcome.rewards
    tenths = _corrections_by_tenth(outcome.details)
    sources = SimpleNamespace(
        **parts,
        outcome=outcome,
        counts=outcome.meter or SimpleNamespace(**dict.fromkeys(vars(Meter()))),
        id=job.run_id(number),
        number=number,
        seed=job.run_seed(number),
        job=job,
        date=date,
        best_trial=None if reward is None or reward not in rewards else rewards.index(reward),
        early_corrections=tenths and tenths[1],
        late_corrections=tenths and tenths[-1],
        reached=outcome.details.get(REACHED) if job.cell.method.is_ours else None,
        practice=_practice_of(rewards) if is_noisy and rewards else None,
        result=_result_of(outcome.status, movements, rewards),
        later=None,
    )
    values = {name: attrgetter(source)(sources) for name, _, source, _ in COLUMNS if source}
    values["used"] = ", ".join(outcome.used)
    return Row(job, values, movements, rewards, outcome.details, outcome.environment or {})


def _corrections_by_tenth(details: Mapping[str, Any]) -> list[int] | None:
    """Return a learner's numbers of corrections, by parts of its trials.

    The result is a list of 11 numbers: the number in trial 0, and that in each tenth of the later
    trials. It is None if ``details``, the details of the run, do not contain such a list.
    """
    counts = details.get(CORRECTIONS_BY_TENTH)
    if not isinstance(counts, list) or len(counts) != 11:
        return None
    are_counts = all(type(count) is int and 0 <= count <= MAX_COUNT for count in counts)
    return counts if are_counts else None


def _practice_of(rewards: Sequence[int | None]) -> str:
    """Return the mean ticks in each tenth of the trials, as JSON.

    The JSON is a list of ten numbers: the mean over the completed trials of each tenth, or null for
    a tenth without a completed trial. ``rewards`` are those of all trials.
    """
    tenths = np.array_split(np.array(rewards, np.float64), 10)
    means = [-float(np.nanmean(part)) if np.isfinite(part).any() else None for part in tenths]
    return json.dumps(means)


def _result_of(
    status: str, movements: Mapping[str, Sequence[list[Any]]], rewards: Sequence[int | None]
) -> str:
    """Return a hash of the status, the movements and the stored rewards of a run.

    The hash has 16 hex digits. Times and counts are not hashed.
    """
    stated = [[part, *data] for part in PARTS for data in movements.get(part, [])]
    content = json.dumps([status, *stated]).encode()
    return hashlib.sha256(content + reward_bytes(rewards)).hexdigest()[:16]


COLUMNS = (
    ("run_id", "TEXT NOT NULL UNIQUE", "id",
     "hash of task, method, parameters and seed, with the version or code of the method"),
    ("suite", "TEXT", "", "name of the suite"),
    ("task", "TEXT", "", "name of the task"),
    ("method", "TEXT", "", "id of the method"),
    ("setting", "TEXT", "", "parameters that are not the defaults"),
    ("world", "TEXT", "",
     "constants of the [world](model.md#worlds) that are not the paper's; empty for the paper's"),
    ("called", "TEXT", "", "name that the suite gives the runs (key `as`); empty for none"),
    ("run", "INTEGER NOT NULL", "number", "number of the run, from 0"),
    ("seed", "INTEGER NOT NULL", "seed", "the same for every method on a task and `run`"),
    ("status", "TEXT NOT NULL", "outcome.status",
     "`ok`, `infeasible`, `solver-failed`, `timeout` or `crashed`"),
    ("reason", "TEXT NOT NULL", "outcome.reason", "why the run is not ok"),
    ("hands", "TEXT", "solution.hands", "hand of each goal in the solution, such as `LRLR`"),
    ("reward", "INTEGER", "solution.reward",
     "of the solution; of a learner its best trial; missing in a world with noise"),
    ("mean_ticks", "REAL", "later",
     "in a world with [motor noise](model.md#motor-noise): mean ticks of 100 fresh executions of "
     "what the method recommends; a failed one counts as twice the ticks of the corrective "
     "process with its best hands"),
    ("failed_executions", "INTEGER", "later",
     "how many of these executions failed"),
    ("practice", "TEXT", "practice",
     "in a world with noise: mean ticks of the trials in each tenth, as JSON"),
    ("noise_rule", "INTEGER", "later",
     "in a world with noise: version of the rule of noise; mean ticks of another version are shown "
     "as missing until `coartic run` makes them again"),
    ("replay_reward", "INTEGER", "replay.reward",
     "of one more trial of a learner, greedy and without noise"),
    ("replay_hands", "TEXT", "replay.hands", "hand of each goal in that trial"),
    ("initial_reward", "INTEGER", "initial.reward",
     "of a learner's first trial: the corrective process alone"),
    ("initial_hands", "TEXT", "initial.hands", "hand of each goal in that trial"),
    ("best_trial", "INTEGER", "best_trial", "first trial that got `reward`, from 0"),
    ("trials", "INTEGER", "counts.trials", "physical trials, as many as `--trials` says"),
    ("initial_trials", "INTEGER", "counts.initial_trials",
     "trials besides, of the search for the first hands, where the [task](howto/task.md) names "
     "a rule for them"),
    ("movement_ticks", "INTEGER", "counts.movement_ticks", "control ticks of all these trials"),
    ("forward_kinematics", "INTEGER", "counts.forward_kinematics",
     "evaluations of the forward kinematics"),
    ("corrections", "INTEGER", "counts.corrections",
     "corrective movements of all these trials"),
    ("reached", "BOOLEAN", "reached",
     "of a run with parameter `until`: whether a trial took no more ticks than that"),
    ("failed_trials", "INTEGER", "counts.failed_trials", "trials that missed a goal"),
    ("gradients", "INTEGER", "counts.gradients", "evaluations of a solver's gradient"),
    ("solver_iterations", "INTEGER", "counts.solver_iterations", "iterations of a solver"),
    ("solution_corrections", "INTEGER", "solution.corrections",
     "corrective movements of the solution"),
    ("early_corrections", "INTEGER", "early_corrections",
     "corrective movements in the first tenth of a learner's trials after its first trial"),
    ("late_corrections", "INTEGER", "late_corrections",
     "corrective movements in the last tenth"),
    ("other_arm_travel", "REAL", "solution.other_arm_travel",
     "joint travel of the arm that is not chosen, rad"),
    ("build_s", "REAL", "counts.build_s", "seconds of setting up a solver's problems"),
    ("solve_s", "REAL", "counts.solve_s", "seconds of solving, without compiling"),
    ("wall_s", "REAL", "outcome.times.wall_s", "seconds of wall time"),
    ("cpu_s", "REAL", "outcome.times.cpu_s", "seconds of CPU time"),
    ("warm", "BOOLEAN", "outcome.times.warm",
     "whether the process had run the method before"),
    ("together", "INTEGER", "outcome.times.together",
     "runs that one process made side by side; they share their time evenly"),
    ("process_peak_mb", "REAL", "outcome.times.peak_rss_mib",
     "most memory of the process so far, MiB"),
    ("time_limit_s", "REAL", "job.time_limit_s", "limit of CPU time, seconds"),
    ("date", "TEXT NOT NULL", "date", "date and time at the end, UTC"),
    ("used", "TEXT NOT NULL", "outcome.used",
     "declared information that the method used"),
    ("result", "TEXT NOT NULL", "result",
     "hash of the outcome; runs with the same value are identical"),
    ("information", "TEXT", "", "information that the method declares"),
    ("parameters", "TEXT", "", "all parameters of the method, as JSON"),
    ("commit", "TEXT", "", "commit of the checkout, with + if it was changed since"),
    ("code", "TEXT", "",
     "versions of model and method, such as `1.2`; of a method file a hash of its code"),
    ("packages", "TEXT", "", "hash of the versions of Python and of libraries"),
)  # fmt: skip
"""Columns of view ``runs``, which has a row for each stored run of the plan. SQL tables, data
frames and a page of the documentation are made from this tuple. An entry consists of

- the name of the column;
- the type of the column in SQL, with ``NOT NULL`` if all runs have a value in table ``results``;
- the source of the value in :func:`row_of`, such as ``counts.trials``. The source ``later`` stands
  for None, which is replaced later. The source is empty for a column of another table;
- a phrase for the documentation."""


def movement_data(movement: Movement) -> list[Any]:
    """Return a movement as a list of its goal, hand, kind, ticks and path.

    Workers send movements in this form, hashes are computed from it, and folders store it. The last
    entry of the list is a JSON string: the target, or the waypoints of a movement of kind ``path``.
    In the string, -0.0 is 0.0, and an entry of a target that is NaN is null. The fourth entry is
    None for a movement without ticks, and the last entry is None for a movement with neither target
    nor waypoints. Raises an error, such as TypeError or ValueError, for a movement that cannot be
    converted.
    """
    m, path = movement, movement.target
    if m.waypoints is not None:
        if m.kind != "path" or not (path is None or np.array_equal(path, m.waypoints[-1])):
            raise ValueError(
                f"movement to goal {m.goal} has waypoints and kind {m.kind!r}; its kind must be "
                "'path', and its target None or the last waypoint"
            )
        path = m.waypoints
    numbers = None if path is None else (real_array("a path", path) + 0.0).tolist()
    if numbers is not None and m.waypoints is None:  # an entry that stays is null
        numbers = [None if math.isnan(number) else number for number in numbers]
    text = None if numbers is None else json.dumps(numbers, separators=(",", ":"))
    return [int(m.goal), str(m.hand), str(m.kind), m.ticks and int(m.ticks), text]


def movement_from(data: Sequence[Any]) -> Movement:
    """Return the movement that :func:`movement_data` converted to a list.

    Wrong data may raise TypeError, ValueError or IndexError.
    """
    goal, hand, kind, ticks, text = data
    path = None if text is None else np.array(json.loads(text), np.float64)
    if kind == "path" and path is not None:
        return Movement(goal, hand, kind, path[-1], ticks, path)
    return Movement(goal, hand, kind, path, ticks)


def reward_bytes(rewards: Sequence[int | None]) -> bytes:
    """Encode the rewards of trials as bytes, which the caller compresses.

    The bytes encode numbers of four bytes: the best reward, signed (0 if there is none), and then
    a number for each trial. The number of a trial is 1 plus the difference between the best reward
    and the reward of the trial, or 0 if the reward of the trial is None. The lowest bytes of all
    numbers come first, then the second lowest bytes of all numbers, and so on, because bytes
    compress better in this order.
    """
    values = np.array(rewards, np.float64)  # None becomes NaN
    best = 0.0 if np.isnan(values).all() else np.nanmax(values)
    numbers = np.append(best, np.where(np.isnan(values), 0.0, best - values + 1.0))
    return numbers.astype(np.int64).astype("<u4").view(np.uint8).reshape(-1, 4).T.tobytes()


def execute_all(
    task: Task, solutions: Sequence[Sequence[Movement]], model: MotionModel = PAPER
) -> list[Execution | Exception]:
    """Execute solutions of a task without motor noise.

    Parameters
    ----------
    task : Task
    solutions : sequence of sequence of Movement
        Solutions, whose targets and waypoints are arrays of floats.
    model : MotionModel
        The motion model. Its motor noise is ignored.

    Returns
    -------
    list of Execution or Exception
        Execution of each solution, in the order of ``solutions``. For a solution that breaks the
        rules of the task, is too long (:func:`too_long`), or takes more than 1,000,000 ticks, the
        entry is an exception, which is not raised.
    """
    exact = model.without_noise()
    errors = [too_long(task, solution, exact) for solution in solutions]
    short = [s for s, error in zip(solutions, errors, strict=True) if error is None]
    executions = map(_unless_long, execute_many(compiled_task(task, exact), short))
    return [next(executions) if error is None else error for error in errors]


def _unless_long(execution: Execution | Exception) -> Execution | Exception:
    """Return an execution, or an error if its corrective movements make it too long."""
    if isinstance(execution, Execution) and execution.ticks > MAX_STEPS:
        return SolutionError(
            f"the solution takes {execution.ticks} ticks; at most {MAX_STEPS} are allowed"
        )
    return execution


def judge(
    task: Task,
    answers: Sequence[Sequence[Movement]],
    model: MotionModel,
    seeds: Sequence[int],
    executions: int = NOISY_EXECUTIONS,
) -> tuple[Array, NDArray[np.int64]]:
    """Compute the mean ticks of solutions over many executions with motor noise.

    A failed execution counts as twice the ticks that the corrective process with its best hands
    (:func:`.best_hands`) takes without noise.

    Parameters
    ----------
    task : Task
    answers : sequence of sequence of Movement
        K solutions: the movements that methods recommend (:func:`.next_action`).
    model : MotionModel
        The motion model, with motor noise.
    seeds : sequence of int
        Seed of the noise for each answer.
    executions : int
        Number of executions of each answer.

    Returns
    -------
    ndarray, shape (K,)
        Mean ticks; NaN if an execution failed and :func:`.best_hands` finds no hands.
    ndarray of int, shape (K,)
        Number of executions of each answer that failed.
    """
    exact = model.without_noise()
    ticks = execute_noisy(task, answers, model.motor_noise, executions, seeds, exact)
    best = best_hands(task, exact)
    capped = np.where(np.isnan(ticks), np.nan if best is None else 2.0 * best[1], ticks)
    return capped.mean(axis=1), np.isnan(ticks).sum(axis=1)


def judged(runs: Sequence[Row]) -> list[Row]:
    """Return copies of solved runs of one cell in a world with noise, with :data:`OF_NOISE` set."""
    cell, seeds = runs[0].cell, [run.job.judge_seed(run["run"]) for run in runs]
    means, failed = judge(cell.arena, [run.part("solution") for run in runs], cell.model, seeds)
    return [
        run.with_values(
            mean_ticks=None if math.isnan(mean) else mean,
            failed_executions=count,
            noise_rule=NOISE_RULE,
        )
        for run, mean, count in zip(runs, means.tolist(), failed.tolist(), strict=True)
    ]


def too_long(
    task: Task, solution: Sequence[Movement], model: MotionModel = PAPER
) -> SolutionError | None:
    """Return an error if a solution is too long to be executed; return None otherwise.

    A solution is too long if it has

    - more than 10,000 movements;
    - more than 400,000 numbers in the start, the targets and the waypoints;
    - more than 1,000,000 steps on straight lines from the start through all of them.
    """
    if len(solution) > _MAX_MOVEMENTS:
        return SolutionError(
            f"the solution has {len(solution)} movements; at most {_MAX_MOVEMENTS} are allowed"
        )
    corners = [task.q0]
    for movement in solution:
        corners += [] if movement.waypoints is None else list(movement.waypoints)
        corners += [] if movement.target is None else [movement.target]
    if (count := sum(map(np.size, corners))) > _MAX_NUMBERS:
        return SolutionError(
            f"the solution has {count} numbers in its paths; at most {_MAX_NUMBERS} are allowed"
        )
    shapes = {np.shape(corner) for corner in corners}
    if len(shapes) == 1:  # a solution with other shapes breaks the rules of the task
        with np.errstate(over="ignore"):
            stays = np.isnan(corners)  # an entry that stays makes no way
            points = np.where(stays, corners[0], corners)
            for k in range(1, len(points)):
                points[k] = np.where(stays[k], points[k - 1], points[k])
            steps = segment_lengths(points, model).sum() / model.step
        if steps > MAX_STEPS:
            return SolutionError(
                f"the path of the solution has {steps:.0f} steps; at most {MAX_STEPS} are allowed"
            )
    return None
