"""Study worlds: its rules on made-up runs, and its shipped tables, computed again by csv alone."""

import csv
import lzma
from statistics import fmean

import numpy as np
import pandas as pd
import pytest

from coartic import load_task
from coartic.benchmarks.planning import plan_suite
from tests.support.processes import ROOT, programs

FOLDER = ROOT / "studies" / "worlds"
SETTINGS, PROTOCOLS, STUDY = programs("worlds", "settings", "protocols", "study")
METHODS = ("learner", "random-search", "policy-gradient", "cma-es/bandit")


def made_up(failed=()):
    """Runs on two tasks, with ticks 100 to 119; the corrective process takes 200."""
    rows = [
        {
            "world": "paper", "group": "one-armed", "task": f"one-armed/v1/i{task}", "run": run,
            "method": method, "ticks": np.nan if (task, method, run) in failed
            else 100.0 + 10 * task + 3 * METHODS.index(method) + run, "alone": 200.0,
            "first": np.nan if (task, method, run) in failed else 1.0 * run + 5 * task,
        }
        for task in range(2) for method in METHODS for run in range(2)
    ]  # fmt: skip
    return pd.DataFrame(rows)


def test_values_are_means_of_runs_in_per_cent_of_the_corrective_process():
    found = STUDY.values_of(made_up(), "learner-gains")
    assert found.value.tolist() == pytest.approx([1.5, 1.5])  # 3 of 200 ticks
    assert STUDY.values_of(made_up(), "cma-es-ahead").value.tolist() == pytest.approx([-4.5] * 2)
    assert STUDY.values_of(made_up(), "first-movement-slower").value.tolist() == [0.0, 0.0]
    assert found.runs.tolist() == [4, 4]
    assert found.failed.tolist() == [0, 0]


def test_a_failed_run_counts_as_the_worst_of_any_method_and_has_no_signature():
    runs = made_up({(0, "learner", 1)})
    found = STUDY.values_of(runs, "learner-gains")
    # Task 0: random search 103, 104; learner 100 and the worst run of CMA-ES, 110.
    assert found.value.tolist() == pytest.approx([100 * (103.5 - 105) / 200, 1.5])
    assert found.failed.tolist() == [1, 0]
    first = STUDY.values_of(runs, "first-movement-slower")
    assert first.value.tolist() == pytest.approx([100 * (0 - 0.5) / 200, 0.0])
    assert first.lost.tolist() == [1, 0]
    every = {(0, method, run) for method in METHODS for run in range(2)}
    assert STUDY.values_of(made_up(every), "learner-gains").value.isna().tolist() == [True, False]


def test_verdicts():
    rng = np.random.default_rng(1)
    noise = rng.normal(size=20)
    one = np.append(np.full(19, -0.01), 8.0) + 0.01 * noise  # a single task makes the mean
    skewed = np.exp(1.6 * rng.normal(size=20)) - 0.2
    cells = {"ahead": 3 + noise, "behind": -3 + noise, "nothing": noise - noise.mean(),
             "one": one, "equal": np.zeros(20)}  # fmt: skip
    found = STUDY.verdicts(cells)
    assert found.verdict.to_dict() == {
        "ahead": "holds", "behind": "reversed", "nothing": "open", "one": "open", "equal": "open"
    }  # fmt: skip
    assert found.without["one"] == "open"
    assert [*STUDY.two_tailed_verdicts(cells)] == ["holds", "reversed", "open", "open", "open"]
    alone = STUDY.verdicts({"skewed": skewed})
    many = STUDY.verdicts(dict.fromkeys(range(30), skewed))
    assert (many.p >= alone.p.iloc[0]).all()  # Holm
    assert many.skewness.iloc[0] > 2
    values = [
        *np.linspace(-0.35, 0.65, 18),
        1.5,
        4.0,
    ]  # p is 0.014 for the fourth part of the level
    unsure = STUDY.verdicts(dict.fromkeys(range(4), values)).iloc[0]
    assert [unsure.all_tasks, unsure.without, unsure.verdict] == ["holds", "holds", "open"]
    values = [-0.4, -0.1, 0.0, 0.3, 0.4, 0.6, 0.6, 0.7, 1.0, 1.1, 1.1, 4.2]
    unsure = STUDY.verdicts(dict.fromkeys(range(2), values)).iloc[0]  # p is 0.003 and 0.022
    assert unsure.p < 0.01 < unsure.p_without
    assert [unsure.all_tasks, unsure.without, unsure.verdict] == ["holds", "holds", "open"]


def test_the_first_verdicts_are_those_of_the_runs_that_the_first_matrix_had():
    leans = pd.DataFrame(
        [
            {"world": "maximum", "pair": f"i{pair}", "part": part, "method": method,
             "lean": 10.0 + pair, "asked": 10, "failed": 0}
            for pair in range(5) for part in ("all", "joints")
            for method in ("learner", "random-search")
        ]
    )  # fmt: skip
    parts = []
    for world in ("maximum", "base-4"):
        for task in range(8):
            of_task = made_up().query("task == 'one-armed/v1/i0'")
            later = of_task.run > 0  # later runs turn the sign of the learner's gain
            ticks = of_task.ticks.mask(later & (of_task.method == "learner"), 300.0)
            ticks = ticks + task * of_task.method.map(METHODS.index) / 8
            parts.append(of_task.assign(world=world, task=f"one-armed/v1/i{task}", ticks=ticks))
    runs = pd.concat(parts)
    found = STUDY.tabulate(runs, leans).verdict
    first = STUDY.first_verdicts(runs, leans)
    for world, verdict in (("maximum", "reversed"), ("base-4", "holds")):
        row = f"learner-gains {world} one-armed"
        assert [found[row], first[row]] == ["reversed", verdict]


def test_worlds_differ_in_one_thing_each_and_their_tasks_in_nothing_else(tmp_path):
    for world in SETTINGS.WORLDS.values():
        changed = len(world.model) + (world.radius is not None)
        assert changed == (world.name != "paper")
    world = SETTINGS.WORLDS["radius-0.3"]
    tasks, pairs = PROTOCOLS.places_of(world, tmp_path, "d000..d000")
    made = load_task(tasks["aligned/v1/d000"])
    assert made.radius == 0.3
    assert made.goals == load_task("aligned/v1/d000").goals
    assert load_task(pairs["d000-back"]).radius == 0.3
    file = tmp_path / "suite.toml"
    noisy = SETTINGS.WORLDS["noise-0.01"]
    blocks = PROTOCOLS.blocks_of(noisy, tmp_path, "d000..d000", SETTINGS.STAGES)
    file.write_text(PROTOCOLS.head("noise", noisy) + blocks, "utf-8")
    cells = [job.cell for job in plan_suite(file)]
    assert {cell.model.motor_noise for cell in cells} == {0.01}
    assert {cell.task.name for cell in cells} == {
        *(f"{family}/v1/d000" for family in SETTINGS.FAMILIES), "d000-goal", "d000-back"
    }  # fmt: skip


def test_names_of_tasks():
    for name in ("ascending", "two-armed-1", "i200-goal", "one-armed/v1/i200"):
        assert STUDY.base_name(name) == name
    assert STUDY.base_name("two-armed-1-radius-0.02") == "two-armed-1"
    assert STUDY.base_name("two-armed-i200-radius-0.02") == "two-armed/v1/i200"


def shipped():
    """The rows that ship, as a list of dicts, and the results by claim, world and group."""
    text = lzma.decompress((FOLDER / "runs.csv.xz").read_bytes()).decode()
    with open(FOLDER / "results.csv", encoding="utf-8") as file:
        results = {(row["claim"], row["world"], row["group"]): row for row in csv.DictReader(file)}
    return [*csv.DictReader(text.splitlines())], results


def ticks_of(rows):
    """Ticks of runs; a failed run has those of the worst."""
    known = [float(row["ticks"]) for row in rows if row["ticks"]]
    return {row["run_id"]: float(row["ticks"]) if row["ticks"] else max(known) for row in rows}


def test_the_shipped_matrix_follows_from_the_shipped_rows():
    rows, results = shipped()
    ahead = {"learner-gains": ("random-search", "learner"),
             "cma-es-ahead": ("learner", "cma-es/bandit"),
             "policy-gradient-ahead": ("learner", "policy-gradient")}  # fmt: skip
    of_task = {}
    for row in rows:
        if row["world"] == SETTINGS.LONG.name:
            continue  # described, without a verdict
        of_task.setdefault((row["world"], row["group"], row["task"]), []).append(row)
    values = {}
    for (world, group, _), runs in of_task.items():
        ticks, alone = ticks_of(runs), float(runs[0]["alone"])
        for claim, (more, fewer) in ahead.items():
            mine, other = (
                fmean(ticks[row["run_id"]] for row in runs if row["method"] == name)
                for name in (fewer, more)
            )
            values.setdefault((claim, world, group), []).append(100 * (other - mine) / alone)
        mine, other = (
            [float(row["first"]) for row in runs if row["method"] == name and row["first"]]
            for name in ("learner", "random-search")
        )
        if mine and other:
            slower = 100 * (fmean(mine) - fmean(other)) / alone
            values.setdefault(("first-movement-slower", world, group), []).append(slower)
    judged = 0
    for key, row in results.items():
        if not key[0].endswith(("leans", "lean")):
            assert float(row["value"]) == pytest.approx(fmean(values[key]), rel=1e-4, abs=1e-4)
            judged += row["verdict"] != ""
    assert judged >= 4 * 3 * 5
