"""CMA-ES over target configurations; hand sequences by a bandit, or goal by goal.

Each hand sequence has an evolution strategy (CMA-ES) over the targets of all explored joints, which
sees the total reward of each trial and nothing else. Its first mean are the configurations of the
corrective process **A** alone, which takes one trial; its first step size is ``sigma``; where it
stops by its own criteria it starts again from the first mean with twice the population (IPOP). A
failed trial ranks last. UCB1 on the best reward of each sequence, scaled by the spread of the first
rewards, decides in ``cma-es/bandit`` which strategy makes the next generation of trials.

Tuning, three or four runs a value. c = 0.02, 0.05, 0.1, 0.2, 0.5 on the two-armed tasks: no
reward differs by more than 2.4; with the other arm kept still, up to 0.05 can settle on RRRR in
two-armed-2 (-339 in the mean, where 0.1 and more give -331). Step sizes 0.02, 0.05, 0.1
and 0.2 within one given sequence are within 5 of each other after 2000 trials; after 300
0.05 leads or is 2 behind. To learn from where the goals were hit, not from the targets
(Lamarckian), cost 6 to 9 after 2000 trials.

``cma-es/bandit`` tries every hand sequence, while trials are left, before it prefers one; of more
than 4096 it has the initial one alone. In ``cma-es/goal-by-goal`` each pair of hands at two goals
in a row has a value, the highest reward of any trial that used it. Goal by goal the hand of higher
value is chosen, with probability ε a random one. A sequence that comes for the first time takes one
trial by the corrective process; if that succeeds, each time it comes again, a generation of its own
strategy. On six random tasks with 14 goals and two arms, mean reward with ε = 0.05 and 0.2: -1439
and -1351; the learner EC4 -1799.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from coartic.baselines.evolution import EvolutionStrategy
from coartic.baselines.uninformed import Attempts, UninformedParameters
from coartic.method import Method, Result, Session
from coartic.method.optimisers import OPTIMISER_INFORMATION, sequences_of
from coartic.robot import Array
from coartic.tasks.task import letters_of

_CITATION = (
    "N. Hansen (2016). The CMA evolution strategy: a tutorial. arXiv:1604.00772. A. Auger, N. "
    "Hansen (2005). A restart CMA evolution strategy with increasing population size. IEEE "
    "Congress on Evolutionary Computation."
)


class BanditParameters(UninformedParameters):
    """Parameters of CMA-ES with a bandit over hand sequences."""

    exploration: Annotated[float, Field(ge=0, le=100)] = 0.2
    """c of UCB1, as a multiple of the range of the first rewards, which counts as 1 or more."""


class Strategy:
    """CMA-ES over the targets of one hand sequence, after a trial by the corrective process."""

    def __init__(self, session: Session, attempts: Attempts, hands: str, sigma: float) -> None:
        self.hands = hands
        self.sigma = sigma
        self.generations = 1  # the trial by A counts as the first
        self.trials = 1
        self._rng = session.rng
        self._attempts = attempts
        first = attempts.by_correction(hands)
        self.reward = float(first.rewards[0])
        """Best reward so far; -inf where **A** did not complete the sequence."""
        self._mean: Array = first.reached[0, attempts.explored]
        self.evolution: EvolutionStrategy | None = None
        """The present strategy; None before the first generation."""

    def generation(self) -> None:
        """Make the trials of one generation of CMA-ES, or as many as are left (at least one must
        be), and, if the generation is complete, update CMA-ES from their rewards. Where CMA-ES has
        ended, it first restarts with twice the population. To be called only if the corrective
        process completes the hand sequence."""
        evolution = self.evolution
        if evolution is None or evolution.has_ended():
            default = 4 + int(3 * math.log(len(self._mean)))
            size = default if evolution is None else 2 * evolution.size
            evolution = EvolutionStrategy(self._mean, self.sigma, size, self._rng)
            self.evolution = evolution
        values = evolution.ask()[: self._attempts.left]
        rewards = self._attempts.around(self.hands, values).rewards
        self.generations += 1
        self.trials += len(values)
        self.reward = max(self.reward, float(rewards.max()))
        if len(values) == evolution.size:
            completed = rewards > -math.inf
            worst = rewards[completed].min() if completed.any() else 0.0
            evolution.tell(values, np.where(completed, -rewards, 1.0 - worst))


def spend_trials(strategies: Sequence[Strategy], attempts: Attempts, exploration: float) -> None:
    """Let strategies make generations until no trial of ``attempts`` is left.

    The next generation comes from the strategy with the highest upper confidence bound (UCB1). Its
    c is ``exploration`` times the range of the strategies' first rewards. Strategies whose hand
    sequence the corrective process did not complete make no generation.
    """
    promising = [strategy for strategy in strategies if strategy.reward > -math.inf]
    rewards = [strategy.reward for strategy in promising] or [0.0]
    width = exploration * max(max(rewards) - min(rewards), 1.0)
    generations = len(promising)

    def bound(strategy: Strategy) -> float:
        doubt = math.sqrt(2.0 * math.log(generations) / strategy.generations)
        return strategy.reward + width * doubt

    while promising and attempts.left > 0:
        max(promising, key=bound).generation()
        generations += 1


class CMAES(Method):
    """CMA-ES for each hand sequence; the sequence of highest upper confidence bound makes the next
    generation."""

    name = "cma-es/bandit"
    version = 2
    tuned_on = "the paper's tasks: twenty settings"
    title = "CMA-ES, a bandit over hand sequences"
    citation = _CITATION + (
        " P. Auer, N. Cesa-Bianchi, P. Fischer (2002). Finite-time analysis of the multiarmed "
        "bandit problem. Machine Learning."
    )
    information = OPTIMISER_INFORMATION
    Parameters = BanditParameters

    def solve(self, session: Session) -> Result:
        """Make a trial by the corrective process with each hand sequence while trials are left (of
        more than 4096 only with the initial one), then, if one succeeds, generations of trials;
        return the movements of the best trial. Raises MethodError if no trial hit every goal."""
        attempts = Attempts(session, self.parameters.trials)
        with session.solving():
            strategies = [
                Strategy(session, attempts, hands, self.parameters.sigma)
                for hands in sequences_of(session)[: attempts.left]
            ]
            spend_trials(strategies, attempts, self.parameters.exploration)
        return attempts.result(trials={s.hands: s.trials for s in strategies})


class GoalByGoalParameters(UninformedParameters):
    """Parameters of CMA-ES that chooses hands goal by goal."""

    epsilon: Annotated[float, Field(ge=0, le=1)] = 0.2
    """Probability of a random hand, for each goal."""


class GoalByGoal(Method):
    """CMA-ES for each hand sequence; the hand of each goal is the hand with the best reward after
    the hand before, or random."""

    name = "cma-es/goal-by-goal"
    version = 2
    tuned_on = f"{CMAES.tuned_on}; ε: six random tasks of 14 goals"
    title = "CMA-ES, hands chosen goal by goal"
    citation = _CITATION
    information = OPTIMISER_INFORMATION
    Parameters = GoalByGoalParameters

    def solve(self, session: Session) -> Result:
        """Make trials until none is left, every hand sequence has failed, or, with ``epsilon`` 0, a
        failed sequence is chosen again; return the movements of the best trial. Raises MethodError
        if no trial hit every goal, and NotApplicableError if no initial hands are found."""
        attempts = Attempts(session, self.parameters.trials)
        letters = sorted(letters_of(session.hands))
        values: dict[tuple[int, str], float] = defaultdict(lambda: -math.inf)
        strategies: dict[str, Strategy] = {}
        hands = session.find_initial_hands()
        with session.solving():
            most = len(letters) ** session.goals_count
            while attempts.left > 0 and (attempts.hands or len(strategies) < most):
                if hands not in strategies:
                    strategies[hands] = Strategy(session, attempts, hands, self.parameters.sigma)
                elif strategies[hands].reward > -math.inf:
                    strategies[hands].generation()
                elif not self.parameters.epsilon:
                    break  # the same hands would be chosen again
                pairs = [hands[max(goal - 1, 0) : goal + 1] for goal in range(len(hands))]
                for entry in enumerate(pairs):
                    values[entry] = max(values[entry], strategies[hands].reward)
                hands = ""
                for goal in range(session.goals_count):
                    pair = {letter: (goal, hands[-1:] + letter) for letter in letters}
                    best = max(letters, key=lambda letter: values[pair[letter]])
                    explores = session.rng.random() < self.parameters.epsilon
                    hands += str(session.rng.choice(letters)) if explores else best
        return attempts.result(sequences=len(strategies))


METHODS: tuple[type[Method], ...] = (CMAES, GoalByGoal)
