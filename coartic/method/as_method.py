"""Parameters whose value another method finds, such as ``sequence = "as cma-es/bandit"``.

With such a parameter a run makes the run of the named method first: on the same task, in the same
world, with the same seed, trials and trial budget, and with the defaults of all other parameters.
``sequence`` and ``hands`` then stand for the hand sequence of its answer, and ``until`` stands for
the ticks of its answer. Its trials are told in the details of the run, and are not counted as
trials of the run.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

from pydantic import AfterValidator

from coartic.internal.text import unknown
from coartic.internal.validation import described_error
from coartic.method.base import Method, Outline, Result, built_in_methods, reason_against
from coartic.method.session import MethodError, Session
from coartic.model import MotionModel
from coartic.motion.execution import execute
from coartic.motion.solution import hands_in

AS = "as "
"""Beginning of a parameter's value that names a method."""
TOLD = "as"
"""Key in the details of a run. The value maps the ids of the named methods to dicts: ``trials`` of
their run, and ``hands`` and ``ticks`` of its answer (without ticks in a world with motor noise)."""
REACHED = "reached"
"""Key in the details of a run with parameter ``until``: whether a trial took no more ticks."""


def _known(value: str) -> str:
    """Check the id of a method in ``as METHOD``; return the value."""
    name = value.removeprefix(AS)
    if value.startswith(AS) and name not in built_in_methods():
        raise described_error(unknown("method", name, built_in_methods()))
    return value


HandsOrMethod = Annotated[str, AfterValidator(_known)]
"""Type of a parameter for a hand sequence, such as ``"RRLR"``, or ``"as METHOD"``."""


def _ticks(value: int | str) -> int | str:
    """Check a number of ticks, or ``as METHOD``; return the value."""
    if value < 1 if isinstance(value, int) else not value.startswith(AS):
        raise described_error(
            f"until is {value!r}; it must be a number of ticks, at least 1, or 'as METHOD'"
        )
    return value if isinstance(value, int) else _known(value)


TicksOrMethod = Annotated[int | str, AfterValidator(_ticks)]
"""Type of a parameter for a number of ticks, or ``"as METHOD"``."""


def methods_named_in(parameters: Mapping[str, Any]) -> dict[str, str]:
    """Return a dict that maps parameters of a built-in method to the ids of methods they name."""
    return {
        name: value.removeprefix(AS)
        for name, value in parameters.items()
        if isinstance(value, str) and value.startswith(AS)
    }


def reason_against_named(
    parameters: Mapping[str, Any], task: Outline, model: MotionModel
) -> str | None:
    """Return why a built-in method cannot run after the methods that its parameters name, or None.

    ``parameters`` are all parameters of the method, and ``task`` and ``model`` those of its run.
    """
    if parameters.get("until") is not None and model.motor_noise > 0.0:
        return "until needs a world without motor noise, in which a lucky trial ends no run"
    for parameter, name in methods_named_in(parameters).items():
        other = built_in_methods()[name]
        if reason := other.refuses(model) or reason_against(other(), task):
            return f"{parameter} is {AS + name!r}, but {reason}"
    return None


def solve_in(method: Method, sessions: Sequence[Session]) -> Sequence[Result | MethodError]:
    """Let a built-in method solve the task in sessions, after the methods that it names.

    Parameters
    ----------
    method : Method
    sessions : sequence of Session
        Sessions of the same task, model and budget.

    Returns
    -------
    sequence of Result or MethodError
        For each session, in order, the result, or the error that the method raised. Where a named
        method finds no answer, the error is that of this method.
    """
    named = methods_named_in(vars(method.parameters))
    if not named:
        return _solve(method, sessions)
    told = {
        name: _answers_of(name, method.parameters.trials, sessions)
        for name in dict.fromkeys(named.values())
    }
    results = dict[int, Result | MethodError]()
    alike = defaultdict[tuple[Any, ...], list[int]](list)  # sessions by the values that they take
    for n in range(len(sessions)):
        values = []
        for parameter, name in named.items():
            answer = told[name][n]
            if isinstance(answer, MethodError):
                reason = f"{parameter} is {AS + name!r}, which finds no answer: {answer}"
                results[n] = MethodError(answer.outcome, reason)
                break
            values.append((parameter, answer["ticks" if parameter == "until" else "hands"]))
        else:
            alike[tuple(values)].append(n)
    for found, members in alike.items():
        parameters = method.parameters.model_copy(update=dict(found))
        solved = _solve(type(method)(parameters), [sessions[n] for n in members])
        for n, result in zip(members, solved, strict=True):
            result.details[TOLD] = {name: answers[n] for name, answers in told.items()}
            results[n] = result
    return [results[n] for n in range(len(sessions))]


def _answers_of(
    name: str, trials: int, sessions: Sequence[Session]
) -> list[dict[str, Any] | MethodError]:
    """Make the run of a built-in method beside each session, and return what is told of it."""
    method = built_in_methods()[name]
    more = {"trials": trials} if "trials" in method.Parameters.model_fields else {}
    others = [session.beside(method.information) for session in sessions]
    answers = list[dict[str, Any] | MethodError]()
    for other, result in zip(
        others, _solve(method(method.Parameters(**more)), others), strict=True
    ):
        if isinstance(result, MethodError):
            answers.append(result)
            continue
        movements, ticks = result.solution, None
        if other.model.motor_noise == 0.0:
            task = other.reveal(*method.information)
            ticks = execute(task, movements, model=other.model).ticks
        hands = hands_in(movements)
        answers.append({"trials": other.trials_made, "hands": hands, "ticks": ticks})
    return answers


def _solve(method: Method, sessions: Sequence[Session]) -> list[Result | MethodError]:
    """Call the method with as many sessions at a time as it can take."""
    size, results = method.max_batch(), list[Result | MethodError]()
    for begin in range(0, len(sessions), size):
        results += method.solve_together(sessions[begin : begin + size])
    return results
