"""The tables that ship: each has a program of the present code, and runs of its versions."""

import tomllib

import pandas as pd
import pytest

from coartic.benchmarks.registry import built_in
from tests.support.processes import ROOT

SOURCES = [ROOT / "docs" / "stored" / "SOURCES.toml", *sorted(ROOT.glob("studies/*/sources.toml"))]
TABLES = [table for file in SOURCES for table in tomllib.loads(file.read_text("utf-8"))["tables"]]
CODE = {name: info.code for name, info in built_in().items()}
"""Versions of model and method by the id of the method."""


def outdated(methods):
    """Return the methods that now have another version; ``methods`` has versions by the first part
    of an id."""
    return [
        f"{name} is {code}, not {version}"
        for method, version in methods.items()
        for name, code in CODE.items()
        if name.startswith(method) and code != version
    ]


def test_each_shipped_table_is_listed_once():
    folders = (ROOT / "docs" / "stored", ROOT / "studies")
    paths = [path for folder in folders for path in folder.glob("*/*.csv*")]
    listed = [file for table in TABLES for file in table["files"]]
    assert len(listed) == len({*listed})
    there = {str(path.relative_to(ROOT)) for path in paths}
    where = "sources.toml of the folder of its study, or in docs/stored/SOURCES.toml"
    missing, lost = sorted(there - {*listed}), sorted({*listed} - there)
    assert not missing, f"list each of {missing} in {where}"
    assert not lost, f"there is none of {lost}: correct {where}"


@pytest.mark.parametrize("table", TABLES, ids=lambda table: table["files"][0])
def test_program_and_pages_exist(table):
    assert (ROOT / table["program"]).is_file()
    assert table["source"] in ("", "comparison", "families", "shipped", "rows")
    assert table["pages"]
    assert [page for page in table["pages"] if not (ROOT / page).is_file()] == []


@pytest.mark.parametrize("table", TABLES, ids=lambda table: table["files"][0])
def test_runs_are_of_the_present_versions(table):
    assert outdated(table["methods"]) == []
    for file in table["files"]:
        runs = pd.read_csv(ROOT / file, usecols=lambda name: name in ("run_id", "method"))
        if {*runs} == {"run_id", "method"}:  # the id of a run ends in the version of its method
            runs = runs[runs.method.isin(CODE)].drop_duplicates()
            assert [*runs.run_id.str.rpartition("-")[2]] == [*runs.method.map(CODE)], file


def test_another_version_of_a_method_makes_its_tables_stale():
    code = CODE["cma-es/bandit"]
    assert outdated({"cma-es": code}) == []
    assert f"cma-es/bandit is {code}, not 0.9" in outdated({"cma-es": "0.9"})
