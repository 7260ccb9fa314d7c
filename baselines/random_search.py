"""Random search: Gaussian noise on target configurations, random hands, keep the best.

Every hand sequence has a centre, at first what the corrective process **A** alone makes of
it, which takes the first trial of the sequence. A trial perturbs all explored joints of the
centre at once. ``pure`` leaves the centres where they are and draws every sequence equally
often; ``climbing`` moves a sequence's centre to any better trial (a (1+1) hill climber per
sequence) and explores hands as the learner does, with ε for each goal around the best
sequence known. The SD and ε are the learner's, untuned.

``memory`` was tried both ways, mean of five runs of 10 000 trials, "reached" and
"target": ascending -301 and -297, two-armed-1 -481 and -474, two-armed-2 -327 and -336.
The default is what the learner stores.
"""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from baselines.uninformed import TOLD, Practice, UninformedParameters
from coartic.dual_process import spend_search
from coartic.initial import search_initial_hands
from coartic.method import Information, Method, Result, Session
from coartic.robot import Array


class ClimbingParameters(UninformedParameters):
    """Parameters of the hill climber."""

    epsilon: Annotated[float, Field(ge=0, le=1)] = 0.2
    """ε: probability of a random hand, for each goal."""
    memory: Literal["reached", "target"] = "reached"
    """What a better trial leaves: the configurations in which the goals were hit, or the
    targets with which it was made."""


class _Centre(NamedTuple):
    """What trials of one hand sequence are made around."""

    mask: NDArray[np.bool_]  # explored joints, (G, dof)
    values: Array  # their values, (number of explored joints,)
    reward: float


class Pure(Method):
    """Random samples around what the corrective process alone does."""

    name = "random-search/pure"
    title = "Random search around the corrective process"
    citation = (
        "L. A. Rastrigin (1963). The convergence of the random search method in the extremal "
        "control of a many parameter system. Automation and Remote Control."
    )
    told = TOLD
    Parameters = UninformedParameters

    def solve(self, session: Session) -> Result:
        """Every hand sequence is drawn with the same probability."""
        return _search(session, self.parameters, 1.0, None)


class Climbing(Method):
    """A (1+1) hill climber per hand sequence."""

    name = "random-search/climbing"
    title = "Random search, hill climbing"
    citation = (
        "H.-G. Beyer, H.-P. Schwefel (2002). Evolution strategies: a comprehensive "
        "introduction. Natural Computing."
    )
    told = TOLD
    Parameters = ClimbingParameters

    def solve(self, session: Session) -> Result:
        """Hands are drawn around the best sequence known."""
        parameters: ClimbingParameters = self.parameters
        return _search(session, parameters, parameters.epsilon, parameters.memory)


def _search(
    session: Session,
    parameters: UninformedParameters,
    epsilon: float,
    memory: Literal["reached", "target"] | None,
) -> Result:
    task = session.hand_over(Information.CORRECTIVE_PROCESS)
    first = search_initial_hands(task, model=session.model)
    spend_search(session, first)
    practice = Practice(session, parameters)
    letters = [hand[0].upper() for hand in session.hands]
    centres: dict[str, _Centre] = {}
    hopeless: set[str] = set()  # A alone does not complete them, however often it is asked
    hands = first.hands
    with session.solving():
        while practice.left > 0:
            if hands not in centres:
                mask = practice.explored(hands)
                attempt = practice.by_correction(hands)
                if attempt.rewards[0] > -np.inf:
                    values = attempt.reached[0, mask]
                    centres[hands] = _Centre(mask, values, attempt.rewards[0])
                else:
                    hopeless.add(hands)
            else:
                mask, values, reward = centres[hands]
                values = values + parameters.sigma * session.rng.standard_normal(len(values))
                attempt = practice.by_targets(hands, mask, values[None])
                if memory is not None and attempt.rewards[0] > reward:
                    if memory == "reached":
                        values = attempt.reached[0, mask]
                    centres[hands] = _Centre(mask, values, attempt.rewards[0])
            if len(hopeless) == len(letters) ** session.goals_count:
                break
            hands = _draw(session.rng, letters, practice.hands, epsilon, session.goals_count)
            while hands in hopeless:
                hands = _draw(session.rng, letters, practice.hands, epsilon, session.goals_count)
    return practice.result(sequences=len(centres))


def _draw(
    rng: np.random.Generator, letters: list[str], best: str, epsilon: float, goals: int
) -> str:
    """A hand sequence; uniformly random where none has succeeded yet."""
    return "".join(
        letters[rng.integers(len(letters))] if not best or rng.random() < epsilon else best[goal]
        for goal in range(goals)
    )


METHODS: tuple[type[Method], ...] = (Pure, Climbing)
