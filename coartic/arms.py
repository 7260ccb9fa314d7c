"""N robots side by side, each at a subtask of its own trial of its own task.

A single task is the case in which all robots have the same one. What they are and have done is
held in arrays that live with them, and one call of a kernel makes the next subtask of all robots
of a kind: those with the same links, locks and size of goals.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import ArrayLike, NDArray

from coartic.inputs import WIDTHS, check_limits, real_array
from coartic.model import PAPER, MotionModel, check_model
from coartic.motion.compiled import entry, fill_row, inlined, inner, record_type
from coartic.motion.corrective import correct_lanes
from coartic.motion.initial import corrective_trial, initial_hands
from coartic.motion.lanes import LANES, board
from coartic.motion.movement import Goal
from coartic.motion.problem import arm_of
from coartic.motion.reach import Requests, Setup, blank, new_batch, reach_goals, setup_for
from coartic.motion.trials import Trials, hand_codes
from coartic.motion.trigonometry import joint_chain
from coartic.optimisers import FAILED
from coartic.robot import BASE_DOF, HANDS, LARGEST_FIGURE, Array, Hand, Robot
from coartic.tasks.task import MOST_GOALS, Task, hands_of

MOST_ARMS = 1_000_000
Observe = Literal["learner", "posture", "ahead"]
_FIXED, _PRESENT, _CORRECTIVE = 0, 1, 2  # middle of the box
_LEARNER, _POSTURE, _AHEAD = 0, 1, 2  # what is observed
_SIGHTS: dict[Observe, int] = {"learner": _LEARNER, "posture": _POSTURE, "ahead": _AHEAD}
UNIT = 4.0
"""Unit of lengths and ways in observations ahead: the reach of the paper's arms."""
MANY_GOALS = 10.0
"""Unit of the number of goals left in them."""
_LETTERS = tuple(map(ord, "LR"))
_COUNTS = ("ticks", "corrections", "iterations", "evaluations")
_FIELDS = dict.fromkeys(("task", "goal", *_COUNTS), np.int64) | {"reward": np.float64}
ROW = record_type(_FIELDS | dict.fromkeys(("acting", "completed", "ended"), np.bool_))
"""A robot: its task, which goal is next, its trial so far, and what its last step gave."""


class Table(NamedTuple):
    """Tasks as the kernels read them, K of them; D is the largest number of joints."""

    kinds: Any  # (K,)
    counts: Any  # (K,) of goals
    has: Any  # (K, 2) whether it has the hand
    starts: Any  # (K, D)
    goals: Any  # (K, G, 2)
    hands: Any  # (K, G) given ones
    moves: Any  # (K, G, D) whether a joint can move
    entries: Any  # (K, D) entry of each joint in an action
    around: Any  # (K, G, D) middle of the box where it is fixed


class Options(NamedTuple):
    """How an action says a target, and what is observed."""

    scale: float
    chooses: bool
    middle: int
    sight: int


class Robots(NamedTuple):
    """What N robots are and have done, and where those of a kind are put in order."""

    rows: Any  # (N,) of ROW
    q: Any  # (N, D)
    letters: Any  # (N, G) of hands used, as Unicode has them; 0 for none yet
    targets: Any  # (N, G, D)
    reached: Any  # (N, G, D)
    postures: Any  # (N, 2, D) where the corrective process would bring each hand from here
    found: Any  # (N, 2) whether it does
    seen: Any  # (N, O)
    order: Any  # (N,) those of a kind, those at one goal together
    sizes: Any  # (K * G,) always 0 between calls
    firsts: Any  # (K * G,)
    chain: Any  # (2, most links + 1) of one arm
    shown: Any  # (2,) whether an observation has the arm of this side


@inner
def sort_rows(kind: int, which: Any, table: Any, robots: Any, arms: Any) -> int:
    """Put the robots of a kind in order; returns the number of groups, one for each goal."""
    goals, count, groups = table.goals.shape[1], 0, 0
    for i in range(len(which)):
        row = robots.rows[i]
        going = which[i] and row.goal < table.counts[row.task]
        row.acting = going and table.kinds[row.task] == kind
        if row.acting:
            robots.sizes[row.task * goals + row.goal] += 1
    for i in range(len(which)):
        row = robots.rows[i]
        if row.acting:
            key = row.task * goals + row.goal
            if robots.sizes[key] > 0:
                arms.bounds[groups], robots.firsts[key] = count, count
                arms.goals[groups, 0, 0] = table.goals[row.task, row.goal, 0]
                arms.goals[groups, 0, 1] = table.goals[row.task, row.goal, 1]
                count += robots.sizes[key]
                robots.sizes[key] = 0
                groups += 1
            robots.order[robots.firsts[key]] = i
            robots.firsts[key] += 1
    arms.bounds[groups] = count
    return groups


@inlined
def is_wrong(action: Any, first: int) -> bool:
    """Whether an action is NaN in part, or for the hand."""
    missing = 0
    for j in range(first, len(action)):
        missing += 1 if np.isnan(action[j]) else 0
    no_hand = first == 1 and np.isnan(action[0])
    return no_hand or 0 < missing < len(action) - first


@inlined
def way(q: Any, posture: Any) -> float:
    """Distance in joint space, squared."""
    square = 0.0
    for j in range(len(q)):
        square += (posture[j] - q[j]) * (posture[j] - q[j])
    return square


@inlined
def nearer_hand(i: int, robots: Any) -> int:
    """The hand that the corrective process brings to the goal by the shorter way."""
    nearer = way(robots.q[i], robots.postures[i, 1]) < way(robots.q[i], robots.postures[i, 0])
    return 1 if robots.found[i, 1] and (nearer or not robots.found[i, 0]) else 0


@inlined
def write_request(
    i: int, p: int, action: Any, options: Any, table: Any, robots: Any, arms: Any
) -> None:
    """Write what an action says into the request of a robot."""
    row, q, target = robots.rows[i], robots.q[i], arms.targets[p, 0]
    hand, first = table.hands[row.task, row.goal], 1 if options.chooses else 0
    if options.chooses:
        hand = 1 if action[0] > 0.0 else 0
        if options.middle == _CORRECTIVE:
            nearer = nearer_hand(i, robots)
            hand = 1 - nearer if action[0] > 0.5 else nearer
    arms.hands[p, 0], arms.stops[p, 0] = hand, True
    robots.letters[i, row.goal] = _LETTERS[1] if hand == 1 else _LETTERS[0]
    fill_row(arms.starts[p], q)
    for j in range(len(target)):
        target[j] = q[j]
        if len(action) > first and np.isnan(action[first]):
            target[j] = np.nan
        elif table.moves[row.task, row.goal, j]:
            away = min(max(action[first + table.entries[row.task, j]], -1.0), 1.0)
            middle = q[j]
            if options.middle == _FIXED:
                middle = table.around[row.task, row.goal, j]
            elif options.middle == _CORRECTIVE:
                middle = robots.postures[i, hand, j]
            target[j] = middle + options.scale * away


@inlined
def see(i: int, options: Any, table: Any, robots: Any) -> None:
    """Observe what the learner knows, and the posture."""
    row, seen, goals = robots.rows[i], robots.seen[i], table.goals.shape[1]
    for j in range(goals + 2):
        seen[j] = 0.0
    if row.goal < goals:
        seen[row.goal] = 1.0
    if row.goal > 0:
        seen[goals + (1 if robots.letters[i, row.goal - 1] == _LETTERS[1] else 0)] = 1.0
    if options.sight == _POSTURE:
        for j in range(len(robots.q[i])):
            seen[goals + 2 + j] = robots.q[i, j]


@inlined
def note(i: int, p: int, options: Any, table: Any, robots: Any, arms: Any, reached: Any) -> None:
    """Add what came of a subtask to the trial of a robot."""
    row, goal = robots.rows[i], robots.rows[i].goal
    fill_row(robots.q[i], reached.q[p, 0])
    fill_row(robots.targets[i, goal], arms.targets[p, 0])
    row.ticks += reached.ticks[p, 0]
    row.corrections += reached.corrections[p, 0]
    row.iterations += reached.iterations[p, 0]
    row.evaluations += reached.evaluations[p, 0]
    row.reward = -FAILED
    if reached.hit[p, 0]:
        fill_row(robots.reached[i, goal], reached.q[p, 0])
        row.goal += 1
        row.reward = -reached.ticks[p, 0]
    row.completed = row.goal == table.counts[row.task]
    row.ended = row.completed or not reached.hit[p, 0]
    if options.sight != _AHEAD:
        see(i, options, table, robots)


@entry
def step_robots(
    kind: int,
    actions: Any,
    which: Any,
    options: Any,
    table: Any,
    robots: Any,
    arms: Any,
    setup: Any,
    reached: Any,
    batch: Any,
) -> int:
    """Make the next subtask of the robots of a kind; the first one whose action is wrong, or -1."""
    for i in range(len(which)):
        if not which[i]:
            robots.rows[i].reward, robots.rows[i].ended = 0.0, False
        elif is_wrong(actions[i], 1 if options.chooses else 0):
            return i
    groups = sort_rows(kind, which, table, robots, arms)
    count = arms.bounds[groups]
    for p in range(count):
        write_request(robots.order[p], p, actions[robots.order[p]], options, table, robots, arms)
    asked = Requests(
        arms.starts, arms.hands, arms.targets, arms.stops, arms.bounds, arms.goals[:groups]
    )
    reach_goals(asked, setup, reached, batch)
    for p in range(count):
        note(robots.order[p], p, options, table, robots, arms, reached)
    return -1


@inlined
def see_ahead(i: int, ahead: int, table: Any, robots: Any, setup: Any) -> None:
    """Observe posture, what the corrective process would do, and the goals in view."""
    row, q, seen = robots.rows[i], robots.q[i], robots.seen[i]
    for j in range(len(seen)):
        seen[j] = 0.0
    left = table.counts[row.task] - row.goal
    seen[0] = left / MANY_GOALS
    if row.goal > 0:
        seen[2 if robots.letters[i, row.goal - 1] == _LETTERS[1] else 1] = 1.0
    seen[3] = 1.0 if setup.corrector.free_x else 0.0
    seen[4] = 1.0 if setup.corrector.free_y else 0.0
    seen[5] = 1.0 if left > 0 and nearer_hand(i, robots) == 1 else 0.0
    at, most = 6, robots.chain.shape[1] - 1
    for hand in range(2):
        if table.has[row.task, hand]:
            arm = arm_of(setup, hand)
            links = len(arm.links)
            joint_chain(q, arm, robots.chain[0], robots.chain[1])
            seen[at] = links / 8.0
            seen[at + 1] = (robots.chain[0, links] - q[0]) / UNIT
            seen[at + 2] = (robots.chain[1, links] - q[1]) / UNIT
            for k in range(links):
                seen[at + 6 + k] = q[arm.first + k]
            if left > 0 and robots.found[i, hand]:
                posture = robots.postures[i, hand]
                seen[at + 3] = math.sqrt(way(q, posture)) / UNIT
                seen[at + 4] = (posture[0] - q[0]) / UNIT
                seen[at + 5] = (posture[1] - q[1]) / UNIT
                for k in range(links):
                    seen[at + 6 + most + k] = posture[arm.first + k] - q[arm.first + k]
        if robots.shown[hand]:
            at += 6 + 2 * most
    for k in range(min(ahead + 1, left)):
        seen[at] = 1.0
        seen[at + 1] = (table.goals[row.task, row.goal + k, 0] - q[0]) / UNIT
        seen[at + 2] = (table.goals[row.task, row.goal + k, 1] - q[1]) / UNIT
        at += 3


@entry
def look_robots(
    kind: int,
    ahead: int,
    observes: bool,
    which: Any,
    table: Any,
    robots: Any,
    arms: Any,
    setup: Any,
    batch: Any,
) -> None:
    """Ask the corrective process where it would bring each hand, and observe, for the robots of a
    kind."""
    groups = sort_rows(kind, which, table, robots, arms)
    size = len(batch.runs)
    for group in range(groups):
        goal = Goal(arms.goals[group, 0, 0], arms.goals[group, 0, 1], setup.radius)
        for first in range(arms.bounds[group], arms.bounds[group + 1], size):
            count = min(size, arms.bounds[group + 1] - first)
            for hand in range(2):
                if not robots.shown[hand]:
                    continue
                for n in range(count):
                    i, run = robots.order[first + n], batch.runs[n]
                    fill_row(run.target, robots.q[i])
                    board(batch.lanes.at, n, n, run.target, arm_of(setup, hand))
                correct_lanes(batch.lanes, count, goal, setup.corrector, setup.model, batch.runs)
                for n in range(count):
                    i, run = robots.order[first + n], batch.runs[n]
                    fill_row(robots.postures[i, hand], run.target)
                    has = table.has[robots.rows[i].task, hand]
                    robots.found[i, hand] = run.converged and has
    for i in range(len(which)):
        if observes and which[i] and table.kinds[robots.rows[i].task] == kind:
            see_ahead(i, ahead, table, robots, setup)


class Frame(NamedTuple):
    """What the tasks of robots have at most."""

    tasks: int
    goals: int
    links: int
    dof: int
    hands: tuple[Hand, ...]


class Arms:
    """N robots, each at a subtask of its own trial.

    Parameters
    ----------
    count : int
        Number of robots.
    task : Task, optional
        The task of all of them; without one, each is given its own (:meth:`give`).
    frame : Frame, optional
        What tasks have at most that robots are given; by default those of ``task``.
    scale : float
        Half the width of the box of targets, length unit (base) and rad (joints).
    around : str or array_like, shape (G, dof), optional
        Middle of the box. By default the present configuration. A configuration for each goal, or
        a hand sequence (``"RLRL"``), which means the configurations in which the corrective
        process alone hits the goals; ``"hands"`` is the sequence ``hands``, or where there is none
        the task's initial hands. ``"corrective"``: where the corrective process would bring the
        hand from the present configuration, which it knows the next goal alone for.
    observe : {"learner", "posture", "ahead"}
        What is observed.
    ahead : int
        Goals in view beyond the next one, where ``"ahead"`` is observed.
    hands : str, optional
        Hand sequence of all trials, or ``"initial"`` for the task's initial hands; by default the
        actions choose.
    model : MotionModel
        Constants of movement.

    Raises
    ------
    ValueError
        An option does not fit the task.

    Notes
    -----
    An action has an entry for the hand, unless the robot has one hand or ``hands`` are given, and
    an entry for each joint that can move. The box is from -1 to 1. The entry for the hand chooses
    the left one (0 and below) or the right one; with ``around="corrective"`` the hand for which
    the corrective process has the shorter way (0.5 and below) or the other one. Where the entries
    of all joints are NaN, no movement is made to a target: the corrective process acts alone, and
    the step takes 0 ticks if the hand is inside the goal already. With ``hands``, an arm that hits
    neither this goal nor a later one keeps its posture.

    An observation of ``"learner"`` has an entry for each goal, 1 for the next goal, and two for the
    hand that hit the goal before; ``"posture"`` has also the configuration ``(dof,)`` and the goals
    ``(G, 2)``. That of ``"ahead"`` is in the table of the guide to agents.
    """

    def __init__(
        self,
        count: int,
        task: Task | None = None,
        *,
        frame: Frame | None = None,
        scale: float = 1.0,
        around: str | ArrayLike | None = None,
        observe: Observe = "learner",
        ahead: int = 1,
        hands: str | None = None,
        model: MotionModel = PAPER,
    ) -> None:
        check_limits("num_envs", count, 1, MOST_ARMS)
        check_limits("scale", scale, *WIDTHS)
        check_limits("ahead", ahead, 0, MOST_GOALS)
        if observe not in _SIGHTS:
            raise ValueError(
                f"observe is {observe!r}; it is one of {', '.join(map(repr, _SIGHTS))}"
            )
        if task is not None:
            robot = task.robot
            frame = Frame(1, len(task.goals), robot.most_links, robot.dof, task.hands)
        assert frame is not None
        most, goals, links, dof, sides = frame
        self.scale, self.model, self.ahead = float(scale), check_model(model), ahead
        self._around, self._given, self._sides = around, hands, sides
        self.chooses_hands = hands is None and len(sides) == 2
        middles = {None: _PRESENT, "corrective": _CORRECTIVE}
        middle = middles.get(around, _FIXED) if isinstance(around, str | None) else _FIXED
        self._sight = _SIGHTS[observe]
        self.tasks: list[Task] = []
        """Tasks that robots were given."""
        self._slots: dict[str, int] = {}
        self._names = np.full(most, None, dtype=object)
        self._kinds: dict[Any, int] = {}
        self._setups: list[Setup] = []
        self._table = Table(
            kinds=np.zeros(most, np.int64),
            counts=np.zeros(most, np.int64),
            has=np.zeros((most, 2), np.bool_),
            starts=np.zeros((most, dof)),
            goals=np.zeros((most, goals, 2)),
            hands=np.zeros((most, goals), np.int64),
            moves=np.zeros((most, goals, dof), np.bool_),
            entries=np.zeros((most, dof), np.int64),
            around=np.zeros((most, goals, dof)),
        )
        self._frame, self._columns = frame, None
        if task is None:  # the base, and the arms of the family's hands
            parts = [_columns(hand, links, links) for hand in HANDS if hand in sides]
            self._columns = np.concatenate([np.arange(BASE_DOF), *parts])
        else:
            self.add(task)
            self._table.entries[0, self.free] = np.arange(len(self.free))
        joints = len(self.free) if self._columns is None else len(self._columns)
        self.action_space = Box(-1.0, 1.0, (self.chooses_hands + joints,), np.float32)
        size = goals + 2 + (dof + 2 * goals) * (observe == "posture")
        bounded = goals + 2
        if observe == "ahead":
            size, bounded = 6 + len(sides) * (6 + 2 * links) + 3 * (ahead + 1), 0
        high = np.ones(size, dtype=np.float32)
        high[bounded:] = LARGEST_FIGURE
        low = np.where(np.arange(size) < bounded, 0.0, -high).astype(np.float32)
        self.observation_space = Box(low, high, dtype=np.float32)
        self._options = Options(self.scale, self.chooses_hands, middle, self._sight)
        self.rows = np.zeros(count, ROW)
        """Task, next goal and trial of each robot, records of :data:`ROW`."""
        self.q = np.zeros((count, dof))
        """Configurations; zeros beyond the joints of a robot that has fewer."""
        letters = np.zeros((count, goals), np.uint32)
        self.hands = letters.view(f"U{goals}")[:, 0]
        """Hands used so far (``"RL"``), shape ``(N,)``."""
        self.goal = self.rows["goal"]
        """Number of the next goal, from 0, shape ``(N,)``."""
        places = np.full((2, count, goals, dof), np.nan)
        self._robots = Robots(
            self.rows,
            self.q,
            letters,
            targets=places[0],
            reached=places[1],
            postures=np.zeros((count, 2, dof)),
            found=np.zeros((count, 2), np.bool_),
            seen=np.zeros((count, size), np.float32),
            order=np.zeros(count, np.int64),
            sizes=np.zeros(most * goals, np.int64),
            firsts=np.zeros(most * goals, np.int64),
            chain=np.zeros((2, links + 1)),
            shown=np.array([hand in sides for hand in HANDS]),
        )
        named = {name: self.rows[name] for name in ("completed", *_COUNTS)}
        self.trials = Trials(targets=places[0], reached=places[1], **named)
        """The trials as far as they are made."""
        self._actions = np.zeros((count, *self.action_space.shape))
        self._asked = Requests(
            starts=np.zeros((count, dof)),
            hands=np.zeros((count, 1), np.int64),
            targets=np.zeros((count, 1, dof)),
            stops=np.ones((count, 1), np.bool_),
            bounds=np.zeros(count + 1, np.int64),
            goals=np.zeros((count, 1, 2)),
        )
        self._reached = blank(self._asked)
        widest = Robot((1.0,) * links, (1.0,) * links)
        self._batch = new_batch(widest, min(count, LANES))
        if task is not None:
            self.reset(np.ones(count, np.bool_))

    @property
    def task(self) -> Task:
        """The task of the first robot."""
        return self.tasks[int(self.rows["task"][0])]

    @property
    def free(self) -> NDArray[np.int64]:
        """Joints of the first task that have an entry in an action."""
        return np.flatnonzero(self._table.moves[0].any(axis=0))

    def given_hands(self, task: Task) -> str | None:
        """Hands that are given on a task; None where actions choose."""
        if self._given == "initial":
            return initial_hands(task, model=self.model)
        if self._given is None and len(task.hands) == 1:
            return len(task.goals) * task.hands[0][0].upper()
        return self._given

    def add(self, task: Task) -> int:
        """Enter a task into the table; returns its place. Raises ValueError for a wrong option."""
        check_model(self.model, radius=task.radius)
        place, goals, dof = len(self.tasks), len(task.goals), task.robot.dof
        hands = self.given_hands(task)
        table = self._table
        if hands is not None:
            table.hands[place, :goals] = hand_codes(task, hands, 1)[0]
        middle = self._middle(task, hands)
        if middle is not None:
            table.around[place, :goals, :dof] = middle
        kind = task.robot, float(task.radius), task.locked_base
        if kind not in self._kinds:
            self._kinds[kind] = len(self._setups)
            self._setups.append(
                setup_for(task.robot, kind[1], locked_base=task.locked_base, model=self.model)
            )
        table.kinds[place], table.counts[place] = self._kinds[kind], goals
        table.has[place] = [hand in task.hands for hand in HANDS]
        table.starts[place, :dof], table.goals[place, :goals] = task.q0, task.goal_array
        table.moves[place, :goals, :2] = [axis not in task.locked_base for axis in "xy"]
        for goal in range(goals):
            for hand in task.hands if hands is None else hands_of(hands)[goal:]:
                table.moves[place, goal, task.robot.joints(hand)] = True
        if self._columns is not None:
            columns = _joint_columns(task.robot, self._frame.links)
            table.entries[place, :dof] = np.searchsorted(self._columns, columns)
        self.tasks.append(task)
        self._slots[task.name], self._names[place] = place, task.name
        return place

    def _middle(self, task: Task, hands: str | None) -> Array | None:
        """The middle of the box at each goal of a task, ``(G, dof)``, where it is fixed."""
        around, goals, dof = self._around, len(task.goals), task.robot.dof
        if around is None or (isinstance(around, str) and around == "corrective"):
            return None
        if isinstance(around, str):
            if around == "hands":
                around = hands or initial_hands(task, model=self.model)
            if {*around} - {"L", "R"} or len(around) != goals:
                raise ValueError(
                    f"around is {around!r}; it must have L or R for each of {goals} goals, or be "
                    "'hands' or 'corrective'"
                )
            around = corrective_trial(task, around, model=self.model).configurations
        middle = real_array("around", around)
        if middle.shape != (goals, dof):
            raise ValueError(f"around has shape {middle.shape}; it must be ({goals}, {dof})")
        if not (np.abs(middle) <= LARGEST_FIGURE).all():
            raise ValueError(f"around has figures that are not finite or beyond {LARGEST_FIGURE:g}")
        return middle

    def give(self, row: int, task: Task | str) -> None:
        """Give a robot a task, at whose start it is when it is reset, or one that it knows by name.

        Raises KeyError for the name of a task that was not given before.
        """
        if not isinstance(task, str) and task.name not in self._slots:
            self.add(task)
        self.rows["task"][row] = self._slots[task if isinstance(task, str) else task.name]

    def knows(self, name: str) -> bool:
        """Whether a task of this name was given before."""
        return name in self._slots

    def reset(self, which: NDArray[np.bool_]) -> None:
        """Put these robots, of a mask ``(N,)``, at the start of their tasks."""
        robots, goals = self._robots, self._table.goals.shape[1]
        tasks = self.rows["task"][which]
        for name in ROW.names or ():
            if name != "task":
                self.rows[name][which] = 0
        self.q[which] = self._table.starts[tasks]
        robots.letters[which] = 0
        robots.targets[which] = robots.reached[which] = np.nan
        if self._sight != _AHEAD:
            robots.seen[which, : goals + 2] = np.arange(goals + 2) == 0
        if self._sight == _POSTURE:
            robots.seen[which, goals + 2 : goals + 2 + self.q.shape[1]] = self.q[which]
            robots.seen[which, -2 * goals :] = self._table.goals[tasks].reshape(-1, 2 * goals)
        self._look(which)

    def _kinds_of(self, which: NDArray[np.bool_]) -> Sequence[int]:
        """Kinds of robots among these, for each of which a kernel is called."""
        if len(self._setups) == 1:
            return (0,)
        return list(np.unique(self._table.kinds[self.rows["task"][which]]))

    def _look(self, which: NDArray[np.bool_]) -> None:
        """Find where the corrective process would bring these robots, where it is needed."""
        if self._sight == _AHEAD or self._options.middle == _CORRECTIVE:
            for kind in self._kinds_of(which):
                look_robots(
                    kind, self.ahead, self._sight == _AHEAD, which, self._table, self._robots,
                    self._asked, self._setups[kind], self._batch,
                )  # fmt: skip

    def centre(self, row: int) -> Array:
        """The middle of the box of targets of a robot, for each hand, shape ``(2, dof)``."""
        robots, record = self._robots, self.rows[row]
        middle = {
            _PRESENT: self.q[row],
            _FIXED: self._table.around[record["task"], record["goal"]],
            _CORRECTIVE: robots.postures[row],
        }[self._options.middle]
        dof = self.tasks[record["task"]].robot.dof
        return np.array(np.broadcast_to(middle, (2, self.q.shape[1]))[:, :dof])

    def action_for(self, row: int, hand: Hand, target: Array | None) -> Array:
        """The action that moves this hand of a robot to a target ``(dof,)``.

        Without a target, which is None or NaN, the corrective process acts alone: the entries of
        the joints are NaN. Raises ValueError for a target outside of the box, which no action leads
        to, and for a hand that the robot does not have or, where hands are given, not at this goal.
        """
        record, robots = self.rows[row], self._robots
        task = self.tasks[record["task"]]
        if hand not in task.hands:
            raise ValueError(f"hand is {hand!r}; it must be one of {task.hands}")
        code, side = HANDS.index(hand), -1.0 if hand == "left" else 1.0
        given = self._table.hands[record["task"], record["goal"]]
        if not self.chooses_hands and code != given:
            raise ValueError(f"hand is {hand!r}; the {HANDS[given]} hand is given at this goal")
        if self._options.middle == _CORRECTIVE and self.chooses_hands:
            ways = ((robots.postures[row] - self.q[row]) ** 2).sum(axis=1)
            nearer = np.where(robots.found[row], ways, np.inf).argmin()
            side = -1.0 if code == nearer else 1.0
        centre = self.centre(row)[code]
        wanted = np.full_like(centre, np.nan) if target is None else real_array("target", target)
        if wanted.shape != centre.shape:
            raise ValueError(f"target has shape {wanted.shape}; it must be {centre.shape}")
        free = np.flatnonzero(self._table.moves[record["task"]].any(axis=0))
        away = (wanted - centre)[free] / self.scale
        if (far := np.nanmax(np.abs(away), initial=0.0)) > 1.0 + 1e-9:
            raise ValueError(
                f"the target is outside of the box: it needs a scale of {far * self.scale:.3g}"
            )
        action = np.full(self.action_space.shape, np.nan if np.isnan(away).all() else 0.0)
        first = int(self.chooses_hands)
        action[first + self._table.entries[record["task"], free]] = away
        action[:first] = side
        return action

    def step(self, actions: ArrayLike, which: NDArray[np.bool_]) -> tuple[Array, NDArray[np.bool_]]:
        """Make the next subtask of these robots: rewards ``(N,)``, and whose trials have ended.

        ``actions`` has shape ``(N, A)``. Entries are clipped to the box. Raises ValueError for
        another shape, and for entries that are NaN, unless those of all joints are.
        """
        chosen = real_array("actions", actions)
        if chosen.shape != self._actions.shape:
            shape = self._actions.shape
            raise ValueError(f"actions have shape {chosen.shape}; it must be {shape}")
        self._actions[:] = chosen
        for kind in self._kinds_of(which):
            wrong = step_robots(
                kind, self._actions, which, self._options, self._table, self._robots,
                self._asked, self._setups[kind], self._reached, self._batch,
            )  # fmt: skip
            if wrong >= 0:
                raise ValueError(
                    "an action is not finite; NaN is for all joints, not for some, and not for the "
                    "hand"
                )
        self._look(which)
        return self.rows["reward"].copy(), self.rows["ended"].copy()

    def observations(self) -> NDArray[np.float32]:
        """Observations ``(N, O)``."""
        return np.array(self._robots.seen)

    def infos(self) -> dict[str, Any]:
        """Hands used so far (``"RL"``), corrective movements made, whether all goals are hit; of
        robots with tasks of their own also the task's name."""
        given = {} if self._columns is None else {"task": self._names[self.rows["task"]]}
        return given | {
            "hands": self.hands.copy(),
            "corrections": self.rows["corrections"].copy(),
            "is_success": self.rows["completed"].copy(),
        }


def _columns(hand: Hand, links: int, most: int) -> NDArray[np.int64]:
    """Places of an arm's joints in a configuration with ``most`` links an arm."""
    return BASE_DOF + most * HANDS.index(hand) + np.arange(links)


def _joint_columns(robot: Robot, most: int) -> NDArray[np.int64]:
    """Place of each joint of a robot in a configuration with ``most`` links an arm."""
    arms = ((hand, len(robot.arm(hand).links)) for hand in HANDS)
    parts = [_columns(hand, links, most) for hand, links in arms]
    return np.concatenate([np.arange(BASE_DOF), *parts])
