"""Measure and draw solutions goal by goal, as in Figures 5 to 7 of the paper."""

import numpy as np
import pandas as pd
from matplotlib.patches import Circle
from published import published_cell
from reader import LEARNER, Reader

from coartic import load_task
from coartic.analysis import figures
from coartic.analysis.study import MOST_EXECUTED, solved, typical_run

TALLEST = 8.8
"""Largest height (in inches) of a figure that leaves room for a caption on the page."""
MARKERS = {"L": {"marker": "s", "markerfacecolor": "white"}, "R": {"marker": "o"}}


def measure_solutions(study):
    """Measure the initial solution of each task and the median run of each condition.

    The median run is the run whose reward is nearest to the median. There is a row for each goal,
    with ``hand``, ``reward`` of the movements (in negative ticks), and the configuration at the hit
    (in length units and rad).
    """
    rows = []
    for name, task in study.tasks.items():
        runs = {}
        for on, label in sorted(study.cells):
            condition, every = label.removeprefix(LEARNER), solved(study.cells[on, label])
            if on == name and len(every) and published_cell(name, condition):
                executed = study.executed(name, label)
                typical = typical_run(every[:MOST_EXECUTED])
                runs[condition] = executed.runs[executed.run_ids.index(typical)]
        if runs:
            runs = {"initial": Reader(study).initial_execution(name)} | runs
        for condition, run in runs.items():
            for goal, (q, ticks) in enumerate(
                zip(run.configurations, run.ticks_by_goal(), strict=True)
            ):
                angles = dict(zip(task.robot.joint_names, q.tolist(), strict=True))
                rows.append({"row": f"{name} {condition} {goal + 1}", "task": name,
                             "condition": condition, "goal": goal + 1, "hand": run.hands[goal],
                             "reward": -ticks, **angles})  # fmt: skip
    return pd.DataFrame(rows).set_index("row")


@figures.styled
def draw_solutions(solutions):
    """Draw the posture that hits each goal, and the previous posture.

    There is a row of panels for each run.
    """
    runs = solutions.groupby(["task", "condition"], sort=False)
    most = solutions.goal.max()
    size = figures.TWO, min(TALLEST, 0.82 * runs.ngroups)
    figure, axes = figures.panels((runs.ngroups, most), size)
    for place, ((name, condition), run) in enumerate(runs):
        task, row = load_task(name), axes[place * most : (place + 1) * most]
        joints = list(task.robot.joint_names)
        every = solutions.loc[solutions.task == name, joints].to_numpy()
        points = np.vstack([
            task.goal_array,
            *(task.robot.joint_positions(q, hand) for q in (task.q0, *every)
              for hand in task.hands),
        ])  # fmt: skip
        (left, low), (right, high) = points.min(axis=0) - 0.4, points.max(axis=0) + 0.4
        for panel in row:
            panel.set_axis_off()
            panel.set(aspect="equal", xlim=(left, right), ylim=(low, high))
        words = f"{task.label}\n{condition}, {''.join(run.hand)}\n−{-run.reward.sum()}"
        row[0].text(-0.05, 0.5, words, transform=row[0].transAxes, ha="right", va="center")
        before = task.q0
        for panel, (q, hand, reward) in zip(
            row, zip(run[joints].to_numpy(), run.hand, run.reward, strict=True), strict=False
        ):
            draw_posture(panel, task, before, figures.GREY)
            draw_posture(panel, task, q, "black", hand)
            panel.text(0.4, -0.02, f"−{-reward}", transform=panel.transAxes, ha="center", va="top")
            before = q
    return figure


def draw_posture(axes, task, q, colour, marked=""):
    """Draw base, arms and goals in a configuration.

    Joints of the arm of the ``marked`` hand (``L`` or ``R``) have markers.
    """
    axes.fill(*task.robot.base_outline(q).T, facecolor="none", edgecolor=colour, linewidth=0.5)
    for hand in task.hands:
        letter = hand[0].upper()
        marks = MARKERS[letter] if letter == marked else {}
        axes.plot(*task.robot.joint_positions(q, hand).T, color=colour, linewidth=0.7,
                  markersize=2, markeredgewidth=0.5, **marks)  # fmt: skip
    for number, (x, y) in enumerate(task.goals, 1):
        axes.add_patch(Circle((x, y), task.radius, fill=False, linewidth=0.4))
        below = any(0 < up - y < 0.6 and abs(right - x) < 0.3 for right, up in task.goals)
        side, va = (-1, "top") if below else (1, "bottom")
        axes.annotate(str(number), (x, y + side * task.radius), (0, side), ha="center", va=va,
                      textcoords="offset points", fontsize=5)  # fmt: skip
