"""Wrong objectives: what it costs to plan for another reward than the true one.

The tasks of suite ``objectives`` are random tasks and the paper's, each without a penalty and with
several (:class:`coartic.tasks.task.Penalty`). A plan made without a penalty is what somebody does
who does not know of one: its movements are executed and scored under each penalty here, which
takes no run. The weight of a penalty, in ticks, says how wrong such a planner is.
"""

from __future__ import annotations

import itertools

import numpy as np
import pandas as pd

from coartic import Movement, Task, execute
from coartic.analysis.statistics.estimates import FEWEST, RESAMPLES, SEED
from coartic.analysis.study import CellRuns, Study, cached
from coartic.robot import Array
from coartic.runs.run import movements_from
from coartic.tasks.task import address_of

Solution = tuple[Movement, ...]
TERMS = {"joints": "costly joints", "region": "costly disc", "distinct": "postures alike"}
"""Penalties, each by its one weight, in words."""
WHO = {
    "told": "the planner told of the penalty",
    "ticks": "the planner of ticks",
    "smooth": "the planner of smoothness",
    "learner": "the learner",
    "from plan": "the learner from the plan of ticks",
    "cma-es": "CMA-ES",
}
"""Who makes movements, in words: planners that are told of the penalty, that believe that ticks
count alone, that believe in smoothness; the learner, from the corrective process and from the plan
of ticks; CMA-ES."""
UNTOLD = ("learner", "cma-es")
"""Who learns by trial and error, and from no plan."""
_METHODS = {
    "believed-reward/plan": "told",
    "dual-process": "learner",
    "believed-reward/EC1": "from plan",
    "believed-reward/EC4": "from plan",
    "cma-es/bandit": "cma-es",
}
_PLANNERS = {"believed-reward/plan": "ticks", "trajectory-optimisation/squared-changes": "smooth"}


def base_of(task: str) -> str:
    """The name of the task of which a task with a penalty is a variant."""
    return task.partition(".")[0]


def term_of(task: Task) -> tuple[str, float]:
    """The one term of a task's penalty that counts, and its weight; no term and 0 without any."""
    if task.penalty is None:
        return "", 0.0
    weights = {term: getattr(task.penalty, term) for term in TERMS}
    (term,) = (term for term, weight in weights.items() if weight)
    return term, weights[term]


@cached
def rewards(study: Study) -> pd.DataFrame:
    """Mean reward under the true objective: a row for each task, term, weight and who.

    Columns ``task`` (without its variant), ``family`` (missing for the paper's), ``split``,
    ``term``, ``weight``, ``who``, ``reward``, ``regret``, in per cent of the best reward that is
    known under this objective, and ``cell``, whose runs are behind it. A task without a penalty is
    one of weight 0 under every term. Runs that failed are left out.
    """
    rows = []
    plans = plans_without_penalty(study)
    for name, task in study.tasks.items():
        address = address_of(base_of(name))
        family, split = (address.family, address.split) if address else (None, None)
        term, weight = term_of(task)
        seen: dict[str, tuple[float, CellRuns]] = {}
        best = -np.inf
        for (run_on, label), cell in study.cells.items():
            method = label.partition(" ")[0]
            who = _METHODS.get(method) or _METHODS.get(method.partition("/")[0])
            if run_on == name and who is not None and len(cell.good):
                seen[who] = float(cell.rewards.mean()), cell
                best = max(best, float(cell.rewards.max()))
        for who, (movements, cell) in plans.get(base_of(name), {}).items():
            scored = execute(task, movements, model=study.model)
            if scored.reward is not None:
                seen[who] = float(scored.reward), cell
                best = max(best, float(scored.reward))
        for one in TERMS if weight == 0 else (term,):
            for who, (reward, cell) in seen.items():
                regret = 100 * (best - reward) / abs(best)
                row = (base_of(name), family, split, one, weight, who, reward, regret, cell)
                rows.append(row)
    columns = ["task", "family", "split", "term", "weight", "who", "reward", "regret", "cell"]
    return pd.DataFrame(rows, columns=columns).astype({"family": "string", "split": "string"})


@cached
def plans_without_penalty(study: Study) -> dict[str, dict[str, tuple[Solution, CellRuns]]]:
    """Plans of those that know of no penalty, and their runs, by task without a penalty."""
    movements, waypoints = study.movements
    plans: dict[str, dict[str, tuple[Solution, CellRuns]]] = {}
    for (name, label), cell in study.cells.items():
        who = _PLANNERS.get(label.partition(" ")[0])
        if who and study.tasks[name].penalty is None and len(cell.good):
            run = str(cell.good.run_id.iloc[0])
            task = study.tasks[name]
            solution = movements_from(task, movements[run], waypoints.get(run))
            plans.setdefault(name, {})[who] = solution, cell
    return plans


def on_random_tasks(study: Study) -> pd.DataFrame:
    """Rows of :func:`rewards` on random tasks; development instances where there are no others."""
    frame = rewards(study)
    frame = frame[frame.family.notna()]
    reported = frame[frame.split != "development"]
    return reported if len(reported) else frame


def advantage(study: Study, first: str, second: str, term: str) -> pd.DataFrame:
    """Regret of ``second`` less that of ``first``, in per cent of the best known reward.

    A row for each random task that both solved under every weight of a term, a column for each
    weight, 0 first; indexed by family and task.
    """
    frame = on_random_tasks(study)
    frame = frame[frame.term == term]
    second_regret, first_regret = (
        frame[frame.who == who].pivot_table("regret", index=["family", "task"], columns="weight")
        for who in (second, first)
    )
    return (second_regret - first_regret).dropna()


def crossing(weights: Array, means: Array) -> float:
    """The weight from which a mean advantage, shape ``(weights,)``, is above 0 to the last weight.

    Linear between weights; 0 where it always is, infinite where it is not at the last one.
    """
    if means[-1] <= 0:
        return np.inf
    below = np.flatnonzero(means <= 0)
    if not len(below):
        return 0.0
    k = int(below[-1])
    share = -means[k] / (means[k + 1] - means[k])
    return float(weights[k] + share * (weights[k + 1] - weights[k]))


def crossings(study: Study) -> pd.DataFrame:
    """Where trial and error overtakes the planner of ticks, by term: the weight, with its interval.

    Percentiles of 9,999 bootstrap resamples of random tasks within their families, 95 %, which are
    not widened as means over tasks are: a crossing can be infinite. An infinite end: beyond the
    largest weight, if at all.
    """
    rows = []
    for term, who in itertools.product(TERMS, UNTOLD):
        table = advantage(study, who, "ticks", term)
        if len(table) < FEWEST:
            continue
        weights = np.array(table.columns, dtype=np.float64)
        rng = np.random.default_rng(SEED)
        by_family = [part.to_numpy() for _, part in table.groupby(level="family")]
        drawn = [
            part[rng.integers(len(part), size=(RESAMPLES, len(part)))].mean(axis=1)
            for part in by_family
        ]
        each = [crossing(weights, resample) for resample in np.mean(drawn, axis=0)]
        low, high = np.quantile(each, [0.025, 0.975], method="inverted_cdf")
        centre = np.mean([part.mean(axis=0) for part in by_family], axis=0)
        rows.append((term, who, len(table), crossing(weights, centre), low, high))
    columns = ["term", "who", "tasks", "crossing", "crossing_low", "crossing_high"]
    return pd.DataFrame(rows, columns=columns)
