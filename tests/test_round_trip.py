"""What a user writes has one form: validated, hashed, stored, and handed to the method."""

import hashlib
import json
import math
import multiprocessing
import os
import sqlite3
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest

from coartic import CoarticError, MotionModel, load_task
from coartic.analysis.study import load
from coartic.benchmarks.planning import plan_suite
from coartic.benchmarks.registry import built_in, registry
from coartic.benchmarks.runner import perform
from coartic.benchmarks.worker import perform_job
from coartic.model import PAPER, check_model, model_from
from coartic.runs.plan import Job, hash_of
from coartic.runs.store import RUNS_FILE, open_store, open_store_for_writing
from tests.support.suites import KNOWN, InProcess, cell_on

HEAD = 'title = "x"\ndescription = "x"\nruns = 2\ntrials = 30\n'


@pytest.fixture
def suite(tmp_path):
    def written(lines, methods="'random-search', 'cma-es/bandit'", name="own.toml"):
        path = tmp_path / name
        block = f"[[blocks]]\ntasks = ['ascending']\nmethods = [{methods}]\n"
        path.write_text(f"{HEAD}{block}{lines}\n", "utf-8")
        return path

    return written


# ---- Worlds ----


@pytest.mark.parametrize("number", [4, 4.0, np.int64(4), np.float32(4)])
def test_a_number_makes_one_world_whatever_its_type(number, suite):
    weight = repr(number) if type(number) in (int, float) else "4"
    of_suite = plan_suite(suite(f"model = {{ base_weight = {weight} }}"))
    of_command = plan_suite(suite(""), model={"base_weight": number})
    due = plan_suite(suite("model = { base_weight = 4.0 }"))
    for plan in (of_suite, of_command):
        assert [job.cell.id for job in plan] == [job.cell.id for job in due]
        assert {job.cell.world for job in plan} == {"base_weight=4.0"}
    cell = replace(due[0].cell, model=MotionModel(base_weight=number))
    assert cell.id == due[0].cell.id


def test_constants_have_one_type():
    written = {"gain": 1, "motor_noise": np.float32(0.5), "arrival_tolerance": np.int8(0)}
    written |= {"max_iterations": np.int64(9), "norm": np.str_("maximum")}
    model = model_from(written)
    assert model == PAPER._replace(**written)
    kinds = {float: 5, int: 1, str: 1, type(None): 2}  # the task's radius, and a tolerance
    assert {kind: [*map(type, model)].count(kind) for kind in kinds} == kinds
    assert check_model(model) is model


def as_version_7(folder, name="base_weight"):
    """Give a folder the cells and ids that version 7.0.0 made of an integer constant."""
    with closing(sqlite3.connect(folder / RUNS_FILE)) as db:
        for cell_id, content in db.execute("SELECT id, content FROM cells").fetchall():
            cell = json.loads(content)
            cell["model"][name] = int(cell["model"][name])
            digest = hash_of(cell | {"method": cell["method"]["name"]})
            new_id = f"{digest[:16]}-{cell['method']['code']}"
            world = f"{name}={cell['model'][name]}"
            db.execute(
                "UPDATE cells SET id = ?, digest = ?, content = ?, world = ? WHERE id = ?",
                (new_id, digest, json.dumps(cell), world, cell_id),
            )
            for seed, run in db.execute(
                "SELECT suite_seed, run FROM results WHERE cell = ?", (cell_id,)
            ).fetchall():
                run_id = f"{hash_of_text(f'{digest} {seed} {run}')}-{cell['method']['code']}"
                db.execute(
                    "UPDATE results SET cell = ?, run_id = ? WHERE cell = ? AND run = ?",
                    (new_id, run_id, cell_id, run),
                )
        db.commit()
        return {cell_id for (cell_id,) in db.execute("SELECT id FROM cells")}


def hash_of_text(text):
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def stored(folder):
    with closing(sqlite3.connect(folder / RUNS_FILE)) as db:
        return sorted(db.execute("SELECT run_id, cell, result, date FROM results"))


def test_a_folder_of_version_7_with_an_integer_constant_is_mended(suite, tmp_path):
    path, folder = suite("model = { base_weight = 4 }"), tmp_path / "old"
    perform(plan_suite(path), folder, executor=InProcess())
    due = stored(folder)
    # The ids are those that `coartic run` of version 7.0.0 made.
    assert as_version_7(folder) == {"8cc64b2adbc47b78-1.1", "d8e7ce1dbfcb48f0-1.2"}
    assert "2bffbfa71181de7b-1.1" in {row[0] for row in stored(folder)}
    assert {row[0] for row in stored(folder)}.isdisjoint(row[0] for row in due)
    with pytest.raises(CoarticError, match="7.0.0 stored an integer .* repeat the `coartic run`"):
        load(folder).runs  # noqa: B018
    progress = perform(plan_suite(path, runs=3), folder, executor=InProcess())
    assert (progress.present, progress.done, progress.others) == (4, 2, 0)
    assert {*due} < {*stored(folder)}  # with their dates: no method made them again
    assert load(folder).runs.world.unique().tolist() == ["base_weight=4.0"]
    assert len(load(folder).runs) == 6


def test_runs_of_both_forms_of_a_world_are_one(suite, tmp_path):
    """As of a folder in which 4 was written first, and 4.0 later."""
    path, folder = suite("model = { base_weight = 4 }"), tmp_path / "old"
    perform(plan_suite(path), folder, executor=InProcess())
    due = [row[:3] for row in stored(folder)]
    as_version_7(folder)
    with closing(sqlite3.connect(folder / RUNS_FILE)) as db:
        old = db.execute("SELECT * FROM cells").fetchall(), stored(folder)
    with open_store_for_writing(folder) as store:  # the runs of 4.0, without those of 4
        store._mend_worlds()
    with closing(sqlite3.connect(folder / RUNS_FILE)) as db:
        db.executemany(f"INSERT INTO cells VALUES ({', '.join('?' * len(old[0][0]))})", old[0])
        columns = [row[1] for row in db.execute("PRAGMA table_info(results)")]
        names = ", ".join(f'"{name}"' for name in columns if name not in ("cell", "run_id"))
        for (run_id, cell, *_), (same, *_) in zip(old[1], sorted(due), strict=True):
            db.execute(
                f"INSERT INTO results (cell, run_id, {names}) SELECT ?, ?, {names} FROM results "
                "WHERE run_id = ?",
                (cell, run_id, same),
            )
        db.commit()
    assert len(stored(folder)) == 2 * len(due)
    progress = perform(plan_suite(path), folder, executor=InProcess())
    assert (progress.done, progress.others) == (0, 0)
    assert [row[:3] for row in stored(folder)] == due


# ---- Parameters of methods from files ----

FILE = """
import math
from enum import Enum
from pathlib import Path
from typing import Any, Literal
from pydantic import BaseModel, Field, field_validator
from coartic.method import Information, Method, Parameters, Result
from coartic.motion.solution import Movement

class Mine(Method):
    name = title = "mine"; citation = "Ours."; stochastic = False
    information = frozenset({Information.CORRECTIVE_PROCESS})
    def solve(self, session):
        goals = range(1, session.goals_count + 1)
        got = {name: repr(value) for name, value in self.parameters}
        return Result(tuple(Movement(goal, "right", "corrective") for goal in goals), got)

class Inner(BaseModel):
    rate: float = 1

class Mood(Enum):
    CALM = "calm"
    WILD = "wild"

class P(Parameters):
"""


@pytest.fixture
def own(tmp_path):
    """Writes the class of the parameters of method ``mine``, and returns its file."""

    def written(fields, name="m.py", after="\nMine.Parameters = P\n"):
        lines = "".join(f"    {line}\n" for line in fields.splitlines())
        (tmp_path / name).write_text(FILE + lines + after, "utf-8")
        return tmp_path / name

    return written


def used(suite, path, lines, folder):
    """The settings in column ``setting`` and what the method got, after all went through a file."""
    perform(plan_suite(suite(lines, "'mine'"), method_files=[path]), folder, executor=InProcess())
    with open_store(folder) as store:
        runs = store.runs()
        got = [store.run(run_id).details for run_id in runs.run_id]
    return runs.setting.tolist(), got, [json.loads(text) for text in runs.parameters]


KINDS = {  # the type and default, the values in a grid, and what a method gets of each
    "tuple[float, ...] = (0.1, 0.2)": ("[[1, 2], [3, 4]]", ["(1.0, 2.0)", "(3.0, 4.0)"]),
    "list[float] = [0.1, 0.2]": ("[[1, 2.5]]", ["[1.0, 2.5]"]),
    "tuple[int, ...] = (8, 8)": ("[[16], [8, 8]]", ["(16,)", "(8, 8)"]),
    "tuple[float, float] | None = None": ("[[1, 2]]", ["(1.0, 2.0)"]),
    "bool | int = 1": ("[1, true, 2]", ["1", "True", "2"]),
    "int | float = 1": ("[1, 1.0, 2]", ["1", "1.0", "2"]),
    "float = 1": ("[1, 2]", ["1.0", "2.0"]),
    "int | str = 1": ('[1, "two"]', ["1", "'two'"]),
    "Literal['a', 'b'] = 'a'": ('["a", "b"]', ["'a'", "'b'"]),
    "Mood = Mood.CALM": ('["calm", "wild"]', ["<Mood.CALM: 'calm'>", "<Mood.WILD: 'wild'>"]),
    "Inner = Inner()": ("", ["Inner(rate=1.0)"]),
    "dict[str, float] = {'a': 1}": ("", ["{'a': 1.0}"]),
}


@pytest.mark.process
@pytest.mark.parametrize("kind", KINDS)
def test_a_method_gets_what_a_suite_asks_for(kind, suite, own, tmp_path):
    values, due = KINDS[kind]
    lines = f"grid = {{ value = {values} }}" if values else ""
    settings, got, parameters = used(suite, own(f"value: {kind}"), lines, tmp_path / "out")
    assert [each["value"] for each in got] == due
    assert len({*settings}) == len(due)
    assert all({*each} == {"value"} for each in parameters)
    # Written in the same way, the default is no setting; what is written otherwise is one.
    assert settings.count("") == IS_DEFAULT.count(kind)


IS_DEFAULT = [kind for kind in KINDS if not kind.startswith(("tuple[float", "list"))]
"""Kinds in whose grid a value is the default, or that have no grid."""
REFUSED = {
    "turn: float = 30.0\n@field_validator('turn')\n@classmethod\n"
    "def rad(cls, x): return math.radians(x)": r"turn is 1\.57.*, and 0\.027.* must keep a default",
    "turn: tuple[float, ...] = (1.0,)\n@field_validator('turn')\n@classmethod\n"
    "def sorted(cls, x): return (*x, 1.0)": r"turn is \(90\.0, 1\.0\), and \(90\.0, 1\.0, 1\.0\)",
    "turn: float = Field(default=1.0, exclude=True)": r"turn is 90\.0, and 1\.0 when it is stored",
    "turn: float = 1.0\nother: Any = (1, 2)": r"other is \(1, 2\), and \[1, 2\] when",
    "turn: frozenset[float] = frozenset({1.0, 90.0})": "turn is frozenset.* no set, which has no",
    "turn: float = 1.0\nother: float = None": "other is None; it should be a valid number",
    "turn: float = 1.0\nother: float = Field(default=1.0, alias='o')": "other is an unknown key",
}


@pytest.mark.process
@pytest.mark.parametrize("fields", REFUSED)
def test_what_does_not_come_back_is_refused_before_anything_runs(fields, suite, own, tmp_path):
    value = "[90]" if "tuple" in fields else "90.0"
    path = suite(f"parameters = {{ turn = {value} }}", "'mine'")
    with pytest.raises(CoarticError, match=REFUSED[fields]):
        plan_suite(path, method_files=[own(fields)])


@pytest.mark.process
def test_a_conversion_that_is_made_once_is_allowed(suite, own, tmp_path):
    """A validator that leaves alone what it returned, such as one that rounds or orders."""
    fields = (
        "turn: float = 0.0\nwords: tuple[float, ...] = (1.0, 2.0)\n"
        "@field_validator('turn')\n@classmethod\ndef whole(cls, x): return float(round(x))\n"
        "@field_validator('words')\n@classmethod\ndef ordered(cls, x): return tuple(sorted(x))"
    )
    lines = "parameters = { turn = 1.7, words = [3, 2] }"
    settings, got, parameters = used(suite, own(fields), lines, tmp_path / "out")
    assert settings == ["turn=2.0, words=[2.0, 3.0]"]
    assert parameters == [{"turn": 2.0, "words": [2.0, 3.0]}]
    assert got == [{"turn": "2.0", "words": "(2.0, 3.0)"}]


@pytest.mark.process
def test_a_number_of_numpy_is_a_number():
    info = built_in()["dual-process/EC1"]
    asked = {"trials": np.int64(20), "epsilon": np.float64(0.3)}
    assert info.complete(asked) == info.complete({"trials": 20, "epsilon": 0.3})
    with pytest.raises(CoarticError, match="must be plain data"):
        info.complete({"trials": object()})


def test_a_default_of_numpy_is_a_number(own):
    number = "__import__('numpy')."
    fields = f"n: int = {number}int64(5)\npair: tuple[float, float] = ({number}float32(0.5), 1.0)"
    info = registry([own(fields)])["mine"]
    assert info.defaults == info.complete({}) == {"n": 5, "pair": [0.5, 1.0]}


def test_names_of_settings_are_told_apart(suite, own):
    path = suite('grid = { value = [1, "1"] }', "'mine'")
    with pytest.raises(CoarticError, match="two settings have the name mine value=1 on ascending"):
        plan_suite(path, method_files=[own("value: int | str = 0")])


@pytest.mark.process
def test_a_default_of_an_own_method_is_hashed(suite, own, tmp_path):
    """It can come from elsewhere, such as a file that nothing notices, and change."""
    step = tmp_path / "step.txt"
    path = own("step: float = float(Path(__file__).with_name('step.txt').read_text())")
    asked, rows = suite("", "'mine'"), {}
    for text in ("0.02", "0.2", "0.02"):
        step.write_text(text)
        (job,) = plan_suite(asked, method_files=[path])
        assert (job.cell.setting, job.cell.parameters) == ("", {"step": float(text)})
        rows.setdefault(text, job.run_id(0))
        assert rows[text] == job.run_id(0)
    assert len({*rows.values()}) == 2
    (job,) = plan_suite(suite("parameters = { step = 0.02 }", "'mine'"), method_files=[path])
    assert job.run_id(0) == rows["0.02"]  # whoever writes the default asks for the same run


@pytest.mark.process
def test_runs_of_an_own_method_that_version_7_made_stay(suite, own, tmp_path):
    """It did not hash defaults: the runs can be read, and a command makes its own beside them."""
    path, folder = own("step: float = 0.02"), tmp_path / "out"
    plan = plan_suite(suite("", "'mine'"), method_files=[path])
    old = [replace(job, cell=replace(job.cell, parameters={})) for job in plan]
    perform(old, folder, executor=InProcess())
    assert load(folder).runs[["step", "status"]].values.tolist() == [[0.02, "ok"]]
    progress = perform(plan, folder, executor=InProcess())
    assert (progress.present, progress.done, progress.others) == (0, 1, 1)
    assert str(progress).endswith("(without 1 run of earlier commands)")


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"trials": np.bool_(True)}, "not JSON serializable"),
        ({"trials": (1, 2)}, "its values change"),
        ({1: 2}, "its values change"),
    ],
)
def test_a_cell_that_would_not_come_back_is_never_stored(parameters, words, tmp_path):
    good = cell_on(load_task("ascending"), KNOWN["random-search"])
    plan = [
        Job(cell, 0, (0,), None, "own") for cell in (good, replace(good, parameters=parameters))
    ]
    with pytest.raises(CoarticError, match=f"cannot be stored and read back .*{words}"):
        perform(plan, tmp_path / "out", executor=InProcess())
    with (
        pytest.raises(CoarticError, match="is not finished"),
        open_store(tmp_path / "out") as store,
    ):
        store.plan()


# ---- Declarations and files ----

DECLARATIONS = {
    "Parameters = dict": "Parameters must be a subclass of coartic.method.Parameters, not <class",
    "Parameters = Parameters()": "Parameters must be a subclass",
    "stochastic = 0": "stochastic must be True or False, not 0",
    "version = '2'": "version must be an integer, not '2'",
    "version = True": "version must be an integer, not True",
    "quick = [1]": r"quick must be a dict of parameters, not \[1\]",
    "files = ('weights.npz')": "files must be a tuple of names, .* not 'weights.npz'",
    "files = (1,)": r"files must be a tuple of names, .* not \(1,\)",
}


@pytest.mark.process
@pytest.mark.parametrize("line", DECLARATIONS)
def test_a_declaration_of_a_wrong_type_is_one_sentence(line, own):
    path = own("step: float = 1.0", after=f"\nclass Other(Mine):\n    name = 'other'; {line}\n")
    with pytest.raises(CoarticError, match=f"m.py: Other: {DECLARATIONS[line]}"):
        registry([path])


@pytest.mark.process
@pytest.mark.parametrize("value", ["''", "False", "True", "' '"])
def test_a_reason_is_a_sentence_or_none(value, own):
    reason = f"\nMine.inapplicable_reason = lambda self, task: {value}\n"
    info = registry([own("step: float = 1.0", after=reason)])["mine"]
    with pytest.raises(
        CoarticError, match="inapplicable_reason returned .*; it must return a sent"
    ):
        info.inapplicable_reason(load_task("ascending"))


@pytest.mark.process
@pytest.mark.parametrize(
    ("name", "line"),
    [("random", "from random import gauss"), ("calendar", "import calendar as c"),
     ("pydantic", "import pydantic.fields"), ("helper", "import helper")],
)  # fmt: skip
def test_a_module_that_another_would_replace_is_refused(name, line, own, tmp_path):
    """Also if only another module of the user imports it."""
    (tmp_path / f"{name}.py").write_text("def gauss(): return 1.0\n")
    (tmp_path / "between.py").write_text(line)
    path = own("step: float = 1.0")
    text = path.read_text()
    for first in (line, "import between"):
        path.write_text(f"{first}\n{text}")
        if name == "helper":
            assert registry([path])["mine"].code
            continue
        with pytest.raises(CoarticError, match=f"{name} is also the name of a module .* another"):
            registry([path])


@pytest.mark.process
def test_planning_leaves_no_process(suite, own):
    def left():
        return {child.pid for child in multiprocessing.active_children()}, len(
            os.listdir("/proc/self/fd")
        )

    if not os.path.exists("/proc/self/fd"):
        pytest.skip("no /proc")
    path, wrong = own("step: float = 1.0"), own("step: int = 1.0", "wrong.py", "\nimport nothing\n")
    plan_suite(suite("", "'mine'"), method_files=[path])  # starts what Python keeps
    before = left()
    for _ in range(3):
        plan_suite(suite("", "'mine'"), method_files=[path])
        with pytest.raises(CoarticError, match="cannot be imported"):
            plan_suite(suite(""), method_files=[wrong])
    assert left() == before


@pytest.mark.process
def test_what_a_solution_uses_is_noted(suite, own):
    """A movement that only the corrective process makes uses it, whatever the method called."""
    (job,) = plan_suite(suite("", "'mine'"), method_files=[own("step: float = 1.0")])
    (outcome,) = perform_job(job)
    assert (outcome.status, outcome.used) == ("ok", ("corrective process",))
    job = replace(job, cell=replace(job.cell, method=replace(job.cell.method, information=())))
    (outcome,) = perform_job(job)
    assert (outcome.status, outcome.used) == ("crashed", ())
    assert "used 'corrective process', which it does not declare" in outcome.reason


# ---- Worlds of methods beside a suite ----


@pytest.mark.process
@pytest.mark.filterwarnings("ignore:suite 'comparison', block .* is left out")
def test_a_method_file_joins_every_world_that_it_can(own):
    def worlds(fields, after, **options):
        plan = plan_suite("comparison", method_files=[own(fields, after=after)], **options)
        mine = [job.cell for job in plan if job.cell.method.name == "mine"]
        assert len({cell.id for cell in mine}) == len(mine)
        return {(cell.task.name, cell.world) for cell in mine}

    tasks = ("ascending", "descending", "two-armed-1", "two-armed-2")
    both = {(task, world) for task in tasks for world in ("", "motor_noise=0.01")}
    assert worlds("step: float = 1.0", "\n", methods=["mine"]) == both
    assert worlds("step: float = 1.0", "\n") == both
    only = "\nMine.refuses = classmethod(lambda cls, model: 'no noise')\n"
    assert worlds("step: float = 1.0", only) == {(task, "") for task in tasks}
    one = worlds("step: float = 1.0", "\n", methods=["mine"], model={"base_weight": 4})
    assert one == {(task, "base_weight=4.0") for task in tasks}


def test_only_methods_that_run_are_asked_for_a_world(suite):
    planner = suite("", "'posture-based/one-goal', 'EC1'")
    plan = plan_suite(planner, methods=["EC1"], model={"base_weight": 4})
    assert [job.cell.label for job in plan] == ["dual-process/EC1"]
    for methods in ([], ["*"], ["posture-based/one-goal"], ["EC1", "posture-based/*"]):
        with pytest.raises(CoarticError, match=r"model.base_weight is 4\.0; method 'posture-based"):
            plan_suite(planner, methods=methods, model={"base_weight": 4})
    assert math.isclose(plan[0].cell.model.base_weight, 4.0)


# ---- Folders that a notebook has loaded ----


def made_in(folder, seed=0, runs=2):
    options = {"tasks": ["ascending"], "methods": ["random-search"], "trials": 30}
    return perform(
        plan_suite("quick", runs=runs, seed=seed, **options), folder, executor=InProcess()
    )


def test_a_study_stays_with_its_folder_when_the_working_folder_changes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    made_in(tmp_path / "res")
    made_in(tmp_path / "other" / "res", seed=7)
    study, expected = load("res"), load(tmp_path / "res").solutions
    monkeypatch.chdir(tmp_path / "other")
    assert study.solutions.equals(expected)
    assert len(study.executed("ascending", "random-search").runs) == 2


def test_a_folder_that_grows_can_be_read_on_and_one_that_shrinks_is_told(tmp_path):
    folder = tmp_path / "res"
    made_in(folder)
    study, other = load(folder), load(folder)
    made_in(folder, runs=3)
    assert {*study.solutions.run_id} == {*study.runs.run_id}
    made_in(folder, runs=1)
    with pytest.raises(CoarticError, match="was changed since it was loaded"):
        _ = other.solutions
