"""The base of methods: what a method declares, and how it is run."""

from __future__ import annotations

import sys
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple

from pydantic import BaseModel, ConfigDict

from coartic.errors import NotApplicableError
from coartic.internal.limits import MOST_RUN_SEED, check_limits
from coartic.internal.validation import in_sentences
from coartic.method.session import Information, MethodError, Session
from coartic.model import PAPER, MotionModel
from coartic.motion.solution import Movement
from coartic.motion.trial import too_many_sequences
from coartic.robot import Hand
from coartic.tasks.catalogue import TaskLike, as_task
from coartic.tasks.task import INITIAL_POLICIES, Task


@in_sentences
class Parameters(BaseModel):
    """Base of every method's parameters: typed, validated, immutable, plain data."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


@dataclass(frozen=True)
class Result:
    """A solution, with further data that a method returns."""

    solution: tuple[Movement, ...]
    """Movements, at least one for each goal, in the order of the goals."""
    details: dict[str, Any] = field(default_factory=dict)
    """Plain data to be stored with the solution. Never its score."""
    initial: tuple[Movement, ...] = ()
    """Movements of a learner's first trial; empty if it failed, and for other methods."""
    replay: tuple[Movement, ...] = ()
    """Movements of a learner's noiseless greedy trial after learning; empty if that trial failed,
    and for other methods."""


class Outline(NamedTuple):
    """The properties of a task by which a method says whether it applies."""

    name: str
    """Name of the task, for the sentence."""
    goals_count: int
    """Number of goals."""
    dof: int
    """Number of degrees of freedom of the robot."""
    hands: tuple[Hand, ...]
    """Hands that may hit goals, of ``"left"`` and ``"right"``."""
    initial_hands: str
    """Hand sequence, such as ``"RRRR"``, or policy that the task names for a first solution."""

    @property
    def initial_is_policy(self) -> bool:
        """True if ``initial_hands`` names a policy that finds the hands, not a hand sequence."""
        return self.initial_hands in INITIAL_POLICIES

    @property
    def too_many_sequences(self) -> str | None:
        """A sentence that the task has more than 4096 hand sequences, too many to try one by one;
        else None."""
        return too_many_sequences(self.name, self.goals_count, len(self.hands))


def outline_of(task: Task) -> Outline:
    """Return the properties of a task by which a method says whether it applies."""
    return Outline(task.name, len(task.goals), task.robot.dof, task.hands, task.initial_hands)


class Method(ABC):
    """Base of every method. A subclass declares itself in its class attributes."""

    name: ClassVar[str]
    """Id, such as ``"random-search"``; another form of the method adds ``/form``."""
    title: ClassVar[str]
    citation: ClassVar[str]
    information: ClassVar[frozenset[Information]]
    tuned_on: ClassVar[str] = ""
    """Tasks on which its parameters were chosen, and among how many; empty: not said. Readers judge
    by it whether results are of new tasks; the identity of a run leaves it out."""
    stochastic: ClassVar[bool] = True
    """True if the seed matters; other methods are run once."""
    Parameters: ClassVar[type[Parameters]] = Parameters
    version: ClassVar[int] = 1
    """Version of the method's results, raised with every change of them, a default's as well: runs
    of two versions are not compared."""
    files: ClassVar[tuple[str, ...]] = ()
    """Names of data files in the folder of the method's file. They count as its code."""
    quick: ClassVar[Mapping[str, Any]] = {}
    """Parameters for a check in seconds, where the defaults take longer than that."""

    def __init__(self, parameters: Any = None) -> None:
        self.parameters: Any = self.Parameters() if parameters is None else parameters

    def why_not(self, task: Outline) -> str | None:
        """Return a sentence on why the method does not apply to a task; None if it applies, as
        every method does unless its class or a base overrides this."""
        return None

    @abstractmethod
    def solve(self, session: Session) -> Result:
        """Find a solution of the session's task; return the movements, in a :class:`Result`. Raises
        MethodError if none is found, or NotApplicableError if no initial hands are."""

    def max_batch(self) -> int:
        """Return the largest number of sessions for one call of :meth:`solve_together`; a suite
        gives methods that are not this project's own one session, whatever they return."""
        return 1

    def solve_together(self, sessions: Sequence[Session]) -> Sequence[Result | MethodError]:
        """Solve in several sessions that differ in their seeds alone; return for each, in order,
        the result of :meth:`solve`, or the MethodError that :meth:`solve` raises, as an object.
        """
        results: list[Result | MethodError] = []
        for session in sessions:
            try:
                results.append(self.solve(session))
            except MethodError as error:
                results.append(error)
        return results


MODULES = (
    "coartic.learner.method",
    "coartic.baselines.corrective_alone",
    "coartic.baselines.random_search",
    "coartic.baselines.hill_climbing",
    "coartic.baselines.cma_es",
    "coartic.baselines.nullspace_qp",
    "coartic.baselines.posture_qp",
    "coartic.baselines.posture_based",
    "coartic.baselines.trajectory_optimisation",
    "coartic.baselines.receding_horizon",
    "coartic.baselines.optimum",
)
"""Modules of the built-in methods, each with a list ``METHODS``."""


def run_method(
    method: Method, task: TaskLike, seed: int = 0, *, model: MotionModel = PAPER
) -> tuple[Result, Session]:
    """Let a method solve a task, in this process.

    Methods of this project may see the task and count by themselves; any other method is refused
    undeclared information whose use a session sees (:data:`METERED`). ``task`` is a task, its name
    or its file; ``seed`` is the seed of the method's random numbers; ``model`` has the constants of
    movement. There is no budget of trials, and the solution is not executed.

    Returns the solution with its details, and the session in which it was found, with its counts
    and rewards. Raises MethodError if the method finds no solution, UndeclaredError if it uses
    such information, NotApplicableError if it does not apply to the task or finds no initial hands,
    SolutionError if its solution is no sequence, and ValueError for a seed that is no whole number
    from 0 to 2^128 - 1.
    """
    chosen = as_task(task)
    if (reason := method.why_not(outline_of(chosen))) is not None:
        raise NotApplicableError(reason)
    built_in = (getattr(sys.modules.get(module), "METHODS", ()) for module in MODULES)
    is_ours = any(type(method) in methods for methods in built_in)
    check_limits("seed", seed, 0, MOST_RUN_SEED)
    session = Session(chosen, int(seed), method.information, model=model, trusted=is_ours)
    result = method.solve(session)
    session.check_solution(result.solution)
    return result, session
