"""Measure how much of the reward for the whole task coarticulation needs.

python studies/dose/protocols.py results/dose
PYTHONPATH=studies python studies/dose/study.py results/dose
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd

from coartic.analysis import TwoContexts, contexts_of_control, figures, load, means
from common.judging import judge_means
from common.writing import tabulate_runs, write_study

HERE = Path(__file__).parent
RANDOM_SEARCH = "random-search"
KEYS = ["group", "counted", "dose"]
MEASURES = {
    "nearer": "next goal nearer (ticks)",
    "beyond": "nearer than in random search",
    "first": "first movement slower (ticks)",
    "saved": "ticks saved (%)",
}
"""Measures of a run, with the labels of their axes."""
SHARED = ("ascending", "descending")
"""Tasks of the paper that share their first goal, and no other goal."""


def measure_runs(study):
    """Return the solved runs with their measures.

    A learner's run is measured by its noiseless trial after learning (the replay), and a run of
    random search by its solution. Runs of random search with other settings than the defaults are
    left out; they are used only for ``beyond``. The new columns are

    - ``nearer``, ``first``, ``saved``: see :data:`MEASURES`;
    - ``beyond``: ``nearer`` less its mean in random search on the same task with the same hands;
      missing for random search;
    - ``group``: the family, or the task of the paper;
    - ``counted``: the movements whose rewards count (``all`` or ``later``), or ``random search``;
    - ``dose``: the factor γ; missing for random search;
    - ``kind``: ``counted`` and ``dose`` as a string.
    """
    learns = study.runs.method != RANDOM_SEARCH
    nearer, first = (
        study.signature(name, replay=True).where(learns, study.signature(name))
        for name in ("arm", "first")
    )
    runs = study.runs.assign(
        group=study.runs.family.str.partition("/")[0].fillna(study.runs.task),
        counted=study.runs.counted.fillna("random search"),
        dose=study.runs.discount, nearer=nearer, first=first,
    )  # fmt: skip
    reward = runs.replay_reward.where(learns, runs.reward)
    initial = runs.groupby("task").initial_reward.transform("first")  # random search has none
    runs["saved"] = (100 * (initial - reward) / initial).astype("Float64")
    of_dose = runs.dose.map(lambda dose: "" if np.isnan(dose) else f" {dose:g}")
    runs["kind"] = runs.counted + of_dose
    runs = runs[runs.status == "ok"].sort_values("method", kind="stable")
    searched = runs[runs.method == RANDOM_SEARCH].groupby(["task", "hands"]).nearer.mean()
    hands = pd.MultiIndex.from_arrays([runs.task, runs.replay_hands.fillna("")])
    runs["beyond"] = runs.nearer - searched.reindex(hands).to_numpy()
    return runs[(runs.method != RANDOM_SEARCH) | (runs.setting == "")]


def tabulate(study, runs):
    """Tabulate the mean measures by γ.

    Means are over random tasks, or over the runs on a task of the paper.
    """
    every = pd.concat([runs[runs.family.notna()].assign(group="random"), runs])
    every["row"] = every.group + " " + every.kind
    # All random tasks have the same weight, whatever their number of runs.
    unit = every.run.where(every.family.isna(), 0)
    by = ["row", *KEYS, "task", unit]
    units = every.groupby(by, sort=False, dropna=False)[[*MEASURES]].mean().reset_index()
    table = means(units, ["row", *KEYS], [*MEASURES]).set_index("row").drop(columns="rows")
    table.insert(3, "tasks", every.groupby("row").task.nunique())
    table.insert(4, "runs", every.groupby("row").size())
    return table.join(tabulate_posture_difference(study, runs))


def tabulate_posture_difference(study, runs):
    """Tabulate by γ the posture difference at the goal that two tasks share.

    The tasks are those of the paper in :data:`SHARED`.

    The posture difference mixes length units and rad. ``beyond_p`` is p of a test against the
    posture difference of random search.
    """
    rows = {}
    first = runs[runs.task == SHARED[0]].groupby("kind").first()
    labels = (first.method + " " + first.setting).str.strip()
    for kind, label in labels.items():
        replay = label != RANDOM_SEARCH
        both = (study.executed(task, label, replay=replay) for task in SHARED)
        ours = TwoContexts(*both, 1, "right")
        control = contexts_of_control(study, ours)
        rows[f"{SHARED[0]} {kind}"] = {
            "posture_difference": ours.posture_difference,
            "beyond_p": np.nan if control is None else ours.p_beyond(control),
        }
    return pd.DataFrame.from_dict(rows, orient="index")


def judge_claims(runs):
    """Judge the claims, which were registered before the random tasks were run."""
    drawn = runs[runs.family.notna()]
    nearer, beyond, first, saved = (
        drawn.pivot_table(name, "task", "kind").loc[drawn.task.unique()] for name in MEASURES
    )

    to_half = (saved["all 0"] + saved["all 1"]) / 2 - saved["all 0.1"]
    first_to_half = (first["all 0"] + first["all 1"]) / 2 - first["all 0.1"]
    values = {
        "dose-moves-postures": [nearer["all 1"] - nearer["all 0"], beyond["all 1"]],
        "dose-slows-first-movements": [first["all 1"] - first["all 0"]],
        "dose-saves": [saved["all 1"] - saved["all 0"]],
        "no-step-at-a-small-dose": [to_half, first_to_half],
        "half-a-dose-saves-less": [saved["all 1"] - saved["all 0.5"]],
        "three-quarters-suffice": [saved["all 0.75"] - saved["all 1"]],
        "earlier-movements-count": [saved["all 1"] - saved["later 1"]],
    }
    return judge_means(HERE / "claims.toml", values)


LOOKS = {
    "all": {"label": "all movements count", "color": figures.PALETTE[0]},
    "later": {"label": "later ones alone", "color": figures.PALETTE[1], "linestyle": "--"},
    "random search": {"label": "random search", "color": figures.GREY, "linestyle": ":"},
}
"""Label and style of a line, by the movements whose rewards count."""


@figures.styled
def draw(table):
    """Draw measures by γ on random tasks, and the posture difference on the paper's tasks."""
    figure, panels = figures.panels((2, 2), (figures.TWO, 4.6))
    shown = [name for name in MEASURES if name != "nearer"]
    for axes, name in zip(panels, [*shown, "posture_difference"], strict=True):
        is_shown = table[name].notna() if name not in MEASURES else table.group == "random"
        for counted, of_kind in table[is_shown].groupby("counted", sort=False):
            if counted == "random search":
                place = 0 if name == "beyond" else of_kind[name].iloc[0]
                axes.axhline(place, **LOOKS[counted])
            else:
                places = of_kind.assign(dose=of_kind.dose + 0.01 * (counted == "later"))
                figures.means(axes, places, x="dose", y=name, **LOOKS[counted])
        axes.set(xlabel="γ", ylabel=MEASURES.get(name, "posture difference"))
    figures.letters(panels)
    figures.legend(figure, panels[0].get_legend_handles_labels()[0], 3)
    return figure


def measure(study):
    """Return the tables by name; each becomes a CSV file."""
    runs = measure_runs(study)
    tables = {"results": tabulate(study, runs), "claims": judge_claims(runs)}
    return tables | {"runs": tabulate_runs(study)}


if __name__ == "__main__":
    write_study(HERE, measure(load(sys.argv[1])) if sys.argv[1:] else {}, draw)
