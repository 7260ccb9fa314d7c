"""Check whether a new method or task follows the rules of the benchmark.

One worker process performs all runs that check a method, each with a limit of CPU time. A second
process repeats one of these runs, to check that its result does not depend on the process.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from math import dist, inf
from pathlib import Path
from typing import NamedTuple

from coartic import (
    PAPER,
    Execution,
    MotionModel,
    NotApplicableError,
    Task,
    TaskError,
    builtin_tasks,
    corrective_trial,
    initial_hands,
    load_task,
)
from coartic.benchmarks.registry import Registry
from coartic.benchmarks.reproduce import compare_runs, perform_in_order
from coartic.internal.text import describe_parameters, pluralize
from coartic.method import METERED
from coartic.motion.execution import execute_many
from coartic.motion.solution import goals_without_target, next_action
from coartic.motion.trials import compiled_task, noise_draws, noise_seed
from coartic.runs.method_info import MethodInfo
from coartic.runs.plan import Job, cell_of
from coartic.runs.record import Row
from coartic.tasks.task import check_task

CHECK_TRIALS = 60  # trials of a run: enough to learn something, few enough to be quick
_LIMIT_S = 120.0  # limit of CPU time of a run
_BUDGET = 7  # trial budget of the runs that check ``limits``
_NOISE = "motor noise"  # kind of the runs with motor noise, and name of their check
_WORLD = MotionModel(motor_noise=0.01)


class CheckResult(NamedTuple):
    """Result of a check of a method or a task."""

    name: str
    """Name of the check, such as ``determinism``."""
    passed: bool | None
    """True if the check found no problem, False if it found one, None if it was not made."""
    finding: str
    """The first problem. If there is none, a text on what was checked, such as the title of the
    method; if the check was not made, the reason."""


def check_method(
    info: MethodInfo, tasks: Sequence[Task] | None = None, *, verbose: bool = False
) -> list[CheckResult]:
    """Check a method, and return the result of each check in :data:`CHECKS`.

    If the check ``solution`` finds a problem, the checks after it are not made.

    Parameters
    ----------
    info : MethodInfo
        Declaration of the method.
    tasks : sequence of Task, optional
        Tasks to run the method on, by default the shipped tasks. Tasks to which the method does not
        apply are left out.
    verbose : bool
        True to show what the method prints and logs, and the tracebacks of its errors. The output
        of the run that is repeated in a second process is not shown.

    Returns
    -------
    list of CheckResult
        A result for each check, in the order of :data:`CHECKS`.

    Raises
    ------
    CoarticError
        Worker processes cannot start, the file of the method was changed after it was read, or the
        method cannot say whether it applies to a task.
    """
    trials = {"trials": CHECK_TRIALS} if "trials" in info.defaults else {}
    parameters = trials | info.rules()["quick"]

    def applies(task: Task) -> bool:
        return info.inapplicable_reason(task, parameters) is None

    candidates = [*map(load_task, builtin_tasks())] if tasks is None else tasks
    tasks, jobs, runs = list(filter(applies, candidates)), dict[tuple[str, str], Job](), _Runs()
    for kind, seed, budget, chosen in (
        ("first", 1, None, tasks),
        ("again", 1, None, tasks),
        ("other seed", 2, None, tasks),
        ("after others", 1, None, tasks),
        ("budget", 1, _BUDGET, tasks),
        ("hopeless", 1, None, filter(applies, map(_hopeless_task, tasks[:1]))),
        (_NOISE, 1, None, tasks),
    ):
        for task in chosen:
            world = _WORLD if kind == _NOISE else PAPER
            cell = cell_of(task, info, parameters, trial_budget=budget, model=world)
            jobs[kind, task.name] = Job(cell, seed, (0,), _LIMIT_S)
    performed = perform_in_order([*jobs.values()], verbose=verbose)
    run_of = {id(job): run for job, run in performed}  # runs may finish in another order
    for (kind, name), job in jobs.items():
        runs.setdefault(kind, {})[name] = run_of[id(job)]
    if tasks:
        last_task = tasks[-1].name
        _, run = next(perform_in_order([jobs["first", last_task]]))
        runs["elsewhere"] = {last_task: run}
    results, is_solved = list[CheckResult](), True
    for name, (problems, finding) in CHECKS.items():
        if not is_solved:
            results.append(CheckResult(name, None, "not checked, because solution failed"))
            continue
        problem = next(problems(info, runs), "")
        results.append(CheckResult(name, not problem, problem or finding(info, runs)))
        is_solved = not (name == "solution" and problem)
    return results


_Runs = dict[str, dict[str, Row]]
"""Dict that maps kinds of runs, such as ``first``, to dicts that map names of tasks to runs."""


def _declaration(info: MethodInfo, _: _Runs) -> Iterator[str]:
    if not info.title.strip():
        yield "title is empty"
    if not info.citation.strip() and not info.facts.works:
        yield "citation is empty, and facts name no works"


def _parameters(info: MethodInfo, _: _Runs) -> Iterator[str]:
    config = info.rules()["config"]
    if config["extra"] != "forbid":
        yield "an unknown parameter is accepted; forbid extra keys"
    if config["frozen"] is not True:
        yield "parameters can be changed after validation; freeze them"


def _solution(info: MethodInfo, runs: _Runs) -> Iterator[str]:
    if not runs:
        yield "the method applies to none of the tasks, so nothing can be checked"
    for task, run in runs.get("first", {}).items():
        if run["reason"]:
            yield f"on {task}: {run['status']}: {run['reason']}"


def _changes(runs: _Runs, kind: str, how: str) -> Iterator[str]:
    """Yield a sentence for each difference between runs of one kind and first runs.

    On each task, the run of kind ``kind`` is compared with the run of kind ``first``. Each sentence
    begins with ``how``, in which the name of the task replaces ``{}``.
    """
    for task, run in runs.get(kind, {}).items():
        yield from (f"{how.format(task)}: {c}" for c in compare_runs(runs["first"][task], run))


def _determinism(info: MethodInfo, runs: _Runs) -> Iterator[str]:
    yield from _changes(runs, "again", "same seed on {}, same process")
    yield from _changes(runs, "elsewhere", "same seed on {}, another process")
    if not info.stochastic:
        how = "stochastic is False, but another seed on {}"
        yield from _changes(runs, "other seed", how)


def _limits(info: MethodInfo, runs: _Runs) -> Iterator[str]:
    for task, run in runs.get("budget", {}).items():
        is_over = (run["trials"] or 0) > _BUDGET
        if is_over or run["status"] not in ("ok", "infeasible"):
            made = run["reason"] or f"{run['trials']} trials"
            yield f"a budget of {_BUDGET} trials on {task}: {made}"


def _used(runs: _Runs) -> set[str]:
    return {
        name for run in runs.get("first", {}).values() for name in run["used"].split(", ") if name
    }


def _information(info: MethodInfo, runs: _Runs) -> Iterator[str]:
    metered = {item.value for item in METERED if item.value in info.information}
    if unused := sorted(metered - _used(runs)):
        yield f"declared but not used: {', '.join(unused)}"


def _failure(info: MethodInfo, runs: _Runs) -> Iterator[str]:
    for run in runs.get("hopeless", {}).values():
        if run["status"] not in ("infeasible", "solver-failed"):
            status = f"{run['status']} {run['reason']}"
            yield f"a task out of reach gives {status}; it must give infeasible with a reason"


def _noise(info: MethodInfo, runs: _Runs) -> Iterator[str]:
    for task, run in runs.get(_NOISE, {}).items():
        if run["reason"]:
            noise = f"with motor noise {_WORLD.motor_noise:g}"
            yield f"on {task}, {noise}: {run['status']}: {run['reason']}"


def _is_best_trial(run: Row) -> bool:
    """Return whether the solution of a noisy run seems to be its best trial.

    The solution is executed with the noise draw of the best trial. If the solution consists of the
    movements of the best trial, this execution takes as many ticks as the best trial. Any other
    solution takes as many ticks only by chance. If all trials have the same reward, or if there are
    no trials, the result is False.
    """
    rewards = [-inf if reward is None else reward for reward in run.rewards]
    if len({*rewards}) < 2:
        return False  # there was nothing to choose from
    task, best = run.cell.arena, max(rewards)
    worlds = noise_draws(noise_seed(run["seed"]), rewards.index(best))
    answer = next_action(run.part("solution"))
    (execution,) = execute_many(compiled_task(task, run.cell.model), [answer], worlds)
    return isinstance(execution, Execution) and execution.reward == best


def _luck(info: MethodInfo, runs: _Runs) -> str:
    """Return a sentence on the solutions that the method returns with motor noise."""
    made = f"the method solves its tasks with motor noise {_WORLD.motor_noise:g}"
    if not all(map(_is_best_trial, runs[_NOISE].values())):
        return made
    return (
        f"{made}; its answer seems to be its best trial, which was partly lucky: return what the "
        "method recommends to do next, if it knows more than this trial"
    )


def _rewards(info: MethodInfo, runs: _Runs) -> str:
    """Return a sentence on the rewards of the solutions, and on goals without a target."""
    runs_by_task = runs["first"]
    text = ", ".join(f"{task} {run['reward']}" for task, run in runs_by_task.items())
    for task, run in runs_by_task.items():
        if goals := goals_without_target(run.part("solution")):
            numbers = ", ".join(map(str, goals))
            text += f"; on {task} the solution has no target for goals {numbers}: is this meant?"
    return f"executed and scored on {text}"


def _seeds(info: MethodInfo, runs: _Runs) -> str:
    """Return a sentence on how results depend on the seed."""
    if info.stochastic and not any(_changes(runs, "other seed", "{}")):
        return "another seed gives the same result, too: declare stochastic = False"
    return f"{'the same' if info.stochastic else 'any'} seed gives the same result"


def _hopeless(info: MethodInfo, runs: _Runs) -> str:
    """Return a sentence on the run on a task that is out of reach."""
    for run in runs.get("hopeless", {}).values():
        return f"a task out of reach gives {run['status']}: {run['reason']}"
    return "the method does not apply to a task out of reach"


CHECKS: dict[
    str,
    tuple[Callable[[MethodInfo, _Runs], Iterator[str]], Callable[[MethodInfo, _Runs], str]],
] = {
    "declaration": (_declaration, lambda info, _: info.title),
    "parameters": (_parameters, lambda info, _: describe_parameters(info.complete({})) or "none"),
    "solution": (_solution, _rewards),
    "determinism": (_determinism, _seeds),
    "no hidden state": (
        lambda _, runs: _changes(runs, "after others", "after other runs, {} with the same seed"),
        lambda *_: "other runs in between do not change the result",
    ),
    "limits": (_limits, lambda *_: f"the method keeps a budget of {_BUDGET} trials"),
    "information": (
        _information,
        lambda _, runs: f"declared and used: {', '.join(sorted(_used(runs))) or 'nothing'}",
    ),
    "failure": (_failure, _hopeless),
    _NOISE: (_noise, _luck),
}
"""Dict that maps the name of each check to two functions. Both are called with the declaration of
the method and its runs. The first function yields a sentence for each problem of the method. The
second function returns a text on what was checked; it is called if there is no problem."""


def _hopeless_task(like: Task) -> Task:
    """Return a copy of a task with a locked base and one unreachable goal."""
    return like.model_copy(
        update={
            "name": "hopeless",
            "goals": ((9e3, 9e3),),
            "locked_base": ("x", "y"),
            "initial_hands": "R" if "right" in like.hands else "L",
            "provenance": {},
        }
    )


def check_task_file(path: Path, registered: Registry) -> list[CheckResult]:
    """Check that a task file is valid, and that its task can be completed.

    Parameters
    ----------
    path : Path
        The file.
    registered : mapping
        Dict that maps ids to the declarations of all known methods. The finding of check ``valid``
        says how many of these methods apply to the task.

    Returns
    -------
    list of CheckResult
        Results of three checks. If the file is not valid, only the first result is returned:

        - ``valid``: the file is a task whose goals can be reached;
        - ``distinct goals``: the centres of successive goals are more than one radius apart;
        - ``solvable``: the corrective process with the task's initial hands hits every goal.
    """
    try:
        task = check_task(load_task(path))
    except TaskError as error:
        return [CheckResult("valid", False, str(error))]
    near = [
        f"goals {number} and {number + 1} are within one radius of each other"
        for number, (goal, next_goal) in enumerate(pairwise(task.goals), 1)
        if dist(goal, next_goal) <= task.radius
    ]
    try:
        hands = initial_hands(task)
        trial = corrective_trial(task, hands)
        finding = trial.reason or f"initial hands {hands} complete it with reward {trial.reward}"
        is_solved = trial.completed
    except (NotApplicableError, TaskError) as error:
        finding, is_solved = str(error), False
    methods = [name for name, info in registered.items() if info.inapplicable_reason(task) is None]
    count = (
        f"{pluralize(len(task.goals), 'goal')}; {pluralize(len(methods), 'method')} can run on it"
    )
    return [
        CheckResult("valid", True, f"{task.name}, {count}"),
        CheckResult(
            "distinct goals",
            not near,
            near[0] if near else "successive goals are more than one radius apart",
        ),
        CheckResult("solvable", is_solved, finding),
    ]
