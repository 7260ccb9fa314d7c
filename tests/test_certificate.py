"""The proof of a lower bound: every half-space, every relaxation, against true points."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from baselines.certificate import _normals, _Relaxation, _roots, _support, certify
from coartic import PAPER, execute, load_task
from coartic.robot import directions
from coartic.solution import Movement
from coartic.task import hands_of
from tests.support.strategies import changed

NAMES = ["ascending", "two-armed-1", "two-armed-2"]


@given(st.floats(1e-6, 12.0), st.lists(st.floats(-2, 2), min_size=3, max_size=3))
def test_offsets_are_exact_maxima(half, normal):
    a, b, k = normal
    offset = _support(np.array(normal)[:, None, None], np.array([half])).item()
    delta = np.linspace(-half, half, 40_001)
    cosine, sine = directions(delta).T
    true = (a * cosine + b * sine + k * delta).max()
    assert offset >= true - 1e-12
    assert offset == pytest.approx(true, abs=1e-6)


@given(st.floats(1e-6, 12.0))
def test_normals_bound_all_sides(half):
    normals = _normals(np.array([half]))[..., 0]
    assert normals.shape[0] == 3
    for side in (1.0, -1.0):
        assert ((0.0, 0.0, side) == normals.T).all(axis=1).any()


def feasible(task, hands, rng, reach):
    """Configurations that put each hand at its goal, near the start; None where it fails."""
    q, found = np.array(task.q0), []
    free = np.ones(task.robot.dof, dtype=bool)
    free[:2] = ["x" not in task.locked_base, "y" not in task.locked_base]
    for hand, goal in zip(hands, task.goals, strict=True):
        (other,) = {"left", "right"} - {hand}
        moving = free.copy()
        moving[task.robot.joints(other)] = False
        q = q + reach * rng.standard_normal(q.shape) * moving
        for _ in range(60):
            miss = np.array(goal) - task.robot.forward_kinematics(q, hand)
            jacobian = task.robot.jacobian(q, hand) * moving
            q = q + jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + 1e-4 * np.eye(2), miss)
        if np.hypot(*miss) > 0.09:
            return None
        found.append(q)
    return np.array(found)


@pytest.mark.parametrize("name", NAMES)
def test_a_relaxation_never_exceeds_a_true_path(name):
    """For any path and any box around its link angles, and for every split of the box."""
    task = load_task(name)
    rng = np.random.default_rng(len(name))
    checked = 0
    for root in list(_roots(task, still=True)):
        if root.moves < len(task.goals):
            continue
        hands = hands_of(root.hands)
        q = feasible(task, hands, rng, 0.3)
        if q is None:
            continue
        length = np.linalg.norm(np.diff(np.vstack([task.q0, q]), axis=0), axis=1).sum()
        box = root.first_box(length)
        angles = root._angles[:, : q.size] @ q.ravel()
        assert np.all((box[:, 0] <= angles) & (angles <= box[:, 1]))
        for _ in range(5):
            rows, offsets = root._with_half_spaces(box)
            spaces = rows[-len(offsets) :]
            point = np.zeros(root._size)
            point[: q.size] = q.ravel()
            point[root._directions], point[root._directions + 1] = directions(angles).T
            assert (spaces @ point - offsets).max() < 1e-9
            bound, minimum, _ = root.solve(box)
            assert bound <= length
            below, above = root.split(box, minimum)
            inside = np.all((below[:, 0] <= angles) & (angles <= below[:, 1]))
            tighter = below if inside else above
            assert (tighter[:, 1] - tighter[:, 0]).sum() < (box[:, 1] - box[:, 0]).sum()
            assert np.all((tighter[:, 0] <= angles) & (angles <= tighter[:, 1]))
            box = tighter
            checked += 1
    assert checked >= 5


def test_a_box_around_one_path_bounds_it_tightly():
    task = load_task("ascending")
    q = feasible(task, ("right",) * 3, np.random.default_rng(1), 0.2)
    (root,) = (r for r in _roots(task, still=True) if r.moves == 3)
    angles = root._angles[:, : q.size] @ q.ravel()
    box = np.stack([angles - 1e-4, angles + 1e-4], axis=1)
    bound, point, _ = root.solve(box)
    # What is left free: the base, and the hand within its disc.
    relaxed = point[: q.size].reshape(q.shape)
    hand = task.robot.forward_kinematics(relaxed, "right")
    assert np.hypot(*(hand - task.goal_array).T).max() <= task.radius + 1e-3
    steps = np.diff(np.vstack([task.q0, relaxed]), axis=0)
    assert np.linalg.norm(steps, axis=1).sum() == pytest.approx(bound, abs=1e-4)


def test_the_optimum_of_two_goals_is_proven():
    """That of three is, by the method that asks for proofs, in test_optimum."""
    goals = [list(goal) for goal in load_task("ascending").goals[:2]]
    task = changed("ascending", goals=goals, initial_hands="RR")
    found = certify(task, 191, still=True, model=PAPER, most_nodes=300)
    assert found.proven
    assert found.ticks == 191
    assert found.open_nodes == 0
    assert found.nodes > 50


def test_nothing_false_is_proven():
    """A claim above the optimum is not proven, and the bound stays below the optimum."""
    found = certify(load_task("ascending"), 300, still=True, model=PAPER, most_nodes=150)
    assert not found.proven
    assert found.ticks <= 292
    assert found.open_nodes > 0


def test_bounds_only_grow_with_the_nodes():
    bounds = [
        certify(load_task("two-armed-1"), 465, still=False, model=PAPER, most_nodes=nodes).ticks
        for nodes in (60, 160)
    ]
    assert bounds == sorted(bounds)
    assert bounds[0] > 400
    assert bounds[-1] <= 465


def test_a_goal_in_line_needs_the_base_alone():
    task = changed("ascending", goals=[[6.5, 0.1]], initial_hands="R")
    found = certify(task, 191, still=True, model=PAPER, most_nodes=500)
    assert found.proven
    movement = Movement(1, "right", "planned", task.q0 + np.eye(10)[0] * 1.95)
    assert execute(task, [movement]).ticks == 191


def test_two_goals_hit_at_once_count_once():
    """Both hands stand at goals already: nothing has to move, so nothing is proven."""
    task = changed("two-armed-2", goals=[[3.5, 0.1], [4.5, 0.1]], initial_hands="LR", radius=0.1)
    roots = list(_roots(task, still=False))
    assert {r.hands for r in roots if r.moves == 0} == {"LR"}
    alone = [Movement(1, "left", "corrective"), Movement(2, "right", "corrective")]
    assert execute(task, alone).ticks == 0
    found = certify(task, 1, still=False, model=PAPER, most_nodes=50)
    assert found.ticks == 0
    assert not found.proven
    assert certify(task, 0, still=False, model=PAPER, most_nodes=50).proven


def test_a_goal_out_of_reach_leaves_no_path():
    task = changed("ascending", goals=[[6, 90]], locked_base=["y"], initial_hands="R")
    root = _Relaxation(task, ("right",), (), True)
    bound, _, _ = root.solve(root.first_box(5.0))
    assert bound == math.inf
