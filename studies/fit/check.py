"""Checks before a fit, whether trials show anything, and after it, the absolute one: could the
model of least BIC have made these trials at all?

People of the fitted model are simulated under the conditions of the recording: from its first
complete trial on, with its lost hits, its motor noise and as many outliers. Their statistics show
what the model allows, so that no limit depends on task, noise or losses.

Statistics are scores: derivatives of the likelihood by what may be wrong. With covariance Σ of
residuals r they are made of Σ⁻¹ r, in which the noise of a posture that many residuals share counts
once.
"""

import numpy as np
from evidence import DRIFTS, SHORT, evidence_in
from models import HANDS, Trials, explored_by, starts, tables_before, trials_of
from scipy import linalg, sparse, stats
from simulate import simulate

from coartic import CoarticError

STATISTICS = {
    "echo": "residuals of successive trials are alike",
    "offset": "residuals from one stored posture are alike",
    "mixture": "movements aim at a mixture of stored postures",
    "fading": "residuals grow or shrink with practice",
    "tails": "residuals are no normal distribution",
    "outliers": "too many hits land elsewhere",
    "hands": "hands are explored more often early or late",
    "gain": "simulated people of this model gain other numbers of ticks",
}
"""Statistics, and what is wrong if the one of a person is far from those of simulated people."""
SIMULATED = 59
"""Number of people who are simulated."""
LIMIT = 3.5
"""Difference from the median of simulated people, in their SDs, from which a statistic does not fit
if it is also larger than the difference of each of them."""
RARE = 1e-4
"""Probability of a residual of the model from which a hit is an outlier."""
OUTLIERS = 0.1, 0.005
"""Share of outliers that is no misfit, and share that is simulated."""
STILL = 1e-6
"""Spread of postures, or of ticks as a share, below which trials are equal."""


def statistics_of(task, condition, trials, model, fitted, noise):
    """Return :data:`STATISTICS` by name, and a pair of the share and the SD of single outliers;
    None if no hit shows anything. ``fitted``: σ, ε and κ of the model; ``noise``: SD of motor
    noise."""
    sigma, _, kappa = fitted
    drifts = DRIFTS if model == "drawn" else (kappa,)
    evidence = evidence_in(task, condition, trials, model, kappas=drifts)
    if not len(evidence.trial):
        return None
    number = np.unique(evidence.trial, return_inverse=True)[1]
    squares = (evidence.nodes**2).sum(axis=2)
    least = np.array([np.bincount(number, each) for each in squares]).argmin(axis=0)[number]
    residual = evidence.nodes[least, np.arange(len(least))]
    dimensions, goals, weights = evidence.sizes, trials.hands.shape[1], evidence.weights(kappa)
    scale = sigma * evidence.at(kappa)[1]
    hit, stored = evidence.records[:2]
    goal, hand = hit % goals, trials.hands[evidence.trial, hit % goals]

    shared = noise**2 * evidence.shared(kappa)
    ratio = (residual**2).sum(axis=1) / (scale**2 + shared.diagonal())
    middle = np.median(ratio / stats.chi2.median(dimensions))
    is_far = ratio > middle * stats.chi2.isf(RARE, dimensions)
    is_false = np.isin(evidence.records[1:], hit[is_far]).any(axis=0)
    is_own, use = is_far & ~is_false, ~(is_far | is_false)
    variance = np.where(use, scale**2, 4.0)  # of what is not used: nothing is expected
    precision = sparse.diags_array(1 / variance)
    if noise:
        precision = linalg.inv(shared + np.diag(variance))
    scores, diagonal = precision @ residual, precision.diagonal()
    noises = noise**2 * (weights.T @ scores)
    postures = trials.postures.reshape(-1, task.robot.dof)[: len(noises)] - noises
    z = np.where(use[:, None], scores * scale[:, None], 0.0)
    total = (z**2).sum()

    last, recent, echo, is_single = {}, {}, 0.0, is_own.copy()
    for k, key in enumerate(zip(goal, hand, strict=True)):
        if is_own[k] and key in last and is_own[last[key]]:
            is_single[[last[key], k]] = False
        last[key], mean = k, recent.get(key, 0.0 * z[k])
        echo += z[k] @ mean
        if use[k]:
            recent[key] = 0.8 * mean + 0.2 * z[k]
    entry = np.unique([stored, goal, hand], axis=1, return_inverse=True)[1].ravel()
    sums = np.array([np.bincount(entry, column) for column in z.T])

    kept, mixed = {}, np.zeros_like(postures)
    for place in np.unique(stored[stored >= 0]):
        t, g = divmod(int(place), goals)
        state = g, trials.hands[t, g - 1] if g else 2, trials.hands[t, g]
        kept[state] = (kept.get(state, postures[place]) + postures[place]) / 2
        mixed[place] = kept[state] - postures[place]
    moves = (1 - kappa) * evidence.at(kappa)[1][:, None] * mixed[stored]
    moves = np.where((use & (stored >= 0))[:, None], moves, 0.0)
    power = np.sqrt((moves * (precision @ moves)).sum())

    late = evidence.trial - evidence.trial[use].mean()
    size = ((scores**2).sum(axis=1) / (diagonal * dimensions))[use]
    explores, half = ~evidence.follows, len(evidence.follows) // 2
    rewards = trials.rewards[np.isfinite(trials.rewards)][1:]
    third = max(len(rewards) // 3, 1)
    statistics = {
        "echo": echo / total,
        "offset": (sums**2).sum() / total,
        "mixture": (moves * scores).sum() / power if power else 0.0,
        "fading": late @ (z**2).sum(axis=1) / (total * max(late[use].std(), 1.0)),
        "tails": np.log((size**2).mean() / size.mean() ** 2),
        "outliers": max(is_own.sum() / (~is_false).sum(), OUTLIERS[0]),
        "hands": explores[:half].mean() - explores[half:].mean(),
        "gain": 1 - rewards[-third:].mean() / rewards[:third].mean(),
    }
    spread = (residual[is_single] ** 2).sum() / max(dimensions[is_single].sum(), 1)
    return statistics, (is_single.mean(), np.sqrt(spread))


def compare(task, condition, trials, model, fitted, noise):
    """Compare a person with simulated people; parameters as of :func:`statistics_of`.

    Returns
    -------
    dict
        For each of :data:`STATISTICS` the difference from the median of simulated people, as a
        share of the difference from which it does not fit; and the share of ``lapses``, single
        outliers that the model does not make.
    """
    begin = int(np.flatnonzero(np.isfinite(trials.rewards))[0])
    trials = Trials(*(each[begin:] for each in trials))
    recorded, (share, spread) = statistics_of(task, condition, trials, model, fitted, noise)
    people = simulate(task, model, *fitted, seeds=range(SIMULATED), trials=len(trials.hands),
                      condition=condition,
                      first=(trials.hands[0], trials.postures[0]))  # fmt: skip
    people = [trials_of(person, task) for _, person in people.groupby("subject")]

    def recordings(share):
        """Return statistics of simulated people, and the mean share of single outliers."""
        each = []
        for number, (hands, postures, rewards) in enumerate(people):
            rng, lost = np.random.default_rng(number), trials.hands[: len(hands)] < 0
            added = noise * rng.standard_normal(postures.shape)
            is_outlier = rng.random(hands.shape) < share
            added[is_outlier] += spread * rng.standard_normal(added[is_outlier].shape)
            seen = np.where(lost[..., None], np.nan, postures + added)
            known = np.where(lost.any(axis=1), np.nan, rewards)
            seen = Trials(np.where(lost, -1, hands), seen, known)
            each.append(statistics_of(task, condition, seen, model, fitted, noise))
        each = [one for one in each if one]
        found = {name: np.array([one[name] for one, _ in each]) for name in STATISTICS}
        return found, np.mean([single for _, (single, _) in each])

    simulated, expected = recordings(0.0)
    if share - expected > OUTLIERS[1]:
        simulated, _ = recordings(share - expected)
    ratios = {}
    for name, values in simulated.items():
        off, sd = np.append(values, recorded[name]) - np.median(values), values.std()
        if name == "mixture":  # which cannot be negative, and of which some people have none
            off, sd = np.maximum(off, 0.0), max(sd, 1.0)
        ratios[name] = np.abs(off[-1]) / max(np.abs(off[:-1]).max(), LIMIT * sd, 1e-9)
    return ratios | {"lapses": max(share - expected, 0.0)}


def misfits(ratios):
    """Return the words of :data:`STATISTICS` whose ratio of :func:`compare` is above 1, a list."""
    return [words for name, words in STATISTICS.items() if ratios[name] > 1]


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
