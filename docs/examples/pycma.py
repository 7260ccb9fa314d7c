"""CMA-ES of pycma, which begins anew with twice the population where it stops."""

import cma

from coartic import Optimiser
from coartic.method.optimisers import OptimiserParameters


class PyCMAParameters(OptimiserParameters):
    sigma: float = 0.05  # first step size, length unit and rad


class PyCMA(Optimiser):
    name = "pycma"
    title = "CMA-ES (pycma)"
    citation = "N. Hansen (2016). arXiv:1604.00772."
    Parameters = PyCMAParameters

    def optimise(self, objective, rng):
        options = {"seed": int(rng.integers(1, 2**31)), "verbose": -9}
        while True:  # until the objective ends it
            strategy = cma.CMAEvolutionStrategy(objective.x0, self.parameters.sigma, options)
            while not strategy.stop():
                points = strategy.ask()
                strategy.tell(points, objective.many(points))
            options["seed"] += 1
            options["popsize"] = 2 * strategy.popsize
