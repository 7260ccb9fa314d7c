"""How much of the whole task's reward it takes: planted results, and a small suite."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from coartic import load_task
from coartic.analysis.claims.judge import judgements
from coartic.analysis.report import build
from coartic.analysis.report.contents import TABLES
from coartic.analysis.signatures.signs import SIGNS
from coartic.analysis.topics import dose
from tests.support.made_up import row, study_of
from tests.support.suites import run_and_write, suite_of

DOSES = (0.0, 0.1, 0.5, 0.75, 1.0)
CLAIMS = (
    "dose-moves-postures", "dose-slows-first-movements", "dose-saves", "no-step-at-a-small-dose",
    "half-a-dose-saves-less", "three-quarters-suffice", "earlier-movements-count",
)  # fmt: skip
STRAIGHT = [20 * gamma for gamma in DOSES]
STEP = [0.0, 20.0, 20.0, 20.0, 20.0]


@pytest.mark.parametrize(
    ("curve", "later", "guesses", "against"),
    [
        ([0.0, 2.0, 10.0, 20.0, 20.0], 10.0, 5.0, ()),
        (STRAIGHT, 10.0, 5.0, {"three-quarters-suffice"}),
        (STEP, 20.0, 5.0, {*CLAIMS[3:5], "earlier-movements-count"}),
        ([20.0] * 5, 20.0, 30.0, {*CLAIMS} - {"three-quarters-suffice"}),
    ],
)
def test_claims_on_the_dose(curve, later, guesses, against, monkeypatch):
    """One curve for all measures; wild values where tasks are not those of a claim."""
    judged = [load_task(f"long/v1/i{k:03d}") for k in range(8)]
    others = [load_task("long/v1/d000"), load_task("ascending")]
    at = [*(("all", *pair) for pair in zip(DOSES, curve, strict=True)), ("later", 1.0, later)]
    rows = []
    for number, task in enumerate([*judged, *others]):
        for counted, gamma, value in [*at, ("guesses", np.nan, guesses)]:
            one = (0.8 + number / 17.5) * value if task in judged else 1e4 * (1 - gamma)
            cell = SimpleNamespace(good=pd.DataFrame({"run_id": [f"{task.name} {gamma}"]}))
            measured = dict.fromkeys(dose.MEASURES, np.array([one - 0.1, one + 0.1]))
            keys = {"group": "long", "counted": counted, "dose": gamma, "task": task.name}
            rows.append({**keys, "cell": cell, **measured})
    monkeypatch.setattr(dose, "dose_values", lambda study: pd.DataFrame(rows))
    runs = [row("placebo/guesses", -500, task=task.name) for task in [*judged, *others]]
    study = study_of(pd.DataFrame(runs), [*judged, *others], suite="dose")
    seen = {each.claim.id: each.verdict for each in judgements(study)}
    assert set(seen) == set(CLAIMS)
    refuted = {name for name, verdict in seen.items() if verdict == "not supported"}
    assert refuted == set(against)
    assert {name for name, v in seen.items() if v == "supported"} == {*CLAIMS} - refuted


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    folder = tmp_path_factory.mktemp("dose")
    block = """tasks = ["ascending", "descending", "one-armed/v1/d001", "one-armed/v1/d002"]
methods = ["dual-process/EC1-subtask"]
"""
    suite = suite_of(
        folder,
        block + 'parameters = { counted = "all" }\ngrid = { discount = [0, 1] }',
        block.replace("EC1-subtask", "EC1"),
        block.replace("dual-process/EC1-subtask", "placebo/guesses"),
    )
    study = run_and_write(folder / "results", suite, runs=4, trials=1500)
    object.__setattr__(study, "plan", replace(study.plan, suite="dose"))
    return study


def test_a_small_study_of_the_dose(small):
    """The whole as a dose is the paper's learner, judged by what it replays."""
    table, tasks = TABLES["dose"](small), ["one-armed/v1/d001", "one-armed/v1/d002"]
    replays = [small.replays(task, "dual-process/EC1") for task in tasks]
    for sign, column in (("arm", "nearer"), ("first", "first")):
        expected = np.mean([SIGNS[sign].of(runs).mean() for runs in replays])
        assert table[column]["random all 1"] == pytest.approx(expected)
    runs = small.runs[(small.runs.method == "dual-process/EC1") & small.runs.task.isin(tasks)]
    saved = (1 - runs.replay_reward / runs.initial_reward).groupby(runs.task).mean().mean()
    assert table.saved["random all 1"] == pytest.approx(100 * saved)
    first, second = (
        np.mean([run.execution.configurations[0] for run in small.replays(*key).runs], axis=0)
        for key in (("ascending", "dual-process/EC1"), ("descending", "dual-process/EC1"))
    )
    assert table.apart["ascending all 1"] == pytest.approx(np.linalg.norm(first - second))
    assert table.apart["ascending all 1"] > table.apart["ascending all 0"] + 0.1
    assert table.beyond_p["ascending all 1"] < 0.05 < table.beyond_p["ascending all 0"]
    assert table.apart.notna().sum() == 3
    assert build.draw_figure(small, "dose")
