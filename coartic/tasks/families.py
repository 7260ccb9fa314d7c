"""Families of random tasks: distributions of tasks, and instances that never change.

A family is defined by a file. The files of the shipped families are ``families/NAME.vN.toml``. A
file contains the distributions from which the number and the positions of the goals, the links of
the arms, the base and the start are drawn. The file of a released family does not change; a changed
family gets a new version.

An instance is a task with a name such as ``two-armed/v1/i017``. It depends only on this name and on
the file of the family, because its numbers come from a counter-based random number generator
(:mod:`coartic.tasks.philox`). The key of the generator is a hash of family, version and stream; its
counter contains the number of the instance. Streams are ``d`` (development, to tune on), ``i``
(test, to report on) and years such as ``2027-`` (fresh instances, to check a finished method on).

An instance is drawn in two stages. The *structure* (number of goals and links, kind of base,
distribution of the starting postures, whether a line of goals is horizontal or vertical) is drawn
once. Positions and angles are drawn again until they break no rule (rejection sampling,
:func:`broken_rule`). Rejection therefore does not change the frequencies of the structures.
Positions and angles are drawn as integers, in thousandths. Geometric rules compare integers; the
other rules use the compiled kernels, which need only IEEE arithmetic
(:mod:`coartic.motion.kernels.trigonometry`). No rejection depends on a machine's library.
"""

from __future__ import annotations

import itertools
import re
import sys
from collections import Counter
from collections.abc import Iterable
from contextlib import suppress
from functools import cache, lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, ValidationError
from pydantic_core import PydanticCustomError

from coartic.errors import NotApplicableError, TaskError
from coartic.internal.arguments import checked_arguments
from coartic.internal.limits import MAX_CELLS, check_limits
from coartic.internal.text import BACKWARDS, Line, plain, pluralize, unknown
from coartic.internal.toml_files import read_toml
from coartic.internal.validation import FileData, described_error, explain
from coartic.motion.doors import move
from coartic.motion.initial_hands import ranked_sequences, search_initial_hands
from coartic.robot import HANDS, Hand, Robot
from coartic.tasks.philox import Draws, hash_key
from coartic.tasks.task import (
    INITIAL_POLICIES,
    MAX_GOALS,
    SPLITS,
    Address,
    InitialPolicy,
    Split,
    Task,
    address_of,
    parse_task,
)

FAMILY_FOLDER = Path(__file__).parent / "families"
COUNTS: dict[Split, int] = {"development": 1000, "test": 10, "fresh": 10}
"""Dict that maps each split to its default number of instances. The first is instance 0."""
MAX_ATTEMPTS = 10_000
"""Largest number of drafts of one instance (:func:`instance_of`)."""
Base = Literal["free", "rail", "locked"]
LOCKED: dict[Base, tuple[Literal["x", "y"], ...]] = {
    "free": (),
    "rail": ("y",),
    "locked": ("x", "y"),
}
"""Base coordinates that cannot move, for each kind of base."""
_PARTS = 1000  # parts of a length unit, of a rad, of 1
_STRUCTURE, _GEOMETRY = 0, 1  # word of the counter, by what is drawn
_RANGE = re.compile(r"(.+/)([^/]+)\.\.([^/]+)")


def _in_thousandths(value: float) -> int:
    """Return a number in thousandths: 300 for 0.3.

    Raises a validation error unless it is a finite number with at most three decimals.
    """
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not is_number or not abs(value * _PARTS) <= sys.float_info.max:
        raise PydanticCustomError("finite", "should be a finite number")
    if round(value * _PARTS) / _PARTS != value:
        raise described_error(f"{value} should have at most three decimals")
    return round(value * _PARTS)


Thousandths = Annotated[int, BeforeValidator(_in_thousandths)]
"""Type of a length, an angle or a ratio: a number with at most three decimals, which is stored as
an integer, in thousandths."""


def _in_order(limits: tuple[int, int]) -> tuple[int, int]:
    """Check that the lower number of a range comes first, and return the range."""
    if limits[0] > limits[1]:
        raise PydanticCustomError("order", "should have the lower number first")
    return limits


def _as_share(limits: tuple[int, int]) -> tuple[int, int]:
    """Check that a range is within 0 to 1, and return it."""
    if not 0 <= limits[0] <= limits[1] <= _PARTS:
        raise PydanticCustomError("share", "should be from 0 to 1")
    return limits


_ordered = AfterValidator(_in_order)
Range = Annotated[tuple[Thousandths, Thousandths], _ordered]
"""Type of a range: the lowest and the highest value. A number that is drawn from a range is one of
these values or of the thousandths between them, with equal probabilities."""
_GoalsCount = Annotated[int, Field(strict=True, ge=2, le=MAX_GOALS)]
_PerArm = Annotated[int, Field(strict=True, ge=3, le=8)]
_Bases = tuple[Base, ...]


class _Region(FileData):
    """Region of the goals of a family.

    Without a line of goals, the goals of an instance are drawn in a box, which is itself drawn in
    the region. Goals on a line are in the region, but not in a box.
    """

    x: Range
    """Lowest and highest x (in length units). At the start the base is at the origin."""
    y: Range
    """Lowest and highest y (in length units)."""
    scale: Annotated[Range, AfterValidator(_as_share)] = (_PARTS, _PARTS)
    """Smallest and largest ratio of the sides of the box to the sides of the region."""


class _Alignment(FileData):
    """Goals on a horizontal or vertical line.

    If there are three or more goals, one goal, which is neither the first nor the last, is off the
    line.
    """

    steps: Range
    """Smallest and largest distance from goal to goal along the line (in length units)."""
    off: Range
    """Smallest and largest distance of the goal that is off the line from the line (in length
    units). It is drawn on either side of the line with equal probability."""


class Posture(FileData):
    """Distribution of the posture of an arm at the start."""

    first: Range
    """Smallest and largest angle of the first joint, measured from +x (in rad)."""
    others: Range
    """Smallest and largest angle of each other joint, measured from the link before it (in rad)."""


_PARKED = Posture(first=(0, 0), others=(0, 0))


class Postures(FileData):
    """Distributions of the postures of both arms at the start.

    An arm without an entry is straight along +x.
    """

    left: Posture = _PARKED
    """The left arm."""
    right: Posture = _PARKED
    """The right arm."""


class Family(FileData):
    """Distributions from which tasks are drawn, and rules that each instance obeys.

    The units below are those of the file. Lengths, angles and shares are stored as integers, in
    thousandths of these units: 300 for 0.3.
    """

    name: str
    """Name with the version, such as ``two-armed/v1``."""
    title: Line
    """Name in figures and tables."""
    description: Line
    """One sentence that describes the family in lists."""
    hands: tuple[Hand, ...] = HANDS
    """Hands that may hit goals."""
    goals: Annotated[tuple[_GoalsCount, _GoalsCount], _ordered]
    """Smallest and largest number of goals; each number is equally likely."""
    links: Annotated[tuple[_PerArm, _PerArm], _ordered]
    """Smallest and largest number of links of each arm. Both arms of an instance have the same
    number. All links have the same length (to a thousandth)."""
    reach: Thousandths = 4 * _PARTS
    """Sum of the lengths of the links of each arm (in length units). The default is the paper's."""
    base: Annotated[_Bases, Field(min_length=1)]
    """Kinds of base, equally likely: ``"free"``, ``"rail"`` (the base cannot move in y) or
    ``"locked"``. Each instance has one of them."""
    restrictions: _Bases = ()
    """Further kinds of base with which the corrective process completes each instance as well."""
    radius: Thousandths = 100
    """Radius of every goal (in length units)."""
    region: _Region
    """Region of the goals: table ``[region]``."""
    line: _Alignment | None = None
    """Goals on a line: table ``[line]``. Without this table goals are scattered in the region."""
    start: Annotated[tuple[Postures, ...], Field(min_length=1)]
    """Distributions of the postures at the start: tables ``[[start]]``. Each instance is drawn from
    one of them; all are equally likely."""
    initial_hands: InitialPolicy = INITIAL_POLICIES[0]
    """Policy that finds the hand sequence of trial 0, ``"best-single-hand"`` or ``"best-of-all"``.
    The ``initial_hands`` of an instance are the sequence that the policy found."""
    apart: Thousandths = 300
    """Smallest distance between the centres of two goals (in length units)."""
    clear: Thousandths = 200
    """Smallest distance of a hand at the start from the rim of a goal (in length units). It holds
    for each of ``hands``."""
    within: Thousandths = 950
    """Largest distance of a goal from the shoulder of each of ``hands`` at the start, as a fraction
    of ``reach``. Coordinates in which the base can move do not count in the distance."""
    bent: Thousandths = 200
    """Angle (in rad). At the start, the arm of each of ``hands`` has a joint, other than the first,
    that is bent by at least this angle."""


def draft(family: Family, address: Address, attempt: int) -> Task:
    """Draw the task of an instance in one attempt, without checking the family's rules.

    The task may break rules of the family (:func:`broken_rule`), and goals may be out of reach.
    ``initial_hands`` of the task is the policy of the family, not a hand sequence. Equal arguments
    give equal tasks.

    Parameters
    ----------
    family : Family
    address : Address
        The instance.
    attempt : int
        Number of the attempt, from 0.
    """
    key = hash_key(f"coartic {family.name}/{address.stream}")
    structure = Draws(key, address.number, 0, _STRUCTURE)
    count, links = structure.integer(*family.goals), structure.integer(*family.links)
    base, postures = structure.one_of(family.base), structure.one_of(family.start)
    vertical = structure.one_of((False, True))
    draws = Draws(key, address.number, attempt, _GEOMETRY)
    goals = draw_goals(draws, family, count, vertical)
    # Links have the same length; if that is impossible, the first ones are a thousandth longer.
    length, longer = divmod(family.reach, links)
    lengths = [(length + (k < longer)) / _PARTS for k in range(links)]
    start: dict[str, Any] = {}
    for hand, posture in (("left", postures.left), ("right", postures.right)):
        ranges = [posture.first, *[posture.others] * (links - 1)]
        start[hand] = [draws.integer(*limits) / _PARTS for limits in ranges]
    content = {
        "name": str(address),
        "hands": list(family.hands),
        "goals": [[x / _PARTS, y / _PARTS] for x, y in goals],
        "radius": family.radius / _PARTS,
        "locked_base": list(LOCKED[base]),
        "initial_hands": family.initial_hands,
        "start": start,
        "robot": {"left_links": lengths, "right_links": lengths},
    }
    return parse_task(content, f"family {family.name}", reach=False)


def draw_goals(draws: Draws, family: Family, count: int, vertical: bool) -> list[tuple[int, int]]:
    """Draw goals, and return their x and y in thousandths of a length unit.

    - Family without a line: the goals are drawn in a box, which is itself drawn in the region.
    - Family with a line: the goals are on a line, possibly outside the region. If there are more
      than two goals, one goal, which is neither the first nor the last, is moved off the line by
      the distance ``off``.

    Parameters
    ----------
    draws : Draws
    family : Family
    count : int
        Number of goals.
    vertical : bool
        True if the line is vertical, False if it is horizontal.
    """
    region, line = family.region, family.line
    share, sides = draws.integer(*region.scale), []
    for low, high in (region.x, region.y):
        length = (high - low) * share // _PARTS
        start = draws.integer(low, high - length)
        sides.append((start, start + length))
    scattered = [(draws.integer(*sides[0]), draws.integer(*sides[1])) for _ in range(count)]
    if line is None:
        return scattered
    along, across = (region.y, region.x) if vertical else (region.x, region.y)
    start, level = draws.integer(*along), draws.integer(*across)
    direction = draws.one_of((-1, 1))
    steps = [start]
    for _ in range(count - 1):
        steps.append(steps[-1] + direction * draws.integer(*line.steps))
    levels = [level] * count
    if count > 2:
        moved_goal = draws.integer(1, count - 2)
        levels[moved_goal] += draws.one_of((-1, 1)) * draws.integer(*line.off)
    return [*(zip(levels, steps, strict=True) if vertical else zip(steps, levels, strict=True))]


def broken_rule(family: Family, task: Task) -> str | None:
    """Return the name of the first rule that a draft breaks, or None.

    The names of the rules, in the order in which they are checked, and how a draft breaks them:

    - ``outside``: a goal is outside the region.
    - ``overlap``: two goals are too close to each other.
    - ``reach``: a goal is too far from a shoulder, with the base of the draft or of a restriction.
    - ``straight``: an arm is straight at the start, or nearly.
    - ``start-hit``: a hand is in a goal at the start, or close to one.
    - ``corrective``: the policy of the task finds no hand sequence with which the corrective
      process on its own completes the task; or this sequence fails with the base of a restriction;
      or there are more than 4096 sequences to try.

    The last four rules consider only the hands of the family.
    """
    goals = [(_in_thousandths(x), _in_thousandths(y)) for x, y in task.goals]
    (left, right), (low, high) = family.region.x, family.region.y
    if not all(left <= x <= right and low <= y <= high for x, y in goals):
        return "outside"
    for a, b in itertools.combinations(goals, 2):
        if (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 < family.apart**2:
            return "overlap"
    restricted = [LOCKED[base] for base in family.restrictions]
    farthest = family.reach * family.within
    for locked in (task.locked_base, *restricted):
        for hand, goal in itertools.product(family.hands, goals):
            arm = task.robot.arm(hand)
            shoulder = [_in_thousandths(arm.shoulder_x), _in_thousandths(arm.shoulder_y)]
            square = sum((goal[axis] - shoulder[axis]) ** 2 for axis in map("xy".index, locked))
            if square * _PARTS**2 > farthest**2:
                return "reach"
    for hand in family.hands:
        _, *bends = task.start.left if hand == "left" else task.start.right
        if max(abs(_in_thousandths(angle)) for angle in bends) < family.bent:
            return "straight"
    near = (family.radius + family.clear) / _PARTS
    for hand, centre in itertools.product(task.hands, task.goals):
        if move(task.robot, task.q0, task.q0, hand, centre, near).hit:
            return "start-hit"
    try:
        hands, _ = search_initial_hands(task)
    except NotApplicableError:
        return "corrective"
    for locked in restricted:
        restricted_task = task.model_copy(update={"locked_base": locked})
        ((_, reward, *_),) = ranked_sequences(restricted_task, [hands])
        if reward is None:
            return "corrective"
    return None


def instance_of(family: Family, address: Address) -> Task:
    """Return the instance at an address: the first draft that breaks no rule.

    Unlike a draft, the returned task has a title, a description and a provenance, and its
    ``initial_hands`` are a hand sequence with which the corrective process completes the task.
    Raises TaskError if each of the first 10,000 drafts breaks a rule of the family.
    """
    broken = Counter[str]()
    for attempt in range(MAX_ATTEMPTS):
        task = draft(family, address, attempt)
        if (rule := broken_rule(family, task)) is None:
            break
        broken[rule] += 1
    else:
        rule, times = broken.most_common(1)[0]
        raise TaskError(
            f"{address}: {MAX_ATTEMPTS:,} draws of family {family.name!r} broke a rule, {times:,} "
            f"of them {rule!r}"
        )
    name = str(address)
    short = name.rpartition("/")[2]
    source = f"drawn: family {family.name}, instance {short}"
    chosen = ["goals", "start", "initial_hands"]
    chosen += ["locked_base"] if task.locked_base else []
    chosen += ["robot"] if task.robot != Robot() else []
    base = {0: "a free base", 1: "the base on a rail", 2: "the base locked"}[len(task.locked_base)]
    links = len(task.robot.left_links)
    content = task.model_dump() | {
        "title": f"{family.title} {short}",
        "description": f"{pluralize(len(task.goals), 'goal')}, {links} links an arm, {base}: drawn "
        f"from family {family.name}.",
        "initial_hands": search_initial_hands(task)[0],
        "provenance": {key: {"status": "chosen", "source": source} for key in chosen},
    }
    return parse_task(content, name)


@lru_cache(maxsize=4096)
def instance(name: str) -> Task:
    """Return the instance of a family (a task) with a given name.

    Examples of names are ``two-armed/v1/i017`` and, for the family of a file,
    ``mine.v1.toml/i017``. The last 4096 instances are cached (LRU). Raises TaskError if the family
    is unknown or cannot be used, or if the name is not of this form.
    """
    family, _, short = name.rpartition("/")
    address = address_of(f"{load_family(family).name}/{short}" if is_file(family) else name)
    if address is None:
        if few_digits := re.fullmatch(r"([di]|[0-9]{4}-)([0-9]{1,2})", short):
            right = f"{family}/{few_digits[1]}{int(few_digits[2]):03d}"
            raise TaskError(f"{name!r}: the number must have three digits: {right}")
        raise TaskError(
            f"{name!r} is not an instance of a family. Write for example two-armed/v1/i017 (test), "
            "two-armed/v1/d017 (development) or two-armed/v1/2027-017 (fresh, of the year 2027)."
        )
    return instance_of(load_family(family), address)


def is_file(family: str) -> bool:
    """Return whether a family's name is a file name, which ends in ``.toml``."""
    return family.endswith(".toml")


def named_by(text: str) -> list[str]:
    """List the names of the instances in a range such as ``two-armed/v1/i000..i039``.

    Both ends are included. If ``text`` is not a range, but for example the name or the file of a
    task, the only entry of the list is ``text`` itself, unchecked. Raises TaskError for a range
    that is malformed, goes backwards or has more than 10,000 instances, and for a range in a family
    file that cannot be used. For any other family it is not checked whether the family exists.

    Examples
    --------
    >>> named_by("two-armed/v1/i008..i010")
    ['two-armed/v1/i008', 'two-armed/v1/i009', 'two-armed/v1/i010']
    """
    if "/" not in text or ".." not in text.rpartition("/")[2] or text.endswith(".toml"):
        return [text]
    written = _RANGE.fullmatch(text)
    start = written[1] if written else ""
    family = f"{load_family(start[:-1]).name}/" if is_file(start[:-1]) else start
    ends = [address_of(family + end) for end in written.groups()[1:]] if written else [None]
    low, high = ends[0], ends[-1]
    if low is None or high is None or low.stream != high.stream:
        raise TaskError(
            f"{text!r} is not a range of instances. Write for example two-armed/v1/i000..i039, "
            "or the path of a task file of your own, which ends in .toml."
        )
    if high.number < low.number:
        raise TaskError(BACKWARDS.format(text))
    if high.number - low.number >= MAX_CELLS:
        raise TaskError(f"{text!r} names more than {MAX_CELLS:,} instances")
    numbers = range(low.number, high.number + 1)
    return [str(low._replace(family=start[:-1], number=number)) for number in numbers]


def shipped_families() -> dict[str, Family]:
    """Return a new dict that maps names, such as ``two-armed/v1``, to the shipped families."""
    families = map(read_family, sorted(FAMILY_FOLDER.glob("*.v*.toml")))
    return {family.name: family for family in families}


def own_families(paths: Iterable[Path]) -> dict[str, Family]:
    """Read families from files, and return a dict that maps their names to the families.

    Raises TaskError for a file that cannot be used, and for a name that another of the files, or a
    shipped family, has as well.
    """
    families: dict[str, Family] = {}
    for path in paths:
        family = read_family(path)
        if family.name in families or family.name in shipped_families():
            raise TaskError(f"{path}: family {family.name!r} exists already; rename the file")
        families[family.name] = family
    return families


def load_family(name: str) -> Family:
    """Return the family with a given name, or the family of a file.

    The name of a shipped family includes the version, as in ``two-armed/v1``. The family of a file
    is cached: later changes of the file have no effect in the same process. Raises TaskError if the
    family does not exist or cannot be used.
    """
    if is_file(name):
        return read_family(Path(name))
    shipped = shipped_families()
    if name not in shipped:
        raise TaskError(unknown("family", name, shipped))
    return shipped[name]


def is_family(name: str) -> bool:
    """Return whether a string names a shipped family or the file of a family.

    A ``.toml`` file is the file of a family if it can be read and contains the key ``region``.
    """
    with suppress(TaskError):
        return name in shipped_families() or (
            is_file(name) and "region" in read_toml(name, error=TaskError)
        )
    return False


@cache
def read_family(path: Path) -> Family:
    """Read a family from its TOML file, and cache the family.

    The name of the family comes from the name of the file: ``two-armed.v1.toml`` is family
    ``two-armed/v1``. Raises TaskError if the file cannot be read or is not a family.
    """
    content, name = read_toml(path, error=TaskError), "/".join(path.stem.rsplit(".", 1))
    if "name" in content:
        raise TaskError(f"{path}: name is an unknown key; the name of the file names a family")
    try:
        family = Family.model_validate(content | {"name": name})
    except ValidationError as error:
        keys = [*Family.model_fields, *_Region.model_fields, *_Alignment.model_fields]
        raise TaskError(f"{plain(str(path))}: {explain(error, keys)}") from None
    if address_of(f"{name}/i000") is None:
        raise TaskError(f"{path}: the name of a family's file must have the form NAME.v1.toml")
    return family


@checked_arguments
def instance_names(
    family: str, split: Split, count: int | None = None, year: int | None = None
) -> list[str]:
    """List the names of the first instances of a split of a family.

    Parameters
    ----------
    family : str
        Name of a shipped family, or path of a family's file.
    split : {"development", "test", "fresh"}
    count : int, optional
        Number of instances, from instance 0; by default 1000 for development and 10 otherwise.
    year : int, optional
        Year of fresh instances, from 1000 to 9999; None for the other splits.

    Returns
    -------
    list of str
        Names such as ``two-armed/v1/d000``, in the order of the instances.

    Raises
    ------
    ValueError
        An argument has a wrong type, the split is unknown, ``count`` is not from 1 to 10,000, or
        ``year`` does not fit the split.
    TaskError
        The family is unknown or cannot be used.
    """
    load_family(family)
    if (year is None) == (split == "fresh"):
        raise ValueError(
            f"year is {year!r}; fresh instances need a year, such as 2027, and other instances None"
        )
    if year is not None:
        check_limits("year", year, 1000, 9999)
    count = COUNTS[split] if count is None else count
    check_limits("count", count, 1, MAX_CELLS)
    streams = {name: stream for stream, name in SPLITS.items()} | {"fresh": f"{year}-"}
    return [str(Address(family, streams[split], number)) for number in range(count)]
