"""Shared by the tests of studies."""

from functools import cache

import pytest

from coartic.analysis import load
from common import judging
from tests.support.processes import ROOT, program
from tests.support.suites import unpacked


@pytest.fixture(scope="session", autouse=True)
def _fewer_resamples_of_claims():
    """On which no verdict of a test depends."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(judging, "RESAMPLES_OF_CLAIMS", 4_999)
        yield


@pytest.fixture(scope="session")
def measured(tmp_path_factory):
    """By the name of a study, once: its program, its small stored folder, and the tables there."""

    @cache
    def measure(name):
        study = program(ROOT / "studies" / name / "study.py")
        place = ROOT / "tests" / "studies" / name
        stored = load(unpacked(place, tmp_path_factory.mktemp("study")))
        return study, stored, study.measure(stored)

    return measure
