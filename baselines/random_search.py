"""Random search: Gaussian noise on target configurations, random hands, keep the best.

Every hand sequence has a centre, at first what the corrective process **A** alone makes of
it, which takes the first trial of the sequence. A trial perturbs all explored joints of the
centre at once. ``pure`` leaves the centres where they are and draws every sequence equally
often; ``climbing`` moves a sequence's centre to any better trial (a (1+1) hill climber per
sequence) and explores hands as the learner does, with ε for each goal around the best
sequence known. The SD and ε are the learner's, untuned.

A better trial leaves the configurations in which the goals were hit, as in the learner. Leaving the
targets with which it was made was tried, mean of five runs of 10 000 trials, so and so: ascending
-301 and -297, two-armed-1 -481 and -474, two-armed-2 -327 and -336.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from coartic.baselines.uninformed import Practice, UninformedParameters
from coartic.method import Method, Result, Session
from coartic.optimisers import TOLD
from coartic.robot import Array

_AHEAD = 128  # trials that are drawn before they are made, at most


class ClimbingParameters(UninformedParameters):
    """Parameters of the hill climber."""

    epsilon: Annotated[float, Field(ge=0, le=1)] = 0.2
    """ε: probability of a random hand, for each goal."""


class _Centre(NamedTuple):
    """What trials of one hand sequence are made around."""

    mask: NDArray[np.bool_]  # explored joints, (G, dof)
    values: Array  # their values, (number of explored joints,)
    reward: float  # what a trial has to exceed to move it


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
        return _Search(session, self.parameters, 1.0, climbs=False).result()


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
        return _Search(session, parameters, parameters.epsilon, climbs=True).result()


class _Search:
    """The centres, and the next trials around them."""

    def __init__(
        self, session: Session, parameters: UninformedParameters, epsilon: float, *, climbs: bool
    ) -> None:
        self._session, self._rng = session, session.rng
        self._first_hands = session.find_initial_hands()
        self._practice = Practice(session, parameters)
        self._letters = [hand[0].upper() for hand in session.hands]
        self._sigma, self._epsilon, self._climbs = parameters.sigma, epsilon, climbs
        self.centres: dict[str, _Centre] = {}
        self._hopeless: set[str] = set()  # A alone does not complete them, ever

    def result(self) -> Result:
        """The best of all trials."""
        with self._session.solving():
            self._run()
        return self._practice.result(sequences=len(self.centres))

    def _run(self) -> None:
        """Make trials until none is left or none can succeed."""
        most, ahead = len(self._letters) ** self._session.goals_count, 1
        following: str | None = self._first_hands
        while self._practice.left > 0 and len(self._hopeless) < most:
            best = self._practice.hands
            hands = self._draw(best) if following is None else following
            following = None
            if hands not in self.centres:
                self._begin(hands)
                continue
            # What comes next is known until a centre moves, which is rare.
            state = self._rng.bit_generator.state
            drawn, following = self._ahead(hands, best, min(ahead, self._practice.left))
            tried, moved = self._around(drawn)
            ahead = min(2 * ahead, _AHEAD)
            if moved:  # then what was drawn beyond that was not to come
                self._rng.bit_generator.state = state
                self._ahead(hands, best, tried)
                following, ahead = None, tried

    def _begin(self, hands: str) -> None:
        """The first trial of a hand sequence."""
        mask = self._practice.explored(hands)
        attempt = self._practice.by_correction(hands)
        if attempt.rewards[0] > -np.inf:
            reward = attempt.rewards[0] if self._climbs else np.inf
            self.centres[hands] = _Centre(mask, attempt.reached[0, mask], reward)
        else:
            self._hopeless.add(hands)

    def _ahead(
        self, hands: str, best: str, count: int
    ) -> tuple[list[tuple[str, Array]], str | None]:
        """Hands and noise of at most ``count`` trials; the hands after them, where drawn."""
        drawn: list[tuple[str, Array]] = []
        while hands in self.centres:
            size = len(self.centres[hands].values)
            drawn.append((hands, self._sigma * self._rng.standard_normal(size)))
            if len(drawn) == count:
                return drawn, None
            hands = self._draw(best)
        return drawn, hands

    def _around(self, drawn: list[tuple[str, Array]]) -> tuple[int, bool]:
        """Make trials up to the first that moves its centre; how many, and whether one did."""
        centres = [self.centres[hands] for hands, _ in drawn]
        values = [centre.values + noise for centre, (_, noise) in zip(centres, drawn, strict=True)]
        than = np.array([centre.reward for centre in centres])
        masks = [centre.mask for centre in centres]
        attempt = self._practice.by_targets([hands for hands, _ in drawn], masks, values, than)
        last = len(attempt.rewards) - 1
        moves = bool(attempt.rewards[last] > than[last])
        if moves:
            reached = attempt.reached[last, masks[last]]
            self.centres[drawn[last][0]] = _Centre(masks[last], reached, attempt.rewards[last])
        return last + 1, moves

    def _draw(self, best: str) -> str:
        """A hand sequence around the best; uniformly random where none has succeeded."""
        rng, letters = self._rng, self._letters
        while True:
            hands = "".join(
                letters[rng.integers(len(letters))]
                if not best or rng.random() < self._epsilon
                else best[goal]
                for goal in range(self._session.goals_count)
            )
            if hands not in self._hopeless:
                return hands


METHODS: tuple[type[Method], ...] = (Pure, Climbing)
