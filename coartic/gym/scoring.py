"""Policies, agents and planners compared on the tasks of an environment."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pandas as pd
from gymnasium.vector import VectorEnv
from numpy.typing import ArrayLike, NDArray

from coartic.errors import NotApplicableError
from coartic.estimates import Estimate, mean
from coartic.gym.environment import normaliser_of, options_of, without_wrappers
from coartic.gym.vector import TaskVectorEnv
from coartic.internal.arguments import Numbers, checked_arguments
from coartic.internal.limits import MOST_CELLS, MOST_RUN_SEED, brief_value, check_limits, real_array
from coartic.method import Method, MethodError, run_method
from coartic.method.optimisers import FAILED
from coartic.model import PAPER, MotionModel
from coartic.motion.solution import execute, initial_reward
from coartic.robot import Array
from coartic.tasks.families import is_family
from coartic.tasks.optima import best_shipped
from coartic.tasks.task import Task

Policy = Callable[[NDArray[np.float32]], ArrayLike] | Method | Any


def score(
    env: str | gymnasium.Env | VectorEnv,
    policy: Policy | Mapping[str, Policy] | None = None,
    *,
    episodes: int = 20,
    seed: int = 0,
    **options: Any,
) -> pd.DataFrame:
    """Compare policies and planners with random actions and the best known solutions.

    Parameters
    ----------
    env : str, Env, VectorEnv or VecEnv
        An environment of this package without wrappers, except ``VecNormalize``, or its id. Of a
        family the instances of the test split are scored, or of the ``split`` that is given here.
    policy : callable, agent, Method or mapping, optional
        Gives actions ``(N, A)`` for observations ``(N, O)``: a function, an agent with the
        ``predict`` of Stable-Baselines3, which is asked without noise, or a method of the
        benchmark, such as a planner, that solves each task. For an agent that was trained in
        ``VecNormalize``, observations are normalised as there. A mapping has several, by their
        names.
    episodes : int
        Trials of random actions on each task.
    seed : int
        Seed of random actions and of methods.
    **options
        Options of :class:`TaskVectorEnv`.

    Returns
    -------
    DataFrame
        A row for each policy, for uniformly random actions, for the corrective process alone with
        the task's initial hands, and for the best solution known. Columns: ``reward``, the mean
        over tasks, ticks; ``gap`` to the best known reward, a share of it, with its 95 % interval
        ``gap_low`` to ``gap_high`` (BCa bootstrap) over tasks, or of one task over trials;
        ``completed``, the share of trials that hit all goals: where it is below 1, reward and gap
        are NaN. NaN also where nothing is known, or too few trials for an interval.
        ``attrs["units"]`` has the units.

    Raises
    ------
    ValueError, TypeError
        The environment is not coartic's or has a wrapper, an option is wrong, or the policy is
        no policy, or an agent that was trained in another wrapper.
    """
    check_limits("episodes", episodes, 1, MOST_CELLS)
    check_limits("seed", seed, 0, MOST_RUN_SEED)
    given = options_of(env) | options
    if isinstance(task := given.get("task"), str | Path) and is_family(str(task)):
        given = {"split": "test", **given}
    setting = TaskVectorEnv(1, **given)
    model, shape = setting.model, setting.single_action_space.shape
    tasks = [setting.task_at(number) for number in range(len(setting.tasks))]
    policies = policy if isinstance(policy, Mapping) else {"policy": policy}
    rewards = {}
    for name, each in policies.items():
        if isinstance(each, Method):
            rewards[name] = column(_reward_of(each, task, seed, model) for task in tasks)
        elif each is not None:
            rewards[name] = _rollout(_acting(each, normaliser_of(env)), given, len(tasks))
    rng = np.random.default_rng(seed)
    rewards["random actions"] = _rollout(
        lambda seen: rng.uniform(-1, 1, (len(seen), *shape)), given, len(tasks), episodes
    )
    rewards["corrective process"] = column(initial_reward(task, model) for task in tasks)
    shipped = [best_shipped(task) if model == PAPER else None for task in tasks]
    return compare(rewards, column(None if each is None else each.reward for each in shipped))


def column(rewards: Iterable[float | None]) -> Array:
    """Return K rewards as an array of shape ``(K, 1)``, with NaN for None."""
    return np.array([[np.nan if reward is None else reward] for reward in rewards])


def _acting(policy: Any, normal: Any) -> Callable[[NDArray[np.float32]], ArrayLike]:
    """Return a function from observations to actions for a policy, a function or an agent with
    ``predict``; one that was trained in ``VecNormalize``, or is given with it (``normal``), gets
    observations normalised as there. Raises TypeError for any other object and for an agent
    trained in another wrapper."""
    normal = getattr(policy, "get_vec_normalize_env", lambda: None)() or normal
    see = normal.normalize_obs if normal else np.asarray
    if hasattr(policy, "predict"):
        get_env = getattr(policy, "get_env", lambda: None)
        env = without_wrappers(get_env(), "the agent's environment", normal)
        for each in getattr(env, "envs", ()):
            without_wrappers(each, "the agent's environment")
        return lambda seen: policy.predict(see(seen), deterministic=True)[0]
    if not callable(policy):
        raise TypeError(
            f"policy is {brief_value(policy)}; it must be a function of observations, an agent "
            "with predict, or a Method"
        )

    def act(seen: NDArray[np.float32]) -> Any:
        if isinstance(actions := policy(see(seen)), tuple):
            raise TypeError(
                f"the policy returned a tuple of {len(actions)}; needed are the actions alone, "
                "which are the first entry of what an agent's predict returns"
            )
        return actions

    return act


def _rollout(
    act: Callable[[NDArray[np.float32]], ArrayLike],
    options: Mapping[str, Any],
    tasks: int,
    trials: int = 1,
) -> Array:
    """Let ``act``, which gives actions ``(n, A)`` for observations ``(n, O)``, make ``trials``
    trials on each of ``tasks`` tasks of a :class:`TaskVectorEnv` with these options.

    Returns the total rewards, ticks, shape ``(tasks, trials)``; NaN where a trial failed.
    """
    rows = np.arange(trials * tasks)
    robots, totals = TaskVectorEnv(len(rows), **options), np.zeros(len(rows))
    robots._begin(rows, rows // trials)
    while len(rows):
        robots._move(real_array("actions", act(robots.state.seen[rows])), rows)
        totals[rows] += robots.state.rewards[rows]
        rows = np.flatnonzero(robots.state.going)
    return np.where(totals > -FAILED, totals, np.nan).reshape(-1, trials)


@checked_arguments
def compare(rewards: Mapping[str, Numbers], best: Numbers) -> pd.DataFrame:
    """Return a table with a row for each policy and one for the best known, columns ``reward``,
    ``gap``, ``gap_low``, ``gap_high`` and ``completed`` (:func:`score`). ``rewards``, by policy,
    have shapes ``(K, trials)`` for K tasks, NaN where a trial failed; ``best`` has the best known
    rewards, shape ``(K, 1)``, NaN where none is known. Raises ValueError for other shapes."""
    optimum = np.asarray(best)
    earnings = {name: np.asarray(each) for name, each in rewards.items()} | {"best known": optimum}
    shapes = [earned.shape for earned in earnings.values()]
    if any(len(shape) != 2 or shape[0] != len(optimum) for shape in shapes):
        raise ValueError(f"rewards have shapes {shapes}; needed is a row for each task")
    rows, known = {}, np.isfinite(optimum[:, 0])
    for name, earned in earnings.items():
        gap = ((optimum - earned) / np.abs(optimum))[known]
        values = gap.ravel() if len(optimum) == 1 else gap.mean(axis=1)
        failed = name != "best known" and not np.isfinite(earned).all()
        usable = len(values) > 0 and np.isfinite(values).all() and not failed
        rows[name] = {
            "reward": earned.mean(axis=1).mean(),
            **(mean(values) if usable else Estimate(np.nan)).columns("gap"),
            "completed": float(np.isfinite(earned).mean()),
        }
    rows["best known"]["completed"] = np.nan
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("policy")
    gaps = dict.fromkeys(["gap", "gap_low", "gap_high"], "share of the best known reward")
    table.attrs["units"] = {"reward": "ticks", **gaps, "completed": "share of trials"}
    return table


def _reward_of(method: Method, task: Task, seed: int, model: MotionModel) -> float | None:
    """Return the reward, ticks, of a method's solution of a task when executed; None if the method
    does not apply, finds no solution, or the solution misses a goal."""
    with suppress(MethodError, NotApplicableError):
        result, _ = run_method(method, task, seed, model=model)
        return execute(task, result.solution, model=model).reward
    return None
