"""UCB1 bandit over hand sequences, each with its own search over target configurations.

The arms of the bandit are the hand sequences. Pulling an arm lets the search of this hand sequence
make one generation of trials. The value of an arm is the best reward of its hand sequence so far.
Each search starts from the postures in which the corrective process **A** on its own hits the
goals; finding these postures takes one trial.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence

from coartic.baselines.uninformed import Attempts, SequenceParameters
from coartic.method import Result, Session
from coartic.method.optimisers import sequences_of
from coartic.motion.solution import Movement, movements_of
from coartic.robot import Array


class Search(ABC):
    """Base class of the searches over the targets of one hand sequence.

    The constructor makes one trial, in which only the corrective process acts. If that trial fails,
    :attr:`reward` is -inf, and callers must not call :meth:`generation`.

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
        """Postures in which the corrective process hit the goals: the values of the explored
        joints, goal by goal, shape ``(n,)``, in length units and rad; NaN for goals that were not
        hit."""

    def make_trials(self, values: Array) -> Array:
        """Make the trials of a generation, and return their rewards.

        Parameters
        ----------
        values : ndarray, shape (N, n)
            Targets of the explored joints, goal by goal, in length units and rad. A row contains
            the n targets of a trial.

        Returns
        -------
        ndarray, shape (M,)
            Rewards of the trials, -inf for a failed trial. If only M < N trials are left, only the
            first M trials are made; otherwise M is N.

        Notes
        -----
        At least one trial must be left.
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
        """Cost and targets that the search recommends.

        - The cost is the mean cost of the trials of a complete generation, in ticks.
        - The targets are the mean of the search after that generation, shape ``(n,)``, in length
          units and rad.

        Without a complete generation, the cost is infinity, and the targets are :attr:`first_mean`.
        """


def solve_by_bandit(
    session: Session,
    parameters: SequenceParameters,
    make_search: Callable[[Attempts, str], Search],
    exploration: float,
) -> Result:
    """Try each hand sequence once, then divide the remaining trials among the sequences by UCB1.

    1. For each hand sequence, ``make_search`` makes a search, which makes one trial in which only
       the corrective process acts. If this trial fails, the hand sequence gets no further trials.
    2. Until no trial is left, UCB1 chooses the search that makes the next generation
       (:func:`spend_trials`). If all trials of step 1 have failed, this step is left out.

    All hand sequences of the task are tried, with two exceptions:

    - If parameter ``sequence`` is given, only this sequence is tried.
    - If the task has more than 4096 sequences, only the task's initial sequence is tried.

    If fewer trials are left than there are sequences, the last sequences are not tried.

    Parameters
    ----------
    session : Session
        Session in which the trials are made and counted.
    parameters : SequenceParameters
        Parameters of the method; ``trials`` and ``sequence`` are used.
    make_search : callable
        Function that makes the search of a hand sequence. Its arguments are the Attempts of the run
        and the hand sequence, such as ``"RRLR"``.
    exploration : float
        Constant of UCB1, as a multiple of the range of the first rewards (:func:`spend_trials`).

    Returns
    -------
    Result
        The movements of the best trial; with motor noise, the movements to the recommended targets
        (:func:`recommend`). The details contain ``best_trial``, the number of the best trial from
        0, and ``trials``, a dict that maps each tried hand sequence to its number of trials.

    Raises
    ------
    MethodError
        No trial is left to make, or no trial hits every goal.
    NotApplicableError
        The method needs the task's initial hand sequence, and the session does not find one
        (:meth:`.Session.find_initial_hands`).
    ValueError
        Parameter ``sequence`` does not fit the task.
    """
    attempts = Attempts(session, parameters.trials)
    given = parameters.told_hands(session)
    with session.solving():
        sequences = sequences_of(session) if given is None else [given]
        searches = [make_search(attempts, each) for each in sequences[: attempts.left]]
        spend_trials(searches, attempts, exploration)
    return attempts.result(
        lambda: recommend(searches, attempts),
        trials={search.hand_sequence: search.trials for search in searches},
    )


def spend_trials(searches: Sequence[Search], attempts: Attempts, exploration: float) -> None:
    """Let UCB1 divide the remaining trials among searches, one generation at a time.

    The next generation is made by the search with the highest upper confidence bound ::

        R + c sqrt(2 ln(N) / n)

    Here

    - R is the best reward of the search so far;
    - n is the number of generations of the search, and N the number of generations of all searches
      (the first trial of a search is counted as a generation);
    - c is ``exploration`` times the difference between the highest and the lowest first reward of
      the searches, or ``exploration`` times 1 tick if this difference is below 1 tick.

    Searches whose first trial failed do not take part, and are left out of N and c.

    Parameters
    ----------
    searches : sequence of Search
    attempts : Attempts
        Makes and counts the trials of the run. The function returns when no trial is left, or if
        the first trials of all searches have failed.
    exploration : float
        Factor of the constant c.
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
    """Return movements to the targets of the search that recommends the lowest cost.

    Each search recommends a cost and targets (:attr:`Search.answer`). If no search has made a
    complete generation, the targets come from the search whose hand sequence the best trial used.
    """
    best = min(
        searches, key=lambda each: (each.answer[0], each.hand_sequence != attempts.hand_sequence)
    )
    targets = attempts.targets_of(best.answer[1][None])[0]
    return movements_of(best.hand_sequence, targets)
