"""The claims register: verdicts on planted findings, and on runs of its own."""

import numpy as np
import pandas as pd
import pytest

from analysis.claims import CLAIMS, Claim, Finding, MissingError, claims_page, judge
from analysis.results import Results
from analysis.statistics import Inference
from analysis.study import Study
from benchmarks.methods import registry
from benchmarks.suites import Cell
from coartic import load_task

from .test_harness import run_and_write
from .test_methods_table import row

NOTHING = Results(
    None, {"specification": {"tasks": {}, "cells": []}}, pd.DataFrame(), pd.DataFrame()
)


def test(p):
    return Inference(1.0, (20,), "planted", p=p)


def planted(holds, *p, place="here", ids=("r",)):
    def decide(data):
        data.used += ids
        return Finding(holds, "planted", tuple(map(test, p)))

    return Claim("planted", "It is so.", place, "planted", decide)


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
        (planted(False, 0.99), "not supported"),
        (planted(False, 0.001, 0.99), "not supported"),
        (planted(False), "not supported"),
        (planted(None), "cannot tell"),
        (planted(True, 0.001, ids=()), "cannot tell"),
        (planted(None, place=""), "measured"),
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
        planted(None, 0.9, place=""),  # measured: no part of the family
    ]
    judged = judge(Study(NOTHING), claims)
    assert [entry.p for entry in judged[:3]] == pytest.approx([0.06, 0.003, 0.06])
    assert np.isnan(judged[3].p)
    verdicts = [entry.verdict for entry in judged]
    assert verdicts == ["cannot tell", "supported", "cannot tell", "measured"]


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


def planted_results(rows, tmp_path):
    runs = pd.DataFrame(rows).astype({"reward": "Int64", "proven_bound": "Int64"})
    cells = runs[["task", "method", "variant"]].drop_duplicates().to_dict("records")
    tasks = {name: load_task(name).model_dump(mode="json") for name in runs.task.unique()}
    sequences = pd.DataFrame(
        {"task": ["two-armed-1"] * 2, "hands": ["LRLR", "RRRR"], "reward": [-533, -671]}
    )
    specification = {"tasks": tasks, "cells": cells}
    return Results(tmp_path, {"specification": specification}, runs, sequences)


LOW = [-610, -612, -608, -611, -609, -613, -607, -610]
MIDDLE = [-505, -503, -507, -504, -506, -508, -502, -505]
HIGH = [-484, -482, -486, -483, -485, -487, -481, -484]
WORSE = [-350, -351, -352, -353, -351, -350, -352, -354]
BETTER = [-330, -331, -332, -333, -331, -330, -332, -334]
T1, T2 = "two-armed-1", "two-armed-2"


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
        (
            "ec4-beats-ec3",
            learner(T1, "EC3", MIDDLE) + learner(T1, "EC4", HIGH) + second(WORSE, BETTER),
            "supported",
        ),
        (
            "ec4-beats-ec3",
            learner(T1, "EC3", HIGH) + learner(T1, "EC4", MIDDLE) + second(WORSE, BETTER),
            "not supported",
        ),
        (
            "ec4-beats-ec3",
            learner(T1, "EC3", MIDDLE) + learner(T1, "EC4", HIGH) + second(WORSE, WORSE[::-1]),
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
            learner(T1, "EC2", LOW, "RRRR") + learner(T1, "EC3", MIDDLE) + second(WORSE, BETTER),
            "supported",
        ),
        (
            "sequences-change",
            learner(T1, "EC2", LOW, "RRRR") + learner(T1, "EC3", MIDDLE)
            + second(WORSE, BETTER, hands4="RRRR"),
            "cannot tell",
        ),
        ("ec2-sequences", learner(T1, "EC2", LOW * 3, "RRRR"), "not supported"),
        ("ec2-sequences", learner(T1, "EC2", LOW, ["RRLR"] * 4 + ["RRRR"] * 4), "cannot tell"),
        ("half-choose-rlrr", learner(T2, "EC3", WORSE * 5, "RRRR", -357), "not supported"),
        ("half-choose-rlrr", learner(T2, "EC3", WORSE * 5, ["RLRR", "RRRR"] * 20, -357),
         "cannot tell"),
        ("half-choose-rlrr", learner(T2, "EC3", WORSE * 100, ["RLRR", "RRRR"] * 400, -357),
         "supported"),
    ],
)  # fmt: skip
def test_judges_on_planted_runs(claim, rows, verdict, tmp_path):
    (wanted,) = [entry for entry in CLAIMS if entry.id == claim]
    (judged,) = judge(Study(planted_results(rows, tmp_path)), [wanted])
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
    (claim,) = [entry for entry in CLAIMS if entry.id == "learning-improves"]
    for replays, verdict in (
        ([9, 10, 11, 12], "supported"),
        ([-9, -10, -11, -12], "not supported"),
        ([-9, 10, -11, 12], "cannot tell"),
    ):
        (judged,) = judge(Study(planted_results(seven(replays), tmp_path)), [claim])
        assert judged.verdict == verdict


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        (learner(T1, "EC3", MIDDLE, trials=3000), "with 10000 trials, as the paper's have"),
        (learner(T1, "EC3", MIDDLE[:2]), "at least 3 runs"),
        (
            learner(T1, "EC3", MIDDLE)[:-1] + learner(T1, "EC3", MIDDLE, status="crashed")[-1:],
            "1 of 8 runs of dual-process/EC3 on two-armed-1 have no solution",
        ),
    ],
)
def test_runs_that_are_not_like_the_papers_are_not_judged(rows, words, tmp_path):
    (claim,) = [entry for entry in CLAIMS if entry.id == "ec3-alternates"]
    (judged,) = judge(Study(planted_results(rows, tmp_path)), [claim])
    assert judged.verdict == "cannot tell"
    assert words in judged.evidence


def test_what_the_folder_lacks_is_said():
    def decide(data):
        raise MissingError("no runs of dual-process/EC1 on ascending")

    (judged,) = judge(Study(NOTHING), [Claim("c", "s", "here", "t", decide)])
    assert judged.verdict == "cannot tell"
    assert judged.evidence == "not in this folder: no runs of dual-process/EC1 on ascending"
    assert judged.run_ids == ()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    known = registry()
    cells = [
        Cell(load_task(task), known[f"dual-process/{condition}"])
        for task, conditions in (
            ("ascending", ["EC1"]),
            ("descending", ["EC1"]),
            ("two-armed-1", ["EC2", "EC3", "EC4"]),
            ("two-armed-2", ["EC3", "EC4"]),
        )
        for condition in conditions
    ]
    cells.append(Cell(load_task("ascending"), known["trajectory-optimisation/squared-changes"]))
    cells.append(Cell(load_task("descending"), known["trajectory-optimisation/squared-changes"]))
    return run_and_write(tmp_path_factory.mktemp("claims"), cells, runs=4, trials=10_000)


def test_the_register_on_runs(folder):
    judged = {entry.claim.id: entry for entry in judge(Study(folder))}
    assert len(judged) == len(CLAIMS)
    # Few runs, yet these are never in doubt.
    for name in ("first-movement-sacrificed", "ec3-beats-exhaustive"):
        assert 0 < judged[name].p <= 1
        assert judged[name].verdict != "not supported"
    sacrificed = judged["first-movement-sacrificed"]
    assert "first movement 141 to" in sacrificed.evidence
    assert len(sacrificed.run_ids) == 8
    assert set(sacrificed.run_ids) <= set(folder.runs.run_id)
    assert judged["distance-to-optimum"].verdict == "measured"
    assert "ticks from -292" in judged["distance-to-optimum"].evidence
    # What was not run is not judged.
    for name in ("less-experience", "resembles-jerk", "shared-signatures"):
        assert judged[name].verdict == "cannot tell"
        assert judged[name].evidence.startswith("not in this folder: no runs of")
    assert judged["resembles-squared-changes"].run_ids


def test_the_register_is_the_same_every_time(folder):
    first, second = judge(Study(folder)), judge(Study(folder))
    assert [(j.verdict, j.evidence) for j in first] == [(j.verdict, j.evidence) for j in second]
    np.testing.assert_array_equal([j.p for j in first], [j.p for j in second])


def test_the_page_names_every_run(folder):
    judged = judge(Study(folder))
    page = claims_page(folder, judged)
    assert page.startswith("# Claims")
    for entry in judged:
        assert entry.claim.statement.replace("|", "\\|") in page
        assert all(run[:8] in page for run in entry.run_ids)
