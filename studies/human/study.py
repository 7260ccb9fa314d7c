"""Do the models behave like people?

    coartic run studies/human/suite.toml
    PYTHONPATH=studies python studies/human/study.py results/human

human.toml has the findings, in place of claims, the models and how verdicts are made; measures.py
what is measured.
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

from coartic import trajectory
from coartic.analysis import figures, load
from coartic.estimates import Estimate
from common.writing import write_study

HERE = Path(__file__).parent
FINDINGS = tomllib.loads((HERE / "human.toml").read_text("utf-8"))
GROUPS, MODELS, FURTHER = (FINDINGS.pop(key) for key in ("groups", "models", "further"))
"""The findings by id, in the order of the table; groups of models by name; models that are compared
with people, and further ones that measures need, by name: methods with their parameters."""
SEARCH = "random search"
OF_TWO_ARMS = {"first movement against isolated reach", "near-tie repeats"}
"""Measures on tasks for two arms, where random search can have other hands than a model."""
LEVEL, RESAMPLES = 0.05, 9_999
VALUE_KEYS = ["measure", "model", "sample", "task"]
NOT_BEYOND = "it is not shown to exceed random search"
FEWEST_TASKS = 10
MARKS = {
    "agrees": ("+", figures.PALETTE[0]), "disagrees": ("−", figures.PALETTE[3]),
    "undecided": ("?", figures.GREY), "silent": ("·", figures.GREY), "no cases": ("", figures.GREY),
}  # fmt: skip


def tidy(study):
    """The solved runs of all models, a row each, in the order of the suite.

    ``model``; ``task`` with its ``arms`` and ``goals`` (their numbers) and its ``best`` reward of
    any run; ``moved``, the number of the goal that was moved, to ``place`` (its y, length unit) in
    the task ``origin``, or 0; the planner's ``horizon``; ``hands``; ``path``, the movement tick by
    tick.
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
    """Return the names of the models whose runs of a task are those of a method with all its
    ``parameters``, defaults included."""
    learner = f"dual-process/EC{4 if len(task.hands) > 1 else 1}"
    given = parameters | {"hands": parameters.get("hands") or ""}
    return [
        name
        for name, model in (MODELS | FURTHER).items()
        if (model["method"] or learner) == method
        and model.get("parameters", {}).items() <= given.items()
    ]


def of_control(runs, model, measure):
    """Return a measure of two arms by task for the control of a model: random search with the hands
    of each of its runs; of the choice of hands, random search with every hand sequence."""
    if measure == "near-tie repeats":
        return MEASURES[measure][0](runs, "random search, every hand sequence")
    search = "random search by hands"
    hands = runs[(runs.model == model) & (runs.arms == 2)][["task", "hands"]]
    control = hands.merge(runs[runs.model == search], on=["task", "hands"])
    return MEASURES[measure][0](control, search)


def measure_effects(study):
    """Return the effects (:func:`tabulate_effects`), and the values that they are statistics of, by
    measure, model and task (``sample``: ``model`` or ``control``)."""
    runs, used = tidy(study), {}
    of_model = cache(lambda measure, model: MEASURES[measure][0](runs, model))

    def measured(measure, model):
        """Return the values of a model and of its control, by task."""
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
    """Return the effects, a row for each finding, model and test, in their order. ``judge``:
    function of model, test, level and why the model is silent that returns the columns of a test.

    ``value`` with its interval, of ``tasks``; ``over_random_search``: by how much it exceeds that
    of random search; ``of_test``, the verdict of the test,
    and ``verdict``, that of the finding; ``built_in``: it follows from how the model is built;
    ``because``: why a model is silent, or does not agree though its interval is beyond the bound.
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
    """Return words by model; ``words`` has them by model or by group of models (:data:`GROUPS`)."""
    return {model: text for name, text in words.items() for model in GROUPS.get(name, [name])}


def judge_test(measured, model, test, level, silent):
    """Apply one test of a finding to a model; return its columns (:func:`columns_of`).
    ``measured``: function of measure and model that returns values of the model and its control;
    ``level``: of the interval, two-sided; ``silent``: why nothing follows for the model, or empty.
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
    """Return the verdict of a test, and why a model is silent or does not agree. One rule for all
    models: agreement has to lie beyond the bound, and to exceed random search where it can be
    measured (``over``: by how much).
    ``silent``: why nothing follows, or empty."""
    side, word = (1, "above") if "above" in test else (-1, "below")
    near, far = sorted([side * seen.low, side * seen.high])
    agrees, disagrees = near > side * test[word], far < side * test.get("disagree", test[word])
    if not tasks:
        return "silent" if silent else "no cases", silent
    if tasks < FEWEST_TASKS or agrees == disagrees:
        return "undecided", silent
    if agrees and min(side * over.low, side * over.high) <= 0:
        return "undecided", NOT_BEYOND
    return "agrees" if agrees else "disagrees", silent


def bootstrap(sides, statistic, level):
    """Return a statistic of all tasks with its interval over tasks, and their number.

    ``sides``: values by task; of two, the statistic of the first less that of the second, on the
    tasks that both have. ``level``: error of the interval, two-sided. Percentiles, wider by √(k /
    (k − 1)) for k tasks, by which resamples fall short of the spread. NaN without tasks, and
    without an interval of one.
    """
    tasks = [task for task in sides[0].index.unique() if all(task in side.index for side in sides)]
    rows = [[pd.DataFrame(side).loc[[task]].to_numpy() for task in tasks] for side in sides]
    count = len(tasks)

    def difference(drawn):
        first, *second = (statistic(np.concatenate([side[k] for k in drawn])) for side in rows)
        return first - sum(second)

    value = difference(range(count)) if count else np.nan
    if count < 2:
        return Estimate(value, n=(count,))
    drawn = np.random.default_rng(0).integers(count, size=(RESAMPLES, count))
    different, which = np.unique(drawn, axis=0, return_inverse=True)
    values = np.array([*map(difference, different)])[which.ravel()]
    away = (values - value) * np.sqrt(count / (count - 1))
    return Estimate(value, *(value + np.quantile(away, [level / 2, 1 - level / 2])), n=(count,))


def verdict_of(tests):
    """Return the verdict of a finding from the verdicts of its tests: the common one if all are
    alike, else ``disagrees`` or ``no cases`` if a test has it, else ``undecided``."""
    if len(set(tests)) == 1:
        return tests[0]
    return next((kind for kind in ("disagrees", "no cases") if kind in tests), "undecided")


def tabulate(effects):
    """Verdicts of models on findings; a star: it follows from how the model is built."""
    cells = effects.drop_duplicates(["finding", "model"]).set_index(["finding", "model"])
    words = cells.verdict + cells.built_in.map({True: " *", False: ""})
    table = pd.DataFrame({name: words[:, name] for name in MODELS}).add_prefix("of ")
    table = table.loc[effects.finding.unique()]
    table.insert(0, "finding", [FINDINGS[name]["statement"] for name in table.index])
    return table.rename_axis("row")


@figures.styled
def draw(table):
    """A grid with a mark for each verdict, circled where it follows from how the model is built."""
    figure, (axes,) = figures.panels((1, 1), (figures.TWO, 4.6))
    models = table.drop(columns="finding").rename(columns=lambda name: name.removeprefix("of "))
    for (y, x), verdict in np.ndenumerate(models):
        mark, color = MARKS[verdict.removesuffix(" *")]
        axes.text(x, y, mark, color=color, ha="center", va="center", fontsize=10)
        if verdict.endswith("*"):
            axes.plot(x, y, "o", markersize=11, markerfacecolor="none", markeredgecolor=color,
                      markeredgewidth=0.6)  # fmt: skip
    axes.set_yticks(range(len(models)), models.index.str.replace("-", " "))
    axes.set_ylim(len(models) - 0.4, -0.6)
    axes.set_xticks(range(models.shape[1]), models, rotation=50, ha="left", rotation_mode="anchor")
    axes.xaxis.tick_top()
    axes.tick_params(length=0)
    axes.set_xlim(-0.6, models.shape[1] - 0.4)
    axes.grid(visible=True, linewidth=0.3)
    axes.spines[:].set_visible(False)
    return figure


def measure(study):
    """Return the tables by name; each becomes a CSV file. ``runs`` has values by task; verdicts are
    also on finding body-shares."""
    effects, values = measure_effects(study)
    body = pd.read_csv(HERE / "body.csv", index_col=0)
    results = tabulate(pd.concat([effects, body]))
    return {"results": results, "effects": effects, "runs": values.set_index("measure")}


if __name__ == "__main__":
    write_study(HERE, measure(load(sys.argv[1])) if sys.argv[1:] else {}, draw)
