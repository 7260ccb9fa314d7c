"""A bandit over hand sequences, each with its own search over target configurations.

UCB1 chooses the search that makes the next generation of trials; the value of a search is the best
reward of its hand sequence so far. Each search starts from the postures in which the corrective
process **A** on its own hits the goals; finding them takes one trial.
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

    The constructor makes one trial, in which only the corrective process acts. If that trial fails,
    :attr:`reward` is -inf, and the search cannot make generations.

    Parameters
    ----------
    attempts : Attempts
        Makes and counts the trials of the run.
    hand_sequence : str
        Hand sequence, such as ``"RRLR"``.
    """

    def __init__(self, attempts: Attempts, hand_sequence: str) -> None:
        self.hand_sequence = hand_sequence
        self.generations = 1  # the trial by the corrective process counts as a generation
        self.trials = 1
        self._attempts = attempts
        corrective_trial = attempts.run_corrective(hand_sequence)
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
        rewards = self._attempts.around(self.hand_sequence, values[: self._attempts.left]).rewards
        self.generations += 1
        self.trials += len(rewards)
        self.reward = max(self.reward, float(rewards.max()))
        return rewards

    @abstractmethod
    def generation(self) -> None:
        """Make the trials of a generation, and update the search from their rewards.

        At least one trial must be left.
        """

    @property
    @abstractmethod
    def answer(self) -> tuple[float, Array]:
        """Cost of the recommended mean, and that mean.

        - The cost is the mean cost of the last complete generation, in ticks. Without a complete
          generation the cost is infinity.
        - The mean has shape ``(n,)``, in length units and rad.
        """


def sequences_to_try(session: Session, given: str | None) -> list[str]:
    """Return the hand sequences that a bandit tries.

    - If ``given`` is a sequence, only that sequence is tried.
    - Otherwise all hand sequences of the task are tried, if there are at most 4096.
    - If there are more than 4096, only the task's initial sequence is tried.
    """
    return sequences_of(session) if given is None else [given]


def spend_trials(searches: Sequence[Search], attempts: Attempts, exploration: float) -> None:
    """Let searches make generations until no trial of ``attempts`` is left.

    The next generation comes from the search with the highest upper confidence bound (UCB1). The
    constant c of UCB1 is ``exploration`` times the range of the searches' first rewards (at least 1
    tick). A search makes no generation if the corrective process failed with its hand sequence.
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
    """Return movements to the recommended mean with the lowest cost (:attr:`Search.answer`).

    If no search has a complete generation, the mean of the best trial's hand sequence is returned.
    """
    best = min(
        searches, key=lambda each: (each.answer[0], each.hand_sequence != attempts.hand_sequence)
    )
    targets = np.full(attempts.explored.shape, np.nan)
    targets[attempts.explored] = best.answer[1]
    return movements_of(best.hand_sequence, targets)
