"""Tasks as environments of Gymnasium: a step is a subtask, its reward minus the ticks it took
(and minus its penalty, where the task has one).

Importing this module registers ``coartic/Ascending-v0``, ``Descending``, ``TwoArmed1`` and
``TwoArmed2``, and ``coartic/Task-v0`` for any other task. Needs the extra ``coartic[gym]``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, Literal

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from coartic.model import PAPER, MotionModel
from coartic.robot import LARGEST_FIGURE, Array, Hand

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure

    from coartic.tasks.task import Task

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
    from -1 to 1; actions beyond it are taken as they are. Where the entries of all joints are NaN,
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

        self.task = as_task(task)
        self.scale, self.model = scale, model
        goals, dof = len(self.task.goals), self.task.robot.dof
        if isinstance(around, str):
            if {*around} - {"L", "R"} or len(around) != goals:
                raise ValueError(
                    f"around is {around!r}; it must have L or R for each of {goals} goals"
                )
            around = corrective_trial(self.task, around, model=model).configurations
        self.around = None if around is None else np.array(around, dtype=np.float64)
        if self.around is not None and self.around.shape != (goals, dof):
            raise ValueError(f"around has shape {self.around.shape}; it must be ({goals}, {dof})")
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
        chosen = np.asarray(actions, dtype=np.float64)
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
                "an action is not finite, or far beyond the box; NaN is for all joints, not for "
                "some, and not for the hand"
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


class TaskEnv(gymnasium.Env):
    """One robot and one task; the options are those of :class:`Arms`.

    An episode is a trial, of as many steps as there are goals; it ends earlier where the
    corrective process fails, which costs ``coartic.optimisers.FAILED``. Nothing is random.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["human", "rgb_array"], "render_fps": 4}

    def __init__(
        self, task: Task | str | Path, *, render_mode: str | None = None, **options: Any
    ) -> None:
        self.arms = Arms(1, task, **options)
        self.action_space = self.arms.action_space
        self.observation_space = self.arms.observation_space
        self.render_mode = render_mode
        self._figure: Figure | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin a trial."""
        super().reset(seed=seed)
        self.arms.reset(np.array([True]))
        if self.render_mode == "human":
            self.render()
        return self.arms.observations()[0], self._info()

    def step(
        self, action: ArrayLike
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Make the next subtask of the trial."""
        rewards, ended = self.arms.step(np.asarray(action)[None], np.array([True]))
        if self.render_mode == "human":
            self.render()
        return self.arms.observations()[0], float(rewards[0]), bool(ended[0]), False, self._info()

    def action_for(self, hand: Hand, target: Array | None) -> Array:
        """The action that moves this hand to a target ``(dof,)``, to replay a solution.

        Without a target, which is None or NaN, the corrective process acts alone: the entries of
        the joints are NaN. A movement of kind ``"corrective"`` is replayed so.
        """
        centre = self.arms.centre(np.array([0]))[0]
        given = np.full_like(centre, np.nan) if target is None else target
        away = (given - centre)[self.arms.free] / self.arms.scale
        return np.array([-1.0 if hand == "left" else 1.0, *away][not self.arms.chooses_hands :])

    def render(self) -> NDArray[np.uint8] | None:
        """Show the robot and the goals in a window, or as a picture ``(height, width, 3)``."""
        if self.render_mode is None:
            return None
        from matplotlib import pyplot
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        if self.render_mode == "rgb_array":
            figure = Figure(figsize=(6, 4))
            canvas: Any = FigureCanvasAgg(figure)
            self._draw(figure)
            canvas.draw()
            return np.asarray(canvas.buffer_rgba())[..., :3].copy()
        self._figure = self._figure or pyplot.figure(figsize=(6, 4))
        self._draw(self._figure)
        pyplot.pause(1 / self.metadata["render_fps"])
        return None

    def _draw(self, figure: Figure) -> None:
        from coartic.drawing import box, draw_goals, draw_robot, fill_goals, number_goals

        arms, task = self.arms, self.arms.task
        (left, bottom), (right, top) = box(task, task.q0, margin=1.0)
        figure.clear()
        axes = figure.add_subplot(aspect="equal", xlim=(left, right), ylim=(bottom, top))
        draw_robot(axes, task, arms.q[0], weight=1.5)
        number_goals(axes, task, weight=1.5)
        fill_goals(draw_goals(axes, task), np.arange(len(task.goals)) < arms.goal[0])

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

    An episode that has ended begins anew in the next step, whose action is ignored.
    """

    metadata: ClassVar[dict[str, Any]] = {
        "render_modes": [],
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(self, num_envs: int, task: Task | str | Path, **options: Any) -> None:
        self.num_envs = num_envs
        self.arms = Arms(num_envs, task, **options)
        self.single_action_space = self.arms.action_space
        self.single_observation_space = self.arms.observation_space
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._ended = np.zeros(num_envs, dtype=np.bool_)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin all trials."""
        super().reset(seed=seed)
        self._ended = np.zeros(self.num_envs, dtype=np.bool_)
        self.arms.reset(~self._ended)
        return self.arms.observations(), self._infos()

    def step(
        self, actions: Array
    ) -> tuple[NDArray[np.float32], Array, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Make the next subtask of each trial that goes on; begin the others anew."""
        self.arms.reset(self._ended)
        rewards, self._ended = self.arms.step(actions, ~self._ended)
        truncated = np.zeros(self.num_envs, dtype=np.bool_)
        return self.arms.observations(), rewards, self._ended.copy(), truncated, self._infos()

    def _infos(self) -> dict[str, Any]:
        infos = self.arms.infos()
        return infos | {f"_{name}": np.ones(self.num_envs, dtype=np.bool_) for name in infos}


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
