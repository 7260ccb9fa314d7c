"""Tables of findings about people: verdicts, and the effects behind them."""

from __future__ import annotations

import pandas as pd

from coartic.analysis.study import Study
from coartic.analysis.table import Row, Rows, table
from coartic.analysis.topics.human.judge import FINDINGS, judged
from coartic.analysis.topics.human.measures import MODELS, run_ids
from coartic.analysis.words import in_brackets, number


@table("finding, of *")
def human(study: Study) -> Rows:
    """Whether each model agrees with each finding, by how much; a star: it is built so."""
    for name, rows in judged(study).groupby("finding", sort=False):
        finding = FINDINGS[str(name)]
        verdicts: Row = {"finding": finding.statement}
        for model, of_model in rows.groupby("model", sort=False):
            verdicts[f"of {model}"] = verdict_in_words(of_model)
        runs = (run_ids(study, model, finding.where) for model in MODELS)
        yield str(name), verdicts | {"run_ids": " ".join(runs)}


def verdict_in_words(tests: pd.DataFrame) -> str:
    """A model's verdict on a finding, with the effect of each test."""
    first = tests.iloc[0]
    verdict = f"{first.verdict}{' *' if first.built_in else ''}"
    there = tests[tests.tasks > 0].drop_duplicates("measure")
    effects = [
        f"{number(value, 2)} {in_brackets(low, high, 2)}".strip()
        for value, low, high in zip(there.value, there.low, there.high, strict=True)
    ]
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
    frame = judged(study).rename(columns={"low": "value_low", "high": "value_high"})
    second = frame.duplicated(["finding", "model", "measure"])
    for row, again in zip(frame.itertuples(), second, strict=True):
        finding, model = str(row.finding), str(row.model)
        values: Row = {column: getattr(row, column) for column in frame.columns}
        ids = run_ids(study, model, FINDINGS[finding].where) if row.tasks else ""
        name = f"{finding} {model} {row.measure}{f' {row.bound}' if again else ''}"
        yield name, values | {"run_ids": ids}
