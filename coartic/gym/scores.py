"""Scores of policies, agents and methods in the environments."""

from __future__ import annotations

import pickle
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from copy import copy
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from coartic.errors import NotApplicableError
from coartic.estimates import Estimate, mean
from coartic.gym.environments import TaskEnv, names_family
from coartic.internal.limits import MAX_CELLS, brief_value, check_limits
from coartic.method import Method, MethodError, run_method
from coartic.model import MotionModel
from coartic.motion.execution import execute, execute_noisy, initial_hands
from coartic.motion.solution import Movement, corrective_movements, next_action
from coartic.motion.trials import JUDGE, noise_seed
from coartic.robot import Array
from coartic.tasks.catalogue import as_task
from coartic.tasks.optima import best_shipped
from coartic.tasks.task import Task

JUDGED = 100
"""Number of noise draws over which :func:`score` averages if the model has motor noise."""
Policy = Callable[[NDArray[np.float32]], ArrayLike] | Method | Any
_NEUTRAL = (
    *("OrderEnforcing", "PassiveEnvChecker", "SyncVectorEnv"),
    *("Monitor", "DummyVecEnv", "VecMonitor", "SharesOfTicks"),
)
"""Names of wrapper classes that change neither observations, nor actions, nor the length of a
trial."""


def score(
    env: Any,
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
        Id, or environment of this module. For a family, the instances of the test split are scored,
        unless the options name another ``split``. If an environment has wrappers other than
        ``VecNormalize`` and those that ``gymnasium.make`` and ``sb3`` add, agents and functions
        are scored in the wrapped environment, and the instances are those of the environment. The
        rewards in the table are nevertheless in ticks, and the statistics of normalising wrappers
        are not updated.
    policy : callable, agent, Method or mapping, optional
        One of

        - a function that returns actions ``(N, A)`` for observations ``(N, O)``;
        - an agent with the ``predict`` of Stable-Baselines3, whose actions are deterministic;
        - a method of the benchmark, such as a planner, that solves each task;
        - a dict that maps names to any of these.
    episodes : int
        Number of trials of random actions on each task, from 1 to 10,000. With motor noise the
        number is always 100.
    seed : int
        Seed of random actions, of methods, of an environment with wrappers and of the motor noise.
    vec_normalize : str, Path or VecNormalize, optional
        Normalisation of observations: the ``VecNormalize`` of an agent's training, or the file that
        its ``save`` has written (a pickle: open only files that you trust). By default the
        ``VecNormalize`` of ``env`` is used, or else that of the agent's own environment.
    **options
        Options of :class:`.TaskEnv`. An environment with other wrappers, as above, takes none.

    Returns
    -------
    DataFrame
        A row for each policy, for uniformly random actions, for the corrective process with the
        initial hands of each task, and for the best known solutions. Columns:

        - ``reward``: mean reward over all trials of all tasks (in ticks);
        - ``gap``: mean relative gap over the tasks whose best reward is known. The relative gap is
          (best known reward - reward) / abs(best known reward);
        - ``gap_low``, ``gap_high``: 95 % bootstrap interval of the gap over tasks, or over the
          trials of a single task (:func:`coartic.estimates.mean`);
        - ``completed``: share of trials that hit all goals; NaN for the best known solutions.

        With motor noise there are 100 trials of each policy, of random actions and of the
        corrective process on each task. Without motor noise there are ``episodes`` trials of random
        actions and one trial of each of the others. Reward and gap are NaN for a row with a failed
        trial, and where they are unknown. ``attrs["units"]`` is a dict that maps columns to units.

    Raises
    ------
    TypeError
        One of these is the case:

        - the environment is not of this module;
        - the environments of a vector environment have different options;
        - an option is missing or unknown;
        - an agent has other spaces than the environment;
        - an agent was trained with such other wrappers, and the environment has none;
        - a wrapper does not pass on the options of ``reset``.
    ValueError
        An option is wrong, options are passed for an environment with wrappers, the name of a
        policy is the name of another row, a function returns an array of actions with a wrong
        shape, or observations would be normalised twice.
    TaskError
        The task or family is unknown.
    OSError
        The file of ``vec_normalize`` cannot be read.
    gymnasium.error.Error
        The id is unknown.

    Warns
    -----
    UserWarning
        An agent was loaded without an environment, and its observations are not normalised. The
        agent may have been trained in ``VecNormalize``.

    Notes
    -----
    With motor noise, policies, random actions and the corrective process are scored on the same 100
    noise draws for each task. No method uses these draws in its own trials. Solutions of methods
    and of the corrective process are executed by :func:`coartic.execute_noisy`. The best known
    rewards come with the package; :attr:`.Objective.best_known` lists the tasks and models that
    have one.

    Examples
    --------
    >>> table = score("coartic/Ascending-v2", lambda seen: np.zeros((len(seen), 6)))
    >>> table.reward.to_dict()  # doctest: +ELLIPSIS
    {'policy': -319.0, 'random actions': ..., 'corrective process': -319.0, 'best known': -292.0}
    """
    check_limits("episodes", episodes, 1, MAX_CELLS)
    env = gymnasium.make(env, **options) if isinstance(env, str) else env
    inner, wrappers = _layers(env)[-1], _wrappers_of(env)
    if not isinstance(inner, TaskEnv):
        raise TypeError(
            f"env is {brief_value(env)}; it must be an id, or an environment or vector environment "
            "of coartic in this process"
        )
    normalisers = [wrapper for wrapper in wrappers if _normalises(wrapper)]
    if vec_normalize is None and wrappers == normalisers:
        vec_normalize = next(iter(normalisers), None)
    if wrappers == normalisers:
        wrappers = []
    if wrappers and options:
        raise ValueError(
            f"{', '.join(options)} cannot be set here, because env has wrappers: make env with it"
        )
    if vec_normalize is not None and wrappers and normalisers:
        raise ValueError("env has a VecNormalize already: leave vec_normalize out")
    env_options = inner.options | options
    if names_family(env_options["task"]) and not wrappers:
        env_options = inner.options | {"split": "test", "count": None, "year": None} | options
    setting = type(inner)(**env_options)
    setting.tasks[:] = tasks = [*map(as_task, setting.tasks)]
    policies = policy if isinstance(policy, Mapping) else {"policy": policy}
    if reserved := {"random actions", "corrective process", "best known"} & {*policies}:
        raise ValueError(
            f"policy {min(reserved)!r} has the name of another row of the table: rename it"
        )
    if isinstance(vec_normalize, str | Path):
        vec_normalize = pickle.loads(Path(vec_normalize).read_bytes())
    rewards: dict[str, Any] = {}
    draws = JUDGED if setting.model.motor_noise > 0.0 else 1
    for name, agent in policies.items():
        if isinstance(agent, Method):
            rewards[name] = [_rewards_of(agent, task, seed, setting.model) for task in tasks]
        elif agent is not None and wrappers:
            act = _actions_of(agent, env, wrappers, vec_normalize)
            rewards[name] = [
                [_wrapped_trial(act, env, n, seed, draw) for draw in range(draws)]
                for n in range(len(tasks))
            ]
        elif agent is not None:
            act = _actions_of(agent, setting, [], vec_normalize)
            rewards[name] = _trials(act, setting, draws, seed)
    rng, shape = np.random.default_rng(seed), setting.action_space.shape
    rewards["random actions"] = _trials(
        lambda seen: rng.uniform(-1, 1, (len(seen), *shape)),
        setting,
        draws if setting.model.motor_noise > 0.0 else episodes,
        seed,
    )
    rewards["corrective process"] = [
        _corrective_rewards(task, seed, setting.model) for task in tasks
    ]
    optima = [best_shipped(task, setting.model) for task in tasks]
    rewards["best known"] = [[None if optimum is None else optimum.reward] for optimum in optima]
    return _table({name: np.array(values, np.float64) for name, values in rewards.items()})


def _layers(env: Any) -> list[Any]:
    """List the layers of an environment, from the outermost wrapper to the innermost environment.

    After a vector environment, the list continues with the layers of its first environment. Raises
    TypeError if the environments of a vector environment have different options.
    """
    layers = [env]
    while (name := next((n for n in ("venv", "env", "envs") if hasattr(env, n)), None)) is not None:
        env = getattr(env, name)
        if name == "envs":
            inner = [_layers(member)[-1] for member in env]
            options = [getattr(member, "options", None) for member in inner]
            if any(member_options != options[0] for member_options in options):
                raise TypeError("env has environments with different options: score each of them")
            env = env[0]
        layers.append(env)
    return layers


def _wrappers_of(env: Any) -> list[Any]:
    return [layer for layer in _layers(env)[:-1] if type(layer).__name__ not in _NEUTRAL]


def _normalises(env: Any) -> bool:
    return type(env).__name__ == "VecNormalize"


def _actions_of(
    policy: Any, env: Any, wrappers: list[Any], normal: Any
) -> Callable[[NDArray[np.float32]], ArrayLike]:
    """Return a function that computes the actions of a policy.

    Parameters
    ----------
    policy : callable or agent
        Function of observations, or object with the ``predict`` of Stable-Baselines3.
    env : object
        Environment in which the policy acts.
    wrappers : list
        Wrappers of ``env`` that change observations or actions.
    normal : VecNormalize or None
        Normalisation of observations. If it is None, and no wrapper is a ``VecNormalize``, the
        ``VecNormalize`` of the agent's own environment is used.

    Returns
    -------
    callable
        Function that maps observations, shape ``(N, O)``, to actions, shape ``(N, A)``.

    Raises
    ------
    TypeError
        The agent has other spaces than ``env``, or was trained with wrappers although ``wrappers``
        is empty.
    """
    normalised = any(map(_normalises, wrappers))
    if normal is None and not normalised:
        normal = getattr(policy, "get_vec_normalize_env", lambda: None)()
    see = normal.normalize_obs if normal else np.asarray
    if not hasattr(policy, "predict"):
        return lambda seen: policy(see(seen))
    for name in ("observation_space", "action_space"):
        env_space = getattr(env, f"single_{name}", None) or getattr(env, name)
        if (agent_space := getattr(policy, name, env_space)) != env_space:
            raise TypeError(
                f"the agent's {name} is {brief_value(agent_space)}, and the environment's is "
                f"{brief_value(env_space)}: score the agent in the environment of its training, "
                "with its wrappers"
            )
    agent_env = getattr(policy, "get_env", lambda: env)()
    if agent_env is None and not (normal or normalised):
        warnings.warn(
            "the agent was loaded without an environment. If it was trained in VecNormalize, call "
            "score with vec_normalize=FILE, the file that VecNormalize.save wrote; otherwise load "
            "the agent with env=coartic.gym.sb3(ID)",
            stacklevel=3,
        )
    for wrapper in [] if wrappers or agent_env is None else _wrappers_of(agent_env):
        if not _normalises(wrapper):
            raise TypeError(
                f"the agent's environment has the wrapper {type(wrapper).__name__}: score the "
                "agent in an environment with this wrapper"
            )
    return lambda seen: policy.predict(see(seen), deterministic=True)[0]


def _trials(act: Callable[[Any], ArrayLike], setting: TaskEnv, trials: int, seed: int) -> Array:
    """Make all trials at once on each task of an environment.

    Parameters
    ----------
    act : callable
        Function that maps observations, shape ``(n, O)``, to actions, shape ``(n, A)``.
    setting : TaskEnv
        Environment, of which copies make the trials.
    trials : int
        Number of trials on each task.
    seed : int
        Seed from which the noise seed for scoring is derived. Trial k has noise draw k.

    Returns
    -------
    ndarray, shape (tasks, trials)
        Total rewards (in ticks); NaN for a trial that failed.

    Raises
    ------
    ValueError
        ``act`` does not return an action for each observation.
    """
    robots = [copy(setting) for _ in range(trials * len(setting.tasks))]
    seen = []
    for n, robot in enumerate(robots):
        seen.append(robot.reset(options={"task": n // trials})[0])
        robot.world, robot.draw = noise_seed(seed, JUDGE), n % trials
    while going := [n for n, robot in enumerate(robots) if robot.going]:
        actions = np.asarray(act(np.array([seen[n] for n in going])))
        if len(actions) != len(going):
            raise ValueError(
                f"actions have shape {actions.shape}; they must have a row for each of "
                f"{len(going)} observations"
            )
        for n, action in zip(going, actions, strict=True):
            seen[n] = robots[n].step(action)[0]
    return np.reshape([robot.outcome for robot in robots], (-1, trials))


def _wrapped_trial(
    act: Callable[[Any], ArrayLike], env: Any, number: int, seed: int, draw: int
) -> float:
    """Make one trial in a wrapped environment, and return its total reward (in ticks).

    In a vector environment, the first environment makes the trial. The result is NaN if the trial
    failed or was truncated.

    Parameters
    ----------
    act : callable
        Function that maps observations, shape ``(N, O)``, to actions, shape ``(N, A)``.
    env : Env, VectorEnv or VecEnv
        The environment with its wrappers.
    number : int
        Index of the task, from 0.
    seed : int
        Seed of the environment. The noise seed for scoring is derived from it as well.
    draw : int
        Number of the noise draw.

    Raises
    ------
    TypeError
        A wrapper does not pass on the options of ``reset``.
    """
    inner, is_one = _layers(env)[-1], isinstance(env, gymnasium.Env)
    options: dict[str, Any] = {"task": number}
    with _not_learning(env):
        if hasattr(env, "set_options"):  # of Stable-Baselines3
            env.seed(seed)
            env.set_options(options)
            seen = env.reset()
        else:
            seen, _ = env.reset(seed=seed, options=options)
        if inner.number != number:
            raise TypeError(
                "a wrapper of env does not pass the options of reset to the environment"
            )
        inner.world, inner.draw = noise_seed(seed, JUDGE), draw
        inner.outcome, ended = np.nan, False
        while not ended:
            actions = np.asarray(act(np.asarray(seen)[None] if is_one else seen))
            seen, _, *flags, _ = env.step(actions[0] if is_one else actions)
            ended = any(np.ravel(flag)[0] for flag in flags)
    return float(inner.outcome)


def _every_layer(env: Any) -> Iterator[Any]:
    """Yield the layers of an environment, and those of each member of a vector environment."""
    yield env
    if inner := next((getattr(env, name) for name in ("venv", "env") if hasattr(env, name)), None):
        yield from _every_layer(inner)
    elif hasattr(env, "envs"):
        for member in env.envs:
            yield from _every_layer(member)


@contextmanager
def _not_learning(env: Any) -> Iterator[None]:
    """Keep the statistics of normalising wrappers unchanged in a ``with`` block."""
    learning = [
        (layer, name, getattr(layer, name))
        for layer in _every_layer(env)
        for name in ("training", "update_running_mean")
        # A wrapper has the attributes of the layers inside it, too.
        if name in vars(layer) or hasattr(type(layer), name)
    ]
    try:
        for layer, name, _ in learning:
            setattr(layer, name, False)
        yield
    finally:
        for layer, name, value in learning:
            setattr(layer, name, value)


def _rewards_of(method: Method, task: Task, seed: int, model: MotionModel) -> Any:
    """Return the rewards of a method's solution, one for each noise draw.

    Without motor noise there is one reward. All rewards are NaN if the method does not apply to the
    task or finds no solution. A reward is NaN, or None without motor noise, if the execution fails.
    """
    with suppress(MethodError, NotApplicableError):
        result, _ = run_method(method, task, seed, model=model)
        return _judged(task, result.solution, seed, model)
    return [np.nan] * (JUDGED if model.motor_noise > 0.0 else 1)


def _corrective_rewards(task: Task, seed: int, model: MotionModel) -> Any:
    """Return the rewards of the corrective process with a task's initial hands.

    There is one reward for each noise draw, or one reward without motor noise. All rewards are NaN
    if no initial hands are found. A reward is NaN, or None without motor noise, if the execution
    fails.
    """
    with suppress(NotApplicableError):
        movements = corrective_movements(initial_hands(task, model=model))
        return _judged(task, movements, seed, model)
    return [np.nan] * (JUDGED if model.motor_noise > 0.0 else 1)


def _judged(task: Task, solution: Sequence[Movement], seed: int, model: MotionModel) -> Any:
    """Return the rewards of executions of a solution.

    There are 100 rewards with motor noise, and one reward without it.
    """
    if model.motor_noise == 0.0:
        return [execute(task, solution, model=model).reward]
    noise, exact = model.motor_noise, model.without_noise()
    return -execute_noisy(task, [next_action(solution)], noise, JUDGED, seed, exact)[0]


def _table(rewards: Mapping[str, Array]) -> pd.DataFrame:
    """Return the table of :func:`score` from the rewards of its rows.

    ``rewards`` is a dict that maps the name of each row to its rewards (in ticks), shape ``(tasks,
    trials)``, with NaN for a failed trial or an unknown reward. The last row contains the best
    known rewards.
    """
    (*_, best), rows = rewards.values(), {}
    known = np.isfinite(best[:, 0])
    for name, earned in rewards.items():
        gap = ((best - earned) / np.abs(best))[known]
        values = gap.ravel() if len(best) == 1 else gap.mean(axis=1)
        completed = np.isfinite(earned)
        usable = len(values) > 0 and (earned is best or completed.all())
        rows[name] = {
            "reward": earned.mean(axis=1).mean(),
            **(mean(values) if usable else Estimate(np.nan)).columns("gap"),
            "completed": np.nan if earned is best else completed.mean(),
        }
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("policy")
    gaps = dict.fromkeys(["gap", "gap_low", "gap_high"], "share of the best known reward")
    table.attrs["units"] = {"reward": "ticks", **gaps, "completed": "share of trials"}
    return table
