"""Tasks and families of tasks as environments of Gymnasium.

In each step of an environment (:class:`TaskEnv`) the robot reaches for one goal; the reward is
minus the number of control ticks that this takes. Importing this module registers the ids of
:data:`IDS`: one for each shipped task, such as ``coartic/Ascending-v2``, and ``coartic/Task-v2``
for any task or family.

- ``gymnasium.make`` makes an environment, and ``gymnasium.make_vec`` makes a vector environment.
- :func:`sb3` makes environments for Stable-Baselines3.
- :func:`score` compares policies with each other, with random actions and with the best known
  solutions.

The module needs the extra ``coartic[gym]``.
"""

from __future__ import annotations

import math
import pickle
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from copy import copy
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from coartic.errors import MissingExtraError, NotApplicableError
from coartic.estimates import Estimate, mean
from coartic.internal.limits import MAX_CELLS, brief_value, check_limits, real_array
from coartic.method import Method, MethodError, run_method
from coartic.method.optimisers import FAILED
from coartic.model import PAPER, MotionModel, model_from
from coartic.motion.execution import execute, execute_noisy, initial_hands, initial_reward
from coartic.motion.solution import Movement, corrective_movements, next_action
from coartic.motion.trials import (
    JUDGE,
    NO_NOISE,
    CompiledTask,
    compiled_task,
    count_trials,
    noise_draws,
    noise_seed,
    reach_next,
)
from coartic.robot import HANDS, MAX_NUMBER, Array
from coartic.tasks.catalogue import as_task, builtin_tasks
from coartic.tasks.families import LOCKED, instance_names, is_family, load_family
from coartic.tasks.optima import best_shipped
from coartic.tasks.task import MAX_GOALS, Split, Task

try:
    import gymnasium
    from gymnasium.error import ResetNeeded
    from gymnasium.spaces import Box
except ImportError:
    raise MissingExtraError("coartic.gym needs Gymnasium: pip install 'coartic[gym]'") from None

REACH = 0.5
"""Displacement of the target of a joint by an action entry of 1, in length units (base) and rad
(angles)."""
JUDGED = 100
"""Number of noise draws over which :func:`score` averages if the model has motor noise."""
IDS: dict[str, dict[str, Any]] = {
    f"coartic/{name.title().replace('-', '')}-v2": {"task": name} for name in builtin_tasks()
} | {"coartic/Task-v2": {}}
"""Dict that maps ids, such as ``coartic/Ascending-v2``, to options of :class:`TaskEnv`."""
Policy = Callable[[NDArray[np.float32]], ArrayLike] | Method | Any
_NEUTRAL = (
    *("OrderEnforcing", "PassiveEnvChecker", "SyncVectorEnv"),
    *("Monitor", "DummyVecEnv", "VecMonitor", "SharesOfTicks"),
)
"""Names of wrapper classes that change neither observations, nor actions, nor the length of a
trial."""


class TaskEnv(gymnasium.Env):
    """Environment in which a robot makes trials of a task or family.

    - *Episode.* An episode is a trial. In each step the robot reaches for the next goal, so that
      the number of steps of a trial is at most the number of goals of the task. Trials are never
      truncated.
    - *Reward.* The reward of a step is minus its number of control ticks. If the goal is missed
      even though the corrective process acts, the reward is -1,000,000, and the trial ends.
    - *Random numbers.* Two things can be random: the instance, if the task is a family, and the
      motor noise, if the model has any. ``reset(seed=n)`` begins a trial with noise draw 0 of seed
      n; ``reset()`` begins a trial with the next noise draw.

    Parameters
    ----------
    task : Task, str or Path
        A task, or a family: its name, such as ``"two-armed/v1"``, or the path of its file. Each
        trial of a family is a trial of one of its instances.
    split : {"development", "test", "fresh"}, optional
        Instances of the family: ``"development"`` to train on (the default), ``"test"`` to report
        on, or ``"fresh"`` for the instances of a ``year``.
    count : int, optional
        Number of instances of the split to use, starting with the first. The default is 1,000 for
        the development split, and 10 for the others.
    year : int, optional
        Year of the fresh instances, such as 2027.
    ahead : int
        Number of goals after the next goal that an observation includes.
    model : MotionModel or dict
        The motion model, or a dict of the constants that differ from the paper's model, such as
        ``{"motor_noise": 0.01}``.
    render_mode : {"rgb_array"}, optional
        ``"rgb_array"`` to make :meth:`render` return pictures.

    Raises
    ------
    ValueError, TypeError, TaskError
        An option other than ``render_mode`` is wrong, or the task or family is unknown.

    Notes
    -----
    *Joints* are here the base coordinates that are not locked (in length units) and the joint
    angles of the arms with the task's ``hands`` (in rad). The arms are in the order of ``hands``. A
    family has one list of joints for all instances: it contains each base coordinate that can move
    in some instances, and for each arm the largest number of joints that the family allows.

    An observation, float32 of shape ``(O,)``, consists of

    - for the next goal and each goal ahead, 1 if the goal exists, else 0;
    - x and y of each of these goals relative to the base (in length units), or 0 if the goal does
      not exist;
    - the value of each joint, or 0 if the robot does not have the joint;
    - for each joint, 1 if the robot can move it, else 0. These entries exist only in a family whose
      robots can have different numbers of links.

    An action, shape ``(A,)``, consists of one entry for the hand, if the task has two hands, and
    one entry for each joint. Entries for joints are clipped to the range from -1 to 1.

    - For each hand, the corrective process finds a posture in which this hand is at the goal. If
      the entry for the hand is at most 0.5, the hand is chosen whose posture is nearer to the
      present configuration, by the Euclidean distance in joint space. If the entry is above 0.5,
      the other hand is chosen.
    - The target of the movement is the posture of the chosen hand, plus :data:`REACH` times the
      entries for the joints. If the corrective process fails for the chosen hand, the present
      configuration takes the place of the posture of this hand.
    - Entries for joints that a robot cannot move have no effect.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["rgb_array"], "render_fps": 4}

    def __init__(
        self,
        task: Task | str | Path,
        *,
        split: Split | None = None,
        count: int | None = None,
        year: int | None = None,
        ahead: int = 1,
        model: MotionModel | Mapping[str, Any] = PAPER,
        render_mode: str | None = None,
    ) -> None:
        check_limits("ahead", ahead, 0, MAX_GOALS)
        self.model, self.render_mode = model_from(model), render_mode
        instances = {"split": split, "count": count, "year": year}
        self.options = {"task": task, "ahead": ahead, "model": self.model} | instances
        self.tasks: list[Task | str]  # tasks, or names of instances
        if _is_family(task):
            family = load_family(str(task))
            self.tasks = [*instance_names(str(task), split or "development", count, year)]
            locked = set.intersection(*({*LOCKED[base]} for base in family.base))
            (fewest, links), hands = family.links, family.hands
        elif any(option is not None for option in instances.values()):
            raise ValueError(
                f"split, count and year are options of families, not of task {brief_value(task)}"
            )
        else:
            self.tasks = [single := as_task(task)]
            locked, hands = {*single.locked_base}, single.hands
            fewest = links = single.robot.max_links
        self.names = [getattr(task, "name", task) for task in self.tasks]
        self._joints = [f"base_{axis}" for axis in "xy" if axis not in locked]
        self._joints += [f"{hand}_{k + 1}" for hand in hands for k in range(links)]
        self._view, joints, self._has_flags = ahead + 1, len(self._joints), fewest < links
        sizes = [self._view, 2 * self._view + joints, joints * self._has_flags]
        high = np.repeat([1.0, MAX_NUMBER, 1.0], sizes).astype(np.float32)
        self.observation_space = Box(np.where(high > 1.0, -high, np.float32(0.0)), high)
        self.action_space = Box(-1.0, 1.0, (len(hands) - 1 + joints,), np.float32)
        self.number, self.going = -1, False
        self.world = 0
        """Seed of the motor noise."""
        self.draw = -1
        """Number of the draw of the noise in this trial, from 0; -1 before the first trial."""
        self.outcome = np.nan
        """Total reward of the last trial that ended (in ticks). NaN if this trial failed or took
        1,000,000 ticks or more, or if no trial has ended."""

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin a trial.

        Parameters
        ----------
        seed : int, optional
            Seed of the generator that draws instances, and seed of the motor noise, which begins
            with draw 0. By default neither the generator nor the noise is seeded again, and the
            trial is made with the next draw of the noise.
        options : dict, optional
            ``{"task": k}`` begins a trial on instance k of a family, from 0. By default the
            instance is drawn at random.

        Returns
        -------
        ndarray, shape (O,)
            First observation.
        dict
            Two entries: ``task`` is the name of the task, and ``is_success`` is True if the trial
            has hit all goals.

        Raises
        ------
        ValueError
            The option or the instance does not exist, or a tolerance of the model does not fit the
            radius of the goals.
        gymnasium.error.Error
            The seed is not a Python int of at least 0.
        """
        super().reset(seed=seed)
        if seed is not None or self.draw < 0:
            self.world, self.draw = noise_seed(max(int(self.np_random_seed), 0)), -1
        self.draw += 1
        drawn, options = self.np_random.integers(len(self.tasks)), {**(options or {})}
        number = options.pop("task", drawn)
        check_limits("options['task']", number, 0, len(self.tasks) - 1)
        if options:
            raise ValueError(f"options {brief_value(options)} are unknown; reset has only 'task'")
        if number != self.number:
            self._load(int(number))
        self.q, self.goal, self.going, self._total = self.task.q0.copy(), 0, True, 0.0
        self._found = self._found_at_start
        return self._seen(), self._info()

    def step(
        self, action: ArrayLike
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Reach for the next goal.

        Parameters
        ----------
        action : array_like, shape (A,)
            Entries for hand and joints (:class:`TaskEnv`).

        Returns
        -------
        ndarray, shape (O,)
            Observation.
        float
            Reward: minus the ticks of this step, or -1,000,000 if the goal is missed.
        bool
            True if the trial has ended.
        bool
            Always False, because trials are not truncated.
        dict
            The entries ``task`` and ``is_success``, as in :meth:`reset`.

        Raises
        ------
        ResetNeeded
            The trial has ended, or no trial was begun.
        ValueError
            The action has a wrong shape, or is not finite.
        """
        if not self.going:
            raise ResetNeeded("the trial has ended, or none was begun: call reset first")
        array, shape = real_array("action", action), self.action_space.shape
        entries = array.tolist()
        if array.shape != shape or not all(map(math.isfinite, entries)):
            raise ValueError(
                f"action is {brief_value(action)}; it must be finite, of shape {shape}"
            )
        count_trials(int(self.goal == 0))
        q, dof = self.q, len(self.q)
        postures = [
            record["corrected"][:dof] if record["corrections"] else None for record in self._found
        ]
        distances = [math.inf if posture is None else _square(posture - q) for posture in postures]
        hand = int(len(distances) > 1 and (distances[1] < distances[0]) != (entries[0] > 0.5))
        target = (q if (posture := postures[hand]) is None else posture).tolist()
        for joint, entry in self._moves:
            target[joint] += REACH * min(max(entries[entry], -1.0), 1.0)
        # With noise the postures at the next goal are sought on their own, without it.
        reached = 1 if self.model.motor_noise > 0.0 else len(self._goals) - self.goal
        targets = self._no_targets[:, :reached].copy()
        targets[0, 0, 0] = target
        record, *next_record = self._reach(self._compiled, hand, targets)
        self.q, hit = record["q"][:dof].copy(), record["hit"].item()
        self.goal += hit
        self.going = hit and self.goal < len(self._goals)
        if self.going:
            rest = range(len(next_record), len(self._sides))
            self._found = next_record + self._reached_by(rest)
        reward = -float(record["ticks"].item() if hit else FAILED)
        self._total += reward
        if not self.going:
            self.outcome = self._total if self._total > -FAILED else np.nan
        return self._seen(), reward, not self.going, False, self._info()

    def render(self) -> NDArray[np.uint8] | None:
        """Draw the robot and its goals; goals that were hit are filled.

        Call :meth:`reset` first.

        Returns
        -------
        ndarray, shape (400, 600, 3), or None
            RGB picture, or None if the environment was made without ``render_mode``.
        """
        if self.render_mode is None:
            return None
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        from coartic.pictures.drawing import box, circle_goals, draw_robot, fill_goals

        (left, bottom), (right, top) = box(self.task, self.task.q0, margin=1.0)
        figure = Figure(figsize=(6, 4), dpi=100)
        canvas: Any = FigureCanvasAgg(figure)
        axes = figure.add_subplot(aspect="equal", xlim=(left, right), ylim=(bottom, top))
        draw_robot(axes, self.task, self.q, weight=1.5)
        fill_goals(circle_goals(axes, self.task), np.arange(len(self._goals)) < self.goal)
        canvas.draw()
        return np.asarray(canvas.buffer_rgba())[..., :3].copy()

    def _load(self, number: int) -> None:
        """Load the task with index ``number``, from 0, and prepare its trials."""
        self.tasks[number] = task = as_task(self.tasks[number])
        self._compiled = compiled_task(task, self.model, checks=False)
        self._exact = compiled_task(task, self.model.without_noise(), checks=False)
        self.task, self.number, self._goals = task, number, task.goal_array
        indices = {name: k for k, name in enumerate(task.robot.joint_names)}
        locked = [f"base_{axis}" for axis in task.locked_base]
        self._indices = [indices.get(name, -1) for name in self._joints]
        self._moves = [
            (indices[name], entry)
            for entry, name in enumerate(self._joints, len(task.hands) - 1)
            if name in indices and name not in locked
        ]
        moved = {joint for joint, _ in self._moves}
        self._flags = [float(index in moved) for index in self._indices] if self._has_flags else []
        sides = [HANDS.index(hand) for hand in task.hands]
        self._sides = [np.array([[side, sides[0]]]) for side in sides]
        self._no_targets = np.full((1, 2, 1, task.robot.dof), np.nan)
        self.q, self.goal = task.q0.copy(), 0
        self._found_at_start = self._reached_by(range(len(sides)))

    def _reach(self, compiled: CompiledTask, hand: int, targets: Array) -> NDArray[np.void]:
        """Reach for the next goal with a hand, and perhaps for the goal after it.

        The robot reaches for as many goals as ``targets`` has. Both movements are made in one call,
        because each call is slow.

        Parameters
        ----------
        compiled : CompiledTask
            The task with or without motor noise.
        hand : int
            Index in ``task.hands`` of the hand that reaches for the next goal. The first hand of
            the task reaches for the goal after it.
        targets : ndarray, shape (1, goals, 1, dof)
            Targets for one or two goals, in length units and rad. If all entries of a goal are NaN,
            only the corrective process moves the arm.

        Returns
        -------
        ndarray, shape (goals,)
            A per-goal record for each goal.
        """
        sides = self._sides[hand][:, : targets.shape[1]]
        noisy = compiled.model.motor_noise > 0.0
        worlds = noise_draws(self.world, self.draw) if noisy else NO_NOISE
        return reach_next(compiled, self.q[None], sides, targets, self.goal, worlds).goals[0, :, 0]

    def _reached_by(self, hands: range) -> list[Any]:
        """Let the corrective process reach for the next goal with each of some hands.

        ``hands`` are indices in ``task.hands``. Return a list with the per-goal record of each
        hand. The process acts without motor noise, and the environment does not change.
        """
        return [self._reach(self._exact, hand, self._no_targets[:, :1])[0] for hand in hands]

    def _seen(self) -> NDArray[np.float32]:
        q, goals = self.q.tolist(), self._goals[self.goal :][: self._view].tolist()
        missing = self._view - len(goals)
        positions = [
            coordinate - base for goal in goals for coordinate, base in zip(goal, q, strict=False)
        ]
        joints = [q[k] if k >= 0 else 0.0 for k in self._indices]
        exist = [1.0] * len(goals) + [0.0] * missing
        return np.array(exist + positions + [0.0, 0.0] * missing + joints + self._flags, np.float32)

    def _info(self) -> dict[str, Any]:
        return {"task": self.names[self.number], "is_success": self.goal == len(self._goals)}


class SharesOfTicks(gymnasium.RewardWrapper):
    """Wrapper that divides the rewards by the ticks of the corrective process.

    The divisor is the number of ticks that the corrective process on its own takes for the whole
    task with the initial hands and without motor noise, but at least 1. The divisor is 1,000,000 if
    the process does not complete the task, or if the task's policy finds no initial hands. A scaled
    reward below -2 is raised to -2.
    """

    def __init__(self, env: gymnasium.Env) -> None:
        super().__init__(env)
        self._ticks: dict[int, float] = {}

    def reward(self, reward: Any) -> float:
        """Scale a reward (in ticks). The result is at least -2."""
        env: Any = self.unwrapped
        if env.number not in self._ticks:
            corrective = initial_reward(env.task, env.model)
            self._ticks[env.number] = float(FAILED if corrective is None else max(-corrective, 1))
        return max(float(reward) / self._ticks[env.number], -2.0)


def sb3(env: str, num_envs: int = 64, **options: Any) -> Any:
    """Make environments for Stable-Baselines3, with scaled rewards.

    Parameters
    ----------
    env : str
        Id, such as ``"coartic/TwoArmed1-v2"``.
    num_envs : int
        Number of environments.
    **options
        Options of :class:`TaskEnv`.

    Returns
    -------
    DummyVecEnv
        Environments, made by Stable-Baselines3's ``make_vec_env``. Rewards are divided by the ticks
        of the corrective process (:class:`SharesOfTicks`). At the end of a trial, entry ``episode``
        of the info contains the unscaled total reward of the trial (in ticks).

    Raises
    ------
    MissingExtraError
        Stable-Baselines3 is not installed.
    """
    try:
        from stable_baselines3.common.env_util import make_vec_env
    except ImportError:
        raise MissingExtraError(
            "coartic.gym.sb3 needs Stable-Baselines3: pip install 'coartic[rl]'"
        ) from None
    return make_vec_env(env, num_envs, wrapper_class=SharesOfTicks, env_kwargs=options)


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
        ``VecNormalize`` and those that ``gymnasium.make`` and :func:`sb3` add, agents and functions
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
        Options of :class:`TaskEnv`. An environment with other wrappers, as above, takes none.

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
    if _is_family(env_options["task"]) and not wrappers:
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


def _square(difference: Array) -> float:
    """Return the sum of the squares of a vector, added one after the other.

    NumPy adds the terms in groups, so that rounding could make the distances to two mirrored
    postures differ, although they must be equal.
    """
    square = 0.0
    for value in difference.tolist():
        square += value * value
    return square


def _is_family(task: Any) -> bool:
    return isinstance(task, str | Path) and is_family(str(task))


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


for _id, _options in IDS.items():
    if _id not in gymnasium.registry:
        gymnasium.register(_id, entry_point="coartic.gym:TaskEnv", kwargs=_options)
