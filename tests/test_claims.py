"""The claims register: verdicts on planted findings, and on runs of its own."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from coartic import corrective_trial, load_task, trajectory
from coartic.analysis.claims import (
    CLAIMS,
    Claim,
    Finding,
    MissingError,
    general,
    judge,
)
from coartic.analysis.claims.data import FREE
from coartic.analysis.claims.general import shortest_reach
from coartic.analysis.claims.page import SENTENCES, page
from coartic.analysis.claims.power import powers
from coartic.analysis.claims.presence import REPRESENTATIVES
from coartic.analysis.claims.reconstructions import held_by
from coartic.analysis.claims.statements import MARGINS, REASONS, Said
from coartic.analysis.published import published_cells
from coartic.analysis.report.document import Estimate
from coartic.analysis.report.formats.markdown import markdown
from coartic.analysis.report.pages.claims import claims_document
from coartic.analysis.results.folder import Results
from coartic.analysis.signatures.context import context_dependence, dependence_below
from coartic.analysis.signatures.rows import Place, SignatureRow
from coartic.analysis.signatures.subtasks import isolated_reach, served
from coartic.analysis.signatures.trajectories import Trajectories
from coartic.analysis.statistics.estimates import Inference, mean
from coartic.analysis.statistics.hypotheses import bootstrap_test
from coartic.analysis.study import Study
from coartic.analysis.words import interval
from coartic.benchmarks.suites import Cell
from tests.support.made_up import MadeUp, manifest_for, replanned, row
from tests.support.strategies import as_released, changed
from tests.support.suites import KNOWN, ROOT, InProcess, run_and_write

NOTHING = Results(None, manifest_for([]), pd.DataFrame(), pd.DataFrame())


def test(p):
    return Inference(1.0, (20,), "planted", p=p)


def planted(holds, *p, rule="tested", ids=("r",), against=None, **more):
    def decide(data):
        data.run_ids.extend(ids)
        contrary = None if against is None else tuple(map(test, against))
        return Finding(holds, "planted", tuple(map(test, p)), contrary)

    return Claim("planted", "It is so.", "General", rule, "planted", decide, place="here", **more)


test.__test__ = False


@pytest.mark.parametrize(
    ("claim", "verdict"),
    [
        (planted(True, 0.001), "supported"),
        (planted(True), "supported"),
        (planted(True, float("nan")), "supported"),  # no spread, no doubt
        (planted(True, 0.2), "cannot tell"),
        (planted(True, 0.001, 0.2), "cannot tell"),
        (planted(False, 0.7), "cannot tell"),
        (planted(False, 0.97), "not supported"),
        (planted(False, 0.94), "cannot tell"),
        (planted(False, 0.001, 0.99), "not supported"),
        (planted(False, 0.5, 0.97), "cannot tell"),  # the contrary of one of two
        (planted(False, 0.7, against=[0.01]), "not supported"),
        (planted(False, 0.7, against=[0.06]), "cannot tell"),
        (planted(False, 0.99, against=[]), "cannot tell"),  # a test without a contrary side
        (planted(True, 0.2, against=[0.01]), "cannot tell"),
        (planted(False), "not supported"),
        (planted(None), "cannot tell"),
        (planted(True, 0.001, ids=()), "cannot tell"),
        (planted(None, rule="measured"), "measured"),
        (planted(True, 0.2, rule="measured"), "measured"),
    ],
)
def test_verdicts(claim, verdict):
    (judged,) = judge(Study(NOTHING), [claim])
    assert judged.verdict == verdict


def test_p_values_are_the_largest_of_a_claim_corrected_over_the_claims():
    """0.03 alone is significant, and is not beside two others (Holm 1979)."""
    claims = [
        planted(True, 0.03),
        planted(True, 0.001),
        planted(True, 0.02, 0.04),
        planted(None, 0.9, rule="measured"),  # no part of the family
        planted(True, rule="counted"),  # neither
    ]
    judged = judge(Study(NOTHING), claims)
    assert judged.pop().verdict == "supported"
    assert [entry.p for entry in judged[:3]] == [0.03, 0.001, 0.04]
    assert [entry.adjusted_p for entry in judged[:3]] == pytest.approx([0.06, 0.003, 0.06])
    assert np.isnan([judged[3].p, judged[3].adjusted_p]).all()
    verdicts = [entry.verdict for entry in judged]
    assert verdicts == ["cannot tell", "supported", "cannot tell", "measured"]


def test_a_claim_that_is_not_judged_counts_in_its_family():
    """As one with p = 1: what else was run changes no verdict."""
    claims = [planted(True, 0.02), planted(True, 0.001), planted(True, 0.03, ids=())]

    def missing(data):
        raise MissingError("not run")

    claims[2] = Claim("m", "It is so.", "General", "tested", "planted", missing, place="here")
    judged = judge(Study(NOTHING), claims)
    assert [entry.adjusted_p for entry in judged[:2]] == pytest.approx([0.04, 0.003])
    # Claims on runs beside the paper's cells are a family of their own.
    beside = [planted(True, 0.0001, beside=True) for _ in range(9)]
    same = judge(Study(NOTHING), [*claims, *beside])
    assert [entry.adjusted_p for entry in same[:2]] == [entry.adjusted_p for entry in judged[:2]]
    assert same[-1].adjusted_p == pytest.approx(0.0009)


def test_contraries_are_corrected_over_the_claims_too():
    claims = [planted(False, 0.96), planted(False, 0.975), planted(False, 0.999)]
    judged = judge(Study(NOTHING), claims)
    verdicts = [entry.verdict for entry in judged]
    assert verdicts == ["cannot tell", "cannot tell", "not supported"]
    assert [entry.contrary_p for entry in judged] == pytest.approx([0.0401, 0.0251, 0.0011])
    expected = [0.0502, 0.0502, 0.0033]
    assert [entry.adjusted_contrary_p for entry in judged] == pytest.approx(expected)


def learner(task, condition, rewards, hands="LRLR", initial=-671, trials=10_000, **more):
    """Planted runs of one cell; ``hands`` one for all or one each."""
    sequences = [hands] * len(rewards) if isinstance(hands, str) else hands
    return [
        row(
            f"dual-process/{condition}", reward, task=task, run=k, trials=trials,
            initial_reward=initial, replay_reward=reward, **{"hands": sequence, **more},
        )
        for k, (reward, sequence) in enumerate(zip(rewards, sequences, strict=True))
    ]  # fmt: skip


SEQUENCES = {
    "two-armed-1": {"LRLR": -533, "RRRR": -671, "LLLL": -727},
    "two-armed-2": {"RRRR": -357, "RLRR": -357},
}


def planted_results(rows, tmp_path, sequences=SEQUENCES, tasks=()):
    runs = pd.DataFrame(rows).astype({"reward": "Int64", "proven_bound": "Int64"})
    own = {task.name: task for task in tasks}
    known = {
        name: own[name] if name in own else load_task(name) for name in runs.task.unique()
    } | own
    table = [
        {"task": task, "hands": hands, "reward": reward}
        for task, rewards in sequences.items()
        for hands, reward in rewards.items()
    ]
    return Results(tmp_path, manifest_for(known.values(), runs), runs, pd.DataFrame(table))


def verdict_of(claim, study):
    (wanted,) = [entry for entry in CLAIMS if entry.id == claim]
    (judged,) = judge(study, [wanted])
    return judged


LOW = [-610, -612, -608, -611, -609, -613, -607, -610]
MIDDLE = [-505, -503, -507, -504, -506, -508, -502, -505]
HIGH = [-484, -482, -486, -483, -485, -487, -481, -484]
WORSE = [-350, -351, -352, -353, -351, -350, -352, -354]
BETTER = [-330, -331, -332, -333, -331, -330, -332, -334]
T1, T2 = "two-armed-1", "two-armed-2"
RRLR = ["RRLR"] * 8 + ["RRRR"] * 8
TWENTY = [-505 - k % 5 for k in range(20)]
MIXED = ["RLRR"] * 8 + ["RRRR"] * 8


def lrlr(count):
    return ["LRLR"] * count + ["RRRR"] * (20 - count)


def second(ec3, ec4, hands3="RRRR", hands4="RLRR"):
    return learner(T2, "EC3", ec3, hands3, -357) + learner(T2, "EC4", ec4, hands4, -357)


@pytest.mark.parametrize(
    ("claim", "rows", "verdict"),
    [
        ("ec3-beats-exhaustive", learner(T1, "EC3", MIDDLE), "supported"),
        ("ec3-beats-exhaustive", learner(T1, "EC3", LOW), "not supported"),
        ("ec3-beats-exhaustive", learner(T1, "EC3", [-533, -600, -470]), "cannot tell"),
        ("ec3-alternates", learner(T1, "EC3", MIDDLE * 3), "supported"),
        ("ec3-alternates", learner(T1, "EC3", MIDDLE * 3, "RRLR"), "not supported"),
        ("ec3-alternates", learner(T1, "EC3", MIDDLE[:4]), "cannot tell"),
        # More than three quarters of all: 19 of 20 has p = 0.024, 18 of 20 has 0.09.
        ("ec3-alternates", learner(T1, "EC3", TWENTY, lrlr(19)), "supported"),
        ("ec3-alternates", learner(T1, "EC3", TWENTY, lrlr(18)), "cannot tell"),
        ("ec3-alternates", learner(T1, "EC3", TWENTY, lrlr(15)), "cannot tell"),
        # Fewer than that: 11 of 20 has p = 0.041, 12 of 20 has 0.10.
        ("ec3-alternates", learner(T1, "EC3", TWENTY, lrlr(12)), "cannot tell"),
        ("ec3-alternates", learner(T1, "EC3", TWENTY, lrlr(11)), "not supported"),
        (
            "ec4-beats-ec3",
            learner(T1, "EC3", MIDDLE) + learner(T1, "EC4", HIGH),
            "supported",
        ),
        (
            "ec4-beats-ec3",
            learner(T1, "EC3", HIGH) + learner(T1, "EC4", MIDDLE),
            "not supported",
        ),
        (
            "ec4-beats-ec3",
            learner(T1, "EC3", MIDDLE) + learner(T1, "EC4", MIDDLE[::-1]),
            "cannot tell",
        ),
        (
            "proficiency-rises",
            learner(T1, "EC2", LOW) + learner(T1, "EC3", MIDDLE) + learner(T1, "EC4", HIGH)
            + second(WORSE, BETTER),
            "supported",
        ),
        (
            "proficiency-rises",
            learner(T1, "EC2", HIGH) + learner(T1, "EC3", MIDDLE) + learner(T1, "EC4", HIGH)
            + second(WORSE, BETTER),
            "not supported",
        ),
        (
            "sequences-change",
            learner(T1, "EC2", LOW, "RRRR") + learner(T1, "EC3", MIDDLE)
            + learner(T2, "EC3", WORSE, ["RRRR"] * 7 + ["RLRR"], -357),
            "supported",
        ),
        (  # no run of task 2 leaves the initial hands
            "sequences-change",
            learner(T1, "EC2", LOW, "RRRR") + learner(T1, "EC3", MIDDLE)
            + learner(T2, "EC3", WORSE, "RRRR", -357),
            "cannot tell",
        ),
        (
            "sequences-change",
            learner(T1, "EC2", LOW, "RRRR") + learner(T1, "EC3", MIDDLE)
            + learner(T2, "EC3", WORSE * 4, "RRRR", -357),
            "not supported",
        ),
        (
            "sequences-change",
            learner(T1, "EC2", LOW * 4, "RRRR") + learner(T1, "EC3", MIDDLE * 4, "RRRR")
            + learner(T2, "EC3", BETTER, "RLRR", -357),
            "not supported",
        ),
        ("ec2-sequences", learner(T1, "EC2", LOW * 3, "RRRR"), "not supported"),
        ("ec2-sequences", learner(T1, "EC2", LOW, ["RRLR"] * 4 + ["RRRR"] * 4), "cannot tell"),
        ("half-choose-rlrr", learner(T2, "EC3", WORSE * 5, "RRRR", -357), "not supported"),
        ("half-choose-rlrr", learner(T2, "EC3", WORSE, ["RLRR", "RRRR"] * 4, -357),
         "cannot tell"),
        ("half-choose-rlrr", learner(T2, "EC3", WORSE * 5, ["RLRR", "RRRR"] * 20, -357),
         "supported"),
        # A tenth: too few, but not told from 9 of 20 where there are so few runs.
        ("half-choose-rlrr", learner(T2, "EC3", WORSE, ["RLRR"] + ["RRRR"] * 7, -357),
         "cannot tell"),
        ("half-choose-rlrr", learner(T2, "EC3", WORSE * 5, ["RLRR"] * 4 + ["RRRR"] * 36, -357),
         "not supported"),
        ("ec2-rrlr-better", learner(T1, "EC2", MIDDLE + LOW, RRLR), "supported"),
        ("ec2-rrlr-better", learner(T1, "EC2", LOW + MIDDLE, RRLR), "not supported"),
        ("ec2-rrlr-better", learner(T1, "EC2", LOW, "RRRR"), "cannot tell"),
        ("ec2-improves", learner(T1, "EC2", MIDDLE + LOW, RRLR), "supported"),
        ("ec2-improves", learner(T1, "EC2", MIDDLE + LOW, RRLR, initial=-500), "not supported"),
        ("ec2-unreliable", learner(T1, "EC2", MIDDLE + LOW, RRLR), "supported"),
        ("ec2-unreliable", learner(T1, "EC2", MIDDLE * 3, "RRLR"), "not supported"),
        ("ec2-unreliable", learner(T1, "EC2", MIDDLE, "RRLR"), "cannot tell"),
        (
            "ec3-better-than-ec2",
            learner(T1, "EC2", MIDDLE + LOW, RRLR) + learner(T1, "EC3", HIGH), "supported",
        ),
        (  # not what the paper compares: nothing learned RRLR
            "ec3-better-than-ec2",
            learner(T1, "EC2", LOW, "LLLR") + learner(T1, "EC3", HIGH), "cannot tell",
        ),
        (  # better than all runs of EC2 together, but not than those with RRLR
            "ec3-better-than-ec2",
            learner(T1, "EC2", HIGH + LOW, RRLR) + learner(T1, "EC3", MIDDLE), "not supported",
        ),
        ("ec3-as-exhaustive", learner(T1, "EC3", MIDDLE * 3), "supported"),
        ("ec3-as-exhaustive", learner(T1, "EC3", MIDDLE * 3, "RRLR"), "not supported"),
        ("ec3-as-exhaustive", learner(T1, "EC3", TWENTY, lrlr(10)), "not supported"),
        ("rlrr-better", learner(T2, "EC3", BETTER + WORSE, MIXED, -357), "supported"),
        ("rlrr-better", learner(T2, "EC3", WORSE + BETTER, MIXED, -357), "not supported"),
        ("ec3-departs", learner(T2, "EC3", BETTER, "RLRR", -357), "cannot tell"),  # a tie
        ("ec3-departs", learner(T2, "EC3", BETTER, "RLLR", -357), "supported"),
        ("ec4-keeps-lrlr", learner(T1, "EC4", HIGH * 3), "supported"),
        ("ec4-keeps-lrlr", learner(T1, "EC4", HIGH * 3, "RRLR"), "not supported"),
        ("ec4-mixed", learner(T2, "EC4", WORSE + BETTER, MIXED, -357), "supported"),
        ("ec4-mixed", learner(T2, "EC4", WORSE, "RLRR", -357), "not supported"),
    ],
)  # fmt: skip
def test_judges_on_planted_runs(claim, rows, verdict, tmp_path):
    judged = verdict_of(claim, Study(planted_results(rows, tmp_path)))
    assert judged.verdict == verdict, judged.evidence


def seven(replays):
    cells = [
        ("ascending", "EC1", -319), ("descending", "EC1", -333), (T1, "EC2", -671),
        (T1, "EC3", -671), (T1, "EC4", -671), (T2, "EC3", -357), (T2, "EC4", -357),
    ]  # fmt: skip
    return [
        entry
        for task, condition, initial in cells
        for entry in learner(task, condition, [initial + r for r in replays], initial=initial)
    ]


def test_learning_that_does_not_last_is_not_supported(tmp_path):
    """The best of all trials is never below the first; what is kept may be."""
    for replays, verdict in (
        ([9, 10, 11, 12], "supported"),
        ([-9, -10, -11, -12], "not supported"),
        ([-9, 10, -11, 12], "cannot tell"),
    ):
        study = Study(planted_results(seven(replays), tmp_path))
        for which in ("one", "two"):
            assert verdict_of(f"learning-improves-{which}-armed", study).verdict == verdict


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        (
            learner(T1, "EC3", MIDDLE, trials=3000),
            "not judged: the paper's runs have 10000 trials",
        ),
        (learner(T1, "EC3", MIDDLE[:2]), "fewer than 3 runs"),
        (
            learner(T1, "EC3", MIDDLE)[:-1] + learner(T1, "EC3", MIDDLE, status="crashed")[-1:],
            "not judged: 1 of 8 runs of dual-process/EC3 on two-armed-1 failed",
        ),
    ],
)
def test_runs_that_are_not_like_the_papers_are_not_judged(rows, words, tmp_path):
    judged = verdict_of("ec3-alternates", Study(planted_results(rows, tmp_path)))
    assert judged.verdict == "cannot tell"
    assert words in judged.evidence


def test_what_the_folder_lacks_is_said():
    def decide(data):
        raise MissingError("this folder has no runs of dual-process/EC1 on ascending")

    (judged,) = judge(Study(NOTHING), [Claim("c", "s", "General", "tested", "t", decide)])
    assert judged.verdict == "cannot tell"
    assert (
        judged.evidence == "not judged: this folder has no runs of dual-process/EC1 on ascending"
    )
    assert judged.run_ids == ()


@pytest.mark.parametrize(
    ("claim", "task", "rewards", "verdict"),
    [
        ("right-hand-better", T1, {"RRRR": -671, "LLLL": -727}, "measured"),
        ("right-hand-better", T1, {"RRRR": -727, "LLLL": -671}, "not supported"),
        ("right-hand-better", T1, {"RRRR": -727}, "cannot tell"),
        ("best-is-rrrr", T2, {"RRRR": -357, "RLRR": -360}, "measured"),
        ("best-is-rrrr", T2, {"RRRR": -357, "RLRR": -357}, "cannot tell"),
        ("best-is-rrrr", T2, {"RRRR": -357, "RLRR": -350}, "not supported"),
        ("ec3-departs", T2, {"RRRR": -350, "LLLL": -360}, "not supported"),
    ],
)
def test_judges_on_planted_sequences(claim, task, rewards, verdict, tmp_path):
    rows = learner(task, "EC3", MIDDLE, "RRRR")
    study = Study(planted_results(rows, tmp_path, {task: rewards}))
    assert verdict_of(claim, study).verdict == verdict


def test_in_how_many_reconstructions_claims_hold():
    """What the ensembles' members judge has its counts; what goals were admitted by has none."""
    selected = {claim.id for claim in CLAIMS if claim.selected}
    assert selected == {"right-hand-better", "initial-base-reverses", "best-is-rrrr"}
    held = {claim.id: held_by(claim.id) for claim in CLAIMS}
    assert not any(held[name] for name in selected)
    assert not any(held[claim.id] for claim in CLAIMS if not claim.fitted)
    judged = [claim for claim in CLAIMS if held[claim.id]]
    assert {"ec3-alternates", "ec2-sequences", "half-choose-rlrr"} <= {c.id for c in judged}
    for claim in judged:
        for each in held[claim.id]:
            assert each.members >= 200
            assert 0 <= each.supported <= each.members - each.refuted
            assert each.task in claim.reconstructions


def test_the_base_reverses_where_goals_lie_back_and_forth(tmp_path):
    rows = learner(T1, "EC3", MIDDLE)
    judged = verdict_of("initial-base-reverses", Study(planted_results(rows, tmp_path)))
    assert judged.holds
    assert judged.verdict == "measured"  # goals were admitted by it: no support
    assert judged.run_ids == ()
    assert judged.sources == ("the corrective process on two-armed-1",)
    forth = changed(T1, goals=[[4.0, 2.0], [6.0, 2.0], [8.0, 2.0], [10.0, 2.0]])
    study = Study(planted_results(rows, tmp_path, tasks=[forth]))
    assert verdict_of("initial-base-reverses", study).verdict == "not supported"


def test_corrections_early_and_late(tmp_path):
    """Counts of runs differ around a drift that is there in some of the cells, or in none."""
    for drift, verdict in ((40, "supported"), (-40, "not supported"), (0, "cannot tell")):
        rows = [
            {
                **entry,
                "early_corrections": 2000 + drift + 9 * (k % 5),
                "late_corrections": 2000 + 9 * (3 * k % 5),
            }
            for k, entry in enumerate(seven([9, 10, 11, 12, 13]))
        ]
        study = Study(planted_results(rows, tmp_path))
        for which in ("one", "two"):
            judged = verdict_of(f"corrections-{which}-armed", study)
            assert judged.verdict == verdict
        # Of 999.9 trials with four goals; first and last tenth.
        early = np.mean([row["early_corrections"] for row in rows[-5:]]) / 3999.6
        assert f"two-armed-2 EC4 {early:.1%}" in judged.evidence


def ensured(failed=0):
    return [
        {**entry, "failed_trials": failed * (k == 5)} for k, entry in enumerate(seven([9, 10, 11]))
    ]


def test_a_failed_trial_or_sequence_is_found(tmp_path):
    every = {"ascending": {"RRR": -319}, "descending": {"RRR": -333}, **SEQUENCES}
    lacking = {**every, "descending": {"RRR": None}}
    for failed, sequences, one, two in (
        (0, every, "supported", "supported"),
        (1, every, "not supported", "supported"),
        (0, lacking, "not supported", "supported"),
    ):
        study = Study(planted_results(ensured(failed), tmp_path, sequences))
        assert verdict_of("corrective-ensures-one-armed", study).verdict == one
        assert verdict_of("corrective-ensures-two-armed", study).verdict == two


def test_the_shortest_reach():
    """Goal 1 of the ascending task lies 1.5 in line with the extended arm: 1.4 to its disc."""
    task = load_task("ascending")
    alone = corrective_trial(task, "RRR").configurations
    found = [
        shortest_reach(task, q, "right", goal, alone[goal - 1], seed=0)
        for goal, q in ((1, task.q0), (2, alone[0]))
    ]
    assert found[0] == pytest.approx(1.4)
    # No posture that hits goal 2 is nearer: sampled about the corrective process's.
    ways = np.random.default_rng(1).normal(0, 0.05, (20_000, task.robot.dof))
    ways[:, task.robot.joints("left")] = 0.0
    q = alone[1] + ways
    hit = (
        np.linalg.norm(
            task.robot.forward_kinematics(q, "right") - np.array(task.goals[1]), axis=-1
        )
        <= task.radius
    )
    assert hit.sum() > 1000
    least = np.linalg.norm(q[hit] - alone[0], axis=1).min()
    assert 0.9 * least < found[1] < least


def test_the_corrective_process_is_near_the_shortest_way(tmp_path, monkeypatch):
    """With the goals of the first release goal 2 of two-armed task 2 is 13 % off.

    The sum over its subtasks would hide that.
    """
    monkeypatch.setattr(general, "STARTS", 2)
    claims = [f"corrective-near-shortest-{which}-armed" for which in ("one", "two")]
    shipped = Study(planted_results(seven([9, 10, 11]), tmp_path))
    assert [verdict_of(claim, shipped).verdict for claim in claims] == ["supported"] * 2
    study = Study(planted_results(seven([9, 10, 11]), tmp_path, tasks=[as_released(T2)]))
    assert verdict_of(claims[0], study).verdict == "supported"
    two = verdict_of(claims[1], study)
    assert two.verdict == "not supported"
    assert "two-armed-2 +0.3%, +13.2%" in two.evidence
    monkeypatch.setitem(MARGINS, "close", 0.14)
    assert verdict_of(claims[1], study).verdict == "supported"
    monkeypatch.setitem(MARGINS, "close", 0.08)
    assert verdict_of(claims[0], study).verdict == "not supported"


BEST = (("ascending", "EC1"), ("descending", "EC1"), (T1, "EC4"), (T2, "EC4"))
PLANS = ("path-length", "squared-changes", "acceleration", "jerk")


MORE = "goals, forward kinematics, Jacobian"
SPREAD = (-1, 0, 1, 0, -1, 1)


def beside_plans(reward, plan, spent=1_000_000, *, spread=SPREAD, **more):
    """The learner near ``reward`` and plans at ``plan`` (one for all or by cost), everywhere."""
    rows = []
    for task, condition in BEST:
        rewards = [reward + k for k in spread]
        rows += learner(task, condition, rewards, forward_kinematics=spent, jacobians=0)
        rows += [
            row(
                f"trajectory-optimisation/{cost}",
                plan.get(cost, reward) if isinstance(plan, dict) else plan,
                task=task,
                **{
                    "trials": 0, "told": MORE, "forward_kinematics": 50_000, "jacobians": 50_000,
                    **more,
                },
            )
            for cost in PLANS
        ]  # fmt: skip
    return rows


JUST = {"squared-changes": -302, "acceleration": -300, "jerk": -300}
"""One plan a little worse than the learner: p of its test is 0.049, too much times six."""


@pytest.mark.parametrize(
    ("claim", "rows", "verdict"),
    [
        ("beats-inaccurate", beside_plans(-300, -310), "supported"),
        ("beats-inaccurate", beside_plans(-310, -300), "not supported"),
        ("beats-inaccurate", beside_plans(-300, -300), "cannot tell"),
        ("beats-inaccurate", beside_plans(-300, {**JUST, "squared-changes": -310}), "supported"),
        (
            "beats-inaccurate",
            beside_plans(-300, JUST, spread=(-3, -2, 3, 2, -1, 2)),
            "cannot tell",
        ),
        ("low-computation", beside_plans(-300, -300, 90_000), "measured"),
        ("less-experience", beside_plans(-300, -310), "measured"),
    ],
)
def test_judges_beside_planted_plans(claim, rows, verdict, tmp_path):
    study = Study(planted_results(rows, tmp_path))
    for which in ("one", "two"):
        judged = verdict_of(f"{claim}-{which}-armed", study)
        assert judged.verdict == verdict, judged.evidence


def with_paths(results, paths, **parts):
    """A study whose solutions are planted: runs by task and label."""
    tasks = Study(results).tasks
    trajectories = {
        (task, label): Trajectories(tasks[task], label, "", tuple(runs))
        for (task, label), runs in paths.items()
    }
    return MadeUp(results, trajectories=trajectories, **parts)


def at(q):
    return SimpleNamespace(execution=SimpleNamespace(configurations=q))


@pytest.mark.parametrize(
    ("share", "verdict"), [(0.2, "supported"), (0.7, "not supported"), (1.2, "not supported")]
)
def test_resemblance_is_half_the_initial_distance(share, verdict, tmp_path):
    rows, paths = [], {}
    for task in ("ascending", "descending"):
        rows += learner(task, "EC1", [-300] * 9, "RRR")
        rows.append(row("trajectory-optimisation/squared-changes", -300, task=task, hands="RRR"))
        initial = corrective_trial(load_task(task), "RRR").configurations
        planned = initial + 0.1
        paths[task, "trajectory-optimisation/squared-changes"] = [at(planned)]
        paths[task, "dual-process/EC1"] = [
            at(planned + (share + 0.01 * k) * (initial - planned)) for k in range(-4, 5)
        ]
    study = with_paths(planted_results(rows, tmp_path), paths)
    judged = verdict_of("resembles-squared-changes", study)
    assert judged.verdict == verdict
    assert judged.evidence.count(f"learned {share:.2f} [") == 2


@pytest.mark.parametrize(
    ("task", "quicker", "hands", "verdict"),
    [
        (load_task(T1), "left", "RRLR", "supported"),
        (load_task(T1), "left", "LRLR", "not supported"),
        (as_released(T1), "right", "LRLR", "supported"),
        (as_released(T1), "right", "RRLR", "not supported"),
    ],
)
def test_hands_that_serve_other_goals(task, quicker, hands, verdict, tmp_path):
    """Of two-armed task 1, from whose start one hand is quicker at goal 1, by its goals either."""
    first = {h: corrective_trial(task, h).ticks_by_goal()[0] for h in ("LLLL", "RRRR")}
    assert min(first, key=first.get)[0] == quicker[0].upper()
    run = trajectory(task, corrective_trial(task, hands).movements)
    labels = ["EC3", "EC4"]
    rows = [entry for label in labels for entry in learner(T1, label, MIDDLE, hands)]
    paths = {(T1, f"dual-process/{label}"): [run] * 8 for label in labels}
    study = with_paths(planted_results(rows, tmp_path, tasks=[task]), paths)
    judged = verdict_of("hand-coarticulation", study)
    assert judged.verdict == verdict, judged.evidence


def waiting(part, task):
    """At goal 2 the waiting left arm goes part of its way to the posture of goal 3."""
    q = corrective_trial(task, "LRLR").configurations.copy()
    left = task.robot.joints("left")
    q[1, left] += part * (q[2, left] - q[1, left])
    return SimpleNamespace(task=task, hands=("left", "right", "left", "right"), **vars(at(q)))


@pytest.mark.parametrize(
    ("part", "verdict"), [(0.5, "supported"), (-0.5, "not supported"), (0.0, "cannot tell")]
)
def test_the_other_arm_gets_ready(part, verdict, tmp_path):
    """Against 0, not against condition 3, whose arm is as near without having moved."""
    spread = 0.01 * np.array([-4, -3, -2, -1, 1, 2, 3, 4])
    task = load_task(T1)
    rows = learner(T1, "EC3", MIDDLE) + learner(T1, "EC4", HIGH)
    paths = {
        (T1, "dual-process/EC3"): [waiting(0.0, task)] * 8,
        (T1, "dual-process/EC4"): [waiting(part + s, task) for s in spread],
    }
    study = with_paths(planted_results(rows, tmp_path), paths)
    judged = verdict_of("other-arm-coarticulation", study)
    assert judged.verdict == verdict, judged.evidence
    left_at_goal_2 = [
        task.robot.forward_kinematics(corrective_trial(task, hands).configurations[1], "left")
        for hands in ("LRLR", "RRRR")
    ]
    here, initially = np.linalg.norm(left_at_goal_2 - np.array(task.goals[2]), axis=1)
    nearer = f"goal 2 {1 - here / initially:+.2f}"
    assert nearer in judged.evidence.split("under EC4")[-1]  # where EC3's hand is


def by_key(table):
    """Values of a table's rows by column, by the rows' keys."""
    names = [column.name for column in table.columns]
    return {row.key: dict(zip(names, row.values, strict=True)) for row in table.rows}


def signature(task, label, name, goal=None, value=0.0, **more):
    return SignatureRow(
        task=task, method=label, variant="", signature=name, place=Place(goal), value=value,
        **{"n": 20, **more},
    )  # fmt: skip


def shown(tmp_path, label, runs, *, apart=0.5, p=0.0001, ready=None, **sacrificed):
    """The row of a method among the shared signatures, from planted ones."""
    learned = "dual-process/EC1"
    rows = [
        entry
        for task in ("ascending", "descending")
        for entry in (
            *learner(task, "EC1", [-300, -301, -302], "RRR"),
            *(row(label, -300, task=task, run=k) for k in range(runs)),
        )
    ]
    paths = {}
    if ready is not None:
        rows += [row(label, -480, task=T1)]
        paths[T1, label] = [waiting(ready, as_released(T1))]
    planted = [
        signature("ascending", label, "context distance", 1, apart),
        signature("ascending", label, "context dependence", 1, 2.0, p=p),
        signature("ascending", label, "motor-equivalent part", 1, 0.2),
        signature("ascending", label, "non-motor-equivalent part", 1, 0.1),
        signature("ascending", label, "first subtask against the same hands", 1, 5.0),
        signature("ascending", label, "total against the same hands", None, -5.0),
        signature("ascending", label, "first subtask sacrificed", **sacrificed),
    ]
    results = planted_results(rows, tmp_path, tasks=[as_released(T1)])
    study = with_paths(results, paths, signature_rows=planted)
    judged = verdict_of("shared-signatures", study)
    (name,) = [name for name, *labels in REPRESENTATIVES if label in labels]
    assert learned in {one for _, one, _ in REPRESENTATIVES}
    return judged, by_key(judged.table)[name]


PLAN = "trajectory-optimisation/path-length"


@pytest.mark.parametrize(
    ("apart", "p", "says"),
    [(0.2, 0.001, "yes"), (0.05, 0.001, "no"), (0.2, 0.2, "no"), (0.2, np.nan, "yes")],
)
def test_context_is_ten_steps_apart_and_no_chance(apart, p, says, tmp_path):
    _, found = shown(tmp_path, PLAN, 1, apart=apart, p=p, value=1.0)
    assert (found["context"], found["context_distance"]) == (says, apart)
    assert found["motor_equivalent"] == says


@pytest.mark.parametrize(
    ("runs", "sacrificed", "says"),
    [
        (1, {"value": 1.0}, "yes"),
        (1, {"value": 0.0}, "no"),
        (20, {"value": 1.0, "low": 0.84, "high": 1.0}, "yes"),
        (20, {"value": 0.6, "low": 0.39, "high": 0.78}, "no"),
    ],
)
def test_a_sacrifice_is_one_of_most_runs(runs, sacrificed, says, tmp_path):
    """However long the first movement is in the mean."""
    judged, found = shown(tmp_path, "cma-es/bandit", runs, **sacrificed)
    names = ("sacrifice", "first_change", "total_change")
    assert [found[name] for name in names] == [says, 5.0, -5.0]
    assert f"sacrifice: {'CMA-ES' if says == 'yes' else 'none'}; " in judged.evidence


@pytest.mark.parametrize(("ready", "says"), [(0.6, "yes"), (0.1, "no"), (None, None)])
def test_preshaping_is_a_tenth_of_the_way(ready, says, tmp_path):
    judged, found = shown(tmp_path, PLAN, 1, value=1.0, ready=ready)
    assert found["preshaping"] == says
    if ready is None:
        assert "preshaping: not judged; " in judged.evidence
        assert "lead: not judged; turning: not judged" in judged.evidence


def test_learned_rewards_beside_the_printed_ones(tmp_path):
    """Printed 502 ± 3.4 and 484 ± 2.0 over 20 runs, within 1 %."""
    rows = []
    for entry in seven([0, 1, 2, 1] * 5):
        key = entry["task"], entry["method"].removeprefix("dual-process/")
        shift = {(T1, "EC3"): -502, (T1, "EC4"): -460}.get(key)
        if shift is not None:
            entry = {**entry, "reward": shift + entry["reward"] + 670}
        rows.append(entry)
    study = Study(planted_results(rows, tmp_path))
    judged = verdict_of("learned-rewards-as-printed", study)
    found = by_key(judged.table)
    ec3 = found["two-armed-1 EC3 all"]
    names = ("printed", "printed_runs", "ours", "our_runs")
    printed = Estimate(-502, digits=(0, 1))
    assert [ec3[name] for name in names] == [printed, 20, -502, 20]
    assert ec3["difference"].value == 0
    assert ec3["difference"].low < 0 < ec3["difference"].high
    assert ec3["verdict"] == "equivalent"
    assert found["two-armed-1 EC4 all"]["verdict"] == "different"
    assert "two-armed-2 EC4 all" not in found  # not printed
    assert "two-armed-1 EC2 RRRR" not in found  # these runs learned other hands


def test_runs_of_other_hands_are_no_basis(tmp_path):
    study = Study(planted_results(learner(T1, "EC2", MIDDLE + LOW, RRLR), tmp_path))
    improves = verdict_of("ec2-improves", study)
    assert improves.run_ids == tuple(f"dual-process/EC2-{k}" for k in range(8, 16))
    assert "RRLR in 8 of 16 runs (RRLR 8, RRRR 8)" in verdict_of("ec2-sequences", study).evidence


def timed(task, first, others):
    """A run whose first movement takes ``first`` ticks more than initially, the next so many."""
    ticks = corrective_trial(load_task(task), "RRR").ticks_by_goal()
    ticks = [ticks[0] + first, ticks[1] + others, ticks[2]]
    return SimpleNamespace(
        execution=SimpleNamespace(ticks_by_goal=lambda: ticks, ticks=sum(ticks))
    )


@pytest.mark.parametrize(
    ("first", "others", "verdict"),
    [
        (6, -20, "supported"),
        (1, -20, "cannot tell"),  # one tick is rounding
        (-6, -20, "not supported"),
        (6, 20, "not supported"),
    ],
)
def test_the_first_movement_is_sacrificed(first, others, verdict, tmp_path):
    tasks = ("ascending", "descending")
    rows = [entry for task in tasks for entry in learner(task, "EC1", MIDDLE, "RRR")]
    paths = {
        (task, "dual-process/EC1"): [timed(task, first + k, others) for k in SPREAD]
        for task in tasks
    }
    for runs in paths.values():  # as many as rows
        runs += runs[:2]
    judged = verdict_of(
        "first-movement-sacrificed", with_paths(planted_results(rows, tmp_path), paths)
    )
    assert judged.verdict == verdict, judged.evidence
    both = sum(first + k > 1 and first + k + others < 0 for k in (*SPREAD, *SPREAD[:2]))
    assert judged.evidence.count(f"both in {both} of 8 runs") == 2


@pytest.mark.parametrize(
    ("apart", "p", "verdict"),
    [(5.0, 0.001, "supported"), (5.0, 0.2, "cannot tell"), (0.0, 0.6, "not supported")],
)
def test_context_is_more_than_the_spread_and_no_chance(apart, p, verdict, tmp_path):
    """The contrary is seen in the postures themselves."""
    rows = [
        entry
        for task in ("ascending", "descending")
        for entry in learner(task, "EC1", MIDDLE, "RRR")
    ]
    parts = ("motor-equivalent part", "non-motor-equivalent part")
    planted = [
        signature("ascending", "dual-process/EC1", name, 1, apart, p=p)
        for name in ("context distance", "context dependence", *parts)
    ]
    rng = np.random.default_rng(0)
    paths = {
        (task, "dual-process/EC1"): [at(q) for q in rng.normal(size=(8, 3, 10)) + far]
        for task, far in (("ascending", 0.0), ("descending", apart))
    }
    study = with_paths(planted_results(rows, tmp_path), paths, signature_rows=planted)
    assert verdict_of("context", study).verdict == verdict


def test_little_dependence_on_context():
    """Two samples of one distribution are less than a pooled SD apart; two SDs are not."""
    rng = np.random.default_rng(2)
    same, other = rng.normal(size=(2, 20, 10))
    assert dependence_below(same, other, 1.0, np.random.default_rng(0)) < 0.001
    shifted = other + 2.0
    assert context_dependence(same, shifted) > 1
    assert dependence_below(same, shifted, 1.0, np.random.default_rng(0)) > 0.9
    assert np.isnan(dependence_below(same[:1], other, 1.0, rng))


@pytest.mark.parametrize(
    ("xs", "runs", "verdict"),
    [
        ([1, 2, 3, 4], 16, "supported"),
        ([1, 2, 3, 4], 8, "cannot tell"),
        ([1, 2, 1.5, 4], 8, "not supported"),
    ],
)
def test_the_base_goes_right_once_rrlr_is_learned(xs, runs, verdict, tmp_path):
    q = np.zeros((4, 10))
    q[:, 0] = xs
    run = SimpleNamespace(execution=SimpleNamespace(configurations=q, hands="RRLR"))
    rows = learner(T1, "EC2", MIDDLE * 2, "RRLR")
    paths = {(T1, "dual-process/EC2"): [run] * runs}
    assert (
        verdict_of("no-reversal", with_paths(planted_results(rows, tmp_path), paths)).verdict
        == verdict
    )


def test_the_contrary_of_one_test_is_not_that_of_another():
    """Runs without spread that are as claimed say nothing against it."""

    def decide(data):
        data.run_ids.append("r")
        return Finding(False, "", (
            bootstrap_test([5.0, 5.0, 5.0], 0.0, seed=0), bootstrap_test([-9, 8, 0.9], 0, seed=0),
        ))  # fmt: skip

    (judged,) = judge(Study(NOTHING), [Claim("c", "s", "General", "tested", "t", decide)])
    assert judged.verdict == "cannot tell"
    assert any("no spread" in method for method in judged.methods)


def test_no_spread_is_no_certainty():
    assert interval(mean([-490.0] * 20, seed=0)) == "-490.0 (no spread in 20 runs)"
    assert interval(mean([-490.0, -480.0], seed=0)) == "-485.0"
    assert "[" in interval(mean([-490.0, -480.0, -470.0], seed=0))


class FewStarts(InProcess):
    """Plans are begun from little: how good they are is for the tests of their methods."""

    def perform(self, jobs):
        for job in jobs:
            given = job["specification"]
            if "graphs" in given["parameters"]:
                few = {"graphs": 1, "chains": 1, "noisy_starts": 0, "nodes": 60}
                given = {**given, "parameters": {**given["parameters"], **few}}
            yield from super().perform([{**job, "specification": given}])


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """The paper's cells as far as its claims need them, beside a plan and the initial solution."""
    cells = [
        (task, f"dual-process/{condition}")
        for task, conditions in (
            ("ascending", ["EC1"]),
            ("descending", ["EC1"]),
            (T1, ["EC2", "EC3", "EC4"]),
            (T2, ["EC3", "EC4"]),
        )
        for condition in conditions
    ]
    cells += [
        (task, method)
        for method in ("trajectory-optimisation/squared-changes", "corrective-alone/given")
        for task in ("ascending", "descending")
    ]
    planned = [Cell(load_task(task), KNOWN[method]) for task, method in cells]
    folder = tmp_path_factory.mktemp("claims")
    results = run_and_write(folder, planned, runs=4, trials=1500, executor=FewStarts())
    results.runs["trials"] = results.runs.trials.replace(1500, 10_000)  # as long as the paper's
    return Study(results)


def test_the_register_on_runs(study):
    judged = {entry.claim.id: entry for entry in study.judged}
    assert list(judged) == [claim.id for claim in CLAIMS if not claim.families]
    # Few runs, yet these are never in doubt.
    for name in ("first-movement-sacrificed", "ec3-beats-exhaustive"):
        assert 0 < judged[name].p <= 1
        assert judged[name].verdict != "not supported"
    sacrificed = judged["first-movement-sacrificed"]
    assert "first movement 141 to" in sacrificed.evidence
    assert "corrective-alone/given: first +0.0, all +0.0" in sacrificed.evidence
    assert "one-goal" not in sacrificed.evidence  # not in this folder
    assert len(sacrificed.run_ids) == 9
    assert set(sacrificed.run_ids) <= set(study.runs.run_id)
    assert judged["distance-to-optimum"].verdict == "measured"
    # What was not run is not judged.
    for name in (
        "less-experience-two-armed",
        "resembles-jerk",
        "beats-inaccurate-one-armed",
        "proposals",
    ):
        assert judged[name].verdict == "cannot tell"
        assert judged[name].evidence.startswith("not judged: this folder has no runs of")
    assert judged["resembles-squared-changes"].run_ids


def test_tables_of_evidence_are_recomputed_from_their_cells(study):
    tables = {entry.claim.id: entry.table for entry in study.judged if entry.table}

    def values(claim, key):
        return by_key(tables[claim])[key]

    def runs(line):
        (cell,) = line.cells
        return study.cells[cell].runs

    gap = values("distance-to-optimum", "ascending EC1")
    reward = study.cells["ascending", "dual-process/EC1"].runs.reward.astype(float).mean()
    assert (gap["optimum_still"], gap["optimum_free"], gap["gap_free"]) == (-292, None, None)
    assert gap["gap_still"].value == pytest.approx(-292 - reward)
    assert gap["gap_share_still"] == pytest.approx((-292 - reward) / 292)
    for column in tables["distance-to-optimum"].columns:
        assert (column.other_arm == "still") == column.name.endswith("_still")
    for line in tables["computation"].rows:
        own, shown = runs(line), values("computation", line.key)
        spent = (own.forward_kinematics + own.jacobians).median()
        assert shown["evaluations"] == spent
        assert shown["reward"] == pytest.approx(own.reward.astype(float).mean())
        trials = own.trials.median()
        assert shown["evaluations_a_trial"] == (spent / trials if trials > 1 else None)
    given = values("reward-by-experience", "corrective-alone/given on ascending")
    assert (given["reached_free"], given["median_trials_free"]) in [(0, None), (None, None)]
    assert (given["runs"], given["reward"]) == (1, -319.0)
    for line in tables["reward-by-experience"].rows:
        shown, (task, _) = values("reward-by-experience", line.key), line.cells[0]
        for arm in ("free", "still"):
            if shown[f"reached_{arm}"] is not None:
                near = 1.05 * study.optima[task, arm].reward
                assert shown[f"reached_{arm}"] == (runs(line).reward >= near).sum()
    signatures = by_key(tables["shared-signatures"])
    assert set(signatures) == {"learner", "corrective alone", "least squared changes"}
    assert signatures["learner"]["sacrifice"] == "yes"
    alone = signatures["corrective alone"]
    assert (alone["reward"], alone["context"], alone["context_distance"]) == (-319.0, "no", 0.0)
    assert (alone["sacrifice"], alone["first_change"], alone["total_change"]) == ("no", 0.0, 0.0)


def test_what_else_was_run_changes_no_verdict_on_the_papers_cells(study):
    """The same runs alone, and with other methods beside them, one of them tested against."""
    own = study.runs[study.runs.method.str.startswith("dual-process/")]
    manifest = study.results.manifest
    cells = [c for c in manifest.specification.cells if c.method.startswith("dual-process/")]
    alone = replace(study.results, runs=own, manifest=replanned(manifest, cells=tuple(cells)))
    changed_ones = []
    for one, other in zip(judge(Study(alone)), study.judged, strict=True):
        if one.claim.beside or one.claim.rule == "measured":
            changed_ones += [one.claim.id] * (one.evidence != other.evidence)
            continue
        for name in ("verdict", "p", "adjusted_p", "contrary_p", "adjusted_contrary_p"):
            np.testing.assert_equal(getattr(one, name), getattr(other, name), one.claim.id)
    assert "resembles-squared-changes" in changed_ones


def test_evidence_says_what_it_rests_on(study):
    for entry in study.judged:
        if entry.table is None:
            continue
        assert entry.table.id == f"evidence-{entry.claim.id}"
        for column in entry.table.columns:
            assert column.rests_on or column.kind == "text", (entry.claim.id, column.name)
        for line in entry.table.rows:
            for column, value in zip(entry.table.columns, line.values, strict=True):
                cells = line.cells_by_column.get(column.name, line.cells)
                runs = {run for cell in cells for run in study.run_ids[cell]}
                assert runs <= set(entry.run_ids)
                assert runs or value is None or column.rests_on == ()


def test_independent_claims_rest_on_printed_tasks(study):
    """The others rest on a task whose goals were chosen for results like theirs."""
    task_of = dict(zip(study.runs.run_id, study.runs.task, strict=True))
    chosen = {name for name, task in study.tasks.items() if task.reconstructed}
    assert chosen == {T1, T2}
    seen = 0
    for entry in study.judged:
        if not entry.claim.place:
            continue
        tasks = {task_of[run] for run in entry.run_ids}
        tasks |= {name for name in study.tasks for text in entry.sources if text.endswith(name)}
        if tasks:
            seen += 1
            assert bool(tasks & chosen) == entry.claim.fitted, entry.claim.id
    assert seen > 20


def test_a_place_can_be_found_by_a_few_words():
    for claim in CLAIMS:
        assert bool(claim.place) == bool(claim.quote), claim.id
        assert len(claim.quote.split()) <= 12
        assert "Methods" not in claim.place  # the paper's heading is Method


def test_the_register_is_the_same_every_time(study):
    first, second = study.judged, judge(Study(study.results))
    assert [(j.verdict, j.evidence) for j in first] == [(j.verdict, j.evidence) for j in second]
    np.testing.assert_array_equal([j.p for j in first], [j.p for j in second])


def test_page_and_table_hold_every_claim(study):
    page, found = markdown(claims_document(study)), study.claims
    assert page.startswith("# Claims")
    assert list(found.id) == [claim.id for claim in CLAIMS if not claim.families]
    for entry, kept in zip(study.judged, found.to_dict("records"), strict=True):
        heading = f"### {entry.claim.id}: {entry.verdict}{' †' * entry.claim.fitted}"
        assert f"{heading}\n\n{entry.claim.statement}" in page
        assert entry.evidence in page
        assert kept["verdict"] == entry.verdict
        assert tuple(kept["runs"].split()) == entry.run_ids
        assert kept["evidence"] == entry.evidence
        assert page.count(entry.claim.statement) == 1
    assert not any(run in page for run in study.runs.run_id)
    paper = [entry for entry in study.judged if entry.claim.place]
    independent = [entry for entry in paper if not entry.claim.fitted]
    supported = sum(entry.verdict == "supported" for entry in independent)
    assert f"{len(independent)} claims of the paper, on what is printed" in page
    assert f"rest on: {supported} supported" in page
    sections = [line[3:] for line in page.splitlines() if line.startswith("## ")]
    groups = ["One-armed tasks", "Two-armed tasks", "General", "Beyond the paper"]
    assert sections == ["Verdicts", *groups]


def powers_at(runs):
    """Chances of the register's claims with so many runs in each of the paper's cells."""
    return powers(CLAIMS, {(task, f"dual-process/{c}"): runs for task, c in published_cells()})


def test_power_is_that_of_the_rule_by_hand():
    """Of one claim alone, from the binomial and the noncentral t distribution."""

    def alone(claim, runs):
        (wanted,) = [entry for entry in CLAIMS if entry.id == claim]
        cells = {(task, f"dual-process/{c}"): runs for task, c in published_cells()}
        return powers([wanted], cells)[claim]

    # 11 of 20 leave RRRR; of 20 runs 11 must do so at most (p = 0.041).
    found = alone("ec2-unreliable", 20)
    assert found.supported == pytest.approx(stats.binom.cdf(11, 20, 0.55), abs=0.03)
    assert found.refuted == pytest.approx(stats.binom.sf(18, 20, 0.95))
    # All of all: three quarters are exceeded for certain, half of them seldom taken for less.
    found = alone("ec3-alternates", 20)
    assert found.supported == 1
    assert found.refuted == pytest.approx(stats.binom.cdf(11, 20, 0.5))
    # -303 and -319 with an SD of 2.9, -314 and -333 with 1.88.
    assert alone("learning-improves-one-armed", 20) == (1, 1)
    shift = 2.7 / np.sqrt(2.1**2 / 55 + 4.2**2 / 45)
    assert alone("rlrr-better", 100).supported == pytest.approx(
        stats.norm.sf(stats.norm.isf(0.05) - shift), abs=0.03
    )


def test_powers_of_the_register():
    found, enough = powers_at(20), powers_at(100)
    tested = [claim for claim in CLAIMS if claim.tested]
    assert set(found) < {claim.id for claim in tested}
    for name in ("half-choose-rlrr", "ec2-sequences"):  # about half: 20 runs cannot show it
        assert found[name].supported < 0.01
        assert min(enough[name]) > 0.8
    assert min(found["ec3-beats-exhaustive"]) > 0.8
    assert powers(CLAIMS, {}) == found
    # Without printed numbers there is no chance to speak of.
    assert not {"context", "other-arm-coarticulation", "multilevel-search"} & set(found)


@pytest.mark.parametrize(
    ("free", "verdict"),
    [
        (["LRLR"] * 12 + ["RRRR"] * 12, "supported"),
        (["LRLR"] * 24, "not supported"),
        (["LRLR"] * 18 + ["RRRR"] * 6, "cannot tell"),
    ],
)
def test_the_rail_makes_the_sequence(free, verdict, tmp_path):
    rows = [*learner(T1, "EC3", MIDDLE * 3), *learner(T1, "EC2", LOW, "RRRR")]
    rows += [*learner(FREE, "EC3", MIDDLE * 3, free), *learner(FREE, "EC2", LOW, "RRRR")]
    free_base = load_task(T1).model_copy(update={"name": FREE, "locked_base": ()})
    results = planted_results(rows, tmp_path, tasks=[free_base])
    judged = verdict_of("rail", Study(results))
    assert judged.verdict == verdict, judged.evidence


@pytest.mark.parametrize(
    ("one", "verdict"),
    [(LOW, "supported"), (HIGH, "not supported"), (MIDDLE, "cannot tell")],
)
def test_search_on_two_levels(one, verdict, tmp_path):
    rows = [*learner(T1, "EC3", MIDDLE), *learner(T1, "EC1", one)]
    rows += [*learner(T2, "EC3", BETTER, initial=-357), *learner(T2, "EC1", WORSE, initial=-357)]
    assert (
        verdict_of("multilevel-search", Study(planted_results(rows, tmp_path))).verdict == verdict
    )


def test_the_papers_own_p_values():
    """RLRR above RRRR is printed with p < .01; Welch's test on what is printed gives 0.053."""
    judged = verdict_of("printed-p-values", Study(NOTHING))
    assert judged.verdict == "not supported"
    a, b = (-350, 4.2, 9), (-352.7, 2.1, 11)
    p = stats.ttest_ind_from_stats(*a, *b, equal_var=False, alternative="greater").pvalue
    assert f"EC3-RLRR-above-RRRR p = {p:.2g} (" in judged.evidence
    assert f"{p:.2g}" == "0.053"
    assert not judged.claim.fitted


def hit_early(part, task=T2):
    """The right hand of two-armed task 2, part of the way to each next posture at every hit."""
    task = load_task(task)
    path = trajectory(task, corrective_trial(task, task.initial_hands).movements)
    q = path.execution.configurations.copy()
    q[:-1] += part * (q[1:] - q[:-1])
    ticks = path.execution.ticks_by_goal()
    execution = SimpleNamespace(configurations=q, ticks_by_goal=lambda: ticks)
    return SimpleNamespace(task=task, hands=path.hands, execution=execution)


def test_what_a_posture_serves():
    """The corrective process itself gains nothing; half the way ahead, half the way is left."""
    assert served(hit_early(0.0)) == pytest.approx(np.zeros((3, 2)))
    path = hit_early(0.5)
    task, q = path.task, path.execution.configurations
    alone = corrective_trial(task, "RRRR").configurations[0]
    left = isolated_reach(task, q[0], 2, "right")[0]
    gain = isolated_reach(task, alone, 2, "right")[0] - left
    assert gain > 0.4 * left
    assert served(path)[0] == pytest.approx([0, gain])
    # What the other arm does is not the chosen one's.
    q[0, task.robot.joints("left")] += 0.3
    assert served(path)[0, 1] == gain


@pytest.mark.parametrize(
    ("part", "verdict"), [(0.3, "supported"), (-0.3, "not supported"), (0.0, "cannot tell")]
)
def test_the_chosen_arm_serves_the_next_goal(part, verdict, tmp_path):
    rows, paths = [], {}
    for task, initial in ((T1, -671), (T2, -357)):
        for condition in ("EC3", "EC4"):
            rows += learner(task, condition, MIDDLE, "RRRR", initial=initial)
            paths[task, f"dual-process/{condition}"] = [
                hit_early(part + 0.02 * k, task) for k in (-3, -2, -1, 1, 2, 3, -1, 1)
            ]
    judged = verdict_of("arm-coarticulation", with_paths(planted_results(rows, tmp_path), paths))
    assert judged.verdict == verdict, judged.evidence


def test_the_page_of_the_register_is_current():
    text = (ROOT / "docs" / "register.md").read_text(encoding="utf-8")
    assert text == page(), "python -m coartic.analysis.claims.page > docs/register.md"
    assert "| half-choose-rlrr | 0% | 36% | 80 |" in text


def test_every_sentence_is_accounted_for():
    names = {claim.id for claim in CLAIMS}
    for said in SENTENCES:
        assert len({"claims", "held", "open"} & set(said)) == 1, said["quote"]
        assert set(said.get("claims", ())) <= names
    accounted = {name for said in SENTENCES for name in said.get("claims", ())}
    untold = {claim.id for claim in CLAIMS if claim.place} - accounted
    assert not untold, f"sentences.toml names no sentence that these claims come from: {untold}"


SAID = {
    **{"statement": "It is so.", "section": "General", "rule": "tested", "place": "here"},
    **dict.fromkeys(("fitted", "selected"), False),
}


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("rule", "count", "'higher', 'most'"),
        ("section", "Two-armed", "'Two-armed tasks'"),
        ("rool", "counted", "Extra inputs are not permitted"),
        ("place", "", "stands in section 'Beyond the paper'"),
        ("section", "Beyond the paper", "is measured"),
        ("pairs", {"two-armed-9": "EC3 > EC2"}, "there is no task 'two-armed-9'; did you mean"),
        ("pairs", {"two-armed-1": "EC9 > EC2"}, "match pattern"),
        ("pairs", {"two-armed-1": "EC3 LRLR < EC2"}, "match pattern"),
        ("runs", {"two-armed-1": "EC3 LRXR"}, "match pattern"),
    ],
)
def test_a_claim_is_checked_where_it_is_read(field, value, words):
    Said.model_validate(SAID)
    with pytest.raises(ValueError, match=re.escape(words)):
        Said.model_validate(SAID | {field: value})


def test_margins_are_set_once_with_a_reason():
    assert all(said["reason"] for said in REASONS.values())
    assert MARGINS["few"] == 1 - MARGINS["most"]
    for claim in CLAIMS:
        assert "{" not in claim.test
        assert not (claim.pairs and claim.runs)
