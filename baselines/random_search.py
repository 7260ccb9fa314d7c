"""Random search: the paper's learner without its memory; the best trial is kept.

Every trial draws Gaussian noise with the learner's standard deviation around the postures in which
the corrective process hits the goals; trial 0 is the corrective process alone. No target depends on
any reward, so that random search cannot coarticulate by learning: its best trial shows the effect
of selecting one of many noisy trials by the reward of the whole task. It is the control of
signatures of coarticulation (:mod:`coartic.analysis.control`), and differs from the learner in one
thing: it forgets.

``random-search`` has the hands with which the corrective process alone does best, or those that are
given. In ``random-search/hands`` every hand sequence gets as many of the trials; the best of all is
the solution.
"""

from __future__ import annotations

from contextlib import suppress
from typing import Annotated

from pydantic import Field

from coartic.learner.conditions import MOST_NOISE
from coartic.learner.learning import TRIALS, runs_at_once
from coartic.method import BudgetError, Method, MethodError, Parameters, Result, Session
from coartic.optimisers import OPTIMISER_INFORMATION, Objective, sequences_of

_POINTS_AT_ONCE = 500


class RandomSearchHandsParameters(Parameters):
    """Parameters of random search with every hand sequence."""

    trials: Annotated[int, Field(gt=0)] = TRIALS
    """Trials of a run, the corrective process alone among them."""
    sigma: Annotated[float, Field(gt=0, le=MOST_NOISE)] = 0.05
    """SD of the noise on each explored joint, length unit (base) and rad (joints): the
    learner's."""


class RandomSearchParameters(RandomSearchHandsParameters):
    """Parameters of random search."""

    hands: str | None = None
    """Hand sequence; by default the sequence with which the corrective process alone does best, or
    the task's own where there are too many to try."""


def draw_trials(session: Session, hands: str | None, sigma: float, trials: int) -> Objective:
    """Make trials with noise around the postures of the corrective process until none is left;
    return the objective, which keeps the best trial. ``hands``: a hand sequence, or None for the
    one with which the corrective process alone does best. ``sigma``: SD of the noise, length unit
    and rad. ``trials``: most trials, those of the corrective process alone among them. Raises
    BudgetError for no trial at all, MethodError if the process completes no hand sequence."""
    problem = Objective(session, hands, trials=trials)
    with suppress(BudgetError):
        while True:
            noise = session.rng.normal(0.0, sigma, (_POINTS_AT_ONCE, problem.dim))
            problem.many(problem.x0 + noise)
    return problem


class RandomSearchHands(Method):
    """Random search that divides its trials evenly among all hand sequences; with the task's own
    sequence alone where there are too many."""

    name = "random-search/hands"
    title = "Random search with every hand sequence"
    citation = (
        "L. A. Rastrigin (1963). The convergence of the random search method in the extremal "
        "control of a many parameter system. Automation and Remote Control."
    )
    information = OPTIMISER_INFORMATION
    Parameters = RandomSearchHandsParameters

    def most_together(self) -> int:
        """Return the largest number of runs that one job performs (:func:`runs_at_once`)."""
        return runs_at_once(self.parameters.trials)

    def solve(self, session: Session) -> Result:
        """Make equal shares of the trials with one hand sequence after the other; return the
        movements of the best trial. Raises MethodError if the corrective process completes none."""
        parameters: RandomSearchHandsParameters = self.parameters
        sequences, left = sequences_of(session), session.trials_left
        trials = parameters.trials if left is None else min(parameters.trials, left)
        shares = [trials * n // len(sequences) for n in range(len(sequences) + 1)]
        problems: list[Objective] = []
        with session.solving():
            for n, hands in enumerate(sequences):
                with suppress(BudgetError, MethodError):
                    share = shares[n + 1] - shares[n]
                    problems.append(draw_trials(session, hands, parameters.sigma, share))
        if not problems:
            raise MethodError("infeasible", "the corrective process completes no hand sequence")
        best = min(problems, key=lambda problem: problem.best_cost)
        return Result(best.solution, {"sequences": len(problems)})


class RandomSearch(RandomSearchHands):
    """Gaussian noise around the postures in which the corrective process hits the goals.

    The best trial is the solution.
    """

    name = "random-search"
    title = "Random search around the corrective process"
    Parameters = RandomSearchParameters

    def solve(self, session: Session) -> Result:
        """Make trials with one hand sequence, parameter ``hands`` or by default the one with which
        the corrective process alone does best, until none is left; return the movements of the best
        trial. Raises MethodError if there is no trial to make, or if the corrective process alone
        misses a goal."""
        parameters: RandomSearchParameters = self.parameters
        with session.solving():
            try:
                best = draw_trials(session, parameters.hands, parameters.sigma, parameters.trials)
            except BudgetError:
                raise MethodError("infeasible", "the budget leaves no trial to make") from None
        return Result(best.solution, {"evaluations": best.evaluations})


METHODS: tuple[type[Method], ...] = (RandomSearch, RandomSearchHands)
