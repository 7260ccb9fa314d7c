"""Minimise targets and hands together with CatCMA with margin, for which hands are categories."""

import numpy as np
from cmaes import CatCMAwM

import coartic
from coartic.method import BudgetError


def search(task, trials, seed=1):
    """The objective after all trials."""
    cost = coartic.objective(task, budget=trials)
    optimiser = CatCMAwM(
        x_space=cost.bounds, c_space=[2] * len(cost.hands), mean=cost.x0, sigma=0.1, seed=seed
    )
    try:
        while True:
            asked = [optimiser.ask() for _ in range(optimiser.population_size)]
            hands = ["".join("LR"[right] for right in each.c[:, 1].astype(int)) for each in asked]
            costs = cost.many(np.array([each.x for each in asked]), hands)
            optimiser.tell(list(zip(asked, costs, strict=True)))
    except BudgetError:
        return cost


if __name__ == "__main__":
    cost = search("two-armed-2", 10_000)
    print(cost.best_cost, "ticks with hands", cost.best_hands)
