"""Gaps of pycma on ten instances in the files of IOHprofiler: pip install ioh cma."""

from contextlib import suppress

import cma
import ioh

import coartic

logger = ioh.logger.Analyzer(root=".", folder_name="ioh-pycma", algorithm_name="pycma")
for number in range(10):
    cost = coartic.objective(f"one-armed/v1/i{number:03}", budget=2000)
    limits = {"lb": cost.bounds.min(), "ub": cost.bounds.max()}

    def gap(x, cost=cost):  # from 0 on all instances
        return cost(x) / cost.best_known - 1

    problem = ioh.wrap_problem(gap, "one-armed", dimension=cost.dim, instance=number, **limits)
    problem.attach_logger(logger)
    with suppress(coartic.BudgetError):  # which ends it
        cma.fmin2(problem, cost.x0, 0.05, {"seed": 1, "verbose": -9}, restarts=9)
    problem.detach_logger()
logger.close()
