"""Tasks and families as environments of Gymnasium: a step is a goal, its reward minus the ticks.

Importing this module registers ``coartic/Ascending-v2``, ``Descending-v2``, ``TwoArmed1-v2``,
``TwoArmed2-v2``, and ``coartic/Task-v2`` for any other task or a family. It needs the extra
``coartic[gym]``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import gymnasium
import numpy as np
import pandas as pd
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray
from scipy.special import stdtrit

from coartic.inputs import MOST_CELLS, brief_value, check_limits, real_array
from coartic.method import Method, MethodError, Session
from coartic.model import PAPER, MotionModel, check_model
from coartic.motion.initial import corrective_trial, initial_hands
from coartic.motion.reach import reach_unchecked
from coartic.motion.solution import Execution, execute
from coartic.optimisers import FAILED
from coartic.robot import BASE_DOF, HANDS, LARGEST_FIGURE, Array, Robot
from coartic.tasks.families import LOCKED, instance_names, shipped_families
from coartic.tasks.optima import best_shipped
from coartic.tasks.task import MOST_GOALS, Split, Task, as_task
from coartic.text import unknown

if TYPE_CHECKING:
    from coartic.sb3 import RobotEnvs

REACH = 0.5
"""Half the width of the box of targets, length unit (base) and rad (angles)."""
MOST_ROBOTS = 1_000_000


class Robots:
    """N robots side by side, each at a goal of its own trial: what the environments share.

    Parameters
    ----------
    num_envs : int
        Number of robots.
    task : Task, str or Path
        The task; or a family, ``"two-armed/v1"``, of which each trial has an instance.
    split : {"development", "test", "fresh"}, optional
        Instances to train on (by default), to report on, or those of a ``year``. They never mix.
    count : int, optional
        How many instances of the split, from its first; by default 1,000 of the development split
        and 10 of the others.
    year : int, optional
        Of fresh instances.
    ahead : int
        Goals in view beyond the next one.
    model : MotionModel
        Constants of movement.

    Raises
    ------
    ValueError, TypeError, TaskError
        An option is wrong, or there is no such task or family.

    Notes
    -----
    Joints are the coordinates of the base (length unit) and the angles of the arms (rad) that can
    move, in the order of a configuration; in a family, of arms with the most links.

    An observation has an entry for the next goal and for each of those ahead, 1 where there is
    one; x and y of each from the base, length unit, 0 where there is none; and the joints. In a
    family whose robots differ in links an entry for each joint follows, 1 where the robot can move
    it.

    An action has an entry for the hand, where the robot has two, and one for each joint. The box is
    from -1 to 1; what is beyond is clipped. Up to 0.5 the hand is the one that the corrective
    process brings to the goal by the shorter way in joint space, above 0.5 the other one. The
    target is where the corrective process would bring it, plus :data:`REACH` times the entries of
    the joints: zeros do what the corrective process does. Where it would fail, the present posture
    takes the place of its result. Entries of joints that a robot does not have do nothing.
    """

    def __init__(
        self,
        num_envs: int,
        task: Task | str | Path,
        *,
        split: Split | None = None,
        count: int | None = None,
        year: int | None = None,
        ahead: int = 1,
        model: MotionModel = PAPER,
    ) -> None:
        check_limits("num_envs", num_envs, 1, MOST_ROBOTS)
        check_limits("ahead", ahead, 0, MOST_GOALS)
        self.model = check_model(model)
        if isinstance(task, str) and task in shipped_families():
            family = shipped_families()[task]
            instances = instance_names(task, split or "development", count, year)
            self.tasks: list[Task | str] = [*instances]
            goals, links, hands = family.goals[1], family.links[1], family.hands
            locked = set.intersection(*({*LOCKED[base]} for base in family.base))
            self.differ = family.links[0] < links
        elif (split, count, year) != (None, None, None):
            raise ValueError(f"split, count and year are for families, not {brief_value(task)}")
        else:
            only = as_task(task)
            self.tasks = [only]
            goals, links, hands = len(only.goals), only.robot.most_links, only.hands
            locked, self.differ = {*only.locked_base}, False
        # All configurations have one width: base, left arm, right arm, 0 beyond its links.
        self.links, width, number = links, BASE_DOF + 2 * links, len(self.tasks)
        self.names = np.array([getattr(each, "name", each) for each in self.tasks], dtype=object)
        self.sides = np.array([HANDS.index(hand) for hand in hands])
        arms = (BASE_DOF + links * self.sides[:, None] + np.arange(links)).ravel()
        base = [place for place, axis in enumerate("xy") if axis not in locked]
        self.joints = np.array([*base, *arms])
        self.starts, self.goals = np.zeros((number, width)), np.zeros((number, goals, 2))
        self.movable = np.zeros((number, width), np.bool_)
        self.counts, self.kinds = np.zeros(number, np.int64), np.full(number, -1)
        self.kind_of: dict[Any, int] = {}  # number of each robot with its locks and size of goals
        self.task, self.goal = np.zeros((2, num_envs), np.int64)
        self.q, self.view = np.zeros((num_envs, width)), np.arange(ahead + 1)
        entries = (len(hands) > 1) + len(self.joints)
        self.action_space = Box(-1.0, 1.0, (entries,), np.float32)
        places, flags = 2 * (ahead + 1) + len(self.joints), len(self.joints) * self.differ
        high = np.repeat([1.0, LARGEST_FIGURE, 1.0], [ahead + 1, places, flags]).astype(np.float32)
        low = np.where(high > 1.0, -high, np.float32(0.0))
        self.observation_space = Box(low, high, dtype=np.float32)

    def task_at(self, number: int) -> Task:
        """A task by its number; it is loaded when it is first asked for."""
        task = as_task(self.tasks[number])
        if self.kinds[number] < 0:
            check_model(self.model, radius=task.radius)
            self.tasks[number] = task
            places = places_of(task.robot, self.links)
            self.starts[number, places], self.movable[number, places] = task.q0, True
            self.movable[number, ["xy".index(axis) for axis in task.locked_base]] = False
            self.goals[number, : len(task.goals)] = task.goal_array
            self.counts[number] = len(task.goals)
            kind = task.robot, float(task.radius), task.locked_base
            self.kinds[number] = self.kind_of.setdefault(kind, len(self.kind_of))
        return task

    def begin(self, rows: NDArray[np.int64], numbers: NDArray[np.int64]) -> None:
        """Put robots at the start of the tasks of these numbers."""
        for number in np.unique(numbers).tolist():
            self.task_at(number)
        self.task[rows], self.goal[rows] = numbers, 0
        self.q[rows] = self.starts[numbers]

    def observe(self, rows: NDArray[np.int64]) -> NDArray[np.float32]:
        """What is seen of the next goals, and where the robots are, ``(N, O)``."""
        task, q = self.task[rows], self.q[rows]
        goals = self.goal[rows, None] + self.view
        there = goals < self.counts[task, None]
        places = self.goals[task[:, None], np.where(there, goals, 0)] - q[:, None, :BASE_DOF]
        places[~there] = 0.0
        seen = [there, places.reshape(len(rows), -1), q[:, self.joints]]
        seen += [self.movable[task[:, None], self.joints]] if self.differ else []
        return np.concatenate(seen, axis=1, dtype=np.float32)

    def step(self, actions: ArrayLike, rows: NDArray[np.int64]) -> tuple[Array, NDArray[np.bool_]]:
        """Reach for the next goal: rewards ``(N,)``, and whose trials have ended.

        Raises ValueError for actions of another shape than ``(N, A)``, or with NaN.
        """
        chosen = real_array("actions", actions)
        if chosen.shape != (shape := (len(rows), *self.action_space.shape)):
            raise ValueError(f"actions have shape {chosen.shape}; it must be {shape}")
        if math.isnan(chosen.min()):
            row = int(np.isnan(chosen).any(axis=1).argmax())
            raise ValueError(f"the action of robot {row} has NaN; it must be numbers")
        chosen = np.minimum(np.maximum(chosen, -1.0), 1.0)
        task, goal = self.task[rows], self.goal[rows]
        away = np.zeros((len(rows), self.q.shape[1]))
        away[:, self.joints] = REACH * chosen[:, -len(self.joints) :]
        away[~self.movable[task]] = 0.0
        other = (chosen[:, 0] > 0.5) & (len(self.sides) > 1)
        rewards, kinds = np.empty(len(rows)), self.kinds[task]
        for (robot, radius, locked), kind in self.kind_of.items():
            of_kind = np.flatnonzero(kinds == kind)
            if not len(of_kind):
                continue
            some, places = rows[of_kind], places_of(robot, self.links)
            q, goals = self.q[some[:, None], places], self.goals[task[of_kind], goal[of_kind]]
            reach = partial(
                reach_unchecked, robot, radius=radius, locked_base=locked, model=self.model
            )
            hands = len(self.sides)  # of each robot, which are corrected in one call
            every = np.concatenate([q] * hands), np.repeat(self.sides, len(some))
            alone = reach(*every, np.concatenate([goals] * hands), looks=False)
            corrected = alone.corrected.reshape(hands, *q.shape)
            ways = np.sqrt(((corrected - q) ** 2).sum(axis=2))
            ways[np.isnan(ways)] = np.inf
            hand = ways.argmin(axis=0)
            hand = np.where(other[of_kind], 1 - hand, hand)
            middle = corrected[hand, np.arange(len(some))]
            middle = np.where(np.isnan(middle), q, middle)
            targets = middle + away[of_kind[:, None], places]
            reached = reach(q, self.sides[hand], goals, targets=targets)
            self.q[some[:, None], places] = reached.q
            self.goal[some] += reached.hit
            rewards[of_kind] = np.where(reached.hit, -reached.ticks, -FAILED)
        return rewards, (rewards == -FAILED) | (self.goal[rows] == self.counts[task])

    def infos(self, rows: NDArray[np.int64]) -> dict[str, Any]:
        """Names of tasks, and whether all goals are hit."""
        task = self.task[rows]
        return {"task": self.names[task], "is_success": self.goal[rows] == self.counts[task]}


@cache
def places_of(robot: Robot, links: int) -> NDArray[np.int64]:
    """Where the entries of a robot's configurations are among those of robots with so many links an
    arm, ``(dof,)``."""
    left, right = (BASE_DOF + np.arange(len(robot.arm(hand).links)) for hand in HANDS)
    return np.concatenate([np.arange(BASE_DOF), left, links + right])


ONLY = np.zeros(1, np.int64)


class TaskEnv(gymnasium.Env):
    """One robot: an episode is a trial, of as many steps as there are goals.

    It ends earlier where the corrective process fails, which costs ``coartic.optimisers.FAILED``.
    Nothing is random but which instance of a family is drawn. Options, observations and actions
    are those of :class:`Robots`; ``render_mode`` may be ``"rgb_array"``.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["rgb_array"], "render_fps": 4}

    def __init__(
        self, task: Task | str | Path, *, render_mode: str | None = None, **options: Any
    ) -> None:
        self.options = {"task": task, **options}
        self.robots = Robots(1, **self.options)
        self.action_space = self.robots.action_space
        self.observation_space = self.robots.observation_space
        self.render_mode = render_mode
        self._goes_on = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin a trial."""
        super().reset(seed=seed)
        check_no_options(options)
        self.robots.begin(ONLY, self.np_random.integers(len(self.robots.tasks), size=1))
        self._goes_on = True
        return self.robots.observe(ONLY)[0], self._info()

    def step(
        self, action: ArrayLike
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Reach for the next goal. Raises ResetNeeded where the trial has ended."""
        if not self._goes_on:
            raise ResetNeeded("no trial goes on: reset first")
        rewards, ended = self.robots.step(np.asarray(action)[None], ONLY)
        self._goes_on = not ended[0]
        return self.robots.observe(ONLY)[0], float(rewards[0]), bool(ended[0]), False, self._info()

    def render(self) -> NDArray[np.uint8] | None:
        """The robot and its goals as a picture ``(400, 600, 3)``; goals that are hit are filled."""
        if self.render_mode is None:
            return None
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        from coartic.drawing import box, draw_goals, draw_robot, fill_goals

        task = self.robots.task_at(int(self.robots.task[0]))
        (left, bottom), (right, top) = box(task, task.q0, margin=1.0)
        figure = Figure(figsize=(6, 4))
        canvas: Any = FigureCanvasAgg(figure)
        axes = figure.add_subplot(aspect="equal", xlim=(left, right), ylim=(bottom, top))
        draw_robot(
            axes, task, self.robots.q[0, places_of(task.robot, self.robots.links)], weight=1.5
        )
        fill_goals(draw_goals(axes, task), np.arange(len(task.goals)) < self.robots.goal[0])
        canvas.draw()
        return np.asarray(canvas.buffer_rgba())[..., :3].copy()

    def _info(self) -> dict[str, Any]:
        return {name: values.tolist()[0] for name, values in self.robots.infos(ONLY).items()}


class TaskVectorEnv(VectorEnv):
    """N robots side by side, which takes a fraction of the time; see :class:`TaskEnv`.

    A trial that has ended begins anew in the same step, as in Gymnasium's mode ``SAME_STEP``:
    ``final_obs`` and ``final_info`` are what it ended with.
    """

    metadata: ClassVar[dict[str, Any]] = {"autoreset_mode": AutoresetMode.SAME_STEP}

    def __init__(self, num_envs: int, task: Task | str | Path, **options: Any) -> None:
        self.options = {"task": task, **options}
        self.robots = Robots(num_envs, **self.options)
        self.num_envs = num_envs
        self.single_action_space = self.robots.action_space
        self.single_observation_space = self.robots.observation_space
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._all = np.arange(num_envs)
        self._rngs: list[Any] = [None] * num_envs

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin all trials, with a seed for each robot, or for the first, which others follow."""
        check_no_options(options)
        if seed is None or isinstance(seed, int):
            seed = [None if seed is None else seed + row for row in range(self.num_envs)]
        if len(seed) != self.num_envs:
            raise ValueError(f"{len(seed)} seeds for {self.num_envs} environments")
        for row, each in enumerate(seed):
            if each is not None or self._rngs[row] is None:
                self._rngs[row] = seeding.np_random(each)[0]
        self._begin(self._all)
        return self.robots.observe(self._all), self._infos(self._all)

    def step(
        self, actions: ArrayLike
    ) -> tuple[NDArray[np.float32], Array, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Reach for the next goal of each trial, and begin anew those that have ended."""
        if self._rngs[0] is None:
            raise ResetNeeded("no trial goes on: reset first")
        rewards, ended = self.robots.step(actions, self._all)
        final, rows = {}, np.flatnonzero(ended)
        if len(rows):
            last = np.full(self.num_envs, None, dtype=object)
            for row, seen in zip(rows.tolist(), self.robots.observe(rows), strict=True):
                last[row] = seen
            final = {"final_obs": last, "final_info": self._infos(rows)}
            final |= {f"_{name}": ended.copy() for name in ("final_obs", "final_info")}
            self._begin(rows)
        infos = self._infos(self._all) | final
        return self.robots.observe(self._all), rewards, ended, np.zeros_like(ended), infos

    def _begin(self, rows: NDArray[np.int64]) -> None:
        number = len(self.robots.tasks)
        drawn = [self._rngs[row].integers(number) if number > 1 else 0 for row in rows.tolist()]
        self.robots.begin(rows, np.array(drawn))

    def _infos(self, rows: NDArray[np.int64]) -> dict[str, Any]:
        there = np.zeros(self.num_envs, np.bool_)
        there[rows] = True
        infos = self.robots.infos(self._all)
        return infos | {f"_{name}": there.copy() for name in infos}


def check_no_options(options: Mapping[str, Any] | None) -> None:
    """Raises ValueError for options of a reset: there are none."""
    if options:
        raise ValueError(f"reset takes no options, but {brief_value(options)} are given")


def sb3(env: str, num_envs: int = 64, **options: Any) -> RobotEnvs:
    """Robots side by side as environments of Stable-Baselines3.

    Parameters
    ----------
    env : str
        Id of an environment, such as ``"coartic/TwoArmed1-v2"``.
    num_envs : int
        Number of robots.
    **options
        Those of :class:`Robots`.

    Returns
    -------
    coartic.sb3.RobotEnvs
        A ``VecEnv``: trials begin anew by themselves, actions are clipped, and rewards are shares
        of what the corrective process takes.

    Raises
    ------
    ValueError, TypeError
        The id is none of coartic's, or an option is wrong.
    """
    from coartic.sb3 import RobotEnvs

    return RobotEnvs(TaskVectorEnv(num_envs, **known_env(env) | options))


def known_env(env: str) -> dict[str, Any]:
    """The options of an id of this package. Raises ValueError for another one."""
    if env not in IDS:
        raise ValueError(unknown("environment", str(env), IDS))
    return IDS[env]


Policy = Callable[[NDArray[np.float32]], ArrayLike] | Method | Any


def score(
    env: str | gymnasium.Env | VectorEnv,
    policy: Policy | Mapping[str, Policy] | None = None,
    *,
    episodes: int = 20,
    seed: int = 0,
    **options: Any,
) -> pd.DataFrame:
    """How good policies and planners are, beside random actions and the best known solutions.

    Parameters
    ----------
    env : str, Env or VectorEnv
        An environment of this package, or its id. Of a family the instances of the test split
        are scored, or those of the ``split`` that is given here.
    policy : callable, agent, Method or mapping, optional
        Gives actions ``(N, A)`` for observations ``(N, O)``: a function, an agent with the
        ``predict`` of Stable-Baselines3, which is asked without noise, or a method of the
        benchmark, such as a planner, that solves each task. A mapping has several, by their names.
    episodes : int
        Trials of random actions on each task.
    seed : int
        Of random actions and of methods.
    **options
        Those of :class:`Robots`.

    Returns
    -------
    DataFrame
        A row for each policy, for uniformly random actions, for the corrective process alone with
        the task's initial hands, and for the best solution known. Columns: ``reward``, the mean
        over tasks, ticks; ``gap`` to the best known reward, per cent, with its 95 % interval
        ``gap_low`` to ``gap_high`` over tasks, or of one task over trials; ``completed``, the share
        of trials that hit all goals. The others are left out of the means. NaN where nothing is
        known, or too few trials for an interval.

    Raises
    ------
    ValueError, TypeError
        The environment is none of coartic's, an option is wrong, or the policy is no policy.
    """
    check_limits("episodes", episodes, 1, MOST_CELLS)
    if isinstance(env, str):
        given = known_env(env)
    elif isinstance(unwrapped := getattr(env, "unwrapped", env), TaskEnv | TaskVectorEnv):
        given = unwrapped.options
    else:
        raise TypeError(
            f"env is {brief_value(env)}; it must be an environment of coartic or its id"
        )
    given = {name: value for name, value in given.items() if name not in ("split", "count", "year")}
    given |= options
    if given.get("task") in shipped_families():
        given = {"split": "test", **given}
    setting = Robots(1, **given)
    model, shape = setting.model, setting.observation_space.shape
    tasks = [setting.task_at(number) for number in range(len(setting.tasks))]
    policies = policy if isinstance(policy, Mapping) else {"policy": policy}
    policies = {name: each for name, each in policies.items() if each is not None}
    for name, each in policies.items():
        learned_on = getattr(getattr(each, "observation_space", None), "shape", shape)
        if learned_on != shape:
            raise ValueError(
                f"{name} was trained on observations of shape {learned_on}; "
                f"those of {env if isinstance(env, str) else 'this environment'} have {shape}"
            )

    def run(act: Callable[[NDArray[np.float32]], ArrayLike], trials: int = 1) -> Array:
        """Rewards of trials on each task, ``(K, trials)``; NaN where one failed."""
        count = trials * len(tasks)
        robots, rows, totals = Robots(count, **given), np.arange(count), np.zeros(count)
        robots.begin(rows, rows // trials)
        while len(rows):
            rewards, ended = robots.step(act(robots.observe(rows)), rows)
            totals[rows] += rewards
            rows = rows[~ended]
        return np.where(totals > -FAILED, totals, np.nan).reshape(-1, trials)

    def solve(method: Method) -> Array:
        """Rewards of its solutions, ``(K, 1)``; NaN where it has none."""
        rewards = np.full((len(tasks), 1), np.nan)
        for number, task in enumerate(tasks):
            session = Session(task, seed, method.told, model=model, trusted=True)
            with suppress(MethodError):
                solution = method.solve(session).solution
                rewards[number] = reward_of(execute(task, solution, model=model))
        return rewards

    entries, rng = setting.action_space.shape, np.random.default_rng(seed)
    alone = [
        corrective_trial(each, initial_hands(each, model=model), model=model) for each in tasks
    ]
    shipped = [best_shipped(each) if model == PAPER else None for each in tasks]
    best = np.array([[np.nan if each is None else each.reward] for each in shipped])
    rewards = {
        **{name: solve(each) if isinstance(each, Method) else run(policy_of(each))
           for name, each in policies.items()},
        "random actions": run(lambda seen: rng.uniform(-1, 1, (len(seen), *entries)), episodes),
        "corrective process": np.array([[reward_of(trial)] for trial in alone]),
        "best known": best,
    }  # fmt: skip
    rows = {name: summarise(each, best) for name, each in rewards.items()}
    rows["best known"]["completed"] = np.nan
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("policy")


def reward_of(trial: Execution) -> float:
    """Its reward; NaN where it failed."""
    return np.nan if trial.reward is None else trial.reward


def summarise(rewards: Array, best: Array) -> dict[str, float]:
    """Means over tasks of rewards ``(K, trials)``, NaN for those that failed."""
    gaps = pd.DataFrame(100.0 * (best - rewards) / np.abs(best))
    values = (gaps.iloc[0] if len(gaps) == 1 else gaps.mean(axis=1)).dropna()
    half = stdtrit(len(values) - 1, 0.975) * values.sem() if len(values) > 2 else np.nan
    return {
        "reward": pd.DataFrame(rewards).mean(axis=1).mean(),
        "gap": values.mean(),
        "gap_low": values.mean() - half,
        "gap_high": values.mean() + half,
        "completed": float(np.isfinite(rewards).mean()),
    }


def policy_of(policy: Any) -> Callable[[NDArray[np.float32]], ArrayLike]:
    """A policy as a function. Raises TypeError for what is none."""
    if hasattr(policy, "predict"):
        return lambda seen: policy.predict(seen, deterministic=True)[0]
    if not callable(policy):
        raise TypeError(
            f"policy is {brief_value(policy)}; it must be a function of observations, an agent "
            "with predict, or a Method"
        )
    return policy  # type: ignore[no-any-return]


IDS: dict[str, dict[str, Any]] = {
    "coartic/Ascending-v2": {"task": "ascending"},
    "coartic/Descending-v2": {"task": "descending"},
    "coartic/TwoArmed1-v2": {"task": "two-armed-1"},
    "coartic/TwoArmed2-v2": {"task": "two-armed-2"},
    "coartic/Task-v2": {},
}
for _name, _given in IDS.items():
    if _name not in gymnasium.registry:
        gymnasium.register(
            _name,
            entry_point="coartic.gym:TaskEnv",
            vector_entry_point="coartic.gym:TaskVectorEnv",
            kwargs=_given,
        )
