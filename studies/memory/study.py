"""Measure what memory adds to random search: how often something is kept, and what.

    python studies/memory/protocols.py results/memory
    PYTHONPATH=studies python studies/memory/study.py results/memory

Without a folder, tables and page are made from cells.csv and runs.csv.xz. Script hands.py makes the
runs on the learner's rule for hands, and one_selection.py those at equal gain.

Random search is the learner without its memory. In this study it gets memory in doses: after each
of r equal parts (stages) of its trials, it continues from its best trial, either from the postures
that this trial reached, or from the targets at which it aimed. The expected answer is that such a
memory makes the learner's coarticulation. Against it would be signatures that do not rise with r,
or a learner beyond their level.

On two arms, random search has the hand sequences in which the learner's runs end, weighted by the
numbers of these runs. All tests and intervals resample tasks within families. All families have the
same weight.
"""

import sys
from pathlib import Path

import pandas as pd
from cells import (
    KEEPS,
    MEASURES,
    groups_of,
    measure_cells,
    measure_runs,
    rows_of_contexts,
    tabulate_contexts,
)
from equal_gain import tabulate_equal
from scales import MAX_STAGES, Scale, every_scale, tabulate, tabulate_keeping, tabulate_scales

from coartic.analysis import figures, load
from common.judging import judge_means
from common.writing import write_study

HERE = Path(__file__).parent


def judge_claims(cells, scales):
    """Judge the predictions, which were registered before any test instance was run."""
    postures, targets = ({measure: scales[measure, "all", keep] for measure in MEASURES}
                         for keep in KEEPS)  # fmt: skip
    signatures = [measure for measure in MEASURES if measure != "gain"]
    words = {measure: label.partition(" (")[0] for measure, label in MEASURES.items()}

    def rises(kept):
        return [{words[measure]: scale.slopes() for measure, scale in kept.items()}]

    families = [name for name in groups_of(cells, "gain")["all"] if name != "long"]
    but_long = Scale(cells, "gain", "postures", families)
    both = {measure: targets[measure].by_task(
        (targets[measure].table[MAX_STAGES] - postures[measure].table[MAX_STAGES]).dropna()
    ) for measure in MEASURES}  # fmt: skip
    values = {
        "rises-with-postures": rises(postures),
        "rises-with-targets": rises(targets),
        "level-from-a-hundred": [scale.more(100, MAX_STAGES) for scale in postures.values()],
        "learner-at-the-level": [postures[name].more("learner", MAX_STAGES) for name in signatures],
        "learner-gains-the-level": [but_long.more("learner", MAX_STAGES)],
        "targets-gain-more": [both["gain"]],
        "targets-slow-more": [both["first"]],
        "targets-pass-the-learner": [targets["gain"].more(30, "learner")],
        "one-place": [
            {words[measure]: scale.more(*places) for measure, scale in targets.items()}
            for places in (("learner", 10), (100, "learner"))
        ],
    }
    return judge_means(HERE / "claims.toml", values)


@figures.styled
def draw(results):
    """Draw gain and signatures, less those of one selection, against the number of stages.

    Thick lines are over all families, thin lines for each family. The learner is grey, with its
    interval.
    """
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
        axes.set(title=label.replace(" (", "\n("), xlabel="parts r", xscale="log")
        axes.set_xticks([1, 10, 100, 1000], ["1", "10", "100", "1000"])
        axes.set_xticks([], minor=True)
    figures.legend(figure, every[0].get_legend_handles_labels()[0], 3)
    return figure


def measure(study):
    """Return the tables by name; each becomes a CSV file."""
    runs = measure_runs(study)
    cells, rows = measure_cells(runs), rows_of_contexts(study, runs)
    return {"cells": cells, "runs": rows, **tables_of(cells, rows)}


def tables_of(cells, rows):
    """Return the tables by name, from means over runs and from runs on :data:`cells.CONTEXTS`."""
    scales = every_scale(cells)
    return {
        "contexts": tabulate_contexts(rows),
        "results": tabulate(scales),
        "scales": tabulate_scales(scales),
        "keeping": tabulate_keeping(cells),
        "equal": tabulate_equal(cells),
        "claims": judge_claims(cells, scales),
    }


if __name__ == "__main__":
    if sys.argv[1:]:
        write_study(HERE, measure(load(sys.argv[1])), draw)
    else:
        stored = [pd.read_csv(HERE / name, index_col=0) for name in ("cells.csv", "runs.csv.xz")]
        write_study(HERE, tables_of(*stored), draw)
