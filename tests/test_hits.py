"""Reading of recorded trials, and the kernels that get them."""

import warnings

import numpy as np
import pandas as pd
import pytest

from coartic import CONDITIONS, CoarticError, correct, load_task, move
from coartic.analysis import read_hits, solutions_of
from coartic.motion.batch import robot_parameters
from coartic.motion.trial import ALL_STOP, Requests, reach, reach_goals
from tests.support import reference
from tests.support.strategies import metres_task

TASK = load_task("two-armed-1")


@pytest.fixture(scope="module")
def people():
    """Ten trials of the plain learner of the tests, each of two subjects."""
    options = {"condition": CONDITIONS["EC4"], "trials": 10}
    both = (reference.hits_of(TASK, seed=ord(who), subject=who, **options) for who in "ab")
    return pd.concat(both, ignore_index=True)


@pytest.fixture
def read(tmp_path):
    """Reads hits from a file with a frame or a text."""

    def write_and_read(content, task=TASK, **options):
        if isinstance(content, pd.DataFrame):
            content = content.to_csv(index=False)
        path = tmp_path / "people.csv"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read_hits(path, task, **options)

    return write_and_read


def put(column, row, value):
    """A change of one value."""
    return lambda t: t.assign(**{column: t[column].astype(object).where(t.index != row, value)})


WRONG = {
    "no column left_2": lambda t: t.drop(columns="left_2"),
    "line 4: hand is 'both'; needed is left or right": put("hand", 2, "both"),
    "line 3: goal is 9": put("goal", 1, 9),
    "line 2: trial is 0.5;": put("trial", 0, 0.5),
    "line 3: ticks is -5": put("ticks", 1, -5),
    "has no hit": lambda t: t[:0],
    "line 2: ticks is empty": put("ticks", 0, None),
    "angles are in rad": lambda t: t.assign(left_1=np.degrees(t.left_1)),
    "a line above already; number trials": lambda t: pd.concat([t, t]),
    "line 2: ticks is .*column duration": lambda t: t.assign(ticks=t.ticks / 100),
    "less than a tick": lambda t: t.assign(duration=t.ticks / 1000).drop(columns="ticks"),
    "base_x is 1e\\+300": put("base_x", 0, 1e300),
    "line 2: left_2 is 'inf'": put("left_2", 0, np.inf),
    "no column subject.*found are who, trial": lambda t: t.rename(columns={"subject": "who"}),
}


@pytest.mark.parametrize("sentence", WRONG)
def test_reader_says_what_is_wrong_and_where(people, read, sentence):
    frame = WRONG[sentence](people)
    with pytest.raises(CoarticError, match=sentence):
        read(frame)
    if "duration" not in frame:
        with pytest.raises(CoarticError, match="the frame"):
            solutions_of(TASK, frame)


FORMS = {
    "initials NA": lambda text: text.replace("\na,", "\nNA,"),
    "commas at the end": lambda text: text.replace("\n", ",\n"),
    "commas at the end of rows": lambda text: text.replace("\n", ",,\n").replace(",,", "", 1),
    "comments": lambda text: "# made by hand\n" + text.replace("\nb,1,2", "\n# second\nb,1,2"),
    "blanks in headings": lambda text: text.replace(",", ", ", 14).replace("ticks", " ticks "),
    "blank lines": lambda text: "\n" + text.replace("\nb", "\n\n,,,,\nb"),
    "byte order mark": lambda text: "\ufeff" + text,
    "quotes": lambda text: text.replace("\na,", '\n"a",'),
    "lines of Windows": lambda text: text.replace("\n", "\r\n"),
}


@pytest.mark.parametrize("form", FORMS)
def test_other_forms_of_the_same_table_are_read(people, read, form):
    given, same = read(FORMS[form](people.to_csv(index=False))), read(people)
    pd.testing.assert_frame_equal(given.drop(columns="subject"), same.drop(columns="subject"))
    assert given.subject.nunique() == 2


NO_TABLE = {
    "line 3: it has 16 values, the headings are 15: subject,": lambda text: "".join(
        line[:-1] + ",7" * (n == 2) + "\n" for n, line in enumerate(text.splitlines(True))
    ),
    "line 2: it has 14 values": lambda text: text.replace("\na,", "\n", 1),
    "is in UTF-16, as Excel": lambda text: text.encode("utf-16"),
    "in UTF-16": lambda text: text.encode("utf-16-le"),
    "is not in UTF-8: save": lambda text: text.replace("\na,", "\nJos\xe9,").encode("latin-1"),
    "separated by commas; found are subject;trial": lambda text: text.replace(",", ";"),
    "two columns 'ticks'": lambda text: text.replace("goal", "ticks", 1),
    "no column subject": lambda text: "",
}


@pytest.mark.parametrize("sentence", NO_TABLE)
def test_what_is_no_table_is_named(people, read, sentence):
    with pytest.raises(CoarticError, match=sentence):
        read(NO_TABLE[sentence](people.to_csv(index=False)))


@pytest.mark.parametrize("name", ["hits.xlsx", "hits.c3d", "hits.MOT", "hits.trc"])
def test_files_of_other_programs_are_named(name):
    with pytest.raises(CoarticError, match=f"coartic reads no .{name[5:].lower()} file; recorded"):
        read_hits(name, TASK)


@pytest.mark.parametrize("turn", ["0..2π", "-π..π", "a turn more"])
def test_wrapped_angles_are_unwrapped_with_a_warning(people, read, turn):
    wrapped, angles = people.copy(), [*TASK.robot.joint_names[2:]]
    if turn == "a turn more":
        wrapped.loc[wrapped.trial == 3, "right_1"] += 2 * np.pi
    else:
        least = 0 if turn == "0..2π" else -np.pi
        wrapped[angles] = (wrapped[angles] - least) % (2 * np.pi) + least
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        frame = read(wrapped)
        recorded = solutions_of(TASK, wrapped)
    np.testing.assert_allclose(frame[angles], people[angles], atol=1e-9)
    same = solutions_of(TASK, people).configurations
    np.testing.assert_allclose(recorded.configurations, same, atol=1e-9)
    assert len(said) == (0 if turn == "-π..π" else 2)
    assert all("by a turn (2π) between hits" in str(each.message) for each in said)


def test_angles_whose_direction_is_in_doubt_are_named_by_subject_and_line(people, read):
    doubtful = people.copy()
    doubtful.loc[50, "left_1"] = TASK.q0[2] + 3.4  # or 2.9 the other way
    with pytest.raises(CoarticError, match=r"line 52: left_1 of subject b turns by -?\d"):
        read(doubtful)
    with pytest.raises(CoarticError, match="row 50: left_1 of subject b turns"):
        solutions_of(TASK, doubtful)
    straddling = people.copy()  # from trial to trial, not from hit to hit
    straddling["left_1"] = np.where(straddling.trial % 2, 3.1, -3.1) + TASK.q0[2]
    with pytest.raises(CoarticError, match="of subject a turns by"):
        solutions_of(TASK, straddling)


def test_one_armed_people_need_no_columns_of_the_other_arm(read):
    task = metres_task()
    rows = [["s", t, g, "right", 30, 0.5 + t / 100, 1.5] for t in (1, 2) for g in (1, 2, 3)]
    names = ["subject", "trial", "goal", "hand", "ticks", "right_1", "right_2"]
    frame = pd.DataFrame(rows, columns=names)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of hands far from goals
        given = read(frame, task)
        assert len(solutions_of(task, frame).runs) == 2
    assert (given[["base_x", "base_y", "left_1"]] == 0).to_numpy().all()
    with pytest.raises(CoarticError, match="no column base_x, left_1"):
        read(frame)


def test_reader_takes_durations_and_warns_of_small_degrees(people, read):
    timed = people.assign(duration=people.ticks / 100).drop(columns="ticks")
    assert read(timed, ticks_per_unit=100).ticks.tolist() == people.ticks.tolist()
    with pytest.raises(CoarticError, match="in no trial are all 4 goals hit"):
        solutions_of(TASK, people[people.goal < 4])
    since_start = people.groupby(["subject", "trial"]).ticks.cumsum()
    with pytest.warns(UserWarning, match="from the hit before"):
        read(people.assign(ticks=since_start))
    angles = [name for name in people if name[-1].isdigit()]
    with pytest.warns(UserWarning, match="Are the angles in rad"):
        read(people.assign(**np.degrees(people[angles] / 10)))


@pytest.mark.parametrize("bad", [np.nan, -np.inf, 1e300])
@pytest.mark.parametrize("where", ["start", "target", "goal"])
def test_kernels_end_whatever_they_get(bad, where):
    """Without the checks of their callers; a loop that does not end would end the tests."""
    q, targets = np.tile(TASK.q0, (5, 1)), np.tile(TASK.q0 + 0.5, (5, 1))
    goals = np.tile(TASK.goal_array[0], (5, 1))
    {"start": q, "target": targets, "goal": goals}[where][::2, 0] = bad
    hands, parameters = np.arange(5)[:, None] % 2, robot_parameters(TASK.robot)
    for given in (targets, targets * np.nan):
        arms = Requests(q, hands, given[:, None, None], ALL_STOP, goals[:, None])
        assert len(reach(TASK.robot, arms, parameters).rewards) == 5


@pytest.mark.parametrize(
    ("name", "wrong", "words"),
    [
        *(("hands", [0, hand], "needed are 0 .left. and 1 .right.") for hand in (2, -1, 0.5)),
        ("hands", [True, False], "hands"),
        *(("q", q, "^q ") for q in ([TASK.q0[:9]] * 2, [TASK.q0 * np.nan] * 2)),
        *(("goals", goals, "^goals ") for goals in ([[1.0, 2.0]], [[1.0, np.inf]] * 2)),
        ("targets", np.zeros((2, 9)), "^targets "),
        ("radius", 0.0, "radius"),
        ("locked_base", ("z",), "may name 'x' and 'y'"),
    ],
)
def test_many_arms_are_checked_before_a_kernel_gets_them(name, wrong, words):
    usual = {"q": [TASK.q0] * 2, "hands": [0, 1], "goals": TASK.goal_array[:2], "radius": 0.1}
    assert reach_goals(TASK.robot, **usual).hit.all()
    with pytest.raises(ValueError, match=words):
        reach_goals(TASK.robot, **usual | {name: wrong})


@pytest.mark.parametrize("goal", [(1, 2, 3), 1.0, (np.inf, 1), ("1", "2"), None])
def test_a_goal_is_two_finite_numbers(goal):
    with pytest.raises(ValueError, match="goal"):
        correct(TASK.robot, TASK.q0, "right", goal)
    with pytest.raises(ValueError, match="goal"):
        move(TASK.robot, TASK.q0, TASK.q0, "right", goal, 0.1)
    with pytest.raises(ValueError, match="configuration"):
        correct(TASK.robot, TASK.q0 * np.nan, "right", (1, 2))
