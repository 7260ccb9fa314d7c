"""Suites, and the cells they come to."""

from fnmatch import fnmatch

import pytest

from coartic import CoarticError, load_task
from coartic.benchmarks.runner import plan_suite
from coartic.benchmarks.suites import suites
from tests.support.bad_inputs import GOOD
from tests.support.suites import KNOWN, cells_of, paper_cells, suite_of


def test_every_method_runs_in_some_suite():
    blocks = [block for suite in suites().values() for block in suite.blocks]
    patterns = {pattern for block in blocks for pattern in block.methods}
    run = {name for name in KNOWN for pattern in patterns if fnmatch(name, pattern)}
    missing = ", ".join(sorted({*KNOWN} - run))
    assert not missing, f"add a block with {missing} to benchmarks/suites/ablations.toml"


ASCENDING = 'tasks = ["ascending"]\nmethods = ["dual-process/EC1"]\n'
EVERY = 'tasks = ["*"]\nmethods = ["dual-process/EC1"]\n'


def test_suite_ablations_frees_the_base(tmp_path):
    cells = cells_of("ablations")
    tasks = {cell.task.name: cell.task for cell in cells}
    free, rail = tasks["two-armed-1.free-base"], tasks["two-armed-1"]
    assert (free.locked_base, rail.locked_base) == ((), ("y",))
    assert free.provenance["locked_base"].status == "chosen"
    same = {"goals", "start", "hands", "radius", "initial_hands"}
    assert free.model_dump(include=same) == rail.model_dump(include=same)
    with pytest.raises(CoarticError, match="free_base has no effect on task 'ascending'"):
        suite_of(tmp_path, ASCENDING + "free_base = true")


def test_grid_and_fixed_parameters(tmp_path):
    grid = "parameters = { trials = 40 }\ngrid = { noise_sd = [0.02, 0.1], epsilon = [0.0, 0.5] }"
    cells = suite_of(tmp_path, ASCENDING + grid)
    assert [cell.setting for cell in cells] == [
        "trials=40, epsilon=0.0, noise_sd=0.02",
        "trials=40, epsilon=0.5, noise_sd=0.02",
        "trials=40, epsilon=0.0, noise_sd=0.1",
        "trials=40, epsilon=0.5, noise_sd=0.1",
    ]


def test_cells_are_distinguished_by_their_parameters(tmp_path):
    """Different parameters are different cells, compared with the paper only as it had them."""
    asked = suite_of(
        tmp_path,
        ASCENDING,
        ASCENDING + "parameters = { noise_sd = 0.5 }",
        ASCENDING + "parameters = { noise_sd = 0.05 }",  # the default: the first cell again
        ASCENDING + "parameters = { trials = 20 }",
        EVERY,
    )
    labels = [(cell.task.name, cell.setting) for cell in asked]
    assert labels[:3] == [("ascending", each) for each in ("", "noise_sd=0.5", "trials=20")]
    assert len(labels) == len(set(labels)) == 6


def test_a_cell_has_one_number_of_runs(tmp_path):
    with pytest.raises(CoarticError, match="EC1 on ascending: .* 3 runs,.* for 7"):
        suite_of(tmp_path, ASCENDING, ASCENDING + "runs = 7")
    (job,) = plan_suite(tmp_path / "own.toml", runs=2)
    assert job.numbers == range(2)
    task = tmp_path / "mine.toml"
    task.write_text(GOOD, encoding="utf-8")
    suite_of(tmp_path, EVERY + "runs = 7")
    jobs = plan_suite(tmp_path / "own.toml", tasks=[task])
    assert {len(job.numbers) for job in jobs if job.cell.task.name == "mine"} == {7}


def test_own_task_runs_under_every_applicable_condition(tmp_path):
    path, other = tmp_path / "mine.toml", tmp_path / "arm.toml"
    path.write_text(GOOD, encoding="utf-8")
    other.write_text('hands = ["right"]\n' + GOOD.replace("mine", "arm"), encoding="utf-8")

    def methods(path, **selection):
        cells = paper_cells(tasks=[path], **selection)
        return [cell.method.name for cell in cells]

    baseline = ["corrective-alone/best-hands"]
    assert methods(path, methods=baseline) == baseline
    assert methods(path) == [f"dual-process/EC{k}" for k in (1, 2, 3, 4)]
    assert methods(other) == ["dual-process/EC1"]
    tasks = [*map(load_task, ("two-armed-1", path, "two-armed/v1/i003"))]
    again = paper_cells(tasks=tasks, methods=["EC4"])
    assert [cell.task for cell in again] == tasks
    for name, by in (("ascending", "a shipped"), ("two-armed/v1/i003", "a shipped"),
                     ("arm", "another")):  # fmt: skip
        impostor = tasks[1].model_copy(update={"name": name})
        with pytest.raises(CoarticError, match=f"{name}' belongs to {by} task"):
            paper_cells(tasks=[impostor, str(other)])


def test_a_suite_can_move_one_goal(tmp_path):
    cells = suite_of(tmp_path, ASCENDING + "move = { goal = 2, by = [[0, -0.5], [0.25, 0]] }")
    base = load_task("ascending")
    for cell, name, moved in zip(
        cells, ("goal2_0_-0.5", "goal2_0.25_0"), ((6.0, 1.5), (6.25, 2.0)), strict=True
    ):
        assert cell.task.name == f"ascending.{name}"
        assert cell.task.goals == (base.goals[0], moved, base.goals[2])
    far = 'tasks = ["two-armed-1"]\nmethods = ["dual-process/EC4"]\n'
    with pytest.raises(CoarticError, match="out of reach|too far"):
        suite_of(tmp_path, far + "move = { goal = 2, by = [[0, 9]] }")
