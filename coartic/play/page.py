"""The page of `coartic play`: one HTML file, which needs no other and no network."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

import coartic
from coartic.tasks.optima import best_shipped
from coartic.tasks.task import Task, shipped_tasks

FOLDER = Path(__file__).parent
UP_OR_DOWN = ("ascending", "descending")
"""Tasks that share start and first goal: with them the page begins by default."""


def play_page(task: Task | None = None) -> str:
    """Return the page of ``coartic play``, one HTML file that needs no other: it begins with
    ``task``, by default with :func:`up_or_down`, and offers all shipped tasks."""
    presets = [preset_of(each) for each in shipped_tasks().values()]
    if task is None:
        presets.insert(0, up_or_down())
    else:
        own = preset_of(task)
        presets = [own, *(preset for preset in presets if preset != own)]
    return (
        templates()
        .get_template("page.html.jinja")
        .render(
            styles=part_of_page("page.css") + part_of_page("play.css"),
            figure=player_figure(presets),
            version=coartic.__version__,
        )
    )


def player_figure(presets: Sequence[dict[str, Any]], **more: Any) -> str:
    """Return the figure to play with as HTML. The page has to have the styles of ``play.css``, and
    to define the colours that ``play.css`` names.

    ``presets`` are the tasks that the figure offers (:func:`preset_of`). ``more`` is optional data
    for the scripts, such as :func:`coartic.analysis.report.player.player` gives: ``page``, the
    address to which links lead, None for no link; ``first``, what is shown at first; ``folder``,
    the folder with the stored runs, quoted for a shell; ``cells``, the fields of tables that
    start films, each with the id of the field and the film.
    """
    content = {"presets": presets, "version": coartic.__version__, **more}
    data = json.dumps(content, allow_nan=False, separators=(",", ":"))
    return (
        templates()
        .get_template("figure.html.jinja")
        .render(
            still=part_of_page("still.svg"),
            data=data.replace("<", "\\u003c"),
            model="\n".join(map(part_of_page, ("model.js", "worker.js"))),
            script="\n".join(map(part_of_page, ("picture.js", "play.js", "begin.js"))),
        )
    )


def preset_of(task: Task) -> dict[str, Any]:
    """Return a task as the figure offers it: ``label``, with † if its goals are reconstructed;
    ``task``, the fields that the figure needs as plain data; and ``optimum``, the reward of the
    best known solution if it is proven to be the best, or None."""
    keys = {"hands", "goals", "radius", "locked_base", "initial_hands", "start", "robot"}
    mark = " †" if "goals" in task.reconstructed else ""
    content = task.model_dump(mode="json", include=keys)
    content["robot"]["base_size"] = list(task.robot.drawn_base)
    best = best_shipped(task)
    optimum = best.reward if best and best.proven else None
    return {"label": f"{task.label}{mark}", "task": content, "optimum": optimum}


def up_or_down() -> dict[str, Any]:
    """Return a preset (:func:`preset_of`) for two tasks with the same first goal: ``task`` is
    ``ascending``, ``others`` are the later goals of ``descending``, and ``optimum`` is None."""
    up, down = (shipped_tasks()[name] for name in UP_OR_DOWN)
    return {**preset_of(up), "label": "Up or down", "others": down.goals[1:], "optimum": None}


def part_of_page(name: str) -> str:
    """Return the text of file ``name`` of this folder, without a first line ``"use strict";``."""
    return (FOLDER / name).read_text("utf-8").removeprefix('"use strict";\n')


@cache
def templates() -> Environment:
    """Return Jinja's environment of the templates next to this file, always the same object."""
    return Environment(
        loader=FileSystemLoader(FOLDER),
        undefined=StrictUndefined,
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
