"""Recordings: the same hits from any source, what is refused, what the two numbers show."""

import warnings

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some
from hypothesis.extra.numpy import arrays

from coartic import CONDITIONS, CoarticError, load_task
from coartic.analysis import check_hits, consistency, read_hits, solutions_of
from tests.support import reference

BOTH = load_task("two-armed-1")
JOINTS = [*BOTH.robot.joint_names]


@pytest.fixture(scope="module")
def people():
    """Five trials of the plain learner of the tests, each of two subjects."""
    options = {"condition": CONDITIONS["EC4"], "trials": 5}
    both = (reference.hits_of(BOTH, seed=ord(who), subject=who, **options) for who in "ba")
    return pd.concat(both, ignore_index=True)


@pytest.fixture
def read(tmp_path):
    """Reads hits from a file with a frame, a text or bytes."""

    def write_and_read(content, task=BOTH, **options):
        if isinstance(content, pd.DataFrame):
            content = content.to_csv(index=False)
        path = tmp_path / "people.csv"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read_hits(path, task, **options)

    return write_and_read


def put(column, row, value):
    """A change of one value."""
    return lambda t: t.assign(**{column: t[column].astype(object).where(t.index != row, value)})


# -------------------------------------------------------------------------------- tables of hits


FORMS = {
    "comments": lambda text: "# by hand\n" + text.replace("\na,1,2", "\n# second\na,1,2"),
    "byte order mark": lambda text: "\ufeff" + text,
    "initials NA": lambda text: text.replace("\na,", "\nNA,"),
}


@pytest.mark.parametrize("form", FORMS)
def test_other_forms_of_a_table_have_the_same_hits(people, read, form):
    expected = check_hits(people, BOTH)
    hits = read(FORMS[form](people.to_csv(index=False)))
    same = hits.subject.replace("NA", "a")
    pd.testing.assert_frame_equal(hits.assign(subject=same), expected)


def test_hits_in_any_order_are_sorted_by_subject_trial_and_goal(people):
    shuffled = pd.concat([people[:20].sample(frac=1, random_state=1), people[20:]])
    hits = check_hits(shuffled, BOTH)
    pd.testing.assert_frame_equal(hits, check_hits(people, BOTH))
    assert hits.subject.unique().tolist() == ["b", "a"]


UNREADABLE = {
    "no column left_2; it needs subject, .*, and has subject": lambda t: t.drop(columns="left_2"),
    "data row 3: hand is 'both'; it must be left or right": put("hand", 2, "both"),
    "row 2: goal is .*9.*; it must be an integer from 1 to 4": put("goal", 1, 9),
    "row 2: ticks is .*-5.*; it must be more than 0": put("ticks", 1, -5),
    "has no rows": lambda t: t[:0],
    r"goal is .*another goal than in the rows above.*\(40 such rows\)": lambda t: pd.concat([t, t]),
    "row 1: left_2 is '?inf": put("left_2", 0, np.inf),
    "left_2 is .*True": put("left_2", 0, True),
    "20 of 20 hits of b .*must be in rad, anticlockwise": lambda t: t.assign(
        **np.degrees(t[JOINTS[2:]])
    ),
}


@pytest.mark.parametrize("sentence", UNREADABLE)
def test_what_cannot_be_read_is_refused_with_its_row(people, sentence):
    frame = UNREADABLE[sentence](people)
    with pytest.raises(CoarticError, match=sentence):
        check_hits(frame.set_axis(frame.index + 1), BOTH)


def test_rows_of_a_file_are_counted_from_one(people, read):
    with pytest.raises(CoarticError, match="data row 2: goal is 9"):
        read(put("goal", 1, 9)(people))


NO_TABLE = {
    "is not a table in UTF-8": "subject,trial\nä,1\n".encode("utf-16"),
    "separated by commas: .*line 3": "subject,trial\na,1\na,1,2\n",
    "separated by commas": "subject,trial\na,1,2\na,1,2\n",
    "no column subject; .* has subject;trial": "subject;trial\na;1\n",
}


@pytest.mark.parametrize("sentence", NO_TABLE)
def test_a_file_that_is_no_table_is_refused(read, sentence):
    with pytest.raises(CoarticError, match=sentence):
        read(NO_TABLE[sentence])


def test_durations_are_ticks_of_their_unit(people, read):
    seconds = people.assign(duration=people.ticks / 100).drop(columns="ticks")
    with pytest.warns(UserWarning, match="median movement of . takes 0.01 times") as warned:
        read(seconds)
    assert {warning.filename for warning in warned} == {__file__}
    hits = read(seconds, ticks_per_unit=100)
    pd.testing.assert_frame_equal(hits, check_hits(people, BOTH))
    for frame, options in ((people, {"ticks_per_unit": 100}), (people.assign(duration=1), {})):
        with pytest.raises(CoarticError, match="ticks_per_unit has no effect"):
            read(frame, **options)
    with pytest.raises(ValueError, match="ticks_per_unit is"):
        read(seconds, ticks_per_unit=0.0)


@settings(max_examples=5)
@given(turns=arrays(int, (20, 4), elements=some.integers(-2, 2)))
def test_whole_turns_of_recorded_angles_change_nothing(turns, people):
    hits = check_hits(people[:20], BOTH)
    wound = hits.copy()
    wound[JOINTS[6:]] += 2 * np.pi * turns
    pd.testing.assert_frame_equal(check_hits(wound, BOTH), hits, atol=1e-9)


def test_hits_beyond_two_radii_are_said_and_more_than_half_of_them_refused(people):
    odd = people.assign(left_1=people.left_1 + 3.0, right_1=people.right_1 + 3.0)
    with pytest.warns(UserWarning, match="10 of 20 hits of b are more than 2 radii from") as warned:
        check_hits(pd.concat([odd[:10], people[10:]]), BOTH)
    assert len(warned) == 1
    with pytest.raises(CoarticError, match="11 of 20 hits of b are more than 2 radii from"):
        check_hits(pd.concat([odd[:11], people[11:]]), BOTH)


# --------------------------------------------------------------------------------- consistency


def test_off_and_pace_are_those_of_the_robot(people):
    fit = consistency(people.drop(index=5), BOTH).set_index(["subject", "trial", "goal"])
    q, start = people[JOINTS].to_numpy(), BOTH.q0
    for row, hit in enumerate(people.itertuples()):
        if row == 5:
            continue
        got = fit.loc[(hit.subject, hit.trial, hit.goal)]
        at = BOTH.robot.forward_kinematics(q[row], hit.hand)
        way = np.linalg.norm(q[row] - (start if hit.goal == 1 else q[row - 1]))
        assert (got.x, got.y) == pytest.approx(at)
        assert got.off == pytest.approx(np.linalg.norm(at - BOTH.goals[hit.goal - 1]) / 0.1)
        if row == 6:  # the hit before is missing
            assert np.isnan(got.pace)
        else:
            assert got.pace == pytest.approx(hit.ticks / max(way / 0.01, 1))
    assert fit.off.max() <= 1 + 1e-6  # learned movements end where they hit


def test_nobody_is_warned_of_a_pace_that_is_not_known(people):
    """The pace needs the hit before, or the start of the task."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(check_hits(people[people.goal == 2], BOTH)) == 10


# ----------------------------------------------------------------------------------- solutions


def test_solutions_have_the_recorded_postures_and_ticks(people):
    hits = check_hits(people.drop(index=[0, 9]), BOTH)
    found = solutions_of(BOTH, hits)
    whole = people[~people.set_index(["subject", "trial"]).index.isin([("b", 1), ("b", 3)])]
    assert found.run_ids[:2] == ("b 2", "b 4")
    np.testing.assert_allclose(
        found.configurations.reshape(-1, len(JOINTS)), whole[JOINTS], atol=1e-9
    )
    assert [t for run in found.runs for t in run.ticks_by_goal()] == whole.ticks.tolist()
    with pytest.raises(CoarticError, match="the frame has no trial with hits of all"):
        solutions_of(BOTH, people[people.goal > 1])
