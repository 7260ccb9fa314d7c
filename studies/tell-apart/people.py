"""The models of people that all contrasts have: the paper's learner, and planners."""

from coartic import execute
from coartic.method import run_method

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
