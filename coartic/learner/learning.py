"""Run the dual-process learner. The kernels of its trials are in :mod:`coartic.learner.kernel`."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import islice
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from coartic.errors import NotApplicableError
from coartic.internal.limits import (
    MAX_RUN_SEED,
    MAX_RUNS,
    MAX_TRIALS,
    brief_value,
    check_limits,
)
from coartic.internal.threads import threads_for
from coartic.learner.conditions import ExplorationCondition, load_condition
from coartic.learner.kernel import (
    TENTHS,
    Results,
    empty_tables,
    learn_kernel,
    learner_parameters,
    workspace_for,
)
from coartic.learner.learning_run import LearningRun
from coartic.method import TRIALS, Meter
from coartic.model import PAPER, MotionModel
from coartic.motion.doors import correct, move
from coartic.motion.execution import initial_hands, movements_in
from coartic.motion.kernels.compile import addresses
from coartic.motion.kernels.slots import SLOTS
from coartic.motion.kernels.trial import COUNTED
from coartic.motion.solution import Movement, corrective_movements, hands_in, movements_by_goal
from coartic.motion.trials import (
    compiled_task,
    count_trials,
    empty_records,
    make_trials,
    noise_seed,
)
from coartic.tasks.catalogue import TaskLike, as_task
from coartic.tasks.task import Task, check_hands, letters_of

_MAX_STORED_TRIALS = 200_000_000  # trials of one call; each takes 9 bytes
_MAX_BATCH_TRIALS = 4_000_000  # trials of runs whose rewards fit into one answer of a worker


def runs_at_once(trials: int) -> int:
    """Return the largest number of runs of ``trials`` trials in a job of a worker.

    The number is from 1 to 72. A job of more than one run makes at most 4,000,000 trials in all.

    Examples
    --------
    >>> runs_at_once(10_000), runs_at_once(1_000_000), runs_at_once(10_000_000)
    (72, 4, 1)
    """
    return max(1, min(SLOTS, _MAX_BATCH_TRIALS // trials))


def learn(
    task: TaskLike,
    condition: str | ExplorationCondition,
    *,
    seed: int,
    trials: int = TRIALS,
    model: MotionModel = PAPER,
    start: Sequence[Movement] = (),
) -> LearningRun:
    """Run the dual-process learner on a task under an exploration condition.

    Equal arguments give equal runs.

    Parameters
    ----------
    task : Task, str or pathlib.Path
    condition : str or ExplorationCondition
        The condition, or its id in ``CONDITIONS``, ``ABLATIONS`` or ``INFORMED``, such as
        ``"EC4"``.
    seed : int
        Seed of the random numbers.
    trials : int
        Number of trials, including trial 0.
    model : MotionModel
    start : sequence of Movement
        A first solution, such as that of a planner or of an earlier run. In trial 0 the robot makes
        a straight movement for each goal. The target is that of the first movement of the first
        solution for this goal (for a path, its last waypoint). If the hand misses the goal, or if
        there is no target, the corrective process acts. By default there is no first solution, and
        only the corrective process acts in trial 0.

    Returns
    -------
    LearningRun
        The rewards of all trials, the solution, and the learner's tables.

    Raises
    ------
    TaskError
        The task cannot be used.
    NotApplicableError
        The condition does not fit the task or the first solution, or no initial hands are found.
    CoarticError
        The condition is unknown.
    TypeError
        ``task``, ``condition`` or ``model`` has a wrong type.
    SolutionError
        The first solution breaks the task's rules.
    ValueError
        An argument cannot be used:

        - ``seed`` is not an integer from 0 to 2^128 - 1;
        - ``trials`` is not from 1 to 10,000,000;
        - a constant of the model is out of bounds;
        - the task was changed so that it contradicts itself.

    Notes
    -----
    Source: paper, Figure 3.

    Examples
    --------
    >>> from coartic import learn
    >>> first = learn("ascending", "EC1", seed=0, trials=500)
    >>> second = learn("ascending", "EC1", seed=1, trials=500, start=first.solution)
    >>> second.initial_reward == first.reward
    True
    >>> second.reward >= first.reward
    True
    """
    (run,) = learn_many(
        task, condition, seeds=[seed], trials=trials, model=model, jobs=1, start=start
    )
    return run


def learn_many(
    task: TaskLike,
    condition: str | ExplorationCondition,
    *,
    seeds: Iterable[int],
    trials: int = TRIALS,
    model: MotionModel = PAPER,
    jobs: int = -1,
    start: Sequence[Movement] = (),
) -> list[LearningRun]:
    """Run the learner once for each of many seeds, as :func:`learn` does.

    The runs are made side by side and in threads. This saves time, and does not change the results
    of the runs.

    Parameters
    ----------
    task : Task, str or pathlib.Path
    condition : str or ExplorationCondition
    seeds : iterable of int
        A seed for each run. No two seeds may be equal.
    trials : int
    model : MotionModel
    start : sequence of Movement
        First solution of every run (:func:`learn`).
    jobs : int
        Largest number of threads, from 1 to 10,000; -1 stands for the number of cores that the
        process may use.

    Returns
    -------
    list of LearningRun
        A run for each seed, in the order of seeds.

    Raises
    ------
    TaskError, NotApplicableError, CoarticError, SolutionError
        Task, condition or first solution cannot be used, as in :func:`learn`.
    TypeError, ValueError
        An argument cannot be used:

        - :func:`learn` refuses it;
        - ``seeds`` is a string or not iterable, or has equal seeds;
        - there are more than 1,000,000 seeds, or the runs have more than 200,000,000 trials in all
          (the rewards of all trials are stored);
        - ``jobs`` is neither -1 nor from 1 to 10,000.
    """
    task = as_task(task)
    condition = load_condition(condition)
    if reason := condition.inapplicable_reason(task):
        raise NotApplicableError(reason)
    check_limits("trials", trials, 1, MAX_TRIALS)
    if isinstance(seeds, str | bytes) or not isinstance(seeds, Iterable):
        raise TypeError(f"seeds is {brief_value(seeds)}; it must be a list of integers")
    trials, limit = int(trials), min(MAX_RUNS, _MAX_STORED_TRIALS // trials)
    ordered = [*islice(seeds, limit + 1)]
    if len(ordered) > limit:
        raise ValueError(
            f"seeds has more than {limit:,} entries, the limit for runs of {trials:,} trials, "
            "because all rewards are stored. Run some seeds in another call"
        )
    for seed in ordered:
        check_limits("seed", seed, 0, MAX_RUN_SEED)
    ordered = [int(seed) for seed in ordered]
    if len({*ordered}) < len(ordered):
        duplicate = next(seed for seed in ordered if ordered.count(seed) > 1)
        raise ValueError(f"seeds has {duplicate} more than once; each run needs its own seed")
    if start:
        initial = [movements[0] for movements in movements_by_goal(task, start)]
        for movement in initial:
            if movement.hand not in condition.hands:
                raise NotApplicableError(
                    f"{condition.id} uses only the {condition.hands[0]} hand, but the first "
                    f"solution uses the {movement.hand} hand"
                )
    else:
        hands = check_hands(task, initial_hands(task, condition.hands, model=model))
        initial = corrective_movements(hands)
    threads = threads_for(jobs)
    size = max(min(SLOTS, math.ceil(len(ordered) / threads)), 1)
    batches = [ordered[begin : begin + size] for begin in range(0, len(ordered), size)]
    _learn_together(task, condition, model, initial, [0], 0)  # compile before time is taken

    def perform(batch: Sequence[int]) -> list[LearningRun]:
        return _learn_together(task, condition, model, initial, batch, trials)

    if threads == 1:
        return [run for batch in batches for run in perform(batch)]
    with ThreadPoolExecutor(threads) as pool:
        return [run for runs in pool.map(perform, batches) for run in runs]


def _learn_together(
    task: Task,
    condition: ExplorationCondition,
    model: MotionModel,
    initial: Sequence[Movement],
    seeds: Sequence[int],
    trials: int,
) -> list[LearningRun]:
    """Run the learner side by side for at most 72 seeds, without checks.

    Return the runs in the order of seeds. ``initial`` contains the movement for each goal in trial
    0; if a movement has no target, only the corrective process acts at this goal. With ``trials`` 0
    the kernels are compiled, the rewards are empty, and the replay is trial 0.
    """
    runs, dof, compiled = len(seeds), task.robot.dof, compiled_task(task, model)
    tables = empty_tables(runs, task)
    empty = np.zeros_like(empty_records(task.robot, runs, len(task.goals)).goals[..., 0])
    results = Results(
        rewards=np.zeros((runs, trials), dtype=np.int64),
        completed=np.zeros((runs, trials), dtype=np.bool_),
        best_trial=np.full(runs, -1),
        counts=np.zeros((runs, len(COUNTED)), dtype=np.int64),
        corrections=np.zeros((runs, 1 + TENTHS), dtype=np.int64),
        initial_accounts=empty,
        best_accounts=empty.copy(),
        last_records=empty.copy(),
    )
    generators = [np.random.default_rng(seed) for seed in seeds]
    learner, rngs = learner_parameters(compiled, condition, initial), addresses(generators)
    workspace, worlds = workspace_for(runs, task), np.array([*map(noise_seed, seeds)], np.uint64)
    count_trials(runs * trials)
    clock = time.perf_counter()
    learn_kernel(compiled.parameters, learner, tables, results, rngs, worlds, workspace)
    wall = time.perf_counter() - clock

    requested = [[[Movement(1, "right", "learned")]] * len(task.goals)] * runs

    def movements(records: NDArray[np.void]) -> list[tuple[Movement, ...]]:
        trials = zip(movements_in(records[..., None], dof, requested), records, strict=True)
        return [tuple(trial) if goals["hit"][-1] else () for trial, goals in trials]

    initial_trials = movements(results.initial_accounts)
    best_trials = movements(results.best_accounts)
    replays = movements(results.last_records)
    return [
        LearningRun(
            task=task,
            condition=condition,
            model=model,
            seed=seed,
            first_hands=hands_in(initial),
            rewards=np.ma.array(results.rewards[n], mask=~results.completed[n]),
            best_trial=int(results.best_trial[n]) if results.best_trial[n] >= 0 else None,
            initial=initial_trials[n],
            solution=best_trials[n],
            replay=replays[n],
            replay_reward=-int(results.last_records["ticks"][n].sum()) if replays[n] else None,
            values=np.ascontiguousarray(tables[n]["value"]),
            targets=np.ascontiguousarray(tables[n]["target"][..., :dof]),
            corrections=results.corrections[n],
            counters=Meter(trials=trials, **counts),
            wall_s=wall / runs,
        )
        for n, seed in enumerate(seeds)
        for every in [dict(zip(COUNTED, results.counts[n].tolist(), strict=True))]
        for counts in [{name: every[name] for name in every if name in Meter.COUNTS}]
    ]


Kernels = Literal["learner", "motion", "trials"]


def warm_up(task: Task, *parts: Kernels) -> None:
    """Compile the kernels for a task, or load their machine code, before the first run.

    The machine code of the kernels depends on the number of links of the task's robot.

    Parameters
    ----------
    task : Task
    *parts : str
        Names of the kernels to compile, by default all three:

        - ``"learner"``: kernels of the learner;
        - ``"motion"``: kernels of single movements and corrections;
        - ``"trials"``: kernels of trials, and of executions without paths.
    """
    hand, goal = task.hands[0], task.goals[0]
    if not parts or "learner" in parts:
        condition = ExplorationCondition("warm-up", task.hands, True, False, "none")
        initial = corrective_movements(letters_of([hand] * len(task.goals)))
        _learn_together(task, condition, PAPER, initial, [0], 0)
    if not parts or "trials" in parts:
        targets = np.empty((0, len(task.goals), 1, task.robot.dof))
        make_trials(compiled_task(task, PAPER), np.empty(targets.shape[:2], np.int64), targets)
    if not parts or "motion" in parts:
        move(task.robot, task.q0, task.q0, hand, goal, task.radius)
        correct(task.robot, task.q0, hand, goal, model=PAPER._replace(max_iterations=0))
