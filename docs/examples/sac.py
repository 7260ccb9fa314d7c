"""SAC of Stable-Baselines3."""

from stable_baselines3 import SAC

from coartic.agents import Agent, AgentParameters


class Setting(AgentParameters):
    envs: int = 32
    scale: float = 0.05
    learning_rate: float = 3e-3
    gradient_steps: int = 1  # after each step of all environments
    entropy: float = 0.01  # its weight in the reward; "auto" is SAC's way to find it


class SACAgent(Agent):
    name = "sac"
    title = "SAC (Stable-Baselines3)"
    citation = "T. Haarnoja et al. (2018). Soft actor-critic. ICML."
    Parameters = Setting

    def agent(self, envs, seed):
        p = self.parameters
        options = {"gamma": 1.0, "train_freq": 1, "gradient_steps": p.gradient_steps}
        options |= {"ent_coef": p.entropy, "learning_starts": 500}
        policy = {"net_arch": [64, 64]}
        return SAC("MlpPolicy", envs, p.learning_rate, policy_kwargs=policy, seed=seed, **options)
