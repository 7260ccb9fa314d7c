"""``coartic analyse``: the pages and tables that it writes, checked against the runs."""

import re
import shutil

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from analysis.results.folder import load_results
from analysis.signatures.page import signatures_page
from analysis.statistics.hypotheses import holm
from analysis.study import Study
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


def tables(page):
    """Rows by method of every table of a page, by its title and the task it stands under."""
    found, task = {}, ""
    for block in page.split("\n\n"):
        if block.startswith("## "):
            task = block.removeprefix("## ").removesuffix(" †")
        elif block.startswith("### "):
            title = block.removeprefix("### ")
        elif block.startswith("| "):
            head, _, *rows = ([cell.strip() for cell in line.split("|")[1:-1]]
                              for line in block.splitlines())  # fmt: skip
            found[task, title] = {row[0]: dict(zip(head, row, strict=True)) for row in rows}
    return found


def test_the_page_of_signatures_says_what_the_runs_say(results):
    study = Study(results)
    page = signatures_page(study)
    assert page == signatures_page(Study(results))
    found = tables(page)
    for task in ("ascending", "descending", "two-armed-1"):
        for label, row in found[task, "How it moves"].items():
            runs = study.cells[task, label].runs
            shorter = (runs.initial_reward - runs.reward).dropna().to_numpy(dtype=float)
            assert row["runs"] == str(len(runs))
            if len(shorter) > 1:
                half = stats.t.ppf(0.975, len(shorter) - 1) * stats.sem(shorter)
                shown = row["total, ticks"].split(" ± ")
                rounding = 0.501 * 10.0 ** -len(shown[0].partition(".")[2])
                assert float(shown[0]) == pytest.approx(shorter.mean(), abs=rounding)
                assert float(shown[1]) == pytest.approx(half, abs=rounding)
    two_armed = found["two-armed-1", "How it moves"]
    rewards = [study.cells["two-armed-1", label].runs.reward.mean() for label in two_armed]
    assert rewards == sorted(rewards, reverse=True)
    assert "hand entropy, bit" not in found["ascending", "How it moves"]["dual-process/EC1"]
    assert "base y reversals, count" not in two_armed["dual-process/EC3"]
    assert "EC1" not in "".join(found["two-armed-1", "The other arm"])  # one hand all along
    assert re.search(r"Without values \(.*\): dual-process/EC1\.", page)


def test_every_signature_of_a_task_is_on_the_page(results):
    """By hand sequence, goal and subspace, from what the frame says of the same place."""
    study = Study(results)
    found = tables(signatures_page(study))
    frame = study.signatures
    frame = frame[(frame.task == "two-armed-1") & (frame.label == "dual-process/EC4")]
    runs = study.cells["two-armed-1", "dual-process/EC4"].runs
    row = found["two-armed-1", "Hands"]["dual-process/EC4"]
    counts = runs.hands.value_counts()
    assert set(row["hands"].split(", ")) == {f"{hands} {n}" for hands, n in counts.items()}
    for goal in range(1, 5):
        where = frame["where"].str.startswith(f"goal {goal}")
        own = frame[where].set_index("signature").value

        def shown(table, column, goal=goal):
            text = found["two-armed-1", table]["dual-process/EC4"][f"goal {goal}, {column}"]
            return float(text.split()[0])

        near = {"rel": 0.06, "abs": 0.5}
        assert shown("Hands", "as in isolation, share") == own["hand as in isolation"]
        assert shown("Travel of the other arm", "rad") == pytest.approx(
            own["travel of the other arm"], rel=0.06
        )
        for name in ("V_ucm", "V_ort", "ΔV") if counts.iloc[0] > 1 else ():
            value = shown("Synergy: V_ucm, V_ort and ΔV", name)
            assert value == pytest.approx(own[name], rel=0.006)
        if goal > 1:
            value = shown("Further goals", "against isolated, ticks")
            assert value == pytest.approx(own["subtask against isolated reach"], **near)
        if goal in (2, 3):
            value = shown("Further goals", "turn, rad")
            assert value == pytest.approx(own["turning angle"], rel=0.06)


def test_rounding_is_not_shown(results):
    """A path that goes straight on turns by 3e-11 rad: by nothing."""
    study = Study(results)
    turns = (study.signatures.signature == "turning angle") & (
        study.signatures["where"] == "goal 1"
    )
    study.signatures.loc[turns, ["value", "low", "high"]] = [3.28e-11, np.nan, np.nan]
    row = tables(signatures_page(study))["ascending", "How it moves"]["dual-process/EC1"]
    assert row["turn at goal 1, rad"] == "0"


def test_p_values_are_adjusted_within_their_table(results):
    study = Study(results)
    page = signatures_page(study)
    found = tables(page)
    title = "ascending, goal 1, right hand, against descending"
    raw = study.signatures[
        (study.signatures.task == "ascending") & study.signatures["where"].str.contains("against")
    ]
    raw = raw[raw.label == "dual-process/EC1"].dropna(subset="p").set_index("signature").p
    assert len(raw) == 3
    adjusted = dict(zip(raw.index, holm(raw.tolist()), strict=True))
    row = found["Between contexts", title]["dual-process/EC1"]
    for name, head in (
        ("context dependence", "dependence, pooled SD"),
        ("motor-equivalent part", "motor-equivalent part"),
    ):
        assert float(row[head].partition(", p ")[2]) == pytest.approx(adjusted[name], rel=0.05)
    alone = found["Between contexts", title]["corrective-alone/given"]
    assert alone["distance"] == "0"
    letter = alone["dependence, pooled SD"].removeprefix("– ")
    assert f"{letter} one run a context" in page


def test_locus_slopes_are_on_the_page(results):
    study = Study(results)
    found = tables(signatures_page(study))
    (title,) = [
        title for task, title in found if task == "Locus slopes" and "anticipatory" in title
    ]
    row = found["Locus slopes", title]["dual-process/EC1"]
    assert row["runs"] == "12"
    frame = study.signatures.set_index(["signature", "where"])
    slope = frame.loc[("locus slope", "goal 1, anticipatory of goal 2, right hand, base_y")]
    value, _, rest = row["base_y"].partition(" ± ")
    assert float(value) == pytest.approx(slope.value, abs=10.0 ** -len(value.partition(".")[2]))
    half = (slope.high - slope.low) / 2
    assert float(rest.partition(",")[0]) == pytest.approx(half, rel=0.06)
    assert "left_1" not in row
    norms = study.signatures[study.signatures.signature == "locus slope norm"].dropna(subset="p")
    norms = norms[norms["where"] == "goal 1, anticipatory of goal 2, right hand"]
    shown, _, p = row["norm"].partition(", p ")
    assert float(shown) == pytest.approx(norms.value.item(), rel=0.006)
    assert float(p) == pytest.approx(norms.p.item(), rel=0.06)  # the only one of its table


def test_analyse_writes_all_it_names(results, monkeypatch, capsys, tmp_path):
    folder = shutil.copytree(results.folder, tmp_path / "copy")
    code, text, _ = call(monkeypatch, capsys, "analyse", folder)
    assert code == 0
    assert all(name in text for name in WRITTEN)
    first = {name: (folder / name).read_bytes() for name in WRITTEN}
    assert call(monkeypatch, capsys, "analyse", folder)[0] == 0
    assert first == {name: (folder / name).read_bytes() for name in WRITTEN}
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
