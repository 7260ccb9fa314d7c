"""Task files: the shipped ones, and what is refused with what words."""

import math
import tomllib

import numpy as np
import pytest
from pydantic import ValidationError

from coartic import (
    NotApplicableError,
    Task,
    TaskError,
    builtin_tasks,
    corrective_trial,
    initial_hands,
    load_task,
)
from coartic.task import TASK_FOLDER, parse_task

from .strategies import tiny_task

GOOD = """
name = "mine"
goals = [[5.0, 1.0], [5.0, 2.0]]
initial_hands = "RR"

[start]
base = [0.0, 0.0]
left = [0.0, 0.0, 0.0, 0.0]
right = [0.0, 0.0, 0.0, 0.0]
"""


def write(tmp_path, text):
    path = tmp_path / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_shipped_tasks():
    assert builtin_tasks() == ("ascending", "descending", "two-armed-1", "two-armed-2")
    ascending = load_task("ascending")
    assert ascending.goals == ((6.0, 0.1), (6.0, 2.0), (6.0, 4.0))
    assert ascending.hands == ("right",)
    assert ascending.radius == 0.1
    assert load_task("descending").goals == ((6.0, 0.1), (6.0, -2.0), (6.0, -4.0))
    two = load_task("two-armed-2")
    hands = [two.robot.forward_kinematics(two.q0, hand)[0] for hand in two.hands]
    assert hands == [3.5, 4.5]


def test_steeple():
    task = load_task("two-armed-1")
    lean = math.acos(0.5 / 4)
    assert task.start.left[0] == pytest.approx(lean, abs=1e-15)
    assert task.start.right[0] == pytest.approx(math.pi - lean, abs=1e-15)
    for hand in task.hands:
        np.testing.assert_allclose(
            task.robot.forward_kinematics(task.q0, hand),
            (0, 0.1 + math.sqrt(16 - 0.25)),
            atol=1e-14,
        )


def test_shipped_figures_have_a_source():
    for name in builtin_tasks():
        task = load_task(name)
        for key in ("goals", "radius", "start", "initial_hands"):
            assert task.provenance[key].source
    assert load_task("two-armed-1").reconstructed == ("goals", "start")
    assert load_task("two-armed-2").reconstructed == ("goals",)
    assert load_task("ascending").reconstructed == ()


def test_task_survives_its_own_serialisation():
    for name in builtin_tasks():
        task = load_task(name)
        assert parse_task(task.model_dump(mode="json"), "copy") == task


def test_task_is_immutable():
    task = load_task("ascending")
    with pytest.raises(ValidationError, match="frozen"):
        task.radius = 1.0
    with pytest.raises(ValueError, match="read-only"):
        task.q0[0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        task.goal_array[0] = 1.0


def test_own_file(tmp_path):
    task = load_task(write(tmp_path, GOOD))
    assert task.name == task.label == "mine"
    assert task.hands == ("left", "right")
    assert task.radius == 0.1
    assert task == load_task(str(tmp_path / "mine.toml"))


def replace(old, new):
    assert old in GOOD
    return GOOD.replace(old, new)


BAD = {
    "nan": (replace("[5.0, 2.0]", "[nan, 2.0]"), "goals[1][0] is nan; it must be a finite number"),
    "infinite": (replace("base = [0.0,", "base = [inf,"), "start.base[0] is inf"),
    "no goal": (
        replace("[[5.0, 1.0], [5.0, 2.0]]", "[]"),
        "goals is empty; a task needs at least one goal",
    ),
    "zero radius": ("radius = 0.0" + GOOD, "radius is 0.0; it must be greater than 0"),
    "negative radius": ("radius = -0.1" + GOOD, "radius is -0.1; it must be greater than 0"),
    "radius below accuracy": ("radius = 0.005" + GOOD, "radius is 0.005; it must exceed 0.01"),
    "unknown hand": (
        'hands = ["middle"]' + GOOD,
        "hands[0] is 'middle'; it must be 'left' or 'right'",
    ),
    "no hand": ("hands = []" + GOOD, "hands has too few entries"),
    "hand twice": ('hands = ["left", "left"]' + GOOD, "hands names the same entry twice"),
    "unknown letter": (
        replace('"RR"', '"RX"'),
        "initial_hands is 'RX'; it must be a sequence of L",
    ),
    "too few letters": (replace('"RR"', '"R"'), "initial_hands 'R' names 1 hands for 2 goals"),
    "absent hand": (
        'hands = ["left"]' + GOOD,
        "initial_hands 'RR' uses the right hand, which is not among hands",
    ),
    "out of reach": (
        'locked_base = ["x", "y"]'
        + replace("[[5.0, 1.0], [5.0, 2.0]]", "[[4.0, 1.0], [9.0, 2.0]]"),
        "goals[1] (9, 2) is out of reach with the base locked in x and y",
    ),
    "out of reach on a rail": (
        'locked_base = ["y"]' + replace("[5.0, 2.0]", "[5.0, 4.2]"),
        "goals[1] (5, 4.2) is out of reach with the base locked in y",
    ),
    "out of reach of the named hand": (
        'locked_base = ["x", "y"]' + replace('"RR"', '"LL"').replace("5.0, 1.0", "4.2, 0.1"),
        "goals[0] (4.2, 0.1) is out of reach with the base locked in x and y for the left hand",
    ),
    "unknown coordinate": (
        'locked_base = ["z"]' + GOOD,
        "locked_base[0] is 'z'; it must be 'x' or 'y'",
    ),
    "unknown key": ("gaols = 1" + GOOD, "gaols is an unknown key; did you mean 'goals'?"),
    "unknown nested key": (
        GOOD + "middle = [0.0]\n",
        "start.middle is an unknown key",
    ),
    "missing key": (replace('initial_hands = "RR"', ""), "initial_hands is missing"),
    "missing table": (GOOD.split("[start]")[0], "start is missing"),
    "text for a number": (replace("[5.0, 2.0]", '["5", 2.0]'), "goals[1][0] is '5' (str)"),
    "truth for a number": (replace("[5.0, 2.0]", "[true, 2.0]"), "goals[1][0] is True (bool)"),
    "number for a text": (
        replace('name = "mine"', "name = 3"),
        "name is 3 (int); it must be a text",
    ),
    "number for a list": (replace("[[5.0, 1.0], [5.0, 2.0]]", "7"), "goals is 7 (int)"),
    "three coordinates": (
        replace("[5.0, 2.0]", "[5.0, 2.0, 1.0]"),
        "goals[1] has 3 entries; it takes 2",
    ),
    "one coordinate": (replace("[5.0, 2.0]", "[5.0]"), "goals[1][1] is missing"),
    "wrong joint count": (
        replace("right = [0.0, 0.0, 0.0, 0.0]", "right = [0.0]"),
        "start.right has 1 joint angles; the right arm has 4 joints",
    ),
    "name with spaces": (replace('"mine"', '"my task"'), "name is 'my task'; use letters"),
    "bad robot": (GOOD + "[robot]\nleft_links = [1.0, -1.0]\n", "robot.left_links[1] is -1.0"),
    "robot without links": (GOOD + "[robot]\nleft_links = []\n", "robot.left_links has too few"),
    "unknown robot key": (GOOD + "[robot]\nlinks = [1.0]\n", "robot.links is an unknown key"),
    "start is no table": (
        GOOD.split("[start]")[0] + "start = 1\n",
        "start is 1; it must be a table",
    ),
    "bad provenance": (
        GOOD + '[provenance]\ngoals = { status = "guessed", source = "me" }\n',
        "provenance.goals.status is 'guessed'; it must be 'printed', 'inferred' or 'chosen'",
    ),
    "provenance of nothing": (
        GOOD + '[provenance]\ngaols = { status = "chosen", source = "me" }\n',
        "provenance.gaols is not a key of a task; did you mean 'goals'?",
    ),
    "not TOML": ("name = ", "is not valid TOML"),
    "nested deep": ("a = " + "[" * 5000, "is not valid TOML"),
    "huge integer": ("a = " + "9" * 5000, "is not valid TOML"),
    "large integer": (replace("[5.0, 2.0]", f"[{'9' * 300}, 2.0]"), "(300 characters)"),
    "far goal": (replace("[5.0, 2.0]", "[1e7, 2.0]"), "goals[1][0] is 10000000.0; its size must"),
    "far base": (replace("base = [0.0,", "base = [-2e4,"), "start.base[0] is -20000.0; its size"),
    "wound up": (replace("right = [0.0,", "right = [1e20,"), "start.right[0] is 1e+20; its size"),
    "huge radius": ("radius = 1e308" + GOOD, "radius is 1e+308; its size must be at most 10000"),
    "huge link": (GOOD + "[robot]\nleft_links = [1e9]\n", "robot.left_links[0] is 1000000000.0"),
    "too many goals": (
        replace("[[5.0, 1.0], [5.0, 2.0]]", "[" + "[5.0, 1.0]," * 101 + "]"),
        "goals has 101 entries; it takes 100",
    ),
    "key below its table": (GOOD + "radius = 0.1\n", "'radius' belongs above the line [start]"),
}


@pytest.mark.parametrize("case", BAD)
def test_refused_with_file_and_key(case, tmp_path):
    text, words = BAD[case]
    path = write(tmp_path, text)
    with pytest.raises(TaskError) as caught:
        load_task(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert words in message
    assert "\n" not in message  # one sentence for one mistake


def test_several_mistakes_each_get_a_line(tmp_path):
    path = write(tmp_path, replace('"RR"', "1").replace("[5.0, 2.0]", "[nan, inf]"))
    with pytest.raises(TaskError) as caught:
        load_task(path)
    assert len(str(caught.value).splitlines()) == 3


def test_files_that_are_not_there_or_not_text(tmp_path):
    with pytest.raises(TaskError, match="cannot be read: No such file"):
        load_task(tmp_path / "absent.toml")
    with pytest.raises(TaskError, match="cannot be read: Is a directory"):
        load_task(tmp_path)
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(TaskError, match="not a text file in UTF-8"):
        load_task(tmp_path / "binary.toml")
    with pytest.raises(TaskError, match="unknown task 'ascendng'; did you mean 'ascending'\\?"):
        load_task("ascendng")


def test_goals_that_are_within_reach_are_accepted():
    tiny_task(locked_base=["x", "y"], goals=[[4.5, 0.1], [4.49, 0.1]])
    tiny_task(locked_base=["y"], goals=[[100.0, 4.0], [5.0, 1.0]])
    tiny_task(locked_base=["x"], goals=[[4.4, 100.0], [4.0, 1.0]])
    tiny_task(goals=[[1e3, 1e3], [0.0, 0.0]])


def test_inner_reach():
    """An arm of links 3 and 1 cannot reach within 2 of its shoulder."""
    robot = {"right_links": [3.0, 1.0]}
    start = {"left": [0.0] * 4, "right": [0.0, 1.0]}
    with pytest.raises(TaskError, match="goals\\[0\\] \\(1, 0.1\\) is out of reach"):
        tiny_task(
            robot=robot, start=start, hands=["right"], locked_base=["x", "y"],
            goals=[[1.0, 0.1]], initial_hands="R",
        )  # fmt: skip
    tiny_task(
        robot=robot, start=start, hands=["right"], locked_base=["x"],
        goals=[[1.0, 0.1]], initial_hands="R",
    )  # fmt: skip


def test_built_in_python_too():
    with pytest.raises(ValidationError, match="names 1 hands for 2 goals"):
        Task(
            name="x",
            goals=((1.0, 1.0), (2.0, 2.0)),
            initial_hands="R",
            start={"left": (0.0,) * 4, "right": (0.0,) * 4},
        )


def test_initial_hand_policies():
    """The printed policies give the printed hands: both tasks start with RRRR."""
    for name, policy in (("two-armed-1", "best-single-hand"), ("two-armed-2", "best-of-all")):
        content = {**load_task(name).model_dump(mode="json"), "initial_hands": policy}
        task = parse_task(content, name)
        assert initial_hands(task) == load_task(name).initial_hands == "RRRR"
    content = {**load_task("two-armed-1").model_dump(mode="json"), "initial_hands": "best-of-all"}
    task = parse_task(content, "x")
    assert initial_hands(task) == "LRLR"
    assert initial_hands(task, ("right",)) == "RRRR"
    assert corrective_trial(task, "LRLR").reward == -533


def test_policies_with_many_goals():
    """One hand needs two candidates whatever the number of goals; all hands are bounded."""
    many = {"goals": [[5.0, 1.0], [5.0, 2.0]] * 15}
    assert initial_hands(tiny_task(**many, initial_hands="best-single-hand")) == "R" * 30
    with pytest.raises(NotApplicableError, match="1073741824 hand sequences; at most 4096"):
        initial_hands(tiny_task(**many, initial_hands="best-of-all"))


def test_a_file_with_a_byte_order_mark(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_bytes(b"\xef\xbb\xbf" + GOOD.encode())
    assert load_task(path).name == "mine"


def test_every_shipped_file_is_found():
    names = {
        tomllib.loads(path.read_text(encoding="utf-8"))["name"]
        for path in TASK_FOLDER.glob("*.toml")
    }
    assert names == set(builtin_tasks())
