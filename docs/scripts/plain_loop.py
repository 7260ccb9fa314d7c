"""A trial as one would write it: a loop over control steps, compiled with Numba, or in C."""

from __future__ import annotations

import ctypes
import math
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import numpy as np

from coartic import PAPER, Task
from coartic.robot import BASE_DOF, HANDS, Array


@numba.njit
def place(q: Any, arm: Any, x: Any, y: Any) -> None:
    """Fill in shoulder, joints and hand of an arm: first joint, number of links, lengths."""
    first, links, lengths, shoulder_x, shoulder_y = arm
    x[0], y[0], angle = q[0] + shoulder_x, q[1] + shoulder_y, 0.0
    for k in range(links):
        angle += q[first + k]
        x[k + 1] = x[k] + lengths[k] * math.cos(angle)
        y[k + 1] = y[k] + lengths[k] * math.sin(angle)


@numba.njit
def move(q: Any, target: Any, arm: Any, goal: Any, stops: bool, rules: Any, x: Any, y: Any) -> Any:
    """Move straight to a target; return ticks and whether the goal is hit. ``q`` is changed."""
    radius, step, arrival = rules[0], rules[1], rules[2]
    tip, start = arm[1], q.copy()
    distance = math.sqrt(((target - start) ** 2).sum())
    last = math.ceil(distance / step)
    place(target, arm, x, y)
    end_x, end_y = x[tip], y[tip]
    for k in range(last + 1):
        for j in range(len(q)):
            q[j] = (
                target[j] if k == last else start[j] + k * step / distance * (target[j] - start[j])
            )
        place(q, arm, x, y)
        if math.hypot(goal[0] - x[tip], goal[1] - y[tip]) <= radius:
            return k + 1, True
        if stops and math.hypot(end_x - x[tip], end_y - y[tip]) <= arrival:
            return k + 1, False
    return last + 1, False


@numba.njit
def correct(q: Any, arm: Any, goal: Any, rules: Any, free: Any, x: Any, y: Any) -> bool:
    """Jacobian-transpose descent on the distance to the goal; ``q`` is changed."""
    gain, tolerance = rules[3], rules[4]
    first, tip = arm[0], arm[1]
    for _ in range(int(rules[5])):
        place(q, arm, x, y)
        error_x, error_y = goal[0] - x[tip], goal[1] - y[tip]
        if math.hypot(error_x, error_y) <= tolerance:
            return True
        q[0] += gain * error_x * free[0]
        q[1] += gain * error_y * free[1]
        for k in range(tip):
            q[first + k] += gain * ((x[tip] - x[k]) * error_y - (y[tip] - y[k]) * error_x)
    return False


@numba.njit
def trials(q0: Any, targets: Any, hands: Any, goals: Any, arms: Any, rules: Any, free: Any) -> Any:
    """Make trials one after the other; return their ticks, shape ``(N,)``, -1 where one fails."""
    ticks, x, y = np.zeros(len(targets), np.int64), np.empty(16), np.empty(16)
    for n in range(len(targets)):
        q = q0.copy()
        for g in range(len(goals)):
            arm = arms[0] if hands[g] == 0 else arms[1]
            spent, hit = move(q, targets[n, g], arm, goals[g], True, rules, x, y)
            ticks[n] += spent
            if not hit:
                corrected = q.copy()
                if correct(corrected, arm, goals[g], rules, free, x, y):
                    spent, hit = move(q, corrected, arm, goals[g], False, rules, x, y)
                    ticks[n] += spent
            if not hit:
                ticks[n] = -1
                break
    return ticks


def arguments(task: Task, hands: str) -> tuple[Any, ...]:
    """Return what :func:`trials` takes after the targets."""
    arms = []
    for hand in HANDS:
        first, links, shoulder_x, shoulder_y = task.robot.arm(hand)
        arms.append((first, len(links), np.array(links), shoulder_x, shoulder_y))
    model = PAPER.for_radius(task.radius)
    rules = (
        task.radius, model.step, model.arrival_tolerance, model.gain, model.correction_tolerance,
        float(model.max_iterations),
    )  # fmt: skip
    free = tuple(float("xy"[k] not in task.locked_base) for k in range(BASE_DOF))
    codes = np.array(["LR".index(hand) for hand in hands])
    return codes, task.goal_array, tuple(arms), rules, free


def trials_in_c(task: Task, hands: str, targets: Array) -> dict[str, Callable[[], Array]]:
    """Compile ``plain_loop.c``; return functions that make these trials, one after the other, and
    return their ticks, without and with bounds."""
    library = Path(tempfile.mkdtemp()) / "plain_loop.so"
    source = Path(__file__).with_suffix(".c")
    options = ["-O3", "-march=native", "-shared", "-fPIC", "-lm", "-o"]
    subprocess.run(["cc", source, *options, library], check=True)
    codes, goals, arms, rules, free = arguments(task, hands)
    # Structures of the C code: arms, and rules with the free base coordinates.
    arrays = [np.ascontiguousarray(each) for each in (task.q0, targets, codes, goals)]
    rows = [(first, links, lengths.ctypes.data, x, y) for first, links, lengths, x, y in arms]
    arrays += [
        np.array(rows, "i8, i8, u8, f8, f8"),
        np.array((*rules, *free), "f8, f8, f8, f8, f8, i8, f8, f8"),
    ]
    ticks = np.empty(len(targets), np.int64)

    def make(bounds: bool) -> Array:
        sizes, places = map(ctypes.c_long, targets.shape), (each.ctypes for each in arrays)
        ctypes.CDLL(str(library)).trials(*sizes, *places, bounds, ticks.ctypes)
        return ticks

    return {"plain loop in C": lambda: make(False), "loop in C, with bounds": lambda: make(True)}
