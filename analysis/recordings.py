"""Read recorded trials of people, and check whether they fit the task.

A recording is a table with a row for each hit of a goal. For a table with a missing column or a
wrong value, the functions raise CoarticError. The message names the column and, for a wrong value,
the first row that has one. :func:`consistency` computes, for each hit, how far the hand is from the
goal, and how slow the movement is compared with a movement of the model.
"""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from coartic import CoarticError, Execution, Movement, Task
from coartic.analysis.signatures import Solutions
from coartic.internal.arguments import checked_arguments
from coartic.internal.limits import brief_value, check_limits
from coartic.model import PAPER
from coartic.robot import MAX_ENTRY, Array

FAR = 2.0
"""Largest distance between the hand and the centre of the goal, in radii of the goal, at which a
recorded hit fits the task."""
_KEY = ["subject", "trial", "goal"]
_OF_CALLER = 6  # level in the stack of the caller of a function with checked arguments


@checked_arguments
def read_hits(path: str | Path, task: Task, *, ticks_per_unit: float = 1.0) -> pd.DataFrame:
    """Read recorded hits from a CSV file, and check them.

    Parameters
    ----------
    path : str or pathlib.Path
        A CSV file in UTF-8 with the columns of :func:`check_hits`. A column ``duration`` can
        replace ``ticks``. Other columns, empty lines, and the text from a ``#`` to the end of its
        line are ignored.
    task : Task
        The task that was practised.
    ticks_per_unit : float
        Number of ticks in one unit of column ``duration``. For durations in seconds, 100 says that
        a tick is 10 ms.

    Returns
    -------
    DataFrame
        The hits, as :func:`check_hits` returns them.

    Raises
    ------
    CoarticError
        - The file cannot be read, or is not a table.
        - The file has a column ``ticks``, and also a column ``duration``; or it has a column
          ``ticks``, and ``ticks_per_unit`` is not 1.
        - :func:`check_hits` refuses the rows.
    ValueError
        ``ticks_per_unit`` is not from 1e-9 to 1e9.

    Warns
    -----
    UserWarning
        Hits do not fit the task (:func:`check_hits`).
    """
    return _judged(_hits_in_file(path, task, ticks_per_unit), task, str(path))


@checked_arguments
def check_hits(frame: pd.DataFrame, task: Task) -> pd.DataFrame:
    """Check recorded hits, and return them sorted by subject, trial and goal.

    The joint angles of each trial are unwrapped: a multiple of 2π is added to each angle, so that
    it differs by at most π from the same angle at the previous recorded hit of the trial. The
    angles at the first hit are compared with those at the start of the task.

    Parameters
    ----------
    frame : DataFrame
        A row for each hit, with the columns

        - ``subject``: name of the person;
        - ``trial``: number of the person's trial, from 1;
        - ``goal``: number of the goal that is hit, from 1;
        - ``hand``: the hand that hits the goal, ``left`` or ``right``, among ``task.hands``;
        - ``ticks``: the time from the previous hit of the trial, or from the start of the trial;
        - the posture at the hit: a column for each name in ``task.robot.joint_names``, with the
          position of the base in length units and the joint angles in rad.

        Rows of some hits may be missing. A column of the base may be missing if the task locks the
        base in this coordinate. It is then filled with the coordinate at the start of the task. The
        columns of an arm whose hand is not among ``task.hands`` are not read: they are always
        filled with the angles at the start of the task.
    task : Task
        The task that was practised.

    Returns
    -------
    DataFrame
        The columns above, and no others, with numbers as float64 and a new index. Subjects are in
        the order in which they first appear in ``frame``.

    Raises
    ------
    CoarticError
        - The frame has no rows, a column is missing or occurs twice, or a value does not fit its
          column. All numbers must be from -1e5 to 1e5.
        - Two rows have the same subject, trial and goal.
        - More than half of the hits of a subject are more than two radii from the centres of their
          goals.

    Warns
    -----
    UserWarning
        - At least one hit of a subject is more than two radii from the centre of its goal.
        - The median ``pace`` of a subject (:func:`consistency`) is below 0.1 or above 10.
    """
    return _judged(_readable(frame, task, "the frame"), task, "the frame")


@checked_arguments
def consistency(hits: pd.DataFrame, task: Task) -> pd.DataFrame:
    """Return how well each recorded hit fits the task, in position and in time.

    Parameters
    ----------
    hits : DataFrame
        Recorded hits, as :func:`check_hits` describes them.
    task : Task
        The task that was practised.

    Returns
    -------
    DataFrame
        A row for each hit, in the order of :func:`check_hits`, with columns ``subject``, ``trial``,
        ``goal``, ``hand`` and

        - ``x``, ``y``: the position of the hand in length units, computed from the posture by
          forward kinematics;
        - ``off``: the distance between the hand and the centre of the goal, in radii of the goal;
        - ``pace``: the recorded ticks of the movement, divided by the number of steps of a straight
          movement in the paper's model (not rounded, at least 1). Both movements go from the
          posture at the previous hit, or at the start of the task, to the posture at this hit.
          ``pace`` is NaN if the row of the previous hit is missing.

    Raises
    ------
    CoarticError
        The frame has no rows, a column is missing or occurs twice, a value does not fit its column,
        or two rows have the same subject, trial and goal. Unlike in :func:`check_hits`, hits far
        from their goals are allowed.

    Examples
    --------
    >>> from coartic import load_task
    >>> task = load_task("docs/examples/recordings/metres.toml")
    >>> hits = read_hits("docs/examples/recordings/metres.csv", task, ticks_per_unit=100)
    >>> consistency(hits, task).round(2).head(2)
      subject  trial  goal   hand     x     y   off  pace
    0      p1    1.0   1.0  right  0.05  0.46  0.98  2.66
    1      p1    1.0   2.0  right  0.25  0.41  0.80  2.02
    """
    return _fit(_readable(hits, task, "the frame"), task)


@checked_arguments
def solutions_of(task: Task, hits: pd.DataFrame) -> Solutions:
    """Return recorded trials as solutions, whose signatures can be computed.

    No movement is simulated: postures and ticks are those that :func:`check_hits` returns, with the
    ticks rounded to integers.

    Parameters
    ----------
    task : Task
        The task that was practised.
    hits : DataFrame
        Recorded hits, as :func:`check_hits` describes them.

    Returns
    -------
    Solutions
        A run for each trial in which all goals are hit. The id of a run is the name of the subject
        and the number of the trial, such as ``P1 3``. ``unfinished`` is the number of trials in
        which only some goals are hit.

    Raises
    ------
    CoarticError
        The hits are refused (:func:`check_hits`), or no trial hits all goals.

    Warns
    -----
    UserWarning
        Hits do not fit the task (:func:`check_hits`).
    """
    checked = _judged(_readable(hits, task, "the frame"), task, "the frame")
    runs, unfinished = {}, 0
    for (subject, trial), rows in checked.groupby(["subject", "trial"], sort=False):
        if len(rows) < len(task.goals):
            unfinished += 1
        else:
            postures = rows[[*task.robot.joint_names]].to_numpy()
            ticks = rows.ticks.round().astype(int).tolist()
            movements = tuple(
                Movement(goal, hand, "learned", posture, count)
                for goal, (hand, posture, count) in enumerate(
                    zip(rows.hand, postures, ticks, strict=True), 1
                )
            )
            runs[f"{subject} {trial:g}"] = Execution(movements, postures, sum(ticks), 0)
    if not runs:
        raise CoarticError(
            f"the frame has no trial with hits of all {len(task.goals)} goals; signatures need at "
            "least one"
        )
    return Solutions(task, "recorded", tuple(runs.values()), tuple(runs), unfinished)


# ----------------------------------------------------------------------------------------- reading


def _hits_in_file(path: str | Path, task: Task, ticks_per_unit: float) -> pd.DataFrame:
    """Return the hits of a CSV file as :func:`_readable` does.

    A column ``duration`` is converted to ``ticks``. Raises the errors of :func:`read_hits`, except
    those of :func:`_judged`.
    """
    check_limits("ticks_per_unit", ticks_per_unit, 1e-9, 1e9)
    frame, source = _table(path), str(path)
    if "ticks" in frame and ("duration" in frame or ticks_per_unit != 1):
        raise CoarticError(
            f"{source} has a column ticks, so ticks_per_unit has no effect; leave out "
            "ticks_per_unit and the column duration, or the column ticks"
        )
    if "duration" in frame:
        durations = _numbers(frame, ["duration"], source)[:, 0]
        frame = frame.assign(ticks=(durations * ticks_per_unit).round(6))
    return _readable(frame, task, source)


def _table(path: str | Path) -> pd.DataFrame:
    """Return a CSV file as a frame, indexed by the numbers of its data rows, from 1.

    Raises CoarticError if the file cannot be read, or is not a table.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)  # for rows with too many values
            frame = pd.read_csv(
                path, comment="#", index_col=False, skipinitialspace=True, keep_default_na=False,
                na_values=[""], dtype={"subject": str, "hand": str}, encoding="utf-8-sig",
                low_memory=False,
            )  # fmt: skip
    except OSError as error:
        raise CoarticError(f"{path} cannot be read: {error.strerror or error}") from None
    except (ValueError, pd.errors.ParserWarning) as error:
        raise CoarticError(
            f"{path} is not a table in UTF-8, separated by commas: {error}"
        ) from None
    return frame.rename(columns=str.strip).set_axis(frame.index + 1)


def _require(frame: pd.DataFrame, columns: list[str], source: str) -> None:
    """Raise CoarticError if a frame lacks a column, has a column twice, or has no rows.

    ``source`` is the name of the frame in the message.
    """
    if missing := [name for name in columns if name not in frame]:
        found = ", ".join(map(str, frame.columns)) or "none"
        raise CoarticError(
            f"{source} has no column {missing[0]}; it needs {', '.join(columns)}, separated by "
            f"commas (in a file, duration can replace ticks), and has {found}"
        )
    if duplicates := [name for name in columns if [*frame.columns].count(name) > 1]:
        raise CoarticError(f"{source} has two columns {duplicates[0]!r}; leave out one of them")
    if frame.empty:
        raise CoarticError(f"{source} has no rows; it must have one for each hit")


def _numbers(frame: pd.DataFrame, columns: list[str], source: str) -> Array:
    """Return columns of a frame as an array of float64, shape ``(rows, columns)``.

    Strings are converted to numbers. Raises CoarticError for a value that is not a real number from
    -1e5 to 1e5, or a string of one. ``source`` is the name of the frame in the message.
    """
    numbers = np.empty((len(frame), len(columns)))
    for k, name in enumerate(columns):
        values = frame[name]
        if values.dtype.kind not in "iuf":  # otherwise booleans and complex numbers would pass
            values = values.astype(object)
            odd = values.map(lambda value: isinstance(value, bool | np.bool_ | complex))
            values = values.mask(odd.astype(bool), "not a real number")
        read = pd.to_numeric(values, errors="coerce").to_numpy(np.float64, na_value=np.nan)
        is_wrong = ~(np.abs(read) <= MAX_ENTRY)
        _refuse(frame, name, is_wrong, f"a number from -{MAX_ENTRY:g} to {MAX_ENTRY:g}",
                source)  # fmt: skip
        numbers[:, k] = read
    return numbers


def _refuse(frame: pd.DataFrame, column: str, wrong: ArrayLike, needed: str, source: str) -> None:
    """Raise CoarticError if at least one row of a frame is wrong.

    Parameters
    ----------
    frame : DataFrame
    column : str
        Column that has the wrong values. The message shows its value in the first wrong row, and
        the number of wrong rows.
    wrong : array_like of bool, shape (rows,)
        True for each wrong row.
    needed : str
        What would be right, for the end of the message.
    source : str
        Name of the frame in the message.
    """
    if rows := np.flatnonzero(np.asarray(wrong, dtype=bool)).tolist():
        (value,) = frame[column].iloc[rows[:1]].tolist()
        shown = f"{value:g}" if isinstance(value, float) else brief_value(value)
        if pd.isna(value) or value == "":
            shown, needed = "empty", f"{needed}; leave out the rows of missing hits"
        more = f" ({len(rows)} such rows)" if len(rows) > 1 else ""
        row = f"{source}, data row {frame.index[rows[0]]}"
        raise CoarticError(f"{row}: {column} is {shown}; it must be {needed}{more}")


def _readable(frame: pd.DataFrame, task: Task, source: str) -> pd.DataFrame:
    """Return recorded hits as :func:`check_hits` does, but without the check of :func:`_judged`.

    Raises CoarticError if there are no rows, a column is missing or occurs twice, a value does not
    fit its column, or a hit occurs twice. ``source`` is the name of the frame in the message.
    """
    joints = [*task.robot.joint_names]
    is_used = np.zeros(len(joints), dtype=bool)
    for hand in task.hands:
        is_used[task.robot.joints(hand)] = True
    is_used[:2] = [name in frame or name[-1] not in task.locked_base for name in joints[:2]]
    at_start = dict(zip(joints, task.q0.tolist(), strict=True))
    used = [name for name, uses in zip(joints, is_used, strict=True) if uses]
    columns = [*_KEY, "hand", "ticks", *used]
    _require(frame, columns, source)
    numbers = [name for name in columns if name not in ("subject", "hand")]
    hits = frame[columns].copy()
    hits[numbers] = _numbers(frame, numbers, source)
    _refuse(hits, "subject", hits.subject.isna(), "a name", source)
    hits["subject"] = hits.subject.astype(str).str.strip()
    _refuse(hits, "subject", hits.subject == "", "a name", source)
    _refuse(hits, "hand", ~hits.hand.isin(task.hands), " or ".join(task.hands), source)
    _refuse(hits, "trial", (hits.trial % 1 != 0) | (hits.trial < 1), "an integer from 1", source)
    goals = range(1, len(task.goals) + 1)
    _refuse(hits, "goal", ~hits.goal.isin(goals), f"an integer from 1 to {len(goals)}", source)
    _refuse(hits, "ticks", hits.ticks < 1e-6, "more than 0, since the previous hit", source)
    no_duplicate = "another goal than in the rows above of this subject and trial; number the "
    no_duplicate += "trials of a subject through all sessions"
    _refuse(hits, "goal", hits.duplicated(_KEY), no_duplicate, source)
    order = np.lexsort((hits.goal.array, hits.trial.array, pd.factorize(hits.subject)[0]))
    unused = {name: value for name, value in at_start.items() if name not in used}
    hits = hits.iloc[order].reset_index(drop=True).assign(**unused)
    angles, trials = joints[2:], [hits.subject, hits.trial]
    before = hits.groupby(trials, sort=False)[angles].shift().fillna(at_start)
    turns = ((hits[angles] - before) / (2 * np.pi)).round()
    hits[angles] -= 2 * np.pi * turns.groupby(trials, sort=False).cumsum()
    return hits[[*_KEY, "hand", "ticks", *joints]]


def _fit(hits: pd.DataFrame, task: Task) -> pd.DataFrame:
    """Return the frame of :func:`consistency` for hits that :func:`_readable` returned."""
    joints = [*task.robot.joint_names]
    q, goal = hits[joints].to_numpy(), hits.goal.to_numpy(np.int64)
    hand_positions = np.empty((len(q), 2))
    for hand in task.hands:
        rows = (hits.hand == hand).to_numpy()
        hand_positions[rows] = task.robot.forward_kinematics(q[rows], hand)
    off = np.linalg.norm(hand_positions - task.goal_array[goal - 1], axis=1) / task.radius
    by_trial = hits.groupby(["subject", "trial"], sort=False)
    before = np.where((goal == 1)[:, None], task.q0, by_trial[joints].shift().to_numpy())
    is_next = (goal == 1) | (by_trial.goal.diff() == 1).to_numpy()
    straight = np.maximum(np.linalg.norm(q - before, axis=1) / PAPER.step, 1)
    x, y = hand_positions.T
    pace = np.where(is_next, hits.ticks / straight, np.nan)
    return hits[[*_KEY, "hand"]].assign(x=x, y=y, off=off, pace=pace)


def _judged(hits: pd.DataFrame, task: Task, source: str) -> pd.DataFrame:
    """Check whether hits that :func:`_readable` returned fit the task, and return them unchanged.

    - Warns if a hit of a subject is more than two radii from the centre of its goal. Raises
      CoarticError if this is so for more than half of the hits of a subject.
    - Warns if the median ``pace`` of a subject is below 0.1 or above 10.

    ``source`` is the name of the hits in these messages.
    """
    for subject, fit in _fit(hits, task).groupby("subject", sort=False):
        far, pace = fit.off > FAR, fit.pace.median()
        words = f"{source}: {far.sum()} of {len(far)} hits of {subject} are more than 2 radii from "
        words += "the centres of their goals"
        if far.mean() > 0.5:
            raise CoarticError(
                f"{words}. Joint angles must be in rad, anticlockwise, from the direction of the "
                "previous link, and positions in the length unit of the task"
            )
        if far.any():
            warnings.warn(words, stacklevel=_OF_CALLER)
        if pace < 0.1 or pace > 10:
            warnings.warn(
                f"{source}: the median movement of {subject} takes {pace:.2g} times as long as the "
                "model's; ticks_per_unit sets the unit of a column duration",
                stacklevel=_OF_CALLER,
            )
    return hits
