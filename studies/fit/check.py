"""Checks before a fit, whether trials show anything, and after it, the absolute one: could the
model of least BIC have made these trials at all?

Under the true model, standardised residuals of postures are independent, N(0, 1), and equal early
and late; explored hands are as frequent early as late; and simulated people of the fitted model
gain as many ticks as the recorded one. Each statistic is about N(0, 1) then; `study.py` has the
limits' rates of false alarms.
"""

import numpy as np
from evidence import DRIFTS, ELSEWHERE, SHORT
from models import HANDS, explored_by, starts, tables_before
from simulate import simulate

from coartic import CoarticError

LIMITS = {
    "echo": (3.3, "residuals of successive trials are alike"),
    "offset": (6.0, "residuals from one stored posture are alike"),
    "tails": (15.0, "residuals are no normal distribution"),
    "elsewhere": (6.0, "too many hits land elsewhere"),
    "fading": (4.5, "residuals differ early and late"),
    "hands": (4.0, "hands are explored more often early or late"),
    "gain": (5.0, "simulated people of this model gain other numbers of ticks"),
}
"""Statistics with the limit of each, and what is wrong beyond it."""
STILL = 1e-6
"""Spread of postures, or of ticks as a share, below which trials are equal."""
SIMULATED = 8
"""Number of people who are simulated for the gain."""


def residuals_of(evidence, sigma, kappa, noise, drawn):
    """Return standardised residuals ``(m, dof)`` and where hits landed elsewhere; for ``drawn``
    drift by the drift of each trial that leaves the least."""
    residual = evidence.at(kappa)[0]
    if drawn:
        values = np.array([evidence.at(each)[0] for each in DRIFTS])
        number = np.unique(evidence.trial, return_inverse=True)[1]
        squares = np.array([np.bincount(number, each) for each in (values**2).sum(axis=2)])
        residual = values[squares.argmin(axis=0)[number], np.arange(len(number))]
    z, _, elsewhere = evidence.standardised(sigma, kappa, noise, residual)
    return z, elsewhere


def statistics_of(evidence, trials, z, elsewhere):
    """Return the statistics of residuals and hands, each about N(0, 1) under the true model."""
    sizes, here = evidence.sizes, ~elsewhere
    shares, half = (z**2).sum(axis=1) / sizes, np.median(evidence.trial[here])
    goals = trials.hands.shape[1]
    goal, last = evidence.records[0] % goals, {}
    hand = trials.hands[evidence.trial, goal]
    echo = weight = 0.0
    for k in np.flatnonzero(here):
        key = goal[k], hand[k]
        if key in last:
            echo, weight = echo + z[k] @ z[last[key]], weight + sizes[k]
        last[key] = k
    entries = np.stack([goal, evidence.records[1]])[:, here]
    stored = np.unique(entries, axis=1, return_inverse=True)[1].ravel()
    sums = np.array([np.bincount(stored, column) for column in z[here].T])
    pairs = np.bincount(stored) ** 2 - np.bincount(stored)
    offset = (sums**2).sum() - (z[here] ** 2).sum()
    spread = (shares[here] - 1) ** 2 * sizes[here] / 2 - 1
    halves = [here & (evidence.trial < half), here & (evidence.trial >= half)]
    counts = [sizes[each].sum() for each in halves]
    means = [(shares * sizes)[each].sum() / sizes[each].sum() for each in halves]
    explores = ~evidence.follows
    middle, rate = len(explores) // 2, explores.mean()
    off = explores[:middle].mean() - explores[middle:].mean()
    return {
        "echo": echo / np.sqrt(max(weight, 1.0)),
        "offset": offset / np.sqrt(max(2 * pairs.sum() * sizes.mean(), 1.0)),
        "tails": spread.sum() / np.sqrt((2 + 12 / sizes[here]).sum()),
        "elsewhere": (elsewhere.sum() - ELSEWHERE * len(here))
        / np.sqrt(ELSEWHERE * (1 - ELSEWHERE) * len(here)),
        "fading": np.log(means[0] / means[1]) / np.sqrt(sum(2 / count for count in counts)),
        "hands": off / np.sqrt(max(rate * (1 - rate), 1e-9) * 4 / len(explores)),
    }


def gain_of(rewards):
    """Return the share of ticks by which the last third of trials is faster than the first."""
    rewards = rewards[np.isfinite(rewards)]
    third = max(len(rewards) // 3, 1)
    return 1 - rewards[-third:].mean() / rewards[:third].mean()


def gain_statistic(task, condition, trials, model, sigma, epsilon, kappa, plan):
    """Return how far the recorded gain lies from those of simulated people, in their SDs: they
    begin in the postures of the first complete trial, after which gains count."""
    begin = int(np.flatnonzero(np.isfinite(trials.rewards))[0])
    people = simulate(task, model, sigma, epsilon, kappa, seeds=range(SIMULATED),
                      trials=len(trials.rewards) - begin, condition=condition, plan=plan,
                      first=(trials.hands[begin], trials.postures[begin]))  # fmt: skip
    totals = people.groupby(["subject", "trial"]).ticks.sum()
    gains = [gain_of(-each.to_numpy()[1:]) for _, each in totals.groupby("subject")]
    deviation = np.std(gains, ddof=1) * np.sqrt(1 + 1 / len(gains)) + 0.01
    return (gain_of(trials.rewards[begin + 1 :]) - np.mean(gains)) / deviation


def misfits(statistics):
    """Return what does not fit, in words."""
    return [words for name, (limit, words) in LIMITS.items() if abs(statistics[name]) > limit]


def refuse_without_null_space(task, condition):
    """Raise CoarticError for a task in which each goal leaves a hand one posture."""
    for hand, explored in zip(HANDS, explored_by(task, condition).sum(axis=1), strict=True):
        if hand in condition.hands and explored <= 2:
            raise CoarticError(
                f"in task {task.name!r} {explored} coordinates move for the {hand} hand, and 2 of "
                "them place it: it has no null space, in which practice would show. Needed are 3 "
                "or more: free the base, or record the wrist"
            )


def why_not(task, condition, trials):
    """Return why trials of a subject cannot be fitted; None if they can."""
    rows = tables_before(task, condition, trials, "best")
    if not (rows.stored >= 0).any():
        return "no hit follows a complete trial; needed are two trials, the first with all goals"
    q = trials.postures[trials.hands >= 0]
    goal = np.nonzero(trials.hands >= 0)[1]
    spreads = [q[goal == each].std(axis=0).max() for each in np.unique(goal)]
    if max(spreads) < STILL:
        return "postures are equal in all trials, so they show no exploration"
    rewards = trials.rewards[np.isfinite(trials.rewards)]
    if np.ptp(rewards) < STILL * abs(rewards.mean()):
        return (
            f"all complete trials take {-rewards.mean():g} ticks, as by a metronome: none is "
            "better, so they do not show what is kept"
        )
    hits = trials.postures[rows.trial, rows.goal]
    way = np.linalg.norm(hits - starts(task, trials, rows), axis=1)
    if not ((rows.stored >= 0) & (way > SHORT)).any():
        return f"no movement after a complete trial is longer than {SHORT} in joint space"
    return None
