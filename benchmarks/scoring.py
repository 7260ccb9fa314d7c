"""Execute and score the solutions that workers return, in a process that imports no method file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from coartic.benchmarks.provenance import current_environment, now
from coartic.internal.text import LONGEST_REASON, plain
from coartic.motion.execution import Execution, execute_noisy, other_arm_travel
from coartic.runs.plan import Job
from coartic.runs.record import (
    MOTOR_NOISE,
    NOISY_EXECUTIONS,
    Outcome,
    Run,
    Score,
    execute_all,
)
from coartic.tasks.task import Task, hands_of


def score(job: Job, outcomes: Sequence[Outcome]) -> list[Run]:
    """Execute the movements of a job's outcomes, and return its scored runs.

    Parts of an outcome (``solution``, ``initial``, ``replay``) that are too long or break the rules
    of the task are not executed. Only runs with status ok have scores.

    Parameters
    ----------
    job : Job
    outcomes : sequence of Outcome
        Outcome of each run of the job.

    Returns
    -------
    list of Run
    """
    task, method = job.cell.task, job.cell.method
    imports = {} if method.is_ours else {"imports": method.packages}
    solutions = [movements for outcome in outcomes for movements in outcome.parts.values()]
    executions = iter(execute_all(task, solutions))
    runs = []
    for number, outcome in zip(job.numbers, outcomes, strict=True):
        parts = {part: next(executions) for part in outcome.parts}
        status, reason = _final_status(outcome, parts)
        is_ok = status == "ok"
        final = replace(
            outcome,
            status=status,  # type: ignore[arg-type]
            reason="" if is_ok else plain(reason, LONGEST_REASON) or "it gave no reason",
            parts={},
            environment=current_environment() | imports | (outcome.environment or {}),
        )
        scores = {
            part: _score_of(task, part, execution) for part, execution in parts.items() if is_ok
        }
        runs.append(Run(replace(job, numbers=(number,)), final, scores, now()))
    return with_noise(runs)


def with_noise(runs: Sequence[Run]) -> list[Run]:
    """Set ``noisy_ticks`` in the scores of solutions, and return the runs.

    ``noisy_ticks`` is the mean number of ticks over executions with motor noise, or None if an
    execution fails. The seed of the noise is made from the id of the run, so the number does not
    depend on the other runs. All runs must be on one task.
    """
    solved = {run.id: run for run in runs if "solution" in run.scores}
    seeds = [int(run_id.partition("-")[0], 16) for run_id in solved]
    solutions = [run.solution.movements for run in solved.values()]
    noisy = dict[str, float]()
    if solved:
        task = runs[0].cell.task
        ticks = execute_noisy(task, solutions, MOTOR_NOISE, NOISY_EXECUTIONS, seeds)
        noisy = dict(zip(solved, ticks.mean(axis=1).tolist(), strict=True))
    scored = []
    for run in runs:
        if run.id in noisy:
            mean = None if np.isnan(noisy[run.id]) else noisy[run.id]
            solution = run.solution._replace(noisy_ticks=mean)
            run = replace(run, scores=run.scores | {"solution": solution})
        scored.append(run)
    return scored


def _score_of(task: Task, part: str, execution: Execution | Exception) -> Score:
    """Return the score of a part of a run that completed the task.

    Only the score of a solution has corrections and the travel of the idle arm.
    """
    assert isinstance(execution, Execution)
    result = Score(execution.reward, execution.hands, execution.movements)
    if part != "solution":
        return result
    travel = other_arm_travel(task, hands_of(execution.hands), execution.configurations)
    return result._replace(corrections=execution.corrections, other_arm_travel=travel)


def _final_status(outcome: Outcome, parts: Mapping[str, Execution | Exception]) -> tuple[str, str]:
    """Return status and reason of a run after the execution of its parts.

    - ``solver-failed`` if a part cannot be executed, or if an outcome that is ok has no solution;
    - ``infeasible`` if a part misses a goal;
    - otherwise the status of the outcome.
    """
    for execution in parts.values():
        if isinstance(execution, Exception):
            return "solver-failed", f"the solution cannot be executed: {execution}"
        if not execution.completed:
            return "infeasible", execution.reason
    if outcome.status == "ok" and "solution" not in parts:
        return "solver-failed", "it reported ok, but returned no solution"
    return outcome.status, outcome.reason
