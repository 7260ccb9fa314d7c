"""What a report's figure keeps of the movements of runs."""

from coartic import load_task
from coartic.analysis.report.player import methods_played, player
from tests.support.suites import KNOWN, cell_on, run_and_write


def test_methods_that_follow_paths_are_left_out(tmp_path):
    tasks = [load_task(name) for name in ("ascending", "descending")]
    cells = [
        cell_on(task, KNOWN[method])
        for task in tasks
        for method in ("posture-qp/current-goal", "corrective-alone/given")
    ]
    study = run_and_write(tmp_path / "both", cells, trials=20, runs=1)
    played = methods_played(study, [task.name for task in tasks])
    assert [run["id"] for run in played] == ["corrective-alone/given"]
    alone = run_and_write(tmp_path / "alone", cells[::2], trials=20, runs=1)
    assert player(alone) == ""
