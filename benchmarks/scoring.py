"""Execute and score the solutions that workers return, in a process that no method has been
in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from coartic.benchmarks.provenance import current_environment, now
from coartic.benchmarks.worker import Job, Outcome
from coartic.internal.text import LONGEST_REASON, plain
from coartic.motion.solution import Execution, other_arm_travel
from coartic.runs.run import Run, Score, execute_all
from coartic.tasks.task import hands_of


def score(job: Job, outcomes: Sequence[Outcome]) -> list[Run]:
    """The runs of a job, also of one that failed. All their parts are executed side by side; a run
    has the scores of its parts where it is ok."""
    task = job.specification.task
    executions = iter(execute_all(task, [m for each in outcomes for m in each.parts.values()]))
    runs = []
    for number, outcome in zip(job.numbers, outcomes, strict=True):
        parts = {part: next(executions) for part in outcome.parts}
        status, reason = final_status(outcome, parts)
        is_ok = status == "ok"
        executed = {part: e for part, e in parts.items() if is_ok and isinstance(e, Execution)}
        solution = executed.get("solution")
        run = Run(
            specification=job.specification,
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
            solution_corrections=None if solution is None else solution.corrections,
            other_arm_travel=None
            if solution is None
            else other_arm_travel(task, hands_of(solution.hands), solution.configurations),
            bound=outcome.bound if status == outcome.status else None,
            used=outcome.used,
            details=outcome.details,
        )
        runs.append(run)
    return runs


def final_status(outcome: Outcome, parts: Mapping[str, Execution | Exception]) -> tuple[str, str]:
    """Status of a run and its reason: the method's own word, unless a part, its execution or why
    there is none, says otherwise."""
    for execution in parts.values():
        if isinstance(execution, Exception):
            return "solver-failed", f"the solution cannot be executed: {execution}"
        if not execution.completed:
            return "infeasible", execution.reason
    if outcome.status == "ok" and "solution" not in parts:
        return "solver-failed", "it reported ok, but returned no solution"
    return outcome.status, outcome.reason
