"""What holds over instances of families: gaps, contrasts and signatures, on planted rewards."""

import numpy as np
import pandas as pd
import pytest

from coartic import load_task
from coartic.analysis import tables
from coartic.analysis.methods import EC1, EC2, EC3, EC4, RANDOM_SEARCH
from coartic.analysis.tables import instance_runs
from coartic.tasks.families import named_by
from coartic.tasks.optima import KnownOptimum
from tests.support.made_up import MadeUp, change_runs, made, runs_of, study_of

ONE, TWO = ("one-armed/v1",), ("two-armed/v1", "aligned/v1", "redundancy/v1", "long/v1")
FEW = (*ONE, "two-armed/v1", "long/v1")
"""Where no claim is judged, which is on all."""
COUNT = 5
INITIAL = "corrective-alone/given"
BEST, ALONE = -500, -600
NOISE = (-4, -2, 0, 2, 4)


def hands_of(name):
    return "R" * len(load_task(name).goals)


def learner(name, label, centre, *, noise=NOISE, **more):
    rewards, hands = [round(centre) + off for off in noise], hands_of(name)
    return runs_of(name, label, rewards, trials=10_000, initial_reward=ALONE, hands=hands,
                   replay_reward=rewards, failed_trials=0, **more)  # fmt: skip


def rewarded(centres, *, families=FEW, split="i", count=COUNT):
    """Rewards of conditions by label: a number, or a function of the instance's number."""
    rows, tasks, best = [], [], {}
    for family in families:
        for number, name in enumerate(named_by(f"{family}/{split}000..{split}{count - 1:03d}")):
            tasks.append(load_task(name))
            best[name] = KnownOptimum(BEST, BEST if number % 2 else BEST + 50)
            for label, centre in centres.items():
                if (label == EC1) == (family in ONE) or label in (INITIAL, RANDOM_SEARCH):
                    value = centre(number) if callable(centre) else centre
                    noise = (0,) if label == INITIAL else NOISE
                    rows += learner(name, label, value, noise=noise)
    sequences = {
        (task.name,): pd.DataFrame({"hands": [hands_of(task.name)], "reward": [ALONE]})
        for task in tasks
    }
    return study_of(rows, tasks, sequences=made(sequences), optima=best)


RISING = {INITIAL: ALONE, EC1: -540, EC2: -560, EC3: -550, EC4: -540}


def test_gaps_are_to_the_best_known_reward():
    study = rewarded(RISING, families=ONE + TWO)
    runs = instance_runs(study)
    gaps = runs[runs.task == "two-armed/v1/i000"].groupby("method").gap.mean()
    assert gaps["learner"] == pytest.approx(40 / 500)
    assert not {EC1, EC4} & {*gaps.index}
    assert not study.optima["two-armed/v1/i000"].proven
    assert study.optima["two-armed/v1/i001"].proven
    assert list(runs.family.unique()) == [*ONE, *TWO]


def test_gaps_have_intervals_in_each_family():
    study = rewarded({**RISING, EC4: lambda n: -540 - n}, families=TWO, count=8)
    row = dict(tables.list_family_gaps.rows(study))["learner"]
    for family in TWO:
        value, low, high = (row[f"in {family}{ending}"] for ending in ("", "_low", "_high"))
        assert value == pytest.approx((40 + 3.5) / 500)
        assert 40 / 500 < low < value < high < 47 / 500


def test_a_method_that_failed_on_an_instance_has_no_gap_in_its_family():
    study = rewarded(RISING, families=TWO)
    failed = (study.runs.task == "long/v1/i002") & (study.runs.label == EC4)
    change_runs(study, "reward", None, failed)
    again = MadeUp(study, optima=study.optima)
    table = pd.DataFrame(dict(tables.list_family_gaps.rows(again))).T
    row = table.loc["learner"]
    assert (row.instances, row.missing) == (len(TWO) * COUNT - 1, 1)
    assert np.isnan([row["gap"], row["in long/v1"]]).all()
    assert row["in aligned/v1"] == pytest.approx(40 / 500)
    assert table.missing[[EC2, EC3]].tolist() == [0, 0]
