"""Which models agree with which findings: :func:`judged` has a row for each pair and test."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pandas as pd
from pydantic import BaseModel, ConfigDict, TypeAdapter, model_validator

from coartic.analysis.human.measures import GROUPS, MEASURES, MODELS, Values, mean_of
from coartic.analysis.statistics.estimates import LEVEL, SEED
from coartic.analysis.study import Study, cached
from coartic.analysis.words import read_beside
from coartic.robot import Array

SUITE = "human"
FEWEST_TASKS = 10
RESAMPLES = 9_999
AGREES, DISAGREES, UNDECIDED, SILENT = "agrees", "disagrees", "undecided", "silent"
NO_CASES = "no cases"


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


class Finding(BaseModel):
    """A published finding; ``human.toml`` says what the fields are."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    statement: str
    population: str
    statistic: str
    quote: str
    place: str
    source: str
    doi: str
    read: str
    predicts: str
    tests: Sequence[Test]
    where: str
    silent: dict[str, str] = {}
    built_in: dict[str, str] = {}
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
    end of its interval, ``tasks``, ``of_test``: the verdict of the test alone, ``verdict`` of the
    finding (the same for all tests of one), ``built_in``: whether it follows from how the model is
    built, ``because``: why a model is silent.
    Intervals are of the bootstrap over tasks, 95 % for one test and wider for several
    (Bonferroni).
    """
    rows = []
    for name, finding in FINDINGS.items() if study.suite == SUITE else ():
        for model in MODELS:
            silent = finding.silent.get(model, "")
            values = [
                mean_of([]) if silent else MEASURES[test.measure](study, MODELS[model])
                for test in finding.tests
            ]
            level = LEVEL / len(finding.tests)
            estimates = [bootstrapped(measured, level) for measured in values]
            counts = [len(measured.by_task) for measured in values]
            of_tests = [
                SILENT if silent else verdict_of_test(test, estimate, count)
                for test, estimate, count in zip(finding.tests, estimates, counts, strict=True)
            ]
            verdict = verdict_of(of_tests)
            built_in = finding.built_in.get(model) == verdict
            rows_of_tests = zip(finding.tests, estimates, counts, of_tests, strict=True)
            for test, estimate, count, alone in rows_of_tests:
                bound = (
                    f"above {test.above:g}" if test.above is not None else f"below {test.below:g}"
                )
                measured = (name, model, test.measure, bound, *estimate, count)
                rows.append((*measured, alone, verdict, built_in, silent))
    columns = "finding model measure bound value low high tasks of_test verdict built_in because"
    return pd.DataFrame(rows, columns=columns.split())


def bootstrapped(values: Values, level: float) -> tuple[float, float, float]:
    """A statistic of all tasks, and its interval over tasks drawn with replacement.

    Wider by √(k / (k − 1)) for k tasks, by which resamples fall short of the spread. NaN without
    tasks, and without an interval of one. Unlike in :mod:`~coartic.analysis.statistics.instances`
    the statistic can be another than a mean over families, and runs are not drawn.
    """
    count = len(values.by_task)
    if not count:
        return math.nan, math.nan, math.nan
    estimate = values.statistic(np.concatenate(values.by_task))
    if count < 2:
        return estimate, math.nan, math.nan
    rng = np.random.default_rng(SEED)
    drawn = rng.integers(count, size=(RESAMPLES, count))
    resampled = np.array(
        [values.statistic(np.concatenate([values.by_task[k] for k in tasks])) for tasks in drawn]
    )
    away: Array = (resampled - estimate) * math.sqrt(count / (count - 1))
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
    """The findings that tell models apart: on which one kind agrees and the other disagrees.

    Undecided ones are left out.

    ``learner_from_planners``: the paper's learner from every planner that is judged;
    ``look_ahead``: planners with one goal in view from all with more.
    """
    verdicts = judged(study).drop_duplicates(["finding", "model"])
    blind, ahead = GROUPS["planners with one goal in view"], GROUPS["planners with more"]
    kinds = {
        "learner_from_planners": (["learner"], blind + ahead),
        "look_ahead": (blind, ahead),
    }
    apart: dict[str, list[str]] = {kind: [] for kind in kinds}
    for finding, rows in verdicts.groupby("finding", sort=False):
        by_model = rows.set_index("model").verdict
        for kind, groups in kinds.items():
            first, second = (
                set(by_model[group]) - {SILENT, NO_CASES, UNDECIDED} for group in groups
            )
            if (first, second) in (({AGREES}, {DISAGREES}), ({DISAGREES}, {AGREES})):
                apart[kind].append(str(finding))
    return apart
