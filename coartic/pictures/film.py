"""Films of movements (GIF or MP4) in the colours of the page of ``coartic play``.

Open squares mark the left arm, closed circles the right arm. Goals are numbered circles. A goal is
filled from the tick at which it is hit, and the film pauses at this tick. Pale lines trace the
hands.
"""

from __future__ import annotations

import math
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from itertools import cycle
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from matplotlib.animation import FFMpegWriter, FuncAnimation, PillowWriter
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from coartic.errors import CoarticError
from coartic.internal.files import check_ending, check_output, describe_os_errors, write_output
from coartic.internal.text import pluralize
from coartic.pictures.drawing import box, circle_goals, draw_robot, fill_goals, number_goals
from coartic.robot import Array, Hand
from coartic.tasks.task import Task

RATE = 12.5
"""Frames per second. In a GIF, a frame must last an integer number of hundredths of a second."""
MAX_FRAMES = 125
"""Largest number of equally spaced frames of a film. A film of more ticks does not show each tick,
but it always shows the ticks at which goals are hit, and the last tick, in further frames."""
PAUSE, HOLD = 6, 30
"""Number of frames for which a film stands still when a goal is hit, and at the end."""
COLOURS = "#0072b2", "#c04a00"
_DPI = 100
_WEIGHT = 2.0  # of lines


class Movement(Protocol):
    """What a film shows: a :class:`.Trajectory`."""

    @property
    def task(self) -> Task:
        """The task."""

    @property
    def configurations(self) -> Array:
        """Configurations, a row for each control tick."""

    @property
    def hits(self) -> NDArray[np.int64]:
        """Index of the row in which each goal was hit."""

    def hand_path(self, hand: Hand) -> Array:
        """Return the position of a hand in each row of ``configurations``."""


def write_film(
    movements: Sequence[tuple[str, Movement]],
    path: Path,
    *,
    width: int = 800,
    replace: bool = False,
) -> tuple[int, float]:
    """Write a film that shows movements side by side, all from their first tick.

    Parameters
    ----------
    movements : sequence of (str, Trajectory)
        Titles and movements, at least one. A movement that ends earlier than the longest one stands
        still afterwards.
    path : pathlib.Path
        The file, ``.gif`` or, if ffmpeg is installed, ``.mp4``.
    width : int
        Width in pixels. The width of an MP4 is even, and can be up to 2 pixels less.
    replace : bool
        True to overwrite an existing file.

    Returns
    -------
    int
        Number of frames, without the repeated frames of pauses.
    float
        Number of ticks that the film shows in a second, outside pauses.

    Raises
    ------
    CoarticError
        A movement has no tick, the file has another suffix, ffmpeg is missing or fails, the file
        exists and ``replace`` is False, or the file cannot be written.
    """
    check_ending(path, [".gif", ".mp4"])
    is_mp4 = path.suffix.lower() == ".mp4"
    if is_mp4 and not FFMpegWriter.isAvailable():
        raise CoarticError(f"{path}: MP4 needs ffmpeg, which is not installed; use a .gif instead")
    check_output(path, replace=replace)
    lengths = [len(movement.configurations) for _, movement in movements]
    if 0 in lengths:
        raise CoarticError(
            f"{path}: the film has no movement to draw, because all goals are hit before the first "
            "tick"
        )
    stride, end = math.ceil(max(lengths) / MAX_FRAMES), max(lengths) - 1
    hits = {int(hit) for _, movement in movements for hit in movement.hits}
    rows = sorted({*range(0, end, stride), *hits, end})
    shown = [row for row in rows
             for _ in range(HOLD if row == end else PAUSE if row in hits else 1)]  # fmt: skip
    figure, show = stage(movements, width)
    rate: Any = RATE
    writer = FFMpegWriter(rate, codec="h264") if is_mp4 else PillowWriter(rate)
    try:
        with describe_os_errors(path), tempfile.TemporaryDirectory() as folder:
            film = Path(folder) / f"film{path.suffix.lower()}"
            FuncAnimation(figure, show, shown, lambda: (), cache_frame_data=False).save(
                film, writer
            )
            write_output(path, film.read_bytes(), replace=replace)
    except subprocess.CalledProcessError as error:
        raise CoarticError(
            f"{path} cannot be written, because ffmpeg failed: {error.stderr}"
        ) from None
    return len(rows), stride * RATE


def stage(
    movements: Sequence[tuple[str, Movement]], width: int
) -> tuple[Figure, Callable[[int], list[Any]]]:
    """Return a figure with a panel for each movement, and a function that updates it.

    The figure is ``width`` pixels wide, and all panels show the same region. The argument of the
    function is the index of a row of the movements' configurations, which the function shows in
    each panel.
    """
    corners = np.array([box(movement.task, movement.configurations) for _, movement in movements])
    low, high = corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)
    across, up = high - low
    height = width / len(movements) * up / across + 70  # pixels, with the titles
    size = width / _DPI, 2 * round(height / 2) / _DPI  # an even number, which MP4 needs
    figure = Figure(figsize=size, dpi=_DPI, layout="constrained")
    panels = figure.subplots(1, len(movements), squeeze=False)[0]
    shows = []
    for axes, (title, movement), colour in zip(panels, movements, cycle(COLOURS), strict=False):
        axes.set(aspect="equal", xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        axes.set_title(title, fontsize=9, loc="left", parse_math=False)
        axes.set_xticks(range(math.ceil(low[0]), math.ceil(high[0])), [])
        axes.set_yticks(range(math.ceil(low[1]), math.ceil(high[1])), [])
        axes.tick_params(length=0)
        axes.spines[:].set_visible(False)
        axes.grid(color="0.92")
        number_goals(axes, movement.task, weight=_WEIGHT, fontsize=9)
        shows.append(_scene(axes, movement, colour))

    def show(row: int) -> list[Any]:
        for show_panel in shows:
            show_panel(row)
        return []

    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # otherwise each frame would be laid out again
    return figure, show


def _scene(axes: Axes, movement: Movement, colour: str) -> Callable[[int], None]:
    """Draw the goals, the robot, the paths of the hands and a counter of ticks.

    Return a function whose argument is the index of a row of the movement's configurations. The
    function shows this row, or the last row if the index is past the end.
    """
    task = movement.task
    paths = {hand: movement.hand_path(hand) for hand in task.hands}
    traces = {hand: axes.plot([], [], color=colour, alpha=0.4)[0] for hand in task.hands}
    goals = circle_goals(axes, task, weight=_WEIGHT)
    move = draw_robot(axes, task, task.q0, weight=_WEIGHT, colour=colour)
    counter = axes.set_title("", color=colour, fontsize=13, fontweight="bold", loc="right")

    def show(row: int) -> None:
        row = min(row, len(movement.configurations) - 1)
        move(movement.configurations[row])
        for hand, trace in traces.items():
            trace.set_data(*paths[hand][: row + 1].T)
        fill_goals(goals, movement.hits <= row)
        counter.set_text(pluralize(row + 1, "tick"))

    return show
