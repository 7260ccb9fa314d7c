"""Minimise a task with pycma and choose the hands by successive halving."""

import cma

import coartic


def search(task, trials, start):
    """The best of the objectives with each hand sequence; the better half goes on."""
    costs = [coartic.objective(task, hands) for hands in coartic.hand_sequences(task)]
    races = [(cost, start(cost)) for cost in costs]
    share = trials // len(races).bit_length()  # of a round: 16, 8, 4, 2 and 1 sequences
    while races:
        for cost, optimiser in races:
            for _ in range(share // len(races) // optimiser.popsize):
                points = optimiser.ask()
                optimiser.tell(points, cost.many(points))
        races = sorted(races, key=lambda race: race[0].best_cost)[: len(races) // 2]
    return min(costs, key=lambda cost: cost.best_cost)


def pycma(cost, seed=1):
    """Pycma at the start of an objective."""
    return cma.CMAEvolutionStrategy(cost.x0, 0.05, {"seed": seed, "verbose": -9})


if __name__ == "__main__":
    best = search("two-armed-2", 10_000, pycma)
    print(best.best_cost, "ticks with hands", best.hands)
