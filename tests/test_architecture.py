"""Imports point one way only, kinematics has one home, and studies use the public interface."""

import ast
import graphlib
import importlib
import importlib.util
import inspect
import re
import sys
from functools import cache

import pytest

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
BY_NAME = {
    "coartic/__init__.py": "the API, whose names are at home in coartic (the test below)",
    "coartic/internal/lazy.py": "names of an API, for the packages that ask it",
    "coartic/runs/method_info.py": "the code of a method, which can be anybody's",
}
"""Modules of ``coartic`` that import by a name that only running shows, and what."""


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


def test_coartic_imports_nothing_above_by_name():
    """Nor by a function that imports what its caller names."""
    by_name = re.compile(
        r"import_module|__import__|importlib\.util|^(def )?__getattr__", re.MULTILINE
    )
    found = {
        path.relative_to(ROOT).as_posix()
        for path in sorted((ROOT / "coartic").rglob("*.py"))
        if by_name.search(path.read_text(encoding="utf-8"))
    }
    assert found == {*BY_NAME}
    homes = {home.split(".")[1] for home in importlib.import_module("coartic").HOME.values()}
    assert not homes & {"analysis", "baselines", "benchmarks", "cli"}


def module_of(path):
    parts = path.relative_to(ROOT).with_suffix("").parts
    parts = parts if parts[0] == "coartic" else ("coartic", *parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def statements(tree):
    """All of a tree that is run at some time."""
    for node in ast.iter_child_nodes(tree):
        if not (isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"):
            yield node
            yield from statements(node)


def test_no_imports_go_round_in_circles():
    modules = {module_of(path): path for path in sources()}
    imports = {}
    for module, path in modules.items():
        names = names_in(statements(tree_of(path)))
        homes = {name if name in modules else name.rpartition(".")[0] for name in names}
        imports[module] = homes & {*modules} - {module}
    try:
        graphlib.TopologicalSorter(imports).prepare()
    except graphlib.CycleError as error:
        raise AssertionError(" <- ".join(error.args[1])) from None


@cache
def modules_on_pages():
    """Of each module on a reference page its members, and those that the page chooses or leaves
    out."""
    paths = {module_of(path): path for path in sources()}
    paths |= {f"common.{path.stem}": path for path in (ROOT / "studies" / "common").glob("*.py")}
    found = []
    for page in sorted((ROOT / "docs" / "reference" / "python").glob("*.md")):
        directives = re.findall(r"automodule:: (\S+)\n((?:   :.*\n)*)", page.read_text("utf-8"))
        for module, text in directives:
            options = dict(re.findall(r":([a-z-]+): \+?(.*)", text))
            chosen, left_out = (
                {*options.get(key, "").split(", ")} - {""} for key in ("members", "exclude-members")
            )
            found.append((module, members_of(tree_of(paths[module])), chosen, left_out))
    return found


@cache
def public_names():
    """Names that a reference page names, by module: its members, or the page's choice of them."""
    names = {}
    for module, members, chosen, left_out in modules_on_pages():
        names[module] = names.get(module, set()) | ((chosen or members) - left_out)
    return names


def test_reference_pages_name_what_is_there_and_all_of_it():
    """A module that a page names whole has each of its public names on a page; of a module from
    which a page chooses, the other names are internal."""
    on_pages = set().union(*public_names().values())
    for module, members, chosen, _ in modules_on_pages():
        assert chosen <= members, module
        assert chosen or members <= on_pages, module


def members_of(tree):
    """What Sphinx shows of a module: ``__all__``, or what it defines with a docstring."""
    members = set()
    for node, following in zip(tree.body, [*tree.body[1:], None], strict=True):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            members.add(node.name)
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            name = ast.unparse(node).partition(" =")[0].partition(":")[0]
            if name == "__all__":
                return {*ast.literal_eval(node.value)}
            if isinstance(following, ast.Expr):
                members.add(name)
    return {name for name in members if re.fullmatch(r"[A-Za-z]\w*", name)}


@cache
def is_public(full):
    """Whether a page names it in its module, or has this module, or a package exports what a page
    names elsewhere."""
    module, _, name = full.rpartition(".")
    pages = public_names()
    if leads_to_a_page(full) or name in pages.get(module, ()):
        return True
    homes = [home for home, names in pages.items() if name in names]
    if not leads_to_a_page(module) or not homes:
        return False
    package, *homes = map(importlib.import_module, (module, *homes))
    exported = name in getattr(package, "__all__", ())
    return exported and any(
        inspect.unwrap(getattr(home, name)) is inspect.unwrap(getattr(package, name))
        for home in homes
    )


def leads_to_a_page(module):
    """Whether a page has the module, or a module of this package."""
    return any(f"{page}.".startswith(f"{module}.") for page in public_names())


def used_names(tree):
    """Yield the full names in coartic that code imports, or uses as attributes of modules."""
    bound = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names if package_of(alias.name) in PACKAGES]
            yield from names
            bound |= {name.partition(".")[0]: name.partition(".")[0] for name in names}
            bound |= {alias.asname: alias.name for alias in node.names if alias.asname}
        elif isinstance(node, ast.ImportFrom) and package_of(node.module) in PACKAGES:
            names = {alias.asname or alias.name: alias.name for alias in node.names}
            bound |= {short: f"{node.module}.{name}" for short, name in names.items()}
            yield from (f"{node.module}.{name}" for name in names.values())
    for node in ast.walk(tree):
        root, *rest = ast.unparse(node).split(".") if isinstance(node, ast.Attribute) else [""]
        if root in bound and leads_to_a_page(".".join([bound[root], *rest[:-1]])):
            yield ".".join([bound[root], *rest])


def internal_names(tree):
    return {name for name in used_names(tree) if not is_public(name)}


def test_studies_use_the_public_interface_alone():
    """Names that a reference page names, imported from there or from the package above."""
    public = """
import coartic
import coartic.analysis.study as reading
from coartic.analysis import SIGNATURES, figures, load
from coartic.motion.trial import reach_goals
coartic.analysis.frames.ranking(reading.load(coartic.load_task.__doc__)).anything
figures.means(figures.PALETTE)
"""
    assert not internal_names(ast.parse(public))
    internal = """
import coartic.internal.files
from coartic.robot import HANDS
import analysis.standings as standings
def late():
    from coartic.analysis import figures
    return figures.save
"""
    assert len(internal_names(ast.parse(internal))) == 4
    used = {
        path.relative_to(ROOT).as_posix(): internal_names(tree_of(path))
        for path in sorted((ROOT / "studies").rglob("*.py"))
    }
    assert len(used) > 10
    assert {path: names for path, names in used.items() if names} == {}


FRESH = """
import importlib.util, sys
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
if importlib.util.find_spec("gymnasium"):
    import coartic.gym
absent("numba", "matplotlib", "torch")
import coartic.analysis.report.build
absent("scipy.stats")  # before an interval is asked for
from coartic import *
from pkgutil import iter_modules
modules = {module.name for module in iter_modules(coartic.__path__)}
assert not modules & set(coartic.__all__), "a module would hide what has its name"
"""


@pytest.mark.process
def test_the_package_imports_what_is_asked_for():
    said = python("-c", FRESH).stdout
    assert "verify" in said
    assert "dual-process/" in said


def has_encoding(call):
    """Whether a call that reads or writes text names the encoding; all other calls have it."""
    name, *arguments = map(ast.unparse, (call.func, *call.args))
    if not re.search(r"^(?!os\.|webbrowser\.).*\b(open|read_text|write_text)$", name, re.DOTALL):
        return True
    if {keyword.arg for keyword in call.keywords} & {"encoding", "errors"}:
        return True
    return bool(arguments and re.fullmatch(r"'(utf-8(-sig)?|[arwx][+]?b)'", arguments[-1]))


def test_texts_are_read_and_written_in_an_encoding_that_is_named():
    """Else a locale decides, and a dagger ends a report."""
    for call, named in (
        ("x.read_text()", False),
        ("open(x, 'w')", False),
        ("x.open('xb')", True),
        ("open(x, encoding='ascii')", True),
    ):
        assert has_encoding(ast.parse(call).body[0].value) == named, call
    for path in sources():
        for node in ast.walk(tree_of(path)):
            if isinstance(node, ast.Call):
                assert has_encoding(node), f"{path}, line {node.lineno}"


def test_one_kinematic_module():
    """No cosine or sine is taken outside the robot, the functions handed to it, and the referee."""
    home = {"coartic/robot.py", "coartic/motion/trigonometry.py", "analysis/verify.py"}
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
