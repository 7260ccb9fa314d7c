"""The rules of study noise on planted differences, and its executions of a small folder."""

import numpy as np
import pandas as pd
import pytest

from coartic import corrective_trial, execute, load_task
from coartic.analysis import load
from coartic.runs.plan import judge_seed
from tests.support.processes import ROOT, programs
from tests.support.suites import unpacked

RULES, PROTOCOLS, ORDER, WHY, MEMORY, STUDY = programs(
    "noise", "rules", "protocols", "order", "why", "memory", "study"
)
FEWER = 1_999
"""Resamples of tests."""
FAMILIES = PROTOCOLS.FAMILIES


def spread(mean, seed, sd=1.0, tasks=50):
    """Values of tasks with this mean, exactly."""
    values = np.random.default_rng(seed).normal(size=tasks)
    return mean + sd * (values - values.mean())


def by_family(*means, sd=0.5, tasks=12):
    """Differences of gaps by family and task; each family has its mean."""
    parts = {
        family: pd.Series(spread(mean, seed, sd, tasks))
        for seed, (family, mean) in enumerate(zip(FAMILIES, means, strict=True))
    }
    return pd.concat(parts, names=["family", "task"])


def test_planted_differences_have_their_verdicts():
    """Opposites of families are said; a mean that hangs on a task is open."""
    one_task = by_family(0.0, 0.0, 0.0, 0.0, 0.0, sd=0.01)
    one_task.iloc[0] = -3.0
    table = RULES.judge(
        {
            "ahead": by_family(-2, -2, -2, -2, -2),
            "behind": by_family(2, 2, 2, 2, 2),
            "opposites": by_family(-5, -5, -5, -5, 3),
            "one task": one_task,
            "nothing": by_family(-0.4, 0.4, 0.0, 0.2, -0.2),
        },
        FEWER,
    )
    assert table.verdict.to_dict() == {
        "ahead": "ahead", "behind": "behind", "opposites": "differs by family",
        "one task": "open", "nothing": "open",
    }  # fmt: skip
    assert table.difference["opposites"] == pytest.approx(-3.4)


def test_tests_of_all_methods_are_corrected_together():
    """A difference that is significant alone is not among many without one."""
    weak = by_family(*[-0.32] * 5, sd=1.0)
    assert RULES.judge({"weak": weak}, FEWER).verdict["weak"] == "ahead"
    null = {f"null {k}": by_family(*[0.0] * 5) for k in range(9)}
    assert RULES.judge({"weak": weak} | null, FEWER).verdict["weak"] == "open"


def test_levels_of_noise_are_judged_together():
    values = {0.0: spread(-2.0, 50, tasks=40), 0.01: spread(2.0, 51, tasks=40),
              0.02: spread(0.0, 52, tasks=40)}  # fmt: skip
    assert RULES.judge_levels(values, FEWER).verdict.tolist() == ["less", "more", "open"]


def rows_of(gaps, tasks=8):
    """Executions of all methods on random tasks; ``gaps`` has the four gaps of some methods."""
    rows, rng = [], np.random.default_rng(0)
    cases = {"exact": ("T", 0.0, -300), "aims": ("T", 0.01, -300), "hits": ("P", 0.01, -300),
             "practised": (np.nan, 0.01, -400)}  # fmt: skip
    for family in FAMILIES:
        for number in range(tasks):
            for label, name in ORDER.LABELS.items():
                if ("EC1" in label) != (family == "one-armed") and name.endswith("learner"):
                    continue
                method, _, setting = label.partition(" ")
                ours = gaps.get(name, (30.0, 60.0, 40.0, 50.0))
                for gap, (case, (target, noise, best)) in zip(ours, cases.items(), strict=True):
                    run = {"run_id": f"{family}{number}{label}{case == 'practised'}", "run": 0}
                    noisy = {"motor_noise": noise, "target": target, "error": 1.0 * (noise > 0)}
                    ticks = -best * (1 + gap / 100) + rng.normal()
                    rows.append(run | noisy | {
                        "task": f"{family}/v1/i{number:03d}", "method": method,
                        "setting": setting or np.nan, "best_known": best, "failures": 0,
                        "ticks": ticks, "off": 3.0 if name == "CMA-ES" else 1.0,
                        "question": "answers" if case == "practised" else "practised",
                    })  # fmt: skip
                    if case == "exact":
                        rows.append(rows[-1] | {"target": "P"})
    return pd.DataFrame(rows)


PLANTED = {
    "CMA-ES": (5.0, 70.0, 8.0, 45.0),
    "policy gradient": (6.0, 10.0, 9.0, 20.0),
    "random search": (31.0, 61.0, 45.0, 70.0),
}


def test_planted_gaps_and_verdicts_are_found():
    """The references are those of the world of practice; the learner has 40 and 50 %."""
    gaps = ORDER.read(rows_of(PLANTED))
    table = ORDER.tabulate(gaps).set_index(["group", "name"])
    for name, due in (PLANTED | {"learner": (30.0, 60.0, 40.0, 50.0)}).items():
        for group in ("all", "long"):
            row = table.loc[(group, name), :]
            assert row[[*ORDER.CASES]].tolist() == pytest.approx(due, abs=0.4)
            assert row.hits_low < row.hits < row.hits_high
    # A gap of a run has the error of one tick of 300, and a mean over 40 runs 1/sqrt(40) of it.
    assert table.aims_error["all", "learner"] == pytest.approx(100 / 300 / 40**0.5)
    verdicts = ORDER.tabulate_verdicts(gaps, FEWER).reset_index().set_index(["case", "name"])
    assert len(verdicts) == 10
    assert verdicts.verdict["hits"].to_dict() == {
        "policy gradient": "ahead", "CMA-ES": "ahead", "informed learner": "open",
        "hill climbing": "open", "random search": "behind",
    }  # fmt: skip
    assert verdicts.difference["practised", "CMA-ES"] == pytest.approx(-5.0, abs=0.3)
    families = ORDER.tabulate_families(gaps)
    assert len(families) == 50
    assert (families[families.name == "policy gradient"].ahead == 8).all()


def test_why_noise_costs():
    rows = rows_of(PLANTED)
    why = WHY.tabulate_why(ORDER.read(rows), rows)
    assert why.off.to_dict() == {name: 3.0 if name == "CMA-ES" else 1.0 for name in why.index}
    assert why.aims["CMA-ES"] == pytest.approx(3 * 65, abs=1)
    assert why.hits["CMA-ES"] == pytest.approx(3 * 3, abs=1)


def test_figure_names_each_method_at_the_end_of_its_line():
    results = ORDER.tabulate(ORDER.read(rows_of(PLANTED))).set_index("group")
    (axes,) = STUDY.draw(results).axes
    assert {text.get_text() for text in axes.texts} == {*ORDER.LABELS.values()}


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    return load(unpacked(ROOT / "tests" / "studies" / "dose", tmp_path_factory.mktemp("small")))


def test_solutions_are_executed_once_with_the_noise_of_the_judge(tmp_path, small, monkeypatch):
    """Exact ticks are the rewards, numbers of runs give the seeds, and files are not made again."""
    label = small.runs.label[small.runs.family.notna()].iloc[0]
    monkeypatch.setitem(PROTOCOLS.LABELS, label, "planted")
    PROTOCOLS.execute_practised(small, tmp_path, repeats=3)
    files = sorted(tmp_path.iterdir())
    rows = pd.concat(map(pd.read_csv, files))
    exact = rows[(rows.motor_noise == 0) & (rows.target == "T")]
    assert (exact.ticks == -exact.reward).all()
    assert len(rows) == 4 * len(exact) > 0
    row = rows[(rows.motor_noise > 0) & (rows.target == "T")].iloc[0]
    solution = small.movements()[row.run_id]
    seed = judge_seed(0, row.task, row.run)
    due = PROTOCOLS.execute_noisy(small.tasks[row.task], [solution], 0.01, 3, seed)[0]
    assert [row.ticks, row.error] == pytest.approx([due.mean(), due.std() / 3**0.5])
    before = [file.stat().st_mtime_ns for file in files]
    files[0].unlink()
    PROTOCOLS.execute_practised(small, tmp_path, repeats=3)
    pd.testing.assert_frame_equal(rows, pd.concat(map(pd.read_csv, files)))
    assert [file.stat().st_mtime_ns for file in files[1:]] == before[1:]


def test_a_failed_execution_counts_as_twice_the_corrective_process(monkeypatch):
    task = load_task("ascending")
    monkeypatch.setattr(PROTOCOLS, "execute_noisy", lambda *_: np.array([[300.0, np.nan]]))
    row = PROTOCOLS.executions(task, {"a": ()}, {"a": 0}, 0.01, 2).iloc[0]
    assert (row.ticks, row.failures) == ((300 + 2 * 319) / 2, 1)


def test_postures_are_aimed_at():
    """Movements to the postures of hits hit where the solution does."""
    task = load_task("two-armed-2")
    solution = corrective_trial(task, "LRLR").movements
    due = execute(task, solution)
    postures = PROTOCOLS.to_postures(task, solution)
    np.testing.assert_array_equal([each.target for each in postures], due.configurations)
    assert execute(task, postures).hands == "LRLR"
    assert PROTOCOLS.off_centre(task, postures) > 0.5
    assert np.isnan(PROTOCOLS.off_centre(task, solution))


def test_hands_weigh_in_memory_as_in_the_learner():
    task, rows = "two-armed/v1/i160", []
    for hands, ticks in (("RR", 300), ("LR", 360)):
        for how, change in (("", 0), (", stages=1000, keep=postures", -30),
                            (", stages=1000, keep=targets", -60)):  # fmt: skip
            rows.append({"run_id": f"{hands}{change}", "motor_noise": 0.0, "task": task,
                         "setting": f"hands={hands}{how}", "ticks": ticks + change})  # fmt: skip
    hands = pd.DataFrame({"task": task, "hands": ["RR", "LR"], "count": [2, 1]}).set_index("task")
    values = MEMORY.read_memory(pd.DataFrame(rows), hands).set_index(["stages", "keep"]).ticks
    assert values[1, "postures"] == values[1, "targets"] == pytest.approx(320)
    assert values[1000, "postures"] == pytest.approx(290)
    assert values[1000, "targets"] == pytest.approx(260)


def test_tables_are_made_from_the_rows_that_ship(tmp_path):
    """But p-values, which have fewer resamples here, and verdicts that hang on these."""
    folder = ROOT / "studies" / "noise"
    rows = pd.read_csv(folder / "runs.csv.xz", low_memory=False).set_index("run_id")
    hands = pd.read_csv(folder / "hands.csv", index_col=0)
    for name, table in STUDY.tables_of(rows, hands, FEWER).items():
        table.to_csv(tmp_path / "table.csv", float_format="%.6g")
        ours, due = (pd.read_csv(path, index_col=0)
                     for path in (tmp_path / "table.csv", folder / f"{name}.csv"))  # fmt: skip
        kept = [column for column in due if column not in ("p", "p_without")]
        if name == "memory_verdicts":
            kept.remove("verdict")
        pd.testing.assert_frame_equal(ours[kept], due[kept], rtol=1e-4, atol=1e-4)
