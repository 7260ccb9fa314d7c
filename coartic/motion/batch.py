"""Many arms side by side: the arrays on which the compiled kernels work.

A *run* is a robot that makes a trial, a record of the batch. A *slot* holds the arm of a run while
it moves or is corrected. The innermost loop of a kernel runs over slots, so that the compiler makes
vector instructions of it; the number of links belongs to the type of the rows, so that loops over
links are unrolled. No operation mixes slots and none is reordered or fused: the result of a slot
does not depend on other slots, on their number or on the width of the vectors.

Robot parameters are one record: Numba looks at every field of a tuple each time a kernel is called.
"""

from __future__ import annotations

from functools import cache, lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from coartic.model import PAPER, PAPER_RADIUS, MotionModel
from coartic.motion.compile import chain_by, inlined, inner, record_type
from coartic.motion.trigonometry import LARGEST, cosine, near_cosine, near_sine, sine
from coartic.robot import BASE_DOF, HANDS, Arm, Robot

SLOTS = 72
"""Number of slots of a batch: few enough to stay in the processor's innermost cache."""
_VECTOR = 8  # slots that vectors hold; SLOTS is a multiple of it
GOING = 0.0
"""Status of a slot that has not ended."""
RobotRecord = Any
"""Record of a robot, its task's limits and the model, for kernels (:func:`robot_parameters`)."""
RunRecord = Any
"""Record of a run, a robot that makes a trial (:func:`batch_for`)."""
SlotArrays = Any
"""Record of the slots' arrays by name, whose last axis is the slot (:func:`layout`)."""


def _links_for(robot: Robot) -> int:
    """Return the number of links per arm for which the kernels of a robot are compiled, so that
    most robots share machine code: 4 or 8 if no arm has more links, else :attr:`Robot.max_links`.
    """
    return 4 if robot.max_links <= 4 else max(robot.max_links, 8)


def width_of(robot: Robot) -> int:
    """Return the number of entries of a robot's configuration in records of kernels: the ``dof``
    entries of the robot, then unused ones up to a base and two arms of :func:`_links_for` links
    each."""
    return BASE_DOF + 2 * _links_for(robot)


# ---- Robot parameters ----


@cache
def _parameters_type(links: int) -> np.dtype[np.void]:
    """Return the NumPy type of the record of :func:`robot_parameters` for ``links`` per arm."""
    arm = {"first_joint": np.int64, "count": np.int64, "links": (np.float64, links)}
    shoulder = dict.fromkeys(("shoulder_x", "shoulder_y"), np.float64)
    model = dict.fromkeys(MotionModel._fields, np.float64) | {"max_iterations": np.int64}
    fields = {
        "arms": (record_type(arm | shoulder), len(HANDS)),
        "model": record_type(model),
        "radius": np.float64,  # of the goals, length unit
        "free_x": np.bool_,  # True if the corrective process moves the base in x
        "free_y": np.bool_,
        "checks": np.bool_,  # True if an arm without a target stays if its hand is in the goal
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
) -> NDArray[np.void]:
    """Return robot, constants and options for kernels as one record, in an array of shape ``(1,)``.
    The array is cached: copy it before you change it.

    ``radius`` is the radius of the goals, length unit. The corrective process does not change base
    coordinates in ``locked_base``. With ``checks``, an arm without a target stays if its hand is in
    its goal already; without, the corrective process begins at once. Raises ValueError for a lock
    other than "x" and "y".
    """
    if not set(locked_base) <= {"x", "y"}:
        raise ValueError(f"locked_base is {locked_base!r}; it may name 'x' and 'y'")
    parameters = np.zeros(1, _parameters_type(_links_for(robot)))
    for hand, arm in zip(HANDS, parameters["arms"][0], strict=True):
        first_joint, links, *shoulder = robot.arm(hand)
        arm["first_joint"], arm["count"] = first_joint, len(links)
        arm["links"][: len(links)] = links
        arm["shoulder_x"], arm["shoulder_y"] = shoulder
    parameters["model"] = model.for_radius(radius)
    parameters["radius"], parameters["checks"] = radius, checks
    for axis in "xy":
        parameters[f"free_{axis}"] = axis not in locked_base
    return parameters


@inlined
def arm_of(robot: RobotRecord, hand: int) -> Arm:
    """Return the :class:`Arm` of a hand (0 left, 1 right) from a record of
    :func:`robot_parameters`; its links share memory with the record."""
    arm = robot.arms[hand]
    return Arm(arm.first_joint, arm.links[: arm.count], arm.shoulder_x, arm.shoulder_y)


# ---- Runs and slots ----


class Batch(NamedTuple):
    """Runs side by side, and the slots in which their arms are moved and corrected."""

    runs: Any
    """Records of the N runs, shape ``(N,)``."""
    at: Any
    """The rows of the slots, by name (:func:`layout`): a record in an array of shape ``(1,)``."""
    corrected: Any
    """The rows in ``at`` with all that a correction needs, in the same memory, shape ``(rows,
    SLOTS)``. Only to be copied: some rows are integers."""
    moved: Any
    """The rows in ``at`` with all that a movement needs, likewise."""


def batch_for(robot: Robot, count: int = SLOTS) -> Batch:
    """Return a new batch for kernels: ``count`` records of runs, with room for the links of
    ``robot``, and the arrays of 72 slots (:data:`SLOTS`), all entries 0. Each run needs a slot, so
    kernels take at most 72 runs."""
    width = width_of(robot)
    fields = {
        "q": (np.float64, width),  # where the robot is, length unit and rad
        "target": (np.float64, width),  # where it is to go, or where the correction has ended
        "preferred": (np.float64, width),  # posture that information prefers, length unit and rad
        "drift": np.float64,  # share of the way to it by which the mean of exploration moves
        "pull": np.float64,  # share that an iteration of the corrective process adds
        "goal": (np.float64, 2),  # x and y, length unit
        "hand": np.int64,  # that is to hit the goal: 0 left, 1 right
        "action": np.int64,  # next: see coartic.motion.trial
        "corrects": np.bool_,  # True if the corrective process acts where a movement misses
        "going": np.bool_,  # True if it has missed no goal so far
        "acting": np.bool_,  # True if the run is among those that are moved or corrected next
        "hit": np.bool_,  # True if the hand is within the goal's radius
        "converged": np.bool_,  # True if the corrective process did
        "ticks": np.int64,  # of the movement
        "iterations": np.int64,  # of the corrective process
        "evaluations": np.int64,  # of forward kinematics, since the last account
    }
    record, corrected, moved = layout(_links_for(robot))
    at = np.zeros(1, record)
    rows = at.view(np.float64).reshape(-1, SLOTS)
    return Batch(np.zeros(count, record_type(fields)), at, rows[corrected], rows[moved])


@cache
def layout(links: int) -> tuple[np.dtype[np.void], slice, slice]:
    """Return the NumPy type of :data:`SlotArrays` for arms with ``links`` links, and two slices of
    its rows (a row has a number for each slot): rows with all that a correction needs, and rows
    with all that a movement needs. Shorter arms end in links of length 0."""
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
        "rate": (links,),  # of the absolute link angles, rad a step
        "base_rate": (2,),
        "end": (2,),  # of the hand, where the target would put it
        "distance": (),  # from start to target; its square, before the arm sets off
        **dict.fromkeys(("step", "last", "slowness", "bend", "clearance"), ()),
        "x": (links + 1,),  # of shoulder, joints and hand
        "y": (links + 1,),
        "status": (),
        "pull": joints,  # what an iteration of a correction adds to q
        "jacobian": (2, *joints),
    }
    kinds = dict.fromkeys(("run", "first_joint", "links"), np.int64)
    record = np.dtype(
        [(name, kinds.get(name, np.float64), (*shape, SLOTS)) for name, shape in shapes.items()]
    )
    before = {name: place[1] // (8 * SLOTS) for name, place in (record.fields or {}).items()}
    return record, slice(before["target"]), slice(before["run"], before["x"])


@inlined
def _copy_arm(row: Any, slot: int, q: Any, arm: Arm) -> None:
    """Copy base and joints of ``arm`` from configuration ``q`` into column ``slot`` of ``row``,
    shape ``(2 + links, slots)``, in place; entries of links that the arm lacks become 0."""
    row[0, slot] = q[0]
    row[1, slot] = q[1]
    for k in range(len(row) - BASE_DOF):
        row[BASE_DOF + k, slot] = q[arm.first_joint + k] if k < len(arm.links) else 0.0


@inlined
def load(at: SlotArrays, slot: int, number: int, run: RunRecord, arm: Arm) -> None:
    """Copy ``number``, goal, base and joints of ``run``, record ``number`` (from 0) of its batch,
    and shoulder and links of its ``arm`` into column ``slot`` of the arrays ``at``, in place."""
    at.run[slot], at.first_joint[slot], at.links[slot] = number, arm.first_joint, len(arm.links)
    at.shoulder[0, slot] = arm.shoulder_x
    at.shoulder[1, slot] = arm.shoulder_y
    at.goal[0, slot], at.goal[1, slot] = run.goal[0], run.goal[1]
    for k in range(len(at.length)):
        at.length[k, slot] = arm.links[k] if k < len(arm.links) else 0.0
    _copy_arm(at.q, slot, run.q, arm)


@inlined
def squared_distance(run: RunRecord) -> float:
    """Return the squared joint-space distance from a run's configuration to its target."""
    square = 0.0
    for j in range(len(run.q)):
        delta = run.target[j] - run.q[j]
        square += delta * delta
    return square


@inlined
def start(at: SlotArrays, slot: int, number: int, run: RunRecord, arm: Arm) -> None:
    """Copy ``run``, record ``number`` (from 0) of its batch, into column ``slot`` of ``at``
    (:func:`load`), and with it the start, the target and the squared joint-space distance of its
    movement, so that :func:`move_slots` can make this movement."""
    load(at, slot, number, run, arm)
    _copy_arm(at.start, slot, run.q, arm)
    _copy_arm(at.target, slot, run.target, arm)
    at.distance[slot] = squared_distance(run)


@inlined
def store(at: SlotArrays, slot: int, q: Any) -> None:
    """Copy the base and the joints of the arm in column ``slot`` of ``at`` into configuration
    ``q``, in place; entries of the other arm stay."""
    q[0] = at.q[0, slot]
    q[1] = at.q[1, slot]
    for k in range(at.links[slot]):
        q[at.first_joint[slot] + k] = at.q[BASE_DOF + k, slot]


@inlined
def compact(rows: Any, slot: int, last: int) -> None:
    """Copy column ``last`` of ``rows``, shape ``(rows, slots)``, over column ``slot``, in place:
    the run in ``slot`` has ended, and the run in slot ``last`` takes its place."""
    if slot != last:
        for row in range(len(rows)):
            rows[row, slot] = rows[row, last]


@inner
def padded_count(count: int) -> int:
    """Return the number of slots to work on if ``count`` are in use: ``count`` itself for 0 and 1,
    else ``count`` rounded up to whole vectors of 8 slots, whose last slots may hold no run."""
    return count if count < 2 else (count + _VECTOR - 1) // _VECTOR * _VECTOR


# ---- Forward kinematics ----


@inlined
def winding(q: Any, slot: int) -> float:
    """Return an upper bound on the absolute angle from +x of every link of the arm in a slot
    (column of ``q``), rad: the sum of the absolute angles of its joints."""
    total = 0.0
    for k in range(len(q) - BASE_DOF):
        total += abs(q[BASE_DOF + k, slot])
    return total


@inner
def are_near(at: SlotArrays, count: int) -> bool:
    """Return whether the absolute angle from +x of every link in the first ``count`` columns of
    ``at``, and in columns that pad them (:func:`padded_count`), is certain to be below 1e5 rad
    (:func:`winding`)."""
    far = 0
    for i in range(padded_count(count)):
        far += 0 if winding(at.q, i) < LARGEST else 1
    return far == 0


def _chains_by(cos: Any, sin: Any) -> Any:
    """Return a kernel ``chains(at, count)`` that fills ``at.x`` and ``at.y`` in ``count`` columns
    as :func:`place` does, by the functions ``cos`` and ``sin``."""

    @inner
    def chains(at: SlotArrays, count: int) -> None:
        for i in range(count):
            arm = Arm(BASE_DOF, at.length[:, i], at.shoulder[0, i], at.shoulder[1, i])
            chain_by(at.q[:, i], arm, at.x[:, i], at.y[:, i], cos, sin)

    return chains


_near_chains = _chains_by(near_cosine, near_sine)
_far_chains = _chains_by(cosine, sine)


@inner
def place(at: SlotArrays, count: int, near: bool) -> None:
    """Fill the arrays ``x`` and ``y`` in the first ``count`` columns of ``at``, and in columns that
    pad them, in place, with the places of shoulder, joints and hand, length unit, for the
    configurations ``at.q``. ``near`` promises absolute link angles below 1e5 rad."""
    if near:
        _near_chains(at, padded_count(count))
    else:
        _far_chains(at, padded_count(count))
