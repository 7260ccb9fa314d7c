"""The protocols of the study: models of people practise, are informed, and are measured.

    python studies/tell-apart/protocols.py [SPLIT] [FOLDER]

writes changes.csv, starts.csv and steps.csv into the folder, by default this one, in five
minutes of one core. Split ``d`` runs a few development instances in place of the test instances.
"""

import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd

from coartic import (
    CoarticError,
    MethodError,
    Movement,
    correct,
    execute,
    learn,
    learn_many,
    load_task,
    objective,
    parse_task,
)
from coartic.baselines.evolution import EvolutionStrategy
from coartic.baselines.posture_based import TwoGoals
from coartic.baselines.posture_qp import CurrentGoal, GoalsAhead
from coartic.baselines.receding_horizon import RecedingHorizon
from coartic.method import Information, Session, run_method

HERE = Path(__file__).parent
PEOPLE = 3
"""Runs of a model on a task, each with its own practice, in the second and third contrast; in the
first one stands for each task."""
AFTER = [1, 10, 30, 100, 300, 1000, 10000]
"""Trials after the change at which the solution is looked at; the last is all of practice."""
EVOLVED = 3000
DISTANCES, EVERY = [0.25, 0.5, 1.0], [0.5, 4.0]
"""By which a goal moves, length units (a link of the arm is 1), and where all models are measured;
4 is from ``ascending`` to ``descending`` and back."""
NOISE = 0.05
"""SD of exploration of the learner (the paper's), and of execution in the third contrast."""
BLOCK = slice(200, 600)
"""Trials of the third contrast, after as many as people need to become familiar."""
HANDS = {"L": "left", "R": "right"}


def changed(task, goals):
    """The task with other goals. Raises CoarticError or MethodError where they cannot be hit."""
    other = parse_task(task.model_dump() | {"goals": goals, "name": "changed"}, "a changed task")
    objective(other)  # or it says that no hands hit them all
    return other


def condition(task):
    """The paper's condition that explores most of what the robot has."""
    return "EC1" if len(task.hands) == 1 else "EC4"


def moves(task, seed):
    """Yield each goal that has one after it, a distance, and the task with that one moved.

    The direction is random, the same for all distances; the moved goal stays apart from its
    neighbours.
    """
    rng, goals = np.random.default_rng([68, seed]), task.goal_array
    for g in range(len(goals) - 1):
        beside = np.delete(goals, g + 1, axis=0)[max(g - 1, 0) : g + 2]
        for _ in range(100):
            angle = rng.uniform(0, 2 * np.pi)
            places = goals[g + 1] + np.outer(DISTANCES, [np.cos(angle), np.sin(angle)])
            if np.linalg.norm(places[:, None] - beside, axis=2).min() < 4 * task.radius:
                continue
            try:
                tasks = [changed(task, [*goals[: g + 1], place, *goals[g + 2 :]])
                         for place in places]  # fmt: skip
            except (CoarticError, MethodError):
                continue
            yield from zip([g] * len(tasks), DISTANCES, tasks, strict=True)
            break


def look(task, movements):
    """Postures in which the goals are hit, shape ``(G, dof)``, and ticks of a trial."""
    done = execute(task, movements)
    return done.configurations, done.ticks


def plan(task, method, seed=0, **parameters):
    """Return the solution of a planner or controller of the package."""
    result, _ = run_method(method(method.Parameters(**parameters)), task, seed)
    return look(task, result.solution)


def learned(task, seed, start):
    """Return what the learner has learned after :data:`AFTER` trials from a first solution."""
    runs = (learn(task, condition(task), seed=seed, trials=n, start=start) for n in AFTER)
    return [look(task, run.solution) for run in runs]


def informed_next(before, task, q, hands, g, movements):
    """Movements in which the posture at goal ``g`` is corrected for the goal after it.

    The corrective process finds from the posture how the robot would hit the next goal, before
    and after the change. Half of the difference is added to the posture, which the process then
    brings back to its goal.
    """

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
    """As :func:`look`, for a point of an objective."""
    targets = np.full((1, *cost.joints.shape), np.nan)
    targets[0][cost.joints] = point
    session = Session(task, 0, [Information.REWARD_BY_TRIAL, Information.CORRECTIVE_PROCESS])
    trial = session.trials(cost.hands, targets)
    return trial.reached[0], int(trial.ticks[0])


# ---- The first contrast: an announced change ----

EFFORT = {"nodes": 80, "graphs": 1, "chains": 6, "starts": 6}
PLANNERS = {
    "planner, all goals": lambda task: plan(
        task, RecedingHorizon, horizon=len(task.goals) - 1, **EFFORT
    ),
    "planner, next goal": lambda task: plan(task, TwoGoals),
    "control, next goal": lambda task: plan(task, GoalsAhead),
    "control, this goal": lambda task: plan(task, CurrentGoal),
}


def change_goals(task, seed):
    """Rows of a task: a model each, for a goal before a change and a distance.

    ``dot_N``: shift of the posture at the goal after N trials, times the shift after all of them;
    ``square``: the latter squared. ``ticks_N``: of a trial then. ``same`` and ``anew``: such a
    product for practice without a change, and the squared distance to those who learn the changed
    task anew; ``among``: between those.
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


# ---- The second contrast: practice from another start ----


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
    tested = [look(c, run.solution)[0] for run in runs]
    went_on = [look(c, learn(c, condition(task), seed=s + 500, start=run.solution).solution)[0]
               for s, run in zip(seeds, runs, strict=True)]  # fmt: skip
    planned = [plan(c, TwoGoals, s)[0] for s in seeds]
    for model, trials, postures in (
        ("learner", 1, tested), ("learner", 10_000, went_on), ("planner", 1, planned)
    ):  # fmt: skip
        q = np.array(postures).reshape(2 * PEOPLE, -1)
        apart = ((q[:, None] - q) ** 2).sum(axis=2)
        same = np.kron(np.eye(2), np.ones((PEOPLE, PEOPLE))).astype(bool)
        within = apart[same].sum() / (2 * PEOPLE * (PEOPLE - 1))
        yield {"task": task.name, "model": model, "trials": trials,
               "between": apart[~same].mean(), "within": within}  # fmt: skip


# ---- The third contrast: steps from trial to trial ----


def series(task, model, seed):
    """Postures at the goals, ``(trials, G, dof)``, and rewards of a person of a task for one arm.

    The ``learner`` keeps a trial that is better than all before, and adds noise to what it keeps;
    up to there it is the paper's, number for number. The ``fixed`` one keeps nothing more from
    the block on, the ``walk`` keeps every trial. The ``planner`` adds noise to its plan.
    """
    session = Session(task, 0, [Information.REWARD_BY_TRIAL, Information.CORRECTIVE_PROCESS])
    rng, best = np.random.default_rng(seed), -np.inf
    targets = np.full((1, len(task.goals), len(task.q0)), np.nan)
    if model == "planner":
        targets[0] = plan(task, TwoGoals, seed)[0]
    free, postures, rewards = moving(task), [], []
    for trial in range(BLOCK.stop):
        tried = targets.copy()
        if trial or model == "planner":
            tried[0][:, free] += NOISE * rng.standard_normal((len(task.goals), len(free)))
        done = session.trials("R" * len(task.goals), tried)
        postures.append(done.reached[0])
        rewards.append(done.rewards[0])
        learns = model == "learner" or (model == "fixed" and trial < BLOCK.start)
        if (learns and rewards[-1] > best) or (model == "walk" and done.completed[0]):
            best, targets = rewards[-1], done.reached
    return np.array(postures), np.array(rewards)


def moving(task):
    """Indices of the joints that the right hand moves with."""
    arm = task.robot.joints("right")
    base = [k for k, axis in enumerate("xy") if axis not in task.locked_base]
    return [*base, *range(arm.start, arm.stop)]


def steps(task, seed):
    """Rows of a task: a model and person each.

    ``same``: share of successive steps of self-motion with the same sign. ``kept``: share of the
    deviation from the ten trials before that the next trial keeps, if it was the best so far, less
    that if it was not.
    """
    for model, person in ((m, p) for m in ("learner", "fixed", "walk", "planner")
                          for p in range(PEOPLE)):  # fmt: skip
        postures, rewards = series(task, model, 1000 * seed + person)
        records = np.flatnonzero(rewards[1:] > np.maximum.accumulate(rewards)[:-1]) + 1
        same, sums = [], np.zeros((2, 2))
        for g in range(len(task.goals)):
            q = postures[:, g, moving(task)]
            jacobian = task.robot.jacobian(postures[BLOCK, g].mean(axis=0), "right")
            z = q @ np.linalg.svd(jacobian[:, moving(task)])[2][2:].T  # the hand does not move
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


# ---- All of it ----


def main(split="i", folder=HERE):
    """Run the protocols on test instances, or on some development instances.

    Tasks that the folder has are not run again. The next instance of both families follows in
    turn, so that what is done is a fair part of all.
    """
    clock, chosen = time.process_time(), ["ascending", "descending"]
    for n in range(30 if split == "i" else 2):
        chosen += [f"one-armed/v1/{split}{n:03d}", f"two-armed/v1/{split}{n:03d}"]
    paths = {name: Path(folder) / f"{name}.csv" for name in ("changes", "starts", "steps")}
    rows = {name: pd.read_csv(path).to_dict("records") if path.exists() else []
            for name, path in paths.items()}  # fmt: skip
    for seed, name in enumerate(chosen):
        if any(row["task"] == name for row in rows["changes"]):
            continue
        task, keys = load_task(name), ["task", "distance", "model"]
        changes = pd.DataFrame(change_goals(task, seed)).groupby(keys, sort=False)
        rows["changes"] += changes.sum(min_count=1).reset_index().to_dict("records")
        rows["starts"] += start_elsewhere(task, seed) if 2 <= seed < 22 else []
        rows["steps"] += steps(task, seed) if len(task.hands) == 1 and seed < 18 else []
        for kind, path in paths.items():
            pd.DataFrame(rows[kind]).to_csv(path, float_format="%.5g", index=False)
        print(f"{name}: {time.process_time() - clock:.0f} s", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
