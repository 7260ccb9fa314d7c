"""Run the three contrasts: models of people practise, are informed, and are measured.

    python studies/tell-apart/protocols.py results/tell-apart

writes changes.csv, starts.csv and steps.csv, in five minutes of one core.
"""

import sys
from itertools import chain, product
from pathlib import Path

import numpy as np
import pandas as pd
from announced import moves

from coartic import Movement, correct, execute, learn, learn_many, load_task, parse_task
from coartic.analysis.signatures.two_contexts import movable
from coartic.baselines.posture_based import TwoGoals
from coartic.baselines.receding_horizon import RecedingHorizon
from coartic.benchmarks.pool import process_pool
from coartic.method import Information, Session, run_method

INSTANCES = [f"{family}/v1/i{n:03d}" for n in range(30) for family in ("one-armed", "two-armed")]
TASKS = ["ascending", "descending", *INSTANCES]
"""Test instances of both families take turns; places are seeds."""
PEOPLE = 3
"""Runs of a model on a task, each with its own practice, in the second and third contrast; in the
first one stands for each task."""
NOISE = 0.05
"""SD of exploration of the learner (the paper's), and of execution in the third contrast."""


def condition(task):
    """The paper's condition that explores most of what the robot has."""
    return "EC1" if len(task.hands) == 1 else "EC4"


def plan(task, method, seed=0, **parameters):
    """Return the execution of the solution of one of the package's planners."""
    result, _ = run_method(method(method.Parameters(**parameters)), task, seed)
    return execute(task, result.solution)


# An announced change: does the posture shift at once or by trial and error?

AFTER = [1, 10, 30, 100, 300, 1000, 10000]
"""Trials after the change at which the solution is looked at; the last is all of practice."""
EFFORT = {"nodes": 80, "graphs": 1, "chains": 6, "starts": 6}
PLANNERS = {
    "planner, all goals": lambda task: plan(
        task, RecedingHorizon, horizon=len(task.goals) - 1, **EFFORT
    ),
    "planner, next goal": lambda task: plan(task, TwoGoals),
}
"""The first is measured at all distances, the second at half a link alone."""


def learned(task, seed, start):
    """Return executions of what the learner has learned after each of :data:`AFTER` trials from the
    first solution ``start``."""
    runs = (learn(task, condition(task), seed=seed, trials=n, start=start) for n in AFTER)
    return [run.execute() for run in runs]


def informed_next(before, task, done, g, movements):
    """Return ``movements`` (``done``: their execution before the change), with the posture
    at goal ``g`` (from 0) corrected for the goal after it, which the change from task ``before`` to
    ``task`` has moved. The corrective process finds from the posture how the robot would hit the
    next goal, before and after the change. Half of the difference is added to the posture, which
    the process then brings back to its goal."""
    q, hands = done.configurations[g], {movement.goal: movement.hand for movement in movements}
    hand, following = hands[g + 1], hands[g + 2]

    def process(q, hand, goal):
        return correct(task.robot, q, hand, goal, locked_base=task.locked_base).q

    shift = process(q, following, task.goals[g + 1]) - process(q, following, before.goals[g + 1])
    back = process(q + shift / 2, hand, task.goals[g]) - process(q, hand, task.goals[g])
    informed = Movement(g + 1, hand, "learned", q + back)
    later = [movement for movement in movements if movement.goal > g + 1]
    return [*(movement for movement in movements if movement.goal <= g), informed, *later]


def change_goals(task, seed):
    """Rows of a task: a model each, for a goal before a change and a distance.

    ``dot_N``: shift of the posture at the goal after N trials, times the shift after all of them;
    ``square``: the latter squared. ``ticks_N``: of a trial then. ``same``: such a product for
    practice without a change; ``anew``: mean squared distance to two learners of the changed task,
    with ``ticks_anew``; ``among``: squared distance between the two.
    """
    practised = learn(task, condition(task), seed=10 * seed).solution
    done = execute(task, practised)
    went_on = learn(task, condition(task), seed=10 * seed + 1, start=practised).execute()
    planned = {model: planner(task) for model, planner in PLANNERS.items()}
    for g, distance, after in moves(task, seed):

        def row(model, before, seen, g=g, distance=distance, **more):
            shifts = np.array([each.configurations[g] for each in seen]) - before.configurations[g]
            return {
                "task": task.name, "distance": distance, "model": model, "cases": 1,
                "square": shifts[-1] @ shifts[-1],
                **{f"dot_{n}": shifts[k] @ shifts[-1] for k, n in enumerate(AFTER)},
                **{f"ticks_{n}": seen[k].ticks for k, n in enumerate(AFTER)}, **more,
            }  # fmt: skip

        for model in PLANNERS if distance == 0.5 else [*PLANNERS][:1]:
            yield row(model, planned[model], [PLANNERS[model](after)] * len(AFTER))
        seen = learned(after, 10 * seed + 1, practised)
        before, ended = done.configurations[g], seen[-1].configurations[g]
        same = (went_on.configurations[g] - before) @ (ended - before)
        if distance != 0.5:
            yield row("learner", done, seen, same=same)
            continue
        seeds = [10 * seed + 2, 10 * seed + 3]
        runs = learn_many(after, condition(task), seeds=seeds, jobs=1)
        anew = [run.execute() for run in runs]
        one, other = (each.configurations[g] for each in anew)
        yield row(
            "learner", done, seen, same=same, among=np.sum((one - other) ** 2),
            anew=np.mean([np.sum((q - ended) ** 2) for q in (one, other)]),
            ticks_anew=np.mean([each.ticks for each in anew]),
        )  # fmt: skip
        informed = informed_next(task, after, done, g, practised)
        yield row("learner, informed", done, learned(after, 10 * seed + 1, informed))


# Practice from another start: do learners keep apart?


def start_elsewhere(task, seed):
    """Rows of a task, practised from start A or B and tested from C, half-way between.

    ``between``: mean squared distance of postures at the goals of runs from A and from B;
    ``within``: of runs from the same start. ``trials`` were made from C.
    """
    rng, far = np.random.default_rng([69, seed]), np.zeros(len(task.q0))
    for hand in task.hands:
        far[task.robot.joints(hand)] = rng.uniform(-1, 1, len(task.robot.right_links))
    content = task.model_dump(exclude={"start"}) | {"name": "start"}
    a, b, c = (parse_task(content | {"q0": task.q0 + k * far}, "start") for k in (0, 1, 0.5))
    seeds = [1000 * seed + n for n in range(2 * PEOPLE)]
    runs = [run for start, some in ((a, seeds[:PEOPLE]), (b, seeds[PEOPLE:]))
            for run in learn_many(start, condition(task), seeds=some, jobs=1)]  # fmt: skip
    tested = [execute(c, run.solution) for run in runs]
    went_on = [learn(c, condition(task), seed=s + 500, start=run.solution).execute()
               for s, run in zip(seeds, runs, strict=True)]  # fmt: skip
    planned = [plan(c, TwoGoals, s) for s in seeds]
    for model, trials, people in (
        ("learner", 1, tested), ("learner", 10_000, went_on), ("planner", 1, planned)
    ):  # fmt: skip
        q = np.array([person.configurations for person in people]).reshape(2 * PEOPLE, -1)
        apart = ((q[:, None] - q) ** 2).sum(axis=2)
        same = np.kron(np.eye(2), np.ones((PEOPLE, PEOPLE))).astype(bool)
        within = apart[same].sum() / (2 * PEOPLE * (PEOPLE - 1))
        yield {"task": task.name, "model": model, "trials": trials,
               "between": apart[~same].mean(), "within": within}  # fmt: skip


# Steps from trial to trial: is the best trial kept?

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


def contrasts_on(seed):
    """Return the rows of the three contrasts on a task, by its place in :data:`TASKS`: the first is
    on all tasks, the others are on some random tasks."""
    task = load_task(TASKS[seed])
    starts = start_elsewhere(task, seed) if 2 <= seed < 22 else []
    moved = steps(task, seed) if len(task.hands) == 1 and seed < 18 else []
    return [*change_goals(task, seed)], [*starts], [*moved]


def main(folder):
    """Run the contrasts on all tasks."""
    with process_pool(1) as pool:
        of_tasks = zip(*pool.map(contrasts_on, range(len(TASKS))), strict=True)
    changes, starts, moved = map(chain.from_iterable, of_tasks)
    sums = pd.DataFrame(changes).groupby(["task", "distance", "model"], sort=False)
    tables = {
        "changes": sums.sum(min_count=1).reset_index(),
        "starts": pd.DataFrame(starts),
        "steps": pd.DataFrame(moved),
    }
    Path(folder).mkdir(parents=True, exist_ok=True)
    for kind, table in tables.items():
        table.to_csv(Path(folder) / f"{kind}.csv", float_format="%.5g", index=False)


if __name__ == "__main__":
    main(sys.argv[1] if sys.argv[1:] else "results/tell-apart")
