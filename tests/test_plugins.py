"""Methods and tasks from elsewhere: entry points, files, and the README's examples."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

from benchmarks.registry import registry
from coartic import CoarticError

ROOT = Path(__file__).parent.parent
EXAMPLE = ROOT / "tests" / "example_plugin"
METHOD = EXAMPLE / "coartic_example" / "__init__.py"


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """The example package, installed by pip into a folder of its own."""
    target = tmp_path_factory.mktemp("site")
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index"]
    source = tmp_path_factory.mktemp("source") / "plugin"
    subprocess.run(["cp", "-r", EXAMPLE, source], check=True)
    subprocess.run(
        [*pip, "--no-build-isolation", "--target", str(target), str(source)], check=True
    )
    return {**os.environ, "PYTHONPATH": str(target), "COLUMNS": "200"}


def coartic(*arguments, env=None):
    return subprocess.run(
        [sys.executable, "-m", "coartic", *map(str, arguments)],
        capture_output=True, text=True, env=env, cwd=ROOT,
    )  # fmt: skip


def test_a_package_brings_a_method(installed, tmp_path):
    listed = coartic("list", env=installed)
    assert "nearest-hand" in listed.stdout
    assert "(plug-in" in listed.stdout
    checked = coartic("check", "nearest-hand", env=installed)
    assert checked.returncode == 0, checked.stdout
    assert "nearest-hand: 8 of 8 laws hold." in checked.stdout
    out = tmp_path / "out"
    done = coartic(
        "run", "paper", "--methods", "nearest-hand", "--tasks", "shelf",
        "--task-file", EXAMPLE / "shelf.toml", "--out", out, env=installed,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    (run,) = pd.read_parquet(out / "runs.parquet").to_dict("records")
    assert (run["method"], run["task"], run["status"]) == ("nearest-hand", "shelf", "ok")
    assert run["told"] == "corrective process, forward kinematics, goals"
    assert json.loads(run["parameters"]) == {"reluctance": 0.0}
    assert run["forward_kinematics"] > run["jacobians"] > 0


def test_a_file_brings_a_method(tmp_path):
    out = tmp_path / "out"
    done = coartic(
        "run", "paper", "--methods", "nearest-hand", "--method-file", METHOD,
        "--tasks", "two-armed-1,two-armed-2", "--out", out,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    runs = pd.read_parquet(out / "runs.parquet")
    assert list(runs.status) == ["ok", "ok"]
    assert (runs.solution_corrections == 0).all()
    run_id = runs.run_id[0]
    shown = coartic("show", run_id[:9], "--in", tmp_path)
    assert '"nearest-hand"' in shown.stdout
    assert f"coartic reproduce {run_id} --in {out} --method-file {METHOD}" in shown.stdout
    again = ("reproduce", run_id, "--in", tmp_path)
    assert coartic(*again, "--method-file", METHOD).stdout.endswith("identical.\n")
    without = coartic(*again)
    assert without.returncode == 2
    assert "unknown method 'nearest-hand'" in without.stderr


def test_a_changed_file_makes_its_records_stale(tmp_path):
    method = tmp_path / "mine.py"
    method.write_text(METHOD.read_text(encoding="utf-8"), encoding="utf-8")
    command = (
        "run", "paper", "--methods", "nearest-hand", "--method-file", method,
        "--tasks", "ascending", "--out", tmp_path / "out",
    )  # fmt: skip
    assert "0 were there, 1 done" in coartic(*command).stdout
    assert "1 were there, 0 done" in coartic(*command).stdout
    method.write_text(method.read_text(encoding="utf-8") + "\nCHANGED = 1\n", encoding="utf-8")
    changed = coartic(*command)
    assert "0 were there, 1 done" in changed.stdout
    assert "not used, made by other code: 1 record" in changed.stderr


def test_a_changed_helper_makes_records_stale_too(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    helper = tmp_path / "coartic_test_helper.py"
    method = tmp_path / "mine.py"
    text = METHOD.read_text(encoding="utf-8")
    method.write_text("import coartic_test_helper\n" + text, encoding="utf-8")
    codes = []
    for version in ("x = 1", "x = 1", "x = 2"):
        helper.write_text(version, encoding="utf-8")
        codes.append(registry([method])["nearest-hand"].code)
    assert codes[0] == codes[1] != codes[2]


def test_a_broken_plugin_is_a_warning(tmp_path):
    """One bad package does not take the command line with it."""
    info = tmp_path / "bad-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: bad\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[coartic.methods]\nbad = no_such_module:Method\n")
    done = coartic("list", env={**os.environ, "PYTHONPATH": str(tmp_path)})
    assert done.returncode == 0
    assert "warning: plug-in bad: entry point 'bad' cannot be used" in done.stderr
    assert "dual-process/EC1" in done.stdout


def test_a_method_that_cannot_say_where_it_applies(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(
        "from coartic.method import Method\nclass A(Method):\n    name = 'a'\n"
        "    title = citation = 'x'\n    told = frozenset()\n"
        "    def why_not(self, task): return 1 / 0\n"
        "    def solve(self, session): ...",
        encoding="utf-8",
    )
    listed = coartic("list", "--method-file", path)
    assert listed.returncode == 0
    ran = coartic(
        "run", "paper", "--methods", "a", "--method-file", path, "--out", tmp_path / "out"
    )
    assert ran.returncode == 2
    assert "cannot say whether it applies to task 'ascending': ZeroDivisionError" in ran.stderr


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("import nothing_like_this", "cannot be run: ModuleNotFoundError"),
        ("x = 1", "defines no subclass of coartic.method.Method"),
        ("def (", "cannot be run: SyntaxError"),
        (
            "from coartic.method import Method\nclass A(Method):\n    name = 'a'\n"
            "    def solve(self, session): ...",
            "A does not declare 'title'",
        ),
        (
            "from coartic.method import Method\nclass A(Method):\n    name = 'a b'\n"
            "    title = citation = 'x'\n    told = frozenset()\n"
            "    def solve(self, session): ...",
            "A: name: string should match pattern",
        ),
        (
            "from coartic.method import Method\nclass A(Method):\n    name = 'dual-process/EC1'\n"
            "    title = citation = 'x'\n    told = frozenset()\n"
            "    def solve(self, session): ...",
            "method id 'dual-process/EC1' is reserved",
        ),
    ],
)
def test_method_files_that_cannot_be_used(source, words, tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(source, encoding="utf-8")
    with pytest.raises(CoarticError) as caught:
        registry([path])
    assert words in str(caught.value)


def test_method_file_that_is_not_there(tmp_path):
    with pytest.raises(CoarticError, match="cannot be read: No such file"):
        registry([tmp_path / "absent.py"])


def test_parameters_are_validated():
    entry = registry([METHOD])["nearest-hand"]
    assert entry.complete({"reluctance": 0.5}) == {"reluctance": 0.5}
    with pytest.raises(CoarticError, match="'nearest-hand': reluctance: input should be greater"):
        entry.complete({"reluctance": -1.0})
    with pytest.raises(CoarticError, match="Its parameters: reluctance"):
        entry.complete({"reluctant": 1.0})


def test_the_readme_shows_the_example_as_it_is():
    """The README's method and task are those that the tests run."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    shown = re.findall(r"```(?:python|toml)\n(.*?)```", readme, re.DOTALL)
    assert any(METHOD.read_text(encoding="utf-8").strip() in block for block in shown)
    task = (EXAMPLE / "shelf.toml").read_text(encoding="utf-8").strip()
    assert any(task in re.sub(r"\n?# shelf.toml\n", "", block) for block in shown)


def test_the_readme_suite_can_be_used(tmp_path):
    from benchmarks.suites import load_suite, select_cells

    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"```toml\n(# noise.toml.*?)```", readme, re.DOTALL)
    path = tmp_path / "noise.toml"
    path.write_text(block, encoding="utf-8")
    cells = select_cells(load_suite(str(path)), registry())
    assert [cell.variant for cell in cells[:3]] == ["noise_sd=0.02", "", "noise_sd=0.1"]
    assert len(cells) == 6
