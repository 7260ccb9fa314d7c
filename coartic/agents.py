"""Agents of Stable-Baselines3 as methods of the benchmark. Needs the extra ``coartic[rl]``.

:class:`SessionEnvs` presents the trials of a session as environments. An :class:`Agent` is a method
that trains on them; its result is one trial of the learned policy without noise.
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

from coartic.gym import LETTERS, Arms
from coartic.learner.learning import TRIALS
from coartic.method import BudgetError, Method, MethodError, Outline, Parameters, Result, Session
from coartic.motion.initial import too_many_sequences
from coartic.motion.solution import Movement
from coartic.motion.trials import Trials, movements_of
from coartic.optimisers import TOLD, Objective
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


class SessionEnvs(VecEnv):
    """The robots of :class:`coartic.gym.Arms` as environments of Stable-Baselines3.

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

    def step_async(self, actions: Array) -> None:
        """Take the actions of the next subtask."""
        self._actions = actions

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
                steps = np.count_nonzero(self._arms.hands[row] >= 0)
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
        made, given = LETTERS[self._arms.hands[0]], self._first_hands  # of goals after a failure
        hands = "".join(one or other for one, other in zip(made, given, strict=True))
        return movements_of(hands, self._arms.trials.targets[0])

    def _step(self, which: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Make the next subtask of these robots; returns whose trials have ended."""
        actions = self._actions.copy()
        actions[:, -len(self._arms.free) :] *= self._scale
        return self._arms.step(actions, which)[1]

    def _count(self, rows: NDArray[np.int64]) -> Array:
        """Count the trials of these robots; returns their rewards."""
        trials = Trials._make(each[rows] for each in self._arms.trials)
        self._session._count_batch(trials)
        self.best_reward = max([self.best_reward, *trials.rewards])
        return trials.rewards

    # What Stable-Baselines3 wants of its environments beside this.

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
        """They are not."""
        return [False] * self.num_envs


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
        return too_many_sequences(task.name, task.goals_count, len(task.hands))

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
