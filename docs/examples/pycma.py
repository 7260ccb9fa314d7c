"""CMA-ES of pycma."""

import cma

from coartic import Optimiser


class PyCMA(Optimiser):
    name = "pycma"
    title = "CMA-ES (pycma)"
    citation = "N. Hansen (2016). arXiv:1604.00772."

    def optimise(self, objective, rng):
        options = {"seed": int(rng.integers(1, 2**31)), "verbose": -9}
        strategy = cma.CMAEvolutionStrategy(objective.x0, 0.05, options)
        while not strategy.stop():
            points = strategy.ask()
            strategy.tell(points, objective.many(points))
