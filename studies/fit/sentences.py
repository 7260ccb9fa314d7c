"""Sentences on a fit: models by name, parameters, and the measured coverage of intervals."""

from pathlib import Path

import numpy as np
import pandas as pd
from check import OUTLIERS

MODELS = {
    "best": "keep the best",
    "informed": "keep the best, informed",
    "drawn": "keep the best, drawn drift",
    "walk": "a walk (keep the last)",
    "memoryless": "no memory (keep the first)",
    "planner": "a noisy planner, replayed",
}
LEARNERS = ("best", "informed", "drawn")
HERE = Path(__file__).parent
CLEAR = 6.0
"""Difference in BIC from which a model is preferred ("strong" in Kass & Raftery 1995)."""


def sentence(row):
    """Return what a row of :func:`fit` says, in words."""
    alike = [row.model, *row.others.split()]
    text = (
        f"{row.subject}, trials 1 to {row.trials} (lost: {row.lost}; hits missing in others: "
        f"{row.missing}{f'; unfinished: {row.unfinished}' * bool(row.unfinished)}): "
    )
    lost = "A trial with lost hits may have been the best" if row.lost + row.missing else ""
    wrong = f" {lost}: the model can be wrong." if lost else ""
    if row.misfit:
        return (
            f"{text}none of the six models explains these trials ({row.misfit}). The "
            f"nearest is {MODELS[row.model]}. No parameters are given.{wrong}"
            + f" Outliers ({100 * row.check_lapses:.0f} % of hits) can cause this: look at them."
            * bool(row.check_lapses > OUTLIERS[1])
        )
    if {*alike} <= {*LEARNERS} or len(alike) == 1:
        behind = min(row[f"bic_{name}"] for name in MODELS if name not in alike)
        text += (
            f"{' or '.join(MODELS[name] for name in alike)} (other models: BIC higher by "
            f"{behind - row[f'bic_{row.model}']:.0f} or more)"
        )
        if row.model not in LEARNERS:
            return f"{text}. Parameters of the learner do not apply.{wrong}"
        numbers = [
            f"{symbol} = {row[name]:.3f} [{row[f'{name}_low']:.3f}, {row[f'{name}_high']:.3f}]"
            for symbol, name in (("σ", "sigma"), ("ε", "epsilon"), ("κ", "kappa"))
            if name in row.index
        ]
        if not row.sigma_low > row.noise / 10:
            return f"{text}. Motor noise explains all of σ, so no parameters are given.{wrong}"
        doubts = [lost] * bool(lost)
        doubts += ["Motor noise is more than half of σ"] * bool(row.noise > row.sigma / 2)
        doubt = f" {'. '.join(doubts)}: intervals can be too narrow, and the model wrong."
        held = (
            " Such 95 % profile intervals held the true σ and κ of {:.0f} and {:.0f} % of {:d} "
            "simulated people{}.".format(*coverage(row))
        )
        return f"{text}. {', '.join(numbers)}.{held}{doubt if doubts else ''}"
    return (
        f"{text}these trials cannot distinguish {'; '.join(MODELS[name] for name in alike)} "
        f"(differences in BIC below {CLEAR:g}), so no parameters are given. Trials better than all "
        f"before: {row.improved}.{wrong}"
    )


def coverage(row):
    """Return the measured coverage of intervals of σ and κ, %, the number of people, and what their
    data had, for the stored case that is nearest to a row of :func:`fit`."""
    data = "noisy" if row.noise else "lossy" if row.lost + row.missing else "complete"
    table = pd.read_csv(HERE / "results.csv").query("group == 'paper' and data == @data")
    nearest = table.iloc[np.abs(np.log(table.trials / row.trials)).argmin()]
    words = {"noisy": " with motor noise that is given", "lossy": " who lost 10 % of their trials",
             "complete": ""}  # fmt: skip
    held = 100 * nearest.sigma_cover, 100 * nearest.kappa_cover
    return *held, int(nearest.informed), f"{words[data]} after {nearest.trials} trials"
