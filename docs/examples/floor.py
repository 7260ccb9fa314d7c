"""The best that a box and given hands allow, as far as a search finds it: a yardstick.

CMA-ES within the bounds of the objective, from the middle of the box and then from points drawn in
it, with twice the population each time.
"""

import cma

from coartic import Optimiser


class Floor(Optimiser):
    name = "floor"
    title = "Search for the best point of a box"
    citation = "N. Hansen (2016). arXiv:1604.00772."

    def optimise(self, objective, rng):
        low, high = objective.bounds.T
        start, step = objective.x0, min(0.3 * self.parameters.half_width, 0.1)
        options = {"bounds": [low, high], "seed": int(rng.integers(1, 2**31)), "verbose": -9}
        while True:  # until the objective ends it
            strategy = cma.CMAEvolutionStrategy(start, step, options)
            while not strategy.stop():
                points = strategy.ask()
                strategy.tell(points, objective.many(points))
            options |= {"seed": options["seed"] + 1, "popsize": 2 * strategy.popsize}
            start = rng.uniform(low, high)
