"""Trials for methods of uninformed search, which see what the paper's learner sees.

As in the learner, a trial moves towards a target configuration for each goal, and the corrective
process **A** corrects the movements that miss their goals. After the trial, the method knows the
total reward of the trial and the configurations in which the trial hit the goals.

In this module *joints* are all entries of a configuration: base coordinates and joint angles.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import islice
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import Field

from coartic.method import TRIALS, MethodError, Parameters, Result, Session
from coartic.method.as_method import HandsOrMethod
from coartic.method.optimisers import explored_joints
from coartic.motion.solution import Movement, movements_of
from coartic.motion.trials import Trials
from coartic.robot import Array

_MAX_AHEAD = 128  # largest number of trials that are drawn ahead


class UninformedParameters(Parameters):
    """Parameters of CMA-ES, hill climbing and policy gradient, with the learner's defaults."""

    trials: Annotated[int, Field(gt=0)] = TRIALS
    """Largest number of trials of a run."""
    sigma: Annotated[float, Field(gt=0, le=10)] = 0.05
    """Standard deviation of the noise on the targets, in length units (base) and rad (joints).
    CMA-ES, and policy gradient and hill climbing with ``spread="learned"``, begin with this value
    and adapt it."""


class SequenceParameters(UninformedParameters):
    """Parameters of methods to which the user can give the hand sequence."""

    sequence: HandsOrMethod | None = None
    """Hand sequence of all trials, such as ``"RRLR"``; ``"given"`` for the task's initial hands
    (:meth:`.Session.find_initial_hands`); or ``"as METHOD"`` for the hands of the answer of another
    method, such as ``"as dual-process/EC4"``. By default the method explores hand sequences."""

    def told_hands(self, session: Session) -> str | None:
        """Return the hand sequence that parameter ``sequence`` stands for, or None.

        For ``"given"``, :meth:`.Session.find_initial_hands` finds the sequence, and its errors are
        raised.
        """
        return session.find_initial_hands() if self.sequence == "given" else self.sequence


class Draw(NamedTuple):
    """A trial that is drawn, but not yet made."""

    hand_sequence: str
    """Hand sequence, such as ``"RRLR"``."""
    values: Array
    """Targets of the explored joints, goal by goal, shape ``(n,)``, in length units and rad; NaN
    for joints that do not move."""
    threshold: float
    """The trial is *better* if its reward exceeds this threshold (in ticks)."""


class Attempts:
    """Make the physical trials of one run, and remember the best trial.

    The session enforces its own budget, but nothing enforces ``trials``: callers ask for at most
    ``left`` trials.

    Parameters
    ----------
    session : Session
        Session in which the trials are made and counted.
    trials : int
        Number of trials of the run, from which ``left`` is computed.
    """

    def __init__(self, session: Session, trials: int) -> None:
        self._session = session
        self.explored = np.tile(explored_joints(session), (session.goals_count, 1))
        """True for the joints that are explored at each goal, shape ``(G, dof)``."""
        self.is_noisy = session.model.motor_noise > 0.0
        """True if the motion model has motor noise, so that the best reward is partly luck."""
        left = session.trials_left
        self.left = trials if left is None else min(trials, left)
        """Number of trials left."""
        self._ahead = 1
        self.trials_made = 0
        """Number of trials made."""
        self.reward = -math.inf
        """Best reward so far; -inf before the first success."""
        self.hand_sequence = ""
        """Hand sequence of the best trial; empty before the first success."""
        self.best_trial = -1
        """Number of the best trial, from 0; -1 before the first success."""
        self.targets: Array = np.empty(0)
        """Targets of the best trial, shape ``(G, dof)``, in length units and rad; empty before the
        first success. With motor noise, the target of a joint that does not move is NaN, so that
        the joint does not move when the targets are used again."""
        self.reached: Array = np.empty(0)
        """Configurations in which the best trial hit the goals, shape ``(G, dof)``, in length units
        and rad; empty before the first success."""

    def run_corrective(self, *hand_sequences: str) -> Trials:
        """Make a trial with each hand sequence, in which only the corrective process acts.

        Parameters
        ----------
        *hand_sequences : str
            Hand sequences, such as ``"RRLR"``; at least one.

        Returns
        -------
        Trials
            Results of the trials, in order. If the session's budget ends, there are fewer trials
            than hand sequences.

        Raises
        ------
        BudgetError
            No trial of the session is left.
        """
        shape = (len(hand_sequences), self._session.goals_count, self._session.dof)
        return self.run_targets([*hand_sequences], np.full(shape, np.nan))

    def around(self, hand_sequence: str, values: Array) -> Trials:
        """Make trials with one hand sequence and targets for the explored joints.

        Parameters
        ----------
        hand_sequence : str
            Hand sequence, such as ``"RRLR"``.
        values : ndarray, shape (N, n)
            Targets of the explored joints (True in ``explored``), goal by goal, in length units and
            rad. A row contains the n targets of a trial; N is at least 1. Other joints do not move.

        Returns
        -------
        Trials
            Results of the trials, in order. If the session's budget ends, there are fewer than N
            trials.

        Raises
        ------
        BudgetError
            No trial of the session is left.
        """
        return self.run_targets(hand_sequence, self.targets_of(values))

    def targets_of(self, values: Array) -> Array:
        """Convert targets of the explored joints, shape ``(N, n)``, to shape ``(N, G, dof)``.

        Both are in length units and rad. The targets of other joints are NaN.
        """
        targets = np.full((len(values), *self.explored.shape), np.nan)
        targets[:, self.explored] = values
        return targets

    def run_ahead(self, draws: Callable[[], Iterator[Draw]]) -> tuple[list[Draw], Trials]:
        """Draw trials ahead, make them, and go back to the first that is better.

        The trials are those of a loop that draws a trial and makes it, until one is better than its
        threshold. Many trials that are made at once take much less CPU time than trials in a loop,
        and few trials are better. So up to 128 trials are drawn, as if none of them were better. If
        one is, the trials after it are not counted, and the session's generator is set to its state
        after the draw of this trial.

        Parameters
        ----------
        draws : callable
            Function whose iterator draws trials with the session's generator. It yields at least
            one trial, and ends after a trial if the next draw depends on the reward of this trial
            even though it is not better. The function is called again to go back, and must then
            yield the same trials from the same state of the generator.

        Returns
        -------
        list of Draw
            The trials that were made and counted, at least one. All but the last are not better.
        Trials
            Results of these trials, in order.

        Raises
        ------
        BudgetError
            No trial of the session is left.
        """
        bits = self._session.rng.bit_generator
        before = bits.state
        drawn = [*islice(draws(), min(self._ahead, self.left))]
        hand_sequences = [draw.hand_sequence for draw in drawn]
        targets = self.targets_of(np.array([draw.values for draw in drawn]))
        thresholds = np.array([draw.threshold for draw in drawn])
        trials = self._session.trials(hand_sequences, targets, until=thresholds)
        counted = len(trials.rewards)
        if counted == len(drawn):
            self._ahead = min(2 * self._ahead, _MAX_AHEAD)
        else:
            self._ahead, bits.state = counted, before
            drawn = [*islice(draws(), counted)]
        self._remember(hand_sequences, targets, trials)
        return drawn, trials

    def run_targets(self, hand_sequences: str | list[str], targets: Array) -> Trials:
        """Make trials with targets, and remember the best trial so far.

        Parameters
        ----------
        hand_sequences : str or list of str
            One hand sequence for all trials, or a list with a hand sequence for each trial.
        targets : ndarray, shape (N, G, dof)
            Targets, in length units and rad; NaN for joints that do not move. N is at least 1.

        Returns
        -------
        Trials
            Results of the trials, in order. There are fewer than N trials if the session's budget
            ends.

        Raises
        ------
        BudgetError
            No trial of the session is left.
        """
        trials = self._session.trials(hand_sequences, targets)
        self._remember(hand_sequences, targets, trials)
        return trials

    def _remember(self, hand_sequences: str | list[str], targets: Array, trials: Trials) -> None:
        """Count trials, and remember their best if it is the best so far."""
        rewards = trials.rewards
        best = int(rewards.argmax())
        if rewards[best] > self.reward:
            self.reward = float(rewards[best])
            self.hand_sequence = (
                hand_sequences if isinstance(hand_sequences, str) else hand_sequences[best]
            )
            self.best_trial = self.trials_made + best
            self.targets, self.reached = trials.targets[best], trials.reached[best]
            if self.is_noisy:
                self.targets = targets[best].copy()
        self.trials_made += len(rewards)
        self.left -= len(rewards)

    @property
    def solution(self) -> tuple[Movement, ...]:
        """Movements of the best trial.

        Raises ValueError before the first success.
        """
        return movements_of(self.hand_sequence, self.targets)

    def result(
        self, recommended: Callable[[], tuple[Movement, ...]] | None = None, **details: Any
    ) -> Result:
        """Return the result of a method: the movements of the best trial, and details.

        Parameters
        ----------
        recommended : callable, optional
            Function that returns the movements that the method recommends. With motor noise, these
            movements take the place of the movements of the best trial; without motor noise, the
            function is not called.
        **details
            Details of the result, in addition to ``best_trial``, the number of the best trial from
            0.

        Returns
        -------
        Result

        Raises
        ------
        MethodError
            No trial has hit every goal. In this case ``recommended`` is not called.
        """
        if not self.trials_made:
            raise MethodError("infeasible", "the trial budget leaves no trial to make", details)
        if not self.hand_sequence:
            raise MethodError(
                "infeasible",
                f"no trial hit every goal: the corrective process failed in all "
                f"{self.trials_made} trials",
                details,
            )
        solution = recommended() if recommended and self.is_noisy else self.solution
        return Result(solution, {"best_trial": self.best_trial, **details})
