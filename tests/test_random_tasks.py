"""What holds over instances of families: gaps, contrasts and signatures, on planted rewards."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from coartic import load_task
from coartic.analysis.claims import judging, reader
from coartic.analysis.claims.families import CLAIMS_ON_FAMILIES
from coartic.analysis.claims.judgements import CLAIMS, judge_claims, judgements
from coartic.analysis.methods import EC1, EC2, EC3, EC4, INITIAL, RANDOM_SEARCH
from coartic.analysis.report import about
from coartic.analysis.sections import random_tasks
from coartic.analysis.sections.random_tasks import solved
from coartic.analysis.signatures.measures import SIGNATURES
from coartic.analysis.study import one_by_one
from coartic.tasks.families import named_by
from coartic.tasks.optima import KnownOptimum
from tests.support.made_up import MadeUp, made, runs_of, study_of

ONE, TWO = ("one-armed/v1",), ("two-armed/v1", "aligned/v1", "redundancy/v1", "long/v1")
FEW = (*ONE, "two-armed/v1", "long/v1")
"""Where no claim is judged, which is on all."""
COUNT = 5
BEST, ALONE = -500, -600
NOISE = (-4, -2, 0, 2, 4)


@pytest.fixture(autouse=True)
def _fewer_resamples(monkeypatch):
    monkeypatch.setattr(judging, "RESAMPLES_OF_CLAIMS", 4_999)


def hands_of(name, letter="R"):
    return letter * len(load_task(name).goals)


def learner(name, label, centre, *, noise=NOISE, **more):
    rewards, hands = [round(centre) + off for off in noise], hands_of(name)
    return runs_of(name, label, rewards, trials=10_000, initial_reward=ALONE, hands=hands,
                   replay_reward=rewards, initial_hands=hands, failed_trials=0, **more)  # fmt: skip


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


def on(study, name, label):
    """Gaps of a method on an instance to the best known reward."""
    rows = solved(study)
    rows = rows[(rows.task == name) & (rows.method == label)]
    return rows.gap.item() if len(rows) else None


def test_gaps_are_to_the_best_known_reward():
    study = rewarded(RISING, families=ONE + TWO)
    name = "two-armed/v1/i000"
    gap = on(study, name, EC4)
    assert gap.mean() == pytest.approx(40 / 500)
    assert not study.optima[name].proven
    assert study.optima["two-armed/v1/i001"].proven
    assert on(study, name, EC1) is None
    assert (on(study, name, "dual-process (EC1, EC4)") == gap).all()
    assert list(solved(study).family.unique()) == [*ONE, *TWO]


def test_more_than_eight_instances_are_not_shown_singly():
    for count, shown in ((8, 8), (9, 0)):
        assert len(one_by_one(rewarded(RISING, families=ONE, count=count))) == shown


def made_up_signatures(study, hand=1.0, idle=0.3, of_random_search=0.5):
    """Signatures of the learner, and of random search: that share of them, more by a little."""
    by_cell = {}
    for name in study.tasks:
        for label in (EC1, EC2, EC3, EC4, RANDOM_SEARCH):
            if (name, label) in study.cells:
                number = int(name[-3:])
                values = {
                    "arm": np.array([2.0, 3.0 + 0.1 * number]),
                    "first": np.array([5.0, 6.0 + 0.1 * number]),
                    "whole": np.array([9.0, 8.0 + 0.1 * number]),
                }
                if len(study.tasks[name].hands) > 1:
                    values["hand"] = np.array([hand, hand, hand - 0.1 * (number == 0)])
                    values["other arm"] = np.array([idle + 0.01 * number])
                if label == RANDOM_SEARCH:
                    off = 0.001 * (number - 2)
                    values = {name: of_random_search * of + off for name, of in values.items()}
                by_cell[name, label] = values
    return by_cell


def with_signatures(study, **values):
    """A study whose runs are not executed: their signatures are made up."""
    by_cell = made_up_signatures(study, **values)
    signatures = {(name, *cell): of_cell.get(name, np.empty(0))
                  for cell, of_cell in by_cell.items() for name in SIGNATURES}  # fmt: skip
    with_hands = {cell: {"R": values} for cell, values in signatures.items() if len(values)}

    def by_hands(*cell, every=False):
        return with_hands.get(cell, {})

    parts = {"signature_of": made(signatures), "signature_by_hands": by_hands}
    return MadeUp(study, **vars(study), **parts)


def test_claims_of_generality(monkeypatch):
    alone = SimpleNamespace(reward=ALONE)
    monkeypatch.setattr(reader, "initial_solution", lambda task: alone)
    centres = {**RISING, EC4: lambda n: -540 - n, RANDOM_SEARCH: -580}
    study = with_signatures(rewarded(centres, families=ONE + TWO, count=12))
    entries = judgements(study)
    assert list(entries.index) == [claim.id for claim in CLAIMS_ON_FAMILIES]
    for name in (
        "learning-improves",
        "proficiency-rises",
        "other-arm-coarticulation",
        "arm-coarticulation",
    ):
        entry = entries.loc[f"{name}-in-general"]
        assert entry.verdict == "supported", entry.evidence
        assert entry.p_holm < 0.05
    of_random_search = with_signatures(rewarded(centres, families=ONE + TWO), of_random_search=1.0)
    of_signatures = [CLAIMS[f"{name}-in-general"] for name in ("other-arm-coarticulation",
                                                          "arm-coarticulation")]  # fmt: skip
    # No more than random search shows:
    assert set(judge_claims(of_random_search, of_signatures).verdict) == {"undecided"}
    assert entries.verdict["corrective-ensures-in-general"] == "supported"
    jerk = entries.loc["beats-inaccurate-in-general"]
    assert jerk.verdict == "undecided"
    assert "fewer than 3 instances of one-armed/v1" in jerk.evidence


def test_a_claim_that_one_family_does_not_judge_says_what_the_others_show():
    """Random search improves on the corrective process on two tasks of a family alone."""
    study = with_signatures(rewarded(RISING | {RANDOM_SEARCH: -580}, families=ONE + TWO, count=8))

    def by_hands(name, task, label, *, every=False):
        if label == RANDOM_SEARCH and task.startswith("long/") and int(task[-1]) > 1:
            return {}
        return study.signature_by_hands(name, task, label, every=every)

    seen = MadeUp(study, **vars(study) | {"signature_by_hands": by_hands})
    entry = judge_claims(seen, [CLAIMS["arm-coarticulation-in-general"]]).iloc[0]
    assert entry.verdict == "undecided"
    said, _, shown = entry.evidence.partition(". ")
    assert said.endswith("can be judged of long/v1, more than random search")
    assert "long/v1: 2.68 [" in shown  # the mean of 2, and 3 + n / 10, over n = 0 to 7
    assert "aligned/v1, more than random search: 1.3" in shown
    assert "long/v1, more than random search" not in shown


def test_gaps_have_intervals_in_each_family():
    study = rewarded({**RISING, EC4: lambda n: -540 - n}, families=TWO, count=8)
    row = dict(random_tasks.list_family_gaps.rows(study))[EC4]
    for family in TWO:
        value, low, high = (row[f"in {family}{ending}"] for ending in ("", "_low", "_high"))
        assert value == pytest.approx((40 + 3.5) / 500)
        assert 40 / 500 < low < value < high < 47 / 500


def test_hands_are_learned_where_they_differ_from_the_closest():
    """EC2 hits with the slower hand as often as hands are drawn: what counts is EC4 beyond it."""
    rewards = rewarded(RISING | {RANDOM_SEARCH: -580}, families=ONE + TWO, count=8)
    study = with_signatures(rewards, of_random_search=0.1)

    def verdict(more):
        def signature_of(name, task, label, *, replay=False):
            if label not in (EC2, EC4):
                return study.signature_of(name, task, label)
            return np.array([0.4, 0.6]) + (more + 0.01 * int(task[-1])) * (label == EC4)

        def by_hands(*cell, every=False):
            return {"": values} if len(values := signature_of(*cell)) else {}

        parts = {"signature_of": signature_of, "signature_by_hands": by_hands}
        seen = MadeUp(study, **vars(study) | parts)
        return judge_claims(seen, [CLAIMS["hand-coarticulation-in-general"]]).verdict.iloc[0]

    assert [verdict(more) for more in (0.1, -0.2, -0.02)] == [
        "supported", "not supported", "undecided",
    ]  # fmt: skip


def test_a_hypothesis_that_fails_in_one_family_does_not_hold_in_general():
    falling, mixed = (
        with_signatures(rewarded({**RISING, EC4: of_instance}, families=ONE + TWO, count=8))
        for of_instance in (lambda n: -570 - n, lambda n: -540 if n % 2 else -560)
    )
    claims = [
        CLAIMS[f"{name}-in-general"]
        for name in ("other-arm-pays", "proficiency-rises", "random-hands-pay")
    ]
    assert set(judge_claims(falling, claims).verdict) == {"not supported"}
    assert judge_claims(mixed, claims).verdict.iloc[0] == "undecided"


def test_development_instances_are_not_judged():
    centres = {**RISING, EC4: lambda n: -540 - n}
    entries = judgements(with_signatures(rewarded(centres, families=ONE + TWO, split="d")))
    assert set(entries.verdict) == {"undecided"}
    words = "has no instances of two-armed/v1 that can be judged"
    assert words in entries.evidence["other-arm-pays-in-general"]


@pytest.mark.parametrize(
    ("name", "to"),
    [("two-armed/v1/i000", "best known reward"), ("two-armed/v1/2030-000", "best of this folder")],
)
def test_what_only_a_folder_says_is_not_called_known(name, to):
    runs = (learner(name, label, 9 * ALONE, commit="") for label in (EC4, RANDOM_SEARCH))
    seen = study_of([run for of_label in runs for run in of_label])
    assert random_tasks.on_random_tasks(seen).startswith(f"Nearest to the {to}: ")
    assert len(about.limits(seen)["own"]) == (to == "best of this folder")
