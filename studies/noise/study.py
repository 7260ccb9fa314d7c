"""Measure whether the order of methods that learn survives motor noise.

    PYTHONPATH=studies python studies/noise/protocols.py results/noise
    PYTHONPATH=studies python studies/noise/study.py results/noise

Without a folder, tables and page are made from runs.csv.xz and hands.csv. README.md has the
hypotheses and rules.
"""

import sys
from pathlib import Path

import order
import pandas as pd
import why
from rules import RESAMPLES

import memory
from coartic.analysis import figures, load
from common.writing import write_study

HERE = Path(__file__).parent
_KEPT = [
    *("run_id", "task", "method", "setting", "run", "best_known", "motor_noise", "target"),
    *("ticks", "error", "failures", "off"),
]
"""Columns of the stored executions."""


def executions_of(folder):
    """Return the executions of a folder, by run, level of noise and target.

    Column ``question`` is the part of the study to which the row belongs. If the folder lacks the
    part on memory, the rows of this part are those of ``runs.csv.xz``.
    """
    tables = []
    parts = {"practised": "practised", "answers": "answers", "answers-of-cma-es": "answers"}
    for part, question in (parts | {"memory-executed": "memory"}).items():
        if files := sorted((folder / part).glob("*.csv")):
            rows = pd.concat(map(pd.read_csv, files)).reindex(columns=_KEPT)
            tables.append(rows.assign(question=question))
    if not (folder / "memory-executed").exists():
        shipped = pd.read_csv(HERE / "runs.csv.xz", low_memory=False)
        shipped = shipped[shipped.question == "memory"]
        tables.append(shipped.reindex(columns=[*_KEPT, "question"]))
    rows = pd.concat(tables).set_index("run_id")
    return rows.assign(ticks=rows.ticks.round(2), error=rows.error.round(3), off=rows.off.round(3))


def measure(folder):
    """Return the tables of the study by name, from the executions of a folder."""
    folder = Path(folder)
    rows = executions_of(folder)
    if (folder / "memory").exists():
        runs = load(folder / "memory").runs
        learner = runs[runs.method.str.startswith("dual-process/")]
        hands = learner.groupby("task").hands.value_counts().reset_index().set_index("task")
    else:
        hands = pd.read_csv(HERE / "hands.csv", index_col=0)
    return {"runs": rows, "hands": hands, **tables_of(rows, hands)}


def tables_of(rows, hands, resamples=RESAMPLES):
    """Return the tables by name, from the executions and the hands of the learner's runs."""
    rows = rows.reset_index()
    gaps = order.read(rows)
    values = memory.read_memory(rows[rows.question == "memory"], hands)
    of_memory, verdicts = memory.tabulate_memory(values, resamples)
    return {
        "results": order.tabulate(gaps).set_index("group"),
        "verdicts": order.tabulate_verdicts(gaps, resamples),
        "families": order.tabulate_families(gaps).set_index("case"),
        "why": why.tabulate_why(gaps, rows),
        "memory": of_memory.set_index("group"),
        "memory_verdicts": verdicts,
    }


@figures.styled
def draw(results):
    """Draw the gap of each method in the four cases, with labelled lines."""
    figure, (axes,) = figures.panels((1, 1), (figures.TWO, 3.2))
    rows = results.reset_index().query("group == 'all'").set_index("name")
    methods = {name: label for label, name in order.LABELS.items()}
    places = range(len(order.CASES))
    for name in rows.sort_values("practised").index:
        gaps = rows.loc[name]
        look = figures.look_of(methods[name].partition(" ")[0])
        axes.errorbar(
            places, [gaps[case] for case in order.CASES],
            yerr=[[gaps[case] - gaps[f"{case}_low"] for case in order.CASES],
                  [gaps[f"{case}_high"] - gaps[case] for case in order.CASES]],
            color=look["color"], marker=look["marker"], markersize=4, linewidth=1, elinewidth=0.6,
            linestyle="--" if " " in methods[name] else "-",
        )  # fmt: skip
    ends = _spread(rows.practised.sort_values(), 0.045)
    for name, height in ends.items():
        color = figures.look_of(methods[name].partition(" ")[0])["color"]
        label = axes.annotate(
            name, (places[-1], height), (8, 0), textcoords="offset points", va="center",
            color=color,
        )  # fmt: skip
        label.set_in_layout(False)
    axes.set(yscale="log", ylabel="gap (%), log scale; lower is better", xlim=(-0.3, 4.4))
    axes.set_xticks(places, ["found and made\nwithout noise", "the same in noise,\nas it aims",
                             "in noise,\nat its hits", "practised and\nmade in noise"])  # fmt: skip
    axes.set_ylim(4, 50)
    axes.set_yticks([5, 10, 20, 40], ["5", "10", "20", "40"])
    axes.set_yticks([], minor=True)
    return figure


def _spread(values, least):
    """Return a dict of values that are moved up to be at least ``least`` apart in log10.

    ``values`` are in rising order; the dict maps their names to the moved values.
    """
    moved, before = {}, 0.0
    for name, value in values.items():
        moved[name] = before = max(value, before * 10**least)
    return moved


if __name__ == "__main__":
    if sys.argv[1:]:
        write_study(HERE, measure(sys.argv[1]), draw)
    else:
        rows = pd.read_csv(HERE / "runs.csv.xz", low_memory=False).set_index("run_id")
        write_study(HERE, tables_of(rows, pd.read_csv(HERE / "hands.csv", index_col=0)), draw)
