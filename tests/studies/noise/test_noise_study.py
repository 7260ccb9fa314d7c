"""The rules of study noise on planted differences, and its executions of a small folder."""

from itertools import product

import numpy as np
import pandas as pd
import pytest

from coartic import corrective_trial, execute, load_task
from coartic.analysis import load
from coartic.baselines.cma_es import CMAES
from tests.support.processes import ROOT, programs
from tests.support.strategies import solve
from tests.support.suites import unpacked

RULES, PROTOCOLS, ORDER, WHY, LEARNING, IN_NOISE = programs(
    "noise", "rules", "protocols", "order", "why", "learning", "in_noise"
)


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
        (("kept, smaller", "kept, larger"), "kept"),
        (("reversed", "open"), "open"),
    ],
)
def test_what_verdicts_have_in_common(verdicts, due):
    assert RULES.common(*verdicts) == due


def test_a_significant_change_that_enlarges_a_lead_does_not_make_it_smaller():
    assert RULES.verdict(1.0, 2.0, (True, False, True)) == "open"
    assert RULES.verdict(1.0, 0.2, (True, False, True)) == "smaller"
    assert RULES.verdict(1.0, -0.2, (True, False, True)) == "smaller"


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


def test_planted_gaps_are_found_and_a_method_does_not_win_by_failing(tmp_path):
    rows = rows_of({"CMA-ES": (10.0, 20.0), "learner": (20.0, 40.0)})
    fails = (rows.method == "cma-es/bandit") & (rows.motor_noise > 0)
    rows.loc[fails, "failures"] = 100
    rows.loc[fails, "ticks"] = np.nan
    gaps, pairs = tables_of(rows, tmp_path)
    assert pairs.verdict["learner, CMA-ES"] == "reversed"
    assert pairs.verdict["hill climbing, random search"] == "open"
    assert (len(pairs), pairs.open_loop.sum()) == (28, 7)
    of = gaps[(gaps.name == "learner") & ~gaps.signal_dependent].set_index("motor_noise")
    assert of.gap.tolist() == pytest.approx([20, 40], abs=0.1)
    assert (of.gap_low < of.gap).all()
    failed = gaps[(gaps.name == "CMA-ES") & (gaps.motor_noise > 0)].failures
    assert failed.tolist() == [40 * 100] * 2


def test_solutions_are_executed_once(tmp_path):
    (tmp_path / "small").mkdir()
    study = load(unpacked(ROOT / "tests" / "studies" / "dose", tmp_path / "small"))
    folder = tmp_path / "order"
    PROTOCOLS.execute_order(study, folder, levels=(0.0, 0.01), repeats=3)
    files = sorted(folder.iterdir())
    rows = pd.concat(map(pd.read_csv, files)).set_index("run_id")
    exact = rows[rows.motor_noise == 0]
    assert (exact.ticks == -exact.reward).all()
    assert len(rows) == 3 * len(exact)
    before = [file.stat().st_mtime_ns for file in files]
    files[0].unlink()
    PROTOCOLS.execute_order(study, folder, levels=(0.0, 0.01), repeats=3)
    again = pd.concat(map(pd.read_csv, files)).set_index("run_id")
    pd.testing.assert_frame_equal(rows, again)
    assert [file.stat().st_mtime_ns for file in files[1:]] == before[1:]


def test_postures_and_centres_are_aimed_at():
    """Movements to the postures of hits hit where the solution does; moved to the centre, the hand
    is there to the tolerance of the corrective process."""
    task = load_task("two-armed-2")
    solution = corrective_trial(task, "LRLR").movements
    due = execute(task, solution)
    postures = PROTOCOLS.to_postures(task, solution, at_centre=False)
    np.testing.assert_array_equal([each.target for each in postures], due.configurations)
    assert execute(task, postures).hands == "LRLR"
    assert PROTOCOLS.off_centre(task, postures) > 0.5
    centred = PROTOCOLS.to_postures(task, solution, at_centre=True)
    assert 0 < PROTOCOLS.off_centre(task, centred) * task.radius <= 0.01
    assert np.isnan(PROTOCOLS.off_centre(task, solution))


def straight_rows(saved, cost):
    """Executions of a method that aims, for which the centre saves a share of the cost of noise."""
    every = product(PROTOCOLS.FAMILIES, range(8), "TPC", (0.0, 0.01))
    rows = pd.DataFrame(every, columns=["family", "number", "target", "motor_noise"])
    of_noise = (rows.motor_noise > 0) * cost * (1 - saved * (rows.target == "C"))
    noise = np.random.default_rng(1).normal(size=len(rows))
    number = rows.number.astype(str)
    return rows.assign(ticks=300 + 40 * rows.number + of_noise + noise, failures=0, off=0.97,
                       run_id=rows.family + number, task=rows.family + "/v1/i00" + number,
                       method="cma-es/bandit", setting=np.nan)  # fmt: skip


@pytest.mark.parametrize(
    ("saved", "cost", "due"),
    [
        (0.8, 20, "aim"),
        (0.2, 20, "posture"),
        (0.49, 20, "undecided"),
        (0.51, 20, "undecided"),
        (0.8, 1.2, "not judged"),
    ],
)
def test_what_the_centre_saves(tmp_path, saved, cost, due):
    """Whole intervals decide: of the share beyond one half, of the cost above one tick."""
    rows = straight_rows(saved, cost)
    rows.loc[rows.run_id == "long3", "failures"] = 1  # a run that fails is left out
    rows.to_csv(tmp_path / "rows.csv", index=False)
    row = WHY.tabulate_why(WHY.read(tmp_path)).loc["CMA-ES"]
    assert row.verdict == due
    assert (row.runs, row.left_out, row.at_centre) == (39, 1, False)
    assert row.cost == pytest.approx(cost, abs=0.5)
    if cost == 20:
        assert row.share == pytest.approx(saved, abs=0.05)
        assert row.share_low < row.share < row.share_high


def test_hands_weigh_in_memory_as_in_the_learner(tmp_path):
    task, rows = "two-armed/v1/i160", []
    for hands, ticks in (("RR", 300), ("LR", 360)):
        for how, change in (("", 0), (", stages=1000, keep=postures", -30),
                            (", stages=1000, keep=targets", -60)):  # fmt: skip
            rows.append({"run_id": f"{hands}{change}", "motor_noise": 0.0, "task": task,
                         "setting": f"hands={hands}{how}", "method": "random-search",
                         "ticks": ticks + change, "failures": 0})  # fmt: skip
    rows.append(rows[-1] | {"run_id": "fails", "ticks": np.nan, "failures": 2})
    pd.DataFrame(rows).to_csv(tmp_path / "rows.csv", index=False)
    learner = pd.DataFrame({"task": task, "hands": ["RR", "RR", "LR"]})
    values = LEARNING.read_memory(tmp_path, learner).set_index(["stages", "keep"]).ticks
    assert values[1, "postures"] == values[1, "targets"] == pytest.approx(320)
    assert values[1000, "postures"] == pytest.approx(290)
    # The run that fails counts as the worst of the task, 360, in the mean of its hands.
    assert values[1000, "targets"] == pytest.approx((2 * 240 + (300 + 360) / 2) / 3)


def learning_rows(gaps):
    """Executions of all methods of question 4; ``gaps`` has, by name, the gap after practice and
    execution at 0, and at 0.01."""
    noisy, rows, rng = "0.0509901951359278", [], np.random.default_rng(2)
    settings = {
        "dual-process/EC4": ("", f"noise_sd={noisy}"), "hill-climbing": ("", f"sigma={noisy}"),
        "random-search": ("", f"sigma={noisy}"),
        "random-search 1000": ("stages=1000", f"sigma={noisy}, stages=1000"),
        "cma-es/in-noise": ("motor_noise=0.0", ""),
    }  # fmt: skip
    for family, number, key, practice, level in product(
        PROTOCOLS.FAMILIES, range(10), settings, (0, 1), (0, 1)
    ):
        gap = gaps.get(LEARNING.METHODS[key], (30.0, 45.0))[level]
        rows.append({
            "run_id": f"{len(rows)}", "motor_noise": 0.01 * level, "run": 0,
            "ticks": 300 * (1 + gap / 100) + rng.normal() - 2 * practice * level,
            "action": "next action", "failures": 0, "setting": settings[key][practice],
            "task": f"{family}/v1/i{160 + number}", "best_known": -250,
            "method": key.partition(" ")[0],
        })  # fmt: skip
    return pd.DataFrame(rows)


def test_planted_practice_and_order_are_found(tmp_path):
    rows = learning_rows({"CMA-ES": (10.0, 40.0), "learner": (20.0, 30.0)})
    for part, some in (("learning", rows[10:]), ("handler", rows[:10])):
        (tmp_path / f"{part}-executed").mkdir()
        some.to_csv(tmp_path / f"{part}-executed" / "rows.csv", index=False)
    made = LEARNING.read_learning(tmp_path)
    assert (made[made.motor_noise == 0].groupby("task").gap.min() == 0).all()
    assert set(made.groupby("name").practice.nunique()) == {2}
    pairs = LEARNING.tabulate_learning_pairs(made, FEWER)
    assert len(pairs) == 10
    assert pairs.verdict["learner; CMA-ES"] == "reversed"
    practice = LEARNING.tabulate_practice(made, FEWER).set_index("name")
    # Two ticks less, of some 330.
    assert practice.change["CMA-ES"] == pytest.approx(-0.6, abs=0.2)
    assert practice.change_high["CMA-ES"] < 0
    table = LEARNING.tabulate_learning(made).set_index(["name", "practice", "motor_noise"])
    change = table.gap["learner", 0.0, 0.01] - table.gap["learner", 0.0, 0.0]
    assert change == pytest.approx(100 * 30 / 330, abs=0.7)


def test_practice_without_noise_is_that_of_cma_es():
    """Without noise the method makes the trials of CMA-ES. Its next action is where it searched."""
    due, _, first = solve(CMAES, "ascending", 3, trials=300)
    made, _, second = solve(IN_NOISE.CMAESInNoise, "ascending", 3, trials=300, motor_noise=0.0)
    assert first.rewards == second.rewards
    assert [*map(str, made.solution)] == [*map(str, due.solution)]
    assert -execute("ascending", made.replay).reward < 319


def test_a_noise_handler_stays_within_its_trials():
    made, _, session = solve(IN_NOISE.CMAESWithHandler, "ascending", 3, trials=700, hands="RRR")
    assert 600 < session.trials_made <= 700
    assert -execute("ascending", made.replay).reward < 319
