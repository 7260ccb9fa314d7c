"""The paper's exploration conditions, and variants of the learner, as data.

A condition says which hands the robot has, which joints are perturbed (AModChosen:
base and chosen arm; AModOther: the other arm) and how hands are explored (DASel).
The learner reads these fields; it has no code of its own for any condition.

Variants go beyond the paper. Two integrate informed search as its Discussion proposes:
a secondary objective in the nullspace of the corrective process, and noise whose mean
lies in the direction that the corrective process suggests. One takes the corrective
process away, one learns from the reward of each subtask in place of the overall one, which
the paper calls crucial. Suite ablations measures what each does to learning.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, get_args, get_origin, get_type_hints

from coartic.errors import CoarticError, need
from coartic.robot import HANDS, Hand

if TYPE_CHECKING:
    from coartic.tasks.task import Task

MOST_NOISE = 100.0
"""Largest noise, length unit and rad, and bias: far beyond what any arm can use. Targets that
lose themselves in the far would be approached step by step without an end."""
HandExploration = Literal["none", "closest", "random"]
Ties = Literal["left", "right", "random", "nearest", "previous"]
EqualDistance = Literal["random", "computed"]
FirstTrial = Literal["learns", "forgotten"]
UnknownTarget = Literal["corrects", "explores"]
Update = Literal["greater", "not-less"]
Learned = Literal["best", "replay"]
Credit = Literal["overall", "subtask"]
State = Literal["previous-hand", "goal"]


@dataclass(frozen=True)
class ExplorationCondition:
    """What the learner explores. Source: paper, section *Experiments*."""

    id: str
    hands: tuple[Hand, ...]
    modify_chosen: bool  # AModChosen
    modify_other: bool  # AModOther
    hand_exploration: HandExploration  # "random" is DASel
    epsilon: float = 0.2  # ε
    noise_sd: float = 0.05  # SD of η, length unit (base) or rad (joints)
    nullspace_gain: float = 0.0
    """β of the corrective process, 0 to 1 (:func:`coartic.motion.corrective.correct`)."""
    bias: float = 0.0
    """Mean of η along the step that **A** would make from q*, on the explored joints, in
    SDs of η. Its mean across that direction stays zero."""
    corrects: bool = True
    """Whether **A** finishes what a stored target misses. If not, such a trial fails;
    **A** is left for pairs (s, a) without a stored target, such as those of trial 0."""
    ties: Ties = "left"
    """The hand among those of equal Q, most often unknown ones."""
    equal_distance: EqualDistance = "random"
    """The closest hand where both are as near: a random one, or what rounding makes nearer."""
    first_trial: FirstTrial = "learns"
    """Whether trial 0 fills Q and q*."""
    unknown_target: UnknownTarget = "corrects"
    """Of a pair (s, a) without a stored target: **A** acts at once, or first the noise, from
    where the robot stands."""
    update: Update = "greater"
    """Whether a trial replaces what is stored where R > Q, or where R >= Q."""
    state: State = "previous-hand"
    """What Q and q* are learned for: a goal and the hand before it, or a goal alone."""
    learned: Learned = "best"
    """What is learned in the end: the best trial, or the noiseless replay after the last."""

    credit: Credit = "overall"
    """What Q(s, a) of a goal stands for: the reward R of the whole trial, or the return from
    that goal on, the reward of its own subtask first."""
    discount: float = 0.0
    """γ, 0 to 1: the return is r_g + γ r_{g+1} + γ² r_{g+2} + …, with r_g the reward of the
    movements to goal g. 0 is the reward of the subtask alone. With credit "subtask" only."""

    def __post_init__(self) -> None:
        if not self.hands or any(hand not in HANDS for hand in self.hands):
            raise ValueError(f"hands {self.hands!r}: name 'left', 'right' or both")
        if not 0.0 <= self.epsilon <= 1.0:
            raise ValueError(f"epsilon {self.epsilon} is not a probability")
        if not 0.0 <= self.noise_sd <= MOST_NOISE:
            raise ValueError(f"noise_sd {self.noise_sd} is not within 0 to {MOST_NOISE:g}")
        if not 0.0 <= self.nullspace_gain <= 1.0:
            raise ValueError(f"nullspace_gain {self.nullspace_gain} is not within 0 to 1")
        if not 0.0 <= self.bias <= MOST_NOISE:
            raise ValueError(f"bias {self.bias} is not within 0 to {MOST_NOISE:g}")
        if not 0.0 <= self.discount <= 1.0:
            raise ValueError(f"discount {self.discount} is not within 0 to 1")
        for name, options in _CHOICES.items():
            if getattr(self, name) not in options:
                *others, last = map(repr, options)
                raise ValueError(
                    f"{name} is {getattr(self, name)!r}; it must be {', '.join(others)} or {last}"
                )
        if self.discount and self.credit == "overall":
            raise ValueError(
                f"discount is {self.discount}, but only rewards of subtasks can be discounted: set "
                "credit to 'subtask'"
            )

    def why_not(self, task: Task) -> str | None:
        """Why the condition does not apply to a task, or None where it does."""
        missing = [hand for hand in self.hands if hand not in task.hands]
        if missing:
            return (
                f"{self.id} uses the {' and '.join(self.hands)} hand, "
                f"task {task.name!r} has no {' or '.join(missing)} hand"
            )
        letters = {hand[0].upper() for hand in self.hands}
        if not task.initial_is_policy and not set(task.initial_hands) <= letters:
            return (
                f"{self.id} uses only the {self.hands[0]} hand, "
                f"task {task.name!r} starts with {task.initial_hands}"
            )
        return None


_CHOICES: dict[str, tuple[str, ...]] = {
    name: get_args(kind)
    for name, kind in get_type_hints(ExplorationCondition).items()
    if get_origin(kind) is Literal
}
"""What each field that is a choice may be."""

CONDITIONS = {
    condition.id: condition
    for condition in (
        ExplorationCondition("EC1", ("right",), True, False, "none"),
        ExplorationCondition("EC2", HANDS, True, True, "closest"),
        ExplorationCondition("EC3", HANDS, True, False, "random"),
        ExplorationCondition("EC4", HANDS, True, True, "random"),
    )
}


NULLSPACE_GAIN = 0.05  # β of the nullspace variants
BIAS = 0.25  # of the biased variants, SDs of η


def _variants(base: str) -> tuple[ExplorationCondition, ...]:
    plain = CONDITIONS[base]
    return (
        replace(plain, id=f"{base}-nullspace", nullspace_gain=NULLSPACE_GAIN),
        replace(plain, id=f"{base}-biased", bias=BIAS),
        replace(plain, id=f"{base}-uncorrected", corrects=False),
        replace(plain, id=f"{base}-subtask", credit="subtask"),
    )


VARIANTS = {condition.id: condition for base in ("EC1", "EC4") for condition in _variants(base)}


def load_condition(condition: str | ExplorationCondition) -> ExplorationCondition:
    """A condition or variant by its id; raises CoarticError for an unknown one, TypeError for
    what is neither."""
    if isinstance(condition, ExplorationCondition):
        return condition
    need(condition, str, "a condition goes by its id, such as EC1")
    try:
        return (CONDITIONS | VARIANTS)[condition.removeprefix("dual-process/")]
    except KeyError:
        known = ", ".join(CONDITIONS | VARIANTS)
        raise CoarticError(f"unknown exploration condition {condition!r}; known: {known}") from None
