"""An environment of one robot that makes one trial after another, and ids of environments."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.vector import VectorWrapper
from numpy.typing import ArrayLike, NDArray

from coartic.errors import CoarticError
from coartic.gym.vector import TaskVectorEnv, check_no_options, whole_seed
from coartic.internal.limits import brief_value, real_array
from coartic.internal.text import unknown
from coartic.tasks.task import Task

if TYPE_CHECKING:
    from coartic.gym.stable_baselines import RobotEnvs

IDS: dict[str, dict[str, Any]] = {
    "coartic/Ascending-v2": {"task": "ascending"},
    "coartic/Descending-v2": {"task": "descending"},
    "coartic/TwoArmed1-v2": {"task": "two-armed-1"},
    "coartic/TwoArmed2-v2": {"task": "two-armed-2"},
    "coartic/Task-v2": {},
}
"""Options with which the environments are registered, by id."""
ADDED = ("OrderEnforcing", "PassiveEnvChecker", "Monitor", "VecMonitor")
"""Wrappers that the libraries add by themselves, which change no observations and no actions."""


class TaskEnv(gymnasium.Env):
    """Environment of one robot, with the options (except ``num_envs``), observations, actions and
    rewards of :class:`TaskVectorEnv`; a trial begins with a reset only."""

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["rgb_array"], "render_fps": 4}

    def __init__(
        self,
        task: Task | str | Path | None = None,
        *,
        render_mode: str | None = None,
        **options: Any,
    ) -> None:
        self.robots = TaskVectorEnv(1, task, render_mode=render_mode, **options)
        self.action_space = self.robots.single_action_space
        self.observation_space = self.robots.single_observation_space
        self.render_mode = render_mode

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin a trial, of the task or of a random instance of the family; return observation
        ``(O,)`` and info, a dictionary: ``task`` is the task's name (:meth:`TaskVectorEnv.infos`),
        ``is_success`` True if the trial has hit all goals. With ``seed`` None the random generator
        goes on, which the system seeds at first. Raises ValueError for any option, and for a seed
        that is no whole number from 0."""
        super().reset(seed=whole_seed(seed))
        check_no_options(options)
        self.robots._begin(slice(None), self.np_random.integers(len(self.robots.tasks)))
        return self.robots.state.seen[0].copy(), self._info()

    def step(
        self, action: ArrayLike
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Reach for the next goal by an action ``(A,)``; return observation ``(O,)``, reward,
        whether the trial has ended, False (no trial is truncated) and info, as :meth:`reset`.
        Raises ResetNeeded if the trial had ended before or no trial was begun, and ValueError for
        an action of another shape or that is not finite."""
        state = self.robots.state
        if not state.going[0]:
            raise ResetNeeded("no trial goes on: reset first")
        self.robots._move(real_array("action", action)[None])
        return state.seen[0].copy(), state.rewards.item(), not state.going[0], False, self._info()

    def render(self) -> NDArray[np.uint8] | None:
        """Return a picture of the robot and its goals, RGB, ``(400, 600, 3)``, in which goals hit
        so far are filled; None if the environment was made without ``render_mode``."""
        return None if self.render_mode is None else self.robots.picture(0)

    def _info(self) -> dict[str, Any]:
        state, number = self.robots.state, self.robots.state.task.item()
        is_success = state.goal.item() == state.counts.item(number)
        return {"task": self.robots.names[number], "is_success": is_success}


def options_of(env: Any) -> dict[str, Any]:
    """Return the options ``task``, ``ahead`` and ``model`` of an environment of this package, or
    the options with which an id, such as ``coartic/Task-v2``, is registered, as a dictionary, not a
    copy: do not change it. Raises ValueError for an unknown id, and TypeError for anything else."""
    if isinstance(env, str):
        if env not in IDS:
            raise ValueError(unknown("environment", env, IDS))
        return IDS[env]
    return robots_of(env).options


def robots_of(env: Any) -> TaskVectorEnv:
    """Return the :class:`TaskVectorEnv` that moves the robots of an environment of this package,
    also of an environment in wrappers. Raises TypeError for anything else."""
    *_, inner = layers(env)
    robots = getattr(inner, "robots", inner)
    if not isinstance(robots, TaskVectorEnv):
        raise TypeError(
            f"env is {brief_value(env)}; it must be an environment of coartic or its id"
        )
    return robots


def layers(env: Any) -> list[Any]:
    """Return a list of the wrappers of an environment, from the outermost inwards, and the
    environment inside."""
    found = [env]
    while isinstance(env, gymnasium.Wrapper | VectorWrapper) or hasattr(env, "venv"):
        env = env.venv if hasattr(env, "venv") else env.env
        found.append(env)
    return found


def wrappers_of(env: Any) -> list[Any]:
    """Return a list of the wrappers of an environment, from the outermost inwards, without wrappers
    that Gymnasium and Stable-Baselines3 add by themselves (:data:`ADDED`)."""
    return [each for each in layers(env)[:-1] if type(each).__name__ not in ADDED]


def sb3(env: str, num_envs: int = 64, **options: Any) -> RobotEnvs:
    """Return a ``VecEnv`` of Stable-Baselines3 with ``num_envs`` robots side by side.

    ``env`` is an id, such as ``"coartic/TwoArmed1-v2"``; ``options`` are options of
    :class:`TaskVectorEnv`. Trials start again by themselves, actions are clipped, and rewards are
    minus the ticks, on a scale of the task's, at least -2 a step
    (:class:`~coartic.gym.stable_baselines.RobotEnvs`). Raises ValueError or TypeError for an
    unknown id and for a wrong option, and CoarticError for a task that cannot be used, and if
    Stable-Baselines3 is not installed.
    """
    try:
        from coartic.gym.stable_baselines import RobotEnvs
    except ImportError:
        raise CoarticError("coartic.gym.sb3 needs: pip install 'coartic[rl]'") from None

    return RobotEnvs(TaskVectorEnv(num_envs, **options_of(env) | options))
