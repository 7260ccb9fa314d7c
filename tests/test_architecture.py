"""Imports point one way only, kinematics has one home, and studies use the public interface."""

import ast
import re
import sys
from collections import defaultdict
from functools import cache
from pkgutil import iter_modules

import pytest

import coartic
from coartic.motion.kernels.compile import KERNEL_FILES
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
CONTRASTS = "coartic.analysis.contrasts"
"""Plans of suites are checked by it: it reads no results."""
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
        names = {name for name in imported(path) if not name.startswith((CHECKER, CONTRASTS))}
        others = {package_of(name) for name in names} & set(PACKAGES) - {package}
        if not relative.startswith(COMMAND_LINE):
            assert others <= ALLOWED[package], path
            assert not any(name.startswith("coartic.cli") for name in imported(path)), path


def test_no_module_imports_itself_by_way_of_others():
    """Imports within functions and imports for types are counted, too."""
    names = {}
    for path in sources():
        parts = path.relative_to(ROOT).with_suffix("").parts
        parts = parts[: -1 if parts[-1] == "__init__" else None]
        names[".".join(parts if parts[0] == "coartic" else ("coartic", *parts))] = path
    imports = {}
    for name, path in names.items():
        asked = {each for full in imported(path) for each in (full, full.rpartition(".")[0])}
        # A package takes names of its own modules.
        imports[name] = {each for each in asked & {*names} if not each.startswith(f"{name}.")}
    done, open_now = set(), []

    def visit(name):
        circle = " -> ".join([*open_now[open_now.index(name) :], name] if name in open_now else [])
        assert not circle, circle
        if name not in done:
            open_now.append(name)
            for other in sorted(imports[name] - {name}):
                if not name.startswith(f"{other}."):  # a module of this package
                    visit(other)
            open_now.pop()
            done.add(name)

    for name in names:
        visit(name)


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


WITHOUT_SOLVERS = """
import sys
sys.modules |= dict.fromkeys(["casadi", "clarabel", "cma", "cvxpy", "daqp", "osqp"])
from coartic.analysis import load, ranking
print(len(ranking(load("shipped").worlds[""].runs)))
"""


@pytest.mark.process
def test_results_are_read_without_solvers():
    assert int(python("-c", WITHOUT_SOLVERS).stdout) > 0


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


KERNELS = {"entry", "inner", "shared", "inlined", "scalar", "intrinsic"}
"""Decorators of kernels."""


@cache
def bindings(path):
    """What a module binds at its top level: nodes by name, and imported names of coartic."""
    defined, imported_names = defaultdict(list), {}
    for node in tree_of(path).body:
        if isinstance(node, ast.ImportFrom) and node.module.startswith("coartic"):
            for alias in node.names:
                imported_names[alias.asname or alias.name] = f"{node.module}.{alias.name}"
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            defined[node.name].append(node)
        else:
            stored = (n for n in ast.walk(node) if isinstance(n, ast.Name))
            for name in stored:
                if isinstance(name.ctx, ast.Store):
                    defined[name.id].append(node)
    return defined, imported_names


def kernels_of(path):
    """Names that a module makes kernels, by decorator or by a call."""
    for name, nodes in bindings(path)[0].items():
        for node in nodes:
            made = [
                *getattr(node, "decorator_list", ()),
                getattr(getattr(node, "value", 0), "func", 0),
            ]
            if {getattr(each, "id", "") for each in made} & KERNELS:
                yield name


def read_from(path, name, seen):
    """Fill ``seen`` with all pairs of file and name that the value of a name is made from, without
    types and decorators."""
    defined, imported_names = bindings(path)
    if name in imported_names:
        module, _, original = imported_names[name].rpartition(".")
        file = ROOT.joinpath(*module.split(".")).with_suffix(".py")
        if file.is_file():  # else it is imported from a package, as modules are
            read_from(file, original, seen)
    if name not in defined or (path, name) in seen:
        return
    seen.add((path, name))
    for node in defined[name]:
        kinds = [
            getattr(n, "annotation", None) or getattr(n, "returns", None) for n in ast.walk(node)
        ]
        kinds += getattr(node, "decorator_list", [])
        skipped = {n for kind in kinds if kind for n in ast.walk(kind)}
        for n in ast.walk(node):
            if isinstance(n, ast.Name) and n not in skipped and n.id not in KERNELS:
                read_from(path, n.id, seen)
            elif isinstance(n, ast.Attribute) and isinstance(n.value, ast.Name):
                module = imported_names.get(n.value.id, "")
                file = ROOT.joinpath(*module.split(".")).with_suffix(".py")
                if module and file.is_file():
                    read_from(file, n.attr, seen)


def test_the_hash_of_kernels_covers_the_files_that_they_consist_of_and_no_others():
    """Else changed kernels would not be compiled, or unchanged ones would be."""
    covered, needed = set(KERNEL_FILES), set()
    for path in sources():
        for name in kernels_of(path):
            seen = set()
            read_from(path, name, seen)
            files = {file for file, _ in seen}
            if path.parts[len(ROOT.parts)] == "baselines":
                files.remove(path)  # Numba looks at the file of a cached function itself
            needed |= files
            assert files <= covered, (
                f"kernel {name} of {path} reads {files - covered}: define kernels, and the numbers "
                "that they read, in coartic/motion or coartic/learner, beside other kernels, or "
                "add the file to KERNEL_FILES of coartic/motion/kernels/compile.py"
            )
    assert covered == needed, f"take {covered - needed} out of KERNEL_FILES: no kernel reads it"


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
