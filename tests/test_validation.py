"""What a user writes wrong gets one sentence, with the key and what would be right."""

import ast
import inspect
import itertools
import os
import re
import traceback
from functools import partial
from inspect import getmembers, isfunction
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import coartic
from coartic import (
    PAPER,
    CoarticError,
    ExplorationCondition,
    Movement,
    Provenance,
    Robot,
    Task,
    analysis,
    builtin_tasks,
    correct,
    corrective_trial,
    estimates,
    execute,
    learn,
    load_task,
    movements_of,
    trajectory,
)
from coartic.analysis import FIGURES, TABLES, ecdf, interval, mean, means, other_tasks
from coartic.analysis.signatures import Solutions
from coartic.analysis.statistics import holm
from coartic.benchmarks.planning import plan_suite
from coartic.benchmarks.registry import registry
from coartic.benchmarks.runner import perform, run_suite
from coartic.internal.text import did_you_mean, plain
from coartic.method import Information, Session
from coartic.motion.trial import reach_goals
from coartic.tasks.families import FAMILY_FOLDER, instance_names, read_family
from coartic.tasks.task import TASK_FOLDER
from tests.support.bad_inputs import GOOD
from tests.support.strategies import make_trials
from tests.support.suites import KNOWN, ROOT

TASK_FILE = TASK_FOLDER / "1-ascending.toml"
FAMILY_FILE = FAMILY_FOLDER / "long.v1.toml"
NO_METHOD = Path(__file__).parents[1] / "LICENSE"
FAMILY = """
title = "Mine"
description = "Mine."
goals = [2, 3]
links = [4, 4]
base = ["free"]
[region]
x = [-5, 5]
y = [-3, 3]
[[start]]
"""
SUITE = """
title = "x"
description = "x"
runs = 1
[[blocks]]
tasks = ["ascending"]
methods = ["dual-process/EC1"]
"""
METHOD = """
from coartic.method import Method
class A(Method):
    name = "a"
    title = citation = "x"
    information = frozenset()
    def solve(self, session): ...
"""


def changed(good, old, new):
    assert old in good
    return good.replace(old, new)


task, family, suite, method = (partial(changed, text) for text in (GOOD, FAMILY, SUITE, METHOD))

TASKS = [
    (task("[5.0, 2.0]", "[nan, 2.0]"), "goals[1][0] is nan; it should be a finite number"),
    (task("[[5.0, 1.0], [5.0, 2.0]]", "[]"), "goals is []; it needs at least 1 item"),
    ('locked_base = ["x", "y"]\n' + task("[5.0, 2.0]", "[5.0, 20.0]"), "out of reach"),
    ("goal = 1\n" + GOOD, "goal is an unknown key; did you mean 'goals'?"),
    (task('"RR"', '"RRR"'), "initial_hands: hands 'RRR' do not fit task 'mine': needed is"),
    ("hands = ['left']\n" + GOOD, "needed is a text with L for each of 2 goals, or one of best-"),
    (task("right = [0.0, 0.0, 0.0, 0.0]", "right = [0.0, 0.0]"), "start.right"),
    (task('"mine"', '"my task"'), "name is 'my task'; it begins with a letter or digit"),
    ("start = 1\n" + GOOD.partition("[start]")[0], "start is 1; it should be a table"),
    ('title = "a\\nb"' + GOOD, "it should be one line of printable text"),
    (task("goals = [[", "goals = [[["), "line"),
    (f"{GOOD}[penalty]\njoints = 1.0\n", "penalty is an unknown key"),
]
FAMILIES = [
    (family("[2, 3]", "[1, 3]"), "goals[0] is 1; it should be at least 2"),
    (family("[2, 3]", "[5, 3]"), "goals is [5, 3]; it should have the lower number first"),
    (family("[-5, 5]", "[-5, 1e306]"), "region.x[1] is 1e+306; it should be a finite number"),
    (
        family("[-5, 5]", "[-5, 5]\nscale = [0.5, 1.5]"),
        "scale is [0.5, 1.5]; it should be from 0 to",
    ),
    ("reach = 4.0001" + FAMILY, "4.0001 should have at most three decimals"),
]
SUITES = [
    (suite("EC1", "EC3"), "task 'ascending' has no left hand"),
    (SUITE + "parameters = {noise = 1.0}", "noise is an unknown key; did you mean 'noise_sd'?"),
    (SUITE + f"grid = {{noise_sd = [1{400 * '0'}]}}", "a finite number, a text"),
    (suite("runs = 1", "runs = 1.5"), "runs is 1.5; it should be a whole number"),
    (suite('["ascending"]', "3"), "blocks[0].tasks is 3; it should be a list"),
    (SUITE + "move = {goal = 4, by = [[0, 1]]}", "has no goal 4 to move"),
]
METHODS = [
    ("import nothing_like_this", "cannot be imported: ModuleNotFoundError"),
    ("x = 1", "defines no subclass of coartic.Method"),
    ("def (", "cannot be imported: SyntaxError"),
    (method("def solve", "def solves"), "that is complete: A has no solve"),
    (method('    name = "a"\n', ""), "name must be a text"),
    (method('"a"', f'"{81 * "a"}"'), "'.', '_', '+', '/' and '-', at most 80"),
    (method('"a"', '"cma-es/bandit"'), "'cma-es/bandit' is already taken"),
    (method("frozenset()", '"goals"'), "information must be a set of Information"),
    (METHOD + "    files = ('w.npy',)", "w.npy"),
]


@pytest.mark.parametrize(
    ("read", "name", "text", "words"),
    [
        *((load_task, "mine.toml", *case) for case in TASKS),
        *((read_family, "mine.v1.toml", *case) for case in FAMILIES),
        (read_family, "x.toml", FAMILY, "the name of a family's file is NAME.v1.toml"),
        *((plan_suite, "own.toml", *case) for case in SUITES),
        *((lambda path: registry([path]), "mine.py", *case) for case in METHODS),
    ],
)
def test_a_file(read, name, text, words, tmp_path):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    with pytest.raises(CoarticError) as caught:
        read(path)
    (line,) = str(caught.value).splitlines()
    assert words in line
    assert name in line or "suite 'own'" in line or "method '" in line


def test_of_many_problems_the_first_are_said(tmp_path):
    (tmp_path / "mine.toml").write_text("".join(f"a{n} = 1\n" for n in range(100)) + GOOD)
    with pytest.raises(CoarticError) as caught:
        load_task(tmp_path / "mine.toml")
    *lines, last = str(caught.value).splitlines()
    assert len(set(lines)) == 20
    assert last.endswith("has 80 more problems")


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"tasks": ["ascendin"]}, "did you mean 'ascending'?"),
        ({"tasks": ["absent.toml"]}, "absent.toml"),
        ({"tasks": Path("a.toml")}, "tasks is PosixPath('a.toml'); it should be a list"),
        ({"tasks": [3]}, "3 is no task; it should be a name, a path or a task"),
        ({"jobs": 2}, "jobs is no option: give executor=Local(jobs)"),
        ({"scheduler": "x"}, "scheduler is no option: give executor=Dask(scheduler)"),
        ({"method_file": "a.py"}, "method_file is an unknown key; did you mean 'method_files'?"),
        (
            {"method_files": [int]},
            "by the paths of their files, not by <class 'int'>: write it into",
        ),
        ({"runs": 0}, "runs is 0; it must be a whole number from 1"),
        ({"seed": -1}, "seed is -1; it should be at least 0"),
        ({"trials": 10**9}, "trials is 1000000000; it should be at most 10000000"),
        ({"time_limit_s": float("nan")}, "time_limit_s is nan; it should be"),
        ({"folder": ""}, "the name of a folder is empty; the current folder is ."),
        *(({"folder": name}, "cannot be used: ") for name in ("a" * 5000, "x\0y")),
        *(({"folder": name}, f"{name}: needed is a text") for name in (3, None)),
    ],
)
def test_an_argument(wrong, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(CoarticError) as caught:
        run_suite(**{"suite": "paper", "folder": "out"} | wrong)
    assert words in str(caught.value)
    assert len(str(caught.value)) < 300
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize("read", [load_task, lambda path: registry([path])])
@pytest.mark.parametrize("kind", ["pipe", "device", "folder", "large"])
def test_what_is_no_file_is_refused_at_once(read, kind, tmp_path):
    path = tmp_path / "mine.v1.toml"
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "device":
        path.symlink_to("/dev/zero")
    elif kind == "folder":
        path.mkdir()
    else:
        with path.open("wb") as file:
            file.truncate(3_000_000_000)
    with pytest.raises(CoarticError, match="cannot be read|at most") as caught:
        read(path)
    (line,) = str(caught.value).splitlines()
    assert len(line) < 700


@pytest.mark.parametrize("read", [load_task, read_family, plan_suite])
def test_toml_is_bounded_before_it_is_read(read, tmp_path):
    path = tmp_path / "mine.v1.toml"
    for size, words in ((1_000_000, "unknown key|title"), (1_000_001, "1000001 bytes; .* 1000000")):
        path.write_text("x = 1 #".ljust(size, "."))
        with pytest.raises(CoarticError, match=words):
            read(path)


@pytest.mark.parametrize("what", [*TABLES.values(), *FIGURES.values()])
def test_tables_and_figures_are_of_a_study(what):
    with pytest.raises(CoarticError, match="needed is a study, as .* returns it, not a str"):
        what("folder")


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        ("the learner EC1", "dual-process/EC1"),
        ("CMA-ES", "cma-es/bandit"),
        ("posture qp", "posture-qp/goals-ahead"),
        ("Posture based: two goals", "posture-based/two-goals"),
        ("two armed 2", "two-armed-2"),
        ("DESCENDING", "descending"),
        *((name, None) for name in ("", "-", "qqq", ".")),
    ],
)
def test_a_name_as_tables_and_figures_have_it_is_understood(name, meant):
    hint = f"; did you mean {meant!r}?" if meant else ""
    assert did_you_mean(name, [*builtin_tasks(), *KNOWN]) == hint


def test_blanks_before_a_text_do_not_hide_it():
    assert plain("\n" * 9000 + "text", 80) == "text"
    assert plain("a" + " " * 9000 + "b", 80).endswith("…")


OF_ANOTHER_PROGRAM = "arm.urdf: coartic reads no .urdf file; a task is a TOML file"


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (["run", "paper", "--tasks", ""], "unknown task ''"),
        (["draw", "ascending", "--out", ""], "is empty"),
        (["report", "a" * 5000], "File name too long"),
        (["list", "two-armed/v2/i003"], "two-armed/v1"),
        (["check", "two-armed-1"], "two-armed-1 is a task, not a method. `coartic draw"),
        (["check", "mine.py"], "coartic check METHOD --method-file mine.py"),
        (["run", "paper", "--runs", "two"], "runs is 'two'; it must be a whole number from 1"),
        (["list", "--method-file", NO_METHOD], "the name of a method file ends in .py"),
        (["run"], "name a suite: ablations, "),
        (["run", "paper", "--family-file", TASK_FILE], "is a task: coartic run SUITE --tasks"),
        (["run", FAMILY_FILE], "is a family: coartic run SUITE --tasks"),
        (["check", "quick"], "quick is a suite: coartic run quick"),
        (["check", "two-armed"], "is a shipped family: coartic list two-armed"),
        (["run", "paper", "--tasks", "long/v1/*"], "range, such as long/v1/i000..i009"),
        (["draw", ".", "--run", "CMA-ES", "--out", "x.gif"], "column run_ids of a report's"),
        (["draw", "--run", "1a2b"], "--run needs one results folder"),
        (["draw", ".", *["--run", "1a2b"] * 3], "a film shows at most two runs"),
        (["report", "nowhere"], "there is no folder nowhere"),
        (["play", "--out", "x.txt"], "the name must end in .html"),
        (["new", "My Search"], "coartic new: the name 'My Search' must begin with"),
        (["new", "dual-process/EC1"], "'dual-process/EC1' is reserved"),
        (["new", "cma-es"], "'cma-es' is a name of a method here"),
        *(([command, "arm.urdf"], OF_ANOTHER_PROGRAM) for command in ("check", "draw", "list")),
    ],
)
def test_a_command_that_cannot_be_is_one_sentence(command, words, tmp_path, monkeypatch, coartic):
    monkeypatch.chdir(tmp_path)
    code, text, error = coartic(*command)
    (line,) = error.splitlines()
    assert (code, text) == (2, "")
    assert line.startswith("Error: ")
    assert words in line
    assert not [*tmp_path.iterdir()]


Trials = coartic.Optimiser.Parameters
MASKED = np.ma.array(np.zeros(10), mask=[False] * 9 + [True])
HUGE = 10**400  # beyond the range of float
UNMASKED = "it should have no masked entries"
SPAN = np.timedelta64(3, "s")  # NumPy counts it among whole numbers
ODD = (
    *(None, 3, 2.5, "x", "", [], [1], {}, object(), np.zeros(3), np.array(["a"]), np.nan, True),
    *((np.zeros(10), None), b"x", [None], pd.DataFrame({"a": [1]}), lambda: 0, [[1], [1, 2]]),
    *(-3, np.inf, np.full(10, np.nan), pd.NA, {"a": 1}, MASKED, Path("x"), [True, 1.0], SPAN),
    *(HUGE, [HUGE]),
)
TASK, ROBOT = load_task("ascending"), Robot()
TRIAL = corrective_trial(TASK, "RRR")
PATH = trajectory(TASK, TRIAL.movements)
SOLUTIONS = Solutions(TASK, "x", (TRIAL, TRIAL))
SESSION = Session(TASK, 0, frozenset(Information), model=PAPER)
GROUPS = [np.eye(3, 10), np.eye(4, 10)]
FRAME = pd.DataFrame({"method": "a", "task": "t", "reward": [-300.0], "best_known": -292,
                      "run": 0, "trials": 5})  # fmt: skip
USUAL = {
    "task": TASK, "robot": ROBOT, "q": TASK.q0, "target": TASK.q0, "hand": "right",
    "goal": (3.0, 2.0), "hands": "RRR", "radius": 0.1, "left_links": (0.5, 0.5),
    "right_links": (0.5, 0.5), "solution": TRIAL.movements, "movements": TRIAL.movements,
    "condition": "EC1", "seed": 0, "seeds": [0], "trials": 3, "jobs": 1, "half_width": 1.0,
    "budget": 5, "runs": SOLUTIONS, "name_or_path": "ascending", "family": "long/v1",
    "split": "test", "count": 2, "year": None, "content": {"goals": [[3.0, 2.0]]}, "source": "x",
    "reach": True, "width": 200, "replace": True, "frame": FRAME, "hits": FRAME, "by": ["method"],
    "columns": ["reward"], "values": [1.0, 2.0, 3.0], "resamples": 99, "bound": 0.0, "value": 1.5,
    "digits": 2, "row": {"a": 1.0, "a_low": 0.0, "a_high": 2.0}, "column": "a", "scale": 1.0,
    "unit": "",
    "scores": {"a": [np.array([1.0, 2.0])]}, "method": GROUPS, "other": GROUPS,
    "rng": np.random.default_rng(0), "alternative": "less", "p_values": [0.1, 0.2],
    "total": 5, "share": 0.5, "folder": "nowhere", "ticks_per_unit": 1.0,
    "difference": np.ones(10), "jacobian": ROBOT.jacobian(TASK.q0, "right"),
    "rewards": [-300.0, None], "locked_base": ["y"],
}  # fmt: skip
"""Arguments by the names of parameters, for all functions that take no others of these names."""


def with_arguments(function, **own):
    """A function, and arguments that it takes."""
    parameters = inspect.signature(function).parameters
    return function, {name: USUAL[name] for name in USUAL if name in parameters} | own


OF_STUDY = {
    **{name: {"signature": "first", "task": "two-armed-1", "label": "dual-process/EC4"}
       for name in ("mean_excess", "with_control")},
    "contexts_of_control": {"contexts": None},
    "runtimes": {"targets": [0.5]},
}  # fmt: skip


RIGHT = {"hands": ["right"]}
OWN = {
    "movements_of": {"targets": TRIAL.configurations},
    "ecdf": {"targets": [0.1]},
    "execute_noisy": {"solutions": [TRIAL.movements], "motor_noise": 0.01, "repeats": 2,
                      "seed": [0], "signal_dependent": False},
    "hand_sequences": RIGHT,
    "initial_hands": RIGHT,
    "read_hits": {"path": "nowhere.csv"},
}  # fmt: skip
PUBLIC = {name: each for package in (coartic, analysis)
          for name, each in getmembers(package, isfunction)
          if name in package.__all__ and name not in OF_STUDY}  # fmt: skip
CALLS = (
    *(with_arguments(call, **OWN.get(name, {})) for name, call in PUBLIC.items()),
    *map(with_arguments, (
        Robot, ROBOT.forward_kinematics, ROBOT.jacobian, ROBOT.base_outline, ROBOT.arm,
        ROBOT.joints, ROBOT.reach, ROBOT.joint_positions, ROBOT.linearised, PATH.hand_path,
        instance_names, SESSION.trial,
    )),
    with_arguments(Task, goals=[(3.0, 2.0)], locked_base=["y"], **RIGHT),
    with_arguments(plan_suite, suite="quick", tasks=["ascending"], methods=["EC1"], runs=1,
                   seed=0, trials=5, time_limit_s=1.0, trial_budget=5),
    with_arguments(PATH.animate, path=".gif"),
    with_arguments(reach_goals, q=[TASK.q0], hands=[1], goals=[(3.0, 2.0)], targets=None,
                   checks=True, locked_base=(), model=PAPER),
    with_arguments(SESSION.correct, goal=1),
    with_arguments(SESSION.spend, solver_iterations=1),
    with_arguments(SESSION.trials, targets=TRIAL.configurations[None], until=None),
    with_arguments(SESSION.find_initial_hands, **RIGHT),
)  # fmt: skip


def refused_by_us(call):
    """Whether a call is taken, or refused by a statement of coartic rather than by what it calls;
    and the error in words."""
    try:
        call()
    except Exception as error:
        return is_ours(error), repr(error)
    return True, ""


def is_ours(error):
    last = traceback.extract_tb(error.__traceback__)[-1]
    file, number = Path(last.filename), last.lineno or 1
    if ".venv" in file.parts or ROOT not in file.parents:
        return False
    return "raise " in file.read_text("utf-8").splitlines()[number - 1]


@pytest.mark.parametrize(("call", "usual"), CALLS)
def test_no_wrong_argument_gets_an_error_of_python(call, usual):
    assert refused_by_us(partial(call, **usual))[0]
    hints = inspect.signature(call).parameters
    for name, value in itertools.product(usual, ODD):
        ours, words = refused_by_us(partial(call, **usual | {name: value}))
        assert ours, (name, value, words)
        if value is MASKED and name in hints:
            is_array = re.search("Numbers|Config|Sequence.float", str(hints[name].annotation))
            assert words or not is_array, name
        is_number = isinstance(value, int | float | None)
        assert words or is_number or type(usual[name]) is not int, (name, value)
        if name == "hand":
            assert re.search("left'?(,| and| or) '?right", words), (value, words)


TAKE_A_TASK = [each for name, each in getmembers(coartic, isfunction)
               if {"task", "name_or_path"} & {*inspect.signature(each).parameters}]  # fmt: skip


@pytest.mark.parametrize("call", TAKE_A_TASK)
def test_a_name_and_a_path_stand_for_the_task(call):
    usual = dict(CALLS)[call]
    first = next(iter(usual))
    for given in (usual[first], str(TASK_FILE), TASK_FILE):
        due, found = (call(**usual | {first: each}) for each in ("ascending", given))
        if call is coartic.objective:
            due, found = ([each.task, each.bounds.tolist()] for each in (due, found))
        assert repr(found) == repr(due)
    for wrong in (None, ["ascending"], {"name": "ascending"}):
        with pytest.raises(TypeError, match=r"task is .*; it must be .* path of a task file"):
            call(**usual | {first: wrong})
    with pytest.raises(coartic.TaskError, match="did you mean 'ascending'"):
        call(**usual | {first: "ascendng"})


def as_lists(value):
    """A value with lists in place of arrays."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, dict):
        return {key: as_lists(each) for key, each in value.items()}
    return [as_lists(each) for each in value] if isinstance(value, list) else value


@pytest.mark.parametrize(
    ("call", "usual"),
    [
        *CALLS,
        (other_tasks, {"scores": {"a": [np.array([1.0, 2.0])] * 3}}),
    ],
)  # fmt: skip
def test_arrays_may_be_lists(call, usual):
    def outcome(arguments):
        try:
            return call(**arguments)
        except Exception as error:
            return error

    due, found = outcome(usual), outcome(as_lists(usual))
    plain = isinstance(due, np.ndarray | float | estimates.Estimate) and "rng" not in usual
    if plain or isinstance(due, Exception) or isinstance(found, Exception):
        assert repr(found) == repr(due)


@pytest.mark.parametrize("name", OF_STUDY)
def test_no_wrong_question_to_a_study_gets_an_error_of_python(name, traced):
    usual = OF_STUDY[name]
    call = partial(getattr(analysis, name), traced)
    for argument, value in itertools.product(usual, ODD):
        ours, words = refused_by_us(partial(call, **usual | {argument: value}))
        assert ours, (argument, value, words)
        assert words or value in (True, 3, [1]), (argument, value)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (
            lambda: correct(ROBOT, TASK.q0, "right", (True, 1.0)),
            "goal is .*; it .* without True",
        ),
        (lambda: ROBOT.jacobian(TASK.q0 * np.nan, "right"), "configuration .* is not finite"),
        (lambda: Movement(1, "right", "planned", MASKED), f"target is .*{UNMASKED}"),
        (lambda: Movement(1, "right", "path", waypoints=[MASKED]), f"waypoints is .*{UNMASKED}"),
        (lambda: make_trials(TASK, "RRR", [[MASKED] * 3]), UNMASKED),
        (lambda: means(FRAME, ["method"], ["\x1b[31mred"]), r"no column \\x1b\[31mred"),
        (lambda: Provenance("chosen"), "Provenance takes arguments by name, such as status=..."),
        (lambda: Robot(*[(1.0,)] * 9), "Robot: .*; it takes 5 arguments"),
        (lambda: mean([1.0], [2.0]), "mean: it takes 1 argument$"),
        (lambda: reach_goals(3, [TASK.q0], [0], [], 1.0), "it should be an instance of Robot"),
        (lambda: Task(goals=[(3.0, 2.0)], q0=TASK.q0 * np.nan), "Task: q0 is .*; needed are fin"),
        (
            lambda: interval({"a": "x", "a_low": 0, "a_high": 1}, "a"),
            "the row has no numbers a, a_l",
        ),
        *(
            (lambda values=values: mean(values), "from 1e-100 to 1e100 in size")
            for values in ([1e101, 0.0, 1.0], [1e-101, 0.0, 1.0])
        ),
        *(
            (lambda given=given: holm(*given), "needed are p-values, 0 to 1, of . tests at most")
            for given in (([0.1, 1.01],), ([-0.01],), ([0.1, 0.2], 1))
        ),
        *(
            (lambda plan=plan: perform(plan, "x"), "plan is .*; it must be a list of jobs")
            for plan in (None, [], "x", [1])
        ),
        (
            lambda: learn(TASK, "EC1", seed=10**5000, trials=1),
            "seed is a value of type int; it must",
        ),
        (lambda: analysis.number(np.timedelta64(3)), "value is '3 generic time units'; it should"),
        (lambda: Task(goals=[(3.0, np.True_)]), r"goals\[0\]\[1\] is True; it should be a number"),
        (lambda: ROBOT.jacobian([[np.True_, 1.0]], "right"), "real numbers, without True or False"),
        (lambda: movements_of("RRR", np.zeros((2, 10))), "a row for each of the 3"),
        (lambda: Robot(links=(1, 1)), "Robot: links is an unknown key; did you mean 'left_l"),
        (
            lambda: ExplorationCondition("x", ("right",), True, True, "all"),
            "ExplorationCondition: hand_exploration is 'all'; it sh",
        ),
        (lambda: Trials(trials=0), "Parameters: trials is 0; it should be greater"),
    ],
)
def test_what_was_taken_silently_or_badly_has_a_sentence(call, words):
    with pytest.raises((CoarticError, ValueError, TypeError), match=words):
        call()


@pytest.mark.parametrize("field", ["goal", "hand", "kind", "target", "waypoints"])
def test_no_wrong_movement_gets_an_error_of_python(field):
    for kind, value in itertools.product(("planned", "path"), ODD):
        usual = {"goal": 1, "hand": "right", "kind": kind, "target": TASK.q0}
        usual["waypoints"] = [TASK.q0] if kind == "path" else None
        movement = partial(Movement, **usual | {field: value})
        ours, words = refused_by_us(lambda make=movement: execute(TASK, [make()]))
        assert ours, (value, words)
        assert "ambiguous" not in words


@pytest.mark.parametrize(
    ("call", "usual", "name", "value"),
    [
        (plan_suite, {"suite": "paper"}, "runs", "3"),
        (ecdf, {"frame": FRAME}, "targets", "x"),
        (learn, {"task": "two-armed-1", "trials": 1, "seed": 0}, "condition", 3),
        (instance_names, {"family": "long/v1", "split": "fresh"}, "year", None),
    ],
)  # fmt: skip
def test_advice_that_is_followed_is_taken(call, usual, name, value):
    with pytest.raises((CoarticError, ValueError, TypeError), match="such as") as caught:
        call(**usual | {name: value})
    said = str(caught.value).rpartition("such as ")[2]
    advice = re.match(r"(\[+.*\]+|range\(.*\)|'[^']*'|[0-9]+)", said)[1]
    call(**usual | {name: ast.literal_eval(advice) if "range" not in advice else range(50, 100)})


def test_advice_about_instances_and_their_families_is_taken(tmp_path):
    for wrong in ("two-armed/v1/x1", "two-armed/v1/i0..x9"):
        with pytest.raises(CoarticError) as caught:
            plan_suite("paper", tasks=[wrong])
        advice = re.search(r"(for example|such as) ([a-z0-9/-]+[.]*[a-z0-9]*)", str(caught.value))
        assert plan_suite("paper", tasks=[advice[2]], methods=["EC4"])
    family = tmp_path / "strips.v1.toml"
    shipped = ROOT / "coartic" / "tasks" / "families" / "two-armed.v1.toml"
    family.write_text(shipped.read_text("utf-8"), "utf-8")
    with pytest.raises(CoarticError, match="such as") as caught:
        plan_suite("paper", family_files=[family])
    advice = str(caught.value).rpartition("such as ")[2]
    assert len(plan_suite("paper", family_files=[family], tasks=[advice], methods=["EC4"])) == 10
