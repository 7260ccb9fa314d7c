"""Recorded trials, of people for instance: read from a CSV file, or checked in a frame."""

from __future__ import annotations

import csv
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from coartic import CoarticError, Task
from coartic.internal.arguments import checked_arguments
from coartic.internal.limits import brief_value
from coartic.internal.text import counted, foreign_file
from coartic.motion.movement import LARGEST_ENTRY

_LARGEST_ANGLE = 20.0
"""Largest angle, rad; a larger one is taken for degrees and refused."""
_AMBIGUOUS = 2.5
"""Turn of a joint between hits, rad, from which its direction is in doubt if angles are wrapped."""
_LARGEST_TRIAL = 100_000
"""Largest number of a trial."""


@checked_arguments
def read_hits(path: str | Path, task: Task, *, ticks_per_unit: float = 1.0) -> pd.DataFrame:
    """Read recorded trials: a CSV file with a row for each hit.

    Blank lines, lines that begin with ``#``, commas at the end of a line, and other columns do not
    count. Angles that jump by a turn (2π) between hits are unwrapped from hit to hit, from the
    start of the task on, with a warning. They stay, also with a warning, if the hand is more than
    two radii from its goal in the median hit. Warns, too, if ticks rise from goal to goal.

    Parameters
    ----------
    path : str or pathlib.Path
        The file, with columns ``subject``, ``trial`` and ``goal`` (both from 1), ``hand`` (left or
        right), ``ticks`` or ``duration``, and one for each entry of ``task.robot.joint_names``
        (length unit and rad). ``ticks`` and ``duration`` count from the hit before. Rows of trials
        and goals may be missing, and so may columns of an arm that is not among ``task.hands`` and
        of a locked base: their values are then those at the start.
    task : Task
        The task that was practised.
    ticks_per_unit : float
        Ticks in a unit of ``duration``, such as 100 for seconds.

    Returns
    -------
    DataFrame
        The rows sorted by subject (in the order of the file), trial and goal, with ``ticks`` in
        place of ``duration`` and all joints; numbers are float64, the index is new.

    Raises
    ------
    CoarticError
        The file is no such table, an angle exceeds 20 rad, or a wrapped joint turns by more than
        2.5 rad between hits. A sentence says where and what is needed.
    """
    if words := foreign_file(str(path), "recorded hits are a CSV file, see docs/howto/people.md"):
        raise CoarticError(words)
    headings, rows, lines = _read_lines(path)
    frame = pd.DataFrame(rows, columns=headings, dtype=object)
    if "ticks" not in frame and "duration" in frame:
        frame["ticks"] = (pd.to_numeric(frame.duration, errors="coerce") * ticks_per_unit).round(6)
    return checked_hits(frame, task, str(path), [f"line {line}" for line in lines])


def _read_lines(path: str | Path) -> tuple[list[str], list[list[str]], list[int]]:
    """Return headings, rows of as many texts, and the number of the last line of each row, from 1;
    blank lines and lines that begin with ``#`` are left out. Raises CoarticError for a file that
    cannot be read or is no table of text separated by commas."""
    try:
        content = Path(path).read_bytes()
        text = content.decode("utf-8-sig")
    except OSError as error:
        raise CoarticError(f"{path} cannot be read: {error.strerror or error}") from None
    except UnicodeDecodeError:
        text = "\0"
    if "\0" in text:
        wide = content[:2] in (b"\xff\xfe", b"\xfe\xff") or b"\0" in content[:200]
        kind = "in UTF-16, as Excel and Notepad write 'Unicode'" if wide else "not in UTF-8"
        raise CoarticError(f"{path} is {kind}: save it as CSV in UTF-8")
    reader = csv.reader(text.splitlines(keepends=True), skipinitialspace=True)
    headings: list[str] = []
    rows, lines = [], []
    try:
        for fields in reader:
            fields = [field.strip() for field in fields]
            while fields and not fields[-1] and (not headings or len(fields) > len(headings)):
                fields.pop()
            if not any(fields) or fields[0].startswith("#"):
                continue
            if not headings:
                headings = fields
            elif len(fields) != len(headings):
                raise CoarticError(
                    f"{path}, line {reader.line_num}: it has {counted(len(fields), 'value')}, "
                    f"the headings are {len(headings)}: {', '.join(headings)}"
                )
            else:
                rows.append(fields)
                lines.append(reader.line_num)
    except csv.Error as error:
        raise CoarticError(f"{path}, line {reader.line_num}: {error}") from None
    if twice := [name for n, name in enumerate(headings) if name in headings[:n]]:
        raise CoarticError(f"{path} has two columns {twice[0]!r}")
    return headings, rows, lines


def checked_hits(
    frame: pd.DataFrame, task: Task, source: str, names: Sequence[str]
) -> pd.DataFrame:
    """Return a new frame of recorded hits as :func:`read_hits` returns it, checked and unwrapped.

    ``source``, the name of the file or frame, and ``names``, a name for each row, are for messages.
    Raises CoarticError as :func:`read_hits` does.
    """
    joints = [*task.robot.joint_names]
    free = {f"base_{axis}" for axis in "xy" if axis not in task.locked_base}
    free |= {name for hand in task.hands for name in joints[task.robot.joints(hand)]}
    needed = ["subject", "trial", "goal", "hand", "ticks", *joints]
    still = [name for name in joints if name not in free | {*frame.columns}]
    frame = frame.assign(**{name: task.q0[joints.index(name)] for name in still})
    if missing := [name for name in needed if name not in frame]:
        there = ", ".join(map(str, frame.columns.drop(still))) or "none"
        raise CoarticError(
            f"{source} has no column {', '.join(missing)}; needed are "
            f"{', '.join(name for name in needed if name not in still)} (or duration in place of "
            f"ticks), separated by commas; found are {there}"
        )
    if not len(frame):
        raise CoarticError(f"{source} has no hit: needed is a row for each")
    timed, frame = "duration" in frame, frame[needed].copy()

    def refuse(wrong: ArrayLike, column: str, wanted: str) -> None:
        if (rows := np.flatnonzero(np.asarray(wrong, dtype=bool))).size:
            value = brief_value(frame[column].tolist()[rows[0]])
            value = "empty" if value == "''" else value
            raise CoarticError(f"{source}, {names[rows[0]]}: {column} is {value}; {wanted}")

    for name in ["trial", "goal", "ticks", *joints]:
        numbers = pd.to_numeric(frame[name], errors="coerce").to_numpy(np.float64, na_value=np.nan)
        refuse(~np.isfinite(numbers), name,
               "needed is a number; leave out the row of a hit that is missing")  # fmt: skip
        frame[name] = numbers
    is_blank = frame.subject.isna() | (frame.subject.astype(str).str.strip() == "")
    refuse(is_blank, "subject", "needed is a name")
    refuse(~frame.hand.isin(task.hands), "hand", f"needed is {' or '.join(task.hands)}")
    is_whole = (frame.trial % 1 == 0) & frame.trial.between(1, _LARGEST_TRIAL)
    refuse(~is_whole, "trial", f"needed is a whole number from 1 to {_LARGEST_TRIAL}")
    last = len(task.goals)
    refuse(~frame.goal.isin(range(1, last + 1)), "goal", f"needed is a number from 1 to {last}")
    if not timed:
        seconds = "needed is a whole number; seconds belong into a column duration"
        refuse(frame.ticks % 1 != 0, "ticks", seconds)
    refuse(frame.ticks <= 0, "ticks", "needed is more than 0, from the hit before to this one")
    refuse(frame.ticks < 1, "ticks",
           "a duration is less than a tick: give ticks_per_unit, 100 for s")  # fmt: skip
    twice = frame.duplicated(["subject", "trial", "goal"])
    refuse(twice, "goal", "this subject, trial and goal have a line above already; number trials "
           "through from session to session")  # fmt: skip
    for name in joints[:2]:
        far = "needed is a place in the length unit of the task"
        refuse(frame[name].abs() > LARGEST_ENTRY, name, far)
    for name in joints[2:]:
        wanted = "angles are in rad: convert degrees with numpy.radians"
        refuse(frame[name].abs() > _LARGEST_ANGLE, name, wanted)
    keys = frame.trial * (last + 1) + frame.goal
    order = np.lexsort([keys.to_numpy(), pd.factorize(frame.subject)[0]])
    frame, names = frame.iloc[order].reset_index(drop=True), [names[n] for n in order]
    if not _hint(frame, task, source):
        _unwrap(frame, task, source, names)
    return frame


def _unwrap(frame: pd.DataFrame, task: Task, source: str, names: Sequence[str]) -> None:
    """Unwrap the angles of sorted hits in place, hit by hit, each trial from the task's start on.

    Warns if angles change. Raises CoarticError if the joint of a subject is wrapped and turns by
    more than :data:`_AMBIGUOUS` between hits: then its direction is in doubt.
    """
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
    doubtful = doubtful & (np.abs(steps) > _AMBIGUOUS)
    for row, joint in np.argwhere(doubtful)[:1]:
        step = steps[row, joint]
        raise CoarticError(
            f"{source}, {names[row]}: {joints[joint]} of subject {frame.subject[row]} turns by "
            f"{step:.2f} or by {step - np.sign(step) * 2 * np.pi:.2f} rad from the hit before, and "
            "this subject's angles are wrapped (they jump by 2π): unwrap the recording with "
            "numpy.unwrap before hits are taken from it"
        )
    for row, joint in np.argwhere(turns != 0)[:1]:
        warnings.warn(
            f"{source}: {np.count_nonzero(turns)} times an angle jumps by a turn (2π) between "
            f"hits, first {joints[joint]} in {names[row]}; angles are unwrapped from hit to hit",
            stacklevel=4,
        )
        frame[joints] = plain.to_numpy()


def _hint(frame: pd.DataFrame, task: Task, source: str) -> bool:
    """Warn if ticks rise from goal to goal in every trial, and if the hand is more than two radii
    from its goal in the median hit. Return True for the second: such angles are not unwrapped."""
    off = np.zeros(len(frame))
    for hand in task.hands:
        rows = (frame.hand == hand).to_numpy()
        postures = frame.loc[rows, [*task.robot.joint_names]].to_numpy()
        goals = task.goal_array[frame.goal[rows].to_numpy(np.int64) - 1]
        off[rows] = np.linalg.norm(task.robot.forward_kinematics(postures, hand) - goals, axis=1)
    if far := bool(np.median(off) > 2 * task.radius):
        warnings.warn(
            f"{source}: in the median hit the hand is {np.median(off):.2g} length units from its "
            "goal. Are the angles in rad, each measured from the link before, the base in the "
            f"length unit of the task, and is the task {task.name!r}?",
            stacklevel=4,
        )
    ticks = frame.pivot_table("ticks", ["subject", "trial"], "goal").dropna()
    if len(ticks) >= 10 and (ticks.diff(axis=1).iloc[:, 1:] > 0).to_numpy().all():
        warnings.warn(
            f"{source}: in every trial ticks rise from goal to goal. Are they from the hit before, "
            "and not from the start of the trial?",
            stacklevel=4,
        )
    return far
