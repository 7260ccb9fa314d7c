"""Families of random tasks: distributions as data, and instances that never change.

A family is a file, ``families/NAME.vN.toml``: how many goals, where, for which hands, arms and
base, from which start; once released, it is not changed, and a change is a new version. An
instance is a task by the name ``two-armed/v1/i017``, and a function of file and name alone: numbers
come from a counter-based generator (:mod:`coartic.tasks.philox`) whose key is the hash of family,
version and stream and whose counter has the number of the instance. Streams are ``d`` (development:
to tune on), ``i`` (test: to report on) and years (``2027-``: fresh ones).

What is drawn once is the structure: how many goals and links, the base, the kind of start. Places
and angles are drawn again until :func:`broken_rule` finds none, so that rejection leaves the shares
of structures alone. They are whole thousandths from the start. Geometric rules compare integers;
the others ask the compiled kernels, which use IEEE arithmetic alone
(:mod:`coartic.motion.trigonometry`): no rejection depends on a machine's library.
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
from coartic.internal.limits import MOST_CELLS, check_limits
from coartic.internal.text import Line, counted, plain, unknown
from coartic.internal.toml_files import read_toml
from coartic.internal.validation import FileData, explain, sentence_error
from coartic.motion.movement import move
from coartic.motion.trial import ranked_sequences, search_initial_hands
from coartic.robot import HANDS, Hand, Robot
from coartic.tasks.philox import Draws, hash_key
from coartic.tasks.task import (
    INITIAL_POLICIES,
    MOST_GOALS,
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
"""Number of instances of each split that are named by default, from instance 0."""
MOST_ATTEMPTS = 10_000
"""Most drafts of one instance; a family that needs more cannot be used."""
Base = Literal["free", "rail", "locked"]
LOCKED: dict[Base, tuple[Literal["x", "y"], ...]] = {
    "free": (),
    "rail": ("y",),
    "locked": ("x", "y"),
}
"""Base coordinates that cannot move, by kind of base."""
_PARTS = 1000  # of a unit of length, of a rad, of 1
_STRUCTURE, _GEOMETRY = 0, 1  # what a block of the generator is for
_RANGE = re.compile(r"(.+/)([^/]+)\.\.([^/]+)")


def _in_thousandths(value: float) -> int:
    """Return a number in thousandths, 300 for 0.3. Raises a validation error for what is no
    finite number with at most three decimals."""
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not is_number or not abs(value * _PARTS) <= sys.float_info.max:
        raise PydanticCustomError("finite", "should be a finite number")
    if round(value * _PARTS) / _PARTS != value:
        raise sentence_error(f"{value} should have at most three decimals")
    return round(value * _PARTS)


Thousandths = Annotated[int, BeforeValidator(_in_thousandths)]
"""A length, an angle or a share: given with up to three decimals, kept in thousandths."""


def _in_order(span: tuple[int, int]) -> tuple[int, int]:
    """Return the span itself. Raises a validation error if its first number is the larger."""
    if span[0] > span[1]:
        raise PydanticCustomError("order", "should have the lower number first")
    return span


def _as_share(span: tuple[int, int]) -> tuple[int, int]:
    """Return the span itself. Raises a validation error if it is not within 0 to 1."""
    if not 0 <= span[0] <= span[1] <= _PARTS:
        raise PydanticCustomError("share", "should be from 0 to 1")
    return span


_ordered = AfterValidator(_in_order)
Span = Annotated[tuple[Thousandths, Thousandths], _ordered]
"""Lowest and highest value; every thousandth from one to the other is equally likely."""
_GoalsCount = Annotated[int, Field(strict=True, ge=2, le=MOST_GOALS)]
_PerArm = Annotated[int, Field(strict=True, ge=3, le=8)]
_Bases = tuple[Base, ...]


class _Region(FileData):
    """Region of the goals: a box, in which a box with a drawn share of the sides is placed."""

    x: Span
    """From, to, length unit; at the start the base is at the origin."""
    y: Span
    """From, to, length unit."""
    scale: Annotated[Span, AfterValidator(_as_share)] = (_PARTS, _PARTS)
    """Length of the sides of an instance's own box, as a share of the region's, from, to."""


class _Alignment(FileData):
    """Goals on a horizontal or vertical line, except one, not first or last, of three or more."""

    steps: Span
    """Distance from goal to goal along the line, length unit, from, to."""
    off: Span
    """Distance of that goal from the line, to either side, length unit, from, to."""


class Posture(FileData):
    """An arm at the start."""

    first: Span
    """Angle of the first joint from +x, rad, from, to."""
    others: Span
    """Angle of each other joint from the link before it, rad, from, to."""


_PARKED = Posture(first=(0, 0), others=(0, 0))


class Postures(FileData):
    """Both arms at the start; an arm without an entry is straight along +x."""

    left: Posture = _PARKED
    """The left arm."""
    right: Posture = _PARKED
    """The right arm."""


class Family(FileData):
    """Distributions of tasks, and rules that each instance keeps.

    Lengths, angles and shares of the file are kept as whole thousandths: 300 for 0.3.
    """

    name: str
    """Name with the version, such as ``two-armed/v1``."""
    title: Line
    """Name in figures and tables."""
    description: Line
    """A sentence for lists."""
    hands: tuple[Hand, ...] = HANDS
    """Hands that may hit goals."""
    goals: Annotated[tuple[_GoalsCount, _GoalsCount], _ordered]
    """Least and largest number of goals; each number is equally likely."""
    links: Annotated[tuple[_PerArm, _PerArm], _ordered]
    """Least and largest number of links of each arm; all links have one length (to a
    thousandth)."""
    reach: Thousandths = 4 * _PARTS
    """Sum of the links of each arm, length unit; by default the paper's."""
    base: Annotated[_Bases, Field(min_length=1)]
    """Bases; each instance has one: free, on a rail (it cannot move in y), or locked."""
    restrictions: _Bases = ()
    """Bases, in addition to the instance's own, with which every instance can be completed."""
    radius: Thousandths = 100
    """Radius of every goal, length unit."""
    region: _Region
    """Region of the goals: table ``[region]``."""
    line: _Alignment | None = None
    """Goals on a line: table ``[line]``; scattered in the region where left out."""
    start: Annotated[tuple[Postures, ...], Field(min_length=1)]
    """Starting postures; each instance has one: tables ``[[start]]``."""
    initial_hands: InitialPolicy = INITIAL_POLICIES[0]
    """Policy that finds the hands of trial 0, ``"best-single-hand"`` or ``"best-of-all"``; an
    instance names the hands that the policy found for it."""
    apart: Thousandths = 300
    """Least distance between the centres of two goals, length unit."""
    clear: Thousandths = 200
    """Least distance of a hand at the start from a goal's rim, length unit."""
    within: Thousandths = 950
    """Largest distance of a goal from a shoulder, as a share of the reach, measured along the base
    coordinates that are locked."""
    bent: Thousandths = 200
    """Angle, rad, by which a joint of each arm with one of ``hands`` is bent at least at the
    start."""


def draft(family: Family, address: Address, attempt: int) -> Task:
    """Return the task drawn for the instance at ``address`` in attempt ``attempt`` (from 0); equal
    arguments give equal tasks. No rule of the family is checked (:func:`broken_rule`): goals may be
    out of reach. ``initial_hands`` of the task is a policy, not yet a hand sequence.
    """
    key = hash_key(f"coartic {family.name}/{address.stream}")
    structure = Draws(key, address.number, 0, _STRUCTURE)
    count, links = structure.integer(*family.goals), structure.integer(*family.links)
    base, postures = structure.one_of(family.base), structure.one_of(family.start)
    vertical = structure.one_of((False, True))
    draws = Draws(key, address.number, attempt, _GEOMETRY)
    goals = draw_goals(draws, family, count, vertical)
    # Links of one length, where that can be, else the first ones a thousandth longer.
    length, longer = divmod(family.reach, links)
    lengths = [(length + (k < longer)) / _PARTS for k in range(links)]
    start: dict[str, Any] = {}
    for hand, posture in (("left", postures.left), ("right", postures.right)):
        spans = [posture.first, *[posture.others] * (links - 1)]
        start[hand] = [draws.integer(*span) / _PARTS for span in spans]
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
    """Draw ``count`` goals and return their x and y, thousandths of a length unit: in a box with a
    drawn share of the region's sides, or, if the family has a line, on a line (``vertical`` or
    horizontal) except, if there are more than two, one goal, neither first nor last, which ``off``
    of the line moves off it. Goals on a line may be outside the region."""
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
    at, level = draws.integer(*along), draws.integer(*across)
    forward = draws.one_of((-1, 1))
    places = [at]
    for _ in range(count - 1):
        places.append(places[-1] + forward * draws.integer(*line.steps))
    levels = [level] * count
    if count > 2:
        odd = draws.integer(1, count - 2)
        levels[odd] += draws.one_of((-1, 1)) * draws.integer(*line.off)
    return [*(zip(levels, places, strict=True) if vertical else zip(places, levels, strict=True))]


def broken_rule(family: Family, task: Task) -> str | None:
    """Return the name of the first rule of the family that a draft, a task drawn for it, breaks;
    None if it breaks no rule.

    ``outside``: a goal is outside the region. ``overlap``: two goals are too near to each other.
    With hands of the family, ``reach``: a goal is too far from a shoulder, with the base of the
    draft or of a restriction; ``straight``: an arm is straight at the start, or nearly;
    ``start-hit``: a hand is in a goal at the start, or close by; ``corrective``: the corrective
    process alone does not complete the task, with the base of the draft or of a restriction, or has
    more than 4096 hand sequences to try.
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
    others = (task.model_copy(update={"locked_base": locked}) for locked in restricted)
    rewards = (reward for other in others for _, reward, *_ in ranked_sequences(other, [hands]))
    return "corrective" if None in rewards else None


def instance_of(family: Family, address: Address) -> Task:
    """Return the instance of a family at an address, the first draft (task drawn for it) that
    breaks no rule, as a task with a title, initial hands and provenance. Raises TaskError if each
    of the first 10,000 drafts breaks a rule of the family."""
    broken = Counter[str]()
    for attempt in range(MOST_ATTEMPTS):
        task = draft(family, address, attempt)
        if (rule := broken_rule(family, task)) is None:
            break
        broken[rule] += 1
    else:
        rule, times = broken.most_common(1)[0]
        raise TaskError(
            f"{address}: {MOST_ATTEMPTS:,} draws of family {family.name!r} broke a rule, {times:,} "
            f"of them {rule!r}"
        )
    name = str(address)
    short = name.rpartition("/")[2]
    source = f"drawn: family {family.name}, instance {short}"
    chosen = ["goals", "start", "initial_hands"]
    chosen += ["locked_base"] * bool(task.locked_base)
    chosen += ["robot"] * (task.robot != Robot())
    base = {0: "a free base", 1: "the base on a rail", 2: "the base locked"}[len(task.locked_base)]
    links = len(task.robot.left_links)
    content = task.model_dump() | {
        "title": f"{family.title} {short}",
        "description": f"{counted(len(task.goals), 'goal')}, {links} links an arm, {base}: drawn "
        f"from family {family.name}.",
        "initial_hands": search_initial_hands(task)[0],
        "provenance": {key: {"status": "chosen", "source": source} for key in chosen},
    }
    return parse_task(content, name)


@lru_cache(maxsize=4096)
def instance(name: str) -> Task:
    """Return an instance of a family, a task, by its name, such as ``two-armed/v1/i017``, or
    ``mine.v1.toml/i017`` of the family of a file; the last 4096 are kept. Raises TaskError if
    there is no such instance."""
    place, _, short = name.rpartition("/")
    address = address_of(f"{load_family(place).name}/{short}" if is_file(place) else name)
    if address is None:
        raise TaskError(
            f"{name!r} is not an instance of a family. Write for example two-armed/v1/i017 (test), "
            "two-armed/v1/d017 (development) or two-armed/v1/2027-017 (fresh, of the year 2027)."
        )
    return instance_of(load_family(place), address)


def is_file(family: str) -> bool:
    """Return whether a family is named by a file: whether its name ends in ``.toml``."""
    return family.endswith(".toml")


def named_by(text: str) -> list[str]:
    """List the names of the instances of a range such as ``two-armed/v1/i000..i039``, both ends
    included; for a text that is no range, such as a task's name or its file, list this text alone,
    unchecked. Raises TaskError for a range that is malformed, goes backwards or has more than
    10,000 instances. Whether a shipped family exists is not checked."""
    if "/" not in text or ".." not in text.rpartition("/")[2] or text.endswith(".toml"):
        return [text]
    written = _RANGE.fullmatch(text)
    start = written[1] if written else ""
    known = f"{load_family(start[:-1]).name}/" if is_file(start[:-1]) else start
    ends = [address_of(known + end) for end in written.groups()[1:]] if written else [None]
    first, last = ends[0], ends[-1]
    if first is None or last is None or first.stream != last.stream:
        raise TaskError(
            f"{text!r} is not a range of instances. Write for example two-armed/v1/i000..i039, "
            "or the path of a task file of your own, which ends in .toml."
        )
    if last.number < first.number:
        raise TaskError(f"{text!r} goes backwards; put the lower number first")
    if last.number - first.number >= MOST_CELLS:
        raise TaskError(f"{text!r} names more than {MOST_CELLS:,} instances")
    numbers = range(first.number, last.number + 1)
    return [str(first._replace(family=start[:-1], number=number)) for number in numbers]


def shipped_families() -> dict[str, Family]:
    """Return a new dictionary of the shipped families by name with version, ``two-armed/v1``."""
    families = map(read_family, sorted(FAMILY_FOLDER.glob("*.v*.toml")))
    return {family.name: family for family in families}


def own_families(paths: Iterable[Path]) -> dict[str, Family]:
    """Return the families read from files, by name. Raises TaskError for a file that cannot be
    used, and for a name that another of the files or a shipped family has."""
    families: dict[str, Family] = {}
    for path in paths:
        family = read_family(path)
        if family.name in families or family.name in shipped_families():
            raise TaskError(f"{path}: there is a family {family.name!r} already; rename the file")
        families[family.name] = family
    return families


def load_family(name: str) -> Family:
    """Return a shipped family by its name with version, such as ``two-armed/v1``, or a family of
    your own by the path of its file. A file is read once per process. Raises TaskError if
    it does not exist or cannot be used."""
    if is_file(name):
        return read_family(Path(name))
    shipped = shipped_families()
    if name not in shipped:
        raise TaskError(unknown("family", name, shipped))
    return shipped[name]


def is_family(name: str) -> bool:
    """Return whether a text is the name of a shipped family, or of a ``.toml`` file that can be
    read and has the key ``region``."""
    with suppress(TaskError):
        return name in shipped_families() or (
            is_file(name) and "region" in read_toml(name, error=TaskError)
        )
    return False


@cache
def read_family(path: Path) -> Family:
    """Read a family from its TOML file, which names it: ``two-armed.v1.toml`` has family
    ``two-armed/v1``. The family of a path is cached.

    Raises TaskError for a file that is no family.
    """
    content, name = read_toml(path, error=TaskError), "/".join(path.stem.rsplit(".", 1))
    if "name" in content:
        raise TaskError(f"{path}: name: is an unknown key; a family is named by its file")
    try:
        family = Family.model_validate(content | {"name": name})
    except ValidationError as error:
        keys = [*Family.model_fields, *_Region.model_fields, *_Alignment.model_fields]
        raise TaskError(f"{plain(str(path))}: {explain(error, keys)}") from None
    if address_of(f"{name}/i000") is None:
        raise TaskError(f"{path}: the name of a family's file is NAME.v1.toml")
    return family


@checked_arguments
def instance_names(
    family: str, split: Split, count: int | None = None, year: int | None = None
) -> list[str]:
    """List the names of instances 0 to ``count`` - 1 of a split (``"development"``, ``"test"``,
    ``"fresh"``) of a family, by its name or its file; by default ``count`` is 1000 for development,
    else 10.

    Raises ValueError for another split, for a count that is not from 1 to 10,000, for fresh
    instances without a year from 1000 to 9999, and for others with a year; TaskError for a family
    that is unknown or cannot be used.
    """
    load_family(family)
    if (year is None) == (split == "fresh"):
        raise ValueError(f"year is {year!r}; fresh instances need one, such as 2027, others none")
    if year is not None:
        check_limits("year", year, 1000, 9999)
    count = COUNTS[split] if count is None else count
    check_limits("count", count, 1, MOST_CELLS)
    streams = {name: stream for stream, name in SPLITS.items()} | {"fresh": f"{year}-"}
    return [str(Address(family, streams[split], number)) for number in range(count)]
