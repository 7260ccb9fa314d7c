"""The paper's exploration conditions and ablations of the learner, as data.

A condition defines

- which hands the learner uses;
- which joints it perturbs (AModChosen: base and chosen arm; AModOther: the other arm);
- how it explores hands (DASel).

Informed conditions combine informed and uninformed search, which the paper leaves to "future
research" (section *Integrating Informed and Uninformed Search*). They change two things in the base
and the chosen arm. The mean of exploration, which is t in the paper, becomes ::

    t + κ N(t) (p - t)

and each iteration of the corrective process adds the term ::

    β N(x) (p - x)

where

- p is the preferred posture, which is chosen when a goal becomes current;
- t is the stored target and x is the present configuration;
- N = I − J⁺J projects onto the null space of the chosen hand's Jacobian; like the paper's distance,
  it mixes lengths and angles.

There are two ablations, which are not in the paper:

- *uncorrected*: a movement to a stored target that misses its goal is not corrected;
- *subtask*: the learner learns from the reward of each subtask. The paper calls it crucial that it
  learns from the overall reward.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import (
    ConfigDict,
    Field,
    ValidationError,
    ValidatorFunctionWrapHandler,
    WrapValidator,
)
from pydantic.dataclasses import dataclass

from coartic.errors import CoarticError
from coartic.internal.limits import brief_value
from coartic.internal.text import unknown
from coartic.internal.validation import describe_validation_errors, described_error
from coartic.robot import HANDS, Hand

if TYPE_CHECKING:
    from coartic.method import Outline
    from coartic.tasks.task import Task

METHOD_PREFIX = "dual-process/"
"""Prefix of the names of the learner's methods; the id of the exploration condition follows."""
MAX_NOISE = 100.0
"""Largest standard deviation of noise that is accepted, in length units and rad."""
Share = Annotated[float, Field(ge=0, le=1)]
Drift = Annotated[float, Field(ge=0, le=10)]


def _one_or_many(value: Any, validate: ValidatorFunctionWrapHandler) -> Any:
    """Validate a drift: a number, or a tuple of numbers.

    For any other value, raises a single validation error instead of two errors (number, tuple).
    """
    try:
        return validate(value)
    except ValidationError:
        raise described_error(
            f"drift is {brief_value(value)}; it must be a number from 0 to 10, or a list of such "
            "numbers"
        ) from None


Drifts = Annotated[
    Drift | Annotated[tuple[Drift, ...], Field(min_length=1, strict=False)],
    WrapValidator(_one_or_many),
]


@describe_validation_errors
@dataclass(frozen=True, config=ConfigDict(extra="forbid"))
class ExplorationCondition:
    """Rules of the learner's exploration and learning (paper, section *Experiments*).

    ``CONDITIONS`` has the paper's four conditions, ``ABLATIONS`` has conditions that change a part
    of the learner, and ``INFORMED`` has conditions with more information. To change fields of a
    condition, use ``dataclasses.replace``. Raises ValueError if a field is out of range, or if two
    fields contradict each other.
    """

    id: str
    """Name of the condition, such as ``"EC4"``."""
    hands: Annotated[tuple[Hand, ...], Field(min_length=1)]
    """Hands that the learner uses."""
    modify_chosen: bool
    """True if noise moves the targets of the free base and of the arm that is to hit
    (AModChosen)."""
    modify_other: bool
    """True if noise moves the targets of the other arm (AModOther); False if the other arm does not
    move."""
    hand_exploration: Literal["none", "closest", "random", "nearest-posture"]
    """Exploration of the hand for a goal:

    - ``"none"``: none;
    - ``"closest"``: the hand closest to the goal;
    - ``"random"``: a random hand (DASel);
    - ``"nearest-posture"``: the hand whose corrective posture for the goal is nearest in joint
      space.
    """
    epsilon: Share = 0.2
    """ε: probability with which the hand for a goal is explored (published)."""
    noise_sd: Annotated[float, Field(ge=0, le=MAX_NOISE, allow_inf_nan=False)] = 0.05
    """Standard deviation of the noise η (published), in length units (base) and rad (joints)."""
    corrects: bool = True
    """True if the corrective process **A** acts when a movement to a stored target misses its goal.
    If False, such a trial fails, and **A** acts only in trial 0 and for states and hands without a
    stored target."""
    learned: Literal["best", "replay"] = "best"
    """Solution of a run: its best trial (``"best"``), or a greedy trial without exploration after
    the last trial (``"replay"``)."""
    credit: Literal["overall", "subtask"] = "overall"
    """Credit assignment, that is, the reward from which Q(s, a) is learned at a goal: the reward R
    of the whole trial (``"overall"``), or the return of the goal (``"subtask"``, see
    ``discount``)."""
    discount: Share = 0.0
    """γ: the return of goal g is Σ γ^|h − g| r_h, where r_h is the reward of the movements to goal
    h. With γ = 0 the return is the reward of the subtask itself. A value above 0 needs credit
    ``"subtask"``.
    """
    counted: Literal["later", "all"] = "later"
    """Goals h in the sum for the return of goal g: g and later goals (``"later"``), or all goals
    (``"all"``, which needs credit ``"subtask"``). With ``"all"`` and γ = 1 every return is R."""
    drift: Drifts = 0.0
    """κ, gain of informed exploration: the fraction of the null-space distance to the preferred
    posture by which the mean of exploration moves. If κ is a tuple, each trial after trial 0 draws
    one number of the tuple."""
    pull: Share = 0.0
    """β, gain of informed correction: the fraction of the null-space distance to the preferred
    posture that each iteration of the corrective process adds, after trial 0."""
    direction: Literal["next-goal", "stay", "start"] = "next-goal"
    """The preferred posture:

    - ``"next-goal"``: halfway to the stored target of the next goal, if there is one;
    - ``"stay"``: the configuration of the robot when the goal becomes current;
    - ``"start"``: the configuration at the start of the trial, as a control with wrong information.
    """

    def __post_init__(self) -> None:
        if len({*self.hands}) < len(self.hands):
            raise ValueError(f"hands names the same hand twice: {', '.join(self.hands)}")
        if self.discount and self.credit == "overall":
            raise ValueError(
                f"discount is {self.discount}, but only the rewards of subtasks can be discounted: "
                "set credit to 'subtask'"
            )
        if self.counted == "all" and self.credit == "overall":
            raise ValueError(
                "counted is 'all', but only the returns of subtasks add up rewards of goals: set "
                "credit to 'subtask'"
            )
        if self.direction != "next-goal" and not self.is_informed:
            raise ValueError(
                f"direction={self.direction!r} has no effect unless drift or pull is above 0"
            )
        if self.credit == "subtask" and self.learned == "best":
            raise ValueError(
                "credit is 'subtask', so the learner does not compare whole trials and cannot know "
                "its best one: set learned to 'replay'"
            )

    @property
    def drifts(self) -> tuple[float, ...]:
        """The field ``drift`` (κ) as a tuple. A single number becomes a tuple of one number."""
        return self.drift if isinstance(self.drift, tuple) else (self.drift,)

    @property
    def is_informed(self) -> bool:
        """True if ``drift`` or ``pull`` is not 0, so that a preferred posture is used."""
        return any(self.drifts) or self.pull > 0

    def inapplicable_reason(self, task: Task | Outline) -> str | None:
        """Return why the condition does not apply to a task's hands; None if it applies."""
        missing = [hand for hand in self.hands if hand not in task.hands]
        if missing:
            return (
                f"{self.id} uses the {' and '.join(self.hands)} hand, "
                f"but task {task.name!r} has no {' or '.join(missing)} hand"
            )
        letters = {hand[0].upper() for hand in self.hands}
        if not task.initial_is_policy and not set(task.initial_hands) <= letters:
            return (
                f"{self.id} uses only the {self.hands[0]} hand, "
                f"but task {task.name!r} starts with {task.initial_hands}"
            )
        return None


CONDITIONS = {
    condition.id: condition
    for condition in (
        ExplorationCondition("EC1", ("right",), True, False, "none"),
        ExplorationCondition("EC2", HANDS, True, True, "closest"),
        ExplorationCondition("EC3", HANDS, True, False, "random"),
        ExplorationCondition("EC4", HANDS, True, True, "random"),
    )
}
VARIANTS: dict[str, tuple[str, dict[str, Any]]] = {
    "uncorrected": ("no correction", {"corrects": False}),
    # A learner of subtasks must not choose its solution by the reward of the whole task.
    "subtask": ("subtask reward", {"credit": "subtask", "learned": "replay"}),
}
"""Maps the name of each variant of EC1 and EC4 to words for its title and its changed fields."""
ABLATIONS = {
    f"{base}-{name}": replace(CONDITIONS[base], id=f"{base}-{name}", **fields)
    for base in ("EC1", "EC4")
    for name, (_, fields) in VARIANTS.items()
}

INFORMED = {
    f"{base}-informed": replace(CONDITIONS[base], id=f"{base}-informed", drift=1.0)
    for base in ("EC1", "EC4")
}
"""Informed conditions: EC1 and EC4 with a drift. The preferred posture is halfway to the posture
for the next goal because the shortest path is straight. The conditions therefore use the formula of
the reward.

The drift was chosen among 0.1, 0.3 and 1 by the mean gap after 10,000 trials on development
instances d000 to d009 of five families, three runs each (``studies/dial/development.toml``). The
gaps were 6.8, 4.2 and 4.0 %.
"""
EVERY_CONDITION = CONDITIONS | ABLATIONS | INFORMED
"""All conditions by id."""


def load_condition(condition: str | ExplorationCondition) -> ExplorationCondition:
    """Look up an exploration condition by its id, such as ``"EC4"`` or ``"dual-process/EC4"``.

    If the argument is a condition already, it is returned unchanged. Raises CoarticError for an
    unknown id, and TypeError for an object that is neither a string nor a condition.
    """
    if isinstance(condition, ExplorationCondition):
        return condition
    if not isinstance(condition, str):
        raise TypeError(
            f"condition is {brief_value(condition)}; it must be an ExplorationCondition or the "
            "name of one, such as 'EC4'"
        )
    try:
        return EVERY_CONDITION[condition.removeprefix(METHOD_PREFIX)]
    except KeyError:
        raise CoarticError(unknown("exploration condition", condition, EVERY_CONDITION)) from None
