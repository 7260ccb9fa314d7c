"""People who practise a task by one of six models, or by one of four others, simulated.

The others, on whom the absolute check is tried, learn as *keep the best* does, except that tables
move half the way to each better trial (``averages``), forget trials before the last ten
(``recent``), keep the best posture of each goal by its own ticks (``by goal``), or that noise falls
to a tenth in the end (``decays``).
"""

import numpy as np
import pandas as pd
from evidence import DRIFTS
from models import HANDS, condition_for, explored_by, plan_for, projection

from coartic import CoarticError, initial_hands
from coartic.motion.trial import reach_goals

FOREIGN = ("averages", "recent", "by goal", "decays")
FIRST = ("memoryless", "planner")
"""Models that keep the first posture."""
RECENT = 10
"""Trials that ``recent`` remembers."""


def simulate(task, model, sigma, epsilon, kappa=0.0, *, seeds, trials, condition=None, first=None):
    """Return the hits of simulated people, one for each seed, as
    :func:`coartic.analysis.read_hits` does.

    Parameters
    ----------
    model : str
        One of :data:`fit.MODELS` or :data:`FOREIGN`.
    sigma, epsilon, kappa : float or array_like, shape (people,)
        SD of exploration (length unit and rad), exploration rate of hands, drift.
    first : tuple of ndarray, optional
        Hands and postures that all but planners aim at in trial 1; by default they have the task's
        initial hands and correct.
    """
    if len(np.unique(seeds, axis=0)) < len(seeds):
        raise CoarticError(f"seeds are {[*seeds]}: one is there twice, and would be one person")
    condition = condition or condition_for(task)
    people, goals, dof, robot = len(seeds), len(task.goals), task.robot.dof, task.robot
    sigma, epsilon, kappa = (np.broadcast_to(each, people) for each in (sigma, epsilon, kappa))
    rngs = [np.random.default_rng(seed) for seed in seeds]
    allowed = [HANDS.index(hand) for hand in HANDS if hand in condition.hands]
    begun = ["LR".index(letter) for letter in initial_hands(task, condition.hands)]
    begun = begun if first is None else first[0]
    masks = explored_by(task, condition)
    value = np.full((people, goals, 3, 2), -np.inf)
    stored = np.full((people, goals, 3, 2, dof), np.nan)
    plan = plan_for(task) if model == "planner" else None
    rows, past = [], {}
    for trial in range(trials):
        for entry, kept in past.items():
            last = [visit for visit in kept if trial - visit[0] <= RECENT] or kept[-1:]
            _, value[entry], stored[entry] = max(last, key=lambda visit: visit[1])
        q, before = np.tile(task.q0, (people, 1)), np.full(people, 2)
        going, total = np.ones(people, bool), np.zeros(people, int)
        drift = np.array(kappa, dtype=float)
        if model == "drawn" and trial:
            drift = np.array([DRIFTS[int(rng.random() * len(DRIFTS))] for rng in rngs])
        visits = []
        for goal in range(goals):
            hands, targets = np.zeros(people, int), np.full((people, dof), np.nan)
            ways, noises, explores = *np.zeros((2, people, dof)), np.zeros(people, bool)
            for n, rng in enumerate(rngs):
                entries, where = value[n, goal, before[n]], stored[n, goal, before[n]]
                hand = max(allowed, key=lambda each: entries[each])  # of equal ones the first
                if plan:
                    hand = plan[0][goal]
                if trial == 0 and not plan:
                    hand = begun[goal]
                elif len(allowed) > 1 and rng.random() < epsilon[n]:
                    hand = explored_hand(task, condition, q[n], goal, allowed, rng)
                hands[n] = hand
                target = where[hand]
                if trial == 0 and first is not None and not plan:
                    targets[n] = first[1][goal]
                if plan and hand == plan[0][goal]:
                    target = plan[1][goal]
                if np.isfinite(target[0]) and (trial or plan):
                    p = q[n]
                    if goal + 1 < goals and np.isfinite(value[n, goal + 1, hand]).any():
                        following = value[n, goal + 1, hand]
                        best = max(allowed, key=lambda each: following[each])
                        middle = (q[n] + stored[n, goal + 1, hand, best]) / 2
                        p = np.where(masks[best], middle, p)
                    targets[n], ways[n], explores[n] = target, p - target, True
                    noises[n, masks[hand]] = rng.standard_normal(int(masks[hand].sum()))
            fading = 0.1 ** (trial / max(trials - 1, 1)) if model == "decays" else 1.0
            moves = (sigma * fading)[:, None] * noises
            if drift.any() and explores.any():
                each = [robot.jacobian(targets[explores], hand) for hand in HANDS]
                own = np.where((hands[explores] == 0)[:, None, None], *each)
                pull = projection(own, masks[hands[explores]]) @ ways[explores, :, None]
                moves[explores] += drift[explores, None] * pull[..., 0]
            targets[explores] += moves[explores]
            for n in np.flatnonzero(explores) if not condition.modify_other else []:
                idle = robot.joints(HANDS[1 - hands[n]])
                targets[n, idle] = q[n, idle]
            reached = reach_goals(robot, q, hands, task.goal_array[[goal] * people], task.radius,
                                  targets, locked_base=task.locked_base)  # fmt: skip
            going &= reached.hit
            total += reached.ticks
            visits.append((before, hands, reached.ticks, reached.q))
            for n in np.flatnonzero(going):
                rows.append([n, trial + 1, goal + 1, HANDS[hands[n]], reached.ticks[n],
                             *reached.q[n]])  # fmt: skip
            q, before = reached.q, hands
        for goal, (state, hands, ticks, postures) in enumerate(visits):
            for n in np.flatnonzero(going):
                entry, posture = (n, goal, state[n], hands[n]), postures[n]
                reward = -(ticks if model == "by goal" else total)[n]
                is_empty, is_better = np.isneginf(value[entry]), reward > value[entry]
                if model == "recent":
                    past.setdefault(entry, []).append((trial, reward, posture))
                elif model == "walk" or is_empty or (is_better and model not in FIRST):
                    if model == "averages" and not is_empty:
                        posture = (stored[entry] + posture) / 2
                    value[entry], stored[entry] = reward, posture
    columns = ["subject", "trial", "goal", "hand", "ticks", *robot.joint_names]
    frame = pd.DataFrame(rows, columns=columns)
    return frame.sort_values(["subject", "trial", "goal"], ignore_index=True)


def explored_hand(task, condition, q, goal, allowed, rng):
    """Return the hand of an exploration, a place in HANDS: random out of ``allowed`` (places in
    HANDS), or the hand closest to the goal (from 0)."""
    if condition.hand_exploration == "closest":
        far = [np.linalg.norm(task.robot.forward_kinematics(q, hand) - task.goals[goal])
               for hand in HANDS]  # fmt: skip
        if abs(far[0] - far[1]) > 1e-9:
            return int(np.argmin(far))
    return allowed[int(rng.random() * len(allowed))]
