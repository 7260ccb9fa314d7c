"""Tasks and families as environments of Gymnasium: a step is a subtask, its reward minus the ticks
it took.

Importing this module registers ``coartic/Ascending-v1``, ``Descending``, ``TwoArmed1`` and
``TwoArmed2``, ``coartic/Task-v1`` for any other task, and ``coartic/Family-v0`` for the instances
of a family. Needs the extra ``coartic[gym]``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import gymnasium
import numpy as np
import pandas as pd
from gymnasium.error import ResetNeeded
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray
from scipy.special import stdtrit

from coartic.arms import Arms, Frame
from coartic.inputs import MOST_CELLS, brief_value, check_limits
from coartic.method import Method, MethodError, Session
from coartic.model import PAPER, MotionModel
from coartic.motion.initial import corrective_trial, initial_hands
from coartic.motion.solution import execute
from coartic.robot import BASE_DOF, Array, Hand
from coartic.tasks.catalogue import load_task
from coartic.tasks.families import instance_names, load_family
from coartic.tasks.optima import best_shipped
from coartic.tasks.task import Task, as_task
from coartic.text import unknown

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from coartic.sb3 import RobotEnvs

OPTIONS = ("scale", "around", "observe", "ahead", "hands", "model")
OF_FAMILY = ("family", "split", "count", "year")
FAMILY_OPTIONS = (*OF_FAMILY, "scale", "ahead", "hands", "model")
WORKS = {"around": "hands", "hands": "initial", "scale": 0.5}
"""Options of version 1 of the single tasks."""


def make_arms(
    num_envs: int, task: Task | str | Path | None = None, **options: Any
) -> tuple[Arms, list[str]]:
    """Robots with the options of an environment, and the instances that they are given.

    Raises TypeError for an option that there is not.
    """
    of_family = task is None and "family" in options
    known = FAMILY_OPTIONS if of_family else OPTIONS
    for name in options.keys() - {*known}:
        raise TypeError(unknown("option", name, [*known, "render_mode"]))
    if not of_family:
        return Arms(num_envs, as_task(task), **options), []  # type: ignore[arg-type]
    which: dict[str, Any] = {"split": "development"}
    which |= {name: options.pop(name) for name in OF_FAMILY if name in options}
    names, family = instance_names(**which), load_family(which["family"])
    goals, links = family.goals[1], family.links[1]
    frame = Frame(len(names), goals, links, BASE_DOF + 2 * links, family.hands)
    options = {"scale": 0.5} | options | {"observe": "ahead", "around": "corrective"}
    return Arms(num_envs, frame=frame, **options), names


def check_render_mode(mode: str | None, metadata: dict[str, Any]) -> str | None:
    """The mode itself. Raises ValueError for one that there is not."""
    if mode is not None and mode not in metadata["render_modes"]:
        raise ValueError(f"render_mode is {mode!r}; it must be one of {metadata['render_modes']}")
    return mode


def draw_picture(arms: Arms, row: int) -> NDArray[np.uint8]:
    """A robot and its goals, ``(height, width, 3)``."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6, 4))
    canvas: Any = FigureCanvasAgg(figure)
    draw_arms(figure, arms, row)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def draw_arms(figure: Figure, arms: Arms, row: int) -> None:
    """Draw a robot and its goals; those that it has hit are filled."""
    from coartic.drawing import box, draw_goals, draw_robot, fill_goals, number_goals

    task = arms.tasks[arms.rows["task"][row]]
    (left, bottom), (right, top) = box(task, task.q0, margin=1.0)
    figure.clear()
    axes = figure.add_subplot(aspect="equal", xlim=(left, right), ylim=(bottom, top))
    draw_robot(axes, task, arms.q[row, : task.robot.dof], weight=1.5)
    number_goals(axes, task, weight=1.5)
    fill_goals(draw_goals(axes, task), np.arange(len(task.goals)) < arms.goal[row])


class TaskEnv(gymnasium.Env):
    """One robot and one task, or instances of a family of which each trial has one.

    An episode is a trial, of as many steps as there are goals; it ends earlier where the
    corrective process fails, which costs ``coartic.optimisers.FAILED``. Actions are clipped to the
    box. Nothing is random but which instance is drawn.

    Parameters
    ----------
    task : Task, str or Path, optional
        The task; in its place a family, of which instances are drawn.
    family : str
        The family with its version, ``"two-armed/v1"``.
    split : {"development", "test", "fresh"}
        Its instances to train on, to report on, or those of a ``year``. They never mix.
    count : int, optional
        How many instances, the first ones of the split; by default 1,000 of the development split
        and 10 of the others.
    year : int, optional
        Of fresh instances.
    render_mode : {"human", "rgb_array"}, optional
        As in Gymnasium.
    **options
        As in :class:`coartic.arms.Arms`. Of a family the middle of the box is ``"corrective"``,
        half its width by default 0.5, and ``"ahead"`` is observed.

    Raises
    ------
    ValueError, TypeError, TaskError
        An option is wrong, or there is no such task or family.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["human", "rgb_array"], "render_fps": 4}

    def __init__(
        self,
        task: Task | str | Path | None = None,
        *,
        render_mode: str | None = None,
        **options: Any,
    ) -> None:
        self.arguments = {"task": task, **options}
        self.arms, self.names = make_arms(1, **self.arguments)
        self.action_space = self.arms.action_space
        self.observation_space = self.arms.observation_space
        self.render_mode = check_render_mode(render_mode, self.metadata)
        self._figure: Figure | None = None
        self._goes_on = False
        self._all = np.array([True])

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin a trial."""
        super().reset(seed=seed)
        if self.names:
            give_instance(self.arms, 0, self.names, self.np_random)
        self.arms.reset(self._all)
        self._goes_on = True
        if self.render_mode == "human":
            self.render()
        return self.arms.observations()[0], self._info()

    def step(
        self, action: ArrayLike
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Make the next subtask of the trial. Raises ResetNeeded where it has ended."""
        if not self._goes_on:
            raise ResetNeeded("no trial goes on: reset first")
        rewards, ended = self.arms.step(np.asarray(action)[None], self._all)
        self._goes_on = not ended[0]
        if self.render_mode == "human":
            self.render()
        return self.arms.observations()[0], float(rewards[0]), bool(ended[0]), False, self._info()

    def action_for(self, hand: Hand, target: Array | None) -> Array:
        """The action that moves this hand to a target, to replay a solution: see
        :meth:`coartic.arms.Arms.action_for`. A movement of kind ``"corrective"`` has no target."""
        return self.arms.action_for(0, hand, target)

    def render(self) -> NDArray[np.uint8] | None:
        """Show the robot and the goals in a window, or as a picture ``(height, width, 3)``."""
        if self.render_mode is None:
            return None
        if self.render_mode == "rgb_array":
            return draw_picture(self.arms, 0)
        from matplotlib import pyplot

        self._figure = self._figure or pyplot.figure(figsize=(6, 4))
        draw_arms(self._figure, self.arms, 0)
        pyplot.pause(1 / self.metadata["render_fps"])
        return None

    def close(self) -> None:
        """Close the window."""
        if self._figure is not None:
            from matplotlib import pyplot

            pyplot.close(self._figure)
        self._figure = None

    def _info(self) -> dict[str, Any]:
        return {name: values.tolist()[0] for name, values in self.arms.infos().items()}


class TaskVectorEnv(VectorEnv):
    """N robots side by side, which takes a fraction of the time; options as :class:`TaskEnv`.

    ``autoreset_mode`` is one of Gymnasium's. By default, ``"NextStep"``, an episode that has ended
    begins anew in the next step, whose action is ignored. Actions are clipped to the box.
    """

    metadata: ClassVar[dict[str, Any]] = {
        "render_modes": ["rgb_array"],
        "render_fps": TaskEnv.metadata["render_fps"],
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        num_envs: int,
        task: Task | str | Path | None = None,
        *,
        render_mode: str | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        **options: Any,
    ) -> None:
        self.arguments = {"task": task, **options}
        self.arms, self.names = make_arms(num_envs, **self.arguments)
        self.num_envs = num_envs
        self.render_mode = check_render_mode(render_mode, self.metadata)
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode}  # type: ignore[misc]
        self.single_action_space = self.arms.action_space
        self.single_observation_space = self.arms.observation_space
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self._ended = np.zeros(self.num_envs, dtype=np.bool_)
        self._all = np.ones(self.num_envs, dtype=np.bool_)
        self._rngs: list[np.random.Generator | None] = [None] * self.num_envs

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin all trials, or those of ``options["reset_mask"]``, shape ``(num_envs,)``.

        A seed, or one for each environment, is taken as by Gymnasium. Nothing is random but which
        instance of a family is drawn.
        """
        seeds: Sequence[int | None]
        if isinstance(seed, Sequence | np.ndarray) and not isinstance(seed, str):
            seeds = seed
            if len(seeds) != self.num_envs:
                raise ValueError(f"{len(seeds)} seeds for {self.num_envs} environments")
            super().reset(seed=seeds[0])
        else:
            super().reset(seed=seed)  # raises for what is no seed
            seeds = [None if seed is None else seed + row for row in range(self.num_envs)]
        which = self._all
        if options is not None and "reset_mask" in options:
            which = options["reset_mask"]
            fits = isinstance(which, np.ndarray) and which.dtype == np.bool_
            if not fits or which.shape != (self.num_envs,) or not which.any():
                raise ValueError(
                    f"reset_mask must be an array of {self.num_envs} booleans, at least one of "
                    "them True"
                )
        for row in np.flatnonzero(which).tolist():
            if seeds[row] is not None or self._rngs[row] is None:
                self._rngs[row] = seeding.np_random(seeds[row])[0]  # raises for what is no seed
        self._begin(which)
        return self.arms.observations(), self._infos(which)

    def _begin(self, which: NDArray[np.bool_]) -> None:
        """Begin these trials."""
        for row in np.flatnonzero(which).tolist() if self.names else ():
            give_instance(self.arms, row, self.names, self._rngs[row])
        self._ended[which] = False
        self.arms.reset(which)

    def step(
        self, actions: Array
    ) -> tuple[NDArray[np.float32], Array, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Make the next subtask of each trial that goes on; begin the others anew.

        Raises ResetNeeded where they are not begun by themselves, in the mode ``"Disabled"``.
        """
        going = ~self._ended
        if not going.all():
            if self.autoreset_mode == AutoresetMode.DISABLED:
                raise ResetNeeded(
                    f"the trials of environments {np.flatnonzero(self._ended).tolist()} have "
                    "ended: reset them first"
                )
            self._begin(~going)
        rewards, ended = self.arms.step(actions, going)
        truncated = np.zeros_like(ended)
        observations, infos = self.arms.observations(), self._infos(self._all)
        if self.autoreset_mode != AutoresetMode.SAME_STEP:
            self._ended = ended.copy()
        elif ended.any():
            last = np.full(self.num_envs, None, dtype=object)
            for row in np.flatnonzero(ended):
                last[row] = observations[row]
            final = {"final_obs": last, "final_info": self._infos(ended)}
            self._begin(ended)
            observations, infos = self.arms.observations(), self._infos(self._all) | final
            infos |= {f"_{name}": ended.copy() for name in final}
        return observations, rewards, ended, truncated, infos

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """A picture of each robot and its goals."""
        if self.render_mode is None:
            return None
        return tuple(draw_picture(self.arms, row) for row in range(self.num_envs))

    def _infos(self, which: NDArray[np.bool_]) -> dict[str, Any]:
        infos = self.arms.infos()
        return infos | {f"_{name}": which.copy() for name in infos}


def give_instance(
    arms: Arms, row: int, names: Sequence[str], rng: np.random.Generator | None
) -> None:
    """Give a robot an instance that is drawn among these."""
    assert rng is not None
    name = names[int(rng.integers(len(names)))]
    arms.give(row, name if arms.knows(name) else load_task(name))


def sb3(env: str, num_envs: int = 64, **options: Any) -> RobotEnvs:
    """Robots side by side as environments of Stable-Baselines3.

    Parameters
    ----------
    env : str
        Id of an environment, such as ``"coartic/Family-v0"``.
    num_envs : int
        Number of robots.
    **options
        As in ``gymnasium.make``.

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

    given = known_env(env) | options
    return RobotEnvs(TaskVectorEnv(num_envs, **given, autoreset_mode=AutoresetMode.SAME_STEP))


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
        As in ``gymnasium.make``.

    Returns
    -------
    DataFrame
        A row for each policy, for uniformly random actions, for the corrective process alone with
        the given hands or the task's initial ones, and for the best solution known. Columns:
        ``reward``, the mean over tasks, ticks; ``gap`` to the best known reward, per cent, with its
        95 % interval ``gap_low`` to ``gap_high`` over tasks, or of one task over trials;
        ``completed``, the share of trials that hit all goals. The others are left out of the means.
        NaN where nothing is known, or too few trials for an interval.

    Raises
    ------
    ValueError, TypeError
        The environment is none of coartic's, an option is wrong, or the policy is no policy.
    """
    check_limits("episodes", episodes, 1, MOST_CELLS)
    if isinstance(env, str):
        given = known_env(env)
    elif isinstance(unwrapped := getattr(env, "unwrapped", env), TaskEnv | TaskVectorEnv):
        given = unwrapped.arguments
    else:
        raise TypeError(
            f"env is {brief_value(env)}; it must be an environment of coartic or its id"
        )
    given = {name: value for name, value in given.items() if name not in ("split", "count", "year")}
    if "family" in given:
        given["split"] = "test"
    given |= options
    _, names = make_arms(1, **given)
    tasks = [load_task(name) for name in names] or [as_task(given["task"])]

    found = {} if policy is None else policy if isinstance(policy, Mapping) else {"policy": policy}

    def robots(each: int) -> Arms:
        arms, _ = make_arms(each * len(tasks), **given)
        for row in range(each * len(tasks)):
            arms.give(row, tasks[row // each])
        arms.reset(np.ones(each * len(tasks), dtype=np.bool_))
        return arms

    first = robots(1)
    entries = first.observation_space.shape
    for name, each in found.items():
        learned_on = getattr(getattr(each, "observation_space", None), "shape", entries)
        if learned_on != entries:
            raise ValueError(
                f"{name} was trained on observations of shape {learned_on}; "
                f"those of {env if isinstance(env, str) else 'this environment'} have {entries}"
            )
    model = first.model
    rng = np.random.default_rng(seed)
    best = best_known(tasks) if model == PAPER else np.full(len(tasks), np.nan)
    hands = [first.given_hands(task) or initial_hands(task, model=model) for task in tasks]
    alone = [
        corrective_trial(task, each, model=model) for task, each in zip(tasks, hands, strict=True)
    ]
    rewards = {
        name: solve_all(tasks, each, seed, model)
        if isinstance(each, Method)
        else run_trials(robots(1), policy_of(each))[:, None]
        for name, each in found.items()
    }
    guesses = robots(episodes)
    size = guesses.action_space.shape
    rewards["random actions"] = run_trials(
        guesses, lambda seen: rng.uniform(-1, 1, (len(seen), *size))
    ).reshape(len(tasks), episodes)
    rewards["corrective process"] = np.array(
        [[np.nan if trial.reward is None else trial.reward] for trial in alone]
    )
    rewards["best known"] = best[:, None]
    rows = {name: summarise(each, best) for name, each in rewards.items()}
    rows["best known"]["completed"] = np.nan
    table = pd.DataFrame.from_dict(rows, orient="index")
    return table.rename_axis("policy")


def summarise(rewards: Array, best: Array) -> dict[str, float]:
    """Means over tasks of rewards ``(K, trials)``, NaN for those that failed."""
    gaps = 100.0 * (best[:, None] - rewards) / np.abs(best[:, None])
    values = gaps[0] if len(gaps) == 1 else mean_over(gaps, axis=1)
    values = values[np.isfinite(values)]
    mean, half = mean_over(values), np.nan
    if len(values) > 2:
        half = stdtrit(len(values) - 1, 0.975) * values.std(ddof=1) / np.sqrt(len(values))
    return {
        "reward": float(mean_over(mean_over(rewards, axis=1))),
        "gap": float(mean),
        "gap_low": float(mean - half),
        "gap_high": float(mean + half),
        "completed": float(np.isfinite(rewards).mean()),
    }


def mean_over(values: Array, axis: int | None = None) -> Any:
    """The mean of the numbers among these; NaN where there is none."""
    count = np.isfinite(values).sum(axis=axis)
    with np.errstate(invalid="ignore"):
        return np.where(np.isfinite(values), values, 0.0).sum(axis=axis) / count


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


def run_trials(arms: Arms, policy: Callable[[NDArray[np.float32]], ArrayLike]) -> Array:
    """Rewards of a trial of each robot, from its start, ``(N,)``; NaN where one failed."""
    going = np.ones(len(arms.rows), dtype=np.bool_)
    while going.any():
        going &= ~arms.step(policy(arms.observations()), going)[1]
    return np.where(np.isfinite(arms.trials.rewards), arms.trials.rewards, np.nan)


def solve_all(tasks: Sequence[Task], method: Method, seed: int, model: MotionModel) -> Array:
    """Rewards of a method's solutions, ``(K, 1)``; NaN where it has none."""
    rewards = np.full((len(tasks), 1), np.nan)
    for place, task in enumerate(tasks):
        session = Session(task, seed, method.told, model=model, trusted=True)
        with suppress(MethodError):
            reward = execute(task, method.solve(session).solution, model=model).reward
            rewards[place] = np.nan if reward is None else reward
    return rewards


def best_known(tasks: Sequence[Task]) -> Array:
    """The best reward that is shipped of each task ``(K,)``; NaN where none is."""
    shipped = map(best_shipped, tasks)
    return np.array([np.nan if known is None else known.reward for known in shipped])


TASKS = {
    "Ascending": "ascending",
    "Descending": "descending",
    "TwoArmed1": "two-armed-1",
    "TwoArmed2": "two-armed-2",
    "Task": None,
}


IDS: dict[str, dict[str, Any]] = {"coartic/Family-v0": {"family": "two-armed/v1"}}
for _name, _task in TASKS.items():
    _given = {} if _task is None else {"task": _task}
    IDS |= {f"coartic/{_name}-v0": _given, f"coartic/{_name}-v1": _given | WORKS}
for _name, _given in IDS.items():
    if _name not in gymnasium.registry:
        gymnasium.register(
            _name,
            entry_point="coartic.gym:TaskEnv",
            vector_entry_point="coartic.gym:TaskVectorEnv",
            kwargs=_given,
        )
