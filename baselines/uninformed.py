"""The learner's trials for methods that see of a trial its total reward and where it hit.

As in the learner, a trial moves towards one target configuration per goal, the
corrective process **A** corrects the goals that are missed, and the configurations in which the
goals were hit are known afterwards.
"""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from coartic.learner.learning import TRIALS
from coartic.method import MethodError, Parameters, Result, Session
from coartic.method.optimisers import explored_joints
from coartic.motion.solution import Movement, movements_of
from coartic.motion.trial import Trials
from coartic.robot import Array


class UninformedParameters(Parameters):
    """Parameters of CMA-ES and hill climbing; the defaults are the learner's."""

    trials: Annotated[int, Field(gt=0)] = TRIALS
    """Trials of a run."""
    sigma: Annotated[float, Field(gt=0, le=10)] = 0.05
    """SD of the (first) perturbations, length unit (base) or rad (joints)."""


class Attempts:
    """Make the physical trials of one run, and remember the best trial."""

    def __init__(self, session: Session, trials: int) -> None:
        self._session = session
        self.explored = np.tile(explored_joints(session), (session.goals_count, 1))
        """True for joints that are explored at each goal, shape ``(G, dof)``."""
        left = session.trials_left
        self.left = trials if left is None else min(trials, left)
        """Number of trials left, at most ``trials``."""
        self.trials_made = 0
        """Number of trials made."""
        self.reward = -math.inf
        """Best reward so far; -inf before the first success."""
        self.hands = ""
        """Hand sequence of the best trial, empty before the first success."""
        self.best_trial = -1
        """Number of the best trial, from 0; -1 before the first success."""
        self.targets: Array = np.empty(0)
        """Targets of the best trial, shape ``(G, dof)``."""
        self.reached: Array = np.empty(0)
        """Configurations in which the best trial hit the goals, shape ``(G, dof)``."""

    def by_correction(self, *hands: str) -> Trials:
        """Make one trial for each of the hand sequences given (at least one), such as ``"RRLR"``:
        without targets, so that the corrective process alone goes to each goal. Remember the best
        of these trials if it beats all earlier ones, and return the results of the trials made, in
        order: fewer than sequences if the budget ends. Raises BudgetError if no trial of the
        session is left."""
        shape = (len(hands), self._session.goals_count, self._session.dof)
        return self.by_targets([*hands], np.full(shape, np.nan))

    def around(self, hands: str, values: Array) -> Trials:
        """Make N trials with one hand sequence, or as many as the budget of the session still has;
        remember the best trial so far, and return the results of these trials, a row for each.

        ``values``, shape ``(N, n)``, length unit and rad, are target coordinates of the n explored
        joints of all goals (True in ``explored``), goal by goal; other joints keep still. N is at
        least 1. Raises BudgetError if no trial of the session is left.
        """
        targets = np.full((len(values), *self.explored.shape), np.nan)
        targets[:, self.explored] = values
        return self.by_targets(hands, targets)

    def by_targets(
        self, hands: str | list[str], targets: Array, until: Array | None = None
    ) -> Trials:
        """Make N trials (at least one) with targets of shape ``(N, G, dof)``, length unit and rad,
        NaN for joints that keep still, and one hand sequence, or a hand sequence for each trial;
        remember the best trial so far, and return the results of the trials made, fewer if the
        budget of the session ends.

        ``until``, rewards of shape ``(N,)``: the first trial whose reward exceeds its entry is the
        last trial made. Raises BudgetError if no trial of the session is left.
        """
        trials = self._session.trials(hands, targets, until=until)
        rewards = trials.rewards
        best = int(rewards.argmax())
        if rewards[best] > self.reward:
            self.reward = float(rewards[best])
            self.hands = hands if isinstance(hands, str) else hands[best]
            self.best_trial = self.trials_made + best
            self.targets, self.reached = trials.targets[best], trials.reached[best]
        self.trials_made += len(rewards)
        self.left -= len(rewards)
        return trials

    @property
    def solution(self) -> tuple[Movement, ...]:
        """The movements of the best trial. Raises ValueError before the first success."""
        return movements_of(self.hands, self.targets)

    def result(self, **details: Any) -> Result:
        """Return the movements of the best trial, and as details its number (from 0) and
        ``details``. Raises MethodError if no trial hit every goal."""
        if not self.trials_made:
            raise MethodError("infeasible", "the trial budget leaves no trial to make", details)
        if not self.hands:
            raise MethodError(
                "infeasible",
                f"the corrective process failed in all {self.trials_made} trials made; "
                "no trial hit every goal",
                details,
            )
        return Result(self.solution, {"best_trial": self.best_trial, **details})
