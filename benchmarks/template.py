"""NAME: write here what your method does. Check it with: coartic check NAME --method-file FILE."""

from contextlib import suppress

import numpy as np

from coartic import BudgetError, Objective, Optimiser


class Mine(Optimiser):
    """Random steps from the best point, as a start for your own method.

    The length of the steps follows the one-fifth rule. The length grows after a batch that contains
    a point at least as good as the best point before, and shrinks after any other batch. If one
    batch in five contains such a point, the length stays about the same. On the paper's tasks the
    gap is 6.2 [6.0, 6.5] %, and the gap of the paper's learner is 7.9 %. With motor noise the best
    cost is partly luck, so that the steps become too short: improve this first.
    """

    name = "NAME"  # id in commands and tables
    title = "Random steps from the best point"  # title in lists and citations
    citation = "I. Rechenberg (1973). Evolutionsstrategie."  # work that others should cite
    tuned_on = "nothing"  # tasks on which you chose its constants

    def optimise(self, objective: Objective, rng: np.random.Generator) -> np.ndarray:
        """Minimise the cost of a trial, and return the point that you recommend.

        When no trial is left, ``objective`` raises BudgetError, which ends the search. Without
        motor noise the solution is the best trial. With noise the best trial was partly lucky, and
        the solution is the point that is returned: the one from which the search would go on.
        """
        # Use only rng for random numbers. A point has the joints at all goals (length units, rad).
        x, step = objective.x0, 0.03  # the postures of the corrective process; length units and rad
        with suppress(BudgetError):
            best = objective(x)  # ticks
            while True:
                points = x + step * rng.standard_normal((10, objective.dim))
                costs = objective.many(points)  # faster than one by one
                step *= 1.5 if costs.min() <= best else 1.5**-0.25
                if costs.min() < best:
                    x, best = points[costs.argmin()], costs.min()
        return x


# This method uses the corrective process and the rewards of its trials. A method that uses more
# information, such as the goals or a Jacobian, declares the information and has a function `solve`:
# see "Make a method of your own" in the documentation.
