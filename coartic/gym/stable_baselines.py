"""Environments for Stable-Baselines3."""

from __future__ import annotations

from typing import Any

import gymnasium

from coartic.errors import MissingExtraError
from coartic.method.optimisers import FAILED
from coartic.motion.execution import initial_reward


class SharesOfTicks(gymnasium.RewardWrapper):
    """Wrapper that divides the rewards by the ticks of the corrective process.

    The divisor is the number of ticks that the corrective process on its own takes for the whole
    task with the initial hands and without motor noise, but at least 1. The divisor is 1,000,000 if
    the process does not complete the task, or if the task's policy finds no initial hands. A scaled
    reward below -2 is raised to -2.
    """

    def __init__(self, env: gymnasium.Env) -> None:
        super().__init__(env)
        self._ticks: dict[int, float] = {}

    def reward(self, reward: Any) -> float:
        """Scale a reward (in ticks). The result is at least -2."""
        env: Any = self.unwrapped
        if env.number not in self._ticks:
            corrective = initial_reward(env.task, env.model)
            self._ticks[env.number] = float(FAILED if corrective is None else max(-corrective, 1))
        return max(float(reward) / self._ticks[env.number], -2.0)


def sb3(env: str, num_envs: int = 64, **options: Any) -> Any:
    """Make environments for Stable-Baselines3, with scaled rewards.

    Parameters
    ----------
    env : str
        Id, such as ``"coartic/TwoArmed1-v2"``.
    num_envs : int
        Number of environments.
    **options
        Options of :class:`.TaskEnv`.

    Returns
    -------
    DummyVecEnv
        Environments, made by Stable-Baselines3's ``make_vec_env``. Rewards are divided by the ticks
        of the corrective process (:class:`SharesOfTicks`). At the end of a trial, entry ``episode``
        of the info contains the unscaled total reward of the trial (in ticks).

    Raises
    ------
    MissingExtraError
        Stable-Baselines3 is not installed.
    """
    try:
        from stable_baselines3.common.env_util import make_vec_env
    except ImportError:
        raise MissingExtraError(
            "coartic.gym.sb3 needs Stable-Baselines3: pip install 'coartic[rl]'"
        ) from None
    return make_vec_env(env, num_envs, wrapper_class=SharesOfTicks, env_kwargs=options)
