"""How far methods end from the optimum, who is ahead, and what it costs: by hand."""

import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from coartic import load_task
from coartic.analysis.comparisons.methods import BY_TRIAL, UNTOLD, group_of
from coartic.analysis.comparisons.reached import WAY, Targets, price, targets
from coartic.analysis.comparisons.standings import (
    ALL_TASKS,
    apart,
    gaps,
    initial_and_optimum,
    leaders,
    standings,
)
from coartic.analysis.optima import KnownOptimum
from coartic.analysis.statistics.estimates import SEED
from coartic.analysis.trajectories import initial_reward
from coartic.tasks.task import Penalty
from tests.support.made_up import MadeUp, fake_study, made_up_optima, row, study_of


def study(rewards):
    """Runs of methods by task: ``{(task, method): rewards}``."""
    rows = [
        row(method, reward, task=task, run=k, seed=100 + k)
        for (task, method), of_method in rewards.items()
        for k, reward in enumerate(of_method)
    ]
    runs = pd.DataFrame(rows).astype({"reward": "Int64", "proven_bound": "Int64"})
    names = list(dict.fromkeys(runs.task))
    made_up = study_of(runs, [load_task(name) for name in names])
    return MadeUp(made_up, optima=made_up_optima(*names))


def test_gaps_of_a_results_folder():
    """From the initial solution of two-armed-1 to its optimum."""
    runs = {
        "run": [0, 1], "seed": [7, 8], "status": ["ok", "infeasible"], "reason": ["", "planted"],
        "reward": [-520, None], "hands": ["RRLR", None], "initial_reward": [-675, None],
    }  # fmt: skip
    results = fake_study(runs)
    optima = made_up_optima("two-armed-1")
    seen = MadeUp(results, optima=optima)
    optimum = optima["two-armed-1"].reward
    assert initial_and_optimum(seen) == {"two-armed-1": (-675.0, optimum)}
    first, second = gaps(seen).gap
    assert first == pytest.approx((optimum + 520) / -optimum)
    assert math.isnan(second)
    missed = {"two-armed-1": replace(optima["two-armed-1"], reward=-680)}
    below = MadeUp(results, optima=missed)  # below the initial solution
    assert gaps(below).empty


LEARNER = {("ascending", "dual-process/EC1"): [-300, -301, -302, -303],
           ("two-armed-1", "dual-process/EC4"): [-480, -481, -482, -483]}  # fmt: skip
CMA = {("ascending", "cma-es/bandit"): [-293, -294, -293, -294],
       ("two-armed-1", "cma-es/bandit"): [-466, -467, -468, -466]}  # fmt: skip


def test_the_learners_conditions_stand_together():
    table = standings(study(LEARNER | CMA))
    over = table[table.task == ALL_TASKS]
    assert over.method.tolist() == ["cma-es/bandit", "dual-process (EC1, EC4)"]
    by_task = [(301.5 - 292) / 292, (481.5 - 465) / 465]
    assert over.gap.iloc[1] == pytest.approx(np.mean(by_task))
    assert over.algorithm.tolist() == ["CMA-ES", "learner"]
    assert (over.low < over.gap).all()
    assert (over.gap < over.high).all()


def test_a_rank_counts_algorithms():
    every = {(task, "cma-es/every"): rewards for (task, _), rewards in CMA.items()}
    seen = study(LEARNER | CMA | every)
    rows = leaders(seen, BY_TRIAL)
    assert rows.algorithm.tolist() == ["CMA-ES", "learner"]
    assert math.isnan(rows.p[0])
    # Eight pairs, all in favour of the first: of 2^8 signs two are as extreme.
    assert rows.p[1] == pytest.approx(2 / 2**8, abs=0.003)
    assert apart(seen, "cma-es/bandit", "cma-es/every").p == 1.0


def test_a_method_that_makes_one_trial_does_not_use_its_reward():
    """The corrective process alone is told of its only trial, and of every hand sequence."""
    alone = study({("ascending", "corrective-alone/given"): [-319]} | LEARNER)
    assert group_of(alone, "corrective-alone/given") == BY_TRIAL  # ten trials in made-up rows
    alone.runs.loc[alone.runs.method == "corrective-alone/given", "trials"] = 1
    again = MadeUp(alone, optima=made_up_optima("ascending", "two-armed-1"))
    assert group_of(again, "corrective-alone/given") == UNTOLD
    assert group_of(again, "dual-process (EC1, EC4)") == BY_TRIAL


def test_crossings_by_brute_force():
    """Budgets read off every run and target, one by one."""
    rng = np.random.default_rng(5)
    spends = [rng.lognormal(3, 1, (runs, 20)).round() for runs in (6, 9)]
    spends[1][rng.random(spends[1].shape) < 0.3] = math.inf
    reached = Targets(spends)

    def share(budget):
        return np.mean([(part <= budget).mean() for part in spends])

    budgets = np.unique(np.concatenate([part.ravel() for part in spends]))
    for level in (0.1, 0.25, 0.5, 0.9):
        least = next((b for b in budgets if share(b) >= level - 1e-12), math.inf)
        crossing = reached.crossing(level)
        assert crossing.value == least
        assert crossing.low <= least <= crossing.high or math.isinf(least)
        assert (crossing.low, crossing.high) == resampled_ends(spends, level)
    steps, shares = reached.curve()
    for budget, at in zip(steps[::7], shares[::7], strict=True):
        assert at == pytest.approx(share(budget))
    assert reached.share() == pytest.approx(share(1e300))
    assert math.isnan(Targets([spends[0][:2]]).crossing(0.5).low)  # too few runs


def resampled_ends(spends, level):
    """Percentiles of crossings, resample by resample, of runs drawn as often as they are there."""
    rng = np.random.default_rng(SEED)
    numbers = [len(part) for part in spends]
    counts = [rng.multinomial(runs, [1 / runs] * runs, size=1_999) for runs in numbers]
    budgets = np.append(np.unique(np.concatenate([part.ravel() for part in spends])), math.inf)
    within = [(part[..., None] <= budgets).mean(axis=1) for part in spends]
    shares = sum(
        count @ part / len(part) for count, part in zip(counts, within, strict=True)
    ) / len(spends)
    shares[:, -1] = 1.0
    crossed = budgets[(shares >= level - 1e-9).argmax(axis=1)]
    return tuple(np.quantile(crossed, [0.025, 0.975], method="inverted_cdf"))


def test_targets_are_evenly_spaced_rewards():
    """A run that goes half of the way has reached half of the targets."""
    half = -319 + (319 - 292) / 2
    seen = study({("ascending", "posture-based/two-goals"): [math.ceil(half)] * 3})
    vars(seen)["rewards"] = lambda: iter(())
    reached = targets(seen)["ascending", "posture-based/two-goals", "trials"]
    assert reached.share() == pytest.approx(len([w for w in WAY if w <= 0.5]) / len(WAY), abs=0.051)
    assert reached.crossing(0.25).value == 10  # trials of the made-up row
    paid = price(seen).loc["posture-based/two-goals"]
    assert (paid.task, paid.trials_to_quarter, paid.trials_to_half) == ("ascending", 10, 10)
    assert paid.reached == reached.share()


def test_the_initial_reward_loses_the_penalty():
    """It is the scale of targets, of gaps and of the table of learning."""
    plain = load_task("ascending")
    dear = plain.model_copy(update={"penalty": Penalty(joints=20.0, costly="base")})
    rows = row("dual-process/EC1", -350, task="ascending")
    best = {"ascending": KnownOptimum(-340, None)}
    seen = MadeUp(study_of(pd.DataFrame([rows]), [dear]), optima=best)
    without, initial = (initial_reward(task, seen.model) for task in (plain, dear))
    assert initial < -340 < without
    assert initial_and_optimum(seen) == {"ascending": (initial, -340)}
