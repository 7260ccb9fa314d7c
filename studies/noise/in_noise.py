"""Methods that practise with motor noise: CMA-ES, and CMA-ES that measures its uncertainty.

This is a method file, which protocols.py uses. The movements of a trial in practice have noisy
targets; corrections have no noise. The next action of a method, which is what it would do without
exploration, is stored as its replay.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated

import cma
import numpy as np
from pydantic import Field

from coartic import movements_of
from coartic.baselines.cma_es import CMAES, BanditParameters, Strategy, spend_trials
from coartic.baselines.uninformed import Attempts
from coartic.method import Method, Result, Session
from coartic.method.optimisers import OPTIMISER_INFORMATION, sequences_of


class NoiseParameters(BanditParameters):
    """Parameters of CMA-ES that practises with motor noise."""

    motor_noise: Annotated[float, Field(ge=0, le=1)] = 0.01
    """Standard deviation of the motor noise, in length units (base) and rad (joints)."""


class HandlerParameters(NoiseParameters):
    """Parameters of CMA-ES with a noise handler."""

    hands: str
    """The hand sequence."""


class NoisyAttempts(Attempts):
    """Trials whose movements miss their targets at random."""

    def __init__(self, session: Session, trials: int, motor_noise: float) -> None:
        super().__init__(session, trials)
        self._motor_noise = motor_noise
        self._misses = np.random.default_rng([session.seed, 1])

    def around(self, hands, values):
        """Make trials whose targets are ``values`` plus noise."""
        misses = self._misses.standard_normal(np.shape(values))
        return super().around(hands, values + self._motor_noise * misses)


class Watched(Strategy):
    """CMA-ES with one hand sequence, which notes where each run between restarts has ended."""

    def __init__(self, session, attempts, hands, sigma):
        super().__init__(session, attempts, hands, sigma)
        self.ends = []
        """For each run of CMA-ES, the mean cost and the mean point of its last complete
        generation."""
        self._before = None

    def generation(self):
        """Make a generation, and note where it ends if it is complete."""
        super().generation()
        if not self.evolution.costs.size:
            return
        if self.evolution is not self._before:
            self._before = self.evolution
            self.ends.append(None)
        self.ends[-1] = float(self.evolution.costs.mean()), self.evolution.mean


def with_next_action(session, attempts, ends, result):
    """Return ``result`` with the next action as its replay.

    ``ends`` has mean costs, mean points and hands of last generations. The next action moves to the
    mean point whose generation has the lowest mean cost.
    """
    _, mean, hands = min(ends, key=lambda end: end[0])
    targets = np.tile(session.q0, (session.goals_count, 1))
    targets[attempts.explored] = mean
    return replace(result, replay=movements_of(hands, targets))


class CMAESInNoise(CMAES):
    """CMA-ES whose trials have motor noise."""

    name = "cma-es/in-noise"
    title = "CMA-ES that practises with motor noise"
    Parameters = NoiseParameters

    def solve(self, session: Session) -> Result:
        """Solve the task as CMA-ES with a bandit over hand sequences, but with noisy trials."""
        parameters = self.parameters
        attempts = NoisyAttempts(session, parameters.trials, parameters.motor_noise)
        with session.solving():
            strategies = [
                Watched(session, attempts, hands, parameters.sigma)
                for hands in sequences_of(session)[: attempts.left]
            ]
            spend_trials(strategies, attempts, parameters.exploration)
        ends = [(*end, strategy.hands) for strategy in strategies for end in strategy.ends]
        return with_next_action(session, attempts, ends, attempts.result())


class CMAESWithHandler(Method):
    """CMA-ES of the package ``cma`` with its noise handler, for one hand sequence.

    The handler evaluates some points again. If their ranks depend on the noise, it raises the
    number of evaluations of each point, whose median counts, or the step size. If CMA-ES stops, it
    starts again with twice the population. A generation is only begun if enough trials are left.
    """

    name = "cma-es/noise-handler"
    title = "CMA-ES with a noise handler"
    citation = (
        "N. Hansen, A. S. P. Niederberger, L. Guzzella, P. Koumoutsakos (2009). A method for "
        "handling uncertainty in evolutionary optimization with an application to feedback "
        "control of combustion. IEEE Transactions on Evolutionary Computation."
    )
    information = OPTIMISER_INFORMATION
    Parameters = HandlerParameters

    def solve(self, session: Session) -> Result:
        """Make generations of trials as long as enough trials are left."""
        parameters = self.parameters
        attempts = NoisyAttempts(session, parameters.trials, parameters.motor_noise)
        first = attempts.run_corrective(parameters.hands)
        start, ends = first.reached[0, attempts.explored], []
        worst = -float(first.rewards[0])

        def cost(values):
            nonlocal worst
            (reward,) = attempts.around(parameters.hands, np.asarray(values)[None]).rewards
            if reward > -math.inf:
                worst = max(worst, -float(reward))
                return -float(reward)
            return worst + 1.0

        size = 4 + int(3 * math.log(len(start)))
        with session.solving():
            while True:
                seed = int(session.rng.integers(1, 2**31))
                options = {"seed": seed, "popsize": size, "verbose": -9}
                strategy = cma.CMAEvolutionStrategy(start, parameters.sigma, options)
                handler = cma.NoiseHandler(len(start), maxevals=[1, 1, 30])
                begun = False
                while not strategy.stop():
                    if attempts.left < 2 * size * math.ceil(handler.evaluations):
                        break
                    points, costs = strategy.ask_and_eval(cost, evaluations=handler.evaluations)
                    strategy.tell(points, costs)
                    strategy.sigma *= handler(points, costs, cost, strategy.ask)
                    begun = True
                    end = float(np.mean(costs)), strategy.mean.copy(), parameters.hands
                if begun:
                    ends.append(end)
                if not strategy.stop():
                    break
                size *= 2
        return with_next_action(session, attempts, ends, attempts.result())


METHODS = (CMAESInNoise, CMAESWithHandler)
