"""Task files: the shipped ones, and what is refused with what words."""

import math
import re

import numpy as np
import pytest

from coartic import (
    CoarticError,
    NotApplicableError,
    Robot,
    Start,
    Task,
    TaskError,
    builtin_tasks,
    corrective_trial,
    initial_hands,
    load_task,
)
from coartic.tasks.families import shipped_families
from coartic.tasks.task import check_task
from tests.support.strategies import TIED, changed, tiny_task, uneven_task


def write(tmp_path, text):
    path = tmp_path / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_shipped_figures_have_a_source():
    for name in builtin_tasks():
        task = load_task(name)
        for key in ("goals", "radius", "start", "initial_hands"):
            assert task.provenance[key].source
    assert load_task("two-armed-1").reconstructed == ("goals", "start")
    assert load_task("two-armed-2").reconstructed == ("goals",)
    assert load_task("ascending").reconstructed == ()


@pytest.mark.parametrize(
    "task",
    [
        *map(load_task, builtin_tasks()),
        *(load_task(f"{family}/d001") for family in shipped_families()),
        tiny_task(
            title='Fingers \\ "é"', provenance={"goals": {"status": "chosen", "source": "me"}}
        ),
        uneven_task(right=[-1e-7] * 4, locked_base=["x"], radius=0.3),
        tiny_task(locked_base=["y", "x"], goals=[[3.0, 1.0], [-0.5, 2.5]], initial_hands="LL"),
        Task(goals=[(3, 2)], q0=np.linspace(-6, 6, 10), robot=Robot(base_size=(2.0, 0.1))),
    ],
    ids=repr,
)
def test_a_saved_task_is_read_as_it_was(task, tmp_path):
    path = tmp_path / "saved.toml"
    task.save(path)
    assert load_task(path) == task
    with pytest.raises(CoarticError, match="replace=True"):
        task.save(path)
    task.save(str(path), replace=True)
    with pytest.raises(CoarticError, match=r"the name of a task file must end in \.toml"):
        task.save(tmp_path / "saved.json")


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"q0": [0, 0, 0, 0, 0, 0, 30, 40, 20, 0]}, "Did you mean 40° = 0.698?"),
        ({"q0": [0] * 10, "start": {"left": [0] * 4, "right": [0] * 4}}, "pass only one"),
    ],
)
def test_a_wrong_task_is_refused_in_a_sentence(wrong, words):
    with pytest.raises(ValueError, match=re.escape(words)) as caught:
        Task(**{"goals": [(3, 2)]} | wrong)
    assert "pydantic" not in str(caught.value)


def test_goals_that_are_within_reach_are_accepted():
    tiny_task(locked_base=["x", "y"], goals=[[4.5, 0.1], [4.49, 0.1]])
    tiny_task(locked_base=["y"], goals=[[100.0, 4.0], [5.0, 1.0]])
    tiny_task(locked_base=["x"], goals=[[4.4, 100.0], [4.0, 1.0]])
    tiny_task(goals=[[1e3, 1e3], [0.0, 0.0]])


def test_reach_of_the_corrective_process():
    """Right hand: up to 4 from (0.5, 0.1). A rim may be within reach, 0.01 of the centre not."""
    task = tiny_task(locked_base=["x", "y"], goals=[[4.0, 0.1], [4.55, 0.1]])
    with pytest.raises(TaskError, match=r"goals\[1\] \(4.55, 0.1\) .*: 0.04 too far"):
        check_task(task)
    check_task(tiny_task(locked_base=["x", "y"], goals=[[4.0, 0.1], [4.505, 0.1]]))
    with pytest.raises(TaskError, match="the right hand that initial_hands 'R' gives it: 0.6 too"):
        tiny_task(locked_base=["x", "y"], goals=[[-4.2, 0.1]])


def test_inner_reach():
    content = {"robot": {"right_links": [3.0, 1.0]}, "hands": ["right"], "goals": [[1.0, 0.1]],
               "start": {"left": [0.0] * 4, "right": [0.0, 1.0]}}  # fmt: skip
    with pytest.raises(TaskError, match="goals\\[0\\] \\(1, 0.1\\) is out of reach"):
        tiny_task(locked_base=["x", "y"], **content)
    tiny_task(locked_base=["x"], **content)


def test_initial_hand_policies():
    """The published policies give the published hands: both tasks start with RRRR."""
    for name, policy, hands in (
        ("two-armed-1", "best-single-hand", "RRRR"),
        ("two-armed-2", "best-of-all", "RRRR"),
        ("two-armed-1", "best-of-all", "LRLR"),
    ):
        assert initial_hands(changed(name, initial_hands=policy)) == hands
    best = changed("two-armed-1", initial_hands="best-of-all")
    assert initial_hands(best, ("right",)) == "RRRR"
    assert initial_hands(TIED) == "RRL"


def test_policies_with_many_goals():
    """One hand needs two candidates whatever the number of goals; all hands are bounded."""
    many = {"goals": [[5.0, 1.0], [5.0, 2.0]] * 15}
    assert initial_hands(tiny_task(**many, initial_hands="best-single-hand")) == "R" * 30
    with pytest.raises(NotApplicableError, match="1073741824 hand sequences; at most 4096"):
        initial_hands(tiny_task(**many, initial_hands="best-of-all"))


def test_a_task_of_ones_own_needs_goals_alone(tmp_path):
    goals = [(3.0, 2.0), (4.5, 2.0)]
    robot = Robot(right_links=(0.5,) * 6)
    q0 = np.linspace(-0.3, 0.3, robot.dof)
    task = Task(goals=goals, robot=robot, q0=q0)
    assert task.q0.tolist() == q0.tolist()
    assert task == Task(
        name="unnamed",
        goals=goals,
        robot=robot,
        initial_hands="best-single-hand",
        start=Start(base=tuple(q0[:2]), left=tuple(q0[2:6]), right=tuple(q0[6:])),
    )
    assert corrective_trial(task, "RR").completed
    path = tmp_path / "shelf.toml"
    path.write_text("goals = [[3.0, 2.0], [4.5, 2.0]]\n", encoding="utf-8")
    assert load_task(path) == Task(name="shelf", goals=goals, q0=np.zeros(10))


def test_a_task_has_at_most_256_goals():
    goals = [(4 + math.sin(k), 1 + math.cos(k)) for k in range(257)]
    assert corrective_trial(Task(goals=goals[:256], hands=["right"]), "R" * 256).completed
    with pytest.raises(ValueError, match="at most 256"):
        Task(goals=goals)
