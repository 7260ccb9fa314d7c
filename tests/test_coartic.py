"""The names of ``coartic``: what they take, what they refuse, and how they show themselves."""

import inspect
from dataclasses import replace

import numpy as np
import pytest

import coartic
from coartic import Movement, Robot, execute, load_task
from coartic.method import Information, Session
from coartic.tasks.task import TASK_FOLDER

TASK = load_task("two-armed-2")
FILE = next(path for path in TASK_FOLDER.glob("*.toml") if load_task(path).name == TASK.name)
HANDS = "LRLR"


CORRECTIVE = [Movement(n, "right", "corrective") for n in (1, 2, 3, 4)]
TAKES_A_TASK = {
    "learn": lambda task: coartic.learn(task, "EC4", seed=3, trials=30).reward,
    "learn_many": lambda task: coartic.learn_many(task, "EC4", seeds=[3], trials=30)[0].reward,
    "execute": lambda task: coartic.execute(task, CORRECTIVE).reward,
    "trajectory": lambda task: coartic.trajectory(task, CORRECTIVE).reward,
    "corrective_trial": lambda task: coartic.corrective_trial(task, HANDS).reward,
    "hand_sequences": lambda task: coartic.hand_sequences(task),
    "initial_hands": lambda task: coartic.initial_hands(task),
    "objective": lambda task: coartic.objective(task, HANDS).best_cost,
}


def test_all_functions_that_take_a_task_are_tried():
    """By their first parameter; ``load_task`` takes what names one."""
    functions = {name for name in coartic.__all__ if inspect.isfunction(getattr(coartic, name))}
    first = {
        name: next(iter(inspect.signature(getattr(coartic, name)).parameters), "")
        for name in functions
    }
    assert {name for name in functions if first[name] == "task"} == {*TAKES_A_TASK}


@pytest.mark.parametrize("name", TAKES_A_TASK)
def test_a_name_and_a_path_stand_for_the_task(name):
    for given in (TASK.name, str(FILE), FILE):
        assert TAKES_A_TASK[name](given) == TAKES_A_TASK[name](TASK)


@pytest.mark.parametrize(
    "call", [*TAKES_A_TASK.values(), load_task], ids=[*TAKES_A_TASK, "load_task"]
)
def test_what_is_no_task(call):
    for wrong in (None, ["ascending"], {"name": "ascending"}):
        with pytest.raises(TypeError, match=r"task is .*; it must be .* path of a task file"):
            call(wrong)
    with pytest.raises(coartic.TaskError, match="did you mean 'ascending'"):
        call("ascendng")


Q = np.zeros(10)
PATH = coartic.trajectory(TASK, coartic.corrective_trial(TASK, HANDS).movements)
TAKES_A_HAND = {
    "arm": Robot().arm,
    "joints": Robot().joints,
    "reach": Robot().reach,
    "forward_kinematics": lambda hand: Robot().forward_kinematics(Q, hand),
    "joint_positions": lambda hand: Robot().joint_positions(Q, hand),
    "jacobian": lambda hand: Robot().jacobian(Q, hand),
    "linearised": lambda hand: Robot().linearised(Q, hand),
    "hand_path": PATH.hand_path,
    "move": lambda hand: coartic.move(Robot(), Q, Q, hand, (1.0, 1.0), 0.1),
    "correct": lambda hand: coartic.correct(Robot(), Q, hand, (1.0, 1.0)),
    "hand_sequences": lambda hand: coartic.hand_sequences(TASK, (hand,)),
    "initial_hands": lambda hand: coartic.initial_hands(TASK, (hand,)),
    "condition": lambda hand: replace(coartic.CONDITIONS["EC1"], hands=(hand,)),
}


@pytest.mark.parametrize("name", TAKES_A_HAND)
def test_a_wrong_hand_is_refused_with_the_choices(name):
    TAKES_A_HAND[name]("left")
    for wrong in ("L", "", None, ["left"]):
        with pytest.raises(ValueError, match=r"'left'.* '?right'"):
            TAKES_A_HAND[name](wrong)


@pytest.mark.parametrize(
    "call",
    [
        lambda task, hands: coartic.corrective_trial(task, hands),
        lambda task, hands: coartic.objective(task, hands),
        lambda task, hands: Session(task, 0, Information).trials(hands, np.zeros((1, 3, 10))),
    ],
)
def test_a_wrong_hand_sequence_is_refused_with_the_choices(call):
    for wrong in ("rrr", "LLL", "RR", 3):
        with pytest.raises(ValueError, match="do not fit task 'ascending': .* R for each of 3"):
            call(load_task("ascending"), wrong)
    for wrong in ("left", ()):
        with pytest.raises(ValueError, match="'left' and 'right'"):
            coartic.hand_sequences(TASK, wrong)


def test_conditions_are_shown_as_they_are_written():
    for condition in (coartic.CONDITIONS | coartic.ABLATIONS).values():
        assert eval(repr(condition), {**vars(coartic)}) == condition


def test_dir_shows_the_interface_alone():
    assert {name for name in dir(coartic) if not name.startswith("__")} == {*coartic.__all__}
    assert len(set(coartic.__all__)) == len(coartic.__all__)


def test_errors_can_be_imported():
    """But for those of a folder below, which stay within it."""
    errors = [coartic.CoarticError]
    for error in errors:
        errors += error.__subclasses__()
    names = {error.__name__ for error in errors if error.__module__.count(".") == 1}
    assert names <= {*coartic.__all__}


FUNCTIONS = {
    f"{owner.__name__}.{name}": getattr(owner, name)
    for owner, names in (
        (coartic, {*coartic.__all__} - {"objective"}),
        (Robot, ("forward_kinematics", "joint_positions", "jacobian", "base_outline")),
    )
    for name in names
    if inspect.isfunction(getattr(owner, name))
}


@pytest.mark.parametrize("name", sorted(FUNCTIONS))
def test_docstrings_say_what_goes_in_and_what_comes_out(name):
    text = inspect.getdoc(FUNCTIONS[name])
    for parameter in {*inspect.signature(FUNCTIONS[name]).parameters} - {"self"}:
        assert f"\n{parameter} : " in text.partition("Parameters\n---")[2], parameter
    assert "\nReturns\n-------\n" in text
    assert "\nRaises\n------\n" in text or not inspect.signature(FUNCTIONS[name]).parameters


def test_what_is_no_solution():
    for wrong in (None, 3, Movement(1, "left", "corrective")):
        with pytest.raises(coartic.SolutionError, match="the solution is .*; needed is a list"):
            execute(TASK, wrong)
    target = ["a"] * 10
    with pytest.raises(coartic.SolutionError, match="goal 1: configuration .* real numbers"):
        execute(TASK, [Movement(1, "left", "learned", target)])
