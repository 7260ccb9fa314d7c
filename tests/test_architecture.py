"""Imports point one way only, and kinematics has one home."""

import ast
import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGES = ("coartic", "baselines", "benchmarks", "analysis")
ALLOWED = {
    "coartic": set(),
    "baselines": {"coartic"},
    "benchmarks": {"coartic", "baselines"},
    "analysis": {"coartic"},
}
# The command line sits on top of all four; nothing imports it.
COMMAND_LINE = {"coartic/cli.py", "coartic/__main__.py"}


def sources():
    return [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]


def imported(path):
    """Full names of everything a module imports, at any depth of its code."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


@pytest.mark.parametrize("path", sources(), ids=lambda path: path.relative_to(ROOT).as_posix())
def test_imports_point_one_way(path):
    relative = path.relative_to(ROOT).as_posix()
    package = relative.split("/")[0]
    others = {name.split(".")[0] for name in imported(path)} & set(PACKAGES) - {package}
    if relative not in COMMAND_LINE:
        assert others <= ALLOWED[package]
        assert not any(name.startswith("coartic.cli") for name in imported(path))


def test_the_command_line_uses_all_it_sits_on():
    roots = {name.split(".")[0] for name in imported(ROOT / "coartic" / "cli.py")}
    assert {"coartic", "benchmarks", "analysis"} <= roots


def test_one_kinematic_module():
    """No cosine or sine is taken outside the robot and the functions handed to it."""
    home = {"coartic/robot.py", "coartic/trigonometry.py"}
    pattern = re.compile(r"\b(np|numpy|math|casadi|ca|cs)\.(cos|sin|tan|exp)\(|\b(cosine|sine)\(")
    for path in sources():
        if path.relative_to(ROOT).as_posix() not in home:
            assert not pattern.search(path.read_text(encoding="utf-8")), path


def test_no_module_is_imported_but_undeclared():
    """Every third-party import is a declared dependency."""
    declared = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    aliases = {"pydantic_core": "pydantic", "llvmlite": "numba", "click": "typer", "PIL": "pillow"}
    for path in sources():
        for name in imported(path):
            root = name.split(".")[0]
            if root in PACKAGES or root in sys.stdlib_module_names:
                continue
            assert f'"{aliases.get(root, root)}>=' in declared, f"{path}: {root}"
