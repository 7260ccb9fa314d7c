"""Compare the models with findings on people.

    coartic run studies/human/suite.toml
    PYTHONPATH=studies python studies/human/study.py results/human

File human.toml has the findings (in place of claims), the models, and the rules for verdicts. File
measures.py has the measures.
"""

import json
import re
import sys
import tomllib
from functools import cache, partial
from pathlib import Path

import numpy as np
import pandas as pd
from measures import MEASURES
from scipy import stats

from coartic import trajectory
from coartic.analysis import figures, load
from coartic.analysis.figures.style import name_rows
from coartic.analysis.statistics import holm
from coartic.estimates import Estimate
from common.writing import write_study

HERE = Path(__file__).parent
FINDINGS = tomllib.loads((HERE / "human.toml").read_text("utf-8"))
GROUPS, MODELS, FURTHER = (FINDINGS.pop(key) for key in ("groups", "models", "further"))
"""``FINDINGS`` maps ids to findings, in the order of the table. ``GROUPS`` maps names to groups of
models. ``MODELS`` and ``FURTHER`` map names to models, which are methods with their parameters:
``MODELS`` are compared with people, and ``FURTHER`` are needed for measures."""
SEARCH = "random search"
OF_TWO_ARMS = {"first movement against isolated reach", "near-tie repeats"}
"""Measures on tasks for two arms, where random search can use other hands than a model."""
LEVEL, RESAMPLES = 0.05, 9_999
VALUE_KEYS = ["measure", "model", "sample", "task"]
NOT_BEYOND = "it is not shown to exceed random search"
MIN_TASKS = 10
POWER = 0.9
EFFECTS_WITH_POWER = {
    "two-ahead learner slope norm at distance 2": "value",
    "both-directions learner slope norm at distance -1": "over_random_search",
    "horizon-grows learner rise of the slope norm at distance 2": "value",
    "serial-where-it-may learner benefit correlation": "value",
    "bends-away learner bow slope": "value",
}
"""Dict that maps each effect for which power is computed (:func:`tabulate_power`) to the column
that is tested."""
COLORS = {"agrees": figures.PALETTE[0], "undecided": "#d0d0d0", "disagrees": figures.PALETTE[3]}
MARKS = {"agrees": "+", "disagrees": "−", "undecided": "?", "silent": "·", "no cases": "·"}


def tidy(study):
    """Return the solved runs of all models, in the order of the suite.

    There is a row for each run and model. The columns are

    - ``model``: name of the model;
    - ``task``: name of the task; ``arms``, ``goals``: numbers of its arms and goals; ``best``: the
      highest reward of any run on it;
    - ``origin``: name of the task without a moved goal; ``moved``: number of the goal that was
      moved (0 for none); ``place``: y of this goal (in length units);
    - ``horizon``: parameter of a planner; None for other methods;
    - ``hands``: hand sequence; ``path``: the trajectory (:func:`coartic.trajectory`).
    """
    solved = study.runs[study.runs.status == "ok"]
    best = solved.groupby("task").reward.max()
    rows = []
    for cell in solved.drop_duplicates(["task", "method", "setting"]).itertuples():
        task = study.tasks[cell.task]
        parameters = study.declared[cell.method].defaults | json.loads(cell.parameters)
        origin, moved = re.fullmatch(r"(.+?)(?:\.goal(\d+)_.+)?", cell.task).groups()
        place = task.goals[int(moved) - 1][1] if moved else np.nan
        facts = {
            "task": cell.task, "arms": len(task.hands), "goals": cell.goals,
            "best": best[cell.task], "origin": origin, "moved": int(moved or 0), "place": place,
            "horizon": parameters.get("horizon"),
        }  # fmt: skip
        for name in models_of(task, cell.method, parameters):
            for run in study.executed(cell.task, f"{cell.method} {cell.setting}".strip()).runs:
                path = trajectory(task, run.movements)
                rows.append({"model": name, **facts, "hands": run.hands, "path": path})
    return pd.DataFrame(rows)


def models_of(task, method, parameters):
    """Return the names of the models that a method with its parameters represents on a task.

    ``parameters`` contains all parameters of the method, including defaults.
    """
    learner = f"dual-process/EC{4 if len(task.hands) > 1 else 1}"
    given = parameters | {"hands": parameters.get("hands") or ""}
    return [
        name
        for name, model in (MODELS | FURTHER).items()
        if (model["method"] or learner) == method
        and model.get("parameters", {}).items() <= given.items()
    ]


def of_control(runs, model, measure):
    """Return a measure of a model's control on tasks for two arms, by task.

    The control is random search with the hands of each of the model's runs. For measure
    ``near-tie repeats``, it is random search with every hand sequence.
    """
    if measure == "near-tie repeats":
        return MEASURES[measure][0](runs, "random search, every hand sequence")
    search = "random search by hands"
    hands = runs[(runs.model == model) & (runs.arms == 2)][["task", "hands"]]
    control = hands.merge(runs[runs.model == search], on=["task", "hands"])
    return MEASURES[measure][0](control, search)


def measure_effects(study):
    """Return the effects (:func:`tabulate_effects`), and the values from which they are computed.

    The table of values has a row for each value, with its measure, model, sample (``model`` or
    ``control``) and task.
    """
    runs, used = tidy(study), {}
    of_model = cache(lambda measure, model: MEASURES[measure][0](runs, model))

    def measured(measure, model):
        """Return the values of a model, and those of its control, by task."""
        control = of_model(measure, SEARCH)
        if model != SEARCH and measure in OF_TWO_ARMS:
            control = of_control(runs, model, measure)
        used[measure, model, "model"] = of_model(measure, model)
        used[measure, model, "control"] = control if model != SEARCH else control[:0]
        return used[measure, model, "model"], used[measure, model, "control"]

    findings = [name for name in FINDINGS if name != "body-shares"]
    effects = tabulate_effects(findings, partial(judge_test, measured))
    values = pd.concat({key: pd.DataFrame(each) for key, each in used.items()}, names=VALUE_KEYS)
    return effects, values.reset_index()


def tabulate_effects(findings, judge):
    """Return the effects: a row for each finding, model and test, in this order.

    ``judge`` is a function with the arguments model, test, level, and the reason why the model is
    silent (empty if it is not). It returns the columns of a test as a dict. The columns of the
    effects are, among others,

    - ``value``: value of the measure, with its interval; ``tasks``: number of tasks;
    - ``over_random_search``: by how much the value exceeds that of random search;
    - ``of_test``: verdict of the test; ``verdict``: verdict of the finding;
    - ``built_in``: True if the verdict follows from how the model is built;
    - ``because``: why a model is silent, or why it does not agree although its interval is beyond
      the bound.
    """
    rows = []
    for name in findings:
        finding = FINDINGS[name]
        silent, built_in = (by_model(finding.get(words, {})) for words in ("silent", "built_in"))
        level = LEVEL / len(finding["tests"])
        for model in MODELS:
            tests = [judge(model, test, level, silent.get(model, "")) for test in finding["tests"]]
            verdict = verdict_of([test["of_test"] for test in tests])
            judged = {"verdict": verdict, "built_in": built_in.get(model) == verdict}
            rows += [{"finding": name, "model": model, **test, **judged} for test in tests]
    effects = pd.DataFrame(rows)
    effects["because"] = effects.pop("because")  # the last column
    bounds = effects.bound.where(effects.duplicated(["finding", "model", "measure"]), "")
    names = effects.finding + " " + effects.model + " " + effects.measure + " " + bounds
    return effects.set_index(names.str.strip().rename("row"))


def by_model(words):
    """Return a dict that maps models to texts.

    ``words`` maps models, or groups of models (:data:`GROUPS`), to texts.
    """
    return {model: text for name, text in words.items() for model in GROUPS.get(name, [name])}


def judge_test(measured, model, test, level, silent):
    """Apply one test of a finding to a model, and return the columns of the test.

    ``measured`` is a function with the arguments measure and model. It returns the values of the
    model and of its control. ``level`` is 1 minus the coverage of the interval. ``silent`` is the
    reason why nothing follows for the model, or the empty string.
    """
    statistic = MEASURES[test["measure"]][1]
    values, control = (pd.Series(), pd.Series()) if silent else measured(test["measure"], model)
    seen, over = bootstrap([values], statistic, level), Estimate(np.nan)
    tasks = seen.n[0]
    if tasks and len(control):
        over = bootstrap([values, control], statistic, level)
    return columns_of(test, seen, over, tasks, *decide(test, seen, over, tasks, silent))


def columns_of(test, seen, over, tasks, verdict, because):
    """Return the columns of a test, as :func:`tabulate_effects` has them."""
    word = "above" if "above" in test else "below"
    return {
        "measure": test["measure"], "bound": f"{word} {test[word]:g}", **seen.columns("value"),
        "tasks": tasks, **over.columns("over_random_search"), "of_test": verdict,
        "because": because,
    }  # fmt: skip


def decide(test, seen, over, tasks, silent):
    """Return the verdict of a test, and why a model is silent or does not agree.

    The rule is the same for all models. A model agrees if its interval lies beyond the bound, and
    if its value exceeds that of random search where this is measured. With fewer than ten tasks the
    test is undecided. ``seen`` is the value, and ``over`` is this excess, both with their
    intervals. ``silent`` is the reason why nothing follows for the model, or the empty string.
    """
    side, word = (1, "above") if "above" in test else (-1, "below")
    near, far = sorted([side * seen.low, side * seen.high])
    agrees, disagrees = near > side * test[word], far < side * test.get("disagree", test[word])
    if not tasks:
        return "silent" if silent else "no cases", silent
    if tasks < MIN_TASKS or agrees == disagrees:
        return "undecided", silent
    if agrees and min(side * over.low, side * over.high) <= 0:
        return "undecided", NOT_BEYOND
    return "agrees" if agrees else "disagrees", silent


def bootstrap(sides, statistic, level):
    """Return an estimate: a statistic of all tasks, with its interval for other tasks.

    ``sides`` is a list of one or two tables of values, indexed by task. With two tables, the result
    is the statistic of the first minus that of the second, on the tasks that both contain.
    ``level`` is 1 minus the coverage of the interval.

    The ends of the interval are percentiles of resamples of tasks. The interval is widened by
    √(k / (k − 1)) for k tasks, because resamples underestimate the spread by this factor. The value
    is NaN without tasks. There is no interval with a single task.
    """
    value, count, values = resampled(sides, statistic)
    if count < 2:
        return Estimate(value, n=(count,))
    return Estimate(value, *np.quantile(values, [level / 2, 1 - level / 2]), n=(count,))


def resampled(sides, statistic):
    """Return a statistic of all tasks, the number k of tasks, and resampled statistics.

    The distances of the resampled statistics from the statistic of all tasks are multiplied by
    √(k / (k − 1)). With fewer than two tasks there are no resamples (:func:`bootstrap`).
    """
    tasks = [task for task in sides[0].index.unique() if all(task in side.index for side in sides)]
    rows = [[pd.DataFrame(side).loc[[task]].to_numpy() for task in tasks] for side in sides]
    count = len(tasks)

    def difference(drawn):
        first, *second = (statistic(np.concatenate([side[k] for k in drawn])) for side in rows)
        return first - sum(second)

    value = difference(range(count)) if count else np.nan
    if count < 2:
        return value, count, np.empty(0)
    drawn = np.random.default_rng(0).integers(count, size=(RESAMPLES, count))
    different, which = np.unique(drawn, axis=0, return_inverse=True)
    values = np.array([*map(difference, different)])[which.ravel()]
    return value, count, value + (values - value) * np.sqrt(count / (count - 1))


def verdict_of(tests):
    """Return the verdict of a finding from the verdicts of its tests.

    If all tests have the same verdict, it is this verdict. Otherwise it is ``disagrees`` if a test
    has this verdict, or else ``no cases`` if a test has this verdict, or else ``undecided``.
    """
    if len(set(tests)) == 1:
        return tests[0]
    return next((kind for kind in ("disagrees", "no cases") if kind in tests), "undecided")


def p_of_side(values, bound, side):
    """Return the two-sided p of the test that a statistic lies beyond a bound.

    ``side`` is 1 for above and -1 for below. ``values`` contains the resampled statistics.
    """
    return min(1.0, 2 * (1 + (side * (values - bound) <= 0).sum()) / (1 + len(values)))


def p_of_test(row, test, values):
    """Return p of the verdict of a test.

    Agreement needs two tests: that the value is beyond the bound, and that it exceeds random
    search. Its p is the larger of the two. ``row`` is the row of the effect, and ``values`` maps
    ``model`` and ``control`` to tables of values, indexed by task.
    """
    side, word = (1, "above") if "above" in test else (-1, "below")
    if row.finding == "body-shares":  # only its intervals are stored
        z = stats.norm.ppf(1 - LEVEL / len(FINDINGS["body-shares"]["tests"]) / 2)
        p = 0.0
        for name, bound in (("value", test[word]), ("over_random_search", 0)):
            width = row[f"{name}_high"] - row[f"{name}_low"]
            if width > 0:
                p = max(p, 2 * stats.norm.sf(abs(row[name] - bound) * 2 * z / width))
        return p
    statistic = MEASURES[test["measure"]][1]
    sides = [values[sample] for sample in ("model", "control") if len(values[sample])]
    seen = resampled(sides[:1], statistic)[2]
    if row.of_test == "disagrees":
        return p_of_side(seen, test.get("disagree", test[word]), -side)
    p = p_of_side(seen, test[word], side)
    return max(p, p_of_side(resampled(sides, statistic)[2], 0, side)) if len(sides) > 1 else p


def correct(effects, values):
    """Return the verdicts of models on findings, corrected over all verdicts (Holm).

    There is a row for each pair of a finding and a model. Its columns are, among others, ``tasks``,
    the ``uncorrected`` verdict, its p-value (``p``), the Holm-adjusted p-value (``p_holm``), and
    the corrected ``verdict``. Tests of one finding are corrected by
    Bonferroni, as their intervals are. Verdicts that follow from how a model is built are not
    changed. ``values`` is table ``runs``.
    """
    rows = {}
    for (finding, model), tests in effects.groupby(["finding", "model"], sort=False):
        kind, built_in = tests.verdict.iloc[0], bool(tests.built_in.iloc[0])
        p = []
        for (_, row), test in zip(tests.iterrows(), FINDINGS[finding]["tests"], strict=True):
            if row.of_test == kind and kind in ("agrees", "disagrees") and not built_in:
                of = values[(values.index == test["measure"]) & (values.model == model)]
                samples = {
                    name: of[of["sample"] == name]
                    .set_index("task")
                    .drop(columns=["model", "sample"])
                    for name in ("model", "control")
                }
                samples = {name: side.dropna(axis=1, how="all") for name, side in samples.items()}
                p.append(p_of_test(row, test, samples))
        made = not built_in and kind in ("agrees", "disagrees", "undecided")
        rows[f"{finding} {model}"] = {
            "finding": finding, "model": model, "tasks": tests.tasks.min(), "uncorrected": kind,
            "built_in": built_in, "judged": made and tests.tasks.min() > 0,
            "p": len(tests) * (max if kind == "agrees" else min)(p) if p else np.nan,
        }  # fmt: skip
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("row")
    table["p_holm"] = holm(table.p.clip(upper=1), int(table.judged.sum()))
    open_ = table.p_holm >= LEVEL
    return table.assign(verdict=table.uncorrected.mask(open_, "undecided"))


def tabulate(verdicts):
    """Tabulate the verdicts of models on findings.

    A star marks verdicts that follow from how the model is built.
    """
    cells = verdicts.set_index(["finding", "model"])
    words = cells.verdict + cells.built_in.map({True: " *", False: ""})
    table = pd.DataFrame({name: words[:, name] for name in MODELS}).add_prefix("of ")
    table = table.loc[verdicts.finding.unique()]
    table.insert(0, "finding", [FINDINGS[name]["statement"] for name in table.index])
    return table.rename_axis("row")


def separating(table):
    """Return the rows of table ``results`` that separate models.

    In such a row, the verdicts of the models differ, and at least one of them is ``agrees`` or
    ``disagrees`` and does not follow from how its model is built.
    """
    models = table.drop(columns="finding")
    decided = models.isin(["agrees", "disagrees"]).any(axis=1)
    differ = models.ne(models.iloc[:, 0], axis=0).any(axis=1)
    return models[decided & differ]


@figures.styled
def draw(table):
    """Draw the number of findings by model and verdict, and the rows that separate models.

    Bars of findings with which a model disagrees go to the left. Marks of verdicts that follow from
    how the model is built are in brackets.
    """
    figure, (bars, marks) = figures.panels((1, 2), (figures.TWO, 3.4), sharey=True)
    models = table.drop(columns="finding").rename(columns=lambda name: name.removeprefix("of "))
    plain = models.apply(lambda verdicts: verdicts.str.removesuffix(" *"))
    counts = {verdict: (plain == verdict).sum() for verdict in COLORS}
    starts = {"undecided": counts["agrees"], "disagrees": -counts["disagrees"]}
    for verdict, color in COLORS.items():
        bar = bars.barh(-np.arange(len(counts[verdict])), counts[verdict], height=0.7, color=color,
                        left=starts.get(verdict, 0), label=verdict)  # fmt: skip
        labels = [count or "" for count in counts[verdict]]
        ink = "black" if verdict == "undecided" else "white"
        bars.bar_label(bar, labels, label_type="center", color=ink)
    bars.axvline(0, color="black", linewidth=0.6)
    bars.set_xticks([])
    bars.set_xlabel("number of findings")
    rows = separating(table)
    for (x, y), verdict in np.ndenumerate(rows):
        kind = verdict.removesuffix(" *")
        color = figures.GREY if kind == "undecided" else COLORS.get(kind, figures.GREY)
        mark = f"({MARKS[kind]})" if kind != verdict else MARKS[kind]
        marks.text(x, -y, mark, color=color, ha="center", va="center", fontsize=11)
    marks.set_xlim(-0.6, len(rows) - 0.4)
    marks.set_xticks(range(len(rows)), rows.index.str.replace("-", "\n"))
    for axes in (bars, marks):
        axes.xaxis.set_label_position("top")
        axes.xaxis.tick_top()
        axes.spines[:].set_visible(False)
        axes.tick_params(length=0)
    name_rows(bars, [*models])
    figures.legend(figure, bars.get_legend_handles_labels()[0], 3)
    return figure


def measure(study):
    """Return the tables by name; each becomes a CSV file.

    Table ``runs`` has values by task. The verdicts include those on finding body-shares.
    """
    effects, values = measure_effects(study)
    values = values.set_index("measure")
    return {**judge_all(effects, values), "effects": effects, "runs": values}


def judge_all(effects, values):
    """Return the tables of verdicts by name, including verdicts on finding body-shares."""
    body = pd.read_csv(HERE / "body.csv", index_col=0)
    verdicts = correct(pd.concat([effects, body]), values)
    same = on_the_same_tasks(values, "slope norm at distance 2", "all goals ahead")
    power = tabulate_power(effects, int(verdicts.judged.sum()))
    return {"results": tabulate(verdicts), "verdicts": verdicts, "same": same, "power": power}


def tabulate_power(effects, judged):
    """Return the smallest effects that a test finds with 90 % power.

    There is a row for each effect in :data:`EFFECTS_WITH_POWER`. The columns are

    - ``least``: smallest effect without the correction over verdicts;
    - ``least_corrected``: smallest effect with the correction over ``judged`` verdicts, as for the
      smallest p-value;
    - ``larger``: the fraction by which the correction increases the distance of the smallest effect
      from the bound.
    """
    rows, of_power = {}, stats.norm.ppf(POWER)
    for name, column in EFFECTS_WITH_POWER.items():
        of = effects.loc[name]
        tests = ((effects.finding == of.finding) & (effects.model == of.model)).sum()
        bound = abs(float(of.bound.split()[1])) if column == "value" else 0.0
        single, corrected = (
            stats.norm.ppf(1 - LEVEL / tests / verdicts / 2) for verdicts in (1, judged)
        )
        error = (of[f"{column}_high"] - of[f"{column}_low"]) / (2 * single)
        rows[name] = {
            "least": bound + (single + of_power) * error,
            "least_corrected": bound + (corrected + of_power) * error,
            "larger": (corrected + of_power) / (single + of_power) - 1,
        }
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("row")


def on_the_same_tasks(values, measure, model):
    """Return a measure of each model on the tasks on which ``model`` has values of it.

    Models without a value on one of these tasks are left out.
    """
    of = values[(values.index == measure) & (values["sample"] == "model")]
    tasks = of.task[of.model == model].unique()
    rows = {}
    for name, of_model in of[of.task.isin(tasks)].groupby("model", sort=False):
        side = of_model.set_index("task").drop(columns=["model", "sample"])
        found = bootstrap([side.dropna(axis=1, how="all")], MEASURES[measure][1], LEVEL)
        if found.n == (len(tasks),):
            rows[name] = {"tasks": len(tasks), **found.columns("value")}
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("model")


if __name__ == "__main__":
    if sys.argv[1:]:
        tables = measure(load(sys.argv[1]))
    else:
        stored = [pd.read_csv(HERE / name, index_col=0) for name in ("effects.csv", "runs.csv.xz")]
        tables = judge_all(*stored)
    write_study(HERE, tables, draw)
