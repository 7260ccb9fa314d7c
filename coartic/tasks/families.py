"""Families of random tasks: distributions as data, and instances that never change.

A family is a file, ``families/NAME.vN.toml``: how many goals, where, for which hands, arms and
base, from which start; once released, it is not changed, and a change is a new version. An
instance is a task by the name ``two-armed/v1/i017``, and a function of this name alone: numbers
come from a counter-based generator (:mod:`coartic.tasks.philox`) whose key is the hash of family,
version and stream and whose counter is the number of the instance. Streams are ``d`` (development:
to tune on), ``i`` (test: to report on) and years (``2027-``: fresh ones).

What is drawn once is the structure: how many goals and links, the base, the kind of start. Places
and angles are drawn again until no rule of :data:`RULES` is broken, so that rejection leaves the
shares of structures alone. They are whole thousandths from the start. Geometric rules compare
integers; the others ask the compiled kernels, which use IEEE arithmetic alone
(:mod:`coartic.motion.trigonometry`): no rejection depends on a machine's library.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import re
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    model_validator,
)
from pydantic_core import ErrorDetails, PydanticCustomError

from coartic.errors import NotApplicableError, TaskError
from coartic.inputs import MOST_CELLS, problems, read_toml
from coartic.model import PAPER
from coartic.robot import HANDS, Hand, Robot
from coartic.tasks.philox import Draws, key_of
from coartic.tasks.task import (
    INITIAL_POLICIES,
    Address,
    InitialPolicy,
    Task,
    address_of,
    parse_task,
)
from coartic.text import Line, counted, did_you_mean

FAMILY_FOLDER = Path(__file__).parent / "families"
MOST_ATTEMPTS = 10_000
"""Draws of one instance; a family that needs more cannot be used."""
CORRECTIVE = "corrective"
"""The rule that needs a trial."""
Base = Literal["free", "rail", "locked"]
LOCKED: dict[Base, tuple[Literal["x", "y"], ...]] = {
    "free": (),
    "rail": ("y",),
    "locked": ("x", "y"),
}
"""Base coordinates that cannot move."""
_PARTS = 1000  # of a unit of length, of a rad, of 1
_STRUCTURE, _GEOMETRY = 0, 1  # what a block of the generator is for
_LEAST_LINKS, _MOST_LINKS = 3, 8
_LEAST_GOALS, _MOST_GOALS = 2, 8
_RANGE = re.compile(r"(.+/)([^/]+)\.\.([^/]+)")


def _in_parts(value: Any) -> int:
    """A number in thousandths."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= _PARTS:
        text = "should be a number up to 1000"
    elif round(value * _PARTS) / _PARTS != value:
        text = "has more than three decimals"
    else:
        return round(value * _PARTS)
    raise PydanticCustomError("parts", "{text}", {"text": text})


def _ordered(span: tuple[int, int]) -> tuple[int, int]:
    if span[0] > span[1]:
        raise PydanticCustomError("order", "goes from more to less", {})
    return span


def _checked(wrong: Callable[[int], bool], text: str) -> AfterValidator:
    def check(parts: int) -> int:
        if wrong(parts):
            raise PydanticCustomError("parts", "{text}", {"text": text})
        return parts

    return AfterValidator(check)


Parts = Annotated[int, BeforeValidator(_in_parts)]
"""A length, an angle or a share, as a number of up to three decimals; kept in thousandths."""
Span = Annotated[tuple[Parts, Parts], AfterValidator(_ordered)]
"""From, to; every thousandth between as likely."""
_Positive = Annotated[Parts, _checked(lambda parts: parts <= 0, "should be greater than 0")]
_Share = Annotated[
    Parts, _checked(lambda parts: not 0 < parts <= _PARTS, "should be above 0, at most 1")
]
_Bend = Annotated[
    Parts, _checked(lambda parts: abs(parts) > 1570, "should be within -1.57 to 1.57")
]
_Goals = Annotated[int, Field(strict=True, ge=_LEAST_GOALS, le=_MOST_GOALS)]
_Links = Annotated[int, Field(strict=True, ge=_LEAST_LINKS, le=_MOST_LINKS)]
_Bases = tuple[Base, ...]


class _Data(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Region(_Data):
    """Where goals are: a box, of whose sides a share is drawn and placed within it."""

    x: Span
    """From, to, length unit; at the start the base is at the origin."""
    y: Span
    """From, to, length unit."""
    scale: Annotated[tuple[_Share, _Share], AfterValidator(_ordered)] = (_PARTS, _PARTS)
    """Share of both sides that an instance's own box has, from, to."""


class Alignment(_Data):
    """Goals on a horizontal or vertical line, but for one that is neither first nor last."""

    steps: Annotated[tuple[_Positive, _Positive], AfterValidator(_ordered)]
    """From goal to goal along the line, length unit, from, to."""
    off: Annotated[tuple[_Positive, _Positive], AfterValidator(_ordered)]
    """Distance of the one goal from the line, to either side, length unit, from, to."""


class Posture(_Data):
    """An arm at the start."""

    first: Span
    """Angle of the first joint from +x, rad, from, to."""
    others: Annotated[tuple[_Bend, _Bend], AfterValidator(_ordered)]
    """Angle of each other joint from the link before it, rad, from, to, within ±π/2: an arm whose
    bends are so small is straight, and thereby singular, where they are all 0."""


_PARKED = Posture(first=(0, 0), others=(0, 0))


class Postures(_Data):
    """Both arms at the start; an arm whose hand has nothing to do is parked at 0."""

    left: Posture = _PARKED
    """The left arm."""
    right: Posture = _PARKED
    """The right arm."""


class Family(_Data):
    """Distributions of tasks, and what no instance may be.

    Lengths, angles and shares are kept in thousandths of what the file says.
    """

    name: str
    """With the version, as ``two-armed/v1``."""
    title: Line
    """For figures and tables."""
    description: Line
    """A sentence for lists."""
    hands: tuple[Hand, ...] = HANDS
    """Hands that may hit goals; the robot has both arms anyway."""
    goals: Annotated[tuple[_Goals, _Goals], AfterValidator(_ordered)]
    """How many there are, from, to; each number as likely."""
    links: Annotated[tuple[_Links, _Links], AfterValidator(_ordered)]
    """How many each of both arms has, from, to; they have one length (to a thousandth)."""
    reach: _Positive = 4 * _PARTS
    """Sum of an arm's links, length unit; the paper's."""
    base: Annotated[_Bases, Field(min_length=1)]
    """One is drawn: free, on a rail (it cannot move in y), or locked."""
    restrictions: _Bases = ()
    """Bases, beside its own, under which every instance can be done."""
    radius: _Positive = 100
    """Of every goal, length unit."""
    region: Region
    """Where goals are: table ``[region]``."""
    line: Alignment | None = None
    """Goals on a line: table ``[line]``; scattered over the region where left out."""
    start: Annotated[tuple[Postures, ...], Field(min_length=1)]
    """Postures of which one is drawn: tables ``[[start]]``."""
    initial_hands: InitialPolicy = INITIAL_POLICIES[0]
    """How the hands of trial 0 are found; the instance names them."""
    apart: Parts = 300
    """Least distance between the centres of two goals, length unit."""
    clear: Parts = 200
    """Least distance of a hand at the start from a goal's rim, length unit."""
    within: _Share = 950
    """Share of the reach within which goals are, where the base cannot come nearer."""
    bent: Parts = 200
    """Angle, rad, by which a joint of each arm is bent at least; 0 lets straight arms start."""

    @model_validator(mode="after")
    def _has_fit_goals(self) -> Family:
        text = None
        if self.radius <= PAPER.correction_tolerance * _PARTS:
            text = "radius is not larger than the accuracy of the corrective process"
        elif self.apart < 2 * self.radius:
            text = "apart lets goals overlap"
        if text is not None:
            raise PydanticCustomError("goals", "{text}", {"text": text})
        return self

    def key(self, stream: str) -> tuple[int, int]:
        """Of the generator, for the instances of a stream."""
        return key_of(f"coartic {self.name}/{stream}")


@dataclass(frozen=True)
class Candidate:
    """What was drawn, before any rule has seen it; figures in thousandths."""

    family: Family
    links: int
    base: Base
    goals: tuple[tuple[int, int], ...]
    angles: dict[Hand, tuple[int, ...]]

    def lengths(self) -> tuple[int, ...]:
        """Of an arm's links: one for all, where that can be, else the first ones longer."""
        whole, rest = divmod(self.family.reach, self.links)
        return tuple(whole + (k < rest) for k in range(self.links))

    def content(self) -> dict[str, Any]:
        """Of the task file, but for what only an accepted instance has."""
        links = [length / _PARTS for length in self.lengths()]
        return {
            "name": "candidate",
            "hands": list(self.family.hands),
            "goals": [[x / _PARTS, y / _PARTS] for x, y in self.goals],
            "radius": self.family.radius / _PARTS,
            "locked_base": list(LOCKED[self.base]),
            "initial_hands": self.family.initial_hands,
            "start": {
                "base": [0.0, 0.0],
                **{hand: [angle / _PARTS for angle in self.angles[hand]] for hand in HANDS},
            },
            "robot": {"left_links": links, "right_links": links},
        }

    def task(self, base: Base | None = None) -> Task:
        """The task that it would be, with its base or another one, whatever can be reached."""
        content = self.content() | {"locked_base": list(LOCKED[base or self.base])}
        return parse_task(content, f"family {self.family.name}", reach=False)


def _outside(candidate: Candidate) -> bool:
    (left, right), (low, high) = candidate.family.region.x, candidate.family.region.y
    return not all(left <= x <= right and low <= y <= high for x, y in candidate.goals)


def _overlap(candidate: Candidate) -> bool:
    return any(
        (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 < candidate.family.apart**2
        for a, b in itertools.combinations(candidate.goals, 2)
    )


def _out_of_reach(candidate: Candidate) -> bool:
    family, robot = candidate.family, Robot()
    shoulders = {"left": robot.left_shoulder, "right": robot.right_shoulder}
    for base in (candidate.base, *family.restrictions):
        for hand in family.hands:
            shoulder = map(_in_parts, shoulders[hand])
            fixed = zip("xy", shoulder, strict=True)
            places = [(axis, at) for axis, at in fixed if axis in LOCKED[base]]
            for goal in candidate.goals:
                square = sum((goal["xy".index(axis)] - at) ** 2 for axis, at in places)
                if square * _PARTS**2 > (family.reach * family.within) ** 2:
                    return True
    return False


def _starts_in_goal(candidate: Candidate) -> bool:
    from coartic.motion.movement import move

    task, family = candidate.task(), candidate.family
    near = (family.radius + family.clear) / _PARTS
    return any(
        move(task.robot, task.q0, task.q0, hand, goal, near).hit
        for hand in task.hands
        for goal in task.goals
    )


def _starts_straight(candidate: Candidate) -> bool:
    return any(
        max(map(abs, candidate.angles[hand][1:])) < candidate.family.bent
        for hand in candidate.family.hands
    )


RULES: dict[str, Callable[[Candidate], bool]] = {
    "outside": _outside,
    "overlap": _overlap,
    "reach": _out_of_reach,
    "straight": _starts_straight,
    "start-hit": _starts_in_goal,
}
"""What no instance may be, in the order in which it is asked; then comes :data:`CORRECTIVE`."""
RULES_IN_WORDS = {
    "outside": "a goal of the line, or off it, is outside the region",
    "overlap": "two goals are nearer to each other than the family lets them be",
    "reach": "a hand cannot come near enough to a goal, with the base as it is locked",
    "straight": "an arm is straight at the start, or nearly",
    "start-hit": "a hand is in a goal at the start, or close by",
    CORRECTIVE: "the corrective process alone does not complete the task with the initial hands",
}


def judged(candidate: Candidate) -> tuple[str | None, str]:
    """The first rule that a candidate breaks, and the initial hands of one that breaks none."""
    for rule, breaks in RULES.items():
        if breaks(candidate):
            return rule, ""
    hands = _initial_hands(candidate)
    return (CORRECTIVE, "") if hands is None else (None, hands)


def _initial_hands(candidate: Candidate) -> str | None:
    """With which the corrective process does the task under every restriction, or None."""
    from coartic.motion.initial import corrective_trial, initial_hands

    try:
        hands = initial_hands(candidate.task(), model=PAPER)
    except NotApplicableError:
        return None
    others = (candidate.task(base) for base in candidate.family.restrictions)
    done = all(corrective_trial(other, hands, model=PAPER).completed for other in others)
    return hands if done else None


def candidate_of(address: Address, attempt: int) -> Candidate:
    """What is drawn for an instance at the given attempt, from 0. Raises TaskError."""
    family = load_family(address.family)
    key = family.key(address.stream)
    structure = Draws(key, address.number, 0, _STRUCTURE)
    count, links = structure.integer(*family.goals), structure.integer(*family.links)
    base, postures = structure.one_of(family.base), structure.one_of(family.start)
    vertical = structure.one_of((False, True))
    draws = Draws(key, address.number, attempt, _GEOMETRY)
    goals = _scattered(draws, family.region, count)
    if family.line is not None:
        goals = _aligned(draws, family.region, family.line, count, vertical)
    angles: dict[Hand, tuple[int, ...]] = {}
    for hand in HANDS:
        posture = postures.left if hand == "left" else postures.right
        spans = [posture.first, *[posture.others] * (links - 1)]
        angles[hand] = tuple(draws.integer(*span) for span in spans)
    return Candidate(family, links, base, tuple(goals), angles)


def _scattered(draws: Draws, region: Region, count: int) -> list[tuple[int, int]]:
    share = draws.integer(*region.scale)
    sides = []
    for low, high in (region.x, region.y):
        length = (high - low) * share // _PARTS
        start = draws.integer(low, high - length)
        sides.append((start, start + length))
    return [(draws.integer(*sides[0]), draws.integer(*sides[1])) for _ in range(count)]


def _aligned(
    draws: Draws, region: Region, line: Alignment, count: int, vertical: bool
) -> list[tuple[int, int]]:
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
    pairs = zip(levels, places, strict=True) if vertical else zip(places, levels, strict=True)
    return list(pairs)


@dataclass(frozen=True)
class Drawn:
    """An instance, and what was drawn before it."""

    task: Task
    rejected: tuple[str, ...]
    """The rules that earlier attempts broke, in order."""


@lru_cache(maxsize=4096)
def drawn(address: Address) -> Drawn:
    """The instance at an address. Raises TaskError where there is none."""
    family = load_family(address.family)
    rejected: list[str] = []
    while len(rejected) < MOST_ATTEMPTS:
        candidate = candidate_of(address, len(rejected))
        rule, hands = judged(candidate)
        if rule is None:
            return Drawn(_named(address, family, candidate, hands), tuple(rejected))
        rejected.append(rule)
    most, times = Counter(rejected).most_common(1)[0]
    raise TaskError(
        f"{address}: {MOST_ATTEMPTS:_} draws of family {family.name!r} broke a rule, {times:_} of "
        f"them {most!r}: {RULES_IN_WORDS[most]}"
    )


def _named(address: Address, family: Family, candidate: Candidate, hands: str) -> Task:
    name = str(address)
    short = name.rpartition("/")[2]
    source = f"drawn: family {family.name}, instance {short}"
    chosen = ["goals", "start", "initial_hands"]
    chosen += ["locked_base"] * bool(LOCKED[candidate.base])
    chosen += ["robot"] * (candidate.task().robot != Robot())
    base = {"free": "a free base", "rail": "the base on a rail", "locked": "the base locked"}
    content = candidate.content() | {
        "name": name,
        "title": f"{family.title} {short}",
        "description": f"{counted(len(candidate.goals), 'goal')}, {candidate.links} links an arm, "
        f"{base[candidate.base]}: drawn from family {family.name}.",
        "initial_hands": hands,
        "provenance": {key: {"status": "chosen", "source": source} for key in chosen},
    }
    return parse_task(content, name)


def instance(name: str) -> Task:
    """An instance by its name, ``two-armed/v1/i017``. Raises TaskError for what is none."""
    address = address_of(name)
    if address is None:
        raise TaskError(
            f"{name!r} is not an instance of a family. Write for example two-armed/v1/i017 (test), "
            "two-armed/v1/d017 (development) or two-armed/v1/2027-017 (fresh, of the year 2027)."
        )
    return drawn(address).task


def check_instance(task: Task, source: str) -> None:
    """Raises TaskError for a task with an instance's name that is not that instance."""
    if task != instance(task.name):
        raise TaskError(
            f"{source}: the task is called {task.name!r}, but it is not the instance of that name. "
            "Give it another name, or write the instance anew: "
            f"coartic draw {task.name} --out FOLDER"
        )


def names_in(text: str) -> list[str]:
    """Names of the instances from one to another: ``two-armed/v1/i000..i039``.

    Raises TaskError for what is no such range, or one of more than :data:`MOST_CELLS`.
    """
    found = _RANGE.fullmatch(text)
    ends = [address_of(found[1] + end) for end in found.groups()[1:]] if found else [None]
    first, last = ends[0], ends[-1]
    if first is None or last is None or first.stream != last.stream:
        raise TaskError(
            f"{text!r} is not a range of instances. Write for example two-armed/v1/i000..i039, "
            "or the path of a task file of your own, which ends in .toml."
        )
    if last.number < first.number:
        raise TaskError(f"{text!r} goes backwards; put the lower number first")
    if last.number - first.number >= MOST_CELLS:
        raise TaskError(f"{text!r} names more than {MOST_CELLS:_} instances")
    numbers = range(first.number, last.number + 1)
    return [str(first._replace(number=number)) for number in numbers]


def named_by(text: str) -> list[str]:
    """What a name stands for where several may: instances for a range of them, else itself."""
    is_range = "/" in text and ".." in text and not text.endswith(".toml")
    return names_in(text) if is_range else [text]


@dataclass(frozen=True)
class Rejections:
    """How often draws were rejected, and why."""

    instances: int
    draws: int
    by_rule: dict[str, int]
    """Draws whose first broken rule it was, by rule."""

    @property
    def rate(self) -> float:
        """Share of the draws that were rejected."""
        return 1 - self.instances / self.draws


def rejections(names: Iterable[str]) -> Rejections:
    """Of the draws of some instances. Raises TaskError for names that are none."""
    addresses = [address_of(instance(name).name) for name in names]
    found = [drawn(address) for address in addresses if address is not None]
    counts = Counter(rule for each in found for rule in each.rejected)
    rules = (*RULES, CORRECTIVE)
    draws = len(found) + counts.total()
    return Rejections(len(found), draws, {rule: counts[rule] for rule in rules})


@cache
def families() -> dict[str, Family]:
    """The shipped families by name with version, such as ``two-armed/v1``."""
    return {name: _shipped(name) for name in _files()}


def _files() -> dict[str, Path]:
    """By name with version."""
    return {_name(path): path for path in sorted(FAMILY_FOLDER.glob("*.v*.toml"))}


def _name(path: Path) -> str:
    return "/".join(path.stem.rsplit(".", 1))


@cache
def _shipped(name: str) -> Family:
    return read_family(_files()[name])


def load_family(name: str) -> Family:
    """A family by name, with its version or, without, the newest. Raises TaskError."""
    known = _files()
    newest = {family.partition("/")[0]: family for family in sorted(known, key=_version)}
    full = newest.get(name, name)
    if full not in known:
        hint = did_you_mean(full, known) or ";"
        raise TaskError(f"unknown family {name!r}{hint} the families are {', '.join(known)}")
    return _shipped(full)


def _version(name: str) -> int:
    number = name.partition("/v")[2]
    return int(number) if number.isdecimal() else 0


def read_family(path: Path) -> Family:
    """A family from its file. Raises TaskError with one line per problem."""
    content = read_toml(path, error=TaskError)
    name = _name(path)
    if "name" in content:
        raise TaskError(f"{path}: name: is an unknown key; a family is named by its file")
    try:
        family = Family(**content, name=name)
    except ValidationError as error:
        keys = [*Family.model_fields, *Region.model_fields, *Alignment.model_fields]
        raise TaskError(problems(str(path), error, keys, _explain)) from None
    if address_of(f"{name}/i000") is None:
        raise TaskError(f"{path}: the name of a family's file is NAME.v1.toml")
    return family


def _explain(detail: ErrorDetails) -> str | None:
    return detail["msg"] if detail["type"] == "goals" else None


def task_text(task: Task) -> str:
    """The task as the text of its file, from which :func:`coartic.load_task` gives it again."""
    content = task.model_dump(mode="json")
    tables = {key: content.pop(key) for key in ("start", "robot", "provenance")}
    if task.robot == Robot():
        del tables["robot"]
    lines = [f"{key} = {_toml(value)}" for key, value in content.items()]
    for key, table in tables.items():
        if table:
            lines += [
                "",
                f"[{key}]",
                *(f"{name} = {_toml(value)}" for name, value in table.items()),
            ]
    return "\n".join(lines) + "\n"


def _toml(value: Any) -> str:
    """A value as TOML writes it; strings as JSON does, of printable characters."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_toml(item)}" for key, item in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)


def task_hash(task: Task) -> str:
    """SHA-256 of the task's file (:func:`task_text`)."""
    return hashlib.sha256(task_text(task).encode()).hexdigest()
