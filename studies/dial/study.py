"""Measure what exploration that leans towards the next goal gains, on tasks not used for tuning.

    python studies/dial/protocols.py results/dial
    PYTHONPATH=studies python studies/dial/study.py results/dial

The *gain* of a run is a share in per cent: 0 is the reward of the corrective process alone with its
best hands, and 100 is the best known reward.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
from settings import AFTER, DRIFTS, FAMILIES, INFORMED, PAPER, PLANNER, TRIALS
from shifts import by_task, in_each, judge_shifts, measure_shifts, tabulate_shifts

from coartic.analysis import figures, means
from common.judging import judge_means
from common.writing import write_study

HERE = Path(__file__).parent


def measure_runs(raw):
    """Add gains and logarithms of numbers of trials to the stored runs.

    - ``gain_N`` is the gain after N trials, in per cent.
    - ``log_quarter`` and ``log_half`` are the logarithms (base 10) of the numbers of trials until
      the gain is 25 % and 50 %. For a run of 10,000 trials that does not reach this gain, they are
      the logarithm of 10,000. For such a run of fewer trials, they are NaN.

    All of them are NaN on tasks on which nothing can be gained.
    """
    zero = raw.corrective_best
    possible = (raw.best_known - zero).where(raw.best_known > zero)
    gains = {f"gain_{n}": 100 * (raw[f"reward_{n}"] - zero) / possible for n in AFTER}
    logs = {f"log_{name}": np.log10(raw[name].clip(upper=TRIALS).where(possible.notna()))
            for name in ("quarter", "half")}  # fmt: skip
    return raw.assign(**gains, **logs)


def tabulate(runs):
    """Tabulate mean gains, and median numbers of trials to gains of 25 % and 50 %.

    The rows are for all random tasks, for each family, and for each task of the paper, each with
    every setting. Means of gains are over random tasks, which all have the same weight, or over the
    runs on a task of the paper. A median is over runs; it is infinite if half of the runs do not
    reach the gain.
    """
    drawn = runs[runs.family.isin(FAMILIES)]
    every = pd.concat([drawn.assign(group="random"), runs.assign(group=runs.family)])
    unit = every.run.where(~every.family.isin(FAMILIES), 0)
    numbers = [f"gain_{n}" for n in AFTER]
    by = ["group", "setting", "task", unit]
    units = every.groupby(by, sort=False)[numbers].mean().reset_index()
    table = means(units, ["group", "setting"], numbers)
    table.index = (table.group + " " + table.setting).rename("row")
    # Runs that did not get there count as the slowest, also those with only 1,000 trials.
    slow = every[every.gain_30.notna()].fillna({"quarter": np.inf, "half": np.inf})
    trials = slow.groupby(["group", "setting"], sort=False)[["quarter", "half"]]
    # An order statistic, because the mean of two values could be infinite.
    medians = trials.quantile(0.5, interpolation="higher").add_suffix("_0.5")
    table = table.merge(medians, left_on=["group", "setting"], right_index=True)
    return table.rename(columns={"rows": "units"})


def tabulate_named(runs):
    """Tabulate the mean best rewards of the named settings over the runs on each task."""
    groups = runs.groupby(["task", "setting"], sort=False)
    table = groups[[name for name in runs if name.startswith("after_")]].mean()
    table.insert(0, "runs", groups.size())
    table = table.reset_index()
    return table.set_index((table.task + " " + table.setting).rename("row"))


def judge_claims(runs):
    """Judge the claims, which were registered before any random test task was run."""

    def more(first, second, column="gain_100"):
        return by_task(runs, first, column) - by_task(runs, second, column)

    informed, late = more(INFORMED, PAPER), "gain_10000"
    values = {
        "information-in-exploration-brings-much": [in_each(informed)],
        "information-makes-quick": [in_each(more(PAPER, PLANNER, "log_quarter"))],
        "information-in-correction-brings-little": [
            in_each(informed - 2 * more("correction", PAPER))
        ],
        "planning-alone-is-short-sighted": [in_each(more(PLANNER, "1 0", late))],
        "wrong-information-helps-less": [in_each(more(INFORMED, "0.3 0.05 start"))],
        "wrong-information-harms": [in_each(more(PAPER, "1 0.05 start", late), FAMILIES[1:])],
        "drawn-drift-is-as-good": [in_each(more("drawn", INFORMED))],
        "information-about-hands": [
            in_each(more("hands", PAPER), ["long"]),
            in_each(more(PAPER, "hands", late), ["two-armed", "redundancy"]),
        ],
    }
    return judge_means(HERE / "claims.toml", values)


DIRECTIONS = {
    "next goal (σ = 0.01)": ("0.01", "next-goal"), "next goal": ("0.05", "next-goal"),
    "present posture": ("0.05", "stay"), "start": ("0.05", "start"),
}  # fmt: skip
"""Dict that maps the label of each line of the figure, which says towards what exploration leans,
to the noise and the direction in the names of its settings."""
OTHERS = "CMA-ES", "posture planning", "shortest path"
"""Methods that the figure shows as horizontal lines."""


@figures.styled
def draw(table):
    """Draw the mean gain after 100 trials on random tasks, by drift and for other methods."""
    figure, (axes,) = figures.panels((1, 1), (figures.TWO, 3.4))
    rows = table[table.group == "random"].set_index("setting")
    kappas = [0, *DRIFTS]
    for number, (label, (noise, direction)) in enumerate(DIRECTIONS.items()):
        line = rows.loc[[f"0 {noise}", *(f"{kappa:g} {noise} {direction}" for kappa in DRIFTS)]]
        look = {"color": figures.PALETTE[(0, 0, 2, 3)[number]], "marker": "osv^"[number]}
        figures.means(axes, line.assign(x=range(len(kappas))), x="x", y="gain_100",
                      linestyle="--" if noise == "0.01" else "-", **look)  # fmt: skip
        axes.text(len(kappas) - 0.92, line.gain_100.iloc[-1], label, va="center")
    for method in OTHERS:
        gain, ends = rows.gain_100[method], (-0.2, len(kappas) - 0.95)
        axes.hlines(gain, *ends, color=figures.GREY, linewidth=0.8, linestyle=":")
        axes.text(-0.17, gain + 1.5, method, va="bottom", color=figures.GREY)
    axes.text(len(kappas) - 0.92, 60, "exploration leans\ntowards the", va="center", style="italic")
    axes.set_xticks(range(len(kappas)), [f"{kappa:g}" for kappa in kappas])
    axes.set_xlim(-0.2, len(kappas) + 0.3)
    axes.set_xlabel("drift κ")
    axes.set_ylabel("gain after 100 trials (%)")
    return figure


def measure(folder):
    """Return the tables by name; each becomes a CSV file."""
    parts = ("runs", "others", "shifts", "named_runs")
    runs, others, shifts, named = (pd.read_csv(Path(folder) / f"{name}.csv") for name in parts)
    named = named.sort_values("task", kind="stable")
    stored = pd.concat([runs, others], ignore_index=True)
    runs, moved, shifts = measure_runs(stored), shifts.set_index("task"), measure_shifts(shifts)
    return {
        "runs": stored.set_index("task").sort_index(kind="stable"),
        "moved": moved.sort_index(kind="stable"),
        "results": tabulate(runs),
        "named": tabulate_named(named),
        "named_runs": named.set_index("task"),
        "claims": judge_claims(runs),
        "shifts": tabulate_shifts(shifts),
        "shift_claims": judge_shifts(shifts),
    }


if __name__ == "__main__":
    write_study(HERE, measure(sys.argv[1]) if sys.argv[1:] else {}, draw)
