"""CMA-ES over target configurations, with a bandit that finds the hand sequence.

Every hand sequence has an evolution strategy of its own (CMA-ES, Hansen 2016) over the
targets of all its explored joints, which sees the total reward of each trial and nothing
else. Its first mean are the configurations of the corrective process **A** alone, which takes
one trial; its first step size is the learner's noise; where it stops by its own
criteria it begins anew there with twice the population (IPOP, Auger & Hansen 2005). A
failed trial ranks last. UCB1 (Auer, Cesa-Bianchi & Fischer 2002) on the best reward of each
sequence, scaled by the spread of the first rewards, decides which strategy makes the next
generation of trials.

Tuning, three or four runs a value. c = 0.02, 0.05, 0.1, 0.2, 0.5 on the two-armed tasks: no
reward differs by more than 2.4; with the other arm kept still, up to 0.05 can settle on RRRR in
two-armed-2 (-339 in the mean, where 0.1 and more give -331). Step sizes 0.02, 0.05, 0.1
and 0.2 within one given sequence are within 5 of each other after 2000 trials; after 300
0.05 leads or is 2 behind. Handing the strategy the configurations in which the goals were hit
instead of the targets (Lamarckian) cost 6 to 9 after 2000 trials, so it is not done.
"""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field

from coartic.baselines.evolution import EvolutionStrategy
from coartic.baselines.uninformed import Attempts, UninformedParameters
from coartic.method import Method, Result, Session
from coartic.optimisers import TOLD, sequences_of
from coartic.robot import Array


class BanditParameters(UninformedParameters):
    """Parameters of the bandit."""

    exploration: Annotated[float, Field(ge=0, le=100)] = 0.2
    """c of UCB1, in spreads of the first rewards."""


class Strategy:
    """CMA-ES over the targets of one hand sequence."""

    def __init__(self, session: Session, attempts: Attempts, hands: str, sigma: float) -> None:
        self.hands = hands
        self.sigma = sigma
        self.generations = 1  # the trial by A counts as the first
        self.trials = 1
        self._rng = session.rng
        self._attempts = attempts
        self._mask = attempts.explored(hands)
        first = attempts.by_correction(hands)
        self.reward = float(first.rewards[0])
        """Best reward so far; -inf where **A** did not complete the sequence."""
        self._mean: Array = first.reached[0, self._mask]
        self._restarts = -1

    def generation(self) -> None:
        """Make one generation of trials, or the trials that are left."""
        if self._restarts < 0 or self._evolution.has_ended():
            self._restart()
        values = self._evolution.ask()[: self._attempts.left]
        rewards = self._attempts.around(self.hands, self._mask, values).rewards
        self.generations += 1
        self.trials += len(values)
        self.reward = max(self.reward, float(rewards.max()))
        if len(values) == self._evolution.size:
            completed = rewards > -math.inf
            worst = rewards[completed].min() if completed.any() else 0.0
            self._evolution.tell(values, np.where(completed, -rewards, 1.0 - worst))

    def _restart(self) -> None:
        self._restarts += 1
        size = 4 + int(3 * math.log(len(self._mean)))  # λ, the default of CMA-ES
        self._evolution = EvolutionStrategy(
            self._mean, self.sigma, size * 2**self._restarts, self._rng
        )


class CMAES(Method):
    """CMA-ES for each hand sequence; the upper confidence bound says which goes on."""

    name = "cma-es/bandit"
    title = "CMA-ES, a bandit over hand sequences"
    citation = (
        "N. Hansen (2016). The CMA evolution strategy: a tutorial. arXiv:1604.00772. "
        "A. Auger, N. Hansen (2005). A restart CMA evolution strategy with increasing population "
        "size. IEEE Congress on Evolutionary Computation. "
        "P. Auer, N. Cesa-Bianchi, P. Fischer (2002). Finite-time analysis of the multiarmed "
        "bandit problem. Machine Learning."
    )
    told = TOLD
    Parameters = BanditParameters

    def solve(self, session: Session) -> Result:
        """Search until the trials are used up; the solution is the best trial's."""
        attempts = Attempts(session, self.parameters)
        with session.solving():
            strategies = []
            for hands in sequences_of(session)[: attempts.left]:
                strategies.append(Strategy(session, attempts, hands, self.parameters.sigma))
            promising = [s for s in strategies if s.reward > -math.inf]
            if promising:
                self._allot(promising, attempts)
        return attempts.result(trials={s.hands: s.trials for s in strategies})

    def _allot(self, strategies: list[Strategy], attempts: Attempts) -> None:
        """Spend the trials that are left, generation by generation."""
        first = [strategy.reward for strategy in strategies]
        width: float = self.parameters.exploration * max(max(first) - min(first), 1.0)
        generations = len(strategies)

        def bound(strategy: Strategy) -> float:
            doubt = math.sqrt(2.0 * math.log(generations) / strategy.generations)
            return strategy.reward + width * doubt

        while attempts.left > 0:
            max(strategies, key=bound).generation()
            generations += 1


METHODS: tuple[type[Method], ...] = (CMAES,)
