"""PPO of Stable-Baselines3."""

from stable_baselines3 import PPO

from coartic.agents import Agent, AgentParameters


class Setting(AgentParameters):
    scale: float = 1.0
    learning_rate: float = 3e-3
    log_std_init: float = -2.0
    steps: int = 16
    epochs: int = 5


class PPOAgent(Agent):
    name = "ppo"
    title = "PPO (Stable-Baselines3)"
    citation = "J. Schulman et al. (2017). arXiv:1707.06347."
    Parameters = Setting

    def agent(self, envs, seed):
        p = self.parameters
        size = p.steps * envs.num_envs // 4
        options = {"n_steps": p.steps, "batch_size": size, "n_epochs": p.epochs, "gamma": 1.0}
        policy = {"log_std_init": p.log_std_init, "net_arch": [32, 32]}
        return PPO("MlpPolicy", envs, p.learning_rate, policy_kwargs=policy, seed=seed, **options)
