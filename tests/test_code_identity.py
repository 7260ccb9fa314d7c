"""Which code the results of a method come from."""

import ast
import importlib
import inspect
import json
import subprocess
from pathlib import Path

import pytest

from coartic.benchmarks import syntax
from coartic.benchmarks.code_identity import code_of, files_of
from coartic.method import MODULES
from coartic.motion.compile import PACKAGE
from tests.support.processes import pythons

FILES = {name.split(".")[-1]: Path(inspect.getfile(importlib.import_module(name)))
         for name in MODULES}  # fmt: skip
LEARNER, PLANNERS = "method", {"trajectory_optimisation", "receding_horizon", "optimum"}
WITH_TRIALS = {LEARNER, "hill_climbing", "random_search", "cma_es"}
"""Methods that take the number of trials from the learner."""


def codes():
    return {name: code_of(file) for name, file in FILES.items()}


@pytest.fixture(scope="module")
def before():
    return codes()


@pytest.fixture
def after(before, monkeypatch):
    """The methods whose code is another after a change in a file of the package."""

    def change(place, old, new):
        read, changed = Path.read_bytes, (PACKAGE / place).resolve()
        assert old in read(changed)
        with monkeypatch.context() as patch:
            patch.setattr(
                Path,
                "read_bytes",
                lambda path: (
                    read(path).replace(old, new) if path.resolve() == changed else read(path)
                ),
            )
            return {name for name, code in codes().items() if code != before[name]}

    return change


def test_what_plans_stores_reads_and_shows_runs_does_not_count():
    for file in FILES.values():
        rooms = {path.relative_to(PACKAGE).parts[0] for path in files_of(file)}
        assert not rooms & {"__init__.py", "analysis", "benchmarks", "cli", "play", "runs"}
        assert not rooms & {"drawing.py", "film.py", "gym.py"}


@pytest.mark.parametrize(
    ("place", "methods"),
    [
        ("__init__.py", set()),
        ("baselines/evolution.py", {"cma_es"}),
        ("baselines/trajectory_problem.py", PLANNERS),
        ("learner/kernel.py", WITH_TRIALS),
        ("motion/trial.py", {*FILES}),
        ("benchmarks/worker.py", {*FILES}),
    ],
)
def test_a_number_counts_where_it_is_executed(after, place, methods):
    line = b"from __future__ import annotations\n" if "__init__" not in place else b"import "
    assert after(place, line, b"STEP = 3\n" + line) == methods


def test_names_of_the_package_count_where_they_are_at_home(tmp_path):
    (tmp_path / "mine.py").write_text("import coartic\n\nprint(coartic.learn('ascending', 'EC1'))")
    assert PACKAGE / "learner" / "kernel.py" in files_of(tmp_path / "mine.py")
    (tmp_path / "mine.py").write_text("from coartic import load_task")
    assert PACKAGE / "learner" / "kernel.py" not in files_of(tmp_path / "mine.py")


SOURCES = {
    "878d399f25ee": '''
"""A docstring."""
from __future__ import annotations
import coartic, numpy as np
if TYPE_CHECKING:
    from somewhere import Thing
__version__ = "1.2"

class Mine(coartic.Method, kind=None):
    name = u"mine" "-é\\U0001fae8"
    def solve(self, session: Thing, /, *rest, a=1, b: int | None = None, **more) -> None:
        """Another."""
        total: float = -1e-3 + 0x_FF * 2j
        match rest:
            case [1, *others] if (first := others) and first is not None:
                return lambda x=None: {**more, "x": [*others], None: ...}
            case {"a": None, **kept} | Point(x=0) as point:
                yield from (x async for x in kept)
            case _:
                pass
        try:
            del self.x[1:, ::2]
        except* (ValueError, OSError) as error:
            raise RuntimeError from error
''',
    "cca2e0208c72": r'''
def words(x, width, who=None):
    """None of these counts."""
    a = "one " f"two {x}" " three" u" four" f"{x!r:>{width}}" ""
    b = f"{{{x}}}" + f"{x=}" + f"{ x = !s:^{width}.{3}}" + f"" + f"{x:}" + rf"\{x}\d"
    c = f"""{x
        } and {'nested ' + f"{width}"}
""" f'\N{BULLET}{x:%H:%M {{}}}'
    return a, b"\x00" b"bytes", c % (who,), f"{x:{'>'}{width}}"
''',
}  # fmt: skip
"""Two sources by the beginning of the hash of what they compute."""
HASH = """
import ast, hashlib, json, runpy, sys
text_of = runpy.run_path(sys.argv[1])["text_of"]
for source in json.load(sys.stdin):
    print(hashlib.sha256(text_of(ast.parse(source)).encode()).hexdigest()[:12])
"""


@pytest.mark.parametrize("minor", range(11, 16))
def test_every_version_of_python_reads_the_same_code(minor):
    sources = json.dumps([*SOURCES.values()])
    for python in (there := pythons().get(minor, [])):
        command = [python, "-I", "-W", "ignore", "-c", HASH, syntax.__file__]
        done = subprocess.run(command, input=sources, capture_output=True, text=True)
        assert done.stdout.split() == [*SOURCES], done.stderr
    if not there:
        pytest.skip(f"Python 3.{minor} is not installed")


def test_what_runs_counts_and_words_do_not():
    def text(source):
        return syntax.text_of(ast.parse(source))

    for same, other in (
        ('"""A."""\nx = 1  # one', '"""B."""\nx = 1'),
        ('__version__ = "1"', '__version__ = "2"'),
        ("if TYPE_CHECKING: import a", "if TYPE_CHECKING: import b"),
        ("if typing.TYPE_CHECKING: import a", "if typing.TYPE_CHECKING: import b"),
        ('f"a" "b" f"{x}"', 'f"ab{x}"'),
        ('x = u"a"', "x = 'a'"),
    ):
        assert text(same) == text(other)
    for one, another in (
        ("x = 1", "x = 1.0"),
        ("x = True", "x = 1"),
        ("x = None", "x = ()"),
        ("return", "return []"),
        ("f(a, b)", "f(a, b=b)"),
        ("if not TYPE_CHECKING: import a", "if not TYPE_CHECKING: import b"),
        ("def f(a, /, b): pass", "def f(a, b): pass"),
        ("def f(*, a): pass", "def f(*, a=None): pass"),
        ('f"{x}"', 'f"{{x}}"'),
        ("x = 'None'", "x = None"),
    ):
        assert text(one) != text(another)
