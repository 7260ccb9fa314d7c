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
from coartic.robot import HANDS, LARGEST_FIGURE, Array, Hand

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure

    from coartic.tasks.task import Task

Flags = NDArray[np.bool_]
LETTERS = np.array(["L", "R"])


class Arms:
    """N robots, each at some subtask of a trial of its own: what the environments consist of.

    ``task`` is a task, the name of one (``"long/v1/i017"``) or a file. An action has, where the
    robot has two hands, an entry that chooses the left one (below 0) or the right one, and then
    one for each joint that can move. The box from -1 to 1 is ``scale`` (length unit or rad) to
    either side of the present posture, or of the posture for the goal in ``around``, shape
    ``(G, dof)``; a hand sequence (``"RLRL"``) stands for those in which the corrective process
    alone hits the goals with it. Actions beyond the box are taken as they are. Where all joints of
    an action are NaN, no movement is made to a target: the corrective process acts alone, and the
    step takes 0 ticks if the hand is inside the goal already.

    An observation has an entry for each goal, 1 for the next one, and two for the hand that hit
    the one before; with ``observe="posture"`` also the configuration ``(dof,)`` and the goals
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
        model: MotionModel = PAPER,
    ) -> None:
        from coartic import corrective_trial  # the compiler takes a while
        from coartic.tasks.task import as_task

        self.task = as_task(task)
        self.scale, self.model = scale, model
        goals, dof = len(self.task.goals), self.task.robot.dof
        if isinstance(around, str):
            if {*around} - {*LETTERS} or len(around) != goals:
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
        moves = np.zeros(dof, dtype=np.bool_)
        moves[:2] = [coordinate not in self.task.locked_base for coordinate in "xy"]
        for hand in self.task.hands:
            moves[self.task.robot.joints(hand)] = True
        self.free = np.flatnonzero(moves)
        self.two_hands = len(self.task.hands) == 2
        self.action_space = Box(-1.0, 1.0, (self.two_hands + len(self.free),), np.float32)
        seen = np.ones(goals + 2 + (dof + 2 * goals) * self.sees_posture, dtype=np.float32)
        seen[goals + 2 :] = LARGEST_FIGURE
        low = np.where(np.arange(len(seen)) < goals + 2, 0.0, -seen).astype(np.float32)
        self.observation_space = Box(low, seen, dtype=np.float32)
        self.q = np.empty((count, dof))
        self.goal = np.empty(count, dtype=np.int64)
        self.hands = np.empty((count, goals), dtype="U1")
        self.corrections = np.empty(count, dtype=np.int64)
        self.is_success = np.empty(count, dtype=np.bool_)
        self.reset(np.ones(count, dtype=np.bool_))

    def reset(self, which: Flags) -> None:
        """Put these robots back to the start."""
        self.q[which] = self.task.q0
        self.goal[which], self.corrections[which] = 0, 0
        self.hands[which], self.is_success[which] = "", False

    def centre(self, rows: NDArray[np.int64]) -> Array:
        """The middle of the box of targets of these robots, shape ``(n, dof)``."""
        return self.q[rows] if self.around is None else self.around[self.goal[rows]]

    def step(self, actions: Array, which: Flags) -> tuple[Array, Flags]:
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
        chosen = chosen[rows]
        hands = np.full(len(rows), HANDS.index(self.task.hands[0]))
        if self.two_hands:
            hands = (chosen[:, 0] > 0).astype(np.int64)
        joints = chosen[:, int(self.two_hands) :]
        targets = self.centre(rows).copy()
        targets[:, self.free] += self.scale * joints
        without = np.isnan(joints).all(axis=1)
        no_hand = self.two_hands and np.isnan(chosen[:, 0]).any()
        if no_hand or not (np.abs(targets[~without]) <= LARGEST_FIGURE).all():
            raise ValueError(
                "an action is not finite, or far beyond the box; NaN is for all joints, not for "
                "some, and not for the hand"
            )
        targets[without] = np.nan  # of joints that cannot move, too
        reached = reach_unchecked(
            self.task.robot,
            self.q[rows],
            hands,
            self.task.goal_array[self.goal[rows]],
            self.task.radius,
            targets,
            locked_base=self.task.locked_base,
            model=self.model,
        )
        penalties = penalties_of_movements(
            self.task, self.q[rows], reached.q, hands, self.goal[rows] == 0
        )
        self.q[rows] = reached.q
        self.hands[rows, self.goal[rows]] = LETTERS[hands]
        self.goal[rows] += reached.hit
        self.corrections[rows] += reached.corrections
        completed = self.goal[rows] == len(self.task.goals)
        self.is_success[rows] = completed
        rewards, ended = np.zeros(len(which)), np.zeros(len(which), dtype=np.bool_)
        rewards[rows] = np.where(reached.hit, -(reached.ticks + penalties), -FAILED)
        ended[rows] = completed | ~reached.hit
        return rewards, ended

    def observations(self) -> NDArray[np.float32]:
        """What is to be seen of each, float32."""
        count, goals = self.hands.shape
        seen = np.zeros((count, *self.observation_space.shape), dtype=np.float32)
        rows = np.flatnonzero(self.goal < goals)
        seen[rows, self.goal[rows]] = 1.0
        rows = np.flatnonzero(self.goal > 0)
        seen[rows, goals + (self.hands[rows, self.goal[rows] - 1] == "R")] = 1.0
        if self.sees_posture:
            seen[:, goals + 2 :] = np.hstack(
                [self.q, np.broadcast_to(self.task.goal_array.ravel(), (count, 2 * goals))]
            )
        return seen

    def infos(self) -> dict[str, Any]:
        """Hands used so far (``"RL"``), corrective movements made, whether all goals are hit."""
        return {
            "hands": self.hands.copy().view(f"U{self.hands.shape[1]}")[:, 0],
            "corrections": self.corrections.copy(),
            "is_success": self.is_success.copy(),
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
        return np.array([-1.0 if hand == "left" else 1.0, *away][not self.arms.two_hands :])

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
            draw(figure, self.arms)
            canvas.draw()
            return np.asarray(canvas.buffer_rgba())[..., :3].copy()
        self._figure = self._figure or pyplot.figure(figsize=(6, 4))
        draw(self._figure, self.arms)
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
    ) -> tuple[NDArray[np.float32], Array, Flags, Flags, dict[str, Any]]:
        """Make the next subtask of each trial that goes on; begin the others anew."""
        self.arms.reset(self._ended)
        rewards, self._ended = self.arms.step(actions, ~self._ended)
        truncated = np.zeros(self.num_envs, dtype=np.bool_)
        return self.arms.observations(), rewards, self._ended.copy(), truncated, self._infos()

    def _infos(self) -> dict[str, Any]:
        infos = self.arms.infos()
        return infos | {f"_{name}": np.ones(self.num_envs, dtype=np.bool_) for name in infos}


def draw(figure: Figure, arms: Arms) -> None:
    """Draw the first robot and the goals; those that are hit are filled."""
    from matplotlib.patches import Circle

    task, q = arms.task, arms.q[0]
    shown = [task.goal_array]
    shown += [task.robot.joint_positions(task.q0, hand) for hand in task.hands]
    (left, bottom), (right, top) = np.min(np.vstack(shown), 0), np.max(np.vstack(shown), 0)
    figure.clear()
    axes = figure.add_subplot(
        aspect="equal", xlim=(left - 1, right + 1), ylim=(bottom - 1, top + 1)
    )
    axes.fill(*task.robot.base_outline(q).T, color="0.8")
    for hand in task.hands:
        axes.plot(*task.robot.joint_positions(q, hand).T, "k-o", markersize=3)
    for number, (x, y) in enumerate(task.goals):
        next_color = "tab:red" if number == arms.goal[0] else "0.5"
        is_hit = bool(number < arms.goal[0])
        axes.add_patch(Circle((x, y), task.radius, color=next_color, fill=is_hit))
        axes.annotate(str(number + 1), (x, y + task.radius), ha="center", va="bottom")


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
