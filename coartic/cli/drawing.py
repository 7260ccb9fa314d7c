"""Commands that draw."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from coartic.cli import arguments as given
from coartic.cli.arguments import names_in
from coartic.cli.terminal import say
from coartic.errors import CoarticError
from coartic.text import one_line

if TYPE_CHECKING:
    from coartic import MotionModel, Task
    from coartic.analysis.figures.animation import Panel

GROUP = "Draw"


def draw(
    out: Annotated[Path, typer.Option(help="Picture to write: .png, .svg or .pdf.")],
    tasks: given.TasksToDraw = None,
    task_file: given.TaskFiles = None,
    replace: given.Replace = False,
) -> None:
    """Draw start configuration and goals of tasks; FAMILY/v1/i000..i003 are several."""
    from coartic import builtin_tasks, load_task
    from coartic.families import named_by
    from coartic.files import check_outputs, write_outputs

    names = [name for text in names_in(tasks, "--tasks") for name in named_by(text)]
    if not names and not task_file:
        names = list(builtin_tasks())
    chosen = [load_task(name) for name in dict.fromkeys(names)] + [
        load_task(path) for path in task_file or []
    ]
    from coartic.analysis.figures.plot import FORMATS, picture  # after what is soon said
    from coartic.analysis.figures.tasks import tasks_plot

    if out.suffix.lower() not in FORMATS:
        raise CoarticError(f"--out {out}: the name must end in {', '.join(FORMATS)}")
    check_outputs([out], replace=replace)
    write_outputs({out: picture(tasks_plot(chosen), out.suffix.lower())}, replace=replace)
    say(f"{', '.join(task.name for task in chosen)} drawn in {out}.")


def animate(
    run_id: given.RunId,
    out: Annotated[Path, typer.Option(help="Film to write: .gif, .svg or .mp4 (needs ffmpeg).")],
    other: Annotated[
        str | None, typer.Argument(metavar="[OTHER_RUN_ID]", help="A run to show beside it.")
    ] = None,
    folder: given.Records = Path("results"),
    initial: Annotated[
        bool, typer.Option("--initial", help="Show the task's initial solution beside it.")
    ] = False,
    speed: Annotated[
        float | None,
        typer.Option(min=0.1, max=10_000, help="Ticks per second; by default some 10 s in all."),
    ] = None,
    width: Annotated[int, typer.Option(min=200, max=3840, help="Width in pixels.")] = 800,
    replace: given.Replace = False,
) -> None:
    """Show a run's solution tick by tick, alone or beside another one."""
    from coartic.analysis.figures.animation import Panel, animate, check_output
    from coartic.benchmarks.reproduce import find_record, trajectory_of

    check_output(out, replace=replace)
    if initial and other is not None:
        raise CoarticError("--initial shows one run beside its initial solution: give one run id")
    panels = []
    for name in (run_id,) if other is None else (run_id, other):
        _, record = find_record(name, folder)
        found = trajectory_of(record)
        title = one_line(f"{found.task.name}: {record.method}, run {record.run}")
        panels.append(Panel(title, found))
    if initial:
        panels.insert(0, _initial_panel(panels[0].trajectory.task, record.model))
    timed = animate(panels, out, speed=speed, width=width, replace=replace)
    say(
        f"{' beside '.join(panel.title for panel in panels)} in {out}: "
        f"{len(timed.rows)} frames, {timed.stride / timed.interval_s:.0f} ticks a second."
    )


def _initial_panel(task: Task, model: MotionModel) -> Panel:
    from coartic import corrective_trial, initial_hands, trajectory
    from coartic.analysis.figures.animation import Panel

    movements = corrective_trial(task, initial_hands(task, model=model), model=model).movements
    return Panel(f"{task.name}: initial solution", trajectory(task, movements, model=model))


COMMANDS = (draw, animate)
