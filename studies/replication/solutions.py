"""Measure solutions goal by goal, and draw them as Figure 5 of the paper does."""

import pandas as pd
from published import published_cell
from reader import LEARNER, Reader

from coartic import load_task
from coartic.analysis import figures
from coartic.analysis.study import MAX_EXECUTED, solved, typical_run
from coartic.pictures.drawing import box, circle_goals, draw_robot, number_goals


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
                typical = typical_run(every[:MAX_EXECUTED])
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
    """Draw the postures at each goal of the corrective process and of the learner, on two tasks.

    The tasks are the first two of the table. There is a row of panels for each task, and a panel
    for each goal. The learner has the last condition of the task.
    """
    tasks = solutions.task.unique()[:2]
    goals = solutions.goal[solutions.task.isin(tasks)].max()
    figure, axes = figures.panels((len(tasks), goals), (figures.TWO, 2.1 * len(tasks)))
    for place, name in enumerate(tasks):
        task, of_task = load_task(name), solutions[solutions.task == name]
        ends = [of_task[of_task.condition == each] for each in of_task.condition.iloc[[0, -1]]]
        joints = list(task.robot.joint_names)
        low, high = box(task, pd.concat(ends)[joints].to_numpy())
        for goal, panel in enumerate(axes[place * goals : (place + 1) * goals]):
            panel.set_axis_off()
            if goal >= len(task.goals):
                continue
            panel.set(aspect="equal", xlim=(low[0], high[0]), ylim=(low[1], high[1]))
            for run, colour in zip(ends, ("#a0a0a0", "black"), strict=True):
                draw_robot(panel, task, run[joints].to_numpy()[goal], weight=1.5, colour=colour)
            circle_goals(panel, task)
            number_goals(panel, task)
            before, after = (-run.reward.iloc[goal] for run in ends)
            panel.set_title(f"{task.label}, goal {goal + 1}\n{before} → {after} ticks")
    return figure
