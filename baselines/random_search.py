"""Random search: uniform noise on target configurations; the best trial is kept.

``random-search`` is the best of uniformly drawn targets around the corrective process with its best
hands. It cannot coarticulate by learning: no target depends on any reward. Its best trial shows the
effect of selecting one of many noisy trials by the reward of the whole task. A signature of
coarticulation of a method that selects its solution from trials counts if it exceeds this one. The
half width was tuned for reward at 10 000 trials on 24 development instances (twelve for one arm,
four of each of two-armed, aligned and redundancy), two runs each. Mean gain over the corrective
process with the best hands, per cent: 0.06 2.53, 0.08 2.67, 0.10 2.80, 0.12 2.83, 0.15 2.80, 0.20
2.75, 0.25 2.68. Other widths show larger signatures. Means over twelve development instances each,
for 0.06, 0.12, 0.18, 0.25, 0.5 and 1.0: first movement slower by -2.3, -2.2, -2.1,
-0.1, 3.1 and 2.7 ticks with one arm, 0.2, 2.0, 2.4, 3.6, 2.8 and 0 with two; next goal nearer by
5.5, 8.0, 9.6, 14.2, 19.0 and 18.7, and by 2.2, 3.2, 3.1, 2.5, 1.0 and 0; path of the idle hand
0.06, 0.07, 0.16, 0.24, 0.30 and 0; on four long tasks next goal nearer by 1.6, 1.9 and from 0.18 on
0. So suites have all of these but the last.

``random-search`` has the hands with which the corrective process alone does best, so that its
hands could not come out otherwise. In ``random-search/hands`` every sequence gets as many of the
trials, the first by the corrective process alone, the others around it. The best of all is the
solution.
"""

from __future__ import annotations

from contextlib import suppress
from typing import Annotated

import numpy as np
from pydantic import Field

from coartic.learner.learning import TRIALS
from coartic.method import BudgetError, Method, MethodError, Parameters, Result, Session
from coartic.optimisers import (
    OPTIMISER_INFORMATION,
    Objective,
    Optimiser,
    OptimiserParameters,
    sequences_of,
)

_POINTS_AT_ONCE = 500


class RandomSearchParameters(OptimiserParameters):
    """Parameters of random search."""

    half_width: Annotated[float, Field(gt=0, le=100)] = 0.12
    """Half the width of the box of targets, length unit (base) and rad (joints)."""


class RandomSearch(Optimiser):
    """Uniform targets in a box around the postures in which the corrective process hits the goals.

    The hands are those with which the corrective process alone does best. The best trial is the
    solution; the first is the corrective process alone.
    """

    name = "random-search"
    title = "Random search around the corrective process"
    citation = (
        "L. A. Rastrigin (1963). The convergence of the random search method in the extremal "
        "control of a many parameter system. Automation and Remote Control."
    )
    Parameters = RandomSearchParameters

    def optimise(self, objective: Objective, rng: np.random.Generator) -> None:
        """Draw targets until no trial is left."""
        low, high = objective.bounds.T
        while True:
            objective.many(rng.uniform(low, high, (_POINTS_AT_ONCE, objective.dim)))


class RandomSearchHandsParameters(Parameters):
    """Parameters of random search with every hand sequence."""

    trials: Annotated[int, Field(gt=0)] = TRIALS
    """Trials of a run, as many for each hand sequence."""
    half_width: Annotated[float, Field(gt=0, le=100)] = 0.12
    """Half the width of the box of targets, length unit (base) and rad (joints)."""


class RandomSearchHands(Method):
    """Random search for each hand sequence; for the task's own alone where there are too many."""

    name = "random-search/hands"
    title = "Random search with every hand sequence"
    citation = RandomSearch.citation
    information = OPTIMISER_INFORMATION
    Parameters = RandomSearchHandsParameters

    def solve(self, session: Session) -> Result:
        """Draw targets for one sequence after the other; the solution is the best trial's."""
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


METHODS: tuple[type[Method], ...] = (RandomSearch, RandomSearchHands)
