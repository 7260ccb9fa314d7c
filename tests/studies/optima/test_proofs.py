"""The proof of a lower bound: every half-space, every relaxation, against true points."""

import itertools
import math
import sys
from types import SimpleNamespace

import clarabel
import numpy as np
import pytest
from scipy.spatial import KDTree

from coartic import PAPER, corrective_trial, execute, load_task
from coartic.motion.execution import hand_sequences
from coartic.motion.solution import Movement
from coartic.tasks.task import hands_of
from tests.support.processes import programs
from tests.support.strategies import (
    UNEVEN,
    changed,
    steps_from,
    tiny_task,
    uneven_task,
)

(PROOF,) = programs("optima", "certificate")
RELAXED, LAGRANGIAN, SPEED = (sys.modules[n] for n in ("relaxation", "lagrangian", "speed"))
NAMES = ["ascending", "two-armed-1", "two-armed-2"]


def paths(name, every):
    """Paths of the corrective process, near the shortest ones, with every so many hand sequences:
    task, hands, configurations ``(G, dof)``, lengths of the steps."""
    task = load_task(name)
    for letters in hand_sequences(task)[::every]:
        q = corrective_trial(task, letters).configurations
        steps = np.linalg.norm(steps_from(task.q0, q), axis=1)
        yield task, hands_of(letters), q, steps


def undecided(hands, rng):
    return tuple(hand if rng.random() < 0.6 else None for hand in hands)


def first_goals(name, count):
    """A task's first goals alone."""
    goals = [list(goal) for goal in load_task(name).goals[:count]]
    return changed(name, goals=goals, initial_hands="R" * count)


def angles_of(task, hands, q):
    """Absolute link angles of the chosen arms, goal by goal; none where a hand is undecided."""
    decided = [(g, hand) for g, hand in enumerate(hands) if hand is not None]
    angles = [np.cumsum(q[g, task.robot.joints(hand)]) for g, hand in decided]
    return np.concatenate([*angles, np.empty(0)])


def bound(root, box, multipliers, longest):
    return root.lagrangian(multipliers, longest).bound(box)


def test_the_disc_of_an_undecided_hand_holds_both_hands():
    """A straight arm that points away from the other shoulder is on its circle."""
    task, straight = load_task("two-armed-2"), np.zeros((2001, 10))
    middle, radius = RELAXED.disc_of(task, None)
    far = []
    for hand in task.hands:
        q = straight.copy()
        q[:, task.robot.arm(hand).first_joint] = np.linspace(-math.pi, math.pi, len(q))
        away = np.linalg.norm(task.robot.forward_kinematics(q, hand) - middle, axis=1)
        far.append(task.radius + away.max())
    assert radius - 1e-4 < max(far) <= radius + 1e-12


FAILURES = (
    lambda each, rng: each + rng.choice([1e-3, 1.0]) * rng.standard_normal(each.shape),
    lambda each, rng: np.where(rng.random(each.shape) < 0.3, np.nan, each),
    lambda each, rng: 1e300 * rng.standard_normal(each.shape),
    lambda each, rng: rng.permutation(each),  # as of another box
)


def failing(rng):
    """A class of solvers that fail, by a change of their numbers."""
    solver, statuses = clarabel.DefaultSolver, clarabel.SolverStatus

    class Failing:
        def __init__(self, *data):
            self.solver = solver(*data)
            self.update = self.solver.update

        def solve(self):
            right = self.solver.solve()
            change = FAILURES[rng.integers(len(FAILURES))]
            x, z = (change(np.array(each), rng) for each in (right.x, right.z))
            status = rng.choice([statuses.PrimalInfeasible, statuses.NumericalError])
            return SimpleNamespace(x=x, z=z, status=status)

    return Failing


@pytest.mark.parametrize(
    ("name", "failure"),
    [("ascending", False), ("two-armed-2", False), ("two-armed-1", True)],
)
def test_a_relaxation_never_exceeds_a_true_path(name, failure, monkeypatch):
    """For any path, hands undecided, boxes around its link angles and parts of them, and whatever
    the solver says. What is cut off a box never holds the path, for the least slack that keeps it
    of interest.
    """
    rng, cuts = np.random.default_rng(7), []
    if failure:
        monkeypatch.setattr(clarabel, "DefaultSolver", failing(rng))
    for task, hands, q, steps in paths(name, 8):
        length = steps.sum()
        for chosen in (hands, undecided(hands, rng)):
            root, angles = RELAXED.Relaxation(task, chosen, (), True), angles_of(task, chosen, q)

            def holds(box, angles=angles):
                return np.all((box[:, 0] <= angles) & (angles <= box[:, 1]))

            near = angles[:, None] + rng.random((len(angles), 2)) * [-1.0, 1.0]
            for box in (root.first_box(length), near):
                assert holds(box)
                for _ in range(3 if len(box) else 1):
                    relaxed = root.solve(box)
                    assert np.isfinite(relaxed.q).all()
                    pulls, forces, speeds = relaxed.multipliers
                    for much in ((pulls, forces, speeds + 1), (0 * pulls, 0 * forces, speeds + 9)):
                        assert root.lagrangian(much, length).bound(box) <= length + 1e-9
                    lagrangian = root.lagrangian(relaxed.multipliers, length)
                    least = lagrangian.bound(box)
                    assert least <= length + 1e-9
                    left = lagrangian.within(box, length - least + 1e-9)
                    assert holds(left)
                    cuts.append(np.any(left != box))
                    if len(box):
                        below, above = RELAXED.split(box, relaxed)
                        half = below if holds(below) else above
                        assert holds(half)
                        assert (half[:, 1] - half[:, 0]).sum() < (box[:, 1] - box[:, 0]).sum()
                        box = half
    assert len(cuts) >= 8
    assert failure or any(cuts)


def test_a_box_without_a_path_is_ruled_out():
    """By the ray: the bound exceeds every path, as far as forces count."""
    task = load_task("two-armed-1")
    root = RELAXED.Relaxation(task, hands_of("RRRR"), (), False)
    box = root.first_box(0.01)  # near the start no hand is at a goal
    relaxed = root.solve(box)
    assert bound(root, box, relaxed.multipliers, 10.0) > 100.0
    assert bound(root, root.first_box(10.0), relaxed.multipliers, 10.0) < 10.0


@pytest.mark.parametrize("name", ["long/v1/i000", "one-armed/v1/i005"])
def test_dynamic_programming_finds_the_soonest_of_all_sequences(name):
    task = load_task(name)

    def ticks(hands):
        """Ticks of one sequence, hand by hand."""
        where, when = dict.fromkeys(task.hands, (-1, 0)), 0
        for goal, hand in enumerate(hands):
            last, hit = where[hand]
            path = SPEED.path_between(task, hand, last, goal)
            when = max(when, hit + math.ceil(path / PAPER.step) + 1) if path else when
            where[hand] = goal, when
        return when

    sequences = [*itertools.product(task.hands, repeat=len(task.goals))]
    assert SPEED.least_ticks(task) == min(map(ticks, sequences))
    assert [SPEED.least_ticks(task, hands) for hands in sequences[:9]] == [
        *map(ticks, sequences[:9])
    ]


@pytest.mark.parametrize("name", NAMES)
def test_every_path_is_as_long_as_its_spans_say(name):
    rng = np.random.default_rng(8)
    for task, hands, q, steps in paths(name, 2):
        none = (None,) * len(q)
        for chosen in (hands, undecided(hands, rng), (*hands[:2], *none[2:]), none):
            spans, least = SPEED.spans_of(task, chosen)
            assert np.all(spans @ steps >= least)
            assert len(least)


def test_the_least_of_a_term_is_exact():
    rng = np.random.default_rng(4)
    for _ in range(12):
        low, (slopes, sizes, towards) = rng.uniform(-8, 8, 16), rng.standard_normal((3, 16))
        box = np.stack([low, low + rng.uniform(0, 9, 16)], 1)
        lagrangian = LAGRANGIAN.Lagrangian(1.0, slopes, np.abs(sizes), 3 * towards)
        sampled = np.linspace(*box.T, 1001)
        values = slopes * sampled + np.abs(sizes) * np.cos(sampled - 3 * towards)
        true = values.min(axis=0)
        least = LAGRANGIAN.least(*lagrangian[1:], *box.T)
        assert np.all(least <= true + 1e-12)
        assert least == pytest.approx(true, abs=1e-4)
        left = lagrangian.within(box, 0.3)
        gone = (sampled < left[:, 0]) | (sampled > left[:, 1])
        assert (values[gone] > np.broadcast_to(least + 0.3, values.shape)[gone] - 1e-9).all()
        assert gone.any()


@pytest.mark.parametrize("seed", range(3))
def test_the_proof_agrees_with_an_exhaustive_search(seed):
    """Two goals, one link an arm, the base on a rail: every path on a fine grid."""
    rng = np.random.default_rng(seed)
    goals = rng.uniform((-2, -0.7), (2, 0.9), (2, 2)).round(3).tolist()
    start = {"left": [1.2], "right": [0.4]}
    robot = {"left_links": [1.0], "right_links": [1.2]}
    task = tiny_task(robot=robot, locked_base=["y"], start=start, goals=goals)
    assert not PROOF.mergeable(task, hands_of("RR"))
    least = np.inf
    for hands in itertools.product(task.hands, repeat=2):
        layers = []
        for hand, goal in zip(hands, task.goals, strict=True):
            # All angles and points of the disc: the base follows from the hand's x.
            angle = np.linspace(-3, 4, 1401)  # half a step apart
            q = np.tile(task.q0, (angle.size, 1))
            q[:, task.robot.joints(hand)] = angle[:, None]
            off = task.robot.forward_kinematics(q, hand) - np.array(goal)
            half = np.sqrt(np.maximum(task.radius**2 - off[:, 1] ** 2, 0.0))
            near = np.abs(off[:, 1]) <= task.radius
            q, off, half = q[near], off[near], half[near]
            sides = np.tile(q, (9, 1, 1))
            sides[..., 0] = np.linspace(-1, 1, 9)[:, None] * half - off[:, 0]
            layers.append(sides.reshape(-1, 4))
        first, second = layers
        # The hand that does not reach keeps its joints: the nearest posture in those that move.
        moving = [0, 2 + (hands[1] == "right")]
        to_first = np.linalg.norm(first - task.q0, axis=1)
        to_second, _ = KDTree(second[:, moving]).query(first[:, moving])
        least = min(least, (to_first + to_second).min())
    # In steps; the grid is not finer than one.
    ticks = PROOF.certify(task, 5000, 160, still=True).ticks
    merged = len(PROOF.mergeable(task, (None, None)))
    assert ticks <= math.ceil(least / PAPER.step) + 2
    assert ticks >= math.floor(least / PAPER.step) + 2 - merged - 4


@pytest.mark.parametrize(
    ("task", "claim", "most_nodes", "proven"),
    [
        (first_goals("ascending", 2), 191, 300, 191),
        # A goal in line needs the base alone: 1.9 less the disc, and the tick that ends it.
        (changed("ascending", goals=[[6.5, 0.1]], initial_hands="R"), 191, 500, 191),
        # On this instance few cone programmes prove less than the distances alone.
        (load_task("one-armed/v1/i028"), 813, 20, 520),
    ],
)
def test_what_is_proven(task, claim, most_nodes, proven):
    assert PROOF.certify(task, claim, most_nodes, still=True).ticks == proven


def test_two_goals_hit_at_once_count_once():
    """Both hands stand at goals already: nothing has to move, so nothing is proven."""
    task = changed("two-armed-2", goals=[[3.5, 0.1], [4.5, 0.1]], initial_hands="LR", radius=0.1)
    assert PROOF.mergeable(task, hands_of("LR")) == (0, 1)
    assert PROOF.mergeable(task, hands_of("LL")) == (0,)
    assert PROOF.mergeable(task, (None, None)) == (0, 1)
    for apart, both in ((0.19, (1,)), (0.21, ())):
        goals = [[5.0, 1.0], [5.0 + apart, 1.0]]
        overlapping = tiny_task(goals=goals, radius=0.1)
        assert PROOF.mergeable(overlapping, hands_of("RR"))[-1:] == both
    alone = [Movement(1, "left", "corrective"), Movement(2, "right", "corrective")]
    assert execute(task, alone).ticks == 0
    assert PROOF.certify(task, 1, 50).ticks == 0
    assert PROOF.certify(task, 0, 50).ticks == 0


@pytest.mark.parametrize("locked", [[], ["y"]])
def test_no_hand_is_faster_than_the_fastest(locked):
    """Of no configuration has the Jacobian a larger norm, and that of a straight arm has it."""
    goals = [[1.0, 0.3], [1.0, 0.6]]
    task = uneven_task([0.5], [0.5] * 4, goals=goals, locked_base=locked)
    q = np.random.default_rng(5).uniform(-3, 3, (2000, UNEVEN.dof))
    q[0, 2:] = 0.0
    shoulders = [task.robot.arm(hand).first_joint for hand in task.hands]
    q[0, shoulders] = math.pi / 2  # at right angles to x
    moving = np.ones(UNEVEN.dof)
    moving[["xy".index(axis) for axis in locked]] = 0.0
    for hand in task.hands:
        norms = np.linalg.norm(UNEVEN.jacobian(q, hand) * moving, ord=2, axis=(1, 2))
        assert SPEED.fastest_hand(task, hand) == pytest.approx(norms.max(), rel=1e-12)
