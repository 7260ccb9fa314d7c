"""Models beside people: findings by models."""

from __future__ import annotations

from coartic.analysis.human.judge import FINDINGS, judged
from coartic.analysis.human.measures import MODELS
from coartic.analysis.study import Study
from coartic.analysis.tables.table import Column, Row, Rows, table


@table(
    "finding, of *",
    finding=Column("people"),
    **{f"of {name}": Column(name) for name in MODELS},
)
def human(study: Study) -> Rows:
    """Whether each model agrees with each finding; a star: because of how it is built."""
    for name, rows in judged(study).groupby("finding", sort=False):
        verdicts: Row = {"finding": FINDINGS[str(name)].statement}
        for row in rows.drop_duplicates("model").itertuples():
            verdicts[f"of {row.model}"] = f"{row.verdict}{' *' if row.built_in else ''}"
        yield str(name), verdicts | {"run_ids": ""}


@table("finding, model, measure, value[], tasks, verdict")
def human_effects(study: Study) -> Rows:
    """What each model shows of each finding, with its interval over tasks."""
    for row in judged(study).itertuples():
        if row.tasks:
            yield (
                f"{row.finding} {row.model} {row.measure}",
                {
                    **{"finding": row.finding, "model": row.model, "measure": row.measure},
                    **{"value": row.value, "value_low": row.low, "value_high": row.high},
                    **{"tasks": row.tasks, "verdict": row.verdict, "run_ids": ""},
                },
            )
