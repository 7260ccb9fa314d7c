"""Policies, agents and planners compared on the tasks of an environment."""

from __future__ import annotations

import pickle
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from itertools import chain
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pandas as pd
from gymnasium.vector import VectorEnv
from numpy.typing import ArrayLike, NDArray

from coartic.errors import NotApplicableError
from coartic.estimates import Estimate, mean
from coartic.gym.environment import layers, options_of, robots_of, wrappers_of
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
    vec_normalize: str | Path | Any = None,
    **options: Any,
) -> pd.DataFrame:
    """Compare policies and planners with random actions and the best known solutions.

    Parameters
    ----------
    env : str, Env, VectorEnv or VecEnv
        An environment of this package, or its id. Of a family the instances of the test split are
        scored, or of the ``split`` that is given here. An environment in wrappers (other than
        :data:`ADDED`, or ``VecNormalize`` alone) is taken as it is, with its own instances:
        policies that are no methods see and do what the wrappers let them, and trials count in
        ticks; wrappers that normalise learn nothing.
    policy : callable, agent, Method or mapping, optional
        Gives actions ``(N, A)`` for observations ``(N, O)``: a function, an agent with the
        ``predict`` of Stable-Baselines3, which is asked without noise, or a method of the
        benchmark, such as a planner, that solves each task. By default the ``VecNormalize`` of
        an agent's own environment normalises what it sees. A mapping has several, by their
        names.
    episodes : int
        Trials of random actions on each task.
    seed : int
        Seed of random actions, of methods and of an environment in wrappers.
    vec_normalize : str, Path or VecNormalize, optional
        Normalises what policies see (in the place of ``env``'s, if that is its only wrapper), such
        as of an agent that was loaded from a file: the ``VecNormalize`` of its training, or the
        file that its ``save`` wrote (a pickle: open only files that you trust).
    **options
        Options of :class:`TaskVectorEnv`, for an environment without wrappers.

    Returns
    -------
    DataFrame
        A row for each policy, for uniformly random actions, for the corrective process alone with
        the task's initial hands, and for the best solution known. Columns: ``reward``, the mean
        over tasks, ticks; ``gap`` to the best known reward, a share of it, over tasks where it is
        known, with its 95 % interval ``gap_low`` to ``gap_high`` (BCa bootstrap) over tasks, or of
        one task over trials; ``completed``, the share of trials that hit all goals (by actions in
        less than 1,000,000 ticks): where it is below 1, reward and gap are NaN. NaN also stands for
        what is not known, and for an interval of too few values. ``attrs["units"]`` has the units.

    Raises
    ------
    ValueError, TypeError
        The environment is not coartic's, an option is wrong, the policy is no policy, is called as
        another row, or is an agent with other spaces than the environment or with wrappers where
        this has none; or observations would be normalised twice, in ``env`` and by
        ``vec_normalize``.
    OSError
        The file of ``vec_normalize`` cannot be read.

    Warns
    -----
    UserWarning
        An agent's ``get_env`` returns None, as after loading, and neither ``env`` nor
        ``vec_normalize`` normalises: nothing says whether it was trained in ``VecNormalize``.

    Examples
    --------
    >>> table = score("coartic/Ascending-v2", lambda seen: np.zeros((len(seen), 6)))
    >>> table.reward.to_dict()  # doctest: +ELLIPSIS
    {'policy': -319.0, 'random actions': ..., 'corrective process': -319.0, 'best known': -292.0}
    """
    check_limits("episodes", episodes, 1, MOST_CELLS)
    check_limits("seed", seed, 0, MOST_RUN_SEED)
    given, wrapped = options_of(env) | options, not isinstance(env, str) and wrappers_of(env)
    if wrapped == [env] and is_normaliser(env):
        vec_normalize, wrapped = vec_normalize or env, False
    if vec_normalize is not None and wrapped and any(map(is_normaliser, layers(env))):
        raise ValueError("the environment is in a VecNormalize already: leave vec_normalize out")
    if wrapped and options:
        raise ValueError(f"{', '.join(options)}: make the environment in the wrappers with this")
    if isinstance(task := given.get("task"), str | Path) and is_family(str(task)):
        given = {**(robots_of(env).instances if wrapped else {"split": "test"}), **given}
    setting = TaskVectorEnv(1, **given)
    model, shape = setting.model, setting.single_action_space.shape
    tasks = [setting.task_at(number) for number in range(len(setting.tasks))]
    policies = policy if isinstance(policy, Mapping) else {"policy": policy}
    if taken := {"random actions", "corrective process", "best known"} & {*policies}:
        raise ValueError(f"a policy is called {min(taken)!r}, as a row of the table: rename it")
    rewards, normal = {}, _normaliser(vec_normalize)
    for name, each in policies.items():
        if isinstance(each, Method):
            rewards[name] = column(_reward_of(each, task, seed, model) for task in tasks)
        elif each is not None:
            act = _acting(each, env if wrapped else setting, normal)
            if wrapped:
                rewards[name] = _rollout_as_it_is(act, env, len(tasks), seed)
            else:
                rewards[name] = _rollout(act, given, len(tasks))
    rng = np.random.default_rng(seed)
    rewards["random actions"] = _rollout(
        lambda seen: rng.uniform(-1, 1, (len(seen), *shape)), given, len(tasks), episodes
    )
    rewards["corrective process"] = column(initial_reward(task, model) for task in tasks)
    shipped = [best_shipped(task) if model == PAPER else None for task in tasks]
    return compare(rewards, column(None if each is None else each.reward for each in shipped))


def column(rewards: Iterable[float | None]) -> Array:
    """Return K rewards, at least one, as a column, an array of shape ``(K, 1)``, with NaN for
    None."""
    return np.array([[reward] for reward in rewards], np.float64)


def is_normaliser(env: Any) -> bool:
    """Return whether the class of an environment is called ``VecNormalize``."""
    return type(env).__name__ == "VecNormalize"


def _normaliser(given: str | Path | Any) -> Any:
    """Return the ``VecNormalize`` that is given, itself or by the pickle file that has it; None for
    None. Raises OSError if the file cannot be read, and TypeError for anything else."""
    what = f"vec_normalize is {brief_value(given)}"
    if isinstance(given, str | Path):
        try:
            given = pickle.loads(Path(given).read_bytes())
        except OSError:
            raise
        except Exception as error:
            raise TypeError(f"{what}, which no VecNormalize.save wrote: {error}") from None
    if not (given is None or is_normaliser(given)):
        raise TypeError(f"{what}; it must be a VecNormalize, or the file that its save wrote")
    return given


def _acting(policy: Any, env: Any, normal: Any) -> Callable[[NDArray[np.float32]], ArrayLike]:
    """Return a function that gives the actions of a policy for observations of ``env``, which
    ``normal``, a ``VecNormalize``, normalises; if ``normal`` is None and ``env`` has none, the
    agent's own. Raises TypeError for no policy, and for an agent of other spaces, or of wrappers
    where ``env`` has none."""
    normalised = any(map(is_normaliser, layers(env)))
    if normal is None and not normalised:
        normal = getattr(policy, "get_vec_normalize_env", lambda: None)()
    see = normal.normalize_obs if normal else np.asarray
    if hasattr(policy, "predict"):
        for name in ("observation_space", "action_space"):
            there = getattr(env, f"single_{name}", None) or getattr(env, name)
            theirs = getattr(policy, name, there)
            if theirs != there:
                raise TypeError(
                    f"the agent's {name} is {brief_value(theirs)}, and the environment's is "
                    f"{brief_value(there)}: score the agent in the environment of its training, "
                    "in its wrappers"
                )
        own = getattr(policy, "get_env", lambda: env)()
        if own is None and not (normal or normalised):
            warnings.warn(
                "the agent has no environment, as after loading: if it was trained in VecNormalize,"
                " give score vec_normalize=FILE, which VecNormalize.save writes; if not, load it "
                "with env=coartic.gym.sb3(ID)",
                stacklevel=3,
            )
        if not wrappers_of(env):
            inner = layers(own)[-1]
            behind = [*wrappers_of(own), *chain(*map(wrappers_of, getattr(inner, "envs", ())))]
            for wrapper in behind:
                if not is_normaliser(wrapper):
                    raise TypeError(
                        f"the agent's environment is wrapped in {type(wrapper).__name__}: score "
                        "the agent in an environment with this wrapper"
                    )
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
    """Let ``act``, which gives actions ``(n, A)`` for observations ``(n, O)``, make trials on each
    task of a :class:`TaskVectorEnv` with these options. Return the total rewards, ticks, shape
    ``(tasks, trials)``; NaN where a trial failed or took 1,000,000 ticks or more."""
    rows = np.arange(trials * tasks)
    robots, totals = TaskVectorEnv(len(rows), **options), np.zeros(len(rows))
    robots._begin(rows, rows // trials)
    while len(rows):
        robots._move(real_array("actions", act(robots.state.seen[rows])), rows)
        totals[rows] += robots.state.rewards[rows]
        rows = np.flatnonzero(robots.state.going)
    return np.where(totals > -FAILED, totals, np.nan).reshape(-1, trials)


def _rollout_as_it_is(
    act: Callable[[NDArray[np.float32]], ArrayLike], env: Any, tasks: int, seed: int
) -> Array:
    """Let ``act`` (:func:`_rollout`) make trials in an environment in wrappers, reset with
    ``seed``, until each of its ``tasks`` tasks had a trial. Return the total reward of the trial on
    each task that ended first, ticks, shape ``(tasks, 1)``; NaN where the trial failed, was cut
    short or took 1,000,000 ticks or more."""
    robots, is_one = robots_of(env), isinstance(env, gymnasium.Env)
    totals, rewards = np.zeros(robots.num_envs), dict[int, float]()

    def begin(seed: int | None = None) -> Any:
        if hasattr(env, "step_async"):  # of Stable-Baselines3
            env.seed(seed)
            return env.reset()
        return env.reset(seed=seed)[0]

    with _as_learned(env):
        seen = begin(seed)
        while len(rewards) < tasks:
            numbers = robots.state.task.tolist()
            actions = act(np.asarray(seen)[None] if is_one else seen)
            seen, _, ended, *more = env.step(np.asarray(actions)[0] if is_one else actions)
            cut = np.atleast_1d(more[0] if len(more) > 1 else np.zeros_like(ended))
            totals += robots.state.rewards
            for row in np.flatnonzero(np.atleast_1d(ended) | cut):
                failed = cut[row] or totals[row] <= -FAILED
                rewards.setdefault(numbers[row], np.nan if failed else totals[row])
                totals[row] = 0
                seen = begin() if is_one else seen
    return column(rewards[number] for number in range(tasks))


@contextmanager
def _as_learned(env: Any) -> Iterator[None]:
    """Set ``training`` and ``update_running_mean``, where an environment and its wrappers have
    them, to False in the block of this context: the means by which wrappers normalise stay."""
    learning = [
        (each, name, getattr(each, name))
        for each in layers(env)
        for name in ("training", "update_running_mean")
        if name in vars(each) or isinstance(getattr(type(each), name, None), property)
    ]
    try:
        for each, name, _ in learning:
            setattr(each, name, False)
        yield
    finally:
        for each, name, value in learning:
            setattr(each, name, value)


@checked_arguments
def compare(rewards: Mapping[str, Numbers], best: Numbers) -> pd.DataFrame:
    """Return a table with a row for each policy and one for the best known, columns ``reward``,
    ``gap``, ``gap_low``, ``gap_high`` and ``completed`` (:func:`score`). ``rewards``, by policy,
    have shapes ``(K, trials)`` for K tasks, NaN where a trial failed; ``best`` has the best known
    rewards, shape ``(K, 1)``, NaN where none is known. Raises ValueError for other shapes, and for
    a policy ``best known``."""
    if "best known" in rewards:
        raise ValueError("a policy is called 'best known', as a row of the table: rename it")
    optimum = np.asarray(best)
    earnings = {name: np.asarray(each) for name, each in rewards.items()} | {"best known": optimum}
    shapes = [earned.shape for earned in earnings.values()]
    if optimum.shape[1:] != (1,) or any(s[:1] != optimum.shape[:1] or len(s) != 2 for s in shapes):
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
    """Return the reward of the solution that a method finds for a task; None if the method does not
    apply or finds no solution, or a goal is missed even after correction."""
    with suppress(MethodError, NotApplicableError):
        result, _ = run_method(method, task, seed, model=model)
        return execute(task, result.solution, model=model).reward
    return None
