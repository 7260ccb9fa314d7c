"""The figure of findings about people: a mark for each verdict."""

from __future__ import annotations

from typing import Any

from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, missing
from coartic.analysis.study import Study
from coartic.analysis.topics.human import judge
from coartic.analysis.topics.human.measures import MODELS
from coartic.analysis.topics.human.tables import human

MARKS = {
    judge.AGREES: ("+", style.BLUE),
    judge.DISAGREES: ("−", style.VERMILLION),
    judge.UNDECIDED: ("?", style.GREY),
    judge.SILENT: ("·", style.GREY),
}


@figure(
    "human",
    "Which models agree with which findings about people",
    "+ agrees, − disagrees, ? undecided, · silent: nothing follows for the model; empty: no cases. "
    "In a circle: the verdict follows from how the model is built.",
)
def draw_human(study: Study) -> Parts:
    """A grid with a mark for each verdict."""
    verdicts = judge.judged(study).drop_duplicates(["finding", "model"])
    if not len(verdicts):
        raise missing(study, f"only suite {judge.SUITE!r} is put to findings about people")
    drawing, (axes,) = style.figure_of((1, 1), (style.TWO, 4.6))
    findings, models = list(judge.FINDINGS), list(MODELS)
    effects = human(study)
    for row in verdicts.itertuples():
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
    counts = verdicts.verdict.value_counts()
    words = ", ".join(f"{verdict} {count}" for verdict, count in counts.items())
    return drawing, effects, f"{len(findings)} findings by {len(models)} models: {words}.", ()
