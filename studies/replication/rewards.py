"""Compare learned rewards and hands with the published ones."""

import math

import numpy as np
import pandas as pd
from published import RUNS, TRIALS, Summary, published_alone, published_cell
from reader import LEARNER
from scipy.special import stdtrit

from coartic.analysis import figures
from coartic.estimates import MIN_VALUES, RESAMPLES, SEED, TAILS, Estimate, standard_deviation

MARGIN = 0.01
"""Differences up to this share of the published reward count as equivalent."""
COLOURS = {"equivalent": figures.PALETTE[0], "different": figures.PALETTE[3]}
MARKS = {"equivalent": "o", "different": "D", "undecided": "s"}


def compare_rewards(study):
    """Compare the rewards of the cells that the paper has, and of their hand sequences.

    Cells are in the order of the plan. If the paper or our runs have several hand sequences, rows
    for them follow the row of the cell: first the published sequences, then ours by their number of
    runs. Columns:

    - ``hands``: the hand sequence; empty for the whole cell;
    - ``published_runs``: the published number of runs with the sequence (0 if the paper has the
      numbers of all other sequences);
    - ``pooled``: True if the published mean is computed from several sequences;
    - ``several``: True if the paper has rewards of several sequences;
    - ``runs``: number of our runs with the sequence, of ``of_runs`` with a solution;
    - ``verdict``: see :func:`equivalence`; missing unless our runs have as many trials as the
      paper's;
    - ``p_sd`` and ``p_se``: p if the published spread is a standard deviation, or a standard error.
    """
    rows = {}
    for (task, label), every in study.cells.items():
        runs = every[every.status == "ok"]
        condition, hands = label.removeprefix(LEARNER), runs.hands
        published = published_cell(task, condition)
        if published is None:
            continue
        complete = sum(each.published_runs or 0 for of, each in published.items() if of) == RUNS
        unpublished = Summary(math.nan, published_runs=0 if complete else None)
        several = len(published) > 1 or len(set(hands)) > 1
        initial = published_alone(task, "initial hands")
        ours = map(str, hands.value_counts().index) if several else ()
        for name in dict.fromkeys(["", *published, *ours]):
            with_hands = runs[hands == name] if name else runs
            rewards = with_hands.reward.to_numpy(np.float64)
            summary = published.get(name, unpublished)
            is_compared, difference = len(rewards) > 0 and name in published, Estimate(math.nan)
            if is_compared:
                difference = difference_to_published(rewards, *summary[:3])
            row = {
                "task": study.tasks[task].label + (" †" if study.tasks[task].reconstructed else ""),
                "condition": condition,
                "hands": name,
                "published": summary.mean,
                "published_sd": summary.sd,
                "published_runs": summary.published_runs,
                "pooled": summary.derived,
                "several": len(published) > 2,  # one of them is that of the whole cell
                "ours": rewards.mean() if len(rewards) else math.nan,
                "ours_sd": standard_deviation(rewards),
                "runs": len(rewards),
                "of_runs": len(runs),
                **difference.columns("difference"),
                "margin": MARGIN * abs(summary.mean),
                "verdict": None,
                "p_sd": math.nan,
                "p_se": math.nan,
                "published_initial": initial and initial.mean,
                "ours_initial": runs.initial_reward.dropna().mean(),
                "run_ids": " ".join(with_hands.run_id),
            }
            if is_compared and summary.sd is not None and not summary.derived:
                row["p_sd"] = spread_p(rewards, summary.sd, summary.runs)
                row["p_se"] = spread_p(rewards, summary.sd, summary.runs, of_mean=True)
            if is_compared and (runs.trials == TRIALS).all():
                row["verdict"] = equivalence(difference, row["margin"])
            rows[" ".join(filter(None, (task, condition, name)))] = row
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("row")


def difference_to_published(ours, published, sd, runs):
    """Return our mean less the published mean, with an interval.

    The interval is Welch's, with the published SD and number of runs. Without a published SD
    (None), it is Student's. There is no interval for fewer than five runs of ours.
    """
    n, value = len(ours), float(np.mean(ours)) - published
    if n < MIN_VALUES:
        return Estimate(value, n=(n,))
    parts = [(standard_deviation(ours) ** 2 / n, n - 1)]
    if sd is not None and runs > 1:
        parts.append((sd**2 / runs, runs - 1))
    total = sum(part for part, _ in parts)
    sizes = tuple(free + 1 for _, free in parts)
    if total == 0.0:
        return Estimate(value, value, value, n=sizes)
    freedom = total**2 / sum(part**2 / free for part, free in parts)
    half = float(stdtrit(freedom, TAILS[1])) * math.sqrt(total)
    return Estimate(value, value - half, value + half, n=sizes)


def equivalence(difference, margin):
    """Return whether a difference is equivalent to 0, by comparing its interval with ±margin.

    The result is ``equivalent`` if the interval is within ±margin, ``different`` if it is wholly
    outside, and otherwise ``undecided``. This is two one-sided tests at level 2.5 % (TOST; D. J.
    Schuirmann 1987, Journal of Pharmacokinetics and Biopharmaceutics 15).
    """
    if -margin <= difference.low and difference.high <= margin:
        return "equivalent"
    if difference.low > margin or difference.high < -margin:
        return "different"
    return "undecided"


def spread_p(values, published, runs, *, of_mean=False):
    """Return the two-tailed p that ``runs`` runs like ours have the published spread.

    Samples of ``runs`` of our ``values`` are drawn with replacement. p is twice the share of
    samples whose standard deviation (with ``of_mean``, standard error) is at least as far on the
    side of the published spread. p is NaN with fewer than ten values.
    """
    if len(values) < 10:
        return math.nan
    drawn = np.random.default_rng(SEED).choice(values, (RESAMPLES, runs))
    spreads = drawn.std(axis=1, ddof=1) / (math.sqrt(runs) if of_mean else 1.0)
    beyond = min((spreads <= published).sum(), (spreads >= published).sum())
    return float(min(1.0, 2 * (1 + beyond) / (1 + RESAMPLES)))


@figures.styled
def draw_rewards(rewards):
    """Draw the differences of :func:`compare_rewards`, with intervals and margins."""
    shown = rewards[rewards.published.notna() & (rewards.several | rewards.hands.isna())]
    figure, (axes,) = figures.panels((1, 1), (figures.TWO, 0.85 + 0.185 * len(shown)))
    names = []
    for y, row in zip(range(0, -len(shown), -1), shown.itertuples(), strict=True):
        name = f"{row.task}, {row.condition}{'*' if row.pooled else ''}"
        if isinstance(row.hands, str):
            published = "" if math.isnan(row.published_runs) else f"; {row.published_runs:.0f}"
            name = f"↳ {row.hands} ({row.runs}/{row.of_runs}{published})"
        names.append(name)
        axes.barh(y, 2 * row.margin, 0.8, left=-row.margin, color=figures.GREY, alpha=0.2)
        if not row.runs:
            axes.text(1.3 * row.margin, y, "never found here", va="center", color=figures.GREY)
            continue
        colour, mark = COLOURS.get(row.verdict, "black"), MARKS.get(row.verdict, "x")
        axes.plot([row.difference_low, row.difference_high], [y, y], color=colour, lw=1.0)
        face = "white" if row.verdict == "undecided" else colour
        axes.plot(row.difference, y, mark, color=colour, markersize=4, markerfacecolor=face)
    axes.axvline(0, color="black", linewidth=0.6)
    axes.set_yticks(range(0, -len(shown), -1), names)
    axes.set_ylim(0.4 - len(shown), 0.6)
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
    # The axis is symmetric about zero, and wide enough for every interval and margin.
    ends = shown[["difference", "difference_low", "difference_high", "margin"]]
    reach = np.nanmax(np.abs(ends.to_numpy(float)))
    axes.set_xlim(-1.05 * reach, 1.05 * reach)
    axes.set_xlabel("reward, ours − published")
    return figure
