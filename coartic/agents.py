"""Agents of Stable-Baselines3 as methods of the benchmark. Needs the extra ``coartic[rl]``.

:class:`SessionEnvs` makes the trials of a session environments; an :class:`Agent` is a method that
trains on them and is judged by what it has learned: one trial of its policy without noise.
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

from coartic.learner.learning import TRIALS
from coartic.method import BudgetError, Method, MethodError, Outline, Parameters, Result, Session
from coartic.motion.initial import too_many_sequences
from coartic.motion.solution import Movement
from coartic.motion.trials import Trials, movements_of
from coartic.optimisers import TOLD, Objective
from coartic.robot import HANDS, Array
from coartic.tasks.task import hands_of

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
    """Trials of a session, side by side, as environments of Stable-Baselines3.

    A step is a subtask. An action has, where the agent chooses hands, an entry for the left hand
    (below 0) or the right one, and one for each joint that can move: its target, from -1 to 1 in
    a box around the configuration in which the corrective process alone hits the goal. An arm
    that hits neither this goal nor a later one keeps its posture. An observation has an entry for
    each goal, 1 for the next one, and two for the hand that hit the goal before; with
    ``sees_targets`` also the last action for each joint.

    The observations do not depend on how the movements end, so the trials are made when their
    last actions are known. The last step then has the reward: by how many per cent the trial was
    better than the corrective process alone; the others have 0.
    """

    def __init__(self, session: Session, parameters: AgentParameters) -> None:
        trials, left = parameters.trials, session.trials_left
        if left is not None:
            trials = min(trials, left)
        first = Objective(session, trials=trials - 1)  # the last one is the policy's
        self._session, self._scale = session, parameters.scale
        self._trials_left = trials - 1 - session.meter.trials
        self._first_cost = first.best_cost
        self.best_reward = -first.best_cost
        """Reward of the best trial, those in which hands were tried among them."""
        self._postures = first.postures
        self._hands = np.array([HANDS.index(hand) for hand in hands_of(first.hands)])
        self._chooses_hands = parameters.chooses_hands and len(session.hands) == 2
        self._free = np.asarray(first.joints.any(axis=0))
        for hand in session.hands if self._chooses_hands else ():
            self._free[session.joints(hand)] = True
        size = int(self._chooses_hands) + int(self._free.sum())
        self.render_mode = None
        seen = np.ones(session.goals_count + 2 + parameters.sees_targets * self._free.sum())
        seen[session.goals_count + 2 :] = np.inf
        observed = Box(-seen.astype(np.float32), seen.astype(np.float32))
        super().__init__(parameters.envs, observed, Box(-1.0, 1.0, (size,), np.float32))
        self._begin()

    def _begin(self) -> None:
        """Put all robots back to the start."""
        count, goals = self.num_envs, self._session.goals_count
        self._goal = 0
        self._chosen = np.tile(self._hands, (count, 1))
        self._targets = np.full((count, goals, self._session.dof), np.nan)
        self._moved: Array = np.zeros((count, int(self._free.sum())))

    def _observations(self) -> NDArray[np.float32]:
        seen = np.zeros((self.num_envs, *self.observation_space.shape), dtype=np.float32)
        goals = self._session.goals_count
        seen[:, self._goal] = 1.0
        if self._goal > 0:
            rows = np.arange(self.num_envs)
            seen[rows, goals + self._chosen[:, self._goal - 1]] = 1.0
        if seen.shape[1] > goals + 2:
            seen[:, goals + 2 :] = self._moved
        return seen

    def reset(self) -> NDArray[np.float32]:
        """Begin all trials."""
        self._begin()
        return self._observations()

    def step_async(self, actions: Array) -> None:
        """Take the actions of the next subtask."""
        if self._chooses_hands:
            self._chosen[:, self._goal] = actions[:, 0] > 0
        self._moved = actions[:, int(self._chooses_hands) :]
        target = self._postures[self._goal, self._free] + self._scale * self._moved
        self._targets[:, self._goal, self._free] = target
        self._goal += 1

    def step_wait(self) -> tuple[NDArray[np.float32], Array, NDArray[np.bool_], list[Any]]:
        """Make the trials, where all subtasks have their actions. Raises BudgetError where no
        trials are left."""
        rewards: Array = np.zeros(self.num_envs)
        infos: list[dict[str, Any]] = [{} for _ in rewards]
        ended: NDArray[np.bool_] = np.full(self.num_envs, self._goal == self._session.goals_count)
        if ended.all():
            rewards = self._rewards_of_trials()
            # An agent that looks at the last observation finds that nothing follows.
            last = np.zeros(self.observation_space.shape, dtype=np.float32)
            infos = [
                {"terminal_observation": last, "episode": {"r": float(r), "l": self._goal, "t": 0}}
                for r in rewards
            ]
            self._begin()
        return self._observations(), rewards.astype(np.float32), ended, infos

    def _rewards_of_trials(self) -> Array:
        """Rewards of the trials, in per cent of what the first one took."""
        count = min(self.num_envs, self._trials_left)
        if count == 0:
            raise BudgetError("all trials are made")
        costs = -self._make_trials(count).rewards
        self._trials_left -= count
        self.best_reward = max(self.best_reward, -float(costs.min()))
        if count < self.num_envs:
            raise BudgetError("all trials are made")
        gains = np.asarray(100.0 * (1.0 - costs / self._first_cost))
        return np.maximum(gains, WORST)

    def _make_trials(self, count: int) -> Trials:
        """Make the trials of the first ``count`` robots."""
        for number, hand in enumerate(HANDS):
            if hand in self._session.hands:  # an arm keeps its posture when its last goal is hit
                later = np.flip(np.flip(self._chosen == number, 1).cumsum(axis=1), 1) > 0
                self._targets[..., self._session.joints(hand)][~later] = np.nan
        return self._session.trials(self._chosen[:count], self._targets[:count])

    def trial_of(self, policy: Callable[[NDArray[np.float32]], Array]) -> tuple[Movement, ...]:
        """Make the last trial, which no training may take: the movements that a policy makes.

        ``policy`` gives actions ``(envs, A)`` for observations ``(envs, O)``.
        """
        observations = self.reset()
        for _ in range(self._session.goals_count):
            self.step_async(policy(observations))
            observations = self._observations()
        trials = self._make_trials(1)
        self.best_reward = max(self.best_reward, float(trials.rewards[0]))
        letters = "".join(HANDS[code][0].upper() for code in self._chosen[0])
        return movements_of(letters, trials.targets[0])

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
