"""Which models agree with which findings about people: verdicts, tables, the figure.

A finding is a row of ``human.toml``, which says what its fields are.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, missing
from coartic.analysis.section import Section
from coartic.analysis.statistics.estimates import LEVEL, RESAMPLES, SEED, Estimate, interval
from coartic.analysis.study import Study, cached
from coartic.analysis.table import Row, Rows, table
from coartic.analysis.topics.human.measures import (
    MEASURES,
    MODELS,
    ByTask,
    Statistic,
    run_ids,
)
from coartic.analysis.words import interval_in_words, listed, read_beside
from coartic.robot import Array

FINDINGS: dict[str, dict[str, Any]] = read_beside(__file__, "human")
"""The findings by id, in the order of the table."""
GROUPS: dict[str, list[str]] = FINDINGS.pop("groups")
"""Names of models that have something in common."""
del FINDINGS["models"]
SUITE = "human"
FEWEST_TASKS = 10
AGREES, DISAGREES, UNDECIDED, SILENT = "agrees", "disagrees", "undecided", "silent"
NO_CASES = "no cases"
NOT_BEYOND = "it is not shown to exceed random guesses"


def by_model(words: Mapping[str, str]) -> dict[str, str]:
    """Words on models by model, where some are on a group of them."""
    return {model: text for name, text in words.items() for model in GROUPS.get(name, [name])}


@cached
def verdicts(study: Study) -> pd.DataFrame:
    """A row for each finding, test and model, in their order; none for folders of other suites.

    Columns ``finding``, ``model``, ``measure``, ``bound``, ``value`` with its interval, ``tasks``;
    ``over_guesses`` with its interval: by how much it exceeds that of random guesses on the same
    tasks, where solutions are picked from trials; ``of_test``: the verdict of the test alone,
    ``verdict`` of the finding (the same for all tests of one), ``built_in``: whether it follows
    from how the model is built, ``because``: why a model is silent, or does not agree though its
    interval lies beyond the bound. Intervals are of the bootstrap over tasks, 95 % for one test and
    wider for several (Bonferroni).
    """
    rows = []
    for name, finding in FINDINGS.items() if study.suite == SUITE else ():
        silent, built_in = (by_model(finding.get(words, {})) for words in ("silent", "built_in"))
        for model in MODELS:
            because = silent.get(model, "")
            tests = [
                judge_test(study, model, LEVEL / len(finding["tests"]), because, **test)
                for test in finding["tests"]
            ]
            verdict = verdict_of([row["of_test"] for row in tests])
            whole = {"verdict": verdict, "built_in": built_in.get(model) == verdict}
            rows += [{"finding": name, "model": model, **row, **whole} for row in tests]
    columns = (
        "finding model measure bound value value_low value_high tasks over_guesses "
        "over_guesses_low over_guesses_high of_test verdict built_in because"
    )
    return pd.DataFrame(rows, columns=columns.split())


def judge_test(
    study: Study, model: str, level: float, silent: str, measure: str, **bounds: float
) -> Row:
    """One test of a finding put to a model; ``silent``: why nothing follows for the model."""
    measure_of, statistic = MEASURES[measure]
    values = {} if silent else measure_of(study, MODELS[model])
    estimate = bootstrap(values, statistic, level)
    verdict, because = SILENT if silent else verdict_of_test(estimate, **bounds), silent
    over = None
    if model in GROUPS["picked from trials"] and values:
        over = bootstrap(values, statistic, level, measure_of(study, MODELS["random guesses"]))
        side = 1 if "above" in bounds else -1
        beyond = min(side * over.low, side * over.high) > 0 and sum(over.n) >= FEWEST_TASKS
        if verdict == AGREES and not beyond:
            verdict, because = UNDECIDED, NOT_BEYOND
    bound = next(f"{side} {value:g}" for side, value in bounds.items() if side != "disagree")
    row = {"measure": measure, "bound": bound, "tasks": len(values)}
    row |= interval("value", estimate) | interval("over_guesses", over)
    return row | {"of_test": verdict, "because": because}


def bootstrap(
    values: ByTask,
    statistic: Statistic,
    level: float,
    beside: ByTask | None = None,
    *,
    resamples: int = RESAMPLES,
) -> Estimate:
    """A statistic of all tasks, and its interval over tasks drawn with replacement.

    With ``beside``: by how much it exceeds theirs, on the tasks that both have. Wider by
    √(k / (k − 1)) for k tasks, by which resamples fall short of the spread. NaN without tasks, and
    without an interval of one. Unlike in :mod:`~coartic.analysis.statistics.instances` the
    statistic can be another than a mean over families, and runs are not drawn.
    """
    sides = [values] if beside is None else [values, beside]
    tasks = [task for task in values if all(task in side for side in sides)]
    rows = [[np.atleast_2d(np.asarray(side[task], float)) for task in tasks] for side in sides]
    count = len(tasks)
    if not count:
        return Estimate(math.nan)

    def difference(drawn: Iterable[int]) -> float:
        drawn = list(drawn)
        first, *second = (statistic(np.concatenate([side[k] for k in drawn])) for side in rows)
        return first - sum(second)

    value = difference(range(count))
    if count < 2:
        return Estimate(value, n=(count,))
    drawn = np.random.default_rng(SEED).integers(count, size=(resamples, count))
    away: Array = (np.array([*map(difference, drawn)]) - value) * math.sqrt(count / (count - 1))
    low, high = value + np.quantile(away, [level / 2, 1 - level / 2])
    return Estimate(value, float(low), float(high), n=(count,))


def verdict_of_test(
    estimate: Estimate,
    above: float = math.nan,
    below: float = math.nan,
    disagree: float = math.nan,
) -> str:
    """The verdict of one test, by an estimate over tasks; undecided where both verdicts fit.

    It should lie above or below a bound; a value at the bound is neither. ``disagree``: bound
    beyond which, on the wrong side, it is a disagreement, if that is not the first bound.
    """
    if not estimate.n:
        return NO_CASES
    side, bound = (1, above) if math.isnan(below) else (-1, below)
    near, far = sorted((side * estimate.low, side * estimate.high))
    agrees = near > side * bound
    disagrees = far < side * (bound if math.isnan(disagree) else disagree)
    if sum(estimate.n) < FEWEST_TASKS or agrees == disagrees:
        return UNDECIDED
    return AGREES if agrees else DISAGREES


def verdict_of(tests: Sequence[str]) -> str:
    """The verdict of a finding, from those of its tests: one on the wrong side disagrees."""
    if len(set(tests)) == 1:
        return tests[0]
    return next((kind for kind in (DISAGREES, NO_CASES) if kind in tests), UNDECIDED)


@table("finding, of *")
def human(study: Study) -> Rows:
    """Whether each model agrees with each finding, by how much; a star: it is built so."""
    for name, rows in verdicts(study).groupby("finding", sort=False):
        finding = FINDINGS[str(name)]
        words: Row = {"finding": finding["statement"]}
        for model, of_model in rows.groupby("model", sort=False):
            words[f"of {model}"] = verdict_in_words(of_model)
        runs = (run_ids(study, model, finding["where"]) for model in MODELS)
        yield str(name), words | {"run_ids": " ".join(runs)}


def verdict_in_words(tests: pd.DataFrame) -> str:
    """A model's verdict on a finding, with the effect of each test."""
    first = tests.iloc[0]
    verdict = f"{first.verdict}{' *' if first.built_in else ''}"
    there = tests[tests.tasks > 0].drop_duplicates("measure").to_dict("records")
    effects = [interval_in_words(row, "value", digits=2) for row in there]
    return f"{verdict}: {'; '.join(effects)}" if effects else verdict


@table(
    "finding, model, measure, bound, value[], tasks, over_guesses[], of_test, verdict, built_in, "
    "because"
)
def human_effects(study: Study) -> Rows:
    """What each model shows of each finding, with its interval over tasks; why it is silent.

    Of models whose solutions are picked from trials, also by how much it exceeds random guesses.
    The second test of one measure has its bound in the row's name.
    """
    frame = verdicts(study)
    second = frame.duplicated(["finding", "model", "measure"])
    for row, again in zip(frame.to_dict("records"), second, strict=True):
        finding, model = row["finding"], row["model"]
        ids = run_ids(study, model, FINDINGS[finding]["where"]) if row["tasks"] else ""
        name = f"{finding} {model} {row['measure']} {row['bound'] if again else ''}".strip()
        yield name, {"run_ids": ids} | {str(column): value for column, value in row.items()}


MARKS = {
    AGREES: ("+", style.BLUE),
    DISAGREES: ("−", style.VERMILLION),
    UNDECIDED: ("?", style.GREY),
    SILENT: ("·", style.GREY),
}


@figure(
    "human",
    "Which models agree with which findings about people",
    "+ agrees, − disagrees, ? undecided, · silent: nothing follows for the model; empty: no cases. "
    "In a circle: the verdict follows from how the model is built.",
)
def draw_human(study: Study) -> Parts:
    """A grid with a mark for each verdict."""
    cells = verdicts(study).drop_duplicates(["finding", "model"])
    if not len(cells):
        raise missing(study, f"only suite {SUITE!r} is put to findings about people")
    drawing, (axes,) = style.panels((1, 1), (style.TWO, 4.6))
    findings, models = list(FINDINGS), list(MODELS)
    effects = human(study)
    for row in cells.itertuples():
        finding, model = str(row.finding), str(row.model)
        place = models.index(model), -findings.index(finding)
        mark, color = MARKS.get(str(row.verdict), ("", style.GREY))
        text: Any = {"color": color, "ha": "center", "va": "center", "fontsize": style.NORMAL + 2}
        label = axes.text(*place, mark, **text)
        style.tip(label, f"{finding}, {model}: {effects[f'of {model}'][finding]}")
        if row.built_in:
            axes.plot(*place, "o", markersize=11, markerfacecolor="none", markeredgecolor=color,
                      markeredgewidth=0.6)  # fmt: skip
    style.name_rows(axes, [name.replace("-", " ") for name in findings])
    axes.set_xticks(range(len(models)), models, rotation=50, ha="left", rotation_mode="anchor")
    axes.xaxis.tick_top()
    axes.tick_params(length=0)
    axes.set_xlim(-0.6, len(models) - 0.4)
    axes.grid(visible=True, linewidth=0.3)
    axes.spines[:].set_visible(False)
    counts = cells.verdict.value_counts()
    words = ", ".join(f"{verdict} {count}" for verdict, count in counts.items())
    return drawing, effects, f"{len(findings)} findings by {len(models)} models: {words}.", ()


def finding_of_human(study: Study) -> str:
    """How often the learner agrees with findings about people, and where it could differ."""
    cells = verdicts(study).drop_duplicates(["finding", "model"])
    if not len(cells):
        return ""
    learner = cells[cells.model == "learner"].verdict.value_counts()
    possible, apart, look_ahead = where_models_differ(cells)
    sentence = (
        f"Of {len(FINDINGS)} findings about people, the paper's learner agrees with "
        f"{learner.get(AGREES, 0)}, disagrees with {learner.get(DISAGREES, 0)} and is undecided "
        f"on {learner.get(UNDECIDED, 0)}."
    )
    if possible:
        sentence += (
            f" It could differ from planners that look ahead on {len(possible)}, where it and at "
            "least one of them are decided, and differs from all that are on "
            f"{names_in_words(apart) if apart else 'none'}."
        )
    else:
        sentence += (
            " It could not differ from planners that look ahead: nowhere are it and one of them "
            "decided."
        )
    if look_ahead:
        differ = "Planners that look ahead differ from those that do not on"
        return f"{sentence} {differ} {names_in_words(look_ahead)}."
    return f"{sentence} No finding tells all planners that look ahead from those that do not."


def names_in_words(findings: Sequence[str]) -> str:
    """Ids of findings in a sentence."""
    return listed(name.replace("-", " ") for name in findings)


def where_models_differ(cells: pd.DataFrame) -> tuple[list[str], list[str], list[str]]:
    """Where the learner, and planners that look ahead, could differ and do; by verdicts.

    The findings on which the paper's learner and at least one planner that looks ahead agree or
    disagree; those of them where all such planners have the opposite verdict; and those where
    planners with one goal in view have one verdict and all with more the opposite one, undecided
    ones left out.
    """
    possible, apart, look_ahead = [], [], []
    for finding, rows in cells.groupby("finding", sort=False):
        of_model = rows.set_index("model").verdict
        learner, blind, ahead = (
            set(of_model[models]) & {AGREES, DISAGREES}
            for models in (
                ["learner"],
                GROUPS["planners with one goal in view"],
                GROUPS["planners with more"],
            )
        )
        if learner and ahead:
            possible.append(str(finding))
        if len(learner) == len(ahead) == 1 and learner != ahead:
            apart.append(str(finding))
        if len(blind) == len(ahead) == 1 and blind != ahead:
            look_ahead.append(str(finding))
    return possible, apart, look_ahead


HUMAN = Section(
    "human",
    short="People",
    title="Do the models behave like people?",
    caption="Findings about people, and which models agree with them",
    finding=finding_of_human,
    figure="human",
    table="human",
    note=(
        "Each finding is put to the robot as an inequality that was written down before any model"
        " was judged (analysis/topics/human/human.toml). A model agrees or disagrees where the "
        "whole interval over tasks lies on one side of the bound. Silent: nothing follows for the"
        " model; table human-effects says why. * The verdict follows from how the model is built."
        " Models whose solution is picked from trials agree only beyond random guesses. There is "
        "no total score: a row that tells models apart is worth more than a sum."
    ),
)
