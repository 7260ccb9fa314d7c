"""The first contrast, an announced change: does the posture shift at once or by trial and error?"""

import numpy as np
from announced import changed, moves
from people import NOISE, condition, look, plan

from coartic import Movement, correct, execute, learn, learn_many, load_task, objective
from coartic.baselines.evolution import EvolutionStrategy
from coartic.baselines.posture_based import TwoGoals
from coartic.baselines.posture_qp import CurrentGoal, GoalsAhead
from coartic.baselines.receding_horizon import RecedingHorizon
from coartic.method import Information, Session

AFTER = [1, 10, 30, 100, 300, 1000, 10000]
"""Trials after the change at which the solution is looked at; the last is all of practice."""
EVOLVED = 3000
EVERY = [0.5, 4.0]
"""Distances at which all models are measured, others at all of :data:`announced.DISTANCES`; 4 is
from ``ascending`` to ``descending`` and back."""
HANDS = {"L": "left", "R": "right"}
EFFORT = {"nodes": 80, "graphs": 1, "chains": 6, "starts": 6}
PLANNERS = {
    "planner, all goals": lambda task: plan(
        task, RecedingHorizon, horizon=len(task.goals) - 1, **EFFORT
    ),
    "planner, next goal": lambda task: plan(task, TwoGoals),
    "control, next goal": lambda task: plan(task, GoalsAhead),
    "control, this goal": lambda task: plan(task, CurrentGoal),
}


def learned(task, seed, start):
    """Return :func:`look` at what the learner has learned after each of :data:`AFTER` trials from
    the first solution ``start``."""
    runs = (learn(task, condition(task), seed=seed, trials=n, start=start) for n in AFTER)
    return [look(task, run.solution) for run in runs]


def informed_next(before, task, q, hands, g, movements):
    """Return ``movements`` with the posture ``q`` at goal ``g`` (from 0) corrected for the goal
    after it, which the change from task ``before`` to ``task`` has moved. The corrective process
    finds from the posture how the robot would hit the next goal, before and after the change. Half
    of the difference is added to the posture, which the process then brings back to its goal."""

    def process(q, hand, goal):
        return correct(task.robot, q, hand, goal, locked_base=task.locked_base).q

    shift = process(q, hands[g + 1], task.goals[g + 1])
    shift -= process(q, hands[g + 1], before.goals[g + 1])
    back = process(q + shift / 2, hands[g], task.goals[g]) - process(q, hands[g], task.goals[g])
    first = next(n for n, movement in enumerate(movements) if movement.goal == g + 1)
    informed = Movement(g + 1, hands[g], "learned", q + back)
    return [*movements[:first], informed, *(m for m in movements[first:] if m.goal != g + 1)]


def evolve(cost, point, rng):
    """Run CMA-ES from a point, which the first trial tries. Returns the best points after
    :data:`AFTER` trials, with :data:`EVOLVED` in place of the last. Where it has converged it
    begins again from the best point.
    """
    size = 4 + int(3 * np.log(len(point)))
    strategy = EvolutionStrategy(point, NOISE, size, rng)
    best, trials, seen = cost(point), 1, [point]
    while trials < EVOLVED:
        if strategy.has_ended():
            strategy = EvolutionStrategy(point, NOISE, size, rng)
        points = strategy.ask()
        costs = cost.many(points)
        strategy.tell(points, costs)
        for tried, needed in zip(points, costs, strict=True):
            trials += 1
            if needed < best:
                best, point = needed, tried
            if trials in AFTER:
                seen.append(point)
    return [*seen, point]


def hit(task, cost, point):
    """Return postures and ticks as :func:`look` does, for a point of an objective (``cost``)."""
    targets = np.full((1, *cost.joints.shape), np.nan)
    targets[0][cost.joints] = point
    session = Session(task, 0, [Information.REWARD_BY_TRIAL, Information.CORRECTIVE_PROCESS])
    trial = session.trials(cost.hands, targets)
    return trial.reached[0], int(trial.ticks[0])


def change_goals(task, seed):
    """Rows of a task: a model each, for a goal before a change and a distance.

    ``dot_N``: shift of the posture at the goal after N trials, times the shift after all of them;
    ``square``: the latter squared. ``ticks_N``: of a trial then. ``same``: such a product for
    practice without a change; ``anew``: mean squared distance to two learners of the changed task,
    with ``ticks_anew``; ``among``: squared distance between the two.
    """
    cases = list(moves(task, seed))
    if task.name in ("ascending", "descending"):
        other = {"ascending": "descending", "descending": "ascending"}[task.name]
        cases.append((0, 4.0, changed(task, load_task(other).goals)))
    practised = learn(task, condition(task), seed=10 * seed).solution
    done = execute(task, practised)
    before, hands = done.configurations, [HANDS[letter] for letter in done.hands]
    more = learn(task, condition(task), seed=10 * seed + 1, start=practised).solution
    went_on, cost = look(task, more)[0], objective(task)
    point = evolve(cost.fresh(), cost.x0, np.random.default_rng(10 * seed))[-1]
    evolved = hit(task, cost, point)[0]
    used = [model for model in PLANNERS if len(task.hands) == 1 or model.startswith("planner")]
    planned = {model: PLANNERS[model](task)[0] for model in used}
    for g, distance, after in cases:

        def row(model, before, seen, g=g, distance=distance, **more):
            shifts = np.array([q[g] for q, _ in seen]) - before[g]
            return {
                "task": task.name, "distance": distance, "model": model, "cases": 1,
                "square": shifts[-1] @ shifts[-1],
                **{f"dot_{n}": shifts[k] @ shifts[-1] for k, n in enumerate(AFTER)},
                **{f"ticks_{n}": seen[k][1] for k, n in enumerate(AFTER)}, **more,
            }  # fmt: skip

        for model in used if distance in EVERY else used[:1]:
            yield row(model, planned[model], [PLANNERS[model](after)] * len(AFTER))
        seen = learned(after, 10 * seed + 1, practised)
        same = (went_on[g] - before[g]) @ (seen[-1][0][g] - before[g])
        if distance not in EVERY:
            yield row("learner", before, seen, same=same)
            continue
        runs = learn_many(after, condition(task), seeds=[10 * seed + 2, 10 * seed + 3], jobs=1)
        (one, ticks), (other, more) = (look(after, run.solution) for run in runs)
        yield row(
            "learner", before, seen, same=same, among=np.sum((one[g] - other[g]) ** 2),
            anew=np.mean([np.sum((q[g] - seen[-1][0][g]) ** 2) for q in (one, other)]),
            ticks_anew=(ticks + more) / 2,
        )  # fmt: skip
        informed = informed_next(task, after, before[g], hands, g, practised)
        yield row("learner, informed", before, learned(after, 10 * seed + 1, informed))
        cost = objective(after, cost.hands)
        best = evolve(cost, point, np.random.default_rng(10 * seed + 1))
        yield row("CMA-ES", evolved, [hit(after, cost, point) for point in best])
