"""Judges of the paper's claims about the one-armed tasks (exploration condition 1)."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from coartic.analysis.claims.data import ASCENDING, DESCENDING, Data, MissingError
from coartic.analysis.claims.register import MARGINS, Claim, Finding
from coartic.analysis.claims.rules import all_hold, exceeds, shown
from coartic.analysis.methods import EC1, INITIAL, name_of
from coartic.analysis.signatures.between import TwoContexts, rng_of
from coartic.analysis.signatures.context import (
    context_dependence,
    dependence_below,
    distance,
    permutation_p,
)
from coartic.analysis.signatures.manifold import jacobian_of, motor_equivalence
from coartic.analysis.signatures.register import REGISTER
from coartic.analysis.signatures.subtasks import sacrifices
from coartic.analysis.statistics.estimates import SEED, Inference
from coartic.analysis.trajectories import change_from
from coartic.analysis.words import number
from coartic.robot import Array

CONTROLS = ("posture-based/one-goal", INITIAL)
"""Methods that do not look beyond the current goal."""
_TASKS = (ASCENDING, DESCENDING)
_PLAN = "trajectory-optimisation/squared-changes"


def first_movement_sacrificed(data: Data, _: Claim) -> Finding:
    """Whether the first movement gets slower and the whole task faster."""
    tests, parts = [], []
    for task in _TASKS:
        cell, initial = data.cell(task, EC1), data.initial(task)
        before = initial.ticks_by_goal()[0]
        first = _first_ticks(data, task, EC1)
        whole = np.array([run.execution.ticks for run in cell.runs])
        tests += [
            exceeds(first, before + MARGINS["ticks"]),
            exceeds(-whole.astype(float), -float(initial.ticks)),
        ]
        both = sum(sacrifices(change_from(run.execution, initial)) for run in cell.runs)
        parts.append(
            f"{task}: the first movement takes {shown(first)} ticks (initially {before}), the "
            f"whole task {number(whole.mean(), 1)} (initially {initial.ticks}); both in {both} of "
            f"{len(cell.runs)} runs"
        )
    for label in CONTROLS:
        with suppress(MissingError):
            change = data.cell(ASCENDING, label).against_same_hands
            if len(change):
                parts.append(
                    f"{name_of(label)} on ascending: {number(change[:, 0].mean(), 1)} ticks "
                    f"longer, {number(change.sum(axis=1).mean(), 1)} in all"
                )
    return all_hold(tests, parts)


def _first_ticks(data: Data, task: str, label: str) -> Array:
    """Ticks of the first movement of each run, ``(runs,)``."""
    runs = data.cell(task, label).runs
    return np.array([float(run.execution.ticks_by_goal()[0]) for run in runs])


def overall_reward(data: Data, _: Claim) -> Finding:
    """Whether a learner with a reward for each subtask sacrifices nothing and ends with less."""
    tests, parts = [], []
    for task in _TASKS:
        replays = data.replays(task, "EC1"), data.replays(task, "EC1-subtask")
        first = [_first_ticks(data, task, label) for label in (EC1, f"{EC1}-subtask")]
        tests += [exceeds(*replays), exceeds(*first)]
        initial = data.initial(task)
        parts.append(
            f"{task}: replay {shown(replays[0])} against {shown(replays[1])} (initially "
            f"{number(-initial.ticks)}), first movement {shown(first[0])} against "
            f"{shown(first[1])} ticks (initially {initial.ticks_by_goal()[0]})"
        )
    return all_hold(tests, parts)


def _contexts(data: Data, label: str) -> TwoContexts:
    """Runs of a method that hit goal 1 of the two tasks; MissingError without them."""
    first, second = (data.cell(task, label) for task in _TASKS)
    contexts = TwoContexts(first, second, 1, "right")
    if not all(contexts.runs):
        raise MissingError(f"no run of {label} hits goal 1 of both tasks with the right hand")
    return contexts


def context(data: Data, _: Claim) -> Finding:
    """Whether postures at goal 1 depend on the goal that follows."""
    contexts = _contexts(data, EC1)
    first, second = contexts.postures
    spreads = context_dependence(first, second)
    rng = rng_of(REGISTER["context dependence"], contexts.place)
    p = float(permutation_p(first, second, rng))
    joints, jacobian = jacobian_of(
        contexts.first.task, contexts.hand, np.concatenate([first, second])
    )
    difference = first.mean(axis=0) - second.mean(axis=0)
    equivalent, other = motor_equivalence(difference[joints], jacobian)
    parts = [
        f"postures at goal 1 lie {number(distance(first, second), 2)} apart, "
        f"{number(spreads, 1)} pooled SD; per dimension {number(equivalent, 3)} of that leaves the "
        f"hand in place and {number(other, 3)} moves it"
    ]
    for label in CONTROLS:
        with suppress(MissingError):
            apart = distance(*_contexts(data, label).postures)
            parts.append(f"{name_of(label)}: {number(apart, 2)} apart")
    bound = MARGINS["spread"]
    test = Inference(spreads, (contexts.n,), "permutation test over runs", p=p, seed=SEED)
    less_p = dependence_below(first, second, bound, np.random.default_rng(SEED))
    less = replace(test, estimate=bound - spreads, method="bootstrap over runs", p=less_p)
    return Finding(spreads > bound, f"{'; '.join(parts)}.", (test,), (less,))


def resembles_squared_changes(data: Data, _: Claim) -> Finding:
    """Whether learned postures resemble those of the plan for least squared changes."""
    tests, parts = [], []
    for task in _TASKS:
        learner, initial = data.cell(task, EC1), data.initial(task)
        (plan,) = data.cell(task, _PLAN).runs
        planned = plan.execution.configurations
        before = _apart(initial.configurations, planned)
        ratios = np.array(
            [_apart(run.execution.configurations, planned) / before for run in learner.runs]
        )
        test = exceeds(-ratios, -MARGINS["halfway"])
        tests.append(replace(test, method=f"{test.method}, sign turned"))
        parts.append(
            f"{task}: the initial solution lies {number(before, 2)} from the plan, learned "
            f"solutions {shown(ratios, 2)} times as far"
        )
    return all_hold(tests, parts)


def _apart(q: Array, planned: Array) -> float:
    """Mean distance of postures at the goals, length unit and rad mixed."""
    return float(np.linalg.norm(q - planned, axis=-1).mean())
