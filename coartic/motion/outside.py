"""Trials that a process makes outside the session of a run: honest methods make none."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

_trials = 0
_inside = 0


def note_trials(count: int) -> None:
    """Count trials, unless the session of a run makes them."""
    global _trials
    _trials += 0 if _inside else count


@contextmanager
def inside(of_run: bool) -> Iterator[None]:
    """Trials made in this block are not counted if they belong to the session of a run."""
    global _inside
    _inside += of_run
    try:
        yield
    finally:
        _inside -= of_run


def trials_outside() -> int:
    """Trials made outside so far, in this process."""
    return _trials
