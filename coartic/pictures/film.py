"""Movements tick by tick as a GIF or an MP4, in the colours of the play page.

Open squares mark the left arm, closed circles the right arm; goals are numbered circles, filled
from the tick at which they are hit, when the film pauses. Pale lines trace the hands.
"""

from __future__ import annotations

import math
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.animation import FFMpegWriter, PillowWriter
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from coartic.errors import CoarticError
from coartic.internal.files import check_ending, check_output, errors_in_words, write_output
from coartic.internal.text import counted
from coartic.pictures.drawing import box, circle_goals, draw_robot, fill_goals, number_goals

if TYPE_CHECKING:
    from coartic.pictures.trajectories import Trajectory

LASTS_S = 10.0
"""About the seconds, without pauses, of the longest movement; of fewer than 125 ticks less."""
PAUSE_S, HOLD_S = 0.5, 2.5
"""About the seconds that the film stands where a goal is hit, and at the end."""
COLOURS = "#0072b2", "#c04a00"
RATE = 12.5  # frames per second, at most: a GIF's file grows with its frames
_DPI = 100
_WEIGHT = 2.0  # of lines
_COUNTER: Any = {"fontsize": 13, "fontweight": "bold", "va": "bottom"}
_BESIDE, _BELOW, _ABOVE = 0.08, 0.05, 0.65  # inches beside the axes


def write_film(
    movements: Sequence[tuple[str, Trajectory]],
    path: Path,
    *,
    width: int = 800,
    replace: bool = False,
) -> tuple[int, float]:
    """Write a film, ``width`` pixels wide (MP4: up to 2 fewer), of movements side by side, all from
    their first tick; return the number of frames that differ, and about how many ticks are shown in
    a second.

    ``movements`` are pairs of a title and a trajectory. A movement that ends before the longest
    movement then stands still. Raises CoarticError for a movement without a tick, for an ending
    other than .gif and .mp4, for MP4 without ffmpeg, and if the file cannot be written, or is there
    without ``replace``."""
    check_ending(path, [".gif", ".mp4"])
    is_mp4 = path.suffix.lower() == ".mp4"
    if is_mp4 and not FFMpegWriter.isAvailable():
        raise CoarticError(f"{path}: MP4 needs ffmpeg; install it, or choose a .gif")
    check_output(path, replace=replace)
    lengths = [len(movement.configurations) for _, movement in movements]
    if 0 in lengths:
        raise CoarticError("there is no movement to draw: all goals are hit before the first tick")
    ticks = max(lengths)
    # A frame shows a tick or more, and stands for whole hundredths of a second, as GIF has them.
    speed = max(ticks / LASTS_S, RATE)
    stride = max(1, math.ceil(speed / RATE - 1e-9))
    interval_s = max(2, round(100 * stride / speed)) / 100
    hits = {int(hit) for _, movement in movements for hit in movement.hits}
    rows = sorted({*range(0, ticks, stride), *hits, ticks - 1})
    stands = dict.fromkeys(hits, PAUSE_S) | {ticks - 1: HOLD_S}
    figure, scenes = set_stage(movements, width)
    rate: Any = 1 / interval_s
    # Pillow's writer cuts milliseconds off to whole ones: half a one more, or 70 may become 69.
    gif_rate: Any = 1000 / (1000 * interval_s + 0.5)
    writer = FFMpegWriter(rate, codec="h264") if is_mp4 else PillowWriter(gif_rate)
    try:
        with errors_in_words(path), tempfile.TemporaryDirectory() as folder:
            film = Path(folder) / f"film{path.suffix.lower()}"
            with writer.saving(figure, str(film), _DPI):
                for row in rows:
                    for show in scenes:
                        show(row)
                    for _ in range(1 + round(stands.get(row, 0) / interval_s)):
                        writer.grab_frame()
            write_output(path, film.read_bytes(), replace=replace)
    except subprocess.CalledProcessError as error:
        raise CoarticError(f"cannot write {path}: ffmpeg failed: {error.stderr}") from None
    return len(rows), stride / interval_s


def _set_scene(axes: Axes, movement: Trajectory, colour: str) -> Callable[[int], None]:
    """Draw goals, robot, paths of the hands and a counter of ticks, and return a function that
    updates the drawing to a row of the movement's configurations, from 0; a row past the end shows
    the last configuration."""
    task = movement.task
    paths = {hand: movement.hand_path(hand) for hand in task.hands}
    traces = {hand: axes.plot([], [], color=colour, alpha=0.4)[0] for hand in task.hands}
    goals = circle_goals(axes, task, weight=_WEIGHT)
    move = draw_robot(axes, task, task.q0, weight=_WEIGHT, colour=colour)
    counter = axes.text(0, 1.01, "", transform=axes.transAxes, color=colour, **_COUNTER)

    def show(row: int) -> None:
        row = min(row, len(movement.configurations) - 1)
        move(movement.configurations[row])
        for hand, trace in traces.items():
            trace.set_data(*paths[hand][: row + 1].T)
        fill_goals(goals, movement.hits <= row)
        counter.set_text(counted(row + 1, "tick"))

    return show


def set_stage(
    movements: Sequence[tuple[str, Trajectory]], width: int
) -> tuple[Figure, list[Callable[[int], None]]]:
    """Return a figure ``width`` pixels wide with axes for each of ``movements``, pairs of a title
    and a trajectory, all over the same region, and for each movement a function that shows a row of
    its configurations, from 0."""
    corners = np.array([box(movement.task, movement.configurations) for _, movement in movements])
    low, high = corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)
    across, up = high - low
    inches, count = width / _DPI, len(movements)
    wide = inches / count - 2 * _BESIDE
    # Even in pixels, as MP4 wants it.
    height = 2 * round((wide * up / across + _ABOVE + _BELOW) * _DPI / 2) / _DPI
    figure = Figure(figsize=(inches, height), dpi=_DPI)
    for index, (title, movement) in enumerate(movements):
        left, tall = index / count + _BESIDE / inches, 1 - (_ABOVE + _BELOW) / height
        axes = figure.add_axes((left, _BELOW / height, wide / inches, tall), aspect="equal")
        axes.set_xlim(low[0], high[0])
        axes.set_ylim(low[1], high[1])
        number_goals(axes, movement.task, weight=_WEIGHT, fontsize=9)
        axes.set_title(title, fontsize=9, loc="left", pad=24, parse_math=False)
        axes.set_xticks(range(math.ceil(low[0]), math.ceil(high[0])), [])
        axes.set_yticks(range(math.ceil(low[1]), math.ceil(high[1])), [])
        axes.tick_params(length=0)
        axes.spines[:].set_visible(False)
        axes.grid(color="0.92")
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
        _set_scene(axes, movement, colour)
        for axes, (_, movement), colour in zip(figure.axes, movements, cycle(COLOURS), strict=False)
    ]
