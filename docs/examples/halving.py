"""Hill climbing with each hand sequence; the worse half of them is dropped again and again."""

from contextlib import suppress

from coartic import Objective, Optimiser
from coartic.method import BudgetError, MethodError, Result


def climb(objective, rng):
    """Make a trial at a time, around the best one."""
    x, lowest = objective.x0, objective(objective.x0)
    while True:
        yield
        point = x + 0.05 * rng.standard_normal(objective.dim)
        if (cost := objective(point)) <= lowest:
            x, lowest = point, cost


class Halving(Optimiser):
    name = "halving"
    title = "Hill climbing, halving of hand sequences"
    citation = "K. Jamieson, A. Talwalkar (2016). AISTATS."

    def optimise(self, objective, rng):
        for _ in climb(objective, rng):
            pass

    def solve(self, session):
        if self.parameters.hands is not None:
            return super().solve(session)
        trials = self.parameters.trials
        costs = [Objective(session, trials=trials)]  # tries the corrective process alone
        with session.solving(), suppress(BudgetError):  # which ends all objectives together
            for hands in costs[0].hand_sequences:
                with suppress(MethodError):  # the corrective process fails with these hands
                    costs.append(Objective(session, hands, trials=trials - session.meter.trials))
            race = [(cost, climb(cost, session.rng)) for cost in costs[1:]]
            share = trials // len(race).bit_length()  # of a round: 16, 8, 4, 2 and 1 sequences
            while True:
                for _, climber in race:
                    for _ in range(1 + share // len(race)):
                        next(climber)
                race = sorted(race, key=lambda each: each[0].best_cost)[: len(race) // 2 or 1]
        return Result(min(costs, key=lambda cost: cost.best_cost).solution)
