"""What a report says it cannot show: every sentence where it is true, none where it is not."""

import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from coartic import load_task
from coartic.analysis.report.limitations import limitations
from coartic.analysis.results.optima import entries
from coartic.analysis.study import Study
from tests.support.made_up import replanned


@pytest.fixture(scope="module")
def study(traced):
    return traced


@pytest.fixture(scope="module")
def results(traced):
    return traced.results


def said(of):
    return {text.partition("*")[2].partition(".*")[0]: text for text in limitations(of)}


def changed(of, column, values):
    """The study with a column of its runs replaced in some rows, by their number."""
    runs = of.results.runs.copy()
    for row, value in values.items():
        runs.loc[row, column] = value
    return Study(replace(of.results, runs=runs))


def of_tasks(of, *tasks):
    """The study as if its folder had these tasks only."""
    kept = {task.name: task.model_dump(mode="json") for task in tasks}
    cells = [cell for cell in of.results.manifest.specification.cells if cell.task in kept]
    manifest = replanned(of.results.manifest, tasks=kept, cells=tuple(cells))
    runs = of.results.runs
    runs = runs[runs.task.isin(list(kept))]
    return Study(replace(of.results, manifest=manifest, runs=runs))


@pytest.fixture
def clean(study):
    """One one-armed task, all at one clean commit."""
    one = of_tasks(study, load_task("ascending"))
    runs = one.results.runs.assign(commit="a" * 40)
    return Study(replace(one.results, runs=runs))


def test_a_clean_folder(clean):
    found = said(clean)
    assert list(found) == [
        "Learned reward", "Failures", "Trials", "Number of runs", "One seed", "Times", "Model",
        "One posture",
    ]  # fmt: skip
    runs = len(clean.results.runs)
    assert found["Failures"].endswith(
        f"None: of {runs} runs each has a solution, executed and scored."
    )
    assert "run once" in found["One seed"]
    assert "The paper has 20 runs a cell; here are 4." in " ".join(limitations(clean))


def test_reconstructed_and_chosen_tasks(study, clean):
    found = said(study)
    assert "two-armed-1" in found["Reconstructed"]
    assert "goals (" in found["Reconstructed"]
    assert "Arms" in found
    assert not {"Reconstructed", "Not the paper's", "Arms"} & set(said(clean))
    own = load_task("ascending").model_copy(
        update={"provenance": {**load_task("two-armed-1").provenance}}
    )
    entry = {"goals": own.provenance["goals"].model_copy(update={"status": "chosen"})}
    own = own.model_copy(update={"provenance": entry})
    assert "ascending: goals chosen" in said(of_tasks(study, own))["Not the paper's"]


def test_failures(clean):
    rows = clean.cells["ascending", "dual-process/EC1"].runs.index
    broken = changed(clean, "status", dict.fromkeys(rows[:2], "crashed"))
    broken = changed(broken, "reason", {rows[0]: "exit *7*", rows[1]: "exit 8"})
    text = said(broken)["Failures"]
    assert "ascending: 2 runs are crashed (exit \\*7\\*, and other reasons): " in text
    assert "`dual-process/EC1` (2 of 4)" in text
    assert "None" not in text
    slow = changed(broken, "status", {rows[1]: "timeout"})
    assert len([t for t in limitations(slow) if t.startswith("*Failures.*")]) == 2


def test_failed_trials(clean):
    rows = clean.cells["ascending", "dual-process/EC1"].runs.index
    assert "Failed trials" not in said(changed(clean, "failed_trials", {rows[0]: 5}))
    text = said(changed(clean, "failed_trials", {rows[0]: 6}))["Failed trials"]
    assert "ascending, `dual-process/EC1` 6 of 600 (1 %)" in text


def test_learned_reward_beside_its_replay(clean):
    runs = clean.cells["ascending", "dual-process/EC1"].good
    text = said(clean)["Learned reward"]
    learned, replayed = (f"{column.mean():.1f}" for column in (runs.reward, runs.replay_reward))
    assert f"ascending EC1 {learned} ({replayed})".replace("-", "−") in text
    assert runs.replay_reward.mean() <= runs.reward.mean()
    missing = changed(clean, "replay_reward", {runs.index[0]: None})
    assert "Learned reward" not in said(missing)


def test_what_is_not_as_printed(clean):
    """-303 is printed: runs that get -319 and less differ, runs that get -303 do not."""
    rows = clean.cells["ascending", "dual-process/EC1"].runs.index
    trials = changed(clean, "trials", dict.fromkeys(rows, 10_000))
    poor = changed(trials, "reward", {row: -319 - k for k, row in enumerate(rows)})
    assert "ascending EC1: learned reward −320.5, printed −303." in said(poor)["Not reproduced"]
    good = changed(trials, "reward", {row: -303 + k % 2 for k, row in enumerate(rows)})
    assert "Not reproduced" not in said(good)
    assert "Not reproduced" not in said(changed(poor, "trials", dict.fromkeys(rows, 150)))


def test_mixed_versions(clean):
    rows = list(clean.results.runs.index)
    mixed = changed(clean, "commit", {rows[0]: "b" * 40})
    text = said(mixed)["Mixed versions"]
    assert "2 commits (`aaaaaaaaaaaa`, `bbbbbbbbbbbb`); the code behind" in text
    dirty = said(changed(clean, "commit", {rows[0]: "a" * 40 + "+"}))
    assert "Mixed versions" not in dirty
    assert "`aaaaaaaaaaaa`" in dirty["Uncommitted changes"]
    assert (
        "1 run was made outside"
        in said(changed(clean, "commit", {rows[0]: pd.NA}))["Unknown commit"]
    )
    assert (
        "2 sets of library versions"
        in said(changed(clean, "packages", {rows[0]: "x"}))["Mixed versions"]
    )


def test_trials_and_runs_as_in_the_paper(clean):
    runs = clean.results.runs.copy()
    runs.loc[runs.method == "dual-process/EC1", "trials"] = 10_000
    texts = limitations(Study(replace(clean.results, runs=runs)))
    assert not any(text.startswith("*Trials.*") for text in texts)
    learner = runs[runs.method == "dual-process/EC1"]
    many = pd.concat([runs, *[learner.assign(run_id=f"x{k}" + learner.run_id) for k in range(4)]])
    texts = limitations(Study(replace(clean.results, runs=many)))
    assert not any("The paper has 20 runs" in text for text in texts)
    assert any("n = 20" in text for text in texts)


def welch_power(difference, sd, n):
    """P(a one-tailed t-test at 5 % finds it), for two samples of equal variance."""
    freedom = 2 * n - 2
    return stats.nct.sf(stats.t.ppf(0.95, freedom), freedom, difference / (sd * (2 / n) ** 0.5))


def test_differences_that_are_found(study):
    """Each printed difference is found with probability 80 %, by the rewards of the runs."""
    (text,) = (t for t in limitations(study) if "a one-tailed t-test at 5 % finds" in t)
    assert "with probability 80 %" in text
    found = re.findall(r"([\w-]+) (EC\d) ([\d.]+) ticks \(([\d.]+) %, n = (\d+)\)", text)
    runs = study.results.runs
    optimum = {e.task: e.reward for e in entries() if (e.base, e.other_arm) == ("task", "free")}
    spread = {}
    for key, own in runs[runs.variant == ""].groupby(["task", "method"]):
        if not key[1].startswith("dual-process/EC"):
            continue
        sd = np.std(own.reward.to_numpy(dtype=float), ddof=1)
        if sd > 0:
            spread[key[0], key[1][-3:]] = sd
    assert {(task, condition) for task, condition, *_ in found} == set(spread)
    assert len(spread) > 1
    for task, condition, ticks, share, n in found:
        sd = spread[task, condition]
        assert n == "4"
        assert welch_power(float(ticks) - 0.05, sd, 4) <= 0.8 <= (
            welch_power(float(ticks) + 0.05, sd, 4)
        )  # fmt: skip
        # The share is of the difference before rounding.
        assert float(share) == pytest.approx(100 * float(ticks) / -optimum[task], abs=0.08)


def test_few_runs(clean):
    manifest = replanned(clean.results.manifest, runs=1)
    runs = clean.results.runs
    one = Study(replace(clean.results, manifest=manifest, runs=runs[runs.run == 0]))
    found = said(one)
    assert "No cell has the three runs" in found["One seed"]
    assert "run once" not in found["One seed"]
    assert "t-test" not in " ".join(limitations(one))


def test_optima(study, clean):
    assert not {"No optimum", "Optimum not proven"} & set(said(clean))
    own = load_task("ascending").model_copy(update={"radius": 0.2})
    assert "known of ascending: no gaps" in said(of_tasks(study, own))["No optimum"]
    # A search of one's own that proves nothing.
    runs = of_tasks(study, own).results.runs
    plan = runs.method == "trajectory-optimisation/path-length"
    search = runs[plan].assign(
        method="optimum/multistart", parameters='{"other_arm": "free"}', run_id="y"
    )
    found = of_tasks(study, own)
    searched = Study(replace(found.results, runs=pd.concat([runs, search])))
    text = said(searched)["Optimum not proven"]
    assert f"other arm free: {search.reward.iloc[0]} is the best of the searches." in text
    bound = Study(replace(found.results, runs=pd.concat([runs, search.assign(proven_bound=-10)])))
    assert "none above -10 is proven" in said(bound)["Optimum not proven"]


def test_warming_up(clean):
    lost = changed(clean, "warm", dict.fromkeys(clean.results.runs.index, pd.NA))
    assert "0 % of the runs" in said(lost)["Times"]
    assert (
        "0 % of the runs"
        in said(Study(replace(clean.results, runs=clean.results.runs.assign(warm=True))))["Times"]
    )
    assert (
        "100 % of the runs"
        in said(Study(replace(clean.results, runs=clean.results.runs.assign(warm=False))))["Times"]
    )
