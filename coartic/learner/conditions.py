"""The paper's exploration conditions, and ablations and extensions of the learner, as data.

A condition defines

- which hands the learner uses;
- which joints it perturbs (AModChosen: base and chosen arm; AModOther: the other arm);
- how it explores hands (DASel).

*Informed conditions* combine informed and uninformed search, which the paper leaves to "future
research" (section *Integrating Informed and Uninformed Search*). They use null-space projection to
move the base and the chosen arm towards a preferred posture. With gain κ (field ``drift``) above 0,
the mean of exploration, which in the paper is the stored target t, becomes ::

    t + κ N(t) (p - t)

Here

- p is the preferred posture: halfway from the robot's configuration, when a goal becomes current,
  to the stored target of the next goal; the configuration itself if there is no such target;
- N = I − J⁺J is the projection onto the null space of the Jacobian J of the chosen hand. Like the
  paper's distance in joint space, the projection mixes lengths and angles.

There are two *ablations*, which are not in the paper:

- *uncorrected*: a movement to a stored target that misses its goal is not corrected;
- *subtask*: the learner learns from the reward of each subtask, that is, of the movements to one
  goal, and its solution is a greedy trial after learning. The paper calls it crucial that the
  learner learns from the overall reward.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass

from coartic.errors import CoarticError
from coartic.internal.limits import brief_value
from coartic.internal.text import unknown
from coartic.internal.validation import describe_validation_errors
from coartic.robot import HANDS, Hand

if TYPE_CHECKING:
    from coartic.method import Outline
    from coartic.tasks.task import Task

METHOD_PREFIX = "dual-process/"
"""Prefix of the ids of the learner's methods. After the prefix comes the id of the exploration
condition, or ``custom``."""
MAX_NOISE = 100.0
"""Largest allowed standard deviation of exploration noise, in length units and rad."""
Share = Annotated[float, Field(ge=0, le=1)]


@describe_validation_errors
@dataclass(frozen=True, config=ConfigDict(extra="forbid"))
class ExplorationCondition:
    """Rules of the learner's exploration and learning (paper, section *Experiments*).

    ``CONDITIONS`` contains the paper's four conditions, ``ABLATIONS`` contains ablations of EC1 and
    EC4, and ``INFORMED`` contains conditions that use more information.
    To change fields of a condition, use ``dataclasses.replace``. Raises ValueError if a field is
    out of range, or if two fields contradict each other.

    Examples
    --------
    >>> from dataclasses import replace
    >>> replace(CONDITIONS["EC4"], id="EC4, less noise", noise_sd=0.02).noise_sd
    0.02
    """

    id: str
    """Name of the condition, such as ``"EC4"``."""
    hands: Annotated[tuple[Hand, ...], Field(min_length=1)]
    """Hands that the learner uses."""
    modify_chosen: bool
    """True if noise is added to the targets of the base (its coordinates that are not locked) and
    of the chosen arm, whose hand is to hit the goal (AModChosen)."""
    modify_other: bool
    """True if noise is added to the targets of the other arm (AModOther). If False, movements to
    stored targets do not move the other arm."""
    hand_exploration: Literal["none", "closest", "random"]
    """Which hand is tried for a goal when the hand is explored, which happens with probability
    ``epsilon``:

    - ``"none"``: hands are not explored;
    - ``"closest"``: the hand closest to the goal, or a random hand if both are equally close;
    - ``"random"``: a random hand (DASel).
    """
    epsilon: Share = 0.2
    """ε: probability with which the hand for a goal is explored (published)."""
    noise_sd: Annotated[float, Field(ge=0, le=MAX_NOISE, allow_inf_nan=False)] = 0.05
    """Standard deviation of the noise η (published), in length units (base) and rad (joints)."""
    corrects: bool = True
    """True if the corrective process **A** acts when a movement to a stored target misses its goal.
    If False, a trial fails when such a movement misses, and **A** acts only in trial 0 and at goals
    for which no target is stored for the state and the hand."""
    learned: Literal["best", "replay"] = "best"
    """Which trial is the solution of a run: the best trial (``"best"``), or a greedy trial without
    exploration that is made after the last trial (``"replay"``)."""
    credit: Literal["overall", "subtask"] = "overall"
    """Credit assignment: from which reward the value Q(s, a) is learned at a goal. It is the reward
    R of the whole trial (``"overall"``), or that of the movements to the goal (``"subtask"``)."""
    drift: Annotated[float, Field(ge=0, le=10)] = 0.0
    """κ, gain of null-space exploration: the fraction of the null-space displacement to the
    preferred posture by which the mean of exploration is moved."""

    def __post_init__(self) -> None:
        if len({*self.hands}) < len(self.hands):
            raise ValueError(f"hands names the same hand twice: {', '.join(self.hands)}")
        if self.credit == "subtask" and self.learned == "best":
            raise ValueError(
                "credit is 'subtask', so the learner does not compare whole trials and cannot know "
                "its best one: set learned to 'replay'"
            )

    @property
    def is_informed(self) -> bool:
        """True if ``drift`` is not 0, so that a preferred posture is used."""
        return self.drift > 0

    def inapplicable_reason(self, task: Task | Outline) -> str | None:
        """Return why the condition does not fit a task's hands; None if it fits."""
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
"""Dict that maps the name of each ablation to a tuple: a phrase for its title, and a dict that maps
the changed fields of EC1 or EC4 to their values."""
ABLATIONS = {
    f"{base}-{name}": replace(CONDITIONS[base], id=f"{base}-{name}", **fields)
    for base in ("EC1", "EC4")
    for name, (_, fields) in VARIANTS.items()
}

INFORMED = {
    f"{base}-informed": replace(CONDITIONS[base], id=f"{base}-informed", drift=1.0)
    for base in ("EC1", "EC4")
}
"""Dict that maps ids to the informed conditions: EC1 and EC4 with null-space exploration. The
preferred posture is halfway to the posture at the next goal, because the shortest path is straight.
So these conditions use the formula of the reward.

Their ``drift`` was chosen among 0.1, 0.3 and 1 by the mean gap after 10,000 trials on development
instances d000 to d009 of five families, three runs each (``studies/dial/development.toml``). The
mean gaps were 6.8, 4.2 and 4.0 %, in this order.
"""
EVERY_CONDITION = CONDITIONS | ABLATIONS | INFORMED
"""Dict that maps the ids of all conditions to the conditions."""


def load_condition(condition: str | ExplorationCondition) -> ExplorationCondition:
    """Return the exploration condition with an id, such as ``"EC4"`` or ``"dual-process/EC4"``.

    A condition that is passed is returned unchanged. Raises CoarticError for an unknown id, and
    TypeError for an object that is neither a string nor a condition.
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
