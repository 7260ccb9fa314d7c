"""The first contrast, an announced change: does the posture shift at once or by trial and error?"""

import numpy as np
from announced import moves
from people import condition, plan

from coartic import Movement, correct, execute, learn, learn_many
from coartic.baselines.posture_based import TwoGoals
from coartic.baselines.receding_horizon import RecedingHorizon

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
