"""Claims on families of random tasks, on planted rewards and signatures."""

import importlib
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from coartic.analysis.methods import EC2, EC4, RANDOM_SEARCH
from tests.support.made_up import MadeUp
from tests.support.processes import programs
from tests.test_random_tasks import ALONE, ONE, RISING, TWO, rewarded

programs("replication", "study")
claims, reader = map(importlib.import_module, ("claims", "reader"))


def with_signatures(study, of_random_search=0.5):
    """A study whose runs are not executed: their signatures are made up, those of random search as
    a share of the learner's, more by a little."""

    def signature(name, task, label, *, replay=False):
        number = int(task[-3:])
        values = {
            "arm": [2.0, 3.0 + 0.1 * number],
            "first": [5.0, 6.0 + 0.1 * number],
            "whole": [9.0, 8.0 + 0.1 * number],
        }
        if len(study.tasks[task].hands) > 1:
            values["hand"] = [1.0, 1.0, 1.0 - 0.1 * (number == 0)]
            values["other arm"] = [0.3 + 0.01 * number]
        shown = np.array(values.get(name, ()))
        if label == RANDOM_SEARCH:
            shown = of_random_search * shown + 0.001 * (number - 2)
        return of_runs(study, task, label, shown)

    return MadeUp(study, **vars(study), signature=signature)


def of_runs(study, task, label, values):
    """Values of the first runs of a method on a task; the others have none."""
    return pd.Series(values, study.cells[task, label].index[: len(values)], dtype=float).reindex(
        study.cells[task, label].index
    )


@pytest.fixture(scope="module")
def rising():
    """Rewards of all conditions and of random search on eight instances of each family."""
    centres = {**RISING, EC4: lambda n: -540 - n, RANDOM_SEARCH: -580}
    return rewarded(centres, families=ONE + TWO, count=8)


def test_claims_of_generality(monkeypatch, rising):
    alone = SimpleNamespace(reward=ALONE, completed=True)
    monkeypatch.setattr(reader, "corrective_trial", lambda task, hands: alone)
    study = with_signatures(rising)
    of_signatures = ["other-arm-coarticulation-in-general", "arm-coarticulation-in-general"]
    supported = ["learning-improves-in-general", "proficiency-rises-in-general", *of_signatures,
                 "corrective-ensures-in-general"]  # fmt: skip
    entries = claims.judge_claims(study, [*supported, "beats-inaccurate-in-general"])
    for name in supported:
        assert entries.replicates[name] == "supported", entries.evidence[name]
    of_random_search = with_signatures(rising, of_random_search=1.0)
    # No more than random search shows:
    judged = claims.judge_claims(of_random_search, of_signatures)
    assert set(judged.more_than_one_selection) == {"undecided"}
    assert set(entries.more_than_one_selection[of_signatures]) == {"supported"}
    jerk = entries.evidence["beats-inaccurate-in-general"]
    assert "fewer than 3 instances of one-armed/v1" in jerk


def test_a_claim_that_one_family_does_not_judge_says_what_the_others_show(rising):
    """Random search improves on the corrective process on two tasks of a family alone."""
    study = with_signatures(rising)

    def signature(name, task, label, *, replay=False):
        if label == RANDOM_SEARCH and task.startswith("long/") and int(task[-1]) > 1:
            return of_runs(study, task, label, [])
        return study.signature(name, task, label)

    seen = MadeUp(study, **vars(study) | {"signature": signature})
    entry = claims.judge_claims(seen, ["arm-coarticulation-in-general"]).iloc[0]
    assert entry.more_than_one_selection == "undecided"
    assert "long/v1: 2.68 [" in entry.evidence  # the mean of 2, and 3 + n / 10, over n = 0 to 7
    said, _, shown = entry.evidence_beyond.partition(". ")
    assert said.endswith("can be judged of long/v1, more than random search")
    assert "aligned/v1, more than random search: 1.3" in shown
    assert "long/v1, more than random search" not in shown


def test_hands_are_learned_where_they_differ_from_the_closest(rising):
    """EC2 hits with the slower hand as often as hands are drawn: what counts is EC4 beyond it."""
    study = with_signatures(rising, of_random_search=0.1)

    def verdict(more):
        def signature(name, task, label, *, replay=False):
            if label not in (EC2, EC4):
                return study.signature(name, task, label)
            values = np.array([0.4, 0.6]) + (more + 0.01 * int(task[-1])) * (label == EC4)
            return of_runs(study, task, label, values)

        seen = MadeUp(study, **vars(study) | {"signature": signature})
        return claims.judge_claims(seen, ["hand-coarticulation-in-general"]).replicates.iloc[0]

    verdicts = [verdict(more) for more in (0.1, -0.2, -0.02)]
    assert verdicts == ["supported", "not supported", "undecided"]


def test_a_hypothesis_that_fails_in_one_family_does_not_hold_in_general():
    falling, mixed = (
        rewarded({**RISING, EC4: of_instance}, families=TWO, count=8)
        for of_instance in (lambda n: -570 - n, lambda n: -540 if n % 2 else -560)
    )
    names = [
        f"{name}-in-general" for name in ("other-arm-pays", "proficiency-rises", "random-hands-pay")
    ]
    assert set(claims.judge_claims(falling, names).replicates) == {"not supported"}
    assert claims.judge_claims(mixed, names[:1]).replicates.tolist() == ["undecided"]


def test_development_instances_are_not_judged():
    study = with_signatures(rewarded(RISING, families=ONE + TWO, split="d"))
    (entry,) = claims.judge_claims(study, ["other-arm-pays-in-general"]).itertuples()
    assert entry.replicates == "undecided"
    assert "has no instances of two-armed/v1 that can be judged" in entry.evidence
