"""coartic: a benchmark of methods for computational motor control on one kinematic robot.

This package contains the dual-process learner of Shah, Barto & Fagg (2013), *A Dual Process Account
of Coarticulation in Motor Skill Acquisition*, and everything that other methods share with the
learner: robot, tasks, movement, corrective process, execution and scoring.
"""

from typing import TYPE_CHECKING

from coartic.internal.lazy import import_lazily

if TYPE_CHECKING:
    from coartic.errors import (
        CoarticError,
        MissingExtraError,
        NotApplicableError,
        SolutionError,
        TaskError,
    )
    from coartic.learner.conditions import ABLATIONS, CONDITIONS, INFORMED, ExplorationCondition
    from coartic.learner.learning import learn, learn_many
    from coartic.learner.learning_run import LearningRun
    from coartic.method import BudgetError, MethodError, UndeclaredError
    from coartic.method.optimisers import Objective, Optimiser, objective
    from coartic.model import PAPER, MotionModel
    from coartic.motion.doors import Correction, MoveResult, correct, move
    from coartic.motion.execution import (
        Execution,
        corrective_trial,
        execute,
        execute_noisy,
        hand_sequences,
        initial_hands,
    )
    from coartic.motion.solution import Movement, movements_of
    from coartic.pictures.trajectories import Trajectory, trajectory
    from coartic.robot import Arm, Hand, Robot
    from coartic.tasks.catalogue import builtin_tasks, load_task
    from coartic.tasks.task import Provenance, Start, Task, parse_task

__version__ = "7.0.0"

__all__ = [
    "ABLATIONS",
    "CONDITIONS",
    "INFORMED",
    "PAPER",
    "Arm",
    "BudgetError",
    "CoarticError",
    "Correction",
    "Execution",
    "ExplorationCondition",
    "Hand",
    "LearningRun",
    "MethodError",
    "MissingExtraError",
    "MotionModel",
    "MoveResult",
    "Movement",
    "NotApplicableError",
    "Objective",
    "Optimiser",
    "Provenance",
    "Robot",
    "SolutionError",
    "Start",
    "Task",
    "TaskError",
    "Trajectory",
    "UndeclaredError",
    "builtin_tasks",
    "correct",
    "corrective_trial",
    "execute",
    "execute_noisy",
    "hand_sequences",
    "initial_hands",
    "learn",
    "learn_many",
    "load_task",
    "move",
    "movements_of",
    "objective",
    "parse_task",
    "trajectory",
]

_HOMES = {
    "errors": (
        *("CoarticError", "MissingExtraError", "NotApplicableError"),
        *("SolutionError", "TaskError"),
    ),
    "learner.conditions": ("CONDITIONS", "ABLATIONS", "INFORMED", "ExplorationCondition"),
    "learner.learning": ("learn", "learn_many"),
    "learner.learning_run": ("LearningRun",),
    "method": ("BudgetError", "MethodError", "UndeclaredError"),
    "model": ("PAPER", "MotionModel"),
    "motion.doors": ("Correction", "MoveResult", "correct", "move"),
    "motion.execution": (
        *("Execution", "corrective_trial", "execute", "execute_noisy"),
        *("hand_sequences", "initial_hands"),
    ),
    "motion.solution": ("Movement", "movements_of"),
    "method.optimisers": ("Objective", "Optimiser", "objective"),
    "robot": ("Arm", "Hand", "Robot"),
    "tasks.catalogue": ("builtin_tasks", "load_task"),
    "tasks.task": ("Provenance", "Start", "Task", "parse_task"),
    "pictures.trajectories": ("Trajectory", "trajectory"),
}
HOME = {name: f"coartic.{module}" for module, names in _HOMES.items() for name in names}
"""Dict that maps each public name of ``coartic`` to the module from which it is imported."""

__getattr__, __dir__ = import_lazily(__name__, HOME)
