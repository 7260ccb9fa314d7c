"""Make the interactive figure of ``coartic play`` with the runs of a results folder."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from coartic.analysis.control import contexts_of_control, shared_goal
from coartic.analysis.methods import EC1, EC4
from coartic.analysis.standings import cells_of, runs_by_method, standings
from coartic.analysis.study import MAX_EXECUTED, CellKey, Study, shared_cells, solved, typical_run
from coartic.analysis.tables import SHORT_ID, list_not_ranked, list_ranking, shown_columns
from coartic.play.page import player_figure, preset_of
from coartic.robot import HANDS


def player(study: Study) -> str:
    """Return the interactive figure with the runs of a study as HTML.

    The user chooses a preset and a method in the figure. A preset consists of a task, or of two
    tasks, and a run of each method on each of its tasks. The presets are, in this order:

    - the two tasks of :func:`.shared_goal` together, if they share goal 1, and a method whose
      movements are straight solved both. This preset also has the posture difference of random
      search, if the study has such runs of random search (:func:`.contexts_of_control`);
    - each individual task that a method whose movements are straight solved.

    For each of these methods, a preset has the run whose reward is nearest to the median. The
    result is the empty string if there is no preset. It is also empty in another world than the
    paper's, because the script of the figure only knows the paper's model, and after some trials
    (:attr:`.Study.after`).

    The method that the figure shows first is

    - the first method from a file, in the order of :func:`.standings`, that is in a preset;
    - otherwise the method of :func:`.shared_goal`, if the shared goal is goal 1, and the method is
      in the first preset;
    - otherwise the paper's learner (EC1 if the first preset has one arm, EC4 if it has two), if it
      is in the first preset. The page of ``coartic play`` begins with this learner, too;
    - otherwise the first method of the first preset.
    """
    presets, first = [], ""
    if study.world or study.after:
        return ""
    if (shared := shared_goal(study)) is not None and shared.goal == 1:
        (up, down), first = shared.tasks, shared.method
        both = {
            **preset_of(up),
            "label": f"{up.label} or {down.label}",
            "others": down.goals[1:],
            "optimum": None,
        }
        both["runs"] = methods_played(study, [up.name, down.name])
        control = contexts_of_control(study, shared)
        by_chance = control.posture_difference if control else math.nan
        presets.append(both | {"by_chance": by_chance if math.isfinite(by_chance) else None})
    single_presets = {
        name: preset_of(task) | {"runs": methods_played(study, [name])}
        for name, task in study.individual_tasks.items()
    }
    single_presets = {name: preset for name, preset in single_presets.items() if preset["runs"]}
    presets = [preset for preset in (*presets, *single_presets.values()) if preset["runs"]]
    if not presets:
        return ""
    ids = [[run["id"] for run in preset["runs"]] for preset in presets]
    own = (
        {"preset": number, "who": method}
        for method in standings(study).query("not built_in").index
        for number, methods in enumerate(ids)
        if method in methods
    )
    learner = EC4 if len(presets[0]["task"]["hands"]) > 1 else EC1
    default = next((method for method in (first, learner) if method in ids[0]), ids[0][0])
    where = {name: presets.index(preset) for name, preset in single_presets.items()}
    return player_figure(
        presets,
        page=None,
        folder=study.folder_in_commands,
        first=next(own, {"who": default}),
        cells=[
            (cell, {"preset": where[task], "who": label})
            for cell, task, label in _cells_shown(study)
            if task in where and label in {run["id"] for run in single_presets[task]["runs"]}
        ],
    )


def _cells_shown(study: Study) -> Iterator[tuple[str, str, str]]:
    """Yield the table cells that show the gap of a method on a task.

    Each item consists of the id of the HTML cell, the name of the task, and the label of the
    method. The cells are those of the table of ranked methods and of the table of methods that are
    not ranked.
    """
    by_method = runs_by_method(study)
    for table in (list_ranking, list_not_ranked):
        frame = table(study)
        columns = [*shown_columns(table, study, frame)]
        for row, method in enumerate(frame.method):
            for task, label in cells_of(by_method[method]) if method in by_method else ():
                if f"on {task}" in columns:
                    column = columns.index(f"on {task}")
                    yield f"T_{table.id}_row{row}_col{column}", task, label


def methods_played(study: Study, tasks: list[str]) -> list[dict[str, Any]]:
    """Return the methods that solved a run on each given task, in the form that ``play.js`` reads.

    Each method is a dict with the keys

    - ``id``: label of the method;
    - ``name``: title of the method;
    - ``films``: a list with a film for each task (:func:`_film_of`). If there is more than one
      task, a film also has the key ``reached``: the postures of the first 500 solved runs at goal
      1, which the tasks share, as lists of numbers in length units and rad, rounded to three
      decimals.

    Methods with movements of kind ``path`` are left out, because the script only makes straight
    movements.
    """
    runs = []
    for label in study.methods.index:
        films = [_film_of(study, (name, label)) for name in tasks]
        if all(films):
            if len(tasks) > 1:
                for film, name in zip(films, tasks, strict=True):
                    film["reached"] = study.configurations(name, label)[:, 0].round(3).tolist()
            runs.append({"id": label, "name": study.methods.title[label], "films": films})
    return runs


def _film_of(study: Study, key: CellKey) -> dict[str, Any]:
    """Return the run of a cell whose reward is nearest to the median, for ``play.js``.

    The run is chosen from the first 500 solved runs. The result is a dict with the keys

    - ``run``: the first eight characters of the id of the run;
    - ``ticks``: ticks of the solution;
    - ``movements``: a list with a dict for each movement. Its keys are ``goal`` (from 0), ``hand``
      (index in HANDS), ``kind`` and ``target`` (a list in length units and rad, or None).

    The dict is empty if the cell has no solved run, or if a movement of one of the first 500 solved
    runs is of kind ``path``.
    """
    cell = shared_cells(study).get(key)
    if cell is None or not len(good := solved(cell)[:MAX_EXECUTED]):
        return {}
    run, stored = typical_run(good), study.movements("solution")
    if any(movement.kind == "path" for run_id in good.run_id for movement in stored[run_id]):
        return {}
    movements = [
        {
            "goal": movement.goal - 1,
            "hand": HANDS.index(movement.hand),
            "kind": movement.kind,
            "target": None if movement.target is None else movement.target.tolist(),
        }
        for movement in stored[run]
    ]
    ticks = sum(movement.ticks or 0 for movement in stored[run])
    return {"run": run[:SHORT_ID], "ticks": ticks, "movements": movements}
