"""Time and accuracy of the QP solvers, on the problems of a real run.

``python -m benchmarks.qp_solvers`` records the two-level problems that
``nullspace-qp/next-goal`` meets on a two-armed task and gives them to every solver, all
solvers in turn on each problem, so that whatever else the machine does meets them alike.
A problem that a solver does not solve is counted and its reason shown.
"""

from __future__ import annotations

import os
import sys
import time
from dataclasses import dataclass, field
from typing import NamedTuple, get_args

import numpy as np

from baselines.cascade import LIMIT, Cascade, CascadeError, SolverName, damped_projection
from baselines.nullspace_qp import NextGoal
from benchmarks.provenance import environment
from benchmarks.sandbox import THREADS
from coartic import execute, load_task
from coartic.method import MethodError, Session
from coartic.robot import Array

SOLVERS: tuple[SolverName, ...] = get_args(SolverName)
TASK, HANDS = "two-armed-1", "LRLR"
PROBLEMS = 400
_WARM_UP = 20
_PACKAGES = ("cvxpy", "clarabel", "daqp", "osqp", "proxsuite", "numpy", "scipy")


class Problem(NamedTuple):
    """What :meth:`baselines.cascade.Cascade.solve` is given."""

    jacobian: Array
    rate: Array
    preferred: Array | None


@dataclass
class Figures:
    """What one solver did."""

    build_s: float
    """Setting both levels up, compilation by cvxpy included."""
    total_s: list[float] = field(default_factory=list)
    """Time of each problem, cvxpy included."""
    solver_s: list[float] = field(default_factory=list)
    """Time of each problem as the solver itself reports it; 0 where it does not."""
    solutions: list[Array | None] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)


class _Recorder(Cascade):
    def __init__(self, joints: int, solver: SolverName) -> None:
        self.problems: list[Problem] = []
        super().__init__(joints, solver)
        self.problems.clear()

    def solve(self, jacobian: Array, rate: Array, preferred: Array | None = None) -> Array:
        self.problems.append(Problem(jacobian, rate, preferred))
        return super().solve(jacobian, rate, preferred)


def recorded(count: int) -> list[Problem]:
    """``count`` problems, evenly spaced over the run; those with both levels only."""
    recorders: list[_Recorder] = []

    class Recorded(NextGoal):
        def cascade(self, joints: int) -> Cascade:
            recorders.append(_Recorder(joints, self.parameters.solver))
            return recorders[-1]

    method = Recorded(NextGoal.Parameters(hands=HANDS))
    method.solve(Session(load_task(TASK), 0, method.told, trusted=True))
    found = [problem for problem in recorders[0].problems if problem.preferred is not None]
    return [found[k] for k in np.linspace(0, len(found) - 1, count).astype(int)]


def measure(problems: list[Problem]) -> dict[SolverName, Figures]:
    """Every solver on every problem."""
    joints = problems[0].jacobian.shape[1]
    cascades: dict[SolverName, Cascade] = {}
    figures: dict[SolverName, Figures] = {}
    for name in SOLVERS:
        clock = time.perf_counter()
        cascades[name] = Cascade(joints, name)
        figures[name] = Figures(time.perf_counter() - clock)
    for warm, problem in [
        *((True, problem) for problem in problems[:_WARM_UP]),
        *((False, problem) for problem in problems),
    ]:
        for name, cascade in cascades.items():
            reported = cascade.solver_s
            clock = time.perf_counter()
            try:
                solution = cascade.solve(*problem)
            except CascadeError as error:
                solution = None
                reason = str(error)
            if warm:
                continue
            figures[name].solutions.append(solution)
            if solution is None:
                figures[name].failures.append(reason)
            else:
                figures[name].total_s.append(time.perf_counter() - clock)
                figures[name].solver_s.append(cascade.solver_s - reported)
    return figures


def table(problems: list[Problem], figures: dict[SolverName, Figures]) -> str:
    """The figures in Markdown."""
    closed = [_closed_form(problem) for problem in problems]
    lines = [
        "| solver | build, ms | solve, ms: median | 95 % | solver itself, µs | hand's rate off by "
        "| rates off closed form by | off Clarabel by | failed | reward |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    for name, of in figures.items():
        rates = of.solutions
        hand = [
            _norm(problem.jacobian @ (x - exact))
            for problem, x, exact in zip(problems, rates, closed, strict=True)
            if x is not None and exact is not None
        ]
        exactly = [
            _norm(x - exact)
            for x, exact in zip(rates, closed, strict=True)
            if x is not None and exact is not None
        ]
        clarabel = [
            _norm(x - other)
            for x, other in zip(rates, figures["clarabel"].solutions, strict=True)
            if x is not None and other is not None
        ]
        inside = np.median(of.solver_s) * 1e6 if of.solver_s else 0.0
        cells = [
            name,
            f"{of.build_s * 1e3:.0f}",
            *(f"{t * 1e3:.2f}" for t in _quantiles(of.total_s)),
            f"{inside:.0f}" if inside > 0 else "not reported",
            *(f"{max(misses):.0e}" if misses else "-" for misses in (hand, exactly, clarabel)),
            str(len(of.failures)),
            _reward(name),
        ]
        lines.append(f"| {' | '.join(cells)} |")
    lines += [f"\n{name}: {of.failures[0]}" for name, of in figures.items() if of.failures]
    return "\n".join(lines)


def conditions() -> str:
    """Machine, threads and versions."""
    found = environment()
    versions = ", ".join(f"{name} {found['packages'][name]}" for name in _PACKAGES)
    threads = ", ".join(f"{name}={os.environ.get(name, 'unset')}" for name in THREADS)
    load = ", ".join(f"{value:.1f}" for value in os.getloadavg())
    return (
        f"{found['processor']}, {found['cores']} cores, load {load}; {found['platform']}, "
        f"Python {found['python']}; {versions}; {threads}"
    )


def main() -> None:
    """Record, measure, print."""
    if len(sys.argv) > 1:
        sys.exit("usage: python -m benchmarks.qp_solvers (it takes no arguments)")
    problems = recorded(PROBLEMS)
    figures = measure(problems)
    free = sum(_closed_form(problem) is not None for problem in problems)
    print(
        f"{len(problems)} two-level problems of {NextGoal.name} on {TASK}, {HANDS}; no limit is "
        f"active in {free} of them, which are compared with the closed form (largest "
        "distances, in units of the joint step a tick).\n"
    )
    print(table(problems, figures))
    print(f"\n{conditions()}")


def _closed_form(problem: Problem) -> Array | None:
    """The exact answer, where no limit is active."""
    nothing = np.zeros(problem.jacobian.shape[1])
    first = damped_projection(problem.jacobian, problem.rate, nothing)
    if problem.preferred is None or np.abs(first).max() > LIMIT:
        return None
    rates = damped_projection(*problem[:2], problem.preferred)
    return rates if np.abs(rates).max() <= LIMIT else None


def _reward(solver: SolverName) -> str:
    """Reward of the whole task with this solver, or why there is none."""
    task = load_task(TASK)
    method = NextGoal(NextGoal.Parameters(hands=HANDS, solver=solver))
    try:
        result = method.solve(Session(task, 0, method.told, trusted=True))
    except MethodError as error:
        return f"{error.outcome}: {error}"
    return str(execute(task, result.solution).reward)


def _quantiles(times: list[float]) -> tuple[float, float]:
    if not times:
        return float("nan"), float("nan")
    return float(np.median(times)), float(np.quantile(times, 0.95))


def _norm(vector: Array) -> float:
    return float(np.linalg.norm(vector))


if __name__ == "__main__":
    main()
