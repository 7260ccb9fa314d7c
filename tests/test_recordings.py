"""Recordings: the same hits from any source, what is refused, what the two numbers show."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some
from hypothesis.extra.numpy import arrays

from coartic import CONDITIONS, CoarticError, correct, load_task
from coartic.analysis import (
    check_hits,
    consistency,
    draw_recording,
    hits_from_markers,
    read_hits,
    solutions_of,
)
from coartic.robot import HANDS
from tests.support import reference
from tests.support.processes import ROOT

EXAMPLES = ROOT / "docs" / "examples" / "recordings"
BOTH, RIGHT = load_task("two-armed-1"), load_task(EXAMPLES / "metres.toml")
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
    with pytest.warns(UserWarning, match="10 of 20 hits of b are more than 2 radii off") as warned:
        check_hits(pd.concat([odd[:10], people[10:]]), BOTH)
    assert len(warned) == 1
    with pytest.raises(CoarticError, match="11 of 20 hits of b are more than 2 radii off"):
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


# ------------------------------------------------------------------------------------- markers


def knots_of(task, trials, seed=0):
    """Postures at the goals of trials, with times in s: each hand reaches the centre of its goal,
    from where a noisy target puts it."""
    rng, every = np.random.default_rng(seed), []
    for _ in range(trials):
        q, time, knots = task.q0, 0.0, [(0.0, task.q0)]
        for goal in task.goals:
            hand = task.hands[int(rng.integers(len(task.hands)))]
            noise, arm = np.zeros(len(q)), task.robot.joints(hand)
            noise[arm] = 0.05 * rng.standard_normal(arm.stop - arm.start)
            to = correct(task.robot, q + noise, hand, goal, locked_base=task.locked_base).q
            time += 0.013 * np.linalg.norm(to - q) / 0.01
            q = to
            knots.append((time, q))
        every.append(knots)
    return every


def postures(knots, rate):
    """Times and postures of a trial at a sampling rate: movements of minimum jerk."""
    times, qs = (np.array(each) for each in zip(*knots, strict=True))
    clock = np.arange(0, times[-1] + 0.2, 1 / rate)
    leg = np.clip(np.searchsorted(times, clock, side="right") - 1, 0, len(times) - 2)
    s = np.clip((clock - times[leg]) / np.diff(times)[leg], 0, 1)[:, None]
    return clock, qs[leg] + (10 * s**3 - 15 * s**4 + 6 * s**5) * np.diff(qs, axis=0)[leg]


def recorded(task, trials=2, rate=100):
    """Positions of markers, a frame."""
    frames = []
    for trial, knots in enumerate(knots_of(task, trials), 1):
        clock, q = postures(knots, rate)
        frame = {"subject": "p", "trial": trial, "time": clock}
        for hand in task.hands:
            for k, place in enumerate(np.moveaxis(task.robot.joint_positions(q, hand), 1, 0), 1):
                name = "tip" if k > len(task.robot.arm(hand).links) else k
                frame |= {f"{hand}_{name}_x": place[:, 0], f"{hand}_{name}_y": place[:, 1]}
        frames.append(pd.DataFrame(frame))
    return pd.concat(frames, ignore_index=True)


def true_hits(task, trials=2):
    """First entries into goals, found by looking at 20,000 postures a second."""
    rows = []
    for trial, knots in enumerate(knots_of(task, trials), 1):
        clock, q = postures(knots, 20_000)
        tips = {hand: task.robot.forward_kinematics(q, hand) for hand in task.hands}
        k, before = 0, 0.0
        for goal, centre in enumerate(task.goals, 1):
            inside = {hand: np.linalg.norm(tips[hand] - centre, axis=1) <= task.radius
                      for hand in tips}  # fmt: skip
            k += int(np.argmax(np.any([inside[hand][k:] for hand in inside], axis=0)))
            hand = next(hand for hand in HANDS if hand in inside and inside[hand][k])
            rows.append([trial, goal, hand, 100 * (clock[k] - before), *q[k]])
            before = clock[k]
    return pd.DataFrame(rows, columns=["trial", "goal", "hand", "ticks", *task.robot.joint_names])


@pytest.mark.parametrize(("task", "rate"), [(BOTH, 60), (RIGHT, 200)], ids=["both", "right"])
def test_hits_are_found_at_any_rate_of_sampling(task, rate):
    hits, truth = hits_from_markers(recorded(task, rate=rate), task), true_hits(task)
    assert hits.attrs == {"unfinished": {"p": 0}}
    assert (hits[["trial", "goal", "hand"]] == truth[["trial", "goal", "hand"]]).all(axis=None)
    assert np.abs(hits.ticks - truth.ticks).max() < 100 / rate  # a sample
    joints = [*task.robot.joint_names]
    assert np.abs(hits[joints] - truth[joints]).max(axis=None) < 0.02
    assert len(solutions_of(task, hits).runs) == 2


def test_a_file_is_read_as_a_frame_and_sides_are_chosen(tmp_path):
    markers = recorded(RIGHT)
    markers.to_csv(tmp_path / "p.csv", index=False)
    hits = hits_from_markers(markers, RIGHT)
    pd.testing.assert_frame_equal(hits_from_markers(tmp_path / "p.csv", RIGHT), hits)
    double = hits_from_markers(markers, RIGHT, "right", ticks_per_unit=200)
    np.testing.assert_allclose(double.ticks, 2 * hits.ticks, atol=1e-5)
    hits.to_csv(tmp_path / "hits.csv", index=False)
    pd.testing.assert_frame_equal(read_hits(tmp_path / "hits.csv", RIGHT), hits)
    one_of_two = BOTH.model_copy(update={"hands": ("right",)})
    without_left = hits_from_markers(recorded(one_of_two, trials=1), BOTH)
    assert (without_left[JOINTS[2:6]] == BOTH.q0[2:6]).all(axis=None)
    with pytest.raises(CoarticError, match="side is 'left', but task 'metres' has the right hand"):
        hits_from_markers(markers, RIGHT, "left")


def lost(samples, column="right_2", first=40):
    """A change: the position of a marker is lost for some samples of 10 ms."""
    rows = slice(first, first + samples - 1)

    def change(t):
        t = t.copy()
        t.loc[rows, [f"{column}_x", f"{column}_y"]] = np.nan
        return t

    return change


def test_gaps_are_bridged_up_to_fifty_ms():
    markers = recorded(RIGHT)
    whole, bridged = (hits_from_markers(change(markers), RIGHT) for change in (lost(0), lost(5)))
    assert np.abs(whole.ticks - bridged.ticks).max() < 1
    last = markers.index[markers.trial == 1][-1]
    after = hits_from_markers(lost(10, first=last - 9)(markers), RIGHT)  # of the last hit
    pd.testing.assert_frame_equal(after, whole)


REFUSED = {
    r"trial 1 of p: a marker is missing for more than 50 ms from 0.39 s on": lost(6),
    r"trial 1 of p: the time jumps by 0.07 s at 0.49 s": lambda t: t.drop(index=range(50, 56)),
    "trial 2 of p: the links of the right arm are .* long, those of the task": lambda t: t.assign(
        **{name: t[name] * (1 + 0.15 * (t.trial == 2)) for name in t if name[-1] in "xy"}
    ),
    r"trial 1 of p: samples are 0.05 s apart; .* at least 25": lambda t: t[::5],
    "row 7: time is .*; it must be later": lambda t: t.rename(index={6: 7, 7: 6}).sort_index(),
    "no column right_3_y": lambda t: t.drop(columns="right_3_y"),
    "no trial hits all goals in their order": lambda t: t.assign(
        right_tip_x=-t.right_tip_x, right_1_x=-t.right_1_x, right_2_x=-t.right_2_x,
        right_3_x=-t.right_3_x,
    ),
}  # fmt: skip


@pytest.mark.parametrize("sentence", REFUSED)
def test_recordings_from_which_hits_would_be_wrong_are_refused(sentence):
    with pytest.raises(CoarticError, match=sentence):
        hits_from_markers(REFUSED[sentence](recorded(RIGHT)), RIGHT)


def test_unfinished_trials_are_counted():
    markers = recorded(RIGHT, trials=3)
    ends = markers.groupby("trial").time.transform("max")
    cut = markers[(markers.trial != 2) | (markers.time < ends / 2)]
    hits = hits_from_markers(cut, RIGHT)
    assert (hits.attrs["unfinished"], {*hits.trial}) == ({"p": 1}, {1, 3})
    assert solutions_of(RIGHT, hits).unfinished == 1
    assert solutions_of(RIGHT, hits.drop(index=0)).unfinished == 2  # of trial 1 a hit is missing
    both = hits_from_markers(pd.concat([markers.assign(subject="q"), cut]), RIGHT)
    one = both[both.subject == "q"]
    assert solutions_of(RIGHT, one).unfinished == 0


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
    with pytest.raises(CoarticError, match="no trial hits all goals"):
        solutions_of(BOTH, people[people.goal > 1])


# ------------------------------------------------------------------------------------- picture


def test_the_picture_shows_all_hits_and_their_numbers(people):
    figure = draw_recording(people, BOTH)
    axes = [each for part in figure.subfigs for each in part.axes]
    assert [each.get_title("left") for each in axes[:4]] == [f"goal {k}" for k in range(1, 5)]
    fit = consistency(people, BOTH)
    for panel, measure in ((4, "off"), (5, "pace")):
        dots = [line.get_ydata() for line in axes[panel].lines if line.get_marker() == "."]
        shown = np.sort(np.concatenate(dots))
        np.testing.assert_allclose(shown, np.sort(fit[measure].clip(lower=0.03)))
    assert [label.get_text() for label in axes[4].get_xticklabels()] == ["b", "a"]


def test_a_recording_that_is_refused_can_be_drawn(people, tmp_path):
    degrees = people.assign(**np.degrees(people[JOINTS[2:]]))
    degrees.to_csv(tmp_path / "hits.csv", index=False)
    assert draw_recording(tmp_path / "hits.csv", BOTH).subfigs
    mirrored = REFUSED["no trial hits all goals in their order"](recorded(RIGHT, trials=1))
    assert draw_recording(None, RIGHT, lost(20)(mirrored)).subfigs
    with pytest.raises(CoarticError, match="needs one of them"):
        draw_recording(None, RIGHT)
