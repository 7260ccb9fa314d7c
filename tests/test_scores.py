"""Solutions executed side by side get the scores that each gets alone, to the last bit."""

import numpy as np
import pytest

from coartic import CONDITIONS, PAPER, learn_many, load_task
from coartic.errors import CoarticError
from coartic.runs import scores as scores_module
from coartic.runs.scores import MOST_STEPS, PlainMovement, Solved, scored_together, solved

CELLS = [
    ("ascending", "EC1"),
    ("two-armed-1", "EC2"),
    ("two-armed-1", "EC4"),
    ("two-armed-2", "EC3"),
]
RUNS = 12


def spoilt(rows, rng):
    """Solutions that are nearly one: some still hit every goal, some break a rule."""
    k = int(rng.integers(len(rows)))
    target = list(rows[k].target)
    joint = int(rng.integers(len(target)))

    def with_(**changes):
        return (*rows[:k], rows[k].model_copy(update=changes), *rows[k + 1 :])

    def moved(by):
        return with_(target=tuple(q + by * (j == joint) for j, q in enumerate(target)))

    yield with_(ticks=5)
    yield with_(kind="corrective")
    yield with_(kind="planned")
    yield with_(hand="left" if rows[k].hand == "right" else "right")
    yield with_(target=None, kind="corrective")
    yield with_(target=tuple(target[:-1]))
    yield from map(moved, (1e-3, 0.01, 0.3, 1e4, 2e5))
    yield rows[:k] + rows[k + 1 :]
    yield rows[: k + 1] + rows[k:]
    yield rows[::-1]


def alone(task, rows):
    try:
        return solved(task, [row.movement() for row in rows], PAPER)
    except (CoarticError, ValueError, TypeError) as error:
        return error


def shown(score):
    return repr(score) if isinstance(score, Solved) else (type(score), str(score))


@pytest.mark.parametrize(("name", "condition"), CELLS)
def test_side_by_side_as_alone(name, condition, monkeypatch):
    task, rng = load_task(name), np.random.default_rng(3)
    assert condition in CONDITIONS
    asked = []
    for run in learn_many(task, condition, seeds=range(RUNS), trials=6, jobs=1):
        for movements in (run.solution, run.initial, run.replay):
            rows = tuple(map(PlainMovement.of, movements))
            asked += [rows, *spoilt(rows, rng)]
    monkeypatch.setattr(scores_module, "_known", {})
    found = scored_together(task, asked, PAPER)
    assert [shown(score) for score in found] == [shown(alone(task, rows)) for rows in asked]
    assert sum(isinstance(score, Solved) for score in found) > RUNS
    assert sum(not isinstance(score, Solved) for score in found) > RUNS


def test_a_way_without_end_is_refused_among_many(monkeypatch):
    task = load_task("ascending")
    runs = learn_many(task, "EC1", seeds=range(RUNS), trials=2, jobs=1)
    asked = [tuple(map(PlainMovement.of, run.solution)) for run in runs]
    far, near = (tuple(q + by for q in task.q0.tolist()) for by in (9e3, 0.0))
    to_and_fro = [
        PlainMovement(goal=1, hand="right", kind="planned", target=target)
        for target in (far, near) * (MOST_STEPS // 1_000_000 + 1)
    ]
    asked.append((*to_and_fro, *asked[0]))
    monkeypatch.setattr(scores_module, "_known", {})
    *scores, refused = scored_together(task, asked, PAPER)
    assert all(isinstance(score, Solved) for score in scores)
    assert "1000000 are allowed" in str(refused)
