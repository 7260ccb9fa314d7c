"""Movements tick by tick as a GIF or MP4, by the conventions of the paper's figures.

Open squares mark the left arm, closed circles the right one; goals are numbered circles,
filled from the tick at which they are hit. Thin lines trace both hands.
"""

from __future__ import annotations

import math
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from analysis.drawing import MARKERS
from coartic import CoarticError, Trajectory
from coartic.robot import Array

FORMATS = (".gif", ".mp4")
LASTS_S = 10.0
"""Seconds that the longest movement takes unless a speed is given."""
HOLD_S = 2.0
"""Seconds that the last frame stands."""
RATE = 12.5  # frames per second, at most: a GIF's file grows with its frames
_DPI = 100
_HIT = "0.55"  # of a goal; not black, which is the right hand
_MARGIN = 0.4  # length unit around what moves


@dataclass(frozen=True)
class Panel:
    """One movement with its title."""

    title: str
    trajectory: Trajectory


@dataclass(frozen=True)
class Timing:
    """Which ticks are shown, and for how long."""

    stride: int
    """Ticks from one frame to the next."""
    interval_s: float
    """Seconds that a frame stands; a whole number of hundredths, as GIF has them."""
    rows: tuple[int, ...]
    """Row of the longest trajectory that each frame shows, from 0; the last is its end."""
    held: int
    """Times that the last frame is repeated."""


def timing(ticks: int, speed: float | None = None) -> Timing:
    """Frames of a movement of ``ticks`` at ``speed`` (ticks per second).

    Without a speed it lasts :data:`LASTS_S`, or less where that would be slower than a tick a
    frame.
    """
    speed = speed or max(ticks / LASTS_S, RATE)
    stride = max(1, math.ceil(speed / RATE - 1e-9))
    interval = max(2, round(100 * stride / speed)) / 100
    rows = tuple(dict.fromkeys([*range(0, ticks, stride), ticks - 1]))
    return Timing(stride, interval, rows, max(1, round(HOLD_S / interval)))


def animate(
    panels: Sequence[Panel], path: Path, *, speed: float | None = None, width: int = 800
) -> Timing:
    """Draw movements side by side, all from their first tick, into ``path``; their timing.

    ``speed`` is in ticks per second, ``width`` of the picture in pixels. A movement that ends
    before the others stands still. Raises CoarticError for an ending that is not in
    :data:`FORMATS`, for MP4 without ffmpeg, and where the file cannot be written.
    """
    check_output(path)
    ticks = max(panel.trajectory.ticks for panel in panels)
    if not ticks:
        raise CoarticError("there is no movement to draw: all goals are hit before the first tick")
    timed = timing(ticks, speed)
    figure, scenes = _figure(panels, width)
    writer = _writer(path, timed)
    try:
        with writer.saving(figure, str(path), _DPI):
            for row in [*timed.rows, *timed.rows[-1:] * timed.held]:
                for scene in scenes:
                    scene.show(row)
                writer.grab_frame()
    except OSError as error:
        raise CoarticError(f"cannot write {path}: {error.strerror or error}") from None
    except subprocess.CalledProcessError as error:
        raise CoarticError(f"cannot write {path}: ffmpeg failed: {error.stderr}") from None
    return timed


def check_output(path: Path) -> None:
    """Raises CoarticError for what cannot be written: before anything is drawn.

    An ending that is not supported, MP4 without ffmpeg, a folder that is not there.
    """
    from matplotlib.animation import FFMpegWriter

    if path.suffix.lower() not in FORMATS:
        raise CoarticError(f"--out {path}: the name must end in {' or '.join(FORMATS)}")
    if path.suffix.lower() == ".mp4" and not FFMpegWriter.isAvailable():
        raise CoarticError(f"--out {path}: MP4 needs ffmpeg; install it, or choose a .gif")
    if not path.parent.is_dir():
        raise CoarticError(f"cannot write {path}: there is no folder {path.parent}")


class _Scene:
    """One panel: what moves in it is updated, never drawn anew."""

    def __init__(self, axes: Any, panel: Panel, box: tuple[Array, Array]) -> None:
        from matplotlib.patches import Circle, Polygon

        self._trajectory = trajectory = panel.trajectory
        task = trajectory.task
        self._paths = {hand: trajectory.hand_path(hand) for hand in task.hands}
        self._traces = {
            hand: axes.plot([], [], color="0.6", linewidth=1)[0] for hand in task.hands
        }
        outline = task.robot.base_outline(task.q0)
        self._base = axes.add_patch(
            Polygon(outline, closed=True, facecolor="0.85", edgecolor="black", linewidth=1)
        )
        self._goals = []
        for number, (x, y) in enumerate(task.goals, 1):
            circle = Circle((x, y), task.radius, facecolor="none", edgecolor="black", zorder=2.5)
            self._goals.append(axes.add_patch(circle))
            axes.annotate(
                str(number), (x, y + task.radius), (0, 3), textcoords="offset points",
                ha="center", va="bottom", fontsize=9,
            )  # fmt: skip
        self._arms = {
            hand: axes.plot(
                [], [], color="black", linewidth=1.4, markeredgecolor="black", **MARKERS[hand]
            )[0]
            for hand in task.hands
        }
        self._status = axes.text(
            0.0, 1.01, "", transform=axes.transAxes, fontsize=9, va="bottom", parse_math=False
        )
        axes.set_title(panel.title, fontsize=9, loc="left", pad=18, parse_math=False)
        axes.set_xlim(box[0][0], box[1][0])
        axes.set_ylim(box[0][1], box[1][1])
        axes.set_aspect("equal")
        axes.tick_params(labelsize=8)
        axes.spines[["top", "right"]].set_visible(False)

    def show(self, row: int) -> None:
        """The state at a row of the trajectory, or at its last one."""
        trajectory = self._trajectory
        row = min(row, trajectory.ticks - 1)
        q = trajectory.configurations[row]
        robot = trajectory.task.robot
        self._base.set_xy(robot.base_outline(q))
        for hand, arm in self._arms.items():
            arm.set_data(*robot.joint_positions(q, hand).T)
            self._traces[hand].set_data(*self._paths[hand][: row + 1].T)
        hit = trajectory.hits <= row
        for circle, done in zip(self._goals, hit, strict=True):
            circle.set_facecolor(_HIT if done else "none")
        state = "done"
        if not hit.all():
            goal = int(np.argmin(hit))
            state = f"goal {goal + 1} with the {trajectory.hands[goal]} hand"
        self._status.set_text(f"reward −{row + 1}   {state}")


def _figure(panels: Sequence[Panel], width: int) -> tuple[Any, list[_Scene]]:
    """A figure ``width`` pixels wide with a scene per panel, all showing the same place."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    corners = np.array([_box(panel.trajectory) for panel in panels])
    box = corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)
    across, up = box[1] - box[0]
    inches = width / _DPI
    frame = 0.45  # inches beside the axes, for numbers
    height = (inches / len(panels) - frame) * up / across + 0.8
    pixels = 2 * round(height * _DPI / 2)  # an even number, as MP4 wants it
    figure = Figure(figsize=(inches, pixels / _DPI), dpi=_DPI)
    FigureCanvasAgg(figure)
    scenes = []
    for index, panel in enumerate(panels):
        axes = figure.add_axes(
            (
                (index + frame / inches * len(panels)) / len(panels),
                0.3 * _DPI / pixels,
                (1 / len(panels)) - (frame + 0.05) / inches,
                1 - 0.8 * _DPI / pixels,
            )
        )
        scenes.append(_Scene(axes, panel, box))
    return figure, scenes


def _box(trajectory: Trajectory) -> tuple[Array, Array]:
    """Corners of everything that the robot sweeps, with the goals and a margin."""
    task, q = trajectory.task, trajectory.configurations
    parts = [task.robot.base_outline(q), task.goal_array]
    parts += [task.robot.joint_positions(q, hand) for hand in task.hands]
    cloud = np.concatenate([part.reshape(-1, 2) for part in parts])
    return cloud.min(axis=0) - _MARGIN, cloud.max(axis=0) + _MARGIN


def _writer(path: Path, timed: Timing) -> Any:
    from matplotlib.animation import FFMpegWriter, PillowWriter

    rate: Any = 1 / timed.interval_s
    if path.suffix.lower() == ".mp4":
        return FFMpegWriter(fps=rate, codec="h264")
    # Pillow's writer cuts milliseconds off to whole ones: half a one more, or 70 may become 69.
    rate = 1000 / (1000 * timed.interval_s + 0.5)
    return PillowWriter(fps=rate)
