"""What a report's figure keeps of the movements of runs."""

import numpy as np

from coartic import Movement, corrective_trial, load_task, trajectory
from coartic.analysis.report.player import methods_played, player, shortened
from coartic.benchmarks.suites import Cell
from tests.support.suites import KNOWN, run_and_write


def test_films_have_fewer_numbers_and_the_same_ticks():
    task = load_task("ascending")
    targets = corrective_trial(task, "RRR").configurations + 1 / 30
    movements = [Movement(goal, "right", "learned", targets[goal - 1]) for goal in (1, 2, 3)]
    run = trajectory(task, movements)
    shorter = trajectory(task, shortened(task, run.execution))
    assert shorter.execution.ticks_by_goal() == run.execution.ticks_by_goal()
    assert np.abs(shorter.configurations - run.configurations).max() < 0.05
    assert len(repr(shorter.execution.movements[-1].target.tolist())) < 80


def test_methods_that_follow_paths_are_left_out(tmp_path):
    tasks = [load_task(name) for name in ("ascending", "descending")]
    cells = [
        Cell(task, KNOWN[method])
        for task in tasks
        for method in ("nullspace-qp/none", "corrective-alone/given")
    ]
    study = run_and_write(tmp_path / "both", cells, trials=20, runs=1)
    played = methods_played(study, [task.name for task in tasks])
    assert [run["id"] for run in played] == ["corrective-alone/given"]
    alone = run_and_write(tmp_path / "alone", cells[::2], trials=20, runs=1)
    assert player(alone) == ""
