"""Run methods on tasks of the same form as the people's tasks.

    python studies/people/protocols.py results/people

Each of the tasks i180 to i199 of one-armed gives two tasks with the same first goal. In one of
them, goal 2 follows; in the other, the position at which the hand started.
"""

import sys

from coartic import load_task
from coartic.benchmarks import run_suite

INSTANCES = [f"one-armed/v1/i{number}" for number in range(180, 200)]
METHODS = {
    "dual-process/EC1": "learner",
    "hill-climbing": "hill climbing",
    "random-search": "random search",
    "cma-es/bandit": "CMA-ES",
    "posture-based/one-goal": "posture planning, one goal in view",
    "posture-based/two-goals": "posture planning, all goals in view",
    "posture-qp/current-goal": "posture QP, one goal in view",
    "posture-qp/goals-ahead": "posture QP, all goals in view",
}
"""Methods by id. On tasks with two goals, a method with two goals in view sees all goals."""
RUNS = 5


def names(instance):
    """Return the names of the two tasks that are made from an instance (:func:`pair`)."""
    short = instance.rpartition("/")[2]
    return f"{short}-goal", f"{short}-back"


def pair(instance):
    """Return the two tasks that are made from an instance of one-armed.

    After goal 1, the hand must hit goal 2 in the first task, and its start position in the second.
    """
    task = load_task(instance)
    first, second = task.goals[:2]
    at_start = task.robot.forward_kinematics(task.q0, "right").tolist()
    return [
        task.model_copy(
            update={"name": name, "goals": (first, tuple(following)), "initial_hands": "RR"}
        )
        for name, following in zip(names(instance), (second, at_start), strict=True)
    ]


def main(folder="results/people"):
    """Run all methods on all pairs of tasks."""
    tasks = [task for instance in INSTANCES for task in pair(instance)]
    print(run_suite("comparison", folder, tasks=tasks, methods=[*METHODS], runs=RUNS))


if __name__ == "__main__":
    main(*sys.argv[1:])
