"""Movements tick by tick as a GIF or an MP4, by the conventions of the paper's figures.

Open squares mark the left arm, closed circles the right one; goals are numbered circles,
filled from the tick at which they are hit. Thin lines trace both hands.
"""

from __future__ import annotations

import math
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.animation import FFMpegWriter, PillowWriter
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from coartic.drawing import box, draw_goals, draw_robot, fill_goals, number_goals
from coartic.errors import CoarticError
from coartic.files import check_output, write_output

if TYPE_CHECKING:
    from coartic.trajectories import Trajectory

FILMS = (".gif", ".mp4")
LASTS_S = 10.0
"""Seconds that the longest movement takes; one of fewer ticks than frames takes less."""
HOLD_S = 2.0
"""Seconds that the last frame stands."""
RATE = 12.5  # frames per second, at most: a GIF's file grows with its frames
_DPI = 100
_WEIGHT = 1.5  # of lines
_LEFT, _RIGHT, _BELOW, _ABOVE = 0.45, 0.05, 0.3, 0.5  # inches beside the axes


def write_film(
    movements: Sequence[tuple[str, Trajectory]],
    path: Path,
    *,
    width: int = 800,
    replace: bool = False,
) -> tuple[int, float]:
    """Draw movements with their titles side by side, all from their first tick, into ``path``.

    Returns the number of frames that differ, and the ticks that are shown in a second.

    ``width`` of the picture is in pixels. A movement that ends before the others stands still.
    Without ``replace`` no file is written over. Raises CoarticError for an ending that is not in
    :data:`FILMS`, for MP4 without ffmpeg, and where the file cannot be written.
    """
    check_film(path, replace=replace)
    ticks = max(len(movement.configurations) for _, movement in movements)
    if ticks == 0:
        raise CoarticError("there is no movement to draw: all goals are hit before the first tick")
    # A frame shows a tick or more, and stands for whole hundredths of a second, as GIF has them.
    speed = max(ticks / LASTS_S, RATE)
    stride = max(1, math.ceil(speed / RATE - 1e-9))
    interval_s = max(2, round(100 * stride / speed)) / 100
    rows = list(dict.fromkeys([*range(0, ticks, stride), ticks - 1]))
    held = max(1, round(HOLD_S / interval_s))
    figure, scenes = set_stage(movements, width)
    rate: Any = 1 / interval_s
    # Pillow's writer cuts milliseconds off to whole ones: half a one more, or 70 may become 69.
    gif_rate: Any = 1000 / (1000 * interval_s + 0.5)
    mp4 = path.suffix.lower() == ".mp4"
    writer = FFMpegWriter(rate, codec="h264") if mp4 else PillowWriter(gif_rate)
    try:
        with tempfile.TemporaryDirectory() as folder:
            film = Path(folder) / f"film{path.suffix.lower()}"
            with writer.saving(figure, str(film), _DPI):
                for row in [*rows, *[rows[-1]] * held]:
                    for show in scenes:
                        show(row)
                    writer.grab_frame()
            write_output(path, film.read_bytes(), replace=replace)
    except OSError as error:
        raise CoarticError(f"cannot write {path}: {error.strerror or error}") from None
    except subprocess.CalledProcessError as error:
        raise CoarticError(f"cannot write {path}: ffmpeg failed: {error.stderr}") from None
    return len(rows), stride / interval_s


def check_film(path: Path, *, replace: bool = False) -> None:
    """Raises CoarticError for what cannot be written: before anything is drawn.

    An ending that is not supported, MP4 without ffmpeg, what :func:`check_output` refuses.
    """
    if path.suffix.lower() not in FILMS:
        raise CoarticError(f"--out {path}: the name must end in {', '.join(FILMS)}")
    if path.suffix.lower() == ".mp4" and not FFMpegWriter.isAvailable():
        raise CoarticError(f"--out {path}: MP4 needs ffmpeg; install it, or choose a .gif")
    check_output(path, replace=replace)


def set_scene(axes: Axes, movement: Trajectory) -> Callable[[int], None]:
    """Draw what moves in one picture.

    Returns a function that shows the state at a row of the movement, or at its last one: artists
    are updated, never drawn anew.
    """
    task = movement.task
    paths = {hand: movement.hand_path(hand) for hand in task.hands}
    traces = {hand: axes.plot([], [], color="0.6", linewidth=1)[0] for hand in task.hands}
    goals = draw_goals(axes, task, weight=_WEIGHT)
    move = draw_robot(axes, task, task.q0, weight=_WEIGHT)
    status = axes.text(
        0.0, 1.01, "", transform=axes.transAxes, fontsize=9, va="bottom", parse_math=False
    )

    def show(row: int) -> None:
        row = min(row, len(movement.configurations) - 1)
        move(movement.configurations[row])
        for hand, trace in traces.items():
            trace.set_data(*paths[hand][: row + 1].T)
        hit = movement.hits <= row
        fill_goals(goals, hit)
        state = "done"
        if not hit.all():
            goal = int(np.argmin(hit))
            state = f"goal {goal + 1} with the {movement.hands[goal]} hand"
        status.set_text(f"reward −{row + 1}   {state}")

    return show


def set_stage(
    movements: Sequence[tuple[str, Trajectory]], width: int
) -> tuple[Figure, list[Callable[[int], None]]]:
    """A figure ``width`` pixels wide with a scene per movement, all showing the same place, and
    the functions that show their rows."""
    corners = np.array([box(movement.task, movement.configurations) for _, movement in movements])
    low, high = corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)
    across, up = high - low
    inches, count = width / _DPI, len(movements)
    wide = inches / count - _LEFT - _RIGHT
    # Even in pixels, as MP4 wants it.
    height = 2 * round((wide * up / across + _ABOVE + _BELOW) * _DPI / 2) / _DPI
    figure = Figure(figsize=(inches, height), dpi=_DPI)
    for index, (title, movement) in enumerate(movements):
        left, tall = index / count + _LEFT / inches, 1 - (_ABOVE + _BELOW) / height
        axes = figure.add_axes((left, _BELOW / height, wide / inches, tall), aspect="equal")
        axes.set_xlim(low[0], high[0])
        axes.set_ylim(low[1], high[1])
        number_goals(axes, movement.task, weight=_WEIGHT, fontsize=9)
        axes.set_title(title, fontsize=9, loc="left", pad=18, parse_math=False)
        axes.tick_params(labelsize=8)
        axes.spines[["top", "right"]].set_visible(False)
    # What stands still takes most of the time of drawing: it is drawn once, as a picture.
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    figure.figimage(np.array(canvas.buffer_rgba()), zorder=-1)
    for axes in figure.axes:
        axes.set_axis_off()
        axes.set_title("", loc="left")
        for text in list(axes.texts):
            text.remove()
    return figure, [
        set_scene(axes, movement)
        for axes, (_, movement) in zip(figure.axes, movements, strict=True)
    ]
