"""Measure whether the order of methods survives motor noise, and how methods learn in noise.

    python studies/noise/protocols.py results/noise
    PYTHONPATH=studies python studies/noise/study.py results/noise

The expected answer to the first question was that CMA-ES keeps a lead over the paper's learner, but
a smaller one. Against it would be a lead that is as large as without noise, larger, reversed, or
not significant. README.md has all hypotheses and rules.
"""

import sys
from pathlib import Path

import learning
import order
import pandas as pd
import why

from coartic.analysis import figures, load
from common.writing import write_study

GROUPS = {"paper": "the paper's tasks", "families": "200 random tasks"}
_KEPT = [
    *("run_id", "task", "method", "setting", "run", "best_known", "motor_noise"),
    *("signal_dependent", "target", "action", "ticks", "failures"),
]
"""Columns of the stored executions."""


def executions_of(folder):
    """Return all executions of the study, with a row for each run, level of noise and target.

    Column ``question`` has the question to which the row belongs.
    """
    parts = {"order": "order", "why": "why"}
    parts |= {"memory-executed": "memory", "learning-executed": "learning"}
    parts |= {"handler-executed": "learning"}
    tables = []
    for part, question in parts.items():
        rows = pd.concat([pd.read_csv(path) for path in sorted((folder / part).glob("*.csv"))])
        if question == "order":
            rows = rows[rows.method.isin(order.NAMES) & rows.setting.isna()]
        tables.append(rows.reindex(columns=_KEPT).assign(question=question))
    rows = pd.concat(tables).set_index("run_id")
    return with_references(rows.assign(ticks=rows.ticks.round(2)))


def with_references(rows):
    """Return executions with the reference of their gaps as ``best_known``.

    On random tasks of question 4, the reference is the best reward without noise of any run of the
    study.
    """
    learning = (rows.question == "learning") & rows.task.str.contains("/")
    exact = rows[learning & (rows.motor_noise == 0) & (rows.failures == 0)]
    best = -exact.groupby("task").ticks.min()
    known = rows.best_known.where(~learning, rows.task.map(best))
    return rows.assign(best_known=known)


def measure(folder):
    """Return the tables of the study by name."""
    folder = Path(folder)
    rows = order.read(folder / "order")
    runs = load(folder / "memory").runs
    learner = runs[runs.method.str.startswith("dual-process/")]
    values = learning.read_memory(folder / "memory-executed", learner)
    memory, verdicts = learning.tabulate_memory(values)
    learned = learning.read_learning(folder)
    pairs = learning.tabulate_learning_pairs(learned)
    return {
        "runs": executions_of(folder),
        "hands": learner.groupby("task").hands.value_counts().reset_index().set_index("task"),
        "results": order.tabulate_gaps(rows).set_index("group"),
        "families": order.tabulate_families(rows).set_index("family"),
        "pairs": order.tabulate_pairs(rows),
        "why": why.tabulate_why(why.read(folder / "why")),
        "memory": memory.set_index("group"),
        "memory_verdicts": verdicts,
        "learning": learning.tabulate_learning(learned).set_index("group"),
        "practice": learning.tabulate_practice(learned).set_index("group"),
        "learning_pairs": pairs,
    }


@figures.styled
def draw(results):
    """Draw the gap by motor noise, with a panel for each group of tasks."""
    figure, panels = figures.panels((1, 2), (figures.TWO, 3.2))
    results = results.reset_index()
    for axes, (group, title) in zip(panels, GROUPS.items(), strict=True):
        of_group = results[(results.group == group) & ~results.signal_dependent]
        for name, method in {name: method for method, name in order.NAMES.items()}.items():
            look = figures.look_of(method) | {"label": name}
            figures.means(axes, of_group[of_group.name == name], x="motor_noise", y="gap", **look)
        axes.set(title=title, xlabel="motor noise s (rad, length units)", yscale="log")
        axes.set_xticks([0, 0.005, 0.01, 0.02])
        axes.set_yticks([1, 2, 5, 10, 20, 50], ["1", "2", "5", "10", "20", "50"])
        axes.set_yticks([], minor=True)
    panels[0].set_ylabel("gap (%), log scale; lower is better")
    figures.legend(figure, panels[0].get_legend_handles_labels()[0], 4)
    return figure


if __name__ == "__main__":
    write_study(Path(__file__).parent, measure(sys.argv[1]) if sys.argv[1:] else {}, draw)
