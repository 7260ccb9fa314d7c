"""Functions for single movements and corrections, and checks of their arguments.

:func:`move`, :func:`follow` and :func:`correct` call the compiled kernels. A movement is straight
in joint space, or follows a path through waypoints. The length of a movement is measured in the
norm of the motion model, in which a length unit of the base is as long as ``base_weight`` rad of a
joint.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from coartic.internal.limits import brief_value, check_limits, real_array
from coartic.model import PAPER, MotionModel, check_exact
from coartic.motion.kernels.correct import correct_kernel
from coartic.motion.kernels.move import move_kernel, path_kernel
from coartic.motion.kernels.slots import Batch, batch_for, robot_parameters
from coartic.robot import BASE_DOF, HANDS, MAX_ENTRY, Array, Hand, Robot


class MoveResult(NamedTuple):
    """Result of one movement (:func:`move`, :func:`coartic.motion.doors.follow`)."""

    q: Array
    """Configuration in which the movement stopped, shape ``(dof,)``, in length units and rad."""
    ticks: int
    """Control ticks spent. The reward of the movement is ``-ticks``."""
    hit: bool
    """True if the hand is within the goal's radius."""
    evaluations: int
    """Number of forward-kinematics evaluations. On a path there is one per tick. On a straight
    movement, steps that cannot end the movement are not evaluated, and the target is evaluated
    before the movement if ``stop_on_arrival`` is True."""


class Correction(NamedTuple):
    """Result of the corrective process (:func:`correct`)."""

    q: Array
    """Configuration found, shape ``(dof,)``, in length units and rad; the last iterate if
    ``converged`` is False."""
    converged: bool
    """True if the hand is within ``MotionModel.correction_tolerance`` of the goal's centre."""
    iterations: int
    """Iterations made, with one Jacobian each."""


def move(
    robot: Robot,
    q: Array,
    target: Array,
    hand: Hand,
    goal: tuple[float, float],
    radius: float,
    *,
    stop_on_arrival: bool = True,
    model: MotionModel = PAPER,
) -> MoveResult:
    """Move the robot straight in joint space, until a hand hits its goal or arrives.

    The movement ends at the target configuration at the latest. A movement of k steps takes k + 1
    ticks.

    Parameters
    ----------
    robot : Robot
        The robot.
    q : ndarray, shape (dof,)
        Configuration in which the robot stands, in length units (base) and rad (joints).
    target : ndarray, shape (dof,)
        Target configuration, in the same units.
    hand : {"left", "right"}
        The hand that is to hit the goal.
    goal : tuple of float
        Centre of the goal, x and y in length units.
    radius : float
        Radius of the goal (in length units).
    stop_on_arrival : bool
        If True, the movement also ends when the hand is within ``arrival_tolerance`` of the
        position that the hand has in the target configuration. If False, as in a corrective
        movement, the movement ends only on a hit or at its target configuration.
    model : MotionModel
        The motion model. Its constants ``gain``, ``correction_tolerance`` and ``max_iterations``
        are not used.

    Returns
    -------
    MoveResult
        Where the robot stopped, the control ticks of the movement, and whether the goal is hit.

    Raises
    ------
    ValueError
        An argument cannot be used:

        - a shape is wrong;
        - a number is not finite, or is beyond ±100,000;
        - the radius is below 0;
        - the hand is unknown;
        - a constant of the model is out of bounds, or the model has motor noise.
    TypeError
        ``robot``, ``model`` or ``stop_on_arrival`` has a wrong type.

    Notes
    -----
    Source: paper, section *Generating Movement for Each Goal*.
    """
    if not isinstance(stop_on_arrival, bool | np.bool_):
        raise TypeError(f"stop_on_arrival is {brief_value(stop_on_arrival)}; it must be a bool")
    batch = one_run(robot, q, hand, goal, radius)
    run, entries = batch.runs[0], slice(robot.dof)
    run["target"][entries] = configuration(robot, target)
    parameters = robot_parameters(robot, radius, model=check_exact(model))
    move_kernel(stop_on_arrival, parameters, batch)
    return MoveResult(
        run["q"][entries].copy(), int(run["ticks"]), bool(run["hit"]), int(run["evaluations"])
    )


def follow(
    robot: Robot,
    q: Array,
    waypoints: Array,
    hand: Hand,
    goal: tuple[float, float],
    radius: float,
    *,
    model: MotionModel = PAPER,
) -> MoveResult:
    """Move the robot along a path through waypoints, until a hand hits its goal.

    If the hand does not hit the goal, the movement ends at the last waypoint. A movement of k steps
    takes k + 1 ticks.

    Parameters
    ----------
    robot : Robot
        The robot.
    q : ndarray, shape (dof,)
        Configuration in which the robot stands, in length units (base) and rad (joints).
    waypoints : ndarray, shape (W, dof)
        Configurations through which the path passes, at least one, in the same units
        (:func:`path_points`).
    hand : {"left", "right"}
        The hand that is to hit the goal.
    goal : tuple of float
        Centre of the goal, x and y in length units.
    radius : float
        Radius of the goal (in length units).
    model : MotionModel

    Returns
    -------
    MoveResult
        Where the robot stopped, the control ticks of the movement, and whether the goal is hit. The
        robot stops at the first point of the path (:func:`path_points`) at which the hand is in the
        goal, or else at the last waypoint.

    Raises
    ------
    ValueError
        An argument cannot be used:

        - a shape is wrong, or there is no waypoint;
        - a number is not finite, or is beyond ±100,000;
        - the radius is below 0;
        - the hand is unknown;
        - a constant of the model is out of bounds, or the model has motor noise.
    TypeError
        ``robot`` or ``model`` has a wrong type, or ``waypoints`` has no length.
    """
    batch = one_run(robot, q, hand, goal, radius)
    points = finite_array("waypoints", waypoints, (max(len(waypoints), 1), robot.dof))
    path_kernel(robot_parameters(robot, radius, model=check_exact(model)), points, batch)
    run = batch.runs[0]
    return MoveResult(
        run["q"][: robot.dof].copy(), int(run["ticks"]), bool(run["hit"]), int(run["evaluations"])
    )


def scale_base(changes: Array, model: MotionModel) -> Array:
    """Multiply the base coordinates of joint-space vectors by the weight of the base.

    ``changes`` contains differences between configurations. The array and the result have shape
    ``(..., dof)``. The norm of a row of the result, in the norm of ``model``, is the length of the
    straight movement by the same row of ``changes``. If the weight is 1, ``changes`` itself is
    returned.
    """
    if model.base_weight == 1.0:
        return changes
    scaled = np.array(changes)
    scaled[..., :BASE_DOF] *= model.base_weight
    return scaled


def line_points(q: Array, target: Array, model: MotionModel = PAPER) -> Array:
    """Return the configurations of a straight movement, spaced by ``model.step``.

    The last step may be shorter.

    Parameters
    ----------
    q : ndarray, shape (dof,)
        Configuration at the beginning, in length units (base) and rad (joints).
    target : ndarray, shape (dof,)
        Configuration at the end. A coordinate whose entry is NaN does not move.
    model : MotionModel
        Motion model with the length of a step, the norm and the weight of the base. Its motor noise
        is ignored.

    Returns
    -------
    ndarray, shape (n + 1, dof)
        Configurations of a movement of n steps, including both ends. Without motor noise the
        kernels compute the same configurations, bit for bit.

    Examples
    --------
    >>> line_points(np.zeros(3), np.array([0.0, 0.0, 0.025]))[:, 2]
    array([0.   , 0.01 , 0.02 , 0.025])
    """
    target = np.where(np.isnan(target), q, target)
    difference, square = target - q, 0.0
    for value in scale_base(difference, model).tolist():
        square = max(square, value * value) if model.norm == "maximum" else square + value * value
    distance = math.sqrt(square)
    k = np.arange(math.ceil(distance / model.step))[:, None]
    return np.vstack([q + k * model.step / (distance or 1.0) * difference, target])


def segment_lengths(configurations: ArrayLike, model: MotionModel = PAPER) -> Array:
    """Return the joint-space distance from each configuration to the next.

    The distance is measured in the norm of ``model``, with its weight of the base.
    ``configurations`` has shape ``(k, dof)``, in length units and rad. The result has shape
    ``(k - 1,)``; a distance combines both units.

    Examples
    --------
    >>> segment_lengths([[0.0, 0.0, 0.0], [0.0, 0.0, 3.0], [4.0, 0.0, 0.0]])
    array([3., 5.])
    """
    changes = scale_base(np.diff(configurations, axis=0), model)
    if model.norm == "maximum":
        return np.asarray(np.abs(changes).max(axis=1, initial=0.0))
    return np.asarray(np.sqrt((changes**2).sum(axis=1)))


def path_points(robot: Robot, q: Array, waypoints: Array, model: MotionModel = PAPER) -> Array:
    """Return points on a path through waypoints in joint space, spaced by ``model.step``.

    The path is straight from each configuration to the next.

    Parameters
    ----------
    robot : Robot
    q : ndarray, shape (dof,)
        Configuration at the beginning of the path, in length units (base) and rad (joints).
    waypoints : ndarray, shape (W, dof)
        At least one configuration.
    model : MotionModel
        Motion model with the length of a step, the norm and the weight of the base.

    Returns
    -------
    ndarray, shape (n + 1, dof)
        Point k < n lies at arc length ``k * model.step`` of the path; point n is the last waypoint.

    Raises
    ------
    ValueError
        A shape is wrong, or a number is not finite or is beyond ±100,000.
    """
    shape = (len(waypoints), robot.dof)
    corners = np.vstack([configuration(robot, q), finite_array("waypoints", waypoints, shape)])
    ends = np.concatenate([[0.0], np.cumsum(segment_lengths(corners, model))])
    lengths = np.append(np.arange(math.ceil(ends[-1] / model.step)) * model.step, ends[-1])
    points = np.stack([np.interp(lengths, ends, joint) for joint in corners.T], axis=1)
    points[-1] = corners[-1]
    return points


def configuration(robot: Robot, q: Any) -> Array:
    """Convert a configuration to a new contiguous array of float64, shape ``(dof,)``.

    Raises ValueError for a wrong shape, and for an entry that is not finite or beyond ±100,000.
    """
    return finite_array("configuration", q, (robot.dof,))


def finite_array(name: str, value: Any, shape: tuple[int, ...]) -> Array:
    """Convert numbers to a new contiguous array of float64 with a given shape.

    Raises ValueError if the numbers do not have this shape, or if a number is not finite or is
    beyond ±100,000. The error message begins with ``name``.
    """
    array = np.array(real_array(name, value), order="C")
    if array.shape != shape:
        raise ValueError(f"{name} has shape {array.shape}; it must be {shape}")
    if not (np.abs(array) <= MAX_ENTRY).all():
        allowed = f"from -{MAX_ENTRY:g} to {MAX_ENTRY:g}" if np.isfinite(array).all() else "finite"
        raise ValueError(f"{name} is {brief_value(array.tolist())}; all entries must be {allowed}")
    return array


def one_run(robot: Any, q: Any, hand: Any, goal: Any, radius: float = 0.0) -> Batch:
    """Return a batch for kernels that contains one run with configuration and target ``q``.

    Parameters
    ----------
    robot : Robot
    q : array_like, shape (dof,)
        Configuration, in length units and rad.
    hand : {"left", "right"}
        The hand that is to hit the goal.
    goal : array_like, shape (2,)
        Centre of the goal, x and y in length units.
    radius : float
        Radius of the goal (in length units). It is only checked.

    Raises
    ------
    TypeError
        ``robot`` is not a Robot.
    ValueError
        Another argument does not fit.
    """
    if not isinstance(robot, Robot):
        raise TypeError(f"robot is {brief_value(robot)}; it must be a Robot")
    robot.arm(hand)
    batch = batch_for(robot, 1)
    run = batch.runs[0]
    run["q"][: robot.dof] = run["target"][: robot.dof] = configuration(robot, q)
    run["hand"], run["goal"] = HANDS.index(hand), check_goal(goal, radius)
    return batch


def check_goal(centre: Any, radius: float = 0.0) -> tuple[float, float]:
    """Convert the centre of a goal to two floats, x and y (in length units).

    Raises ValueError if ``centre`` does not consist of two finite numbers within ±100,000. The
    function also raises ValueError if ``radius`` (in length units) is not from 0 to 100,000.
    """
    x, y = finite_array("goal", centre, (2,)).tolist()
    check_limits("radius", radius, 0.0, MAX_ENTRY)
    return x, y


def correct(
    robot: Robot,
    q: Array,
    hand: Hand,
    goal: tuple[float, float],
    *,
    locked_base: Collection[str] = (),
    model: MotionModel = PAPER,
) -> Correction:
    """Find a configuration that puts a hand at a goal, by Jacobian-transpose inverse kinematics.

    This is the paper's corrective process: gradient descent, from ``q``, on half the squared
    distance of the hand from the goal. The joints of the other arm do not change.

    Parameters
    ----------
    robot : Robot
        The robot.
    q : ndarray, shape (dof,)
        Configuration in which the process begins, in length units (base) and rad (joints).
    hand : {"left", "right"}
        The hand that is to reach the goal.
    goal : tuple of float
        Centre of the goal, x and y in length units.
    locked_base : collection of {"x", "y"}
        Coordinates of the base that do not move.
    model : MotionModel
        The motion model. Only its constants ``gain``, ``correction_tolerance`` (0.01 length units
        for None) and ``max_iterations`` are used.

    Returns
    -------
    Correction
        The configuration, whether the process converged, and the number of iterations. No error is
        raised if the process gets stuck, or would need more than ``model.max_iterations``
        iterations: ``converged`` is then False.

    Raises
    ------
    TypeError
        ``robot`` or ``model`` has a wrong type.
    ValueError
        An argument cannot be used:

        - a shape is wrong;
        - a number is not finite, or is beyond ±100,000;
        - the hand is unknown;
        - ``locked_base`` has an entry other than ``"x"`` and ``"y"``;
        - a constant of the model is out of bounds, or the model has motor noise.

    Notes
    -----
    Source: paper, Figure 2 (Whitney 1969; Craig 2004).
    """
    batch = one_run(robot, q, hand, goal)
    run, entries = batch.runs[0], slice(robot.dof)
    locked = tuple(map(str, locked_base if isinstance(locked_base, Collection) else [locked_base]))
    correct_kernel(robot_parameters(robot, locked_base=locked, model=check_exact(model)), batch)
    return Correction(run["target"][entries].copy(), bool(run["converged"]), int(run["iterations"]))
