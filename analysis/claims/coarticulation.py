"""The paper's claims that coarticulation shows in the hands chosen and in the other arm."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from coartic.analysis.claims.data import ONE, TWO, Data, MissingError
from coartic.analysis.claims.evidence import all_hold, exceeds, shown
from coartic.analysis.claims.register import Finding
from coartic.analysis.claims.statements import MARGINS, decides
from coartic.analysis.methods import LEARNER
from coartic.analysis.signatures.other_arm import preshaping, readiness
from coartic.analysis.signatures.subtasks import isolated_agreement, served
from coartic.analysis.signatures.trajectories import Trajectories
from coartic.analysis.statistics.estimates import FEWEST
from coartic.analysis.statistics.hypotheses import share_test
from coartic.robot import Array

_CONTROLS = ("corrective-alone/every", "posture-based/one-goal hands=every, other_arm=free")
"""Methods that do not look beyond the current goal."""


@decides("hand-coarticulation")
def _hand_coarticulation(data: Data) -> Finding:
    tests, against, parts = [], [], []
    for condition in ("EC3", "EC4"):
        cell = data.cell(ONE, LEARNER + condition)
        # The last goal has no successor to be prepared for.
        agrees = np.array([isolated_agreement(run)[:-1] for run in cell.runs])
        away, total = int((~agrees.all(axis=1)).sum()), len(agrees)
        tests.append(share_test(away, total, MARGINS["majority"], "greater"))
        against.append(share_test(away, total, MARGINS["majority"], "less"))
        goals = ", ".join(f"goal {k} {n}" for k, n in enumerate((~agrees).sum(axis=0), 1) if n)
        parts.append(f"{condition}: {away} of {total} runs ({goals or 'no goal'})")
    return replace(all_hold(tests, parts), against=tuple(against))


@decides("arm-coarticulation")
def _arm_prepares(data: Data) -> Finding:
    tests, parts = [], []
    for task in (ONE, TWO):
        for condition in ("EC3", "EC4"):
            own, following = _served(data.cell(task, LEARNER + condition))
            tests.append(exceeds(following, 0.0))
            parts.append(f"{task} {condition} {shown(following)} ticks, {shown(own)} ticks")
        for label in _CONTROLS:
            with suppress(MissingError):
                own, following = _served(data.cell(task, label))
                parts.append(f"{task} {label} {following.mean():.1f}, {own.mean():.1f}")
    before = (
        "gained on the way to the next goal, and spent more on the way to this one, against the "
        "posture in which the corrective process would have hit it, mean over goals: "
    )
    return all_hold(tests, parts, before)


def _served(cell: Trajectories) -> Array:
    """Means over goals of :func:`coartic.analysis.signatures.subtasks.served`, shape ``(2,
    runs)``."""
    gains = np.array([served(run) for run in cell.runs])
    if not np.isfinite(gains).all():
        raise MissingError(f"the corrective process alone misses a goal of {cell.task.name}")
    return np.asarray(gains.mean(axis=1).T)


def prepared_by_waiting(cell: Trajectories) -> Array:
    """How much nearer the waiting arm has brought its hand to its next goal, mean over goals.

    :func:`coartic.analysis.signatures.other_arm.preshaping` of each run, shape ``(runs,)``:
    0 where the arm keeps still. Runs that use one hand only are left out. Raises MissingError
    where the corrective process alone does not complete the task.
    """
    values = _by_goal(cell, since_hit=True)
    known = ~np.isnan(values)
    return np.asarray(np.nanmean(values[known.any(axis=1)], axis=1))


def _by_goal(cell: Trajectories, *, since_hit: bool) -> Array:
    """Preshaping of each run by goal, shape ``(runs, G)``."""
    initial = cell.initial
    if initial is None:
        raise MissingError(f"the corrective process alone does not complete {cell.task.name}")
    measure = preshaping if since_hit else readiness
    return np.array([measure(run, initial) for run in cell.runs])


def _goals(values: Array) -> str:
    """Means by goal, of the goals that have one."""
    known = [(k, row[~np.isnan(row)]) for k, row in enumerate(values.T, 1)]
    return ", ".join(f"goal {k} {row.mean():+.2f}" for k, row in known if len(row))


@decides("other-arm-coarticulation")
def _other_arm_prepares(data: Data) -> Finding:
    moving, still = (data.cell(ONE, LEARNER + condition) for condition in ("EC4", "EC3"))
    own = prepared_by_waiting(moving)
    if len(own) < FEWEST:
        raise MissingError(f"fewer than {FEWEST} runs of EC4 on {ONE} use both hands")
    parts = [
        f"what the waiting arm does under EC4 brings its hand nearer by "
        f"{shown(own, '.2f')} of the initial distance "
        f"({_goals(_by_goal(moving, since_hit=True))})",
        "with the base and the posture that its last hit left, it is nearer than in the initial "
        f"solution by {_goals(_by_goal(moving, since_hit=False))} under EC4, by "
        f"{_goals(_by_goal(still, since_hit=False))} under EC3, where that arm cannot move",
    ]
    for label in _CONTROLS:
        with suppress(MissingError):
            control = prepared_by_waiting(data.cell(ONE, label))
            if len(control):
                parts.append(f"{label}, by waiting: {control.mean():.2f}")
    return all_hold([exceeds(own, 0.0)], parts)
