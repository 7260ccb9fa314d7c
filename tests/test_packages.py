"""Wheel and source distribution: built, installed into empty environments, and run.

That takes minutes and a package index, so it is done where COARTIC_PACKAGES=1 says so.
"""

import os
import subprocess
import sys
import tarfile
import tomllib
import zipfile

import pytest

from coartic.benchmarks.registry import built_in
from coartic.runs.shipped import open_shipped, shipped_hashes
from tests.support.processes import pythons
from tests.support.suites import ROOT

pytestmark = pytest.mark.skipif(
    os.environ.get("COARTIC_PACKAGES") != "1", reason="minutes: only with COARTIC_PACKAGES=1"
)
OWN = ("analysis", "baselines", "benchmarks")
"""Folders of the user's own in the place where commands are run."""


def do(*command, cwd):
    """A command that works, without what the tests' environment would give it."""
    env = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    done = subprocess.run(
        [*map(str, command)], cwd=cwd, env=env, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_shipped_results_are_of_this_code():
    now = {name: info.code for name, info in built_in().items()}
    for suite in shipped_hashes():
        with open_shipped(suite) as store:
            shipped = {job.cell.method.name: job.cell.method.code for job in store.plan()}
        assert shipped
        other = {name for name, code in shipped.items() if now.get(name) != code}
        assert not other, f"shipped runs of suite {suite} are of other code: make shipped"


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """The two files, of what git has."""
    folder = tmp_path_factory.mktemp("built")
    do("git", "clone", "--quiet", ROOT, folder / "clone", cwd=folder)
    do(sys.executable, "-m", "hatchling", "build", "-d", folder / "dist", cwd=folder / "clone")
    (sdist,) = (folder / "dist").glob("*.tar.gz")
    (wheel,) = (folder / "dist").glob("*.whl")
    return sdist, wheel


def works(environment, place):
    """A task, a method and a report, from a folder with things of the user's own."""
    for name in OWN:
        (place / name).mkdir()
        (place / name / "__init__.py").write_text("raise ImportError('the user has one')\n")
    coartic = environment / "bin" / "coartic"
    assert "two-armed-2" in do(coartic, "list", cwd=place)
    small = ("--tasks", "ascending", "--runs", 2, "--trials", 20)
    methods = ("--methods", "dual-process/EC1,corrective-alone/given")
    do(coartic, "run", "quick", *small, *methods, "--out", "results", cwd=place)
    do(coartic, "report", "results", cwd=place)
    assert (place / "results" / "report" / "report.html").stat().st_size > 100_000
    version = do(environment / "bin" / "python", "-m", "coartic", "--version", cwd=place)
    assert version.startswith("coartic ")


PYTHONS = {minor: paths[-1] for minor, paths in pythons().items() if minor >= 11}
DEPENDENCIES = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"]


def installed(python, tmp_path, *what):
    """An environment with what pip installs, and an empty folder to work in."""
    environment, place = tmp_path / "environment", tmp_path / "place"
    place.mkdir()
    do(python, "-m", "venv", environment, cwd=tmp_path)
    do(environment / "bin" / "python", "-m", "pip", "install", "-q", *what, cwd=tmp_path)
    return environment, place


@pytest.mark.parametrize("minor", sorted({11, 12, 13, *PYTHONS}))
@pytest.mark.parametrize("versions", ["lowest", "newest"])
def test_the_lowest_and_the_newest_versions(built, tmp_path, minor, versions):
    """Of what the package depends on directly. The lowest ones are tried on the oldest Python: of
    some there is no file for newer ones."""
    if minor not in PYTHONS:
        pytest.skip(f"not tried: there is no python3.{minor} on this machine")
    if versions == "lowest" and minor != min(PYTHONS):
        pytest.skip("the lowest versions have files for the oldest Python alone")
    lowest = [text.replace(">=", "==") for text in DEPENDENCIES] if versions == "lowest" else []
    environment, place = installed(PYTHONS[minor], tmp_path, built[1], *lowest)
    works(environment, place)
    coartic = environment / "bin" / "coartic"
    assert "Usage: coartic" in do(coartic, "run", "--help", cwd=place)
    do(coartic, "report", "results", "--for-paper", cwd=place)
    assert len([*(place / "results" / "report").rglob("*.tex")]) > 3


def test_the_source_distribution_with_the_pinned_versions(built, tmp_path):
    pins = ROOT / "constraints.txt"
    environment, place = installed(sys.executable, tmp_path, "-c", pins, built[0])
    where = "import coartic; print(coartic.__file__)"
    assert str(environment) in do(environment / "bin" / "python", "-c", where, cwd=place)
    works(environment, place)


def test_what_is_in_them(built):
    sdist, wheel = built
    with zipfile.ZipFile(wheel) as file:
        names = {name for name in file.namelist() if ".dist-info/" not in name}
    tracked = do("git", "ls-files", "coartic", *OWN, cwd=ROOT).split()
    links = {f"coartic/{name}" for name in OWN}
    assert names == {
        f"coartic/{name}" if name.startswith(OWN) else name for name in {*tracked} - links
    }
    with tarfile.open(sdist) as file:
        inside = {name.partition("/")[2] for name in file.getnames()}
    assert {
        "README.md",
        "Makefile",
        "constraints.txt",
        "docs/conf.py",
        "tests/conftest.py",
    } <= inside
