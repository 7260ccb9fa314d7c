"""Draw the robot with the names of its joints, and its null space.

    python docs/scripts/draw_robot.py

The script writes ``docs/robot.svg`` and ``docs/nullspace.svg``.
"""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Circle

from coartic import load_task
from coartic.analysis.figures import GREY, TWO, panels, picture, styled
from coartic.pictures.drawing import draw_robot
from coartic.robot import Array

Q = np.array([0, 0, 2.5, -0.8, 0.6, 0.5, 0.5, 0.6, -0.8, 0.5])
"""Configuration of the robot: base (length units), left arm and right arm (rad)."""
ANGLE = 0.55
"""Radius of the arcs that show joint angles, in length units."""


@styled
def robot() -> Figure:
    """Draw the robot with the names of its joints, and arcs of its angles."""
    task = load_task("two-armed-2")
    drawing, (axes,) = panels((1, 1), (TWO, 0.42 * TWO))
    draw_robot(axes, task, Q, weight=1.6)
    for hand, first, side in (("left", 2, -0.12), ("right", 6, 0.12)):
        joints = task.robot.joint_positions(Q, hand)
        aligned = {"ha": "right" if side < 0 else "left", "va": "top"}
        for number, joint in enumerate(joints[:-1]):
            # The angle is measured from the direction of the previous link, or from the x axis.
            before, after = (
                float(np.sum(Q[first:to])) for to in (first + number, first + number + 1)
            )
            ahead = joint + 1.4 * ANGLE * np.array([np.cos(before), np.sin(before)])
            axes.plot(*zip(joint, ahead, strict=True), ":", color=GREY, linewidth=0.7)
            ends = np.rad2deg(sorted((before, after)))
            axes.add_patch(
                Arc(joint, 2 * ANGLE, 2 * ANGLE, theta1=ends[0], theta2=ends[1], color=GREY)
            )
            axes.text(joint[0] + side, joint[1] - 0.08, f"{hand}_{number + 1}", **aligned)
        axes.text(joints[-1][0] + side, joints[-1][1], f"{hand} hand", **aligned)
    axes.plot(0, 0, "+", color=GREY)
    axes.text(0, -0.16, "base_x, base_y", ha="center", va="top")
    axes.set_xlim(-4.6, 4.6)
    axes.set_ylim(-0.6, 3.1)
    axes.set_aspect("equal")
    axes.set_xlabel("x (length unit)")
    axes.set_ylabel("y (length unit)")
    return drawing


@styled
def nullspace() -> Figure:
    """Draw several postures that hit goal 1, and a posture that hits goal 2.

    The posture at goal 1 that is nearest to the posture at goal 2 is black.
    """
    task = load_task("ascending")
    arm, goals = task.robot.joints("right"), np.array([(3.2, 1.4), (3.6, -0.4)])

    def hitting(goal: Array, angles: Array) -> Array:
        """Return a configuration whose right hand is at a goal, found by damped Newton steps.

        ``angles`` are the angles of the four joints of the right arm at the start, in rad.
        """
        q = np.zeros(task.robot.dof)
        q[arm] = angles
        for _ in range(200):
            error = goal - task.robot.forward_kinematics(q, "right")
            q[arm] += 0.5 * np.linalg.pinv(task.robot.jacobian(q, "right")[:, arm]) @ error
        return q

    starts = [np.array([a, 0.4 - 0.5 * a, 0.2 - 0.5 * a, -1.5]) for a in (1.6, 1.1, 0.6, 0.1, -0.4)]
    after = hitting(goals[1], np.array([-0.4, 0.4, 0.2, -1.5]))
    postures = [hitting(goals[0], start) for start in starts]
    postures.sort(key=lambda q: float(np.linalg.norm(after - q)))
    drawing, (axes,) = panels((1, 1), (TWO, 0.42 * TWO))
    for q, color, line in ((after, GREY, ":"), *((q, GREY, "-") for q in postures[1:]),
                           (postures[0], "black", "-")):  # fmt: skip
        joints = task.robot.joint_positions(q, "right")
        axes.plot(*joints.T, line, marker="o", color=color, markersize=3)
    for number, goal in enumerate(goals, 1):
        axes.add_patch(Circle(goal, 0.1, fill=False))
        axes.text(goal[0] + 0.2, goal[1], f"goal {number}", va="center")
    axes.annotate("", goals[0], goals[0] + (1.2, 1.1), arrowprops={"arrowstyle": "->"})
    axes.text(*goals[0] + (1.25, 1.1), "level 1 moves the hand", va="center")
    axes.set_xlim(-0.3, 6.6)
    axes.set_ylim(-1.4, 2.7)
    axes.set_aspect("equal")
    axes.set_axis_off()
    return drawing


if __name__ == "__main__":
    for name, draw in (("robot", robot), ("nullspace", nullspace)):
        Path(__file__).parents[1].joinpath(f"{name}.svg").write_bytes(picture(draw(), ".svg"))
