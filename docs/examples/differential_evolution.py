"""Differential evolution of scipy."""

from scipy.optimize import differential_evolution

from coartic import Optimiser


class DifferentialEvolution(Optimiser):
    name = "differential-evolution"
    title = "Differential evolution (scipy)"
    citation = "R. Storn, K. Price (1997). Journal of Global Optimization 11."

    def optimise(self, objective, rng):
        differential_evolution(
            lambda points: objective.many(points.T),  # scipy has them in columns
            objective.bounds,
            x0=objective.x0,
            rng=rng,
            vectorized=True,
            updating="deferred",
            polish=False,
            popsize=1,  # as many points as dimensions; 15 times as many take all trials
            maxiter=10**6,
            tol=0,  # or it stops where a narrow box has like costs
        )
