"""Which models agree with which findings: :func:`judged` has a row for each pair and test."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
import pandas as pd
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, model_validator

from coartic.analysis.statistics.estimates import LEVEL, SEED
from coartic.analysis.study import Study, cached
from coartic.analysis.topics.human.measures import GROUPS, MEASURES, MODELS, Values, mean_of
from coartic.analysis.words import read_beside
from coartic.robot import Array

SUITE = "human"
FEWEST_TASKS = 10
RESAMPLES = 9_999
AGREES, DISAGREES, UNDECIDED, SILENT = "agrees", "disagrees", "undecided", "silent"
NO_CASES = "no cases"
PLACEBO, PICKED = "random guesses", "picked from trials"
NOT_BEYOND = "it is not shown to exceed random guesses"


class Test(BaseModel):
    """One inequality that a finding predicts."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    measure: str
    above: float | None = None
    below: float | None = None
    disagree: float | None = None
    """Bound beyond which, on the wrong side, it is a disagreement; the first bound if not given."""

    @model_validator(mode="after")
    def is_one_inequality(self) -> Test:
        """Check that the measure exists and that there is one bound."""
        if self.measure not in MEASURES or (self.above is None) == (self.below is None):
            raise ValueError("should have a measure of measures.py, and either above or below")
        return self

    def exceeds(self, difference: tuple[float, float, float]) -> bool:
        """Whether the interval of a difference lies on the predicted side of 0."""
        _, low, high = difference
        return low > 0 if self.above is not None else high < 0


class Finding(BaseModel):
    """A published finding that can be cited; ``human.toml`` says what the fields are."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    statement: str
    population: str
    statistic: str
    quote: str
    place: str
    authors: str = Field(min_length=1)
    year: int
    title: str = Field(min_length=1)
    source: str = Field(min_length=1)
    doi: str = Field(pattern=r"^10\.\d{4,}/\S+$")
    read: str
    predicts: str
    tests: Sequence[Test]
    where: str
    silent: dict[str, str] = {}
    built_in: dict[str, str] = {}
    also: str = ""
    not_asked: str = ""
    power: str = ""
    note: str = ""


def read_findings() -> dict[str, Finding]:
    """The findings by id, with the models in the place of the names of their groups."""
    data = read_beside(__file__, "human")
    rows = {name: row for name, row in data.items() if name not in ("models", "groups")}
    findings = TypeAdapter(dict[str, Finding]).validate_python(rows)
    for name, finding in findings.items():
        for field in ("silent", "built_in"):
            by_name: dict[str, str] = getattr(finding, field)
            by_model = {
                model: what for key, what in by_name.items() for model in GROUPS.get(key, [key])
            }
            if unknown := by_model.keys() - MODELS.keys():
                raise ValueError(f"{name}: {field} has {sorted(unknown)}, no models of measures.py")
            by_name.clear()
            by_name.update(by_model)
    return findings


FINDINGS = read_findings()
"""The findings by id, in the order of the table."""


@cached
def judged(study: Study) -> pd.DataFrame:
    """A row for each finding, test and model, in their order; none for folders of other suites.

    Columns ``finding``, ``model``, ``measure``, ``bound``, ``value`` with the ``low`` and ``high``
    end of its interval, ``tasks``; ``over_guesses`` with both ends: by how much it
    exceeds that of random guesses on the same tasks, where solutions are picked from trials;
    ``of_test``: the verdict of the test alone, ``verdict`` of the finding (the same for all tests
    of one), ``built_in``: whether it follows from how the model is built, ``because``: why a model
    is silent, or does not agree though its interval lies beyond the bound.
    Intervals are of the bootstrap over tasks, 95 % for one test and wider for several
    (Bonferroni).
    """
    rows = []
    for name, finding in FINDINGS.items() if study.suite == SUITE else ():
        level = LEVEL / len(finding.tests)
        for model in MODELS:
            silent = finding.silent.get(model, "")
            of_tests = []
            for test in finding.tests:
                values = mean_of({}) if silent else measured(study, test.measure, model)
                estimate, tasks = bootstrapped(values, level), len(values.by_task)
                alone = SILENT if silent else verdict_of_test(test, estimate, tasks)
                over, because = (math.nan,) * 3, silent
                if model in GROUPS[PICKED] and tasks:
                    guesses = measured(study, test.measure, PLACEBO)
                    over = bootstrapped(values, level, beside=guesses)
                    both = len(values.by_task.keys() & guesses.by_task.keys())
                    if alone == AGREES and not (test.exceeds(over) and both >= FEWEST_TASKS):
                        alone, because = UNDECIDED, NOT_BEYOND
                bound = (
                    f"above {test.above:g}" if test.above is not None else f"below {test.below:g}"
                )
                of_tests.append((test.measure, bound, *estimate, tasks, *over, alone, because))
            verdict = verdict_of([alone for *_, alone, _ in of_tests])
            built_in = finding.built_in.get(model) == verdict
            rows += [
                (name, model, *numbers, verdict, built_in, because)
                for *numbers, because in of_tests
            ]
    columns = (
        "finding model measure bound value low high tasks over_guesses over_guesses_low "
        "over_guesses_high of_test verdict built_in because"
    )
    return pd.DataFrame(rows, columns=columns.split())


def measured(study: Study, measure: str, model: str) -> Values:
    """What a measure finds of a model, by their names."""
    return MEASURES[measure](study, MODELS[model])


def bootstrapped(
    values: Values, level: float, beside: Values | None = None
) -> tuple[float, float, float]:
    """A statistic of all tasks, and its interval over tasks drawn with replacement.

    With ``beside``: by how much it exceeds theirs, on the tasks that both have. Wider by
    √(k / (k − 1)) for k tasks, by which resamples fall short of the spread. NaN without tasks, and
    without an interval of one. Unlike in :mod:`~coartic.analysis.statistics.instances` the
    statistic can be another than a mean over families, and runs are not drawn.
    """
    sides = [values] if beside is None else [values, beside]
    tasks = [task for task in values.by_task if all(task in side.by_task for side in sides)]
    if not tasks:
        return math.nan, math.nan, math.nan
    rows = [[side.by_task[task] for task in tasks] for side in sides]

    def difference(drawn: Iterable[int]) -> float:
        drawn = list(drawn)
        first, *second = (
            side.statistic(np.concatenate([of_side[k] for k in drawn]))
            for side, of_side in zip(sides, rows, strict=True)
        )
        return first - sum(second)

    count = len(tasks)
    estimate = difference(range(count))
    if count < 2:
        return estimate, math.nan, math.nan
    rng = np.random.default_rng(SEED)
    drawn = rng.integers(count, size=(RESAMPLES, count))
    away: Array = (np.array([*map(difference, drawn)]) - estimate) * math.sqrt(count / (count - 1))
    low, high = estimate + np.quantile(away, [level / 2, 1 - level / 2])
    return estimate, float(low), float(high)


def verdict_of_test(test: Test, estimate: tuple[float, float, float], tasks: int) -> str:
    """The verdict of one test, by a value with its interval; undecided where both verdicts fit.

    A value at the bound is neither above nor below it.
    """
    if not tasks:
        return NO_CASES
    _, low, high = estimate
    sign, bound = (1, test.above) if test.above is not None else (-1, test.below)
    assert bound is not None
    wrong = bound if test.disagree is None else test.disagree
    near, far = sorted((sign * low, sign * high))
    agrees, disagrees = near > sign * bound, far < sign * wrong
    if tasks < FEWEST_TASKS or agrees == disagrees:
        return UNDECIDED
    return AGREES if agrees else DISAGREES


def verdict_of(tests: Sequence[str]) -> str:
    """The verdict of a finding, from those of its tests: one on the wrong side disagrees."""
    if len(set(tests)) == 1:
        return tests[0]
    return next((kind for kind in (DISAGREES, NO_CASES) if kind in tests), UNDECIDED)


def separating(study: Study) -> dict[str, list[str]]:
    """Where the learner, and planners that look ahead, could differ and do.

    ``possible``: the findings on which the paper's learner and at least one planner that looks
    ahead agree or disagree; ``apart``: those of them where all such planners have the opposite
    verdict; ``look_ahead``: where planners with one goal in view have one verdict and all with more
    the opposite one, undecided ones left out.
    """
    verdicts = judged(study).drop_duplicates(["finding", "model"])
    found: dict[str, list[str]] = {"possible": [], "apart": [], "look_ahead": []}
    for finding, rows in verdicts.groupby("finding", sort=False):
        by_model = rows.set_index("model").verdict
        learner, blind, ahead = (
            set(by_model[models]) & {AGREES, DISAGREES}
            for models in (
                ["learner"],
                GROUPS["planners with one goal in view"],
                GROUPS["planners with more"],
            )
        )
        holds = {
            "possible": bool(learner and ahead),
            "apart": len(learner) == len(ahead) == 1 and learner != ahead,
            "look_ahead": len(blind) == len(ahead) == 1 and blind != ahead,
        }
        for kind in found:
            found[kind] += [str(finding)] if holds[kind] else []
    return found
