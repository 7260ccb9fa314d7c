"""Find what a model aims at before each hit, given earlier trials, and where the movement lands.

Rewards and postures determine the learner's tables Q and q*, hence the hand of highest value and
the target t + κ N(t) (p − t), which lands in a posture L(κ): the package's kernel finds it, because
a movement ends early, where the goal is hit.
"""

from typing import NamedTuple

import numpy as np
import pandas as pd

from coartic import CONDITIONS, execute
from coartic.analysis.signatures.two_contexts import movable
from coartic.baselines.posture_based import TwoGoals
from coartic.method import run_method
from coartic.motion.trial import reach_goals

HANDS = ("left", "right")
"""Hands in the order in which arrays count them."""
_PLANS = {}


class Trials(NamedTuple):
    """Trials of a subject, from the first to the last number; G goals."""

    hands: np.ndarray
    """Hands as places in HANDS, shape ``(T, G)``; -1 for a hit that is missing."""
    postures: np.ndarray
    """Shape ``(T, G, dof)``; NaN for a hit that is missing."""
    rewards: np.ndarray
    """Minus the ticks, shape ``(T,)``; NaN where a hit of the trial is missing."""


def trials_of(frame, task):
    """Return the trials of one subject from rows of :func:`coartic.analysis.read_hits`."""
    shape = int(frame.trial.max()), len(task.goals)
    hands, ticks = np.full(shape, -1), np.full(shape, np.nan)
    postures = np.full((*shape, task.robot.dof), np.nan)
    at = frame.trial.to_numpy(int) - 1, frame.goal.to_numpy(int) - 1
    hands[at], ticks[at] = frame.hand.map(HANDS.index), frame.ticks
    postures[at] = frame[[*task.robot.joint_names]]
    return Trials(hands, postures, -ticks.sum(axis=1))


def condition_for(task):
    """Return the paper's condition that explores most: EC1 with one hand, EC4 with two."""
    return CONDITIONS["EC1" if len(task.hands) == 1 else "EC4"]


def explored_by(task, condition):
    """Return the joints that the condition explores, bool, shape ``(2, dof)``, by chosen hand."""
    masks = np.zeros((2, task.robot.dof), bool)
    for chosen, hand in enumerate(HANDS):
        masks[chosen, movable(task, hand)] = condition.modify_chosen
        masks[chosen, task.robot.joints(HANDS[1 - chosen])] = condition.modify_other
    return masks


def plan_for(task):
    """Return hands (places in HANDS) and postures ``(G, dof)`` at the goals of a planner, which
    sees the current goal and the next; made once for each task."""
    if (key := task.model_dump_json()) not in _PLANS:
        done = execute(task, run_method(TwoGoals(), task)[0].solution)
        hands = np.array(["LR".index(letter) for letter in done.hands])
        _PLANS[key] = hands, done.configurations
    return _PLANS[key]


def projection(jacobian, explored):
    """Return the projection N = I − J⁺J over the explored joints, shape ``(..., dof, dof)``."""
    among = np.where(explored[..., None, :], jacobian, 0.0)
    gram = np.linalg.pinv(among @ among.mT, rcond=1e-12, hermitian=True)
    return np.eye(explored.shape[-1]) * explored[..., None, :] - among.mT @ gram @ among


def tables_before(task, condition, trials, rule):
    """Return what the tables hold before each hit after the first complete trial, a frame.

    ``trial`` and ``goal`` count from 0. ``hand`` was used and ``greedy`` has the highest value;
    ``stored`` is the trial of the stored posture, -1 for none, and ``following`` of the stored
    posture of the next goal, for the ``follower``, the hand that is best there. A complete trial
    replaces an entry if it is better (``rule`` "best"), always ("walk"), or if the entry is empty
    ("memoryless").
    """
    goals = len(task.goals)
    allowed = [HANDS.index(hand) for hand in HANDS if hand in condition.hands]
    value, source, rows = np.full((goals, 3, 2), -np.inf), np.full((goals, 3, 2), -1), []
    for trial, hands in enumerate(trials.hands.tolist()):
        states = [*zip(range(goals), [2, *hands], hands, strict=False)]
        for goal, before, hand in states if source.max() >= 0 else []:
            if min(before, hand) >= 0:
                greedy = max(allowed, key=lambda each, at=(goal, before): value[at][each])
                after = (min(goal + 1, goals - 1), hand)
                follower = max(allowed, key=lambda each, at=after: value[at][each])
                following = source[after][follower] if goal + 1 < goals else -1
                stored = source[goal, before, hand]
                rows.append((trial, goal, hand, greedy, stored, follower, following))
        for entry in states if np.isfinite(trials.rewards[trial]) else []:
            is_empty, is_better = source[entry] < 0, trials.rewards[trial] > value[entry]
            if is_empty or (rule == "best" and is_better) or rule == "walk":
                value[entry], source[entry] = trials.rewards[trial], trial
    columns = ["trial", "goal", "hand", "greedy", "stored", "follower", "following"]
    return pd.DataFrame(rows, columns=columns)


def landings(task, condition, trials, rows, kappas, plan, simulated):
    """Return residuals at drifts ``(K, m, dof)``, their dimensions ``(m,)`` and the shares of the
    movements that were made ``(K, m)``, for hits whose tables are in ``rows``.

    ``simulated``: noise, drift and a number N, to simulate these hits N times in place of the
    recorded ones, for residuals of shape ``(N, K, m, dof)``; None for the recorded ones.
    """
    robot, explored = task.robot, explored_by(task, condition)
    trial, goal, hand = (rows[name].to_numpy() for name in ("trial", "goal", "hand"))
    y, q = trials.postures[trial, goal], starts(task, trials, rows)
    t = trials.postures[rows.stored, goal]
    if plan:
        t = np.where((plan[0][goal] == hand)[:, None], plan[1][goal], t)

    def null_space(at):
        """Return projections onto the null space of the hand, over the explored joints."""
        each = np.stack([robot.jacobian(at, name) for name in HANDS], axis=1)
        return projection(each[np.arange(len(at)), hand], explored[hand])

    d = np.zeros_like(t)
    if any(kappas):
        following = rows.following.to_numpy()
        towards = (q + trials.postures[following, np.minimum(goal + 1, len(task.goals) - 1)]) / 2
        moves = explored[rows.follower] & (following >= 0)[:, None]
        d = (null_space(t) @ (np.where(moves, towards, q) - t)[..., None])[..., 0]

    def land(target):
        return reach_goals(robot, q, hand, task.goal_array[goal], task.radius, target,
                           locked_base=task.locked_base)  # fmt: skip

    nearest = t if condition.modify_other else np.where(explored[hand], t, q)
    if simulated:
        sigma, kappa, count = simulated
        noise = np.random.default_rng(0).standard_normal((count, *t.shape))
        y = np.array(
            [land(nearest + kappa * d + sigma * explored[hand] * each).q for each in noise]
        )
    each = []
    for kappa in kappas:
        mean = nearest + kappa * d
        landed, way = land(mean), mean - q
        share = ((landed.q - q) * way).sum(axis=1) / np.maximum((way**2).sum(axis=1), 1e-12)
        share = np.where(landed.corrections > 0, 1.0, np.clip(share, 0.05, 1.0))
        free = null_space(landed.q)
        each.append(((free @ (y - landed.q)[..., None])[..., 0], share))
    residuals, shares = map(np.array, zip(*each, strict=True))
    if simulated:
        residuals = np.moveaxis(residuals, 1, 0)
    return residuals, np.trace(free, axis1=1, axis2=2).round(), shares


def starts(task, trials, rows):
    """Return the postures in which the movements of ``rows`` (of :func:`tables_before`) began,
    shape ``(m, dof)``."""
    before = trials.postures[rows.trial, np.maximum(rows.goal - 1, 0)]
    return np.where(rows.goal.to_numpy()[:, None] > 0, before, task.q0)
