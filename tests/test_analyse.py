"""``coartic analyse``: the pages and tables that it writes, checked against the runs."""

import shutil

import numpy as np
import pandas as pd
import pytest

from coartic.analysis.results.folder import load_results
from tests.support.commands import call
from tests.support.suites import run_and_write, suite_of

WRITTEN = {
    "claims.md", "frontier.md", "signatures.md", "signatures.csv", "anytime.csv", "targets.csv",
    "areas.csv", "pareto.csv",
}  # fmt: skip


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    folder = tmp_path_factory.mktemp("analyse")
    moved = 'tasks = ["ascending"]\nmethods = ["dual-process/EC1"]\nmove = {goal=2, by=%s}'
    cells = suite_of(
        folder,
        'tasks = ["ascending", "descending"]\nmethods = ["dual-process/EC1", '
        '"corrective-alone/given"]',
        'tasks = ["two-armed-1"]\nmethods = ["dual-process/EC3", "dual-process/EC4", '
        '"dual-process/EC1"]',
        moved % "[[0, -0.5], [0, -0.25]]",
    )
    return run_and_write(folder / "results", cells=cells, runs=4, trials=150)


def test_analyse_writes_all_it_names(results, monkeypatch, capsys, tmp_path):
    folder = shutil.copytree(results.folder, tmp_path / "copy")
    code, text, _ = call(monkeypatch, capsys, "analyse", folder)
    assert code == 0
    assert all(name in text for name in WRITTEN)
    assert all((folder / name).stat().st_size for name in WRITTEN)
    curves = pd.read_csv(folder / "anytime.csv")
    rewards = load_results(folder).runs.groupby(["task", "method"]).reward.mean()
    last = curves[curves.spend == "trials"].groupby(["task", "method"])["mean"].last()
    np.testing.assert_allclose(last.sort_index(), rewards.sort_index().astype(float))
    assert set(pd.read_csv(folder / "targets.csv").other_arm) == {"free", "still"}
    assert set(pd.read_csv(folder / "areas.csv").spend) == {
        "trials", "movement_ticks", "forward_kinematics", "solve_s",
    }  # fmt: skip


def test_analyse_says_what_is_damaged(results, monkeypatch, capsys, tmp_path):
    folder = shutil.copytree(results.folder, tmp_path / "copy")
    (folder / "solutions.parquet").write_bytes(b"PAR1")
    code, _, error = call(monkeypatch, capsys, "analyse", folder)
    assert code == 2
    assert "solutions.parquet is damaged" in " ".join(error.split())
    assert "start the same `coartic run` again" in " ".join(error.split())
    assert "Traceback" not in error
    (folder / "solutions.parquet").unlink()
    code, _, error = call(monkeypatch, capsys, "analyse", folder)
    assert code == 2
    assert "solutions.parquet is missing" in " ".join(error.split())
