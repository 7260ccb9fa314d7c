"""What a report's figure keeps of the movements of runs."""

import numpy as np

from coartic import PAPER, Movement, corrective_trial, load_task, trajectory
from coartic.analysis.report.player import bends, shortened


def test_films_have_fewer_numbers_and_the_same_ticks():
    """A path along an arc of many waypoints, then targets of many digits."""
    task = load_task("ascending")
    share = np.linspace(0.0, 1.0, 400)[1:, None]
    path = np.tile(task.q0, (len(share), 1))
    path[:, 6:] += np.sin(share * [0.3, -0.5, 0.4, 0.2])
    path[:, :2] += 1.7 * share
    targets = corrective_trial(task, "RRR").configurations + 1 / 30
    movements = [
        Movement(1, "right", "path", None, None, path),
        *(Movement(goal, "right", "learned", targets[goal - 1]) for goal in (2, 3)),
    ]
    run = trajectory(task, movements)
    shorter = trajectory(task, shortened(run, PAPER))
    assert shorter.execution.ticks_by_goal() == run.execution.ticks_by_goal()
    assert len(shorter.execution.movements[0].waypoints) < 40
    assert np.abs(shorter.configurations - run.configurations).max() < 0.05
    assert len(repr(shorter.execution.movements[-1].target.tolist())) < 80


def test_a_line_stays_a_line_and_where_it_turns_is_kept():
    line = np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0], [2.0, 3.0], [2.0, 1.0]])
    np.testing.assert_array_equal(bends(line, 1e-9), line[[0, 2, 3, 4]])
