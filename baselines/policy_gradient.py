"""Policy gradient: mean and spread of a Gaussian policy follow the gradient of the reward.

The rule is REINFORCE (Williams 1992) for a Gaussian policy. Haith (2025) proposes it as a theory of
how people improve a movement by practice: after each trial the mean *and* the spread of a person's
movements change in the direction that makes better movements more frequent.

Each hand sequence has a Gaussian policy over the targets of all explored joints, with mean m and a
standard deviation e^ν for each coordinate. The first mean consists of the postures in which the
corrective process **A** on its own hits the goals; finding these postures takes one trial. The
first standard deviations are ``sigma``. A batch has B trials with targets m + e^ν z, where the
entries of z are standard normal. After a batch with rewards R, the policy is updated with the
advantages A of the trials::

    A = (R - b) / d, at least -3 and at most 3
    m <- m + α e^ν mean(A z)
    ν <- ν + β mean(A (z² - 1)), with e^ν at least 0.005 and at most 0.3

- The baseline b is an exponential moving average of the rewards.
- The scale d is an exponential moving average of 1.25 |R - b|, an estimate of the standard
  deviation of the rewards. If d is below 1 tick, A is computed with 1 tick instead.
- The update after a batch uses the values of b and d from before this batch. The update after the
  first batch uses the mean reward and the mean of 1.25 |R - b| of this batch itself. After each
  update, b and d move by a tenth of the difference towards the values of the batch, for which
  |R - b| is computed with the old b.
- Without the bounds on A, a single bad batch can move the policy far away.
- The reward of a failed trial is replaced by a lower value: the lowest reward of a completed trial
  of all batches so far, minus 1. Before any trial of a batch has been completed, the value is minus
  twice the ticks of the first trial, in which only the corrective process acts.
- An incomplete last batch does not change the policy.

With ``spread="fixed"`` ν does not change.

The hands are chosen by the same bandit as in ``cma-es/bandit``. An alternative was tried on the
development instances on which the method was tuned: a softmax policy over the hands of each goal,
whose preferences follow the same gradient. With the better of two step sizes for the preferences,
its solutions take 23 % more ticks than those with the bandit (geometric means over runs; 10 to 46 %
in the four families with two arms).

With motor noise the targets of the solution are the mean m of one hand sequence: the sequence whose
last complete batch has the highest mean reward.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

import numpy as np
from numpy import exp
from pydantic import Field

from coartic.baselines.bandit import Search, solve_by_bandit
from coartic.baselines.uninformed import Attempts, SequenceParameters
from coartic.method import Facts, Method, Result, Session
from coartic.method.optimisers import OPTIMISER_INFORMATION
from coartic.robot import Array

_EXPLORATION = 0.2  # constant of the bandit, the default of CMA-ES
_CLIP = 3.0  # largest advantage
_RATE = 0.1  # of the running means b and d, for each batch
_LOG_BOUNDS = math.log(0.005), math.log(0.3)  # of a learned spread, in length units and rad
_TUNED = {"learned": (25, 2.0, 0.1), "fixed": (25, 1.0, 0.0)}
"""Dict that maps each value of ``spread`` to the defaults of ``batch``, ``step`` and
``spread_step``."""


class PolicyGradientParameters(SequenceParameters):
    """Parameters of the policy gradient."""

    spread: Literal["learned", "fixed"] = "learned"
    """``"fixed"`` if the standard deviation of each coordinate is always ``sigma``; ``"learned"``
    if it begins with ``sigma`` and follows the gradient."""
    batch: Annotated[int, Field(ge=2)] | None = None
    """Number B of trials in a batch. Here, and in ``step`` and ``spread_step``, None stands for the
    value that was tuned for the given ``spread``."""
    step: Annotated[float, Field(gt=0, le=1000)] | None = None
    """Step size α of the mean."""
    spread_step: Annotated[float, Field(gt=0, le=1000)] | None = None
    """Step size β of the logarithm of the spread. It has no effect if ``spread`` is
    ``"fixed"``."""

    @property
    def steps(self) -> tuple[int, float, float]:
        """Batch size B, and step sizes α and β (0 for a fixed spread)."""
        batch, step, spread_step = _TUNED[self.spread]
        if self.spread == "learned":
            spread_step = self.spread_step or spread_step
        return self.batch or batch, self.step or step, spread_step


class Policy(Search):
    """Gaussian policy over the targets of one hand sequence, and its policy gradient.

    Parameters
    ----------
    rng : numpy.random.Generator
        Generator of the random numbers z.
    attempts : Attempts
        Makes and counts the trials of the run.
    hand_sequence : str
        Hand sequence, such as ``"RRLR"``.
    parameters : PolicyGradientParameters
    """

    def __init__(
        self,
        rng: np.random.Generator,
        attempts: Attempts,
        hand_sequence: str,
        parameters: PolicyGradientParameters,
    ) -> None:
        super().__init__(attempts, hand_sequence)
        self._rng = rng
        self._batch, self._step, self._spread_step = parameters.steps
        self.mean = self.first_mean
        """Mean of the targets, shape ``(n,)``, in length units and rad."""
        self.log_spread = np.full(len(self.mean), math.log(parameters.sigma))
        """Logarithm of the standard deviation of each target, shape ``(n,)``."""
        self._failure = 2.0 * self.reward  # value of a failed trial
        self._worst = math.inf  # lowest reward of a completed trial of all batches
        self._baseline = self._scale = math.nan  # b and d
        self._cost = math.inf

    def generation(self) -> None:
        """Make the trials of a batch, and update mean and spread by the policy gradient.

        If fewer trials are left than belong to a batch, only these trials are made, and mean and
        spread are not updated.
        """
        z = self._rng.standard_normal((self._batch, len(self.mean)))
        spread = exp(self.log_spread)
        rewards = self.make_trials(self.mean + spread * z)
        completed = rewards > -math.inf
        if completed.any():
            self._worst = min(self._worst, float(rewards[completed].min()))
            self._failure = self._worst - 1.0
        if len(rewards) < self._batch:
            return
        rewards = np.where(completed, rewards, self._failure)
        if math.isnan(self._baseline):
            self._baseline = float(rewards.mean())
            self._scale = 1.25 * float(np.abs(rewards - self._baseline).mean())
        differences = rewards - self._baseline
        advantages = np.clip(differences / max(self._scale, 1.0), -_CLIP, _CLIP)
        self.mean = self.mean + self._step * spread * (advantages @ z) / self._batch
        if self._spread_step:
            gradient = advantages @ (z**2 - 1.0) / self._batch
            self.log_spread = np.clip(self.log_spread + self._spread_step * gradient, *_LOG_BOUNDS)
        self._scale += _RATE * (1.25 * float(np.abs(differences).mean()) - self._scale)
        self._baseline += _RATE * float(differences.mean())
        self._cost = -float(rewards.mean())

    @property
    def answer(self) -> tuple[float, Array]:
        """Mean cost of the last complete batch (in ticks), and the mean of the policy.

        Without a complete batch the cost is infinity, and the mean is the first mean.
        """
        return self._cost, self.mean


class PolicyGradient(Method):
    """REINFORCE with a Gaussian policy over targets for each hand sequence."""

    name = "policy-gradient"
    tuned_on = "development instances d000 to d002 of five families, in two worlds"
    title = "policy gradient"
    facts = Facts(works=("haith2025", "williams1992", "auer2002"))
    information = OPTIMISER_INFORMATION
    Parameters = PolicyGradientParameters

    def solve(self, session: Session) -> Result:
        """Solve the task with a policy for each hand sequence (:func:`.solve_by_bandit`)."""
        parameters: PolicyGradientParameters = self.parameters

        def make_policy(attempts: Attempts, hand_sequence: str) -> Policy:
            return Policy(session.rng, attempts, hand_sequence, parameters)

        return solve_by_bandit(session, parameters, make_policy, _EXPLORATION)


METHODS: tuple[type[Method], ...] = (PolicyGradient,)
