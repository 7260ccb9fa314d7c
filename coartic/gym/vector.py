"""N robots that act side by side, each in a trial of its own, as a vector environment."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from coartic.gym.kernel import VectorState, observe, step_robots
from coartic.internal.limits import MOST_RUN_SEED, brief_value, check_limits, real_array
from coartic.internal.text import counted
from coartic.model import PAPER, MotionModel, check_model
from coartic.motion.batch import SLOTS, batch_for, robot_parameters
from coartic.motion.trial import count_trials, empty_accounts
from coartic.robot import BASE_DOF, HANDS, LARGEST_FIGURE, Array, Robot
from coartic.tasks.catalogue import as_task
from coartic.tasks.families import LOCKED, instance_names, is_family, load_family
from coartic.tasks.task import MOST_GOALS, Split, Task

REACH = 0.5
"""Half the width of the box of targets, length unit (base) and rad (angles)."""
RowIndex = NDArray[np.int64] | slice


class TaskVectorEnv(VectorEnv):
    """Vector environment: N robots act side by side, each in a trial of its own.

    An episode is a trial, of at most as many steps as there are goals. The reward of a step is
    minus its ticks, or -1,000,000 where the corrective process fails, which ends the trial. A trial
    that has ended starts again in the same step, as in Gymnasium's mode ``SAME_STEP``:
    ``final_obs`` and ``final_info`` have its last observation and infos. Only the draw of an
    instance of a family is random.

    Parameters
    ----------
    num_envs : int
        Number of robots.
    task : Task, str or Path
        The task; or a family, ``"two-armed/v1"`` or the path of its file: each trial has an
        instance of the family.
    split : {"development", "test", "fresh"}, optional
        Instances of the family: to train on (``"development"``, the default), to report on
        (``"test"``), or of a ``year`` (``"fresh"``).
    count : int, optional
        How many instances of the split, from its first; by default 1,000 of the development split,
        10 of the test and fresh splits.
    year : int, optional
        Year of fresh instances, such as 2027.
    ahead : int
        Number of goals in view beyond the next goal.
    model : MotionModel
        Constants of movement.
    render_mode : {"rgb_array"}, optional
        With it ``render`` returns a picture of each robot.

    Raises
    ------
    ValueError, TypeError, TaskError
        An option is wrong, or there is no such task or family.

    Notes
    -----
    Joints are the coordinates of the base (length unit) and the angles of the arms (rad) that can
    move, the arms in the order of the task's ``hands``; each arm counts with the most links that an
    arm of the task or family can have.

    An observation has an entry for the next goal and for each goal ahead, 1 if the goal exists,
    else 0; x and y of each from the base, length unit, 0 without a goal; and the joints. In a
    family whose robots differ in links an entry for each joint follows, 1 where the robot can move
    the joint.

    An action has an entry for the hand, where the task has two, and an entry for each joint. The
    box is from -1 to 1; entries beyond are clipped. For each hand the corrective process finds a
    posture at the goal. With an entry up to 0.5 the hand is the hand whose posture is nearer in
    joint space, above 0.5 the other hand. The target is the posture of this hand, or, where the
    process fails, the present posture, plus :data:`REACH` times the entries of the joints: zeros
    mostly do what the corrective process does with this hand. Entries of joints that a robot cannot
    move do nothing.
    """

    metadata: ClassVar[dict[str, Any]] = {
        **{"render_modes": ["rgb_array"], "render_fps": 4},
        "autoreset_mode": AutoresetMode.SAME_STEP,
    }

    def __init__(
        self,
        num_envs: int,
        task: Task | str | Path | None = None,
        *,
        split: Split | None = None,
        count: int | None = None,
        year: int | None = None,
        ahead: int = 1,
        model: MotionModel = PAPER,
        render_mode: str | None = None,
    ) -> None:
        if task is None:
            raise TypeError(
                "task is missing: give task=, a task, its name or file, or a family, such as "
                "task='two-armed/v1'"
            )
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(
                f"render_mode is {brief_value(render_mode)}; it must be 'rgb_array' or None. "
                "gymnasium.make knows others, such as 'human' for a window"
            )
        check_limits("num_envs", num_envs, 1, 1_000_000)
        check_limits("ahead", ahead, 0, MOST_GOALS)
        self.num_envs, self.model = num_envs, check_model(model)
        self.render_mode = render_mode
        self.options = {"task": task, "ahead": ahead, "model": model}
        self.instances = {"split": split, "count": count, "year": year}  # of a family
        self.tasks: list[Task | str]  # or names of instances
        if isinstance(task, str | Path) and is_family(str(task)):
            task = str(task)
            family = load_family(task)
            self.tasks = [*instance_names(task, split or "development", count, year)]
            locked = set.intersection(*({*LOCKED[base]} for base in family.base))
            (fewest, links), hands, goals = family.links, family.hands, family.goals[1]
        elif (split, count, year) != (None, None, None):
            raise ValueError(f"split, count and year are for families, not {brief_value(task)}")
        else:
            only = as_task(task)
            self.tasks, locked = [only], {*only.locked_base}
            fewest = links = only.robot.most_links
            hands, goals = only.hands, len(only.goals)
        self.names = np.array([getattr(each, "name", each) for each in self.tasks], dtype=object)
        # All robots are taken for the widest, some of whose links have no length.
        self._widest = Robot((1.0,) * links, (1.0,) * links)
        self._kind_of: dict[Any, int] = {}  # number of each robot with its locks and size of goals
        base = [place for place, axis in enumerate("xy") if axis not in locked]
        arms = [np.arange(self._widest.dof)[self._widest.joints(hand)] for hand in hands]
        joints, view = np.concatenate([base, *arms]).astype(np.int64), ahead + 1
        sizes = [view, 2 * view + len(joints), len(joints) * (fewest < links)]
        high = np.repeat([1.0, LARGEST_FIGURE, 1.0], sizes).astype(np.float32)
        tasks, batch, dof = len(self.tasks), batch_for(self._widest), self._widest.dof
        self.state = VectorState(  # in which no task is loaded and no trial goes on
            task=np.zeros(num_envs, np.int64),
            goal=np.zeros(num_envs, np.int64),
            q=np.zeros((num_envs, dof)),
            going=np.zeros(num_envs, np.bool_),
            actions=np.zeros((num_envs, len(hands) - 1 + len(joints))),
            rewards=np.zeros(num_envs),
            seen=np.zeros((num_envs, len(high)), np.float32),
            parameters=robot_parameters(self._widest)[:0],
            kinds=np.full(tasks, -1),
            goals=np.zeros((tasks, goals, 2)),
            counts=np.zeros(tasks, np.int64),
            movable=np.zeros((tasks, len(joints)), np.bool_),
            joints=joints,
            sides=np.array([HANDS.index(hand) for hand in hands]),
            ahead=ahead,
            reach=REACH,
            runs=np.stack([batch.runs] * len(hands)),
            at=batch.at,
            corrected=batch.corrected,
            moved=batch.moved,
            accounts=empty_accounts(self._widest, SLOTS, 1).goals[:, 0, 0],
            indices=np.zeros(SLOTS, np.int64),
        )
        self.single_action_space = Box(-1.0, 1.0, self.state.actions.shape[1:], np.float32)
        self.single_observation_space = Box(np.where(high > 1.0, -high, np.float32(0.0)), high)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._starts = np.zeros((tasks, dof))
        self._rngs: list[Any] = [None] * num_envs

    def task_at(self, number: int) -> Task:
        """Return task ``number``, from 0, of the environment's tasks; the first call loads the task
        into the state of the robots. Raises ValueError for another number."""
        check_limits("number", number, 0, len(self.tasks) - 1)
        task, state = as_task(self.tasks[number]), self.state
        if state.kinds[number] < 0:
            check_model(self.model, radius=task.radius)
            self.tasks[number], places = task, self._places_of(task.robot)
            self._starts[number, places] = task.q0
            locked = ["xy".index(axis) for axis in task.locked_base]
            state.movable[number] = np.isin(state.joints, np.setdiff1d(places, locked))
            state.goals[number, : len(task.goals)] = task.goal_array
            state.counts[number] = len(task.goals)
            kind = task.robot, float(task.radius), task.locked_base
            if kind not in self._kind_of:
                self._kind_of[kind] = len(state.parameters)
                parameters = robot_parameters(
                    self._widest, task.radius, locked_base=task.locked_base, model=self.model
                ).copy()
                for hand, arm in zip(HANDS, parameters["arms"][0], strict=True):
                    _, links, arm["shoulder_x"], arm["shoulder_y"] = task.robot.arm(hand)
                    arm["links"] = np.pad(links, (0, len(arm["links"]) - len(links)))
                known = np.concatenate([state.parameters, parameters])
                self.state = state._replace(parameters=known)
            state.kinds[number] = self._kind_of[kind]
        return task

    def _places_of(self, robot: Robot) -> NDArray[np.int64]:
        """Return, for each entry of a configuration of ``robot``, its index in a configuration of
        the robot with the most links, shape ``(dof,)``."""
        left, right = (np.arange(len(robot.arm(hand).links)) for hand in HANDS)
        return np.concatenate([[0, 1], BASE_DOF + left, BASE_DOF + self._widest.most_links + right])

    def _begin(self, rows: RowIndex, numbers: ArrayLike) -> None:
        """Put each of the robots ``rows`` at the start of a task, whose number (from 0) ``numbers``
        has; fill in the observations of all robots."""
        state = self.state
        state.task[rows], state.goal[rows], state.going[rows] = numbers, 0, True
        for number in {*state.task[rows].tolist()}:
            self.task_at(number)
        state.q[rows] = self._starts[state.task[rows]]
        observe(*self.state)

    def _move(self, actions: Array, rows: RowIndex = slice(None)) -> None:
        """Let all robots whose trial goes on reach for their next goal; change the state in place.
        ``actions``, ``(n, A)``, are of the n robots ``rows``; other robots keep their actions.
        Raises ValueError for actions of another shape, or that are not finite."""
        shape = self.state.actions[rows].shape
        if actions.shape != shape:
            raise ValueError(f"actions have shape {actions.shape}; it must be {shape}")
        self.state.actions[rows] = actions
        begun = step_robots(*self.state)
        if begun < 0:
            which = f" of robot {-1 - begun}" if self.num_envs > 1 else ""
            raise ValueError(f"the action{which} is not finite; it must be numbers")
        count_trials(begun)

    def infos(self, there: NDArray[np.bool_] | bool = True) -> dict[str, Any]:
        """Return a dictionary of arrays of shape ``(N,)``: ``task``, the name of each robot's task,
        such as ``mine.v1.toml/i017`` for an instance of the family of a file; ``is_success``, True
        where the robot has hit all goals of its trial; ``_task`` and ``_is_success``, both equal to
        ``there``, True where the entry counts. Before the first reset entries mean nothing. After
        :meth:`step` a trial that ended has started again: its last infos are in ``final_info`` of
        the step."""
        task = self.state.task
        infos = {"task": self.names[task], "is_success": self.state.goal == self.state.counts[task]}
        return infos | {f"_{name}": np.full(self.num_envs, there) for name in infos}

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin a trial of each of the N robots; return observations ``(N, O)`` and the dictionary
        of infos. ``seed``: a list of a seed for each robot, or one number, with which robot i (from
        0) has ``seed + i``; a robot with None keeps its random generator, which draws the tasks and
        which the system seeds at first. Raises ValueError for any option, for a list of another
        length, and for seeds that are not whole numbers from 0 to 2^128 - 1.
        """
        check_no_options(options)
        if isinstance(seed, Iterable):
            seeds = [*map(whole_seed, seed)]
        else:
            first = whole_seed(seed)
            seeds = [None if first is None else first + row for row in range(self.num_envs)]
        if len(seeds) != self.num_envs:
            there = counted(self.num_envs, "environment")
            raise ValueError(f"{counted(len(seeds), 'seed')} for {there}")
        for row, each in enumerate(seeds):
            if each is not None or self._rngs[row] is None:
                self._rngs[row] = seeding.np_random(each)[0]
        self._begin_anew(np.ones(self.num_envs, np.bool_))
        return self.state.seen.copy(), self.infos()

    def step(
        self, actions: ArrayLike
    ) -> tuple[NDArray[np.float32], Array, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Let each robot reach for its next goal by its row of ``actions``, shape ``(N, A)``.

        Returns observations ``(N, O)``, rewards ``(N,)``, True where the trial has ended, ``(N,)``,
        False for each (none is truncated), ``(N,)``, and a dictionary of infos. A trial that has
        ended starts again in this step: its observation is the first of the next trial;
        ``final_obs`` and ``final_info`` of the infos are the last observation and infos of the
        trial that ended. Raises ResetNeeded before the first reset, and ValueError for actions of
        another shape or that are not finite.
        """
        state = self.state
        if not state.going.all():
            raise ResetNeeded("no trial goes on: reset first")
        self._move(real_array("actions", actions))
        final, ended = {}, ~state.going
        if ended.any():
            last = np.full(self.num_envs, None, dtype=object)
            for row in np.flatnonzero(ended).tolist():
                last[row] = state.seen[row].copy()
            final = {"final_obs": last, "final_info": self.infos(ended)}
            final |= {f"_{name}": ended.copy() for name in ("final_obs", "final_info")}
            self._begin_anew(ended)
        infos = self.infos() | final
        return state.seen.copy(), state.rewards.copy(), ended, np.zeros_like(ended), infos

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Return a picture of each robot and its goals, RGB, ``(400, 600, 3)``, in which goals hit
        so far are filled; None if the environment was made without ``render_mode``."""
        if self.render_mode is None:
            return None
        return tuple(map(self.picture, range(self.num_envs)))

    def picture(self, row: int) -> NDArray[np.uint8]:
        """Return a picture of robot ``row``, from 0, and its goals, RGB, ``(400, 600, 3)``, in
        which goals hit so far are filled."""
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        from coartic.pictures.drawing import box, circle_goals, draw_robot, fill_goals

        task, state = self.task_at(self.state.task.item(row)), self.state
        (left, bottom), (right, top) = box(task, task.q0, margin=1.0)
        figure = Figure(figsize=(6, 4), dpi=100)
        canvas: Any = FigureCanvasAgg(figure)
        axes = figure.add_subplot(aspect="equal", xlim=(left, right), ylim=(bottom, top))
        draw_robot(axes, task, state.q[row, self._places_of(task.robot)], weight=1.5)
        fill_goals(circle_goals(axes, task), np.arange(len(task.goals)) < state.goal[row])
        canvas.draw()
        return np.asarray(canvas.buffer_rgba())[..., :3].copy()

    def _begin_anew(self, ended: NDArray[np.bool_]) -> None:
        number, rows = len(self.tasks), np.flatnonzero(ended)
        drawn = [self._rngs[row].integers(number) for row in rows.tolist()] if number > 1 else 0
        self._begin(rows, drawn)


def check_no_options(options: Mapping[str, Any] | None) -> None:
    """Raise ValueError if a reset has options; None and an empty mapping pass."""
    if options:
        raise ValueError(f"reset takes no options, but {brief_value(options)} are given")


def whole_seed(seed: Any) -> int | None:
    """Return a seed, a whole number from 0 to 2**128 - 1, as an int, or None for None. Raises
    ValueError for anything else."""
    if seed is None:
        return None
    check_limits("seed", seed, 0, MOST_RUN_SEED)
    return int(seed)
