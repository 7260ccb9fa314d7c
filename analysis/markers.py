"""Hits of recorded trials from the places of markers over time, as motion capture gives them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, combinations, pairwise, permutations, product
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from coartic import CoarticError, Task
from coartic.analysis.hits import AXES, MANY, Implausible, checked_hits, turned
from coartic.analysis.recorded_tables import (
    also,
    as_names,
    as_numbers,
    read_table,
    row_names,
    warn,
    why_no_number,
)
from coartic.internal.arguments import checked_arguments
from coartic.internal.text import counted
from coartic.robot import HANDS, Array, Hand

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

    A trial begins with its first sample. Goals are hit in their order: a hit is where a tip, on the
    straight line from sample to sample, is first within the goal's radius; its time and posture are
    interpolated to there. Gaps of up to 50 ms (empty, NaN, or, far from the origin, both
    coordinates 0) are bridged by a straight line, with a warning unless after the last hit. An arm
    of the task without markers keeps its start, with a warning. Warns, too, of samples that repeat,
    places that are rounded or held, frames that seem lost, links whose length is not the task's,
    changes or follows a joint, an arm that never starts as early as the other, trials that begin
    away from the task's start, rests and returns to the start on the way, and hits of two goals in
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
        A row for each hit, with the columns of :func:`.read_hits` (``ticks``: at least 1). Trials
        in which a goal is never reached have no hits, with a warning; ``attrs["unfinished"]``,
        which :func:`pandas.concat` may lose, is the number of such trials.

    Raises
    ------
    CoarticError
        ``ticks_per_unit`` is not above 0, or the task lacks the hand of ``side``; the recording is
        no such table, of several people, or not of 25 to 2000 samples in a second;
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
    hands = [hand for hand in HANDS if side in (hand, "both") and hand in task.hands]
    if not hands:
        raise CoarticError(f"side is {side!r}, but task {task.name!r} has the {task.hands[0]} hand")
    samples = _samples_of(recording, task, hands)
    _check_clock(samples)
    marks = _bridge_gaps(samples)
    marks["jumping_link"] = _find_jumps_of_links(samples)
    q, marks["is_torn"] = _postures(samples)
    trials = [_trial_of(samples, q, part) for part in samples.parts]
    marks["is_used"] = False
    for trial in trials:
        marks.loc[trial.part.start : trial.end - 1, "is_used"] = True
    finished = [trial for trial in trials if trial.is_finished]
    remedy = _finished_by([trial.tips for trial in trials if not trial.is_finished], task)
    _refuse_places(samples, marks, trials, remedy)
    unfinished = _unfinished(samples, trials, remedy)
    _check_starts(samples, q, finished)
    _warn_of_places(samples, q, marks)
    if unfinished:
        warn(unfinished)
    _warn_of_movement(samples, finished)
    rows = []
    for trial in finished:
        before = samples.time[trial.part.start]
        for goal, hit in enumerate(trial.hits, 1):
            ticks = round(max((hit.time - before) * ticks_per_unit, 1.0), 6)
            number = samples.trial[trial.part.start]
            rows.append([samples.subject, number, goal, hands[hit.hand], ticks, *hit.posture])
            before = hit.time
    table = pd.DataFrame(rows, columns=["subject", "trial", "goal", "hand", "ticks",
                                        *task.robot.joint_names])  # fmt: skip
    calls = [f"trial {row[1]:g}, goal {row[2]}" for row in rows]
    hits = checked_hits(table, task, samples.source, calls, implausible)
    hits.attrs["unfinished"] = len(trials) - len(finished)
    return hits


@dataclass(frozen=True)
class _Samples:
    """Samples of a person's trials, n in all, by trial and time.

    ``source`` and ``names`` of rows are for messages, ``markers`` are names such as ``right_1``,
    ``trial`` and ``time``, s, are ``(n,)``, ``places`` ``(n, markers, 2)``, length unit.
    """

    task: Task
    source: str
    names: Sequence[str]
    subject: str
    markers: dict[Hand, list[str]]
    trial: Array
    time: Array
    places: dict[Hand, Array]

    @cached_property
    def begins(self) -> NDArray[np.bool_]:
        """Mask, ``(n,)``, of the first samples of trials."""
        return np.append(True, np.diff(self.trial) != 0)

    @cached_property
    def parts(self) -> list[slice]:
        """Slice of the samples of each trial."""
        begin = np.flatnonzero(self.begins).tolist()
        return [slice(*ends) for ends in pairwise([*begin, len(self.trial)])]

    @cached_property
    def steps(self) -> Array:
        """Time since the sample before, also of another trial, ``(n,)``, s; 0 at the very first."""
        return np.append(0.0, np.diff(self.time))

    @cached_property
    def is_even(self) -> NDArray[np.bool_]:
        """Mask, ``(n,)``, of samples whose time since the sample before is at most 2.5 times the
        median of the trial; False where a trial begins."""
        steps = np.where(self.begins, np.nan, self.steps)
        usual = self.by_trial(steps[:, None], "median")[np.cumsum(self.begins) - 1, 0]
        even: NDArray[np.bool_] = ~self.begins & (self.steps <= 2.5 * usual)
        return even

    @cached_property
    def step(self) -> float:
        """Mean time between even samples (:attr:`is_even`), s; NaN without such samples."""
        return float(self.steps[self.is_even].mean()) if self.is_even.any() else np.nan

    @cached_property
    def origins(self) -> Array:
        """Places of the hands at the task's start, ``(hands, 2)``, length unit."""
        q0, robot = self.task.q0, self.task.robot
        return np.stack([robot.forward_kinematics(q0, hand) for hand in self.places])

    @cached_property
    def leaps(self) -> NDArray[np.bool_]:
        """Mask, ``(n,)``, of samples before which others are missing: their time since the sample
        before is over 1.9 times :attr:`step` (not 2: clocks may be rounded)."""
        return ~self.begins & (self.steps > 1.9 * self.step)

    def by_trial(self, values: Array, statistic: str) -> Array:
        """Return a statistic (its name in pandas) of values of samples, ``(n, k)``, in each trial,
        without NaN: shape ``(trials, k)``."""
        return pd.DataFrame(values).groupby(np.cumsum(self.begins)).agg(statistic).to_numpy()

    def refuse(self, wrong: NDArray[np.bool_], words: str) -> None:
        """Raise CoarticError, with :meth:`sentence`, if a sample is ``wrong``, a mask ``(n,)``."""
        if rows := np.flatnonzero(wrong).tolist():
            raise CoarticError(self.sentence(rows, words))

    def sentence(self, rows: Sequence[int], words: str) -> str:
        """Return ``words`` after the source and the name of the first of ``rows`` (indices of
        samples), and before the names of other rows."""
        return f"{self.source}, {self.names[rows[0]]}: {words}{also([self.names[k] for k in rows])}"

    def compare_trials(
        self, name: str, each: Array, share: float, most: float, doubt: float, words: str
    ) -> None:
        """Raise CoarticError if a quantity, ``each`` by trial, differs between trials of over 20
        samples by over ``most``, and warn if by over ``doubt``; the share ``share`` of trials with
        the lowest values, and of trials with the highest, does not count. ``name`` (of the
        quantity) and ``words`` (advice) are for the message."""
        samples = np.array([self.is_even[part].sum() for part in self.parts])
        long = np.flatnonzero((samples >= MANY) & np.isfinite(each))
        ordered, out = np.sort(each[long]), int(share * len(long))
        if not len(long) or (change := ordered[-1 - out] - ordered[out]) <= min(most, doubt):
            return
        high = each[long] > ordered[out] + change / 2
        one, other = sorted((long[high.argmin()], long[high.argmax()]))
        begins = [self.parts[n].start for n in (one, other)]
        before, now = (f"{each[n]:.3g} in trial {self.trial[begin]:g}"
                       for n, begin in zip((one, other), begins, strict=True))  # fmt: skip
        text = self.sentence(begins[1:], f"{name} is {now}, but {before}; {words}")
        warn(text, refuse=change > most)


class _Hit(NamedTuple):
    """Hit: index of its sample in the trial and of its hand, and time, s, and posture, ``(dof,)``,
    where the tip enters the goal."""

    sample: int
    hand: int
    time: float
    posture: Array


class _Trial(NamedTuple):
    """Trial of n samples: their numbers in the recording, ``end`` after the last that counts (the
    last hit if all goals are hit), places of hands, ``(hands, n, 2)``, the hits up to the first
    goal that is missed, and ways from the start, ``(hands, n)``, in radii, where the hands are in
    running medians of 50 ms; ``second``: the sample of a second start, from which all goals are
    hit, or None."""

    part: slice
    end: int
    is_finished: bool
    tips: Array
    hits: list[_Hit]
    ways: Array
    second: int | None


def _samples_of(
    recording: pd.DataFrame | str | Path, task: Task, hands: Sequence[Hand]
) -> _Samples:
    """Return the samples of a recording as of :func:`hits_from_markers`, NaN for a missing place.
    Raises CoarticError for a missing column, no sample, no or several people, text in place of a
    number, and trials or times that are in no order."""
    if isinstance(recording, pd.DataFrame):
        frame, source, names = recording.reset_index(drop=True), "the frame", row_names(recording)
    else:
        source = str(recording)
        frame, names = read_table(recording, "places of markers are")
    markers = {hand: [*(f"{hand}_{k + 1}" for k in range(len(task.robot.arm(hand).links))),
                      f"{hand}_tip"] for hand in hands}  # fmt: skip
    columns = [f"{marker}_{axis}" for marker in chain(*markers.values()) for axis in "xy"]
    if missing := [name for name in ["subject", "trial", "time", *columns] if name not in frame]:
        there = ", ".join(map(str, frame.columns)) or "none"
        raise CoarticError(f"{source} has no column {missing[0]}{also(missing)}; found are {there}")
    if not len(frame):
        raise CoarticError(f"{source} has no sample: needed is a row for each")
    people = as_names(frame.subject)
    numbers = {name: as_numbers(frame[name]) for name in ["trial", "time", *columns]}
    places = {hand: np.stack([numbers[f"{marker}_{axis}"] for marker in markers[hand]
                              for axis in "xy"], axis=1).reshape(len(frame), -1, 2)
              for hand in hands}  # fmt: skip
    trial, time, person = numbers["trial"], numbers["time"], people.iloc[0]
    samples = _Samples(task, source, names, person, markers, trial, time, places)
    samples.refuse((people == "").to_numpy(), "subject is empty; needed is a name")
    others = (people != person).to_numpy()
    samples.refuse(others, "another subject; needed is a file for each person")
    for name in ("trial", "time"):
        none = ~np.isfinite(numbers[name])
        value = frame[name][int(none.argmax())]
        samples.refuse(none, f"{name} is {value!r}; {why_no_number(value)}")
    for name in columns:  # an empty place is a gap
        for row in np.flatnonzero(np.isnan(numbers[name]) & frame[name].notna()).tolist():
            if "leave out" not in (why := why_no_number(value := frame[name][row])):
                samples.refuse(np.arange(len(frame)) == row, f"{name} is {value!r}; {why}")
    begins = samples.begins
    samples.refuse((trial % 1 != 0) | (trial < 1), "trial is no whole number from 1")
    again = pd.Series(np.where(begins, trial, np.nan)).duplicated().to_numpy() & begins
    samples.refuse(
        again,
        "a trial of this number ended above; number trials through from session to session, sort "
        "samples by time, and give people of one name a file each",
    )
    samples.refuse(
        ~begins & (samples.steps <= 0),
        "time does not increase; needed is each sample once, in order, with a time that is not "
        "rounded, and a trial for each start of the clock",
    )
    return samples


def _check_clock(samples: _Samples) -> None:
    """Raise CoarticError if there are fewer than 25 or more than 2000 samples in a second, or if
    some trials have another number than others."""
    if not 0.0005 <= samples.step <= 0.0401:  # else hands pass goals between samples
        raise CoarticError(
            f"{samples.source}: the time between samples is {samples.step:g} s; needed are 25 to "
            "2000 samples in a second. Is time in s, and not in ms or frames, and are all samples "
            "there?"
        )
    steps = np.where(samples.is_even, samples.steps, np.nan)
    each = samples.by_trial(steps[:, None], "mean")[:, 0]
    samples.compare_trials("the time between samples", each, 0, _TOLERANCE * samples.step, np.inf,
                           "correct the clock, or sample all trials at one rate")  # fmt: skip


def _bridge_gaps(samples: _Samples) -> pd.DataFrame:
    """Fill gaps in the places of markers by straight lines, in place.

    Returns a row for each sample: ``gap``, duration of the longest gap that begins there, s, or 0,
    and its ``marker``, such as ``right_1: ``, empty if whole samples are missing; ``is_held``, True
    if a marker keeps its place, or is missing, from there for over 50 ms, unlike elsewhere.
    ``attrs`` has the step to which places are rounded, length unit, as ``grid``, and the column
    with the largest as ``coarsest``.
    """
    task, step, n = samples.task, samples.step, len(samples.time)
    longest, of_marker = np.zeros(n), np.full(n, "", dtype=object)
    held, coarse, rounded = np.zeros(n, dtype=bool), 0.0, ""
    for hand, at in samples.places.items():
        for (k, marker), (axis, letter) in product(
            enumerate(samples.markers[hand]), enumerate("xy")
        ):
            column = at[:, k, axis]
            grid = np.unique(np.round(column[np.isfinite(column)] / task.radius, 6))
            if len(grid) >= MANY and (least := np.diff(grid).min()) > coarse:
                coarse, rounded = least, f"{marker}_{letter}"
        at[~np.isfinite(at).all(axis=2)] = np.nan
        middle = pd.DataFrame(at.reshape(n, -1)).median().to_numpy().reshape(-1, 2)
        far = np.linalg.norm(middle, axis=1) > 0.1 * task.robot.reach(hand)[1]
        at[(at == 0).all(axis=2) & far] = np.nan  # near the origin a marker may be there
        for k, marker in enumerate(samples.markers[hand]):
            same = (np.diff(at[:, k], axis=0, prepend=np.nan) == 0).all(axis=1) & ~samples.begins
            if 0 < same.mean() < 0.05:  # else markers are often still
                kept = np.where(same[:, None], np.nan, at[:, k])
                held |= _bridge(kept, samples) > _LONGEST_GAP
            durations = _bridge(at[:, k], samples)
            of_marker[durations > longest] = f"{marker}: "
            longest = np.maximum(longest, durations)
    leaps = samples.leaps
    longest[leaps] = np.maximum(longest[leaps], samples.steps[leaps] - step)
    marks = pd.DataFrame({"gap": longest, "marker": of_marker, "is_held": held})
    marks.attrs |= {"grid": coarse * task.radius, "coarsest": rounded}
    return marks


def _find_jumps_of_links(samples: _Samples) -> NDArray[np.object_]:
    """Return for each sample, ``(n,)``, the marker at which a link begins that changes its length
    from the sample before by over 10 % of the task's length and over nine times the median change,
    such as ``right_1: ``, or an empty text. Raises CoarticError if the median length of a link in a
    trial differs by over 10 % from the task's; warns if over all trials by over 2 %, or between
    trials by over 2.5 %."""
    task, jumps = samples.task, np.full(len(samples.time), "", dtype=object)
    for hand, places in samples.places.items():
        links, lengths = task.robot.arm(hand).links, _lengths(places)
        each = samples.by_trial(lengths, "median")
        words = (f"the links of the {hand} arm are {{}} long in the median sample, those of "
                 f"task {task.name!r} {_listed(links)}")  # fmt: skip
        if wrong := np.flatnonzero((np.abs(each / links - 1) > _TOLERANCE).any(axis=1)).tolist():
            part = samples.parts[wrong[0]]
            trials = [f"trial {samples.trial[samples.parts[n].start]:g}" for n in wrong]
            swapped = _swapped(places[part], links, samples.markers[hand])
            raise CoarticError(
                f"{samples.source}, {samples.names[part.start]}: in {trials[0]} "
                f"{words.format(_listed(each[wrong[0]]))}{also(trials)}. {swapped}Is this another "
                "arm, another unit, or are markers misplaced?"
            )
        usual = pd.DataFrame(lengths).median().to_numpy()
        if (np.abs(usual / links - 1) > _TOLERANCE / 5).any():
            warn(f"{samples.source}: {words.format(_listed(usual))}: a task with the lengths of "
                 "this person fits better")  # fmt: skip
        changes = np.abs(np.diff(lengths, axis=0, prepend=np.nan))
        noise = 9 * pd.DataFrame(changes).median().to_numpy()
        jumped = (changes > np.maximum(_TOLERANCE * links, noise)) & ~samples.begins[:, None]
        for link, marker in enumerate(samples.markers[hand][:-1]):
            jumps[jumped[:, link]] = f"{marker}: "
            samples.compare_trials(
                f"the length of {hand} link {link + 1}", each[:, link], 0.1, np.inf,
                _TOLERANCE / 4 * links[link], "did a marker move, or the scale?",
            )  # fmt: skip
    return jumps


def _postures(samples: _Samples) -> tuple[Array, NDArray[np.bool_]]:
    """Return the postures of samples, ``(n, dof)``, unwrapped from the task's start on in each
    trial, and a mask, ``(n,)``, of samples whose two shoulders do not fit one base, by over 10 % of
    their distance (of the shorter arm if that is 0). A locked base that is
    elsewhere in some trials is warned of, and raises CoarticError beyond two radii."""
    task, robot = samples.task, samples.task.robot
    shoulders = {hand: np.array(robot.arm(hand)[2:]) for hand in samples.places}
    bases = [places[:, 0] - shoulders[hand] for hand, places in samples.places.items()]
    apart = np.linalg.norm(np.ptp(bases, axis=0), axis=1)
    width = float(np.linalg.norm(np.ptp([*shoulders.values()], axis=0)))
    torn = apart > _TOLERANCE * (width or min(robot.reach(hand)[1] for hand in shoulders))
    q = np.tile(task.q0, (len(apart), 1))
    q[:, :2] = np.mean(bases, axis=0)
    for k in ("xy".index(axis) for axis in task.locked_base):
        each = samples.by_trial(q[:, [k]], "median")[:, 0]
        samples.compare_trials(
            f"base_{'xy'[k]}", each, 0.1, 2 * task.radius, task.radius,
            f"task {task.name!r} locks it: did the person or the camera move?",
        )  # fmt: skip
    for hand, places in samples.places.items():
        way = np.diff(places, axis=1)
        q[:, robot.joints(hand)] = np.diff(np.arctan2(way[..., 1], way[..., 0]), prepend=0.0)
    for part in samples.parts:
        q[part, 2:] = np.unwrap(np.vstack([task.q0[2:], q[part, 2:]]), axis=0)[1:]
    return q, torn


def _trial_of(samples: _Samples, q: Array, part: slice) -> _Trial:
    """Return the trial of the samples ``part``; ``q``: postures of all samples, ``(n, dof)``."""
    task, clock = samples.task, samples.time[part]
    tips = np.stack([places[part, -1] for places in samples.places.values()])
    hits = _hits(tips, task, clock, q[part])
    window = max(3, 2 * round(_LONGEST_GAP / samples.step / 2) + 1)  # single samples are noise
    smooth = np.stack([
        pd.DataFrame(tip).rolling(window, center=True, min_periods=1).median().to_numpy()
        for tip in tips
    ])  # fmt: skip
    ways = np.linalg.norm(smooth - smooth[:, :1], axis=2) / task.radius
    to_goal = np.linalg.norm(tips[:, 0] - task.goal_array[0], axis=1).min() / task.radius
    close, second = min(3.0, to_goal - 2), None
    for back in _returns(ways, close + 0.5, close, hits[0].sample if hits else 0)[:1]:
        rest = _hits(tips[:, back:], task, clock[back:], q[part][back:])
        second = back if len(rest) == len(task.goals) else None
    is_finished = len(hits) == len(task.goals)
    end = part.start + hits[-1].sample + 1 if is_finished else part.stop
    return _Trial(part, end, is_finished, tips, hits, ways, second)


def _returns(ways: Array, left: float, back: float, first: int) -> list[int]:
    """Return the indices, from ``first`` on, of samples of a trial in which all hands are within
    ``back`` radii of the start, after one was farther than ``left`` radii; ``ways`` as of
    :class:`_Trial`."""
    has_left = np.logical_or.accumulate((ways > left).any(axis=0))
    there = np.flatnonzero(has_left & (ways < back).all(axis=0)).tolist()
    return [sample for sample in there if sample >= first]


def _refuse_places(
    samples: _Samples, marks: pd.DataFrame, trials: Sequence[_Trial], remedy: str
) -> None:
    """Raise CoarticError for a used sample at which a gap of over 50 ms begins, the length of a
    link jumps, a marker goes much farther than elsewhere, or two shoulders do not fit one base
    (unless there is a ``remedy``, :func:`_finished_by`), and for a trial with a second start.
    ``marks`` gets a column, in place."""
    used = marks.is_used.to_numpy()

    def refuse(column: str, wrong: NDArray[np.bool_], words: str) -> None:
        wrong = used & wrong
        samples.refuse(wrong, f"{marks[column][wrong.argmax()]}{words}")

    lost, longest = (marks.gap > _LONGEST_GAP + 1e-9).to_numpy(), f"{1000 * _LONGEST_GAP:.0f} ms"
    samples.refuse(
        used & lost & samples.leaps,
        f"time jumps by more than {longest}: are samples missing, or was the clock set? Fill the "
        "gap, or leave the trial out",
    )
    words = f"a marker is missing for more than {longest}; fill the gap, or leave the trial out"
    refuse("marker", lost, words)
    words = (f"the length of a link jumps by more than {100 * _TOLERANCE:.0f} %: markers swap, or "
             "a flag stands for a gap")  # fmt: skip
    refuse("jumping_link", (marks.jumping_link != "").to_numpy(), words)
    samples.refuse(
        used & marks.is_torn.to_numpy() & (not remedy),
        "the places of the two shoulders do not belong to one base: they differ from the task's by "
        f"more than {100 * _TOLERANCE:.0f} %",
    )
    starts = [trial.part.start + trial.second for trial in trials if trial.second is not None]
    samples.refuse(
        marks.index.isin(starts),
        "the hand is back at the start of the trial and reaches all goals again; needed is a "
        "number for each trial",
    )
    marks["leaping"] = ""
    for hand, places in samples.places.items():
        ways = np.linalg.norm(np.diff(places, axis=0, prepend=np.nan), axis=2)
        ways[samples.begins | ~used] = np.nan
        ways /= np.maximum(samples.steps / samples.step, 1)[:, None]
        most = np.maximum(6 * pd.DataFrame(ways).quantile(0.95).to_numpy(), samples.task.radius)
        for k, marker in enumerate(samples.markers[hand]):
            marks.loc[ways[:, k] > most[k], "leaping"] = f"{marker}: "
    words = "a marker goes much farther than in other samples: are samples missing, or did a marker"
    refuse("leaping", (marks.leaping != "").to_numpy(), f"{words} jump?")


def _unfinished(samples: _Samples, trials: Sequence[_Trial], remedy: str) -> str:
    """Return in words which trials are unfinished, with the ``remedy`` (:func:`_finished_by`);
    an empty text if all are finished. Raises CoarticError if most are unfinished."""
    task, missed = samples.task, []
    for trial in trials:
        if not trial.is_finished:
            done, after = len(trial.hits), trial.hits[-1].sample + 1 if trial.hits else 0
            ways = np.linalg.norm(trial.tips[:, after:] - task.goal_array[done], axis=2)
            number, nearest = (
                samples.trial[trial.part.start],
                ways.min(initial=np.inf) - task.radius,
            )
            missed.append(f"goal {done + 1} in trial {number:g} by {nearest:.2g}")
    if not missed:
        return ""
    words = (f"{samples.source}: {len(missed)} of {counted(len(trials), 'trial')} are unfinished "
             f"and have no hits: the tip misses {missed[0]}{also(missed)}{remedy}")  # fmt: skip
    if 2 * len(missed) > len(trials):
        middles = np.nanmedian([trial.tips[:, 0] for trial in trials], axis=0)
        raise CoarticError(
            f"{words}. It begins at {_points(middles)} in the median trial, at "
            f"{_points(samples.origins)} in the task. Are places in the unit of the task, with its "
            "origin and directions (y upwards), not filtered, cut at the start, and goals in its "
            "order? Else leave out trials that were broken off"
        )
    return words


def _check_starts(samples: _Samples, q: Array, trials: Sequence[_Trial]) -> None:
    """Raise CoarticError for finished trials that begin with a rest, or with the hand away from the
    task's start by over a quarter of the arm's reach. Warn if the median trial begins a little away
    from it, or if both arms move in ten trials or more and the earliest start of one is over 80 ms
    later than the other's. ``q``: postures of samples,
    ``(n, dof)``."""
    task, robot, hands = samples.task, samples.task.robot, [*samples.places]
    largest = 0.25 * max(robot.reach(hand)[1] for hand in hands)
    away, rests = np.zeros((2, len(q)), dtype=bool)
    begun = []
    for trial in trials:
        first, clock = trial.part.start, samples.time[trial.part]
        away[first] = (np.linalg.norm(trial.tips[:, 0] - samples.origins, axis=1) > largest).any()
        to_hit = slice(first, first + trial.hits[0].sample + 1)
        by_arm = [np.linalg.norm(places[to_hit] - places[first], axis=2).max(axis=1) / task.radius
                  for places in samples.places.values()]  # fmt: skip
        begun.append([clock[: len(way)][way > 0.25].min(initial=np.inf) - clock[0]
                      for way in by_arm])  # fmt: skip
        moved = np.max(by_arm, axis=0)
        moved[-1] = np.inf
        # A smooth movement has gone 8 times as far after twice the time: the rest is before it.
        leaves, is_far = (clock[np.argmax(moved > far)] for far in (0.5, 4))
        rests[first] = 2 * leaves - is_far - clock[0] > _LONGEST_REST
    samples.refuse(
        away,
        f"the hand is not within {largest:.2g} of {_points(samples.origins)}, where task "
        f"{task.name!r} starts; needed are trials cut at the start, or the start of people in the "
        "task",
    )
    samples.refuse(
        rests,
        f"the trial begins with a rest of more than {1000 * _LONGEST_REST:.0f} ms, which would "
        "count as movement; cut trials where the movement begins",
    )
    earliest, moving = np.min(begun, axis=0), np.isfinite(begun).sum(axis=0)
    if moving.min() >= 10 and (lag := np.ptp(earliest)) > 0.08:
        warn(f"{samples.source}: the {hands[int(earliest.argmax())]} arm rests for at least "
             f"{1000 * lag:.0f} ms more than the other at its earliest, at the start of all "
             "trials: does its system lag behind, or is the clock another?")  # fmt: skip
    starts = q[[trial.part.start for trial in trials]] - task.q0
    start = np.median(starts, axis=0)
    same = np.mean(np.sign(starts) == np.sign(start), axis=0) >= 0.9
    distance = float(np.median(np.linalg.norm(starts, axis=1)))
    far_joints = [f"{robot.joint_names[k]} {start[k]:+.2f}" for k in range(2, len(start))
                  if same[k] and abs(start[k]) > 0.05]  # fmt: skip
    words = ""
    if far_joints:
        words = (f"at {', '.join(far_joints)} rad from the start of task {task.name!r}: are trials "
                 "cut late, or is its start another?")  # fmt: skip
    elif distance > 0.3:
        words = (f"{distance:.2g} (length unit, rad) from the start of task {task.name!r}, in "
                 "varied directions: is there one start?")  # fmt: skip
    if words:
        warn(f"{samples.source}: the median trial begins {words}")


def _warn_of_places(samples: _Samples, q: Array, marks: pd.DataFrame) -> None:
    """Warn of places that are coarsely rounded, of used samples in which a marker keeps its place
    or a gap is bridged, of samples that repeat, frames that seem lost, links whose length follows a
    joint or drifts, and an arm without markers; ``q``: postures, ``(n, dof)``."""
    used, gap = marks.is_used.to_numpy(), marks.gap.to_numpy()
    grid, radius = marks.attrs["grid"], samples.task.radius
    if grid > 0.2 * radius:
        warn(f"{samples.source}: {marks.attrs['coarsest']} is rounded to {grid:.2g}, the radius of "
             f"goals is {radius:g}: are there more digits?")  # fmt: skip
    if frozen := np.flatnonzero(used & marks.is_held & (gap == 0)).tolist():
        words = ("a marker keeps its place to the last digit for more than 50 ms, unlike "
                 "elsewhere. Does its last place fill a gap?")  # fmt: skip
        warn(samples.sentence(frozen, words))
    if bridged := np.flatnonzero(used & (gap > 0)).tolist():
        words = (f"{marks.marker[bridged[0]]}a gap is bridged by a straight line; the longest "
                 f"takes {1000 * gap[bridged].max():.0f} ms")  # fmt: skip
        warn(samples.sentence(bridged, words))
    every = np.hstack([places.reshape(len(q), -1) for places in samples.places.values()])
    ways = np.diff(every, axis=0, prepend=np.nan)
    ways[samples.begins | samples.leaps] = np.nan
    rates = samples.step / np.where(samples.begins, samples.step, samples.steps)[:, None]
    least = 5 * grid  # shorter paths may be doubled by rounding
    if (words := _odd_steps(ways, least)) and _odd_steps(ways * rates, least):
        warn(f"{samples.source}: {words}")
    stretched = [
        f"{hand} {words}"
        for hand, places in samples.places.items()
        for words in _stretches(_lengths(places)[used], q[used, samples.task.robot.joints(hand)])
    ]
    if stretched:
        warn(f"{samples.source}: the length of {stretched[0]}: does a marker slide over a joint, "
             f"or is it late?{also(stretched)}")  # fmt: skip
    if absent := [hand for hand in samples.task.hands if hand not in samples.places]:
        warn(f"{samples.source}: the {absent[0]} arm has no markers and keeps its start")


def _warn_of_movement(samples: _Samples, trials: Sequence[_Trial]) -> None:
    """Warn of what counts as movement in finished trials: rests on the way, returns to the start,
    and hits of two goals in successive samples."""
    rows_by_kind: dict[str, list[int]] = {
        f"the hand rests for more than {1000 * _LONGEST_REST:.0f} ms on the way": [],
        "the hand is back at the start before it hits a goal": [],
        "the hand is in the next goal already where it hits one": [],
    }
    pauses, returns, at_once = rows_by_kind.values()
    for trial in trials:
        first, radius = trial.part.start, samples.task.radius
        ways = np.hstack([places[first : trial.end] for places in samples.places.values()])
        pauses += [first + k for k in _rests(ways, samples.time[first : trial.end], radius)]
        to_hit = trial.ways[:, : trial.hits[0].sample]
        returns += [first + k for k in _returns(to_hit, 1.5, 0.5, 0)[:1]]
        at_once += [first + one.sample for one, other in pairwise(trial.hits)
                    if other.sample - one.sample == 1]  # fmt: skip
    for words, rows in rows_by_kind.items():
        if rows:
            times = counted(len(rows), "time")
            warn(samples.sentence(rows, f"{words}, {times}, which counts as movement"))


def _lengths(places: Array) -> Array:
    """Return the lengths of the links of an arm, ``(n, links)``, from its markers' places."""
    lengths: Array = np.linalg.norm(np.diff(places, axis=1), axis=2)
    return lengths


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


def _swapped(places: Array, links: Array, markers: Sequence[str]) -> str:
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


def _bridge(place: Array, samples: _Samples) -> Array:
    """Fill the gaps (NaN) of a marker, ``(n, 2)``, in place by straight lines in time, trial by
    trial (at ends by the nearest place; not in trials without a place). Return, at the first sample
    of each gap, its duration in s, and 0 elsewhere."""
    gap, durations, step = np.isnan(place[:, 0]), np.zeros(len(place)), samples.step
    for part in samples.parts if gap.any() else ():
        if not gap[part].any():
            continue
        there, clock = ~gap[part], samples.time[part]
        edges = np.flatnonzero(np.diff(np.concatenate([[True], there, [True]]).astype(int)))
        around = np.concatenate([[clock[0] - step], clock, [clock[-1] + step]])
        durations[part.start + edges[::2]] = around[edges[1::2] + 1] - around[edges[::2]] - step
        for axis in (0, 1) if there.any() else ():
            at = place[part, axis]
            at[~there] = np.interp(clock[~there], clock[there], at[there])
    return durations


def _hits(tips: Array, task: Task, time: Array, q: Array) -> list[_Hit]:
    """Return the hits of a trial, up to the first goal that is missed, from places of the tips,
    ``(hands, n, 2)``, times ``(n,)`` and postures ``q``, ``(n, dof)``, of its samples."""
    hits: list[_Hit] = []
    at, goals = tips @ [1, 1j], task.goal_array @ [1, 1j]
    ways = np.diff(at, axis=1, prepend=at[:, :1])  # to each sample from the one before
    for goal in goals:
        first = hits[-1].sample + 1 if hits else 0
        way, start = ways[:, first:], (at - ways)[:, first:] - goal
        square = np.maximum(way.real**2 + way.imag**2, 1e-18)
        slope = (start * way.conj()).real
        off = np.abs(start + np.clip(-slope / square, 0, 1) * way)
        inside = (off <= task.radius).any(axis=0)
        if not inside.any():
            return hits
        place = int(inside.argmax())
        hand, sample = int(off[:, place].argmin()), first + place
        excess = abs(start[hand, place]) ** 2 - task.radius**2
        root = slope[hand, place] ** 2 - square[hand, place] * excess
        share = (-slope[hand, place] - np.sqrt(max(root, 0.0))) / square[hand, place]
        share = np.clip(share, 0, 1) if sample else 1.0
        before = max(sample - 1, 0)
        when = float(time[before] + share * (time[sample] - time[before]))
        hits.append(_Hit(sample, hand, when, q[before] + share * (q[sample] - q[before])))
    return hits
