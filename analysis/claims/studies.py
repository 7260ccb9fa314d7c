"""Rules of our own studies: how far ahead a planner looks, stops at goals, and wrong objectives.

Tests are over random tasks, each of which counts alike. Where a run that is compared is missing
on a task, or failed, that task is left out.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd

from coartic.analysis.claims.data import Data, MissingError
from coartic.analysis.claims.register import MARGINS, Claim, Finding
from coartic.analysis.generality.sample import sample
from coartic.analysis.methods import most_exploring
from coartic.analysis.signatures.signs import SIGNS
from coartic.analysis.statistics.estimates import FEWEST, Estimate, mean
from coartic.analysis.statistics.hypotheses import bootstrap_test
from coartic.analysis.statistics.instances import gap_share
from coartic.analysis.studies.objectives import TERMS, WHO, advantage
from coartic.analysis.study import CellRuns, Study, cached
from coartic.analysis.words import estimate
from coartic.motion.costs import joint_costs, segment_lengths
from coartic.tasks.task import MOST_GOALS

RESAMPLES_OF_STUDIES = 99_999
"""Resamples of a test, as many as on families of tasks: p-values are corrected over many claims."""
PLANNER = "receding-horizon"
ALL_GOALS = "all"
HORIZONS: tuple[int | str, ...] = (0, 1, 2, 3, 4, ALL_GOALS)
DEAR = ("base", "right-arm")
"""Joints that cost more than the others, where the claim on them is tested."""
STOPPING = "trajectory-optimisation/jerk"
"""What stops at goals, without words for its parameters."""


def reported(data: Data, name: str) -> bool:
    """Whether a task is one of those that methods were not tuned on."""
    return data.task(name).split != "development"


@cached
def gaps_by_horizon(study: Study) -> pd.DataFrame:
    """Gaps of the planner on every random task, a row for each: per cent of the shortest.

    Indexed by task, ``hands`` and ``costs``; columns :data:`HORIZONS`, missing where nothing was
    run and where the task has not so many goals ahead: a task with five has four at its first
    movement. Of ticks, over the best known of the task; with costly joints of the weighted path
    length that was executed, over the shortest of all runs with the same costs.
    """
    references = instances.references if (instances := sample(study)) else {}
    lengths: dict[tuple[str, str, str], dict[int, float]] = {}
    for cell, parameters in solved_cells(study, PLANNER):
        if cell.task in references:
            task, costly = study.tasks[cell.task], parameters["costs"]
            length = -float(cell.rewards[0])
            if costly != "none":
                costs = joint_costs(task.robot, costly, parameters["cost_factor"])
                (executed,) = study.trajectories(cell.task, cell.label).runs
                length = float(segment_lengths(executed.configurations, costs).sum())
            horizon = min(parameters["horizon"], len(task.goals) - 1)
            lengths.setdefault((cell.task, parameters["hands"], costly), {})[horizon] = length
    rows = {}
    for (name, hands, costly), by_horizon in lengths.items():
        last = len(study.tasks[name].goals) - 1
        if hands == "optimal":  # with all goals in view it is the same plan
            planned = lengths.get((name, "planned", costly), {})
            by_horizon.setdefault(last, planned.get(last, math.nan))
        shortest = -float(references[name].reward)
        if costly != "none":
            shortest = min(by_horizon.values())
        seen = [last if h == ALL_GOALS else int(h) for h in HORIZONS]
        there = [by_horizon.get(h, math.nan) if h <= last else math.nan for h in seen]
        rows[name, hands, costly] = 100 * (np.array(there) / shortest - 1)
    frame = pd.DataFrame.from_dict(rows, orient="index", columns=list(HORIZONS))
    frame.index = pd.MultiIndex.from_tuples(list(rows), names=["task", "hands", "costs"])
    return frame


def solved_cells(study: Study, method: str) -> Iterator[tuple[CellRuns, dict[str, Any]]]:
    """Cells of a method with a solved run, each with its parameters."""
    for cell in study.cells.values():
        if cell.method == method and len(cell.good):
            yield cell, json.loads(str(cell.good.parameters.iloc[0]))


def gaps_of(data: Data, hands: str = "planned", costs: str = "none") -> pd.DataFrame:
    """Gaps by horizon on the reported tasks, indexed by task."""
    gaps = gaps_by_horizon(data.study)
    places = gaps.index.to_frame()
    judged = places.task.map(lambda name: reported(data, name)).astype(bool)
    chosen = gaps[(places.hands == hands) & (places.costs == costs) & judged].copy()
    chosen = chosen.droplevel(["hands", "costs"])
    runs = data.study.runs
    data.run_ids.extend(runs[(runs.method == PLANNER) & runs.task.isin(chosen.index)].run_id)
    return chosen


def over_tasks(values: pd.Series, margin: float = 0.0) -> Estimate:
    """One-tailed test that the mean over tasks is above a margin; MissingError for too few."""
    there = values.dropna().to_numpy(dtype=np.float64)
    if len(there) < FEWEST:
        raise MissingError(f"fewer than {FEWEST} random tasks can be judged")
    return bootstrap_test(there, margin, resamples=RESAMPLES_OF_STUDIES)


def in_words(sentence: str, values: pd.Series) -> str:
    """A sentence with the mean over tasks and its interval, and with how many tasks there are."""
    there = values.dropna()
    seen = estimate(mean(there.to_numpy(dtype=np.float64)), 2)
    return f"{sentence.format(seen)} ({len(there)} tasks)"


def finding(parts: dict[str, tuple[pd.Series, float, int]]) -> Finding:
    """What is seen of values, by sentences that each have a place for a mean over tasks.

    With each: the values by task, a bound, and 1 where they should be above it, -1 below.
    """
    tests = tuple(over_tasks(sign * v, sign * bound) for v, bound, sign in parts.values())
    seen = [in_words(sentence, values) for sentence, (values, _, _) in parts.items()]
    return Finding(all(test.value > 0 for test in tests), one_sentence(seen), tests)


def one_sentence(parts: list[str]) -> str:
    """Parts of the evidence as one sentence."""
    words = "; ".join(parts)
    return f"{words[0].upper()}{words[1:]}."


def goals_ahead(study: Study, gaps: pd.DataFrame) -> pd.Series:
    """How many goals are ahead at the first movement, of each row of :func:`gaps_by_horizon`."""
    names = gaps.index.get_level_values("task")
    return pd.Series([len(study.tasks[name].goals) - 1 for name in names], gaps.index, dtype=int)


def judged_gaps(data: Data, claim: Claim, costs: str = "none") -> tuple[pd.DataFrame, pd.Series]:
    """Gaps by horizon as a claim takes them, and how many goals each task has ahead.

    A claim that is not counted takes goals that a task does not have for goals that gain nothing:
    beyond its last goal its gap is that with all goals in view.
    """
    gaps = gaps_of(data, costs=costs)
    ahead = goals_ahead(data.study, gaps)
    if not claim.uncounted:
        return gaps, ahead
    for h in HORIZONS[:-1]:
        gaps[h] = gaps[h].where(ahead >= h, gaps[ALL_GOALS])
    return gaps, pd.Series(MOST_GOALS, gaps.index)


def first_goal_ahead_gains_most(data: Data, claim: Claim) -> Finding:
    """one-tailed bootstrap test over random tasks of the difference of both gains"""
    gaps, ahead = judged_gaps(data, claim)
    gained, left = gaps[0] - gaps[1], gaps[1] - gaps[ALL_GOALS]
    sentence = "The first goal ahead gains {} points more than all others together"
    return finding({sentence: ((gained - left).where(ahead > 1), 0.0, 1)})


def further_goals_gain_little(data: Data, claim: Claim) -> Finding:
    """one-tailed bootstrap tests over random tasks of the gains against {gain:g} %"""
    (gaps, _), least = judged_gaps(data, claim), MARGINS["gain"]
    return finding(
        {
            "The second goal ahead gains {} points": (gaps[1] - gaps[2], least, 1),
            "the fourth gains {} points": (gaps[3] - gaps[4], least, -1),
        }
    )


def most_of_the_loss_is_posture(data: Data, _: Claim) -> Finding:
    """one-tailed bootstrap test over random tasks of the loss with given hands, less a share of \
the loss"""
    planned, given = gaps_of(data)[0], gaps_of(data, hands="optimal")[0]
    share = MARGINS["share_of_loss"]
    sentence = (
        "Without look-ahead the planner with given hands loses {} points more than "
        f"{share:.0%} of what it loses with its own"
    )
    return finding({sentence: (given - share * planned, 0.0, 1)})


def dear_joints_keep_the_horizon(data: Data, claim: Claim) -> Finding:
    """one-tailed bootstrap tests over random tasks of the gains against {gain:g} %, by costs"""
    parts, least = {}, MARGINS["gain"]
    for costs in DEAR:
        gaps, ahead = judged_gaps(data, claim, costs)
        dear = f"with a dear {costs.replace('-', ' ')}"
        parts[f"{dear} the second goal ahead gains {{}} points"] = gaps[1] - gaps[2], least, 1
        beyond = (gaps[4] - gaps[ALL_GOALS]).where(ahead > 4)
        parts[f"{dear} those beyond the fourth gain {{}} points together"] = beyond, least, -1
    return finding(parts)


def learner_behind_one_goal_ahead(data: Data, _: Claim) -> Finding:
    """one-tailed bootstrap test over random tasks of the difference of the gaps"""
    gaps = gaps_of(data)
    instances = sample(data.study)
    assert instances is not None  # or there would be no gaps
    learner = {}
    for name in gaps.index:
        label = most_exploring(data.task(name))
        cell = data.study.cells.get((name, label))
        if cell is not None and len(cell.good):
            share = gap_share(cell.rewards, instances.references[name].reward)
            learner[name] = 100 * float(share.mean())
            data.run_ids.extend(cell.good.run_id)
    behind = pd.Series(learner, dtype=np.float64) - gaps[1]
    sentence = "The learner loses {} points more than the planner with one goal ahead"
    return finding({sentence: (behind, MARGINS["gain"], 1)})


def served_next_goal(data: Data, timing: str, stop: int) -> pd.Series:
    """Ticks by which postures leave the next goal nearer, on each reported random task."""
    values = {}
    for cell, parameters in solved_cells(data.study, STOPPING):
        asked = (parameters["timing"], parameters["stop"], parameters["stop_every"])
        drawn = data.task(cell.task).family is not None
        if drawn and reported(data, cell.task) and asked == (timing, stop, 1):
            nearer = SIGNS["arm"].of(data.study.trajectories(cell.task, cell.label))
            data.run_ids.extend(cell.good.run_id)
            if len(nearer):
                values[cell.task] = float(nearer.mean())
    return pd.Series(values, dtype=np.float64)


def postures_serve_after_a_stop(data: Data, _: Claim) -> Finding:
    """one-tailed bootstrap tests over random tasks, with free and with equal times"""
    least = MARGINS["ticks"]
    return finding({
        f"Ticks by which postures leave the next goal nearer, {timing} times: {{}}": (
            served_next_goal(data, timing, 1), least, 1
        )
        for timing in ("free", "fixed")
    })  # fmt: skip


def stop_at_equal_times(data: Data, _: Claim) -> Finding:
    """one-tailed bootstrap test over random tasks of the difference, passing less full stop"""
    passing, stopping = (served_next_goal(data, "fixed", stop) for stop in (0, 1))
    return finding(
        {
            "Ticks by which postures leave the next goal nearer when passing than with "
            "a full stop, at equal times: {}": (passing - stopping, 0.0, 1),
        }
    )


def less_regret(data: Data, claim: Claim) -> Finding:
    """one-tailed bootstrap tests over random tasks that the first regrets less than the second by \
more than {regret:g} % of the best known reward"""
    tests = []
    by_pair: dict[str, list[str]] = {}
    for where, (first, second) in claim.cells.items():
        terms, _, weight = where.partition(" ")
        for term in TERMS if terms == "every" else (terms,):
            table = advantage(data.study, first, second, term)
            if len(table) < FEWEST or float(weight) not in table.columns:
                raise MissingError(f"this folder has too few tasks with {term} {weight}")
            values = np.array(table[float(weight)], dtype=np.float64)
            test = bootstrap_test(values, MARGINS["regret"], resamples=RESAMPLES_OF_STUDIES)
            tests.append(test)
            at = f"at weight {weight} ({TERMS[term]})" if float(weight) else "without a penalty"
            by_pair.setdefault(f"{WHO[first]} regrets less than {WHO[second]}", []).append(
                f"{estimate(mean(values), 1)} points {at} on {len(values)} random tasks"
            )
    data.run_ids.extend(data.study.runs.run_id)
    seen = one_sentence([f"{pair}: {', '.join(parts)}" for pair, parts in by_pair.items()])
    seen += " Points are per cent of the best known reward."
    return Finding(all(test.value > 0 for test in tests), seen, tuple(tests))
