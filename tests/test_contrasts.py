"""Contrasts: values, the sign test, verdicts and errors, on planted studies with a known answer."""

import math

import numpy as np
import pytest

from coartic.analysis.contrasts import check_contrasts
from coartic.analysis.optima import BestKnown
from coartic.analysis.study import contrast, later
from coartic.errors import CoarticError
from coartic.runs.contrasts import Contrast
from coartic.runs.rows import Ranked, places_of, row_names
from tests.support.made_up import change_runs, row, study_of

A, B = "hill-climbing", "random-search"
TICKS = {"quantity": "ticks", "weights": {A: 1, B: -1}}


def tasks(count, family="one-armed"):
    return [f"{family}/v1/i{number:03d}" for number in range(count)]


def planted(differences, *, family="one-armed", runs=1, world="", **more):
    """Rows in which method A takes ``difference`` ticks more than method B, task by task."""
    rows = []
    for task, difference in zip(tasks(len(differences), family), differences, strict=True):
        for run in range(runs):
            rows.append(row(B, -400, task=task, run=run, world=world, **more))
            reward = None if difference is None else -400 - difference
            rows.append(row(A, reward, task=task, run=run, world=world, **more))
    return rows


def studied(rows, **parts):
    named = {each["task"] for each in rows}
    optima = {name: BestKnown(-300, -300) for name in named}
    return study_of(rows, optima=optima, **parts)


def answered(differences, expected="above 0", **keys):
    """The only cell of a planted study."""
    table = answers_of(planted(differences), expected=expected, **keys)
    assert len(table) == 1
    return table.iloc[0]


def answers_of(rows, **keys):
    return contrast(studied(rows), **{**TICKS, **keys})


def two_sided(yes, no):
    """Exact sign test, by adding up probabilities."""
    n, k = yes + no, min(yes, no)
    return min(1.0, 2 * sum(math.comb(n, i) for i in range(k + 1)) / 2**n)


@pytest.mark.parametrize(
    ("above", "below", "equal", "verdict"),
    [(18, 2, 0, "shown"), (2, 18, 0, "opposite shown"), (10, 10, 0, "open"), (0, 0, 12, "open"),
     (6, 0, 0, "shown"), (5, 0, 0, "not tested"), (1, 0, 0, "not tested"),
     (9, 0, 11, "open"), (11, 0, 9, "shown")],
)  # fmt: skip
def test_the_sign_test_and_its_verdict(above, below, equal, verdict):
    """A verdict needs more than half of all tasks besides: nine of twenty are none."""
    cell = answered([3] * above + [-2] * below + [0] * equal)
    assert (cell.n, cell.yes, cell.equal) == (above + below + equal, above, equal)
    assert cell.p == pytest.approx(two_sided(above, below))
    assert cell.verdict == verdict
    mirrored = answered([-3] * above + [2] * below + [0] * equal, "below 0")
    assert (mirrored.yes, mirrored.p, mirrored.verdict) == (cell.yes, cell.p, verdict)


def test_within_counts_tasks_inside_the_bound():
    cell = answered([1] * 8 + [-1] * 8 + [5] * 2 + [-5] * 2, "within 2")
    assert (cell.yes, cell.verdict) == (16, "shown")
    assert cell.p == pytest.approx(two_sided(16, 4))
    spread = answered([3] * 10 + [-3] * 9 + [0], "within 2")
    assert (spread.yes, spread.verdict) == (1, "opposite shown")  # though its median is 0


def test_median_and_mean_have_intervals_over_tasks():
    values = np.random.default_rng(3).normal(5, 10, 30).round()
    cell = answered(values)
    assert (cell["median"], cell["mean"]) == (np.median(values), pytest.approx(values.mean()))
    assert cell.median_low < cell["median"] < cell.median_high
    assert cell.mean_low < cell["mean"] < cell.mean_high
    ordered = np.sort(values)  # 10th and 21st of 30: the binomial interval of the median
    assert (cell.median_low, cell.median_high) == (ordered[9], ordered[20])
    constant = answered([2] * 8)
    assert (constant.mean_low, constant.mean_high) == (2, 2)


def test_a_few_large_differences_are_told():
    cell = answered([-1] * 20 + [200] * 4)
    assert (cell.verdict, cell.note) == ("opposite shown", "mean differs from most tasks")


def test_p_is_corrected_over_the_cells_that_are_large_enough():
    sizes = {"one-armed": 12, "two-armed": 10, "aligned": 5}
    rows = [each for family, n in sizes.items() for each in planted([1] * n, family=family)]
    table = answers_of(rows, expected="above 0").set_index("family")
    assert [*table.index] == ["one-armed/v1", "two-armed/v1", "aligned/v1", "all families"]
    p = table.p_holm.to_dict()
    assert p["one-armed/v1"] == pytest.approx(2 * 2 * 0.5**12)
    assert p["two-armed/v1"] == pytest.approx(2 * 0.5**10)
    assert np.isnan(p["aligned/v1"])
    assert table.note["aligned/v1"] == "too few tasks"
    assert (table.n["all families"], table.verdict["all families"]) == (27, "")


def test_too_few_tasks_for_the_correction_are_told():
    rows = [
        each for family in ("one-armed", "two-armed") for each in planted([1] * 6, family=family)
    ]
    table = answers_of(rows, expected="above 0")
    note = "mean differs from most tasks; too few tasks for a correction over 2 cells"
    assert table.note.tolist()[:2] == [note] * 2
    assert table.verdict.tolist()[:2] == ["open"] * 2


def test_tasks_with_failed_or_missing_runs_are_dropped():
    cell = answered([1] * 19 + [None])
    assert (cell.n, cell.dropped, cell.verdict) == (19, 1, "shown")
    cell = answered([1] * 17 + [None] * 3)
    assert (cell.n, cell.verdict, cell.note) == (
        17,
        "not tested",
        "3 tasks with failed or missing runs",
    )
    rows = [
        each for each in planted([1] * 20) if each["method"] == B or each["task"] > tasks(4)[-1]
    ]
    cell = answers_of(rows, expected="above 0").iloc[0]
    assert (cell.n, cell.dropped, cell.verdict) == (16, 4, "not tested")


def test_a_value_is_a_mean_over_runs_and_one_failed_run_drops_its_task():
    rows = planted([4] * 8, runs=2)
    for each in rows:
        each["reward"] -= 10 * each["run"] * (each["method"] == A)
    cell = answers_of(rows, expected="above 8").iloc[0]
    assert (cell["median"], cell.yes) == (9, 8)
    rows[1] |= {"reward": None, "status": "crashed"}
    assert answers_of(rows, expected="above 8").iloc[0].n == 7


def test_weights_make_any_sum_and_a_single_method_is_compared_with_the_bound():
    rows = planted([30, 60] * 4) + [row("mine", -440, task=task) for task in tasks(8)]
    half = answers_of(rows, weights={"mine": 1, A: -0.5, B: -0.5})
    assert half["mean"].tolist() == [440 - (400 + 445) / 2]
    assert half.verdict.tolist() == [""]
    single = answers_of(rows, weights={"mine": 1}, expected="above 439").iloc[0]
    assert (single.yes, single.verdict) == (8, "shown")


def test_quantities_are_in_per_cent_of_their_reference(monkeypatch):
    alone = dict.fromkeys(tasks(6), -500.0)
    study = studied(planted([20] * 6), corrective_best=alone)
    for quantity, value in {"saved": 100 * (80 - 100) / 500, "gap": 100 * 20 / 300,
                            "share": 100 * -20 / 200, "ticks": 20}.items():  # fmt: skip
        table = contrast(study, quantity, {A: 1, B: -1})
        assert table["mean"].tolist() == [pytest.approx(value)]


def test_after_reads_the_best_trial_so_far():
    rows = planted([-5] * 6, trials=4)
    curves = {A: [-420, -410, np.nan, -395], B: [-405, -430, -402, -400]}
    given = [(each["run_id"], np.array(curves[each["method"]], float)) for each in rows]
    study = studied(rows, rewards=lambda: iter(given))
    change_runs(study, "budget", 4)
    for after, value in {1: 15, 2: 5, 3: 8, 4: -5}.items():
        asked = Contrast(name="x", says="", after=after, **TICKS)
        places = [place._replace(trials=4) for place in places_of(study.plan)]
        check_contrasts([asked], places)
        assert contrast(study, **TICKS, after=after)["mean"].tolist() == [value]


def test_worlds_are_cells_and_a_contrast_can_cross_them():
    rows = planted([2] * 7) + planted([-3] * 7, world="base_weight=4.0")
    table = answers_of(rows, expected="above 0").set_index("world")
    assert table.verdict.to_dict() == {"": "shown", "base_weight=4.0": "opposite shown"}
    only = answers_of(rows, expected="above 0", worlds=["base_weight=4"])
    assert (only.world.tolist(), only.p_holm.tolist()) == (["base_weight=4.0"], [2 * 0.5**7])
    across = [{"method": A, "weight": 1, "world": "base_weight=4"},
              {"method": A, "weight": -1, "world": ""}]  # fmt: skip
    crossed = answers_of(rows, weights=across, expected="below 0").iloc[0]
    assert (crossed["mean"], crossed.yes, crossed.verdict) == (-5, 7, "shown")


def test_a_task_of_no_family_has_a_row_with_an_interval_over_runs_and_no_test():
    rows = [row(method, -400 - gap - run, task="ascending", run=run)
            for method, gap in ((A, 10), (B, 0)) for run in range(6)]  # fmt: skip
    cell = answers_of(rows, expected="above 0").iloc[0]
    assert (cell.family, cell["mean"], cell.verdict) == ("ascending", 10, "")
    assert cell.mean_low < 10 < cell.mean_high


def test_learners_for_one_arm_and_for_two_are_one_row_if_their_settings_are_equal():
    one, two = "dual-process/EC1", "dual-process/EC4"
    runs = [(one, "", "a"), (two, "", "b"), (one, "epsilon=0.1", "a"), (f"{one}-informed", "", "a")]
    named = row_names([*(Ranked(*run) for run in runs), Ranked(B, "sigma=0.1", "a", "wide")])
    assert named == ["learner", "learner", "learner epsilon=0.1", "informed learner", "wide"]
    assert row_names([Ranked(one, "", "a"), Ranked(two, "", "a")]) == [one, two]


@pytest.mark.parametrize(
    ("keys", "words"),
    [({"quantity": "tick"}, "quantity 'tick' is unknown; did you mean 'ticks'"),
     ({"weights": {"hill-climbin": 1}}, "method 'hill-climbin' is unknown; did you mean"),
     ({"weights": {}}, "weights is empty"),
     ({"expected": "over 0"}, "it must be 'above B'"),
     ({"expected": "within 0"}, "it must be 'above B'"),
     ({"worlds": ["norm=maximum"]}, "world 'norm=maximum' is not in the suite; its worlds are ''"),
     ({"families": ["two-armed"]}, "family 'two-armed' is unknown"),
     ({"tasks": ["ascending"]}, "task 'ascending' is not in the suite"),
     ({"after": 5, "quantity": "first"}, "after reads only ticks, saved, gap, share"),
     ({"nam": "x"}, "nam is an unknown key; did you mean 'name'"),
     ({"weights": [{"method": A, "weight": 1, "world": ""}, {"method": B, "weight": 1}]},
      "gives a world to some methods only")],
)  # fmt: skip
def test_a_contrast_that_does_not_fit_is_refused_with_what_would(keys, words):
    with pytest.raises(CoarticError, match=words):
        answers_of(planted([1] * 6), **keys)


def test_methods_without_a_common_task_and_with_unequal_runs_are_refused():
    rows = planted([1] * 6)
    with pytest.raises(CoarticError, match="no task has all of its methods"):
        answers_of(
            [each for each in rows if (each["method"] == A) == (each["task"] < tasks(4)[-1])]
        )
    names = [Contrast(name="x", says="", **TICKS)] * 2
    with pytest.raises(CoarticError, match="contrast 'x': two contrasts have this name"):
        later(studied(rows), names)
    places = places_of(studied(rows).plan)
    uneven = [place._replace(runs=5) if place.row == A else place for place in places]
    with pytest.raises(CoarticError, match="3 and 5 runs"):
        check_contrasts(names[:1], uneven)
