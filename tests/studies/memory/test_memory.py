"""Scales, places and what is left at equal gain, of planted cells."""

import importlib

import numpy as np
import pandas as pd
import pytest

from coartic.analysis.statistics import bootstrap_test
from tests.support.processes import ROOT, programs

NAMES = "cells", "scales", "equal_gain", "study", "one_selection", "hands"
CELLS, SCALES, EQUAL, STUDY, ONE, OF_HANDS = programs("memory", *NAMES)
OF_OTHERS = importlib.import_module("scales")  # as the other programs import it
STAGES = SCALES.STAGES


@pytest.fixture(autouse=True)
def _fewer_resamples(monkeypatch):
    """On which no mean and no verdict here depends."""
    for module in (OF_OTHERS, SCALES, ONE):
        monkeypatch.setattr(module, "RESAMPLES", 499)


def planted(of_stages, learner, families=("aligned", "long"), tasks=6, noise=0.0):
    """Cells of random search with these values by number of stages, and of the learner; next goal
    nearer is half the gain. Tasks differ by ``noise``, from which no difference follows."""
    rows = []
    rng = np.random.default_rng(0)
    for family in families:
        for number in range(tasks):
            own = noise * rng.normal()
            cells = [("compared", 0, learner), ("learner", 0, learner)]
            cells += [(keep, stages, value) for keep in CELLS.KEEPS
                      for stages, value in zip(STAGES, of_stages, strict=True)]  # fmt: skip
            rows += [
                {"group": family, "task": f"{family}/v1/i{number:03d}", "name": name,
                 "trials": 10_000, "stages": stages, "gain": value + own, "first": value / 2,
                 "arm": value / 2, "other arm": value / 100}
                for name, stages, value in cells
            ]  # fmt: skip
    return pd.DataFrame(rows)


RISING = [0.0, 10.0, 20.0, 30.0, 40.0, 41.0, 42.0]


def test_a_scale_is_level_where_nothing_exceeds_the_bound():
    scale = SCALES.Scale(planted(RISING, 35.0, noise=5.0), "gain", "postures")
    assert scale.means[30] - scale.means[1] == pytest.approx(40)
    assert [scale.level(bound) for bound in (0.5, 1.5, 2.5, 13.0, 100.0)] == [1000, 100, 30, 10, 1]
    assert [*scale.difference(1000, 1).columns("of").values()] == pytest.approx([42, 42, 42])
    assert scale.slopes().to_numpy() == pytest.approx(
        np.polyfit(np.log10(STAGES), RISING, 1)[0], rel=1e-9
    )


@pytest.mark.parametrize(
    ("learner", "place", "where"),
    [
        (-1.0, 1.0, "below"),
        (35.0, np.sqrt(10 * 30), "below"),
        (40.5, np.sqrt(30 * 100), "level"),
        (50.0, np.inf, "above"),
    ],
)
def test_the_learner_has_a_place_on_the_scale(learner, place, where):
    scale = SCALES.Scale(planted(RISING, learner), "gain", "targets")
    assert [*scale.place().columns("of").values()] == pytest.approx([place] * 3)
    assert SCALES.where(scale, 5.0) == where


def test_families_weigh_the_same_whatever_their_tasks():
    cells = planted(RISING, 0.0)
    cells.loc[cells.group == "long", "gain"] += 8
    fewer = cells[~cells.task.isin(["long/v1/i000", "long/v1/i001"])]
    for each in (cells, fewer):
        scale = SCALES.Scale(each, "gain", "postures")
        assert scale.means["learner"] == pytest.approx(4)
    assert len(scale.table) == 10


def test_a_spread_between_families_is_no_spread_of_a_difference():
    cells = planted(RISING, 30.0)
    more = (cells.group == "long") & (cells.name == "compared")
    cells.loc[more, "gain"] += 20
    values = SCALES.Scale(cells, "gain", "postures").more("learner", 1000)
    assert values.to_numpy() == pytest.approx(30 + 10 - 42)


@pytest.mark.parametrize(
    ("gain", "arm", "status"),
    [
        (0.0, 0.0, "compared"),
        (15.0, 4.0, "compared"),
        (20.0, 6.0, "compared"),
        (-0.1, None, "gain below 0"),
        (20.1, None, "beyond the learner"),
    ],
)
def test_the_learner_is_interpolated_between_its_gains(gain, arm, status):
    """What the learner does not gain is counted, and not compared."""
    rows = [
        ("learner", 10.0, 2.0),
        ("learner", 20.0, 6.0),
        ("learner", -3.0, 9.0),
        ("a", gain, 7.0),
    ]
    cells = pd.DataFrame(rows, columns=["name", "gain", "arm"])
    others = {"other arm": cells.arm / 2, "first": cells.arm / 2, "stages": 0}
    (row,) = EQUAL.at_equal_gain(cells.assign(group="long", task="x", **others)).to_dict("records")
    assert row["status"] == status
    expected = np.nan if arm is None else arm
    assert row["learner arm"] == pytest.approx(expected, nan_ok=True)
    assert row["learner first"] == pytest.approx(expected / 2, nan_ok=True)


def runs(**columns):
    return pd.DataFrame({"group": "long", "task": "t", "first": 1.0, "arm": 2.0, **columns})


def test_random_search_has_the_hands_of_the_learner():
    """Weighted by its runs; hands of fewer than a tenth of them do not count."""
    hands, gain = ["RR"] * 12 + ["RL"] * 6 + ["LL"], [9.0] * 12 + [3.0] * 6 + [50.0]
    learner = runs(name="learner", trials=10_000, stages=np.nan, keep=None, hands=hands, gain=gain)
    learner["other arm"] = np.where(learner.hands == "RR", np.nan, 0.5)
    search = runs(name="random search", trials=10_000, stages=1, keep="postures",
                  hands=["RR", "RR", "RL", "LL"], gain=[2.0, 4.0, 9.0, 70.0])  # fmt: skip
    search["other arm"] = [np.nan, np.nan, 0.25, 0.75]
    cells = CELLS.measure_cells(pd.concat([learner, search]))
    table = cells.set_index("name")[["gain", "other arm"]]
    assert table.loc["compared"].tolist() == pytest.approx([7.0, 0.5])
    for keep in CELLS.KEEPS:  # with one part both are the same
        assert table.loc[keep].tolist() == pytest.approx([(2 * 3 + 9) / 3, 0.25])


def test_a_mean_of_unequal_families_is_tested_at_its_level():
    """At its bound the test rejects in 5 % of planted studies; of 200 in at most 9.6 % (three
    standard errors). Families are as large as those of tasks with an idle hand, and the smallest
    has the largest spread: with the spread of pooled tasks it would be 15 %."""
    rng, sizes, spreads = np.random.default_rng(0), [32, 12, 27, 34], [1.0, 2.5, 1.0, 0.8]
    families, ends = pd.Series(np.repeat([*"abcd"], sizes)), np.cumsum(sizes)[:-1]
    means = np.repeat([1.0, 2.0, -1.0, -2.0], sizes)  # their mean over families is 0
    p = []
    for _ in range(200):
        values = means + rng.normal(size=len(means)) * np.repeat(spreads, sizes)
        tested = SCALES.by_task(pd.Series(values), families)
        of_families = [part.mean() for part in np.split(values, ends)]
        assert tested.mean() == pytest.approx(np.mean(of_families))
        p.append(bootstrap_test(tested, 0.0, resamples=199).p)
    assert 0.004 < np.mean(np.array(p) <= 0.05) < 0.096


def test_tables_are_made_from_the_rows_that_ship(monkeypatch):
    """How methods differ from the learner at equal gain, of one method. Intervals of two tables are
    of all resamples; ends of the others are near."""
    folder = ROOT / "studies" / "memory"

    def shipped(name):
        return pd.read_csv(folder / f"{name}.csv", index_col=0)

    cells, due = shipped("cells"), {"equal": shipped("equal").query("name == 'posture QP'")}
    with monkeypatch.context() as patch:
        for module in (OF_OTHERS, SCALES):
            patch.setattr(module, "RESAMPLES", 9_999)
        equal = EQUAL.tabulate_equal(cells[cells.name.isin(["learner", "posture QP"])])
        exact = {"equal": equal, "keeping": SCALES.tabulate_keeping(cells)}
    monkeypatch.setattr(STUDY, "tabulate_equal", lambda _: equal)
    made = STUDY.tables_of(cells, pd.read_csv(folder / "runs.csv.xz", index_col=0))
    made["one_selection"] = ONE.tabulate(pd.read_csv(folder / "one_selection.csv.xz", index_col=0))
    made["hands"] = OF_HANDS.tabulate(pd.read_csv(folder / "hands.csv.xz"))
    resampled = r"_(low|high)$|^level$|^where$|^p_|_p_|evidence"
    for name, ours in made.items():
        theirs = due.get(name, shipped(name)).dropna(axis=1, how="all")
        for low in theirs.filter(regex="_low$"):
            high = low.removesuffix("low") + "high"
            level = np.log if low.startswith("place") else np.asarray  # those can be infinite
            with np.errstate(invalid="ignore"):
                width = level(theirs[high]) - level(theirs[low])
                for end in (low, high):  # of 499 resamples, for 9,999
                    off = np.abs(level(ours[end]) - level(theirs[end]))
                    assert not (off > 0.2 * width + 1e-4).any(), (name, end)
        if name in exact:
            ours = exact[name]
        else:
            ours, theirs = (t.drop(columns=t.filter(regex=resampled)) for t in (ours, theirs))
        pd.testing.assert_frame_equal(
            ours, theirs, rtol=1e-4, atol=1e-4, check_dtype=False, check_like=True
        )
