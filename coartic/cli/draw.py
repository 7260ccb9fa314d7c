"""Commands that draw: pictures of tasks, films of runs, and the page to play with."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from coartic.cli import arguments as given
from coartic.cli.terminal import say
from coartic.errors import CoarticError
from coartic.internal.files import folder_named
from coartic.internal.text import counted

_PICTURED = 12
"""Most tasks of a picture."""


def draw(
    tasks: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="TASK",
            help="Tasks, task files, or long/v1/i000..i003; with --run a results folder.",
        ),
    ] = None,
    run: Annotated[
        list[str] | None, given.option("ID", "A run to film; two are side by side.", "--run")
    ] = None,
    initial: Annotated[
        bool, typer.Option("--initial", help="Film the corrective process alone next to the run.")
    ] = False,
    recording: Annotated[
        Path | None,
        given.file_or_folder("FILE", "Recorded hits or markers (CSV) to draw.", "--recording"),
    ] = None,
    ticks_per_unit: Annotated[
        float | None,
        given.within("--ticks-per-unit", "Ticks in a unit of time of the recording.", 1e-9, 1e9),
    ] = None,
    width: Annotated[
        int | None, given.within("--width", "Width of the film in pixels; 800.", 200, 3840)
    ] = None,
    out: Annotated[
        Path | None,
        given.file_or_folder(
            "FILE", "Picture (.png, .svg, .pdf), or a folder; of runs a film (.gif, .mp4)."
        ),
    ] = None,
    replace: given.Replace = False,
) -> None:
    """Draw tasks (a folder also gets their files), film runs, or draw a recording."""
    if recording:
        if run or initial or width is not None:
            raise CoarticError("--run, --initial or --width has no effect with --recording")
        if len(tasks := tasks or []) != 1:
            raise CoarticError("--recording needs one task: coartic draw TASK --recording FILE")
        return _draw_recording(tasks[0], recording, ticks_per_unit, out, replace)
    if ticks_per_unit is not None:
        raise CoarticError("--ticks-per-unit has no effect without --recording")
    if run:
        if len(tasks := tasks or []) != 1:
            raise CoarticError("--run needs one results folder: coartic draw FOLDER --run ID")
        film = out or Path("film.gif")
        return _film(folder_named(tasks[0]), run, film, initial, width or 800, replace)
    if initial or width is not None:
        raise CoarticError("--initial or --width has no effect without --run, which names a run")
    from coartic import builtin_tasks, load_task
    from coartic.internal.files import check_ending, check_output, publish, write_output
    from coartic.runs.plan import tasks_by_name
    from coartic.tasks.families import named_by
    from coartic.tasks.task import task_text

    for folder in [name for name in tasks or () if Path(name).is_dir()]:
        raise CoarticError(
            f"{folder} is a folder: coartic draw {folder} --run ID films a run; coartic list "
            f"{folder} has the ids"
        )
    out = out or Path("tasks.svg")
    if replace and not out.suffix:
        raise CoarticError("--replace has no effect on a folder, whose pictures are written again")
    meant = given.tasks_meant(tasks or builtin_tasks())
    names = [name for text in meant for name in named_by(text)]
    chosen = [*tasks_by_name(map(load_task, names)).values()]
    from coartic.analysis.figures.drawings import picture_of_tasks
    from coartic.analysis.figures.plot import FORMATS, picture  # slow imports, after the checks

    if out.suffix:
        check_ending(out, FORMATS)
        check_output(out, replace=replace)
    drawing = picture_of_tasks(chosen[:_PICTURED])
    if out.suffix:
        write_output(out, picture(drawing, out.suffix.lower()), replace=replace)
    else:
        files = {f"{task.name}.toml": task_text(task).encode() for task in chosen}
        files |= {"tasks.svg": picture(drawing, ".svg")}
        publish(out, files)
    drawn = f", of which {_PICTURED} are drawn" if len(chosen) > _PICTURED else ""
    return say(f"{out}: {counted(len(chosen), 'task')}{drawn}.")


def _draw_recording(
    task_name: str, recording: Path, ticks_per_unit: float | None, out: Path | None, replace: bool
) -> None:
    """Write a picture of a recording. Raises CoarticError if the recording cannot be read, and,
    after the picture is written, if its hits do not fit the task."""
    from coartic import load_task
    from coartic.analysis.figures.plot import FORMATS, picture
    from coartic.analysis.recordings import (
        draw_recording,
        hits_from_markers,
        is_of_markers,
        read_hits,
        solutions_of,
    )
    from coartic.internal.files import check_ending, check_output, write_output

    out = out or Path("recording.svg")
    check_ending(out, FORMATS)
    check_output(out, replace=replace)
    task = load_task(given.tasks_meant([task_name])[0])
    if has_markers := is_of_markers(recording):
        drawing = draw_recording(None, task, recording, ticks_per_unit=ticks_per_unit)
    else:
        drawing = draw_recording(recording, task, ticks_per_unit=ticks_per_unit)
    write_output(out, picture(drawing, out.suffix.lower()), replace=replace)
    say(f"{out}: {recording}.")  # also where the hits are refused
    if has_markers:
        hits = hits_from_markers(recording, task, ticks_per_unit=ticks_per_unit or 100.0)
    else:
        hits = read_hits(recording, task, ticks_per_unit=ticks_per_unit or 1.0)
    solutions = solutions_of(task, hits)
    finished = counted(len(solutions.runs), "trial")
    say(f"{finished} with all goals hit, {solutions.unfinished} with a goal missed.")


def _film(
    folder: Path, run_ids: Sequence[str], out: Path, initial: bool, width: int, replace: bool
) -> None:
    """Write a film (.gif, .mp4), ``width`` pixels wide (MP4: rounded down to even), of one or two
    runs of a results folder side by side, or, with ``initial``, of one run next to the corrective
    process alone. Raises CoarticError for more or unknown runs, and if the film cannot be made or
    written."""
    from coartic import corrective_trial, initial_hands, trajectory
    from coartic.analysis.methods import title_of
    from coartic.benchmarks.reproduce import find_run, trajectory_of
    from coartic.pictures.film import write_film

    if len(run_ids) + initial > 2:
        raise CoarticError("a film shows at most two runs, or one run with --initial")
    movements = []
    for run_id in run_ids:
        stored = find_run(run_id, folder)
        movement = trajectory_of(stored)
        title = f"{movement.task.label}\n{title_of(stored.cell.method)}, run {stored.number}"
        movements.append((title, movement))
    if initial:
        on = movements[0][1].task
        initial_solution = trajectory(on, corrective_trial(on, initial_hands(on)).movements)
        movements.insert(0, (f"{on.label}\ncorrective process alone", initial_solution))
    frames, ticks_a_second = write_film(movements, out, width=width, replace=replace)
    say(f"{out}: {frames} frames, {ticks_a_second:.0f} ticks a second.")


def play(
    task: Annotated[
        str | None,
        typer.Argument(metavar="TASK", help="Task to begin with, or a task file (.toml)."),
    ] = None,
    out: given.Out = None,
    show: Annotated[bool, typer.Option("--open/--no-open", help="Open it in the browser.")] = True,
    replace: given.Replace = False,
) -> None:
    """Write a page on which goals can be moved and the learner learns; open it in the browser."""
    import webbrowser

    from coartic import load_task
    from coartic.internal.files import check_ending, check_output, write_output
    from coartic.play.page import play_page

    if replace and out is None:
        raise CoarticError("--replace has no effect without --out")
    if out is not None:
        check_ending(out, [".html"])
        check_output(out, replace=replace)
    chosen = [] if task is None else given.tasks_meant([task])
    page = play_page(*map(load_task, chosen)).encode()
    out = out or Path(tempfile.mkdtemp(prefix="coartic-"), "play.html")
    write_output(out, page, replace=replace)
    opened = show and webbrowser.open(out.absolute().as_uri())
    say(f"{out}: {len(page) // 1000} kB" + ("." if opened else "; open it in a browser."))
