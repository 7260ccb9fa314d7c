"""Tasks and families as environments of Gymnasium: a step reaches for a goal and costs its ticks.

Importing this module registers the ids :data:`IDS`, such as ``coartic/Ascending-v2``, and
``coartic/Task-v2`` for any other task or a family. ``gymnasium.make`` makes one environment,
``gymnasium.make_vec`` several, and :func:`sb3` several for Stable-Baselines3. :func:`score`
compares policies with planners. The module needs the extra ``coartic[gym]``.
"""

from __future__ import annotations

import math
import pickle
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from copy import copy
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from coartic.errors import MissingExtraError, NotApplicableError
from coartic.estimates import Estimate, mean
from coartic.internal.limits import MOST_CELLS, brief_value, check_limits, real_array
from coartic.method import Method, MethodError, run_method
from coartic.method.optimisers import FAILED
from coartic.model import PAPER, MotionModel, check_model
from coartic.motion.batch import robot_parameters
from coartic.motion.solution import execute, initial_reward
from coartic.motion.trial import ALL_STOP, Requests, count_trials, reach
from coartic.robot import HANDS, LARGEST_FIGURE, Array
from coartic.tasks.catalogue import as_task
from coartic.tasks.families import LOCKED, instance_names, is_family, load_family
from coartic.tasks.optima import best_shipped
from coartic.tasks.task import MOST_GOALS, Split, Task

try:
    import gymnasium
    from gymnasium.error import ResetNeeded
    from gymnasium.spaces import Box
except ImportError:
    raise MissingExtraError("coartic.gym needs Gymnasium: pip install 'coartic[gym]'") from None

REACH = 0.5
"""Half the width of the box of targets, length unit (base) and rad (angles)."""
IDS: dict[str, dict[str, Any]] = {
    "coartic/Ascending-v2": {"task": "ascending"},
    "coartic/Descending-v2": {"task": "descending"},
    "coartic/TwoArmed1-v2": {"task": "two-armed-1"},
    "coartic/TwoArmed2-v2": {"task": "two-armed-2"},
    "coartic/Task-v2": {},
}
"""Options with which the environments are registered, by id."""
Policy = Callable[[NDArray[np.float32]], ArrayLike] | Method | Any
_NEUTRAL = (
    *("OrderEnforcing", "PassiveEnvChecker", "SyncVectorEnv"),
    *("Monitor", "DummyVecEnv", "VecMonitor", "SharesOfTicks"),
)
"""Classes that change neither observations nor actions nor the length of a trial."""


class TaskEnv(gymnasium.Env):
    """Environment in which one robot makes one trial after another.

    An episode is a trial, of at most as many steps as there are goals. The reward of a step is
    minus its ticks, or -1,000,000 if the corrective process fails, which ends the trial. No trial
    is truncated. Only the draw of an instance of a family is random.

    Parameters
    ----------
    task : Task, str or Path
        The task; or a family, ``"two-armed/v1"`` or the path of its file: each trial has an
        instance of the family.
    split : {"development", "test", "fresh"}, optional
        Instances of the family: to train on (``"development"``, the default), to report on
        (``"test"``), or of a ``year`` (``"fresh"``).
    count : int, optional
        How many instances of the split, from its first; by default 1,000 of the development split,
        10 of the test and fresh splits.
    year : int, optional
        Year of fresh instances, such as 2027.
    ahead : int
        Number of goals in view beyond the next goal.
    model : MotionModel
        Constants of movement.
    render_mode : {"rgb_array"}, optional
        With it :meth:`render` returns a picture.

    Raises
    ------
    ValueError, TypeError, TaskError
        An option is wrong, or there is no such task or family.

    Notes
    -----
    Joints are the coordinates of the base (length unit) and the angles of the arms (rad) that can
    move, the arms in the order of the task's ``hands``. Each arm counts with the most links that an
    arm of the task or family can have.

    An observation, float32 of shape ``(O,)``, has

    - for the next goal and each goal ahead, 1 if the goal exists, else 0;
    - x and y of each of these goals from the base, length unit, 0 without a goal;
    - the joints;
    - in a family whose robots differ in links, for each joint 1 if the robot can move it, else 0.

    An action, of shape ``(A,)``, has an entry for the hand, if the task has two, and an entry for
    each joint. Entries are clipped to -1 to 1. For each hand the corrective process finds a posture
    at the goal. An entry for the hand up to 0.5 chooses the hand whose posture is nearer in joint
    space, an entry above 0.5 the other hand. The target of the movement is the posture of this
    hand, or the present posture if the process fails, plus :data:`REACH` times the entries of the
    joints. Entries of joints that a robot cannot move have no effect.
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
        model: MotionModel = PAPER,
        render_mode: str | None = None,
    ) -> None:
        check_limits("ahead", ahead, 0, MOST_GOALS)
        instances = {"split": split, "count": count, "year": year}
        self.options = {"task": task, "ahead": ahead, "model": check_model(model)} | instances
        self.model, self.render_mode = model, render_mode
        self.tasks: list[Task | str]  # or names of instances
        if _is_family(task):
            family = load_family(str(task))
            self.tasks = [*instance_names(str(task), split or "development", count, year)]
            locked = set.intersection(*({*LOCKED[base]} for base in family.base))
            (fewest, links), hands = family.links, family.hands
        elif any(each is not None for each in instances.values()):
            raise ValueError(f"split, count and year are for families, not {brief_value(task)}")
        else:
            self.tasks = [only := as_task(task)]
            locked, hands = {*only.locked_base}, only.hands
            fewest = links = only.robot.max_links
        self.names = [getattr(each, "name", each) for each in self.tasks]
        self._joints = [f"base_{axis}" for axis in "xy" if axis not in locked]
        self._joints += [f"{hand}_{k + 1}" for hand in hands for k in range(links)]
        self._view, joints, self._has_flags = ahead + 1, len(self._joints), fewest < links
        sizes = [self._view, 2 * self._view + joints, joints * self._has_flags]
        high = np.repeat([1.0, LARGEST_FIGURE, 1.0], sizes).astype(np.float32)
        self.observation_space = Box(np.where(high > 1.0, -high, np.float32(0.0)), high)
        self.action_space = Box(-1.0, 1.0, (len(hands) - 1 + joints,), np.float32)
        self.number, self.going = -1, False
        self.outcome = np.nan
        """Total reward of the last trial that ended, ticks; NaN if it failed or took 1,000,000."""

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin a trial.

        Parameters
        ----------
        seed : int, optional
            Seed of the generator that draws instances. With None the generator goes on; at first
            the system seeds it.
        options : dict, optional
            ``{"task": k}`` begins a trial of instance k of a family, from 0. By default the
            instance is drawn.

        Returns
        -------
        ndarray, shape (O,)
            The first observation.
        dict
            ``task``, the name of the task, and ``is_success``, True if the trial has hit all goals.

        Raises
        ------
        ValueError
            There is no such option or instance.
        """
        super().reset(seed=seed)
        drawn, options = self.np_random.integers(len(self.tasks)), {**(options or {})}
        number = options.pop("task", drawn)
        check_limits("options['task']", number, 0, len(self.tasks) - 1)
        if options:
            raise ValueError(f"reset has no options {brief_value(options)}; it has 'task'")
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

        Returns
        -------
        ndarray, shape (O,)
            The observation.
        float
            The reward, minus the ticks.
        bool
            True if the trial has ended.
        bool
            False: no trial is truncated.
        dict
            As :meth:`reset` returns it.

        Raises
        ------
        ResetNeeded
            The trial has ended, or none was begun.
        ValueError
            The action has another shape or is not finite.
        """
        if not self.going:
            raise ResetNeeded("no trial goes on: call reset first")
        array, shape = real_array("action", action), self.action_space.shape
        entries = array.tolist()
        if array.shape != shape or not all(map(math.isfinite, entries)):
            raise ValueError(
                f"action is {brief_value(action)}; it must be finite, of shape {shape}"
            )
        count_trials(int(self.goal == 0))
        now, dof = self.q, len(self.q)
        ends = [each["corrected"][:dof] if each["corrections"] else None for each in self._found]
        away = [math.inf if end is None else _square(end - now) for end in ends]
        hand = int(len(away) > 1 and (away[1] < away[0]) != (entries[0] > 0.5))
        target = (now if (end := ends[hand]) is None else end).tolist()
        for joint, entry in self._moves:
            target[joint] += REACH * min(max(entries[entry], -1.0), 1.0)
        targets = self._no_targets[:, : len(self._goals) - self.goal].copy()
        targets[0, 0, 0] = target
        made, *after = self._reach(hand, targets)
        self.q, hit = made["q"][:dof].copy(), made["hit"].item()
        self.goal += hit
        self.going = hit and self.goal < len(self._goals)
        if self.going:
            self._found = after + self._reached_by(range(1, len(self._sides)))
        reward = -float(made["ticks"].item() if hit else FAILED)
        self._total += reward
        if not self.going:
            self.outcome = self._total if self._total > -FAILED else np.nan
        return self._seen(), reward, not self.going, False, self._info()

    def render(self) -> NDArray[np.uint8] | None:
        """Return a picture of the robot and its goals, RGB, ``(400, 600, 3)``, in which goals hit
        so far are filled; None if the environment was made without ``render_mode``."""
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
        """Prepare trials of task ``number``, from 0."""
        self.tasks[number] = task = as_task(self.tasks[number])
        check_model(self.model, radius=task.radius)
        self.task, self.number, self._goals = task, number, task.goal_array
        place = {name: k for k, name in enumerate(task.robot.joint_names)}
        locked = [f"base_{axis}" for axis in task.locked_base]
        self._places = [place.get(name, -1) for name in self._joints]
        self._moves = [
            (place[name], entry)
            for entry, name in enumerate(self._joints, len(task.hands) - 1)
            if name in place and name not in locked
        ]
        moved = {joint for joint, _ in self._moves}
        self._flags = [float(each in moved) for each in self._places] if self._has_flags else []
        sides = [HANDS.index(hand) for hand in task.hands]
        self._sides = [np.array([[side, sides[0]]]) for side in sides]
        self._no_targets = np.full((1, 2, 1, task.robot.dof), np.nan)
        self._parameters = robot_parameters(
            task.robot, task.radius, locked_base=task.locked_base, model=self.model, checks=False
        )
        self.q, self.goal = task.q0.copy(), 0
        self._found_at_start = self._reached_by(range(len(sides)))

    def _reach(self, hand: int, targets: Array) -> NDArray[np.void]:
        """Return the accounts of an arm that reaches, from where the robot stands, for the next
        goal with hand ``hand`` of the task, and, as each call costs, for the goal after it with the
        task's first hand. ``targets`` has shape ``(1, goals, 1, dof)``; where it is NaN the
        corrective process acts alone."""
        goals = self._goals[None, self.goal : self.goal + targets.shape[1]]
        arms = Requests(self.q[None], self._sides[hand], targets, ALL_STOP, goals)
        return reach(self.task.robot, arms, self._parameters).goals[0, :, 0]

    def _reached_by(self, hands: range) -> list[Any]:
        """List the accounts of hands that reach for the next goal by the corrective process."""
        return [self._reach(hand, self._no_targets[:, :1])[0] for hand in hands]

    def _seen(self) -> NDArray[np.float32]:
        q, near = self.q.tolist(), self._goals[self.goal :][: self._view].tolist()
        beyond = self._view - len(near)
        places = [each - base for goal in near for each, base in zip(goal, q, strict=False)]
        joints = [q[k] if k >= 0 else 0.0 for k in self._places]
        exist = [1.0] * len(near) + [0.0] * beyond
        return np.array(exist + places + [0.0, 0.0] * beyond + joints + self._flags, np.float32)

    def _info(self) -> dict[str, Any]:
        return {"task": self.names[self.number], "is_success": self.goal == len(self._goals)}


class SharesOfTicks(gymnasium.RewardWrapper):
    """Wrapper that divides rewards by the ticks of the corrective process alone.

    The divisor is the ticks, at least 1, that the process takes for the whole trial with the task's
    initial hands, or 1,000,000 if it cannot complete the task. No step loses more than 2.
    """

    def __init__(self, env: gymnasium.Env) -> None:
        super().__init__(env)
        self._ticks: dict[int, float] = {}

    def reward(self, reward: Any) -> float:
        """Return a reward in ticks as a share of the divisor."""
        env: Any = self.unwrapped
        if env.number not in self._ticks:
            alone = initial_reward(env.task, env.model)
            self._ticks[env.number] = float(FAILED if alone is None else max(-alone, 1))
        return max(float(reward) / self._ticks[env.number], -2.0)


def sb3(env: str, num_envs: int = 64, **options: Any) -> Any:
    """Make environments for Stable-Baselines3 by its ``make_vec_env``, with scaled rewards.

    Parameters
    ----------
    env : str
        An id, such as ``"coartic/TwoArmed1-v2"``.
    num_envs : int
        Number of robots.
    **options
        Options of :class:`TaskEnv`.

    Returns
    -------
    DummyVecEnv
        The environments. Rewards are shares of ticks (:class:`SharesOfTicks`); ``episode`` in the
        infos has the reward of a trial in ticks.

    Raises
    ------
    MissingExtraError
        Stable-Baselines3 is not installed.
    """
    try:
        from stable_baselines3.common.env_util import make_vec_env
    except ImportError:
        raise MissingExtraError("coartic.gym.sb3 needs: pip install 'coartic[rl]'") from None
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
        An id, or an environment of this module. Of a family the instances of the test split are
        scored, or of the ``split`` among the options. An environment in wrappers that change what
        policies see or do is used as it is, with its own instances, and trials still count in
        ticks. Wrappers that normalise do not learn meanwhile.
    policy : callable, agent, Method or mapping, optional
        Gives actions ``(N, A)`` for observations ``(N, O)``: a function, or an agent with the
        ``predict`` of Stable-Baselines3, which is asked without noise. Or a method of the
        benchmark, such as a planner, that solves each task. A mapping has several, by name.
    episodes : int
        Trials of random actions on each task.
    seed : int
        Seed of random actions, of methods and of an environment in wrappers.
    vec_normalize : str, Path or VecNormalize, optional
        Normalises what policies see: the ``VecNormalize`` of an agent's training, or the file that
        its ``save`` wrote (a pickle: open only files that you trust). The default is the
        ``VecNormalize`` of ``env``, if that is its only wrapper, else that of the agent's own
        environment.
    **options
        Options of :class:`TaskEnv`, for an environment without wrappers.

    Returns
    -------
    DataFrame
        A row for each policy, for uniformly random actions, for the corrective process alone with
        the task's initial hands, and for the best solution known. Columns:

        - ``reward``: mean over tasks, ticks;
        - ``gap``: distance to the best known reward as a share of it, mean over the tasks for which
          it is known;
        - ``gap_low``, ``gap_high``: 95 % interval of the gap (BCa bootstrap) over tasks, or over
          the trials of a single task;
        - ``completed``: share of trials that hit all goals in less than 1,000,000 ticks.

        Reward and gap of a policy that failed in a trial are NaN, as is what is not known.
        ``attrs["units"]`` has the units.

    Raises
    ------
    TypeError
        The environment is not of this module; an agent has other spaces than the environment, or
        was trained in wrappers that this environment does not have.
    ValueError
        An option is wrong; a policy has the name of another row; observations would be normalised
        twice.
    OSError
        The file of ``vec_normalize`` cannot be read.

    Warns
    -----
    UserWarning
        An agent has no environment, as after loading, and nothing normalises what it sees: it is
        not known whether it was trained in ``VecNormalize``.

    Examples
    --------
    >>> table = score("coartic/Ascending-v2", lambda seen: np.zeros((len(seen), 6)))
    >>> table.reward.to_dict()  # doctest: +ELLIPSIS
    {'policy': -319.0, 'random actions': ..., 'corrective process': -319.0, 'best known': -292.0}
    """
    check_limits("episodes", episodes, 1, MOST_CELLS)
    env = gymnasium.make(env, **options) if isinstance(env, str) else env
    inner, wrappers = _layers(env)[-1], _wrappers_of(env)
    if not isinstance(inner, TaskEnv):
        raise TypeError(
            f"env is {brief_value(env)}; it must be an id, or an environment or vector environment "
            "of coartic in this process"
        )
    normalisers = [each for each in wrappers if _normalises(each)]
    if vec_normalize is None and wrappers == normalisers:
        vec_normalize = next(iter(normalisers), None)
    if wrappers == normalisers:
        wrappers = []
    if wrappers and options:
        raise ValueError(f"{', '.join(options)}: env has wrappers, so make it with this option")
    if vec_normalize is not None and wrappers and normalisers:
        raise ValueError("env normalises already, in a VecNormalize: leave vec_normalize out")
    given = inner.options | options
    if _is_family(given["task"]) and not wrappers:
        given = inner.options | {"split": "test", "count": None, "year": None} | options
    setting = type(inner)(**given)
    setting.tasks[:] = tasks = [*map(as_task, setting.tasks)]
    policies = policy if isinstance(policy, Mapping) else {"policy": policy}
    if taken := {"random actions", "corrective process", "best known"} & {*policies}:
        raise ValueError(
            f"policy has the name {min(taken)!r} of another row of the table: rename it"
        )
    if isinstance(vec_normalize, str | Path):
        vec_normalize = pickle.loads(Path(vec_normalize).read_bytes())
    rewards: dict[str, Any] = {}
    for name, each in policies.items():
        if isinstance(each, Method):
            rewards[name] = [[_reward_of(each, task, seed, setting.model)] for task in tasks]
        elif each is not None and wrappers:
            act = _actions_of(each, env, wrappers, vec_normalize)
            rewards[name] = [[_wrapped_trial(act, env, n, seed)] for n in range(len(tasks))]
        elif each is not None:
            act = _actions_of(each, setting, [], vec_normalize)
            rewards[name] = _trials(act, setting)
    rng, shape = np.random.default_rng(seed), setting.action_space.shape
    rewards["random actions"] = _trials(
        lambda seen: rng.uniform(-1, 1, (len(seen), *shape)), setting, episodes
    )
    rewards["corrective process"] = [[initial_reward(task, setting.model)] for task in tasks]
    known = [best_shipped(task) if setting.model == PAPER else None for task in tasks]
    rewards["best known"] = [[None if each is None else each.reward] for each in known]
    return _table({name: np.array(each, np.float64) for name, each in rewards.items()})


def _square(difference: Array) -> float:
    """Return the sum of squares of a vector, added one after the other: NumPy's sums round
    differently, and mirrored postures have to be exactly as near."""
    square = 0.0
    for each in difference.tolist():
        square += each * each
    return square


def _is_family(task: Any) -> bool:
    return isinstance(task, str | Path) and is_family(str(task))


def _layers(env: Any) -> list[Any]:
    """List an environment's layers, from the outermost wrapper to the environment inside; of
    several environments side by side those of the first. Raises TypeError if they differ."""
    found = [env]
    while (name := next((n for n in ("venv", "env", "envs") if hasattr(env, n)), None)) is not None:
        env = getattr(env, name)
        if name == "envs":
            inner = [_layers(each)[-1] for each in env]
            options = [getattr(each, "options", None) for each in inner]
            if any(each != options[0] for each in options):
                raise TypeError("env has environments with different options: score each of them")
            env = env[0]
        found.append(env)
    return found


def _wrappers_of(env: Any) -> list[Any]:
    return [each for each in _layers(env)[:-1] if type(each).__name__ not in _NEUTRAL]


def _normalises(env: Any) -> bool:
    return type(env).__name__ == "VecNormalize"


def _actions_of(
    policy: Any, env: Any, wrappers: list[Any], normal: Any
) -> Callable[[NDArray[np.float32]], ArrayLike]:
    """Return a function that gives a policy's actions, ``(N, A)``, for observations ``(N, O)`` of
    ``env``, which has these wrappers. ``normal`` is a ``VecNormalize``; if it is None and no
    wrapper normalises, the agent's own is used. Raises TypeError for an agent that was trained with
    other spaces or wrappers."""
    normalised = any(map(_normalises, wrappers))
    if normal is None and not normalised:
        normal = getattr(policy, "get_vec_normalize_env", lambda: None)()
    see = normal.normalize_obs if normal else np.asarray
    if not hasattr(policy, "predict"):
        return lambda seen: policy(see(seen))
    for name in ("observation_space", "action_space"):
        there = getattr(env, f"single_{name}", None) or getattr(env, name)
        if (theirs := getattr(policy, name, there)) != there:
            raise TypeError(
                f"the agent's {name} is {brief_value(theirs)}, and the environment's is "
                f"{brief_value(there)}: score the agent in the environment of its training, in its "
                "wrappers"
            )
    own = getattr(policy, "get_env", lambda: env)()
    if own is None and not (normal or normalised):
        warnings.warn(
            "the agent has no environment, as after loading: if it was trained in VecNormalize, "
            "give score vec_normalize=FILE, which VecNormalize.save writes; if not, load it with "
            "env=coartic.gym.sb3(ID)",
            stacklevel=3,
        )
    for wrapper in [] if wrappers or own is None else _wrappers_of(own):
        if not _normalises(wrapper):
            raise TypeError(
                f"the agent's environment is wrapped in {type(wrapper).__name__}: score the agent "
                "in an environment with this wrapper"
            )
    return lambda seen: policy.predict(see(seen), deterministic=True)[0]


def _trials(act: Callable[[Any], ArrayLike], setting: TaskEnv, trials: int = 1) -> Array:
    """Let ``act``, which gives actions ``(n, A)`` for observations ``(n, O)``, make trials side by
    side on each task of ``setting``. Return the total rewards, ticks, shape ``(tasks, trials)``;
    NaN where a trial failed."""
    robots = [copy(setting) for _ in range(trials * len(setting.tasks))]
    seen = [each.reset(options={"task": n // trials})[0] for n, each in enumerate(robots)]
    while going := [n for n, each in enumerate(robots) if each.going]:
        actions = np.asarray(act(np.array([seen[n] for n in going])))
        if len(actions) != len(going):
            raise ValueError(f"actions have shape {actions.shape}, not a row for each observation")
        for n, action in zip(going, actions, strict=True):
            seen[n] = robots[n].step(action)[0]
    return np.reshape([each.outcome for each in robots], (-1, trials))


def _wrapped_trial(act: Callable[[Any], ArrayLike], env: Any, number: int, seed: int) -> float:
    """Let ``act`` make a trial on task ``number``, from 0, in an environment in wrappers, of
    several side by side in the first. Return the total reward, ticks; NaN where the trial failed or
    was cut short."""
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
            raise TypeError("a wrapper of env does not pass on the options of reset")
        inner.outcome, ended = np.nan, False
        while not ended:
            actions = np.asarray(act(np.asarray(seen)[None] if is_one else seen))
            seen, _, *flags, _ = env.step(actions[0] if is_one else actions)
            ended = any(np.ravel(flag)[0] for flag in flags)
    return float(inner.outcome)


@contextmanager
def _not_learning(env: Any) -> Iterator[None]:
    """Keep the means by which wrappers normalise, in the block of this context: set ``training``
    and ``update_running_mean`` of an environment and its wrappers to False."""
    learning = [
        (each, name, getattr(each, name))
        for each in _layers(env)
        for name in ("training", "update_running_mean")
        if name in {*vars(each), *vars(type(each))}
    ]
    try:
        for each, name, _ in learning:
            setattr(each, name, False)
        yield
    finally:
        for each, name, value in learning:
            setattr(each, name, value)


def _reward_of(method: Method, task: Task, seed: int, model: MotionModel) -> float | None:
    """Return the reward of the solution that a method finds for a task; None if the method does not
    apply or finds no solution, or a goal is missed even after correction."""
    with suppress(MethodError, NotApplicableError):
        result, _ = run_method(method, task, seed, model=model)
        return execute(task, result.solution, model=model).reward
    return None


def _table(rewards: Mapping[str, Array]) -> pd.DataFrame:
    """Return the table of :func:`score` from rewards, ticks, shape ``(tasks, trials)``, by row, the
    last of which is the best known; NaN where a trial failed or nothing is known."""
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


for _name, _given in IDS.items():
    if _name not in gymnasium.registry:
        gymnasium.register(_name, entry_point="coartic.gym:TaskEnv", kwargs=_given)
