"""Execute solutions with motor noise, one robot after the other: slow and obvious.

Every step of every movement is made by :mod:`tests.support.reference`. Only the order of random
numbers is the same as in :mod:`coartic.motion.noise`; no code is shared.
"""

from types import SimpleNamespace

import numpy as np

from coartic.model import PAPER
from tests.support import reference


def execute_noisy(
    task, solutions, motor_noise, repeats, seed, model=PAPER, *, signal_dependent=False
):
    """Return the ticks of :func:`coartic.execute_noisy`, which are NaN if an execution failed."""
    rows = []
    for k, solution in enumerate(solutions):
        whole = np.random.SeedSequence(seed, spawn_key=(k,)) if isinstance(seed, int) else seed[k]
        rng = np.random.default_rng(whole)
        rows.append(_execute(task, solution, motor_noise, repeats, rng, model, signal_dependent))
    return np.array(rows).reshape(-1, repeats)


def _execute(task, solution, motor_noise, repeats, rng, model, signal_dependent):
    model = model.for_radius(task.radius)
    aims = _aims_without_noise(task, solution, model)
    draws = rng.standard_normal((repeats, len(aims), task.robot.dof))
    robots = [_robot(task) for _ in range(repeats)]
    for number, goal in enumerate(task.goals, 1):
        first = next(movement for movement in solution if movement.goal == number)
        for repeat, robot in enumerate(robots):
            robot.hit = first.kind == "corrective" and _is_hit(task, robot.q, first.hand, goal)
            for m, aim in enumerate(aims):
                if aim.movement.goal != number or robot.hit or robot.failed:
                    continue
                corners = np.where(aim.moves, aim.corners, robot.q)
                sd = motor_noise
                if signal_dependent:
                    sd *= min(1.0, np.linalg.norm(corners[-1] - robot.q))
                for k in range(len(corners)):
                    share = (k + 1) / len(corners)
                    corners[k, aim.moves] += share * (sd * draws[repeat, m, aim.moves])
                _make(task, robot, aim.movement, corners, goal, model)
        for _ in range(50):
            for robot in robots:
                if robot.hit or robot.failed:
                    continue
                found = reference.correct(
                    task.robot, robot.q, first.hand, goal,
                    locked_base=task.locked_base, model=model,
                )  # fmt: skip
                if not found.converged:
                    robot.failed = True
                    continue
                target = found.q.copy()
                sd = motor_noise * min(1.0, np.linalg.norm(target - robot.q))
                noise = sd * rng.standard_normal(task.robot.dof)
                for j, name in enumerate(task.robot.joint_names):
                    is_base = name.startswith("base")
                    locked = is_base and name[-1] in task.locked_base
                    if name.startswith(first.hand) or (is_base and not locked):
                        target[j] += noise[j]
                _move(task, robot, first.hand, goal, target, model, stop_on_arrival=False)
        for robot in robots:
            robot.failed = robot.failed or not robot.hit
    return [np.nan if robot.failed else robot.ticks for robot in robots]


def _robot(task):
    return SimpleNamespace(q=np.array(task.q0), ticks=0, hit=False, failed=False)


def _is_hit(task, q, hand, goal):
    return np.hypot(*(task.robot.forward_kinematics(q, hand) - goal)) <= task.radius


def _move(task, robot, hand, goal, target, model, **how):
    robot.q, ticks, robot.hit, _ = reference.move(
        task.robot, robot.q, target, hand, goal, task.radius, model=model, **how
    )
    robot.ticks += ticks


def _make(task, robot, movement, corners, goal, model):
    """Make a movement to the last of some corners, or a path along all of them."""
    how = {"stop_on_arrival": movement.kind in ("learned", "planned")}
    if movement.kind == "path":
        how = {"waypoints": corners}
    _move(task, robot, movement.hand, goal, corners[-1], model, **how)


def _aims_without_noise(task, solution, model):
    """Return the movements of a solution to targets, with the coordinates that they move."""
    robot, aims = _robot(task), []
    for number, goal in enumerate(task.goals, 1):
        due = [movement for movement in solution if movement.goal == number]
        hand = due[0].hand
        robot.hit = due[0].kind == "corrective" and _is_hit(task, robot.q, hand, goal)
        for movement in due:
            corrected = reference.correct(
                task.robot, robot.q, hand, goal, locked_base=task.locked_base, model=model
            )
            if movement.kind == "corrective":
                is_own = movement.target is not None and not robot.hit and not robot.failed
                if is_own and corrected.converged:
                    is_own = np.abs(corrected.q - movement.target).max() > 1e-9
                if not is_own:
                    break
            corners = np.atleast_2d(
                movement.target if movement.kind != "path" else movement.waypoints
            )
            moves = (np.abs(corners - robot.q) > 1e-9).any(axis=0)
            aims.append(SimpleNamespace(movement=movement, corners=corners, moves=moves))
            if not robot.hit and not robot.failed:
                _make(task, robot, movement, corners, goal, model)
        if not robot.hit and not robot.failed:
            corrected = reference.correct(
                task.robot, robot.q, hand, goal, locked_base=task.locked_base, model=model
            )
            robot.failed = not corrected.converged
            if corrected.converged:
                _move(task, robot, hand, goal, corrected.q, model, stop_on_arrival=False)
    return aims
