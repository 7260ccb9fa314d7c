"""Trajectories agree with the execution that is scored, tick by tick."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coartic import (
    Movement,
    execute,
    learn,
    load_task,
    trajectory,
)
from coartic.errors import SolutionError
from tests.support.reference import move as reference_move
from tests.support.strategies import PAPER_CELLS, configurations, tiny_task, uneven_task


def agrees(task, movements):
    """All that a trajectory must have in common with its execution."""
    execution = execute(task, movements)
    path = trajectory(task, movements)
    assert path.ticks == execution.ticks == len(path.configurations)
    assert path.execution.hands == execution.hands
    if path.ticks:
        np.testing.assert_array_equal(path.configurations[0], task.q0)
        np.testing.assert_array_equal(path.configurations[path.hits], execution.configurations)
    steps = np.linalg.norm(np.diff(path.configurations, axis=0), axis=1)
    assert (steps <= 0.01 + 1e-9).all()
    for number, (hit, hand) in enumerate(zip(path.hits, path.hands, strict=True), 1):
        rows = path.hand_path(hand)[: hit + 1]
        if not len(rows):
            continue
        inside = np.linalg.norm(rows - task.goals[number - 1], axis=1) <= task.radius
        assert inside[-1]
        started = path.hits[number - 2] if number > 1 else 0
        assert not inside[started + 1 : -1].any()  # the movement ends on its first hit
    return path


@pytest.mark.parametrize(("name", "condition"), PAPER_CELLS)
def test_learned_solutions(name, condition):
    for seed in range(3):
        run = learn(load_task(name), condition, seed=seed, trials=400)
        path = agrees(run.task, run.solution)
        assert path.ticks == -run.reward
        assert tuple(np.diff([-1, *path.hits])) == path.execution.ticks_by_goal()


@st.composite
def solutions(draw):
    """A task for either robot, with planned, path and corrective movements that miss or hit."""
    uneven = draw(st.booleans())
    goals = [[3.0, 1.0], [3.2, 1.4]]
    if uneven:
        task = uneven_task([0.1], [0.2, 0.3, -0.4, 0.1], goals=goals)
    else:
        start = {"base": [0.0, 0.0], "left": [0.3] * 4, "right": [0.2] * 4}
        task = tiny_task(start=start, goals=goals)
    near = configurations(task.robot, -1.5, 1.5)
    movements = []
    for goal in (1, 2):
        hand = draw(st.sampled_from(["left", "right"]))
        for _ in range(draw(st.integers(1, 2))):
            kind = draw(st.sampled_from(["learned", "planned", "corrective", "path"]))
            if kind == "corrective":
                movements.append(Movement(goal, hand, kind))
            elif kind == "path":
                points = np.array([draw(near) for _ in range(draw(st.integers(1, 3)))])
                movements.append(Movement(goal, hand, kind, waypoints=points))
            else:
                movements.append(Movement(goal, hand, kind, draw(near)))
    return task, movements


@settings(max_examples=30)
@given(solutions())
def test_any_solution(drawn):
    task, movements = drawn
    if execute(task, movements).completed:
        agrees(task, movements)
    else:
        with pytest.raises(SolutionError, match="goal"):
            trajectory(task, movements)


def test_every_point_is_the_reference_models():
    """Each row equals where the step-by-step model stands after so many steps."""
    run = learn(load_task("two-armed-1"), "EC4", seed=1, trials=300)
    path = trajectory(run.task, run.solution)
    at = 0
    for movement in path.execution.movements:
        if not movement.ticks:
            continue
        start = path.configurations[at]
        result = reference_move(
            run.task.robot, start, movement.target, movement.hand,
            run.task.goals[movement.goal - 1], run.task.radius,
            stop_on_arrival=movement.kind != "corrective",
        )  # fmt: skip
        assert result.ticks == movement.ticks
        np.testing.assert_array_equal(path.configurations[at + movement.ticks - 1], result.q)
        at += movement.ticks


def test_rows_are_the_printed_points():
    """q + k m (target - q)/distance, the last one short, then the next movement's start."""
    task = tiny_task(goals=[[5.5, 0.1], [5.5, 0.1]])
    target = np.array([1.005, *[0.0] * 9])
    still = Movement(2, "right", "planned", target)
    path = agrees(task, [Movement(1, "right", "planned", target), still])
    np.testing.assert_allclose(path.configurations[:, 0], [*np.arange(91) * 0.01, 0.9])
    assert list(path.hits) == [90, 91]
    np.testing.assert_allclose(path.hand_path("right")[:, 0], path.configurations[:, 0] + 4.5)
    assert len(path.subtask(1)) == 91
    assert len(path.subtask(2)) == 2


def test_goals_hit_at_the_start():
    task = tiny_task(goals=[[4.5, 0.1], [5.5, 0.1]])
    path = agrees(task, [Movement(goal, "right", "corrective") for goal in (1, 2)])
    assert path.hits[0] == 0
    np.testing.assert_array_equal(path.configurations[0], task.q0)
    idle = agrees(
        tiny_task(goals=[[4.5, 0.1]], initial_hands="R"), [Movement(1, "right", "corrective")]
    )
    assert idle.configurations.shape == (0, 10)
    assert list(idle.hits) == [0]
