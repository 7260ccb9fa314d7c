"""The placebo: the best of many random guesses around the corrective process.

It cannot coarticulate by learning: no guess depends on any reward. What its best trial shows is
what selecting one of many noisy trials by the reward of the whole task shows by itself. A sign of
coarticulation of a method that selects its solution from trials counts where it exceeds this one.

The half width was tuned for reward at 10 000 trials on 24 development instances (twelve for one
arm, four of each of two-armed, aligned and redundancy), two runs each. Mean gain over the
corrective process with the best hands, per cent: 0.06 2.53, 0.08 2.67, 0.10 2.80, 0.12 2.83,
0.15 2.80, 0.20 2.75, 0.25 2.68.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field

from coartic.method import Method
from coartic.optimisers import Objective, Optimiser, OptimiserParameters

_TOGETHER = 500  # guesses that are tried at once


class PlaceboParameters(OptimiserParameters):
    """Parameters of the placebo."""

    half_width: Annotated[float, Field(gt=0, le=100)] = 0.12
    """Half the width of the box of targets, length unit (base) and rad (joints)."""


class Guesses(Optimiser):
    """Uniform guesses in a box around the postures in which the corrective process hits the goals.

    The hands are those with which the corrective process alone does best. The best trial is the
    solution; the first is the corrective process alone.
    """

    name = "placebo/guesses"
    title = "Placebo: best of random guesses around the corrective process"
    citation = (
        "L. A. Rastrigin (1963). The convergence of the random search method in the extremal "
        "control of a many parameter system. Automation and Remote Control."
    )
    Parameters = PlaceboParameters

    def optimise(self, objective: Objective, rng: np.random.Generator) -> None:
        """Guess until no trial is left."""
        low, high = objective.bounds.T
        while True:
            objective.many(rng.uniform(low, high, (_TOGETHER, objective.dim)))


METHODS: tuple[type[Method], ...] = (Guesses,)
"""The placebo."""
