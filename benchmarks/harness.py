"""Performs a plan: what the store lacks is run, scored, and kept as soon as it is done."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from typing import Annotated

from pydantic import Field, ValidationError

from coartic import CoarticError
from coartic.benchmarks.executors import Answer, Executor, Local
from coartic.benchmarks.provenance import surroundings
from coartic.benchmarks.specification import RunSpec
from coartic.benchmarks.store import Damage, Store
from coartic.errors import IncompleteError
from coartic.inputs import problems_inline
from coartic.method import Information
from coartic.runs.record import SEARCH, SOLUTIONS, Environment, Record, Status, Timing
from coartic.runs.scores import MOST_MOVEMENTS, PlainMovement, Solved, Unscored, scored_together
from coartic.runs.stored import Plain, Reward, Spent, Values
from coartic.text import counted, plain

Handed = Annotated[tuple[PlainMovement, ...], Field(max_length=MOST_MOVEMENTS)]
MOST_REWARDS = 1_000_000
"""Trials whose rewards are kept of a method that is not built in."""
LEAST_TOGETHER = 8
"""Runs of a cell that are not divided among workers."""
_ROUNDS = 3  # in a row without a single answer, after which runs are given up
_PARTS = 8  # of a lot that went wrong, or took too long, are performed by themselves
_SURE = frozenset({"ok", "infeasible"})  # whoever was beside
RETRIED = frozenset({"timeout", "crashed"})


@dataclass
class Progress:
    """How far a plan is."""

    total: int
    present: int = 0
    """Runs whose record was there before."""
    done: int = 0
    """Runs performed now."""
    failed: int = 0
    """Of all records, those that are not ok."""
    damaged: list[Damage] = field(default_factory=list)
    stale: list[str] = field(default_factory=list)


Watcher = Callable[[Progress, RunSpec | None], None]


def perform_missing(
    specs: Sequence[RunSpec],
    store: Store,
    executor: Executor,
    *,
    retry_failed: bool = False,
    redo: bool = False,
    watch: Watcher = lambda progress, spec: None,
) -> Progress:
    """Perform every run that the store, which the caller has locked, has no good record of.

    A record is good where it is as it was written and agrees with itself
    (:meth:`coartic.runs.record.Record.check`). One that timed out under a shorter limit than now
    asked for is redone, and with ``retry_failed`` every timeout and crash is; ``redo`` performs
    everything anew. ``watch`` is called before the first run and after each. Raises CoarticError
    where records cannot be written or runs keep getting lost.
    """
    by_id = {spec.run_id: spec for spec in specs}
    progress = Progress(total=len(by_id))
    progress.stale = store.stale(by_id)
    missing = dict(by_id)
    if not redo:
        for record in store.read_known(by_id):
            if isinstance(record, Damage):
                progress.damaged.append(record)
                store.set_aside(record)
            elif not _to_redo(record, by_id[record.run_id], retry_failed):
                del missing[record.run_id]
                progress.present += 1
                progress.failed += record.status != "ok"
    watch(progress, None)
    idle = 0
    at_most: dict[str, int] = {}  # that a run is performed together with, itself among them
    while missing and idle < _ROUNDS:
        idle += 1
        lots = {lot[0].run_id: lot for lot in _lots(missing.values(), at_most, _workers(executor))}
        jobs = [lot[0].setting.job(lot) for lot in lots.values()]
        for answer in executor.perform(jobs):
            lot, idle = lots.pop(answer["run_id"]), 0
            records = records_of(answer, lot)
            if len(lot) > 1:  # one that went wrong beside others may have had it from them
                doubtful = {r.run_id for r in records if r.status not in _SURE}
                at_most |= dict.fromkeys(doubtful, max(1, len(lot) // _PARTS))
                records = [record for record in records if record.run_id not in doubtful]
            store.write(records)
            for record in records:
                progress.done += 1
                progress.failed += record.status != "ok"
                watch(progress, missing.pop(record.run_id))
    if missing:
        raise CoarticError(
            f"{len(missing)} runs were lost again and again because their workers died. "
            "Finished runs are kept; repeat the command to resume."
        )
    return progress


def _workers(executor: Executor) -> int:
    return executor.workers if isinstance(executor, Local) else 1


def _lots(
    specs: Collection[RunSpec], at_most: Mapping[str, int], workers: int
) -> Iterator[Sequence[RunSpec]]:
    """Runs that are performed side by side; results do not depend on which these are.

    Where there are few, each worker has its part; of many, the last lots are divided that would
    not go round. But lots are not made smaller than :data:`LEAST_TOGETHER`: a run beside many
    takes a fraction of its time alone.
    """
    share = max(math.ceil(len(specs) / workers), LEAST_TOGETHER)
    lots: list[list[RunSpec]] = []
    for _, group in groupby(specs, key=lambda spec: id(spec.setting)):
        together: list[RunSpec] = []
        room = 0
        for spec in group:
            most = min(spec.setting.most_together, share)
            most = min(most, at_most.get(spec.run_id, most))
            if len(together) >= min(room, most):
                together, room = [], most
                lots.append(together)
            together.append(spec)
            room = min(room, most)
    left = len(lots) % workers
    whole = len(lots) - left
    yield from lots[:whole]
    for lot in lots[whole:]:
        size = max(math.ceil(len(lot) * left / workers), LEAST_TOGETHER)
        yield from (lot[first : first + size] for first in range(0, len(lot), size))


def _to_redo(record: Record, spec: RunSpec, retry_failed: bool) -> bool:
    if record.status not in RETRIED:
        return False
    if retry_failed:
        return True
    had, has = record.timing.time_limit_s, spec.limits.time_s
    return record.status == "timeout" and had is not None and (has is None or has > had)


class Outcome(Plain):
    """What a worker states of a run: typed and bounded, and believed in no more than that."""

    status: Status
    reason: str = ""
    solution: Handed = ()
    initial: Handed = ()
    replay: Handed = ()
    bound: Reward | None = None
    details: Values = Field(default_factory=dict)
    used: tuple[Information, ...] = ()
    meter: Spent | None = None
    rewards: tuple[Reward | None, ...] = ()


class Made(Plain):
    """In which time each of the runs of an answer was made, and with what."""

    timing: Timing
    environment: Environment


class _Answered(Made):
    runs: tuple[Outcome, ...]


class _Said(Plain):
    """An answer of a worker."""

    error: str | None
    foreign_code: bool = False
    answer: _Answered | None


def record_of(answer: Answer, spec: RunSpec) -> Record:
    """The record of a run that was performed alone; see :func:`records_of`."""
    (record,) = records_of(answer, [spec])
    return record


def records_of(answer: Answer, specs: Sequence[RunSpec]) -> list[Record]:
    """The records of an answer, also of one that says how the runs failed.

    Solutions are executed and scored here, where the method has never been, by the
    specification's own task and model. Raises CoarticError where the answer comes from
    other code than was asked for.
    """

    def failed(status: Status, reason: str, wall_s: float = 0.0) -> list[Record]:
        return [_failure(spec, status, reason, wall_s) for spec in specs]

    if "outcome" not in answer:
        return failed(answer["failure"], answer["reason"], answer["wall_s"])
    try:
        said = _Said.model_validate_json(answer["outcome"])
    except ValidationError as error:
        reason = f"what it handed over cannot be kept: {problems_inline(error)}"
        return failed("solver-failed", reason)
    if said.foreign_code and specs[0].entry.foreign is None:
        raise CoarticError(plain(said.error or "other code"))
    if said.answer is None:
        return failed("crashed", said.error or "it gave no answer")
    outcomes = said.answer.runs
    if len(outcomes) != len(specs):
        reason = f"it answers for {counted(len(outcomes), 'run')} of {len(specs)}"
        return failed("solver-failed", reason)
    given = [_handed(outcome) for outcome in outcomes]
    found = iter(
        scored_together(
            specs[0].task, [rows for own in given for rows in own.values()], specs[0].model
        )
    )
    return [
        _scored(spec, outcome, said.answer, {name: next(found) for name in own})
        for spec, outcome, own in zip(specs, outcomes, given, strict=True)
    ]


def _scored(
    spec: RunSpec, outcome: Outcome, made: Made, found: Mapping[str, Solved | Unscored]
) -> Record:
    false = _false_claim(spec, outcome)
    if false is not None:
        return _failure(spec, *false)
    scores = {name: score for name, score in found.items() if isinstance(score, Solved)}
    unsolved = next((score for score in found.values() if not isinstance(score, Solved)), None)
    if unsolved is None:
        record = _record(spec, outcome, made, **scores)
    else:
        record = _record(spec, outcome.model_copy(update=_ending(unsolved)), made)
    problem = record.disagreement()
    if problem is not None:
        return _failure(spec, "solver-failed", f"what it states contradicts itself: {problem}")
    return record


def _false_claim(spec: RunSpec, outcome: Outcome) -> tuple[Status, str] | None:
    """The outcome of a run that claims what its method may not; None where it does not."""
    told = spec.entry.declared.told
    used = {*outcome.used}
    if any(row.kind == "corrective" and row.target is None for row in outcome.solution):
        used.add(Information.CORRECTIVE_PROCESS)
    undeclared = sorted(used - {*told})
    trials = len(outcome.rewards)
    if undeclared:
        return "crashed", f"the method used {undeclared[0].value!r}, which it does not declare"
    if spec.entry.foreign is not None and trials > MOST_REWARDS:
        return "solver-failed", f"it states {trials} rewards; at most {MOST_REWARDS} are kept"
    if outcome.bound is not None and not spec.method.startswith(SEARCH):
        return (
            "solver-failed",
            f"it states a bound, which is for methods {SEARCH}* of this project",
        )
    return None


def _handed(outcome: Outcome) -> dict[str, Handed]:
    """What an outcome hands over to be executed."""
    if outcome.status != "ok":
        return {}
    return {
        name: movements
        for name in SOLUTIONS
        if (movements := getattr(outcome, name)) or name == "solution"
    }


def _ending(unscored: Unscored) -> dict[str, str]:
    """How a run ended that hands over as a solution what is none."""
    if isinstance(unscored, IncompleteError):
        return {"status": "infeasible", "reason": str(unscored)}
    return {
        "status": "solver-failed",
        "reason": f"the solution cannot be executed: {unscored}",
    }


def _failure(spec: RunSpec, status: Status, reason: str, wall_s: float = 0.0) -> Record:
    """The record of a run that has left nothing but how it ended."""
    timing = Timing(wall_s=wall_s, time_limit_s=spec.limits.time_s)
    made = Made(timing=timing, environment=surroundings())
    return _record(spec, Outcome(status=status, reason=reason), made)


def _record(spec: RunSpec, outcome: Outcome, made: Made, **scores: Solved) -> Record:
    good = outcome.status == "ok"
    return Record(
        run_id=spec.run_id,
        run=spec.run,
        specification=spec.specification,
        code=spec.entry.code,
        status=outcome.status,
        reason="" if good else plain(outcome.reason) or "it gave no reason",
        solution=scores.get("solution"),
        initial=scores.get("initial"),
        replay=scores.get("replay"),
        bound=outcome.bound if good else None,
        told=spec.entry.declared.told,
        secondary=spec.entry.declared.secondary,
        used=tuple(item for item in outcome.used if item in spec.entry.declared.told),
        meter=outcome.meter,
        details=outcome.details,
        rewards=outcome.rewards,
        timing=made.timing.model_copy(update={"time_limit_s": spec.limits.time_s}),
        origin=spec.entry.origin,
        environment=made.environment,
    )
