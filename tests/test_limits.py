"""Checks of the numbers that users give, at every function that takes them."""

import numpy as np
import pytest

import coartic
from coartic import Movement, SolutionError, execute, load_task
from coartic.analysis import mean, other_tasks
from coartic.motion.solution import movements_of
from coartic.runs.record import movement_data
from tests.support.strategies import make_trials

MASKED = np.ma.array([0.0] * 10, mask=[False] * 9 + [True])
TASK = load_task("two-armed-2")
COST = coartic.objective(TASK)


def masked_point(points=None):
    point = np.ma.array(COST.x0)
    point[3] = np.ma.masked
    return point


DOORS = {
    "a point": lambda: COST(masked_point()),
    "points": lambda: COST.many(np.ma.array([masked_point()])),
    "a list of points": lambda: COST.many([masked_point()]),
    "movements of a point": lambda: COST.movements(masked_point()),
    "targets of evaluations": lambda: COST.evaluations_to(np.ma.array([1.0, 2.0], mask=[0, 1])),
    "a solution": lambda: movements_of("RRRR", np.ma.array([MASKED] * 4)),
    "a target": lambda: execute(
        TASK, [Movement(n, "right", "planned", MASKED) for n in range(1, 5)]
    ),
    "a path": lambda: execute(
        TASK, [Movement(n, "right", "path", waypoints=[MASKED]) for n in range(1, 5)]
    ),
    "trials": lambda: make_trials(TASK, "RRRR", np.ma.masked_equal(np.zeros((1, 4, 10)), 0.0)),
    "lists of trials": lambda: make_trials(TASK, "RRRR", [[MASKED] * 4]),
    "a movement": lambda: coartic.move(TASK.robot, TASK.q0, MASKED, "right", (5, 1), 0.1),
    "a stored movement": lambda: movement_data(Movement(1, "right", "planned", MASKED)),
    "a masked number": lambda: mean([1.0, 2.0, np.ma.masked]),
    "a mean over instances": lambda: other_tasks({"family": [MASKED]}),
}


@pytest.mark.parametrize("door", DOORS)
def test_masked_arrays_are_refused_by_every_function_that_takes_arrays(door):
    """What is under a mask does not count, so that no number of it may be used."""
    with pytest.raises(
        (ValueError, SolutionError), match="has masked entries; needed are numbers without a mask"
    ):
        DOORS[door]()
