"""Simulate people who practise a task by one of six models, and recover what simulated them.

    python studies/fit/protocols.py results/fit

writes ``recovery.csv``, a row for each simulated person. A cell is done at a time; what is done is
not done again. It takes about an hour of one core.

Aims, set before the runs: with 100 complete trials on one of the tasks, r ≥ 0.95 of σ, ε and κ, and
the right model of six in 95 % of the people. Expected to fail: 30 trials; and ascending and
descending, where a learner often finds nothing better than its first trial and looks as if it had
no memory.
"""

import os
import sys
import zlib
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from pathlib import Path

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # a process for each core

import numpy as np
import pandas as pd
from evidence import DRIFTS
from fit import MODELS, fit_subject
from models import HANDS, condition_for, explored_by, plan_for, projection, trials_of

from coartic import initial_hands, load_task
from coartic.motion.trial import reach_goals


def simulate(task, model, sigma, epsilon, kappa=0.0, *, seeds, trials, condition=None, plan=None):
    """Return the hits of N simulated people, as :func:`coartic.analysis.read_hits` does.

    Parameters
    ----------
    task : Task
        The task.
    model : str
        One of :data:`fit.MODELS`.
    sigma, epsilon, kappa : float or array_like, shape (N,)
        SD of exploration (length unit and rad), exploration rate of hands, drift.
    seeds : sequence of int
        A seed for each person.
    trials : int
        Number of trials of a person.
    condition : ExplorationCondition, optional
        The condition: its hands and its explored joints.
    plan : tuple of ndarray, optional
        Hands and postures of the planner; by default those of :func:`models.plan_for`.

    Returns
    -------
    DataFrame
        A row for each hit.
    """
    condition = condition or condition_for(task)
    people, goals, dof, robot = len(seeds), len(task.goals), task.robot.dof, task.robot
    sigma, epsilon, kappa = (np.broadcast_to(each, people) for each in (sigma, epsilon, kappa))
    rngs = [np.random.default_rng(seed) for seed in seeds]
    allowed = [HANDS.index(hand) for hand in HANDS if hand in condition.hands]
    first = ["LR".index(letter) for letter in initial_hands(task, condition.hands)]
    masks = explored_by(task, condition)
    value = np.full((people, goals, 3, 2), -np.inf)
    stored = np.full((people, goals, 3, 2, dof), np.nan)
    plan = (plan or plan_for(task)) if model == "planner" else None
    rows = []
    for trial in range(trials):
        q, before = np.tile(task.q0, (people, 1)), np.full(people, 2)
        going, total = np.ones(people, bool), np.zeros(people, int)
        drift = np.array(kappa, dtype=float)
        if model == "drawn" and trial:
            drift = np.array([DRIFTS[int(rng.random() * len(DRIFTS))] for rng in rngs])
        visits = []
        for goal in range(goals):
            hands, targets = np.zeros(people, int), np.full((people, dof), np.nan)
            for n, rng in enumerate(rngs):
                entries, where = value[n, goal, before[n]], stored[n, goal, before[n]]
                hand = max(allowed, key=lambda each: entries[each])  # of equal ones the first
                if plan:
                    hand = plan[0][goal]
                if trial == 0 and not plan:
                    hand = first[goal]
                elif len(allowed) > 1 and rng.random() < epsilon[n]:
                    hand = explored_hand(task, condition, q[n], goal, allowed, rng)
                hands[n] = hand
                target = where[hand]
                if plan and hand == plan[0][goal]:
                    target = plan[1][goal]
                if np.isfinite(target[0]) and (trial or plan):
                    explored = masks[hand]
                    mean, idle = np.array(target), robot.joints(HANDS[1 - hand])
                    if not condition.modify_other:
                        mean[idle] = q[n][idle]
                    if drift[n]:
                        p = np.array(q[n])
                        if goal + 1 < goals and np.isfinite(value[n, goal + 1, hand]).any():
                            following = value[n, goal + 1, hand]
                            best = max(allowed, key=lambda each: following[each])
                            middle = (q[n] + stored[n, goal + 1, hand, best]) / 2
                            p = np.where(masks[best], middle, p)
                        jacobian = robot.jacobian(target, HANDS[hand])
                        mean += drift[n] * projection(jacobian, explored) @ (p - target)
                    mean[explored] += sigma[n] * rng.standard_normal(int(explored.sum()))
                    targets[n] = mean
            reached = reach_goals(robot, q, hands, task.goal_array[[goal] * people], task.radius,
                                  targets, locked_base=task.locked_base)  # fmt: skip
            going &= reached.hit
            total += reached.ticks
            visits.append((before, hands, reached.q))
            for n in np.flatnonzero(going):
                rows.append([n, trial + 1, goal + 1, HANDS[hands[n]], reached.ticks[n],
                             *reached.q[n]])  # fmt: skip
            q, before = reached.q, hands
        for goal, (state, hands, postures) in enumerate(visits):
            for n in np.flatnonzero(going):
                entry = n, goal, state[n], hands[n]
                better = -total[n] > value[entry]
                if better or model == "walk":
                    if model in ("memoryless", "planner") and np.isfinite(value[entry]):
                        continue
                    value[entry], stored[entry] = -total[n], postures[n]
    columns = ["subject", "trial", "goal", "hand", "ticks", *robot.joint_names]
    frame = pd.DataFrame(rows, columns=columns)
    return frame.sort_values(["subject", "trial", "goal"], ignore_index=True)


def explored_hand(task, condition, q, goal, allowed, rng):
    """Return the hand of an exploration: random, or the hand closest to the goal."""
    if condition.hand_exploration == "closest":
        far = [np.linalg.norm(task.robot.forward_kinematics(q, hand) - task.goals[goal])
               for hand in HANDS]  # fmt: skip
        if abs(far[0] - far[1]) > 1e-9:
            return int(np.argmin(far))
    return allowed[int(rng.random() * len(allowed))]


TASKS = ("ascending", "descending", "two-armed-1", "two-armed-2")
FAMILIES = ("one-armed", "two-armed", "aligned", "redundancy", "long")
INSTANCES = [f"{family}/v1/i{number:03d}" for number in range(4) for family in FAMILIES]
DATA = {
    "complete": (0.0, 0.0, 0.0), "lossy": (0.0, 0.1, 0.0), "noisy": (0.02, 0.0, 0.02),
    "ignored": (0.02, 0.0, 0.0),
}  # fmt: skip
"""SD of motor noise in recorded postures (length unit and rad), share of trials that are lost, and
the SD that the fit is given."""
PLAN = (
    (TASKS, "complete", 100, 6), (TASKS, "complete", 30, 3), (TASKS, "lossy", 100, 2),
    (TASKS, "ignored", 100, 1), (TASKS, "noisy", 100, 1), (TASKS, "complete", 300, 1),
    (INSTANCES, "complete", 100, 1), (TASKS, "lossy", 100, 4), (TASKS, "complete", 30, 6),
    (TASKS, "complete", 300, 3), (TASKS, "ignored", 100, 3), (TASKS, "noisy", 100, 3),
    (INSTANCES, "complete", 30, 1), (TASKS, "complete", 100, 12), (INSTANCES, "lossy", 100, 1),
    (TASKS, "lossy", 30, 4), (TASKS, "noisy", 30, 4), (TASKS, "lossy", 300, 3),
    (INSTANCES, "complete", 300, 1), (TASKS, "complete", 300, 6), (TASKS, "complete", 30, 12),
    (TASKS, "noisy", 300, 1), (INSTANCES, "noisy", 100, 1),
)  # fmt: skip
"""Tasks, data, trials and repeats, those first that matter most."""
PEOPLE = (*MODELS, "informed")
"""Models of the people of a repeat."""


def cells():
    """Return cells: a task, a number of trials, data and the number of a repeat."""
    every = ((task, trials, data, repeat) for tasks, data, trials, repeats in PLAN
             for repeat in range(repeats) for task in tasks)  # fmt: skip
    return [*dict.fromkeys(every)]


@cache
def plan_of(name):
    """Return :func:`models.plan_for` of a task by its name."""
    return plan_for(load_task(name))


def recover(cell):
    """Simulate people of every model, and fit them; a row for each."""
    name, trials, data, _ = cell
    task, rows, (noise, lost, given) = load_task(name), [], DATA[data]
    plan, seed = plan_of(name), zlib.crc32(repr(cell).encode())
    for person, model in enumerate(PEOPLE):
        rng = np.random.default_rng([seed, person])
        sigma, epsilon = (
            np.exp(rng.uniform(np.log(0.01), np.log(0.1))),
            rng.uniform(0.05, 0.5),
        )
        kappa = rng.uniform(0.0, 1.0) if model == "informed" else 0.0
        frame = simulate(task, model, sigma, epsilon, kappa, seeds=[[seed, person, 1]],
                         trials=trials, plan=plan)  # fmt: skip
        joints = [*task.robot.joint_names]
        frame[joints] += noise * rng.standard_normal((len(frame), len(joints)))
        kept = rng.random(trials) >= lost
        there = trials_of(frame[kept[frame.trial - 1]], task)
        truth = {"true_sigma": sigma, "true_epsilon": epsilon, "true_kappa": kappa}
        row = dict(zip(("task", "trials", "data", "repeat", "person", "true"),
                       (*cell, person, model), strict=True))  # fmt: skip
        try:
            estimates = fit_subject(task, condition_for(task), there, noise=given, plan=plan,
                                intervals=model in ("best", "informed"))  # fmt: skip
        except np.linalg.LinAlgError:
            estimates = {}
        rows.append(row | truth | estimates)
    return pd.DataFrame(rows).reindex(columns=COLUMNS)


COLUMNS = [
    "task", "trials", "data", "repeat", "person", "true", "true_sigma", "true_epsilon",
    "true_kappa",
    *(f"{name}{end}" for name in ("sigma", "epsilon", "kappa") for end in ("", "_low", "_high")),
    *(f"bic_{model}" for model in MODELS),
]  # fmt: skip


def main(folder):
    """Recover all cells that the folder does not have."""
    path = Path(folder) / "recovery.csv"
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.exists():
        path.write_text(",".join(COLUMNS) + "\n", encoding="utf-8")
    done = {*pd.read_csv(path)[COLUMNS[:4]].itertuples(index=False, name=None)}
    left = [cell for cell in cells() if cell not in done]
    with ProcessPoolExecutor(2) as pool:
        for rows in pool.map(recover, left):
            with path.open("a", encoding="utf-8", newline="") as file:
                rows.to_csv(file, header=False, index=False, float_format="%.6g")


if __name__ == "__main__":
    main(sys.argv[1] if sys.argv[1:] else "results/fit")
