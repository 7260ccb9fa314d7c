"""Hill climbing: Gaussian noise and drawn hands, a (1+1) hill climber for each hand sequence.

A sequence has a centre, at first the configurations in which its first trial hits the goals. In
this trial the corrective process **A** acts alone (or see ``begin``). Each later trial perturbs all
explored joints of the centre at once; any better one moves the centre to the configurations in
which it hit the goals, as in the learner.
To keep its targets would gain more: random search with 1,000 ``stages`` gains 0 to 16 ticks more
with targets on the paper's tasks. Hands are explored as the learner does, with ε for each goal
around the best sequence known. SD (by default) and ε are the learner's, untuned.
"""

from __future__ import annotations

from itertools import pairwise
from operator import eq
from typing import Literal

import numpy as np

from coartic.baselines.uninformed import Attempts, UninformedParameters
from coartic.method import Method, Result, Session
from coartic.method.optimisers import OPTIMISER_INFORMATION
from coartic.robot import Array
from coartic.tasks.task import letters_of

_EPSILON = 0.2  # probability of a random hand, for each goal
_MOST_DRAWN = 128  # trials that are drawn before they are made, at most


class HillClimbingParameters(UninformedParameters):
    """Parameters of hill climbing; the defaults are the learner's."""

    begin: Literal["correction", "best"] = "correction"
    """Where the first trial of a hand sequence begins. ``"correction"``: **A** acts alone.
    ``"best"``: as in the learner's table, at the centre of the best sequence so far, perturbed, at
    each goal where both sequences have the same hand and the same hand before; **A** acts at the
    other goals."""


class HillClimbing(Method):
    """Hill climbing for each hand sequence, from its best trial so far."""

    name = "hill-climbing"
    tuned_on = "nothing: the paper's values"
    title = "Hill climbing, (1+1) for each hand sequence"
    citation = (
        "H.-G. Beyer, H.-P. Schwefel (2002). Evolution strategies: a comprehensive "
        "introduction. Natural Computing."
    )
    information = OPTIMISER_INFORMATION
    Parameters = HillClimbingParameters

    def solve(self, session: Session) -> Result:
        """Make trials until none is left, or every hand sequence has failed; return the movements
        of the best trial. Raises MethodError if no trial hit every goal, and NotApplicableError if
        no initial hands are found."""
        first, rng, letters = session.find_initial_hands(), session.rng, letters_of(session.hands)
        attempts = Attempts(session, self.parameters.trials)
        most, ahead = len(letters) ** session.goals_count, 1
        explored, dim = attempts.explored, attempts.explored.sum()
        centres: dict[str, Array] = {}  # their values, (G, dof); NaN for the other joints
        rewards: dict[str, float] = {}  # a trial with more moves the centre
        hopeless: set[str] = set()  # A alone does not complete them, ever

        def draw() -> str:
            """Draw a hand sequence: hands of the best trial, each replaced with probability 0.2 by
            a random hand, or, before a success, random hands; never a sequence with which the
            corrective process alone failed."""
            while True:
                chosen = list(attempts.hands or letters[0] * session.goals_count)
                for goal in range(len(chosen)):
                    if not attempts.hands or rng.random() < _EPSILON:
                        chosen[goal] = letters[rng.integers(len(letters))]
                if (hands := "".join(chosen)) not in hopeless:
                    return hands

        def begin(hands: str) -> Array:
            """Return the targets of the first trial of a hand sequence, shape ``(G, dof)``."""
            targets = np.full(explored.shape, np.nan)
            if self.parameters.begin == "best" and attempts.hands:
                states, of_best = ([*pairwise(f" {each}")] for each in (hands, attempts.hands))
                shared = np.array([*map(eq, states, of_best)])
                aimed = shared[:, None] & explored
                noise = self.parameters.sigma * rng.standard_normal(aimed.sum())
                targets[aimed] = centres[attempts.hands][aimed] + noise
            return targets

        with session.solving():
            while attempts.left > 0 and len(hopeless) < most:
                # The next draws are known until a centre moves, which is rare: they are tried
                # together, and what was drawn beyond the trial that moves one is drawn again.
                drawn, noise, states = list[str](), list[Array](), [rng.bit_generator.state]
                while len(drawn) < min(ahead, attempts.left):
                    hands = draw() if attempts.trials_made else first
                    if hands not in centres:
                        break
                    drawn.append(hands)
                    noise.append(rng.standard_normal(dim))
                    states.append(rng.bit_generator.state)
                if drawn:
                    than = np.array([rewards[hands] for hands in drawn])
                    targets = np.array([centres[hands] for hands in drawn])
                    targets[:, explored] += self.parameters.sigma * np.array(noise)
                    attempt = attempts.by_targets(drawn, targets, until=than)
                    tried = len(attempt.rewards)
                    rng.bit_generator.state = states[tried]
                    hands, ahead = drawn[tried - 1], min(2 * ahead, _MOST_DRAWN)
                    if attempt.rewards[-1] > rewards[hands]:
                        ahead = tried
                else:
                    rewards[hands] = -np.inf
                    targets = begin(hands)
                    attempt = attempts.by_targets([hands], targets[None])
                    if attempt.rewards[-1] == -np.inf and np.isnan(targets).all():
                        hopeless.add(hands)
                if attempt.rewards[-1] > rewards[hands]:
                    centres[hands] = np.where(explored, attempt.reached[-1], np.nan)
                    rewards[hands] = float(attempt.rewards[-1])
        return attempts.result(sequences=len(centres))


METHODS: tuple[type[Method], ...] = (HillClimbing,)
