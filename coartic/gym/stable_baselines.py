"""Environments of :mod:`coartic.gym` for Stable-Baselines3, which has to be installed."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from coartic.method.optimisers import FAILED
from coartic.motion.solution import initial_reward
from coartic.robot import Array


class RobotEnvs(VecEnv):
    """A vector environment of :mod:`coartic.gym` for Stable-Baselines3.

    Actions are clipped to the box. A trial that has ended starts again in the same step;
    ``terminal_observation`` in its info is its last observation, and ``episode`` has its reward in
    ticks. Rewards are minus the ticks, as a share of the ticks (at least 1) that the corrective
    process alone takes for the whole trial with the task's initial hands: the rewards of a trial
    with as many ticks add up to -1. No step loses more than 2. On a task that the corrective
    process cannot complete alone, rewards are shares of ``coartic.method.optimisers.FAILED``,
    1,000,000 ticks.

    Parameters
    ----------
    envs : coartic.gym.TaskVectorEnv
        The environment.
    """

    def __init__(self, envs: Any) -> None:
        self.render_mode = envs.render_mode
        self.robots, self._lost = envs, np.zeros(envs.num_envs)
        self._steps = np.zeros(envs.num_envs, dtype=np.int64)
        self._costs: dict[int, float] = {}
        super().__init__(envs.num_envs, envs.single_observation_space, envs.single_action_space)

    def reset(self) -> NDArray[np.float32]:
        """Begin a trial in each of N environments; return the first observations, ``(N, O)``.
        Raises ValueError if ``set_options`` has set options: the environments take none."""
        seeds = self._seeds if any(seed is not None for seed in self._seeds) else None
        options = next(filter(None, self._options), None)
        self._reset_seeds()
        self._reset_options()
        self._lost[:], self._steps[:] = 0, 0
        observations: NDArray[np.float32] = self.robots.reset(seed=seeds, options=options)[0]
        return observations

    def step_async(self, actions: Array) -> None:
        """Keep the actions, shape ``(N, A)``, with which :meth:`step_wait` makes the next step."""
        self._actions = actions

    def step_wait(self) -> tuple[NDArray[np.float32], Array, NDArray[np.bool_], list[Any]]:
        """Let all N robots reach for their next goal by the actions of :meth:`step_async`.

        Returns observations ``(N, O)``, rewards ``(N,)``, True for trials that have ended,
        ``(N,)``, and N dictionaries, empty for trials that go on, as :class:`RobotEnvs` says;
        ``episode`` has ``r`` (reward in ticks), ``l`` (number of steps) and ``t`` (0).
        """
        costs = np.array([self._cost(task) for task in self.robots.state.task.tolist()])
        observations, rewards, ended, _, seen = self.robots.step(self._actions)
        self._lost += rewards
        self._steps += 1
        infos: list[dict[str, Any]] = [{} for _ in costs]
        for row in np.flatnonzero(ended):
            episode = {"r": float(self._lost[row]), "l": int(self._steps[row]), "t": 0}
            infos[row] = {"terminal_observation": seen["final_obs"][row], "episode": episode}
        self._lost[ended], self._steps[ended] = 0, 0
        return observations, np.maximum(rewards / costs, -2.0).astype(np.float32), ended, infos

    def close(self) -> None:
        """Do nothing: no file or window is open."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return a list with the value of an attribute of this vector environment, once for each of
        ``indices`` (None: for each environment)."""
        return [getattr(self, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Raise NotImplementedError: the environments are one object, and none has own values."""
        raise NotImplementedError("the environments have no attributes of their own")

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> Any:
        """Raise NotImplementedError: the environments are one object, and none has own methods."""
        raise NotImplementedError("the environments have no methods of their own")

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        """Return a list with False for each environment, whatever ``indices``: none is wrapped."""
        return [False] * self.num_envs

    def _cost(self, number: int) -> float:
        """Return the ticks of the corrective process alone on task ``number`` (from 0), at least 1;
        ``FAILED`` if the process fails."""
        if number not in self._costs:
            reward = initial_reward(self.robots.task_at(number), self.robots.model)
            self._costs[number] = float(FAILED if reward is None else max(-reward, 1))
        return self._costs[number]
