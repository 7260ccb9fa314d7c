"""The second contrast, practice from another start: do learners keep apart?"""

import numpy as np
from people import PEOPLE, condition, plan

from coartic import execute, learn, learn_many, parse_task
from coartic.baselines.posture_based import TwoGoals


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
    tested = [execute(c, run.solution) for run in runs]
    went_on = [learn(c, condition(task), seed=s + 500, start=run.solution).execute()
               for s, run in zip(seeds, runs, strict=True)]  # fmt: skip
    planned = [plan(c, TwoGoals, s) for s in seeds]
    for model, trials, people in (
        ("learner", 1, tested), ("learner", 10_000, went_on), ("planner", 1, planned)
    ):  # fmt: skip
        q = np.array([person.configurations for person in people]).reshape(2 * PEOPLE, -1)
        apart = ((q[:, None] - q) ** 2).sum(axis=2)
        same = np.kron(np.eye(2), np.ones((PEOPLE, PEOPLE))).astype(bool)
        within = apart[same].sum() / (2 * PEOPLE * (PEOPLE - 1))
        yield {"task": task.name, "model": model, "trials": trials,
               "between": apart[~same].mean(), "within": within}  # fmt: skip
