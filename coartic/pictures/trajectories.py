"""Trajectories: the configuration of the robot at each control tick of a solution."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from coartic.errors import SolutionError
from coartic.internal.arguments import checked_arguments
from coartic.internal.limits import check_limits
from coartic.internal.validation import equal_contents
from coartic.model import PAPER, MotionModel
from coartic.motion.execution import Execution, execute, sample_execution
from coartic.motion.solution import Movement
from coartic.robot import HANDS, Array, Hand
from coartic.tasks.catalogue import TaskLike, as_task
from coartic.tasks.task import Task, hands_of, in_world

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Configurations at all ticks of an execution that hits all goals (:func:`trajectory`)."""

    task: Task
    """The task."""
    execution: Execution
    """Execution of the solution (:func:`coartic.execute`)."""
    configurations: Array
    """Configurations, shape ``(ticks, dof)``, in length units (base) and rad (joints): a row for
    each control tick. The first row is the start. A movement of k steps has k + 1 rows. The first
    of these rows is the configuration in which the movement begins, so that the last row of the
    previous movement is repeated. A goal that is hit without a tick has no rows of its own."""
    hits: NDArray[np.int64]
    """Index of the row in which each goal was hit, shape ``(G,)``. If a goal was hit without a
    tick, the index is that of the last row up to then, or 0 if there was no row yet."""
    __eq__ = equal_contents

    @property
    def hands(self) -> tuple[Hand, ...]:
        """Hand that hits each goal, such as ``("right", "left")``."""
        return hands_of(self.execution.hands)

    @property
    def ticks(self) -> int:
        """Number of control ticks, which is the number of rows of ``configurations``."""
        return self.execution.ticks

    @property
    def reward(self) -> int:
        """Total reward: minus the ticks."""
        return -self.execution.ticks

    def hand_path(self, hand: Hand) -> Array:
        """Return the position of a hand in each row of ``configurations``.

        The result has shape ``(ticks, 2)``, in length units. ``hand`` may also be a hand that the
        task does not use.
        """
        return self.task.robot.forward_kinematics(self.configurations, hand)

    def subtask(self, goal: int) -> Array:
        """Return the rows of ``configurations`` that belong to a goal.

        Parameters
        ----------
        goal : int
            Number of the goal, from 1.

        Returns
        -------
        ndarray, shape (rows, dof)
            The rows from the hit of the previous goal (for goal 1, from the start) to the hit of
            this goal, including both. A goal that is hit without a tick has one row. There are no
            rows if the whole solution takes no ticks.

        Raises
        ------
        ValueError
            ``goal`` is not an integer from 1 to the number of goals.
        """
        check_limits("goal", goal, 1, len(self.hits))
        start = self.hits[goal - 2] if goal > 1 else 0
        return self.configurations[start : self.hits[goal - 1] + 1]

    def to_frame(self) -> pd.DataFrame:
        """Return the movement as a table with a row for each control tick.

        The index is ``tick``, from 0. The columns are

        - ``goal``: number of the first goal that is hit in this or a later row;
        - ``hand``: the hand that hits this goal;
        - ``base_x`` and ``base_y`` (in length units), ``left_1`` and so on (in rad): the
          configuration;
        - ``left_x``, ``left_y``, ``right_x`` and ``right_y`` (in length units): the positions of
          both hands.

        ``attrs["units"]`` is a dict that maps all columns except ``goal`` and ``hand`` to units.
        """
        import pandas as pd

        goal = np.minimum(
            np.searchsorted(self.hits, np.arange(len(self.configurations))), len(self.hits) - 1
        )
        frame = pd.DataFrame({"goal": goal + 1, "hand": np.array(self.hands)[goal]})
        frame.index.name = "tick"
        frame[list(self.task.robot.joint_names)] = self.configurations
        for hand in HANDS:
            frame[[f"{hand}_x", f"{hand}_y"]] = self.hand_path(hand)
        frame.attrs["units"] = {
            name: "length unit" if name.endswith(("_x", "_y")) else "rad"
            for name in frame.columns[2:]
        }
        return frame

    def plot(self) -> Figure:
        """Return a figure of the robot at the start and at each hit.

        Earlier postures are paler. The figure also shows the goals, and for each goal the path of
        the hand that hits it.
        """
        from matplotlib.figure import Figure

        from coartic.pictures.drawing import box, circle_goals, draw_robot, number_goals

        figure = Figure(figsize=(6, 4.5), layout="constrained")
        low, high = box(self.task, self.configurations)
        axes = figure.add_subplot(aspect="equal", xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        axes.set(xlabel="x (length unit)", ylabel="y (length unit)")
        postures = [self.task.q0, *self.execution.configurations]
        for number, q in enumerate(postures):
            draw_robot(axes, self.task, q, alpha=0.25 + 0.75 * number / len(self.hits))
        for number, hand in enumerate(self.hands, 1):
            x, y = self.task.robot.forward_kinematics(self.subtask(number), hand).T
            axes.plot(x, y, color="0.5", linewidth=0.8, zorder=1)
        circle_goals(axes, self.task)
        number_goals(axes, self.task)
        axes.set_title(f"{self.task.name}: {self.execution.hands}, reward −{-self.reward}")
        return figure

    @checked_arguments
    def animate(
        self,
        path: str | Path,
        *,
        width: Annotated[int, Field(ge=200, le=3840)] = 560,
        replace: bool = False,
    ) -> None:
        """Write a film of the movement.

        Parameters
        ----------
        path : str or pathlib.Path
            The file, ``.gif`` or, if ffmpeg is installed, ``.mp4``.
        width : int
            Width in pixels, from 200 to 3840. The width of an MP4 is even, and can be up to 2
            pixels less.
        replace : bool
            True to overwrite an existing file.

        Raises
        ------
        CoarticError
            The solution takes no ticks, the file has another suffix, ffmpeg is missing or fails,
            the file exists and ``replace`` is False, or the file cannot be written.
        ArgumentError
            An argument has a wrong type, or ``width`` is out of range.
        """
        from coartic.pictures.film import write_film

        title = f"{self.task.name}, {self.execution.hands}"
        write_film([(title, self)], Path(path), width=width, replace=replace)


def trajectory(
    task: TaskLike, movements: Iterable[Movement], model: MotionModel = PAPER
) -> Trajectory:
    """Execute a solution, and return the robot's configuration at each control tick.

    The number of ticks and the configurations at the hits are the same as in
    :func:`coartic.execute`, bit for bit.

    Parameters
    ----------
    task : Task, str or pathlib.Path
    movements : iterable of Movement
        The solution: at least one movement for each goal, in the order of the goals.
    model : MotionModel
        The motion model, without motor noise.

    Returns
    -------
    Trajectory
        The configurations, and the indices of the rows in which the goals were hit.

    Raises
    ------
    TaskError
        The task cannot be used.
    TypeError
        The task is not a Task, a string or a path, or the model is not a MotionModel.
    SolutionError
        The solution breaks the task's rules, or does not hit every goal.
    ValueError
        A constant of the model is out of bounds or does not fit the radius of the goals, or the
        model has motor noise.
    """
    execution = execute(task, movements, model=model)
    task = in_world(as_task(task), model)
    if not execution.completed:
        raise SolutionError(f"task {task.name!r}: {execution.reason}")
    rows = sample_execution(task, execution.movements, model)
    elapsed = np.zeros(len(task.goals), dtype=np.int64)
    for movement in execution.movements:
        elapsed[movement.goal - 1 :] += movement.ticks or 0
    hits = np.maximum(elapsed - 1, 0)
    return Trajectory(task, execution, rows, hits)
