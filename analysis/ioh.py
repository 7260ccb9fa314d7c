"""A results folder in the format of IOHprofiler (Doerr et al. 2018, arXiv:1810.05281).

An algorithm is a method with its variant; a function a task, or a family, whose instances are the
function's; its dimension the number of coordinates of all targets; an evaluation a trial; y its
cost, ticks, which is minimised. IOHinspector and IOHanalyzer read it.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any

from coartic import Task
from coartic.analysis.study import CellRuns, Study
from coartic.analysis.topics.comparison.running_times import BestSoFar, steps_of
from coartic.errors import CoarticError
from coartic.optimisers import FAILED
from coartic.tasks.task import address_of

_VERSION = "0.3.22"  # of IOHexperimenter, whose files are like these


def ioh_files(study: Study) -> dict[str, bytes]:
    """The files by path: for each method a folder with a JSON file for each function.

    Of runs that made trials. Raises CoarticError where there is none.
    """
    files: dict[str, str] = {}
    functions = list(dict.fromkeys(map(function_of, study.tasks.values())))
    cells: dict[tuple[str, str], dict[int, list[CellRuns]]] = {}
    for (name, label), cell in study.cells.items():
        if any(run.learns for run in steps_of(study, cell)):
            task = study.tasks[name]
            of_function = cells.setdefault((label, function_of(task)), {})
            of_function.setdefault(dimension(task), []).append(cell)
    if not cells:
        raise CoarticError(f"{study.folder} has no run that made trials, which IOHprofiler counts")
    labels = list(dict.fromkeys(label for label, _ in cells))
    for (label, function), by_dimension in cells.items():
        number, place = functions.index(function) + 1, labels.index(label) + 1
        name = f"f{number}_{in_path(function)}"
        folder, scenarios = f"{place:02}-{in_path(label)}", []
        for size, of_size in sorted(by_dimension.items()):
            path = f"data_{name}/IOHprofiler_f{number}_DIM{size}.dat"
            runs, lines = zip(*scenarios_of(study, of_size), strict=True)
            files[f"{folder}/{path}"] = "".join(lines)
            scenarios.append({"dimension": size, "path": path, "runs": runs})
        card = study.plan.methods[of_size[0].method]
        content = {
            "version": _VERSION,
            "suite": study.suite,
            "function_id": number,
            "function_name": function,
            "maximization": False,
            "algorithm": {"name": label, "info": card.title},
            "attributes": ["evaluations", "raw_y"],
            "scenarios": scenarios,
        }
        files[f"{folder}/IOHprofiler_{name}.json"] = json.dumps(content, indent=1)
    return {path: text.encode() for path, text in files.items()}


def function_of(task: Task) -> str:
    """The name of a task, or of the family and split that it is an instance of."""
    address = address_of(task.name)
    return task.name if address is None else f"{address.family}/{address.stream}"


def dimension(task: Task) -> int:
    """Number of coordinates of the targets of all goals that are free to move."""
    return len(task.goals) * (task.robot.dof - len(task.locked_base))


def in_path(name: str) -> str:
    """A name as a part of a path."""
    return re.sub(r"[^\w.=-]+", "-", name).strip("-")


def scenarios_of(study: Study, cells: list[CellRuns]) -> Iterator[tuple[dict[str, Any], str]]:
    """Of each run that made trials, what the JSON file says, and its lines in the data file."""
    for cell in cells:
        address = address_of(cell.task)
        instance = 1 if address is None else address.number
        for run in steps_of(study, cell):
            if run.learns and (trials := int(run.total["trials"])):
                steps = costs(run)
                best = {"evals": steps[-1][0], "y": steps[-1][1], "x": []}
                ends = [] if steps[-1][0] == trials else [(trials, steps[-1][1])]
                lines = ["evaluations raw_y", *(f"{n} {y}" for n, y in [*steps, *ends])]
                said = {"instance": instance, "evals": trials, "best": best}
                yield said, "".join(f"{line}\n" for line in lines)


def costs(run: BestSoFar) -> list[tuple[int, int]]:
    """Trial and cost of each improvement, from trial 1, which may have failed."""
    pairs = zip(run.spent("trials").tolist(), run.rewards.tolist(), strict=True)
    steps = [(int(trial), -int(reward)) for trial, reward in pairs]
    return steps if steps and steps[0][0] == 1 else [(1, FAILED), *steps]
