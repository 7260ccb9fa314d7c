"""Reading of recorded trials, and the kernels that get them."""

import re
import warnings

import numpy as np
import pandas as pd
import pytest

from coartic import CONDITIONS, CoarticError, correct, load_task, move
from coartic.analysis import read_hits, solutions_of
from coartic.analysis.hits import checked_hits
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


@pytest.fixture(scope="module")
def plainly(people):
    """The same ten trials of each, as they are read."""
    return checked_hits(people, TASK)


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
    "Angles are in rad": lambda t: t.assign(left_1=np.degrees(t.left_1)),
    "a line above already; number trials": lambda t: pd.concat([t, t]),
    "line 2: ticks is .*column duration": lambda t: t.assign(ticks=t.ticks / 100),
    "duration is 0.0; needed is more than 0": lambda t: t.assign(duration=0.0).drop(
        columns="ticks"
    ),
    "median hit takes 0.0.* Are times in": lambda t: t.assign(duration=t.ticks / 1000).drop(
        columns="ticks"
    ),
    "base_x is 1e\\+300": put("base_x", 0, 1e300),
    "line 2: left_2 is '?inf": put("left_2", 0, np.inf),
    "left_2 is '?True'?; needed is a number": put("left_2", 0, np.True_),
    r"left_2 is '?\(1\+2j\)'?; '\(' .* makes it no number": put("left_2", 0, 1 + 2j),
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
def test_other_forms_of_the_same_table_are_read(people, plainly, read, form):
    given = read(FORMS[form](people.to_csv(index=False)))
    pd.testing.assert_frame_equal(given.drop(columns="subject"), plainly.drop(columns="subject"))
    assert given.subject.nunique() == 2


def zeros_of(hand, chosen):
    """A change of a hit made with a hand, or by the other: all angles of its arm are zero."""

    def change(t):
        row = t.index[((t.hand == hand) == chosen) & (t.goal > 1)][5]
        joints = [name for name in t if name.startswith(hand)]
        return t.assign(**{name: t[name].where(t.index != row, 0.0) for name in joints})

    return change


IMPLAUSIBLE = {
    "all angles of the right arm are 0": zeros_of("right", chosen=True),
    "the hand is .* radii from its goal": put("right_2", 30, 0.9),
    "all angles of the left arm are 0": zeros_of("left", chosen=False),
    "left_2 is 9999, no angle in rad": put("left_2", 30, 9999.0),
    "base_y is 0.4, but task 'two-armed-1' locks it at 0": put("base_y", 30, 0.4),
    "ticks, a straight movement": put("ticks", 30, 2),
    "it takes 78000 ticks, the corrective process at most": put("ticks", 30, 78_000),
}


@pytest.mark.parametrize("reason", IMPLAUSIBLE)
def test_a_hit_that_nobody_can_have_made_is_named_or_left_out(people, read, reason):
    frame = IMPLAUSIBLE[reason](people)
    bad = (frame != people).any(axis=1)
    line, row = bad.idxmax() + 2, bad.idxmax()
    with pytest.raises(CoarticError, match=rf"people.csv, line {line}: .*{reason}.*Mend"):
        read(frame)
    words = f"1 of {len(people)} hits are left out as implausible"
    with pytest.warns(UserWarning, match=words) as warned:
        left = read(frame, implausible="drop")
    assert {warning.filename for warning in warned} == {__file__}
    pd.testing.assert_frame_equal(left, read(people[~bad]))
    with pytest.warns(UserWarning, match=rf"left out as implausible, row {row}") as warned:
        trials = solutions_of(TASK, frame, implausible="drop")
    assert {warning.filename for warning in warned} == {__file__}
    assert len(trials.runs) == 20 - 1


def test_a_time_below_a_tick_is_refused_also_after_a_hit_that_is_missing(people, read):
    """The straight movement is unknown: it cannot be named."""
    frame = put("ticks", 30, 0.5)(people).drop(29).rename(columns={"ticks": "duration"})
    with pytest.raises(CoarticError, match=r"it takes 0\.5 ticks, any movement 1 or more\."):
        read(frame, ticks_per_unit=1.0)


RIGHT_ARM = [f"right_{joint}" for joint in (1, 2, 3, 4)]
ANGLES = [*TASK.robot.joint_names[2:]]
MOSTLY = {
    "degrees": lambda t: t.assign(**np.degrees(t[ANGLES])),
    "columns in another order": lambda t: t.assign(
        **dict(zip(RIGHT_ARM, t[RIGHT_ARM[::-1]].to_numpy().T, strict=True))
    ),
    "clockwise": lambda t: t.assign(**-t[ANGLES]),
    "of segments": lambda t: t.assign(**t[RIGHT_ARM].cumsum(axis=1)),
    "of the next row": lambda t: t.assign(**t[ANGLES].shift(-1).ffill()),
    "goals in another order": lambda t: t.assign(goal=5 - t.goal),
    "hands swapped": lambda t: t.assign(hand=t.hand.map({"left": "right", "right": "left"})),
    "no base": lambda t: t.assign(base_x=t.base_x + 0.5),
}


@pytest.mark.parametrize("change", MOSTLY)
def test_a_person_whose_hits_are_mostly_impossible_is_refused_by_row(people, read, change):
    ofb = people.subject == "b"
    frame = pd.concat([people[~ofb], MOSTLY[change](people[ofb])])
    sentence = r"line \d+: .*(radii from its goal|no angle in rad).*Most hits of b are implausible"
    with pytest.raises(CoarticError, match=sentence):
        read(frame)
    with pytest.raises(CoarticError, match="Most hits of b"):
        solutions_of(TASK, frame, implausible="drop")


def test_goals_in_another_order_are_named(people, read):
    swapped = people.assign(goal=people.goal.replace({2: 3, 3: 2}))
    with pytest.raises(CoarticError, match=r"at goal [23].*Are goals in their order\? Mend"):
        read(swapped)


TIMES = {
    r"b: all times are multiples of 100 ticks, the median hit takes \d+: they are rounded": (
        lambda ticks: (ticks / 100).round().clip(lower=1) * 100
    ),
    "b: all times are multiples of 150 ticks, .* or constant": lambda ticks: 0 * ticks + 150,
    "b: in every trial times rise .* clock that runs on": np.cumsum,
    r"b: the median hit takes .*ms \(ticks_per_unit=0.1\)": lambda ticks: 1000 * ticks + 7,
    "b: 16 of 40 hits, first goal 1 in trial 7, take .* Do units differ, ms there and s else": (
        lambda ticks: ticks * np.repeat([1, 1000], [24, 16])
    ),
    "b: 25 of 40 hits, .* s there and min elsewhere.$": lambda ticks: (
        ticks * np.repeat([1, 60], [15, 25]) / 60
    ),
    "Do units differ, ms there and s elsewhere, or was a point between thousands": lambda ticks: (
        1000 * ticks.where(ticks < ticks.median(), ticks / 1000)
    ),
}


@pytest.mark.parametrize("sentence", TIMES)
def test_times_of_a_person_that_are_none_are_refused(people, read, sentence):
    seconds = people.assign(duration=people.ticks / 100).drop(columns="ticks")
    change = TIMES[sentence](people.ticks[people.subject == "b"]) / 100
    seconds.loc[people.subject == "b", "duration"] = change
    with pytest.raises(CoarticError, match=sentence):
        read(seconds, ticks_per_unit=100)


ODD_TIMES = {
    "times hardly follow the paths .* or were they sorted": lambda t: t.ticks.sort_values().array,
    "times hardly follow the paths of hits .*another person": lambda t: (
        t.ticks.sample(frac=1, random_state=1).array
    ),
    "a quarter .* faster .* Most are in trials 6 to 10: are these another person's": lambda t: (
        t.ticks * np.where(t.trial > 5, 0.4, 1)
    ),
    "a quarter .* faster .* Most are hits of goal 4: does a counter overflow": lambda t: (
        t.ticks * np.where(t.goal == 4, 0.3, 1)
    ),
    "goal 1 takes .* is a reaction time in it": lambda t: t.ticks + 400 * (t.goal == 1),
    "times hardly follow .* with the row above or below.: do they belong to other rows": lambda t: (
        np.roll(t.ticks, 1)
    ),
}


@pytest.mark.parametrize("sentence", ODD_TIMES)
def test_times_that_hold_more_or_belong_to_other_rows_are_said(people, sentence):
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        solutions_of(TASK, people.assign(ticks=ODD_TIMES[sentence](people)), implausible="drop")
    assert any(re.search(f"a: {sentence}", str(each.message)) for each in said)


ONE_ARM = load_task("ascending")
ARM_AND_BASE = [*ONE_ARM.robot.joint_names]


@pytest.fixture(scope="module")
def practised():
    """Forty trials of the plain learner with one arm."""
    return reference.hits_of(ONE_ARM, CONDITIONS["EC1"], trials=40, seed=1, subject="a")


def angles(change):
    """A change of all angles of the right arm."""
    return lambda t: t.assign(**{name: change(t[name]) for name in RIGHT_ARM})


def in_order(*goals):
    """A change of the order of rows in each trial."""
    return lambda t: t.iloc[np.lexsort([t.goal.map(goals.index), t.trial])]


def filled(t):
    """Every third posture at goal 2 is that of the first trial."""
    first = t[ARM_AND_BASE][t.goal == 2].iloc[0]
    every = (t.goal == 2) & (t.trial % 3 == 1)
    return t.assign(**{name: t[name].mask(every, first[name]) for name in ARM_AND_BASE})


def times_of(trials, copies):
    """A change: some trials have the times of others."""
    number = dict(zip(copies, trials, strict=True))

    def change(t):
        times = t.set_index(["trial", "goal"]).ticks
        keys = zip(t.trial.replace(number), t.goal, strict=True)
        return t.assign(ticks=[times[key] for key in keys])

    return change


def elsewhere(task):
    """The second goal is lower by two radii."""
    one, (x, y), *others = task.goals
    return task.model_copy(update={"goals": ((one, (x, y - 2 * task.radius), *others))})


def cut(t):
    """Trials 5, 7 and 15 are cut after goal 1, and later trials count on."""
    begins = t.trial.isin([5, 7, 15]) & (t.goal == 2)
    return t.assign(trial=t.trial + begins.cumsum())


SHOWN = {
    "3 trials of a end where the next one begins, first trial 5: are trials cut in two": cut,
    "% of the hits of a at goal 1 in trials 21 to 40 .* Did a sensor .*zeroed again": lambda t: (
        t.assign(base_x=t.base_x - 0.06 * ((t.trial > 20) & (t.goal == 1)))
    ),
    r"row 0: rows of the trial are in no order of goals.*also row 3, .*35 more": in_order(1, 3, 2),
    r"a: right_1 has \d values, 0.1 rad apart or more: is it rounded": angles(
        lambda x: (10 * x).round() / 10
    ),
    "a: all times are multiples of 20 ticks, .* rounded": lambda t: t.assign(
        ticks=(t.ticks / 20).round().clip(lower=1) * 20
    ),
    "a: the posture is the same in 14 of 40 hits of goal 2: is it filled": filled,
    r"a: right_4 is the same in \d of 40 hits of goal 2: .*out of range": lambda t: t.assign(
        right_4=t.right_4.clip(upper=t.right_4.quantile(0.9))
    ),
    "a, trial 25: times rise from goal to goal.* clock.*also trial 26, .*11 more": lambda t: (
        t.assign(ticks=t.ticks.where(t.trial < 25, t.groupby("trial").ticks.cumsum()))
    ),
    r"% of the hits of goal 2 are more than 1.25 radii .* is the goal elsewhere": elsewhere,
    "% of the hits of a's right hand in trials (1[5-9]|2[0-4]) to 40 .* sensor drift": (
        lambda t: t.assign(right_2=t.right_2 + 0.05 * t.trial / 40)
    ),
    "% of the hits of a's right hand in trials 25 to 40 .* Did a sensor .*slip": lambda t: t.assign(
        right_2=t.right_2 + 0.06 * (t.trial >= 25)
    ),
    "a: right_3 is the same in all 120 hits: was it measured": lambda t: t.assign(
        right_3=t.right_3.median()
    ),
    "a: the posture is the same in 40 of 40 hits of goal 2: is it filled in, computed": lambda t: (
        t.assign(
            **t[ARM_AND_BASE].where(t.goal != 2, t.groupby("goal")[ARM_AND_BASE].transform("last"))
        )
    ),
    "Trials 5 and 20 of a, and others, have the same times at all goals": times_of(
        range(5, 15), range(20, 30)
    ),
    "Trials 3 and 7 of a, and others, have the same times": times_of([3] * 5, [7, 15, 22, 30, 33]),
    "three of four hits are within 0.4. radii .* a diameter": lambda task: task.model_copy(
        update={"radius": 2 * task.radius}
    ),
}


@pytest.mark.parametrize("sentence", SHOWN)
def test_values_that_no_recording_has_by_chance_are_said(practised, sentence):
    change = SHOWN[sentence]
    of_task = change is elsewhere or "diameter" in sentence
    hits, task = (practised, change(ONE_ARM)) if of_task else (change(practised), ONE_ARM)
    with pytest.warns(UserWarning, match=sentence) as said:
        assert len(checked_hits(hits, task)) == 120
    assert len(said) == 1


def turned(t, arm, sign, first):
    """A change: angles have a sign, and the first angle of an arm is from another line."""
    return t.assign(**sign * t[arm]).assign(**{arm[0]: first + sign * t[arm[0]]})


REMEDIES = {
    "with each posture a row lower": lambda t: t.assign(**t[ARM_AND_BASE].shift(-1).ffill()),
    "with the other sign of right_2": lambda t: t.assign(right_2=-t.right_2),
    "with columns in the order right_4, right_3, right_2, right_1": lambda t: t.assign(
        **dict(zip(RIGHT_ARM, t[RIGHT_ARM[::-1]].to_numpy().T, strict=True))
    ),
    "in which turns are made rad": angles(lambda x: x / (2 * np.pi)),
    "in which gradians are made rad": angles(lambda x: np.degrees(x) / 0.9),
    "in which degrees are made rad, axes are turned by 90 degrees": lambda t: t.assign(
        **np.degrees(turned(t, RIGHT_ARM, 1, -np.pi / 2)[RIGHT_ARM])
    ),
    "in which axes are turned by 180 degrees": lambda t: turned(t, RIGHT_ARM, 1, -np.pi),
    "in which x is the other way, as if mirrored": lambda t: turned(t, RIGHT_ARM, -1, np.pi),
    "in which x and y are swapped": lambda t: turned(t, RIGHT_ARM, -1, np.pi / 2),
    "with a turn by π of right_2 .arctan2, not arctan": lambda t: t.assign(
        right_2=t.right_2 - np.pi * (t.goal > 1)
    ),
    "with a turn by π of right_1 .arctan2, not arctan., and back in the next": lambda t: t.assign(
        right_1=t.right_1 + np.pi, right_2=t.right_2 - np.pi
    ),
    "in which a straight joint has angle 0, not π": angles(lambda x: np.pi + x),
    "with all angles a row lower": lambda t: t.assign(**t[RIGHT_ARM].shift(-1).ffill()),
}


@pytest.mark.parametrize("remedy", REMEDIES)
def test_the_change_that_mends_most_hits_is_named(practised, remedy):
    with pytest.raises(CoarticError, match=f"would be at their goals in a recording {remedy}"):
        checked_hits(REMEDIES[remedy](practised), ONE_ARM)


LEFT_ARM = [f"left_{joint}" for joint in (1, 2, 3, 4)]


def arms_exchanged(t):
    """The columns of the arms are swapped in some trials."""
    both = t[LEFT_ARM + RIGHT_ARM]
    other = pd.DataFrame(t[RIGHT_ARM + LEFT_ARM].to_numpy(), columns=both.columns)
    return t.assign(**both.where(~t.trial.between(4, 6), other))


OF_ARMS = {
    "x is the other way, as if mirrored .the left arm": lambda t: turned(t, LEFT_ARM, -1, np.pi),
    "angles are anticlockwise, .* .the left arm": lambda t: t.assign(**-t[LEFT_ARM]),
    "gradians are made rad .the left arm": lambda t: t.assign(**np.degrees(t[LEFT_ARM]) / 0.9),
    "all angles a row higher .the left arm": lambda t: t.assign(**t[LEFT_ARM].shift(1).bfill()),
    "all angles a row lower .the right arm": lambda t: t.assign(**t[RIGHT_ARM].shift(-1).ffill()),
    "which the columns of the arms are swapped": arms_exchanged,
    "the start: is it of the next trial": lambda t: t.assign(
        **{name: t[name].mask(t.goal == 4, TASK.q0[n]) for n, name in enumerate(ARM_AND_BASE)}
    ),
}


@pytest.mark.parametrize("cause", OF_ARMS)
def test_a_fault_of_one_arm_or_of_some_trials_is_named(people, cause):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of times in what is left
        with pytest.raises(CoarticError, match=cause):
            checked_hits(OF_ARMS[cause](people), TASK)


def test_an_arm_that_is_never_used_is_no_fault():
    one_hand = TASK.model_copy(update={"hands": ("right",)})
    hits = reference.hits_of(one_hand, CONDITIONS["EC1"], trials=8, seed=1, subject="a")
    assert len(checked_hits(hits, TASK)) == 32


def means(t, rows, step):
    """Postures of some rows are the means of the rows ``step`` above and below."""
    u = t.copy()
    for row in rows:
        u.loc[row, ARM_AND_BASE] = (t.loc[row - step, ARM_AND_BASE] + t.loc[row + step]) / 2
    return u


NOT_MEASURED = {
    "row 15: the angles of the arm are means of the hits around it.* row 31": lambda t: means(
        t, [15, 31, 50, 82], step=3
    ),
    "row 31: the angles of the arm are means .*row 52": lambda t: means(t, [31, 52, 77], step=1),
    "Consecutive hits of a have equal times, first in trial 5": lambda t: t.assign(
        ticks=t.ticks.mask(
            t.trial.isin([5, 9, 20]), t.groupby("trial").ticks.transform("mean").round()
        )
    ),
    "Consecutive hits of a have equal times, first in trial 14": lambda t: t.assign(
        ticks=t.ticks.mask(t.index.isin(range(40, 47)), 60)
    ),
    "of the hits of a's right hand in trials (19|20) to (27|28) .* change its scale": lambda t: (
        t.assign(right_1=t.right_1 * np.where(t.trial.between(20, 27), 1.2, 1))
    ),
    "% of the hits of a's right hand in trials 25 to 40 .* sensor .*slip": lambda t: t.assign(
        right_2=t.right_2 + 0.2 * (t.trial >= 25)
    ),
}


@pytest.mark.parametrize("cause", NOT_MEASURED)
def test_a_refusal_names_values_that_are_filled_in_or_change_at_a_trial(practised, cause):
    with pytest.raises(CoarticError, match=cause):
        checked_hits(NOT_MEASURED[cause](practised), ONE_ARM)


@pytest.mark.parametrize("decimals", [6, 3])
def test_clean_recordings_of_a_learner_and_a_planner_pass_without_a_warning(practised, decimals):
    last, rng = practised[-3:], np.random.default_rng(0)
    planner = practised.copy()
    planner[["ticks", *ARM_AND_BASE]] = np.tile(last[["ticks", *ARM_AND_BASE]], (40, 1))
    planner["ticks"] = np.rint(planner.ticks * rng.lognormal(0.2, 0.05, 120))
    planner[RIGHT_ARM] += 0.005 * rng.standard_normal((120, 4))
    for hits in (practised, planner):
        assert len(checked_hits(hits.round(decimals), ONE_ARM)) == 120


def test_hands_farther_than_two_radii_are_plausible_with_motor_noise_alone(people, read):
    noisy, joints = people.copy(), [*TASK.robot.joint_names]
    noisy[joints] += 0.02 * np.random.default_rng(0).standard_normal(noisy[joints].shape)
    assert len(read(noisy)) == len(people)  # of which one in eight is farther than two radii
    with pytest.raises(CoarticError, match="radii from its goal"):
        read(put("right_2", 30, 0.5)(noisy))
    with pytest.raises(CoarticError, match="all angles of the right arm are 0"):
        read(zeros_of("right", chosen=True)(noisy))


OF_UNITS = {
    "ticks_per_unit is 0": ({}, 0.0),
    "ticks_per_unit is -1": ({}, -1.0),
    "ticks_per_unit is nan": ({}, np.nan),
    "ticks_per_unit is inf": ({}, np.inf),
    "ticks_per_unit is 100, but .* has a column ticks": ({}, 100.0),
    "has columns ticks and duration": ({"duration": 1.5}, None),
    "Are times in ms .ticks_per_unit=0.1": ("duration", 1e3, 100.0),
    "Are times in s .ticks_per_unit=100": ("duration", 2.0, None),
    "Are times in min .ticks_per_unit=6000": ("duration", 1 / 60, 100.0),
    "median hit takes .* with 1 ticks per unit.* Are times in s .ticks_per_unit=100": (
        "duration",
        1,
        None,
    ),
    "with 1 ticks per unit.* Are times in min .ticks_per_unit=6000": ("duration", 1 / 60, None),
}


@pytest.mark.parametrize("sentence", OF_UNITS)
def test_a_wrong_unit_or_option_is_named_as_such(people, read, sentence):
    *change, unit = OF_UNITS[sentence]
    if change[0] == "duration":
        seconds = people.ticks.clip(lower=60) / 100 * change[1]
        frame = people.assign(duration=seconds).drop(columns="ticks")
    else:
        frame = people.assign(**change[0])
    with pytest.raises(CoarticError, match=sentence):
        read(frame, ticks_per_unit=unit)


TEXTS = {
    "typographic minus": lambda text: text.replace("-", "\u2212"),
    "non-breaking hyphen": lambda text: text.replace("-", "\u2011"),
    "no-break and zero-width spaces": lambda text: text.replace(",right,", ",\u00a0right\u200b,"),
    "odd blanks in headings": lambda text: text.replace("hand", "\u200bhand\u00a0", 1),
    "separator of Excel": lambda text: "sep=,\r\n" + text,
    "old lines of a Mac": lambda text: text.replace("\n", "\r"),
    "a note of two lines": lambda text: text.replace("\n", ',"one\ntwo"\n').replace(
        ',"one\ntwo"', ",note", 1
    ),
    **{f"{odd!r} in a note": lambda text, odd=odd: text.replace("\n", f",so{odd}so\n").replace(
        f"so{odd}so", "note", 1) for odd in "\x0b\x0c\x85\u2028"},
}  # fmt: skip


@pytest.mark.parametrize("form", TEXTS)
def test_text_is_read_as_unicode(people, plainly, read, form):
    pd.testing.assert_frame_equal(read(TEXTS[form](people.to_csv(index=False))), plainly)


SPOILT = {
    "line 4: left_1 is '0,5'; ',' .comma. makes it no number: write": "0,5",
    "line 4: left_1 is '45°'; '°' .degree sign. makes it no number": "45°",
    "line 4: left_1 is '1.2.3'; '.' .full stop. makes it no number": "1.2.3",
    "line 4: left_1 is '1-Feb'; it looks like a date that a spreadsheet made": "1-Feb",
    "line 4: left_1 is '0:05'; ':' .colon. makes it no number: write seconds": "0:05",
    "line 4: left_1 is '1_0'; '_' .low line. makes it no number": "1_0",
    "line 4: left_1 is 'lost'; needed is a number; leave out the row": "lost",
    "line 4: left_1 is empty; needed is a number; leave out the row": "",
}


@pytest.mark.parametrize("sentence", SPOILT)
def test_the_character_that_spoils_a_number_is_named(people, read, sentence):
    with pytest.raises(CoarticError, match=sentence):
        read(put("left_1", 2, SPOILT[sentence])(people))


def test_two_spellings_of_a_name_are_one_and_said(people, read):
    names = people.subject.map({"a": "Jos\u00e9 K", "b": "p\u22121"})
    one = people.assign(subject=names)
    odd = one.assign(subject=names.where(people.trial < 5, names.map(
        {"Jos\u00e9 K": "Jose\u0301\u00a0 K", "p\u22121": "p\u22121"})))  # fmt: skip
    for get in (read, lambda frame: solutions_of(TASK, frame)):
        with pytest.warns(UserWarning, match="'José K' is spelt in 2 ways.*Jose.u0301"):
            get(odd)
    with pytest.warns(UserWarning, match="differ in capitals alone: A, a"):
        read(people.assign(subject=people.subject.map({"a": "a", "b": "A"})))
    assert read(one).subject.unique().tolist() == ["Jos\u00e9 K", "p-1"]


def test_values_that_repeat_are_said_also_where_hits_are_refused(practised):
    with (
        pytest.raises(CoarticError, match="row 60: the hand is"),
        pytest.warns(UserWarning, match="the posture is the same in 14 of 40 hits of goal 2"),
    ):
        checked_hits(put("right_2", 60, 1.5)(filled(practised)), ONE_ARM)


def test_the_first_five_of_a_kind_are_named_and_the_others_counted(people, read):
    with pytest.raises(CoarticError, match=r"line 2: hand is 'R'.*also line 3, .*line 6, 2 more\)"):
        read(people.assign(hand=people.hand.where(people.index > 6, "R")))
    short = people.to_csv(index=False).replace(",right", "")
    with pytest.raises(CoarticError, match=r"it has 14 values.*\d+ more\)$"):
        read(short)


def test_unused_columns_are_left_out_with_one_warning_and_not_checked(read):
    task = load_task("ascending")
    people = reference.hits_of(task, CONDITIONS["EC1"], trials=3, seed=1, subject="a")
    odd = people.assign(left_1=np.nan, left_2="?", left_9=90.0, left_toe=7, note="x")
    for get in (lambda frame: read(frame, task), lambda frame: checked_hits(frame, task)):
        with pytest.warns(
            UserWarning, match="left_1 is left out.*also left_2, left_9, left_t"
        ) as said:
            given = get(odd)
        assert len(said) == 1
        pd.testing.assert_frame_equal(given, get(people))


def test_recordings_that_are_there_twice_are_said(people, read):
    again = people[(people.subject == "a") & (people.trial > 1)].assign(subject="c")
    twice = pd.concat([people, again])
    with pytest.warns(
        UserWarning, match="20 trials are equal to others.*trial 10 of a and trial 10 of c"
    ):
        read(twice)
    later = people[people.trial > 4].assign(trial=lambda t: t.trial + 50)
    with pytest.warns(UserWarning, match="26 trials are equal .* trial 10 of b and trial 60 of b"):
        solutions_of(TASK, pd.concat([people, later]))
    held = people[(people.subject == "b") & (people.trial == 6)].assign(trial=7)
    stuck = people[(people.subject != "b") | (people.trial != 7)]
    with pytest.warns(UserWarning, match="trials are equal .* trial 6 of b and trial 7 of b"):
        read(pd.concat([stuck, held]))


NO_TABLE = {
    "line 3: it has 16 values, the headings are 15: subject,": lambda text: "".join(
        line[:-1] + ",7" * (n == 2) + "\n" for n, line in enumerate(text.splitlines(True))
    ),
    "line 2: it has 14 values": lambda text: text.replace("\na,", "\n", 1),
    "line 2: it has 16 values.*also line 3": lambda text: "".join(
        {1: line[:-1] + ",7\n", 2: line.partition(",")[2]}.get(n, line)
        for n, line in enumerate(text.splitlines(True))
    ),
    "is in UTF-16, as Excel": lambda text: text.encode("utf-16"),
    "in UTF-16": lambda text: text.encode("utf-16-le"),
    "is damaged from byte": lambda text: text.encode()[:-300] + b"\0" * 300,
    "is not in UTF-8: save": lambda text: text.replace("\na,", "\nJos\xe9,").encode("latin-1"),
    "the separator is ';'.*found are subject;trial": lambda text: text.replace(",", ";"),
    "the separator is ';'": lambda text: "sep=;\n" + text.replace(",", ";"),
    r"the separator is '\\t'": lambda text: text.replace(",", "\t"),
    "is a quotation mark open": lambda text: text.replace("\na,", '\n"a,', 1),
    "two columns 'ticks'": lambda text: text.replace("goal", "ticks", 1),
    "no column subject": lambda text: "",
    "line 42: the headings are there again": lambda text: "\n".join(
        line + ("\n" + text.partition("\n")[0]) * (n == 40)
        for n, line in enumerate(text.splitlines())
    ),
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
    idle = (people.subject == "b") & (people.goal == 4) & (people.hand == "right")
    row = people.index[idle][0]
    doubtful.loc[row, ["left_1", "ticks"]] = TASK.q0[2] + 3.4, 900  # or 2.9 the other way
    with pytest.raises(CoarticError, match=rf"line {row + 2}: left_1 of subject b turns by -?\d"):
        read(doubtful)
    with pytest.raises(CoarticError, match=f"row {row}: left_1 of subject b turns"):
        solutions_of(TASK, doubtful)
    left = TASK.start.left
    away = TASK.start.model_copy(update={"left": (left[0] - 3.14, *left[1:])})
    straddling = TASK.model_copy(update={"start": away})  # from trial to trial, not hit to hit
    with pytest.raises(CoarticError, match="of subject a turns by"):
        solutions_of(straddling, people.assign(ticks=people.ticks + 400))


def test_one_armed_people_need_no_columns_of_the_other_arm(read):
    task = metres_task()
    ends = [correct(task.robot, task.q0, "right", goal, locked_base=("x", "y")).q[-2:]
            for goal in task.goals]  # fmt: skip
    rows = [["s", t, g, "right", 90, *ends[g - 1] + t / 200] for t in (1, 2) for g in (1, 2, 3)]
    names = ["subject", "trial", "goal", "hand", "ticks", "right_1", "right_2"]
    frame = pd.DataFrame(rows, columns=names)
    given = read(frame, task)
    assert len(solutions_of(task, frame).runs) == 2
    assert (given[["base_x", "base_y", "left_1"]] == 0).to_numpy().all()
    with pytest.raises(CoarticError, match="no column base_x, left_1"):
        read(frame)


def test_reader_takes_durations_and_warns_of_small_degrees(people, read):
    timed = people.assign(duration=people.ticks / 100).drop(columns="ticks")
    with pytest.raises(CoarticError, match="no column ticks.*read_hits reads a file with a dur"):
        solutions_of(TASK, timed)
    assert read(timed, ticks_per_unit=100).ticks.tolist() == people.ticks.tolist()
    with pytest.raises(CoarticError, match="in no trial are all 4 goals hit"):
        solutions_of(TASK, people[people.goal < 4])
    since_start = people.groupby(["subject", "trial"]).ticks.cumsum()
    with pytest.raises(
        CoarticError, match="of a clock that runs on; needed .* from the hit before"
    ):
        read(people.assign(ticks=since_start))
    angles = [name for name in people if name[-1].isdigit()]
    with pytest.raises(CoarticError, match="Most hits of [ab] are implausible. Angles are in rad"):
        read(people.assign(**np.degrees(people[angles] / 10)), implausible="drop")


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
