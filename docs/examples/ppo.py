"""PPO of Stable-Baselines3, whose action is a whole trial: the postures at all goals."""

import gymnasium
import numpy as np
from stable_baselines3 import PPO

from coartic import Optimiser


class Trials(gymnasium.Env):
    """A step is a trial: steps from the postures of the corrective process, for minus the cost."""

    observation_space = gymnasium.spaces.Box(0.0, 1.0, (1,))

    def __init__(self, objective):
        self.objective, self.scale = objective, objective(objective.x0)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (objective.dim,))

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return np.zeros(1, np.float32), {}

    def step(self, action):
        cost = self.objective(self.objective.x0 + 0.5 * action)
        return np.zeros(1, np.float32), -cost / self.scale, True, False, {}


class Agent(Optimiser):
    name = "ppo"
    title = "PPO on whole trials"
    citation = "J. Schulman et al. (2017). arXiv:1707.06347."

    def optimise(self, objective, rng):
        agent = PPO(
            "MlpPolicy",
            Trials(objective),
            policy_kwargs={"log_std_init": -2.0},
            n_steps=256,
            seed=int(rng.integers(2**31)),
            device="cpu",
        )
        agent.learn(10**9)  # until the objective ends it
