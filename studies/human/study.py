"""Do the models behave like people?

    coartic run studies/human/suite.toml
    python studies/human/study.py results/human

human.toml has the findings, in place of claims, the models and how verdicts are made; measures.py
what is measured.
"""

import json
import re
import sys
import tomllib
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
from measures import MEASURES

from coartic import trajectory
from coartic.analysis import figures, load, write_study
from coartic.estimates import Estimate

HERE = Path(__file__).parent
FINDINGS = tomllib.loads((HERE / "human.toml").read_text("utf-8"))
GROUPS, MODELS = FINDINGS.pop("groups"), FINDINGS.pop("models")
"""The findings by id, in the order of the table; groups of models by name; models that are compared
with people, by name: methods with their parameters."""
FURTHER = {
    "learner, begun": MODELS["learner"] | {"parameters": {"trials": 100}},
    "learner, replayed, begun": MODELS["learner, replayed"] | {"parameters": {"trials": 100}},
    "least acceleration, stopping": MODELS["least acceleration"] | {"parameters": {"stop": 1}},
    "least jerk, stopping": MODELS["least jerk"] | {"parameters": {"stop": 1}},
    "any goals ahead": {"method": "receding-horizon"},
}
"""Further models that some measures need: the learner after a hundredth of its practice, plans that
stop at each goal, all points of the planner's curve."""
LEVEL, RESAMPLES = 0.05, 9_999
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
    the task ``origin``, or 0; the planner's ``horizon``; ``path``, the movement tick by tick.
    """
    solved = study.runs[study.runs.status == "ok"]
    best = solved.groupby("task").reward.max()
    rows = []
    for cell in solved.drop_duplicates(["task", "method", "setting"]).itertuples():
        task, parameters = study.tasks[cell.task], json.loads(cell.parameters)
        learner = f"dual-process/EC{4 if len(task.hands) > 1 else 1}"
        origin, moved = re.fullmatch(r"(.+?)(?:\.goal(\d+)_.+)?", cell.task).groups()
        place = task.goals[int(moved) - 1][1] if moved else np.nan
        facts = {
            "task": cell.task, "arms": len(task.hands), "goals": cell.goals,
            "best": best[cell.task], "origin": origin, "moved": int(moved or 0), "place": place,
            "horizon": parameters.get("horizon"),
        }  # fmt: skip
        for name, model in (MODELS | FURTHER).items():
            wanted = model.get("parameters", {}).items()
            if (model["method"] or learner) == cell.method and wanted <= parameters.items():
                replay = model.get("replayed", False)
                for run in study.executed(
                    cell.task, f"{cell.method} {cell.setting}".strip(), replay=replay
                ).runs:
                    path = trajectory(task, run.movements)
                    rows.append({"model": name, **facts, "path": path})
    return pd.DataFrame(rows)


def measure_effects(study):
    """A row for each finding, model and test, in their order.

    ``value`` with its interval, of ``tasks``; ``over_random_search``: by how much it exceeds that
    of random search; ``of_test``, the verdict of the test,
    and ``verdict``, that of the finding; ``built_in``: it follows from how the model is built;
    ``because``: why a model is silent, or does not agree though its interval is beyond the bound.
    """
    runs, rows = tidy(study), []
    findings = {name: each for name, each in FINDINGS.items() if name != "body-shares"}
    measured = cache(lambda measure, model: MEASURES[measure][0](runs, model))
    for name, finding in findings.items():
        silent, built_in = (by_model(finding.get(words, {})) for words in ("silent", "built_in"))
        level = LEVEL / len(finding["tests"])
        for model in MODELS:
            tests = [judge_test(measured, model, test, level, silent.get(model, ""))
                     for test in finding["tests"]]  # fmt: skip
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
    """Apply one test of a finding to a model; return its columns of :func:`measure_effects`.
    ``measured``: function of measure and model that returns values; ``level``: of the interval,
    two-sided; ``silent``: why nothing follows for the model, or empty."""
    name, word = test["measure"], "above" if "above" in test else "below"
    bound, statistic = test[word], MEASURES[name][1]
    values = pd.Series() if silent else measured(name, model)
    seen, over = bootstrap([values], statistic, level), Estimate(np.nan)
    tasks = seen.n[0]
    if tasks and model != "random search":
        control = measured(name, "random search")
        if len(control):
            over = bootstrap([values, control], statistic, level)
    verdict, because = decide(test, seen, over, tasks, silent)
    return {
        "measure": name, "bound": f"{word} {bound:g}", **seen.columns("value"), "tasks": tasks,
        **over.columns("over_random_search"), "of_test": verdict, "because": because,
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


def judge_stored(effects):
    """Judge stored effects of planners by the one rule. Where the difference to random search was
    not stored, their intervals have to lie apart, which asks for more."""
    effects = effects.copy()
    search = effects[effects.model == "random search"].set_index(["finding", "measure", "bound"])
    open_tests = (effects.of_test == "agrees") & (effects.model != "random search")
    for name, row in effects[open_tests & effects.over_random_search.isna()].iterrows():
        control = search.loc[row.finding, row.measure, row.bound]
        above = row.bound.startswith("above")
        near, far = ("low", "high") if above else ("high", "low")
        apart = row[f"value_{near}"] - control[f"value_{far}"]
        if apart <= 0 if above else apart >= 0:  # False without a control
            effects.loc[name, ["of_test", "because"]] = "undecided", NOT_BEYOND
    verdicts = effects.groupby(["finding", "model"]).of_test.agg(lambda each: verdict_of([*each]))
    effects["verdict"] = [verdicts[row.finding, row.model] for row in effects.itertuples()]
    built_in = {
        (name, model) for name, finding in FINDINGS.items()
        for model, verdict in by_model(finding.get("built_in", {})).items()
        if verdicts.get((name, model)) == verdict
    }  # fmt: skip
    effects["built_in"] = [(row.finding, row.model) in built_in for row in effects.itertuples()]
    return effects


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
    """Return the tables by name; each becomes a CSV file."""
    effects = measure_effects(study)
    return {"results": tabulate(effects), "effects": effects}


def main(folder=None):
    """Measure a folder, or judge the stored effects; join finding body-shares; write all."""
    stored = {name: pd.read_csv(HERE / f"{name}.csv", index_col=0).fillna({"because": ""})
              for name in ("effects", "body")}  # fmt: skip
    effects = measure_effects(load(folder)) if folder else judge_stored(stored["effects"])
    tables = {"results": tabulate(pd.concat([effects, stored["body"]])), "effects": effects}
    write_study(HERE, tables, draw)


if __name__ == "__main__":
    main(*sys.argv[1:])
