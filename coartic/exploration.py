"""The paper's exploration conditions, as data.

A condition says which hands the robot has, which joints are perturbed (AModChosen:
base and chosen arm; AModOther: the other arm) and how hands are explored (DASel).
The learner reads these fields; it has no code of its own for any condition.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from coartic.errors import CoarticError
from coartic.robot import HANDS, Hand

if TYPE_CHECKING:
    from coartic.task import Task

HandExploration = Literal["none", "closest", "random"]


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

    def __post_init__(self) -> None:
        if not self.hands or any(hand not in HANDS for hand in self.hands):
            raise ValueError(f"hands {self.hands!r}: name 'left', 'right' or both")
        if not 0.0 <= self.epsilon <= 1.0:
            raise ValueError(f"epsilon {self.epsilon} is not a probability")
        if not 0.0 <= self.noise_sd < float("inf"):
            raise ValueError(f"noise_sd {self.noise_sd} is not a finite number >= 0")
        if self.hand_exploration not in ("none", "closest", "random"):
            raise ValueError(
                f"hand_exploration {self.hand_exploration!r}: it is 'none', 'closest' or 'random'"
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


CONDITIONS = {
    condition.id: condition
    for condition in (
        ExplorationCondition("EC1", ("right",), True, False, "none"),
        ExplorationCondition("EC2", HANDS, True, True, "closest"),
        ExplorationCondition("EC3", HANDS, True, False, "random"),
        ExplorationCondition("EC4", HANDS, True, True, "random"),
    )
}


def load_condition(condition: str | ExplorationCondition) -> ExplorationCondition:
    """A condition by its id; raises CoarticError for an unknown one."""
    if isinstance(condition, ExplorationCondition):
        return condition
    try:
        return CONDITIONS[condition.removeprefix("dual-process/")]
    except KeyError:
        known = ", ".join(CONDITIONS)
        raise CoarticError(
            f"unknown exploration condition {condition!r}; known: {known}"
        ) from None
