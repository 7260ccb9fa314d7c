"""Run methods on tasks of the form that the people had.

    python studies/people/protocols.py results/people

For each of the tasks i180 to i199 of one-armed there are two tasks, which differ after goal 1: then
goal 2, or then the place where the hand started.
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
"""Methods by id. On tasks with two goals, two goals in view are all."""
RUNS = 5


def names(instance):
    """Return the names of the two tasks made from an instance: another goal next, and back."""
    short = instance.rpartition("/")[2]
    return f"{short}-goal", f"{short}-back"


def pair(instance):
    """Return the two tasks made from an instance of one-armed."""
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
