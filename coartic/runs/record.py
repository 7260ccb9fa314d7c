"""The run record: what is kept of a run, typed, bounded, and checked against itself.

A record says what was asked for (its specification, of which its id is a hash), what came of
it, what the method states of itself, and with what it was made. A score is never taken from a
method: :func:`coartic.runs.scores.solved` makes it, and :meth:`Record.check` makes it again from
what is stored.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from pydantic_core import to_json

from coartic.errors import CoarticError
from coartic.learner.kernel import PARTS
from coartic.learner.learning import CORRECTIONS, METHOD_PREFIX
from coartic.method import Information, Meter
from coartic.model import MotionModel
from coartic.motion.solution import Movement
from coartic.runs.scores import Solved, Unscored, scored_together
from coartic.runs.stored import (
    Amount,
    Count,
    Itself,
    Plain,
    Reason,
    Reward,
    Seed,
    Spent,
    TaskContent,
    Values,
    canonical,
)
from coartic.tasks.task import INITIAL_POLICIES, Task, parse_task
from coartic.text import LONGEST_REASON, Line, printable

RECORD_FORMAT: Literal[2] = 2
BUILT_IN = "built in"
"""Origin of this project's methods."""
SEARCH = "optimum/"
"""Ids of the searches for the optimum begin so; they alone may state a bound."""
_KEY = 16  # digits
_LOT, _LOT_TRIALS = 200, 200_000  # records, and trials in them, that are checked together
_OUTCOME = ("status", "solution", "initial", "replay", "bound", "rewards")

Status = Literal["ok", "infeasible", "solver-failed", "timeout", "crashed"]


class RecordError(CoarticError):
    """A record that is missing or cannot be trusted."""


class Asked(Plain):
    """Everything the results of a cell's runs depend on, but for their seeds and the code."""

    format: Literal[2]
    task: TaskContent
    method: Line
    parameters: Values
    model: dict[str, bool | int | float]
    trial_budget: Annotated[int, Field(gt=0)] | None

    def with_seed(self, seed: int) -> Specification:
        """The specification of one run, of a seed that is one."""
        return Specification.model_construct(**self.__dict__, seed=seed)

    def keys(self, seeds: Iterable[int]) -> Iterator[str]:
        """:meth:`Specification.key` with each seed, at a fiftieth of its cost."""
        start, end = _around_seed(*(Itself(getattr(self, name)) for name in Asked.model_fields))
        for seed in seeds:
            whole = start.copy()
            whole.update(b"%d" % seed + end)
            yield whole.hexdigest()[:_KEY]


class Specification(Asked):
    """Everything the result of a run depends on, but for the code."""

    seed: Seed

    def key(self) -> str:
        """Hash of the specification, the first part of a run's id."""
        (key,) = self.keys([self.seed])
        return key


@lru_cache(maxsize=64)
def _around_seed(*asked: Itself) -> tuple[Any, bytes]:
    """The canonical text of a specification, hashed up to its seed, and what comes after that:
    once for the runs of a cell, which share the very objects."""
    values = (item.object for item in asked)
    fields = dict(zip(Asked.model_fields, values, strict=True))
    content = Asked.model_construct(**fields).model_dump(mode="json")
    before, after = (
        canonical({name: content[name] for name in content if (name < "seed") == first})
        for first in (True, False)
    )
    return hashlib.sha256(before[:-1] + b',"seed":'), b"," + after[1:]


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
    together: Annotated[int, Field(gt=0)] = 1
    """Runs that were performed side by side; the times are this one's share."""
    process_peak_mb: Amount | None = None
    """Of the process so far, all its runs included."""
    time_limit_s: Annotated[float, Field(gt=0)] | None = None


class Common(Plain):
    """What runs of one cell, performed by one process, have in common beside what they ask."""

    code: Annotated[str, Field(pattern="^[0-9a-f]+$")]
    told: tuple[Information, ...]
    secondary: tuple[Line, ...]
    origin: Line
    """``built in``, a plug-in's distribution, or the path of a method file."""
    environment: Environment


class Own(Plain):
    """What is a run's own."""

    run_id: Annotated[str, Field(pattern="^[0-9a-f]{16}-[0-9a-f]+$")]
    run: Count
    """Number of the run within its cell, from 0."""
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
    used: tuple[Information, ...]
    meter: Spent | None
    """None where it went with the process."""
    details: Values
    rewards: tuple[Reward | None, ...]
    """Of each trial; None where it failed."""
    timing: Timing


class Record(Common, Own):
    """One run."""

    specification: Specification

    @property
    def method(self) -> str:
        """Id of the method."""
        return self.specification.method

    @property
    def task(self) -> Task:
        """The task as it was run. Raises TaskError where it cannot be one."""
        return _parsed(Itself(self.specification.task))

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
        parts = (_canonical(getattr(self, name)) for name in _OUTCOME)
        return hashlib.sha256(b"[" + b",".join(parts) + b"]").hexdigest()[:16]

    def check(self) -> None:
        """The record agrees with itself, and its solutions give their scores again.

        Raises RecordError that names the run otherwise. Not seen here, because nothing
        stored can show it: what a method spent and how long it took.
        """
        check_together([self])

    def disagreement(self) -> str | None:
        """The first law that the record breaks by what it states; None where it breaks none."""
        return next(_broken_laws(self), None)


# In JSON of numbers that Python writes in another way, and in no word of a record's outcome.
_OTHERWISE = (b"0.0000", b"e-", b"e+", b"e1", b"e2", b"e3")


def _canonical(part: Any) -> bytes:
    """:func:`coartic.runs.stored.canonical` of a part of a record, at a tenth of its cost."""
    content = part
    if isinstance(part, Solved):
        rows = [dict(sorted(vars(row).items())) for row in part.movements]
        content = dict(sorted({**vars(part), "movements": rows}.items()))
    text = to_json(content)
    if not any(mark in text for mark in _OTHERWISE):
        return text
    return canonical(part.model_dump(mode="json") if isinstance(part, Solved) else part)


SOLUTIONS = ("solution", "initial", "replay")
"""What a record may hold of these: each is executed again to check it."""


def check_together(records: Sequence[Record]) -> None:
    """:meth:`Record.check` of each, at a fraction of its cost where many are of one task.

    Raises RecordError for the first that does not pass.
    """
    for error in _errors_in(records):
        if error is not None:
            raise error


def _errors_in(records: Sequence[Record]) -> list[RecordError | None]:
    """What each record breaks; None where it breaks nothing."""
    words: list[str | None] = []
    asked: dict[tuple[Itself, MotionModel], list[tuple[int, str, Solved]]] = {}
    for number, record in enumerate(records):
        problem = record.disagreement()
        words.append(problem and f"run {record.run_id} contradicts itself: {problem}")
        for name in SOLUTIONS if problem is None else ():
            stored: Solved | None = getattr(record, name)
            if stored is not None:
                try:
                    whose = Itself(record.task), record.model
                except (CoarticError, ValueError, TypeError) as error:
                    words[-1] = words[-1] or _difference(record, name, stored, error)
                else:
                    asked.setdefault(whose, []).append((number, name, stored))
    for (task, model), own in asked.items():
        again = scored_together(task.object, [stored.movements for _, _, stored in own], model)
        for (number, name, stored), found in zip(own, again, strict=True):
            words[number] = words[number] or _difference(records[number], name, stored, found)
    return [None if text is None else RecordError(text) for text in words]


def _difference(record: Record, name: str, stored: Solved, again: Solved | Unscored) -> str | None:
    if not isinstance(again, Solved):
        return f"run {record.run_id}: its {name} cannot be executed: {again}"
    if again != stored:
        return (
            f"run {record.run_id}: its {name}, executed again, gives {again.brief()} "
            f"instead of {stored.brief()}"
        )
    return None


def in_lots(records: Iterable[Record]) -> Iterator[list[Record]]:
    """Records in their order, in lots to be checked together: few where they are large."""
    lot: list[Record] = []
    size = 0
    for record in records:
        lot.append(record)
        size += len(record.rewards)
        if len(lot) == _LOT or size >= _LOT_TRIALS:
            yield lot
            lot, size = [], 0
    if lot:
        yield lot


_Trials = tuple[list[int], int]
"""Rewards of the trials that hit every goal; number of the others."""


def _broken_laws(record: Record) -> Iterator[str]:
    trials = _trials(record)
    yield from _broken_by_outcome(record)
    yield from _broken_by_spending(record, trials)
    if record.method.startswith(METHOD_PREFIX):
        yield from _broken_by_learning(record, trials)


def _broken_by_outcome(record: Record) -> Iterator[str]:
    ok, solution = record.status == "ok", record.solution
    if record.run_id != f"{record.specification.key()}-{record.code}":
        yield "its id is not the hash of its specification and code"
    if ok != (solution is not None):
        yield "status and solution"
    if ok == bool(record.reason):
        yield "status and reason"
    if ok and record.meter is None:
        yield "it is solved, and nothing was spent"
    if not set(record.used) <= set(record.told):
        yield "it used what it was not told"
    if record.bound is None:
        return
    if not record.method.startswith(SEARCH):
        yield f"a bound is for methods {SEARCH}*"
    if solution is not None and solution.reward > record.bound:
        yield "its reward is above the bound it proves"


def _broken_by_spending(record: Record, trials: _Trials) -> Iterator[str]:
    spent, (known, failed) = record.meter, trials
    if spent is None:
        return
    if len(record.rewards) > spent.trials:
        yield "more rewards than trials"
    if failed > spent.failed_trials:
        yield "more failed rewards than failed trials"
    if -sum(known) > spent.movement_ticks:
        yield "its trials' rewards are more than its ticks"


def _broken_by_learning(record: Record, trials: _Trials) -> Iterator[str]:
    spent, rewards, asked = record.meter, record.rewards, record.specification
    known, failed = trials
    policy = asked.task.get("initial_hands") in INITIAL_POLICIES  # it makes trials of its own
    if spent is not None and rewards and not policy:
        if (spent.trials, spent.failed_trials) != (len(rewards), failed):
            yield "its counts of trials are not those of its rewards"
        if not failed and spent.movement_ticks != -sum(known):
            yield "its ticks are not those of its trials"
    if asked.parameters.get("learned") == "replay":
        if record.solution != record.replay:
            yield "what was learned is not its replay"
    elif (record.solution and record.solution.reward) != max(known, default=None):
        yield "the learned reward is not the best of its trials"
    if rewards and rewards[0] != (record.initial and record.initial.reward):
        yield "the initial reward is not that of trial 0"
    counts = corrections_of(record)
    if record.status == "ok" and rewards and counts is None:
        yield "its corrections by trial are no counts"
    if spent and counts and not policy and sum(counts) != spent.corrections:
        yield "its corrections by trial do not add up to those it spent"
    if spent is None or not rewards or asked.trial_budget is not None:
        return
    if len(rewards) != asked.parameters.get("trials"):
        yield "its trials are not those it was asked for"


def corrections_of(record: Record) -> list[int] | None:
    """Corrective movements of a learner in trial 0 and in each tenth of the others.

    None for other methods, and where they are not stored.
    """
    counts = record.details.get(CORRECTIONS)
    if not record.method.startswith(METHOD_PREFIX) or not isinstance(counts, list):
        return None
    whole = [n for n in counts if isinstance(n, int) and not isinstance(n, bool) and n >= 0]
    return whole if len(whole) == len(counts) == 1 + PARTS else None


def _trials(record: Record) -> _Trials:
    known = [reward for reward in record.rewards if reward is not None]
    return known, len(record.rewards) - len(known)


@lru_cache(maxsize=64)
def _parsed(content: Itself) -> Task:
    """Once for the records of a pack."""
    return parse_task(content.object, "a record")


def run_seeds(root: int, task: str, count: int) -> list[int]:
    """Seeds of the runs of a task, from the suite's seed, the task's name and their numbers alone.

    Every method gets the same seed for the same task and run, so runs are paired. Run ``k`` has
    the first 63 bits of NumPy's ``SeedSequence(root, spawn_key=(*words, k))``, ``words`` being
    four of the SHA-256 of the name; all are made at once, as that class takes in the last word.
    """
    words = np.frombuffer(hashlib.sha256(task.encode()).digest()[:16], dtype="<u4")
    pool = np.random.SeedSequence(root, spawn_key=tuple(map(int, words))).pool
    taken = 4 * (1 + 3 + len(words))  # steps so far: the root, its parts together, the name
    factor = _ENTER * pow(_ENTER_BY, taken, 1 << 32) & _WORD
    number, mixed = np.arange(count, dtype=np.uint32), []
    for part in pool.tolist():
        hashed, factor = _hashed(number, factor, _ENTER_BY)
        both = np.uint32(_MIX_LEFT * part & _WORD) - np.uint32(_MIX_RIGHT) * hashed
        mixed.append(both ^ both >> _HALF)
    (low, factor), high = _hashed(mixed[0], _LEAVE, _LEAVE_BY), mixed[1]
    high, _ = _hashed(high, factor, _LEAVE_BY)
    whole = high.astype(np.uint64) << np.uint64(32) | low
    found: list[int] = (whole >> np.uint64(1)).tolist()
    return found


# Of NumPy's SeedSequence, which promises to stay as it is.
_ENTER, _ENTER_BY = 0x43B0D7E5, 0x931E8875
_LEAVE, _LEAVE_BY = 0x8B51F9DD, 0x58F38DED
_MIX_LEFT, _MIX_RIGHT = 0xCA01F9DD, 0x4973F715
_WORD, _HALF = (1 << 32) - 1, np.uint32(16)
_Words = NDArray[np.uint32]


def _hashed(words: _Words, factor: int, by: int) -> tuple[_Words, int]:
    """A step of SeedSequence's hash: the words (n,), and the factor of the next step."""
    following = factor * by & _WORD
    found = (words ^ np.uint32(factor)) * np.uint32(following)
    return found ^ found >> _HALF, following
