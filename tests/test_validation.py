"""What a user writes wrong gets one sentence, with the key and the value."""

import inspect
from functools import partial
from inspect import getmembers, isfunction

import numpy as np
import pytest

import coartic
from coartic import (
    PAPER,
    CoarticError,
    Movement,
    Robot,
    Task,
    correct,
    corrective_trial,
    load_task,
)
from coartic.analysis import interval, mean
from coartic.analysis.statistics import holm
from coartic.benchmarks.planning import plan_suite
from coartic.benchmarks.registry import registry
from coartic.benchmarks.runner import run_suite
from coartic.method import Information, Session
from coartic.tasks.families import read_family
from coartic.tasks.task import TASK_FOLDER
from tests.support.bad_inputs import GOOD
from tests.support.strategies import make_trials

TASK_FILE = TASK_FOLDER / "1-ascending.toml"
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
OPTIMISER = """
from coartic import Optimiser
class A(Optimiser):
    name = title = citation = "a"
    def optimise(self, objective): ...
"""


def changed(good, old, new):
    assert old in good
    return good.replace(old, new)


task, family, suite, method = (partial(changed, text) for text in (GOOD, FAMILY, SUITE, METHOD))

TASKS = [
    (task("[5.0, 2.0]", "[nan, 2.0]"), "goals[1][0] is nan; "),
    ('locked_base = ["x", "y"]\n' + task("[5.0, 2.0]", "[5.0, 20.0]"), "out of reach"),
    ("goal = 1\nrobots = 1\n" + GOOD, "goal is an unknown key; did you mean 'goals'?"),
    (task("right = [0.0, 0.0, 0.0, 0.0]", "right = [0.0, 0.0]"), "start.right"),
    (task("goals = [[", "goals = [[["), "is not valid TOML: "),
]
FAMILIES = [
    (family("[-5, 5]", "[-5, 5]\nscale = [0.5, 1.5]"), "scale is [0.5, 1.5]; "),
    ("reach = 4.0001" + FAMILY, "4.0001"),
]
SUITES = [
    (suite("EC1", "EC3"), "task 'ascending' has no left hand"),
    (SUITE + "grid = {noise_sd = [nan]}", "grid.noise_sd[0] is nan; "),
    (SUITE + "move = {goal = 4, by = [[0, 1]]}", "asks for goal 4"),
    (SUITE + "goals = [2]", "suite 'own', block 1: goals = [2] leaves no task"),
]
METHODS = [
    (method("def solve", "def solves"), "A has no solve"),
    (OPTIMISER, "A: optimise must be defined as optimise(self, objective, rng)"),
    (method('"a"', '"cma-es/bandit"'), "method id 'cma-es/bandit' exists already"),
    (method("frozenset()", '"goals"'), "information must be"),
]


@pytest.mark.parametrize(
    ("read", "name", "text", "words"),
    [
        *((load_task, "mine.toml", *case) for case in TASKS),
        *((read_family, "mine.v1.toml", *case) for case in FAMILIES),
        (read_family, "x.toml", FAMILY, "NAME.v1.toml"),
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


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"tasks": ["ascendin"]}, "did you mean 'ascending'?"),
        ({"runs": "3"}, "runs is '3'"),
        ({"seed": True}, "seed is True; "),
    ],
)
def test_an_argument(wrong, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(CoarticError) as caught:
        run_suite(**{"suite": "paper", "folder": "out"} | wrong)
    assert words in str(caught.value)
    assert not [*tmp_path.iterdir()]


MASKED = np.ma.array(np.zeros(10), mask=[False] * 9 + [True])
TASK, ROBOT = load_task("ascending"), Robot()
TRIAL = corrective_trial(TASK, "RRR")
SESSION = Session(TASK, 0, frozenset(Information), model=PAPER)
USUAL = {
    "task": TASK, "robot": ROBOT, "q": TASK.q0, "target": TASK.q0, "hand": "right",
    "goal": (3.0, 2.0), "hands": "RRR", "radius": 0.1, "solution": TRIAL.movements,
    "movements": TRIAL.movements, "condition": "EC1", "seed": 0, "seeds": [0], "trials": 3,
    "jobs": 1, "half_width": 1.0, "budget": 5, "name_or_path": "ascending",
}  # fmt: skip
"""Arguments by the names of parameters, for all functions that take no others of these names."""


def with_arguments(function, **own):
    """A function, and arguments that it takes."""
    parameters = inspect.signature(function).parameters
    return function, {name: USUAL[name] for name in USUAL if name in parameters} | own


RIGHT = {"hands": ["right"]}
OWN = {
    "movements_of": {"targets": TRIAL.configurations},
    "execute_noisy": {"solutions": [TRIAL.movements], "motor_noise": 0.01, "repeats": 2,
                      "seed": [0], "signal_dependent": False},
    "hand_sequences": RIGHT,
    "initial_hands": RIGHT,
}  # fmt: skip
CALLS = (
    *(with_arguments(call, **OWN.get(name, {})) for name, call in getmembers(coartic, isfunction)),
    *map(with_arguments, (
        ROBOT.forward_kinematics, ROBOT.jacobian, ROBOT.base_outline, ROBOT.joint_positions,
        ROBOT.linearised,
    )),
    with_arguments(Task, goals=[(3.0, 2.0)], locked_base=["y"], **RIGHT),
    with_arguments(plan_suite, suite="quick", tasks=["ascending"], methods=["EC1"], runs=1,
                   seed=0, trials=5, time_limit_s=1.0, trial_budget=5),
    (interval, {"row": {"a": 1.0, "a_low": 0.0, "a_high": 2.0}, "column": "a", "scale": 1.0}),
    with_arguments(SESSION.correct, goal=1),
    with_arguments(SESSION.spend, solver_iterations=1),
    with_arguments(SESSION.trials, targets=TRIAL.configurations[None], until=None),
)  # fmt: skip
"""Of functions whose decorator checks arguments one stands for all."""


@pytest.mark.parametrize(("call", "usual"), CALLS)
def test_what_is_not_a_number_is_refused(call, usual):
    for name, value in usual.items():
        wrong = list[object]()
        if type(value) in (int, float):
            wrong = [True, str(value), [value], np.zeros(3)]
        elif isinstance(value, np.ndarray):
            wrong = [MASKED, value.astype(str), value.astype(bool), [[1.0], [1.0, 2.0]], "x", None]
        for each in wrong:
            with pytest.raises((CoarticError, ValueError, TypeError)):
                call(**usual | {name: each})


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
        np.testing.assert_equal(found, due)
    with pytest.raises(TypeError, match="task is "):
        call(**usual | {first: ["ascending"]})


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: correct(ROBOT, TASK.q0, "right", (True, 1.0)), "goal is "),
        (lambda: correct(ROBOT, TASK.q0, "rigt", (3.0, 1.0)), "hand is 'rigt'; it must be"),
        (lambda: Movement(1, "right", "planned", MASKED), "target is "),
        (lambda: make_trials(TASK, "RRR", [[MASKED] * 3]), "masked"),
        (lambda: interval({"a": "x", "a_low": 0, "a_high": 1}, "a"), "a_l"),
        (lambda: mean([1e101, 0.0, 1.0]), "1e100"),
        (lambda: coartic.execute(TASK, np.zeros((3, 10))), r"movements_of\(hands, targets\)"),
        (lambda: load_task("long/v1/i99"), "three digits: long/v1/i099"),
        (lambda: holm([0.1, 1.01]), "p-values"),
    ],
)
def test_what_a_function_refuses_is_named(call, words):
    with pytest.raises((CoarticError, ValueError, TypeError), match=words):
        call()
