"""Execute and score the solutions of runs, in a process that imports no method file."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from coartic.benchmarks.provenance import current_environment, now
from coartic.internal.text import MAX_REASON_LENGTH, plain
from coartic.model import PAPER, same_world
from coartic.motion.execution import Execution, execute_noisy
from coartic.motion.solution import Movement, next_action
from coartic.runs.plan import Job
from coartic.runs.record import (
    MOTOR_NOISE,
    NOISE_RULE,
    NOISY_EXECUTIONS,
    Outcome,
    Row,
    execute_all,
    judge,
    row_of,
)


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
    executions = iter(execute_all(cell.task, solutions, cell.model))
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
    return with_noise(runs)


def _answer_of(outcome: Outcome) -> dict[str, list[Movement]]:
    """Return a dict with only the solution of an outcome, without ticks (:func:`next_action`).

    The dict is empty if the outcome has no solution.
    """
    solution = outcome.parts.get("solution")
    return {} if solution is None else {"solution": [*next_action(solution)]}


def with_noise(runs: Sequence[Row]) -> list[Row]:
    """Execute each solution 100 times with motor noise, and set the columns of mean ticks.

    - In the paper's world, ``noisy_ticks`` is the mean number of ticks over the executions with
      motor noise 0.01, or None if one of them fails. The seed of the noise is the hexadecimal
      number before the hyphen in the id of the run.
    - In a world with motor noise, ``mean_ticks`` is the mean number of ticks over the executions in
      this world, and ``failed_executions`` is the number of failed executions. A failed execution
      counts as twice the ticks of the corrective process with its best hands; if that process does
      not complete the task with any hands, ``mean_ticks`` is None instead. The seed of the noise is
      :func:`.judge_seed`, the same for all methods.
    - In any other world nothing is executed, and the runs are returned unchanged.

    In the first two cases, column ``noise_rule`` is set to the version of the rule of noise,
    :data:`.NOISE_RULE`.

    Parameters
    ----------
    runs : sequence of Row
        Runs of one cell. The ticks of a run do not depend on the other runs. Runs without a
        solution are returned unchanged.

    Returns
    -------
    list of Row
        Copies of the runs in which these columns are set, in the order of ``runs``.
    """
    solved = [run for run in runs if "solution" in run.movements]
    if not solved:
        return [*runs]
    cell, solutions = solved[0].cell, [run.part("solution") for run in solved]
    if cell.model.motor_noise > 0.0:
        ticks = _judge(solved, solutions)
    elif same_world(cell.model, PAPER, cell.task.radius):
        seeds = [int(run["run_id"].partition("-")[0], 16) for run in solved]
        made = execute_noisy(cell.task, solutions, MOTOR_NOISE, NOISY_EXECUTIONS, seeds)
        ticks = [{"noisy_ticks": _number(mean)} for mean in made.mean(axis=1).tolist()]
    else:
        return [*runs]
    scored = {
        run["run_id"]: run.with_values(**values, noise_rule=NOISE_RULE)
        for run, values in zip(solved, ticks, strict=True)
    }
    return [scored.get(run["run_id"], run) for run in runs]


def _judge(runs: Sequence[Row], answers: Sequence[Sequence[Movement]]) -> list[dict[str, Any]]:
    """Return ``mean_ticks`` and ``failed_executions`` of each run in a world with motor noise.

    ``answers`` contains the recommended solution of each run. All runs must be of one cell.
    """
    cell = runs[0].cell
    seeds = [run.job.judge_seed(run["run"]) for run in runs]
    means, failed = judge(cell.task, answers, cell.model, seeds)
    return [
        {"mean_ticks": _number(mean), "failed_executions": count}
        for mean, count in zip(means.tolist(), failed.tolist(), strict=True)
    ]


def _number(value: float) -> float | None:
    """Return ``value``, or None if it is NaN."""
    return None if math.isnan(value) else value


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
