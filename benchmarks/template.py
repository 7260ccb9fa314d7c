"""NAME: say in a line what it does. Check it: coartic check NAME --method-file FILE."""

import numpy as np

from coartic import Objective, Optimiser


class Mine(Optimiser):
    """Random steps from the best point: what you start from, and already ahead of the paper's
    learner on its tasks (a gap of 6.0 [5.9, 6.1] %, and 7.9 %)."""

    name = "NAME"  # its id in commands and tables
    title = "Random steps from the best point"  # in lists and citations
    citation = "I. Rechenberg (1973). Evolutionsstrategie."  # what others cite
    tuned_on = "nothing"  # tasks on which you chose its constants, here the step of 0.03

    def optimise(self, objective: Objective, rng: np.random.Generator) -> None:
        """Minimise the cost of a trial until ``objective`` raises BudgetError because no trial is
        left: do not catch it. The best point counts."""
        # Draw from rng alone. A point has the joints of all goals; units: length, rad.
        x = objective.x0  # the postures of the corrective process
        best = objective(x)  # ticks
        while True:
            points = x + 0.03 * rng.standard_normal((10, objective.dim))
            costs = objective.many(points)  # side by side, as fast as one
            if costs.min() < best:
                x, best = points[costs.argmin()], costs.min()


# It uses the corrective process and the reward of its trials. A method that needs more, such as
# the goals or a Jacobian, declares this information and has a `solve`: see "Make a method of your
# own" in the docs.
