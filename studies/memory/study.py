"""Measure what memory adds to random search: how often something is kept, and what.

    python studies/memory/protocols.py results/memory
    python studies/memory/study.py results/memory

Random search is the learner without its memory. Here it has memory by the dose: after each of r
equal parts of its trials it goes on from its best trial, from the postures that this trial reached
or from the targets that it aimed at. Against the expected answer, that such a memory makes the
learner's coarticulation: signatures that do not rise with r, or a learner beyond their level.

On two arms all of this has the hands in which the learner ends, each weighted as the learner's runs
weight it. All tests and intervals resample tasks within families, which weigh the same.
"""

import sys
from pathlib import Path

from cells import KEEPS, MEASURES, measure_cells, measure_contexts, measure_runs
from equal_gain import tabulate_equal
from predictions import judge_claims
from scales import tabulate, tabulate_keeping, tabulate_scales

from coartic.analysis import figures, load, write_study


@figures.styled
def draw(results):
    """Gain and signatures beyond one selection against the number of parts: thick over all
    families, thin by family; grey: the learner, with its interval."""
    figure, every = figures.panels((2, 2), (figures.ONE, 3.6))
    looks = dict(zip(KEEPS, (figures.PALETTE[0], figures.PALETTE[1]), strict=True))
    for axes, (measure, label) in zip(every, MEASURES.items(), strict=True):
        column = f"{measure}_more"
        for keep, color in looks.items():
            rows = results[(results.name == keep) & results[column].notna()]
            for group, of_group in rows.groupby("group", sort=False):
                if group == "all":
                    figures.means(axes, of_group, x="stages", y=column, color=color, label=keep)
                else:
                    axes.plot(of_group.stages, of_group[column], color=color, linewidth=0.4)
        learner = results.loc["all learner"]
        axes.axhspan(learner[f"{column}_low"], learner[f"{column}_high"], color="0.85", zorder=0)
        axes.axhline(learner[column], color="0.5", linewidth=0.8, label="learner")
        axes.set_title(label.replace(" (", "\n("))
        axes.set_xlabel("parts r")
        axes.set_xscale("log")
        axes.set_xticks([1, 10, 100, 1000], ["1", "10", "100", "1000"])
        axes.set_xticks([], minor=True)
    figures.legend(figure, every[0].get_legend_handles_labels()[0], 3)
    return figure


def measure(study):
    """Return the tables by name; each becomes a CSV file."""
    cells = measure_cells(measure_runs(study))
    return {
        "cells": cells,
        "results": tabulate(cells),
        "scales": tabulate_scales(cells),
        "keeping": tabulate_keeping(cells),
        "equal": tabulate_equal(cells),
        "contexts": measure_contexts(study),
        "claims": judge_claims(cells),
    }


if __name__ == "__main__":
    write_study(Path(__file__).parent, measure(load(sys.argv[1])) if sys.argv[1:] else {}, draw)
