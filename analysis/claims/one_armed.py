"""The paper's claims about the one-armed tasks (exploration condition 1)."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from coartic.analysis.claims.data import ASCENDING, DESCENDING, Data, MissingError
from coartic.analysis.claims.evidence import all_hold, exceeds, shown
from coartic.analysis.claims.register import Finding
from coartic.analysis.claims.statements import MARGINS, decides
from coartic.analysis.methods import EC1, INITIAL
from coartic.analysis.signatures.context import dependence_below
from coartic.analysis.signatures.subtasks import ROUNDING, change_from, sacrifices
from coartic.analysis.signatures.trajectories import postures
from coartic.analysis.statistics.estimates import SEED, Inference
from coartic.robot import Array

CONTROLS = ("posture-based/one-goal", INITIAL)
"""Methods that do not look beyond the current goal."""
SHARE = MARGINS["halfway"]
RATIO_TEST = (
    "one-tailed bootstrap tests on both one-armed tasks that the ratio of mean distances to the "
    f"plan, learned over initial, is below {SHARE:g}; BCa interval of the ratio"
)
_OPTIMUM = "optimum/dynamic-programming"


@decides("first-movement-sacrificed")
def _first_movement_sacrificed(data: Data) -> Finding:
    tests, parts = [], []
    for task in (ASCENDING, DESCENDING):
        cell, initial = data.cell(task, EC1), data.initial(task)
        before = initial.ticks_by_goal()[0]
        first = np.array([float(run.execution.ticks_by_goal()[0]) for run in cell.runs])
        total = np.array([float(run.execution.ticks) for run in cell.runs])
        tests += [
            exceeds(first, float(before + ROUNDING)),
            exceeds(-total, -float(initial.ticks)),
        ]
        both = sum(sacrifices(change_from(run.execution, initial)) for run in cell.runs)
        parts.append(
            f"{task}: first movement {before} to {shown(first)} ticks, "
            f"all {initial.ticks} to {total.mean():.1f}, both in {both} of {len(cell.runs)} runs"
        )
    for method in CONTROLS:
        with suppress(MissingError):
            change, whole = sacrifice(data, method)
            parts.append(f"{method}: first {change:+.1f}, all {whole:+.1f} on ascending")
    return all_hold(tests, parts)


def sacrifice(data: Data, method: str) -> tuple[float, float]:
    """Ticks of the first movement and of all, less the corrective process's, on ascending.

    Of the corrective process alone with the same hands. Raises MissingError without runs.
    """
    first = data.signature(ASCENDING, method, "first subtask against the same hands")
    total = data.signature(ASCENDING, method, "total against the same hands")
    return float(first.value), float(total.value)


@decides("overall-reward")
def _overall_reward(data: Data) -> Finding:
    tests, parts = [], []
    alone = f"{EC1}-subtask"
    for task in (ASCENDING, DESCENDING):
        replays = data.replays(task, "EC1"), data.replays(task, "EC1-subtask")
        first = [
            np.array([float(run.execution.ticks_by_goal()[0]) for run in data.cell(task, m).runs])
            for m in (EC1, alone)
        ]
        tests += [exceeds(*replays), exceeds(*first)]
        initial = data.initial(task)
        parts.append(
            f"{task}: replay {shown(replays[0])} against {shown(replays[1])} (initial "
            f"{-initial.ticks}), first movement {shown(first[0])} against {shown(first[1])} ticks "
            f"(initial {initial.ticks_by_goal()[0]})"
        )
    with suppress(MissingError):
        apart = [context_distance(data, method) for method in (EC1, alone)]
        parts.append(
            f"postures at goal 1 before different successors {apart[0]:.2f} and {apart[1]:.2f} "
            "apart in the best trials, which are chosen by the whole reward"
        )
    return all_hold(tests, parts)


@decides("context")
def _context_matters(data: Data) -> Finding:
    distance = context_distance(data, EC1)
    row = data.signature(ASCENDING, EC1, "context dependence", 1)
    equivalent = data.signature(ASCENDING, EC1, "motor-equivalent part", 1).value
    other = data.signature(ASCENDING, EC1, "non-motor-equivalent part", 1).value
    test = Inference(row.value, (int(row.n),), "permutation test over runs", p=row.p, seed=SEED)
    parts = [
        f"postures at goal 1 lie {distance:.2f} apart, {row.value:.1f} pooled SDs; per dimension "
        f"{equivalent:.3f} leave the hand in place and {other:.3f} move it"
    ]
    for method in CONTROLS:
        with suppress(MissingError):
            parts.append(f"{method}: {context_distance(data, method):.2f} apart")
    first, second = (postures(data.cell(t, EC1).runs, 1) for t in (ASCENDING, DESCENDING))
    spread = MARGINS["spread"]
    p = dependence_below(first, second, spread, np.random.default_rng(SEED))
    contrary = replace(test, estimate=spread - row.value, method="bootstrap over runs", p=p)
    return Finding(row.value > spread, "; ".join(parts), (test,), (contrary,))


def context_distance(data: Data, method: str) -> float:
    """Distance of mean postures at goal 1, ascending and descending; MissingError without runs."""
    data.runs(DESCENDING, method)
    return float(data.signature(ASCENDING, method, "context distance", 1).value)


@decides("resembles-squared-changes", cost="squared-changes")
@decides("resembles-acceleration", cost="acceleration")
@decides("resembles-jerk", cost="jerk")
def _resembles(data: Data, cost: str) -> Finding:
    """Whether learned postures resemble the plan of one smoothness cost."""
    tests, parts = [], []
    for task in (ASCENDING, DESCENDING):
        learner, initial = data.cell(task, EC1), data.initial(task)
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
