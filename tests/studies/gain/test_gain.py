"""Differences at equal gain, of planted tasks, and of every stored run in plain loops."""

import numpy as np
import pandas as pd
import pytest

from tests.support.processes import programs

(GAIN,) = programs("gain", "study")


def planted(*rows):
    """Cells of one task: name, gain and next goal nearer; other signatures are half as large."""
    cells = pd.DataFrame(rows, columns=["name", "gain", "arm"])
    others = {"other arm": cells.arm / 2, "first": cells.arm / 2, "whole": cells.gain}
    return cells.assign(group="one-armed", task="a", trials=1, **others)


@pytest.mark.parametrize(
    ("how", "gain", "at"),
    [
        ("linear", 0.0, 0.0),
        ("linear", 5.0, 1.0),
        ("linear", 15.0, 4.0),
        ("linear", 20.0, 6.0),
        ("nearest", 4.0, 0.0),
        ("nearest", 6.0, 2.0),
        ("nearest", 16.0, 6.0),
        ("same hands", 15.0, 4.0),
        ("linear", -0.1, "gain below 0"),
        ("linear", 20.1, "beyond the learner"),
    ],
)
def test_the_learner_is_interpolated_between_its_gains(how, gain, at):
    """What it does not gain is counted, and not compared."""
    learner = ("learner", 10.0, 2.0), ("learner", 20.0, 6.0)
    (row,) = GAIN.at_equal_gain(planted(*learner, ("CMA-ES", gain, 7.0)), how).to_dict("records")
    if isinstance(at, str):
        assert row["status"] == at
        assert np.isnan(row["arm"])
    else:
        assert row["status"] == "compared"
        assert (row["arm"], row["first"]) == (7.0 - at, 3.5 - at / 2)


def test_a_learner_that_gains_nothing_covers_no_gain():
    gains = [("CMA-ES", gain, 7.0) for gain in (1.0, 0.0, -1.0)]
    rows = GAIN.at_equal_gain(planted(("learner", -3.0, 2.0), *gains))
    assert rows.status.tolist() == ["beyond the learner", "beyond the learner", "gain below 0"]
    assert rows["arm"].isna().all()
    (row,) = GAIN.at_equal_gain(planted(("learner", 3.0, np.nan), gains[1])).to_dict("records")
    assert np.isnan(row["arm"])  # what is not known of the learner is not compared


def test_cells_are_means_over_runs(measured):
    """Of each run's ticks and its own signatures, in loops over runs."""
    _, study, tables = measured("gain")
    runs = [
        (named, run.task, run.trials, float(run.reward) - run.corrective_best, arm)
        for (_, run), arm in zip(study.runs.iterrows(), study.signature("arm"), strict=True)
        for named in [next(name for key, name in GAIN.NAMES.items() if run.method.startswith(key))]
    ]
    for row in tables["cells"].reset_index().to_dict("records"):
        mine = [
            measured for named, task, trials, *measured in runs
            if (task, named) == (row["task"], row["name"]) and row["trials"] in (0, trials)
        ]  # fmt: skip
        assert len(mine) in (1, 3)
        assert np.allclose(np.nanmean(mine, axis=0), (row["gain"], row["arm"]))
