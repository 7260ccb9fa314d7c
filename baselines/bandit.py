"""A bandit over hand sequences, each with its own search over target configurations.

UCB1 decides on the best reward of each sequence which search makes the next generation of trials.
Each search starts from the postures in which the corrective process **A** on its own hits the
goals; finding them takes one trial.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence

import numpy as np

from coartic.baselines.uninformed import Attempts
from coartic.method import Session
from coartic.method.optimisers import sequences_of
from coartic.motion.solution import Movement, movements_of
from coartic.robot import Array


class Search(ABC):
    """Search over the targets of one hand sequence.

    Making a search makes a trial by the corrective process. :attr:`reward` is -inf if that trial
    fails, and the search then cannot make generations.

    Parameters
    ----------
    attempts : Attempts
        Account of the trials of the run.
    hands : str
        Hand sequence, such as ``"RRLR"``.
    """

    def __init__(self, attempts: Attempts, hands: str) -> None:
        self.hands = hands
        self.generations = 1  # the trial by the corrective process counts as a generation
        self.trials = 1
        self._attempts = attempts
        corrective_trial = attempts.run_corrective(hands)
        self.reward = float(corrective_trial.rewards[0])
        """Best reward so far; -inf if the corrective process does not complete the sequence."""
        self.first_mean: Array = corrective_trial.reached[0, attempts.explored]
        """Explored joints of the postures of the corrective process, goal by goal, shape
        ``(n,)``."""

    def make_trials(self, values: Array) -> Array:
        """Make the trials of a generation, and return their rewards; -inf for a failed trial.

        Parameters
        ----------
        values : ndarray, shape (N, n)
            Targets of the explored joints, goal by goal, in length units and rad. If fewer than N
            trials are left, only the first ones are made; at least one must be left.
        """
        rewards = self._attempts.around(self.hands, values[: self._attempts.left]).rewards
        self.generations += 1
        self.trials += len(rewards)
        self.reward = max(self.reward, float(rewards.max()))
        return rewards

    @abstractmethod
    def generation(self) -> None:
        """Make the trials of a generation, and learn from them. At least one trial must be
        left."""

    @property
    @abstractmethod
    def answer(self) -> tuple[float, Array]:
        """The mean that the search recommends, shape ``(n,)``, and the mean cost of its last
        complete generation in ticks; infinity if there is none."""


def sequences_to_try(session: Session, given: str | None) -> list[str]:
    """Return the given hand sequence; without one all, or only the initial one if there are more
    than 4096."""
    return sequences_of(session) if given is None else [given]


def spend_trials(searches: Sequence[Search], attempts: Attempts, exploration: float) -> None:
    """Let searches make generations until no trial of ``attempts`` is left.

    The next generation comes from the search with the highest upper confidence bound (UCB1). The
    constant c of UCB1 is ``exploration`` times the range of the searches' first rewards (at least
    1 tick). Searches whose hand sequence the corrective process did not complete make no
    generation.
    """
    promising = [search for search in searches if search.reward > -math.inf]
    rewards = [search.reward for search in promising] or [0.0]
    width = exploration * max(max(rewards) - min(rewards), 1.0)
    generations = len(promising)

    def bound(search: Search) -> float:
        doubt = math.sqrt(2.0 * math.log(generations) / search.generations)
        return search.reward + width * doubt

    while promising and attempts.left > 0:
        max(promising, key=bound).generation()
        generations += 1


def recommend(searches: Iterable[Search], attempts: Attempts) -> tuple[Movement, ...]:
    """Return the movements of the searches' best answer (:attr:`Search.answer`).

    If no search has a complete generation, the hand sequence of the best trial decides.
    """
    best = min(searches, key=lambda each: (each.answer[0], each.hands != attempts.hands))
    targets = np.full(attempts.explored.shape, np.nan)
    targets[attempts.explored] = best.answer[1]
    return movements_of(best.hands, targets)
