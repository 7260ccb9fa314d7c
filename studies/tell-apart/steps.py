"""The third contrast, steps from trial to trial: is the best trial kept?"""

from itertools import product

import numpy as np
from people import NOISE, PEOPLE, plan

from coartic.analysis.signatures.two_contexts import movable
from coartic.baselines.posture_based import TwoGoals
from coartic.method import Information, Session

BLOCK = slice(200, 600)
"""Trials that count, after as many as people need to become familiar."""


def series(task, model, seed):
    """Postures at the goals, ``(trials, G, dof)``, and rewards of a person of a task for one arm.

    The ``learner`` keeps a trial that is better than all before, and adds noise to what it keeps;
    up to there it is the paper's, number for number. The ``walk`` keeps every trial. The
    ``planner`` adds noise to its plan.
    """
    session = Session(task, 0, [Information.REWARD_BY_TRIAL, Information.CORRECTIVE_PROCESS])
    rng, best = np.random.default_rng(seed), -np.inf
    targets = np.full((1, len(task.goals), len(task.q0)), np.nan)
    if model == "planner":
        targets[0] = plan(task, TwoGoals, seed).configurations
    free, postures, rewards = movable(task, "right"), [], []
    for trial in range(BLOCK.stop):
        tried = targets.copy()
        if trial or model == "planner":
            tried[0][:, free] += NOISE * rng.standard_normal((len(task.goals), len(free)))
        done = session.trials("R" * len(task.goals), tried)
        postures.append(done.reached[0])
        rewards.append(done.rewards[0])
        is_better = model == "learner" and rewards[-1] > best
        if is_better or (model == "walk" and done.completed[0]):
            best, targets = rewards[-1], done.reached
    return np.array(postures), np.array(rewards)


def steps(task, seed):
    """Rows of a task: a model and person each.

    ``same``: share of successive steps of self-motion with the same sign. ``kept``: share of the
    deviation from the ten trials before that the next trial keeps, if it was the best so far, less
    that if it was not.
    """
    free = movable(task, "right")
    for model, person in product(("learner", "walk", "planner"), range(PEOPLE)):
        postures, rewards = series(task, model, 1000 * seed + person)
        records = np.flatnonzero(rewards[1:] > np.maximum.accumulate(rewards)[:-1]) + 1
        same, sums = [], np.zeros((2, 2))
        for g in range(len(task.goals)):
            q = postures[:, g, free]
            jacobian = task.robot.jacobian(postures[BLOCK, g].mean(axis=0), "right")
            z = q @ np.linalg.svd(jacobian[:, free])[2][2:].T  # the hand does not move
            step = np.diff(z[BLOCK], axis=0)
            same.append(np.mean(step[1:] * step[:-1] > 0))
            for t in range(11, len(z) - 1):
                off = z[t - 10 : t].mean(axis=0)
                now, then = z[t] - off, z[t + 1] - off
                sums[int(t in records)] += then @ now, now @ now
        with np.errstate(invalid="ignore"):  # none was the best so far
            others, best = sums[:, 0] / sums[:, 1]
        yield {"task": task.name, "model": model, "person": person, "same": np.mean(same),
               "kept": best - others, "records": int(np.sum(records > 10))}  # fmt: skip
