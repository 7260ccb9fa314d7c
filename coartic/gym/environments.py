"""The environment in which a robot makes trials of a task or family."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box
from numpy.typing import ArrayLike, NDArray

from coartic.internal.limits import brief_value, check_limits, real_array
from coartic.method.optimisers import FAILED
from coartic.model import PAPER, MotionModel, model_from
from coartic.motion.trials import (
    NO_NOISE,
    CompiledTask,
    compiled_task,
    count_trials,
    noise_draws,
    noise_seed,
    reach_next,
)
from coartic.robot import HANDS, MAX_NUMBER, Array
from coartic.tasks.catalogue import as_task
from coartic.tasks.families import LOCKED, instance_names, is_family, load_family
from coartic.tasks.task import MAX_GOALS, Split, Task, in_world

REACH = 0.5
"""Displacement of the target of a joint by an action entry of 1, in length units (base) and rad
(angles)."""


class TaskEnv(gymnasium.Env):
    """Environment in which a robot makes trials of a task or family.

    - *Episode.* An episode is a trial. In each step the robot reaches for the next goal, so that
      the number of steps of a trial is at most the number of goals of the task. Trials are never
      truncated.
    - *Reward.* The reward of a step is minus its number of control ticks. If the goal is missed
      even though the corrective process acts, the reward is -1,000,000, and the trial ends.
    - *Random numbers.* Two things can be random: the instance, if the task is a family, and the
      motor noise, if the model has any. ``reset(seed=n)`` begins a trial with noise draw 0 of seed
      n; ``reset()`` begins a trial with the next noise draw.

    Parameters
    ----------
    task : Task, str or Path
        A task, or a family: its name, such as ``"two-armed/v1"``, or the path of its file. Each
        trial of a family is a trial of one of its instances.
    split : {"development", "test", "fresh"}, optional
        Instances of the family: ``"development"`` to train on (the default), ``"test"`` to report
        on, or ``"fresh"`` for the instances of a ``year``.
    count : int, optional
        Number of instances of the split to use, starting with the first. The default is 1,000 for
        the development split, and 10 for the others.
    year : int, optional
        Year of the fresh instances, such as 2027.
    ahead : int
        Number of goals after the next goal that an observation includes.
    model : MotionModel or dict
        The motion model, or a dict of the constants that differ from the paper's model, such as
        ``{"motor_noise": 0.01}``.
    render_mode : {"rgb_array"}, optional
        ``"rgb_array"`` to make :meth:`render` return pictures.

    Raises
    ------
    ValueError, TypeError, TaskError
        An option other than ``render_mode`` is wrong, or the task or family is unknown.

    Notes
    -----
    *Joints* are here the base coordinates that are not locked (in length units) and the joint
    angles of the arms with the task's ``hands`` (in rad). The arms are in the order of ``hands``. A
    family has one list of joints for all instances: it contains each base coordinate that can move
    in some instances, and for each arm the largest number of joints that the family allows.

    An observation, float32 of shape ``(O,)``, consists of

    - for the next goal and each goal ahead, 1 if the goal exists, else 0;
    - x and y of each of these goals relative to the base (in length units), or 0 if the goal does
      not exist;
    - the value of each joint, or 0 if the robot does not have the joint;
    - for each joint, 1 if the robot can move it, else 0. These entries exist only in a family whose
      robots can have different numbers of links.

    An action, shape ``(A,)``, consists of one entry for the hand, if the task has two hands, and
    one entry for each joint. Entries for joints are clipped to the range from -1 to 1.

    - For each hand, the corrective process finds a posture in which this hand is at the goal. If
      the entry for the hand is at most 0.5, the hand is chosen whose posture is nearer to the
      present configuration, by the Euclidean distance in joint space. If the entry is above 0.5,
      the other hand is chosen.
    - The target of the movement is the posture of the chosen hand, plus :data:`.REACH` times the
      entries for the joints. If the corrective process fails for the chosen hand, the present
      configuration takes the place of the posture of this hand.
    - Entries for joints that a robot cannot move have no effect.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["rgb_array"], "render_fps": 4}

    def __init__(
        self,
        task: Task | str | Path,
        *,
        split: Split | None = None,
        count: int | None = None,
        year: int | None = None,
        ahead: int = 1,
        model: MotionModel | Mapping[str, Any] = PAPER,
        render_mode: str | None = None,
    ) -> None:
        check_limits("ahead", ahead, 0, MAX_GOALS)
        self.model, self.render_mode = model_from(model), render_mode
        instances = {"split": split, "count": count, "year": year}
        self.options = {"task": task, "ahead": ahead, "model": self.model} | instances
        self.tasks: list[Task | str]  # tasks, or names of instances
        if names_family(task):
            family = load_family(str(task))
            self.tasks = [*instance_names(str(task), split or "development", count, year)]
            locked = set.intersection(*({*LOCKED[base]} for base in family.base))
            (fewest, links), hands = family.links, family.hands
        elif any(option is not None for option in instances.values()):
            raise ValueError(
                f"split, count and year are options of families, not of task {brief_value(task)}"
            )
        else:
            self.tasks = [single := as_task(task)]
            locked, hands = {*single.locked_base}, single.hands
            fewest = links = single.robot.max_links
        self.names = [getattr(task, "name", task) for task in self.tasks]
        self._joints = [f"base_{axis}" for axis in "xy" if axis not in locked]
        self._joints += [f"{hand}_{k + 1}" for hand in hands for k in range(links)]
        self._view, joints, self._has_flags = ahead + 1, len(self._joints), fewest < links
        sizes = [self._view, 2 * self._view + joints, joints * self._has_flags]
        high = np.repeat([1.0, MAX_NUMBER, 1.0], sizes).astype(np.float32)
        self.observation_space = Box(np.where(high > 1.0, -high, np.float32(0.0)), high)
        self.action_space = Box(-1.0, 1.0, (len(hands) - 1 + joints,), np.float32)
        self.number, self.going = -1, False
        self.world = 0
        """Seed of the motor noise."""
        self.draw = -1
        """Number of the draw of the noise in this trial, from 0; -1 before the first trial."""
        self.outcome = np.nan
        """Total reward of the last trial that ended (in ticks). NaN if this trial failed or took
        1,000,000 ticks or more, or if no trial has ended."""

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin a trial.

        Parameters
        ----------
        seed : int, optional
            Seed of the generator that draws instances, and seed of the motor noise, which begins
            with draw 0. By default neither the generator nor the noise is seeded again, and the
            trial is made with the next draw of the noise.
        options : dict, optional
            ``{"task": k}`` begins a trial on instance k of a family, from 0. By default the
            instance is drawn at random.

        Returns
        -------
        ndarray, shape (O,)
            First observation.
        dict
            Two entries: ``task`` is the name of the task, and ``is_success`` is True if the trial
            has hit all goals.

        Raises
        ------
        ValueError
            The option or the instance does not exist, or a tolerance of the model does not fit the
            radius of the goals.
        gymnasium.error.Error
            The seed is not a Python int of at least 0.
        """
        super().reset(seed=seed)
        if seed is not None or self.draw < 0:
            self.world, self.draw = noise_seed(max(int(self.np_random_seed), 0)), -1
        self.draw += 1
        drawn, options = self.np_random.integers(len(self.tasks)), {**(options or {})}
        number = options.pop("task", drawn)
        check_limits("options['task']", number, 0, len(self.tasks) - 1)
        if options:
            raise ValueError(f"options {brief_value(options)} are unknown; reset has only 'task'")
        if number != self.number:
            self._load(int(number))
        self.q, self.goal, self.going, self._total = self.task.q0.copy(), 0, True, 0.0
        self._found = self._found_at_start
        return self._seen(), self._info()

    def step(
        self, action: ArrayLike
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Reach for the next goal.

        Parameters
        ----------
        action : array_like, shape (A,)
            Entries for hand and joints (:class:`TaskEnv`).

        Returns
        -------
        ndarray, shape (O,)
            Observation.
        float
            Reward: minus the ticks of this step, or -1,000,000 if the goal is missed.
        bool
            True if the trial has ended.
        bool
            Always False, because trials are not truncated.
        dict
            The entries ``task`` and ``is_success``, as in :meth:`reset`.

        Raises
        ------
        ResetNeeded
            The trial has ended, or no trial was begun.
        ValueError
            The action has a wrong shape, or is not finite.
        """
        if not self.going:
            raise ResetNeeded("the trial has ended, or none was begun: call reset first")
        array, shape = real_array("action", action), self.action_space.shape
        entries = array.tolist()
        if array.shape != shape or not all(map(math.isfinite, entries)):
            raise ValueError(
                f"action is {brief_value(action)}; it must be finite, of shape {shape}"
            )
        count_trials(int(self.goal == 0))
        q, dof = self.q, len(self.q)
        postures = [
            record["corrected"][:dof] if record["corrections"] else None for record in self._found
        ]
        distances = [math.inf if posture is None else _square(posture - q) for posture in postures]
        hand = int(len(distances) > 1 and (distances[1] < distances[0]) != (entries[0] > 0.5))
        target = (q if (posture := postures[hand]) is None else posture).tolist()
        for joint, entry in self._moves:
            target[joint] += REACH * min(max(entries[entry], -1.0), 1.0)
        # With noise the postures at the next goal are sought on their own, without it.
        reached = 1 if self.model.motor_noise > 0.0 else len(self._goals) - self.goal
        targets = self._no_targets[:, :reached].copy()
        targets[0, 0, 0] = target
        record, *next_record = self._reach(self._compiled, hand, targets)
        self.q, hit = record["q"][:dof].copy(), record["hit"].item()
        self.goal += hit
        self.going = hit and self.goal < len(self._goals)
        if self.going:
            rest = range(len(next_record), len(self._sides))
            self._found = next_record + self._reached_by(rest)
        reward = -float(record["ticks"].item() if hit else FAILED)
        self._total += reward
        if not self.going:
            self.outcome = self._total if self._total > -FAILED else np.nan
        return self._seen(), reward, not self.going, False, self._info()

    def render(self) -> NDArray[np.uint8] | None:
        """Draw the robot and its goals; goals that were hit are filled.

        Call :meth:`reset` first.

        Returns
        -------
        ndarray, shape (400, 600, 3), or None
            RGB picture, or None if the environment was made without ``render_mode``.
        """
        if self.render_mode is None:
            return None
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        from coartic.pictures.drawing import box, circle_goals, draw_robot, fill_goals

        (left, bottom), (right, top) = box(self.task, self.task.q0, margin=1.0)
        figure = Figure(figsize=(6, 4), dpi=100)
        canvas: Any = FigureCanvasAgg(figure)
        axes = figure.add_subplot(aspect="equal", xlim=(left, right), ylim=(bottom, top))
        draw_robot(axes, self.task, self.q, weight=1.5)
        fill_goals(circle_goals(axes, self.task), np.arange(len(self._goals)) < self.goal)
        canvas.draw()
        return np.asarray(canvas.buffer_rgba())[..., :3].copy()

    def _load(self, number: int) -> None:
        """Load the task with index ``number``, from 0, and prepare its trials."""
        self.tasks[number] = task = in_world(as_task(self.tasks[number]), self.model)
        self._compiled = compiled_task(task, self.model, checks=False)
        self._exact = compiled_task(task, self.model.without_noise(), checks=False)
        self.task, self.number, self._goals = task, number, task.goal_array
        indices = {name: k for k, name in enumerate(task.robot.joint_names)}
        locked = [f"base_{axis}" for axis in task.locked_base]
        self._indices = [indices.get(name, -1) for name in self._joints]
        self._moves = [
            (indices[name], entry)
            for entry, name in enumerate(self._joints, len(task.hands) - 1)
            if name in indices and name not in locked
        ]
        moved = {joint for joint, _ in self._moves}
        self._flags = [float(index in moved) for index in self._indices] if self._has_flags else []
        sides = [HANDS.index(hand) for hand in task.hands]
        self._sides = [np.array([[side, sides[0]]]) for side in sides]
        self._no_targets = np.full((1, 2, 1, task.robot.dof), np.nan)
        self.q, self.goal = task.q0.copy(), 0
        self._found_at_start = self._reached_by(range(len(sides)))

    def _reach(self, compiled: CompiledTask, hand: int, targets: Array) -> NDArray[np.void]:
        """Reach for the next goal with a hand, and perhaps for the goal after it.

        The robot reaches for as many goals as ``targets`` has. Both movements are made in one call,
        because each call is slow.

        Parameters
        ----------
        compiled : CompiledTask
            The task with or without motor noise.
        hand : int
            Index in ``task.hands`` of the hand that reaches for the next goal. The first hand of
            the task reaches for the goal after it.
        targets : ndarray, shape (1, goals, 1, dof)
            Targets for one or two goals, in length units and rad. If all entries of a goal are NaN,
            only the corrective process moves the arm.

        Returns
        -------
        ndarray, shape (goals,)
            A per-goal record for each goal.
        """
        sides = self._sides[hand][:, : targets.shape[1]]
        noisy = compiled.model.motor_noise > 0.0
        worlds = noise_draws(self.world, self.draw) if noisy else NO_NOISE
        return reach_next(compiled, self.q[None], sides, targets, self.goal, worlds).goals[0, :, 0]

    def _reached_by(self, hands: range) -> list[Any]:
        """Let the corrective process reach for the next goal with each of some hands.

        ``hands`` are indices in ``task.hands``. Return a list with the per-goal record of each
        hand. The process acts without motor noise, and the environment does not change.
        """
        return [self._reach(self._exact, hand, self._no_targets[:, :1])[0] for hand in hands]

    def _seen(self) -> NDArray[np.float32]:
        q, goals = self.q.tolist(), self._goals[self.goal :][: self._view].tolist()
        missing = self._view - len(goals)
        positions = [
            coordinate - base for goal in goals for coordinate, base in zip(goal, q, strict=False)
        ]
        joints = [q[k] if k >= 0 else 0.0 for k in self._indices]
        exist = [1.0] * len(goals) + [0.0] * missing
        return np.array(exist + positions + [0.0, 0.0] * missing + joints + self._flags, np.float32)

    def _info(self) -> dict[str, Any]:
        return {"task": self.names[self.number], "is_success": self.goal == len(self._goals)}


def _square(difference: Array) -> float:
    """Return the sum of the squares of a vector, added one after the other.

    NumPy adds the terms in groups, so that rounding could make the distances to two mirrored
    postures differ, although they must be equal.
    """
    square = 0.0
    for value in difference.tolist():
        square += value * value
    return square


def names_family(task: Any) -> bool:
    """Return True if ``task``, an option of :class:`TaskEnv`, stands for a family."""
    return isinstance(task, str | Path) and is_family(str(task))
