"""From what a worker states of runs to the runs that are kept: executed and scored here, where the
method has never been."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from coartic.benchmarks.provenance import environment, now
from coartic.benchmarks.worker import Answer, Outcome
from coartic.errors import SolutionError
from coartic.learner.kernel import TENTHS
from coartic.learner.run import CORRECTIONS
from coartic.method import Meter
from coartic.model import MotionModel
from coartic.motion.solution import Execution, Movement, execute_many, other_arm_travel
from coartic.robot import Hand
from coartic.runs.store import PARTS, RESULTS, Run
from coartic.tasks.task import Task, hands_of
from coartic.text import LONGEST_REASON, plain

MOST_MOVEMENTS = 10_000
"""Movements of one solution."""
MOST_STEPS = 1_000_000
"""Movement steps along one solution, its targets visited in order: thousands do."""
_EMPTY = dict.fromkeys(RESULTS)


def kept(
    identities: Sequence[Mapping[str, Any]],
    answer: Answer,
    task: Task,
    model: MotionModel,
) -> list[Run]:
    """The runs of a job as they are kept, also of one that failed.

    ``identities`` say which each is: its id, number, seed and so on.
    """
    times = {
        "wall_s": None if answer.wall_s is None else answer.wall_s / len(identities),
        "cpu_s": None if answer.cpu_s is None else answer.cpu_s / len(identities),
        "warm": answer.warm,
        "together": len(identities),
        "process_peak_mb": answer.process_peak_mb,
    }
    made_with = answer.environment or environment()
    outcomes = list(answer.outcomes)
    parts = [(n, part) for n, outcome in enumerate(outcomes) for part in outcome.parts]
    solutions = [outcomes[n].parts[part] for n, part in parts]
    executions: list[dict[str, Execution]] = [{} for _ in outcomes]
    for (n, part), execution in zip(parts, scored(task, solutions, model), strict=True):
        if isinstance(execution, Exception):
            why = f"the solution cannot be executed: {execution}"
            outcomes[n] = ended(outcomes[n], "solver-failed", why)
        elif execution.completed:
            executions[n][part] = execution
        else:
            outcomes[n] = ended(outcomes[n], "infeasible", execution.reason)
    for n, outcome in enumerate(outcomes):
        if outcome.status == "ok" and "solution" not in executions[n]:
            outcomes[n] = ended(
                outcome, "solver-failed", "it reported ok, but returned no solution"
            )
    return [
        run_of(identity, outcome, parts if outcome.status == "ok" else {}, times, task, made_with)
        for identity, outcome, parts in zip(identities, outcomes, executions, strict=True)
    ]


def scored(
    task: Task, solutions: Sequence[Sequence[Movement]], model: MotionModel
) -> list[Execution | Exception]:
    """Execute solutions side by side: the only scores that count.

    In place of an execution, the error of a solution that breaks the task's rules.
    """
    errors = [too_long(task, solution, model) for solution in solutions]
    short = [s for s, error in zip(solutions, errors, strict=True) if error is None]
    executions = iter(execute_many(task, short, model=model))
    return [next(executions) if error is None else error for error in errors]


def too_long(task: Task, solution: Sequence[Movement], model: MotionModel) -> SolutionError | None:
    """What is wrong with a solution that would take very long to execute."""
    if len(solution) > MOST_MOVEMENTS:
        return SolutionError(f"{len(solution)} movements; at most {MOST_MOVEMENTS} are allowed")
    corners = [task.q0]
    for movement in solution:
        corners += [] if movement.waypoints is None else list(movement.waypoints)
        corners += [] if movement.target is None else [movement.target]
    if len({np.shape(corner) for corner in corners}) == 1:  # or it breaks the rules
        steps = np.sqrt((np.diff(corners, axis=0) ** 2).sum(axis=1)).sum() / model.step
        if steps > MOST_STEPS:
            return SolutionError(
                f"its path has {steps:.0f} steps; at most {MOST_STEPS} are allowed"
            )
    return None


def ended(outcome: Outcome, status: str, reason: str) -> Outcome:
    """An outcome whose solution is none."""
    return replace(outcome, status=status, reason=reason, parts={}, bound=None)


def run_of(
    identity: Mapping[str, Any],
    outcome: Outcome,
    executions: Mapping[str, Execution],
    times: Mapping[str, Any],
    task: Task,
    made_with: dict[str, Any],
) -> Run:
    """A run as it is kept."""
    solution = executions.get("solution")
    rewards = outcome.rewards
    corrections: Any = outcome.details.get(CORRECTIONS)
    counted = isinstance(corrections, list) and len(corrections) == 1 + TENTHS
    reason = plain(outcome.reason, LONGEST_REASON) or "it gave no reason"
    row = {
        **_EMPTY,
        **identity,
        **times,
        **{key: outcome.meter.get(key) for key in vars(Meter())},
        "status": outcome.status,
        "reason": "" if outcome.status == "ok" else reason,
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
        hands: Sequence[Hand] = hands_of(solution.hands)
        row |= {
            "best_trial": rewards.index(solution.reward) if solution.reward in rewards else None,
            "solution_corrections": solution.corrections,
            "other_arm_travel": other_arm_travel(task, hands, solution.configurations),
        }
    movements = {part: execution.movements for part, execution in executions.items()}
    del row["setting"], row["environment"]
    row["result"] = result_of(row, movements, rewards)
    return Run(row, made_with, movements, rewards)


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
        for m in movements.get(part, ()):
            parts.append([part, *facts_of(m)])
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:16]


def facts_of(movement: Movement) -> list[Any]:
    """A movement as plain data. SQLite keeps no sign of zero; adding 0.0 loses it here as well."""
    arrays = (movement.target, movement.waypoints)
    places = [None if array is None else (array + 0.0).tolist() for array in arrays]
    return [movement.goal, movement.hand, movement.kind, movement.ticks, *places]
