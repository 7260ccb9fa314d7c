"""From what a worker states of runs to the runs that are kept: executed and scored here, where the
method has never been."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from coartic.benchmarks.pool import Failure
from coartic.benchmarks.provenance import environment, now
from coartic.benchmarks.registry import Entry
from coartic.benchmarks.worker import Answer, Outcome, PlainMovement
from coartic.errors import CoarticError, IncompleteError, SolutionError
from coartic.learner.kernel import PARTS as TENTHS
from coartic.learner.learning import CORRECTIONS
from coartic.method import Information, Meter
from coartic.model import MotionModel
from coartic.motion.solution import Execution, Movement, execute, other_arm_travel
from coartic.robot import Hand
from coartic.runs.plan import SEARCH
from coartic.runs.store import PARTS, RESULTS, Environment, Run
from coartic.tasks.task import Task, hands_of
from coartic.text import LONGEST_REASON, plain

MOST_MOVEMENTS = 10_000
"""Movements of one solution."""
MOST_STEPS = 1_000_000
"""Movement steps along one solution, its targets visited in order: thousands do."""
_STATUSES = frozenset({"ok", "infeasible", "solver-failed", "crashed"})
_EMPTY = dict.fromkeys(RESULTS)


def kept(
    names: Sequence[Mapping[str, Any]],
    answer: Answer | Failure,
    task: Task,
    entry: Entry,
    model: MotionModel,
) -> list[Run]:
    """The runs of a job as they are kept, also of one that failed.

    ``names`` are what identifies each: its id, number, seed and so on.
    """
    if isinstance(answer, Failure):
        times: dict[str, Any] = {"wall_s": answer.wall_s}
        return [_run(name, Outcome(answer.status, answer.reason), {}, times) for name in names]
    times = {
        "wall_s": answer.wall_s / len(names),
        "cpu_s": answer.cpu_s / len(names),
        "warm": answer.warm,
        "together": len(names),
        "process_peak_mb": answer.process_peak_mb,
    }
    runs = []
    for name, outcome in zip(names, answer.outcomes, strict=True):
        executions: dict[str, Execution] = {}
        try:
            _check(outcome, entry)
            executions = {
                part: scored(task, [_movement(row) for row in outcome.parts[part]], model)
                for part in PARTS
                if outcome.status == "ok" and (part == "solution" or part in outcome.parts)
            }
        except _FalseClaimError as error:
            outcome = Outcome(error.status, str(error))
        except IncompleteError as error:
            outcome = _ended(outcome, "infeasible", str(error))
        except (CoarticError, ValueError, TypeError, KeyError, OverflowError) as error:
            outcome = _ended(outcome, "solver-failed", f"the solution cannot be executed: {error}")
        made_with = environment()
        if answer.environment is not None:
            made_with = Environment(**answer.environment)
        runs.append(_run(name, outcome, executions, times, task, made_with))
    return runs


def scored(task: Task, solution: Sequence[Movement], model: MotionModel) -> Execution:
    """Execute a solution: the only score that counts.

    Raises SolutionError where it breaks the task's rules, IncompleteError where it does not
    hit every goal.
    """
    if len(solution) > MOST_MOVEMENTS:
        raise SolutionError(f"{len(solution)} movements; at most {MOST_MOVEMENTS} are allowed")
    corners = [task.q0]
    for movement in solution:
        corners += [] if movement.waypoints is None else list(movement.waypoints)
        corners += [] if movement.target is None else [movement.target]
    if len({len(corner) for corner in corners}) == 1:  # or it breaks the rules
        steps = float(np.linalg.norm(np.diff(corners, axis=0), axis=1).sum()) / model.step
        if steps > MOST_STEPS:
            raise SolutionError(f"its path has {steps:.0f} steps; at most {MOST_STEPS} are allowed")
    execution = execute(task, solution, model=model)
    if not execution.completed:
        raise IncompleteError(execution.reason)
    return execution


class _FalseClaimError(Exception):
    """A method claims what it may not."""

    def __init__(self, status: str, reason: str) -> None:
        super().__init__(reason)
        self.status = status


def _check(outcome: Outcome, entry: Entry) -> None:
    """Raises _FalseClaimError for an outcome that its method cannot have."""
    used = {*outcome.used}
    if any(kind == "corrective" and target is None
           for _, _, kind, target, _ in outcome.parts.get("solution", [])):  # fmt: skip
        used.add(Information.CORRECTIVE_PROCESS.value)
    undeclared = sorted(used - {*entry.told})
    if undeclared:
        raise _FalseClaimError(
            "crashed", f"the method used {undeclared[0]!r}, which it does not declare"
        )
    if outcome.status not in _STATUSES:
        raise _FalseClaimError("solver-failed", f"it states the status {outcome.status!r}")
    if outcome.bound is not None and not entry.name.startswith(SEARCH):
        raise _FalseClaimError(
            "solver-failed", f"it states a bound, which is for this project's methods {SEARCH}*"
        )


def _ended(outcome: Outcome, status: str, reason: str) -> Outcome:
    """An outcome whose solution is none."""
    return Outcome(
        status, reason, details=outcome.details, used=outcome.used, meter=outcome.meter,
        rewards=outcome.rewards,
    )  # fmt: skip


def _movement(row: PlainMovement) -> Movement:
    goal, hand, kind, target, waypoints = row
    return Movement(
        goal,
        hand,  # type: ignore[arg-type]
        kind,  # type: ignore[arg-type]
        None if target is None else np.array(target),
        waypoints=None if waypoints is None else np.array(waypoints),
    )


def _run(
    name: Mapping[str, Any],
    outcome: Outcome,
    executions: Mapping[str, Execution],
    times: Mapping[str, Any],
    task: Task | None = None,
    made_with: Environment | None = None,
) -> Run:
    """A run as it is kept."""
    solution = executions.get("solution")
    rewards = outcome.rewards
    corrections: Any = outcome.details.get(CORRECTIONS)
    counted = isinstance(corrections, list) and len(corrections) == 1 + TENTHS
    row = {
        **_EMPTY,
        **name,
        **times,
        **{key: outcome.meter.get(key) for key in vars(Meter())},
        "status": outcome.status,
        "reason": "" if outcome.status == "ok" else _reason(outcome.reason),
        "early_corrections": corrections[1] if counted else None,
        "late_corrections": corrections[-1] if counted else None,
        "proven_bound": outcome.bound,
        "date": now(),
        "used": ", ".join(outcome.used),
        "details": json.dumps(outcome.details),
    }
    for prefix, part in (("", "solution"), ("initial_", "initial"), ("replay_", "replay")):
        if (execution := executions.get(part)) is not None:
            row |= {f"{prefix}reward": execution.reward, f"{prefix}hands": execution.hands}
    if solution is not None:
        assert task is not None
        hands: Sequence[Hand] = hands_of(solution.hands)
        row |= {
            "best_trial": rewards.index(solution.reward) if solution.reward in rewards else None,
            "solution_corrections": solution.corrections,
            "other_arm_travel": other_arm_travel(task, hands, solution.configurations),
        }
    movements = {part: execution.movements for part, execution in executions.items()}
    del row["setting"], row["environment"]
    row["result"] = result_of(row, movements, rewards)
    return Run(row, made_with or environment(), movements, rewards)


def result_of(
    row: Mapping[str, Any],
    movements: Mapping[str, Sequence[Movement]],
    rewards: Sequence[int | None],
) -> str:
    """Hash of status, solutions to the last joint, rewards of all trials, bound.

    Equal for runs that came out the same, whatever was spent on the way.
    """
    parts: list[Any] = [row["status"], row["proven_bound"], list(rewards)]
    for part in PARTS:
        for own in movements.get(part, ()):
            assert own.target is not None
            points = None if own.waypoints is None else own.waypoints.tolist()
            parts.append(
                [part, own.goal, own.hand, own.kind, own.ticks, own.target.tolist(), points]
            )
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:16]


def _reason(text: str) -> str:
    return plain(text, LONGEST_REASON) or "it gave no reason"
