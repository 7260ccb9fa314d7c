"""Execute and score the solutions that workers hand over, in a process that no method has been
in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from coartic.benchmarks.provenance import current_environment, now
from coartic.benchmarks.worker import Job, Outcome
from coartic.motion.solution import Execution, other_arm_travel
from coartic.runs.run import Run, Score, execute_all
from coartic.tasks.task import hands_of
from coartic.text import LONGEST_REASON, plain

Executions = Mapping[str, Execution | Exception]
"""The executions of a run by part; in place of one, why there is none."""


def score(job: Job, outcomes: Sequence[Outcome]) -> list[Run]:
    """The runs of a job, also of one that failed. All their parts are executed side by side."""
    parts = [(n, part) for n, outcome in enumerate(outcomes) for part in outcome.parts]
    solutions = [outcomes[n].parts[part] for n, part in parts]
    executions = execute_all(job.setting.task, solutions)
    by_run: list[dict[str, Execution | Exception]] = [{} for _ in outcomes]
    for (n, part), execution in zip(parts, executions, strict=True):
        by_run[n][part] = execution
    return [score_run(job, *each) for each in zip(job.numbers, outcomes, by_run, strict=True)]


def score_run(job: Job, number: int, outcome: Outcome, parts: Executions) -> Run:
    """A run with the scores of its parts, of which it has none unless it is ok."""
    status, reason = final_status(outcome, parts)
    is_ok = status == "ok"
    executed = {part: e for part, e in parts.items() if is_ok and isinstance(e, Execution)}
    solution, task = executed.get("solution"), job.setting.task
    corrections = travel = None
    if solution is not None:
        corrections = solution.corrections
        travel = other_arm_travel(task, hands_of(solution.hands), solution.configurations)
    return Run(
        setting=job.setting,
        suite_seed=job.suite_seed,
        number=number,
        status=status,
        reason="" if is_ok else plain(reason, LONGEST_REASON) or "it gave no reason",
        environment=outcome.environment or current_environment(),
        date=now(),
        time_limit_s=job.time_limit_s,
        scores={
            part: Score(each.reward, each.hands, each.movements)
            for part, each in executed.items()
            if each.reward is not None
        },
        rewards=outcome.rewards,
        meter=outcome.meter,
        times=outcome.times,
        solution_corrections=corrections,
        other_arm_travel=travel,
        bound=outcome.bound if status == outcome.status else None,
        used=outcome.used,
        details=outcome.details,
    )


def final_status(outcome: Outcome, parts: Executions) -> tuple[str, str]:
    """Status of a run and its reason: the method's own word, unless a part says otherwise."""
    for execution in parts.values():
        if isinstance(execution, Exception):
            return "solver-failed", f"the solution cannot be executed: {execution}"
        if not execution.completed:
            return "infeasible", execution.reason
    if outcome.status == "ok" and "solution" not in parts:
        return "solver-failed", "it reported ok, but returned no solution"
    return outcome.status, outcome.reason
