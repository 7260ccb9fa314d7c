"""Executing and scoring solutions, whoever made them."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coartic import (
    PAPER,
    CoarticError,
    MotionModel,
    Movement,
    correct,
    corrective_trial,
    execute,
    hand_sequences,
    load_task,
    move,
)
from coartic.errors import SolutionError
from coartic.learner.conditions import load_condition
from coartic.motion.movement import follow
from coartic.motion.solution import execute_many, other_arm_travel
from coartic.runs.run import MOST_STEPS, execute_all
from coartic.tasks.task import hands_of
from tests.support import reference
from tests.support.strategies import tiny_task


def one_by_one(task, groups, model):
    """What ``execute`` says of a solution that keeps the rules, movement after movement."""
    q, done, reached, reason = np.array(task.q0), [], [], ""
    spent = dict.fromkeys(("corrections", "iterations", "evaluations"), 0)

    def moved(target, movement, stops):
        result = move(
            task.robot, q, target, movement.hand, task.goals[movement.goal - 1], task.radius,
            stop_on_arrival=stops, model=model,
        )  # fmt: skip
        spent["evaluations"] += result.evaluations
        return result

    for number, movements in enumerate(groups, 1):
        goal, last = task.goals[number - 1], Movement(number, movements[0].hand, "corrective")
        hit, before = moved(q, last, True).hit, len(done)
        for place, movement in enumerate([*movements, last]):
            target = movement.target
            if hit and (place > 0 or movement.kind == "corrective"):
                continue
            if movement.kind == "path":
                way = movement.waypoints
                result = follow(task.robot, q, way, movement.hand, goal, task.radius, model=model)
                spent["evaluations"] += result.evaluations
                target = way[-1]
            elif target is None:
                correction = correct(
                    task.robot, q, movement.hand, goal, locked_base=task.locked_base, model=model
                )
                spent["iterations"] += correction.iterations
                spent["evaluations"] += correction.iterations + 1
                target = correction.q
                if not correction.converged:
                    reason = f"in {correction.iterations} iterations"
                    break
            if movement.kind != "path":
                stops = movement.kind != "corrective" or model.corrective_arrival
                result = moved(target, movement, stops)
            q, hit = result.q, result.hit
            spent["corrections"] += movement.kind == "corrective"
            done.append((number, movement.hand, movement.kind, target.tolist(), result.ticks))
        reason = reason or ("" if hit else "outside the goal")
        if reason:
            break
        if len(done) == before:
            done.append((number, last.hand, "corrective", q.tolist(), 0))
        reached.append(q)
    return done, np.array(reached).reshape(-1, len(q)), spent, reason


MODELS = [
    PAPER,
    MotionModel(max_iterations=100),
    MotionModel(corrective_arrival=True, arrival_tolerance=0.09),
    MotionModel(whole_last_step=True),
    MotionModel(first_step=True),
]


@settings(max_examples=20)
@given(
    st.sampled_from(["ascending", "two-armed-1", "two-armed-2"]),
    st.integers(0, 10**6),
    st.sampled_from(MODELS),
)
def test_side_by_side_as_movement_after_movement(name, seed, model):
    """Of all kinds, near what hits the goals and far from it; some solutions break a rule."""
    task, rng = load_task(name), np.random.default_rng(seed)
    locked = ["xy".index(coordinate) for coordinate in task.locked_base]

    def posture(number, alone):
        q = np.array(alone[number] if number < len(alone) else task.q0)
        q += rng.choice([0.0, 0.02, 0.3]) * rng.standard_normal(len(q))
        q[locked] = task.q0[locked]
        return q

    def movement(number, hand, alone):
        kind = rng.choice(["learned", "planned", "corrective", "path"])
        if kind == "path":
            way = [posture(number, alone) for _ in range(rng.integers(1, 4))]
            return Movement(number + 1, hand, "path", waypoints=np.array(way))
        by_correction = kind == "corrective" and rng.random() < 0.5
        return Movement(number + 1, hand, kind, None if by_correction else posture(number, alone))

    asked = []
    for hands in rng.choice(hand_sequences(task), 6):
        alone = corrective_trial(task, str(hands), model=model).configurations
        asked.append(
            [
                [movement(number, hand, alone) for _ in range(rng.integers(1, 4))]
                for number, hand in enumerate(hands_of(str(hands)))
            ]
        )
    solutions = [[movement for group in groups for movement in group] for groups in asked]
    broken = [solutions[0][:-1], [*solutions[0], "nonsense"], 5, solutions[0][::-1]]
    executions = execute_many(task, [*broken, *solutions], model=model)
    for solution, error in zip(broken, executions, strict=False):
        if isinstance(error, Exception):  # one movement less may still be a solution
            with pytest.raises(type(error), match=re.escape(str(error))):
                execute(task, solution, model=model)
    assert [type(error) for error in executions[1:4]] == [SolutionError, TypeError, SolutionError]
    for groups, execution in zip(asked, executions[len(broken) :], strict=True):
        done, reached, spent, reason = one_by_one(task, groups, model)
        assert done == [
            (m.goal, m.hand, m.kind, m.target.tolist(), m.ticks) for m in execution.movements
        ]
        np.testing.assert_array_equal(execution.configurations, reached)
        assert {name: getattr(execution, name) for name in spent} == spent
        assert execution.ticks == sum(ticks for *_, ticks in done)
        assert execution.reason.endswith(reason)
        assert execution.completed == (not reason)


@pytest.mark.parametrize(
    ("name", "printed"),
    [("two-armed-1", {"LRLR": -532, "RRRR": -675}), ("two-armed-2", {"RRRR": -357})],
)
def test_corrective_process_alone(name, printed):
    """Every hand sequence, step by step; those of the best and of the initial are printed."""
    task = load_task(name)
    rewards = {hands: corrective_trial(task, hands).reward for hands in hand_sequences(task)}
    assert len(rewards) == 16
    for hands, reward in rewards.items():
        given = task.model_copy(update={"initial_hands": hands})
        slow = reference.learn(given, load_condition("EC3"), seed=0, trials=1)
        assert (reward, slow.completed[0]) == (slow.rewards[0], True)
    assert {hands: rewards[hands] for hands in printed} == printed
    assert max(rewards, key=rewards.get) == next(iter(printed))
    assert sorted(rewards.values())[-2] < max(rewards.values())
    assert rewards["RRRR"] > rewards["LLLL"]  # printed of the first task


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
