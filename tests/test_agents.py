"""Agents of Stable-Baselines3 as methods, with an agent that is none."""

import numpy as np
import pytest

import coartic
from coartic import MotionModel, execute, load_task
from coartic.method import MethodError, Session
from coartic.optimisers import TOLD

pytest.importorskip("stable_baselines3")
agents = pytest.importorskip("coartic.agents")


class Practised:
    """Stands for an agent: wild while it learns, still when its policy is asked for."""

    def __init__(self, envs, action, seed):
        self.envs, self.action, self.rng = envs, action, np.random.default_rng(seed)
        self.gains = []

    def learn(self, steps):
        self.envs.reset()
        for _ in range(steps):
            size = (self.envs.num_envs, *self.envs.action_space.shape)
            gains, ended = self.envs.step(self.rng.uniform(-1, 1, size))[1:3]
            self.gains += gains[ended].tolist()

    def predict(self, observations, deterministic=False):
        assert deterministic
        size = len(observations), *self.envs.action_space.shape
        return np.broadcast_to(self.action, size), None


def agent_of(action, **parameters):
    class Told(agents.Agent):
        name, title, citation = "told", "Told what to do", "None."

        def agent(self, envs, seed):
            return Practised(envs, action, seed)

    return Told(agents.AgentParameters(**parameters))


@pytest.mark.parametrize(("budget", "trials"), [(100, 10_000), (None, 100)])
def test_an_agent_is_judged_by_its_policy_without_noise(budget, trials):
    task = load_task("two-armed-1")
    session = Session(task, 0, TOLD, trial_budget=budget)
    method = agent_of(0.02, trials=trials, scale=0.25, envs=8)
    result = method.solve(session)
    assert session.meter.trials == len(session.rewards) == 100
    cost = coartic.objective(task, "LRLR")
    learned = -cost(cost.x0 + 0.25 * np.float64(0.02))
    assert execute(task, result.solution).reward == session.rewards[-1] == learned
    assert result.details == {"best_trial_reward": max(session.rewards)}
    assert max(session.rewards) == -532 > learned  # no guess was better than what was tried first


def test_an_agent_whose_policy_fails_has_no_solution():
    task, model = load_task("ascending"), MotionModel(max_iterations=100)
    session = Session(task, 0, TOLD, model=model, trial_budget=50)
    result = agent_of(-0.5, scale=2.0).solve(session)
    assert session.rewards[-1] is None
    assert not execute(task, result.solution, model=model).completed
    assert result.details["best_trial_reward"] == max(r for r in session.rewards if r is not None)


def test_an_agent_needs_a_trial_for_its_policy():
    for budget in (1, 2, 17, 18):
        session = Session(load_task("two-armed-1"), 0, TOLD, trial_budget=budget)
        if budget == 1:
            with pytest.raises(MethodError, match="no trial to make"):
                agent_of(0.0).solve(session)
        else:
            assert len(agent_of(0.0).solve(session).solution) == 4
        assert session.meter.trials == (budget if budget > 1 else 0)
