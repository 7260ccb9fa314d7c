"""REINFORCE: a Gaussian policy over target configurations, improved along the likelihood ratio."""

from coartic import Optimiser
from coartic.method.optimisers import OptimiserParameters


class ReinforceParameters(OptimiserParameters):
    spread: float = 0.05  # SD of the policy, length unit and rad
    step: float = 1.0  # along the gradient
    batch: int = 50  # trials


class Reinforce(Optimiser):
    name = "reinforce"
    title = "REINFORCE with a Gaussian policy"
    citation = "R. J. Williams (1992). Machine Learning 8."
    Parameters = ReinforceParameters

    def optimise(self, objective, rng):
        p, mean = self.parameters, objective.x0
        while True:  # until the objective ends it
            noise = rng.standard_normal((p.batch, objective.dim))
            costs = objective.many(mean + p.spread * noise)
            advantages = (costs.mean() - costs) / (costs.std() + 1e-9)
            mean = mean + p.step * p.spread * advantages @ noise / p.batch
