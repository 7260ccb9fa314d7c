"""The signatures of a results folder as a Markdown page: methods beside each other."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import chain
from typing import TYPE_CHECKING, Any

import pandas as pd

from analysis.markup import escaped
from analysis.page import Heading, Part, page
from analysis.signatures.register import NO_RUN
from analysis.statistics.hypotheses import holm
from analysis.table import NONE, Table
from coartic import Task

if TYPE_CHECKING:
    from analysis.study import Study

Row = dict[Any, Any]
_GOAL = re.compile(r"goal \d+")
_NEUTRAL = re.compile(r"neutral at (-?[\d.]+)")
_AT_MOST = re.compile(r", of at most (\d+)$")
_LETTERS = "abcdefghijklmnopqrstuvwxyz"

_NOTES = (
    "Means over runs ± half of Student's 95 % interval, shares of runs with Wilson's in "
    "brackets, slopes ± half of the regression's. A number alone is that of a single run, or of "
    "a quantity without an interval; ± 0 says that these runs do not differ, not that others "
    "would not. Methods by mean reward, best first. What each signature means, and how its tests "
    "and intervals hold: docs/signatures.md; all of them, by goal, hand and joint: "
    "`signatures.csv`.",
    "p-values are two-sided for ΔV z and slopes, of permutation tests for contexts and norms of "
    "slopes, one-sided for the sacrifice (in the mean over runs, the first subtask takes longer "
    "by more than one tick and the whole takes less than by the corrective process with the same "
    "hands). They are adjusted by Holm's method over all tests of their own table, norms apart "
    "from slopes. Over several tables nothing is adjusted.",
)
_HANDS = (
    "Hand sequences with the number of runs; ticks less those of the corrective process alone "
    "with each run's own hands, which is what a sacrifice is judged by; and by goal, the share of "
    "runs that hit it with the hand that is quickest for it by itself."
)
_VARIANCE = (
    "Variance over runs per dimension within (V_ucm) and orthogonal to (V_ort) the uncontrolled "
    "manifold, squared units, and ΔV, their difference over the total."
)
_SYNERGY = (
    "ΔV z at each goal, over the runs with a method's commonest hand sequence; p of the test "
    "against its neutral value, ½ ln(d_ucm/d_ort). **It is above neutral nearly everywhere, and "
    "says little**: a hit confines the hand to a disc of the task's radius, so that runs cannot "
    "differ much in directions that move it, whatever the method."
)
OTHER = (
    "How much nearer the waiting hand is to its next goal than in the initial solution when each "
    "goal is hit (a ratio; 1: there already): in all; seen from the base, which leaves out what a "
    "base does that moved otherwise than in the initial solution; and by what the arm did since "
    "its own last hit, 0 where it keeps still while it waits."
)
CONTEXTS = (
    "Postures at the same goal before different successors. Runs are those of both tasks. The "
    "distance mixes length unit and rad; the parts are per root of their dimension. The lead is "
    "the time before the hit for which contexts differ, of the shorter movement's ticks."
)
_LOCUS = (
    "Slopes of the posture at a goal on the position of a neighbouring goal, by joint: length "
    "unit (base) or rad (joints) per length unit. They are those of the mean posture at each "
    "position, with positions − 2 degrees of freedom, for methods that are run once as for the "
    "others; curvature widens their intervals. Joints without any slope are left out. The norm is "
    "that of all joints together; it is never negative."
)


@dataclass
class _Notes:
    """Why cells of one table are empty: a letter for each reason."""

    reasons: list[str] = field(default_factory=list)

    def mark(self, reason: str) -> str:
        """An empty cell."""
        if reason not in self.reasons:
            self.reasons.append(reason)
        return f"{NONE} ({_LETTERS[self.reasons.index(reason) % len(_LETTERS)]})"

    def lines(self) -> list[str]:
        """The reasons, by letter; in inline markup, nothing where there are none."""
        reasons = enumerate(map(escaped, self.reasons))
        text = "; ".join(f"({_LETTERS[i % 26]}) {why}" for i, why in reasons)
        return [text] if text else []


def signatures_page(study: Study) -> str:
    """Tables by task, between contexts and of locus slopes, from ``study.signatures``."""
    frame = study.signatures
    labels: dict[str, list[str]] = {name: [] for name in study.results.tasks}
    for name, label in study.method_rows:  # best reward first within a task
        labels[name].append(label)
    parts: list[Part] = [Heading(1, "Signatures of coarticulation"), *_NOTES]
    for name, task in study.results.tasks.items():
        own = frame[frame.task == name]
        parts.append(Heading(2, f"{name}{' †' if task.reconstructed else ''}"))
        tables = [("How it moves", "", main_columns(task))]
        if len(task.goals) > 1:
            tables.append(("Further goals", "", _further(task)))
        if len(task.hands) > 1:
            tables += [
                ("Hands", _HANDS, _hands(task)),
                ("The other arm", OTHER, other_arm_columns(task)),
                ("Travel of the other arm", "", _by_goal(task, "travel of the other arm", "rad")),
            ]
        tables += [
            ("Synergy: ΔV z", _SYNERGY, _synergy(task, own)),
            ("Synergy: V_ucm, V_ort and ΔV", _VARIANCE, _variance(task)),
        ]
        found = [_by_method(title, text, own, labels[name], cols) for title, text, cols in tables]
        parts += list(chain.from_iterable(found)) or [f"{NO_RUN.capitalize()}."]
    parts += _contexts(frame, labels)
    parts += _slopes(frame, labels)
    if any(task.reconstructed for task in study.results.tasks.values()):
        parts.append("† Reconstructed task (docs/model.md).")
    return page(parts)


@dataclass(frozen=True)
class Column:
    """A signature at one place, and the head of its column."""

    signature: str
    place: str
    head: str
    spelt: bool = False
    """Whether it shows the signature's ``where``, not its value."""


def main_columns(task: Task) -> list[Column]:
    """The main signatures of one task."""
    columns = [
        Column("first subtask against initial", "goal 1", "first subtask, ticks"),
        Column("total against initial", "", "total, ticks"),
        Column("first subtask sacrificed", "", "sacrificed, share"),
        Column("subtask against isolated reach", "goal 1", "goal 1 against isolated, ticks"),
    ]
    if len(task.hands) > 1:
        columns += [
            Column("hand entropy", "", "hand entropy, bit"),
            Column("hands as the best corrective ones", "", "hands as corrective, share"),
        ]
    columns += [
        Column("base reversals", f"base {axis}", f"base {axis} reversals, count")
        for axis in "xy"
        if axis not in task.locked_base
    ]
    if len(task.goals) > 1:
        columns.append(Column("turning angle", "goal 1", "turn at goal 1, rad"))
    columns.append(Column("hand path SPARC", "chosen hand", "SPARC, 1"))
    columns.append(Column("hand path log dimensionless jerk", "chosen hand", "log jerk, 1"))
    return columns


def other_arm_columns(task: Task) -> list[Column]:
    """What the arm that is not chosen does, goal by goal."""
    goals = [f"goal {number}" for number in range(1, len(task.goals))]
    return [
        Column(name, goal, f"{goal}, {head}")
        for name, head in (
            ("preshaping of the other arm", "all"),
            ("preshaping seen from the base", "from the base"),
            ("preshaping since its last hit", "since its hit"),
        )
        for goal in goals
    ]


def _by_goal(task: Task, signature: str, head: str, first: int = 1) -> list[Column]:
    """A column for each goal from ``first`` on."""
    goals = range(first, len(task.goals) + 1)
    return [Column(signature, f"goal {goal}", f"goal {goal}, {head}") for goal in goals]


def _further(task: Task) -> list[Column]:
    """What :func:`main_columns` have at goal 1, at the others."""
    return [
        *_by_goal(task, "subtask against isolated reach", "against isolated, ticks", 2),
        *_by_goal(task, "turning angle", "turn, rad", 2)[:-1],  # there is none at the last
    ]


def _hands(task: Task) -> list[Column]:
    return [
        Column("hand entropy", "", "hands", spelt=True),
        Column("first subtask against the same hands", "goal 1", "first subtask, ticks"),
        Column("total against the same hands", "", "total, ticks"),
        *_by_goal(task, "hand as in isolation", "as in isolation, share"),
    ]


def _variance(task: Task) -> list[Column]:
    return [
        column
        for goal in range(1, len(task.goals) + 1)
        for name in ("V_ucm", "V_ort", "ΔV")
        for column in _by_goal(task, name, name)[goal - 1 : goal]
    ]


def _synergy(task: Task, frame: pd.DataFrame) -> list[Column]:
    """A column per goal, with the neutral value in its head: one for all methods and hands."""
    columns = []
    for number in range(1, len(task.goals) + 1):
        goal = f"goal {number}"
        places = frame["where"][(frame.signature == "ΔV z") & frame["where"].str.startswith(goal)]
        neutral = places.str.extract(_NEUTRAL)[0].dropna().unique()
        columns.append(Column("ΔV z", goal, f"{goal} (neutral {' or '.join(neutral)})"))
    return columns


def place(row: Row) -> str:
    """Where a signature is, without what differs between methods."""
    if row["signature"] in ("hand entropy", "hands as the best corrective ones"):
        return ""
    goal = _GOAL.match(row["where"])
    return goal.group() if goal else str(row["where"])


def _by_method(
    title: str, text: str, frame: pd.DataFrame, labels: Sequence[str], columns: Sequence[Column]
) -> list[Part]:
    """A table of methods by columns, with notes; nothing where no method has a value."""
    wanted = {column.signature for column in columns}
    rows = frame[frame.signature.isin(wanted)].to_dict("records")
    adjusted = _adjusted(rows)
    found = {
        (row["label"], row["signature"], place(row)): (row, p)
        for row, p in zip(rows, adjusted, strict=True)
    }
    whole = {  # signatures that a method lacks altogether say so in one row
        (row["label"], row["signature"]): row["why_not"] for row in rows if not row["where"]
    }
    notes, lines, empty = _Notes(), [], dict[str, list[str]]()
    for label in labels:
        entries = [found.get((label, column.signature, column.place)) for column in columns]
        known = [row for row, _ in filter(None, entries) if pd.notna(row["value"])]
        if not known:
            why = next((row["why_not"] for row, _ in filter(None, entries)), "")
            why = why or next((whole[key] for key in whole if key[0] == label), "")
            empty.setdefault(why, []).append(label)
            continue
        cells = [
            _cell(*entry, notes, spelt=column.spelt)
            if entry
            else notes.mark(whole.get((label, column.signature), "not in every run's sequence"))
            for entry, column in zip(entries, columns, strict=True)
        ]
        lines.append((label, str(max(row["n"] for row in known)), *cells))
    if not lines:
        return []
    heads = ("method", "runs", *(column.head for column in columns))
    parts: list[Part] = [Heading(3, title), *([text] if text else [])]
    parts += [Table(title, heads, tuple(lines)), *notes.lines()]
    parts += [
        escaped(f"Without values ({why}): {', '.join(names)}.") for why, names in empty.items()
    ]
    return parts


def _contexts(frame: pd.DataFrame, labels: dict[str, list[str]]) -> list[Part]:
    names = {
        "context distance": "distance",
        "context dependence": "dependence, pooled SD",
        "motor-equivalent part": "motor-equivalent part",
        "non-motor-equivalent part": "non-motor-equivalent part",
        "lead time": "lead, ticks",
    }
    frame = frame[frame.signature.isin(list(names)) & frame["where"].str.contains("against")]
    spot = frame["where"].str.replace(_AT_MOST, "", regex=True)
    parts: list[Part] = []
    for (task, where), group in frame.groupby([frame.task, spot], sort=False):
        rows = group.to_dict("records")
        notes, lines = _Notes(), []
        cells = {
            (row["label"], row["signature"]): (row, p)
            for row, p in zip(rows, _adjusted(rows), strict=True)
        }
        for label in labels[str(task)]:
            own = [cells[label, name] for name in names if (label, name) in cells]
            if any(pd.notna(row["value"]) for row, _ in own):
                runs = str(max(row["n"] for row, _ in own))
                lines.append((label, runs, *(_cell(*entry, notes) for entry in own)))
        if lines:
            title = f"{task}, {where}"
            table = Table(title, ("method", "runs", *names.values()), tuple(lines))
            parts += [Heading(3, title), table, *notes.lines()]
    return [Heading(2, "Between contexts"), CONTEXTS, *parts] if parts else []


def _slopes(frame: pd.DataFrame, labels: dict[str, list[str]]) -> list[Part]:
    norms = frame[frame.signature == "locus slope norm"]
    frame = frame[(frame.signature == "locus slope") & frame.value.notna()]
    if not len(frame):
        return []
    split = frame["where"].str.rpartition(", ")
    frame = frame.assign(at=split[0], joint=split[2])
    parts: list[Part] = [Heading(2, "Locus slopes"), _LOCUS]
    for (task, at), group in frame.groupby(["task", "at"], sort=False):
        joints = [
            str(joint)
            for joint, rows in group.groupby("joint", sort=False)
            if rows.value.abs().max() > 0
        ]
        rows = group.to_dict("records")
        cells = {
            (row["label"], row["joint"]): (row, p)
            for row, p in zip(rows, _adjusted(rows), strict=True)
        }
        whole = norms[(norms.task == task) & (norms["where"] == at)].to_dict("records")
        cells |= {
            (row["label"], "norm"): (row, p)
            for row, p in zip(whole, _adjusted(whole), strict=True)
        }
        lines = [
            (
                label,
                str(cells[label, joints[0]][0]["n"]),
                _cell(*cells[label, "norm"], _Notes()),
                *(_cell(*cells[label, joint], _Notes()) for joint in joints),
            )
            for label in labels[str(task)]
            if joints and (label, joints[0]) in cells
        ]
        if lines:
            title = f"{at} (first of the tasks: {task})"
            table = Table(title, ("method", "runs", "norm", *joints), tuple(lines))
            parts += [Heading(3, title), table]
    return parts


def _adjusted(rows: Iterable[Row]) -> list[float]:
    return holm([row["p"] for row in rows])


def _cell(row: Row, p: float, notes: _Notes, *, spelt: bool = False) -> str:
    """Value, interval, adjusted p; a letter for the reason where there is no value."""
    if pd.isna(row["value"]):
        return notes.mark(row["why_not"])
    if spelt:
        return str(row["where"])
    value = row["value"]
    if abs(value) < _ZERO and not row["unit"].startswith("squared"):
        value = 0.0
    text = _interval(value, row["low"], row["high"], share=row["signature"] in _SHARES)
    longest = _AT_MOST.search(row["where"])
    text += f" of {longest.group(1)}" if longest else ""
    if pd.notna(p):
        text += ", p < 0.001" if p < 0.001 else f", p {p:.2g}"
    return text


_SHARES = (
    "first subtask sacrificed",
    "hand as in isolation",
    "hands as the best corrective ones",
)
_ZERO = 1e-8  # what rounding leaves of a value that is 0


def _interval(value: float, low: float, high: float, *, share: bool) -> str:
    """``value ± half`` with two figures of the half; ``value [low, high]`` for shares."""
    if pd.isna(low):
        return f"{value:.3g}"
    if share:
        return f"{value:.2f} [{low:.2f}, {high:.2f}]"
    half = (high - low) / 2
    if half <= 1e-12 * max(1.0, abs(value)):
        return f"{value:.3g} ± 0"
    places = max(0, 1 - int(f"{half:.1e}".partition("e")[2]))
    return f"{value:.{places}f} ± {half:.{places}f}"
