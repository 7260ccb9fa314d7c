"""People of four other models, on whom the absolute check is tried.

Each learns as *keep the best* does, but for one thing: tables move half the way to each better
trial (``averages``), forget trials before the last ten (``recent``), keep the best posture of each
goal by its own ticks (``by goal``), or noise falls to a tenth in the end (``decays``).
"""

import numpy as np
import pandas as pd
from models import HANDS, condition_for, explored_by

from coartic import initial_hands
from coartic.motion.trial import reach_goals

FOREIGN = ("averages", "recent", "by goal", "decays")


def simulate_foreign(task, model, sigma, epsilon, *, seed, trials):
    """Return the hits of a person, a frame as :func:`coartic.analysis.read_hits` returns."""
    condition, rng, robot = condition_for(task), np.random.default_rng(seed), task.robot
    allowed = [HANDS.index(hand) for hand in HANDS if hand in condition.hands]
    first = ["LR".index(letter) for letter in initial_hands(task, condition.hands)]
    masks, past, rows = explored_by(task, condition), {}, []
    for trial in range(trials):
        q, before, visits = np.array(task.q0), 2, []
        now = sigma * 0.1 ** (trial / max(trials - 1, 1)) if model == "decays" else sigma
        for goal, place in enumerate(task.goal_array):
            found = {hand: recall(past.get((goal, before, hand), []), model, trial)
                     for hand in allowed}  # fmt: skip
            hand = max(allowed, key=lambda each: found[each][0])
            if trial == 0:
                hand = first[goal]
            elif len(allowed) > 1 and rng.random() < epsilon:
                hand = allowed[int(rng.random() * len(allowed))]
            target = np.full(robot.dof, np.nan)
            if found[hand][1] is not None:
                target = np.array(found[hand][1])
                target[masks[hand]] += now * rng.standard_normal(int(masks[hand].sum()))
            reached = reach_goals(robot, q[None], np.array([hand]), place[None], task.radius,
                                  target[None], locked_base=task.locked_base)  # fmt: skip
            if not reached.hit[0]:
                break
            visits.append((before, hand, int(reached.ticks[0]), reached.q[0]))
            q, before = reached.q[0], hand
        if len(visits) < len(task.goals):
            continue
        total = -sum(ticks for _, _, ticks, _ in visits)
        for goal, (state, hand, ticks, posture) in enumerate(visits):
            rows.append([0, trial + 1, goal + 1, HANDS[hand], ticks, *posture])
            worth = -ticks if model == "by goal" else total
            past.setdefault((goal, state, hand), []).append((trial, worth, posture))
    columns = ["subject", "trial", "goal", "hand", "ticks", *robot.joint_names]
    return pd.DataFrame(rows, columns=columns)


def recall(visits, model, trial):
    """Return value and posture that a model keeps of visits (trial, value, posture)."""
    if model == "recent":
        visits = [visit for visit in visits if trial - visit[0] <= 10] or visits[-1:]
    value, kept = -np.inf, None
    for _, worth, posture in visits:
        if worth > value:
            mean = model == "averages" and kept is not None
            value, kept = worth, (kept + posture) / 2 if mean else posture
    return value, kept
