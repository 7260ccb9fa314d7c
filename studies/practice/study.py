"""What does the paper's learner lack: another way to move its centre, or a spread that it learns?

    python studies/practice/protocols.py results/practice
    PYTHONPATH=studies python studies/practice/study.py results/practice

Table hands.csv also needs the stored rows of study noise. Table power.csv was made before, from
development instances:

    python studies/practice/protocols.py results/practice-development development
    PYTHONPATH=studies python studies/practice/study.py results/practice-development development

The expected answer was both, in the world without motor noise and in that with it. Against it would
be an effect of one of the two that is near 0 or has the other sign. claims.toml has all rules.
"""

import sys
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import stats

from coartic.analysis import figures, mean
from coartic.analysis.statistics import task_mean
from coartic.analysis.study import Study
from coartic.runs.shipped import open_results
from common.judging import judge_means
from common.writing import write_study

HERE = Path(__file__).parent
WORLDS = {0.0: "without-noise", 0.01: "with-noise"}
"""Ends of the claims' ids by motor noise."""
EFFECTS = {
    "method": {"a": -0.5, "b": -0.5, "c": 0.5, "d": 0.5},
    "spread": {"a": -0.5, "b": 0.5, "c": -0.5, "d": 0.5},
    "interaction": {"a": 1.0, "b": -1.0, "c": -1.0, "d": 1.0},
}
"""Weights of the cells in each effect."""
SETTINGS = {
    "defaults": [],
    "second-best b": ["b"],
    "second-best c": ["c"],
    "second-best d": ["d"],
    "second-best b, c, d": ["b", "c", "d"],
}
"""Cells that have their second-best setting in a row of table ``effects``."""
RANDOM = "random"
"""Group of all random tasks."""
PAPER = "paper"
"""Group of the paper's four tasks."""
_KEPT = [
    *("run_id", "task", "method", "setting", "motor_noise", "run", "seed", "status", "hands"),
    *("value", "failed_executions", "best_known", "corrective_best"),
]
"""Columns of the stored runs."""
_OF_CELL = {
    ("hill-climbing", "fixed"): "a",
    ("hill-climbing", "learned"): "b",
    ("policy-gradient", "fixed"): "c",
    ("policy-gradient", "learned"): "d",
    ("hill-climbing/targets", "fixed"): "targets, fixed",
    ("hill-climbing/targets", "learned"): "targets, learned",
}


def cell_of(method, setting):
    """Return the name of a run's cell, such as ``a``, ``b second`` or ``learner``."""
    if method.startswith("dual-process/"):
        return "learner"
    words = dict(part.split("=") for part in setting.split(", ") if part)
    default = "learned" if method == "policy-gradient" else "fixed"
    cell = _OF_CELL[method, words.get("spread", default)]
    is_second = {*words} & {"window", "batch", "spread_step"}
    return f"{cell} second" if is_second else cell


def read(folder):
    """Return the study of a folder that lacks some of the planned runs.

    A cell of this study has only the runs with its hands. :func:`coartic.analysis.load` refuses
    such a folder.
    """
    folder = Path(folder)
    with open_results(folder) as store:
        stored = store.plan(), store.made_with(), store.runs(), store.marks()
        return Study(folder, *stored, imports=store.imports())


def stored(study):
    """Return the runs of both worlds as they are stored, indexed by their ids.

    ``value`` is minus the ticks of the solution: those of the best trial in the world without
    noise, and the mean over executions in the world with noise. ``best_known`` and
    ``corrective_best`` are minus ticks in the same world.
    """
    runs = pd.concat([each.runs.reset_index() for each in study.worlds.values()])
    return runs[_KEPT].set_index("run_id").dropna(axis="columns", how="all")


def measure_runs(runs):
    """Return stored runs with ``group``, ``cell``, ``gap`` (per cent) and ``log_ticks``.

    ``log_ticks`` is 100 times the natural logarithm of ticks. A failed run has twice the ticks of
    the corrective process with its best hands. ``group`` is the family, or the task of the paper.
    """
    value = runs.value.astype(float).where(runs.status == "ok", 2 * runs.corrective_best)
    return runs.assign(
        group=np.where(runs.task.str.contains("/"), runs.task.str.partition("/")[0], runs.task),
        cell=[*map(cell_of, runs.method, runs.setting.fillna(""))],
        gap=100 * (value / runs.best_known - 1),
        log_ticks=100 * np.log(-value),
    )


def by_cell(runs, column, replaced=()):
    """Return the values of one column, with a row for each run and a column for each cell.

    Cells in ``replaced`` have their second-best setting. Runs that not all of the cells a to d have
    are left out.
    """
    wide = runs.pivot_table(column, ["motor_noise", "group", "task", "run"], "cell", sort=False)
    wide = wide.assign(**{cell: wide[f"{cell} second"] for cell in replaced})
    return wide[wide[["a", "b", "c", "d"]].notna().all(axis=1)]


def effects_of(wide):
    """Return the three effects (:data:`EFFECTS`) for each row of ``wide``."""
    return pd.DataFrame(
        {
            name: sum(weight * wide[cell] for cell, weight in weights.items())
            for name, weights in EFFECTS.items()
        }
    )


def summarise(values, name):
    """Return means of values by motor noise and group, with 95 % intervals.

    On random tasks, the means over the runs of each task are averaged, and intervals are for other
    tasks. On the paper's tasks, intervals are for other runs. ``n`` is the number of tasks, or of
    runs on one task of the paper. ``skewness`` is that of the values over tasks; it is missing for
    the paper's tasks.
    """
    rows = []
    for noise, of_world in values.groupby(level="motor_noise", sort=False):
        is_random = of_world.index.get_level_values("task").str.contains("/")
        tasks = of_world[is_random].groupby(level=["group", "task"], sort=False).mean()
        papers = dict([*of_world[~is_random].groupby(level="task", sort=False)])
        groups = {RANDOM: tasks} if len(tasks) else {}
        groups |= dict([*tasks.groupby(level="group", sort=False)])
        for group, found in {**groups, **papers}.items():
            row = {"motor_noise": noise, "group": group, "n": len(found)}
            row |= mean(found).columns(name)
            rows.append(row | {"skewness": stats.skew(found) if group in groups else np.nan})
        if papers:
            row = {"motor_noise": noise, "group": PAPER, "n": len(papers)}
            rows.append(row | task_mean(papers.values()).columns(name))
    return pd.DataFrame(rows)


def tabulate(runs):
    """Tabulate the mean gap and logarithm of ticks of each cell, by world and group."""
    wide = {column: by_cell(runs, column) for column in ("gap", "log_ticks")}
    tables = []
    for cell in wide["gap"]:
        gap, log = (wide[column][cell].dropna() for column in ("gap", "log_ticks"))
        table = summarise(gap, "gap").drop(columns="skewness")
        table["log_ticks"] = summarise(log, "log_ticks").log_ticks
        table["runs"] = [
            _runs_in(gap, *key) for key in zip(table.motor_noise, table.group, strict=True)
        ]
        tables.append(table.assign(cell=cell))
    return _with_rows(pd.concat(tables), ["motor_noise", "group", "cell"])


def _runs_in(values, noise, group):
    """Return the number of runs of a world and a group.

    ``values`` contains a value for each run.
    """
    here = values.xs(noise, level="motor_noise").reset_index()
    is_random = here.task.str.contains("/")
    chosen = {RANDOM: is_random, PAPER: ~is_random}
    return int(chosen.get(group, here.group == group).sum())


def tabulate_effects(runs):
    """Tabulate the effects by world, group and settings, in points of gap.

    ``log_points`` is the mean effect on 100 times the logarithm of ticks.
    """
    tables = []
    for settings, replaced in SETTINGS.items():
        if not {f"{cell} second" for cell in replaced} <= {*runs.cell}:
            continue
        of_gaps, of_logs = (
            effects_of(by_cell(runs, column, replaced)) for column in ("gap", "log_ticks")
        )
        for effect in EFFECTS:
            table = summarise(of_gaps[effect], "points")
            table["log_points"] = summarise(of_logs[effect], "log_points").log_points
            tables.append(table.assign(effect=effect, settings=settings))
    return _with_rows(pd.concat(tables), ["motor_noise", "group", "effect", "settings"])


def _with_rows(table, keys):
    """Return a table whose first columns are ``keys``, and whose index joins their values."""
    words = table[keys].astype(str).agg(", ".join, axis=1)
    others = [name for name in table if name not in keys]
    return table[[*keys, *others]].set_axis(words.rename("row"), axis=0)


def judge_claims(runs):
    """Judge the claims over random tasks.

    A verdict needs the same sign of the mean effect on the logarithm of ticks. Otherwise it is
    *undecided*.
    """
    drawn = runs[runs.task.str.contains("/")]
    gaps, logs = (effects_of(by_cell(drawn, name)) for name in ("gap", "log_ticks"))
    gaps, logs = (each.groupby(level=["motor_noise", "task"]).mean() for each in (gaps, logs))
    values, is_alike = {}, {}
    for noise, world in WORLDS.items():
        for effect in EFFECTS:
            of_gap, of_log = (each.xs(noise)[effect] for each in (gaps, logs))
            values[f"{effect}-{world}"] = [of_gap]
            is_alike[f"{effect}-{world}"] = of_gap.mean() * of_log.mean() > 0
    claims = judge_means(HERE / "claims.toml", values)
    claims["same_sign_of_log_ticks"] = pd.Series(is_alike)
    claims["verdict"] = claims.verdict.where(claims.same_sign_of_log_ticks, "undecided")
    return claims


def measure_power(runs):
    """Return the spread of the effects over tasks, and the effects with 90 % power.

    Column ``smallest`` is the smallest effect that a one-tailed test at the level 5 % / 6 over 100
    tasks finds with 90 % power, by the normal approximation.
    """
    tasks = effects_of(by_cell(runs, "gap")).groupby(level=["motor_noise", "task"]).mean()
    rows = []
    for noise in WORLDS:
        for effect, values in tasks.xs(noise).items():
            of_random = stats.norm.isf(0.05 / 6) + stats.norm.isf(0.1)
            row = {"motor_noise": noise, "effect": effect, "tasks": len(values)}
            row |= {"points": values.mean(), "sd": values.std()}
            rows.append(row | {"smallest": of_random * values.std() / np.sqrt(100)})
    return _with_rows(pd.DataFrame(rows), ["motor_noise", "effect"])


def tabulate_hands(runs, executions):
    """Tabulate how much of the learner's lag behind the policy gradient hands explain.

    ``executions`` are the stored rows of study noise. They have the policy gradient that chooses
    its hands, on the same tasks. There is a row for each world and family with two arms, and one
    for all these families. ``learner``, ``given`` (cell d) and ``own`` are mean gaps. ``hands`` is
    ``given`` less ``own`` with its interval over tasks, and ``share`` is its part of ``learner``
    less ``own``.
    """
    means = runs.pivot_table("gap", ["motor_noise", "task"], "cell")
    is_exact = (executions.target == "T") & (executions.motor_noise == 0)
    own = executions[
        (executions.method == "policy-gradient")
        & executions.setting.isna()
        & (is_exact | (executions.question == "answers"))
    ]
    own = own.assign(gap=100 * (-own.ticks / own.best_known - 1))
    own = own.groupby(["motor_noise", "task"]).gap.mean().rename("own")
    tasks = means[["learner", "d"]].rename(columns={"d": "given"}).join(own, how="inner")
    family = tasks.index.get_level_values("task").str.partition("/").get_level_values(0)
    tasks = tasks.assign(group=family)[family != "one-armed"]
    rows = []
    for noise, of_world in tasks.groupby(level="motor_noise"):
        for group, found in {"two arms": of_world, **dict([*of_world.groupby("group")])}.items():
            row = {"motor_noise": noise, "group": group, "n": len(found)}
            row |= found[["learner", "given", "own"]].mean().to_dict()
            row |= mean((found.given - found.own).to_numpy()).columns("hands")
            rows.append(row | {"share": row["hands"] / (row["learner"] - row["own"])})
    return _with_rows(pd.DataFrame(rows), ["motor_noise", "group"])


LOOKS = {
    ("a", "b"): {"label": "hill climbing", "color": figures.PALETTE[0]},
    ("c", "d"): {"label": "policy gradient", "color": figures.PALETTE[1], "marker": "s"},
}
"""Cells with a fixed and with a learned spread, and the look of the line between them."""
PANELS = (RANDOM, "one-armed", "two-armed", "aligned", "redundancy", "long")


@figures.styled
def draw(results):
    """Draw the gaps of the cells, with a row of panels for each world."""
    shared = {"sharex": True, "sharey": "col"}
    figure, panels = figures.panels((len(WORLDS), len(PANELS)), (figures.TWO, 4.2), **shared)
    for (noise, group), axes in zip(product(WORLDS, PANELS), panels, strict=True):
        here = results[(results.motor_noise == noise) & (results.group == group)]
        here = here.set_index("cell")
        for cells, look in LOOKS.items():
            rows = here.loc[[*cells]].assign(place=[0, 1])
            figures.means(axes, rows, x="place", y="gap", **look)
        axes.axhline(here.gap["learner"], color=figures.GREY, linestyle="--", label="learner")
        axes.axhline(0, color=figures.GREY, linewidth=0.5)
        axes.set_xlim(-0.3, 1.3)
        axes.set_xticks([0, 1], ["fixed", "learned"])
        if noise == 0.0:
            axes.set_title("all families" if group == RANDOM else group)
        if group == RANDOM:
            axes.set_ylabel(f"gap (%), {WORLDS[noise].replace('-', ' ')}")
    figures.legend(figure, panels[0].get_legend_handles_labels()[0], 4)
    return figure


def measure(study):
    """Return the tables by name; each becomes a CSV file."""
    rows = stored(study)
    runs = measure_runs(rows)
    executions = pd.read_csv(HERE.parent / "noise" / "runs.csv.xz", low_memory=False)
    return {
        "results": tabulate(runs),
        "effects": tabulate_effects(runs),
        "claims": judge_claims(runs),
        "hands": tabulate_hands(runs, executions),
        "runs": rows,
    }


if __name__ == "__main__":
    if sys.argv[2:] == ["development"]:
        power = measure_power(measure_runs(stored(read(sys.argv[1]))))
        power.to_csv(HERE / "power.csv", float_format="%.6g")
    else:
        write_study(HERE, measure(read(sys.argv[1])) if sys.argv[1:] else {}, draw)
