"""CMA-ES over target configurations; hand sequences by a bandit, or goal by goal.

Each hand sequence has its own evolution strategy (CMA-ES) over the targets of all explored joints:

- The strategy uses only the total reward of each trial. A failed trial ranks last.
- Its first mean consists of the postures in which the corrective process **A** on its own hits the
  goals. Finding these postures takes one trial.
- Its first step size is ``sigma``.
- When a stopping criterion of CMA-ES is met, the strategy restarts from the first mean with twice
  the population size (IPOP).

``cma-es/bandit`` first makes one trial with each hand sequence. If the task has more than 4096 hand
sequences, the method uses only the task's initial sequence. Then UCB1 chooses the strategy that
makes the next generation of trials; the value of a strategy is the best reward of its sequence so
far. The exploration bonus of UCB1 is scaled by the range of the rewards of the first trials.

``cma-es/goal-by-goal`` keeps a value table keyed by goal, hand at the previous goal, and hand at
this goal. The value of an entry is the best reward of all hand sequences tried so far that have
these two hands at these two goals. The first sequence is the task's initial one. Each later
sequence is chosen goal by goal, from the first goal to the last: at each goal, the hand with the
higher value or, with probability ε, a random hand. When a sequence is chosen for the first time,
the method makes one trial with only the corrective process. If that trial succeeds, each later
choice of the sequence makes one generation of the strategy of this sequence.

With motor noise the reward of the best trial is partly luck, so the targets of the solution are the
mean of a strategy. Each start and each restart of a strategy gives a candidate: the mean after its
last complete generation. The solution is the candidate whose last complete generation has the
lowest mean cost. In this mean cost, the cost of a failed trial is the larger of two numbers: twice
the ticks of the first trial with this hand sequence (in which only the corrective process acts),
and 1 tick more than the worst completed trial of the generation.

Tuning, with three or four runs for each value:

- c = 0.02, 0.05, 0.1, 0.2 and 0.5 on the two-armed tasks: rewards differ by at most 2.4. If the
  idle arm does not move, c up to 0.05 can settle on RRRR in two-armed-2 (mean reward -339; 0.1 and
  above give -331).
- Step sizes 0.02, 0.05, 0.1 and 0.2 with one hand sequence: rewards are within 5 of each other
  after 2000 trials. After 300 trials 0.05 is best, or within 2 of the best.
- Updating from the postures at the goals instead of the targets (Lamarckian) costs 6 to 9 ticks
  after 2000 trials.
- ε = 0.05 and 0.2 on six random tasks with 14 goals and two arms: mean rewards -1439 and -1351. The
  learner with EC4 gets -1799.
"""

from __future__ import annotations

import math
from collections import defaultdict
from operator import itemgetter
from typing import Annotated

import numpy as np
from pydantic import Field

from coartic.baselines.bandit import Search, recommend, solve_by_bandit
from coartic.baselines.cma_strategy import EvolutionStrategy
from coartic.baselines.uninformed import Attempts, SequenceParameters, UninformedParameters
from coartic.method import Facts, Method, Result, Session
from coartic.method.optimisers import OPTIMISER_INFORMATION
from coartic.robot import Array
from coartic.tasks.task import letters_of


class BanditParameters(SequenceParameters):
    """Parameters of CMA-ES with a bandit over hand sequences."""

    exploration: Annotated[float, Field(ge=0, le=100)] = 0.2
    """Constant of UCB1, as a multiple of the range of the first rewards (:func:`.spend_trials`)."""


class Strategy(Search):
    """CMA-ES over the targets of one hand sequence.

    Parameters
    ----------
    session : Session
    attempts : Attempts
        Makes and counts the trials of the run.
    hand_sequence : str
        Hand sequence, such as ``"RRLR"``.
    sigma : float
        First step size, in length units (base) and rad (joints).
    """

    def __init__(
        self, session: Session, attempts: Attempts, hand_sequence: str, sigma: float
    ) -> None:
        super().__init__(attempts, hand_sequence)
        self.sigma = sigma
        self._rng = session.rng
        self._failure = -2.0 * self.reward
        self._means: list[tuple[float, Array]] = [(math.inf, self.first_mean)]
        self.evolution: EvolutionStrategy | None = None
        """The strategy since the last restart; None before the first generation."""

    def generation(self) -> None:
        """Make the trials of a generation, and update CMA-ES from their rewards.

        If a stopping criterion of CMA-ES is met, the strategy first restarts from the first mean
        with twice the population size. If fewer trials are left than the population size, only
        these trials are made, and the strategy is not updated.
        """
        evolution = self.evolution
        if evolution is None or evolution.has_ended():
            default = 4 + int(3 * math.log(len(self.first_mean)))
            size = default if evolution is None else 2 * evolution.size
            evolution = EvolutionStrategy(self.first_mean, self.sigma, size, self._rng)
            self.evolution = evolution
            self._means.append((math.inf, self.first_mean))
        values = evolution.ask()
        rewards = self.make_trials(values)
        if len(rewards) == len(values):
            completed = rewards > -math.inf
            worst = rewards[completed].min() if completed.any() else 0.0
            evolution.tell(values, np.where(completed, -rewards, 1.0 - worst))
            costs = np.where(completed, -rewards, max(self._failure, 1.0 - worst))
            self._means[-1] = float(costs.mean()), evolution.mean

    @property
    def answer(self) -> tuple[float, Array]:
        """Lowest cost of a restart of CMA-ES, and the last mean of that restart.

        The first start is counted as a restart. The cost of a restart is the mean cost of its last
        complete generation (in ticks); the mean has shape ``(n,)``, in length units and rad.
        Without a complete generation, the cost is infinity, and the mean is the first mean.
        """
        return min(self._means, key=itemgetter(0))


class CMAES(Method):
    """CMA-ES for each hand sequence; a bandit (UCB1) divides the trials among the sequences."""

    name = "cma-es/bandit"
    version = 2
    tuned_on = "the paper's tasks: twenty settings"
    title = "CMA-ES"
    facts = Facts(works=("hansen2016", "auger2005", "auer2002"))
    information = OPTIMISER_INFORMATION
    Parameters = BanditParameters

    def solve(self, session: Session) -> Result:
        """Solve the task with CMA-ES for each hand sequence (:func:`.solve_by_bandit`)."""
        parameters: BanditParameters = self.parameters

        def make_strategy(attempts: Attempts, hand_sequence: str) -> Strategy:
            return Strategy(session, attempts, hand_sequence, parameters.sigma)

        return solve_by_bandit(session, parameters, make_strategy, parameters.exploration)


class GoalByGoalParameters(UninformedParameters):
    """Parameters of CMA-ES with hands that are chosen goal by goal."""

    epsilon: Annotated[float, Field(ge=0, le=1)] = 0.2
    """ε: probability with which the hand for a goal is chosen at random."""


class GoalByGoal(Method):
    """CMA-ES for each hand sequence, with hands chosen goal by goal from a value table."""

    name = "cma-es/goal-by-goal"
    version = 2
    tuned_on = f"{CMAES.tuned_on}; ε: six random tasks of 14 goals"
    title = "CMA-ES, hands goal by goal"
    facts = Facts(
        works=("hansen2016", "auger2005"),
        algorithm="CMA-ES",
        short="CMA-ES, goal by goal",
        headline=False,
    )
    information = OPTIMISER_INFORMATION
    Parameters = GoalByGoalParameters

    def solve(self, session: Session) -> Result:
        """Make trials, and return the movements of the best trial.

        With motor noise, return movements to the recommended targets (:func:`.recommend`). The
        details contain the number of the best trial (``best_trial``, from 0) and the number of hand
        sequences that were tried (``sequences``). The method stops in three cases:

        - No trial is left.
        - The corrective process has failed with all hand sequences.
        - ``epsilon`` is 0, and a hand sequence with which the corrective process has failed is
          chosen again.

        Raises MethodError if no trial hits every goal, and NotApplicableError if no initial hands
        are found.
        """
        attempts = Attempts(session, self.parameters.trials)
        letters = sorted(letters_of(session.hands))
        values: dict[tuple[int, str], float] = defaultdict(lambda: -math.inf)
        strategies: dict[str, Strategy] = {}
        hand_sequence = session.find_initial_hands()
        with session.solving():
            sequences = len(letters) ** session.goals_count
            while attempts.left > 0 and (attempts.hand_sequence or len(strategies) < sequences):
                if hand_sequence not in strategies:
                    strategies[hand_sequence] = Strategy(
                        session, attempts, hand_sequence, self.parameters.sigma
                    )
                elif strategies[hand_sequence].reward > -math.inf:
                    strategies[hand_sequence].generation()
                elif not self.parameters.epsilon:
                    break  # the same hands would be chosen again
                pairs = [
                    hand_sequence[max(goal - 1, 0) : goal + 1] for goal in range(len(hand_sequence))
                ]
                for entry in enumerate(pairs):
                    values[entry] = max(values[entry], strategies[hand_sequence].reward)
                hand_sequence = ""
                for goal in range(session.goals_count):
                    pair = {letter: (goal, hand_sequence[-1:] + letter) for letter in letters}
                    best = max(letters, key=lambda letter: values[pair[letter]])
                    explores = session.rng.random() < self.parameters.epsilon
                    hand_sequence += str(session.rng.choice(letters)) if explores else best
        return attempts.result(
            lambda: recommend(strategies.values(), attempts), sequences=len(strategies)
        )


METHODS: tuple[type[Method], ...] = (CMAES, GoalByGoal)
