"""Read the trials of people from a CSV file with a row for each hit."""

import warnings

import numpy as np
import pandas as pd

from coartic import CoarticError

HALF_TURNS = 20.0
"""Angle, rad, beyond which a recorded angle is taken for degrees."""


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
        frame["ticks"] = frame.duration * ticks_per_unit
    joints = [*task.robot.joint_names]
    needed = ["subject", "trial", "goal", "hand", "ticks", *joints]
    if missing := [name for name in needed if name not in frame]:
        raise CoarticError(f"{path} has no column {', '.join(missing)}; needed are "
                           f"{', '.join(needed)} (or duration in place of ticks)")  # fmt: skip

    def refuse(wrong, column, wanted):
        if wrong.any():
            row = int(np.flatnonzero(wrong)[0])
            raise CoarticError(f"{path}, line {row + 2}: {column} is {frame[column].iloc[row]!r}; "
                               f"{wanted}")  # fmt: skip

    for name in needed[1:]:
        if name != "hand":
            frame[name], given = pd.to_numeric(frame[name], errors="coerce"), frame[name]
            wrong = ~np.isfinite(frame[name])
            frame[name] = frame[name].where(~wrong, given) if wrong.any() else frame[name]
            refuse(wrong, name, "needed is a number; leave out the row of a hit that is missing")
    refuse(frame.subject.isna(), "subject", "needed is a name")
    refuse(~frame.hand.isin(task.hands), "hand", f"needed is {' or '.join(task.hands)}")
    whole = (frame.trial % 1 == 0) & (frame.trial >= 1)
    refuse(~whole, "trial", "needed is a whole number from 1")
    last = len(task.goals)
    refuse(~frame.goal.isin(range(1, last + 1)), "goal", f"needed is a number from 1 to {last}")
    refuse(frame.ticks < 0, "ticks", "needed is 0 or more")
    twice = frame.duplicated(["subject", "trial", "goal"])
    refuse(twice, "goal", "this subject, trial and goal have a line above already")
    for name in joints[2:]:
        wanted = f"angles are in rad (did you mean {np.radians(frame[name].abs().max()):.3g}?)"
        refuse(
            frame[name].abs() > HALF_TURNS, name, f"{wanted}: convert degrees with numpy.radians"
        )
    off = np.zeros(len(frame))
    for hand in task.hands:
        rows = (frame.hand == hand).to_numpy()
        place = task.robot.forward_kinematics(frame.loc[rows, joints].to_numpy(), hand)
        off[rows] = np.linalg.norm(place - task.goal_array[frame.goal[rows] - 1], axis=1)
    if np.median(off) > 2 * task.radius:
        warnings.warn(f"{path}: the hands are {np.median(off):.2g} length units from their goals in "
                      "the median hit. Are the angles in rad, each measured from the link before, "
                      f"and is the task {task.name!r}?", stacklevel=2)  # fmt: skip
    return frame[needed].sort_values(["subject", "trial", "goal"], ignore_index=True)
