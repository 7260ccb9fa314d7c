"""REINFORCE: a Gaussian policy over target configurations, improved along the likelihood ratio."""

from coartic import Optimiser

SPREAD, STEP, BATCH = 0.05, 1.0, 50  # length unit and rad; of the gradient; trials


class Reinforce(Optimiser):
    name = "reinforce"
    title = "REINFORCE with a Gaussian policy"
    citation = "R. J. Williams (1992). Machine Learning 8."

    def optimise(self, objective, rng):
        mean = objective.x0.copy()
        while True:  # until the objective ends it
            noise = rng.standard_normal((BATCH, objective.dim))
            costs = objective.many(mean + SPREAD * noise)
            advantages = (costs.mean() - costs) / (costs.std() + 1e-9)
            mean += STEP * SPREAD * advantages @ noise / BATCH
