"""Tables of the study of wrong objectives."""

from __future__ import annotations

from coartic.analysis.studies import objectives as regrets
from coartic.analysis.studies.objectives import TERMS, WHO, advantage, on_random_tasks
from coartic.analysis.study import Study
from coartic.analysis.tables.studies import mean_of
from coartic.analysis.tables.table import Row, Rows, runs_of, table


@table("term, weight, who, tasks, regret[], helps[]")
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


@table("term, who, tasks, crossing[]")
def crossings(study: Study) -> Rows:
    """The weight from which trial and error regrets less than the planner that believes in ticks.

    Infinite: beyond the largest weight, if at all.
    """
    frame = on_random_tasks(study)
    for at in regrets.crossings(study).to_dict("records"):
        row: Row = {str(name): value for name, value in at.items()}
        of_both = frame[(frame.term == row["term"]) & frame.who.isin([row["who"], "ticks"])]
        cells = {id(cell): cell for cell in of_both.cell}
        yield f"{row['term']} {row['who']}", row | runs_of(*cells.values())
