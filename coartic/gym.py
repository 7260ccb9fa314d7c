"""Tasks as environments of Gymnasium: a step is a subtask, its reward minus the ticks it took
(and minus its penalty, where the task has one).

Importing this module registers ``coartic/Ascending-v0``, ``Descending``, ``TwoArmed1`` and
``TwoArmed2``, and ``coartic/Task-v0`` for any other task. Needs the extra ``coartic[gym]``.
"""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from coartic.inputs import WIDTHS, check_limits, real_array
from coartic.model import PAPER, MotionModel, check_model
from coartic.robot import LARGEST_FIGURE, Array, Hand
from coartic.text import unknown

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure

    from coartic.tasks.task import Task

MOST_ENVS = 1_000_000
LETTERS = np.array(["L", "R", ""])  # of hands 0 and 1; -1 is no hand yet


class Arms:
    """N robots, each at a subtask of its own trial.

    Parameters
    ----------
    count : int
        Number of robots.
    task : Task, str or Path
        A task, the name of a task (``"long/v1/i017"``) or a task file.
    scale : float
        Half the width of the box of targets, length unit (base) and rad (joints).
    around : str or array_like, shape (G, dof), optional
        Middle of the box: a configuration for each goal, or a hand sequence (``"RLRL"``), which
        means the configurations in which the corrective process alone hits the goals. By default
        the present configuration.
    observe : {"learner", "posture"}
        What is observed.
    hands : str, optional
        Hand sequence of all trials; by default the actions choose.
    model : MotionModel
        Constants of movement.

    Raises
    ------
    ValueError
        An option does not fit the task.

    Notes
    -----
    An action has an entry that chooses the left hand (below 0) or the right one, unless the robot
    has one hand or ``hands`` are given, and an entry for each joint that can move. The box is
    from -1 to 1; the environments clip actions to it. Where the entries of all joints are NaN,
    no movement is made to a target: the corrective process acts alone, and the step takes 0 ticks
    if the hand is inside the goal already. With ``hands``, an arm that hits neither this goal nor
    a later one keeps its posture.

    An observation has an entry for each goal, 1 for the next goal, and two for the hand that hit
    the goal before; with ``observe="posture"`` also the configuration ``(dof,)`` and the goals
    ``(G, 2)``.
    """

    def __init__(
        self,
        count: int,
        task: Task | str | Path,
        *,
        scale: float = 1.0,
        around: str | ArrayLike | None = None,
        observe: Literal["learner", "posture"] = "learner",
        hands: str | None = None,
        model: MotionModel = PAPER,
    ) -> None:
        from coartic import corrective_trial  # the compiler takes a while
        from coartic.motion.trials import Trials, hand_codes
        from coartic.tasks.task import as_task, hands_of

        check_limits("num_envs", count, 1, MOST_ENVS)
        check_limits("scale", scale, *WIDTHS)
        self.task = as_task(task)
        self.scale, self.model = scale, check_model(model, radius=self.task.radius)
        goals, dof = len(self.task.goals), self.task.robot.dof
        if isinstance(around, str):
            if {*around} - {"L", "R"} or len(around) != goals:
                raise ValueError(
                    f"around is {around!r}; it must have L or R for each of {goals} goals"
                )
            around = corrective_trial(self.task, around, model=model).configurations
        self.around = None if around is None else real_array("around", around).copy()
        if self.around is not None and self.around.shape != (goals, dof):
            raise ValueError(f"around has shape {self.around.shape}; it must be ({goals}, {dof})")
        if self.around is not None and not (np.abs(self.around) <= LARGEST_FIGURE).all():
            raise ValueError(f"around has figures that are not finite or beyond {LARGEST_FIGURE:g}")
        if observe not in ("learner", "posture"):
            raise ValueError(f"observe is {observe!r}; it is 'learner' or 'posture'")
        self.sees_posture = observe == "posture"
        if hands is None and len(self.task.hands) == 1:
            hands = goals * self.task.hands[0][0].upper()
        self.chooses_hands = hands is None
        self._hands = (
            np.zeros(goals, np.int64) if hands is None else hand_codes(self.task, hands, 1)[0]
        )
        self.moves = np.zeros((goals, dof), dtype=np.bool_)
        """Joints that can move at each goal, shape ``(G, dof)``."""
        self.moves[:, :2] = [coordinate not in self.task.locked_base for coordinate in "xy"]
        for goal in range(goals):
            for hand in self.task.hands if hands is None else hands_of(hands)[goal:]:
                self.moves[goal, self.task.robot.joints(hand)] = True
        self.free = np.flatnonzero(self.moves.any(axis=0))
        """Joints that have an entry in an action."""
        self.action_space = Box(-1.0, 1.0, (self.chooses_hands + len(self.free),), np.float32)
        seen = np.ones(goals + 2 + (dof + 2 * goals) * self.sees_posture, dtype=np.float32)
        seen[goals + 2 :] = LARGEST_FIGURE
        low = np.where(np.arange(len(seen)) < goals + 2, 0.0, -seen).astype(np.float32)
        self.observation_space = Box(low, seen, dtype=np.float32)
        self.q = np.empty((count, dof))
        self.goal = np.empty(count, dtype=np.int64)
        self.hands = np.empty((count, goals), dtype=np.int64)
        counts = np.empty((5, count), dtype=np.int64)
        places = np.empty((2, count, goals, dof))
        completed = np.empty(count, dtype=np.bool_)
        self.trials = Trials._make([counts[0], completed, *counts[1:4], *places, counts[4]])
        """The trials as far as they are made."""
        self.reset(np.ones(count, dtype=np.bool_))

    def reset(self, which: NDArray[np.bool_]) -> None:
        """Put these robots back to the start."""
        self.q[which] = self.task.q0
        self.goal[which], self.hands[which] = 0, -1
        for each in self.trials:
            each[which] = np.nan if each.dtype.kind == "f" else 0

    def centre(self, rows: NDArray[np.int64]) -> Array:
        """The middle of the box of targets of these robots, shape ``(n, dof)``."""
        return self.q[rows] if self.around is None else self.around[self.goal[rows]]

    def step(self, actions: Array, which: NDArray[np.bool_]) -> tuple[Array, NDArray[np.bool_]]:
        """Make the next subtask of these robots: rewards ``(N,)``, and whose trials have ended.

        Raises ValueError for actions of another shape, and for entries that are not finite, unless
        those of all joints are NaN.
        """
        from coartic.motion.penalty import penalties_of_movements
        from coartic.motion.reach import reach_unchecked
        from coartic.optimisers import FAILED

        rows = np.flatnonzero(which)
        chosen = real_array("actions", actions)
        shape = len(which), *self.action_space.shape
        if chosen.shape != shape:
            raise ValueError(f"actions have shape {chosen.shape}; it must be {shape}")
        chosen, goal, trials = chosen[rows], self.goal[rows], self.trials
        hands, joints = self._hands[goal], chosen[:, int(self.chooses_hands) :]
        if self.chooses_hands:
            hands = (chosen[:, 0] > 0).astype(np.int64)
        targets = np.full((len(rows), self.task.robot.dof), np.nan)
        targets[:, self.free] = self.centre(rows)[:, self.free] + self.scale * joints
        without = np.isnan(joints).all(axis=1)
        no_hand = self.chooses_hands and np.isnan(chosen[:, 0]).any()
        if no_hand or not (np.abs(targets[~without][:, self.free]) <= LARGEST_FIGURE).all():
            raise ValueError(
                "an action is not finite; NaN is for all joints, not for some, and not for the hand"
            )
        targets = np.where(self.moves[goal], targets, self.q[rows])
        targets[without] = np.nan
        reached = reach_unchecked(
            self.task.robot,
            self.q[rows],
            hands,
            self.task.goal_array[goal],
            self.task.radius,
            targets,
            locked_base=self.task.locked_base,
            model=self.model,
        )
        penalties = penalties_of_movements(self.task, self.q[rows], reached.q, hands, goal == 0)
        self.q[rows] = reached.q
        self.hands[rows, goal] = hands
        self.goal[rows] += reached.hit
        trials.targets[rows, goal] = targets
        trials.reached[rows[reached.hit], goal[reached.hit]] = reached.q[reached.hit]
        trials.completed[rows] = self.goal[rows] == len(self.task.goals)
        trials.penalties[rows] += penalties
        for name in ("ticks", "corrections", "iterations", "evaluations"):
            getattr(trials, name)[rows] += getattr(reached, name)
        rewards, ended = np.zeros(len(which)), np.zeros(len(which), dtype=np.bool_)
        rewards[rows] = np.where(reached.hit, -(reached.ticks + penalties), -FAILED)
        ended[rows] = trials.completed[rows] | ~reached.hit
        return rewards, ended

    def observations(self) -> NDArray[np.float32]:
        """Observations ``(N, O)``."""
        count, goals = self.hands.shape
        seen = np.zeros((count, *self.observation_space.shape), dtype=np.float32)
        rows = np.flatnonzero(self.goal < goals)
        seen[rows, self.goal[rows]] = 1.0
        rows = np.flatnonzero(self.goal > 0)
        seen[rows, goals + self.hands[rows, self.goal[rows] - 1]] = 1.0
        if self.sees_posture:
            seen[:, goals + 2 :] = np.hstack(
                [self.q, np.broadcast_to(self.task.goal_array.ravel(), (count, 2 * goals))]
            )
        return seen

    def infos(self) -> dict[str, Any]:
        """Hands used so far (``"RL"``), corrective movements made, whether all goals are hit."""
        made, letters = self.trials, LETTERS[self.hands]
        return {
            "hands": letters.view(f"U{letters.shape[1]}")[:, 0],
            "corrections": made.corrections.copy(),
            "is_success": made.completed.copy(),
        }


OPTIONS = tuple(inspect.signature(Arms).parameters)[2:]


def make_arms(count: int, task: Task | str | Path, options: dict[str, Any]) -> Arms:
    """Robots with the options of an environment. Raises TypeError for one that there is not."""
    for name in options.keys() - OPTIONS:
        raise TypeError(unknown("option", name, [*OPTIONS, "render_mode"]))
    return Arms(count, task, **options)


def clip(actions: Any) -> Array:
    """Actions within the box; NaN, which is no target, stays."""
    return np.clip(real_array("actions", actions), -1.0, 1.0)


def check_render_mode(mode: str | None, metadata: dict[str, Any]) -> str | None:
    """The mode itself. Raises ValueError for one that there is not."""
    if mode is not None and mode not in metadata["render_modes"]:
        raise ValueError(f"render_mode is {mode!r}; it must be one of {metadata['render_modes']}")
    return mode


def picture(arms: Arms, row: int) -> NDArray[np.uint8]:
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

    task = arms.task
    (left, bottom), (right, top) = box(task, task.q0, margin=1.0)
    figure.clear()
    axes = figure.add_subplot(aspect="equal", xlim=(left, right), ylim=(bottom, top))
    draw_robot(axes, task, arms.q[row], weight=1.5)
    number_goals(axes, task, weight=1.5)
    fill_goals(draw_goals(axes, task), np.arange(len(task.goals)) < arms.goal[row])


class TaskEnv(gymnasium.Env):
    """One robot and one task; the options are those of :class:`Arms`.

    An episode is a trial, of as many steps as there are goals; it ends earlier where the
    corrective process fails, which costs ``coartic.optimisers.FAILED``. Nothing is random.
    Actions are clipped to the box.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["human", "rgb_array"], "render_fps": 4}

    def __init__(
        self, task: Task | str | Path, *, render_mode: str | None = None, **options: Any
    ) -> None:
        self.arms = make_arms(1, task, options)
        self.action_space = self.arms.action_space
        self.observation_space = self.arms.observation_space
        self.render_mode = check_render_mode(render_mode, self.metadata)
        self._figure: Figure | None = None
        self._goes_on = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin a trial."""
        super().reset(seed=seed)
        self.arms.reset(np.array([True]))
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
        rewards, ended = self.arms.step(clip(action)[None], np.array([True]))
        self._goes_on = not ended[0]
        if self.render_mode == "human":
            self.render()
        return self.arms.observations()[0], float(rewards[0]), bool(ended[0]), False, self._info()

    def action_for(self, hand: Hand, target: Array | None) -> Array:
        """The action that moves this hand to a target ``(dof,)``, to replay a solution.

        Without a target, which is None or NaN, the corrective process acts alone: the entries of
        the joints are NaN. A movement of kind ``"corrective"`` is replayed so. Raises ValueError
        for a target outside of the box, which no action leads to.
        """
        if hand not in self.arms.task.hands:
            raise ValueError(f"hand is {hand!r}; it must be one of {self.arms.task.hands}")
        centre = self.arms.centre(np.array([0]))[0]
        given = np.full_like(centre, np.nan) if target is None else real_array("target", target)
        if given.shape != centre.shape:
            raise ValueError(f"target has shape {given.shape}; it must be {centre.shape}")
        away = (given - centre)[self.arms.free] / self.arms.scale
        if (far := np.nanmax(np.abs(away), initial=0.0)) > 1.0 + 1e-9:
            raise ValueError(
                f"the target is outside of the box: it needs a scale of {far * self.arms.scale:.3g}"
            )
        return np.array([-1.0 if hand == "left" else 1.0, *away][not self.arms.chooses_hands :])

    def render(self) -> NDArray[np.uint8] | None:
        """Show the robot and the goals in a window, or as a picture ``(height, width, 3)``."""
        if self.render_mode is None:
            return None
        if self.render_mode == "rgb_array":
            return picture(self.arms, 0)
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
        return {name: values[0].item() for name, values in self.arms.infos().items()}


class TaskVectorEnv(VectorEnv):
    """N robots side by side, which takes a fraction of the time; options as :class:`Arms`.

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
        task: Task | str | Path,
        *,
        render_mode: str | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        **options: Any,
    ) -> None:
        self.num_envs = num_envs
        self.arms = make_arms(num_envs, task, options)
        self.render_mode = check_render_mode(render_mode, self.metadata)
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode}  # type: ignore[misc]
        self.single_action_space = self.arms.action_space
        self.single_observation_space = self.arms.observation_space
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._ended = np.zeros(num_envs, dtype=np.bool_)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin all trials, or those of ``options["reset_mask"]``, shape ``(num_envs,)``.

        A seed, or one for each environment, is taken as by Gymnasium; nothing is random.
        """
        if isinstance(seed, Sequence | np.ndarray) and not isinstance(seed, str):
            if len(seed) != self.num_envs:
                raise ValueError(f"{len(seed)} seeds for {self.num_envs} environments")
            for each in seed:
                seeding.np_random(each)  # raises for what is none
            seed = seed[0]
        super().reset(seed=seed)
        which = np.ones(self.num_envs, dtype=np.bool_)
        if options is not None and "reset_mask" in options:
            which = options["reset_mask"]
            fits = isinstance(which, np.ndarray) and which.dtype == np.bool_
            if not fits or which.shape != (self.num_envs,) or not which.any():
                raise ValueError(
                    f"reset_mask must be an array of {self.num_envs} booleans, at least one of "
                    "them True"
                )
        self._ended[which] = False
        self.arms.reset(which)
        return self.arms.observations(), self._infos(which)

    def step(
        self, actions: Array
    ) -> tuple[NDArray[np.float32], Array, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Make the next subtask of each trial that goes on; begin the others anew.

        Raises ResetNeeded where they are not begun by themselves, in the mode ``"Disabled"``.
        """
        if self._ended.any() and self.autoreset_mode == AutoresetMode.DISABLED:
            raise ResetNeeded(
                f"the trials of environments {np.flatnonzero(self._ended).tolist()} have ended: "
                "reset them first"
            )
        self.arms.reset(self._ended)
        rewards, ended = self.arms.step(clip(actions), ~self._ended)
        self._ended, truncated = ended.copy(), np.zeros_like(ended)
        observations, infos = self.arms.observations(), self._infos(np.ones_like(ended))
        if ended.any() and self.autoreset_mode == AutoresetMode.SAME_STEP:
            last = np.full(self.num_envs, None, dtype=object)
            for row in np.flatnonzero(ended):
                last[row] = observations[row]
            final = {"final_obs": last, "final_info": self._infos(ended)}
            observations, _ = self.reset(options={"reset_mask": ended})
            infos = self._infos(np.ones_like(ended)) | final
            infos |= {f"_{name}": ended.copy() for name in final}
        return observations, rewards, ended, truncated, infos

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """A picture of each robot and its goals."""
        if self.render_mode is None:
            return None
        return tuple(picture(self.arms, row) for row in range(self.num_envs))

    def _infos(self, which: NDArray[np.bool_]) -> dict[str, Any]:
        infos = self.arms.infos()
        return infos | {f"_{name}": which.copy() for name in infos}


TASKS = {
    "Ascending": "ascending",
    "Descending": "descending",
    "TwoArmed1": "two-armed-1",
    "TwoArmed2": "two-armed-2",
    "Task": None,
}
for _name, _task in TASKS.items():
    if f"coartic/{_name}-v0" not in gymnasium.registry:
        gymnasium.register(
            f"coartic/{_name}-v0",
            entry_point="coartic.gym:TaskEnv",
            vector_entry_point="coartic.gym:TaskVectorEnv",
            kwargs={} if _task is None else {"task": _task},
        )
