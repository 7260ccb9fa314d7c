"""Hits of recorded trials from the places of markers over time, as motion capture gives them."""

from __future__ import annotations

from itertools import chain
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from coartic import CoarticError, Task
from coartic.analysis.hits import (
    Implausible,
    also,
    as_names,
    as_numbers,
    checked_hits,
    read_table,
    row_names,
    warn,
    why_no_number,
)
from coartic.internal.arguments import checked_arguments
from coartic.internal.text import counted
from coartic.robot import HANDS, Array

_LONGEST_GAP = 0.05
"""Longest gap in the place of a marker that is bridged, s."""
_TOLERANCE = 0.1
"""Largest difference, as a share, of the length of a link, and of places of the base."""
_RARE = 0.05
"""Share of samples in which a marker is still below which long rests are in doubt."""
_FAR_START = 0.3
"""Distance of the posture in which trials begin from the task's start, with a warning."""


@checked_arguments
def hits_from_markers(
    recording: pd.DataFrame | str | Path,
    task: Task,
    side: Literal["left", "right", "both"] = "right",
    *,
    ticks_per_unit: float = 100.0,
    implausible: Implausible = "refuse",
) -> pd.DataFrame:
    """Find the hits of a person's trials in the places of markers over time.

    A trial begins with its first sample. A hit is the first sample with the tip within the goal's
    radius, or after such a place on the straight line between samples, in the order of the goals;
    its time and posture are interpolated to where the tip enters the goal. Gaps of up to 50 ms
    (empty, NaN, or both coordinates 0) are bridged by a straight line, with a warning. An arm
    without markers keeps its start, with a warning.

    Parameters
    ----------
    recording : DataFrame, str or pathlib.Path
        A frame, or a CSV file in UTF-8, of one person: a row for each sample, in the order of time,
        with columns ``subject``, ``trial`` (from 1), ``time`` (s), and x and y of each marker in
        the length unit of the task: ``right_1_x``, ``right_1_y`` is the shoulder, joint 1,
        ``right_2`` the next joint, ``right_tip`` the hand. Other columns do not count.
    task : Task
        The task that was practised.
    side : {"left", "right", "both"}
        Arm or arms with markers.
    ticks_per_unit : float
        Ticks in a second.
    implausible : {"refuse", "drop"}
        Hits that the person cannot have made (:func:`.read_hits`) raise CoarticError or are left
        out.

    Returns
    -------
    DataFrame
        A row for each hit, with the columns of :func:`.read_hits`. Trials in which a goal is never
        reached have no hits; ``attrs["unfinished"]`` is the number of such trials, which
        :func:`pandas.concat` loses: fit each person.

    Raises
    ------
    CoarticError
        The recording is no such table or of several people, the median length of a link differs
        from the task's by more than 10 %, a marker has a longer gap, a link's length jumps by more
        than 10 % (markers swap), two shoulders contradict each other, or :func:`.read_hits` would
        refuse the hits.
    """
    if not 0 < ticks_per_unit < np.inf:
        raise CoarticError(f"ticks_per_unit is {ticks_per_unit}; needed is a number above 0")
    if isinstance(recording, pd.DataFrame):
        frame, source, names = recording.reset_index(drop=True), "the frame", row_names(recording)
    else:
        source = str(recording)
        frame, names = read_table(recording, "places of markers are")
    hands = [hand for hand in HANDS if side in (hand, "both") and hand in task.hands]
    if not hands:
        raise CoarticError(f"side is {side!r}, but task {task.name!r} has the {task.hands[0]} hand")
    markers = {hand: [*range(1, len(task.robot.arm(hand).links) + 1), "tip"] for hand in hands}
    columns = {hand: [f"{hand}_{marker}_{axis}" for marker in markers[hand] for axis in "xy"]
               for hand in hands}  # fmt: skip
    needed = ["subject", "trial", "time", *chain(*columns.values())]
    if missing := [name for name in needed if name not in frame]:
        raise CoarticError(f"{source} has no column {missing[0]}{also(missing)}; found are "
                           f"{', '.join(map(str, frame.columns))}")  # fmt: skip
    if not len(frame):
        raise CoarticError(f"{source} has no sample: needed is a row for each")

    def refuse(wrong: NDArray[np.bool_], words: str) -> None:
        if rows := np.flatnonzero(wrong).tolist():
            others = also([names[row] for row in rows])
            raise CoarticError(f"{source}, {names[rows[0]]}: {culprit[rows[0]]}{words}{others}")

    culprit = np.full(len(frame), "", dtype=object)  # the marker to be named at a sample

    people = as_names(frame.subject)
    others = people != people.iloc[0]
    refuse((people == "").to_numpy(), "subject is empty; needed is a name")
    refuse(others.to_numpy(), "another subject; needed is a file for each person")
    trial, time = as_numbers(frame.trial), as_numbers(frame.time)
    refuse(~((trial % 1 == 0) & (trial >= 1)), "trial is no whole number from 1")
    refuse(~np.isfinite(time), "time is no number in s")
    begins = np.append(True, np.diff(trial) != 0)
    again = pd.Series(np.where(begins, trial, np.nan)).duplicated().to_numpy() & begins
    refuse(again, "a trial of this number ended above; number trials through from session to "
           "session, and sort samples by time")  # fmt: skip
    steps = np.append(0.0, np.diff(time))
    refuse(~begins & (steps <= 0), "time does not increase; needed are the samples in order")
    step = float(np.median(steps[~begins])) if not begins.all() else np.nan
    if not 0.0005 <= step <= 0.2:
        raise CoarticError(
            f"{source}: the median time between samples is {step:g} s; needed are 5 to 2000 in a "
            "second. Is time in s, and not in ms or frames?"
        )
    begin = np.flatnonzero(begins)
    held = np.zeros(len(frame), dtype=bool)
    places, missing_for = {}, np.zeros(len(frame))  # s, at the first sample of a gap
    for hand in hands:
        values = np.stack([as_numbers(frame[name]) for name in columns[hand]], axis=1)
        for name, column in zip(columns[hand], values.T, strict=True):
            for row in np.flatnonzero(np.isnan(column) & frame[name].notna()).tolist():
                if (why := why_no_number(frame[name][row])) and "leave out" not in why:
                    refuse(np.arange(len(frame)) == row, f"{name} is {frame[name][row]!r}; {why}")
        at = places[hand] = values.reshape(len(frame), -1, 2)
        at[~np.isfinite(at).all(axis=2)] = np.nan
        middle = pd.DataFrame(at.reshape(len(frame), -1)).median().to_numpy().reshape(-1, 2)
        far = np.linalg.norm(middle, axis=1) > 0.1 * task.robot.reach(hand)[1]
        at[(at == 0).all(axis=2) & far] = np.nan  # near the origin a marker may be there
        for marker, name in enumerate(markers[hand]):
            still = ~begins & (np.diff(at[:, marker], axis=0, prepend=np.nan) == 0).all(axis=1)
            if still.mean() < _RARE:
                kept = np.where(still[:, None], np.nan, at[:, marker])
                held |= _bridge(kept, time, begin, step) > _LONGEST_GAP
            durations = _bridge(at[:, marker], time, begin, step)
            culprit[durations > missing_for] = f"{hand}_{name}: "
            missing_for = np.maximum(missing_for, durations)
    leap = ~begins & (steps > 1.5 * step)
    missing_for[leap] = np.maximum(missing_for[leap], steps[leap] - step)
    lengths = {hand: np.linalg.norm(np.diff(places[hand], axis=1), axis=2) for hand in hands}
    swaps = np.zeros(len(frame), dtype=bool)
    for hand in hands:
        links = task.robot.arm(hand).links
        usual = pd.DataFrame(lengths[hand]).median().to_numpy()
        off = np.abs(usual / links - 1)
        words = (f"{source}: the links of the {hand} arm are {_listed(usual)} long in the median "
                 f"sample, those of task {task.name!r} {_listed(links)}")  # fmt: skip
        if (off > _TOLERANCE).any():
            raise CoarticError(f"{words}. Is this another arm, or another unit?")
        if (off > _TOLERANCE / 5).any():
            warn(f"{words}: a task with the lengths of this person fits better")
        each = pd.DataFrame(lengths[hand]).groupby(np.cumsum(begins)).transform("median")
        jumps = np.diff(lengths[hand], axis=0, prepend=lengths[hand][:1])
        jumps[begins] = each[begins] - usual
        jumped = np.abs(jumps) > _TOLERANCE * links
        swaps |= jumped.any(axis=1)
        for link in range(len(links)):
            culprit[jumped[:, link] & (missing_for == 0)] = f"{hand}_{link + 1}: "
    shoulders = {hand: np.array(task.robot.arm(hand)[2:]) for hand in hands}
    bases = [places[hand][:, 0] - shoulders[hand] for hand in hands]
    apart = np.linalg.norm(np.ptp(bases, axis=0), axis=1)
    width = float(np.linalg.norm(np.ptp([*shoulders.values()], axis=0)))
    torn = apart > _TOLERANCE * (width or min(task.robot.reach(hand)[1] for hand in hands))

    q = np.tile(task.q0, (len(frame), 1))
    q[:, :2] = np.mean(bases, axis=0)
    for hand in hands:
        way = np.diff(places[hand], axis=1)
        q[:, task.robot.joints(hand)] = np.diff(np.arctan2(way[..., 1], way[..., 0]), prepend=0.0)
    rows, used, unfinished, starts = [], np.zeros(len(frame), dtype=bool), [], []
    for first, end in zip(begin, [*begin[1:], len(frame)], strict=True):
        part = slice(first, end)
        q[part, 2:] = np.unwrap(np.vstack([task.q0[2:], q[part, 2:]]), axis=0)[1:]
        tips = np.stack([places[hand][part, -1] for hand in hands])
        found = _hits(tips, task, time[part], q[part])
        used[first : end if len(found) < len(task.goals) else first + found[-1][0] + 1] = True
        if len(found) < len(task.goals):
            unfinished.append(f"goal {len(found) + 1} in trial {trial[first]:g}")
            continue
        starts.append(np.linalg.norm(q[first] - task.q0))
        before = time[first]
        for goal, (_, arm, when, posture) in enumerate(found, 1):
            ticks = max((when - before) * ticks_per_unit, 1.0)
            rows.append([people[0], trial[first], goal, hands[arm], round(ticks, 6), *posture])
            before = when
    refuse(used & (missing_for > _LONGEST_GAP + 1e-9), "a marker is missing for more than "
           f"{1000 * _LONGEST_GAP:.0f} ms; fill the gap, or leave the trial out")  # fmt: skip
    refuse(used & swaps, "the length of a link jumps by more than "
           f"{100 * _TOLERANCE:.0f} %: markers swap, or a flag stands for a gap")  # fmt: skip
    refuse(used & torn, "the places of the two shoulders do not belong to one base: they differ "
           f"from the task's by more than {100 * _TOLERANCE:.0f} %")  # fmt: skip
    if frozen := [names[row] for row in np.flatnonzero(used & held & (missing_for == 0))]:
        warn(f"{source}, {frozen[0]}: a marker keeps its place to the last digit for more than "
             f"50 ms, unlike elsewhere. Does its last place fill a gap?{also(frozen)}")  # fmt: skip
    if bridged := np.flatnonzero(used & (missing_for > 0)).tolist():
        row, longest = bridged[0], 1000 * missing_for[bridged].max()
        words = f"a gap is bridged by a straight line; the longest takes {longest:.0f} ms"
        warn(f"{source}, {names[row]}: {culprit[row]}{words}{also([names[n] for n in bridged])}")
    if not rows:
        raise CoarticError(
            f"{source}: in no trial are all goals reached; missed are {', '.join(unfinished[:5])}. "
            "Are places in the length unit of the task, y upwards, from the origin of its goals?"
        )
    if unfinished:
        warn(f"{source}: {len(unfinished)} of {counted(len(begin), 'trial')} are unfinished and "
             f"have no hits: the tip does not reach {unfinished[0]}{also(unfinished)}")  # fmt: skip
    if absent := [hand for hand in task.hands if hand not in hands]:
        warn(f"{source}: the {absent[0]} arm has no markers and keeps its start")
    if (away := float(np.median(starts))) > _FAR_START:
        warn(f"{source}: the median trial begins {away:.2g} (length unit, rad) from the start of "
             f"task {task.name!r}")  # fmt: skip
    table = pd.DataFrame(rows, columns=["subject", "trial", "goal", "hand", "ticks",
                                        *task.robot.joint_names])  # fmt: skip
    for hand in {*HANDS}.difference(task.hands):
        table = table.drop(columns=[*table.columns[5:][task.robot.joints(hand)]])
    calls = [f"trial {row[1]:g}, goal {row[2]}" for row in rows]
    hits = checked_hits(table, task, source, calls, implausible)
    hits.attrs["unfinished"] = len(unfinished)
    return hits


def _listed(lengths: Array) -> str:
    """Return lengths as text, such as ``0.33, 0.27``."""
    return ", ".join(f"{length:.3g}" for length in lengths)


def _bridge(place: Array, time: Array, begin: NDArray[np.intp], step: float) -> Array:
    """Fill the gaps (NaN) of a marker, ``(n, 2)``, in place by straight lines in time, in each of
    the trials that begin at samples ``begin``. Return, at the first sample of each gap, its
    duration in s, and 0 elsewhere; ``step``: time between samples, s."""
    gap, durations = np.isnan(place[:, 0]), np.zeros(len(place))
    for first, end in zip(begin, [*begin[1:], len(place)], strict=True):
        part = slice(first, end)
        if not gap[part].any():
            continue
        there, clock = ~gap[part], time[part]
        edges = np.flatnonzero(np.diff(np.concatenate([[True], there, [True]]).astype(int)))
        around = np.concatenate([[clock[0] - step], clock, [clock[-1] + step]])
        durations[first + edges[::2]] = around[edges[1::2] + 1] - around[edges[::2]] - step
        for axis in (0, 1) if there.any() else ():
            at = place[part, axis]
            at[~there] = np.interp(clock[~there], clock[there], at[there])
    return durations


def _hits(tips: Array, task: Task, time: Array, q: Array) -> list[tuple[int, int, float, Array]]:
    """Return the hits of a trial in the order of the goals, up to the first goal that is missed,
    each as index of the sample, index of the hand in ``tips``, time, s, and posture ``(dof,)``,
    the last two where the tip enters the goal. ``tips`` are places of hands, ``(hands, n, 2)``,
    ``time`` and ``q`` times ``(n,)`` and postures ``(n, dof)`` of the samples."""
    found: list[tuple[int, int, float, Array]] = []
    ways = np.diff(tips, axis=1, prepend=tips[:, :1])  # to each sample from the one before
    for goal in task.goal_array:
        first = found[-1][0] + 1 if found else 0
        way, start = ways[:, first:], (tips - ways)[:, first:] - goal
        square = np.maximum((way**2).sum(axis=2), 1e-18)
        slope = (start * way).sum(axis=2)
        near = start + np.clip(-slope / square, 0, 1)[..., None] * way
        off = np.linalg.norm(near, axis=2)
        inside = (off <= task.radius).any(axis=0)
        if not inside.any():
            return found
        place = int(inside.argmax())
        hand, sample = int(off[:, place].argmin()), first + place
        excess = (start[hand, place] ** 2).sum() - task.radius**2
        root = slope[hand, place] ** 2 - square[hand, place] * excess
        share = (-slope[hand, place] - np.sqrt(max(root, 0.0))) / square[hand, place]
        share = np.clip(share, 0, 1) if sample else 1.0
        before = max(sample - 1, 0)
        found.append((
            sample, hand, float(time[before] + share * (time[sample] - time[before])),
            q[before] + share * (q[sample] - q[before]),
        ))  # fmt: skip
    return found
