"""How far methods end from the optimum, who is ahead, and what it costs: by hand."""

import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from coartic import load_task
from coartic.analysis.comparisons.methods import BY_TRIAL
from coartic.analysis.comparisons.reached import WAY, Targets, targets
from coartic.analysis.comparisons.standings import (
    ALL_TASKS,
    apart_p,
    ends,
    gaps,
    leaders,
    standings,
)
from coartic.analysis.statistics.across_tasks import gap_share, task_mean
from tests.support.made_up import MadeUp, fake_study, made_up_optima, row, study_of


def study(rewards):
    """Runs of methods by task: ``{(task, method): rewards}``."""
    rows = [
        row(method, reward, task=task, run=k, seed=100 + k)
        for (task, method), own in rewards.items()
        for k, reward in enumerate(own)
    ]
    runs = pd.DataFrame(rows).astype({"reward": "Int64", "proven_bound": "Int64"})
    names = list(dict.fromkeys(runs.task))
    made_up = study_of(runs, [load_task(name) for name in names])
    return MadeUp(made_up, optima=made_up_optima(*names))


def test_gaps_of_a_results_folder():
    """From the initial solution of two-armed-1 to its optimum."""
    assert gap_share([-300, -303], -300).tolist() == [0, 0.01]
    runs = {
        "run": [0, 1], "seed": [7, 8], "status": ["ok", "infeasible"], "reason": ["", "planted"],
        "reward": [-520, None], "hands": ["RRLR", None], "initial_reward": [-675, None],
    }  # fmt: skip
    results = fake_study(runs)
    optima = made_up_optima("two-armed-1")
    seen = MadeUp(results, optima=optima)
    optimum = optima["two-armed-1", "free"].reward
    assert ends(seen) == {"two-armed-1": (-675.0, optimum)}
    first, second = gaps(seen).gap
    assert first == pytest.approx((optimum + 520) / -optimum)
    assert math.isnan(second)
    missed = {("two-armed-1", "free"): replace(optima["two-armed-1", "free"], reward=-680)}
    below = MadeUp(results, optima=missed)  # below the initial solution
    assert gaps(below).empty


def test_strata_are_resampled_within_themselves():
    """Tasks far apart add no width to the interval of their mean."""
    rng = np.random.default_rng(31)
    runs = rng.normal(0, 1, (4, 20))
    apart = {task: 100 * i + runs[i] for i, task in enumerate("abcd")}
    found = task_mean(apart)
    assert found.estimate == pytest.approx(np.mean([own.mean() for own in apart.values()]))
    error = math.sqrt(sum(own.var() / 20 for own in runs)) / 4
    assert found.high - found.low == pytest.approx(2 * 1.96 * error, rel=0.1)
    assert task_mean({"a": [1.0] * 4, "b": [5.0] * 40}).estimate == 3.0  # each counts the same


LEARNER = {("ascending", "dual-process/EC1"): [-300, -301, -302, -303],
           ("two-armed-1", "dual-process/EC4"): [-480, -481, -482, -483]}  # fmt: skip
CMA = {("ascending", "cma-es/bandit"): [-293, -294, -293, -294],
       ("two-armed-1", "cma-es/bandit"): [-466, -467, -468, -466]}  # fmt: skip


def test_the_learners_conditions_stand_together():
    found = standings(study(LEARNER | CMA))
    over = found[found.task == ALL_TASKS]
    assert over.method.tolist() == ["cma-es/bandit", "dual-process (EC1, EC4)"]
    by_task = [(301.5 - 292) / 292, (481.5 - 465) / 465]
    assert over.gap.iloc[1] == pytest.approx(np.mean(by_task))
    assert over.algorithm.tolist() == ["CMA-ES", "learner"]
    assert (over.low < over.gap).all()
    assert (over.gap < over.high).all()


def test_a_rank_counts_algorithms():
    every = {(task, "cma-es/every"): own for (task, _), own in CMA.items()}
    seen = study(LEARNER | CMA | every)
    rows = leaders(seen, BY_TRIAL)
    assert rows.algorithm.tolist() == ["CMA-ES", "learner"]
    assert math.isnan(rows.p[0])
    # Eight pairs, all in favour of the first: of 2^8 signs two are as extreme.
    assert rows.p[1] == pytest.approx(2 / 2**8, abs=0.003)
    assert apart_p(seen, "cma-es/bandit", "cma-es/every") == 1.0


def test_crossings_by_brute_force():
    """Budgets read off every run and target, one by one."""
    rng = np.random.default_rng(5)
    spends = [rng.lognormal(3, 1, (runs, 20)).round() for runs in (6, 9)]
    spends[1][rng.random(spends[1].shape) < 0.3] = math.inf
    found = Targets(spends)

    def share(budget):
        return np.mean([(own <= budget).mean() for own in spends])

    budgets = np.unique(np.concatenate([own.ravel() for own in spends]))
    for level in (0.1, 0.25, 0.5, 0.9):
        least = next((b for b in budgets if share(b) >= level - 1e-12), math.inf)
        crossing = found.crossing(level)
        assert crossing.budget == least
        assert crossing.low <= least <= crossing.high or math.isinf(least)
    steps, shares = found.curve()
    for budget, at in zip(steps[::7], shares[::7], strict=True):
        assert at == pytest.approx(share(budget))
    assert found.share() == pytest.approx(share(1e300))
    assert math.isnan(Targets([spends[0][:2]]).crossing(0.5).low)  # too few runs


def test_targets_are_evenly_spaced_rewards():
    """A run that goes half of the way has reached half of the targets."""
    half = -319 + (319 - 292) / 2
    seen = study({("ascending", "posture-based/two-goals"): [math.ceil(half)] * 3})
    vars(seen)["rewards"] = lambda: iter(())
    found = targets(seen)["ascending", "posture-based/two-goals", "trials"]
    assert found.share() == pytest.approx(len([w for w in WAY if w <= 0.5]) / len(WAY), abs=0.051)
    assert found.crossing(0.25).budget == 10  # trials of the made-up row
