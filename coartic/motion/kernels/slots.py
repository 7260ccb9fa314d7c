"""Data layout with which the compiled kernels move many arms at once.

- A *run* is a robot that makes a trial. A *batch* contains a record for each of its runs.
- A *slot* is a column of some arrays (structure of arrays). It contains the data of the arm of one
  run while the arm moves or is corrected.

The innermost loop of a kernel is over slots, so that the compiler turns it into vector
instructions. The number of links belongs to the type of the arrays, so that loops over links are
unrolled. No operation combines numbers of different slots, and the compiler may not reorder or fuse
operations. Therefore the result in a slot depends neither on the other slots, nor on the number of
slots, nor on the width of the vectors.

The parameters of a robot are one record. If they were a tuple, Numba would look at each of its
fields whenever it calls a kernel.
"""

from __future__ import annotations

from functools import cache, lru_cache
from typing import Any, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from coartic.model import PAPER, PAPER_RADIUS, MotionModel, Norm
from coartic.motion.kernels.compile import chain_by, inlined, inner, record_type
from coartic.motion.kernels.trigonometry import MAX_ANGLE, cosine, near_cosine, near_sine, sine
from coartic.robot import BASE_DOF, HANDS, Arm, Robot

SLOTS = 72
"""Number of slots of a batch. The arrays of a movement of four-link arms then fit into the
processor's first-level cache."""
_VECTOR = 8  # number of slots in a vector; SLOTS is a multiple of it
NORMS = get_args(Norm)
"""Norms of joint space. Kernels represent a norm by its index in this tuple."""
_CONSTANTS = tuple(name for name in MotionModel._fields if name != "radius")
"""Constants of the motion model in the record of :func:`robot_parameters`, which has the radius of
the goals beside it."""
GOING = 0.0
"""Status of a slot whose movement or correction goes on."""
RobotRecord = Any
"""Record of robot, limits of its task and model for kernels (:func:`robot_parameters`)."""
RunRecord = Any
"""Record of a run, that is, a robot that makes a trial (:func:`batch_for`)."""
SlotArrays = Any
"""Record with a field for each array of the slots; the last axis is the slot (:func:`layout`)."""


def _links_for(robot: Robot) -> int:
    """Return the number of links per arm for which a robot's kernels are compiled.

    The number is :attr:`Robot.max_links`, rounded up to 4 or 8 if it is at most 8. So most robots
    share machine code.
    """
    return 4 if robot.max_links <= 4 else max(robot.max_links, 8)


def width_of(robot: Robot) -> int:
    """Return the number of entries of a configuration in the records of kernels.

    The number is that of the base coordinates plus the joints of two arms, each with the number of
    links for which the kernels are compiled (:func:`_links_for`). The first ``dof`` entries are the
    robot's configuration; the other entries are unused.
    """
    return BASE_DOF + 2 * _links_for(robot)


# ---- Robot parameters ----


@cache
def _parameters_type(links: int) -> np.dtype[np.void]:
    """Return the NumPy type of the record of :func:`robot_parameters` for ``links`` per arm."""
    arm = {"first_joint": np.int64, "count": np.int64, "links": (np.float64, links)}
    shoulder = dict.fromkeys(("shoulder_x", "shoulder_y"), np.float64)
    model: dict[str, Any] = dict.fromkeys(_CONSTANTS, np.float64)
    model |= {"max_iterations": np.int64, "norm": np.int64}  # index in NORMS
    fields = {
        "arms": (record_type(arm | shoulder), len(HANDS)),
        "model": record_type(model),
        "radius": np.float64,  # of the goals, in length units
        "free_x": np.bool_,  # True if the corrective process moves the base in x
        "free_y": np.bool_,
        "checks": np.bool_,  # True if an arm without a target stays if its hand is in the goal
        "grows": np.bool_,  # True if the noise of aimed movements grows with their length
    }
    return record_type(fields)


@lru_cache(maxsize=1024)
def robot_parameters(
    robot: Robot,
    radius: float = PAPER_RADIUS,
    *,
    locked_base: tuple[str, ...] = (),
    model: MotionModel = PAPER,
    checks: bool = True,
    grows: bool = False,
) -> NDArray[np.void]:
    """Convert a robot, a motion model and options to a record for kernels.

    The array is cached: copy it before you change it.

    Parameters
    ----------
    robot : Robot
    radius : float
        Radius of the goals (in length units).
    locked_base : tuple of {"x", "y"}
        Coordinates of the base that the corrective process does not change.
    model : MotionModel
        The motion model. Tolerances that are None are replaced by a tenth of ``radius``.
    checks : bool
        True if an arm without a target stays where it is when its hand is in its goal already;
        False if the corrective process begins at once.
    grows : bool
        True if the motor noise of aimed movements grows with their length.

    Returns
    -------
    ndarray, shape (1,)
        The record.

    Raises
    ------
    ValueError
        ``locked_base`` has an entry other than ``"x"`` and ``"y"``.
    """
    if not set(locked_base) <= {"x", "y"}:
        raise ValueError(f"locked_base is {locked_base!r}; it may only have 'x' and 'y'")
    parameters = np.zeros(1, _parameters_type(_links_for(robot)))
    for hand, arm in zip(HANDS, parameters["arms"][0], strict=True):
        first_joint, links, *shoulder = robot.arm(hand)
        arm["first_joint"], arm["count"] = first_joint, len(links)
        arm["links"][: len(links)] = links
        arm["shoulder_x"], arm["shoulder_y"] = shoulder
    constants = model.for_radius(radius)
    numbers = constants._asdict() | {"norm": NORMS.index(model.norm)}
    parameters["model"] = tuple(numbers[name] for name in _CONSTANTS)
    parameters["radius"], parameters["checks"], parameters["grows"] = radius, checks, grows
    for axis in "xy":
        parameters[f"free_{axis}"] = axis not in locked_base
    return parameters


@inlined
def arm_of(robot: RobotRecord, hand: int) -> Arm:
    """Return the :class:`Arm` of a hand (0 left, 1 right) from a robot's record.

    The links of the arm share memory with the record, which comes from :func:`robot_parameters`.
    """
    arm = robot.arms[hand]
    return Arm(arm.first_joint, arm.links[: arm.count], arm.shoulder_x, arm.shoulder_y)


# ---- Runs and slots ----


class Batch(NamedTuple):
    """Runs side by side, and the slots in which their arms are moved and corrected."""

    runs: Any
    """Records of the N runs, shape ``(N,)``."""
    slots: Any
    """The arrays of the slots (:data:`SlotArrays`): a record in an array of shape ``(1,)``."""
    corrected: Any
    """The rows of ``slots`` that a correction needs, shape ``(rows, SLOTS)``: a view of ``slots``
    as floats. Only copy its columns, because some rows contain integers."""
    moved: Any
    """The rows of ``slots`` that a movement needs, in the same form."""


def batch_for(robot: Robot, count: int = SLOTS) -> Batch:
    """Return a new batch for kernels, with all entries 0.

    The batch consists of ``count`` records of runs with room for the links of ``robot``, and of
    arrays of 72 slots (:data:`SLOTS`). Each run needs a slot, so ``count`` must be at most 72.
    """
    width = width_of(robot)
    fields = {
        "q": (np.float64, width),  # where the robot is, in length units and rad
        "target": (np.float64, width),  # of a movement, as asked for; where A has ended
        "end": (np.float64, width),  # where the movement ends unless it stops: target with noise
        "preferred": (np.float64, width),  # preferred posture, in length units and rad
        "goal": (np.float64, 2),  # x and y, in length units
        "hand": np.int64,  # the hand that is to hit the goal: 0 left, 1 right
        "world": np.uint64,  # key of the noise: see coartic.motion.kernels.noise
        "number": np.int64,  # of the goal, from 0
        "made": np.int64,  # movements made for this goal
        "action": np.int64,  # the next action: see coartic.motion.kernels.move.IDLE
        "corrects": np.bool_,  # True if the corrective process acts where a movement misses
        "going": np.bool_,  # True if the run has hit every goal so far
        "acting": np.bool_,  # True if the run is among those that are moved or corrected next
        "hit": np.bool_,  # True if the hand is within the goal's radius
        "converged": np.bool_,  # True if the corrective process has converged
        "ticks": np.int64,  # of the movement, or of all corrections for the goal
        "spent": np.int64,  # ticks of the corrections before the present one
        "corrections": np.int64,  # corrective movements made for the goal
        "iterations": np.int64,  # of the corrective process for the goal
        "evaluations": np.int64,  # of forward kinematics, since the last record
    }
    record, corrected, moved = layout(_links_for(robot))
    slots = np.zeros(1, record)
    rows = slots.view(np.float64).reshape(-1, SLOTS)
    return Batch(np.zeros(count, record_type(fields)), slots, rows[corrected], rows[moved])


@cache
def layout(links: int) -> tuple[np.dtype[np.void], slice, slice]:
    """Return the dtype of :data:`SlotArrays`, and the ranges of rows that are copied together.

    Parameters
    ----------
    links : int
        Number of links in the arrays. A shorter arm is filled up with links of length 0.

    Returns
    -------
    record : dtype
        The type of the record. A row contains a number for each slot.
    corrected, moved : slice
        The rows that a correction needs, and the rows that a movement needs.
    """
    joints = (BASE_DOF + links,)
    shapes = {
        "q": joints,  # base x and y, then the joints of the arm
        "run": (),  # index of the run in the slot
        "first_joint": (),  # index in a configuration of the first joint of its arm
        "links": (),  # of its arm
        "length": (links,),
        "shoulder": (2,),
        "goal": (2,),
        "start": joints,
        "target": joints,
        "rate": (links,),  # of the absolute link angles, in rad per step
        "base_rate": (2,),
        "end": (2,),  # position to which the target would bring the hand
        "distance": (),  # length of the movement (its square before divide_steps)
        **dict.fromkeys(("step", "last", "slowness", "bend", "clearance"), ()),
        "x": (links + 1,),  # of shoulder, joints and hand
        "y": (links + 1,),
        "status": (),
    }
    kinds = dict.fromkeys(("run", "first_joint", "links"), np.int64)
    record = np.dtype(
        [(name, kinds.get(name, np.float64), (*shape, SLOTS)) for name, shape in shapes.items()]
    )
    row_of = {name: field[1] // (8 * SLOTS) for name, field in (record.fields or {}).items()}
    return record, slice(row_of["target"]), slice(row_of["run"], row_of["x"])


@inlined
def _copy_arm(row: Any, slot: int, q: Any, arm: Arm) -> None:
    """Copy base and joints of an arm from a configuration into a column, in place.

    The entries of configuration ``q`` are copied into column ``slot`` of ``row``, shape
    ``(2 + links, slots)``. Entries for links that the arm does not have become 0.
    """
    row[0, slot] = q[0]
    row[1, slot] = q[1]
    for k in range(len(row) - BASE_DOF):
        row[BASE_DOF + k, slot] = q[arm.first_joint + k] if k < len(arm.links) else 0.0


@inlined
def load(slots: SlotArrays, slot: int, number: int, run: RunRecord, arm: Arm) -> None:
    """Load a run into a slot, in place: its goal, its configuration and its arm.

    ``number`` is the index of ``run`` in its batch, from 0.
    """
    slots.run[slot], slots.first_joint[slot], slots.links[slot] = (
        number,
        arm.first_joint,
        len(arm.links),
    )
    slots.shoulder[0, slot] = arm.shoulder_x
    slots.shoulder[1, slot] = arm.shoulder_y
    slots.goal[0, slot], slots.goal[1, slot] = run.goal[0], run.goal[1]
    for k in range(len(slots.length)):
        slots.length[k, slot] = arm.links[k] if k < len(arm.links) else 0.0
    _copy_arm(slots.q, slot, run.q, arm)


@inner
def squared_distance(run: RunRecord) -> float:
    """Return the squared Euclidean distance from a run's configuration to its target.

    The distance depends neither on the motion model's ``norm`` nor on its ``base_weight``.
    """
    square = 0.0
    for j in range(len(run.q)):
        delta = run.target[j] - run.q[j]
        square += delta * delta
    return square


@inlined
def squared_length(run: RunRecord, model: Any) -> float:
    """Return the squared length of the movement from a run's configuration to its ``end``.

    The length is in the norm of ``model``, with its weight of the base. The number of steps of the
    movement is the length divided by ``model.step``, rounded up.
    """
    square = 0.0
    for j in range(len(run.q)):
        delta = run.end[j] - run.q[j]
        if j < BASE_DOF:
            delta *= model.base_weight
        if model.norm == 0:
            square += delta * delta
        else:
            square = max(square, delta * delta)
    return square


@inlined
def start(slots: SlotArrays, slot: int, number: int, run: RunRecord, robot: RobotRecord) -> None:
    """Load a run into a slot for a movement, in place.

    In addition to what :func:`load` does, this function copies the start, the end and the squared
    length of the movement into the slot, so that :func:`move_slots` can make the movement.
    """
    arm = arm_of(robot, run.hand)
    load(slots, slot, number, run, arm)
    _copy_arm(slots.start, slot, run.q, arm)
    _copy_arm(slots.target, slot, run.end, arm)
    slots.distance[slot] = squared_length(run, robot.model)


@inlined
def store(slots: SlotArrays, slot: int, q: Any) -> None:
    """Copy base and joints of the arm in a slot into configuration ``q``, in place.

    The entries of the other arm do not change.
    """
    q[0] = slots.q[0, slot]
    q[1] = slots.q[1, slot]
    for k in range(slots.links[slot]):
        q[slots.first_joint[slot] + k] = slots.q[BASE_DOF + k, slot]


@inlined
def compact(rows: Any, slot: int, last: int) -> None:
    """Replace column ``slot`` by column ``last``, in place.

    The run in slot ``slot`` has ended, and the run in slot ``last``, the last one in use, takes its
    place. ``rows`` has shape ``(rows, slots)``.
    """
    if slot != last:
        for row in range(len(rows)):
            rows[row, slot] = rows[row, last]


@inner
def padded_count(count: int) -> int:
    """Return how many slots a kernel computes if the first ``count`` slots are in use.

    A number above 1 is rounded up to a multiple of 8, the number of slots in a vector. The last of
    these slots may hold no run.
    """
    return count if count < 2 else (count + _VECTOR - 1) // _VECTOR * _VECTOR


# ---- Forward kinematics ----


@inlined
def winding(q: Any, slot: int) -> float:
    """Return an upper bound on the sizes of the link angles of an arm (in rad).

    Link angles are measured from +x. The bound is the sum of the absolute values of the joint
    angles of the arm in ``slot``. ``q`` has a column for each slot.
    """
    total = 0.0
    for k in range(len(q) - BASE_DOF):
        total += abs(q[BASE_DOF + k, slot])
    return total


@inner
def have_small_angles(slots: SlotArrays, count: int) -> bool:
    """Return whether all link angles in the first ``count`` slots are certainly below 1e5 rad.

    The condition is on the sizes of the angles, measured from +x (:func:`winding`). Slots beyond
    ``count`` that are computed to fill a vector are included (:func:`padded_count`).
    """
    large = 0
    for i in range(padded_count(count)):
        large += 0 if winding(slots.q, i) < MAX_ANGLE else 1
    return large == 0


def _chains_by(cos: Any, sin: Any) -> Any:
    """Return a kernel that computes the positions of shoulder, joints and hand in slots.

    The arguments of the kernel are the slots and the number of slots to fill. It computes the
    positions with the functions ``cos`` and ``sin``, and writes them into ``slots.x`` and
    ``slots.y`` (:func:`find_positions`).
    """

    @inner
    def chains(slots: SlotArrays, count: int) -> None:
        for i in range(count):
            arm = Arm(BASE_DOF, slots.length[:, i], slots.shoulder[0, i], slots.shoulder[1, i])
            chain_by(slots.q[:, i], arm, slots.x[:, i], slots.y[:, i], cos, sin)

    return chains


_near_chains = _chains_by(near_cosine, near_sine)
_far_chains = _chains_by(cosine, sine)


@inner
def find_positions(slots: SlotArrays, count: int, small_angles: bool) -> None:
    """Fill ``x`` and ``y`` of the first ``count`` slots for the configurations ``q``, in place.

    ``x`` and ``y`` are the positions of shoulder, joints and hand (in length units). Slots beyond
    ``count`` that are computed to fill a vector are filled as well (:func:`padded_count`).
    ``small_angles`` may be True only if all link angles, measured from +x, are below 1e5 rad in
    size.
    """
    if small_angles:
        _near_chains(slots, padded_count(count))
    else:
        _far_chains(slots, padded_count(count))
