"""Executing and scoring solutions, whoever made them."""

import numpy as np
import pytest

from coartic import PAPER, CoarticError, Movement, execute
from coartic.runs.run import MOST_STEPS, execute_all
from tests.support.strategies import tiny_task


def test_no_way_is_followed_without_end():
    """Nobody waits for a hand that is sent to the end of the world and back."""
    far = 0.9 * MOST_STEPS * PAPER.step
    task = tiny_task(goals=[[5.5, 0.1], [6.5, 0.1]])
    out, back = planned(posture(far), posture(far)), planned(posture(far), posture(0.0))
    first, second = execute_all(task, [out, back])
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


WAY = np.zeros((1, 10))


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
        ([Movement(1, "right", "path", waypoints=[])], "a path needs waypoints"),
        ([Movement(1, "right", "path", waypoints=WAY * np.nan)], "is not finite"),
        ([Movement(1, "right", "path", WAY[0] + 1, waypoints=WAY)], "target is its last waypoint"),
        ([Movement(1, "right", "planned", WAY[0], waypoints=WAY)], "movement has no waypoints"),
        ([Movement(1, "right", "path", waypoints=WAY + 1)], "the target moves a locked base"),
    ],
)
def test_solutions_that_break_the_rules(movements, words):
    task = tiny_task(
        hands=["right"], locked_base=["y"], goals=[[5.5, 0.1], [6.5, 0.1]], initial_hands="RR"
    )
    with pytest.raises(CoarticError) as caught:
        execute(task, movements)
    assert words in str(caught.value)


def test_a_goal_is_hit_by_one_hand():
    both = [Movement(1, hand, "planned", np.zeros(10)) for hand in ("left", "right")]
    with pytest.raises(CoarticError, match="goal 1: two hands for one goal"):
        execute(tiny_task(), both)
