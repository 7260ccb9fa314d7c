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

    def learn(self, steps):
        self.envs.reset()
        for _ in range(steps):
            size = (self.envs.num_envs, *self.envs.action_space.shape)
            self.envs.step(self.rng.uniform(-1, 1, size))

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


def test_what_an_agent_sees_and_gets():
    """Goal, hand before, last action; at the end by how many per cent the trial was better."""
    session = Session(load_task("two-armed-1"), 0, TOLD)
    envs = agents.SessionEnvs(session, agents.AgentParameters(envs=3, scale=0.25))
    assert (envs.reset() == [1] + 14 * [0]).all()
    actions = np.float32(0.02) * np.arange(3)[:, None] * np.ones((3, 9), np.float32)
    for goal in range(3):
        seen, rewards, ended, infos = envs.step(actions)
        hand = [1, 0] if "LRLR"[goal] == "L" else [0, 1]
        assert (seen[:, :6] == [*np.eye(4)[goal + 1], *hand]).all()
        np.testing.assert_array_equal(seen[:, 6:], actions)
        assert not rewards.any()
        assert not ended.any()
        assert not any(infos)
    seen, rewards, ended, infos = envs.step(actions)
    cost = coartic.objective("two-armed-1", "LRLR")
    due = [100 * (1 - cost(cost.x0 + 0.25 * float(action[0])) / 532) for action in actions]
    np.testing.assert_allclose(rewards, due, rtol=1e-6)
    assert len({*due}) == 3
    assert ended.all()
    assert (seen == [1] + 14 * [0]).all()
    assert infos[2]["episode"] == {"r": pytest.approx(due[2]), "l": 4, "t": 0}
    assert session.meter.trials == 16 + 3
