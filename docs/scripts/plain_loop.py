"""Compile and call ``plain_loop.c``: a loop in C over the control steps of a trial."""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from coartic import PAPER, Task
from coartic.robot import BASE_DOF, HANDS, Array


def trials_in_c(task: Task, hands: str, targets: Array) -> dict[str, Callable[[], Array]]:
    """Compile ``plain_loop.c``, and return functions that make trials one after the other.

    Parameters
    ----------
    task : Task
    hands : str
        Hand sequence of all trials, such as ``"RRLR"``.
    targets : ndarray, shape (trials, goals, dof)
        Target of each movement, in length units and rad.

    Returns
    -------
    dict of str to callable
        Two functions by name. Each makes all trials and returns their ticks, shape ``(trials,)``.
        One of them uses bounds to skip control steps at which the hand cannot hit the goal.
    """
    library = Path(tempfile.mkdtemp()) / "plain_loop.so"
    source = Path(__file__).with_suffix(".c")
    options = ["-O3", "-march=native", "-shared", "-fPIC", "-lm", "-o"]
    subprocess.run(["cc", source, *options, library], check=True)
    model, arms = PAPER.for_radius(task.radius), map(task.robot.arm, HANDS)
    free = [float("xy"[k] not in task.locked_base) for k in range(BASE_DOF)]
    rules = (
        task.radius, model.step, model.arrival_tolerance, model.gain, model.correction_tolerance,
        model.max_iterations, *free,
    )  # fmt: skip
    arrays = [
        *map(np.ascontiguousarray, (task.q0, targets, ["LR".index(hand) for hand in hands],
                                    task.goal_array)),
        # Structures of the C code: arms with room for 64 lengths, and rules.
        np.array([(first, len(links), np.resize(links, 64), x, y) for first, links, x, y in arms],
                 "i8, i8, 64f8, f8, f8"),
        np.array(rules, "f8, f8, f8, f8, f8, i8, f8, f8"),
    ]  # fmt: skip
    ticks = np.empty(len(targets), np.int64)

    def make(bounds: bool) -> Array:
        sizes, places = map(ctypes.c_long, targets.shape), (each.ctypes for each in arrays)
        ctypes.CDLL(str(library)).trials(*sizes, *places, bounds, ticks.ctypes)
        return ticks

    return {"plain loop in C": lambda: make(False), "loop in C, with bounds": lambda: make(True)}
