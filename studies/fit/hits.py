"""What was recorded: the trials of people, from a CSV file with a row for each hit."""

import warnings
from typing import NamedTuple

import numpy as np
import pandas as pd

from coartic import CoarticError

HANDS = ("left", "right")
"""Hands in the order in which arrays count them."""
LARGEST_ANGLE = 20.0
"""Angle, rad, beyond which a recorded angle is taken for degrees."""

MOST_TRIALS = 100_000
"""Largest number of a trial."""


def read_hits(path, task, *, ticks_per_unit=1.0):
    """Read the trials of people: a CSV file with a row for each hit.

    Parameters
    ----------
    path : str or pathlib.Path
        The file, with columns ``subject``, ``trial`` and ``goal`` (both from 1), ``hand`` (left or
        right), ``ticks`` or ``duration``, and one for each entry of ``task.robot.joint_names``
        (length unit and rad). Rows of trials and goals may be missing.
    task : Task
        The task that was practised.
    ticks_per_unit : float
        Ticks in a unit of ``duration``.

    Returns
    -------
    DataFrame
        The rows, with ``ticks``, in the order of subjects, trials and goals.

    Raises
    ------
    CoarticError
        The file is no such table. A sentence says where and what is needed.
    """
    try:
        frame = pd.read_csv(path, dtype={"subject": str})
    except (OSError, ValueError) as error:
        raise CoarticError(f"{path} cannot be read as a CSV file: {error}") from None
    if "ticks" not in frame and "duration" in frame:
        frame["ticks"] = (pd.to_numeric(frame.duration, errors="coerce") * ticks_per_unit).round(6)
    joints = [*task.robot.joint_names]
    needed = ["subject", "trial", "goal", "hand", "ticks", *joints]
    if missing := [name for name in needed if name not in frame]:
        raise CoarticError(f"{path} has no column {', '.join(missing)}; needed are "
                           f"{', '.join(needed)} (or duration in place of ticks), separated by "
                           "commas")  # fmt: skip
    if not len(frame):
        raise CoarticError(f"{path} has no hit: needed is a row for each")

    def refuse(wrong, column, wanted):
        if wrong.any():
            row = int(np.flatnonzero(wrong)[0])
            value = frame[column].tolist()[row]
            raise CoarticError(f"{path}, line {row + 2}: {column} is {value!r}; {wanted}")

    for name in ["trial", "goal", "ticks", *joints]:
        numbers = pd.to_numeric(frame[name], errors="coerce")
        wanted = "needed is a number; leave out the row of a hit that is missing"
        refuse(~np.isfinite(numbers), name, wanted)
        frame[name] = numbers
    refuse(frame.subject.isna(), "subject", "needed is a name")
    refuse(~frame.hand.isin(task.hands), "hand", f"needed is {' or '.join(task.hands)}")
    is_whole = (frame.trial % 1 == 0) & frame.trial.between(1, MOST_TRIALS)
    refuse(~is_whole, "trial", f"needed is a whole number from 1 to {MOST_TRIALS}")
    last = len(task.goals)
    refuse(
        ~frame.goal.isin(range(1, last + 1)),
        "goal",
        f"needed is a number from 1 to {last}",
    )
    if "duration" not in frame:
        refuse(frame.ticks % 1 != 0, "ticks", "needed is a whole number")
    refuse(frame.ticks <= 0, "ticks", "needed is more than 0, from the hit before to this one")
    twice = frame.duplicated(["subject", "trial", "goal"])
    refuse(twice, "goal", "this subject, trial and goal have a line above already")
    for name in joints[2:]:
        wanted = "angles are in rad: convert degrees with numpy.radians"
        refuse(frame[name].abs() > LARGEST_ANGLE, name, wanted)
    off = np.zeros(len(frame))
    for hand in task.hands:
        rows = (frame.hand == hand).to_numpy()
        place = task.robot.forward_kinematics(frame.loc[rows, joints].to_numpy(), hand)
        off[rows] = np.linalg.norm(place - task.goal_array[frame.goal[rows] - 1], axis=1)
    if np.median(off) > 2 * task.radius:
        warnings.warn(
            f"{path}: in the median hit the hand is {np.median(off):.2g} length units from its "
            "goal. Are the angles in rad, each measured from the link before, the base in the "
            f"length unit of the task, and is the task {task.name!r}?",
            stacklevel=2,
        )
    frame = frame[needed].sort_values(["subject", "trial", "goal"], ignore_index=True)
    ticks = frame.pivot_table("ticks", ["subject", "trial"], "goal").dropna()
    if len(ticks) >= 10 and (ticks.diff(axis=1).iloc[:, 1:] > 0).all(axis=None):
        warnings.warn(
            f"{path}: in every trial ticks rise from goal to goal. Are they from the hit before, "
            "and not from the start of the trial?",
            stacklevel=2,
        )
    return frame


class Trials(NamedTuple):
    """Trials of a subject, from the first to the last number; G goals."""

    hands: np.ndarray
    """Hands as places in HANDS, shape ``(T, G)``; -1 for a hit that is missing."""
    postures: np.ndarray
    """Shape ``(T, G, dof)``; NaN for a hit that is missing."""
    rewards: np.ndarray
    """Minus the ticks, shape ``(T,)``; NaN where a hit of the trial is missing."""


def trials_of(frame, task):
    """Return the trials of one subject from rows of :func:`read_hits`."""
    shape = int(frame.trial.max()), len(task.goals)
    hands, ticks = np.full(shape, -1), np.full(shape, np.nan)
    postures = np.full((*shape, task.robot.dof), np.nan)
    at = frame.trial.to_numpy(int) - 1, frame.goal.to_numpy(int) - 1
    hands[at], ticks[at] = frame.hand.map(HANDS.index), frame.ticks
    postures[at] = frame[[*task.robot.joint_names]]
    return Trials(hands, postures, -ticks.sum(axis=1))
