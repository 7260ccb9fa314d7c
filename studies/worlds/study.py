"""Measure in which worlds six findings hold.

    PYTHONPATH=studies python studies/worlds/protocols.py results/worlds
    PYTHONPATH=studies python studies/worlds/study.py results/worlds

The findings are in claims.toml with the answers that were expected. Against a finding in a world
is a mean over tasks on the other side of 0 (reversed). No verdict (open) is neither.

Rules, committed before the runs:

- A cell is a claim in a family in a world. Its value is a mean over tasks; each task has the mean
  of its runs. Ticks of a run are those of its solution, in noise the mean of 100 executions of its
  answer. They are divided by the ticks of the corrective process with its best hands in this world.
- A failed run counts as the worst run of any method on its task in this world. A task without the
  corrective process, or without a run that counts, is dropped. For signatures, failed runs and runs
  without the signature are dropped. A lean needs what :func:`coartic.analysis.lean` says; a pair
  without the lean of each method of the claim is dropped. All of these are counted.
- Each cell has two one-tailed bootstrap tests over tasks, of the claim and of its opposite, each
  corrected over all cells of the claim (Holm), with all tasks and without the task that favours
  the tested side most. *holds* and *reversed* need p < 0.05 both times; but where either p is above
  0.01 and the skewness of the tasks is beyond 2 on either side, the cell is open, because the test
  rejects too often there.
- The paper's tasks have no verdict; intervals are over runs. Hill climbing, and 100,000 trials at
  radius 0.02, are described in the same way, over tasks.
- Control: random search with other seeds takes the learner's place in the paper's world. Claims
  about gain, first movement and lean, corrected over families, may hold in some family in at most
  10 of 100 sets of seeds. (A set has one run on a random task, not three.)

The matrix was first made when eight worlds had one run on a random task. Column ``first_verdict``
is made of the same runs. Where a world lacks some of the further runs, none of them counts.
"""

import sys
import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.lines import Line2D
from protocols import LEARNERS
from scipy import stats
from settings import (
    CONTROL,
    CONTROL_OF_PAIRS,
    CONTROL_SETS,
    CONTROL_SETS_OF_PAIRS,
    FAMILIES,
    FULL_AT_FIRST,
    LONG,
    RUNS,
    RUNS_OF_PAIRS,
    WORLDS,
)

from coartic.analysis import TwoContexts, figures, load, mean, means
from coartic.analysis.statistics import holm
from coartic.estimates import LEVEL, Estimate, difference_of_means
from common.judging import level_of, tests_over_tasks, two_sided_tests
from common.writing import write_study

HERE = Path(__file__).parent
CLAIMS = tomllib.loads((HERE / "claims.toml").read_text("utf-8"))
LEARNER, RANDOM, GRADIENT, CMA = "learner", "random-search", "policy-gradient", "cma-es/bandit"
CLIMBING = "hill-climbing"
BETTER = {
    "learner-gains": (RANDOM, LEARNER),
    "cma-es-ahead": (LEARNER, CMA),
    "policy-gradient-ahead": (LEARNER, GRADIENT),
    "hill-climbing-ahead": (LEARNER, CLIMBING),
}
"""Dict that maps each comparison of ticks to two methods: the one that is expected to need more
ticks, and the one that is expected to need fewer. The last comparison is only described, and is not
a claim."""
SHARED = ("ascending", "descending")
PARTS = ("all", "base", "joints")


def base_name(task):
    """Return the name of the task from which a task with another radius is made.

    For ``one-armed-i200-radius-0.02`` it is ``one-armed/v1/i200``. The name of a task with the
    original radius is returned unchanged.
    """
    name = task.partition("-radius-")[0]
    family, _, number = name.rpartition("-")
    is_instance = family in FAMILIES and not number.isdecimal()
    return f"{family}/v1/{number}" if is_instance else name


def of_world(world, study):
    """Return a table of the runs of a world, and the table of :func:`leans_of`.

    The table of runs leaves out tasks whose names end in ``-goal`` or ``-back``, which only
    :func:`leans_of` needs. Its columns are

    - ``world``, ``task``, ``method``, ``run``, ``seed``, ``status`` and ``hands``;
    - ``group``: the family, or the task of the paper;
    - ``ticks``: ticks of the solution; missing if the run failed;
    - ``alone``: ticks of the corrective process with its best hands;
    - ``first``: ticks by which the first movement is longer than in the corrective process with the
      same hands.
    """
    runs = study.runs
    method = runs.method.where(~runs.method.str.startswith("dual-process"), LEARNER)
    task = runs.task.map(base_name)
    table = pd.DataFrame(
        {
            "world": world, "group": task.str.partition("/")[0], "task": task, "method": method,
            "run": runs.run, "seed": runs.seed, "status": runs.status, "ticks": -runs.value,
            "alone": -runs.task.map(study.corrective_best), "hands": runs.hands,
        }
    )  # fmt: skip
    is_pair = runs.task.str.endswith(("-goal", "-back")).to_numpy()
    compared = [
        study.signature("first", *cell)
        for cell in study.cells
        if cell[1] in (*LEARNERS, RANDOM) and not cell[0].endswith(("-goal", "-back"))
    ]
    table["first"] = pd.concat(compared).reindex(runs.index).to_numpy(np.float64)
    table = table.set_index(runs.run_id.to_numpy()).rename_axis("run_id")
    return table[~is_pair], leans_of(world, study)


def read(folder):
    """Return the study of a folder, without best known rewards.

    This study needs no gaps. In a world with noise, each best known reward would be computed from a
    thousand executions.
    """
    study = load(folder)
    vars(study)["optima"] = {}
    return study


def leans_of(world, study):
    """Return the leans of the learner EC1 and of random search, by pair of tasks and part.

    The lean is measured at the first goal, which the tasks of a pair share.
    """
    names, rows = {base_name(name): name for name in study.tasks}, []
    numbers = [name.removesuffix("-goal") for name in names if name.endswith("-goal")]
    pairs = {number: (f"{number}-goal", f"{number}-back") for number in numbers}
    if {*SHARED} <= {*names}:
        pairs = {SHARED[0]: tuple(names[name] for name in SHARED), **pairs}
    for pair, tasks in pairs.items():
        for method in ("dual-process/EC1", RANDOM):
            if any((task, method) not in study.cells for task in tasks):
                continue
            both = [study.executed(task, method) for task in tasks]
            asked = sum(len(study.cells[task, method]) for task in tasks)
            for part in PARTS:
                found = lean_of(*both, part)
                rows.append(
                    {
                        "world": world, "pair": pair, "part": part,
                        "method": LEARNER if method != RANDOM else RANDOM,
                        **found.columns("lean"), "asked": asked,
                        "failed": asked - sum(len(each.runs) for each in both),
                    }
                )  # fmt: skip
    return pd.DataFrame(rows)


def lean_of(first, second, part):
    """Return the lean at goal 1 of runs on two tasks, in per cent; NaN if it is not defined."""
    if not (first.runs and second.runs):
        return Estimate(np.nan)
    contexts = TwoContexts(first, second, 1, "right", part=part)
    if not contexts.in_both:
        return Estimate(np.nan)
    lean = contexts.lean.more
    return Estimate(100 * lean.value, 100 * lean.low, 100 * lean.high, n=lean.n)


def with_failures(runs):
    """Return runs in which each failed run has the ticks of the worst run.

    The worst run is that with the most ticks on the same task in the same world, of any method in
    ``runs``. Column ``failed`` is True for failed runs.
    """
    worst = runs.groupby(["world", "task"]).ticks.transform("max")
    return runs.assign(failed=runs.ticks.isna(), ticks=runs.ticks.fillna(worst))


def shares(runs, claim):
    """Return the contribution of each run to the value of a claim.

    The contribution is in per cent of the ticks of the corrective process. Its sign is changed for
    runs of the method that is subtracted.
    """
    sign = np.where(runs.method == (BETTER[claim][0] if claim in BETTER else LEARNER), 1, -1)
    value = runs.ticks if claim in BETTER else runs["first"]
    return sign * 100 * value / runs.alone


def values_of(runs, claim):
    """Return the value of a claim for each task, with counts of runs.

    The index consists of world, group and task. ``value`` is NaN if the task is dropped. ``runs``
    and ``failed`` are the numbers of runs and of failed runs. ``lost`` is the number of runs that
    failed or, for a signature, do not have it.
    """
    methods = BETTER.get(claim, (LEARNER, RANDOM))
    used = with_failures(runs)
    used = used[used.method.isin(methods)]
    used = used.assign(share=shares(used, claim))
    keys = ["world", "group", "task"]
    by_method = used.pivot_table("share", keys, "method", dropna=False)
    lost = used.failed if claim in BETTER else used.share.isna()
    counts = used.assign(lost=lost).groupby(keys, sort=False).agg(
        runs=("failed", "size"), failed=("failed", "sum"), lost=("lost", "sum")
    )  # fmt: skip
    return counts.assign(value=by_method[[*methods]].sum(axis=1, min_count=2).reindex(counts.index))


def values_of_pairs(leans, claim):
    """Return the value of a claim for each pair of tasks, in the form of :func:`values_of`."""
    part = "joints" if claim == "joints-lean" else "all"
    used = leans[leans.part == part]
    table = used.pivot_table("lean", ["world", "pair"], "method", dropna=False)
    value = table[LEARNER] - (table[RANDOM] if claim == "learner-leans" else 0.0)
    which = used if claim == "learner-leans" else used[used.method == LEARNER]
    counts = which.groupby(["world", "pair"]).agg(runs=("asked", "sum"), failed=("failed", "sum"))
    found = counts.assign(lost=counts.failed, value=value.reindex(counts.index)).reset_index()
    group = np.where(found.pair == SHARED[0], SHARED[0], "one-armed")
    return found.assign(group=group).rename(columns={"pair": "task"}).set_index(
        ["world", "group", "task"]
    )  # fmt: skip


def verdicts(cells):
    """Judge the cells of a claim.

    ``cells`` is a dict that maps each cell to its values, one for each task. The result is a table
    with a row for each cell and the columns

    - ``p``, ``opposite_p``: Holm-adjusted p-values of the claim and of its opposite;
    - ``p_without``, ``opposite_p_without``: the same without the task that favours the tested side
      most;
    - ``skewness``: skewness of the values;
    - ``all_tasks``, ``without``: verdicts from the p-values with and without this task;
    - ``verdict``: the verdict that both give if the p-values are below :func:`.level_of`, otherwise
      ``open``.
    """
    values, columns = [np.asarray(each, float) for each in cells.values()], {}
    for sign, name in ((1, "p"), (-1, "opposite_p")):
        tests = [tests_over_tasks(sign * each, 0.0) for each in values]
        for number, suffix in enumerate(("", "_without")):
            columns[name + suffix] = np.array(holm([pair[number].p for pair in tests], len(cells)))
    columns["skewness"] = [stats.skew(each) if np.ptp(each) else 0.0 for each in values]
    means, levels = (np.array([of(each) for each in values]) for of in (np.mean, level_of))
    sure = []
    for name, suffix in (("all_tasks", ""), ("without", "_without")):
        p, opposite_p = columns["p" + suffix], columns["opposite_p" + suffix]
        sides = (means > 0) & (p < LEVEL), (means < 0) & (opposite_p < LEVEL)
        columns[name] = np.select(sides, ["holds", "reversed"], "open")
        sure.append(np.where(means > 0, p, opposite_p))
    is_sure = (columns["all_tasks"] == columns["without"]) & (np.fmax(*sure) < levels)
    columns["verdict"] = np.where(is_sure, columns["all_tasks"], "open")
    return pd.DataFrame(columns, index=[*cells])


def two_tailed_verdicts(cells):
    """Return the verdicts that two-tailed tests would give: a description, not registered."""
    tests = two_sided_tests(cells)
    verdicts = np.where(tests["mean"] > 0, "holds", "reversed")
    return pd.Series(np.where(tests.differs, verdicts, "open"), tests.index)


EXPECTED = {"h": "holds", "r": "reversed", "o": "open"}


def tabulate(runs, leans):
    """Return the matrix, with a row for each claim, world and group.

    A group is a family with values for at least three tasks, or a task of the paper.
    """
    rows, by_task = [], dict([*runs.groupby(["world", "task"], sort=False)])
    for claim in CLAIMS:
        found = (values_of_pairs(leans, claim) if claim.endswith(("leans", "lean"))
                 else values_of(runs[runs.world != LONG.name], claim))  # fmt: skip
        cells, counted = {}, {}
        for (world, group), of_cell in found.groupby(["world", "group"], sort=False):
            values = of_cell.value.dropna()
            row = {"claim": claim, "world": world, "group": group, "tasks": len(values),
                   "dropped": len(of_cell) - len(values)}  # fmt: skip
            row |= {name: int(of_cell[name].sum()) for name in ("runs", "failed", "lost")}
            if group in FAMILIES and len(values) >= 3:
                cells[world, group], counted[world, group] = values.to_numpy(float), row
            elif group not in FAMILIES:
                rows.append(row | of_paper(claim, (world, group), by_task, leans).columns("value"))
        judged = verdicts(cells).assign(verdict_two_tailed=two_tailed_verdicts(cells))
        for key, row in counted.items():
            answer = CLAIMS[claim]["expected"][key[0]][FAMILIES.index(key[1])]
            values = cells[key]
            row |= mean(values).columns("value") | {"median": float(np.median(values))}
            rows.append(row | judged.loc[[key]].iloc[0].to_dict() | {"expected": EXPECTED[answer]})
    table = pd.DataFrame(rows)
    order = {name: number for number, name in enumerate(WORLDS)}
    table["at"] = table.world.map(order)
    table["nth"] = table.claim.map([*CLAIMS].index)
    table = table.sort_values(["nth", "at"], kind="stable").drop(columns=["at", "nth"])
    return table.set_index((table.claim + " " + table.world + " " + table.group).rename("row"))


def of_paper(claim, key, by_task, leans):
    """Return a claim's value in a world on a task of the paper, with its interval over runs.

    ``by_task`` contains the runs by ``key``, the world and the task.

    The interval of a difference of two leans is computed from the intervals of both, by the method
    of Zou and Donner (2008).
    """
    if claim.endswith(("leans", "lean")):
        part = "joints" if claim == "joints-lean" else "all"
        world, pair = key
        mine = leans[(leans.world == world) & (leans.pair == pair) & (leans.part == part)]
        mine = mine.set_index("method")
        one = mine.loc[LEARNER]
        if claim == "joints-lean":
            return Estimate(one.lean, one.lean_low, one.lean_high)
        other = mine.loc[RANDOM]
        value = one.lean - other.lean
        down = np.hypot(one.lean - one.lean_low, other.lean_high - other.lean)
        up = np.hypot(one.lean_high - one.lean, other.lean - other.lean_low)
        return Estimate(value, value - down, value + up)
    used = with_failures(by_task[key])
    used = used.assign(share=shares(used, claim)).dropna(subset="share")
    first, second = BETTER.get(claim, (LEARNER, RANDOM))
    return difference_of_means(
        used.share[used.method == first], -used.share[used.method == second]
    )  # fmt: skip


def control_values(study, runs):
    """Return the values of claims with control runs in place of the learner's runs.

    Control runs are runs of random search with other seeds, which are divided into sets. The
    columns are ``set``, ``claim``, ``group``, ``task`` and ``value``.
    """
    controls, _ = of_world("paper", study)
    controls = controls.assign(set=controls.run - RUNS["families"] + 1, method=LEARNER)
    rivals = runs[(runs.world == "paper") & (runs.method == RANDOM) & runs.group.isin(FAMILIES)]
    parts = []
    for number, of_set in controls[controls.set.between(1, CONTROL_SETS)].groupby("set"):
        both = pd.concat([of_set.drop(columns="set"), rivals])
        for claim in ("learner-gains", "first-movement-slower"):
            found = values_of(both, claim).reset_index()
            parts.append(found.assign(set=number, claim=claim))
    return pd.concat(parts)[["set", "claim", "group", "task", "value"]]


def control_values_of_pairs(study, leans):
    """Return the table of :func:`control_values` for the claim on leans, by pair of tasks."""
    theirs = leans[(leans.world == "paper") & (leans.part == "all") & (leans.method == RANDOM)]
    theirs, rows = theirs.set_index("pair").lean, []
    runs = study.runs.set_index("run_id").run
    for pair in [name for name in theirs.index if name != SHARED[0]]:
        both = [study.executed(f"{pair}-{kind}", RANDOM) for kind in ("goal", "back")]
        for number in range(1, CONTROL_SETS_OF_PAIRS + 1):
            of_set = [some(each, number, runs) for each in both]
            value = lean_of(*of_set, "all").value - theirs[pair]
            rows.append({"set": number, "claim": "learner-leans", "group": "one-armed",
                         "task": pair, "value": value})  # fmt: skip
    return pd.DataFrame(rows)


def some(solutions, number, runs):
    """Return those of the ``solutions`` of control runs that belong to one set."""
    of_set = [runs[name] // RUNS_OF_PAIRS == number for name in solutions.run_ids]
    keep = [run for run, wanted in zip(solutions.runs, of_set, strict=True) if wanted]
    return type(solutions)(solutions.task, solutions.label, tuple(keep), model=solutions.model)


def judge_control(values):
    """Count the sets of control runs in which a claim holds, or is reversed, in some family.

    There is a row for each claim. ``bound`` is the registered bound of the share of sets.
    """
    rows = []
    for (claim, number), of_set in values.groupby(["claim", "set"], sort=False):
        cells = {group: each.value.dropna().to_numpy(float)
                 for group, each in of_set.groupby("group", sort=False)}  # fmt: skip
        found = verdicts(cells).verdict
        rows.append({"claim": claim, "set": number, "holds": (found == "holds").any(),
                     "reversed": (found == "reversed").any()})  # fmt: skip
    table = pd.DataFrame(rows)
    counts = table.groupby("claim", sort=False)[["holds", "reversed"]].sum().astype(int)
    return counts.assign(sets=table.groupby("claim", sort=False).size(), bound=0.1)


LABELS = {
    "learner-gains": "learner saves more ticks than random search (%)",
    "cma-es-ahead": "CMA-ES takes fewer ticks than the learner (%)",
    "policy-gradient-ahead": "policy gradient takes fewer ticks than the learner (%)",
    "first-movement-slower": "learner's first movement slower than random search's (%)",
    "learner-leans": "learner leans more than random search (points of lean)",
    "joints-lean": "learner's joints lean (points of lean)",
}
"""Titles of panels."""


def legend_line(label, **look):
    """Return an entry of a legend: a mark with its label."""
    return Line2D([], [], label=label, linestyle="", marker="o", **look)


SHOWN = [
    *("paper", "maximum", "noise-0.01", "base-0.25", "base-0.5", "base-2", "base-4"),
    *("radius-0.02", "radius-0.05", "radius-0.3"),
]
"""Worlds in the order in which the figure shows them; they ran in another."""


@figures.styled
def draw(table):
    """Draw the matrix: the estimate and the interval of each cell that is not open."""
    worlds = [name for name in sorted(WORLDS, key=SHOWN.index) if (table.world == name).any()]
    figure, panels = figures.panels((len(CLAIMS), 1), (figures.TWO, 7.6), sharex=True)
    for axes, claim in zip(panels, CLAIMS, strict=True):
        cells = table[(table.claim == claim) & table.verdict.isin(["holds", "reversed"])]
        axes.axhline(0, color=figures.GREY, linewidth=0.6)
        for number, family in enumerate(FAMILIES):
            of_family = cells[cells.group == family]
            shift = 0.24 * (number - 1) if claim not in ("learner-leans", "joints-lean") else 0.0
            places = of_family.assign(place=of_family.world.map(worlds.index) + shift)
            for verdict, rows in places.groupby("verdict"):
                face = figures.PALETTE[number] if verdict == "holds" else "white"
                figures.means(axes, rows, x="place", y="value", color=figures.PALETTE[number],
                              linestyle="", marker="o", markerfacecolor=face)  # fmt: skip
        for place in range(1, len(worlds)):
            axes.axvline(place - 0.5, color=figures.GREY, linewidth=0.2)
        axes.set(xlim=(-0.5, len(worlds) - 0.5))
        axes.set_title(LABELS[claim], loc="left")
        if cells.empty:
            axes.set(ylim=(-1, 1), yticks=[0])
    titles = [WORLDS[name].title.replace(" ", "\n", 1) for name in worlds]
    panels[-1].set_xticks(range(len(worlds)), titles)
    handles = [
        legend_line(family, color=figures.PALETTE[number]) for number, family in enumerate(FAMILIES)
    ]
    handles.append(legend_line("opposite holds", color=figures.GREY, markerfacecolor="white"))
    figures.legend(figure, handles, 4)
    return figure


def describe(runs):
    """Return the mean values of comparisons without a verdict, over the random tasks of a family.

    They are the comparison with hill climbing in all worlds, and at radius 0.02, after 100,000
    trials, the comparisons of the methods that were run.
    """
    parts = []
    for claim in (*BETTER, "first-movement-slower"):
        wanted = (runs.world == LONG.name) | (claim == "hill-climbing-ahead")
        used = runs[wanted & runs.group.isin(FAMILIES)]
        both = {*BETTER.get(claim, (LEARNER, RANDOM))}
        methods = used.groupby("world", sort=False).method.agg(set)
        used = used[used.world.isin(methods.index[[both <= each for each in methods]])]
        if not used.empty:
            parts.append(values_of(used, claim).reset_index().assign(claim=claim))
    table = means(pd.concat(parts), ["claim", "world", "group"], ["value"])
    table = table.rename(columns={"rows": "tasks"})
    return table.set_index((table.claim + " " + table.world + " " + table.group).rename("row"))


def of_whole_worlds(runs):
    """Return runs without the incomplete further runs on random tasks.

    Further runs are those after run 0. They are left out in each world that lacks some of them.
    """
    further = runs.group.isin(FAMILIES) & (runs.world != LONG.name) & (runs.run > 0)
    counted = runs[runs.group.isin(FAMILIES) & runs.method.isin([LEARNER, RANDOM, GRADIENT])]
    least = counted.groupby(["world", "task", "method"]).size().groupby("world").min()
    return runs[~further | runs.world.map(least >= RUNS["families"])]


def first_verdicts(runs, leans):
    """Return the verdicts on random tasks that follow from the runs of the first matrix."""
    runs = runs[((runs.run == 0) | runs.world.isin(FULL_AT_FIRST)) & (runs.method != CLIMBING)]
    return tabulate(runs[runs.group.isin(FAMILIES)], leans[leans.pair != SHARED[0]]).verdict


def measure(folder):
    """Return the tables of a results folder by name; each becomes a CSV file."""
    found = [of_world(name, read(folder / name)) for name in (*WORLDS, LONG.name)
             if (folder / name).is_dir()]  # fmt: skip
    runs, leans = (pd.concat(parts) for parts in zip(*found, strict=True))
    runs = of_whole_worlds(runs)
    results = tabulate(runs, leans)
    tables = {"results": results.assign(first_verdict=first_verdicts(runs, leans)), "runs": runs,
              "leans": leans.set_index(["world", "pair", "part", "method"])}  # fmt: skip
    if runs.method.eq(CLIMBING).any() or runs.world.eq(LONG.name).any():
        tables["described"] = describe(runs)
    values = []
    if (folder / CONTROL).is_dir():
        values.append(control_values(read(folder / CONTROL), runs))
    if (folder / CONTROL_OF_PAIRS).is_dir():
        values.append(control_values_of_pairs(read(folder / CONTROL_OF_PAIRS), leans))
    if values:
        tables["control_values"] = pd.concat(values).set_index("set")
        tables["control"] = judge_control(pd.concat(values))
    return tables


if __name__ == "__main__":
    write_study(HERE, measure(Path(sys.argv[1])) if sys.argv[1:] else {}, draw)
