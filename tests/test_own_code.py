"""What a method file's results come from, and what is done when it changes."""

import subprocess
import sys

import pytest

from coartic.analysis.study import load
from coartic.benchmarks import own_code
from coartic.benchmarks.registry import built_in, registry
from tests.support.processes import python, pythons

METHOD = """
import numpy as np
from coartic import Optimiser
{imports}

class Mine(Optimiser):
    name, title, citation = "mine", "Mine", "none"

    def optimise(self, objective, rng):
        {first}
        x = objective.x0
        while True:
            objective.many(x + {step} * rng.standard_normal((10, objective.dim)))
"""


def written(folder, name="mine.py", imports="", first="pass", step="0.1"):
    folder.mkdir(parents=True, exist_ok=True)
    text = METHOD.format(imports=imports, first=first, step=step)
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


COUNTS = {
    "from coartic.baselines.cma_es import CMAES": ["cma-es/bandit"],
    "import coartic.baselines.cma_es": ["cma-es/bandit"],
    "import coartic as c\nlearn = c.learn": ["dual-process/EC1"],
    "from coartic import learn": ["dual-process/EC1"],
    "from coartic.baselines.trajectory_problem import Instance": ["cma-es/bandit"],
    "from coartic import load_task": [],
    "import learn": [],
}


@pytest.mark.process
def test_versions_of_what_is_built_in_count(tmp_path):
    """Where a file imports a method, in whatever way; of a helper of methods, all versions do."""
    files = [written(tmp_path, f"{n}.py", imports) for n, imports in enumerate(COUNTS)]
    lines = python("-c", RAISE, *map(str, files)).stdout.splitlines()
    assert dict(zip(COUNTS, map(str.split, lines), strict=True)) == COUNTS


RAISE = """
import sys
from pathlib import Path
from coartic.benchmarks.own_code import code_of
from coartic.benchmarks.registry import built_in

infos = built_in()
method = infos["hill-climbing"].load()
for file in map(Path, sys.argv[1:]):
    before = code_of(method, file)
    for name in ("cma-es/bandit", "dual-process/EC1"):
        infos[name].load().version, kept = 9, infos[name].load().version
        print(name if code_of(method, file) != before else "", end=" ")
        infos[name].load().version = kept
    print()
"""


@pytest.mark.process
@pytest.mark.usefixtures("unranked", "not_repeated")
def test_a_changed_library_makes_runs_again(coartic, tmp_path, library):
    """Also of an editable install, which lies outside of the installed packages."""
    path = written(tmp_path, imports="import mylib", step="mylib.STEP")
    command = ("run", "paper", "--tasks", "ascending", "--trials", 50, "--methods", "mine",
               "--method-file", path, "--jobs", 1, "--out", tmp_path / "out")  # fmt: skip
    assert coartic(*command, "--runs", 2)[0] == 0
    before = load(tmp_path / "out").runs
    assert load(tmp_path / "out").imports == {}  # an editable install counts as files of the user
    library.write_text("STEP = 0.5\n", encoding="utf-8")
    code, text, error = coartic(*command, "--runs", 3)
    assert (code, "reused" in text) == (0, False), text
    assert "Not used: 2 runs of mine from before a change of its code" in error
    after = load(tmp_path / "out").runs
    assert len(after) == 3
    assert before.reward.tolist() != after.reward.tolist()[:2]


@pytest.mark.process
@pytest.mark.filterwarnings("default")
@pytest.mark.usefixtures("library", "unranked", "not_repeated")
def test_a_file_that_is_loaded_late_is_named(coartic, tmp_path):
    path = written(tmp_path, first="import mylib as late", step="late.STEP")
    command = ("run", "paper", "--tasks", "ascending", "--trials", 50, "--methods", "mine",
               "--method-file", path, "--jobs", 1, "--out", tmp_path / "out",
               "--runs", 2)  # fmt: skip
    code, text, error = coartic(*command)
    assert (code, "reused" in text) == (0, False), error
    assert error.count("mine: mylib.py was first loaded during a run") == 1
    assert "import it at the top of the method file" in " ".join(error.split())
    code, text, error = coartic(*command)
    assert (code, "2 reused" in text) == (0, True)
    assert error.count("mylib.py was first loaded during a run") == 1
    assert load(tmp_path / "out").methods.title["mine"] == "Mine ‡"


def test_packages_that_a_file_imports_are_named_without_those_of_this_project(tmp_path):
    cma = pytest.importorskip("cma")
    path = tmp_path / "mine.py"
    path.write_text("import json, numpy\nfrom cma import fmin2\n", encoding="utf-8")
    lines = own_code.imported_packages(str(path))
    assert f"cma {cma.__version__.split()[0]}" in lines
    assert not [line for line in lines if line.startswith("numpy")]


def test_a_file_that_was_removed_or_broken_since_imports_nothing(tmp_path):
    (tmp_path / "broken.py").write_text("import numba\ndef (", encoding="utf-8")
    none = own_code.imported_packages(str(tmp_path / "no-module.txt"))
    for name in ("removed.py", "broken.py"):
        assert own_code.imported_packages(str(tmp_path / name)) == none


SOURCE = '''
"""A docstring."""
def words(x, width, who=None):  # a comment
    a = "one " f"two {x}" " three" u" four" f"{x!r:>{width}}" ""
    b = f"{{{x}}}" + f"{x=}" + f"{ x = !s:^{width}.{3}}" + f"" + f"{x:}" + rf"\\{x}\\d"

    c = f"""{x
        } and {'nested ' + f"{width}"} — é
""" f'\\N{BULLET}{x:%H:%M {{}}}'
    if x:
            return a, b"\\x00" b"bytes", c % (who,), f"{x:{'>'}{width}}"
'''
SAME = [
    SOURCE.replace("# a comment", "# another"),
    SOURCE.replace("\n\n", "\n"),
    SOURCE.replace("\n\n", "\n    # more\n\n\n"),
    SOURCE.replace("            return", "      return"),
]
OTHER = [
    SOURCE.replace("{x:}", "{ x:}"),
    SOURCE.replace("three", "four"),
    SOURCE.replace("    if x:", "    if not x:"),
    SOURCE.replace("            return", "            pass\n    return"),
]


def test_what_counts_of_a_python_file(tmp_path):
    def content(text):
        (tmp_path / "a.py").write_text(text, encoding="utf-8")
        return own_code.content_of(str(tmp_path / "a.py"))

    assert {content(text) for text in SAME} == {content(SOURCE)}
    assert len({content(text) for text in [SOURCE, *OTHER]}) == 1 + len(OTHER)
    compiled = tmp_path / "a.so"  # counts byte by byte
    compiled.write_bytes(b"x = 1  # one")
    assert own_code.content_of(str(compiled)) == b"x = 1  # one"


ONLY_CONTENT = """
import hashlib, importlib.util, re, sys
source = open(sys.argv[1], encoding="utf-8").read()
names = tuple(f"def {name}(" for name in ("content_of", "_between"))
parts = [part.split("\\n\\n\\n")[0] for part in re.split(r"\\n(?=def )", source)]
code = "\\n".join(part for part in parts if part.startswith(names))
scope = {}
exec("import io, tokenize\\nfrom pathlib import Path\\n" + code, scope)
print(hashlib.sha256(scope["content_of"](sys.argv[2])).hexdigest())
"""


@pytest.mark.process
@pytest.mark.parametrize("minor", range(11, 16))
def test_every_version_of_python_reads_the_same_code(minor, tmp_path):
    """By the two functions that read it, as the others need packages."""
    (tmp_path / "a.py").write_text(SOURCE, encoding="utf-8")
    command = ["-I", "-c", ONLY_CONTENT, own_code.__file__, str(tmp_path / "a.py")]
    here = subprocess.run([sys.executable, *command], capture_output=True, text=True, check=True)
    for other in (there := pythons().get(minor, [])):
        done = subprocess.run([other, *command], capture_output=True, text=True, check=False)
        assert done.stdout == here.stdout, done.stderr
    if not there:
        pytest.skip(f"Python 3.{minor} is not installed")


def test_words_in_built_in_code_count_nowhere():
    """A built-in method is known by its versions alone, and they are stated."""
    assert {info.code for info in built_in().values()} == {"1.1", "1.2"}
    assert all(isinstance(info.load().version, int) for info in built_in().values())


def test_a_later_parameter_is_left_out_while_it_has_its_default(monkeypatch):
    """Of what a cell is known by; and it is taken into account where it has another value."""
    from coartic import load_task
    from coartic.runs.plan import cell_of

    info, task = built_in()["hill-climbing"], load_task("ascending")
    before = cell_of(task, info, {})
    name = next(iter(before.parameters))
    monkeypatch.setattr(info.load(), "later", frozenset({name}))
    cell = cell_of(task, info, {})
    assert name not in cell.parameters
    assert cell.setting == ""
    assert info.configure(cell.parameters).parameters == info.configure({}).parameters
    other = cell_of(task, info, {name: before.parameters[name] * 2})
    assert other.parameters == before.parameters | {name: before.parameters[name] * 2}
    assert other.setting.startswith(f"{name}=")
