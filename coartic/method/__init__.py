"""The base of methods, and the session through which a method works.

A learner, planner or controller is a :class:`Method`. It states its citation, its parameters and
the **information** that it uses. Given a :class:`Session` (one task, one seed, one meter) it
returns a solution. The session is the only way to the robot: trials and evaluations are counted,
and a call that the method's declaration does not cover is refused. The harness executes, scores and
verifies the solution itself.
"""

from coartic.method.base import (
    MODULES,
    Method,
    Outline,
    Parameters,
    Result,
    outline_of,
    run_method,
)
from coartic.method.session import (
    METERED,
    MOST_COUNT,
    BudgetError,
    Information,
    Meter,
    MethodError,
    Session,
    UndeclaredError,
)

__all__ = [
    "METERED",
    "MODULES",
    "MOST_COUNT",
    "BudgetError",
    "Information",
    "Meter",
    "Method",
    "MethodError",
    "Outline",
    "Parameters",
    "Result",
    "Session",
    "UndeclaredError",
    "outline_of",
    "run_method",
]
