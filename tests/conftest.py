"""Shared by all tests."""

import os

import pytest
from hypothesis import settings

import analysis.report.build
from analysis.study import Study
from tests.support.reports import SVG
from tests.support.suites import run_and_write, traced_cells, with_environment

# Continuous integration tries the same examples every time; people, new ones.
settings.register_profile("ci", derandomize=True, deadline=None)
settings.register_profile("people", deadline=None)
settings.load_profile("ci" if os.environ.get("CI") else "people")


@pytest.fixture
def undrawn(monkeypatch):
    """Reports without figures, which take long and have tests of their own."""
    monkeypatch.setattr(analysis.report.build, "svg_text", lambda plot: SVG)
    monkeypatch.setattr(
        analysis.report.build, "rendered",
        lambda plot, endings: {f"{plot.id}.svg": SVG.encode()},
    )  # fmt: skip


@pytest.fixture(scope="session")
def traced(tmp_path_factory):
    """A results folder that nobody writes into: the paper's cells beside other methods."""
    folder = tmp_path_factory.mktemp("traces") / "results"
    run_and_write(folder, traced_cells(), runs=4, trials=150)
    return Study(with_environment(folder))
