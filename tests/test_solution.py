"""Executing and scoring solutions, whoever made them."""

import re
from dataclasses import replace

import numpy as np
import pytest

from coartic import (
    CONDITIONS,
    PAPER,
    CoarticError,
    Movement,
    SolutionError,
    corrective_trial,
    execute,
    learn,
    load_task,
    movements_of,
)
from coartic.runs.record import MAX_STEPS, execute_all, movement_data, movement_from
from tests.support.strategies import make_trials, posture, tiny_task


def test_no_way_is_followed_without_end():
    far = 0.9 * MAX_STEPS * PAPER.step
    task = tiny_task(goals=[[5.5, 0.1], [6.5, 0.1]])
    out, back = planned(posture(far), posture(far)), planned(posture(far), posture(0.0))
    first, second = execute_all(task, [out, back])
    assert first.reward == -192  # on the way
    assert "1800000 steps; at most 1000000 are allowed" in str(second)


def test_corrective_movements_count_in_the_limit_of_steps():
    """In this world a length unit of the base takes 100,000 ticks."""
    far = tiny_task().model_copy(update={"goals": ((15.0, 1.0), (-15.0, 2.0))})
    solution = [Movement(goal, "right", "corrective") for goal in (1, 2)]
    (short,) = execute_all(far, [solution])
    assert short.completed
    (long,) = execute_all(far, [solution], PAPER._replace(base_weight=1e3))
    assert re.search("takes [0-9]{7} ticks; at most 1000000 are allowed", str(long))


def planned(*targets, hand="right"):
    return [
        Movement(number, hand, "planned", np.array(target, dtype=float))
        for number, target in enumerate(targets, 1)
    ]


def test_a_planner_may_move_one_posture_on_in_place():
    task, q, way = tiny_task(goals=[[5.5, 0.1], [6.5, 0.1]]), posture(0.0), WAY.copy()
    straight, paths = [], []
    for number in (1, 2):
        q += posture(1.0)
        way += posture(1.0)
        straight.append(Movement(number, "right", "planned", q))
        paths.append(Movement(number, "right", "path", waypoints=way))
    of_hands = movements_of("RR", targets := np.array([posture(1.0), posture(2.0)]))
    targets[:] = 0.0
    due = execute(task, planned(posture(1.0), posture(2.0)))
    assert [execute(task, moves).reward for moves in (straight, paths, of_hands)] == [
        due.reward
    ] * 3
    for movement in (*straight, *of_hands):
        assert movement.target[0] == movement.goal
    assert [movement.waypoints[0, 0] for movement in paths] == [1.0, 2.0]
    with pytest.raises(ValueError, match="read-only"):
        straight[0].target += 1.0  # it would be the stored solution


WAY = np.zeros((1, 10))
LRLR = [*enumerate(("left", "right") * 2, 1)]


@pytest.mark.parametrize(
    ("movements", "words"),
    [
        (planned(posture(1.0)), "movements for goals [1]; it must"),
        (
            planned(posture(0.0, 1.0), posture(1.0)),
            "goal 1: a target moves the base in y, which is locked, by 1: entry 1 must be 0",
        ),
        (planned(posture(1.0), posture(2.0), hand="left"), "has no left hand"),
        (
            [Movement(1, "right", "planned"), *planned(posture(1.0))],
            "target of a planned movement is None; it must be",
        ),
        ([Movement(1, "right", "path")], "waypoints of a path are None; they must be a list"),
        (
            [Movement(1, "right", "path", WAY[0] + 1, waypoints=WAY)],
            "it must be None or the last waypoint",
        ),
    ],
)
def test_solutions_that_break_the_rules(movements, words):
    task = tiny_task(locked_base=["y"], goals=[[5.5, 0.1], [6.5, 0.1]], hands=["right"])
    with pytest.raises(CoarticError) as caught:
        execute(task, movements)
    assert words in str(caught.value)


@pytest.mark.parametrize("kind", ["planned", "learned", "corrective", "path"])
def test_waypoints_belong_to_a_path_that_ends_at_its_target(kind):
    way = np.array([posture(1.0), posture(2.0)])
    for target, is_end in ((None, True), (way[-1], True), (way[0], False)):
        movement = Movement(1, "right", kind, target, waypoints=way)
        if kind == "path" and is_end:
            np.testing.assert_array_equal(movement_from(movement_data(movement)).waypoints, way)
            continue
        with pytest.raises(
            ValueError, match=f"waypoints and kind '{kind}'; its kind must be 'path'"
        ):
            movement_data(movement)


def test_a_base_that_a_solver_moves_a_little_is_held():
    task = load_task("two-armed-1")
    due = corrective_trial(task, "LRLR")
    exact = due.configurations
    off = exact + np.outer([1e-12, -1e-7, 0.0, 9e-7], np.eye(10)[1])
    for targets in (exact, off):
        made = execute(task, movements_of("LRLR", targets))
        given = [m.target for m in made.movements if m.kind == "learned"]
        np.testing.assert_array_equal(given, exact)
    waypoints = [Movement(n, hand, "path", waypoints=off[n - 1 : n]) for n, hand in LRLR]
    assert np.unique(execute(task, waypoints).configurations[:, 1]) == [0.0]
    trials = make_trials(task, "LRLR", off[None])
    np.testing.assert_array_equal(trials.targets[0], exact)
    assert off[0, 1]
    with pytest.raises(SolutionError, match=r"base in y, which is locked, by 0\.02: entry 1 must"):
        execute(task, movements_of("LRLR", exact + 0.02))


def test_a_goal_is_hit_by_one_hand():
    both = [Movement(1, hand, "planned", np.zeros(10)) for hand in ("left", "right")]
    with pytest.raises(
        CoarticError, match="goal 1: the movements have the hands left and right; all"
    ):
        execute(tiny_task(), both)


def test_equal_contents_are_equal_before_and_after_use():
    """Whatever an object has computed and kept; arrays by their entries."""
    made = [
        (
            tiny_task(),
            corrective_trial(tiny_task(), "RR"),
            learn("ascending", CONDITIONS["EC1"], seed=0, trials=5),
        )
        for _ in "ab"
    ]
    (task, execution, run), others = made
    assert (others[0].q0.shape, others[0].goal_array.shape) == ((10,), (2, 2))  # kept by one alone
    assert (task, execution, run) == others
    moved = replace(execution.movements[0], target=execution.movements[0].target + 1e-12)
    assert moved != execution.movements[0]
    assert run != learn("ascending", CONDITIONS["EC1"], seed=1, trials=5)
    assert task != tiny_task(radius=0.2)
