"""Signatures of coarticulation in the movements of solutions.

A signature is a number for each run of a method on a task (:data:`SIGNATURES`). At a goal that two
tasks share, :class:`TwoContexts` compares the postures of their runs.

Notation, for run i and goal g = 1..G:

- The run hits the goal at configuration q(i, g) with hand h(i, g), t(i, g) ticks after the previous
  goal. q(i, 0) is the start of the task.
- The corrective process alone, with the hands of run i, takes c(i, g) ticks for goal g.
- A reach by the corrective process from q to goal g with hand h takes r(q, g, h) ticks, and ends at
  configuration R(q, g, h).

A signature has shape ``(n,)`` for n runs, and is NaN for a run without this signature.

Configurations mix length units (base) and rad (joints), as the joint-space distance of the model
does. Permutation tests exchange whole runs. Runs are exchangeable if the context has no effect. The
tests assume no distribution.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, takewhile
from typing import Any, Literal, NamedTuple, get_args

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


@dataclass(frozen=True)
class Solutions:
    """Executed solutions of n runs of one method with one setting on one task with G goals."""

    task: Task
    label: str
    """Label: id of the method with its setting, or ``recorded``."""
    runs: tuple[Execution, ...]
    """Executions of the solutions, one for each run."""
    run_ids: tuple[str, ...] = ()
    """Ids of the runs, in the order of ``runs``; empty if the runs have no ids."""
    unfinished: int = 0
    """Number of recorded trials in which not all goals were hit. They are not among ``runs``. It is
    0 if the runs are not recorded."""
    deterministic: bool = False
    """True if all runs of the method on this task are equal by construction."""
    model: MotionModel = PAPER
    """The world, without motor noise, in which the runs were executed, and in which the corrective
    process is compared with them."""

    @cached_property
    def hands(self) -> NDArray[np.int64]:
        """Hands that hit the goals, shape ``(n, G)``: 0 for left, 1 for right, as in HANDS."""
        hands = [[HANDS.index(hand) for hand in hands_of(run.hands)] for run in self.runs]
        return np.array(hands, dtype=np.int64).reshape(-1, len(self.task.goals))

    @cached_property
    def configurations(self) -> Array:
        """Configurations that hit the goals, shape ``(n, G, dof)``, in length units and rad."""
        shape = len(self.runs), len(self.task.goals), self.task.robot.dof
        return np.array([run.configurations for run in self.runs]).reshape(shape)

    @cached_property
    def starts(self) -> Array:
        """Configurations at the start of each subtask, shape ``(n, G, dof)``.

        A subtask starts at the hit of the previous goal. The first subtask starts at the start of
        the task.
        """
        starts = np.empty_like(self.configurations)
        starts[:, 0], starts[:, 1:] = self.task.q0, self.configurations[:, :-1]
        return starts

    @cached_property
    def against_same_hands(self) -> Array:
        """Ticks of each subtask less those of the corrective process alone, shape ``(n, G)``.

        The corrective process uses the hands of the run. The values of a run are NaN if the
        corrective process does not complete the task with them.
        """
        hand_sequences = {run.hands for run in self.runs}
        references = {
            hands: corrective_trial(self.task, hands, model=self.model) for hands in hand_sequences
        }
        changes = np.full((len(self.runs), len(self.task.goals)), np.nan)
        for row, run in zip(changes, self.runs, strict=True):
            if (reference := references[run.hands]).completed:
                row[:] = np.subtract(run.ticks_by_goal(), reference.ticks_by_goal())
        return changes


def initial_solution(task: Task, model: MotionModel = PAPER) -> Execution | None:
    """Return the execution of the corrective process alone with the initial hands of a task.

    ``model`` is a world without noise. Returns None if

    - the corrective process does not complete the task with the initial hands;
    - the task does not name initial hands, and no hand sequence that its policy allows completes
      the task;
    - the task does not name initial hands, and there are more than 4,096 hand sequences to try.
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
    """Reach single goals by the corrective process, and return ticks and final configurations.

    These are r(q, g, h) and R(q, g, h) in the notation of this module.

    Parameters
    ----------
    task : Task
    q : ndarray, shape (..., dof)
        Configurations at the start, in length units and rad.
    goals, hands : array_like of int, shapes that broadcast to (...)
        Numbers of goals, from 1, and indices of hands in HANDS.
    model : MotionModel
        A world without noise.

    Returns
    -------
    (ndarray, shape (...), ndarray, shape (..., dof))
        Ticks, and configurations at the end. Ticks are 0 if the hand is within the goal at the
        start, and NaN if the reach ends without a hit.

    Raises
    ------
    ValueError
        A goal's number is out of range, or shapes do not fit.
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
    """Return the ticks that postures save for the next goal, shape ``(n, G − 1)``.

    r(q', g + 1, h(i, g + 1)) − r(q'', g + 1, h(i, g + 1)),

    where

    - q' = R(q(i, g − 1), g, h(i, g)) is the posture in which the corrective process would have hit
      goal g;
    - q'' is q(i, g) with the joints of the idle arm as in q', so that movements of the idle arm do
      not count.

    A value is positive if the movement to the next goal is shorter from q'', and NaN if a reach
    ends without a hit.
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
    """Return how many ticks slower than the fastest hand each chosen hand is, shape ``(n, G)``.

    r(q(i, g − 1), g, h(i, g)) − min over hands h of r(q(i, g − 1), g, h)

    Both reaches start where the previous goal was hit. The value is the number of ticks that the
    corrective process needs from there with the chosen hand, minus the number that it needs with
    the fastest hand. The value is above 0 if another hand would be faster for this goal. The value
    is infinite if the reach with the chosen hand ends without a hit.
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
    """Return how much of the path to its next goal the idle hand covers.

    The result has a share for each goal, shape ``(G,)``:

    (d_held(g) − d(g)) / d_initial(g),

    where

    - d(g) is the distance of the idle hand to this hand's next goal, at the hit of goal g;
    - d_held(g) is this distance if the idle arm had not moved its joints since its own last hit (or
      the start);
    - d_initial(g) is the distance of the same hand to the same goal at the hit of goal g in
      ``initial``.

    The share is NaN if the idle hand hits no later goal (always under exploration condition 1), or
    if d_initial(g) is 0. Otherwise it is 0 if the joints of the idle arm do not move (always under
    condition 3), even if the base moves.

    Parameters
    ----------
    task : Task
    run : Execution
        A completed run.
    initial : Execution
        A completed run of the corrective process alone with the task's initial hands.
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
    """A signature of coarticulation, with all that tables and pages say of it."""

    name: str
    """Name, such as ``other arm``. Names of columns have ``_`` for spaces."""
    each: Callable[[Solutions], Array]
    """Function that returns the signature of each run, shape ``(n,)``. It is NaN for a run without
    the signature, and an empty array for no runs."""
    heading: str
    """Heading of its column, with the unit."""
    decimals: int
    """Number of decimals in tables."""
    words: str
    """What the signature measures, in words with its unit."""
    definition: str
    """Definition on the site: sentences after the name and the unit."""
    in_latex: str = ""
    """Columns that LaTeX also has: ``value``, ``value and control`` (of random search), or none."""
    by_hands: bool = True
    """True to compare it only with runs that have the same hand sequence."""

    @property
    def column(self) -> str:
        """Name of its column."""
        return self.name.replace(" ", "_")


def hand(runs: Solutions) -> Array:
    """Return the share of goals that are not hit with their fastest hand, shape ``(n,)``.

    The fastest hand is that for the goal alone. The share is 1 − mean over g < G of a(i, g) of
    :func:`as_in_isolation`: the last goal does not count. The share is NaN on a task for one hand,
    and on a task with one goal.
    """
    alike = as_in_isolation(runs)[:, :-1]
    return np.asarray(1.0 - alike.mean(axis=1)) if alike.size else np.full(len(alike), np.nan)


def as_in_isolation(runs: Solutions) -> Array:
    """Return 1 where the chosen hand is the fastest for the goal alone, otherwise 0.

    The shape is ``(n, G)``. Values are NaN on a task for one hand. a(i, g) is 1 if

    r(q(i, g − 1), g, h(i, g)) = min over h of r(q(i, g − 1), g, h).
    """
    if not runs.runs or len(runs.task.hands) < 2:
        return np.full((len(runs.runs), len(runs.task.goals)), np.nan)
    return np.asarray(ticks_slower(runs) == 0, dtype=np.float64)


def other_arm(runs: Solutions) -> Array:
    """Return how much of the path to its next goal the idle hand covers.

    The result has a share for each run, shape ``(n,)``: the mean of :func:`preshaping` over the
    goals for which this is not NaN. The share is negative if the idle hand moves away on average.
    It is NaN

    - on a task for one hand, or without an initial solution (:func:`initial_solution`);
    - for a run in which :func:`preshaping` is NaN for all goals.
    """
    initial = initial_solution(runs.task, runs.model)
    if not runs.runs or initial is None or len(runs.task.hands) < 2:
        return np.full(len(runs.runs), np.nan)
    values = np.array([preshaping(runs.task, run, initial) for run in runs.runs])
    means, has_value = np.full(len(values), np.nan), ~np.isnan(values).all(axis=1)
    means[has_value] = np.nanmean(values[has_value], axis=1)
    return means


def arm(runs: Solutions) -> Array:
    """Return how many ticks the chosen posture at a goal saves for the next goal, on average.

    The posture is compared with that in which the corrective process would have hit the goal. Only
    the base and the chosen arm count. The result has shape ``(n,)``: the mean of
    :func:`gain_at_next` over goals g < G. It is NaN on a task with one goal, and for a run with a
    gain that is NaN.
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
"""Signatures by name, in the order of tables. ``first`` is t(i, 1) − c(i, 1), and ``whole`` is
Σ_g c(i, g) − t(i, g). Both are NaN if the corrective process does not complete the task with the
hands of the run."""


IN_MEMORY = 500
"""Largest number of permutations or resamples of runs in memory at once."""


def _groups(*groups: Numbers) -> list[Array]:
    """Return groups of runs as arrays of float64.

    Raises ValueError unless all have shape ``(runs, dof)``, the same ``dof``, and at least one run.
    """
    shapes = [np.shape(group) for group in groups]
    if any(len(shape) != 2 or shape[1:] != shapes[0][1:] or 0 in shape for shape in shapes):
        raise ValueError(
            f"groups of runs have shapes {shapes}; each must be (runs, dof) with the same dof and "
            "at least one run"
        )
    return [np.asarray(group, np.float64) for group in groups]


def distance_of_means(first: Array, second: Array) -> float:
    """Return the distance ‖mean(first) − mean(second)‖ of the mean configurations of two contexts.

    ``first`` and ``second`` have shape ``(runs, dof)``. The distance mixes length units and rad.
    Raises ValueError for other shapes.
    """
    first, second = _groups(first, second)
    return float(np.linalg.norm(first.mean(axis=0) - second.mean(axis=0)))


def standardised_posture_difference(first: Array, second: Array) -> float:
    """Return the distance of mean configurations in pooled standard deviations within contexts.

    d = ‖m₁ − m₂‖ / s, s² = (Σ‖x − m₁‖² + Σ‖x − m₂‖²) / (n₁ + n₂ − 2),

    where m₁ and m₂ are the mean configurations of the n₁ runs of the first context and of the n₂
    runs of the second. d is a multivariate form of Cohen's d (Cohen 1988), from 0 to ∞. If the
    context has no effect, d² is about 1/n₁ + 1/n₂ on average, not 0. d is NaN if no context has two
    runs, or if s = 0.

    ``first`` and ``second`` have shape ``(runs, dof)``. Raises ValueError for other shapes.
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
    """Test that the posture difference is below a bound, by the bootstrap.

    Bootstrap samples draw runs within each context. p = (1 + samples whose posture difference is at
    least ``bound``) / (1 + resamples). Noise makes distances larger, so p tends to be too large.

    Parameters
    ----------
    first, second : array_like, shape (runs, dof)
        Configurations in the two contexts, in length units and rad.
    bound : float
        The bound, in the unit of the posture difference.
    rng : numpy.random.Generator
        Generator of the bootstrap samples.
    standardised : bool
        True if the posture difference is :func:`standardised_posture_difference` (in SDs), False if
        it is :func:`distance_of_means`. If True, a sample without spread counts as at least
        ``bound``.
    resamples : int
        Number of bootstrap samples.

    Returns
    -------
    float
        p; NaN if a context has a single run.

    Raises
    ------
    ValueError
        An array has another shape.
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
    """Test that mean configurations of two contexts differ by more than chance, by permutation.

    The statistic is :func:`distance_of_means`, and the test is one-tailed. It is exact if there are
    at most ``resamples`` ways to divide the runs.

    Parameters
    ----------
    first, second : ndarray, shape (runs, dof)
        Configurations in the two contexts, in length units and rad.
    rng : numpy.random.Generator
        Generator of the permutations.
    resamples : int
        Largest number of permutations.

    Returns
    -------
    float
        p, 0 < p ≤ 1. It is 1 if all runs are equal, and NaN if a context has a single run.

    Raises
    ------
    ValueError
        An array has another shape.
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
    """Test that a method's posture difference exceeds another method's, by permutation.

    The posture difference is the distance of the mean configurations in two contexts. The statistic
    is the difference of the two methods' posture differences. Permutations exchange the runs of
    both methods within each context.

    Parameters
    ----------
    method, other : sequence of arrays, shape (runs, dof)
        Configurations in each of the two contexts, in length units and rad.
    rng : numpy.random.Generator
        Generator of the permutations.
    resamples : int
        Number of permutations.

    Returns
    -------
    float
        p, 0 < p ≤ 1: twice the upper tail, but at most 1. NaN if a method has a single run in a
        context.

    Raises
    ------
    ValueError
        A method does not have two contexts, or an array has another shape.

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
    """Return the mean of the configurations that each row picks, and the mean of the others.

    ``rows`` are rows of indices in ``pool``. Both means have shape ``(rows, dof)``.
    """
    total, chosen = pool[rows].sum(axis=1), rows.shape[1]
    return total / chosen, (pool.sum(axis=0) - total) / (len(pool) - chosen)


def _distances(first: Array, second: Array) -> Array:
    """Return the distances of mean configurations, shape ``(rows,)``."""
    return np.asarray(np.linalg.norm(first - second, axis=1))


NEXT_APART = 0.1
"""Smallest distance between the mean next postures of two contexts at which a lean is computed.

It mixes length units and rad."""
STANDARD_ERRORS = 3
"""Smallest distance between the mean next postures, in standard errors, for a lean."""
MIN_RUNS = 5
"""Smallest number of runs in each context for the interval of a lean or posture difference."""


class Lean(NamedTuple):
    """Lean of postures at a shared goal, as shares of the path to the next posture."""

    more: Estimate
    """Lean at the goal less lean at the start, with its interval for other runs. ``n`` are the
    numbers of runs in the two contexts. Interpret this number, not the two leans."""
    at_goal: float
    """Lean of the postures at the shared goal."""
    at_start: float
    """Lean of the postures from which the movements to the shared goal start: the control."""
    apart: float
    """Distance between the mean next postures of both contexts; it mixes length units and rad."""


def lean(
    first: Numbers,
    second: Numbers,
    rng: np.random.Generator,
    *,
    toward: Numbers | None = None,
    deterministic: bool = False,
    resamples: Resamples = FEWER_RESAMPLES,
) -> Lean:
    """Return how much of the path to the next posture is covered at a shared goal.

    In two contexts A and B, the same goal (the shared goal) is followed by different goals. The
    lean is

    (p_A − p_B)·(n_A − n_B) / ‖n_A − n_B‖²,

    where p_A and p_B are the mean postures at the shared goal, and n_A and n_B the mean postures in
    which the next goal is hit. The lean is

    - 0 if the posture at the shared goal does not depend on the next goal;
    - 1 if it is already the posture for the next goal;
    - negative if it is on the side away from the posture for the next goal.

    The unit of the postures cancels out. The same projection of the start postures is the control:
    a difference that existed before the movement is not a lean.

    p and n of one run share the noise of that run, which would look like a lean. Therefore p is the
    mean of the odd runs and n the mean of the even runs, or the other way round; the lean is the
    mean of both. Noise in n_A − n_B makes a lean smaller: with four coordinates by a ninth if the
    lean is just applicable, otherwise by less.

    All numbers but ``apart`` are NaN if the lean is not applicable:

    - ‖n_A − n_B‖ is below :data:`NEXT_APART` in the given coordinates;
    - ‖n_A − n_B‖ is below three of its standard errors (the root of the summed variances of the
      means in all coordinates);
    - a context has a single run, unless ``deterministic``.

    Parameters
    ----------
    first, second : array_like, shape (runs, 3, k)
        Three postures of each run in context A and in context B: at the start of the movement to
        the shared goal, at the shared goal, and at the next goal. The k coordinates are those that
        move the hand that hits the shared goal, in length units and rad.
    rng : numpy.random.Generator
        Generator of the resamples.
    toward : array_like, shape (m, k), optional
        Values of n_A − n_B from other sources, such as other people. Their mean then replaces
        n_A − n_B, and p is the mean of all runs.
    deterministic : bool
        True if all runs of a context are equal by construction, so that one run is enough.
    resamples : int
        Number of bootstrap samples for the interval.

    Returns
    -------
    Lean
        The ends of the interval are percentiles of bootstrap samples. Runs are resampled within the
        odd and within the even runs of each context (with ``toward``, within each context).
        Deviations from the mean of m runs are multiplied by √(m / (m − 1)). There is no interval if
        a context has fewer than five runs, or if ``deterministic``.

    Raises
    ------
    ValueError
        An array has another shape, or is empty or not finite.

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
        """Return the leans at start and goal, shape (..., 2).

        ``means`` has the mean postures, shape (..., 3, k), of the parts of both contexts.
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

    Raises ValueError for another shape, and for values that are not finite.
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
    """Return the summed variance of the means of ``(n, k)`` values; 0 if n is 1."""
    if len(values) < 2:
        return 0.0
    return float(centred(values).var(axis=0, ddof=1).sum()) / len(values)


def _means_drawn(runs: Array, rng: np.random.Generator, resamples: int) -> Array:
    """Return means of runs that are drawn with replacement, shape ``(resamples, ...)``.

    ``runs`` has shape ``(m, ...)``. Deviations from the mean are multiplied by √(m / (m − 1)), so
    that the variance of the means has no bias.
    """
    mean, m = runs.mean(axis=0), len(runs)
    shares = rng.multinomial(m, np.full(m, 1 / m), size=resamples) / m
    deviations = np.tensordot(shares, runs - mean, axes=1)
    return np.asarray(mean + math.sqrt(m / max(m - 1, 1)) * deviations)


SAME = 0.01
"""Posture difference below which postures count as the same: the robot's step.

It mixes length units and rad."""


def context_pairs(tasks: Mapping[str, Task]) -> list[tuple[str, str, int]]:
    """Return the pairs of tasks that share first goals, and how many they share.

    The number n counts the shared first goals that are followed by another goal in both tasks. A
    pair is left out if n is 0, if all goals are equal, or if robot, start, radius, hands or locked
    base differ.

    Returns
    -------
    list of (str, str, int)
        Names of both tasks, and n.
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
        Hand whose arm counts.
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
    """Return the motor-equivalent part and the other part of a difference of configurations Δq.

    They are ‖Nᵀ Δq‖ / √dim N and ‖Rᵀ Δq‖ / √dim R, for an orthonormal basis N of the null space of
    the Jacobian J, and R of its row space. For a random direction the squares of both parts have
    the same expectation. A difference between contexts is motor-equivalent if the first part is
    larger than the second: the posture differs, and the hand has the same position.

    Caveat: for small differences the radius of the goal bounds the second part; nothing bounds the
    first.

    Parameters
    ----------
    difference : ndarray, shape (k,)
        Δq of the k coordinates that can move, in length units and rad.
    jacobian : ndarray, shape (2, k)
        J.

    Returns
    -------
    (float, float)
        Both parts; NaN if the space has dimension 0.

    Raises
    ------
    ValueError
        An array has another shape.

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
        Number of the goal, from 1.
    hand : {"left", "right"}
        Hand that hits the goal.
    part : {"all", "base", "joints"}
        Coordinates that are compared: all, the two of the base (length units), or the joints of
        the arm of ``hand`` (rad). The posture difference, the lean and their tests are of this
        part; :attr:`parts` is always of all. The lean of a part is along the difference of the
        next postures in the same coordinates, so the leans of base and joints do not add up to
        that of all.

    Raises
    ------
    ValueError
        The part is not one of the three.

    Examples
    --------
    >>> study = coartic.analysis.load("shipped")  # doctest: +SKIP
    >>> runs = [study.executed(task, "dual-process/EC1") for task in ("ascending", "descending")]
    ... # doctest: +SKIP
    >>> TwoContexts(*runs, 1, "right", part="joints").lean.more.value  # doctest: +SKIP
    -0.056
    """

    first: Solutions
    second: Solutions
    goal: int
    hand: Hand
    part: Part = "all"

    def __post_init__(self) -> None:
        """Check the part."""
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
        """Configurations of the compared runs at the goal, for each context.

        Each array has shape ``(runs, k)``, with the k coordinates of ``part``: all coordinates of
        the robot in length units and rad, or those of :func:`coordinates`. A run is compared if it
        hits ``goal`` with ``hand``.
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
        """Return the comparison of the same runs in another part of the posture."""
        return replace(self, part=part)

    @property
    def in_both(self) -> bool:
        """True if each context has a run that hits ``goal`` with ``hand``.

        If it is False, posture differences and p raise ValueError.
        """
        return all(map(len, self.configurations))

    @property
    def n(self) -> int:
        """Number of compared runs in the two contexts together."""
        return sum(map(len, self.configurations))

    @property
    def can_test(self) -> bool:
        """True if each context has the five compared runs that a test needs."""
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
        """The posture difference with its interval.

        The ends of the interval are percentiles of a bootstrap that resamples runs within each
        context. There is no interval if a context has fewer than five runs, or if the method is
        deterministic. Noise makes distances larger, so the interval of a small difference tends to
        be too high.
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

        The lean (:func:`.lean`) says how much of the difference between the two contexts' next
        postures is already there at the shared goal, compared with the start of the movement. The
        coordinates are those of :func:`coordinates`: of all, only those that move the hand count.
        In each context, only those compared runs count that hit the next goal with the hand that is
        used most often for it.
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
        """Posture difference in pooled SDs within contexts.

        It is NaN if the postures do not differ within either context, or if each context has a
        single run.
        """
        return standardised_posture_difference(*self.configurations)

    @cached_property
    def parts(self) -> tuple[float, float]:
        """Motor-equivalent part of the posture difference of all coordinates, and the other part.

        The first part does not move the hand. Both are per dimension (:func:`motor_equivalence`).
        """
        task, joints = self.first.task, movable(self.first.task, self.hand)
        postures = self.of_part("all").configurations
        posture = np.concatenate(postures).mean(axis=0)
        first, second = (configurations.mean(axis=0) for configurations in postures)
        jacobian = task.robot.jacobian(posture, self.hand)[:, joints]
        return motor_equivalence((first - second)[joints], jacobian)

    @cached_property
    def p(self) -> float:
        """p of the permutation test that the posture difference exceeds chance.

        The test is one-tailed (:func:`.permutation_p`). p is NaN if a context has fewer than five
        runs.
        """
        if not self.can_test:
            return math.nan
        return permutation_p(*self.configurations, self._rng("context dependence"))

    @cached_property
    def p_same(self) -> float:
        """p of the bootstrap test that the posture difference is below :data:`SAME`.

        See :func:`.posture_difference_below`. p is NaN if a context has fewer than five runs.
        """
        if not self.can_test:
            return math.nan
        rng = self._rng("sameness")
        return posture_difference_below(*self.configurations, SAME, rng, standardised=False)

    def p_beyond(self, other: TwoContexts) -> float:
        """Return p of the permutation test that the posture difference exceeds that of ``other``.

        ``other`` has the runs of another method at the same goal, compared in the same part. p is
        twice the upper tail (:func:`.beyond_p`), and NaN if a context has fewer than five runs.
        Raises ValueError if the parts differ.
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
        """Return a new random generator for a test.

        The seed depends on the test, the goal, the hand and the second task, but not on the folder
        or the method.
        """
        where = f"goal {self.goal}, {self.hand} hand, against {self.second.task.name}"
        return np.random.default_rng([SEED, zlib.crc32(f"{test} {where}".encode())])
