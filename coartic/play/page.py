"""Make the page of ``coartic play``: one HTML file that needs no other file."""

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
"""Names of two tasks with the same start and first goal. By default the page begins with them."""


def play_page(task: Task | None = None) -> str:
    """Return the page of ``coartic play`` as HTML that needs no other file.

    The page offers the shipped tasks of the paper. It begins with ``task``, by default with the two
    tasks of :func:`up_or_down`.
    """
    presets = [preset_of(shipped) for shipped in shipped_tasks().values()]
    if task is None:
        presets.insert(0, up_or_down())
    else:
        preset = preset_of(task)
        presets = [preset, *(shipped for shipped in presets if shipped != preset)]
    return (
        templates()
        .get_template("page.html.jinja")
        .render(
            styles=part_of_page("page.css") + part_of_page("play.css"),
            figure=player_figure(presets),
            version=coartic.__version__,
        )
    )


def player_figure(presets: Sequence[dict[str, Any]], **options: Any) -> str:
    """Return the interactive figure as HTML.

    The page that contains the figure must include the styles of ``play.css``, and define the
    colours that ``play.css`` names.

    Parameters
    ----------
    presets : sequence of dict
        The tasks that the figure offers (:func:`preset_of`).
    **options
        Optional data for the scripts, such as :func:`coartic.analysis.report.player.player`
        returns:

        - ``page``: address to which links lead, or None for no links. By default the figure is the
          page itself, and links lead to its own address;
        - ``first``: dict that maps entries of the state of the figure, such as ``preset`` (an index
          of ``presets``) and ``who`` (who moves the robot), to their first values;
        - ``folder``: results folder with the stored runs, quoted for a shell;
        - ``cells``: a pair for each table cell that starts a film: the id of the HTML element, and
          a dict with ``preset`` and ``who``.
    """
    content = {"presets": presets, "version": coartic.__version__, **options}
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
    """Return a task as a dict for the interactive figure.

    The keys are

    - ``label``: the task's label, with † if its goals are reconstructed;
    - ``task``: dict of the task's fields that the figure needs, as plain data;
    - ``optimum``: the best known reward if it is proven to be the optimum, otherwise None.
    """
    keys = {"hands", "goals", "radius", "locked_base", "initial_hands", "start", "robot"}
    mark = " †" if "goals" in task.reconstructed else ""
    content = task.model_dump(mode="json", include=keys)
    content["robot"]["base_size"] = list(task.robot.drawn_base)
    best = best_shipped(task)
    optimum = best.reward if best and best.proven else None
    return {"label": f"{task.label}{mark}", "task": content, "optimum": optimum}


def up_or_down() -> dict[str, Any]:
    """Return a preset for the two tasks ``ascending`` and ``descending``.

    The result is the dict of :func:`preset_of` for ``ascending`` with the label ``Up or down``. Its
    ``optimum`` is None, and ``others`` contains the goals of ``descending`` after the first goal,
    which the tasks share.
    """
    up, down = (shipped_tasks()[name] for name in UP_OR_DOWN)
    return {**preset_of(up), "label": "Up or down", "others": down.goals[1:], "optimum": None}


def part_of_page(name: str) -> str:
    """Return the text of a file of this folder, without a first line ``"use strict";``."""
    return (FOLDER / name).read_text("utf-8").removeprefix('"use strict";\n')


@cache
def templates() -> Environment:
    """Return the Jinja environment for the templates next to this file.

    Each call returns the same object.
    """
    return Environment(
        loader=FileSystemLoader(FOLDER),
        undefined=StrictUndefined,
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
