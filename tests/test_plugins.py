"""Methods and tasks from elsewhere: entry points, files, and the README's examples."""

import ast
import hashlib
import json
import re
import shutil
import tomllib
from functools import partial
from pathlib import Path

import pandas as pd
import pytest

from coartic import CoarticError, load_task
from coartic.benchmarks import executors, reproduce
from coartic.benchmarks import registry as registry_module
from coartic.benchmarks.code_identity import essence
from coartic.benchmarks.registry import registry
from coartic.benchmarks.suites import Cell
from tests.support.commands import call
from tests.support.suites import InProcess, ask_here, performed, run_specs

ROOT = Path(__file__).parent.parent
EXAMPLE = ROOT / "tests" / "example_plugin"
METHOD = EXAMPLE / "coartic_example" / "__init__.py"


@pytest.fixture
def coartic(monkeypatch, capsys):
    """The command line: exit code, standard output, standard error."""
    monkeypatch.setenv("COLUMNS", "200")
    return partial(call, monkeypatch, capsys)


def go_on_here(monkeypatch):
    """From now on methods are asked and perform their runs in this process."""
    monkeypatch.setattr(registry_module, "_ask", ask_here)
    monkeypatch.setattr(executors, "Local", lambda jobs: InProcess())
    monkeypatch.setattr(reproduce, "supervise", performed)


@pytest.fixture
def in_process(monkeypatch):
    """For tests of what methods say and leave."""
    go_on_here(monkeypatch)


@pytest.fixture
def installed(monkeypatch, tmp_path):
    """The example package, where and as an installer would leave it."""
    site = tmp_path / "site"
    shutil.copytree(METHOD.parent, site / METHOD.parent.name)
    project = tomllib.loads((EXAMPLE / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    about = site / f"{METHOD.parent.name}-{project['version']}.dist-info"
    about.mkdir()
    (about / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n"
    )
    ((group, points),) = project["entry-points"].items()
    lines = [f"[{group}]", *(f"{name} = {where}" for name, where in points.items())]
    (about / "entry_points.txt").write_text("\n".join(lines))
    monkeypatch.syspath_prepend(site)


@pytest.mark.usefixtures("installed")
def test_a_package_brings_a_method(coartic, monkeypatch, tmp_path):
    code, checked, _ = coartic("check", "nearest-hand")
    assert code == 0, checked
    assert "nearest-hand: 8 of 8 checks passed." in checked
    go_on_here(monkeypatch)
    listed = coartic("list")[1]
    assert "nearest-hand" in listed
    out = tmp_path / "out"
    code, _, error = coartic(
        "run", "paper", "--methods", "nearest-hand", "--tasks", "shelf",
        "--task-file", EXAMPLE / "shelf.toml", "--out", out,
    )  # fmt: skip
    assert code == 0, error
    (run,) = pd.read_parquet(out / "runs.parquet").to_dict("records")
    assert (run["method"], run["task"], run["status"]) == ("nearest-hand", "shelf", "ok")
    assert run["told"] == "corrective process, forward kinematics, goals"
    assert json.loads(run["parameters"]) == {"reluctance": 0.0}
    assert run["forward_kinematics"] > run["jacobians"] > 0


def test_a_file_brings_a_method(coartic, monkeypatch, tmp_path):
    out = tmp_path / "out"
    code, _, error = coartic(
        "run", "paper", "--methods", "nearest-hand", "--method-file", METHOD,
        "--tasks", "two-armed-1,two-armed-2", "--out", out, "--jobs", "1",
    )  # fmt: skip
    assert code == 0, error
    runs = pd.read_parquet(out / "runs.parquet")
    assert list(runs.status) == ["ok", "ok"]
    assert (runs.solution_corrections == 0).all()
    go_on_here(monkeypatch)
    run_id = runs.run_id[0]
    again = ("reproduce", run_id, "--in", tmp_path)
    assert coartic(*again, "--method-file", METHOD)[1].endswith("identical.\n")
    code, _, error = coartic(*again)
    assert code == 2
    assert "unknown method 'nearest-hand'" in error


SOURCE = '''
"""A module."""
import os as system, sys
from math import pi, tau
@final
class Kind(object): ...
def named(a, /, b=1, *rest: int, c: str = "x", **others) -> None:
    "What it does."
    total = 0x1f + 1_000 + 2.5e-3 + 1j  # not written
    match a:
        case [1, *more] if more: return f"{a!r:>{b}} {pi:.{b}f} {{x}} {f'{c}'}" "and" f"{a=}"
        case {"k": v, **left}: yield lambda x: [y async for y in x]
    try: assert not (a and b is None), "\u00e9\U0001f600"
    except* (ValueError, OSError) as error: raise error from None
    finally: del a, rest[0:1, ..., ::2]
'''
PLAIN = SOURCE.replace("# not written", "").replace("What it does.", "").replace("A module.", "?")


def test_code_counts_alike_in_every_version_of_python():
    """What :func:`essence` gives was compared between 3.11, 3.12 and 3.13."""
    counts = [hashlib.sha256(essence(ast.parse(text))).hexdigest()[:12] for text in (SOURCE, PLAIN)]
    assert counts == ["b8185c19a05d", "b8185c19a05d"]
    assert essence(ast.parse("x = " + "+".join("1" * 800)))  # a long sum is a deep tree
    assert essence(ast.parse("x = 0x" + "f" * 5000))


@pytest.mark.usefixtures("in_process")
def test_a_changed_file_makes_its_records_stale(coartic, tmp_path):
    method = tmp_path / "mine.py"
    method.write_text(METHOD.read_text(encoding="utf-8"), encoding="utf-8")
    command = (
        "run", "paper", "--methods", "nearest-hand", "--method-file", method,
        "--tasks", "ascending", "--out", tmp_path / "out",
    )  # fmt: skip
    assert coartic(*command)[1].startswith("1 run ")
    assert coartic(*command)[1].startswith("1 run (1 reused)")
    method.write_text(method.read_text(encoding="utf-8") + "\nCHANGED = 1\n", encoding="utf-8")
    assert coartic(*command)[1].startswith("1 run in")


@pytest.mark.usefixtures("in_process")
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


@pytest.mark.usefixtures("in_process")
def test_a_helper_in_another_encoding_counts_as_python_reads_it(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    helper = tmp_path / "coartic_test_latin.py"
    method = tmp_path / "mine.py"
    text = METHOD.read_text(encoding="utf-8")
    method.write_text("import coartic_test_latin\n" + text, encoding="utf-8")
    codes = []
    for encoding, word in (("latin-1", "é"), ("utf-8", "é"), ("latin-1", "è")):
        helper.write_bytes(f"# coding: {encoding}\nNAME = {word!r}\n".encode(encoding))
        codes.append(registry([method])["nearest-hand"].code)
    assert codes[0] == codes[1] != codes[2]


@pytest.mark.usefixtures("in_process")
def test_what_a_helper_imports_is_read_as_well(tmp_path, monkeypatch):
    """An import that is not there may be meant so; one that is no Python is not."""
    monkeypatch.syspath_prepend(tmp_path)
    helper, second = tmp_path / "coartic_test_first.py", tmp_path / "coartic_test_second.py"
    method = tmp_path / "mine.py"
    text = METHOD.read_text(encoding="utf-8")
    method.write_text("import coartic_test_first\n" + text, encoding="utf-8")
    helper.write_text("try:\n    import coartic_test_second\nexcept ImportError:\n    pass\n")
    codes = [registry([method])["nearest-hand"].code]
    second.write_text("x = 1")
    codes.append(registry([method])["nearest-hand"].code)
    assert codes[0] != codes[1]
    second.write_text("def (")
    with pytest.raises(CoarticError, match=r"cannot be run: SyntaxError.*coartic_test_second"):
        registry([method])


@pytest.mark.usefixtures("in_process")
def test_what_a_validator_makes_of_a_parameter_is_what_counts(tmp_path):
    """A value that is clamped is the same run as the value it is clamped to."""
    path = tmp_path / "mine.py"
    text = METHOD.read_text(encoding="utf-8").replace(
        "reluctance: float = Field(default=0.0, ge=0)",
        "reluctance: Annotated[float, AfterValidator(lambda x: min(x, 1.0))] = 0.0",
    )
    head = "from typing import Annotated\nfrom pydantic import AfterValidator\n"
    path.write_text(head + text, encoding="utf-8")
    entry = registry([path])["nearest-hand"]
    assert entry.complete({"reluctance": 5.0}) == {"reluctance": 1.0}
    task = load_task("ascending")
    clamped, stated = (
        run_specs([Cell(task, entry, (("reluctance", x),))], runs=1, seed=0, trials=5)[0][1]
        for x in (5.0, 1.0)
    )
    assert clamped.job()["specification"]["parameters"] == {"reluctance": 1.0}
    assert clamped.run_id == stated.run_id


@pytest.mark.usefixtures("in_process")
@pytest.mark.filterwarnings("always")
def test_a_broken_plugin_is_a_warning(coartic, tmp_path, monkeypatch):
    """One bad package does not take the command line with it."""
    monkeypatch.syspath_prepend(tmp_path)
    info = tmp_path / "bad-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: bad\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[coartic.methods]\nbad = no_such_module:Method\n")
    code, listed, error = coartic("list")
    assert code == 0
    assert "Warning: plug-in bad: entry point 'bad' cannot be used" in error
    assert "dual-process/" in listed


@pytest.mark.usefixtures("in_process")
def test_a_method_that_cannot_say_where_it_applies(coartic, tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(
        "from coartic.method import Method\nclass A(Method):\n    name = 'a'\n"
        "    title = citation = 'x'\n    told = frozenset()\n"
        "    def why_not(self, task): return 1 / 0\n"
        "    def solve(self, session): ...",
        encoding="utf-8",
    )
    assert coartic("list", "--method-file", path)[0] == 0
    out = tmp_path / "out"
    code, _, error = coartic("run", "paper", "--methods", "a", "--method-file", path, "--out", out)
    assert code == 2
    assert "cannot say whether it applies to task 'ascending': ZeroDivisionError" in error


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
            "A: name is ",
        ),
        (
            "from coartic.method import Method\nclass A(Method):\n    name = 'dual-process/EC1'\n"
            "    title = citation = 'x'\n    told = frozenset()\n"
            "    def solve(self, session): ...",
            "method id 'dual-process/EC1' is reserved",
        ),
    ],
)
@pytest.mark.usefixtures("in_process")
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
    with pytest.raises(
        CoarticError, match="'nearest-hand': reluctance is -1.0; it must be at least 0"
    ):
        entry.complete({"reluctance": -1.0})
    with pytest.raises(CoarticError, match="Its parameters: reluctance"):
        entry.complete({"reluctant": 1.0})


def test_the_pages_show_the_example_as_it_is():
    """Method and task of the how-to pages are those that the tests run."""
    pages = [ROOT / "docs" / "howto" / name for name in ("method.md", "task.md")]
    text = "".join(page.read_text(encoding="utf-8") for page in pages)
    shown = re.findall(r"```(?:python|toml)\n(.*?)```", text, re.DOTALL)
    assert any(METHOD.read_text(encoding="utf-8").strip() in block for block in shown)
    task = (EXAMPLE / "shelf.toml").read_text(encoding="utf-8").strip()
    assert any(task in re.sub(r"\n?# shelf.toml\n", "", block) for block in shown)


def test_the_suite_of_the_page_can_be_used(tmp_path):
    from coartic.benchmarks.suites import load_suite, select_cells

    page = (ROOT / "docs" / "howto" / "task.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"```toml\n(# noise.toml.*?)```", page, re.DOTALL)
    path = tmp_path / "noise.toml"
    path.write_text(block, encoding="utf-8")
    cells = select_cells(load_suite(str(path)), registry())
    assert [cell.variant for cell in cells[:3]] == ["noise_sd=0.02", "", "noise_sd=0.1"]
    assert len(cells) == 6
