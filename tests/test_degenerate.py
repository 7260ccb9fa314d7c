"""Folders without any spread, or next to nothing in them, through every command; and the mean."""

import json
import re
import shutil

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from coartic import load_task
from coartic.analysis import study
from coartic.analysis.figures import REGISTER, Figures, register
from coartic.analysis.figures.style import ONE, on_a_phone
from coartic.analysis.signatures.context import context_dependence, distance, permutation_p
from coartic.analysis.signatures.locus import locus_slopes, slope_norm
from coartic.analysis.signatures.manifold import movable, synergy
from coartic.analysis.statistics import intervals, spread
from coartic.analysis.statistics.across_tasks import interquartile_mean
from coartic.analysis.statistics.equivalence import bootstrap_equivalence, difference
from coartic.analysis.statistics.hypotheses import bootstrap_test, permutation_test, standard_error
from tests.support.commands import call

STUCK = """
name = "stuck"
goals = [[2.0, 0.1]]
initial_hands = "R"
locked_base = ["x", "y"]
[start]
base = [0.0, 0.0]
left = [0.0, 0.0, 0.0, 0.0]
right = [0.0, 0.0, 0.0, 0.0]
[provenance]
goals = { status = "chosen", source = "in line with the stretched arm: J'e is 0" }
start = { status = "chosen", source = "as the goals" }
"""
EQUAL = """
title = "All equal"
description = "Without noise every run of a condition is the same."
runs = 4
trials = 3
[[cells]]
tasks = ["ascending", "descending"]
methods = ["dual-process/EC1"]
parameters = { noise_sd = 0.0 }
[[cells]]
tasks = ["two-armed-1"]
methods = ["dual-process/EC3", "dual-process/EC4"]
parameters = { noise_sd = 0.0 }
"""
OPTIMUM = """
title = "Optimum alone"
description = "A method without trials, and nothing beside it."
runs = 1
[[cells]]
tasks = ["ascending"]
methods = ["optimum/dynamic-programming"]
parameters = { nodes = 10, graphs = 1, chains = 1 }
"""
FOLDERS = {
    "one run of one trial": "paper --runs 1 --trials 1 --tasks ascending,descending",
    "two runs of two trials": "paper --runs 2 --trials 2 --tasks two-armed-2",
    "all equal": "equal.toml",
    "all failed": "paper --runs 3 --trials 3 --task-file stuck.toml --tasks stuck",
    "some failed": "quick --runs 2 --trials 5 --task-file stuck.toml --tasks stuck "
    "--methods EC1,random-search/climbing",
    "one method": "quick --tasks ascending,two-armed-1 --methods corrective-alone/given",
    "one cell": "paper --runs 3 --trials 20 --tasks ascending",
    "optimum alone": "optimum.toml",
}
NONSENSE = re.compile(r"\bnan\b|\binf\b|<NA>|\b0 of 0\b")


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Results folders by name, each made by the command line when first asked for."""
    home = tmp_path_factory.mktemp("degenerate")
    (home / "stuck.toml").write_text(STUCK, encoding="utf-8")
    (home / "equal.toml").write_text(EQUAL, encoding="utf-8")
    (home / "optimum.toml").write_text(OPTIMUM, encoding="utf-8")
    made = {}

    def folder(name, monkeypatch, capsys):
        if name not in made:
            out = home / name
            words = [home / w if w.endswith(".toml") else w for w in FOLDERS[name].split()]
            code, text, error = call(monkeypatch, capsys, "run", *words, "--out", out)
            assert code == 0, error
            assert not NONSENSE.search(shown(text))
            made[name] = out
        return made[name]

    return folder


def shown(text):
    """A text without the folders' own names."""
    return "\n".join(line for line in text.splitlines() if " runs: " not in line)


@pytest.mark.parametrize("name", FOLDERS)
@pytest.mark.usefixtures("in_this_process", "undrawn", "read_once")
def test_every_command(name, folders, monkeypatch, capsys, tmp_path):
    folder = folders(name, monkeypatch, capsys)
    other = folders("one run of one trial", monkeypatch, capsys)
    copy = shutil.copytree(folder, tmp_path / "copy")  # before anything is written beside it
    runs = pd.read_parquet(folder / "runs.parquet")
    run, solved = runs.run_id.iloc[-1], bool((runs.status == "ok").iloc[-1])
    for expected, *arguments in (
        (0, "analyse", folder),
        (0, "report", folder),
        (0, "compare", copy, folder, "--out", tmp_path / "same.md"),
        (0, "compare", copy, other, "--out", tmp_path / "other.md"),
        (0, "compare", other, copy, "--out", tmp_path / "turned.md"),
        (0, "cite", folder, "--analysis"),
        (0, "show", run, "--in", folder),
        (0, "reproduce", run, "--in", folder),
        *([] if solved else [(2, "animate", run, "--in", folder, "--out", tmp_path / "run.gif")]),
    ):
        code, text, error = call(monkeypatch, capsys, *arguments)
        assert code == expected, (arguments, error)
        assert "Traceback" not in error
        assert not NONSENSE.search(shown(text)), arguments
    assert "identical" in (tmp_path / "same.md").read_text(encoding="utf-8")
    macros = re.findall(
        r"(?m)^\\newcommand\{\\(\w+)\}", (folder / "report/numbers.tex").read_text()
    )
    assert macros or not (runs.status == "ok").any()
    for macro in {*macros[:1], *macros[-1:]}:
        code, text, error = call(monkeypatch, capsys, "trace", macro, "--in", folder)
        assert code == 0, error
        assert not re.search(r"\b(nan|inf)\b", text)
    pages = [*folder.glob("*.md"), *tmp_path.glob("*.md"), folder / "report" / "report.md"]
    for page in [*pages, folder / "report" / "numbers.tex", *folder.glob("report/tables/*.tex")]:
        found = NONSENSE.search(page.read_text(encoding="utf-8"))
        assert not found, (page.name, found)
    for table in folder.glob("*.csv"):
        rows = pd.read_csv(table).select_dtypes("number")
        for column in rows if table.name != "targets.csv" else ():
            assert not np.isinf(rows[column]).any(), (table.name, column)


@pytest.mark.usefixtures("in_this_process", "read_once")
def test_runs_that_are_equal_have_no_spread_anywhere(folders, monkeypatch, capsys):
    folder = folders("all equal", monkeypatch, capsys)
    assert call(monkeypatch, capsys, "analyse", folder)[0] == 0
    frame = pd.read_csv(folder / "signatures.csv")
    apart = frame.dropna(subset="low")
    share = apart.signature.str.contains("share|isolation|sacrificed|hands as")
    assert (apart.low[~share] == apart.high[~share]).all()
    for name in ("V_ucm", "V_ort", "ΔV", "ΔV z", "context dependence"):
        own = frame[frame.signature == name]
        assert own.value.isna().all()
        assert own.why_not.notna().all()
    tests = frame.dropna(subset="p")
    assert len(tests)
    assert set(tests.p[tests.signature.str.contains("context|part")]) == {1.0}
    assert (pd.read_csv(folder / "comparisons.csv").sd_first.dropna() == 0).all()


@pytest.mark.usefixtures("in_this_process", "read_once")
def test_figures_for_narrow_pages(folders, monkeypatch, capsys):
    """Which the reports above have none of."""
    of = study.load(folders("all equal", monkeypatch, capsys))
    monkeypatch.setattr(register, "REGISTER", [row for row in REGISTER if row.narrows])
    with on_a_phone():
        narrow = Figures(of).plots
    assert {"tasks", "recruitment"} <= {plot.id for plot in narrow}
    for plot in narrow:
        assert plot.figure.get_figwidth() == ONE
        assert not NONSENSE.search(f"{plot.caption} {plot.alt}")


# The mechanism


@given(st.floats(-1e6, 1e6), st.integers(1, 200))
def test_equal_values_have_their_own_mean(value, n):
    values = np.full(n, value)
    assert spread.mean(values) == value
    if n > 1:
        assert spread.variance(values) == 0
        assert spread.sd(values) == 0


@given(arrays(np.float64, st.tuples(st.integers(2, 30), st.integers(1, 4)),
              elements=st.floats(-1e3, 1e3)))  # fmt: skip
def test_other_means_are_numpys(values):
    """To the bit, unless rounding carries them out of their sample."""
    found, plain = spread.mean(values), values.mean(axis=0)
    inside = (values.min(axis=0) <= plain) & (plain <= values.max(axis=0))
    np.testing.assert_array_equal(found[inside], plain[inside])
    np.testing.assert_allclose(found, plain, rtol=1e-12, atol=1e-300)
    if inside.all():
        np.testing.assert_array_equal(spread.variance(values), values.var(axis=0, ddof=1))


@pytest.mark.parametrize("n", [1, 2, 3, 7, 8, 9, 15, 16, 20, 50, 127, 128, 129, 300])
@pytest.mark.parametrize("rows", [1, 5, 400])
def test_short_rows_are_added_as_numpy_adds(rows, n):
    """All at once, and to the bit the same."""
    rng = np.random.default_rng(n)
    drawn = rng.normal(-500, 20, (rows, n)), 0.1 * rng.integers(-2, 3, (rows, n))
    for values in (*drawn, drawn[0].T.copy().T):  # in memory by rows, and by columns
        means = np.clip(values.mean(axis=1), values.min(axis=1), values.max(axis=1))
        np.testing.assert_array_equal(spread.mean(values, -1), means)
        if n > 1:
            variances = values.var(axis=1, ddof=1, mean=means[:, None])
            for found, expected in zip(spread.moments(values), (means, variances), strict=True):
                np.testing.assert_array_equal(found, expected)


def test_numpys_mean_of_equal_rows_differs_from_them():
    """Or there would be nothing to mend."""
    assert (np.full(3, 0.1).mean() != 0.1) or np.full(3, 0.1).var()


@pytest.fixture(scope="module")
def posture():
    task = load_task("ascending")
    joints = movable(task, "right")
    q = np.array(task.q0)
    q[joints] += [0.1, -0.2, 0.3, -0.4, 0.5, 0.2]
    return q[joints], task.robot.jacobian(q, "right")[:, joints]


@pytest.mark.parametrize("n", [2, 3, 7, 3000])
def test_synergy_of_equal_runs(posture, n):
    q, jacobian = posture
    *parts, z = synergy(np.tile(q, (n, 1)), jacobian)
    assert np.isnan([*parts, *z]).all()


@pytest.mark.parametrize("counts", [(1, 1), (2, 1), (5, 5), (19, 1), (1500, 1500)])
def test_synergy_of_runs_on_a_line(posture, counts):
    """Two postures, however often: z is the same without any run, which is no certainty."""
    q, jacobian = posture
    away = q + np.array([0.03, -0.01, 0.02, 0.05, -0.04, 0.01])
    found = synergy(np.repeat([q, away], counts, axis=0), jacobian)
    assert np.isfinite([found.within, found.orthogonal, found.delta, found.z.value]).all()
    assert np.isnan(found.z[1:]).all()


def test_synergy_of_one_run_that_is_apart_in_one_space(posture):
    """Without it nothing is left to compare with: no interval, and no logarithm of rounding."""
    q, jacobian = posture
    _, _, directions = np.linalg.svd(jacobian)
    across, within = directions[0], directions[2:]
    runs = q + 0.05 * np.vstack([*within, across])
    found = synergy(runs, jacobian)
    assert np.isfinite(found.z.value)
    assert np.isnan(found.z.p)


def test_contexts_of_equal_runs(posture):
    q, _ = posture
    rng = np.random.default_rng(0)
    basis = np.linalg.qr(rng.normal(size=(len(q), 2)))[0]
    for first, second in ((3, 7), (20, 20), (1500, 700)):
        groups = np.tile(q, (first, 1)), np.tile(q, (second, 1))
        assert distance(*groups) == 0
        assert np.isnan(context_dependence(*groups))
        for part in (None, basis):
            assert permutation_p(*groups, rng, basis=part, resamples=99) == 1


def test_locus_of_equal_runs(posture):
    q, _ = posture
    places = np.repeat([0.0, 0.5, 1.0], [3, 7, 10])
    runs = np.tile(q, (20, 1))
    assert set(locus_slopes(runs, places)) == {(0.0, 0.0, 0.0, 1.0)}
    norm = slope_norm(runs, places, np.random.default_rng(0))
    assert (norm.value, norm.p) == (0.0, 1.0)


@pytest.mark.parametrize("n", [3, 7, 20, 3000])
def test_samples_of_equal_values(n):
    values = np.full(n, 0.1)
    assert intervals.mean(values)[:3] == (0.1, 0.1, 0.1)
    assert standard_error((values, values[:3])) == 0
    found = interquartile_mean({"task": values}, seed=0, resamples=99)
    assert found.estimate == found.low == found.high == 0.1
    assert np.isnan(bootstrap_test(values, 0.2, seed=0, resamples=99).p)
    assert permutation_test(values, values[:3], "two-sided", seed=0, resamples=99).p == 1
    for agreed in (
        bootstrap_equivalence(values, 0.1, 0.01, seed=0, resamples=99),
        difference(values, 0.1, None, 20, margin=0.01),
    ):
        assert agreed.low == agreed.high == agreed.estimate == 0
        assert agreed.verdict == "equivalent"


def test_resamples_without_spread_have_no_end():
    """All pairs but one equal: what rounding leaves of a variance would pass for an end."""
    ends = []
    for n in range(10, 30):
        pairs = np.zeros(n)
        pairs[-1] = 1.0
        found = bootstrap_equivalence(pairs, 0.0, 0.5, seed=0, resamples=199)
        ends += [found.low, found.high]
    assert all(abs(end) < 10 or np.isinf(end) for end in ends)
    assert np.isinf(ends).any()


@pytest.mark.usefixtures("in_this_process")
def test_json_of_a_folder_of_failures_is_json(folders, monkeypatch, capsys):
    folder = folders("all failed", monkeypatch, capsys)
    json.loads((folder / "manifest.json").read_text(), parse_constant=pytest.fail)
