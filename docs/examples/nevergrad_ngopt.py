"""An optimiser of Nevergrad."""

import nevergrad
import numpy as np

from coartic import Optimiser
from coartic.method.optimisers import OptimiserParameters


class NevergradParameters(OptimiserParameters):
    sigma: float = 0.05  # of mutations, length unit and rad


class Nevergrad(Optimiser):
    name = "nevergrad"
    title = "NGOpt (Nevergrad)"
    citation = "P. Bennet et al. (2021). Nevergrad: black-box optimization platform. SIGEVOlution."
    Parameters = NevergradParameters

    def optimise(self, objective, rng):
        space = nevergrad.p.Array(init=objective.x0).set_mutation(sigma=self.parameters.sigma)
        space.random_state = np.random.RandomState(rng.integers(2**31))
        trials = self.parameters.trials
        optimiser = nevergrad.optimizers.NGOpt(space, budget=trials, num_workers=20)
        while True:  # until the objective ends it
            points = [optimiser.ask() for _ in range(20)]
            for point, cost in zip(points, objective.many([p.value for p in points])):
                optimiser.tell(point, cost)
