"""The claims register: verdicts on planted findings, and on runs of its own."""

import numpy as np
import pandas as pd
import pytest

from analysis.claims import CLAIMS, Claim, Finding, MissingError, claims_page, judge
from analysis.results import Results
from analysis.statistics import Inference
from benchmarks.methods import registry
from benchmarks.suites import Cell
from coartic import load_task

from .test_harness import run_and_write

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
        (planted(True, float("nan")), "supported"),
        (planted(True, 0.2), "cannot tell"),
        (planted(True, 0.001, 0.2), "cannot tell"),
        (planted(False, 0.001), "not supported"),
        (planted(None), "cannot tell"),
        (planted(None, place=""), "measured"),
    ],
)
def test_verdicts(claim, verdict):
    (judged,) = judge(NOTHING, [claim])
    assert judged.verdict == verdict
    assert judged.run_ids == ("r",)


def test_p_values_are_corrected_over_the_whole_register():
    """0.03 alone is significant, and is not beside three others (Holm 1979)."""
    claims = [planted(True, 0.03), planted(True, 0.001), planted(True, 0.02, 0.04)]
    judged = judge(NOTHING, claims)
    assert [entry.p for entry in judged] == [
        pytest.approx((0.06,)),
        pytest.approx((0.004,)),
        pytest.approx((0.06, 0.06)),
    ]
    assert [entry.verdict for entry in judged] == ["cannot tell", "supported", "cannot tell"]


def test_what_the_folder_lacks_is_said():
    def decide(data):
        raise MissingError("no runs of dual-process/EC1 on ascending")

    (judged,) = judge(NOTHING, [Claim("c", "s", "here", "t", decide)])
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
    return run_and_write(tmp_path_factory.mktemp("claims"), cells, runs=4, trials=800)


def test_the_register_on_runs(folder):
    judged = {entry.claim.id: entry for entry in judge(folder)}
    assert len(judged) == len(CLAIMS)
    # Few runs and trials, yet these are never in doubt.
    assert judged["learning-improves"].evidence.startswith("ascending EC1 -319 to -3")
    assert len(judged["learning-improves"].p) == 7
    assert 0 < judged["learning-improves"].p[0] <= 1
    sacrificed = judged["first-movement-sacrificed"]
    assert "first movement 141 to" in sacrificed.evidence
    assert len(sacrificed.run_ids) == 8
    assert set(sacrificed.run_ids) <= set(folder.runs.run_id)
    assert judged["ec3-alternates"].verdict in ("supported", "not supported")
    assert judged["distance-to-optimum"].verdict == "measured"
    assert "ticks from -292" in judged["distance-to-optimum"].evidence
    # What was not run is not judged.
    for name in ("less-experience", "resembles-jerk", "shared-signatures"):
        assert judged[name].verdict == "cannot tell"
        assert judged[name].evidence.startswith("not in this folder: no runs of")
    assert judged["resembles-squared-changes"].p


def test_the_register_is_the_same_every_time(folder):
    first, second = judge(folder), judge(folder)
    assert [(j.verdict, j.evidence) for j in first] == [(j.verdict, j.evidence) for j in second]
    assert [j.p for j in first] == [j.p for j in second]


def test_the_evidence_is_what_the_runs_say(folder):
    (claim,) = [c for c in CLAIMS if c.id == "ec3-beats-exhaustive"]
    (judged,) = judge(folder, [claim])
    runs = folder.runs[
        (folder.runs.task == "two-armed-1") & (folder.runs.method == "dual-process/EC3")
    ]
    rewards = runs.reward.to_numpy(dtype=float)
    assert judged.evidence.startswith(f"{rewards.mean():.1f} ")
    assert "against -533 (published -532)" in judged.evidence
    expected = "not supported" if rewards.mean() <= -533 else "supported"
    if judged.verdict != "cannot tell":
        assert judged.verdict == expected
    assert np.isfinite(judged.p).all()


def test_the_page_names_every_run(folder):
    judged = judge(folder)
    page = claims_page(folder, judged)
    assert page.startswith("# Claims")
    for entry in judged:
        assert entry.claim.statement.replace("|", "\\|") in page
        assert all(run[:8] in page for run in entry.run_ids)
