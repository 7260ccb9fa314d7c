"""Imports point one way only, kinematics has one home, and studies use the public interface."""

import ast
import re
import sys
from functools import cache
from pkgutil import iter_modules

import pytest

import coartic
from tests.support.processes import ROOT, python

PACKAGES = ("coartic", "baselines", "benchmarks", "analysis")
ALLOWED = {
    "coartic": set(),
    "baselines": {"coartic"},
    "benchmarks": {"coartic", "baselines"},
    "analysis": {"coartic"},
}
CHECKER = "coartic.analysis.verify"
"""Imports nothing of coartic, so that all may import it."""
# The command line sits on top of all four; nothing imports it.
COMMAND_LINE = ("coartic/cli/", "coartic/__main__.py")


def sources():
    return [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]


def package_of(name):
    """Which of the four a module belongs to: the other three are within coartic, by name."""
    first, _, rest = f"{name}.".partition(".")
    within = rest.partition(".")[0]
    return within if first == "coartic" and within in ALLOWED else first


@cache
def tree_of(path):
    return ast.parse(path.read_bytes())


def names_in(nodes):
    """Full names of everything that code imports."""
    names = set()
    for node in nodes:
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"relative import: {ast.unparse(node)}"
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


@cache
def imported(path):
    """Full names of everything a module imports, at any depth of its code."""
    return names_in(ast.walk(tree_of(path)))


def test_imports_point_one_way():
    for path in sources():
        relative = path.relative_to(ROOT).as_posix()
        package = relative.split("/")[0]
        names = {name for name in imported(path) if not name.startswith(CHECKER)}
        others = {package_of(name) for name in names} & set(PACKAGES) - {package}
        if not relative.startswith(COMMAND_LINE):
            assert others <= ALLOWED[package], path
            assert not any(name.startswith("coartic.cli") for name in imported(path)), path


FRESH = """
import sys
import coartic
def absent(*names):
    there = set(names) & set(sys.modules)
    assert not there, f"{there} imported by now"
absent("numba", "numpy", "pydantic")
assert {*coartic.__all__} <= {*dir(coartic)}, "not shown before it is imported"
from coartic.cli import main
def end(command, *names):
    sys.argv[1:] = [command]
    try:
        main()
    except SystemExit as stop:
        assert not stop.code
    absent("numba", "pandas", "matplotlib", "scipy", *names)
end("--help", "numpy", "coartic.baselines", "coartic.analysis")
from coartic.runs.method_info import load_method
import coartic.benchmarks.pool
assert load_method("coartic.learner.method", "dual-process/EC1").name == "dual-process/EC1"
absent("casadi", "pandas", "coartic.benchmarks.runner")
end("list")
"""


@pytest.mark.process
def test_the_package_imports_what_is_asked_for():
    said = python("-c", FRESH).stdout
    assert "verify" in said
    assert "dual-process/" in said


def test_kernels_are_read_by_their_doors_alone():
    """By the learner's kernel and posture-based planning besides, and by what sets Numba up."""
    others = {
        "coartic/learner/kernel.py", "coartic/learner/learning.py", "baselines/posture_based.py",
        "benchmarks/preload.py", "benchmarks/provenance.py",
    }  # fmt: skip
    for path in sources():
        relative = path.relative_to(ROOT).as_posix()
        if not relative.startswith("coartic/motion/") and relative not in others:
            names = {name for name in imported(path) if name.startswith("coartic.motion.kernels")}
            assert not names, f"{relative} imports {names}: read a door of coartic.motion instead"


def test_no_module_has_a_name_of_the_package():
    """It would hide what has its name."""
    assert not {module.name for module in iter_modules(coartic.__path__)} & {*coartic.__all__}


def test_one_kinematic_module():
    """No cosine or sine is taken outside the robot, the functions handed to it, and the referee."""
    home = {"coartic/robot.py", "coartic/motion/kernels/trigonometry.py", "analysis/verify.py"}
    pattern = re.compile(r"\b(np|numpy|math|casadi|ca|cs)\.(cos|sin|tan|exp)\(|\b(cosine|sine)\(")
    for path in sources():
        if path.relative_to(ROOT).as_posix() not in home:
            assert not pattern.search(path.read_text(encoding="utf-8")), path


def test_processes_that_compute_are_started_in_one_place():
    """Others would round as their processor does."""
    home = {f"benchmarks/{name}.py" for name in ("pool", "processes", "method_files", "cluster")}
    home |= {"coartic/internal/threads.py"}
    pattern = re.compile(r"ProcessPoolExecutor\(|\bPool\(|\bProcess\(|import multiprocessing")
    paths = [*sources(), *(ROOT / "studies").rglob("*.py"), *(ROOT / "docs").rglob("*.py")]
    for path in paths:
        if path.relative_to(ROOT).as_posix() not in home:
            assert not pattern.search(path.read_text(encoding="utf-8")), path


def test_no_module_is_imported_but_undeclared():
    declared = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    aliases = {"pydantic_core": "pydantic", "llvmlite": "numba", "click": "typer", "PIL": "pillow",
               "stable_baselines3": "stable-baselines3"}  # fmt: skip
    for path in sources():
        for name in imported(path):
            root = name.split(".")[0]
            if root in PACKAGES or root in sys.stdlib_module_names:
                continue
            assert f'"{aliases.get(root, root)}>=' in declared, f"{path}: {root}"
