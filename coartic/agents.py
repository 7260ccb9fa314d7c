"""Agents of Stable-Baselines3. Needs the extra ``coartic[rl]``.

:class:`RobotEnvs` presents a vector environment of :mod:`coartic.gym`, :class:`SessionEnvs` the
trials of a session. An :class:`Agent` is a method that trains on the latter; its result is one
trial of the learned policy without noise.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from contextlib import suppress
from typing import Annotated, Any

import numpy as np
import torch
from gymnasium.spaces import Box
from numpy.typing import NDArray
from pydantic import Field
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import VecEnv

from coartic.arms import Arms
from coartic.learner.learning import TRIALS
from coartic.method import BudgetError, Method, MethodError, Outline, Parameters, Result, Session
from coartic.motion.initial import corrective_trial, initial_hands
from coartic.motion.solution import Movement
from coartic.motion.trials import Trials, movements_of
from coartic.optimisers import FAILED, TOLD, Objective
from coartic.robot import Array

WORST = -100.0
"""Reward of a trial that fails or takes twice as long as the first one, or longer."""


class AgentParameters(Parameters):
    """Parameters of every :class:`Agent`."""

    trials: Annotated[int, Field(gt=0)] = TRIALS
    """All trials: those that try hands, those of the training, and the last one, of the policy."""
    envs: Annotated[int, Field(gt=0)] = 16
    """Environments side by side."""
    scale: Annotated[float, Field(gt=0, le=100)] = 0.5
    """Half the width of the box of targets, length unit (base) and rad (joints)."""
    chooses_hands: bool = False
    """Whether the agent chooses hands, too. If not, the hand sequence is the one with which the
    corrective process alone does best."""
    sees_targets: bool = True
    """Whether observations have the last action for each joint."""


class OneObject(VecEnv):
    """Environments that are one object, as far as Stable-Baselines3 wants the same of all."""

    def step_async(self, actions: Array) -> None:
        """Take the actions of the next subtask."""
        self._actions = actions

    def close(self) -> None:
        """Nothing is open."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute, once for each environment."""
        return [getattr(self, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refused: all environments are one object, so that none can have its own value."""
        raise NotImplementedError("the environments have no attributes of their own")

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> Any:
        """Refused: all environments are one object, so that none can be asked alone."""
        raise NotImplementedError("the environments have no methods of their own")

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        """Whether each is wrapped: none is."""
        return [False] * self.num_envs


class RobotEnvs(OneObject):
    """A vector environment of :mod:`coartic.gym` for Stable-Baselines3.

    Actions are clipped to the box. A trial that has ended begins anew in the same step;
    ``terminal_observation`` in its info is what was seen last, and ``episode`` has its reward in
    ticks. Rewards are ticks as a share of what the corrective process takes for the whole trial
    with the task's initial hands: all rewards of a trial that is like it add up to -1. No step
    loses more than 2, such as one in which the corrective process fails.

    Parameters
    ----------
    envs : coartic.gym.TaskVectorEnv
        The environment, of the mode ``"SameStep"``.
    """

    def __init__(self, envs: Any) -> None:
        self.render_mode = envs.render_mode
        self._envs, self._lost = envs, np.zeros(envs.num_envs)
        self._steps = np.zeros(envs.num_envs, dtype=np.int64)
        self._costs: dict[int, float] = {}
        super().__init__(envs.num_envs, envs.single_observation_space, envs.single_action_space)

    def reset(self) -> NDArray[np.float32]:
        """Begin all trials."""
        seeds = self._seeds if any(seed is not None for seed in self._seeds) else None
        self._reset_seeds()
        self._lost[:], self._steps[:] = 0, 0
        observations: NDArray[np.float32] = self._envs.reset(seed=seeds)[0]
        return observations

    def step_wait(self) -> tuple[NDArray[np.float32], Array, NDArray[np.bool_], list[Any]]:
        """Make the next subtask of all trials."""
        costs = np.array([self._cost(task) for task in self._envs.arms.rows["task"].tolist()])
        observations, rewards, ended, _, seen = self._envs.step(self._actions)
        self._lost += rewards
        self._steps += 1
        infos: list[dict[str, Any]] = [{} for _ in costs]
        for row in np.flatnonzero(ended):
            episode = {"r": float(self._lost[row]), "l": int(self._steps[row]), "t": 0}
            infos[row] = {"terminal_observation": seen["final_obs"][row], "episode": episode}
        self._lost[ended], self._steps[ended] = 0, 0
        return observations, np.maximum(rewards / costs, -2.0).astype(np.float32), ended, infos

    def _cost(self, place: int) -> float:
        """Ticks of the corrective process alone on a task, or of a failure."""
        if place not in self._costs:
            arms = self._envs.arms
            hands = initial_hands(arms.tasks[place], model=arms.model)
            reward = corrective_trial(arms.tasks[place], hands, model=arms.model).reward
            self._costs[place] = float(FAILED if reward is None else -reward)
        return self._costs[place]


class SessionEnvs(OneObject):
    """The robots of :class:`coartic.arms.Arms` as environments of Stable-Baselines3.

    Their trials count as trials of the session. The box of targets is around the configurations in
    which the corrective process alone hits the goals. With ``sees_targets`` an observation also has
    the last action for each joint. The last step of a trial has the reward: by how many per cent
    the trial was better than the corrective process alone; the other steps have 0.
    """

    def __init__(self, session: Session, parameters: AgentParameters) -> None:
        trials, left = parameters.trials, session.trials_left
        if left is not None:
            trials = min(trials, left)
        first = Objective(session, trials=trials - 1)  # the last trial is the policy's
        self._session, self._first_hands, self._first_cost = session, first.hands, first.best_cost
        self._scale, self._sees_targets = parameters.scale, parameters.sees_targets
        self._trials_left = trials - 1 - session.meter.trials
        self.best_reward = -first.best_cost
        """Reward of the best trial, those in which hands were tried among them."""
        self._arms = Arms(
            parameters.envs,
            session._task,
            around=first.postures,
            hands=None if parameters.chooses_hands else first.hands,
            model=session.model,
        )
        actions, seen = self._arms.action_space, self._arms.observation_space.high
        if self._sees_targets:
            seen = np.append(seen, np.full(len(self._arms.free), np.inf, dtype=np.float32))
        self.render_mode = None
        super().__init__(parameters.envs, Box(-seen, seen), actions)
        self._actions: Array = np.zeros((self.num_envs, *actions.shape), dtype=np.float32)

    def _observations(self) -> NDArray[np.float32]:
        seen = self._arms.observations()
        if self._sees_targets:
            moved = self._actions[:, -len(self._arms.free) :]
            moved = np.where(self._arms.goal[:, None] > 0, moved, 0.0)
            seen = np.hstack([seen, moved], dtype=np.float32)
        return seen

    def reset(self) -> NDArray[np.float32]:
        """Begin all trials."""
        self._arms.reset(np.ones(self.num_envs, dtype=np.bool_))
        return self._observations()

    def step_wait(self) -> tuple[NDArray[np.float32], Array, NDArray[np.bool_], list[Any]]:
        """Make the next subtask of all trials. Raises BudgetError where no trial is left."""
        ended = self._step(np.ones(self.num_envs, dtype=np.bool_))
        rewards: Array = np.zeros(self.num_envs)
        infos: list[dict[str, Any]] = [{} for _ in rewards]
        if ended.any():
            rows = np.flatnonzero(ended)
            costs = -self._count(rows[: self._trials_left])
            self._trials_left -= len(costs)
            if len(costs) < len(rows):
                raise BudgetError("all trials are made")
            rewards[rows] = np.maximum(100.0 * (1.0 - costs / self._first_cost), WORST)
            # An agent that looks at the last observation finds that nothing follows.
            last = np.zeros(self.observation_space.shape, dtype=np.float32)
            for row in rows:
                steps = len(self._arms.hands[row])
                episode = {"r": float(rewards[row]), "l": steps, "t": 0}
                infos[row] = {"terminal_observation": last, "episode": episode}
            self._arms.reset(ended)
        return self._observations(), rewards.astype(np.float32), ended, infos

    def trial_of(self, policy: Callable[[NDArray[np.float32]], Array]) -> tuple[Movement, ...]:
        """Make the last trial, which is not part of the training; its movements are returned.

        ``policy`` gives actions ``(envs, A)`` for observations ``(envs, O)``.
        """
        observations = self.reset()
        first, ended = np.arange(self.num_envs) == 0, False
        while not ended:
            self.step_async(policy(observations))
            ended = bool(self._step(first)[0])
            observations = self._observations()
        self._count(np.array([0]))
        made = str(self._arms.hands[0])
        hands = made + self._first_hands[len(made) :]  # of goals after a failure
        return movements_of(hands, self._arms.trials.targets[0])

    def _step(self, which: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Make the next subtask of these robots; returns whose trials have ended."""
        actions = self._actions.copy()
        actions[:, -len(self._arms.free) :] *= self._scale
        return self._arms.step(actions, which, clips=False)[1]

    def _count(self, rows: NDArray[np.int64]) -> Array:
        """Count the trials of these robots; returns their rewards."""
        trials = Trials._make(each[rows] for each in self._arms.trials)
        self._session._count_batch(trials)
        self.best_reward = max([self.best_reward, *trials.rewards])
        return trials.rewards


class Agent(Method):
    """A method of the benchmark that trains an agent of Stable-Baselines3.

    A subclass has a name, a title, a citation and :meth:`agent`. The solution is one trial of what
    the agent has learned: of its policy without noise, made after the training and counted. The
    details have ``best_trial_reward``, the reward of the best trial of all.
    """

    told = TOLD
    Parameters = AgentParameters

    def why_not(self, task: Outline) -> str | None:
        """More hand sequences than can be tried one by one."""
        return task.too_many_sequences

    def solve(self, session: Session) -> Result:
        """Train until one trial is left, and make it with the policy without noise."""
        torch.set_num_threads(1)
        try:
            envs = SessionEnvs(session, self.parameters)
        except BudgetError:
            raise MethodError("infeasible", "the trial budget leaves no trial to make") from None
        with session.solving():
            agent = self.agent(envs, int(session.rng.integers(2**31)))
            with suppress(BudgetError):
                agent.learn(10**9)  # until the environments end it
            solution = envs.trial_of(lambda seen: agent.predict(seen, deterministic=True)[0])
        return Result(solution, {"best_trial_reward": int(envs.best_reward)})

    @abstractmethod
    def agent(self, envs: SessionEnvs, seed: int) -> BaseAlgorithm:
        """An agent that is not trained yet."""
