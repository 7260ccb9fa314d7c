"""The figure to play with, of `coartic play`, with the runs of a folder.

It begins with the stored runs, as their movements are stored. When a goal is moved, the learner
or another method answers anew.
"""

from __future__ import annotations

from typing import Any

from coartic.analysis.methods import RANDOM_SEARCH
from coartic.analysis.random_search import every_random_search_for
from coartic.analysis.sections.coarticulation import shared_goal
from coartic.analysis.sections.own import own_methods
from coartic.analysis.standings import compared
from coartic.analysis.study import MOST_EXECUTED, CellKey, Study, one_by_one, typical_run
from coartic.play.page import figure, preset_of
from coartic.robot import HANDS


def player(study: Study) -> str:
    """The figure as HTML; empty where no run has a solution.

    Of each task it has, for each method of figures that moves straight, the run nearest its median
    reward. It begins with one goal before two others if two tasks share one.
    """
    presets, first = [], ""
    if (shared := shared_goal(study)) is not None and shared.goal == 1:
        widths = every_random_search_for(study, shared)
        strongest = max(
            widths,
            key=lambda each: (
                each.standardised_posture_difference >= 0,
                each.standardised_posture_difference,
            ),
            default=None,
        )
        (up, down), first = shared.tasks, shared.method
        both = {**preset_of(up), "label": f"{up.label} or {down.label}", "others": down.goals[1:]}
        random_search = RANDOM_SEARCH if strongest is None else strongest.method
        presets.append(both | {"runs": methods_played(study, [up.name, down.name], random_search)})
    alone = {
        name: preset_of(task) | {"runs": methods_played(study, [name])}
        for name, task in one_by_one(study).items()
    }
    alone = {name: preset for name, preset in alone.items() if preset["runs"]}
    presets = [preset for preset in (*presets, *alone.values()) if preset["runs"]]
    if not presets:
        return ""
    begin = first_shown(study, presets, first)
    where = {name: presets.index(preset) for name, preset in alone.items()}
    return figure(
        presets,
        still="<p>The movements are played by a script, and scripts are switched off here.</p>",
        page=None,
        first=begin,
        cells=[
            (method, f"on {task}", {"preset": where[task], "who": cell.label})
            for method, cells in compared(study).items()
            for task, cell in cells.items()
            if task in where and cell.label in {run["id"] for run in alone[task]["runs"]}
        ],
    )


def first_shown(study: Study, presets: list[dict[str, Any]], preferred: str) -> dict[str, Any]:
    """Return the preset and the method of the film that is chosen at first: of the nearest method
    from a file if there is one, or else of the preferred method if the first preset has it."""
    ids = [[run["id"] for run in preset["runs"]] for preset in presets]
    for method in own_methods(study):
        for number, played in enumerate(ids):
            if method in played:
                return {"preset": number, "who": method}
    return {"who": preferred if preferred in ids[0] else ids[0][0]}


def methods_played(
    study: Study, tasks: list[str], random_search: str = RANDOM_SEARCH
) -> list[dict[str, Any]]:
    """Methods with solved runs on all of these tasks: their names, and of each task the movements
    of the run nearest the median reward; of several tasks also the postures of all runs at goal 1,
    which they share. Methods that follow paths are left out: the script moves straight. Of random
    search it has those with the label ``random_search``, which the script puts beside the
    others."""
    runs = []
    for label in study.methods.index:
        played = random_search if label == RANDOM_SEARCH else label
        films = [film_of(study, (name, played)) for name in tasks]
        if all(films):
            if len(tasks) > 1:
                for film, name in zip(films, tasks, strict=True):
                    film["reached"] = study.configurations(name, played)[:, 0].round(3).tolist()
            runs.append({"id": label, "name": study.methods.title[played], "films": films})
    return runs


def film_of(study: Study, key: CellKey) -> dict[str, Any]:
    """The run of a cell nearest the median reward, as ``model.js`` executes it; empty where a cell
    has no solution, or one that follows a path."""
    if key not in study.cells or not len(study.cells[key].good):
        return {}
    good = study.cells[key].good[:MOST_EXECUTED]
    run, stored = typical_run(good), study.movements("solution")
    if any(movement.kind == "path" for each in good.run_id for movement in stored[each]):
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
    return {"run": run, "ticks": ticks, "movements": movements}
