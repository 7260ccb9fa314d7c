"""Measure whether people lean towards the posture that comes next.

    python studies/people/make_table.py FOLDER          makes postures.csv from the public files
    python studies/people/protocols.py results/people   runs methods on tasks of the same form
    PYTHONPATH=studies python studies/people/study.py results/people

The expected answer is that people lean. Against it would be a mean over people that sign flips do
not distinguish from 0. README.md has the rule, which was committed before any lean of a person was
computed.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
from protocols import INSTANCES, METHODS, names
from rules import (
    contexts_of,
    leans,
    left_out,
    needed,
    people,
    read,
    sign_flips,
    smallest_shift,
    tabulate_plan,
    tabulate_power,
)
from scipy import stats

from coartic.analysis import TABLES, TwoContexts, figures, load, mean
from common.writing import write_study

HERE = Path(__file__).parent
PANELS = {
    "difference": "posture difference\n(rad; methods: and length unit)",
    "apart": "distance of the next postures\n(rad; methods: and length unit)",
    "lean": "lean\n(share of the way)",
}
QUANTITIES = {"lean": "more", "difference": "difference", "apart": "apart"}
"""Columns of the results, with the columns of the leans from which they are made."""


def over_people(values):
    """Return the mean over people with its 95 % t interval, the SD, and p by sign flips."""
    n, sd = len(values), values.more.std()
    half = stats.t.ppf(0.975, n - 1) * sd / n**0.5
    center = values.more.mean()
    return {
        "people": n, "more": center, "low": center - half, "high": center + half, "sd": sd,
        "p": sign_flips(values.more), "at_end": values.at_end.mean(),
        "at_start": values.at_start.mean(), "smallest": smallest_shift(n) * sd,
        **needed(values.more),
    }  # fmt: skip


def measure_people(table):
    """Return the leans of each person and target, the tests, and the rows of the figure."""
    every, counted = contexts_of(table), contexts_of(table[left_out(table) == ""])
    rows = leans(counted)
    judged = people(rows)
    described = {
        "judged": judged,
        "own next postures": people(leans(counted, own=True)),
        "medians": people(leans(counted, average=np.median)),
        "all repeats": people(leans(every)),
    }
    described |= {f"target {target}": people(part) for target, part in rows.groupby("target")}
    tests = pd.DataFrame({name: over_people(values) for name, values in described.items()}).T
    shown = pd.DataFrame({name: judged[column] for name, column in QUANTITIES.items()})
    shown.index = [f"person {person}" for person in shown.index]
    center = {name: judged[column].mean() for name, column in QUANTITIES.items()}
    center |= {"lean_low": tests.low["judged"], "lean_high": tests.high["judged"]}
    shown = pd.concat([shown, pd.DataFrame(center, ["people"])]).assign(kind="people")
    tables = {"leans": rows.set_index("person"), "tests": tests.rename_axis("test")}
    power = tabulate_power(counted)
    return tables | {"power": power, "plan": tabulate_plan(power.sd["repeats"])}, shown


def measure_pairs(study):
    """Return the lean of each method on each pair of tasks, and the runs from which it is made."""
    rows, runs = [], []
    for instance in INSTANCES:
        for label in METHODS:
            both = [study.executed(task, label) for task in names(instance)]
            contexts = TwoContexts(*both, 1, "right")
            found = contexts.lean
            rows.append({
                "method": label, "task": instance, "lean": found.more.value,
                "difference": contexts.posture_difference, "apart": found.apart,
                "runs": min(found.more.n),
            })  # fmt: skip
            for task, of_task in zip(("goal", "back"), both, strict=True):
                for number, hits in enumerate(of_task.configurations):
                    named = {"method": label, "task": instance, "context": task, "run": number}
                    pair = zip(("at", "next"), hits[:2], strict=True)
                    arm = of_task.task.robot.joints("right")
                    for kind, q in pair:
                        moved = {"x": q[0], "y": q[1], **dict(enumerate(q[arm], 1))}
                        named |= {f"{kind}_{name}": value for name, value in moved.items()}
                    runs.append({"run_id": of_task.run_ids[number], **named})
    return pd.DataFrame(rows).set_index("method"), pd.DataFrame(runs).set_index("run_id")


def of_methods(rows):
    """Return a row of the figure for each method: means over tasks, with intervals of the lean."""
    shown = {}
    for label, of_method in rows.groupby("method", sort=False):
        applies = of_method.dropna(subset="lean")
        shown[METHODS[label]] = {
            **mean(applies.lean.to_numpy()).columns("lean"),
            **mean(applies.difference.to_numpy()).columns("difference"),
            "apart": applies.apart.mean(), "tasks": len(applies), "kind": "methods",
        }  # fmt: skip
    return pd.DataFrame.from_dict(shown, orient="index")


def of_comparison():
    """Return the leans of the methods' shipped runs on tasks ascending and descending."""
    rows = TABLES["contexts"](load("shipped").worlds[""]).set_index("method").loc[[*METHODS]]
    columns = ["lean", "lean_low", "lean_high", "distance", "next_apart", "lean_runs"]
    return rows[columns].rename(index=METHODS)


def measure(folder=""):
    """Return the tables by name.

    The tables of methods are made from the runs in ``folder``, or left out if it is empty.
    """
    tables, shown = measure_people(read(HERE / "postures.csv"))
    if folder:
        rows, runs = measure_pairs(load(folder))
        tables |= {"pairs": rows, "runs": runs, "comparison": of_comparison()}
    else:
        rows = pd.read_csv(HERE / "pairs.csv", index_col=0)
    tables["results"] = pd.concat([shown, of_methods(rows)]).rename_axis("row")
    return tables


@figures.styled
def draw(results):
    """Draw people, their mean, and methods on tasks of the same form."""
    is_people = results.kind == "people"
    rows = results.assign(
        name=results.index,
        color=np.where(is_people, figures.PALETTE[3], figures.PALETTE[0]),
        marker=np.where(is_people, "o", "s"),
        bold=results.index == "people",
    )
    return figures.dots(rows, PANELS, {"lean": results.lean["random search"]})


if __name__ == "__main__":
    write_study(HERE, measure(*sys.argv[1:2]), draw)
