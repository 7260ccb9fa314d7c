"""Implement the model as the paper publishes it, in plain NumPy: slow and obvious.

Movements are made by :mod:`analysis.verify`. Corrective process, execution and learner use the
package's formulas of the robot, but none of its kernels, which are tested against them. Only the
initial hands of a policy come from the package. The learner draws random numbers in the same order
as the package's learner.
"""

import math
from collections import namedtuple
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd

from coartic.analysis import verify
from coartic.model import PAPER
from coartic.motion.doors import Correction, MoveResult
from coartic.motion.execution import initial_hands
from coartic.motion.solution import Movement
from coartic.robot import HANDS
from coartic.tasks.task import hands_of
from tests.support.noise import World

ReferenceRun = namedtuple(
    "ReferenceRun",
    "rewards completed values targets corrections corrective_iterations visits ticks_by_goal "
    "replay",
)
"""Result of the slow learner.

- ``values`` and ``targets`` are by state (goal, previous hand) and hand.
- ``corrections`` are by trial. ``visits`` has, by trial, the state, hand and posture at each hit,
  and ``ticks_by_goal`` the ticks for each goal.
- ``replay`` has the hands and the ticks by goal of the greedy trial after the last trial, or is
  None if that trial failed.
"""


def move(robot, q, target, hand, goal, radius, *, stop_on_arrival=True, model=PAPER, waypoints=()):
    """Make a movement as :func:`coartic.move`, or a path along waypoints.

    :mod:`analysis.verify` makes it and visits every step. Results are equal to the last bit.
    """
    arm = robot.arm(hand)
    rules = SimpleNamespace(
        model=model.for_radius(radius),
        arms={hand: (robot.joints(hand), arm.links, (arm.shoulder_x, arm.shoulder_y))},
        goals=[goal],
        radius=radius,
    )
    kind = "path" if len(waypoints) else "learned" if stop_on_arrival else "corrective"
    corners = np.atleast_2d(waypoints if len(waypoints) else target)
    start = np.array(q, dtype=np.float64)
    end, ticks, hit = verify.make(rules, start, 1, hand, kind, corners)
    return MoveResult(end, ticks, hit, ticks + 1)


Outcome = namedtuple("Outcome", "reward ticks corrections iterations hits movements rows")
"""Result of an execution. ``reward`` is None if it failed; ``rows`` are configurations by tick."""


def execute(task, solution, model=PAPER, world=None):
    """Execute a solution as :func:`coartic.execute`, movement after movement.

    Joints whose target is NaN do not move. With noise, ``world`` is that of the trial.
    """
    q, hits, made, model = np.array(task.q0), [], [], model.for_radius(task.radius)
    world = world or World(model)
    rows, corrections, iterations = [np.empty((0, len(q)))], 0, 0
    for number, goal in enumerate(task.goals, 1):
        world.begin(number - 1)
        due = [movement for movement in solution if movement.goal == number]
        hand = due[0].hand
        where = hand, goal, task.radius
        hit = move(task.robot, q, q, *where, model=model).hit
        for index, movement in enumerate([*due, Movement(number, hand, "corrective")]):
            if hit and (index > 0 or movement.kind == "corrective"):
                continue
            if movement.kind != "path" and movement.target is None:
                fixed = correct_until_hit(task, q, hand, goal, model, world)
                iterations, corrections = iterations + fixed.iterations, corrections + fixed.count
                q, hit = fixed.q, fixed.hit
                if fixed.count:
                    made.append(replace(movement, target=fixed.found, ticks=fixed.ticks))
                    rows += fixed.rows
                break
            is_path = movement.kind == "path"
            corners = world.end_of(q, movement.waypoints if is_path else [movement.target])
            way = corners if is_path else ()
            stops = movement.kind != "corrective"
            points = path_of(q, way, corners[-1], model)
            q, ticks, hit, _ = move(
                task.robot, q, corners[-1], *where, stop_on_arrival=stops, model=model,
                waypoints=way,
            )  # fmt: skip
            rows.append(points.T[:ticks])
            corrections += movement.kind == "corrective"
            target = movement.waypoints[-1] if is_path else movement.target
            made.append(replace(movement, target=target, ticks=ticks))
        if not hit:
            break
        if not made or made[-1].goal != number:
            made.append(Movement(number, hand, "corrective", q, 0))
        hits.append(q)
    ticks = sum(movement.ticks for movement in made)
    reward = -ticks if len(hits) == len(task.goals) else None
    return Outcome(reward, ticks, corrections, iterations, hits, made, np.concatenate(rows))


def executed_noisily(task, solution, model, seed, draw, grows=False):
    """Ticks of one execution of :func:`coartic.execute_noisy`; NaN if it fails."""
    exact = model._replace(motor_noise=0.0).for_radius(task.radius)
    world = World(model, seed, draw, judge=True, grows=grows)
    made = execute(task, _without_process(task, solution, exact), model, world)
    return np.nan if made.reward is None else made.ticks


def _without_process(task, solution, model):
    """Return a solution without the corrective movements that the process makes itself.

    These are the ones without a target, or with that of the process in the execution without noise,
    and all movements for the goal after them.
    """
    q, failed, kept = np.array(task.q0), False, []
    for number, goal in enumerate(task.goals, 1):
        due, before = [movement for movement in solution if movement.goal == number], len(kept)
        hand = due[0].hand
        where = hand, goal, task.radius
        hit = due[0].kind == "corrective" and move(task.robot, q, q, *where, model=model).hit
        for movement in [*due, Movement(number, hand, "corrective")]:
            found = correct(task.robot, q, hand, goal, locked_base=task.locked_base, model=model)
            if movement.kind == "corrective":
                own = movement.target is not None and not hit and not failed
                if own and found.converged:
                    own = np.nanmax(np.abs(found.q - movement.target)) > 1e-9
                if not own:
                    failed = failed or (not hit and not found.converged)
                    if not hit and not failed:
                        q = move(
                            task.robot, q, found.q, *where, model=model, stop_on_arrival=False
                        ).q
                    break
            kept.append(movement)
            if not hit and not failed:
                way = movement.waypoints if movement.kind == "path" else ()
                target = way[-1] if len(way) else np.where(np.isnan(t := movement.target), q, t)
                stops = movement.kind in ("learned", "planned")
                q, _, hit, _ = move(
                    task.robot, q, target, *where, stop_on_arrival=stops, model=model, waypoints=way
                )
        if len(kept) == before:
            kept.append(Movement(number, hand, "corrective"))
    return kept


def path_of(q, way, target, model):
    """Points of a movement along a way, or straight to a target."""
    return verify.path(q, way, model) if len(way) else verify.straight_path_points(q, target, model)


def correct_until_hit(task, q, hand, goal, model, world):
    """Correct a miss by the corrective process: once, or with noise until the goal is hit.

    After 50 corrections, or where the process does not converge, the goal is missed.
    """
    free = np.zeros(len(q), dtype=np.bool_)
    free[:2] = ["x" not in task.locked_base, "y" not in task.locked_base]
    free[task.robot.joints(hand)] = True
    result = SimpleNamespace(q=q, hit=False, count=0, ticks=0, iterations=0, found=None, rows=[])
    for _ in range(50 if world.sd else 1):
        found = correct(task.robot, result.q, hand, goal, locked_base=task.locked_base, model=model)
        result.iterations += found.iterations
        if not found.converged:
            break
        end = world.end_of_correction(result.q, found.q, free)
        points = verify.straight_path_points(result.q, end, model)
        result.q, ticks, result.hit, _ = move(
            task.robot, result.q, end, hand, goal, task.radius, stop_on_arrival=False, model=model
        )
        result.found, result.ticks, result.count = found.q, result.ticks + ticks, result.count + 1
        result.rows.append(points.T[:ticks])
        if result.hit:
            break
    return result


def correct(robot, q, hand, goal, *, locked_base=(), model=PAPER):
    """Correct a posture as :func:`coartic.motion.doors.correct`.

    The Jacobian is a matrix.
    """
    free, model = np.ones(robot.dof), model.for_radius()
    free[:2] = ["x" not in locked_base, "y" not in locked_base]
    q = np.array(q)
    for iteration in range(model.max_iterations):
        place, jacobian = robot.linearised(q, hand)
        error = goal - place
        if math.sqrt(_sum_of_squares(error)) <= model.correction_tolerance:
            return Correction(q, True, iteration)
        step = model.gain * free * (jacobian.T @ error)
        before, q = q, q + step
        if (q == before).all():  # a stationary point away from the goal: no iteration changes it
            return Correction(q, False, iteration + 1)
    error = goal - robot.forward_kinematics(q, hand)
    converged = math.sqrt(_sum_of_squares(error)) <= model.correction_tolerance
    return Correction(q, converged, model.max_iterations)


def _moving(robot, hand, joints):
    """Return the indices of those joints (True in ``joints``) that move a hand."""
    of_hand = [0, 1, *np.arange(robot.dof)[robot.joints(hand)]]
    return [joint for joint in np.flatnonzero(joints) if joint in of_hand]


def null_space(robot, q, hand, joints):
    """Return N(q) = I − J⁺J of a hand over some joints, by singular values."""
    jacobian = robot.jacobian(q, hand)[:, joints]
    return np.asarray(np.eye(len(joints)) - np.linalg.pinv(jacobian, rcond=1e-6) @ jacobian)


def preferred_posture(task, condition, q, number, hand, values, targets):
    """Return the preferred posture p at the current goal, for the chosen hand."""
    p = np.array(q)
    following = (number + 1, hand)
    stored = {each: values[following, each] for each in HANDS if (following, each) in values}
    if number + 1 < len(task.goals) and stored:
        best = max(stored, key=lambda each: stored[each])
        middle = (q + targets[following, best]) / 2
        explores = _explored(task, condition, best)
        p[explores] = middle[explores]
    return p


def hits_of(task, condition, *, trials, seed, subject):
    """Return the hits of a person who learns as the learner does, as a recording of trials."""
    run = learn(task, condition, seed=seed, trials=trials)
    rows = [
        [subject, trial, goal, hand, ticks, *q]
        for trial, (visited, spent) in enumerate(zip(run.visits, run.ticks_by_goal, strict=True), 1)
        for goal, ((_, hand, q), ticks) in enumerate(zip(visited, spent, strict=True), 1)
    ]
    names = ["subject", "trial", "goal", "hand", "ticks", *task.robot.joint_names]
    return pd.DataFrame(rows, columns=names)


def learn(task, condition, *, seed, trials, model=PAPER, start=()):
    """Learn as :func:`coartic.learner.learning.learn`, after Figure 3 line by line.

    ``start`` has the movements of trial 0.
    """
    rng = np.random.default_rng(seed)
    first_hands = [movement.hand for movement in start] or hands_of(
        initial_hands(task, condition.hands, model=model)
    )
    model = model.for_radius(task.radius)
    values = {}
    targets = {}
    rewards = np.zeros(trials, dtype=np.int64)
    completed = np.zeros(trials, dtype=np.bool_)
    iterations = 0
    by_trial = np.zeros(trials + 1, dtype=np.int64)
    visits, ticks_by_goal = [], []
    for trial in range(trials + 1):
        if trial == trials:  # the replay: nothing is learned from it or counted
            greedy = {"hand_exploration": "none", "drift": 0.0, "noise_sd": 0.0}
            condition, counted = replace(condition, **greedy), iterations
        world = World(model, seed, trial)
        q = np.array(task.q0)
        total = 0
        previous = None
        visited = []
        subtasks = []
        for number, goal in enumerate(task.goals):
            world.begin(number)
            state = (number, previous)
            spent_before = total
            if trial == 0:
                hand = first_hands[number]
            else:
                hand = _choose(task, condition, q, goal, state, values, rng)
            p = preferred_posture(task, condition, q, number, hand, values, targets)
            has_target = (state, hand) in targets
            if has_target or (trial == 0 and start):
                if has_target:
                    target = _explore(task, condition, q, hand, targets[state, hand], rng, p)
                else:
                    target = start[number].target
                (end,) = world.end_of(q, [target])
                result = move(task.robot, q, end, hand, goal, task.radius, model=model)
                q, total, hit = result.q, total - result.ticks, result.hit
            else:
                hit = _distance(task.robot.forward_kinematics(q, hand), goal) <= task.radius
            if not hit:
                if has_target and not condition.corrects:
                    break
                fixed = correct_until_hit(task, q, hand, goal, model, world)
                iterations += fixed.iterations
                q, total = fixed.q, total - fixed.ticks
                by_trial[trial] += fixed.count
                if not fixed.hit:
                    break
            visited.append((state, hand, q))
            subtasks.append(total - spent_before)
            previous = hand
        ticks = [-reward for reward in subtasks]
        if trial == trials:
            hands = [hand for _, hand, _ in visited]
            replay = (hands, ticks) if len(visited) == len(task.goals) else None
            break
        visits.append(visited)
        ticks_by_goal.append(ticks)
        rewards[trial] = total
        completed[trial] = len(visited) == len(task.goals)
        if completed[trial]:
            for number, (state, hand, reached) in enumerate(visited):
                credit = total
                if condition.credit == "subtask":
                    credit = subtasks[number]
                value = values.get((state, hand), -math.inf)
                if credit > value:
                    values[state, hand] = credit
                    targets[state, hand] = reached
    return ReferenceRun(
        rewards, completed, values, targets, by_trial[:-1], counted, visits, ticks_by_goal, replay
    )


def _choose(task, condition, q, goal, state, values, rng):
    """Return the chosen hand."""
    hands = [hand for hand in HANDS if hand in condition.hands]
    if condition.hand_exploration != "none" and rng.random() < condition.epsilon:
        if condition.hand_exploration == "closest":
            near = [_distance(task.robot.forward_kinematics(q, hand), goal) for hand in hands]
            if len(hands) == 1 or abs(max(near) - min(near)) > 1e-9:
                return hands[int(np.argmin(near))]
        return hands[int(rng.random() * len(hands))]
    return max(hands, key=lambda hand: values.get((state, hand), -math.inf))


def _explore(task, condition, q, hand, stored, rng, p):
    other = "left" if hand == "right" else "right"
    target = np.array(stored)
    explored = _explored(task, condition, hand)
    if condition.drift:
        projected = _moving(task.robot, hand, explored)
        d = np.where(explored, p - stored, 0.0)
        d[projected] = null_space(task.robot, stored, hand, projected) @ d[projected]
        target += condition.drift * d
    if not condition.modify_other:
        target[task.robot.joints(other)] = q[task.robot.joints(other)]
    target[explored] += condition.noise_sd * rng.standard_normal(int(explored.sum()))
    return target


def _explored(task, condition, hand):
    other = "left" if hand == "right" else "right"
    explored = np.full(task.robot.dof, condition.modify_chosen)
    explored[task.robot.joints(other)] = condition.modify_other
    explored[:2] &= ["x" not in task.locked_base, "y" not in task.locked_base]
    return explored


def _distance(a, b):
    return math.sqrt(_sum_of_squares(np.asarray(a) - b))


def _sum_of_squares(vector):
    total = 0.0
    for value in vector:
        total += float(value) * float(value)
    return total
