"""Movements tick by tick as one SVG that moves by itself, wherever pictures are shown.

By the conventions of the films of :mod:`coartic.analysis.figures.animation`, in SVG's own
animation (SMIL), without a script. What does not move shows the end of each movement.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from coartic import Trajectory
from coartic.analysis.figures.robot import box, numbered_below
from coartic.robot import Array

if TYPE_CHECKING:
    from coartic.analysis.figures.animation import Pace, Panel

_TITLE, _FOOT, _GAP = 26.0, 26.0, 14.0  # pixels above and below a panel, and between two
_DEFS = (
    '<marker id="left" viewBox="-5 -5 10 10" markerWidth="8" markerHeight="8" '
    'markerUnits="userSpaceOnUse"><rect x="-4" y="-4" width="8" height="8" fill="#fff" '
    'stroke="#222" stroke-width="1.6"/></marker>'
    '<marker id="right" viewBox="-5 -5 10 10" markerWidth="6" markerHeight="6" '
    'markerUnits="userSpaceOnUse"><circle r="4.5" fill="#222"/></marker>'
)
_STYLE = (
    "text{font-family:sans-serif;font-size:12px;fill:#222}.goal{stroke:#222}"
    ".arm{fill:none;stroke:#222;stroke-width:1.6;stroke-linejoin:round}"
    ".base{fill:#ddd;stroke:#222}.trace{fill:none;stroke-width:1.4;opacity:.55}"
    ".left{stroke:#0072b2}.right{stroke:#d55e00}.bar{fill:#999}"
)


def moving_picture(panels: Sequence[Panel], timed: Pace, width: int) -> bytes:
    """Movements side by side, all from their first tick, over and over, as an SVG.

    ``width`` in pixels. A movement that ends before the others stands still; bars below show the
    ticks that each has taken, to one scale.
    """
    movements = [panel.trajectory for panel in panels]
    corners = np.array([box(movement.task, movement.configurations) for movement in movements])
    low, high = corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)
    wide = (width - _GAP * (len(panels) - 1)) / len(panels)
    scale = wide / (high[0] - low[0])
    tall = (high[1] - low[1]) * scale
    height = tall + _TITLE + _FOOT
    longest = max(movement.ticks for movement in movements)
    view = _View(timed, scale, np.array([low[0], high[1]]), wide, tall, longest)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height:.0f}" '
        f'width="{width}" height="{height:.0f}" role="img">',
        f"<title>{escape(' beside '.join(panel.title for panel in panels))}</title>",
        f'<style>{_STYLE}</style><defs>{_DEFS}</defs><rect width="100%" height="100%" rx="6" '
        'fill="#fff"/>',
    ]
    for index, panel in enumerate(panels):
        parts.append(f'<g transform="translate({index * (wide + _GAP):.1f} {_TITLE:g})">')
        parts.append(f'<text x="8" y="-8">{escape(panel.title)}</text>')
        parts.extend(view.scene(panel.trajectory))
        parts.append("</g>")
    return "\n".join([*parts, "</svg>", ""]).encode()


class _View:
    """Where and when things are in every panel."""

    def __init__(
        self, timed: Pace, scale: float, corner: Array, wide: float, tall: float, longest: int
    ) -> None:
        self._scale, self._corner, self._longest = scale, corner, longest
        self._wide, self._tall = wide, tall
        self._rows = [*timed.rows, *timed.rows[-1:] * timed.held]
        self._lasts = f'dur="{timed.interval_s * len(self._rows):.2f}s" repeatCount="indefinite"'

    def scene(self, moved: Trajectory) -> Iterator[str]:
        """The elements of one movement."""
        task, last = moved.task, len(moved.configurations) - 1
        rows = np.minimum(self._rows, last)
        shown = moved.configurations[rows]
        for hand in task.hands:
            path = self._pixels(moved.hand_path(hand))
            way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
            left = 1 - way[rows] / (way[-1] or 1.0)
            values = ";".join(f"{share:.3f}" for share in left)
            thinned = path[sorted({*range(0, last + 1, 4), last})]
            yield (
                f'<polyline class="trace {hand}" pathLength="1" stroke-dasharray="1 2" '
                f'points="{_points(thinned)}">'
                + self._animated("stroke-dashoffset", values)
                + "</polyline>"
            )
        numbered = zip(task.goals, numbered_below(task), moved.hits, strict=True)
        for number, (goal, below, hit) in enumerate(numbered, 1):
            (x, y), radius = self._pixels(np.array(goal)), task.radius * self._scale
            when = np.searchsorted(self._rows, hit) / len(self._rows)
            yield (
                f'<circle class="goal" cx="{x:.1f}" cy="{y:.1f}" r="{radius:.1f}" '
                'fill="#8c8c8c">'
                f'<animate attributeName="fill" calcMode="discrete" values="#fff;#8c8c8c" '
                f'keyTimes="0;{max(when, 1e-4):.4f}" {self._lasts}/></circle>'
            )
            up = radius + 13 if below else -radius - 4
            yield f'<text x="{x:.1f}" y="{y + up:.1f}" text-anchor="middle">{number}</text>'
        yield self._shape("polygon", "base", task.robot.base_outline(shown))
        for hand in task.hands:
            marks = "".join(f' marker-{at}="url(#{hand})"' for at in ("start", "mid", "end"))
            yield self._shape("polyline", "arm", task.robot.joint_positions(shown, hand), marks)
        yield from self._bar(moved, rows, last)

    def _bar(self, moved: Trajectory, rows: Array, last: int) -> Iterator[str]:
        """Ticks so far, and how many there are in the end."""
        full, y = self._wide - 110, self._tall + 8
        ends = full * moved.ticks / self._longest
        values = ";".join(f"{share:.1f}" for share in ends * rows / last)
        yield (
            f'<rect class="bar" x="8" y="{y:.1f}" width="{ends:.1f}" height="8">'
            f"{self._animated('width', values)}</rect>"
        )
        done = f"{np.searchsorted(self._rows, last) / len(self._rows):.4f}"
        yield (
            f'<text x="{ends + 14:.1f}" y="{y + 8.5:.1f}">{moved.ticks} ticks'
            f'<animate attributeName="opacity" calcMode="discrete" values="0;1" '
            f'keyTimes="0;{done}" {self._lasts}/></text>'
        )

    def _shape(self, name: str, kind: str, points: Array, more: str = "") -> str:
        """A line or an area whose corners move: ``points`` (frames, corners, 2)."""
        frames = [_points(frame) for frame in self._pixels(points)]
        animated = self._animated("points", ";".join(frames))
        return f'<{name} class="{kind}"{more} points="{frames[-1]}">{animated}</{name}>'

    def _animated(self, attribute: str, values: str) -> str:
        return f'<animate attributeName="{attribute}" values="{values}" {self._lasts}/>'

    def _pixels(self, points: Array) -> Array:
        found: Array = (points - self._corner) * np.array([self._scale, -self._scale])
        return found


def _points(points: Array) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
