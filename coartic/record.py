"""The run record: what is kept of a run, typed, bounded, and checked against itself.

A record says what was asked for (its specification, of which its id is a hash), what came of
it, what the method states of itself, and with what it was made. A score is never taken from a
method: :func:`solved` makes it, and :meth:`Record.check` makes it again from what is stored.

On disk a record is two lines: the SHA-256 of the second, and JSON. Whoever changes the second
line alone is noticed; whoever makes the first line anew still has to state a solution that
gives the score.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    JsonValue,
    ValidationError,
)

from coartic.errors import CoarticError, IncompleteError, SolutionError
from coartic.inputs import MOST_BYTES, problems_inline, read_bytes
from coartic.learning import METHOD_PREFIX
from coartic.method import Information, Meter
from coartic.model import MotionModel
from coartic.movement import configuration
from coartic.robot import Hand
from coartic.solution import Execution, Kind, Movement, execute, other_arm_travel
from coartic.task import INITIAL_POLICIES, Task, parse_task
from coartic.text import LONGEST_REASON, Line, printable

RECORD_FORMAT: Literal[2] = 2
MOST_MOVEMENTS = 10_000
"""Movements of one solution."""
MOST_STEPS = 1_000_000
"""Movement steps along one solution, its targets visited in order: thousands do."""
LARGEST_DETAILS = 64 * 1024
"""Characters of a method's details, or of its parameters, as JSON."""
LARGEST_RECORD = 1 << 28
"""Bytes of a record: rewards of ten million trials, twice over."""
SEARCH = "optimum/"
"""Ids of the searches for the optimum begin so; they alone may state a bound."""
_PREFIX = "sha256:"
_OUTCOME = ("status", "solution", "initial", "replay", "bound", "rewards")

Status = Literal["ok", "infeasible", "solver-failed", "timeout", "crashed"]
LARGEST_COUNT = 2**53
Count = Annotated[int, Field(ge=0, le=LARGEST_COUNT)]
Reward = Annotated[int, Field(ge=-(2**31) + 1, le=0)]
Seed = Annotated[int, Field(ge=0, lt=2**63)]
Amount = Annotated[float, Field(ge=0)]
Reason = Annotated[str, Field(max_length=LONGEST_REASON), printable]


def _json(most: int) -> AfterValidator:
    """JSON of at most ``most`` characters, in which every number is one."""

    def check(content: dict[str, Any]) -> dict[str, Any]:
        size = len(json.dumps(content, allow_nan=False))
        if size > most:
            raise ValueError(f"{size} characters as JSON; at most {most} are kept")
        return content

    return AfterValidator(check)


def _is_whole(meter: Any) -> Any:
    missing = isinstance(meter, dict) and Meter().as_dict().keys() - meter.keys()
    if missing:
        raise ValueError(f"lacks {', '.join(sorted(missing))}")
    return meter


def _counts(meter: Meter) -> Meter:
    for name, value in meter.as_dict().items():
        if not 0 <= value <= LARGEST_COUNT:
            raise ValueError(f"{name} is {value}; it must be 0 to {LARGEST_COUNT}")
    return meter


Values = Annotated[dict[Line, JsonValue], _json(LARGEST_DETAILS)]
"""Details or parameters of a method."""
TaskContent = Annotated[dict[str, JsonValue], _json(MOST_BYTES)]
Spent = Annotated[Meter, BeforeValidator(_is_whole), AfterValidator(_counts)]


class RecordError(CoarticError):
    """A record that is missing or cannot be trusted."""


class Plain(BaseModel):
    """Base of what is stored: typed strictly, immutable, nothing else allowed."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class PlainMovement(Plain):
    """A movement as it is stored; see :class:`coartic.solution.Movement`."""

    goal: Annotated[int, Field(ge=1)]
    hand: Hand
    kind: Kind
    target: tuple[float, ...] | None = None
    ticks: Count | None = None
    waypoints: tuple[tuple[float, ...], ...] | None = None

    @classmethod
    def of(cls, movement: Movement) -> PlainMovement:
        """A movement as plain data; pydantic's ValidationError for one that is none."""
        target, waypoints = movement.target, movement.waypoints
        return cls(
            goal=movement.goal,
            hand=movement.hand,
            kind=movement.kind,
            target=None if target is None else tuple(np.asarray(target, np.float64).tolist()),
            ticks=movement.ticks,
            waypoints=None
            if waypoints is None
            else tuple(tuple(np.asarray(point, np.float64).tolist()) for point in waypoints),
        )

    def movement(self) -> Movement:
        """The movement itself."""
        return Movement(
            goal=self.goal,
            hand=self.hand,
            kind=self.kind,
            target=None if self.target is None else np.array(self.target),
            ticks=self.ticks,
            waypoints=None if self.waypoints is None else np.array(self.waypoints),
        )


class Solved(Plain):
    """A solution as it was executed, and its score."""

    reward: Reward
    hands: Annotated[str, Field(pattern="^[LR]+$")]
    ticks_by_goal: tuple[Count, ...]
    corrections: Count
    """Corrective movements that were needed."""
    other_arm_travel: Amount
    """Of the arm that is not chosen, rad."""
    movements: Annotated[tuple[PlainMovement, ...], Field(max_length=MOST_MOVEMENTS)]


class Specification(Plain):
    """Everything the result of a run depends on, but for the code."""

    format: Literal[2]
    task: TaskContent
    method: Line
    parameters: Values
    model: dict[str, float | int]
    seed: Seed
    trial_budget: Annotated[int, Field(gt=0)] | None

    def key(self) -> str:
        """Hash of the specification, the first part of a run's id."""
        return content_hash(self.model_dump(mode="json"))[:16]


class Commit(Plain):
    """A commit of the project's repository."""

    id: Annotated[str, Field(pattern="^[0-9a-f]{7,64}$")]
    dirty: bool


class Environment(Plain):
    """Where and with what something was made."""

    coartic: Line
    model_code: Line
    commit: Commit | None
    python: Line
    packages: dict[Line, Line]
    platform: Line
    processor: Line
    cores: Annotated[int, Field(gt=0)]
    date: Line
    command: tuple[Annotated[str, Field(max_length=LONGEST_REASON), printable], ...]
    threads: dict[Line, Line | None] | None
    """Bounds on threads of libraries, in a worker."""


class Timing(Plain):
    """Times and memory of a run. None where they went with the process."""

    wall_s: Amount
    cpu_s: Amount | None = None
    warm: bool | None = None
    """Whether the process had run the method before."""
    process_peak_mb: Amount | None = None
    """Of the process so far, all its runs included."""
    time_limit_s: Annotated[float, Field(gt=0)] | None = None


class Record(Plain):
    """One run."""

    run_id: Annotated[str, Field(pattern="^[0-9a-f]{16}-[0-9a-f]+$")]
    run: Count
    """Number of the run within its cell, from 0."""
    specification: Specification
    code: Annotated[str, Field(pattern="^[0-9a-f]+$")]
    status: Status
    reason: Reason
    """Empty where the status is ok."""
    solution: Solved | None
    initial: Solved | None
    """The first trial of a learner."""
    replay: Solved | None
    """One noiseless greedy trial of a learner with what it has learned."""
    bound: Reward | None
    """Reward that no solution exceeds, where the method proved one."""
    told: tuple[Information, ...]
    secondary: tuple[Line, ...]
    used: tuple[Information, ...]
    meter: Spent | None
    """None where it went with the process."""
    details: Values
    rewards: tuple[Reward | None, ...]
    """Of each trial; None where it failed."""
    timing: Timing
    origin: Line
    """``built in``, a plug-in's distribution, or the path of a method file."""
    environment: Environment

    @property
    def method(self) -> str:
        """Id of the method."""
        return self.specification.method

    @property
    def task(self) -> Task:
        """The task as it was run. Raises TaskError where it cannot be one."""
        return _parsed(json.dumps(self.specification.task))

    @property
    def model(self) -> MotionModel:
        """The constants of movement."""
        return MotionModel(**self.specification.model)  # type: ignore[arg-type]

    def movements(self) -> tuple[Movement, ...]:
        """The solution's movements; none where there is no solution."""
        solution = self.solution
        return () if solution is None else tuple(row.movement() for row in solution.movements)

    def result(self) -> dict[str, Any]:
        """What a repetition has to give again: all but times, surroundings and words."""
        meter = None
        if self.meter is not None:
            meter = {name: getattr(self.meter, name) for name in Meter.COUNTS}
        content = self.model_dump(mode="json", include={*_OUTCOME, "details"})
        return {**content, "meter": meter}

    def digest(self) -> str:
        """Hash of status, solutions to the last joint, rewards of all trials, bound.

        Equal for runs that came out the same, whatever was spent on the way.
        """
        result = self.result()
        return content_hash([result[name] for name in _OUTCOME])[:16]

    def check(self) -> None:
        """The record agrees with itself, and its solutions give their scores again.

        Raises RecordError that names the run otherwise. Not seen here, because nothing
        stored can show it: what a method spent and how long it took.
        """
        problem = self.disagreement()
        if problem is not None:
            raise RecordError(f"run {self.run_id} contradicts itself: {problem}")
        for name in ("solution", "initial", "replay"):
            stored: Solved | None = getattr(self, name)
            if stored is None:
                continue
            try:
                again = solved(self.task, [row.movement() for row in stored.movements], self.model)
            except (CoarticError, ValueError, TypeError) as error:
                raise RecordError(
                    f"run {self.run_id}: its {name} cannot be executed: {error}"
                ) from None
            if again != stored:
                raise RecordError(
                    f"run {self.run_id}: its {name}, executed again, gives {_brief(again)} "
                    f"instead of {_brief(stored)}"
                )

    def disagreement(self) -> str | None:
        """The first law that the record breaks by what it states; None where it breaks none."""
        known = [reward for reward in self.rewards if reward is not None]
        best, ticks = max(known, default=None), -sum(known)
        reward = None if self.solution is None else self.solution.reward
        learner = self.method.startswith(METHOD_PREFIX)
        spent = self.meter
        failed = len(self.rewards) - len(known)
        laws: Sequence[tuple[bool, str]] = (
            (
                self.run_id == f"{self.specification.key()}-{self.code}",
                "its id is not the hash of its specification and code",
            ),
            ((self.status == "ok") == (reward is not None), "status and solution"),
            ((self.status == "ok") == (not self.reason), "status and reason"),
            (self.status != "ok" or spent is not None, "it is solved, and nothing was spent"),
            (set(self.used) <= set(self.told), "it used what it was not told"),
            (
                self.bound is None or self.method.startswith(SEARCH),
                f"a bound is for methods {SEARCH}*",
            ),
            (
                self.bound is None or reward is None or reward <= self.bound,
                "its reward is above the bound it proves",
            ),
            (
                spent is None or len(self.rewards) <= spent.trials,
                "more rewards than trials",
            ),
            (
                spent is None or failed <= spent.failed_trials,
                "more failed rewards than failed trials",
            ),
            (
                spent is None or ticks <= spent.movement_ticks,
                "its trials' rewards are more than its ticks",
            ),
            (
                not (learner and spent and self.rewards)
                or self.specification.task.get("initial_hands") in INITIAL_POLICIES
                or (spent.trials, spent.failed_trials) == (len(self.rewards), failed),
                "its counts of trials are not those of its rewards",
            ),
            (
                not (learner and spent and self.rewards)
                or failed > 0
                or self.specification.task.get("initial_hands") in INITIAL_POLICIES
                or spent.movement_ticks == ticks,
                "its ticks are not those of its trials",
            ),
            (
                not learner or reward == best,
                "the learned reward is not the best of its trials",
            ),
            (
                not (learner and self.rewards)
                or self.rewards[0] == (self.initial and self.initial.reward),
                "the initial reward is not that of trial 0",
            ),
            (
                not learner
                or spent is None
                or not self.rewards
                or len(self.rewards) == self.specification.parameters.get("trials")
                or self.specification.trial_budget is not None,
                "its trials are not those it was asked for",
            ),
        )
        return next((problem for holds, problem in laws if not holds), None)


def solved(task: Task, solution: Sequence[Movement], model: MotionModel) -> Solved:
    """Execute a solution apart from its method: the only score that counts.

    Raises SolutionError where it breaks the task's rules, IncompleteError where it does not
    hit every goal, and what :func:`coartic.solution.execute` raises.
    """
    if len(solution) > MOST_MOVEMENTS:
        raise SolutionError(f"{len(solution)} movements; at most {MOST_MOVEMENTS} are kept")
    corners = [task.q0]
    for movement in solution:
        path = () if movement.waypoints is None else movement.waypoints
        corners += [configuration(task.robot, point) for point in path]
        if movement.target is not None:
            corners.append(configuration(task.robot, movement.target))
    steps = float(np.linalg.norm(np.diff(corners, axis=0), axis=1).sum()) / model.step
    if steps > MOST_STEPS:
        raise SolutionError(f"its way is {steps:.0f} steps long; at most {MOST_STEPS} are made")
    execution = execute(task, solution, model=model)
    if not execution.completed:
        raise IncompleteError(execution.reason)
    return _scored(task, execution)


def _scored(task: Task, execution: Execution) -> Solved:
    assert execution.reward is not None
    return Solved(
        reward=execution.reward,
        hands=execution.hands,
        ticks_by_goal=execution.ticks_by_goal(),
        corrections=execution.corrections,
        other_arm_travel=other_arm_travel(task, execution),
        movements=tuple(map(PlainMovement.of, execution.movements)),
    )


def _brief(found: Solved) -> str:
    return f"{found.reward} with {found.hands}, ticks {list(found.ticks_by_goal)}"


@lru_cache(maxsize=512)
def _parsed(text: str) -> Task:
    return parse_task(json.loads(text), "a record")


def content_hash(content: Any) -> str:
    """SHA-256 of plain data in canonical form."""
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def run_seed(root: int, task: str, run: int) -> int:
    """Seed of one run, from the suite's seed, the task's name and the run's number alone.

    Every method gets the same seed for the same task and run, so runs are paired.
    """
    words = np.frombuffer(hashlib.sha256(task.encode()).digest()[:16], dtype="<u4")
    sequence = np.random.SeedSequence(root, spawn_key=(*map(int, words), run))
    return int(sequence.generate_state(1, np.uint64)[0] >> np.uint64(1))


def encode(record: Record) -> bytes:
    """A record as it is kept on disk."""
    body = record.model_dump_json().encode()
    return f"{_PREFIX}{hashlib.sha256(body).hexdigest()}\n".encode() + body + b"\n"


def decode(data: bytes, source: Path) -> Record:
    """A record from its bytes. Raises RecordError where they are not what was written."""
    head, _, body = data.partition(b"\n")
    body = body.removesuffix(b"\n")
    if not head.startswith(_PREFIX.encode()):
        raise RecordError(f"{source}: is not a run record")
    if head.decode(errors="replace") != f"{_PREFIX}{hashlib.sha256(body).hexdigest()}":
        raise RecordError(f"{source}: is damaged: its checksum does not fit")
    try:
        return Record.model_validate_json(body)
    except ValidationError as error:
        raise RecordError(f"{source}: is damaged: {problems_inline(error)}") from None


def read_record(path: Path) -> Record:
    """The record of a file, which is named by the run's id. Raises RecordError otherwise."""
    if not path.exists():
        raise RecordError(f"no record of run {path.stem} in {path.parent.parent}")
    data = read_bytes(path, LARGEST_RECORD, error=RecordError)
    record = decode(data, path)
    if record.run_id != path.stem:
        raise RecordError(f"{path}: holds the record of run {record.run_id}")
    return record
