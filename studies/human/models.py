"""Models that are compared with people, and the runs of each model."""

import json
import re
import tomllib
from pathlib import Path

import numpy as np
import pandas as pd

from coartic import trajectory

MODELS = tomllib.loads(Path(__file__).with_name("human.toml").read_text("utf-8"))["models"]
"""Models that are compared with people, by name: methods with their parameters."""
FURTHER = {
    "learner, begun": MODELS["learner"] | {"parameters": {"trials": 100}},
    "learner, replayed, begun": MODELS["learner, replayed"] | {"parameters": {"trials": 100}},
    "least acceleration, stopping": MODELS["least acceleration"] | {"parameters": {"stop": 1}},
    "least jerk, stopping": MODELS["least jerk"] | {"parameters": {"stop": 1}},
    "any goals ahead": {"method": "receding-horizon"},
}
"""Further models that some measures need: the learner after a hundredth of its practice, plans that
stop at each goal, all points of the planner's curve."""


def tidy(study):
    """The solved runs of all models, a row each, in the order of the suite.

    ``model``; ``task`` with its ``arms`` and ``goals`` (their numbers) and its ``best`` reward of
    any run; ``moved``, the number of the goal that was moved, to ``place`` (its y, length unit) in
    the task ``origin``, or 0; the planner's ``horizon``; ``path``, the movement tick by tick.
    """
    solved = study.runs[study.runs.status == "ok"]
    best = solved.groupby("task").reward.max()
    rows = []
    for cell in solved.drop_duplicates(["task", "method", "setting"]).itertuples():
        task, parameters = study.tasks[cell.task], json.loads(cell.parameters)
        learner = f"dual-process/EC{4 if len(task.hands) > 1 else 1}"
        origin, moved = re.fullmatch(r"(.+?)(?:\.goal(\d+)_.+)?", cell.task).groups()
        place = task.goals[int(moved) - 1][1] if moved else np.nan
        facts = {
            "task": cell.task, "arms": len(task.hands), "goals": cell.goals,
            "best": best[cell.task], "origin": origin, "moved": int(moved or 0), "place": place,
            "horizon": parameters.get("horizon"),
        }  # fmt: skip
        for name, model in (MODELS | FURTHER).items():
            wanted = model.get("parameters", {}).items()
            if (model["method"] or learner) == cell.method and wanted <= parameters.items():
                replay = model.get("replayed", False)
                for run in study.executed(
                    cell.task, f"{cell.method} {cell.setting}".strip(), replay=replay
                ).runs:
                    path = trajectory(task, run.movements)
                    rows.append({"model": name, **facts, "path": path})
    return pd.DataFrame(rows)
