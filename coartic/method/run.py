"""Run a method in this process."""

from __future__ import annotations

import sys

from coartic.errors import NotApplicableError
from coartic.internal.limits import MAX_RUN_SEED, check_limits
from coartic.method.as_method import reason_against_named, solve_in
from coartic.method.base import MODULES, Method, Result, answer_of, outline_of, reason_against
from coartic.method.session import MethodError, Session
from coartic.model import PAPER, MotionModel, check_model
from coartic.tasks.catalogue import TaskLike, as_task


def run_method(
    method: Method, task: TaskLike, seed: int = 0, *, model: MotionModel = PAPER
) -> tuple[Result, Session]:
    """Let a method solve a task in this process.

    The session has no trial budget, and the solution is not executed. Methods of this project may
    see the task itself, and may add to all counters. Any other method must work only through its
    session. The session raises UndeclaredError if it detects the use of undeclared information
    (:data:`METERED`).

    Parameters
    ----------
    method : Method
    task : Task, str or pathlib.Path
    seed : int
        Seed of the method's random numbers.
    model : MotionModel

    Returns
    -------
    result : Result
        The solution with its details, as the method returns it (with motor noise:
        :func:`answer_of`).
    session : Session
        The session in which the method found the solution, with its counts and rewards.

    Raises
    ------
    MethodError
        The method finds no solution.
    UndeclaredError
        The method uses information that it does not declare.
    NotApplicableError
        The method does not apply to the task or to the model, or finds no initial hands.
    SolutionError
        The solution is not a sequence.
    TaskError, TypeError
        The task cannot be used, or ``task`` or ``model`` has a wrong type.
    ValueError
        The seed is not an integer from 0 to 2^128 - 1, or a constant of the model is out of bounds
        or does not fit the radius of the goals.
    """
    chosen = as_task(task)
    model = check_model(model, radius=chosen.radius)
    reason = method.refuses(model) or reason_against(method, outline_of(chosen))
    if reason is not None:
        raise NotApplicableError(reason)
    built_in = (getattr(sys.modules.get(module), "METHODS", ()) for module in MODULES)
    is_ours = any(type(method) in methods for methods in built_in)
    check_limits("seed", seed, 0, MAX_RUN_SEED)
    session = Session(chosen, int(seed), method.information, model=model, trusted=is_ours)
    if is_ours:
        reason = reason_against_named(vars(method.parameters), outline_of(chosen), model)
        if reason is not None:
            raise NotApplicableError(reason)
        (result,) = solve_in(method, [session])
        if isinstance(result, MethodError):
            raise result
    else:
        result = method.solve(session)
    session.check_solution(result.solution)
    return answer_of(result, model), session
