"""Read recorded trials of people, check whether they fit the task, and draw them.

A recording is a table with a row for each hit, or a table with a row for each sample of markers, in
which hits are found. A table that cannot be read raises CoarticError, with its first wrong row.
Faults of a recording that can be read are not diagnosed, but they can be seen:
:func:`consistency` gives two numbers for each hit, and :func:`draw_recording` shows all hits over
the goals. Wrong units, axes, columns, clocks and sensors are visible in this figure.
"""

from __future__ import annotations

import warnings
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter
from numpy.typing import ArrayLike

from coartic import CoarticError, Execution, Movement, Task
from coartic.analysis.figures import style
from coartic.analysis.signatures import Solutions
from coartic.internal.arguments import checked_arguments
from coartic.internal.limits import brief_value, check_limits
from coartic.model import PAPER
from coartic.pictures.drawing import MARKERS, box, circle_goals, draw_robot, number_goals
from coartic.robot import HANDS, LARGEST_ENTRY, Array, Hand

FAR = 2.0
"""Distance from the centre of a goal (in radii) beyond which a hit does not fit the task."""
_KEY = ["subject", "trial", "goal"]
_LONGEST_GAP = 0.05  # longest gap of a marker that is bridged, s
_LONGEST_STEP = 0.04  # longest time between samples, s; with fewer samples hits are missed
_OTHER_ARM = 0.1  # largest difference of a link's length from the task's, as a share
_AT_REST = 0.05  # speed below which a hand rests, as a share of the trial's fast movements
_OF_CALLER = 6  # level in the stack of the caller of a function with checked arguments
_COLUMNS = 4  # panels side by side in the figure


@checked_arguments
def read_hits(path: str | Path, task: Task, *, ticks_per_unit: float = 1.0) -> pd.DataFrame:
    """Read recorded hits from a CSV file, and check them.

    Parameters
    ----------
    path : str or pathlib.Path
        A CSV file in UTF-8 with the columns of :func:`check_hits`. Lines that begin with ``#``,
        empty lines and other columns are ignored. A column ``duration`` can replace ``ticks``.
    task : Task
        The task that was practised.
    ticks_per_unit : float
        Number of ticks in one unit of ``duration``, such as 100 for seconds.

    Returns
    -------
    DataFrame
        The hits, as :func:`check_hits` returns them.

    Raises
    ------
    CoarticError
        The file cannot be read, or :func:`check_hits` refuses its rows.
    ValueError
        ``ticks_per_unit`` is not above 0.
    """
    return _judged(_hits_in_file(path, task, ticks_per_unit), task, str(path))


@checked_arguments
def check_hits(frame: pd.DataFrame, task: Task) -> pd.DataFrame:
    """Return recorded hits, checked and sorted by subject, trial and goal.

    In each trial, angles are unwrapped from the start of the task to the first hit, and from hit to
    hit.

    Parameters
    ----------
    frame : DataFrame
        A row for each hit, with the columns

        - ``subject``; ``trial`` and ``goal``, both from 1; ``hand`` (left or right)
        - ``ticks``: the time since the previous hit of the trial, or since its start
        - the posture at the hit (in length units and rad): a column for each name in
          ``task.robot.joint_names``

        Hits may be missing. The columns of a locked base, and of an arm that is not among
        ``task.hands``, may also be missing: their values are then those at the start of the task.
    task : Task
        The task that was practised.

    Returns
    -------
    DataFrame
        The columns above, and no others, with numbers as float64 and a new index. Subjects keep
        their order.

    Raises
    ------
    CoarticError
        One of these is the case:

        - a column is missing, or a value does not fit its column;
        - a hit occurs twice;
        - more than half of a subject's hits are more than two radii from the centres of their
          goals.

    Warns
    -----
    UserWarning
        Some hits of a subject are more than two radii from the centres of their goals, or the
        median movement of a subject takes less than a tenth or more than ten times the model's
        time.
    """
    return _judged(_readable(frame, task, "the frame"), task, "the frame")


@checked_arguments
def consistency(hits: pd.DataFrame, task: Task) -> pd.DataFrame:
    """Return how well each recorded hit fits the task.

    Parameters
    ----------
    hits : DataFrame
        Recorded hits, as :func:`check_hits` describes them.
    task : Task
        The task that was practised.

    Returns
    -------
    DataFrame
        A row for each hit with ``subject``, ``trial``, ``goal``, ``hand`` and

        - ``x``, ``y``: the position of the hand (in length units), by forward kinematics from the
          posture
        - ``off``: the distance of the hand from the centre of the goal, in radii of the goal
        - ``pace``: the ticks of the movement divided by those of a straight movement of the model
          from the previous hit, or from the start; NaN if the previous hit is missing

    Raises
    ------
    CoarticError
        The hits cannot be read (:func:`check_hits`).

    Examples
    --------
    >>> from coartic import load_task
    >>> task = load_task("docs/examples/recordings/metres.toml")
    >>> hits = read_hits("docs/examples/recordings/metres.csv", task, ticks_per_unit=100)
    >>> consistency(hits, task).round(2).head(2)
      subject  trial  goal   hand     x     y   off  pace
    0      p1    1.0   1.0  right  0.06  0.45  0.98  1.01
    1      p1    1.0   2.0  right  0.24  0.40  1.00  1.00
    """
    return _fit(_readable(hits, task, "the frame"), task)


@checked_arguments
def hits_from_markers(
    recording: pd.DataFrame | str | Path,
    task: Task,
    side: Literal["left", "right", "both"] | None = None,
    *,
    ticks_per_unit: float = 100.0,
) -> pd.DataFrame:
    """Find the hits of recorded trials in the positions of markers over time.

    A trial begins with its first sample. Goals are hit in their order: a goal is hit where a hand,
    on the straight line between samples, first enters its circle. Gaps of a marker (empty values)
    of at most 50 ms are bridged by straight lines.

    Parameters
    ----------
    recording : DataFrame, str or pathlib.Path
        A frame or a CSV file in UTF-8 with a row for each sample, in the order of time, with the
        columns ``subject``, ``trial`` (from 1), ``time`` (s), and the position of each marker in
        the length unit of the task: ``right_1_x``, ``right_1_y`` for the shoulder (joint 1),
        ``right_2`` for the next joint, ``right_tip`` for the hand; the same for ``left``.
    task : Task
        The task that was practised.
    side : {"left", "right", "both"}, optional
        The arms to read; by default the task's arms whose hands have a marker. An arm that is not
        read stays as at the start of the task.
    ticks_per_unit : float
        Number of ticks in a second.

    Returns
    -------
    DataFrame
        The hits of the trials in which all goals are hit, as :func:`check_hits` returns them;
        ``ticks`` is at least 1. ``attrs["unfinished"]`` has, by subject, the number of trials in
        which not all goals are hit.

    Raises
    ------
    CoarticError
        The table cannot be read; no trial hits all goals; :func:`check_hits` refuses the hits; or a
        trial has

        - fewer than 25 samples in a second, or a jump in time of more than 50 ms;
        - a gap of a marker of more than 50 ms before the last hit;
        - a link whose median length differs from the task's by more than 10 %.
    ValueError
        ``ticks_per_unit`` is not above 0.
    """
    source, trials = _trials_of(recording, task, side)
    for trial in trials:
        if trial.fault:
            raise CoarticError(
                f"{source}, trial {trial.number:g} of {trial.subject}: {trial.fault}"
            )
    finished = [trial for trial in trials if len(trial.hits) == len(task.goals)]
    if not finished:
        raise CoarticError(
            f"{source}: no trial hits all goals in their order; draw_recording shows the paths of "
            "the hands"
        )
    hits = _judged(_rows_of(finished, task, ticks_per_unit), task, source)
    unfinished = Counter(trial.subject for trial in trials)
    unfinished.subtract(trial.subject for trial in finished)
    hits.attrs["unfinished"] = dict(unfinished)
    return hits


@checked_arguments
def solutions_of(task: Task, hits: pd.DataFrame) -> Solutions:
    """Return recorded trials as solutions, so that their signatures can be computed.

    Nothing is executed: postures and (rounded) ticks are those of the recording.

    Parameters
    ----------
    task : Task
        The task of the trials.
    hits : DataFrame
        Recorded hits, as :func:`check_hits` describes them.

    Returns
    -------
    Solutions
        A run for each trial in which all goals are hit; ``run_ids`` are subject and trial, such as
        ``P1 3``.

    Raises
    ------
    CoarticError
        The hits are refused (:func:`check_hits`), or no trial hits all goals.
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
        raise CoarticError("no trial hits all goals: signatures need at least one")
    without_hits = hits.attrs.get("unfinished", {})
    unfinished += sum(without_hits.get(subject, 0) for subject in checked.subject.unique())
    return Solutions(task, "recorded", tuple(runs.values()), tuple(runs), unfinished)


@checked_arguments
def draw_recording(
    hits: pd.DataFrame | str | Path | None,
    task: Task,
    samples: pd.DataFrame | str | Path | None = None,
    *,
    ticks_per_unit: float | None = None,
) -> Figure:
    """Draw a recording, also one that :func:`check_hits` or :func:`hits_from_markers` refuses.

    At the top, a panel for each goal shows the postures in which this goal was hit, drawn over the
    circles of all goals. Later trials are darker. Below, two panels show ``off`` and ``pace`` of
    :func:`consistency` by trial. With ``samples``, the panels at the top also show the paths of the
    hands, and a further panel shows when goals were hit. In it, rests are shaded.

    Parameters
    ----------
    hits : DataFrame, str, pathlib.Path or None
        Recorded hits or their file, as :func:`check_hits` and :func:`read_hits` describe them. With
        None, hits are found in ``samples``, also in trials in which not all goals are hit.
    task : Task
        The task that was practised.
    samples : DataFrame, str or pathlib.Path, optional
        The positions of markers, as :func:`hits_from_markers` describes them.
    ticks_per_unit : float, optional
        Number of ticks in a unit of time; by default 1 for a file of hits (:func:`read_hits`) and
        100 for markers (:func:`hits_from_markers`).

    Returns
    -------
    matplotlib.figure.Figure
        The figure; ``figure.savefig("recording.png")`` saves it.

    Raises
    ------
    CoarticError
        A table cannot be read, or ``hits`` and ``samples`` are both None.
    """
    trials = [] if samples is None else _trials_of(samples, task, None)[1]
    if hits is None:
        if samples is None:
            raise CoarticError("hits and samples are both None; draw_recording needs one of them")
        shown = _rows_of(trials, task, ticks_per_unit or 100.0)
    elif isinstance(hits, pd.DataFrame):
        shown = _readable(hits, task, "the frame")
    else:
        shown = _hits_in_file(hits, task, ticks_per_unit or 1.0)
    return _drawn(shown, trials, task)


def is_of_markers(path: str | Path) -> bool:
    """Return True if a CSV file has the position of a hand's marker as a column."""
    return any(str(name).endswith("_tip_x") for name in _table(path))


# ----------------------------------------------------------------------------------------- reading


def _hits_in_file(path: str | Path, task: Task, ticks_per_unit: float) -> pd.DataFrame:
    """Return the hits of a CSV file as :func:`_readable` does, with ``duration`` as ``ticks``."""
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
    """Return a CSV file as a frame whose index counts rows from 1.

    Raises CoarticError if the file cannot be read.
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
    """Raise CoarticError if a column is missing or duplicate, or if there are no rows."""
    if missing := [name for name in columns if name not in frame]:
        found = ", ".join(map(str, frame.columns)) or "none"
        raise CoarticError(
            f"{source} has no column {missing[0]}; it needs {', '.join(columns)}, separated by "
            f"commas (in a file of hits, duration can replace ticks), and has {found}"
        )
    if duplicates := [name for name in columns if [*frame.columns].count(name) > 1]:
        raise CoarticError(f"{source} has two columns {duplicates[0]!r}; leave out one of them")
    if frame.empty:
        raise CoarticError(f"{source} has no rows; it must have one for each hit or sample")


def _numbers(frame: pd.DataFrame, columns: list[str], source: str, gaps: bool = False) -> Array:
    """Return columns as numbers, shape ``(rows, columns)``.

    Values must be real numbers from -1e5 to 1e5. With ``gaps`` they can also be empty, and are then
    NaN. Raises CoarticError for other values.
    """
    numbers = np.empty((len(frame), len(columns)))
    for k, name in enumerate(columns):
        values = frame[name]
        if values.dtype.kind not in "iuf":  # otherwise booleans and complex numbers would pass
            values = values.astype(object)
            odd = values.map(lambda value: isinstance(value, bool | np.bool_ | complex))
            values = values.mask(odd.astype(bool), "not a real number")
        read = pd.to_numeric(values, errors="coerce").to_numpy(np.float64, na_value=np.nan)
        is_wrong = ~(np.abs(read) <= LARGEST_ENTRY)
        is_wrong &= ~(gaps & frame[name].isna().to_numpy(bool))
        _refuse(frame, name, is_wrong, f"a number from -{LARGEST_ENTRY:g} to {LARGEST_ENTRY:g}",
                source)  # fmt: skip
        numbers[:, k] = read
    return numbers


def _refuse(frame: pd.DataFrame, column: str, wrong: ArrayLike, needed: str, source: str) -> None:
    """Raise CoarticError if rows are ``wrong``.

    The message has the first wrong row, the number of wrong rows, and ``needed``: what would be
    right. ``source`` is the name of the frame in the message.
    """
    if rows := np.flatnonzero(np.asarray(wrong, dtype=bool)).tolist():
        (value,) = frame[column].iloc[rows[:1]].tolist()
        shown = f"{value:g}" if isinstance(value, float) else brief_value(value)
        if pd.isna(value) or value == "":
            shown, needed = "empty", f"{needed}; leave out the rows of missing hits"
        more = f" ({len(rows)} such rows)" * (len(rows) > 1)
        row = f"{source}, data row {frame.index[rows[0]]}"
        raise CoarticError(f"{row}: {column} is {shown}; it must be {needed}{more}")


def _readable(frame: pd.DataFrame, task: Task, source: str) -> pd.DataFrame:
    """Return recorded hits as :func:`check_hits` does, without checking whether postures fit."""
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
    """Return :func:`consistency` for hits that :func:`_readable` returns."""
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
    """Return hits of :func:`_readable` unchanged, after checking whether they fit the task.

    - Warns if hits of a subject are more than two radii from the centres of their goals. Raises
      CoarticError if more than half of the subject's hits are.
    - Warns if the median movement of a subject takes less than a tenth or more than ten times the
      model's time.
    """
    for subject, fit in _fit(hits, task).groupby("subject", sort=False):
        far, pace = fit.off > FAR, fit.pace.median()
        words = f"{source}: {far.sum()} of {len(far)} hits of {subject} are more than 2 radii off"
        if far.mean() > 0.5:
            raise CoarticError(
                f"{words}. Joint angles must be in rad, anticlockwise, from the direction of the "
                "previous link, and positions in the length unit of the task; draw_recording shows "
                "where the hand is"
            )
        if far.any():
            warnings.warn(f"{words}; draw_recording shows them", stacklevel=_OF_CALLER)
        if not 0.1 <= pace <= 10:
            warnings.warn(
                f"{source}: the median movement of {subject} takes {pace:.2g} times as long as the "
                "model's; draw_recording shows the paces, and ticks_per_unit sets the unit of a "
                "column duration",
                stacklevel=_OF_CALLER,
            )
    return hits


# ----------------------------------------------------------------------------------------- markers


@dataclass(frozen=True)
class _Trial:
    """A recorded trial of n samples."""

    subject: str
    number: float
    time: Array
    """Times of the samples, shape ``(n,)``, in s."""
    tips: dict[Hand, Array]
    """Positions of each hand with markers, shape ``(n, 2)``, in length units."""
    q: Array
    """Postures with unwrapped angles, shape ``(n, dof)``."""
    hits: list[tuple[float, Hand]]
    """For each goal up to the first missed one: the sample at which it is hit (not an integer if it
    is hit between samples), and the hand."""
    fault: str
    """Why the hits of the trial may be wrong, as a sentence; empty if there is no fault."""

    def at(self, sample: float, values: Array) -> Array:
        """Return ``values``, shape ``(n, ...)``, at a sample, linearly interpolated."""
        before = min(int(sample), len(values) - 2)
        value: Array = values[before] + (sample - before) * (values[before + 1] - values[before])
        return value


def _trials_of(
    recording: pd.DataFrame | str | Path,
    task: Task,
    side: Literal["left", "right", "both"] | None,
) -> tuple[str, list[_Trial]]:
    """Return the name (for messages) and the trials of a recording of markers.

    Raises CoarticError if the recording cannot be read.
    """
    if isinstance(recording, pd.DataFrame):
        source, frame = "the frame", recording
    else:
        source, frame = str(recording), _table(recording)
    hands = [hand for hand in HANDS if hand in task.hands
             and (side in (hand, "both") if side else f"{hand}_tip_x" in frame)]  # fmt: skip
    if not hands:
        raise CoarticError(
            f"{source} has no marker of a hand of the task: it needs columns such as "
            f"{task.hands[0]}_tip_x" if side is None
            else f"side is {side!r}, but task {task.name!r} has the {task.hands[0]} hand only"
        )  # fmt: skip
    names = {hand: [f"{hand}_{k}_{axis}"
                    for k in [*range(1, len(task.robot.arm(hand).links) + 1), "tip"]
                    for axis in "xy"] for hand in hands}  # fmt: skip
    columns = ["trial", "time", *(name for hand in hands for name in names[hand])]
    _require(frame, ["subject", *columns], source)
    _refuse(frame, "subject", frame.subject.isna(), "a name", source)
    trials, times = _numbers(frame, ["trial", "time"], source).T
    _refuse(frame, "trial", (trials % 1 != 0) | (trials < 1), "an integer from 1", source)
    positions = {hand: _numbers(frame, names[hand], source, gaps=True) for hand in hands}
    keys = pd.DataFrame({"subject": frame.subject.astype(str).to_numpy(), "trial": trials})
    found = []
    for key, rows in keys.groupby(["subject", "trial"], sort=False).indices.items():
        subject, number = cast("tuple[str, float]", key)
        later = np.append(True, np.diff(times[rows]) > 0)
        increasing = "later than in the row before; each sample must occur once, and each trial "
        increasing += "must have its own number"
        _refuse(frame.iloc[rows], "time", ~later, increasing, source)
        of_trial = {hand: positions[hand][rows].reshape(len(rows), -1, 2) for hand in hands}
        if len(rows) > 1:
            found.append(_trial(subject, float(number), times[rows], of_trial, task))
    if not found:
        raise CoarticError(f"{source} has one sample in each trial; a trial needs at least two")
    return source, found


def _trial(
    subject: str, number: float, time: Array, places: dict[Hand, Array], task: Task
) -> _Trial:
    """Return a trial with its postures and hits.

    ``places`` has the positions of the markers of each arm, shape ``(n, markers, 2)``, with NaN for
    gaps.
    """
    robot, faults, first_gap = task.robot, [], len(time)
    if (step := float(np.median(np.diff(time)))) > _LONGEST_STEP + 1e-9:
        faults.append(f"samples are {step:g} s apart; hits need at least 25 samples a second")
    if (jump := np.diff(time).max()) > step + _LONGEST_GAP + 1e-9:
        before = time[np.diff(time).argmax()]
        faults.append(
            f"the time jumps by {jump:.3g} s at {before:g} s; fill the gap, leave the trial out, "
            "or give each trial a number"
        )
    for arm in places.values():
        for marker in arm.reshape(len(time), -1).T:
            first_gap = min(first_gap, _bridge(marker, time, step))
    q = np.tile(task.q0, (len(time), 1))
    bases = [arm[:, 0] - np.array(robot.arm(hand)[2:]) for hand, arm in places.items()]
    q[:, :2] = np.mean(bases, axis=0)
    for hand, arm in places.items():
        link, expected = np.diff(arm, axis=1), np.array(robot.arm(hand).links)
        lengths = np.median(np.linalg.norm(link, axis=2), axis=0)
        if not (np.abs(lengths / expected - 1) <= _OTHER_ARM).all():
            listed = (", ".join(f"{length:.3g}" for length in arm_lengths)
                      for arm_lengths in (lengths, expected))  # fmt: skip
            faults.append("the links of the {} arm are {} long, those of the task {}".format(
                hand, *listed))  # fmt: skip
        q[:, robot.joints(hand)] = np.diff(np.arctan2(link[..., 1], link[..., 0]), prepend=0.0)
    q[:, 2:] = np.unwrap(np.vstack([task.q0[2:], q[:, 2:]]), axis=0)[1:]
    tips = {hand: arm[:, -1] for hand, arm in places.items()}
    hits = _hits_of(tips, task)
    last = hits[-1][0] if len(hits) == len(task.goals) else len(time)
    if first_gap < last:
        faults.append(
            f"a marker is missing for more than 50 ms from {time[first_gap]:g} s on, before the "
            "last hit; fill the gap, or leave the trial out"
        )
    return _Trial(subject, number, time, tips, q, hits, faults[0] if faults else "")


def _bridge(values: Array, time: Array, step: float) -> int:
    """Fill the gaps (NaN) of a marker's coordinate by straight lines, in place.

    Returns the last sample before the first gap of more than 50 ms, or 0 if the recording begins
    with this gap. If there is no such gap, returns the number of samples.
    """
    known = np.flatnonzero(np.isfinite(values))
    if not len(known):
        return 0
    values[:] = np.interp(time, time[known], values[known])
    around = np.concatenate([[time[0] - step], time[known], [time[-1] + step]])
    is_long = np.diff(around) - step > _LONGEST_GAP + 1e-9
    before = np.concatenate([[0], known])
    return int(before[is_long][0]) if is_long.any() else len(values)


def _hits_of(tips: dict[Hand, Array], task: Task) -> list[tuple[float, Hand]]:
    """Return :attr:`_Trial.hits` from the positions of hands, shape ``(n, 2)``."""
    hits: list[tuple[float, Hand]] = []
    for goal in task.goal_array:
        first = int(hits[-1][0]) + 1 if hits else 0
        entries = [(first + entry, hand) for hand, tip in tips.items()
                   if (entry := _entry(tip[first:] - goal, task.radius)) is not None]  # fmt: skip
        if not entries:
            break
        hits.append(min(entries))
    return hits


def _entry(path: Array, radius: float) -> float | None:
    """Return the sample at which a path enters a circle around 0, or None.

    The path leads through points, shape ``(n, 2)``, in straight lines. The sample is not an integer
    if the path enters the circle between samples.
    """
    start, move = path[:-1], np.diff(path, axis=0)
    square = np.maximum((move**2).sum(axis=1), 1e-18)
    middle = -(start * move).sum(axis=1) / square  # where the line is closest to the centre
    root = middle**2 - ((start**2).sum(axis=1) - radius**2) / square
    enters = np.clip(middle - np.sqrt(np.maximum(root, 0)), 0, None)
    leaves = middle + np.sqrt(np.maximum(root, 0))
    inside = np.flatnonzero((root >= 0) & (enters <= 1) & (leaves >= 0))
    return float(inside[0] + enters[inside[0]]) if len(inside) else None


def _rows_of(trials: list[_Trial], task: Task, ticks_per_unit: float) -> pd.DataFrame:
    """Return a frame with a row for each hit of trials, as :func:`_readable` does."""
    check_limits("ticks_per_unit", ticks_per_unit, 1e-9, 1e9)
    rows: list[list[Any]] = []
    for trial in trials:
        before = float(trial.time[0])
        for goal, (sample, hand) in enumerate(trial.hits, 1):
            time = float(trial.at(sample, trial.time))
            ticks = round(max((time - before) * ticks_per_unit, 1.0), 6)
            posture = trial.at(sample, trial.q)
            rows.append([trial.subject, trial.number, goal, hand, ticks, *posture])
            before = time
    names = [*_KEY, "hand", "ticks", *task.robot.joint_names]
    hits = pd.DataFrame(rows, columns=names)
    return _readable(hits, task, "the hits") if rows else hits


# ----------------------------------------------------------------------------------------- drawing


@style.styled
def _drawn(hits: pd.DataFrame, trials: list[_Trial], task: Task) -> Figure:
    """Return the figure of :func:`draw_recording`. A goal has the same colour in all panels."""
    postures = np.vstack([task.q0, hits[[*task.robot.joint_names]].to_numpy(np.float64)])
    corners = [*box(task, postures, 0.2)]
    corners += [tip for trial in trials for tip in trial.tips.values()]
    low, high = (end(np.vstack(corners), axis=0) for end in (np.min, np.max))
    columns = min(len(task.goals), _COLUMNS)
    rows = -(-len(task.goals) // columns)
    shape = np.clip((high[1] - low[1]) / (high[0] - low[0]), 0.2, 1.5)
    heights = [rows * (0.6 + shape * (style.TWO / max(columns, 3) - 0.2)), 1.9]
    heights += [0.9 + 0.06 * min(len(trials), 40)] * bool(trials)
    figure = Figure((style.TWO, sum(heights)), layout="constrained")
    parts: Any = figure.subfigures(len(heights), 1, height_ratios=heights)
    panels = parts[0].subplots(
        rows, columns, sharex=True, sharey=True, squeeze=False,
        subplot_kw={"aspect": "equal", "xlim": (low[0], high[0]), "ylim": (low[1], high[1])},
    ).ravel()  # fmt: skip
    for axes in panels[len(task.goals) :]:
        axes.set_axis_off()
    for goal, axes in enumerate(panels[: len(task.goals)], 1):
        _draw_postures(axes, goal, hits, trials, task)
    _draw_fit(parts[1].subplots(1, 2), hits, task)
    if trials:
        _draw_times(parts[2].subplots(), trials)
    return figure


def _color_of(goal: int) -> str:
    """Return the colour of a goal, from 1."""
    return style.PALETTE[(goal - 1) % len(style.PALETTE)]


def _draw_postures(
    axes: Axes, goal: int, hits: pd.DataFrame, trials: list[_Trial], task: Task
) -> None:
    """Draw the postures in which a goal was hit, and the hands' paths to it."""
    color, joints = _color_of(goal), [*task.robot.joint_names]
    last = max([*hits.trial, *(trial.number for trial in trials)], default=1)
    axes.set_title(f"goal {goal}", color=color)
    draw_robot(axes, task, task.q0, alpha=0.25)
    circle_goals(axes, task)
    number_goals(axes, task, fontsize=6)
    for hand in task.hands:
        chosen = hits[(hits.goal == goal) & (hits.hand == hand)]
        shades = [to_rgba(color, 0.1 + 0.7 * trial / last) for trial in chosen.trial]
        arms = task.robot.joint_positions(chosen[joints].to_numpy(np.float64), hand)
        lines = LineCollection([*arms], colors=shades, linewidths=0.7, zorder=2)
        axes.add_collection(lines, autolim=False)
        x, y = arms[:, -1].T
        axes.scatter(x, y, 5, marker=MARKERS[hand]["marker"], color=shades, zorder=4)
    for trial in trials:
        ends = [0.0, *(sample for sample, _ in trial.hits), len(trial.time) - 1.0]
        for tip in trial.tips.values() if goal < len(ends) else ():
            axes.plot(*tip[int(ends[goal - 1]) : int(ends[goal]) + 2].T, color=style.GREY,
                      linewidth=0.5, alpha=0.2 + 0.6 * trial.number / last)  # fmt: skip


def _draw_fit(panels: Any, hits: pd.DataFrame, task: Task) -> None:
    """Draw ``off`` and ``pace`` by trial in two panels, one subject after the other."""
    fit = _fit(hits, task) if len(hits) else hits.assign(off=[], pace=[])
    lasts = fit.groupby("subject", sort=False).trial.max() + 1
    begins = lasts.cumsum() - lasts
    at = fit.trial.to_numpy(np.float64) + fit.subject.map(begins).to_numpy(np.float64)
    for axes, measure, label, lines in zip(
        panels, ("off", "pace"), ("off (radii)", "pace (1: the model's)"), ((1, FAR), (1,)),
        strict=True,
    ):  # fmt: skip
        for goal in range(1, len(task.goals) + 1):
            shown = (fit.goal == goal).to_numpy()
            axes.plot(at[shown], fit[measure][shown].clip(lower=0.03), ".", color=_color_of(goal),
                      markersize=4.5, markeredgewidth=0)  # fmt: skip
        for line in lines:
            axes.axhline(line, color=style.GREY, linewidth=0.6, linestyle=":")
        axes.set(yscale="log", ylabel=label, xlabel="trial")
        if not len(fit):
            axes.text(0.5, 0.5, "no hits", ha="center", transform=axes.transAxes)
        low, high = axes.get_ylim()
        axes.set_ylim(min(low, 0.4), max(high, 2.6))
        axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_formatter(NullFormatter())
        if len(begins) > 1:
            axes.set(xlabel="trial, subject after subject")
            axes.set_xticks(begins, begins.index, ha="left")
            for begin in begins[1:]:
                axes.axvline(begin, color=style.GREY, linewidth=0.6)


def _draw_times(axes: Axes, trials: list[_Trial]) -> None:
    """Draw when goals were hit in each trial, with rests of all hands shaded."""
    for row, trial in enumerate(trials):
        time = trial.time - trial.time[0]
        speed = np.max([np.linalg.norm(np.diff(tip, axis=0), axis=1) / np.diff(time)
                        for tip in trial.tips.values()], axis=0)  # fmt: skip
        axes.hlines(row, 0, time[-1], style.GREY, linewidth=0.5)
        is_rest = speed < _AT_REST * np.quantile(speed, 0.95)
        edges = np.flatnonzero(np.diff(is_rest, prepend=False, append=False)).reshape(-1, 2)
        for begin, end in edges[np.diff(edges)[:, 0] > 2]:
            axes.hlines(row, time[begin], time[end], style.GREY, linewidth=4, alpha=0.6)
        for goal, (sample, _) in enumerate(trial.hits, 1):
            axes.plot(trial.at(sample, time), row, ".", color=_color_of(goal), markersize=4)
    shown = range(0, len(trials), -(-len(trials) // 12))
    has_subjects = len({trial.subject for trial in trials}) > 1
    names = [f"{trials[k].subject}, " * has_subjects + f"{trials[k].number:g}" for k in shown]
    axes.set_yticks(shown, names)
    axes.set(ylim=(len(trials) - 0.4, -0.6), ylabel="subject, trial" if has_subjects else "trial")
    axes.set_xlabel("time since the start of the trial (s), with hits of goals; rests are shaded")
