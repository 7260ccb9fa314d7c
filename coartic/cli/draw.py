"""Commands that draw."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from coartic.cli import arguments as given
from coartic.cli.terminal import say
from coartic.errors import CoarticError
from coartic.text import counted

_PICTURED = 12
"""Tasks of a picture, at most."""


def draw(
    tasks: Annotated[
        list[str] | None,
        typer.Argument(metavar="TASK", help="Tasks, task files, or long/v1/i000..i003."),
    ] = None,
    out: Annotated[
        Path,
        typer.Option(
            parser=given.output_named,
            metavar="FILE",
            help="Picture (.png, .svg, .pdf), or a folder.",
        ),
    ] = Path("tasks.svg"),
    replace: given.Replace = False,
) -> None:
    """Draw tasks, or write them into a folder as files."""
    from coartic import builtin_tasks, load_task
    from coartic.files import check_output, publish, write_output
    from coartic.tasks.families import named_by, task_text

    names = [name for text in tasks or builtin_tasks() for name in named_by(text)]
    chosen = [load_task(name) for name in dict.fromkeys(names)]
    from coartic.analysis.figures.plot import FORMATS, picture  # slow, after quick errors
    from coartic.analysis.topics.tasks import draw_tasks

    drawing = draw_tasks(chosen[:_PICTURED])
    if out.suffix:
        if out.suffix.lower() not in FORMATS:
            raise CoarticError(f"--out {out}: the name must end in {', '.join(FORMATS)}.")
        check_output(out, replace=replace)
        write_output(out, picture(drawing, out.suffix.lower()), replace=replace)
    else:
        files = {f"{task.name}.toml": task_text(task).encode() for task in chosen}
        files |= {"tasks.svg": picture(drawing, ".svg")}
        publish(out, files)
    say(f"{out}: {counted(len(chosen), 'task')}.")


def animate(
    run_id: given.RunId,
    out: Annotated[
        Path,
        typer.Option(
            parser=given.output_named, metavar="FILE", help="Film to write: .gif or .mp4."
        ),
    ],
    other: Annotated[
        str | None, typer.Argument(metavar="OTHER_RUN", help="A run to show beside it.")
    ] = None,
    folder: given.In = Path("results"),
    initial: Annotated[
        bool, typer.Option("--initial", help="Show the initial solution beside it.")
    ] = False,
    width: Annotated[
        int, typer.Option(min=200, max=3840, metavar="N", help="Width in pixels.")
    ] = 800,
    replace: given.Replace = False,
) -> None:
    """Make a film of a run, alone or beside another one."""
    from coartic import corrective_trial, initial_hands, trajectory
    from coartic.analysis.methods import name_of
    from coartic.benchmarks.reproduce import find_run, trajectory_of
    from coartic.film import check_film, write_film

    check_film(out, replace=replace)
    if initial and other is not None:
        raise CoarticError("--initial shows one run beside its initial solution: give one run.")
    panels = []
    for name in (run_id,) if other is None else (run_id, other):
        place, run = find_run(name, folder)
        movement, number = trajectory_of(place, run), run.key.number
        title = f"{movement.task.label}: {name_of(run.setting.method)}, run {number}"
        panels.append((title, movement))
    if initial:
        task = panels[0][1].task
        hands = initial_hands(task, model=run.setting.model)
        movements = corrective_trial(task, hands, model=run.setting.model).movements
        initial_solution = trajectory(task, movements, model=run.setting.model)
        panels.insert(0, (f"{task.label}: initial solution", initial_solution))
    frames, ticks_a_second = write_film(panels, out, width=width, replace=replace)
    say(f"{out}: {frames} frames, {ticks_a_second:.0f} ticks a second.")
