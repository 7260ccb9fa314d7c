"""Measure how well parameters and models of simulated people are recovered.

python studies/fit/protocols.py results/fit
PYTHONPATH=studies python studies/fit/study.py results/fit
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd

from coartic.analysis import figures
from common.writing import write_study
from fit import MODELS, judge

HERE = Path(__file__).parent
TASKS = ("ascending", "descending", "two-armed-1", "two-armed-2")
PARAMETERS = ("sigma", "epsilon", "kappa")
NOISE = 0.02
"""SD of motor noise in noisy data."""


def measure_people(raw):
    """Add ``model`` and ``others`` of :func:`fit.judge` to each simulated person, ``answer``, the
    model or ``none``, and ``group``, the task or the family."""
    judged = [judge(row) for _, row in raw.iterrows()]
    return raw.assign(
        model=[model for model, _ in judged],
        others=[" ".join(others) for _, others in judged],
        answer=np.where(raw.misfit.fillna("") == "", [model for model, _ in judged], "none"),
        group=raw.task.str.partition("/")[0],
    )


def tabulate(people):
    """Tabulate recovery by group, trials and data.

    Groups are tasks, families, the tasks of the paper, random tasks, and people whose estimate of σ
    is less than twice the motor noise (``loud``) or not (``quiet``).

    ``people`` of the six models: shares of them whose model has the least BIC (``right``), whose
    model BIC excludes (``wrong``) and for whom no other model is left (``decided``).
    ``excluded_drift``: largest drift of excluded people, true of the informed and estimated of
    those who keep the best; infinite where others are excluded. ``informed`` of
    them: correlation, bias (of σ as a share), and coverage of intervals of each parameter.
    """
    people = people[people.true.isin([*MODELS])]
    pooled = people.assign(group=np.where(people.task.isin(TASKS), "paper", "random"))
    noisy = pooled[pooled.data == "noisy"]
    noisy = noisy.assign(group=np.where(noisy.sigma < 2 * NOISE, "loud", "quiet"))
    by, rows = ["group", "trials", "data"], {}
    for key, of_cell in pd.concat([people, pooled, noisy]).groupby(by, sort=False):
        left = of_cell.model + " " + of_cell.others
        kept = [true in names.split() for true, names in zip(of_cell.true, left, strict=True)]
        excluded = of_cell[~np.array(kept)]
        drift = excluded.kappa.where(excluded.true == "best", np.inf)
        drift = excluded.true_kappa.where(excluded.true == "informed", drift)
        row = dict(zip(by, key, strict=True)) | {
            "tasks": of_cell.task.nunique(), "people": len(of_cell),
            "right": (of_cell.model == of_cell.true).mean(), "wrong": 1 - np.mean(kept),
            "decided": (of_cell.others == "").mean(), "excluded_drift": drift.max(),
        }  # fmt: skip
        informed = of_cell[of_cell.true == "informed"]
        row["informed"] = len(informed)
        for name in PARAMETERS:
            fitted = informed.dropna(subset=name)
            truth, value = fitted[f"true_{name}"], fitted[name]
            if name == "sigma":
                truth, value = np.log(truth), np.log(value)
            if len(fitted) > 2:
                row[f"{name}_r"] = np.corrcoef(truth, value)[0, 1]
                row[f"{name}_bias"] = (value - truth).mean()
                row[f"{name}_rmse"] = np.sqrt(((value - truth) ** 2).mean())
                low, high = fitted[f"{name}_low"], fitted[f"{name}_high"]
                row[f"{name}_cover"] = fitted[f"true_{name}"].between(low, high).mean()
        rows[" ".join(map(str, key))] = row
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("row")


def answer(people):
    """Count people with 100 trials by data, arms, true model and answer, one of six or none; of
    those who average, ``nothing`` if no recorded trial replaces what was kept. Data are ``quiet``
    if people with motor noise explore by more than this."""
    chosen = people[(people.trials == 100) & people.task.isin(TASKS)]
    quiet = chosen[(chosen.data == "noisy") & (chosen.true_sigma >= NOISE)]
    chosen = pd.concat([chosen, quiet.assign(data="quiet")], ignore_index=True)
    arms = np.where(chosen.task.isin(TASKS[:2]), " one ", " two ")
    nothing = (chosen.true == "averages") & (chosen.replaced == 0)
    row = chosen.data + arms + chosen.true.mask(nothing, "averages nothing")
    counts = pd.crosstab(row.rename("row"), chosen.answer)
    return counts.reindex(columns=[*MODELS, "none"], fill_value=0)


def outliers(people):
    """Tabulate what outliers do to σ: errors of people who keep the best trial, by data."""
    chosen = people[(people.trials == 100) & people.true.isin(["best", "informed"])]
    off = np.log(chosen.sigma / chosen.true_sigma).groupby(chosen.data)
    table = pd.DataFrame({"people": off.size(), "sigma_bias": off.mean(),
                          "sigma_rmse": (off.var(ddof=0) + off.mean() ** 2) ** 0.5})  # fmt: skip
    return table.rename_axis("row")


def confuse(people):
    """Count the people of each of the six models by the model of least BIC."""
    people = people[people.true.isin([*MODELS])]
    cell = people.group.where(people.task.isin(TASKS), "random")
    row = cell + " " + people.trials.astype(str) + " " + people.data + " " + people.true
    return pd.crosstab(row.rename("row"), people.model).reindex(columns=[*MODELS], fill_value=0)


@figures.styled
def draw(table):
    """Draw estimates against true values of informed people with 100 complete trials on the paper's
    tasks, and the share of right models by trials."""
    informed = pd.read_csv(HERE / "runs.csv.xz").query(
        "true == 'informed' and trials == 100 and data == 'complete' and task in @TASKS"
    )
    figure, panels = figures.panels((1, 4), (figures.TWO, 2.1))
    labels = {"sigma": "σ", "epsilon": "ε", "kappa": "κ"}
    for axes, name in zip(panels, PARAMETERS, strict=False):
        ends = [informed[f"true_{name}"].min(), informed[f"true_{name}"].max()]
        axes.plot(ends, ends, color=figures.GREY, linewidth=0.6)
        for number, task in enumerate(TASKS):
            some = informed[informed.task == task]
            axes.plot(some[f"true_{name}"], some[name], linestyle="", marker="o", markersize=2.5,
                      color=figures.PALETTE[number])  # fmt: skip
        axes.set(xlabel=f"true {labels[name]}", ylabel=f"estimated {labels[name]}")
    rows = table[(table.data == "complete") & table.group.isin(TASKS)].sort_values("trials")
    for number, task in enumerate(TASKS):
        some = rows[rows.group == task]
        panels[3].plot(some.trials, 100 * some.right, marker="o", markersize=3, label=task,
                       color=figures.PALETTE[number])  # fmt: skip
    panels[3].set_xscale("log")
    panels[3].set_xticks([30, 100, 300], ["30", "100", "300"])
    panels[3].minorticks_off()
    panels[3].set(xlabel="trials", ylabel="right models (%)")
    figures.letters(panels)
    figures.legend(figure, panels[3].get_legend_handles_labels()[0], 4)
    return figure


def measure(folder):
    """Return the tables by name; each becomes a CSV file."""
    people = measure_people(pd.read_csv(Path(folder) / "recovery.csv"))
    by = ["task", "trials", "data", "repeat", "person"]
    return {
        "runs": people.sort_values(by).set_index("task"),
        "results": tabulate(people), "confusion": confuse(people),
        "answers": answer(people), "outliers": outliers(people),
    }  # fmt: skip


if __name__ == "__main__":
    write_study(HERE, measure(sys.argv[1]) if sys.argv[1:] else {}, draw)
