"""Whether learned postures resemble those of a plan."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from analysis.claims.data import ASCENDING, DESCENDING, Data, MissingError
from analysis.claims.evidence import all_hold, exceeds, shown
from analysis.claims.register import Finding
from analysis.claims.statements import decides
from analysis.methods import LEARNER
from coartic.robot import Array

SHARE = 0.5
"""Of the initial solution's distance to the plan; ``claims.toml`` says half."""
RATIO_TEST = (
    "one-tailed bootstrap tests on both one-armed tasks that the ratio of mean distances to the "
    "plan, learned over initial, is below 0.5; BCa interval of the ratio"
)
_OPTIMUM = "optimum/dynamic-programming"


@decides("resembles-squared-changes", cost="squared-changes")
@decides("resembles-acceleration", cost="acceleration")
@decides("resembles-jerk", cost="jerk")
def _resembles(data: Data, cost: str) -> Finding:
    """Whether learned postures resemble the plan of one smoothness cost."""
    tests, parts = [], []
    for task in (ASCENDING, DESCENDING):
        learner, initial = data.cell(task, f"{LEARNER}EC1"), data.initial(task)
        (plan,) = data.cell(task, f"trajectory-optimisation/{cost}").runs
        planned = plan.execution.configurations
        before = _apart(initial.configurations, planned)
        ratios = np.array(
            [_apart(run.execution.configurations, planned) / before for run in learner.runs]
        )
        test = exceeds(-ratios, -SHARE)
        tests.append(replace(test, method=f"{test.method}, sign turned"))
        parts.append(
            f"{task}: initial {before:.2f} from the plan, learned "
            f"{shown(ratios, '.2f')} times as far" + _optimum(data, task, planned, before)
        )
    return all_hold(tests, parts)


def _optimum(data: Data, task: str, planned: Array, before: float) -> str:
    try:
        (best,) = data.cell(task, _OPTIMUM).runs
    except MissingError:
        return ""
    return f", the optimum {_apart(best.execution.configurations, planned) / before:.2f} times"


def _apart(q: Array, planned: Array) -> float:
    """Mean distance of postures at the goals, length unit and rad mixed."""
    return float(np.linalg.norm(q - planned, axis=-1).mean())
