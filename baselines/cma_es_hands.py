"""CMA-ES that chooses hands goal by goal, by the learner's ε-greedy rule.

``cma-es/bandit`` has tried every hand sequence before it prefers one; of 14 goals there are
16,384. Here each pair of hands at two goals in a row has a value, the highest reward of any trial
that used it. Goal by goal the hand of higher value is chosen, with probability ε a random one. A
sequence that comes for the first time takes one trial by the corrective process alone, one that
comes again a generation of its own strategy. ε is the learner's. On six random tasks with 14
goals and two arms, mean reward with ε = 0.05 and 0.2: -1439 and -1351; with hands drawn around
those of the best trial -1404 and -1331; the learner EC4 -1799.
"""

from __future__ import annotations

import math
from collections import defaultdict
from typing import Annotated

from pydantic import Field

from coartic.baselines.cma_es import Strategy
from coartic.baselines.uninformed import Attempts, UninformedParameters
from coartic.method import Method, Result, Session
from coartic.optimisers import TOLD


class GoalByGoalParameters(UninformedParameters):
    """Parameters of CMA-ES that chooses hands goal by goal."""

    epsilon: Annotated[float, Field(ge=0, le=1)] = 0.2
    """Probability of a random hand, for each goal."""


class GoalByGoal(Method):
    """CMA-ES for each hand sequence; hands are chosen by the best reward that they had."""

    name = "cma-es/goal-by-goal"
    title = "CMA-ES, hands chosen goal by goal"
    citation = (
        "N. Hansen (2016). The CMA evolution strategy: a tutorial. arXiv:1604.00772. "
        "A. Auger, N. Hansen (2005). A restart CMA evolution strategy with increasing population "
        "size. IEEE Congress on Evolutionary Computation."
    )
    told = TOLD
    Parameters = GoalByGoalParameters

    def solve(self, session: Session) -> Result:
        """Search until the trials are used up; the solution is the best trial's."""
        attempts = Attempts(session, self.parameters)
        letters = sorted(hand[0].upper() for hand in session.hands)
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


METHODS: tuple[type[Method], ...] = (GoalByGoal,)
