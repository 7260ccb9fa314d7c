"""Time and accuracy of the QP solvers, and what stating the problems to cvxpy costs.

``python -m coartic.benchmarks.qp_solvers`` records the two-level problems that
``nullspace-qp/next-goal`` meets on a two-armed task and gives them to every solver, once
as numbers (:mod:`coartic.baselines.cascade`) and once through cvxpy
(:mod:`coartic.baselines.modelled_cascade`), all in turn on each problem, so that whatever else the
machine does meets them alike. A problem that a solver does not solve is counted and its
reason shown.
"""

from __future__ import annotations

import os
import sys
import time
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol, get_args

import numpy as np

from coartic import execute, load_task
from coartic.baselines.cascade import (
    LIMIT,
    SLACK,
    Cascade,
    CascadeError,
    SolverName,
    damped_projection,
)
from coartic.baselines.modelled_cascade import ModelledCascade
from coartic.baselines.nullspace_control import FACES
from coartic.baselines.nullspace_qp import NextGoal
from coartic.benchmarks.guard import THREADS
from coartic.benchmarks.provenance import environment
from coartic.method import MethodError, Session
from coartic.robot import Array

SOLVERS: tuple[SolverName, ...] = get_args(SolverName)
TASK, HANDS = "two-armed-1", "LRLR"
PROBLEMS = 400
_WARM_UP = 20
_PACKAGES = ("cvxpy", "clarabel", "daqp", "osqp", "proxsuite", "numpy", "scipy")


class Problem(NamedTuple):
    """What :meth:`coartic.baselines.cascade.Cascade.solve` is given."""

    rows: Array
    least: Array
    preferred: Array


class Solver(Protocol):
    """Solves a problem; raises CascadeError where it does not."""

    def solve(self, rows: Array, least: Array, preferred: Array) -> Array:
        """Changes of the joints."""


@dataclass
class Figures:
    """What one solver did, in one of the two ways."""

    build_s: float
    """Setting both levels up."""
    total_s: list[float] = field(default_factory=list)
    """Time of each problem."""
    solutions: list[Array | None] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)


class Ways(NamedTuple):
    """A solver called directly, and through cvxpy."""

    direct: Figures
    modelled: Figures


class _Recorder(Cascade):
    def __init__(self, rows: int, joints: int, solver: SolverName) -> None:
        super().__init__(rows, joints, solver)
        self.problems: list[Problem] = []

    def solve(self, rows: Array, least: Array, preferred: Array) -> Array:
        self.problems.append(Problem(rows, least, preferred))
        return super().solve(rows, least, preferred)


def recorded(count: int) -> list[Problem]:
    """``count`` problems, evenly spaced over the run."""
    recorders: list[_Recorder] = []

    class Recorded(NextGoal):
        def cascade(self, joints: int) -> Cascade:
            recorders.append(_Recorder(FACES, joints, self.parameters.solver))
            return recorders[-1]

    method = Recorded(NextGoal.Parameters(hands=HANDS))
    method.solve(Session(load_task(TASK), 0, method.told, trusted=True))
    found = recorders[0].problems
    return [found[k] for k in np.linspace(0, len(found) - 1, count).astype(int)]


def measure(problems: list[Problem]) -> dict[SolverName, Ways]:
    """Every solver on every problem, in both ways."""
    rows, joints = problems[0].rows.shape
    figures = {name: Ways(Figures(0.0), Figures(0.0)) for name in SOLVERS}
    called: list[tuple[Solver, Figures]] = []
    for name, ways in figures.items():
        for kind, of in ((Cascade, ways.direct), (ModelledCascade, ways.modelled)):
            clock = time.perf_counter()
            called.append((kind(rows, joints, name), of))
            of.build_s = time.perf_counter() - clock
    for problem in problems[:_WARM_UP]:
        for solver, _ in called:
            _solved(solver, problem)
    for problem in problems:
        for solver, of in called:
            clock = time.perf_counter()
            found = _solved(solver, problem)
            elapsed = time.perf_counter() - clock
            if isinstance(found, str):
                of.solutions.append(None)
                of.failures.append(found)
            else:
                of.solutions.append(found)
                of.total_s.append(elapsed)
    return figures


def table(problems: list[Problem], figures: dict[SolverName, Ways]) -> str:
    """The figures in Markdown."""
    closed = [_closed_form(problem) for problem in problems]
    lines = [
        "| solver | two levels, ms: median | 95 % | through cvxpy, ms: median | 95 % | built, ms "
        "| share of modelling | off each other by | off closed form by | failed | reward |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    for name, (direct, modelled) in figures.items():
        off = [
            _norm(x - exact)
            for x, exact in zip(direct.solutions, closed, strict=True)
            if x is not None and exact is not None
        ]
        apart = [
            _norm(x - other)
            for x, other in zip(direct.solutions, modelled.solutions, strict=True)
            if x is not None and other is not None
        ]
        median, model_median = (
            float(np.median(of.total_s or np.nan)) for of in (direct, modelled)
        )
        cells = [
            name,
            *(f"{t * 1e3:.3f}" for t in _quantiles(direct.total_s)),
            *(f"{t * 1e3:.3f}" for t in _quantiles(modelled.total_s)),
            f"{modelled.build_s * 1e3:.0f}",
            f"{1 - median / model_median:.0%}",
            _largest(apart),
            _largest(off),
            f"{len(direct.failures)}, {len(modelled.failures)}",
            _reward(name),
        ]
        lines.append(f"| {' | '.join(cells)} |")
    lines += [
        f"\n{name}: {of.failures[0]}"
        for name, ways in figures.items()
        for of in ways
        if of.failures
    ]
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
        sys.exit("usage: python -m coartic.benchmarks.qp_solvers (it takes no arguments)")
    problems = recorded(PROBLEMS)
    figures = measure(problems)
    free = sum(_closed_form(problem) is not None for problem in problems)
    print(
        f"{len(problems)} two-level problems of {NextGoal.name} on {TASK}, {HANDS}; one row of "
        f"the task alone decides {free} of them, which are compared with the closed form "
        "(largest distances). Failed: called directly, through cvxpy.\n"
    )
    print(table(problems, figures))
    print(f"\n{conditions()}")


def _solved(solver: Solver, problem: Problem) -> Array | str:
    """The solution, or why there is none."""
    try:
        return solver.solve(*problem)
    except CascadeError as error:
        return str(error)


def _closed_form(problem: Problem) -> Array | None:
    """The exact answer, where it is that to the row of which most is missing, for both levels."""
    rows, least, preferred = problem
    worst = int(np.argmax(least))
    for wanted in (np.zeros_like(preferred), preferred):
        found = damped_projection(rows[worst], float(least[worst]), wanted)
        short = rows @ found < least - max(0.0, least[worst] - rows[worst] @ found) - SLACK
        if short.any() or np.abs(found).max() > LIMIT:
            return None
    return found


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


def _largest(distances: list[float]) -> str:
    if not distances:
        return "-"
    return f"{max(distances):.0e}" if max(distances) else "0"


def _norm(vector: Array) -> float:
    return float(np.linalg.norm(vector))


if __name__ == "__main__":
    main()
