"""The dual-process learner: trial and error over the corrective process.

The paper's section *The Learning Process* and Figure 3. Per trial and goal: choose a
hand, perturb the stored target configuration, move, and let the corrective process
finish where the goal was missed. A trial better than any before it that passed
through the same state and hand replaces what is stored there.

One run is one call of a compiled kernel. It draws from the NumPy generator it is
given (``default_rng(seed)``, PCG64), per trial and goal in this order: a uniform
number against ε, where hands are explored; a second one that picks a hand, where the
first fell below ε and the pick is random; one standard normal per explored joint, in
the order of ``q``, where a target is stored; a bias draws nothing. Runs share nothing,
so any number of them may go on at once.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from coartic.compiled import entry, inlined, inner, joint_chain
from coartic.corrective import correct_kernel, shift_kernel
from coartic.errors import CoarticError, NotApplicableError
from coartic.exploration import ExplorationCondition, load_condition
from coartic.initial import InitialSearch, search_initial_hands
from coartic.model import PAPER, MotionModel, checked_model
from coartic.movement import move_kernel, scratch_for
from coartic.robot import HANDS, Array
from coartic.solution import Execution, Movement, execute
from coartic.task import Task, hands_of, letters_of
from coartic.trials import make_trials

TRIALS = 10_000  # trials of one run (printed)
METHOD_PREFIX = "dual-process/"
NO_HAND = 2  # ∅, the previous hand before goal 1
LEARNED, CORRECTIVE = 0, 1
_EXPLORATION = {"none": 0, "random": 1, "closest": 2}
_EQUALLY_NEAR = 1e-9  # hands at the same place up to rounding, length unit


class _Problem(NamedTuple):
    """Task, condition and constants, as the kernel reads them."""

    start: Any  # (dof,)
    goals: Any  # (G, 2)
    radius: float
    free_x: bool
    free_y: bool
    left: Any  # Arm
    right: Any  # Arm
    hands: Any  # (1 or 2,) hands available
    follows: Any  # (2, dof) for each chosen hand: joint takes its current value
    explored: Any  # (2, dof) for each chosen hand: joint is perturbed
    exploration: int
    epsilon: float
    noise_sd: float
    nullspace_gain: float
    bias: float
    corrects: bool
    model: Any


class _Tables(NamedTuple):
    """What is learned, by goal, previous hand (left, right, none) and hand."""

    value: Any  # Q, (G, 3, 2)
    target: Any  # q*, (G, 3, 2, dof)


class _Log(NamedTuple):
    """The movements of one trial, and where it stood when each goal was hit."""

    count: Any  # (1,)
    goal: Any  # (2 G,)
    hand: Any
    kind: Any
    ticks: Any
    target: Any  # (2 G, dof)
    hands: Any  # (G,)
    reached: Any  # (G, dof)


class _Count(NamedTuple):
    """Indices of the counters."""

    ticks: int = 0
    evaluations: int = 1
    iterations: int = 2
    corrections: int = 3
    failed: int = 4
    biased: int = 5


_C = _Count()


@inlined
def _arm(problem: Any, hand: int) -> Any:
    return problem.left if hand == 0 else problem.right


@inlined
def _goal_distance(q: Any, goal: int, hand: int, problem: Any, counts: Any, scratch: Any) -> float:
    arm = _arm(problem, hand)
    joint_chain(q, arm, scratch.xs, scratch.ys)
    counts[_C.evaluations] += 1
    tip = len(arm.links)
    dx = problem.goals[goal, 0] - scratch.xs[tip]
    dy = problem.goals[goal, 1] - scratch.ys[tip]
    return math.sqrt(dx * dx + dy * dy)


@inner
def _greedy(values: Any, hands: Any) -> int:
    """Hand of the highest value; the first of equals."""
    best = hands[0]
    for hand in hands[1:]:
        if values[hand] > values[best]:
            best = hand
    return int(best)


@inner
def _random_hand(hands: Any, rng: Any) -> int:
    return int(hands[int(rng.random() * len(hands))])


@inner
def _explored_hand(
    q: Any, goal: int, values: Any, problem: Any, rng: Any, counts: Any, scratch: Any
) -> int:
    if problem.exploration == 0 or rng.random() >= problem.epsilon:
        return int(_greedy(values, problem.hands))
    if problem.exploration == 1:
        return int(_random_hand(problem.hands, rng))
    nearest = problem.hands[0]
    nearest_distance = _goal_distance(q, goal, nearest, problem, counts, scratch)
    tie = False
    for hand in problem.hands[1:]:
        distance = _goal_distance(q, goal, hand, problem, counts, scratch)
        tie = abs(distance - nearest_distance) <= _EQUALLY_NEAR
        if distance < nearest_distance:
            nearest, nearest_distance = hand, distance
    if tie:
        return int(_random_hand(problem.hands, rng))
    return int(nearest)


@inlined
def _record(log: Any, goal: int, hand: int, kind: int, ticks: int, target: Any) -> None:
    row = log.count[0]
    log.goal[row] = goal
    log.hand[row] = hand
    log.kind[row] = kind
    log.ticks[row] = ticks
    log.target[row] = target
    log.count[0] = row + 1


@inlined
def _set_target(
    target: Any, q: Any, stored: Any, hand: int, explore: bool, problem: Any, rng: Any
) -> None:
    """q^t = q*(s, a) + η; joints that are not to be modified keep their current values."""
    for j in range(len(q)):
        target[j] = q[j] if problem.follows[hand, j] else stored[j]
        if explore and problem.explored[hand, j]:
            target[j] += problem.noise_sd * rng.standard_normal()


@inlined
def _shift_target(
    target: Any, stored: Any, goal: int, hand: int, problem: Any, counts: Any, scratch: Any
) -> None:
    """Move the mean of η into the direction in which **A** would step from q*(s, a)."""
    shift_kernel(
        target,
        stored,
        _arm(problem, hand),
        problem.goals[goal, 0],
        problem.goals[goal, 1],
        problem.explored[hand],
        problem.bias * problem.noise_sd,
        scratch,
    )
    counts[_C.evaluations] += 1
    counts[_C.biased] += 1


@inlined
def _move(
    q: Any,
    target: Any,
    goal: int,
    hand: int,
    kind: int,
    problem: Any,
    log: Any,
    counts: Any,
    scratch: Any,
) -> tuple[int, bool]:
    """Move ``q`` in place and log it; ticks, goal hit."""
    ticks, hit, evaluations = move_kernel(
        q,
        target,
        _arm(problem, hand),
        problem.goals[goal, 0],
        problem.goals[goal, 1],
        problem.radius,
        kind == LEARNED,
        problem.model,
        scratch,
    )
    counts[_C.evaluations] += evaluations
    counts[_C.ticks] += ticks
    _record(log, goal, hand, kind, ticks, target)
    return ticks, hit


@inlined
def _correct(
    q: Any, target: Any, goal: int, hand: int, problem: Any, counts: Any, scratch: Any
) -> bool:
    """Set ``target`` to what **A** finds from ``q``; whether it found anything."""
    target[:] = q
    converged, iterations = correct_kernel(
        target,
        _arm(problem, hand),
        problem.goals[goal, 0],
        problem.goals[goal, 1],
        problem.free_x,
        problem.free_y,
        problem.nullspace_gain,
        problem.model,
        scratch,
    )
    counts[_C.iterations] += iterations
    counts[_C.evaluations] += iterations + 1
    return converged


@inner
def _trial(
    forced: Any,
    explore: bool,
    problem: Any,
    tables: Any,
    log: Any,
    counts: Any,
    rng: Any,
    q: Any,
    target: Any,
    scratch: Any,
) -> tuple[bool, int]:
    """One trial into ``log``; completed, ticks. ``forced`` hands, if any, are used."""
    q[:] = problem.start
    log.count[0] = 0
    total = 0
    previous = NO_HAND
    for goal in range(len(problem.goals)):
        values = tables.value[goal, previous]
        if len(forced) > 0:
            hand = int(forced[goal])
        elif explore:
            hand = _explored_hand(q, goal, values, problem, rng, counts, scratch)
        else:
            hand = _greedy(values, problem.hands)

        known = values[hand] > -math.inf
        if known:
            stored = tables.target[goal, previous, hand]
            _set_target(target, q, stored, hand, explore, problem, rng)
            if explore and problem.bias > 0.0:
                _shift_target(target, stored, goal, hand, problem, counts, scratch)
            ticks, hit = _move(q, target, goal, hand, LEARNED, problem, log, counts, scratch)
            total += ticks
        else:
            hit = _goal_distance(q, goal, hand, problem, counts, scratch) <= problem.radius
            if hit:
                _record(log, goal, hand, CORRECTIVE, 0, q)
        if not hit:
            if known and not problem.corrects:
                counts[_C.failed] += 1
                return False, total
            if not _correct(q, target, goal, hand, problem, counts, scratch):
                counts[_C.failed] += 1
                return False, total
            counts[_C.corrections] += 1
            # It ends inside the goal: the model's tolerance is below the radius.
            ticks, _ = _move(q, target, goal, hand, CORRECTIVE, problem, log, counts, scratch)
            total += ticks
        log.hands[goal] = hand
        log.reached[goal] = q
        previous = hand
    return True, total


@inner
def _update(reward: float, tables: Any, log: Any) -> None:
    previous = NO_HAND
    for goal in range(len(log.hands)):
        hand = log.hands[goal]
        if reward > tables.value[goal, previous, hand]:
            tables.value[goal, previous, hand] = reward
            tables.target[goal, previous, hand] = log.reached[goal]
        previous = hand


@inner
def _copy(source: Any, destination: Any) -> None:
    for row in range(source.count[0]):
        destination.goal[row] = source.goal[row]
        destination.hand[row] = source.hand[row]
        destination.kind[row] = source.kind[row]
        destination.ticks[row] = source.ticks[row]
        destination.target[row] = source.target[row]
    destination.count[0] = source.count[0]


@entry
def _learn(
    first_hands: Any,
    problem: Any,
    tables: Any,
    rewards: Any,
    completed: Any,
    first: Any,
    best: Any,
    replay: Any,
    counts: Any,
    rng: Any,
    scratch: Any,
    trial_log: Any,
) -> tuple[int, bool, int]:
    """All trials of one run; best trial (or -1), replay completed, replay ticks."""
    free_choice = first_hands[:0]
    q = np.empty_like(problem.start)
    target = np.empty_like(problem.start)
    best_trial = -1
    for trial in range(len(rewards)):
        forced = first_hands if trial == 0 else free_choice
        done, ticks = _trial(
            forced, True, problem, tables, trial_log, counts, rng, q, target, scratch
        )
        rewards[trial] = -ticks
        completed[trial] = done
        if not done:
            continue
        if trial == 0:
            _copy(trial_log, first)
        _update(-float(ticks), tables, trial_log)
        if best_trial < 0 or -ticks > rewards[best_trial]:
            best_trial = trial
            _copy(trial_log, best)
    replay_counts = np.zeros_like(counts)
    replayed, replay_ticks = _trial(
        free_choice, False, problem, tables, replay, replay_counts, rng, q, target, scratch
    )
    return best_trial, replayed, replay_ticks


@dataclass(frozen=True)
class Counters:
    """What one run spent. The replay is not part of it."""

    trials: int
    """Trials made, trial 0 included."""
    movement_ticks: int
    """Control ticks of all trials, those of failed trials included."""
    forward_kinematics: int
    """Forward-kinematics evaluations the compiled kernels made. They skip steps that
    cannot end a movement; a robot would sense its hand on every one of the ticks."""
    jacobians: int
    """Jacobian evaluations: one per corrective iteration and per biased movement."""
    corrective_iterations: int
    corrections: int
    """Corrective movements made."""
    failed_trials: int
    """Trials that did not hit every goal: the corrective process did not converge, or
    the variant has none for stored targets."""


@dataclass(frozen=True)
class LearningRun:
    """One run of the learner and everything it found."""

    task: Task
    condition: ExplorationCondition
    model: MotionModel
    seed: int
    initial_search: InitialSearch
    """Hands of trial 0, and what a policy spent on finding them."""
    rewards: np.ma.MaskedArray[Any, np.dtype[np.int64]]
    """Total reward of each trial, shape ``(trials,)``; masked where the trial failed."""
    best_trial: int | None
    """First trial with the highest total reward; None where none was completed."""
    initial: tuple[Movement, ...]
    """Movements of trial 0; none where it failed."""
    solution: tuple[Movement, ...]
    """Movements of the best trial."""
    replay: tuple[Movement, ...]
    """Movements of one noiseless greedy trial with the final tables."""
    replay_completed: bool
    values: Array
    """Q, shape ``(goals, 3, 2)``: goal, previous hand (left, right, none), hand."""
    targets: Array
    """q*, shape ``(goals, 3, 2, dof)``; NaN where Q is -inf."""
    counters: Counters
    wall_s: float
    cpu_s: float

    @property
    def first_hands(self) -> str:
        """Hands of trial 0."""
        return self.initial_search.hands

    @property
    def completed(self) -> NDArray[np.bool_]:
        """Whether each trial hit every goal; the others failed and taught nothing."""
        return ~np.ma.getmaskarray(self.rewards)

    @property
    def method(self) -> str:
        """Method id of the learner under this condition."""
        return f"{METHOD_PREFIX}{self.condition.id}"

    @property
    def status(self) -> str:
        """``"ok"``, or ``"infeasible"`` where no trial was completed."""
        return "ok" if self.best_trial is not None else "infeasible"

    @property
    def reason(self) -> str:
        """Why the run has no solution; empty where it has one."""
        if self.best_trial is not None:
            return ""
        return (
            f"the corrective process failed in all {self.counters.trials} trials; "
            "no trial hit every goal"
        )

    @property
    def reward(self) -> int | None:
        """Learned reward: the highest total reward of any trial, max Q of state 1."""
        return None if self.best_trial is None else int(self.rewards[self.best_trial])

    @property
    def hands(self) -> str | None:
        """Hand sequence of the best trial."""
        return _hands(self.solution) if self.best_trial is not None else None

    @property
    def initial_reward(self) -> int | None:
        """Reward of trial 0."""
        return int(self.rewards[0]) if self.completed[0] else None

    @property
    def replay_reward(self) -> int | None:
        """Reward of the noiseless greedy trial with the final tables."""
        if not self.replay_completed:
            return None
        return -sum(movement.ticks or 0 for movement in self.replay)

    @property
    def replay_hands(self) -> str | None:
        """Hand sequence of the replay."""
        return _hands(self.replay) if self.replay_completed else None

    def execute(self) -> Execution:
        """Execute the best trial again, apart from the learner."""
        if self.best_trial is None:
            raise CoarticError(f"nothing to execute: {self.reason}")
        return execute(self.task, self.solution, model=self.model)


def learn(
    task: Task,
    condition: str | ExplorationCondition,
    *,
    seed: int,
    trials: int = TRIALS,
    model: MotionModel = PAPER,
) -> LearningRun:
    """Run the learner on a task under an exploration condition.

    The result depends on the arguments alone. Raises NotApplicableError where the
    condition does not fit the task, CoarticError for an unknown condition and
    ValueError for a negative seed, fewer than one trial, or a model that no movement can
    be made with. Source: paper, Figure 3.
    """
    condition = load_condition(condition)
    reason = condition.why_not(task)
    if reason is not None:
        raise NotApplicableError(reason)
    if trials < 1:
        raise ValueError(f"trials is {trials}; trial 0 is the initial solution, so at least 1")
    checked_model(model, radius=task.radius)
    search = search_initial_hands(task, condition.hands, model=model)
    problem = _problem(task, condition, model)
    goals, dof = len(task.goals), task.robot.dof
    tables = _Tables(np.full((goals, 3, 2), -np.inf), np.full((goals, 3, 2, dof), np.nan))
    first, best, replay, trial_log = (_empty_log(goals, dof) for _ in range(4))
    rewards = np.zeros(trials, dtype=np.int64)
    completed = np.zeros(trials, dtype=np.bool_)
    counts = np.zeros(len(_C), dtype=np.int64)
    hand_codes = np.array([HANDS.index(hand) for hand in hands_of(search.hands)], dtype=np.int64)
    rng = np.random.default_rng(seed)

    def run(trial_rewards: NDArray[np.int64]) -> tuple[int, bool, int]:
        result: tuple[int, bool, int] = _learn(
            hand_codes,
            problem,
            tables,
            trial_rewards,
            completed,
            first,
            best,
            replay,
            counts,
            rng,
            scratch_for(task.robot),
            trial_log,
        )
        return result

    if not getattr(_learn, "signatures", True):
        run(rewards[:0])  # compiles, which is not part of any run's time
    wall, cpu = time.perf_counter(), time.thread_time()
    best_trial, replayed, _ = run(rewards)
    wall, cpu = time.perf_counter() - wall, time.thread_time() - cpu

    iterations = int(counts[_C.iterations])
    return LearningRun(
        task=task,
        condition=condition,
        model=model,
        seed=seed,
        initial_search=search,
        rewards=np.ma.array(rewards, mask=~completed),
        best_trial=int(best_trial) if best_trial >= 0 else None,
        initial=_movements(first),
        solution=_movements(best) if best_trial >= 0 else (),
        replay=_movements(replay),
        replay_completed=bool(replayed),
        values=tables.value,
        targets=tables.target,
        counters=Counters(
            trials=trials,
            movement_ticks=int(counts[_C.ticks]),
            forward_kinematics=int(counts[_C.evaluations]),
            jacobians=iterations + int(counts[_C.biased]),
            corrective_iterations=iterations,
            corrections=int(counts[_C.corrections]),
            failed_trials=int(counts[_C.failed]),
        ),
        wall_s=wall,
        cpu_s=cpu,
    )


def learn_many(
    task: Task,
    condition: str | ExplorationCondition,
    *,
    seeds: Iterable[int],
    trials: int = TRIALS,
    model: MotionModel = PAPER,
    jobs: int = -1,
    on_done: Callable[[LearningRun], None] | None = None,
) -> list[LearningRun]:
    """Run :func:`learn` for many seeds in parallel; one run per seed, in their order.

    ``jobs`` threads work at once, -1 for one per core; the kernels hold no lock and
    the number changes nothing but the time. ``on_done`` is called after each run.
    """
    from joblib import Parallel, delayed

    condition = load_condition(condition)
    ordered: Sequence[int] = list(seeds)

    def one(seed: int) -> LearningRun:
        run = learn(task, condition, seed=seed, trials=trials, model=model)
        if on_done is not None:
            on_done(run)
        return run

    runs: list[LearningRun] = Parallel(n_jobs=jobs, prefer="threads")(
        delayed(one)(seed) for seed in ordered
    )
    return runs


def warm_up() -> None:
    """Compile the kernels, or load them, so that no run's time contains it."""
    from coartic.task import load_task

    task = load_task("ascending")
    learn(task, "EC1", seed=0, trials=1).execute()
    make_trials(task, "RRR", np.empty((0, len(task.goals), task.robot.dof)))


def _problem(task: Task, condition: ExplorationCondition, model: MotionModel) -> _Problem:
    dof = task.robot.dof
    follows = np.zeros((2, dof), dtype=np.bool_)
    explored = np.zeros((2, dof), dtype=np.bool_)
    base = np.array(["x" not in task.locked_base, "y" not in task.locked_base])
    for chosen, hand in enumerate(HANDS):
        own, others = task.robot.joints(hand), task.robot.joints(HANDS[1 - chosen])
        explored[chosen, :2] = condition.modify_chosen & base
        explored[chosen, own] = condition.modify_chosen
        explored[chosen, others] = condition.modify_other
        follows[chosen, others] = not condition.modify_other
    return _Problem(
        start=np.array(task.q0),
        goals=np.array(task.goal_array),
        radius=float(task.radius),
        free_x=bool(base[0]),
        free_y=bool(base[1]),
        left=task.robot.arm("left"),
        right=task.robot.arm("right"),
        hands=np.array(sorted(HANDS.index(hand) for hand in condition.hands), dtype=np.int64),
        follows=follows,
        explored=explored,
        exploration=_EXPLORATION[condition.hand_exploration],
        epsilon=float(condition.epsilon),
        noise_sd=float(condition.noise_sd),
        nullspace_gain=float(condition.nullspace_gain),
        bias=float(condition.bias),
        corrects=bool(condition.corrects),
        model=model,
    )


def _empty_log(goals: int, dof: int) -> _Log:
    rows = 2 * goals
    return _Log(
        count=np.zeros(1, dtype=np.int64),
        goal=np.zeros(rows, dtype=np.int64),
        hand=np.zeros(rows, dtype=np.int64),
        kind=np.zeros(rows, dtype=np.int64),
        ticks=np.zeros(rows, dtype=np.int64),
        target=np.zeros((rows, dof)),
        hands=np.zeros(goals, dtype=np.int64),
        reached=np.zeros((goals, dof)),
    )


def _movements(log: _Log) -> tuple[Movement, ...]:
    return tuple(
        Movement(
            goal=int(log.goal[row]) + 1,
            hand=HANDS[log.hand[row]],
            kind="learned" if log.kind[row] == LEARNED else "corrective",
            target=np.array(log.target[row]),
            ticks=int(log.ticks[row]),
        )
        for row in range(int(log.count[0]))
    )


def _hands(movements: tuple[Movement, ...]) -> str:
    by_goal = {movement.goal: movement.hand for movement in movements}
    return letters_of([by_goal[goal] for goal in sorted(by_goal)])
