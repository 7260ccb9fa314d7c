"""Executing and scoring solutions, whoever made them."""

import numpy as np
import pytest

from coartic import (
    PAPER,
    CoarticError,
    Movement,
    execute,
    load_task,
)
from coartic.motion.solution import other_arm_travel
from coartic.runs.run import MOST_STEPS, execute_all
from coartic.tasks.task import hands_of
from tests.support.strategies import tiny_task


def test_no_way_is_followed_without_end():
    """Nobody waits for a hand that is sent to the end of the world and back."""
    far = 0.9 * MOST_STEPS * PAPER.step
    task = tiny_task(goals=[[5.5, 0.1], [6.5, 0.1]])
    out, back = planned(posture(far), posture(far)), planned(posture(far), posture(0.0))
    first, second = execute_all(task, [out, back], PAPER)
    assert first.reward == -192  # on the way
    assert "1800000 steps; at most 1000000 are allowed" in str(second)


def planned(*targets, hand="right"):
    return [
        Movement(number, hand, "planned", np.array(target, dtype=float))
        for number, target in enumerate(targets, 1)
    ]


def posture(x, y=0.0):
    """Arms straight along +x, base at (x, y): the right hand is at (x + 4.5, y + 0.1)."""
    return [x, y, *[0.0] * 8]


def test_a_plan_that_hits():
    task = tiny_task(goals=[[5.5, 0.1], [6.5, 0.1]])
    execution = execute(task, planned(posture(1.0), posture(2.0)))
    # 1.0 less the radius of 0.1 is 90 steps and the arrival tick; then 1.0 more.
    assert execution.ticks_by_goal() == (91, 101)
    assert execution.reward == -192
    assert execution.corrections == 0
    assert execution.completed


def test_aiming_at_the_rim_stops_short_of_it():
    """Within θ^a of a rim target the movement ends without a hit; 0.09 inside it hits."""
    task = tiny_task(goals=[[5.5, 0.1]], initial_hands="R")
    on_rim = execute(task, planned(posture(0.9 - 1e-9)))
    assert on_rim.corrections == 1
    safe = task.radius - PAPER.arrival_tolerance
    assert execute(task, planned(posture(1.0 - safe + 1e-9))).corrections == 0


def test_paths():
    """A path pays its steps and one tick; it may hit on the way; a miss is corrected."""
    task = tiny_task(goals=[[5.5, 0.1], [6.5, 0.1]])
    waypoints = np.linspace(posture(0.0), posture(1.0), 11)[1:]
    path = Movement(1, "right", "path", waypoints=waypoints)
    onward = Movement(2, "right", "path", waypoints=np.array([posture(2.0)]))
    execution = execute(task, [path, onward])
    assert execution.ticks_by_goal() == (91, 101)
    assert execution.corrections == 0
    np.testing.assert_array_equal(execution.movements[0].target, posture(1.0))
    again = execute(task, execution.movements)
    assert again.reward == execution.reward
    short = Movement(1, "right", "path", waypoints=waypoints[:5])
    assert execute(task, [short, onward]).corrections == 1
    with pytest.raises(CoarticError, match="a path needs waypoints"):
        execute(task, [Movement(1, "right", "path", np.array(posture(1.0))), onward])
    with pytest.raises(CoarticError, match="is not finite"):
        execute(task, [Movement(1, "right", "path", waypoints=waypoints * np.nan), onward])


def test_a_planned_movement_is_always_made():
    task = tiny_task(goals=[[4.5, 0.1]], initial_hands="R")
    assert execute(task, planned(posture(0.0))).reward == -1
    corrective = execute(task, [Movement(1, "right", "corrective")])
    assert corrective.reward == 0
    assert corrective.hands == "R"


@pytest.mark.parametrize(
    ("movements", "words"),
    [
        ([], "movements for goals [], wanted [1, 2]"),
        (planned(posture(1.0)), "movements for goals [1], wanted [1, 2]"),
        (planned(posture(1.0), posture(1.0), posture(1.0)), "wanted [1, 2]"),
        (planned([0.0] * 9, posture(1.0)), "goal 1: configuration has shape (9,)"),
        (planned(posture(np.nan), posture(1.0)), "goal 1: configuration"),
        (planned(posture(0.0, 1.0), posture(1.0)), "goal 1: the target moves a locked base"),
        (planned(posture(1.0), posture(2.0), hand="left"), "the robot has no left hand"),
        ([Movement(1, "right", "planned"), *planned(posture(1.0))], "needs a target"),
        ([Movement(1, "right", "jump", np.zeros(10))], "unknown kind 'jump'"),
    ],
)
def test_solutions_that_break_the_rules(movements, words):
    task = tiny_task(
        hands=["right"], locked_base=["y"], goals=[[5.5, 0.1], [6.5, 0.1]], initial_hands="RR"
    )
    with pytest.raises(CoarticError) as caught:
        execute(task, movements)
    assert words in str(caught.value)


def test_travel_of_the_other_arm_is_summed_in_order():
    """As Python's own floats are: a library's dot product rounds as the processor likes."""
    task, rng = load_task("two-armed-1"), np.random.default_rng(0)
    hands = hands_of("LRRL")
    reached = task.q0 + rng.normal(0, 1, (4, task.robot.dof))
    expected, before = 0.0, task.q0.tolist()
    for hand, q in zip(hands, reached.tolist(), strict=True):
        joints = task.robot.joints("left" if hand == "right" else "right")
        square = 0.0
        for a, b in zip(q[joints], before[joints], strict=True):
            square += (a - b) ** 2
        expected, before = expected + square**0.5, q
    assert other_arm_travel(task, hands, reached) == expected
