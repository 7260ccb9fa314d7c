"""Arrangements of goals that a search goes through (``layouts.toml``)."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from coartic.analysis.words import read_beside
from coartic.robot import Array


@dataclass(frozen=True)
class Layout:
    """A task's goals as functions of P parameters, and where these may lie."""

    task: str
    goals: tuple[tuple[str, str], ...]
    """Parameters that are x and y of each goal."""
    grid: dict[str, tuple[float, float, float]]
    """Lowest, highest and step of each parameter, length unit."""
    less: tuple[tuple[str, str, float], ...]
    """a, b, gap: a + gap <= b."""
    apart: float = 0.0
    """Least distance of two goals' centres, length unit."""
    known: dict[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)
    """Sets of goals found before, by name."""

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The parameters, in the order in which the grid goes through them, the last fastest."""
        return tuple(self.grid)

    @cached_property
    def _values(self) -> tuple[Array, ...]:
        return tuple(
            np.linspace(low, high, round((high - low) / step) + 1)
            for low, high, step in self.grid.values()
        )

    @property
    def size(self) -> int:
        """Points of the grid, those that the layout does not allow included."""
        return int(np.prod([len(values) for values in self._values]))

    def blocks(self, length: int) -> Iterator[Array]:
        """The allowed points of the grid, shape ``(<= length, P)``, in order."""
        shape = tuple(len(values) for values in self._values)
        for first in range(0, self.size, length):
            index = np.unravel_index(np.arange(first, min(first + length, self.size)), shape)
            points = np.stack([v[i] for v, i in zip(self._values, index, strict=True)], axis=1)
            yield points[self.allowed(points)]

    def places(self, points: Array) -> Array:
        """Goals, shape ``(N, G, 2)``, of ``points`` (N, P)."""
        columns = [[self.names.index(name) for name in goal] for goal in self.goals]
        return np.asarray(points[:, np.array(columns)])

    def points(self, places: Array) -> Array:
        """The points ``(N, P)`` of goals (N, G, 2); what :meth:`places` undoes."""
        found = {
            name: places[:, number, axis]
            for number, goal in enumerate(self.goals)
            for axis, name in enumerate(goal)
        }
        return np.stack([found[name] for name in self.names], axis=1)

    def allowed(self, points: Array) -> NDArray[np.bool_]:
        """Whether points lie within the ranges and are arranged as the layout says, ``(N,)``."""
        low, high, _ = np.array(list(self.grid.values())).T
        inside = ((points >= low) & (points <= high)).all(axis=1)
        column = dict(zip(self.names, points.T, strict=True))
        for a, b, gap in self.less:
            inside &= column[a] + gap <= column[b] + 1e-9
        places = self.places(points)
        for first, second in itertools.combinations(range(len(self.goals)), 2):
            distances = np.linalg.norm(places[:, first] - places[:, second], axis=1)
            inside &= distances >= self.apart - 1e-9
        return np.asarray(inside)


def layouts() -> dict[str, Layout]:
    """The layouts by task."""
    return {
        task: Layout(
            task,
            tuple(map(tuple, entry["goals"])),
            {name: tuple(values) for name, values in entry["grid"].items()},
            tuple(map(tuple, entry["less"])),
            float(entry["apart"]),
            {name: tuple(map(tuple, goals)) for name, goals in entry["known"].items()},
        )
        for task, entry in read_beside(__file__, "layouts").items()
    }
