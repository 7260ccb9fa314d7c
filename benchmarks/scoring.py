"""Execute and score the solutions of runs, in a process that imports no method file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from coartic.benchmarks.provenance import current_environment, now
from coartic.internal.text import MAX_REASON_LENGTH, plain
from coartic.motion.execution import Execution
from coartic.motion.solution import Movement, next_action
from coartic.runs.plan import Job
from coartic.runs.record import Outcome, Row, execute_all, judged, row_of


def score(job: Job, outcomes: Sequence[Outcome]) -> list[Row]:
    """Execute the movements in the outcomes of a job, and return the scored runs.

    An outcome has up to three parts: ``solution``, ``initial`` (the first trial of a learner) and
    ``replay`` (a greedy trial after learning).

    - A part that is too long or breaks the rules of the task is not executed; the run then has
      status ``solver-failed``.
    - A row contains movements and a score only if the final status of its run is ``ok``.
    - In a world with motor noise, only the solution is scored: the movements that the method
      recommends to make next. These movements are stored without ticks, and corrective movements
      also without targets.

    Parameters
    ----------
    job : Job
    outcomes : sequence of Outcome
        Outcome of each run of the job, in the order of ``job.numbers``.

    Returns
    -------
    list of Row
        The scored runs, in the same order.
    """
    cell, method = job.cell, job.cell.method
    is_noisy = cell.model.motor_noise > 0.0
    imports = {} if method.is_ours else {"imports": method.packages}
    stated = [_answer_of(outcome) if is_noisy else outcome.parts for outcome in outcomes]
    solutions = [movements for parts in stated for movements in parts.values()]
    executions = iter(execute_all(cell.arena, solutions, cell.model))
    runs = []
    for number, outcome, asked in zip(job.numbers, outcomes, stated, strict=True):
        parts = {part: next(executions) for part in asked}
        status, reason = _final_status(outcome, parts)
        is_ok = status == "ok"
        final = replace(
            outcome,
            status=status,  # type: ignore[arg-type]
            reason="" if is_ok else plain(reason, MAX_REASON_LENGTH) or "it gave no reason",
            parts=asked,
            environment=current_environment() | imports | (outcome.environment or {}),
        )
        done = {
            part: execution for part, execution in parts.items() if isinstance(execution, Execution)
        }
        runs.append(row_of(replace(job, numbers=(number,)), final, done if is_ok else {}, now()))
    if not is_noisy:
        return runs
    solved = [run for run in runs if run["status"] == "ok"]
    scored = {run["run_id"]: run for run in (judged(solved) if solved else [])}
    return [scored.get(run["run_id"], run) for run in runs]


def _answer_of(outcome: Outcome) -> dict[str, list[Movement]]:
    """Return a dict with only the solution of an outcome, without ticks (:func:`next_action`).

    The dict is empty if the outcome has no solution.
    """
    solution = outcome.parts.get("solution")
    return {} if solution is None else {"solution": [*next_action(solution)]}


def _final_status(outcome: Outcome, parts: Mapping[str, Execution | Exception]) -> tuple[str, str]:
    """Return the final status of a run, and why the run is not ok.

    The status is

    - ``solver-failed`` if a part of the outcome cannot be executed, or if the outcome has status
      ``ok`` but no solution;
    - ``infeasible`` if the execution of a part misses a goal;
    - otherwise the status of the outcome.

    ``parts`` is a dict that maps each part to its execution, or to the error of the execution.
    """
    for execution in parts.values():
        if isinstance(execution, Exception):
            return "solver-failed", f"the solution cannot be executed: {execution}"
        if not execution.completed:
            return "infeasible", execution.reason
    if outcome.status == "ok" and "solution" not in parts:
        return "solver-failed", "it reported ok, but returned no solution"
    return outcome.status, outcome.reason
