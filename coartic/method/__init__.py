"""The base class of methods, and the session through which a method works.

Each learner, planner or controller is a :class:`Method`. A method declares its facts, its
parameters and the **information** that it uses. Its function ``solve`` gets a :class:`Session` (one
task, one seed and one meter) and returns a :class:`Result` with the solution. The session counts
trials and evaluations, and refuses a call that uses undeclared information. A method that does not
belong to this project must use the robot only through its session. The benchmark itself executes,
scores and verifies the solution.
"""

from coartic.method.base import (
    CORRECTIONS_BY_TENTH,
    MODULES,
    TRIALS,
    Facts,
    Method,
    Outline,
    Parameters,
    Result,
    answer_of,
    built_in_methods,
    outline_of,
    reason_against,
)
from coartic.method.run import run_method
from coartic.method.session import (
    MAX_COUNT,
    METERED,
    BudgetError,
    Information,
    Meter,
    MethodError,
    Session,
    UndeclaredError,
)

__all__ = [
    "CORRECTIONS_BY_TENTH",
    "MAX_COUNT",
    "METERED",
    "MODULES",
    "TRIALS",
    "BudgetError",
    "Facts",
    "Information",
    "Meter",
    "Method",
    "MethodError",
    "Outline",
    "Parameters",
    "Result",
    "Session",
    "UndeclaredError",
    "answer_of",
    "built_in_methods",
    "outline_of",
    "reason_against",
    "run_method",
]
