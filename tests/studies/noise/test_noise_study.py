"""The rules of study noise on planted differences, and its executions of a small folder."""

import numpy as np
import pandas as pd
import pytest

from coartic.analysis import load
from coartic.estimates import Estimate
from tests.support.processes import ROOT, programs
from tests.support.suites import unpacked

RULES, PROTOCOLS, ORDER = programs("noise", "rules", "protocols", "order")


FEWER = 1_999
"""Resamples of tests."""


def spread(mean, seed, sd=1.0, tasks=50):
    """Values of tasks with this mean, exactly."""
    values = np.random.default_rng(seed).normal(size=tasks)
    return mean + sd * (values - values.mean())


def planted(before, after, seed):
    return RULES.Pair(spread(before, seed), spread(after, seed + 1))


PLANTED = {
    "kept": planted(2.0, 2.05, 0),
    "kept, smaller": planted(-4.0, -1.0, 2),
    "kept, larger": planted(1.0, 4.0, 4),
    "reversed": planted(3.0, -3.0, 6),
    "smaller": planted(3.0, 0.01, 8),
    "new": planted(0.01, -3.0, 10),
    "open": planted(0.02, 0.03, 12),
}


def test_planted_pairs_have_their_verdicts():
    table = RULES.judge(PLANTED, FEWER)
    assert table.verdict.to_dict() == {name: name for name in PLANTED}
    assert table.all_tasks.tolist() == table.without.tolist()
    assert table.ratio["kept, smaller"] == pytest.approx(0.25)
    assert table.ratio[["new", "open"]].isna().all()


def test_tests_of_all_pairs_are_corrected_together():
    """A difference that is significant alone is not among many pairs without one."""
    weak = RULES.Pair(spread(0.44, 20), spread(0.44, 21))
    alone = RULES.judge({"weak": weak}, FEWER)
    null = {f"null {k}": planted(0.0, 0.0, 30 + 2 * k) for k in range(27)}
    among = RULES.judge({"weak": weak} | null, FEWER)
    assert alone.verdict["weak"] == "kept"
    assert among.verdict["weak"] == "open"


def test_a_verdict_that_hangs_on_a_task_is_open():
    values = spread(0.2, 1, sd=0.5, tasks=40)
    table = RULES.judge({"as before": RULES.Pair(values, values)}, FEWER)
    assert table.all_tasks["as before"] == "kept"
    assert table.verdict["as before"] == table.without["as before"] == "open"


@pytest.mark.parametrize(
    ("verdicts", "due"),
    [
        (("new", "new"), "new"),
        (("kept, smaller", "kept"), "kept"),
        (("kept, smaller", "kept, larger"), "kept"),
        (("kept", "smaller"), "open"),
        (("reversed", "open"), "open"),
    ],
)
def test_what_verdicts_have_in_common(verdicts, due):
    assert RULES.common(*verdicts) == due


def test_a_significant_change_that_enlarges_a_lead_does_not_make_it_smaller():
    assert RULES.verdict(1.0, 2.0, (True, False, True)) == "open"
    assert RULES.verdict(1.0, 0.2, (True, False, True)) == "smaller"
    assert RULES.verdict(1.0, -0.2, (True, False, True)) == "smaller"


@pytest.mark.parametrize(
    ("share", "cost", "due"),
    [
        ((0.8, 0.6, 0.9), (20.0, 15.0, 25.0), "aim"),
        ((0.3, 0.1, 0.45), (20.0, 15.0, 25.0), "posture"),
        ((0.6, 0.45, 0.7), (20.0, 15.0, 25.0), "undecided"),
        ((0.8, 0.6, 0.9), (1.5, 1.0, 2.0), "not judged"),
        ((0.8, 0.6, 0.9), (1.5, np.nan, np.nan), "not judged"),
    ],
)
def test_what_is_fragile(share, cost, due):
    assert RULES.fragile(Estimate(*share), Estimate(*cost)) == due


def test_levels_of_noise_are_judged_together():
    values = {0.0: spread(-2.0, 50, tasks=40), 0.01: spread(2.0, 51, tasks=40),
              0.02: spread(0.0, 52, tasks=40)}  # fmt: skip
    assert RULES.judge_levels(values, FEWER).verdict.tolist() == ["less", "more", "open"]


def rows_of(gaps, tasks=8):
    """Rows of executions of all methods of the study on random tasks; ``gaps`` has, by method, the
    gap at 0 and at 0.01, in per cent."""
    rows, rng = [], np.random.default_rng(0)
    for family in PROTOCOLS.FAMILIES:
        for number in range(tasks):
            for method, name in ORDER.NAMES.items():
                if ("EC1" in method) != (family == "one-armed") and name.endswith("learner"):
                    continue
                for level, gap in zip((0.0, 0.01), gaps.get(name, (30.0, 60.0)), strict=True):
                    for dependent in (False, True) if level else (False,):
                        rows.append({
                            "run_id": f"{len(rows):016x}-1", "motor_noise": level,
                            "signal_dependent": dependent,
                            "ticks": 300 * (1 + gap / 100) + rng.normal(), "failures": 0,
                            "task": f"{family}/v1/i{number:03d}", "method": method,
                            "setting": np.nan, "run": 0, "best_known": -300,
                        })  # fmt: skip
    return pd.DataFrame(rows)


def tables_of(rows, folder):
    rows.to_csv(folder / "rows.csv", index=False)
    read = ORDER.read(folder)
    return ORDER.tabulate_gaps(read), ORDER.tabulate_pairs(read, FEWER)


def test_planted_gaps_are_found_and_their_order_judged(tmp_path):
    gaps, pairs = tables_of(rows_of({"CMA-ES": (10.0, 50.0), "learner": (20.0, 40.0)}), tmp_path)
    of = gaps[(gaps.name == "CMA-ES") & ~gaps.signal_dependent].set_index("motor_noise")
    assert of.gap.tolist() == pytest.approx([10, 50], abs=0.1)
    assert (of.gap_low < of.gap).all()
    assert len(pairs) == 28
    assert pairs.verdict["learner, CMA-ES"] == "reversed"
    assert pairs.verdict["hill climbing, random search"] == "open"
    assert pairs.open_loop.sum() == 7


def test_a_method_does_not_win_by_failing(tmp_path):
    rows = rows_of({"CMA-ES": (10.0, 20.0), "learner": (20.0, 40.0)})
    fails = (rows.method == "cma-es/bandit") & (rows.motor_noise > 0)
    rows.loc[fails, "failures"] = 100
    rows.loc[fails, "ticks"] = np.nan
    gaps, pairs = tables_of(rows, tmp_path)
    assert pairs.verdict["learner, CMA-ES"] == "reversed"
    failed = gaps[(gaps.name == "CMA-ES") & (gaps.motor_noise > 0)].failures
    assert failed.tolist() == [40 * 100] * 2


def test_solutions_are_executed_once(tmp_path):
    (tmp_path / "small").mkdir()
    study = load(unpacked(ROOT / "tests" / "studies" / "dose", tmp_path / "small"))
    folder = tmp_path / "order"
    PROTOCOLS.execute_study(study, folder, levels=(0.0, 0.01), repeats=3)
    files = sorted(folder.iterdir())
    rows = pd.concat(map(pd.read_csv, files)).set_index("run_id")
    exact = rows[rows.motor_noise == 0]
    assert (exact.ticks == -exact.reward).all()
    assert len(rows) == 3 * len(exact)
    before = [file.stat().st_mtime_ns for file in files]
    files[0].unlink()
    PROTOCOLS.execute_study(study, folder, levels=(0.0, 0.01), repeats=3)
    again = pd.concat(map(pd.read_csv, files)).set_index("run_id")
    pd.testing.assert_frame_equal(rows, again)
    assert [file.stat().st_mtime_ns for file in files[1:]] == before[1:]
