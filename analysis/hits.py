"""Recorded trials, of people for instance: read from a CSV file, or checked in a frame."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from itertools import permutations, product
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from coartic import CoarticError, Task
from coartic.analysis.recorded_tables import (
    NAMED,
    also,
    as_names,
    as_numbers,
    read_table,
    row_names,
    warn,
    why_no_number,
)
from coartic.analysis.solutions import initial_solution
from coartic.internal.arguments import checked_arguments
from coartic.internal.limits import brief_value
from coartic.internal.text import counted
from coartic.model import PAPER
from coartic.motion.movement import LARGEST_ENTRY
from coartic.robot import Array, Hand

Implausible = Literal["refuse", "drop"]
"""Treatment of hits that the person cannot have made."""
_SLOWEST = 20
"""Longest plausible time of a hit, in longest subtasks of the corrective process alone."""
_UNITS = {"s": 100.0, "ms": 0.1, "min": 6000.0, "control steps": 1.0}
"""Ticks in units of a duration, for a person who takes a second for each rad."""
MANY = 20
"""Fewest hits, or samples, that most comparisons need."""
_OUTSIDE = 1.25
"""Distance from the centre of a goal, radii, beyond which a hit is not at its edge."""
_ANGLES = {"": 1.0, "degrees are made rad": np.pi / 180, "gradians are made rad": np.pi / 200,
           "turns are made rad": 2 * np.pi}  # fmt: skip
AXES = {
    "": (1, 0), "angles are anticlockwise, as y is upwards": (-1, 0),
    "x is the other way, as if mirrored": (-1, 2), "axes are turned by 90 degrees": (1, 1),
    "axes are turned by 180 degrees": (1, 2), "axes are turned by -90 degrees": (1, 3),
    "x and y are swapped": (-1, 1), "x and y are swapped, with the other sign": (-1, 3),
}  # fmt: skip
"""Changes of axes: sign of angles, and right angles of a turn afterwards."""


@checked_arguments
def read_hits(
    path: str | Path,
    task: Task,
    *,
    ticks_per_unit: float | None = None,
    implausible: Implausible = "refuse",
) -> pd.DataFrame:
    """Read recorded trials: a CSV file with a row for each hit.

    Blank lines, lines that begin with ``#``, commas at the end of a line, and other columns do not
    count; columns of an arm or a joint that the task does not use are left out, with a warning
    unless they are as at the start. Angles are unwrapped from hit to hit, from the start of the
    task on, with a warning if one jumps by more than half a turn (π). Warns, too, of signs that an
    arm of the task is slower or much faster, trials are cut in two, trials or their times are there
    twice, a name is spelt in two ways, rows are in no order of goals, values are rounded, repeat or
    never vary, times do not follow paths, or are of reactions or of a clock that runs on in some
    trials, and hits contradict the place or the radius of goals, or do so in some trials, as if a
    sensor had slipped.

    Each hit is checked among those of its subject. Implausible is a hit whose hand is more than two
    radii from its goal (up to ten, if motor noise puts a quarter of the hits outside of goals),
    whose locked base is moved as far, whose arm has an angle beyond ±20 rad, one number in place of
    all its angles once it has moved, or, in three hits or more, exact means of the hits around it,
    or whose time is over 20 times the longest subtask of the corrective process, if that completes
    the task, or clearly too short for a straight movement.

    Parameters
    ----------
    path : str or pathlib.Path
        The file (UTF-8), with columns ``subject``, ``trial`` and ``goal`` (both from 1), ``hand``
        (left or right), ``ticks`` or ``duration``, and one for each entry of
        ``task.robot.joint_names`` (length unit and rad). ``ticks`` and ``duration`` count from the
        hit before, or the start. Rows of trials and goals may be missing, and so may columns of an
        arm that is not among ``task.hands`` and of a locked base: their values are then those at
        the start.
    task : Task
        The task that was practised.
    ticks_per_unit : float, optional
        Ticks in a unit of ``duration``, such as 100 for seconds; by default 1. Not for a file that
        has ``ticks``.
    implausible : {"refuse", "drop"}
        "drop" leaves implausible hits out, with a warning that counts them, unless most hits of a
        subject are implausible.

    Returns
    -------
    DataFrame
        The rows sorted by subject (in the order of the file), trial and goal, with ``ticks`` in
        place of ``duration`` and all joints; numbers are float64, the index is new.

    Raises
    ------
    CoarticError
        The file is no such table, hits are implausible, times are impossible, coarse, in two units
        or of a clock that runs on, or a joint that seems wrapped turns by more than 2.5 rad between
        hits.
    """
    if ticks_per_unit is not None and not 0 < ticks_per_unit < np.inf:
        raise CoarticError(
            f"ticks_per_unit is {ticks_per_unit}; needed is a number above 0, such as 100 for s"
        )
    frame, names = read_table(path, "recorded hits are")
    if "ticks" in frame and ticks_per_unit is not None:
        raise CoarticError(
            f"ticks_per_unit is {ticks_per_unit:g}, but {path} has a column ticks, on which it has "
            "no effect: leave it out, or name the column duration if it is in another unit"
        )
    return checked_hits(frame, task, str(path), names, implausible, ticks_per_unit or 1.0)


def turned(places: Array, axes: str) -> Array:
    """Return places ``(..., 2)``, x and y, after a change of axes, a key of :data:`AXES`."""
    sign, quarters = AXES[axes]
    at = (places[..., 0] + sign * 1j * places[..., 1]) * 1j**quarters
    return np.stack([at.real, at.imag], axis=-1)


def checked_hits(
    frame: pd.DataFrame,
    task: Task,
    source: str = "the frame",
    names: Sequence[str] | None = None,
    implausible: Implausible = "refuse",
    ticks_per_unit: float | None = None,
) -> pd.DataFrame:
    """Return a new frame of recorded hits, checked, unwrapped and sorted as by :func:`read_hits`,
    with ``subject``, ``trial``, ``goal``, ``hand``, ``ticks`` and all joints. ``source`` and
    ``names`` of rows are for messages; ``ticks_per_unit``: None for hits from no file, whose
    ``ticks`` may be fractions."""
    names = names or row_names(frame)
    is_timed = ticks_per_unit is not None and "duration" in frame
    frame = _with_columns(frame, task, source, is_timed)
    frame = _with_values(frame, task, source, names, ticks_per_unit, is_timed)
    trials = [frame.subject, frame.trial]
    steps = np.sign(frame.groupby(trials).goal.diff()).groupby(trials)
    back = (steps.transform("min") * steps.transform("max") < 0).to_numpy()
    begins = ~frame.duplicated(["subject", "trial"]).to_numpy()
    disordered = [names[row] for row in np.flatnonzero(back & begins).tolist()]
    order = np.lexsort([frame.goal.array, frame.trial.array, pd.factorize(frame.subject)[0]])
    frame, names = frame.iloc[order].reset_index(drop=True), [names[row] for row in order]
    for subject, hand in product(frame.subject.unique().tolist(), task.hands):
        hits = frame[(frame.subject == subject) & (frame.hand == hand)]
        angles = [*task.robot.joint_names[task.robot.joints(hand)]]
        _warn_of_values(hits, angles, f"{source}, {subject}")
    frame, names = _without_implausible(
        frame, task, source, names, implausible, ticks_per_unit or 1.0
    )
    for words in _odd_groups(frame, task) + _cut_trials(frame, len(task.goals)) + _copies(frame):
        warn(f"{source}: {words}")
    if disordered:
        words = ("rows of the trial are in no order of goals, up or down; times are taken as from "
                 "the goal with the number before")  # fmt: skip
        warn(f"{source}, {disordered[0]}: {words}{also(disordered)}")
    _unwrap(frame, task, source, names)
    return frame


def _with_columns(frame: pd.DataFrame, task: Task, source: str, is_timed: bool) -> pd.DataFrame:
    """Return recorded hits with only the columns of :func:`read_hits`; joints that the task does
    not use, and locked base coordinates without a column, are as at the start. ``is_timed``:
    ``duration`` becomes ``ticks``, still in its unit. Warns of columns that are left out, and
    raises CoarticError for a column that is missing or there twice, for both ``ticks`` and
    ``duration``, and for no hits."""
    if twice := [name for n, name in enumerate(frame.columns) if name in frame.columns[:n]]:
        raise CoarticError(f"{source} has two columns {twice[0]!r}")
    joints = [*task.robot.joint_names]
    used = {"base_x", "base_y"}
    used |= {name for hand in task.hands for name in joints[task.robot.joints(hand)]}
    missing = {f"base_{axis}" for axis in task.locked_base}.difference(frame.columns)
    starts = {name: value for name, value in zip(joints, task.q0.tolist(), strict=True)
              if name not in used or name in missing}  # fmt: skip
    unused = []
    for name in map(str, frame.columns):
        if name not in used and re.match("(base|left|right)_", name):
            values = pd.to_numeric(frame[name], errors="coerce")
            if not np.allclose(values, starts.get(name, np.nan), atol=1e-3):
                unused.append(name)
    if unused:
        which = f"column {unused[0]} is left out, task {task.name!r} does not use it"
        warn(f"{source}: {which}{also(unused)}")
    if {"ticks", "duration"} <= {*frame.columns}:
        raise CoarticError(f"{source} has columns ticks and duration: leave one of them out")
    there = ", ".join(map(str, frame.columns)) or "none"
    if is_timed:
        frame = frame.rename(columns={"duration": "ticks"})
    frame = frame.assign(**starts)
    needed = ["subject", "trial", "goal", "hand", "ticks", *joints]
    if absent := [name for name in needed if name not in frame]:
        timed = "(or duration in place of ticks)"
        if "duration" in frame:
            timed = "(read_hits reads a file with a duration in place of ticks)"
        raise CoarticError(
            f"{source} has no column {', '.join(absent)}; needed are "
            f"{', '.join(name for name in needed if name not in starts)} {timed}, separated by "
            f"commas; found are {there}"
        )
    if not len(frame):
        raise CoarticError(f"{source} has no hit: needed is a row for each")
    return frame[needed]


def _with_values(
    frame: pd.DataFrame,
    task: Task,
    source: str,
    names: Sequence[str],
    ticks_per_unit: float | None,
    is_timed: bool,
) -> pd.DataFrame:
    """Return a new frame of recorded hits whose subjects and hands are texts and other values
    numbers, with times in ticks: ``ticks_per_unit`` (None: 1, for hits from no file) times the
    given times, whose column was ``duration`` if ``is_timed``. Warns of a subject that is spelt in
    several ways, and raises CoarticError for a value that cannot be, or a hit that is there twice.
    """

    def refuse(wrong: ArrayLike, column: str, wanted: str | Callable[[object], str]) -> None:
        if rows := np.flatnonzero(np.asarray(wrong, dtype=bool)).tolist():
            value = frame[column].tolist()[rows[0]]
            needs = wanted if isinstance(wanted, str) else wanted(value)
            shown = "empty" if value == "" or pd.isna(value) else brief_value(value)
            key = "duration" if column == "ticks" and is_timed else column
            others = also([names[row] for row in rows])
            raise CoarticError(f"{source}, {names[rows[0]]}: {key} is {shown}; {needs}{others}")

    frame, joints = frame.copy(), [*task.robot.joint_names]
    for name in ["trial", "goal", "ticks", *joints]:
        numbers = as_numbers(frame[name])
        refuse(~np.isfinite(numbers), name, why_no_number)
        frame[name] = numbers
    spellings, frame["hand"] = frame.subject, as_names(frame.hand)
    frame["subject"] = as_names(spellings)
    for one, several in spellings.groupby(frame.subject).unique().items():
        if len(several) > 1:
            warn(f"{source}: subject {one!r} is spelt in {len(several)} ways, which are taken "
                  f"for one: {', '.join(map(ascii, several))}")  # fmt: skip
    people = frame.subject.unique().tolist()
    if len({name.casefold() for name in people}) < len(people):
        warn(f"{source}: subjects differ in capitals alone: {', '.join(sorted(people)[:20])}")
    refuse(frame.subject == "", "subject", "needed is a name")
    refuse(~frame.hand.isin(task.hands), "hand", f"needed is {' or '.join(task.hands)}")
    is_whole = (frame.trial % 1 == 0) & frame.trial.between(1, 100_000)
    refuse(~is_whole, "trial", "needed is a whole number from 1 to 100000")
    last = len(task.goals)
    refuse(~frame.goal.isin(range(1, last + 1)), "goal", f"needed is a number from 1 to {last}")
    if ticks_per_unit is not None and not is_timed:
        seconds = "needed is a whole number; seconds belong into a column duration"
        refuse(frame.ticks % 1 != 0, "ticks", seconds)
    unit = ticks_per_unit or 1.0
    too_short = "needed is more than 0, from the hit before to this one"
    refuse(frame.ticks * unit < 1e-6, "ticks", too_short)
    frame["ticks"] = (frame.ticks * unit).round(6)
    again = frame.duplicated(["subject", "trial", "goal"])
    refuse(again, "goal", "this subject, trial and goal have a line above already; number trials "
           "through from session to session")  # fmt: skip
    for name in joints[:2]:
        far = "needed is a place in the length unit of the task"
        refuse(frame[name].abs() > LARGEST_ENTRY, name, far)
    return frame


def _without_implausible(
    frame: pd.DataFrame,
    task: Task,
    source: str,
    names: Sequence[str],
    implausible: Implausible,
    unit: float,
) -> tuple[pd.DataFrame, Sequence[str]]:
    """Return sorted hits, and names of their rows, without implausible hits, with a warning that
    counts these. Raises CoarticError, with advice, for implausible hits if ``implausible`` is
    "refuse", and if most hits of a subject are implausible; ``unit``: ticks in a unit of time of
    the recording."""
    initial, counts = initial_solution(task), frame.subject.value_counts()
    slowest = max(initial.ticks_by_goal() if initial else [np.pi / PAPER.step * task.robot.dof])
    reasons: list[str] = []
    whose: list[str] = []
    while True:  # without implausible hits others may stand out
        why = np.full(len(frame), "", dtype=object)
        for subject, rows in frame.groupby("subject", sort=False).indices.items():
            hits = frame.iloc[rows].reset_index(drop=True)
            why[rows] = _implausible(hits, task, f"{source}, {subject}", unit, slowest)
        wrong = why != ""
        reasons += [f"{names[row]}: {why[row]}" for row in np.flatnonzero(wrong).tolist()]
        whose += frame.subject[wrong].tolist()
        most = [name for name in counts.index if 2 * whose.count(name) > counts[name]]
        if not wrong.any():
            break
        if implausible == "refuse" or most:
            advice = 'Mend the recording, or leave such hits out with implausible="drop"'
            if most:
                advice = (
                    f"Most hits of {most[0]} are implausible. Angles are in rad (numpy.radians "
                    "converts), anticlockwise, each measured from the link before. Is each in its "
                    "column and row, are hands and goals right, is the base in the length unit of "
                    f"the task, and is the task {task.name!r}?"
                )
            if fits := _remedy(frame, np.char.find(why.astype(str), " rad") > 0, task):
                advice = (
                    f"Most of these hands would be at their goals in a recording {fits}. {advice}"
                )
            elif ", at goal " in reasons[0]:
                advice = f"Are goals in their order? {advice}"
            elif "at the start" not in reasons[0]:
                advice = " ".join([*_odd_groups(frame, task), *_copies(frame), advice])
            raise CoarticError(f"{source}, {reasons[0]}{also(reasons)}. {advice}")
        frame = frame[~wrong].reset_index(drop=True)
        names = [name for name, words in zip(names, why, strict=True) if not words]
    if reasons:
        warn(f"{source}: {len(reasons)} of {counted(counts.sum(), 'hit')} are left out as "
             f"implausible, {reasons[0]}{also(reasons)}")  # fmt: skip
    return frame, names


def _unwrap(frame: pd.DataFrame, task: Task, source: str, names: Sequence[str]) -> None:
    """Unwrap the angles of sorted hits in place, each trial from the task's start on, with a
    warning if one changes. Raises CoarticError if angles of a joint seem wrapped and turn by more
    than 2.5 rad between hits, in which direction is then in doubt."""
    joints = [*task.robot.joint_names][2:]
    angles = frame[joints].to_numpy(np.float64)
    begins = ~frame.duplicated(["subject", "trial"]).to_numpy()
    recorded = np.diff(angles, axis=0, prepend=task.q0[None, 2:])
    recorded[begins] = angles[begins] - task.q0[2:]
    turns = np.rint(recorded / (2 * np.pi))
    steps = recorded - 2 * np.pi * turns
    groups = frame.groupby(["subject", "trial"], sort=False).ngroup()
    added = pd.DataFrame(turns).groupby(groups).cumsum().to_numpy()
    plain = pd.DataFrame(angles - 2 * np.pi * added)
    at_goal = plain.groupby([frame.subject, frame.goal], sort=False)
    spread = at_goal.transform("max") - at_goal.transform("min")
    wrapped = pd.DataFrame((added != 0) | (spread.to_numpy() > np.pi))
    doubtful = wrapped.groupby(frame.subject, sort=False).transform("any").to_numpy()
    doubtful = doubtful & (np.abs(steps) > 2.5)
    for row, joint in np.argwhere(doubtful)[:1]:
        step = steps[row, joint]
        raise CoarticError(
            f"{source}, {names[row]}: {joints[joint]} of subject {frame.subject[row]} turns by "
            f"{step:.2f} or by {step - np.sign(step) * 2 * np.pi:.2f} rad from the hit before, and "
            "this subject's angles are wrapped (they jump by 2π): unwrap the recording with "
            "numpy.unwrap before hits are taken from it"
        )
    for row, joint in np.argwhere(turns != 0)[:1]:
        warn(
            f"{source}: {np.count_nonzero(turns)} times an angle jumps by a turn (2π) between "
            f"hits, first {joints[joint]} in {names[row]}; angles are unwrapped from hit to hit"
        )
        frame[joints] = plain.to_numpy()


def _implausible(
    frame: pd.DataFrame, task: Task, source: str, unit: float, slowest: float
) -> NDArray[np.object_]:
    """Return why sorted hits of a subject are implausible, a text for each, empty for a plausible
    hit; warn of odd places and times. Raises CoarticError for times that are wrong as a whole
    (:func:`_odd_times`). Times are not checked where places make most hits implausible. ``source``
    begins messages; ``unit``: ticks in a unit of time of the recording; ``slowest``: ticks of the
    longest subtask of the corrective process."""
    why = _implausible_places(frame, task, source)
    if 2 * (why == "").sum() >= len(why):
        _mark_implausible_times(why, frame, task, source, unit, slowest)
    return why


def _mark(why: NDArray[np.object_], wrong: NDArray[np.bool_], words: str, *values: Array) -> None:
    """Write into ``why``, in place, for each hit in the mask ``wrong`` whose text is empty, the
    format ``words`` with the hit's entries of ``values``."""
    for row in np.flatnonzero(wrong & (why == "")).tolist():
        why[row] = words.format(*(each[row] for each in values))


def _implausible_places(frame: pd.DataFrame, task: Task, source: str) -> NDArray[np.object_]:
    """Return why places and postures of a subject's sorted hits are implausible, as of
    :func:`_implausible`; warn if three quarters of the hits are near the centres of goals."""
    q, radius = frame[[*task.robot.joint_names]].to_numpy(np.float64), task.radius
    goal, why = frame.goal.to_numpy(np.int64), np.full(len(frame), "", dtype=object)
    spots = {"the start: is it of the next trial":
             _hand_places(np.tile(task.q0, (len(q), 1)), frame.hand, task)}  # fmt: skip
    spots |= {f"goal {k}": place for k, place in enumerate(task.goal_array, 1)}
    places = _hand_places(q, frame.hand, task)
    ways = np.stack([np.linalg.norm(places - spot, axis=1) for spot in spots.values()], axis=1)
    off = ways[np.arange(len(ways)), goal]
    is_near = ways.min(axis=1) <= 2 * radius
    nearest = np.array([*spots], dtype=object)[ways.argmin(axis=1)]
    for name, values in zip(task.robot.joint_names[2:], q.T[2:], strict=True):
        _mark(why, np.abs(values) > 20, name + " is {:g}, no angle in rad", values)
    # Motor noise puts hits outside of their goals; gaps and flags are few, and far.
    most, outer = 2 * radius, float(np.quantile(off, 0.75))
    if outer <= most:
        most = max(most, 8 * outer - 6 * radius)
    for k in (k for k, axis in enumerate("xy") if axis in task.locked_base):
        words = f"base_{'xy'[k]} is {{:g}}, but task {task.name!r} locks it at {task.q0[k]:g}"
        _mark(why, np.abs(q[:, k] - task.q0[k]) > most, words, q[:, k])
    for hand in task.hands:
        arm, start = q[:, task.robot.joints(hand)], task.q0[task.robot.joints(hand)]
        left = pd.Series((arm != start).any(axis=1)).groupby(frame.trial).cummax().to_numpy()
        one = (arm == arm[:, :1]).all(axis=1) & left & (len(start) > 1)
        words = f"all angles of the {hand} arm are {{:g}}{', as at the start' * (not start.any())}"
        _mark(why, one, words, arm[:, 0])
        filled = _between(arm, goal) & (frame.hand == hand).to_numpy()
        _mark(why, filled, "the angles of the arm are means of the hits around it, as if filled in")
    far, words = off > most, "the hand is {:.3g} radii from its goal"
    if far.any() and is_near[far].mean() > 0.5:
        _mark(why, far & is_near, words + ", at {}", off / radius, nearest)
    _mark(why, far, words, off / radius)
    if len(off) >= MANY and outer < 0.6 * radius and not why.any():
        warn(
            f"{source}: three of four hits are within {outer / radius:.2g} radii of the centres of "
            "goals: is the radius a diameter, or are postures those of rests after hits?"
        )
    return why


def _mark_implausible_times(
    why: NDArray[np.object_],
    frame: pd.DataFrame,
    task: Task,
    source: str,
    unit: float,
    slowest: float,
) -> None:
    """Write into ``why``, in place, why times of hits at plausible places are too short or too
    long, after a check of all times together (:func:`_odd_times`); parameters as of
    :func:`_implausible`."""
    q, whole = frame[[*task.robot.joint_names]].to_numpy(np.float64), why == ""
    trial, goal, ticks = (frame[name].to_numpy(np.float64) for name in ("trial", "goal", "ticks"))
    begins, follows = goal == 1, np.zeros(len(frame), dtype=bool)
    follows[1:] = (trial[1:] == trial[:-1]) & (goal[1:] == goal[:-1] + 1) & whole[:-1]
    way = np.where(begins[:, None], q - task.q0, q - np.roll(q, 1, axis=0))
    way[:, 2:] -= 2 * np.pi * np.rint(way[:, 2:] / (2 * np.pi))
    known = (begins | follows) & whole
    straight = np.where(known, np.linalg.norm(way, axis=1) / PAPER.step, np.nan)
    if known.any():
        _odd_times(frame, straight, source, unit, slowest)
    early = np.where(known, straight - ticks, -1.0) * PAPER.step
    allowed = 0.1 + 5 * max(0.0, float(np.quantile(early, 0.9)))
    words = "it takes {:g} ticks, a straight movement {:.0f}"
    _mark(why, early > allowed, words, ticks, straight)
    _mark(why, ticks < 1, "it takes {:g} ticks, any movement 1 or more", ticks)
    words = f"it takes {{:g}} ticks, the corrective process at most {slowest:.0f} for a goal"
    _mark(why, ticks > _SLOWEST * slowest, words, ticks)


def _odd_times(
    hits: pd.DataFrame, straight: Array, source: str, unit: float, slowest: float
) -> None:
    """Raise CoarticError if times of a subject's hits are of a clock that runs on, in two units,
    coarse, or impossible; warn of signs of this, of reaction times, and of times that do not follow
    paths. ``straight``: ticks of straight movements, ``(n,)``, NaN where unknown; others as of
    :func:`_implausible`."""
    known = np.isfinite(straight)
    times = hits[["ticks", "goal", "trial"]].assign(straight=straight, fast=False)
    times["fast"] = known & ((straight - times.ticks) * PAPER.step > 0.1)
    above, below = (np.roll(times.ticks, rows) for rows in (1, -1))
    paths = times.straight.clip(lower=1.0)
    logs = pd.DataFrame({"paths": paths, "here": times.ticks, "above": above, "below": below})
    logs = logs.clip(lower=1e-9).transform(np.log)[known]
    times["pace"] = (logs.here - logs.paths).transform(np.exp)
    rises = np.diff(hits.ticks, prepend=0.0)[known]
    clocks = _clocks(hits[known], times.pace[known], rises, source)
    if known.sum() >= MANY:
        _refuse_two_units(times[known], source, unit)
    _check_steps_of_times(hits, source, float(times.ticks[known].median()))
    _check_unit(times[known], source, unit, slowest)
    _warn_of_paces(times, logs, source, clocks)


def _likely_unit(pace: float, unit: float) -> str:
    """Return the unit of time, a key of :data:`_UNITS`, that a recording probably has in which hits
    take ``pace`` ticks for each tick of a straight movement at ``unit`` ticks per unit."""
    return min(_UNITS, key=lambda name: abs(np.log(_UNITS[name] / unit * pace)))


def _refuse_two_units(times: pd.DataFrame, source: str, unit: float) -> None:
    """Raise CoarticError if over a tenth of the hits, of two goals or more, are over five times as
    slow for their paths as all others, as if in another unit; ``unit``: ticks in a unit."""
    ordered, tenth = np.sort(times.pace), len(times) // 10 + 1
    leaps = (ordered[1:] / ordered[:-1])[tenth - 1 : len(times) - tenth]
    is_slow = times.pace > ordered[tenth - 1 + leaps.argmax()]
    less, more = times[~is_slow], times[is_slow]
    units = [_likely_unit(float(each.pace.median()), unit) for each in (less, more)]
    if leaps.max() > 5 and units[0] != units[1] and len({*more.goal}) > 1:
        one, other = (f"goal {each.goal.iloc[0]:g} in trial {each.trial.iloc[0]:g}"
                      for each in (less, more))  # fmt: skip
        factor = more.pace.median() / less.pace.median()
        point = ", or was a point between thousands read as a decimal point"
        raise CoarticError(
            f"{source}: {len(more)} of {len(times)} hits, first {other}, take {factor:.0f} times "
            f"as long for their paths as others, first {one}. Do units differ, {units[1]} there "
            f"and {units[0]} elsewhere{point * bool(500 < factor < 2000)}?"
        )


def _check_steps_of_times(hits: pd.DataFrame, source: str, usual: float) -> None:
    """Raise CoarticError, or warn, if all times of 20 hits or more are multiples of a time that is
    large for the median hit, of ``usual`` ticks, although postures differ."""
    ticks = hits.ticks.to_numpy(np.float64)
    least = float(np.diff(np.unique(ticks), prepend=0.0).min())
    postures = hits.drop(columns=["subject", "trial", "goal", "hand", "ticks"]).drop_duplicates()
    is_coarse = least > max(2.0, 0.1 * usual) and len(np.unique(ticks)) < len(postures)
    if len(ticks) >= MANY and is_coarse and np.allclose(ticks % least, 0.0, atol=1e-3):
        words = (f"{source}: all times are multiples of {least:g} ticks, the median hit takes "
                 f"{usual:g}: they are rounded or constant; needed are times to a tenth of a hit "
                 "or better")  # fmt: skip
        warn(words, refuse=least > max(10, 0.2 * usual))


def _check_unit(times: pd.DataFrame, source: str, unit: float, slowest: float) -> None:
    """Raise CoarticError, or warn, if the median time of hits fits another unit; parameters as of
    :func:`_implausible`."""
    usual, path = float(times.ticks.median()), float(times.straight.median())
    ratio, too_long = usual / max(path, 1.0), usual > _SLOWEST * slowest
    if too_long or not 0.1 < ratio < 8:
        name = _likely_unit(ratio, unit)
        words = (
            f"{source}: the median hit takes {usual:g} ticks with {unit:g} ticks per unit; a "
            f"straight movement takes {path:.0f}, the corrective process at most {slowest:.0f}. "
            f"Are times in {name} (ticks_per_unit={_UNITS[name]:g})?"
        )
        warn(words, refuse=too_long or ratio <= 0.1)


def _warn_of_paces(times: pd.DataFrame, logs: pd.DataFrame, source: str, clocks: bool) -> None:
    """Warn of times that hardly follow paths (unless ``clocks`` run on), of a goal with a reaction
    time, and of many hits that are faster than the task's arm. ``logs``: logarithms of ticks of
    hits, of the rows above and below, and of straight movements."""
    paces, goals = times.pace[logs.index], times.goal[logs.index]
    follows, slow = [1.0], []
    if len(logs) >= MANY:
        rates = paces.groupby(goals).median()
        slow = rates.index[rates > 1.6 * rates.sort_values().iloc[-2:].min()].tolist()
        even = logs[~goals.isin(slow)]
        of_goal = even - even.groupby(goals[even.index]).transform("mean")
        rows = logs.corr().paths
        better = rows[["above", "below"]].max()
        follows += [rows.here] * bool(rows.here < 0.3 and better > 0.6)
        follows += [each.corr().here.paths for each in (even, of_goal) if each.paths.std() > 0.2]
    if is_odd := min(follows) < 0.5 and not clocks:
        shifted = f", {better:.2f} with the row above or below" * bool(better > 0.6)
        warn(f"{source}: times hardly follow the paths of hits (correlation {min(follows):.2f}"
             f"{shifted}): do they belong to other rows, or were they sorted, or another person's?"
        )  # fmt: skip
    if slow and not is_odd:
        warn(f"{source}: goal {slow[0]:g} takes {rates[slow[0]]:.2g} ticks for each of a straight "
             f"path, others at most {rates.drop(slow).max():.2g}: is a reaction time in it?"
        )  # fmt: skip
    if times.fast.mean() >= 0.25 and not is_odd:
        shares = times.fast[logs.index].groupby(goals).mean().sort_values()
        part, where = _changed(times.fast.to_numpy(), times.trial.to_numpy())
        question = "Are there more ticks in a unit?"
        if shares.iloc[-1] > 0.8 and shares.iloc[:-1].max() < 0.2:
            question = f"Most are hits of goal {shares.index[-1]:g}: does a counter overflow?"
        elif part.any():
            question = f"Most are {where}: are these another person's, or in another unit?"
        warn(f"{source}: a quarter of the hits or more is faster than the task's arm, whose step "
             f"is {PAPER.step:g} a tick. {question}")  # fmt: skip


def _clocks(hits: pd.DataFrame, paces: pd.Series, rises: Array, source: str) -> bool:
    """Raise CoarticError if the times of a subject's hits are of a clock that runs on from goal to
    goal; warn, and return True, if the clock runs on in five trials or more, but in under 80 % of
    all. Under 20 hits after goal 1 are not judged. ``paces``: ticks of each hit over ticks of a
    straight movement; ``rises``: ticks less ticks of the row before, ``(n,)``."""
    later = hits.goal.to_numpy() > 1
    if later.sum() < MANY:
        return False
    trial, rises = hits.trial.to_numpy(np.int64)[later], rises[later]
    of_ticks = np.log(paces.to_numpy())[later]
    of_rises = of_ticks + np.log(np.maximum(rises, 1e-9) / hits.ticks.to_numpy(np.float64)[later])
    needed = "as those of a clock that runs on; needed are times from the hit before"
    if (rises > 0).all() and np.std(of_rises) < np.std(of_ticks):
        raise CoarticError(f"{source}: in every trial times rise from goal to goal, {needed}")
    usual = np.log(paces[~later].median())
    errors = [np.bincount(trial, np.abs(each - usual)) for each in (of_ticks, of_rises)]
    clocks = [f"trial {number}" for number in np.flatnonzero(errors[1] < errors[0] / 2)]
    if found := NAMED <= len(clocks) < 0.8 * len(np.unique(trial)):
        warn(f"{source}, {clocks[0]}: times rise from goal to goal, {needed}{also(clocks)}")
    return found


def _changed(odd: NDArray[np.bool_], trial: Array) -> tuple[NDArray[np.bool_], str]:
    """Return a mask of hits in a row, or of all before and after them, that are True in ``odd``,
    ``(n,)``, more often than others, and their trials in words; ``trial``, ``(n,)``, has numbers of
    trials. The mask has no hit if n is below 20, or if the range of the sum of deviations from the
    mean (Kuiper's statistic) is, as by chance, at most 2.6 √n SD."""
    part, number = np.zeros(len(odd), dtype=bool), np.arange(len(odd))
    sums = np.cumsum(odd) - (number + 1) * (odd.sum() / max(len(odd), 1))
    if len(odd) >= MANY and np.ptp(sums) > 2.6 * np.sqrt(len(odd)) * odd.std():
        first, last = sorted([sums.argmin(), sums.argmax()])
        part = (number > first) & (number <= last)
        if odd[part].mean() < odd[~part].mean():
            part = ~part
    edges = np.flatnonzero(np.diff(part, prepend=False, append=False)).reshape(-1, 2)
    ends = [[f"{trial[begin]:g}", f"{trial[end - 1]:g}"] for begin, end in edges]
    return part, f"in trials {' and '.join(' to '.join(dict.fromkeys(each)) for each in ends)}"


def _hand_places(q: Array, hands: pd.Series, task: Task) -> Array:
    """Return the places of the hands of n hits, ``(n, 2)``, length unit, from their postures ``q``,
    ``(n, dof)``, and ``hands``, left or right."""
    places = np.empty((len(q), 2))
    for hand in task.hands:
        rows = (hands == hand).to_numpy()
        places[rows] = task.robot.forward_kinematics(q[rows], hand)
    return places


def _remedy(frame: pd.DataFrame, far: NDArray[np.bool_], task: Task) -> str:
    """Return in words a change of a recording (degrees to rad, other axes, swapped columns, ...),
    or one for each arm, that puts over 80 % of the arm's hits in mask ``far`` and over two radii
    away, three or more at several goals if there are such, as close to goals as others, within 1.25
    to 2 radii; empty if no change does."""
    joints, hands = [*task.robot.joint_names], frame.hand
    q, column = frame[joints].to_numpy(np.float64), np.arange(len(joints))
    arms = [task.robot.joints(hand) for hand in task.hands]
    is_base, is_first, between = column < 2, np.isin(column, [arm.start for arm in arms]), q.copy()
    for arm in arms:
        between[:, arm] = np.diff(q[:, arm], axis=1, prepend=0.0)
    forms = {"": (q, 0.0), "a straight joint has angle 0, not π": (q, np.pi),
             "angles are from the link before, not from the x axis": (between, 0.0)}  # fmt: skip
    tried = []
    for unit, form, axes, moves in product(_ANGLES, forms, AXES, (False, True)):
        (recorded, straight), (sign, quarters) = forms[form], AXES[axes]
        angles = sign * (_ANGLES[unit] * recorded - np.where(is_first, 0.0, straight))
        angles += is_first * quarters * np.pi / 2
        angles[:, :2] = turned(q[:, :2], axes) if moves else q[:, :2]
        tried.append((f"in which {', '.join(filter(None, [unit, form, axes]))}", angles))
    del tried[:2]  # nothing is changed
    for words, shift in (("lower", 1), ("higher", -1)):
        rolled = np.roll(q, shift, axis=0)
        tried += [(f"with each posture a row {words}", rolled),
                  (f"with all angles a row {words}", np.where(is_base, q, rolled))]  # fmt: skip
    for unit in (10, 100, 1000):
        tried.append((f"in which the base is divided by {unit}", q / np.where(is_base, unit, 1)))
    for k, name in enumerate(joints):
        tried.append((f"with the other sign of {name}", np.where(column == k, -q, q)))
        for last, words in ((k, ""), (k + 1, ", and back in the next joint")) if k > 1 else ():
            turn = np.pi * ((column == k) | (column == last))
            tried.append((f"with a turn by π of {name} (arctan2, not arctan){words}", q + turn))
    for arm in arms:
        few = arm.stop - arm.start <= 4
        for each in permutations(column[arm].tolist()) if few else [column[arm].tolist()[::-1]]:
            order = [*column[: arm.start], *each, *column[arm.stop :]]
            names = ", ".join(joints[k] for k in each)
            tried.append((f"with columns in the order {names}", q[:, order]))
    if len({arm.stop - arm.start for arm in arms}) < len(arms):
        order = [0, 1, *column[arms[1]], *column[arms[0]]]
        tried.append(("in which the columns of the arms are swapped", q[:, order]))
    swapped = "in which hands are swapped"
    other: dict[Hand, Hand] = {"left": "right", "right": "left"}
    tried += [(swapped, q)] * (len(arms) == 2)
    goals, fits = task.goal_array[frame.goal.to_numpy(np.int64) - 1], {}
    off = np.linalg.norm(_hand_places(q, hands, task) - goals, axis=1) / task.radius
    far = far & (off > 2)
    usual = np.quantile(off[~far], 0.95) if (~far).sum() >= MANY else 2.0
    most = float(np.clip(usual, _OUTSIDE, 2.0)) * task.radius
    for hand in task.hands:
        rows = np.flatnonzero(far & (hands == hand).to_numpy())
        if len(rows) < 3 or len({*frame.goal[rows]}) < min(2, len(task.goals)):
            continue
        shares = []
        for words, postures in tried:
            made_by = other[hand] if words == swapped else hand
            ways = task.robot.forward_kinematics(postures[rows], made_by) - goals[rows]
            shares.append((np.linalg.norm(ways, axis=1) <= most).mean())
        if max(shares) > 0.8:
            fits[hand] = tried[int(np.argmax(shares))][0]
    if len({*fits.values()}) == 1 and len(fits) == len(task.hands):
        return fits[task.hands[0]]
    return " and ".join(f"{fits[hand]} (the {hand} arm)" for hand in fits)


def _repeats(values: Array, edge: float) -> NDArray[np.bool_]:
    """Return a mask of the rows whose k values, ``(n, k)``, in steps to which they are rounded, are
    all less than ``edge`` away from 0; no row if chance could make as many: fewer than 3 + m / 2ᵏ,
    for m other rows less than five times as far away."""
    size: Array = np.abs(values).max(axis=1, initial=0.0)
    exact = size < edge
    near = int((size[~exact] < 5 * edge).sum())
    return exact & bool(exact.sum() >= 3 + near / 2 ** values.shape[1])


def _between(arm: Array, goal: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return a mask of the hits of a subject in which all angles of an arm of two joints or more,
    ``(n, joints)``, are means of the hits before and after, between which it moves, or of the hits
    before and after at the same ``goal``, ``(n,)``, more often than by chance."""
    q, found = arm.round(9), np.zeros(len(arm), dtype=bool)
    steps = np.array([np.diff(np.unique(angles)).min(initial=1.0) for angles in q.T])
    for order in (np.arange(len(q)), np.argsort(goal, kind="stable")):
        before, middle, after = order[:-2], order[1:-1], order[2:]
        moved = (np.abs(q[after] - q[before]) > 10 * steps).any(axis=1) & (len(steps) > 1)
        bends = (q[after] + q[before] - 2 * q[middle])[moved] / steps
        found[middle[moved]] |= _repeats(bends, 1.6)
    return found


def _odd_groups(frame: pd.DataFrame, task: Task) -> list[str]:
    """Return a sentence for trials in a row of a subject's hand, or at a goal, and for each goal,
    with a much larger share of hits clearly outside of goals than others."""
    q, goals = frame[[*task.robot.joint_names]].to_numpy(np.float64), frame.goal.to_numpy(np.int64)
    places, trials = _hand_places(q, frame.hand, task), frame.trial.to_numpy(np.float64)
    ways = places - task.goal_array[goals - 1]
    out = np.linalg.norm(ways, axis=1) > _OUTSIDE * task.radius
    sentences, rest = [], np.ones(len(out), dtype=bool)

    def is_odd(here: NDArray[np.int64], others: NDArray[np.int64], name: str, cause: str) -> bool:
        share, usual = out[here].mean(), out[others].mean()
        if odd := bool(share > max(0.3, 2.5 * usual)):
            sentences.append(
                f"{100 * share:.0f} % of the hits of {name} are more than {_OUTSIDE:g} radii from "
                f"the centre of the goal, of others {100 * usual:.0f} %. {cause}"
            )
        return odd

    groups = {f"'s {hand} hand": (frame.hand == hand).to_numpy() for hand in task.hands}
    groups |= {f" at goal {goal}": goals == goal for goal in np.unique(goals)}
    cause = "Did a sensor drift or slip, change its scale, or was it zeroed again?"
    for subject, (name, of_name) in product(frame.subject.unique(), groups.items()):
        rows = np.flatnonzero((frame.subject == subject).to_numpy() & of_name & rest)
        part, where = _changed(out[rows], trials[rows])
        if part.any() and is_odd(rows[part], rows[~part], f"{subject}{name} {where}", cause):
            rest[rows[part]] = False
    for goal in np.unique(goals):
        here, others = (np.flatnonzero(rest & each) for each in (goals == goal, goals != goal))
        if min(len(here), len(others)) >= MANY:
            (x, y), (off_x, off_y) = places[here].mean(axis=0), ways[here].mean(axis=0)
            mean = f"Their mean is ({x:.3g}, {y:.3g}), ({off_x:+.2g}, {off_y:+.2g}) from it"
            is_odd(here, others, f"goal {goal}", f"{mean}: is the goal elsewhere?")
    return sentences


def _warn_of_values(hits: pd.DataFrame, joints: Sequence[str], source: str) -> None:
    """Warn, at most once, if an angle of an arm seems rounded or not measured, or if many hits of a
    goal have the same posture, or the same value of an angle, as if filled in. ``hits`` are
    recorded hits of a subject with this arm, ``joints`` the columns of its angles, rad; ``source``
    begins the warning."""
    postures = len(hits[joints].drop_duplicates())
    for name in joints:
        angles = np.unique(hits[name])
        least = float(np.diff(angles).min(initial=np.inf))
        if len(angles) == 1 < len(joints) and len({*hits.goal}) > 1 and len(hits) >= 5:
            warn(f"{source}: {name} is the same in all {len(hits)} hits: was it measured?")
            return
        if 2 < len(angles) < postures / 2 and postures >= MANY and least > 0.02:
            warn(f"{source}: {name} has {len(angles)} values, {least:.2g} rad apart or more: is it "
                 "rounded?")  # fmt: skip
            return
    goals = hits.goal.to_numpy()
    compared = hits[[*joints]].assign(posture=hits.groupby([*joints]).ngroup())
    for name in ("posture", *joints):
        values = compared[name].to_numpy()
        for goal in np.unique(goals):
            counts = np.sort(np.unique(values[goals == goal], return_counts=True)[1])
            second, most = [0, *counts.tolist()][-2:]
            n = int(counts.sum())
            fewest = 3 if name == "posture" else max(5, 0.1 * n)
            is_odd = most >= max(fewest, 3 * second) and n - most >= 4 and postures >= MANY
            is_odd &= 2 * (len(counts) - 1) > n - most
            if is_odd or most == n >= 5:
                what = "the posture" if name == "posture" else name
                warn(f"{source}: {what} is the same in {most} of {n} hits of goal {goal:g}: "
                     "is it filled in, computed, out of range, or stuck?")  # fmt: skip
                return


def _cut_trials(frame: pd.DataFrame, goals: int) -> list[str]:
    """Return a sentence for each subject with two or more trials that are cut in two: the next
    trial has the goals left, of ``goals`` in all. At least half of the trials that lack hits have
    to be such halves."""
    sentences = []
    for subject, of_subject in frame.groupby("subject", sort=False):
        trials = of_subject.groupby("trial", as_index=False).goal.agg(["min", "max", "count"])
        trials["gapless"] = trials["max"] - trials["min"] + 1 == trials["count"]
        after = trials.shift(-1)
        cut = trials.gapless & trials.gapless.shift(-1, fill_value=False) & (trials["min"] == 1)
        cut &= (after.trial == trials.trial + 1) & (after["min"] == trials["max"] + 1)
        cut &= after["max"] == goals
        if cut.sum() >= max(2, (trials["count"] < goals).sum() / 4):
            first = trials.trial[cut].iloc[0]
            sentences.append(f"{cut.sum()} trials of {subject} end where the next one begins, "
                             f"first trial {first:g}: are trials cut in two?")  # fmt: skip
    return sentences


def _copies(frame: pd.DataFrame) -> list[str]:
    """Return a sentence on trials that are equal in all postures (two of a subject, or three that
    occur twice or more); without such trials, sentences for each subject with more equal times of
    consecutive hits, or of two trials at all goals, than by chance."""
    postures = frame.drop(columns=["subject", "trial", "ticks"])
    hits = pd.util.hash_pandas_object(postures, index=False)
    trials = hits.groupby([frame.subject, frame.trial], sort=False).sum()
    copies = trials[trials.duplicated(keep=False)]
    if copies.nunique() >= 3 or copies.reset_index(name="sum").duplicated(["subject", "sum"]).any():
        first = [f"trial {trial:g} of {subject}" for subject, trial in
                 copies.index[copies == copies.iloc[-1]][:2]]  # fmt: skip
        return [f"{len(copies)} trials are equal to others in all postures, such as "
                f"{' and '.join(first)}. Is a recording there twice, or a trial copied?"
        ]  # fmt: skip
    words = []
    for subject, of_subject in frame.groupby("subject", sort=False):
        ticks, number = of_subject.ticks.to_numpy(np.float64), of_subject.trial.to_numpy()
        if len(ticks) < MANY or len(each := np.unique(ticks)) < 3:
            continue
        unit, rises = np.diff(each).min(), np.diff(ticks)
        if (runs := _repeats(np.stack([rises[1:], rises[:-1]], axis=1) / unit, 0.5)).any():
            words.append(f"Consecutive hits of {subject} have equal times, first in trial "
                         f"{number[runs.argmax()]:g}: are they a mean, or filled in?")  # fmt: skip
        table = of_subject.pivot_table(index="trial", columns="goal", values="ticks").dropna()
        times, n = table.to_numpy(), len(table)
        pairs = [(np.arange(n - lag), np.arange(lag, n)) for lag in range(1, n)]
        pairs.append(np.triu_indices(min(n, 1000), 1))  # larger ones would take long
        fine = n > 2 < times.shape[1] and (times.std(axis=0) > unit).all()
        for one, other in pairs if fine else ():
            if (same := _repeats((times[other] - times[one]) / unit, 0.5)).any():
                first, second = (table.index[each[same.argmax()]] for each in (one, other))
                words.append(f"Trials {first:g} and {second:g} of {subject}, and others, have the "
                             "same times at all goals: are they copied?")  # fmt: skip
                break
    return words
