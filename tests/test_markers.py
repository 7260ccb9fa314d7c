"""Hits from the places of markers: the way there and back, sampling, and what goes wrong."""

import warnings

import numpy as np
import pandas as pd
import pytest

from coartic import CoarticError, correct, load_task
from coartic.analysis import hits_from_markers, read_hits, solutions_of
from coartic.robot import HANDS
from tests.support.processes import ROOT

BOTH, RIGHT = (
    load_task("two-armed-1"),
    load_task(ROOT / "docs" / "examples" / "recordings" / "metres.toml"),
)
ONE_OF_TWO = BOTH.model_copy(update={"hands": ("right",)})


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


def recorded(task, trials=4, rate=100, hands=None):
    """Places of markers, a frame."""
    frames = []
    for trial, knots in enumerate(knots_of(task, trials), 1):
        clock, q = postures(knots, rate)
        frame = {"subject": "p", "trial": trial, "time": clock}
        for hand in hands or task.hands:
            for k, place in enumerate(np.moveaxis(task.robot.joint_positions(q, hand), 1, 0), 1):
                name = "tip" if k > len(task.robot.arm(hand).links) else k
                frame |= {f"{hand}_{name}_x": place[:, 0], f"{hand}_{name}_y": place[:, 1]}
        frames.append(pd.DataFrame(frame))
    return pd.concat(frames, ignore_index=True)


def true_hits(task, trials=4):
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


@pytest.mark.parametrize("rate", [60, 100, 200])
@pytest.mark.parametrize(("task", "side"), [(BOTH, "both"), (RIGHT, "right")])
def test_angles_are_found_from_places_at_any_rate_of_sampling(task, side, rate):
    hits, truth = hits_from_markers(recorded(task, rate=rate), task, side), true_hits(task)
    assert hits.attrs == {"unfinished": 0}
    assert hits.subject.unique() == ["p"]
    assert (hits[["trial", "goal", "hand"]] == truth[["trial", "goal", "hand"]]).all(axis=None)
    assert np.abs(hits.ticks - truth.ticks).max() < 100 / rate  # a sample
    joints = [*task.robot.joint_names]
    assert np.abs(hits[joints] - truth[joints]).max(axis=None) < 0.02
    assert len(solutions_of(task, hits).runs) == 4


def test_a_file_is_read_as_a_frame_and_ticks_are_of_the_unit(tmp_path):
    markers = recorded(RIGHT)
    text = markers.assign(note="so\u2028so").to_csv(index=False).replace("-", "\u2212")
    (tmp_path / "p.csv").write_text("\ufeff" + text, "utf-8")
    hits, same = hits_from_markers(tmp_path / "p.csv", RIGHT), hits_from_markers(markers, RIGHT)
    pd.testing.assert_frame_equal(hits, same)
    double = hits_from_markers(markers, RIGHT, ticks_per_unit=200)
    np.testing.assert_allclose(double.ticks, 2 * same.ticks, atol=1e-5)
    same.rename(columns={"ticks": "duration"}).to_csv(tmp_path / "hits.csv", index=False)
    pd.testing.assert_frame_equal(read_hits(tmp_path / "hits.csv", RIGHT), same)


def test_an_arm_without_markers_keeps_its_start():
    words = "the left arm has no markers and keeps its start"
    with pytest.warns(UserWarning, match=words) as warned:
        hits = hits_from_markers(recorded(ONE_OF_TWO), BOTH)
    assert {warning.filename for warning in warned} == {__file__}
    left = BOTH.robot.joints("left")
    assert (hits[[*BOTH.robot.joint_names[left]]] == BOTH.q0[left]).all(axis=None)
    assert {*hits.hand} == {"right"}


def lose(samples, column="right_2", value=np.nan, first=40):
    """A change: the place of a marker is lost for some samples."""
    names = [f"{column}_x", f"{column}_y"]

    def change(t):
        u = t.copy()
        u.loc[first : first + samples - 1, names] = value
        return u

    return change


BRIDGED = {
    "NaN": lose(3),
    "50 ms": lose(5),
    "zeros": lose(3, value=0.0),
    "missing rows": lambda t: t.drop(index=[40, 41, 42]),
    "begin": lose(3, first=0),
}


@pytest.mark.parametrize("gap", BRIDGED)
def test_short_gaps_are_bridged_and_said(gap):
    markers = recorded(RIGHT)
    with pytest.warns(UserWarning, match=r"row \d+: .*a gap is bridged .*takes [35]0 ms"):
        hits = hits_from_markers(BRIDGED[gap](markers), RIGHT)
    whole, joints = hits_from_markers(markers, RIGHT), [*RIGHT.robot.joint_names]
    assert np.abs(hits.ticks - whole.ticks).max() < 1
    assert np.abs(hits[joints] - whole[joints]).max(axis=None) < 0.02


def swap(first, last, one="right_2", other="right_3"):
    """A change: two markers have the place of each other."""

    def change(t):
        u = t.copy()
        for axis in "xy":
            a, b = f"{one}_{axis}", f"{other}_{axis}"
            u.loc[first:last, [a, b]] = t.loc[first:last, [b, a]].to_numpy()
        return u

    return change


def scaled(factor):
    """A change: all places are multiplied."""
    return lambda t: t.assign(**{name: factor * t[name] for name in t.columns[3:]})


WRONG = {
    "row 40: right_2: a marker is missing for more than 50 ms": lose(6),
    "row 0: right_2: a marker is missing": lose(8, first=0),
    "row 46: time jumps by more than 50 ms": lambda t: t.drop(index=range(40, 46)),
    "row 50: right_.: the length of a link jumps.*swap": swap(50, 60),
    "row 0: in trial 1 the links.*0.09. Markers right_2 and right_3 may be swapped": swap(
        0, 10**4 // 40
    ),
    "row 50: .*the length of a link .*flag": lose(1, first=50, value=9999.0),
    r"are 330, 270, 90 long .*'metres' 0.33, 0.27, 0.09.*another unit": scaled(1000),
    "another arm": scaled(0.85),
    "row 7: another subject; needed is a file for each": lambda t: t.assign(
        subject=np.where(t.index < 7, "p", "q")
    ),
    "row 0: subject is empty": lambda t: t.assign(subject=None),
    "number trials through from session": lambda t: pd.concat([t, t], ignore_index=True),
    "row 9: time does not increase": lambda t: t.assign(time=t.time.where(t.index != 9, 0.0)),
    "Is time in s, and not in ms": lambda t: t.assign(time=1000 * t.time),
    "row 3: right_2_x is '0,5'; ',' .comma. makes": lambda t: t.astype(object).where(
        (t.index != 3)[:, None] | (t.columns != "right_2_x"), "0,5"
    ),
    "no column right_3_x .also right_3_y": lambda t: t.drop(columns=["right_3_x", "right_3_y"]),
    "no column subject .also trial, .* found are none": lambda t: t[[]],
    "no sample": lambda t: t[:0],
    r"4 of 4 trials are unfinished.*goal 1 in trial 1.*at \(0.0879, -0.486\).*upwards": lambda t: (
        t.assign(**{name: -t[name] for name in t if name.endswith("_y")})
    ),
}


def placed(change):
    """A change of the x and y of all markers."""

    def changed(t):
        xs, ys = ([name for name in t if name.endswith(f"_{axis}")] for axis in "xy")
        x, y = change(t[xs].to_numpy(), t[ys].to_numpy())
        return t.assign(**dict(zip(xs + ys, np.hstack([x, y]).T, strict=True)))

    return changed


WRONG |= {
    "They are finished in a recording in which angles are anticlockwise, as y is upwards": placed(
        lambda x, y: (x, -y)
    ),
    "They are finished in a recording in which axes are turned by 90 degrees": placed(
        lambda x, y: (y, -x)
    ),
    "They are finished in a recording in which x and y are swapped": placed(lambda x, y: (y, x)),
    "They are finished in a recording in which x is the other way": placed(lambda x, y: (-x, y)),
}


def from_trial_3(column, change):
    """A change of columns of the second session, trials 3 and 4."""

    def changed(t):
        names = [name for name in t if name.startswith(column)]
        return t.assign(**{name: t[name].where(t.trial < 3, change(t[name])) for name in names})

    return changed


def in_one(t, trial=1):
    """All trials have one number, and the clock runs on."""
    return t.assign(trial=trial, time=0.01 * np.arange(len(t)))


def earlier(number, of_trial):
    """A change: trials begin with samples of trial 1, as ``of_trial`` gives them."""

    def change(t):
        parts = [
            pd.concat([of_trial(t[t.trial == 1]), part]) if trial in number else part
            for trial, part in t.groupby("trial")
        ]
        return pd.concat(
            part.assign(trial=trial, time=0.01 * np.arange(len(part)))
            for trial, part in enumerate(parts, 1)
        ).reset_index(drop=True)

    return change


WRONG |= {
    r"row \d+: the time between samples is 0.02 in trial \d, but 0.01 in trial \d;": from_trial_3(
        "time", lambda x: 2 * x
    ),
    r"row \d+: the time between samples is 0.03 in trial 2, but 0.01": lambda t: t.assign(
        time=t.time.where(t.trial != 2, 3 * t.time)
    ),
    r"row \d+: base_y is -0.03 in trial \d, but 0 in trial \d; task 'metres' locks": from_trial_3(
        "right_1_y", lambda y: y - 0.03
    ),
    r"in trial 3 the links of the right arm are 33, 27, 9 .*also trial 4.*unit": from_trial_3(
        "right", lambda x: 100 * x
    ),
    r"row \d+: the hand is back at the start of the trial and reaches all goals again": in_one,
    r"row \d+: the hand is back at the start": lambda t: pd.concat(
        [in_one(t[(t.trial == 1) & (t.time < 2.5) | (t.trial == 2)], 2), t[t.trial > 2]],
        ignore_index=True,
    ),
    r"row 0: the trial begins with a rest of more than 200 ms": earlier(
        {1}, lambda t: t.iloc[[0] * 50]
    ),
    r"row \d+: the hand is not within 0.17 of \(0.0879, 0.486\), where": earlier(
        {3}, lambda t: t.iloc[::-5]
    ),
    "time between samples is 0.1 s; needed are 25 to 2000 samples": lambda t: t[::10].reset_index(),
    "row 1: time does not increase; .* not rounded": lambda t: t.assign(time=t.time.round(1)),
    r"row \d+: right_tip: .* are samples missing": lambda t: t.drop(index=range(40, 60)).pipe(
        lambda t: t.assign(time=0.01 * t.groupby("trial").cumcount()).reset_index(drop=True)
    ),
    "row 90: right_.: .* did a marker jump": lambda t: t.assign(
        **{name: t[name] + 0.03 * t.index.isin(range(90, 93)) for name in t if name.endswith("x")}
    ),
    "sort samples by time, and give people of one name a file each": lambda t: pd.concat(
        [t, t.assign(right_tip_x=t.right_tip_x + 0.001)], ignore_index=True
    ),
}


@pytest.mark.parametrize("sentence", WRONG)
def test_a_recording_that_is_wrong_is_refused(sentence):
    with pytest.raises(CoarticError, match=sentence):
        hits_from_markers(WRONG[sentence](recorded(RIGHT)), RIGHT)


def noisy(t, share=0.001, seed=0):
    """Places with noise, as a share of the length of the arm."""
    noise = share * 0.69 * np.random.default_rng(seed).standard_normal((len(t), t.shape[1] - 3))
    return t.assign(**dict(zip(t.columns[3:], (t.iloc[:, 3:] + noise).to_numpy().T, strict=True)))


CLEAN = {
    "little noise": lambda: noisy(recorded(RIGHT)),
    "much noise": lambda: noisy(recorded(RIGHT), 0.002),
    "rounded clock": lambda: recorded(RIGHT, rate=75).round({"time": 2}),
    "slow": lambda: recorded(RIGHT, rate=300).assign(time=lambda t: 3 * t.time),
    "returns": lambda: pd.concat(
        pd.concat([t, t[::-1]]).assign(time=0.01 * np.arange(2 * len(t)))
        for _, t in recorded(RIGHT).groupby("trial")
    ),
}


@pytest.mark.parametrize("seed", range(4))
def test_noise_is_no_second_start(seed):
    """Noise of half a radius brings single samples to goals and back to the start."""
    assert len(hits_from_markers(noisy(recorded(RIGHT, 12), 0.0075, seed), RIGHT)) == 48


@pytest.mark.parametrize("recording", CLEAN)
def test_a_clean_recording_passes_without_a_warning(recording):
    hits, truth = hits_from_markers(CLEAN[recording](), RIGHT), true_hits(RIGHT)
    assert len(hits) == len(truth)
    ticks = truth.ticks * (3 if recording == "slow" else 1)
    assert np.abs(hits.ticks - ticks).median() < 3  # noise moves the way into a goal


def each_trial(change):
    """A change of the samples of each trial, whose clock runs on."""
    return lambda t: pd.concat(
        [change(part).assign(time=lambda u: 0.01 * np.arange(len(u)))
         for _, part in t.groupby("trial")], ignore_index=True)  # fmt: skip


def out_and_back(t):
    """A trial begins with most of the way to the first goal, and the way back."""
    centre, tips = RIGHT.goal_array[0], t[["right_tip_x", "right_tip_y"]].to_numpy()
    begin = t[: int(0.7 * np.argmax(np.linalg.norm(tips - centre, axis=1) < RIGHT.radius))]
    return pd.concat([begin, begin[::-1], t])


SAID = {
    r"row 1\d\d: the hand rests for more than 200 ms on the way, 4 times, which": each_trial(
        lambda t: pd.concat([t[:150], t.iloc[[150] * 60], t[150:]])
    ),
    r"row \d+: the hand is back at the start before it hits a goal, 4 times": each_trial(
        out_and_back
    ),
    r"the median trial begins at right_.* [+-]0.\d+ rad from the start": each_trial(
        lambda t: t[15:]
    ),
}


def twice(t):
    """A sampler of 50 Hz, whose samples are each there twice at 100 Hz."""
    return t.iloc[np.arange(len(t)) // 2 * 2]


def dropped(t):
    """A sixth of the frames is lost, and times are numbered again."""
    return t[np.random.default_rng(len(t)).random(len(t)) > 1 / 6]


def soft(t):
    """The marker of the elbow slides by 15 mm along the arm for each rad of flexion."""
    arm, forearm = (
        (t[f"right_{k + 1}_x"] - t[f"right_{k}_x"])
        + 1j * (t[f"right_{k + 1}_y"] - t[f"right_{k}_y"])
        for k in (1, 2)
    )
    slides = 0.015 * (np.angle(forearm / arm) - 1.4) * arm / abs(arm)
    return t.assign(right_2_x=t.right_2_x + slides.map(np.real),
                    right_2_y=t.right_2_y + slides.map(np.imag))  # fmt: skip


def late(t):
    """The tip is sampled 50 ms later than the other markers."""
    return t.assign(right_tip_x=t.right_tip_x.shift(5).bfill(),
                    right_tip_y=t.right_tip_y.shift(5).bfill())  # fmt: skip


SAID |= {
    r"the length of right link 3 varies by 1\d % .SD.: .*or is it late": each_trial(late),
    "most samples have the places of the one before": each_trial(twice),
    "right_._. is rounded to 0.003, the radius of goals is 0.01": lambda t: t.assign(
        **(t.iloc[:, 3:] / 0.003).round() * 0.003
    ),
    r"\d+ times markers go twice as far between samples .* numbered again": each_trial(dropped),
    r"the length of right link 1 follows joint 2, by 1 % .* slide over a joint.*link 2": soft,
}


@pytest.mark.parametrize("sentence", SAID)
def test_what_counts_as_movement_or_is_cut_from_it_is_said(sentence):
    with pytest.warns(UserWarning, match=sentence):
        assert len(hits_from_markers(SAID[sentence](noisy(recorded(RIGHT))), RIGHT)) == 16


def test_a_scale_that_changes_by_three_per_cent_is_said():
    markers = recorded(RIGHT)
    places = markers.columns[3:]
    larger = markers.assign(**markers[places].where(markers.trial < 3, 1.03 * markers[places]))
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        hits_from_markers(larger, RIGHT)
    words = "link 1 is 0.34 in trial 3, but 0.33 in trial 1; did a marker move, or the scale?"
    assert words in str(said[0].message)


def test_places_in_another_unit_are_not_called_rounded():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(CoarticError, match="another unit"):
            hits_from_markers(scaled(1000)(recorded(RIGHT).round(4)), RIGHT)


@pytest.mark.parametrize("order", [(2, 1, 3, 4), (4, 3, 2, 1)])
def test_goals_in_another_order_are_named(order):
    goals = tuple(RIGHT.goals[k - 1] for k in order)
    markers = recorded(RIGHT.model_copy(update={"goals": goals}))
    words = f"finished in a recording with goals in the order {', '.join(map(str, order))}"
    with pytest.raises(CoarticError, match=words):
        hits_from_markers(markers, RIGHT)


def test_a_second_hit_of_a_goal_that_the_tip_does_not_leave_is_said():
    first, *others = RIGHT.goals
    task = RIGHT.model_copy(update={"goals": (first, first, *others), "initial_hands": "R" * 5})
    with pytest.warns(UserWarning, match="the hand is in the next goal already where it hits"):
        assert len(hits_from_markers(recorded(RIGHT), task)) == 20


def test_starts_far_in_varied_directions_are_said():
    parts = []
    for trial, sign in enumerate([1, -1, 1, -1, -1, 1], 1):
        way = (0.9 + 0.05 * trial) * np.array([0.2, -0.25, 0.1])
        right = tuple(RIGHT.q0[-3:] + sign * way)
        start = RIGHT.start.model_copy(update={"right": right})
        task = RIGHT.model_copy(update={"start": start})
        parts.append(recorded(task, 1).assign(trial=trial))
    with pytest.warns(UserWarning, match=r"begins 0.3\d .length unit, rad. from .* varied"):
        assert len(hits_from_markers(pd.concat(parts), RIGHT)) == 24


def test_a_base_that_moves_a_little_is_said():
    with pytest.warns(UserWarning, match=r"base_y is -0.015 in trial \d, but 0 in trial \d"):
        hits = hits_from_markers(from_trial_3("right_1_y", lambda y: y - 0.015)(recorded(RIGHT)),
                                 RIGHT)  # fmt: skip
    assert len(hits) == 16


def test_arms_that_contradict_each_other_or_the_task_are_refused():
    markers = recorded(BOTH)
    torn = markers.assign(**{name: markers[name] + 0.15 for name in markers if "left" in name
                             and name.endswith("x")})  # fmt: skip
    with pytest.raises(CoarticError, match="row 0: the places of the two shoulders do not belong"):
        hits_from_markers(torn, BOTH, "both")
    near = markers.assign(**{name: markers[name] + 0.04 for name in markers if "left" in name
                             and name.endswith("x")})  # fmt: skip
    base = [hits_from_markers(each, BOTH, "both").base_x[0] for each in (markers, near)]
    assert base[1] - base[0] == pytest.approx(0.02, abs=0.01)
    with pytest.raises(CoarticError, match="side is 'left', but task 'metres' has the right hand"):
        hits_from_markers(markers, RIGHT, "left")


def late_left(t):
    """The places of the left arm are of 120 ms before, with noise of cameras."""
    left = [name for name in t if name.startswith("left")]
    late = t.groupby("trial")[left].shift(12)
    rest = t.groupby("trial")[left].transform("first")
    return t.assign(**late.fillna(rest))


def test_an_arm_whose_system_lags_behind_is_said():
    reached = {"goals": ((0.5, 3.5), (-0.5, 3.4)), "initial_hands": "RR"}
    task = BOTH.model_copy(update={"locked_base": ("x", "y"), **reached})
    markers = recorded(task, trials=40)
    assert len(hits_from_markers(noisy(markers), task, "both")) == 80
    with pytest.warns(UserWarning, match="the left arm rests for at least 1[0-4]0 ms more than"):
        hits_from_markers(noisy(late_left(markers)), task, "both")


def test_unfinished_trials_are_named_and_counted():
    markers = recorded(RIGHT)
    short = markers[(markers.trial != 3) | (markers.time < 0.5)]
    with pytest.warns(UserWarning, match="1 of 4 trials are unfinished.*goal . in trial 3"):
        hits = hits_from_markers(short, RIGHT)
    assert hits.attrs["unfinished"] == 1
    assert hits.trial.unique().tolist() == [1, 2, 4]
    assert solutions_of(RIGHT, hits).unfinished == 1


def test_a_marker_that_is_held_in_its_place_is_said():
    markers, names = recorded(RIGHT), ["right_1_x", "right_1_y"]
    markers.iloc[:, 3:] += 1e-4 * np.random.default_rng(0).standard_normal((len(markers), 8))
    hits_from_markers(markers, RIGHT)
    for samples in (5, 8):
        held = markers.copy()
        held.loc[41 : 40 + samples, names] = held.loc[40, names].to_numpy()
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            hits_from_markers(held, RIGHT)
        words = "row 41: a marker keeps its place"
        assert [words in str(each.message) for each in said] == [True] * (samples > 5)


def test_what_the_hits_do_not_need_is_not_checked():
    markers = recorded(RIGHT)
    after = markers.groupby("trial").time.transform("max") - markers.time < 0.15
    lost = markers.assign(right_2_x=markers.right_2_x.where(~after), left_1_x="?", head_x=90.0)
    pd.testing.assert_frame_equal(hits_from_markers(lost, RIGHT), hits_from_markers(markers, RIGHT))
