"""Hits of recorded trials from the places of markers over time, as motion capture gives them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import chain, combinations, pairwise, permutations
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from coartic import CoarticError, Task
from coartic.analysis.hits import (
    AXES,
    MANY,
    Implausible,
    also,
    as_names,
    as_numbers,
    checked_hits,
    read_table,
    row_names,
    turned,
    warn,
    why_no_number,
)
from coartic.internal.arguments import checked_arguments
from coartic.internal.text import counted
from coartic.robot import HANDS, Array

_LONGEST_GAP = 0.05
"""Longest gap in the place of a marker that is bridged, s."""
_TOLERANCE = 0.1
"""Largest difference, as a share, of lengths of links, times of samples, and shoulders."""
_LONGEST_REST = 0.2
"""Longest rest that passes as movement, s."""


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

    A trial begins with its first sample. A hit is the first sample with a tip within the goal's
    radius, or after such a place on the straight line between samples, in the order of the goals;
    its time and posture are interpolated to where the tip enters the goal. Gaps of up to 50 ms
    (empty, NaN, or, far from the origin, both coordinates 0) are bridged by a straight line, with a
    warning unless after the last hit. An arm of the task without markers keeps its start, with a
    warning. Warns, too, of samples that repeat, places that are rounded, frames that seem lost,
    links whose length follows a joint, an arm that starts later than the other in all trials,
    trials that begin away from the task's start, rests on the way, and hits of two goals in
    successive samples.

    Parameters
    ----------
    recording : DataFrame, str or pathlib.Path
        A frame, or a CSV file in UTF-8, of one person: a row for each sample, by trial and time,
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
        Implausible hits (:func:`.read_hits`) raise CoarticError or are left out.

    Returns
    -------
    DataFrame
        A row for each hit, with the columns of :func:`.read_hits`. Trials in which a goal is never
        reached have no hits, with a warning; ``attrs["unfinished"]``, which :func:`pandas.concat`
        may lose, is the number of such trials.

    Raises
    ------
    CoarticError
        The recording is no such table, of several people, or not of 25 to 2000 samples in a second;
        the median length of a link in a trial differs from the task's by more than 10 %; trials of
        over 20 samples differ in the time between samples by more than 10 %, or, without a tenth
        at either end, in a locked base by more than two radii; a finished trial begins far from the
        task's start or with a rest, or has a second start; most trials are unfinished; before the
        last goal is hit, a marker has a longer gap or jumps, a link's length jumps by more than 10
        % (markers swap), or two shoulders contradict each other; or :func:`.read_hits` would refuse
        the hits.
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
            raise CoarticError(f"{source}, {names[rows[0]]}: {words}{others}")

    culprit = np.full(len(frame), "", dtype=object)  # the marker to be named at a sample

    people = as_names(frame.subject)
    others = people != people.iloc[0]
    refuse((people == "").to_numpy(), "subject is empty; needed is a name")
    refuse(others.to_numpy(), "another subject; needed is a file for each person")
    trial, time = as_numbers(frame.trial), as_numbers(frame.time)
    for name, none in (("trial", ~np.isfinite(trial)), ("time", ~np.isfinite(time))):
        value = frame[name][int(none.argmax())]
        refuse(none, f"{name} is {value!r}; {why_no_number(value)}")
    refuse((trial % 1 != 0) | (trial < 1), "trial is no whole number from 1")
    begins = np.append(True, np.diff(trial) != 0)
    again = pd.Series(np.where(begins, trial, np.nan)).duplicated().to_numpy() & begins
    refuse(again, "a trial of this number ended above; number trials through from session to "
           "session, sort samples by time, and give people of one name a file each")  # fmt: skip
    steps = np.append(0.0, np.diff(time))
    refuse(~begins & (steps <= 0), "time does not increase; needed is each sample once, in order, "
           "with a time that is not rounded, and a trial for each start of the clock")  # fmt: skip
    begin, number = np.flatnonzero(begins), np.cumsum(begins) - 1
    paces = pd.Series(np.where(begins, np.nan, steps)).groupby(number).transform("median")
    even = ~begins & (steps <= 2.5 * paces.to_numpy())  # without gaps; clocks may be rounded
    step = float(steps[even].mean()) if even.any() else np.nan
    if not 0.0005 <= step <= 0.0401:  # else hands pass goals between samples
        raise CoarticError(
            f"{source}: the time between samples is {step:g} s; needed are 25 to 2000 "
            "samples in a second. Is time in s, and not in ms or frames, and are all samples there?"
        )
    parts = [slice(*ends) for ends in zip(begin, [*begin[1:], len(frame)], strict=True)]
    many = np.bincount(number, even) >= MANY

    def medians(values: Array) -> Array:
        return pd.DataFrame(values).groupby(number).median().to_numpy()

    def agree(name: str, each: Array, share: float, most: float, doubt: float, words: str) -> None:
        """Refuse a quantity, ``each`` by trial, that differs between trials of over 20 samples
        by over ``most``, and warn if by over ``doubt``; a share ``share`` at either end does not
        count."""
        long = np.flatnonzero(many & np.isfinite(each))
        ordered, out = np.sort(each[long]), int(share * len(long))
        if not len(long) or (change := ordered[-1 - out] - ordered[out]) <= min(most, doubt):
            return
        high = each[long] > ordered[out] + change / 2
        one, other = sorted((long[high.argmin()], long[high.argmax()]))
        now, before = (f"{each[n]:.3g} in trial {trial[begin[n]]:g}" for n in (other, one))
        text = f"{source}, {names[begin[other]]}: {name} is {now}, but {before}; {words}"
        warn(text, refuse=change > most)

    paces = pd.Series(np.where(even, steps, np.nan)).groupby(number).mean()
    agree("the time between samples", np.array(paces), 0, _TOLERANCE * step, np.inf,
          "correct the clock, or sample all trials at one rate")  # fmt: skip
    held = np.zeros(len(frame), dtype=bool)
    coarse, rounded = 0.0, ""
    places, missing_for = {}, np.zeros(len(frame))  # s, at the first sample of a gap
    for hand in hands:
        values = np.stack([as_numbers(frame[name]) for name in columns[hand]], axis=1)
        for name, column in zip(columns[hand], values.T, strict=True):
            grid = np.unique(np.round(column[np.isfinite(column)] / task.radius, 6))
            if len(grid) >= MANY and (least := np.diff(grid).min()) > coarse:
                coarse, rounded = least, name
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
            if 0 < still.mean() < 0.05:  # else markers are often still
                kept = np.where(still[:, None], np.nan, at[:, marker])
                held |= _bridge(kept, time, parts, step) > _LONGEST_GAP
            durations = _bridge(at[:, marker], time, parts, step)
            culprit[durations > missing_for] = f"{hand}_{name}: "
            missing_for = np.maximum(missing_for, durations)
    if coarse > 0.2:  # radii
        warn(f"{source}: {rounded} is rounded to {coarse * task.radius:.2g}, the radius of goals "
             f"is {task.radius:g}: are there more digits?")  # fmt: skip
    leap = ~begins & (steps > 1.9 * step)  # clocks may be rounded
    missing_for[leap] = np.maximum(missing_for[leap], steps[leap] - step)
    lengths = {hand: np.linalg.norm(np.diff(places[hand], axis=1), axis=2) for hand in hands}
    swaps = np.zeros(len(frame), dtype=bool)
    for hand in hands:
        links, each = task.robot.arm(hand).links, medians(lengths[hand])
        off = np.abs(each / links - 1)
        words = (f"{{}} the links of the {hand} arm are {{}} long in the median sample, those of "
                 f"task {task.name!r} {_listed(links)}{{}}")  # fmt: skip
        if wrong := np.flatnonzero((off > _TOLERANCE).any(axis=1)).tolist():
            where = f"{source}, {names[begin[wrong[0]]]}: in trial {trial[begin[wrong[0]]]:g}"
            swapped = _swapped(places[hand][parts[wrong[0]]], links, markers[hand])
            cause = (f"{also([f'trial {trial[begin[n]]:g}' for n in wrong])}. {swapped}Is this "
                     "another arm, another unit, or are markers misplaced?")  # fmt: skip
            raise CoarticError(words.format(where, _listed(each[wrong[0]]), cause))
        usual = pd.DataFrame(lengths[hand]).median().to_numpy()
        if (np.abs(usual / links - 1) > _TOLERANCE / 5).any():
            more = ": a task with the lengths of this person fits better"
            warn(words.format(f"{source}:", _listed(usual), more))
        jumps = np.abs(np.diff(lengths[hand], axis=0, prepend=np.nan))
        noise = 9 * pd.DataFrame(jumps).median().to_numpy()
        jumped = (jumps > np.maximum(_TOLERANCE * links, noise)) & ~begins[:, None]
        swaps |= jumped.any(axis=1)
        for link in range(len(links)):
            culprit[jumped[:, link] & (missing_for == 0)] = f"{hand}_{link + 1}: "
            agree(f"the length of {hand} link {link + 1}", each[:, link], 0.1, np.inf,
                  _TOLERANCE / 4 * links[link], "did a marker move, or the scale?")  # fmt: skip
    shoulders = {hand: np.array(task.robot.arm(hand)[2:]) for hand in hands}
    bases = [places[hand][:, 0] - shoulders[hand] for hand in hands]
    apart = np.linalg.norm(np.ptp(bases, axis=0), axis=1)
    width = float(np.linalg.norm(np.ptp([*shoulders.values()], axis=0)))
    torn = apart > _TOLERANCE * (width or min(task.robot.reach(hand)[1] for hand in hands))

    q = np.tile(task.q0, (len(frame), 1))
    q[:, :2] = np.mean(bases, axis=0)
    for k in ("xy".index(axis) for axis in task.locked_base):
        agree(f"base_{'xy'[k]}", medians(q[:, k])[:, 0], 0.1, 2 * task.radius, task.radius,
              f"task {task.name!r} locks it: did the person or the camera move?")  # fmt: skip
    for hand in hands:
        way = np.diff(places[hand], axis=1)
        q[:, task.robot.joints(hand)] = np.diff(np.arctan2(way[..., 1], way[..., 0]), prepend=0.0)
    rows, used, unfinished, starts, begun = [], np.zeros(len(frame), dtype=bool), [], [], []
    counted_in: dict[str, list[int]] = {
        f"the hand rests for more than {1000 * _LONGEST_REST:.0f} ms on the way": [],
        "the hand is back at the start before it hits a goal": [],
        "the hand is in the next goal already where it hits one": [],
    }
    pauses, returns, at_once = counted_in.values()
    broken_off: list[Array] = []  # places of hands in unfinished trials
    away, rests, twice = np.zeros((3, len(frame)), dtype=bool)
    window = max(3, 2 * round(_LONGEST_GAP / step / 2) + 1)  # single samples are noise
    largest = 0.25 * max(task.robot.reach(hand)[1] for hand in hands)
    origins = np.stack([task.robot.forward_kinematics(task.q0, hand) for hand in hands])
    for part in parts:
        first, clock = part.start, time[part]
        q[part, 2:] = np.unwrap(np.vstack([task.q0[2:], q[part, 2:]]), axis=0)[1:]
        tips = np.stack([places[hand][part, -1] for hand in hands])
        found = _hits(tips, task, clock, q[part])
        # A second start: from where the hands are back, all goals are reached again.
        smooth = np.stack([
            pd.DataFrame(tip).rolling(window, center=True, min_periods=1).median().to_numpy()
            for tip in tips
        ])  # fmt: skip
        radii = np.linalg.norm(smooth - smooth[:, :1], axis=2) / task.radius
        to_goal = np.linalg.norm(tips[:, 0] - task.goal_array[0], axis=1).min() / task.radius
        close = min(3.0, to_goal - 2)
        left = np.logical_or.accumulate((radii > close + 0.5).any(axis=0))
        back = left & (radii < close).all(axis=0)
        back[: found[0][0] if found else None] = False
        if back.any():
            second = int(back.argmax())
            rest = _hits(tips[:, second:], task, clock[second:], q[part][second:])
            twice[first + second] = len(rest) == len(task.goals)
        if (done := len(found)) < len(task.goals):
            used[part] = True
            after = tips[:, found[-1][0] + 1 if found else 0 :] - task.goal_array[done]
            nearest = np.linalg.norm(after, axis=2).min(initial=np.inf) - task.radius
            unfinished.append(f"goal {done + 1} in trial {trial[first]:g} by {nearest:.2g}")
            broken_off.append(tips)
            continue
        used[first : first + found[-1][0] + 1] = True
        away[first] = (np.linalg.norm(tips[:, 0] - origins, axis=1) > largest).any()
        to_hit = slice(first, first + found[0][0] + 1)
        by_arm = [np.linalg.norm(places[hand][to_hit] - places[hand][first], axis=2).max(axis=1)
                  for hand in hands]  # fmt: skip
        moved = np.max(by_arm, axis=0) / task.radius
        moves = [time[to_hit][way > task.radius / 4].min(initial=np.inf) for way in by_arm]
        begun.append(moves - clock[0])
        moved[-1] = np.inf
        # A smooth movement has gone 8 times as far after twice the time: the rest is before it.
        leaves, is_far = (clock[np.argmax(moved > far)] for far in (0.5, 4))
        rests[first] = 2 * leaves - is_far - clock[0] > _LONGEST_REST
        starts.append(q[first] - task.q0)
        to_last = slice(first, first + found[-1][0] + 1)
        ways = np.hstack([places[hand][to_last] for hand in hands])
        pauses += [int(first) + sample for sample in _rests(ways, time[to_last], task.radius)]
        left = np.logical_or.accumulate((radii > 1.5).any(axis=0))
        again = np.flatnonzero((left & (radii < 0.5).all(axis=0))[: found[0][0]])
        returns += (first + again[:1]).tolist()
        at_once += [int(first) + one[0] for one, other in pairwise(found) if other[0] - one[0] == 1]
        before = clock[0]
        for goal, (_, arm, when, posture) in enumerate(found, 1):
            ticks = max((when - before) * ticks_per_unit, 1.0)
            rows.append([people[0], trial[first], goal, hands[arm], round(ticks, 6), *posture])
            before = when
    lost = used & (missing_for > _LONGEST_GAP + 1e-9)
    refuse(lost & leap, f"time jumps by more than {1000 * _LONGEST_GAP:.0f} ms: are samples "
           "missing, or was the clock set? Fill the gap, or leave the trial out")  # fmt: skip
    refuse(lost, f"{culprit[lost.argmax()]}a marker is missing for more than "
           f"{1000 * _LONGEST_GAP:.0f} ms; fill the gap, or leave the trial out")  # fmt: skip
    swaps &= used
    refuse(swaps, f"{culprit[swaps.argmax()]}the length of a link jumps by more than "
           f"{100 * _TOLERANCE:.0f} %: markers swap, or a flag stands for a gap")  # fmt: skip
    remedy = _finished_by(broken_off, task)
    torn &= used & (not remedy)
    refuse(torn, "the places of the two shoulders do not belong to one base: they differ "
           f"from the task's by more than {100 * _TOLERANCE:.0f} %")  # fmt: skip
    refuse(twice, "the hand is back at the start of the trial and reaches all goals again; needed "
           "is a number for each trial")  # fmt: skip
    sprung = np.zeros(len(frame), dtype=bool)
    for hand in hands:
        ways = np.linalg.norm(np.diff(places[hand], axis=0, prepend=np.nan), axis=2)
        ways[begins | ~used] = np.nan
        ways /= np.maximum(steps / step, 1)[:, None]
        most = np.maximum(6 * pd.DataFrame(ways).quantile(0.95).to_numpy(), task.radius)
        for marker, name in enumerate(markers[hand]):
            far = ways[:, marker] > most[marker]
            culprit[far & (missing_for == 0)] = f"{hand}_{name}: "
            sprung |= far
    refuse(sprung, f"{culprit[sprung.argmax()]}a marker goes much farther than in other samples: "
           "are samples missing, or did a marker jump?")  # fmt: skip
    missed = f"the tip misses {' '.join(unfinished[:1])}{also(unfinished)}"
    missed = (f"{source}: {len(unfinished)} of {counted(len(parts), 'trial')} are unfinished and "
              f"have no hits: {missed}{remedy}")  # fmt: skip
    if 2 * len(unfinished) > len(parts):
        middles = [np.nanmedian(places[hand][begin, -1], axis=0) for hand in hands]
        raise CoarticError(
            f"{missed}. It begins at {_points(middles)} in the median trial, at {_points(origins)} "
            "in the task. Are places in the unit of the task, with its origin and directions (y "
            "upwards), not filtered, cut at the start, and goals in its order? Else leave out "
            "trials that were broken off"
        )
    refuse(away, f"the hand is not within {largest:.2g} of {_points(origins)}, where task "
           f"{task.name!r} starts; needed are trials cut at the start, or the start of people in "
           "the task")  # fmt: skip
    refuse(rests, f"the trial begins with a rest of more than {1000 * _LONGEST_REST:.0f} ms, which "
           "would count as movement; cut trials where the movement begins")  # fmt: skip
    if frozen := [names[row] for row in np.flatnonzero(used & held & (missing_for == 0))]:
        warn(f"{source}, {frozen[0]}: a marker keeps its place to the last digit for more than "
             f"50 ms, unlike elsewhere. Does its last place fill a gap?{also(frozen)}")  # fmt: skip
    if bridged := np.flatnonzero(used & (missing_for > 0)).tolist():
        row, longest = bridged[0], 1000 * missing_for[bridged].max()
        words = f"a gap is bridged by a straight line; the longest takes {longest:.0f} ms"
        warn(f"{source}, {names[row]}: {culprit[row]}{words}{also([names[n] for n in bridged])}")
    if unfinished:
        warn(missed)
    every = np.hstack([places[hand].reshape(len(frame), -1) for hand in hands])
    ways = np.diff(every, axis=0, prepend=np.nan)
    ways[begins | leap] = np.nan
    rates = step / np.where(begins, step, steps)[:, None]
    least = 5 * coarse * task.radius  # shorter paths may be doubled by rounding
    if (words := _odd_steps(ways, least)) and _odd_steps(ways * rates, least):
        warn(f"{source}: {words}")
    stretched = [
        f"{hand} {words}"
        for hand in hands
        for words in _stretches(lengths[hand][used], q[used, task.robot.joints(hand)])
    ]
    if stretched:
        warn(f"{source}: the length of {stretched[0]}: does a marker slide over a joint, "
             f"or is it late?{also(stretched)}")  # fmt: skip
    if absent := [hand for hand in task.hands if hand not in hands]:
        warn(f"{source}: the {absent[0]} arm has no markers and keeps its start")
    for words, samples in counted_in.items():
        if samples:
            warn(f"{source}, {names[samples[0]]}: {words}, {counted(len(samples), 'time')}, which "
                 f"counts as movement{also([names[row] for row in samples])}")  # fmt: skip
    earliest, moving = np.min(begun, axis=0), np.isfinite(begun).sum(axis=0)
    if moving.min() >= 10 and (lag := np.ptp(earliest)) > 0.08:
        warn(f"{source}: the {hands[int(earliest.argmax())]} arm rests for at least "
             f"{1000 * lag:.0f} ms more than the other at the start of all trials: does its system "
             "lag behind, or is the clock another?")  # fmt: skip
    start = np.median(starts, axis=0)
    same = np.mean(np.sign(starts) == np.sign(start), axis=0) >= 0.9
    distance = float(np.median(np.linalg.norm(starts, axis=1)))
    far_joints = [f"{task.robot.joint_names[k]} {start[k]:+.2f}" for k in range(2, len(start))
                  if same[k] and abs(start[k]) > 0.05]  # fmt: skip
    if far_joints:
        warn(f"{source}: the median trial begins at {', '.join(far_joints)} rad from the start of "
             f"task {task.name!r}: are trials cut late, or is its start another?")  # fmt: skip
    elif distance > 0.3:
        warn(f"{source}: the median trial begins {distance:.2g} (length unit, rad) from the start "
             f"of task {task.name!r}, in varied directions: is there one start?")  # fmt: skip
    table = pd.DataFrame(rows, columns=["subject", "trial", "goal", "hand", "ticks",
                                        *task.robot.joint_names])  # fmt: skip
    calls = [f"trial {row[1]:g}, goal {row[2]}" for row in rows]
    hits = checked_hits(table, task, source, calls, implausible)
    hits.attrs["unfinished"] = len(unfinished)
    return hits


def _odd_steps(ways: Array, least: float) -> str:
    """Return, in words, that most samples repeat the sample before, or that between many samples
    markers go some twice as far as before and after, on paths over ``least``; otherwise empty.
    ``ways``: changes from the sample before, ``(n, coordinates)``, NaN after gaps and where a trial
    begins."""
    moves = np.flatnonzero((ways != 0).any(axis=1) & np.isfinite(ways).all(axis=1))
    if len(moves) < MANY:
        return ""
    if np.median(np.diff(moves)) >= 2:
        return "most samples have the places of the one before: leave out samples that repeat"
    around = (ways[:-2] + ways[2:]) / 2
    way = np.linalg.norm(around, axis=1)
    fast = np.isfinite(way) & np.isfinite(ways[1:-1]).all(axis=1)
    fast &= way > max(least, np.median(way[fast])) if fast.any() else False
    ratios = (ways[1:-1] * around).sum(axis=1)[fast] / way[fast] ** 2
    if (skipped := int((ratios > 1.6).sum())) <= max(2, 0.02 * len(ratios)):
        return ""
    return (f"{counted(skipped, 'time')} markers go twice as far between samples as before and "
            "after: are frames lost, and times numbered again?")  # fmt: skip


def _stretches(lengths: Array, angles: Array) -> list[str]:
    """Return in words each link whose length, ``(n, links)``, follows the angle, rad, of a joint
    at one of its ends (except the first joint of the arm), or slowly varies by over 5 % (SD)."""
    changes = []
    for link, length in enumerate(lengths.T):
        for joint in range(max(link, 1), min(link + 2, angles.shape[1])):
            if not (length.std() > 0 < angles[:, joint].std()):
                continue
            correlation = abs(float(np.corrcoef(length, angles[:, joint])[0, 1]))
            share = correlation * length.std() / length.mean()
            if correlation > 0.3 and share > 0.005:
                changes.append(f"link {link + 1} follows joint {joint + 1}, by {100 * share:.1g} %"
                               " (SD)")  # fmt: skip
                break
        else:
            slow = length.std() > 2 * np.diff(length).std()  # unlike noise
            if slow and (share := length.std() / length.mean()) > 0.05:
                changes.append(f"link {link + 1} varies by {100 * share:.0f} % (SD)")
    return changes


def _listed(lengths: Array) -> str:
    """Return lengths as text, such as ``0.33, 0.27``."""
    return ", ".join(f"{length:.3g}" for length in lengths)


def _points(places: Iterable[Array]) -> str:
    """Return places as text, such as ``(0.088, 0.486) and (0.1, 0)``."""
    return " and ".join(f"({_listed(np.round(place, 6) + 0.0)})" for place in places)


def _rests(places: Array, time: Array, radius: float) -> list[int]:
    """Return the indices of samples at which rests of over 0.2 s begin, except at the first sample;
    ``places`` of markers, ``(n, markers, 2)``, and ``radius`` in length unit, ``time``, ``(n,)``,
    in s."""
    # A smooth movement that ends and another that begins are within a radius of the place between
    # them for 1.26 (the cube root of 2) times as long as within half a radius, without the rest.
    ahead = np.minimum(np.searchsorted(time, time + _LONGEST_REST), len(time) - 1)
    quiet = np.linalg.norm(places[ahead] - places, axis=2).max(axis=1) < radius / 2
    middles = np.flatnonzero(quiet & (ahead < len(time) - 1))
    begins: list[int] = []
    after = 0
    for group in np.split(middles, np.flatnonzero(np.diff(middles) > 1) + 1):
        if not len(group) or group[0] < after:
            continue
        middle = int(group[len(group) // 2] + ahead[group[len(group) // 2]]) // 2
        moved = np.linalg.norm(places - places[middle], axis=2).max(axis=1)
        lasts = []
        for far in (1, 0.5):
            gone = np.flatnonzero(moved > far * radius)
            begin = int(gone[gone < middle].max(initial=-1)) + 1
            after = int(gone[gone > middle].min(initial=len(time))) - 1
            lasts.append(time[after] - time[begin])
        if begin and (1.26 * lasts[1] - lasts[0]) / 0.26 > _LONGEST_REST:
            begins.append(begin)
    return begins


def _swapped(places: Array, links: Array, markers: Sequence[object]) -> str:
    """Return in words the first two markers of an arm (``places``, ``(n, markers, 2)``) whose
    exchange brings the median length of each link within 10 % of ``links``; empty if no exchange
    does."""
    for one, other in combinations(range(len(markers)), 2):
        order = [*range(len(markers))]
        order[one], order[other] = other, one
        ways = np.diff(places[:, order], axis=1)
        usual = pd.DataFrame(np.linalg.norm(ways, axis=2)).median().to_numpy()
        if (np.abs(usual / links - 1) <= _TOLERANCE).all():
            return f"Markers {markers[one]} and {markers[other]} may be swapped. "
    return ""


def _finished_by(trials: Sequence[Array], task: Task) -> str:
    """Return in words a change of axes or of the order of goals that finishes over 80 % of the
    first 20 unfinished trials, places of hands ``(hands, n, 2)``; empty if none does, or for fewer
    than two trials."""
    tried = [(f"in which {axes}", axes, task) for axes in AXES if axes]
    numbers = tuple(range(1, len(task.goals) + 1))
    for order in permutations(numbers) if len(numbers) <= 4 else [numbers[::-1]]:
        ordered = task.model_copy(update={"goals": tuple(task.goals[k - 1] for k in order)})
        tried.append((f"with goals in the order {', '.join(map(str, order))}", "", ordered))
    for words, axes, ordered in tried if len(trials) > 1 else ():
        done = []
        for tips in trials[:20]:
            clock = np.arange(float(tips.shape[1]))
            hits = _hits(turned(tips, axes), ordered, clock, clock[:, None])
            done.append(len(hits) == len(task.goals))
        if np.mean(done) > 0.8:
            return f". They are finished in a recording {words}"
    return ""


def _bridge(place: Array, time: Array, parts: Sequence[slice], step: float) -> Array:
    """Fill the gaps (NaN) of a marker, ``(n, 2)``, in place by straight lines in time, trial by
    trial (at ends by the nearest place; not in trials without a place). Return, at the first sample
    of each gap, its duration in s, and 0 elsewhere; ``step``: time between samples, s."""
    gap, durations = np.isnan(place[:, 0]), np.zeros(len(place))
    for part in parts if gap.any() else ():
        if not gap[part].any():
            continue
        there, clock = ~gap[part], time[part]
        edges = np.flatnonzero(np.diff(np.concatenate([[True], there, [True]]).astype(int)))
        around = np.concatenate([[clock[0] - step], clock, [clock[-1] + step]])
        durations[part.start + edges[::2]] = around[edges[1::2] + 1] - around[edges[::2]] - step
        for axis in (0, 1) if there.any() else ():
            at = place[part, axis]
            at[~there] = np.interp(clock[~there], clock[there], at[there])
    return durations


def _hits(tips: Array, task: Task, time: Array, q: Array) -> list[tuple[int, int, float, Array]]:
    """Return the hits of a trial, up to the first goal that is missed, each with the index of the
    sample and of the hand in ``tips``, ``(hands, n, 2)``, and time, s, and posture where the tip
    enters the goal, from times ``(n,)`` and postures ``q``, ``(n, dof)``, of the samples."""
    found: list[tuple[int, int, float, Array]] = []
    at, goals = tips @ [1, 1j], task.goal_array @ [1, 1j]
    ways = np.diff(at, axis=1, prepend=at[:, :1])  # to each sample from the one before
    for goal in goals:
        first = found[-1][0] + 1 if found else 0
        way, start = ways[:, first:], (at - ways)[:, first:] - goal
        square = np.maximum(way.real**2 + way.imag**2, 1e-18)
        slope = (start * way.conj()).real
        off = np.abs(start + np.clip(-slope / square, 0, 1) * way)
        inside = (off <= task.radius).any(axis=0)
        if not inside.any():
            return found
        place = int(inside.argmax())
        hand, sample = int(off[:, place].argmin()), first + place
        excess = abs(start[hand, place]) ** 2 - task.radius**2
        root = slope[hand, place] ** 2 - square[hand, place] * excess
        share = (-slope[hand, place] - np.sqrt(max(root, 0.0))) / square[hand, place]
        share = np.clip(share, 0, 1) if sample else 1.0
        before = max(sample - 1, 0)
        found.append((
            sample, hand, float(time[before] + share * (time[sample] - time[before])),
            q[before] + share * (q[sample] - q[before]),
        ))  # fmt: skip
    return found
