"""Commands that hand results on: standings of submitted folders, exports."""

import json
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from coartic import load_task
from coartic.analysis.ioh import function_of
from coartic.analysis.study import load
from coartic.benchmarks import released, template
from coartic.benchmarks.registry import registry
from coartic.benchmarks.suites import Cell
from coartic.optimisers import FAILED
from coartic.runs.store import RUNS_FILE
from tests.support.commands import call
from tests.support.suites import KNOWN, run_and_write

OWN = Path(template.__file__)


@pytest.fixture
def coartic(monkeypatch, capsys):
    """Calls the command line; exit code, standard output, standard error."""
    return lambda *arguments: call(monkeypatch, capsys, *arguments)


def of(methods, tasks=("ascending", "descending"), known=KNOWN):
    return [Cell(load_task(task), known[method], runs=3) for task in tasks for method in methods]


@pytest.fixture
def shipped(tmp_path, monkeypatch):
    """A folder of suite ``paper``, which is released."""
    methods = ["dual-process/EC1", "corrective-alone/given", "trajectory-optimisation/path-length"]
    run_and_write(tmp_path / "shipped", of(methods), runs=3, trials=60)
    (tmp_path / "packed").mkdir()
    released.pack(tmp_path / "shipped", tmp_path / "packed")
    monkeypatch.setattr(released, "_FOLDER", tmp_path / "packed")
    return tmp_path / "shipped"


def test_standings(coartic, shipped, tmp_path):
    """A submission is ranked; what was edited, is the same or another task is refused by name."""
    folder = tmp_path / "submissions"
    stranger = registry([OWN])
    honest = run_and_write(folder / "b-honest", of(["NAME"], known=stranger), runs=3, trials=90)
    with closing(sqlite3.connect(shutil.copytree(folder / "b-honest", folder / "a-edited")
                                 / RUNS_FILE)) as db:  # fmt: skip
        db.execute("UPDATE results SET reward = reward + 20 WHERE run = 1")
        db.commit()
    other = {"NAME": stranger["NAME"].__class__(**vars(stranger["NAME"]) | {"code": "f" * 12})}
    run_and_write(folder / "c-twin", of(["NAME"], known=other), runs=3, trials=90)
    run_and_write(folder / "d-task", of(["NAME"], ["two-armed-1"], stranger), runs=1, trials=9)
    code, text, _ = coartic("standings", folder, "--out", tmp_path / "standings.csv")
    assert code == 1
    refused = [line.split(": ")[:2] for line in text.splitlines() if line.startswith("Refused")]
    assert refused == [["Refused", str(folder / f"{name}")] for name in
                       ("a-edited", "c-twin", "d-task")]  # fmt: skip
    for reason in ("reward is ", "method 'NAME' is code ", "not have task 'two-armed-1'"):
        assert reason in text
    table = pd.read_csv(tmp_path / "standings.csv", keep_default_na=False)
    assert table.submitted[table.method == "NAME"].tolist() == ["b-honest"]
    assert (table.submitted != "").sum() == 1
    best = {"ascending": -292, "descending": -304}
    gaps = [1 - honest.cells[task, "NAME"].rewards.mean() / best[task] for task in best]
    assert table.gap[table.method == "NAME"].item() == pytest.approx(-100 * sum(gaps) / 2)
    assert {"corrective-alone/given", "dual-process/EC1"} <= set(table.method)


def test_standings_of_what_cannot_be_ranked(coartic, shipped, tmp_path):
    code, _, error = coartic("standings", tmp_path / "nowhere")
    assert code == 2
    assert "holds no results folders" in error
    (tmp_path / "submissions").mkdir()
    shutil.copytree(shipped, tmp_path / "submissions" / "other")
    with closing(sqlite3.connect(tmp_path / "submissions" / "other" / RUNS_FILE)) as db:
        db.execute("UPDATE suite SET name = 'mine'")
        db.commit()
    code, text, _ = coartic("standings", tmp_path / "submissions")
    assert code == 1
    assert "other: no results of suite 'mine' are released, but of paper" in text


@pytest.mark.usefixtures("in_this_process")
def test_a_method_beside_the_released_ones(coartic, shipped, tmp_path):
    """Written by a command, checked by hand, run, and there again when the command is repeated."""
    mine, out = tmp_path / "my_search.py", tmp_path / "out"
    assert coartic("new", "method", "my-search", "--out", mine)[0] == 0
    command = ("run", "paper", "--method-file", mine, "--beside", "released", "--out", out)
    small = ("--runs", 2, "--trials", 40, "--tasks", "ascending,descending")
    code, text, _ = coartic(*command, *small)
    assert code == 0
    assert text.startswith("14 runs (10 reused)")
    assert coartic(*command, *small)[1].startswith("14 runs (14 reused)")
    methods = set(load(out).runs.method)
    assert methods == {"my-search", *load(shipped).runs.method}
    assert coartic("verify", out)[0] == 0
    for wrong, said in (
        (("run", "paper", "--beside", "released"), "--beside needs a method to run"),
        (("run", "quick", *command[2:]), "no results of suite 'quick' are released"),
        ((*command, *small, "--seed", 3), "the seed is 0 in the results that it is put beside"),
        (("new", "method", "cma-es/bandit"), "'cma-es/bandit' is already taken"),
        (("new", "method", "my search"), "letters, digits"),
        (("new", "method", "other", "--out", mine), "is there already"),
        (("new", "method", "other", "--out", tmp_path / "x.txt"), "must end in .py"),
    ):
        code, _, error = coartic(*wrong)
        assert code == 2
        assert said in error


@pytest.mark.usefixtures("in_this_process")
def test_merge_command(coartic, shipped, tmp_path):
    shutil.copytree(shipped, tmp_path / "other")
    code, text, _ = coartic("merge", shipped, tmp_path / "other", "--out", tmp_path / "both")
    assert code == 0
    assert "both: 10 runs (10 of them in more than one folder), each scored again." in text
    assert coartic("merge", shipped, "--out", tmp_path / "c")[0] == 2


def written_by_hand(study):
    """Best cost so far at each improvement, from the reward of every trial; how many trials."""
    for run_id, rewards in study.rewards():
        costs = np.where(np.isnan(rewards), FAILED, -rewards).tolist()
        better = [n for n in range(len(costs)) if n == 0 or costs[n] < min(costs[:n])]
        yield run_id, [(n + 1, costs[n]) for n in better], len(costs)


def test_export_for_iohprofiler(coartic, tmp_path):
    """Files line by line, and what IOHinspector reads of them: runs and times to a target."""
    methods = ["dual-process/EC1", "dual-process/EC1-uncorrected", "corrective-alone/given"]
    tasks = ["ascending", "one-armed/v1/i003"]
    study = run_and_write(tmp_path / "runs", of(methods, tasks), runs=3, trials=60)
    planner = of(["trajectory-optimisation/path-length"], ["ascending"])
    run_and_write(tmp_path / "planner", planner)
    assert coartic("export", tmp_path / "planner", "--ioh")[0] == 2  # it makes no trials
    assert coartic("export", tmp_path / "runs")[0] == 2  # in which format?
    code, text, _ = coartic("export", tmp_path / "runs", "--ioh", "--out", tmp_path / "ioh")
    assert (code, "3 methods in 12 files" in text) == (0, True)
    by_id = {run_id: rest for run_id, *rest in written_by_hand(study)}
    read = {}
    for path in (tmp_path / "ioh").rglob("*.json"):
        said = json.loads(path.read_text())
        assert not said["maximization"]
        for scenario in said["scenarios"]:
            blocks = (path.parent / scenario["path"]).read_text().split("evaluations raw_y\n")[1:]
            lines = [[tuple(map(int, line.split())) for line in b.splitlines()] for b in blocks]
            key = said["algorithm"]["name"], said["function_name"]
            read[key] = list(zip(scenario["runs"], lines, strict=True))
            assert scenario["dimension"] == (3 * 10 if key[1] == "ascending" else 4 * 9)  # y locked
    assert {function for _, function in read} == {"ascending", "one-armed/v1/i"}
    for (task, label), cell in study.cells.items():
        runs = read[label, function_of(study.tasks[task])]
        for run_id, (run, lines) in zip(cell.runs.run_id, runs, strict=True):
            steps, trials = by_id[run_id]
            assert lines == steps + [(trials, steps[-1][1])] * (steps[-1][0] < trials)
            assert (run["evals"], run["best"]["evals"], run["best"]["y"]) == (trials, *steps[-1])
            assert run["instance"] == (3 if "/" in task else 1)
    inspector = pytest.importorskip("iohinspector")
    manager = inspector.DataManager()
    manager.add_folder(str(tmp_path / "ioh"))
    assert manager.n_runs == len(by_id)
    data = manager.load(monotonic=True, include_meta_data=True)
    of_ec1 = data.filter((data["algorithm_name"] == methods[0]) & (data["function_id"] == 1))
    steps = [by_id[run_id] for run_id in study.cells["ascending", methods[0]].runs.run_id]
    found = of_ec1.group_by("run_id", maintain_order=True).agg("evaluations", "raw_y").to_dicts()
    assert [list(zip(f["evaluations"], f["raw_y"], strict=True)) for f in found] == [
        of_run for of_run, _ in steps
    ]
    target = sorted(of_run[-1][1] for of_run, _ in steps)[1]  # two of three runs reach it
    table = inspector.metrics.aggregate_running_time(
        of_ec1, f_min=target, f_max=target + 49, scale_f_log=False, eval_max=60
    )
    hit = [min((n for n, cost in of_run if cost <= target), default=0) for of_run, _ in steps]
    ert = sum(n or 60 for n in hit) / sum(map(bool, hit))
    assert table.ERT[table.raw_y == target].item() == ert
