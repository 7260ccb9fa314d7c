"""Draw the robot with its joints named: ``python docs/scripts/draw_robot.py`` writes
``docs/robot.svg``."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Arc

from coartic import load_task
from coartic.analysis.figures import GREY, TWO, panels, picture, styled
from coartic.drawing import draw_robot

Q = np.array([0, 0, 2.5, -0.8, 0.6, 0.5, 0.5, 0.6, -0.8, 0.5])
"""Configuration: base, left arm, right arm."""
ANGLE = 0.55
"""Radius of the arcs of angles, length units."""


@styled
def robot() -> Figure:
    """Draw the robot, the names of its joints, and how angles are measured."""
    task = load_task("two-armed-2")
    drawing, (axes,) = panels((1, 1), (TWO, 0.42 * TWO))
    draw_robot(axes, task, Q, weight=1.6)
    for hand, first, side in (("left", 2, -0.12), ("right", 6, 0.12)):
        joints = task.robot.joint_positions(Q, hand)
        aligned = {"ha": "right" if side < 0 else "left", "va": "top"}
        for number, joint in enumerate(joints[:-1]):
            # The angle is measured from the direction of the link before, or the x axis.
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


if __name__ == "__main__":
    Path(__file__).parents[1].joinpath("robot.svg").write_bytes(picture(robot(), ".svg"))
