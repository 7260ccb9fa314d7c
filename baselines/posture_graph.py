"""Dynamic programming over a layered graph of sampled inverse-kinematics postures.

Each goal is a layer of the graph. Its nodes are postures (base and one arm) in which a hand is
inside the disc of the goal. The cost of an edge is the joint-space length of the movement from one
node to the next. A movement moves the base and the arm that hits the goal; the other arm stays in
the posture in which it was last used. So the state at a goal is a pair of nodes, one for each arm.
For each hand sequence, dynamic programming over the prefixes of the sequence finds the shortest
path through the layers exactly. Such a path, with a node for each goal, is called a *chain*. For
tasks with many hand sequences, a beam search selects the sequences (:data:`BEAM_WIDTH`).

A planner uses the chains as starts of a local search by IPOPT
(:mod:`coartic.baselines.trajectory_problem`).
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterator
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from coartic.method import Information, MethodError, Session
from coartic.robot import BASE_DOF, HANDS, Array, Hand
from coartic.tasks.task import Task

KINEMATICS = frozenset({Information.GOALS, Information.FORWARD_KINEMATICS, Information.JACOBIAN})
"""Information that all planners and controllers use: the goals, the positions of hands, and the
derivatives of these positions."""
HandSequence = tuple[Hand, ...]
Chain = tuple[HandSequence, Array]
"""A chain: a hand sequence, and the configurations at the goals, shape ``(G, dof)``."""
Layers = dict[tuple[int, Hand], Array]
"""Dict that maps each pair of goal (from 0) and hand to its nodes, shape ``(n, dof)``."""
Nodes = Annotated[int, Field(ge=10, le=1000)]
"""Type of a parameter: number of samples in a posture graph, from 10 to 1000."""
Count = Annotated[int, Field(ge=1)]
"""Type of a parameter: number of graphs, chains or starts, at least 1."""
BEAM_WIDTH = 64
"""Largest number of hand sequences that are planned in a graph. With two hands and up to six goals,
all sequences are planned. With more goals, a beam search of this width selects the sequences."""
QUICK = {"nodes": 40, "graphs": 1, "chains": 1}
"""Parameters with which a planner can be checked in seconds."""
_PROJECTIONS = 25  # Gauss-Newton steps that bring a sample into a disc
_NARROWEST, _WIDEST = 0.05, 1.5  # SD of samples, in length units (base) and rad (joints)
_NEAR = 2.0  # in length units: at a larger distance the base first moves the hand this near


def _sample_postures(
    task: Task, goal: int, hand: Hand, starts: Array, rng: np.random.Generator, spent: Counter[str]
) -> Array:
    """Sample postures in which a hand is inside a goal's disc.

    There is a sample for each of N configurations. Gaussian noise displaces the configuration, and
    Gauss-Newton steps then bring the hand to a random point of the disc. Samples whose hand does
    not come into the disc are left out.

    Parameters
    ----------
    task : Task
    goal : int
        Number of the goal, from 0.
    hand : {"left", "right"}
    starts : ndarray, shape (N, dof)
        Configurations, in length units and rad. The joints of the other arm and locked base
        coordinates do not change.
    rng : numpy.random.Generator
    spent : Counter
        Counter to which the numbers of evaluations are added.

    Returns
    -------
    ndarray, shape (n, dof)
        The n <= N samples.
    """
    robot, count = task.robot, len(starts)
    moving = np.zeros(robot.dof, dtype=np.bool_)
    moving[robot.joints(hand)] = True
    moving[:BASE_DOF] = ["x" not in task.locked_base, "y" not in task.locked_base]
    spread = _NARROWEST * (_WIDEST / _NARROWEST) ** rng.random((count, 1))
    q = starts + spread * rng.standard_normal((count, robot.dof)) * moving
    # Aim at random points of the disc, more often near its rim, where short paths end.
    offset = rng.standard_normal((count, 2))
    offset *= task.radius * rng.random((count, 1)) ** 0.25 / np.linalg.norm(offset, axis=1)[:, None]
    aim = task.goal_array[goal] + 0.98 * offset
    miss = aim - robot.forward_kinematics(q, hand)
    far = np.maximum(1.0 - _NEAR / np.maximum(np.hypot(*miss.T), _NEAR), 0.0)
    q[:, :BASE_DOF] += far[:, None] * miss * moving[:BASE_DOF]
    spent["forward_kinematics"] += count
    for _ in range(_PROJECTIONS):
        position, jacobian = robot.linearised(q, hand)
        miss, jacobian = aim - position, jacobian * moving
        spent["forward_kinematics"] += count
        square = jacobian @ jacobian.swapaxes(-1, -2) + 1e-6 * np.eye(2)
        step = (jacobian.swapaxes(-1, -2) @ np.linalg.solve(square, miss[..., None]))[..., 0]
        length = np.linalg.norm(step, axis=1, keepdims=True)
        q = q + step * np.minimum(1.0, 0.5 / np.maximum(length, 1e-12))
    miss = task.goal_array[goal] - robot.forward_kinematics(q, hand)
    spent["forward_kinematics"] += count
    return np.asarray(q[np.hypot(*miss.T) <= task.radius])


class PrefixCosts(NamedTuple):
    """Table of dynamic programming for one prefix of hand sequences.

    The state is a pair of nodes: the last node of the left hand, and the last node of the right
    hand. For each pair, the table contains the cost of the cheapest path through the layers of the
    prefix that ends in this pair.
    """

    hands: HandSequence
    """The prefix: the hand of each of its goals."""
    nodes: dict[Hand, Array]
    """Dict that maps each hand to the nodes of the layer in which the hand was last used, shape
    ``(n, dof)``. For a hand that the prefix does not use, the only node is the start."""
    cost: Array
    """``cost[i, j]`` is the joint-space length of the shortest path whose last nodes are node i of
    the hand used last and node j of the other hand."""
    predecessors: tuple[NDArray[np.int32], ...]
    """Predecessors on the cheapest paths: a tuple with an array for each goal of the prefix. Let h
    be the hand at this goal. Entry ``[i, j]`` belongs to node i of hand h at this goal, and to last
    node j of the other hand. The entry is the index of the node at which hand h was last used
    before this goal, on the cheapest path to this pair of nodes."""


def sample_layers(task: Task, count: int, rng: np.random.Generator) -> tuple[Layers, Counter[str]]:
    """Sample the nodes of a posture graph for each goal and hand.

    A node is a posture in which the hand is inside the goal's disc. Each sample begins with a
    random configuration, from which Gauss-Newton steps move the hand into the disc. If the previous
    goal has nodes, of either hand, half of the random configurations are drawn around these
    nodes. All other random configurations are drawn around the task's start.

    Parameters
    ----------
    task : Task
    count : int
        Number of samples for each pair of goal and hand. Samples whose hand does not come into the
        disc are left out.
    rng : numpy.random.Generator

    Returns
    -------
    dict
        Dict that maps each pair of goal (from 0) and hand to its nodes, shape ``(n, dof)``, in
        length units and rad.
    Counter
        Numbers of evaluations, keyed by ``forward_kinematics`` and ``jacobians``.
    """
    spent: Counter[str] = Counter()
    layers: Layers = {}
    before = np.empty((0, task.robot.dof))
    for goal in range(len(task.goals)):
        for hand in task.hands:
            starts = np.tile(task.q0, (count, 1))
            if len(before):
                half = slice(count // 2)
                starts[half] = before[rng.integers(len(before), size=count // 2)]
            layers[goal, hand] = _sample_postures(task, goal, hand, starts, rng, spent)
        before = np.concatenate([layers[goal, hand] for hand in task.hands])
    return layers, spent


def chains_of(
    task: Task, layers: Layers, most: int | None = None, base_weight: float = 1.0
) -> list[Chain]:
    """Find the cheapest chain of nodes for each hand sequence, by dynamic programming.

    Parameters
    ----------
    task : Task
    layers : dict
        Dict that maps each pair of goal (from 0) and hand to its nodes, shape ``(n, dof)``.
    most : int, optional
        Width of a beam search over the goals: at each goal, only this number of prefixes of hand
        sequences, the cheapest ones, are kept. So there are at most this number of chains. By
        default all prefixes are kept.
    base_weight : float
        Weight of the base in the length of a movement (:class:`.MotionModel`).

    Returns
    -------
    list of tuple
        A tuple (hand sequence, configurations of shape ``(G, dof)``) for each chain, in the
        alphabetical order of the hand sequences. Hand sequences without a chain are left out.
    """
    start = dict.fromkeys(HANDS, np.array(task.q0)[None, :])
    beam = [PrefixCosts((), start, np.zeros((1, 1)), ())]
    for _ in range(len(task.goals)):
        longer = [more for begun in beam for more in _extend(task, layers, begun, base_weight)]
        ranked = sorted(range(len(longer)), key=lambda i: float(longer[i].cost.min()))
        beam = [longer[i] for i in sorted(ranked[:most])]
    chains: list[Chain] = []
    for hands, _, cost, predecessors in beam:
        i, j = np.unravel_index(cost.argmin(), cost.shape)
        picked = []
        for goal in reversed(range(len(hands))):
            picked.append(layers[goal, hands[goal]][i])
            came = predecessors[goal][i, j]
            same = goal == 0 or hands[goal - 1] == hands[goal]
            i, j = (came, j) if same else (j, came)
        configurations, q = [], np.array(task.q0)
        for hand, node in zip(hands, reversed(picked), strict=True):
            q = q.copy()
            q[:BASE_DOF] = node[:BASE_DOF]
            q[task.robot.joints(hand)] = node[task.robot.joints(hand)]
            configurations.append(q)
        chains.append((hands, np.array(configurations)))
    return chains


def _extend(
    task: Task, layers: Layers, begun: PrefixCosts, base_weight: float
) -> Iterator[PrefixCosts]:
    """Extend a prefix by the next goal, with each hand that has nodes there.

    ``begun`` contains the costs of the prefix of hand sequences. Yields the costs of each longer
    prefix, the one with the left hand first. ``layers`` and ``base_weight`` are as in
    :func:`chains_of`.
    """
    hands, nodes, cost, predecessors = begun
    goal = len(hands)
    for hand in sorted(task.hands):  # left before right
        layer = layers[goal, hand]
        if not len(layer):
            continue
        last = hands[-1] if hands else hand
        base = base_weight**2 * _squared_distances(nodes[last], layer, slice(0, BASE_DOF))
        arm = _squared_distances(nodes[hand], layer, task.robot.joints(hand))
        # A hand comes from its own node. If it was used last, (i, j) leads to (k, j) by the
        # minimum over i, else to (k, i) by the minimum over j.
        came_from, step = (cost, np.sqrt(base + arm)) if hand == last else (cost.T, None)
        came = np.empty((len(layer), came_from.shape[1]), dtype=np.int32)
        reached = np.empty(came.shape)
        for other in range(came.shape[1]):
            distances = np.sqrt(base[other] + arm) if step is None else step
            total = came_from[:, other, None] + distances
            came[:, other], reached[:, other] = total.argmin(axis=0), total.min(axis=0)
        yield PrefixCosts((*hands, hand), {**nodes, hand: layer}, reached, (*predecessors, came))


def cheapest_chains(
    session: Session,
    task: Task,
    rng: np.random.Generator,
    *,
    nodes: int,
    graphs: int,
    chains: int,
    most: int = BEAM_WIDTH,
    spread: bool = False,
) -> Iterator[Chain]:
    """Sample posture graphs, and yield the cheapest chain of each hand sequence in each graph.

    Parameters
    ----------
    session : Session
        Session that counts the evaluations.
    task : Task
    rng : numpy.random.Generator
    nodes : int
        Number of samples in a graph for each pair of goal and hand.
    graphs : int
        Smallest number of graphs.
    chains : int
        Smallest number of chains over all graphs. More than ``graphs`` graphs are made until this
        number of chains is reached.
    most : int
        Largest number of hand sequences with a chain in a graph (:func:`chains_of`).
    spread : bool
        True to yield, after each chain of a task for two hands, a copy in which the idle arm moves
        in equal steps (:func:`move_other_arm`). These copies are not counted in the number
        ``chains``.

    Yields
    ------
    tuple
        A chain: hand sequence, and configurations at the goals, shape ``(G, dof)``, in length units
        and rad.

    Raises
    ------
    MethodError
        A goal has no posture in a graph.
    """
    yielded = 0
    for number in itertools.count(1):
        layers, spent = sample_layers(task, nodes, rng)
        session.spend(**spent)
        able = {goal for (goal, _), postures in layers.items() if len(postures)}
        if missing := {*range(len(task.goals))} - able:
            raise MethodError(
                "infeasible",
                f"goal {min(missing) + 1}: the search found no posture with the "
                f"{' or the '.join(task.hands)} hand inside its disc",
            )
        for hands, configurations in chains_of(task, layers, most, session.model.base_weight):
            yielded += 1
            yield hands, configurations
            if spread and len(task.hands) > 1:
                yield hands, move_other_arm(task, hands, configurations)
        if number >= graphs and yielded >= chains:
            return


def move_other_arm(task: Task, hands: HandSequence, chain: Array) -> Array:
    """Return a copy of a chain in which idle arms move towards their next posture.

    In a chain, an arm moves only on the way to the goals that its hand hits. In the copy, an arm
    moves in equal steps, one for each goal, from its posture at one of these goals (or at the
    start) to its posture at the next of these goals. After the last goal that its hand hits, an arm
    does not move.

    Parameters
    ----------
    task : Task
    hands : tuple of str
        Hand of each goal.
    chain : ndarray, shape (G, dof)
        Configuration at each goal, in length units and rad.

    Returns
    -------
    ndarray, shape (G, dof)
        Configuration at each goal in the copy.
    """
    configurations = chain.copy()
    for hand in task.hands:
        joints = task.robot.joints(hand)
        used = [0, *(g for g, chosen in enumerate(hands, 1) if chosen == hand)]
        corners = np.vstack([task.q0, chain])[used, joints]
        at = np.arange(1, len(hands) + 1)
        configurations[:, joints] = np.stack(
            [np.interp(at, used, joint) for joint in corners.T], axis=1
        )
    return configurations


def _squared_distances(before: Array, after: Array, joints: slice) -> Array:
    """Return the squared distances over some joints between two sets of configurations.

    ``before`` has shape ``(n, dof)``, ``after`` ``(m, dof)``, and the result ``(n, m)``.
    """
    difference = before[:, None, joints] - after[None, :, joints]
    return np.asarray((difference**2).sum(axis=-1))
