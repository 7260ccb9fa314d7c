"""Measure coarticulation in the movements of solutions.

A signature of coarticulation is a number for each run of a method on a task (:data:`SIGNATURES`).
:class:`TwoContexts` compares the postures of runs on two tasks, at a goal that the tasks share.

Notation, for run i and goal g = 1..G:

- The run hits the goal at configuration q(i, g) with hand h(i, g), t(i, g) ticks after the hit of
  the previous goal. q(i, 0) is the configuration at the start of the task.
- The corrective process alone, with the hands of run i, takes c(i, g) ticks for goal g.
- A reach by the corrective process from q to goal g with hand h takes r(q, g, h) ticks, and ends at
  configuration R(q, g, h).

A signature of n runs is an array of shape ``(n,)``. It is NaN for a run without this signature.

The first two coordinates of a configuration are in length units (base), and all others in rad
(joints). Distances between configurations mix the two units, as the joint-space distance of the
model does.

Permutation tests exchange whole runs, which are exchangeable under the null hypothesis. The tests
assume no particular distribution.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, takewhile
from typing import Any, Literal, NamedTuple, TypeVar, get_args

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from coartic import Execution, Hand, Task, corrective_trial, initial_hands
from coartic.analysis.statistics import drawn_rows, places
from coartic.errors import NotApplicableError
from coartic.estimates import (
    FEWER_RESAMPLES,
    MIN_VALUES,
    RESAMPLES,
    SEED,
    TAILS,
    Estimate,
    Resamples,
    centred,
    slices,
)
from coartic.internal.arguments import Numbers
from coartic.model import PAPER, MotionModel
from coartic.motion.trials import reach_goals
from coartic.robot import HANDS, Array
from coartic.tasks.optima import HASHED_FIELDS
from coartic.tasks.task import hands_of

Cached = TypeVar("Cached", bound=NDArray[Any])


def _fixed(array: Cached) -> Cached:
    """Return an array that all users of a study share, so that none can change it."""
    array.setflags(write=False)
    return array


@dataclass(frozen=True)
class Solutions:
    """The executed solutions of n runs of a method on a task with G goals."""

    task: Task
    label: str
    """Label of the method: its id with its setting, or ``recorded`` for recorded trials."""
    runs: tuple[Execution, ...]
    """Executions of the solutions, one for each run."""
    run_ids: tuple[str, ...] = ()
    """Ids of the runs, in the order of ``runs``; empty if the runs have no ids."""
    unfinished: int = 0
    """Number of recorded trials in which not all goals were hit. These trials are not among
    ``runs``. The number is 0 for runs of a method."""
    deterministic: bool = False
    """True if the method is deterministic, so that all its runs on this task are equal."""
    model: MotionModel = PAPER
    """Motion model, without motor noise, with which the runs were executed. The corrective process,
    with which the runs are compared, has the same model."""

    @cached_property
    def hands(self) -> NDArray[np.int64]:
        """Hands that hit the goals, shape ``(n, G)``: 0 for left, 1 for right."""
        hands = [[HANDS.index(hand) for hand in hands_of(run.hands)] for run in self.runs]
        return _fixed(np.array(hands, dtype=np.int64).reshape(-1, len(self.task.goals)))

    @cached_property
    def configurations(self) -> Array:
        """Configurations that hit the goals, shape ``(n, G, dof)``, in length units and rad."""
        shape = len(self.runs), len(self.task.goals), self.task.robot.dof
        return _fixed(np.array([run.configurations for run in self.runs]).reshape(shape))

    @cached_property
    def starts(self) -> Array:
        """Configurations at the start of each subtask, shape ``(n, G, dof)``, length units and rad.

        The subtask of goal 1 starts at the start of the task. Each later subtask starts at the
        configuration in which the previous goal was hit.
        """
        starts = np.empty_like(self.configurations)
        starts[:, 0], starts[:, 1:] = self.task.q0, self.configurations[:, :-1]
        return _fixed(starts)

    @cached_property
    def against_same_hands(self) -> Array:
        """Ticks of each subtask minus those of the corrective process alone, shape ``(n, G)``.

        In the notation of the module: t(i, g) − c(i, g). The corrective process uses the hand
        sequence of the run. If the corrective process does not complete the task with these hands,
        all values of the run are NaN.
        """
        hand_sequences = {run.hands for run in self.runs}
        references = {
            hands: corrective_trial(self.task, hands, model=self.model) for hands in hand_sequences
        }
        changes = np.full((len(self.runs), len(self.task.goals)), np.nan)
        for row, run in zip(changes, self.runs, strict=True):
            if (reference := references[run.hands]).completed:
                row[:] = np.subtract(run.ticks_by_goal(), reference.ticks_by_goal())
        return _fixed(changes)


def initial_solution(task: Task, model: MotionModel = PAPER) -> Execution | None:
    """Execute the corrective process alone with a task's initial hands.

    ``model`` is a motion model without noise. The initial hands are a hand sequence, or a policy
    that finds one (:func:`coartic.initial_hands`). The result is None if

    - the task names a hand sequence, and the corrective process does not complete the task with it;
    - the task names a policy, and the corrective process completes the task with no hand sequence
      that the policy allows;
    - the task names a policy, and there are more than 4,096 hand sequences to try.
    """
    try:
        execution = corrective_trial(task, initial_hands(task, model=model), model=model)
    except NotApplicableError:
        return None
    return execution if execution.completed else None


def _other(hand: Hand) -> Hand:
    """Return the other hand."""
    return "right" if hand == "left" else "left"


def isolated_reaches(
    task: Task, q: Array, goals: ArrayLike, hands: ArrayLike, model: MotionModel = PAPER
) -> tuple[Array, Array]:
    """Compute reaches of the corrective process for single goals, each on its own.

    The results are r(q, g, h) and R(q, g, h) in the notation of this module.

    Parameters
    ----------
    task : Task
        Task with the robot and the goals.
    q : ndarray, shape (..., dof)
        Configuration at the start of each reach, in length units and rad.
    goals : array_like of int
        Number of the goal of each reach, from 1. The shape must broadcast to ``q.shape[:-1]``.
    hands : array_like of int
        Hand of each reach: 0 for left, 1 for right. The shape must broadcast to ``q.shape[:-1]``.
    model : MotionModel
        Motion model without noise.

    Returns
    -------
    ndarray, shape (...)
        Ticks of each reach: 0 if the hand is in the goal at the start, and NaN if the reach ends
        without a hit.
    ndarray, shape (..., dof)
        Configuration at the end of each reach, in length units and rad.

    Raises
    ------
    ValueError
        A number of a goal is out of range, a hand is neither 0 nor 1, shapes do not fit, an entry
        of ``q`` is not finite, or the model has motor noise.
    """
    q, numbers = np.asarray(q), 1 + np.arange(len(task.goals))
    shape = q.shape[:-1]
    try:
        fit = np.broadcast_shapes(np.shape(goals), np.shape(hands), shape) == shape
    except ValueError:
        fit = False
    if not fit or not np.isin(goals, numbers).all():
        raise ValueError(
            f"goals are {np.asarray(goals)}, hands have shape {np.shape(hands)}, and q has shape "
            f"{q.shape}; goals must be from 1 to {len(numbers)}, and the shapes of goals and hands "
            f"must broadcast to {shape}"
        )
    reached = reach_goals(
        task.robot,
        q.reshape(-1, q.shape[-1]),
        np.broadcast_to(hands, shape).ravel(),
        task.goal_array[np.broadcast_to(goals, shape).ravel() - 1],
        task.radius,
        locked_base=task.locked_base,
        model=model,
    )
    ticks = np.where(reached.hit, reached.ticks, np.nan)
    return ticks.reshape(shape), reached.q.reshape(q.shape)


def gain_at_next(runs: Solutions) -> Array:
    """Return how many ticks the posture at each goal saves on the way to the next goal.

    The result has shape ``(n, G − 1)``. For run i and goal g < G, the value is

    r(q', g + 1, h(i, g + 1)) − r(q'', g + 1, h(i, g + 1)),

    where

    - q' = R(q(i, g − 1), g, h(i, g)) is the posture in which the corrective process would have hit
      goal g;
    - q'' is the posture q(i, g) of the run, but with the joints of the idle arm as in q', so that
      movements of the idle arm have no effect.

    The value is positive if the corrective process reaches the next goal in fewer ticks from q''
    than from q'. It is NaN if one of these three reaches of the corrective process ends without a
    hit.
    """
    task, hands = runs.task, runs.hands
    goals = 1 + np.arange(len(task.goals))
    now, following = np.s_[:, :-1], np.s_[:, 1:]
    starts = runs.starts[now]
    isolated, corrective = isolated_reaches(task, starts, goals[:-1], hands[now], runs.model)
    idle = np.zeros((len(HANDS), task.robot.dof), dtype=np.bool_)
    for number, hand in enumerate(HANDS):
        idle[number, task.robot.joints(_other(hand))] = True
    hit = np.where(idle[hands[now]], corrective, runs.configurations[now])
    after, nearer = (
        isolated_reaches(task, q, goals[1:], hands[following], runs.model)[0]
        for q in (corrective, hit)
    )
    return np.where(np.isnan(isolated), np.nan, after - nearer)


def ticks_slower(runs: Solutions) -> Array:
    """Return how many ticks slower the chosen hand is than the fastest hand.

    The result has shape ``(n, G)``. For run i and goal g, the value is

    r(q(i, g − 1), g, h(i, g)) − min over the task's hands h of r(q(i, g − 1), g, h).

    Both reaches start in the configuration in which the previous goal was hit, or at the start of
    the task. The first term is the number of ticks that the corrective process needs with the
    chosen hand, and the second term is the number that it needs with the fastest hand. The value is
    0 if the chosen hand is the fastest, and above 0 if another hand is faster. It is infinite if
    the reach with the chosen hand ends without a hit.
    """
    goals = 1 + np.arange(len(runs.task.goals))
    isolated = np.full((len(HANDS), *runs.hands.shape), np.inf)
    for hand in map(HANDS.index, runs.task.hands):
        reached, _ = isolated_reaches(runs.task, runs.starts, goals, np.array(hand), runs.model)
        isolated[hand] = np.where(np.isnan(reached), np.inf, reached)
    chosen = np.take_along_axis(isolated, runs.hands[None], axis=0)[0]
    slower: Array = np.full_like(chosen, np.inf)
    np.subtract(chosen, isolated.min(axis=0), out=slower, where=chosen < np.inf)
    return slower


def preshaping(task: Task, run: Execution, initial: Execution) -> Array:
    """Return how much nearer the idle hand is to its next goal, at each hit.

    At the hit of goal g, the idle hand is the hand that does not hit goal g. The value is

    (d_held(g) − d(g)) / d_initial(g),

    where

    - d(g) is the distance, at the hit of goal g in ``run``, between the idle hand and the next goal
      that this hand hits;
    - d_held(g) is the distance that would result if the joints of the idle arm were as at the last
      hit by the idle hand (or at the start of the task), with the base as in ``run``;
    - d_initial(g) is the distance of the same hand to the same goal at the hit of goal g in
      ``initial``.

    Parameters
    ----------
    task : Task
    run : Execution
        A completed run.
    initial : Execution
        The completed run of the corrective process alone with the task's initial hands.

    Returns
    -------
    ndarray, shape (G,)
        A fraction for each goal. It is NaN if the idle hand hits no later goal (as always under
        exploration condition EC1), or if d_initial(g) is 0. Otherwise it is 0 if the joints of the
        idle arm have not moved since that last hit (as always under EC3), even if the base has
        moved. It is negative if the idle arm has moved its hand away from its next goal.
    """
    now, hands = run.configurations, hands_of(run.hands)
    held = np.array(now)
    own_last = dict.fromkeys(HANDS, task.q0)
    for row, hand in zip(held, hands, strict=True):
        own_last[hand] = row.copy()
        joints = task.robot.joints(_other(hand))
        row[joints] = own_last[_other(hand)][joints]
    nearer = np.full(len(task.goals), np.nan)
    for k, idle in enumerate(map(_other, hands)):
        if idle in hands[k:]:
            goal = task.goals[hands.index(idle, k)]
            reached, kept, initially = (
                np.linalg.norm(task.robot.forward_kinematics(q[k], idle) - goal)
                for q in (now, held, initial.configurations)
            )
            if initially > 0:
                nearer[k] = (1 - reached / initially) - (1 - kept / initially)
    return nearer


@dataclass(frozen=True)
class Signature:
    """A signature of coarticulation, with the words and formats of tables and pages for it."""

    name: str
    """Name, such as ``other arm``."""
    each: Callable[[Solutions], Array]
    """Function of n runs that returns the signature of each run, shape ``(n,)``. A value is NaN for
    a run without the signature."""
    heading: str
    """Heading of the signature's column in tables, with its unit."""
    decimals: int
    """Number of decimals of the signature in tables."""
    words: str
    """Short description of what the signature measures, with its unit."""
    definition: str
    """Definition of the signature in the documentation, where it follows the name and unit."""
    in_latex: str = ""
    """Columns of the signature in LaTeX tables: ``value`` (mean of the method), ``value and
    control`` (means of the method and of random search), or empty for no column."""
    by_hands: bool = True
    """True if runs are only compared with runs of random search with the same hand sequence."""

    @property
    def column(self) -> str:
        """Name of the signature's column in tables and frames, such as ``other_arm``."""
        return self.name.replace(" ", "_")


def hand(runs: Solutions) -> Array:
    """Return the share of goals that each run hits with a slower hand, shape ``(n,)``.

    The chosen hand counts as slower if the corrective process, from the posture at the previous
    goal, needs fewer ticks with another hand, or does not reach the goal with the chosen hand. For
    run i, the share is 1 minus the mean of a(i, g) over the goals g < G (:func:`as_in_isolation`),
    a fraction. The last goal is left out. The share is NaN on a task for one hand, and on a task
    with one goal.
    """
    alike = as_in_isolation(runs)[:, :-1]
    return np.asarray(1.0 - alike.mean(axis=1)) if alike.size else np.full(len(alike), np.nan)


def as_in_isolation(runs: Solutions) -> Array:
    """Return whether each goal is hit with the hand that is fastest for this goal alone.

    The result a(i, g) has shape ``(n, G)``. It is 1 if

    r(q(i, g − 1), g, h(i, g)) = min over the task's hands h of r(q(i, g − 1), g, h),

    and 0 otherwise, also if the reach with hand h(i, g) ends without a hit. All values are NaN on a
    task for one hand.
    """
    if not runs.runs or len(runs.task.hands) < 2:
        return np.full((len(runs.runs), len(runs.task.goals)), np.nan)
    return np.asarray(ticks_slower(runs) == 0, dtype=np.float64)


def other_arm(runs: Solutions) -> Array:
    """Return how much nearer the idle hand is to its next goal, on average.

    The result is a fraction for each run, shape ``(n,)``: the mean of :func:`preshaping` over the
    goals at which :func:`preshaping` is not NaN. The fraction is negative if the idle arm moves its
    hand away from its next goal on average. It is NaN

    - for all runs on a task for one hand, or on a task without an initial solution
      (:func:`initial_solution`);
    - for a run in which :func:`preshaping` is NaN at all goals.
    """
    initial = initial_solution(runs.task, runs.model)
    if not runs.runs or initial is None or len(runs.task.hands) < 2:
        return np.full(len(runs.runs), np.nan)
    values = np.array([preshaping(runs.task, run, initial) for run in runs.runs])
    means, has_value = np.full(len(values), np.nan), ~np.isnan(values).all(axis=1)
    means[has_value] = np.nanmean(values[has_value], axis=1)
    return means


def arm(runs: Solutions) -> Array:
    """Return how many ticks postures save on the way to the next goal, on average.

    The posture at each goal is compared with the posture in which the corrective process would have
    hit the goal. Only the base and the arm that hits the goal are considered. The result is a mean
    for each run, in ticks, shape ``(n,)``: the mean of :func:`gain_at_next` over the goals g < G.
    It is NaN on a task with one goal, and for a run in which a value of :func:`gain_at_next` is
    NaN.
    """
    if not runs.runs or len(runs.task.goals) < 2:
        return np.full(len(runs.runs), np.nan)
    return np.asarray(gain_at_next(runs).mean(axis=1))


SIGNATURES = {
    signature.name: signature
    for signature in (
        Signature(
            name="first",
            each=lambda runs: runs.against_same_hands[:, 0],
            heading="first movement slower by (ticks)",
            decimals=1,
            words=(
                "ticks by which the first movement is longer than the corrective process's with "
                "the same hands"
            ),
            definition=(
                "how many more ticks the first goal takes than in the corrective process alone "
                "with the same hands. If it is positive and the whole task is faster, the first "
                "movement is sacrificed."
            ),
            in_latex="value and control",
        ),
        Signature(
            name="whole",
            each=lambda runs: -runs.against_same_hands.sum(axis=1),
            heading="whole task faster by (ticks)",
            decimals=1,
            words="ticks by which the whole task is shorter than the corrective process's",
            definition=(
                "how many fewer ticks the whole task takes than in the corrective process alone "
                "with the same hands."
            ),
        ),
        Signature(
            name="arm",
            each=arm,
            heading="next goal nearer by (ticks)",
            decimals=1,
            words=(
                "ticks by which the posture of base and chosen arm leaves the next goal nearer, "
                "with the idle arm where it was (mean over goals)"
            ),
            definition=(
                "how much sooner the corrective process reaches the next goal because base and "
                "chosen arm are prepared. It starts once from their posture at the goal, and once"
                " from the posture in which it would itself have hit the goal. The idle arm stays"
                " where it was both times. The value is a mean over the goals before the last."
            ),
            in_latex="value",
        ),
        Signature(
            name="other arm",
            each=other_arm,
            heading="idle hand nearer to its next goal (share)",
            decimals=2,
            words=(
                "share of the initial distance to its next goal by which the idle arm brings its "
                "hand nearer (mean over goals)"
            ),
            definition=(
                "how much nearer the idle hand is to its own next goal because its arm has moved "
                "since its own last hit. This is divided by the hand's distance in the initial "
                "solution. It is 0 if the arm keeps still, whatever the base does. The value is a"
                " mean over goals."
            ),
        ),
        Signature(
            name="hand",
            each=hand,
            heading="goals with the slower hand for them alone (share)",
            decimals=2,
            words=(
                "share of the goals that others follow which are hit with the slower hand for "
                "them alone"
            ),
            definition=(
                "the share of goals, without the last, that are hit with another hand than the "
                "corrective process would use. It would use the hand that gets there in fewest "
                "ticks from the same posture."
            ),
            by_hands=False,
        ),
    )
}
"""Maps the name of each signature to the signature, in the order of columns. In the notation of
this module, ``first`` is t(i, 1) − c(i, 1), and ``whole`` is the sum over g of c(i, g) − t(i, g).
Both are NaN if the corrective process does not complete the task with the hands of the run."""


IN_MEMORY = 500
"""Number of permutations or bootstrap samples whose runs are in memory at the same time."""


def _groups(*groups: Numbers) -> list[Array]:
    """Return groups of runs as arrays of float64, shape ``(runs, dof)`` each.

    Raises ValueError if an array has another shape or no run, or if the arrays differ in ``dof``.
    """
    shapes = [np.shape(group) for group in groups]
    if any(len(shape) != 2 or shape[1:] != shapes[0][1:] or 0 in shape for shape in shapes):
        raise ValueError(
            f"groups of runs have shapes {shapes}; each must be (runs, dof) with the same dof and "
            "at least one run"
        )
    return [np.asarray(group, np.float64) for group in groups]


def distance_of_means(first: Array, second: Array) -> float:
    """Return the Euclidean distance between the mean configurations of two contexts.

    ``first`` and ``second`` contain the configurations of the runs in the two contexts, shape
    ``(runs, dof)`` each. The distance ‖mean(first) − mean(second)‖ mixes length units and rad.
    Raises ValueError for other shapes, and for a context without runs.
    """
    first, second = _groups(first, second)
    return float(np.linalg.norm(first.mean(axis=0) - second.mean(axis=0)))


def standardised_posture_difference(first: Array, second: Array) -> float:
    """Return the distance between two mean configurations, in pooled standard deviations (SD).

    d = ‖m₁ − m₂‖ / s, s² = (Σ‖x − m₁‖² + Σ‖x − m₂‖²) / (n₁ + n₂ − 2),

    where m₁ is the mean configuration of the n₁ runs in the first context, m₂ is the mean
    configuration of the n₂ runs in the second context, and s is the pooled standard deviation
    within contexts. d is a multivariate form of Cohen's d (Cohen 1988), from 0 to ∞. If the context
    has no effect, d² is about 1/n₁ + 1/n₂ on average, not 0.

    Parameters
    ----------
    first, second : ndarray, shape (runs, dof)
        Configurations in the two contexts, in length units and rad.

    Returns
    -------
    float
        d. It is NaN if both contexts have a single run, or if s = 0.

    Raises
    ------
    ValueError
        An array has a wrong shape or no rows.
    """
    first, second = _groups(first, second)
    freedom = len(first) + len(second) - 2
    if freedom < 1:
        return math.nan
    squares = sum((centred(group) ** 2).sum() for group in (first, second))
    spread = float(np.sqrt(squares / freedom))
    return distance_of_means(first, second) / spread if spread else math.nan


def posture_difference_below(
    first: Numbers,
    second: Numbers,
    bound: float,
    rng: np.random.Generator,
    *,
    standardised: bool = True,
    resamples: Resamples = RESAMPLES,
) -> float:
    """Test by the bootstrap whether the posture difference of two contexts is below a bound.

    Each bootstrap sample draws runs with replacement within each context. p = (1 + number of
    bootstrap samples whose posture difference is at least ``bound``) / (1 + ``resamples``). Noise
    makes distances larger, so that p tends to be too large.

    Parameters
    ----------
    first, second : array_like, shape (runs, dof)
        Configurations in the two contexts, in length units and rad.
    bound : float
        The bound: in standard deviations (SD) if ``standardised`` is True, otherwise in the unit of
        the coordinates.
    rng : numpy.random.Generator
        Generator of the bootstrap samples.
    standardised : bool
        True if the posture difference is :func:`standardised_posture_difference`, False if it is
        :func:`distance_of_means`. If True, the posture difference of a bootstrap sample with SD 0
        counts as at least ``bound``.
    resamples : int
        Number of bootstrap samples.

    Returns
    -------
    float
        p; NaN if a context has a single run.

    Raises
    ------
    ValueError
        An array has a wrong shape or no rows.
    """
    groups = _groups(first, second)
    if min(map(len, groups)) < 2:
        return math.nan
    means, squares = [], np.zeros(resamples)
    for group in groups:
        means.append(np.empty((resamples, group.shape[1])))
        for rows in slices(resamples, IN_MEMORY):
            drawn = group[rng.integers(len(group), size=(rows.stop - rows.start, len(group)))]
            means[-1][rows] = drawn.mean(axis=1)
            squares[rows] += ((drawn - means[-1][rows, None]) ** 2).sum(axis=(1, 2))
    pooled = np.sqrt(squares / (sum(map(len, groups)) - 2)) if standardised else 1.0
    reached = np.linalg.norm(means[0] - means[1], axis=1) >= bound * pooled
    return float(1 + reached.sum()) / (resamples + 1)


def permutation_p(
    first: Array, second: Array, rng: np.random.Generator, *, resamples: Resamples = RESAMPLES
) -> float:
    """Test whether the mean configurations of two contexts differ, by a permutation test.

    The test statistic is :func:`distance_of_means`, and large distances are extreme. The test is
    exact if there are at most ``resamples`` ways to divide the runs into two contexts.

    Parameters
    ----------
    first, second : ndarray, shape (runs, dof)
        Configurations in the two contexts, in length units and rad.
    rng : numpy.random.Generator
        Generator of the permutations.
    resamples : int
        Largest number of permutations. If there are more ways to divide the runs, this number of
        random permutations is used.

    Returns
    -------
    float
        p, 0 < p ≤ 1. It is 1 if all runs are equal, and NaN if a context has a single run.

    Raises
    ------
    ValueError
        An array has a wrong shape or no rows.
    """
    first, second = _groups(first, second)
    if min(len(first), len(second)) < 2:
        return math.nan
    n, m, pool = len(first), len(second), centred(np.concatenate([first, second]))
    ways = math.comb(n + m, n)
    exact = ways <= resamples
    chunks = places(n + m, n, ways if exact else resamples, exact, rng)
    null = [_distances(*_means_of(pool, rows)) for _, rows in chunks]
    (observed,) = _distances(*_means_of(pool, np.arange(n)[None]))
    reached = int((np.concatenate(null) >= observed * (1 - 1e-9)).sum())
    # If divisions are random, the observed one is counted as well (Davison & Hinkley 1997).
    return reached / ways if exact else (1 + reached) / (1 + resamples)


def beyond_p(
    method: Sequence[Numbers],
    other: Sequence[Numbers],
    rng: np.random.Generator,
    *,
    resamples: Resamples = RESAMPLES,
) -> float:
    """Test whether one method's posture difference exceeds another's, by a permutation test.

    The posture difference of a method is the distance between its mean configurations in two
    contexts. The test statistic is the posture difference of the first method minus that of the
    second. Permutations exchange runs of the two methods within each context.

    Parameters
    ----------
    method, other : sequence of two arrays, shape (runs, dof)
        For each method, its configurations in the first and in the second context, in length units
        and rad.
    rng : numpy.random.Generator
        Generator of the permutations.
    resamples : int
        Number of permutations.

    Returns
    -------
    float
        p, 0 < p ≤ 1: twice the upper-tail p-value, but at most 1. It is NaN if a method has a
        single run in a context.

    Raises
    ------
    ValueError
        A method does not have two contexts, or an array has a wrong shape or no rows.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> still = [rng.normal(size=(20, 10)), rng.normal(size=(20, 10))]
    >>> moved = [rng.normal(size=(20, 10)), rng.normal(size=(20, 10)) + 2]
    >>> beyond_p(moved, still, rng) < 0.001 < beyond_p(still, still, rng)
    True
    """
    if len(method) != 2 or len(other) != 2:
        raise ValueError(
            f"method has {len(method)} and other {len(other)} contexts; each must have the runs of "
            "two contexts"
        )
    groups = _groups(*method, *other)
    if min(map(len, groups)) < 2:
        return math.nan
    pools = [np.concatenate(runs) for runs in zip(groups[:2], groups[2:], strict=True)]
    sizes = [*map(len, groups[:2])]

    def excess(rows: Sequence[NDArray[np.int32]]) -> Array:
        of_method, of_other = zip(*map(_means_of, pools, rows), strict=True)
        return _distances(*of_method) - _distances(*of_other)

    null = np.empty(resamples)
    for part in slices(resamples, IN_MEMORY):
        count = part.stop - part.start
        null[part] = excess([drawn_rows(len(pool), size, count, rng)
                             for pool, size in zip(pools, sizes, strict=True)])  # fmt: skip
    (observed,) = excess([np.arange(size, dtype=np.int32)[None] for size in sizes])
    return min(1.0, 2 * float(1 + (null >= observed - 1e-12).sum()) / (1 + resamples))


def _means_of(pool: Array, rows: NDArray[Any]) -> tuple[Array, Array]:
    """Return the means of chosen configurations and of the others, for each resample.

    ``pool`` contains N configurations, shape ``(N, dof)``. Each row of ``rows``, shape ``(rows,
    k)``, contains the indices of the k configurations that a resample chooses. Both means have
    shape ``(rows, dof)``.
    """
    total, chosen = pool[rows].sum(axis=1), rows.shape[1]
    return total / chosen, (pool.sum(axis=0) - total) / (len(pool) - chosen)


def _distances(first: Array, second: Array) -> Array:
    """Return the Euclidean distance between corresponding rows of two arrays, shape ``(rows,)``."""
    return np.asarray(np.linalg.norm(first - second, axis=1))


NEXT_APART = 0.1
"""Smallest distance between the mean next postures of two contexts for which a lean is computed, in
length units and rad. The next posture is the posture at the goal after the shared goal."""
STANDARD_ERRORS = 3
"""Smallest distance between the mean next postures of two contexts, in its standard errors, for
which a lean is computed."""
MIN_RUNS = 5
"""Smallest number of runs in each context for which the interval of a lean or of a posture
difference is computed."""


class Lean(NamedTuple):
    """Leans of postures at a shared goal and at the start, as fractions (:func:`lean`)."""

    more: Estimate
    """Lean at the shared goal minus lean at the start, with its interval for other runs. ``n`` is a
    tuple of the numbers of runs in the two contexts. Interpret this number, not the two leans."""
    at_goal: float
    """Lean of the postures at the shared goal."""
    at_start: float
    """Lean of the postures in which the movements to the shared goal start. It is the control."""
    apart: float
    """Distance between the mean next postures of the two contexts, in length units and rad. With
    ``toward``, it is the length of the mean of ``toward``."""


def lean(
    first: Numbers,
    second: Numbers,
    rng: np.random.Generator,
    *,
    toward: Numbers | None = None,
    deterministic: bool = False,
    resamples: Resamples = FEWER_RESAMPLES,
) -> Lean:
    """Return how far postures at a shared goal lean towards the next postures.

    In two contexts A and B, the robot hits the same goal (the shared goal), and then another goal
    in each context. The lean is the fraction of the difference between the next postures that
    already exists at the shared goal:

    (p_A − p_B)·(n_A − n_B) / ‖n_A − n_B‖²,

    where p_A and p_B are the mean postures at the shared goal in the two contexts, and n_A and n_B
    are the mean postures in which the next goals are hit. The lean is

    - 0 if the posture at the shared goal does not depend on the next goal;
    - 1 if the posture at the shared goal is already the posture of the next goal;
    - negative if postures at the shared goal differ in the opposite direction.

    The lean has no unit. The control is the lean of the postures at the start of the movement to
    the shared goal, computed by the same formula: a difference that existed before the movement is
    not an effect of the movement.

    The postures p and n of the same run share the noise of this run, which would look like a lean.
    Therefore the runs are divided into odd and even runs. The lean is computed twice, with p from
    the odd runs and n from the even runs, and the other way round, and the two results are
    averaged. Noise in n_A − n_B makes a lean smaller. If ‖n_A − n_B‖ is just three standard errors,
    the lean is smaller by about 11 % with four equally noisy coordinates, and by 14 % with six. If
    ‖n_A − n_B‖ is larger, the lean is smaller by less.

    The leans and the interval are NaN if the lean is not applicable, that is, if

    - ‖n_A − n_B‖ is below :data:`NEXT_APART` in the given coordinates;
    - ‖n_A − n_B‖ is below three standard errors. The standard error is the square root of the sum,
      over coordinates and contexts, of the variances of the means;
    - a context has a single run, and ``deterministic`` is False.

    Parameters
    ----------
    first, second : array_like, shape (runs, 3, k)
        Three postures of each run in context A and in context B: at the start of the movement to
        the shared goal, at the shared goal, and at the next goal. The k coordinates, in length
        units and rad, are usually those that move the hand that hits the shared goal.
    rng : numpy.random.Generator
        Generator of the bootstrap samples.
    toward : array_like, shape (m, k), optional
        Values of n_A − n_B from m other sources, such as other people. If this is passed, the mean
        of these values, with its standard error, replaces n_A − n_B, and p_A and p_B are means over
        all runs.
    deterministic : bool
        True if all runs of a context are equal by construction, so that one run is enough.
    resamples : int
        Number of bootstrap samples for the interval.

    Returns
    -------
    Lean
        The leans, as fractions, with the 95 % interval of their difference. The interval is a
        percentile interval of bootstrap samples. In each context, the odd runs and the even runs
        are resampled separately (with ``toward``, all runs together). In a group of m runs, the
        deviations of bootstrap means are multiplied by √(m / (m − 1)). There is no interval if a
        context has fewer than five runs, or if ``deterministic`` is True.

    Raises
    ------
    ValueError
        An array has a wrong shape or is empty, the contexts have different numbers of coordinates,
        or a posture in ``first`` or ``second`` is not finite.

    Examples
    --------
    Each run covers a third of the path from its own start to the next posture:

    >>> rng = np.random.default_rng(0)
    >>> up, down = ([[[0.0], [end / 3], [end]]] * 5 for end in (1.0, -0.5))
    >>> round(lean(up, down, rng).more.value, 6)
    0.333333
    """
    contexts = [_postures(runs) for runs in (first, second)]
    if contexts[0].shape[1:] != contexts[1].shape[1:]:
        numbers = [runs.shape[2] for runs in contexts]
        raise ValueError(
            f"first has {numbers[0]} coordinates and second {numbers[1]}; both must have the same "
            "number"
        )
    n = (len(contexts[0]), len(contexts[1]))
    if toward is not None:
        parts = [[runs] for runs in contexts]
        ways = np.asarray(toward, np.float64)
        if ways.ndim != 2 or ways.shape[1:] != contexts[0].shape[2:] or not ways.size:
            raise ValueError(
                f"toward has shape {ways.shape}; it must have a row for each source, with "
                f"{contexts[0].shape[2]} coordinates"
            )
        way, variance = ways.mean(axis=0), _variance_of_mean(ways)
    else:
        # Only a deterministic method may have a single run; it is then in both halves.
        halves = (slice(0, None, 2), slice(1, None, 2))
        parts = [[runs[half] for half in halves] if len(runs) > 1 else [runs] * 2
                 for runs in contexts]  # fmt: skip
        way = contexts[0][:, 2].mean(axis=0) - contexts[1][:, 2].mean(axis=0)
        variance = sum(_variance_of_mean(runs[:, 2]) for runs in contexts)
    apart = float(np.linalg.norm(way))
    few = min(n) < 2 and not deterministic
    if few or apart < max(NEXT_APART, STANDARD_ERRORS * math.sqrt(variance)):
        return Lean(Estimate(math.nan, n=n), math.nan, math.nan, apart)

    def shares(means: Sequence[Sequence[Array]]) -> Array:
        """Return the leans at the start and at the goal, shape ``(..., 2)``.

        ``means[context][part]`` has three mean postures (at the start, at the goal and at the next
        goal) of k coordinates, shape ``(..., 3, k)``; the first axes are those of resamples. The
        parts are the odd and the even runs or, with ``toward``, all runs together.
        """
        differences = [one - other for one, other in zip(*means, strict=True)]
        ways = [way]
        if toward is None:
            ways = [difference[..., 2, :] for difference in differences[::-1]]
        values = [
            np.einsum("...pk,...k->...p", difference[..., :2, :], to)
            / (to**2).sum(axis=-1)[..., None]
            for difference, to in zip(differences, ways, strict=True)
        ]
        return np.asarray(np.mean(values, axis=0))

    start, goal = shares([[half.mean(axis=0) for half in halves] for halves in parts]).tolist()
    more = Estimate(goal - start, n=n)
    if min(n) >= MIN_RUNS and not deterministic:
        drawn = shares(
            [[_means_drawn(half, rng, resamples) for half in halves] for halves in parts]
        )
        low, high = np.quantile(drawn[:, 1] - drawn[:, 0], TAILS).tolist()
        more = Estimate(more.value, low, high, n=n)
    return Lean(more, goal, start, apart)


def _postures(runs: Numbers) -> Array:
    """Return the postures of runs as an array of shape ``(runs, 3, k)``.

    Raises ValueError for another shape, for no runs, and for values that are not finite.
    """
    postures = np.asarray(runs, np.float64)
    if postures.ndim != 3 or postures.shape[1] != 3 or not postures.size:
        raise ValueError(
            f"the postures of a context have shape {postures.shape}; they must have a row for each "
            "run, with three postures: at the start, at the shared goal, and at the next goal"
        )
    if not np.isfinite(postures).all():
        raise ValueError(
            "the postures of a context have numbers that are not finite; all must be finite"
        )
    return postures


def _variance_of_mean(values: Array) -> float:
    """Return the variance of the mean of vectors, summed over their coordinates.

    ``values`` contains n vectors of k coordinates, shape ``(n, k)``. The result is 0 if n is 1.
    """
    if len(values) < 2:
        return 0.0
    return float(centred(values).var(axis=0, ddof=1).sum()) / len(values)


def _means_drawn(runs: Array, rng: np.random.Generator, resamples: int) -> Array:
    """Return the means of bootstrap samples of runs, shape ``(resamples, ...)``.

    ``runs`` has shape ``(m, ...)``. Each bootstrap sample draws m runs with replacement. The
    deviations of the means from the mean of ``runs`` are multiplied by √(m / (m − 1)), so that the
    variance of the results is an unbiased estimate of the variance of a mean.
    """
    mean, m = runs.mean(axis=0), len(runs)
    shares = rng.multinomial(m, np.full(m, 1 / m), size=resamples) / m
    deviations = np.tensordot(shares, runs - mean, axes=1)
    return np.asarray(mean + math.sqrt(m / max(m - 1, 1)) * deviations)


SAME = 0.01
"""Posture difference, in length units and rad, below which two postures count as the same. It is
the length of a step in the paper's model."""


def context_pairs(tasks: Mapping[str, Task]) -> list[tuple[str, str, int]]:
    """Return the pairs of tasks that begin with the same goals.

    Parameters
    ----------
    tasks : mapping of str to Task
        Maps the name of each task to the task.

    Returns
    -------
    list of (str, str, int)
        For each pair, the names of both tasks and the number n of shared goals. The shared goals
        are the goals at the beginning that are the same in both tasks, without the last goal of
        each task. A pair is left out if n is 0, if all goals of the two tasks are equal, or if the
        tasks differ in robot, start, radius of the goals, hands or locked base.
    """
    pairs = []
    for (a, first), (b, second) in combinations(tasks.items(), 2):
        others_differ = any(getattr(first, key) != getattr(second, key) for key in HASHED_FIELDS)
        if not others_differ and first.goals != second.goals:
            same = (one == other for one, other in zip(first.goals, second.goals, strict=False))
            shared = len(list(takewhile(bool, same)))
            pairs.append((a, b, min(shared, len(first.goals) - 1, len(second.goals) - 1)))
    return [pair for pair in pairs if pair[2]]


def movable(task: Task, hand: Hand) -> Array:
    """Return the indices of the coordinates that move a hand, shape ``(k,)``.

    These are the base coordinates that are not locked, and the joints of the hand's arm.
    """
    base = [k for k, name in enumerate("xy") if name not in task.locked_base]
    return np.array([*base, *np.arange(task.robot.dof)[task.robot.joints(hand)]])


Part = Literal["all", "base", "joints"]
"""Coordinates of a posture that :class:`TwoContexts` compares."""


def coordinates(task: Task, hand: Hand, part: Part) -> Array:
    """Return the indices of the coordinates of a part of the posture, shape ``(k,)``.

    Parameters
    ----------
    task : Task
        Task whose robot has the coordinates.
    hand : {"left", "right"}
        Hand whose arm is considered.
    part : {"all", "base", "joints"}
        - ``"base"``: both coordinates of the base, locked or not, in length units;
        - ``"joints"``: the joints of the hand's arm, in rad;
        - ``"all"``: the coordinates that move the hand (:func:`movable`).

    Raises
    ------
    ValueError
        The part is not one of these.

    Examples
    --------
    >>> from coartic import load_task
    >>> coordinates(load_task("ascending"), "right", "joints").tolist()
    [6, 7, 8, 9]
    """
    if part not in get_args(Part):
        raise ValueError(f"part is {part!r}; it must be one of {', '.join(get_args(Part))}")
    if part == "all":
        return movable(task, hand)
    kept = slice(0, 2) if part == "base" else task.robot.joints(hand)
    return np.array(range(task.robot.dof)[kept])


def motor_equivalence(difference: Array, jacobian: Array) -> tuple[float, float]:
    """Return the sizes of the motor-equivalent part of a posture difference and of the rest.

    The motor-equivalent part of a difference Δq is in the null space of the Jacobian J: to first
    order, it does not move the hand. The rest is in the row space of J. Both sizes are per
    dimension: ‖Nᵀ Δq‖ / √dim N and ‖Rᵀ Δq‖ / √dim R, where N and R are orthonormal bases of the
    null space and of the row space. If Δq has a random direction, the squares of both sizes have
    the same expectation. A difference between contexts is called motor-equivalent if the first size
    is larger than the second.

    Caveat: if differences are small, the radius of the goal bounds the size of the rest, because
    the hand is inside the goal in both contexts. Nothing bounds the motor-equivalent part.

    Parameters
    ----------
    difference : ndarray, shape (k,)
        Difference Δq of the k coordinates that can move, in length units and rad.
    jacobian : ndarray, shape (2, k)
        Jacobian J of the hand's position for these coordinates.

    Returns
    -------
    (float, float)
        Size of the motor-equivalent part, and size of the rest, in length units and rad. A size is
        NaN if its space has dimension 0.

    Raises
    ------
    ValueError
        An array has a wrong shape.

    Notes
    -----
    Source: Mattos, Latash and colleagues, Experimental Brain Research
    (doi:10.1007/s00221-015-4327-4, 10.1007/s00221-018-5215-5).
    """
    if np.ndim(difference) != 1 or np.shape(jacobian) != (2, len(difference)):
        raise ValueError(
            f"difference has shape {np.shape(difference)} and jacobian {np.shape(jacobian)}; "
            "these must be (k,) and (2, k)"
        )
    equivalent, other = (
        float(np.linalg.norm(basis.T @ difference)) / math.sqrt(basis.shape[1] or math.nan)
        for basis in (scipy.linalg.null_space(jacobian), scipy.linalg.orth(np.transpose(jacobian)))
    )
    return equivalent, other


@dataclass(frozen=True)
class TwoContexts:
    """Compare the runs of a method at a goal that two tasks share.

    The tasks have different later goals. Only runs that hit the goal with ``hand`` are compared.

    Parameters
    ----------
    first, second : Solutions
        Runs on two tasks that share the goal, as ``study.executed(task, method)`` returns them.
    goal : int
        Number of the shared goal, from 1. The lean needs a goal that is not the last of a task.
    hand : {"left", "right"}
        Hand that hits the goal in the compared runs.
    part : {"all", "base", "joints"}
        Coordinates that are compared: all of them, the two of the base (length units), or the
        joints of the arm of ``hand`` (rad). The posture difference, its tests and the lean are
        computed in these coordinates. There are two exceptions: for ``"all"``, the lean is computed
        in the coordinates that move the hand (:func:`movable`); :attr:`parts` is always computed in
        those coordinates. The lean of a part is measured along the difference of the next postures
        in the same coordinates. Therefore the leans of base and joints do not add up to the lean of
        all.

    Raises
    ------
    ValueError
        The part is not one of the three.

    Examples
    --------
    >>> study = coartic.analysis.load("shipped").worlds[""]  # doctest: +SKIP
    >>> runs = [study.executed(task, "dual-process/EC1") for task in ("ascending", "descending")]
    ... # doctest: +SKIP
    >>> contexts = TwoContexts(*runs, 1, "right", part="joints")  # doctest: +SKIP
    >>> round(contexts.lean.more.value, 3)  # doctest: +SKIP
    -0.056
    """

    first: Solutions
    second: Solutions
    goal: int
    hand: Hand
    part: Part = "all"

    def __post_init__(self) -> None:
        """Raise ValueError if ``part`` is unknown."""
        coordinates(self.first.task, self.hand, self.part)

    @property
    def tasks(self) -> tuple[Task, Task]:
        """Tasks of the two contexts."""
        return self.first.task, self.second.task

    @property
    def method(self) -> str:
        """Label of the method."""
        return self.first.label

    @cached_property
    def configurations(self) -> tuple[Array, Array]:
        """Configurations of the compared runs at the goal, as an array for each context.

        Each array has shape ``(runs, k)``, in length units and rad. The k coordinates are those of
        ``part``: all coordinates of the robot for ``"all"``, otherwise those of
        :func:`coordinates`. The compared runs are those that hit ``goal`` with ``hand``.
        """
        goal, hand = self.goal - 1, HANDS.index(self.hand)
        first, second = (
            runs.configurations[runs.hands[:, goal] == hand, goal]
            for runs in (self.first, self.second)
        )
        if self.part == "all":
            return first, second
        kept = coordinates(self.first.task, self.hand, self.part)
        return first[:, kept], second[:, kept]

    def of_part(self, part: Part) -> TwoContexts:
        """Return a comparison of the same runs in the coordinates of another ``part``."""
        return replace(self, part=part)

    @property
    def in_both(self) -> bool:
        """True if each context has at least one run that hits ``goal`` with ``hand``.

        If it is False, :attr:`p` and :attr:`p_same` are NaN, and :attr:`posture_difference`,
        :attr:`difference`, :attr:`standardised_posture_difference`, :attr:`parts` and :attr:`lean`
        raise ValueError.
        """
        return all(map(len, self.configurations))

    @property
    def n(self) -> int:
        """Number of compared runs in the two contexts together."""
        return sum(map(len, self.configurations))

    @property
    def can_test(self) -> bool:
        """True if each context has at least the five compared runs that a test needs."""
        return min(map(len, self.configurations)) >= MIN_VALUES

    @property
    def posture_difference(self) -> float:
        """Distance between the mean postures of the two contexts.

        Its unit is the length unit for the base, rad for the joints, and a mixture of both for all
        coordinates.
        """
        return distance_of_means(*self.configurations)

    @cached_property
    def difference(self) -> Estimate:
        """The posture difference with its 95 % interval.

        The interval is the percentile interval of a bootstrap that resamples runs within each
        context; deviations are widened as in :func:`.lean`. There is no interval if a context has
        fewer than five runs, or if the method is deterministic. Noise makes distances larger, so
        that the interval of a small difference tends to be too high.
        """
        value, n = self.posture_difference, tuple(map(len, self.configurations))
        if min(n) < MIN_RUNS or self.first.deterministic:
            return Estimate(value, n=n)
        rng = self._rng("difference")
        drawn = [_means_drawn(runs, rng, FEWER_RESAMPLES) for runs in self.configurations]
        low, high = np.quantile(_distances(*drawn), TAILS).tolist()
        return Estimate(value, low, high, n=n)

    @cached_property
    def lean(self) -> Lean:
        """Lean of the postures at the goal, in the coordinates of ``part``.

        The lean (:func:`.lean`) is the fraction of the difference between the next postures of the
        two contexts that already exists at the shared goal. Its attribute ``more`` is this fraction
        minus the same fraction at the start of the movement. The coordinates are those of
        :func:`coordinates`; for ``"all"``, they are the coordinates that move the hand. In each
        context, only the runs that hit the next goal with the more frequent hand are used. Raises
        IndexError if the shared goal is the last goal of a task.
        """
        kept = coordinates(self.first.task, self.hand, self.part)
        goal, hand = self.goal - 1, HANDS.index(self.hand)
        contexts = []
        for runs in (self.first, self.second):
            is_compared, next_hand = runs.hands[:, goal] == hand, runs.hands[:, goal + 1]
            is_compared &= next_hand == np.bincount(next_hand[is_compared]).argmax()
            hits = runs.configurations
            postures = np.stack([runs.starts[:, goal], hits[:, goal], hits[:, goal + 1]], axis=1)
            contexts.append(postures[is_compared][..., kept])
        deterministic = self.first.deterministic and self.second.deterministic
        first, second = contexts
        return lean(first, second, self._rng("lean"), deterministic=deterministic)

    @property
    def standardised_posture_difference(self) -> float:
        """Posture difference in pooled standard deviations within contexts.

        It is NaN if postures do not vary within either context, or if each context has a single run
        (:func:`.standardised_posture_difference`).
        """
        return standardised_posture_difference(*self.configurations)

    @cached_property
    def parts(self) -> tuple[float, float]:
        """Sizes of the motor-equivalent part of the posture difference and of the rest.

        The motor-equivalent part does not move the hand, to first order. Both sizes are per
        dimension, in length units and rad (:func:`motor_equivalence`). They are computed in the
        coordinates that move the hand (:func:`movable`), whatever ``part`` is. The Jacobian is that
        of the mean posture of all compared runs.
        """
        task, joints = self.first.task, movable(self.first.task, self.hand)
        postures = self.of_part("all").configurations
        posture = np.concatenate(postures).mean(axis=0)
        first, second = (configurations.mean(axis=0) for configurations in postures)
        jacobian = task.robot.jacobian(posture, self.hand)[:, joints]
        return motor_equivalence((first - second)[joints], jacobian)

    @cached_property
    def p(self) -> float:
        """p-value of the permutation test of the posture difference (:func:`.permutation_p`).

        The null hypothesis is that the context has no effect on the posture. The p-value is NaN if
        a context has fewer than five compared runs.
        """
        if not self.can_test:
            return math.nan
        return permutation_p(*self.configurations, self._rng("context dependence"))

    @cached_property
    def p_same(self) -> float:
        """p-value of the bootstrap test for a posture difference below :data:`SAME`.

        The test is :func:`.posture_difference_below`. The p-value is NaN if a context has fewer
        than five compared runs.
        """
        if not self.can_test:
            return math.nan
        rng = self._rng("sameness")
        return posture_difference_below(*self.configurations, SAME, rng, standardised=False)

    def p_beyond(self, other: TwoContexts) -> float:
        """Test whether the posture difference exceeds that of another method (:func:`.beyond_p`).

        Parameters
        ----------
        other : TwoContexts
            Runs of another method at the same goal, compared in the same part of the posture.

        Returns
        -------
        float
            Twice the upper-tail p-value of the permutation test, but at most 1. It is NaN if a
            context of one of the methods has fewer than five compared runs.

        Raises
        ------
        ValueError
            ``part`` of the two comparisons differs.
        """
        if self.part != other.part:
            raise ValueError(
                f"part is {self.part!r}, but that of the other method is {other.part!r}; both must "
                "be compared in the same part"
            )
        if not (self.can_test and other.can_test):
            return math.nan
        return beyond_p(self.configurations, other.configurations, self._rng("beyond"))

    def _rng(self, test: str) -> np.random.Generator:
        """Return a new random generator for the test with this name.

        The seed depends on the test, the goal, the hand and the second task. It does not depend on
        the folder or the method.
        """
        where = f"goal {self.goal}, {self.hand} hand, against {self.second.task.name}"
        return np.random.default_rng([SEED, zlib.crc32(f"{test} {where}".encode())])
