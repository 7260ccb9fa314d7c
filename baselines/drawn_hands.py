"""The placebo for hands: random guesses around the corrective process, with every hand sequence.

``placebo/guesses`` has the hands with which the corrective process alone does best, so that its
hands could not come out otherwise. Here every sequence gets as many of the trials, the first by the
corrective process alone, the others around it. The best of all is the solution.
"""

from __future__ import annotations

from contextlib import suppress
from typing import Annotated

from pydantic import Field

from coartic.baselines.random_search import Guesses
from coartic.learner.learning import TRIALS
from coartic.method import BudgetError, Method, MethodError, Parameters, Result, Session
from coartic.optimisers import TOLD, Objective, sequences_of


class DrawnHandsParameters(Parameters):
    """Parameters of the placebo for hands."""

    trials: Annotated[int, Field(gt=0)] = TRIALS
    half_width: Annotated[float, Field(gt=0, le=100)] = 0.12
    """Half the width of the box of targets, length unit (base) and rad (joints)."""


class DrawnHands(Method):
    """Guesses in a box for each hand sequence; the task's own alone, where there are too many."""

    name = "placebo/hands"
    title = "Placebo: best of random guesses with every hand sequence"
    citation = Guesses.citation
    told = TOLD
    Parameters = DrawnHandsParameters

    def solve(self, session: Session) -> Result:
        """Guess with one sequence after the other; the solution is the best trial's."""
        sequences = sequences_of(session)
        left = session.trials_left
        trials = self.parameters.trials if left is None else min(self.parameters.trials, left)
        shares = [trials * n // len(sequences) for n in range(len(sequences) + 1)]
        problems: list[Objective] = []
        with session.solving():
            for n, hands in enumerate(sequences):
                share, width = shares[n + 1] - shares[n], self.parameters.half_width
                with suppress(BudgetError, MethodError):
                    problem = Objective(session, hands, half_width=width, trials=share)
                    problems.append(problem)
                    low, high = problem.bounds.T
                    problem.many(session.rng.uniform(low, high, (share - 1, problem.dim)))
        if not problems:
            raise MethodError("infeasible", "the corrective process completes no hand sequence")
        best = min(problems, key=lambda problem: problem.best_cost)
        return Result(best.solution, {"sequences": len(problems)})


METHODS: tuple[type[Method], ...] = (DrawnHands,)
