"""Stored tables and figures are what the runs and rows that ship make, with the code of today.

Studies memory and noise have a test of their own, with fewer resamples.
"""

import sys
import tomllib
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from coartic.estimates import Estimate, difference_of_means, mean
from coartic.runs.shipped import shipped_hashes
from common import judging
from tests.support.pictures import draw_the_same
from tests.support.processes import ROOT, program, programs

STUDIES = ROOT / "studies"
STORED = ROOT / "docs" / "stored"
make_findings = program(ROOT / "docs" / "make_findings.py")
RESAMPLED = r"_low$|_high$|\bp\b|^p_|_p$|_p_|verdict|replicates|more_than|without|all_tasks"
"""Columns that depend on the number of resamples, which is smaller in tests."""
FEW = 99
"""Resamples in tests of studies. No column that is compared depends on them, but in study worlds,
which has more."""


@pytest.fixture(autouse=True)
def _few_resamples(monkeypatch):
    monkeypatch.setattr(judging, "RESAMPLES_OF_CLAIMS", FEW)


def without_interval(sample, other=0.0):
    """A mean, or a difference between two, as ``mean`` and ``difference_of_means`` estimate it."""
    return Estimate(float(np.mean(sample) - np.mean(other)))


def rows_of(study, name="runs.csv.xz", index=None):
    return pd.read_csv(STUDIES / study / name, index_col=index, low_memory=False)


def with_settings(study):
    """The rows of a study, as its results with runs and signatures."""
    return program(ROOT / "docs" / "scripts" / "calibrate_means.py").with_settings(rows_of(study))


def of_dial(_):
    study, shifts = programs("dial", "study", "shifts")
    runs = study.measure_runs(rows_of("dial"))
    moved = shifts.measure_shifts(rows_of("dial", "moved.csv"))
    return {
        "results": study.tabulate(runs),
        "named": study.tabulate_named(rows_of("dial", "named_runs.csv")),
        "claims": study.judge_claims(runs),
        "shifts": shifts.tabulate_shifts(moved),
        "shift_claims": shifts.judge_shifts(moved),
    }


def of_dose(_):
    (study,) = programs("dose", "study")
    return {"claims": study.judge_claims(study.measure_runs(with_settings("dose")))}


def of_plans(name, _):
    """Horizon and fourteen."""
    (study,) = programs(name, "study")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study, "tabulate_runs", lambda results: results.runs)
        tables = study.measure(with_settings(name))
    del tables["runs"]
    if name == "horizon":
        (given,) = programs("horizon", "given_hands")
        tables["given_hands"] = given.tabulate(rows_of("horizon", "given_hands.csv.xz", 0))
    return tables


def of_human(shipped):
    study, body_shares = programs("human", "study", "body_shares")
    study.RESAMPLES = body_shares.RESAMPLES = FEW
    body = body_shares.measure_body(shipped("comparison").worlds[""])
    tables = study.judge_all(rows_of("human", "effects.csv", 0), rows_of("human", index=0))
    return tables | {"body": body}


def of_optima(_):
    """But the CPU times, which are in a log that does not ship."""
    (study,) = programs("optima", "study")
    tables = study.tabulate(STUDIES / "optima")
    return tables | {"results": tables["results"].drop(columns="seconds")}


def of_people(_):
    """The comparison is a part of the stored table of contexts, which has a test of its own."""
    study, rules = programs("people", "study", "rules")
    contexts = pd.read_csv(ROOT / "docs" / "stored" / "comparison" / "contexts.csv", index_col=0)
    study.load = lambda _: SimpleNamespace(worlds={"": None})
    study.TABLES = {"contexts": lambda _: contexts}
    stored = rules.read(STUDIES / "people" / "postures.csv")
    counts = rules.contexts_of(stored[rules.left_out(stored) == ""])
    carried = rules.read(STUDIES / "people" / "carry_over_postures.csv")
    carried = rules.carried(carried[rules.left_out(carried) == ""])
    return study.measure() | {
        "power": rules.tabulate_power(counts),
        "carry_over_power": rules.tabulate_carry_over_power(carried),
    }


def of_practice(_):
    (study,) = programs("practice", "study")
    runs = study.measure_runs(rows_of("practice", index=0))
    return {"results": study.tabulate(runs), "effects": study.tabulate_effects(runs),
            "claims": study.judge_claims(runs),
            "hands": study.tabulate_hands(runs, rows_of("noise"))}  # fmt: skip


def of_replication(shipped):
    """But the claims on runs of suite ablations, which do not ship, and intervals in evidence."""
    study, protocols = programs("replication", "study", "protocols")
    study.load = shipped
    with pytest.MonkeyPatch.context() as patch:
        for name in ("comparisons", "families", "hands"):
            for estimate in (mean, difference_of_means):
                patch.setattr(sys.modules[name], estimate.__name__, without_interval, raising=False)
        tables = study.measure(["comparison", "families"])
    tables["claims"] = tables["claims"].query("suite != ''")
    return tables | {"ec4": protocols.tabulate_ec4(rows_of("replication"))}


def of_worlds(_):
    (study,) = programs("worlds", "study")
    runs = rows_of("worlds")
    judging.RESAMPLES_OF_CLAIMS = 999  # its control counts small p
    tables = {"results": study.tabulate(runs, rows_of("worlds", "leans.csv"))}
    tables["described"] = study.describe(runs)
    return tables | {"control": study.judge_control(rows_of("worlds", "control_values.csv"))}


MAKERS = {
    "dial": of_dial,
    "dose": of_dose,
    "fourteen": partial(of_plans, "fourteen"),
    "horizon": partial(of_plans, "horizon"),
    "human": of_human,
    "optima": of_optima,
    "people": of_people,
    "practice": of_practice,
    "replication": of_replication,
    "worlds": of_worlds,
}


@pytest.mark.parametrize("suite", shipped_hashes())
def test_tables_and_figures_of_a_shipped_suite_are_made_of_its_runs(suite, shipped_study, tmp_path):
    """Tables have six digits. Ends of intervals and p-values may differ by a tie of resamples."""
    todo = "make it again: PYTHONPATH=studies python docs/make_findings.py --from shipped"
    study = shipped_study(suite)
    sources = tomllib.loads((STORED / "SOURCES.toml").read_text("utf-8"))["tables"]
    tables = [file for table in sources if table.get("source") == suite for file in table["files"]]
    assert {ROOT / file for file in tables} == {*(STORED / suite).glob("*.csv")}
    for file in tables:
        name, _, world = Path(file).stem.partition("-in-")
        made = make_findings.make_table(study.worlds[world], name)
        made.to_csv(tmp_path / "made.csv", float_format="%.6g")
        made, stored = (
            pd.read_csv(path, index_col=0) for path in (tmp_path / "made.csv", ROOT / file)
        )
        assert [*made] == [*stored], f"{file}: {todo}"
        tied = made.columns.str.contains(r"_low$|_high$|\bp\b|^p_|_p$|_p_")
        for columns, rtol in ((~tied, 1e-5), (tied, 0.02)):
            pd.testing.assert_frame_equal(
                made.loc[:, columns], stored.loc[:, columns], rtol=rtol, atol=1e-9,
                obj=f"{file} ({todo})",
            )  # fmt: skip
    for figure in (STORED / suite).glob("*.svg"):
        drawn = make_findings.draw_figure(study.worlds[""], figure.stem)
        assert draw_the_same(drawn, figure.read_bytes()), f"{figure}: {todo}"


def stored_from_rows(study):
    """Names of the tables of a study that sources.toml says are made of what ships."""
    tables = tomllib.loads((STUDIES / study / "sources.toml").read_text("utf-8"))["tables"]
    made = [file for table in tables if table["source"] for file in table["files"]]
    return {file.rpartition("/")[2].removesuffix(".csv") for file in made}


def test_each_study_with_such_tables_makes_them_here_or_in_its_own_test():
    named = {path.parent.name for path in STUDIES.glob("*/sources.toml")}
    assert named == {*MAKERS, "memory", "noise"}


@pytest.mark.parametrize("name", MAKERS)
def test_stored_tables_are_made_of_what_ships(name, shipped_study, tmp_path):
    tables = MAKERS[name](shipped_study)
    assert {*tables} == stored_from_rows(name)
    for table, made in tables.items():
        made.to_csv(tmp_path / "made.csv", float_format="%.6g")
        made = pd.read_csv(tmp_path / "made.csv", index_col=0).sort_index(kind="stable")
        stored = pd.read_csv(STUDIES / name / f"{table}.csv", index_col=0)
        if (name, table) == ("replication", "claims"):
            stored = stored[stored.suite != "ablations"]
            for column in ("evidence", "evidence_beyond"):
                stored[column] = stored[column].str.replace(r" \[[^]]*\]", "", regex=True)
        if name in ("replication", "optima", "worlds"):
            made = made.drop(columns="run_ids", errors="ignore")
            stored = stored.drop(columns=["seconds", "first_verdict"], errors="ignore")
        assert [*made] == [*stored], f"{name}, {table}"
        stored = stored.sort_index(kind="stable")
        kept = made.columns[~made.columns.str.contains(RESAMPLED)]
        if name == "human":  # its other columns are verdicts
            kept = made[kept].select_dtypes("number").columns
        pd.testing.assert_frame_equal(
            made[kept], stored[kept], rtol=1e-4, atol=1e-6, check_dtype=False,
            check_names=False, obj=f"{name}, {table}",
        )  # fmt: skip
