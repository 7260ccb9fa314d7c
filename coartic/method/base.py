"""The base class of methods: what a method declares, and how it is run."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from typing import Annotated, Any, ClassVar, NamedTuple

from pydantic import BaseModel, ConfigDict, Field
from pydantic.dataclasses import dataclass as checked_dataclass

from coartic.internal.limits import brief_value
from coartic.internal.validation import describe_validation_errors
from coartic.method.session import Information, MethodError, Session
from coartic.model import PAPER, WORLD, MotionModel, differences
from coartic.motion.initial_hands import too_many_sequences
from coartic.motion.solution import Movement, next_action
from coartic.robot import Hand
from coartic.tasks.task import INITIAL_POLICIES, Task

TRIALS = 10_000
"""Number of trials of a run by default (published)."""
CORRECTIONS_BY_TENTH = "corrections"
"""Key in the details of a learner's result. The value is a list of 11 numbers of corrective
movements: in trial 0, and in each tenth of the later trials."""


@describe_validation_errors
class Parameters(BaseModel):
    """Base class of the parameters of methods: immutable plain data, checked by pydantic."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


@dataclass(frozen=True)
class Result:
    """A solution, and further data that a method returns with it."""

    solution: tuple[Movement, ...]
    """Movements, at least one for each goal, in the order of the goals. With motor noise they are
    the movements that the method recommends to make next (:func:`answer_of`)."""
    details: dict[str, Any] = field(default_factory=dict)
    """Plain data that are stored with the solution. They have no effect on its score."""
    initial: tuple[Movement, ...] = ()
    """Movements of a learner's first trial; empty if that trial failed, and for other methods."""
    replay: tuple[Movement, ...] = ()
    """Movements of a learner's noiseless greedy trial after learning; empty if that trial failed,
    and for other methods."""


def answer_of(result: Result, model: MotionModel) -> Result:
    """Return the part of a method's result that is judged under a motion model.

    Without motor noise this is the result itself. With motor noise it is a copy with these changes:

    - The movements of the solution have no ticks, and corrective movements have no targets, because
      both depend on a single draw of the noise (:func:`coartic.motion.solution.next_action`).
    - ``initial`` and ``replay`` are empty for the same reason.

    Examples
    --------
    >>> from coartic import PAPER, Movement
    >>> result = Result((Movement(1, "right", "corrective", target=[0.0] * 10, ticks=7),))
    >>> answer_of(result, PAPER) is result
    True
    >>> answer_of(result, PAPER._replace(motor_noise=0.01)).solution
    (Movement(goal=1, hand='right', kind='corrective', target=None, ticks=None, waypoints=None),)
    """
    if model.motor_noise == 0.0:
        return result
    return Result(next_action(result.solution), result.details)


class Outline(NamedTuple):
    """The properties of a task by which a method decides whether it applies."""

    name: str
    """Name of the task, for the sentence of :meth:`Method.inapplicable_reason`."""
    goals_count: int
    """Number of goals."""
    dof: int
    """Number of degrees of freedom of the robot."""
    hands: tuple[Hand, ...]
    """Hands that may hit goals: ``"left"``, ``"right"`` or both."""
    initial_hands: str
    """Hand sequence of trial 0, such as ``"RRRR"``, or the policy that finds one."""

    @property
    def initial_is_policy(self) -> bool:
        """True if ``initial_hands`` names a policy that finds the hands, not a hand sequence."""
        return self.initial_hands in INITIAL_POLICIES

    @property
    def too_many_sequences(self) -> str | None:
        """A sentence if the task has more than 4096 hand sequences, else None."""
        return too_many_sequences(self.name, self.goals_count, len(self.hands))


def outline_of(task: Task) -> Outline:
    """Return the outline of a task, from which a method decides whether it applies."""
    return Outline(task.name, len(task.goals), task.robot.dof, task.hands, task.initial_hands)


@describe_validation_errors
@checked_dataclass(frozen=True)
class Facts:
    """Citations and names of a method for figures, tables and the bibliography.

    Raises ValueError if a value does not fit its field, for example if ``short`` is too long.

    Examples
    --------
    >>> Facts(works=("hansen2016",), algorithm="CMA-ES", short="CMA-ES, big steps").short
    'CMA-ES, big steps'
    """

    works: tuple[str, ...] = ()
    """Keys in ``analysis/references.bib`` of the works that describe the method, the most important
    first."""
    solvers: tuple[str, ...] = ()
    """Keys in ``analysis/references.bib`` of the works on the solvers that the method uses."""
    algorithm: str = ""
    """Name of the algorithm that the method implements; several methods can implement the same
    algorithm. By default it is the title of a built-in method, and the id of a method from a
    file."""
    short: Annotated[str, Field(max_length=22)] = ""
    """Name in narrow figures, at most 22 characters. By default it is the title of a built-in
    method, and the id of a method from a file."""
    headline: bool = True
    """True if the method represents its algorithm in tables and figures that contain only some
    methods."""
    ablation_of: str = ""
    """Id of the method of which this method is an ablation."""


class Method(ABC):
    """Base class of methods.

    A subclass sets the class attributes below (its id, title, the information that it uses, ...)
    and implements :meth:`solve`.
    """

    name: ClassVar[str]
    """Id, such as ``"random-search"``. Forms of one method have ids such as ``"cma-es/bandit"``."""
    title: ClassVar[str]
    """Name in figures and tables."""
    facts: ClassVar[Facts] = Facts()
    """Works, short name and algorithm of the method. A subclass does not inherit them."""
    citation: ClassVar[str] = ""
    """Reference, as text, to works that are missing from ``analysis/references.bib``."""
    information: ClassVar[frozenset[Information]]
    """Information that the method uses."""
    tuned_on: ClassVar[str] = ""
    """Tasks on which the method's parameters were chosen, and among which values; empty if that is
    not known. Readers can see from this attribute which tasks are new to the method. The attribute
    is not a part of the id of a run."""
    adapts_to: ClassVar[frozenset[str] | None] = None
    """Constants of the world (:data:`.WORLD`) that may differ from the paper's when the method
    runs. ``motor_noise`` may always differ, and so may ``radius``, since a method gets the task
    with this radius. None, the default, stands for

    - only ``motor_noise``, if the method declares the reward formula or the kinematic model,
      because such a method may itself compute lengths as in the paper;
    - all constants of the world otherwise.
    """
    stochastic: ClassVar[bool] = True
    """True if the results depend on the seed. If False, a suite runs the method once on each task
    (in each world)."""
    Parameters: ClassVar[type[Parameters]] = Parameters
    """Class of the method's parameters. By default a method has none."""
    version: ClassVar[int] = 1
    """Version of the method's results. Increase the version whenever results change, also if a
    default changes. Runs of different versions are not compared."""
    files: ClassVar[tuple[str, ...]] = ()
    """Names of data files in the folder of the method's file. These files count as a part of the
    method's code."""
    quick: ClassVar[Mapping[str, Any]] = {}
    """Parameters for a check that takes seconds, if the defaults take longer."""

    def __init_subclass__(cls, **more: Any) -> None:
        super().__init_subclass__(**more)
        cls.facts = vars(cls).get("facts", Facts())

    def __init__(self, parameters: Any = None) -> None:
        self.parameters: Any = self.Parameters() if parameters is None else parameters

    def inapplicable_reason(self, task: Outline) -> str | None:
        """Return a sentence on why the method does not apply to a task, or None.

        By default a method applies to every task.
        """
        return None

    @classmethod
    def refuses(cls, model: MotionModel) -> str | None:
        """Return a sentence on why the method cannot run under a motion model, or None.

        The sentence names the first constant of the world that differs from the paper's and to
        which the method does not adapt (:attr:`adapts_to`). Motor noise, the radius of the goals,
        and constants that are not in :data:`.WORLD`, are never a reason.
        """
        adapts_to = cls.adapts_to
        if adapts_to is None:
            knows = {Information.REWARD_FORMULA, Information.KINEMATIC_MODEL} & cls.information
            adapts_to = frozenset({"motor_noise"} if knows else WORLD)
        for name, value in differences(model).items():
            if name not in {"motor_noise", "radius", *adapts_to}:
                paper = getattr(PAPER, name)
                return (
                    f"model.{name} is {value!r}; method {cls.name!r} plans with the paper's "
                    f"{name} {paper!r}: leave the constant out, or choose another method"
                )
        return None

    @abstractmethod
    def solve(self, session: Session) -> Result:
        """Find a solution of the session's task, and return it.

        Parameters
        ----------
        session : Session
            One task, one seed and one budget. The method makes all its calls through the session.

        Returns
        -------
        Result
            The solution, with at least one movement for each goal, and further data to be stored.
            With motor noise (``session.model.motor_noise`` above 0) the reward of the best trial is
            partly luck. The solution then consists of the movements that the method recommends to
            make next. These movements are judged on draws of the noise that occurred in none of the
            method's trials.

        Raises
        ------
        MethodError
            No solution is found.
        NotApplicableError
            No initial hands are found.
        BudgetError
            The method made a trial when none was left.
        """

    def max_batch(self) -> int:
        """Return the largest number of sessions for one call of :meth:`solve_together`.

        The number matters only for methods of this project. For any other method, a suite calls
        :meth:`solve` with one session at a time.
        """
        return 1

    def solve_together(self, sessions: Sequence[Session]) -> Sequence[Result | MethodError]:
        """Solve the task in many sessions that differ only in their seeds.

        Parameters
        ----------
        sessions : sequence of Session
            At most :meth:`max_batch` sessions.

        Returns
        -------
        sequence of Result or MethodError
            For each session, in order, the result of :meth:`solve`, or the MethodError that
            :meth:`solve` raised.
        """
        results: list[Result | MethodError] = []
        for session in sessions:
            try:
                results.append(self.solve(session))
            except MethodError as error:
                results.append(error)
        return results


def reason_against(method: Method, task: Outline) -> str | None:
    """Return why a method does not apply to a task, or None (:meth:`Method.inapplicable_reason`).

    Raises TypeError if the method answers anything else, such as ``""`` or False.
    """
    reason = method.inapplicable_reason(task)
    if reason is None or (isinstance(reason, str) and reason.strip()):
        return reason
    raise TypeError(
        f"inapplicable_reason returned {brief_value(reason)}; it must return a sentence, or None "
        "if the method applies"
    )


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
    "coartic.baselines.policy_gradient",
)
"""Modules of the built-in methods, in the order of lists and figures. Each module has a sequence
``METHODS`` of classes. Add a new module at the end, so that the other methods keep their colours
and markers."""


@cache
def built_in_methods() -> Mapping[str, type[Method]]:
    """Return a dict that maps the ids of the built-in methods to their classes.

    The methods are in the order of :data:`MODULES`; these modules are imported. Each call returns
    the same dict: do not change it.
    """
    return {method.name: method for name in MODULES for method in import_module(name).METHODS}
