"""What a method file's results come from, and what is done when it changes."""

import pytest

from coartic.analysis import TABLES, ranking
from coartic.analysis.study import load
from coartic.benchmarks.registry import registry

METHOD = """
import numpy as np
from coartic import Optimiser
{imports}

class Mine(Optimiser):
    name, title, citation = "mine", "Mine", "none"
    {more}

    def optimise(self, objective, rng):
        x = objective.x0
        while True:
            objective.many(x + {step} * rng.standard_normal((10, objective.dim)))
"""


def written(folder, name="mine.py", imports="", more="", step="0.1"):
    folder.mkdir(parents=True, exist_ok=True)
    text = METHOD.format(imports=imports, more=more, step=step)
    (folder / name).write_text(text, encoding="utf-8")
    return folder / name


def code_of(path):
    return registry([path])["mine"].code


@pytest.fixture
def library(tmp_path, monkeypatch):
    """A folder on ``PYTHONPATH`` with module ``mylib``, and a method that imports it."""
    folder = tmp_path / "libraries"
    folder.mkdir()
    (folder / "mylib.py").write_text("STEP = 0.05\n", encoding="utf-8")
    monkeypatch.syspath_prepend(folder)
    return folder / "mylib.py"


@pytest.mark.process
def test_what_counts_as_the_code_of_a_method(tmp_path):
    """The file, helpers beside it, declared data and the version, wherever the folder is."""
    files = {
        "helper.py": "STEP = 1",
        "parts/__init__.py": "",
        "parts/more.py": "RATE = 1",
        "data": "x = 1",
    }

    def code(folder, version=1, **changed):
        for name, text in (files | changed).items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text(text, encoding="utf-8")
        imports = "from helper import STEP\nimport parts.more"
        return code_of(
            written(folder, imports=imports, more=f"files, version = ('data',), {version}")
        )

    first = code(tmp_path / "here")
    assert code(tmp_path / "elsewhere") == first
    changes = ("helper.py", "parts/more.py", "data")
    others = [code(tmp_path / name[:4], **{name: "STEP = RATE = 2"}) for name in changes]
    others += [code(tmp_path / "new", version=2), code_of(written(tmp_path / "plain"))]
    assert len({first, *others}) == 6


@pytest.mark.process
def test_helpers_of_one_name_in_two_folders_do_not_mix(tmp_path):
    for folder, step in (("a", "0.1"), ("b", "0.2")):
        path = written(tmp_path / folder, imports="import helper", step="helper.STEP")
        path.write_text(path.read_text("utf-8").replace('"mine"', f'"{folder}"'), "utf-8")
        (tmp_path / folder / "helper.py").write_text(f"STEP = {step}", encoding="utf-8")
    both = registry([tmp_path / "a" / "mine.py", tmp_path / "b" / "mine.py"])
    assert both["a"].code != both["b"].code
    assert both["a"].code == registry([tmp_path / "a" / "mine.py"])["a"].code


@pytest.mark.process
@pytest.mark.usefixtures("unranked", "not_repeated")
def test_a_changed_library_makes_runs_again(coartic, tmp_path, library):
    """Also of an editable install, which lies outside of the installed packages."""
    path = written(tmp_path, imports="import mylib", step="mylib.STEP")
    command = ("run", "paper", "--tasks", "ascending", "--trials", 50, "--methods", "mine",
               "--method-file", path, "--jobs", 1, "--out", tmp_path / "out")  # fmt: skip
    assert coartic(*command, "--runs", 2)[0] == 0
    before = load(tmp_path / "out").runs
    library.write_text("STEP = 0.5\n", encoding="utf-8")
    code, text, error = coartic(*command, "--runs", 3)
    assert (code, "reused" in text) == (0, False), text
    assert "Not used: 2 runs of mine, made before" in error
    after = load(tmp_path / "out").runs
    assert len(after) == 3
    assert before.reward.tolist() != after.reward.tolist()[:2]


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Installs a version of package ``tiny-solver``, which is imported as ``tinysolver``."""
    folder = tmp_path / "site-packages"
    monkeypatch.syspath_prepend(folder)

    def install(version):
        for old in folder.glob("*.dist-info"):
            (old / "METADATA").unlink()
            old.rename(folder / f"tiny_solver-{version}.dist-info")
        place = folder / f"tiny_solver-{version}.dist-info"
        place.mkdir(parents=True, exist_ok=True)
        (folder / "tinysolver.py").write_text(f"VERSION = {version!r}\n")
        (place / "METADATA").write_text(f"Name: tiny-solver\nVersion: {version}\n")
        (place / "RECORD").write_text("tinysolver.py,,\n")

    return install


@pytest.mark.process
@pytest.mark.filterwarnings("default")
@pytest.mark.usefixtures("unranked", "not_repeated")
def test_runs_with_another_version_of_an_imported_package_are_marked(coartic, tmp_path, package):
    """They are used, and the ranking says so."""
    path = written(tmp_path, imports="import json, tinysolver")
    command = ("run", "paper", "--tasks", "ascending", "--trials", 50, "--methods", "mine",
               "--method-file", path, "--jobs", 1, "--out", tmp_path / "out")  # fmt: skip
    package("1.0")
    assert coartic(*command, "--runs", 2)[0] == 0
    study = load(tmp_path / "out")
    assert {"tiny-solver 1.0"} < {*study.imports["mine"]}
    assert study.marks == {}
    package("1.1")
    code, text, _ = coartic(*command, "--runs", 3)
    assert (code, "2 reused" in text) == (0, True)
    study = load(tmp_path / "out")
    assert study.marks["mine"] == [
        "mine: runs were made with tiny-solver 1.0; now it has tiny-solver 1.1"
    ]
    assert study.methods.title["mine"] == "Mine ‡"
    assert not any(each.startswith("json") for each in study.imports["mine"])
    (words,) = study.marks["mine"]
    assert ranking(study.runs).note.to_dict() == {"mine": words}
    assert TABLES["ranking"](study).note.to_dict() == {"mine": words}
    assert TABLES["saved"](study).note.unique().tolist() == [words]  # in CSV only
