"""Tasks: a start, a sequence of goals, and the sources of their numbers.

Tasks are read from TOML files, or made in Python. The shipped files are in the folder ``paper``;
users' files have the same keys.
"""

from __future__ import annotations

import html
import json
import math
import re
from collections.abc import Mapping
from dataclasses import fields
from functools import cache, cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import Field, ValidationError, ValidationInfo, model_validator

from coartic.errors import CoarticError, TaskError
from coartic.internal.arguments import checked_arguments
from coartic.internal.files import folder_named, write_output
from coartic.internal.limits import brief_value, real_array
from coartic.internal.text import Line, did_you_mean, plain, pluralize
from coartic.internal.toml_files import read_toml
from coartic.internal.validation import FileData, described_error, explain
from coartic.model import PAPER, PAPER_RADIUS, MotionModel
from coartic.robot import HANDS, MAX_LINKS, Array, Finite, Hand, Length, Robot

InitialPolicy = Literal["best-single-hand", "best-of-all"]
INITIAL_POLICIES: tuple[InitialPolicy, ...] = ("best-single-hand", "best-of-all")
LETTERS: dict[str, Hand] = {"L": "left", "R": "right"}
TASK_FOLDER = Path(__file__).parent / "paper"

MAX_GOALS = 256
MAX_NAME_LENGTH = 64
NAME_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9._-]*$"
"""Regular expression for names of suites, and for names of tasks that are not in a family. Such
names become names of files and parts of commands."""
_IN_FAMILY = r"^([a-z][a-z0-9-]*/v[1-9][0-9]?/)?"
TASK_PATTERN = _IN_FAMILY + NAME_PATTERN.removeprefix("^")
"""Regular expression for names of tasks, including the names of instances of a family."""
_ADDRESS = re.compile(_IN_FAMILY.removesuffix("?") + r"([di]|[0-9]{4}-)([0-9]{3,6})")
WITHOUT_REACH = "without reach"

Point = tuple[Finite, Finite]


def hands_of(letters: str) -> tuple[Hand, ...]:
    """Convert a hand sequence to the names of its hands: ``"RL"`` to ``("right", "left")``.

    Raises ValueError for any other letter.
    """
    try:
        return tuple(LETTERS[letter] for letter in letters)
    except (KeyError, TypeError):
        raise ValueError(
            f"hands is {brief_value(letters)}; it must be a sequence of L (left) and R (right), "
            "such as 'RRLR'"
        ) from None


def letters_of(hands: tuple[Hand, ...] | list[Hand]) -> str:
    """Convert names of hands to a hand sequence: ``("right", "left")`` to ``"RL"``."""
    return "".join(hand[0].upper() for hand in hands)


Split = Literal["development", "test", "fresh"]
SPLITS: dict[str, Split] = {"d": "development", "i": "test"}


class Address(NamedTuple):
    """Address of an instance of a family of random tasks (:mod:`coartic.tasks.families`)."""

    family: str
    """Name of the family with its version, such as ``two-armed/v1``."""
    stream: str
    """``d`` (development), ``i`` (test) or a year such as ``2027-`` (fresh). In the name of a task,
    the stream stands before the number of the instance."""
    number: int
    """Number of the instance, from 0."""

    @property
    def split(self) -> Split:
        """Split of the instance.

        - ``"development"``: to tune a method on;
        - ``"test"``: to report results on;
        - ``"fresh"``: to check a finished method on.
        """
        return SPLITS.get(self.stream, "fresh")

    def __str__(self) -> str:
        return f"{self.family}/{self.stream}{self.number:03d}"


def address_of(name: str) -> Address | None:
    """Parse the name of an instance, or return None for another form.

    The number is written with at least three digits, but without needless zeros: ``i017``, but not
    ``i0017``. Whether the family exists is not checked.

    Examples
    --------
    >>> address_of("two-armed/v1/i017")
    Address(family='two-armed/v1', stream='i', number=17)
    """
    parts = _ADDRESS.fullmatch(name)
    if parts is None:
        return None
    address = Address(parts[1].removesuffix("/"), parts[2], int(parts[3]))
    return address if str(address) == name else None  # i0017 would be the same as i017


class Provenance(FileData):
    """Source of the numbers of a field of a task (:attr:`.Task.provenance`)."""

    status: Literal["published", "inferred", "chosen"]
    """Whether the numbers are published in the paper, inferred from the paper, or chosen by the
    task's author."""
    source: Line
    """Where the numbers come from, in one line, such as a section or figure of the paper."""


class Start(FileData):
    """The starting configuration q_0 in the form of a task file; ``Task.q0`` is the array."""

    base: Point = (0.0, 0.0)
    """Centre of the base (in length units)."""
    left: Annotated[tuple[Finite, ...], Field(max_length=MAX_LINKS)]
    """Angles of the joints of the left arm (in rad), one for each link. The first angle is measured
    from +x, each other angle from the previous link."""
    right: Annotated[tuple[Finite, ...], Field(max_length=MAX_LINKS)]
    """Angles of the joints of the right arm, as for the left arm."""


class Task(FileData):
    """A sequence of goals to hit in order, each with one hand of the robot.

    :func:`load_task` reads a task from a file, or finds it by its name. New values cannot be
    assigned to the fields of a task. In Python a configuration ``q0=``, shape ``(dof,)``, can be
    passed instead of ``start``: ``Task(goals=[(3, 2), (4.5, 2)], q0=np.zeros(10))``.

    Source of the shipped tasks: paper, section *Experiments*. ``provenance`` contains the sources
    of the numbers.
    """

    name: Annotated[str, Field(pattern=TASK_PATTERN, max_length=MAX_NAME_LENGTH)] = "unnamed"
    """Name in commands, suites and tables, such as ``ascending`` or ``two-armed/v1/i017``."""
    title: Line = ""
    """Name in figures and tables; ``name`` if it is empty."""
    description: Line = ""
    """One sentence that describes the task in lists."""
    hands: Annotated[tuple[Hand, ...], Field(min_length=1, max_length=len(HANDS))] = HANDS
    """Hands that may hit goals. The robot has both arms in any case."""
    goals: Annotated[tuple[Point, ...], Field(min_length=1, max_length=MAX_GOALS)]
    """Goal centres x_g in the order in which they are to be hit (in length units)."""
    radius: Length = PAPER_RADIUS
    """θ^g: radius of every goal (in length units)."""
    locked_base: Annotated[tuple[Literal["x", "y"], ...], Field(max_length=2)] = ()
    """Base coordinates that cannot move."""
    initial_hands: str = "best-single-hand"
    """Hand sequence of trial 0, such as ``"RRRR"``, or a policy that finds one by trials with only
    the corrective process: ``"best-single-hand"`` or ``"best-of-all"``."""
    start: Start
    """Configuration in which every trial begins (table ``[start]`` of the file). By default the
    base is at (0, 0) and the arms are straight along +x."""
    robot: Robot = Robot()
    """Geometry of the robot if it differs from the paper's (table ``[robot]`` of the file)."""
    provenance: dict[str, Provenance] = Field(default_factory=dict)
    """Dict that maps the names of fields to the source and status of their numbers. The numbers of
    a field without an entry were chosen by the task's author."""

    @cached_property
    def q0(self) -> Array:
        """Starting configuration, shape ``(dof,)``, in length units and rad (read-only)."""
        q = np.array([*self.start.base, *self.start.left, *self.start.right], dtype=np.float64)
        q.setflags(write=False)
        return q

    @cached_property
    def goal_array(self) -> Array:
        """Goal centres, x and y, shape ``(G, 2)``, in length units (read-only)."""
        goals = np.array(self.goals, dtype=np.float64)
        goals.setflags(write=False)
        return goals

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Task:
        """Return a copy with the changed fields of ``update``, without a check.

        With ``deep`` the result is a deep copy. The arrays ``q0`` and ``goal_array`` of the copy
        are computed from its own fields.
        """
        copied = super().model_copy(update=update, deep=deep)
        for name in ("q0", "goal_array"):
            copied.__dict__.pop(name, None)
        return copied

    @property
    def initial_is_policy(self) -> bool:
        """True if ``initial_hands`` names a policy that finds the hands, not a hand sequence."""
        return self.initial_hands in INITIAL_POLICIES

    @property
    def label(self) -> str:
        """Title of the task, or its name if the title is empty."""
        return self.title or self.name

    @property
    def family(self) -> str | None:
        """Family with its version, such as ``two-armed/v1``, if the task is named as an instance.

        Otherwise it is None.
        """
        address = address_of(self.name)
        return address and address.family

    @property
    def split(self) -> Split | None:
        """Split of an instance of a family: ``"development"``, ``"test"`` or ``"fresh"``.

        The split follows from the form of the task's name. It is None if the name is not of the
        form of an instance.
        """
        address = address_of(self.name)
        return address and address.split

    @property
    def reconstructed(self) -> tuple[str, ...]:
        """Names of the fields whose numbers were inferred from the paper, such as ``"goals"``."""
        return tuple(k for k, entry in self.provenance.items() if entry.status == "inferred")

    @model_validator(mode="before")
    @classmethod
    def _with_start(cls, content: Any) -> Any:
        """Return the content of a task with the key ``start``.

        - Content that contains the key ``start``, or is not a dict, is returned unchanged.
        - If the content contains the key ``q0``, shape ``(dof,)``, ``start`` is computed from
          ``q0``.
        - Otherwise ``start`` is set: the base is at (0, 0), and both arms are straight along +x.

        Raises a validation error if the content contains both keys, or if ``q0`` is wrong.
        """
        if not isinstance(content, dict):
            return content
        if {"start", "q0"} <= content.keys():
            raise described_error("q0 and start both say where a trial begins: pass only one")
        if "start" in content:
            return content
        robot = content.get("robot", Robot())
        try:
            robot = robot if isinstance(robot, Robot) else Robot(**robot)
        except (TypeError, ValueError):
            robot = Robot()  # the wrong table [robot] has its own error
        content = dict(content)
        try:
            q = real_array("q0", content.pop("q0", np.zeros(robot.dof)))
        except ValueError as error:
            raise described_error(str(error)) from None
        if q.shape != (robot.dof,):
            raise described_error(f"q0 has shape {q.shape}; it must be ({robot.dof},)")
        if not np.isfinite(q).all():
            raise described_error(f"q0 is {brief_value(q.tolist())}; all entries must be finite")
        left, right = (tuple(q[robot.joints(hand)].tolist()) for hand in HANDS)
        content["start"] = Start(base=tuple(q[:2].tolist()), left=left, right=right)
        return content

    @model_validator(mode="after")
    def _is_consistent(self, info: ValidationInfo) -> Task:
        for key, values in (("hands", self.hands), ("locked_base", self.locked_base)):
            if len(set(values)) < len(values):
                raise described_error(f"{key} has a duplicate entry: {', '.join(values)}")
        for hand in HANDS:
            angles, joints = getattr(self.start, hand), len(self.robot.arm(hand).links)
            if len(angles) != joints:
                raise described_error(
                    f"start.{hand} has {len(angles)} joint angles, but the {hand} arm has {joints} "
                    "joints"
                )
            largest = max(angles, key=abs)
            if abs(largest) > 2 * math.pi:
                raise described_error(
                    f"start.{hand} has the angle {largest:g}; angles must be in rad, from -2π to "
                    f"2π. Did you mean {largest:g}° = {math.radians(largest):.3f}?"
                )
        for key in self.provenance:
            if key not in Task.model_fields:
                meant = did_you_mean(key, _all_keys())
                raise described_error(f"provenance.{key} is not a key of a task{meant}")
        if not self.initial_is_policy:
            try:
                check_hands(self, self.initial_hands)
            except ValueError:
                letters, count = letters_of(sorted(self.hands)), len(self.goals)
                raise described_error(
                    f"initial_hands is {brief_value(self.initial_hands)}; it must have "
                    f"{pluralize(count, 'letter')} {' or '.join(letters)}, such as "
                    f"{(letters * count)[:count]!r}, or be {' or '.join(INITIAL_POLICIES)}"
                ) from None
        # With any model the corrective process ends within the radius; check_task is stricter.
        if info.context != WITHOUT_REACH and (far := _out_of_reach(self, self.radius)) is not None:
            raise described_error(far)
        return self

    @checked_arguments
    def save(self, path: str | Path, *, replace: bool = False) -> None:
        """Write the task as a TOML file.

        If ``replace`` is True, an existing file is overwritten. Raises CoarticError if the name
        does not end in ``.toml``, if the file exists and ``replace`` is False, or if the file
        cannot be written.
        """
        file = folder_named(path, "the name of a task's file")
        if file.suffix != ".toml":
            raise CoarticError(
                f"{file} cannot be written: the name of a task file must end in .toml"
            )
        write_output(file, task_text(self).encode(), replace=replace)

    def _repr_html_(self) -> str:
        """Return the HTML that a notebook shows: base, arms and numbered goals at the start."""
        arms = [self.robot.joint_positions(self.q0, hand) for hand in HANDS]
        lines = [(arms[0], "grey"), (arms[1], "currentColor")]
        corners = self.robot.base_outline(self.q0)
        lines.append((np.concatenate([corners, corners[:1]]), "currentColor"))
        around = np.concatenate([self.goal_array, *(points for points, _ in lines)])
        (left, low), (right, high) = around.min(axis=0) - 0.5, around.max(axis=0) + 0.5

        def coordinates(points: Array) -> str:
            return " ".join(f"{x:.3f},{high - y:.3f}" for x, y in points - [left, 0.0])

        marks = [
            f'<polyline points="{coordinates(points)}" fill="none" stroke="{colour}" '
            'stroke-width="0.06"/>'
            for points, colour in lines
        ]
        for number, goal in enumerate(self.goal_array, 1):
            (x, y), radius = coordinates(goal[None]).split(","), self.radius
            marks.append(
                f'<circle cx="{x}" cy="{y}" r="{radius:g}" fill="none" stroke="#009e73" '
                f'stroke-width="0.04"/><text x="{x}" y="{y}" dy="-0.2" font-size="0.35" '
                f'text-anchor="middle" fill="currentColor">{number}</text>'
            )
        caption = html.escape(repr(self))
        return (
            f'<figure><svg viewBox="0 0 {right - left:.3f} {high - low:.3f}" width="420" '
            f'role="img" aria-label="{caption}">{"".join(marks)}</svg>'
            f"<figcaption>{caption}</figcaption></figure>"
        )


def in_world(task: Task, model: MotionModel) -> Task:
    """Return the task with the goals' radius of a motion model; the task itself if that is equal.

    Examples
    --------
    >>> from coartic import load_task
    >>> in_world(load_task("ascending"), MotionModel(radius=0.05)).radius
    0.05
    """
    if model.radius is None or model.radius == task.radius:
        return task
    return task.model_copy(update={"radius": float(model.radius)})


def check_hands(task: Task, hands: str) -> str:
    """Check a hand sequence, such as ``"RRLR"``, and return it unchanged.

    Raises ValueError if ``hands`` is not a string with one letter for each goal, or if a letter is
    not that of one of the task's hands.
    """
    allowed = letters_of(sorted(task.hands))
    fits = isinstance(hands, str) and len(hands) == len(task.goals)
    if not fits or not set(hands) <= set(allowed):
        raise ValueError(
            f"hands {brief_value(hands)} do not fit task {task.name!r}: they must be a string with "
            f"{' or '.join(allowed)} for each of {pluralize(len(task.goals), 'goal')}"
        )
    return hands


def _out_of_reach(task: Task, tolerance: float) -> str | None:
    """Return a sentence on the first goal that is out of reach, or None.

    A goal is out of reach if no hand of the task can come within ``tolerance`` (in length units) of
    its centre. It is also out of reach if the hand that ``initial_hands`` names for the goal cannot
    come that near.
    """
    named = None if task.initial_is_policy else hands_of(task.initial_hands)
    for index, goal in enumerate(task.goals):
        excess = {hand: beyond_reach(task, hand, goal, tolerance) for hand in task.hands}
        problem = (
            f"goals[{index}] ({goal[0]:g}, {goal[1]:g}) is out of reach with the base locked "
            f"in {' and '.join(task.locked_base)}"
        )
        if all(value > 0 for value in excess.values()):
            return f"{problem}: {min(excess.values()):.3g} too far"
        if named is not None and excess[named[index]] > 0:
            return (
                f"{problem} for the {named[index]} hand that initial_hands "
                f"{task.initial_hands!r} gives it: {excess[named[index]]:.3g} too far"
            )
    return None


def beyond_reach(task: Task, hand: Hand, goal: Point, tolerance: float) -> float:
    """Return how far a goal is out of a hand's reach (in length units).

    The result is at most 0 if the hand can come within ``tolerance`` of the goal's centre.
    Otherwise it is the smallest possible distance of the hand from the centre, minus ``tolerance``.
    The hand can be at any distance from its shoulder between the two distances of
    :meth:`.Robot.reach`, and base coordinates that are not locked can take any value.
    """
    arm = task.robot.arm(hand)
    near, far = task.robot.reach(hand)
    dx = goal[0] - task.start.base[0] - arm.shoulder_x if "x" in task.locked_base else 0.0
    dy = goal[1] - task.start.base[1] - arm.shoulder_y if "y" in task.locked_base else 0.0
    distance = math.hypot(dx, dy)
    # A base that is free in a coordinate can always move away from the goal.
    inside = near - distance if len(task.locked_base) == 2 else 0.0
    return max(distance - far, inside) - tolerance


def check_task(task: Task) -> Task:
    """Check that all goals of a task can be reached, and return the task.

    The paper's corrective process converges when the hand is within a tenth of the radius of a
    goal's centre. Raises TaskError if no hand of the task can come that near to a goal, or if the
    hand that ``initial_hands`` names for a goal cannot.
    """
    _, tolerance = PAPER.tolerances(task.radius)
    if (problem := _out_of_reach(task, tolerance)) is not None:
        raise TaskError(f"task {task.name!r}: {problem}")
    return task


def read_task(path: Path) -> Task:
    """Read a task from its TOML file.

    If the key ``name`` is missing, the name of the task is the name of the file without its suffix.
    Raises TaskError, which names the file, if the file is not a task.
    """
    return parse_task({"name": path.stem, **read_toml(path, error=TaskError)}, str(path))


@cache
def shipped_tasks() -> dict[str, Task]:
    """Return a dict that maps names to the tasks that come with the package.

    The tasks are in the paper's order. The dict is cached: do not change it.
    """
    return {task.name: task for task in map(read_task, sorted(TASK_FOLDER.glob("*.toml")))}


@checked_arguments
def parse_task(content: dict[str, Any], source: str, *, reach: bool = True) -> Task:
    """Make a task from the content of a task file.

    Parameters
    ----------
    content : dict
        The content, as ``tomllib`` reads it from a TOML file.
    source : str
        Name of the content in error messages, such as the path of the file.
    reach : bool
        True to refuse a task with a goal that cannot be hit by any of its hands, or by the hand
        that ``initial_hands`` names for the goal.

    Returns
    -------
    Task
        The task, checked.

    Raises
    ------
    TaskError
        The content is not that of a task, or a goal is out of reach.
    """
    try:
        return Task.model_validate(content, context=None if reach else WITHOUT_REACH)
    except ValidationError as error:
        raise TaskError(f"{plain(source)}: {explain(error, _all_keys())}") from None


def _all_keys() -> list[str]:
    """Return the keys of task files, including the keys in tables, without ``q0``."""
    robot = [field.name for field in fields(Robot)]
    return [*Task.model_fields, *Start.model_fields, *robot, *Provenance.model_fields]


def task_text(task: Task) -> str:
    """Return the content of a task's TOML file."""
    content = task.model_dump(mode="json")
    tables = {key: content.pop(key, {}) for key in ("start", "robot", "provenance")}
    if task.robot == Robot():
        del tables["robot"]
    lines = [f"{key} = {_toml_value(value)}" for key, value in content.items()]
    for key, table in tables.items():
        if table:
            lines += [
                "",
                f"[{key}]",
                *(f"{k} = {_toml_value(v)}" for k, v in table.items()),
            ]
    return "\n".join(lines) + "\n"


def _toml_value(value: Any) -> str:
    """Return a value in the notation of TOML.

    The value is a string of printable characters, a number, a list without dicts, or a dict that
    maps bare keys to such values. A dict becomes an inline table; any other value is written as in
    JSON.
    """
    if isinstance(value, dict):
        return (
            "{ " + ", ".join(f"{key} = {_toml_value(item)}" for key, item in value.items()) + " }"
        )
    return json.dumps(value, ensure_ascii=False)
