"""Tables of the study of wrong objectives."""

from __future__ import annotations

from coartic.analysis.studies import objectives as regrets
from coartic.analysis.studies.objectives import TERMS, WHO, advantage, on_random_tasks
from coartic.analysis.study import Study
from coartic.analysis.tables.studies import mean_of
from coartic.analysis.tables.table import Column, Row, Rows, runs_of, table

UNTOLD = ("learner", "cma-es")
"""Who learns by trial and error, and from no plan."""


@table(
    "term, weight, who, tasks, regret[], helps[]",
    weight=Column("weight (ticks)", 0),
    regret=Column("regret (%)", 1),
    helps=Column("less than without the plan (%)", 1),
)
def objectives(study: Study) -> Rows:
    """Regret under the true reward by penalty, its weight and who, means over random tasks.

    In per cent of the best known reward. ``helps``: by how much less the learner from the plan of
    ticks regrets than the learner from the corrective process.
    """
    frame = on_random_tasks(study)
    if not (frame.weight > 0).any():
        return
    for term in TERMS:
        helped = advantage(study, "from plan", "learner", term)
        for (weight, who), rows in sorted(
            frame[frame.term == term].groupby(["weight", "who"]),
            key=lambda part: (part[0][0], WHO.index(part[0][1])),
        ):
            row: Row = {"term": term, "weight": weight, "who": who, "tasks": len(rows)}
            row |= mean_of("regret", rows.regret)
            if who == "from plan" and weight in helped.columns:
                row |= mean_of("helps", helped[weight])
            yield f"{term} {weight:g} {who}", row | runs_of(*rows.cell)


@table(
    "term, who, tasks, crossing[]",
    crossing=Column("overtakes the planner of ticks at (ticks)", 0),
)
def crossings(study: Study) -> Rows:
    """The weight from which trial and error regrets less than the planner that believes in ticks.

    Infinite: beyond the largest weight, if at all.
    """
    frame, weights = on_random_tasks(study), regrets.crossings(study)
    for at in weights[(weights.planner == "ticks") & weights.who.isin(UNTOLD)].itertuples():
        row: Row = {"term": at.term, "who": at.who, "tasks": at.instances, "crossing": at.weight}
        row |= {"crossing_low": at.weight_low, "crossing_high": at.weight_high}
        of_both = frame[(frame.term == at.term) & frame.who.isin([at.who, "ticks"])]
        cells = {id(cell): cell for cell in of_both.cell}
        yield f"{at.term} {at.who}", row | runs_of(*cells.values())
