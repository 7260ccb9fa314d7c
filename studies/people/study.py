"""Measure whether people lean towards the next posture, and whether they keep the last one.

    python studies/people/make_table.py FOLDER          makes postures.csv from the public files
    python studies/people/protocols.py results/people   runs methods on tasks of the same form
    PYTHONPATH=studies python studies/people/study.py results/people

The expected answer is that people lean. Against it would be a mean over people that sign flips do
not distinguish from 0. README.md has the rule, which was committed before any lean of a person was
computed, and that of carry-over, which was committed before any carry-over was computed.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
from protocols import INSTANCES, METHODS, names
from rules import (
    carried,
    contexts_of,
    leans,
    left_out,
    needed,
    people,
    read,
    sign_flips,
    smallest_shift,
    tabulate_carry_over_power,
    tabulate_plan,
    tabulate_power,
)
from scipy import stats

from coartic.analysis import TABLES, figures, lean, load, mean
from coartic.analysis.signatures import distance_of_means
from common.writing import write_study

HERE = Path(__file__).parent
PANELS = {
    "difference": "posture difference\n(rad)",
    "apart": "distance of the next postures\n(rad)",
    "lean": "lean\n(share of the way)",
}
CONTEXTS = ("goal", "back")
"""Contexts of the methods' tasks: goal 2 follows goal 1, or the place where the hand started."""
JOINTS = ["1", "2", "3", "4"]
PARTS = {"all": ["x", "y", *JOINTS], "base": ["x", "y"], "joints": JOINTS}
"""Coordinates of the methods' postures by part. People have four joint angles, and no base."""
QUANTITIES = {"lean": "more", "difference": "difference", "apart": "apart"}
"""Columns of the results, with the columns of the leans from which they are made."""


def over_people(values):
    """Return the row of a test over people as a dict.

    ``more`` is the mean over people, with its 95 % t interval (``low``, ``high``) and the standard
    deviation (``sd``), and ``p`` is the p-value by sign flips.
    """
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
    """Return the tables on the lean of people by name, and their rows of the figure.

    The tables are the leans of each person and target, the tests, their power, and the plan.
    """
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


def measure_carry_over(table):
    """Return the tables on carry-over by name.

    They are the carry-over of each person and contrast, the judged test with the tests that are not
    judged, and the power.
    """
    contrasts = carried(table[left_out(table) == ""])
    rows = leans(contrasts).rename(columns={"target": "contrast", "more": "carry_over"})
    described = {
        "judged": people(leans(contrasts)),
        "own starts": people(leans(contrasts, own=True)),
        "medians": people(leans(contrasts, average=np.median)),
        "all repeats": people(leans(carried(table))),
    }
    described |= {name: people(leans({name: each})) for name, each in contrasts.items()}
    tests = pd.DataFrame({name: over_people(values) for name, values in described.items()}).T
    kept = ["person", "contrast", "repeats", "carry_over", "low", "high", "difference", "apart"]
    return {
        "carry_over": rows[kept].set_index("person"),
        "carry_over_tests": tests.drop(columns=["at_end", "at_start"]).rename_axis("test"),
        "carry_over_power": tabulate_carry_over_power(contrasts),
    }


def tabulate_postures(study):
    """Return the postures of each run at the first two goals of its task.

    A posture consists of the base and the joints of the right arm.
    """
    rows = []
    for instance in INSTANCES:
        for label in METHODS:
            for context, task in zip(CONTEXTS, names(instance), strict=True):
                of_task = study.executed(task, label)
                arm = of_task.task.robot.joints("right")
                for number, hits in enumerate(of_task.configurations):
                    row = {"run_id": of_task.run_ids[number], "method": label, "task": instance}
                    row |= {"context": context, "run": number}
                    for kind, q in zip(("at", "next"), hits[:2], strict=True):
                        moved = {"x": q[0], "y": q[1], **dict(enumerate(q[arm], 1))}
                        row |= {f"{kind}_{name}": value for name, value in moved.items()}
                    rows.append(row)
    return pd.DataFrame(rows).set_index("run_id")


def measure_pairs(runs):
    """Return the lean of each method on each pair of tasks, by part (:data:`PARTS`).

    ``runs`` is a table of :func:`tabulate_postures`. All runs of a pair begin in the same posture.
    A method with only one run is treated as deterministic.
    """
    rows = []
    for (label, instance), of_pair in runs.groupby(["method", "task"], sort=False):
        of_contexts = []
        for context in CONTEXTS:
            of_task = of_pair[of_pair.context == context]
            at, following = (
                of_task[[f"{kind}_{name}" for name in PARTS["all"]]].to_numpy()
                for kind in ("at", "next")
            )
            of_contexts.append(np.stack([0 * at, at, following], axis=1))
        for part, coordinates in PARTS.items():
            columns = [PARTS["all"].index(name) for name in coordinates]
            both = [each[:, :, columns] for each in of_contexts]
            alone = min(map(len, both)) == 1
            # Of the interval, which takes resamples, nothing is used.
            found = lean(*both, np.random.default_rng(0), deterministic=alone, resamples=1)
            rows.append({
                "method": label, "task": instance, "part": part, "lean": found.more.value,
                "difference": distance_of_means(*(each[:, 1] for each in both)),
                "apart": found.apart, "runs": min(found.more.n),
            })  # fmt: skip
    return pd.DataFrame(rows).set_index("method")


def of_methods(rows):
    """Return a row of the figure for each method, with means over pairs of tasks.

    The columns are about the joints, except ``base``, ``base_low`` and ``base_high``: the mean lean
    of the base with its interval.
    """
    shown = {}
    for label, of_method in rows.groupby("method", sort=False):
        applies = of_method.dropna(subset="lean")
        joints, base = (applies[applies.part == part] for part in ("joints", "base"))
        shown[METHODS[label]] = {
            **mean(joints.lean.to_numpy()).columns("lean"), "median": joints.lean.median(),
            **mean(joints.difference.to_numpy()).columns("difference"),
            "apart": joints.apart.mean(), "tasks": len(joints), "kind": "methods",
            **mean(base.lean.to_numpy()).columns("base"), "base_tasks": len(base),
        }  # fmt: skip
    return pd.DataFrame.from_dict(shown, orient="index")


def of_comparison():
    """Return the leans of the methods' shipped runs on tasks ascending and descending."""
    rows = TABLES["contexts"](load("shipped").worlds[""]).set_index("method").loc[[*METHODS]]
    ends = ("", "_low", "_high")
    columns = [f"lean_{part}{end}" for part in ("joints", "base") for end in ends]
    columns += ["distance_joints", "next_apart_joints", "lean_runs"]
    return rows[columns].rename(index=METHODS)


def measure(folder=""):
    """Return the tables by name.

    The tables of methods are made from the runs in ``folder``, or from runs.csv.xz if it is empty.
    """
    tables, shown = measure_people(read(HERE / "postures.csv"))
    if folder:
        tables["runs"] = tabulate_postures(load(folder))
    tables |= measure_carry_over(read(HERE / "carry_over_postures.csv"))
    runs = tables.get("runs", pd.read_csv(HERE / "runs.csv.xz", index_col="run_id"))
    tables |= {"pairs": measure_pairs(runs), "comparison": of_comparison()}
    rows = pd.concat([shown, of_methods(tables["pairs"])])
    return tables | {"results": rows.rename_axis("row")}


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
