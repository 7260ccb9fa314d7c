"""A policy that acts at random, in the box around what the corrective process does."""

from coartic import Optimiser


class RandomPolicy(Optimiser):
    name = "random-policy"
    title = "Random policy"
    citation = "None."

    def optimise(self, objective, rng):
        while True:  # until the objective ends it
            objective.many(rng.uniform(*objective.bounds.T, size=(100, objective.dim)))
