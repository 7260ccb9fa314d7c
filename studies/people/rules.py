"""Define the rules of study people: repeats that count, leans, the test, and its power."""

from functools import cache
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import stats

from coartic.analysis import lean

REST = "R"
KINDS = ("start", "end", "next")
KEYS = ["person", "target", "context"]
LEVEL = 6 / 128
"""Level of the test: at most 6 of the 128 sign flips of seven people may be as extreme."""
POWER = 0.9


def read(path):
    """Return a table of postures with angles in rad and a row for each repeat.

    Raises ValueError if a column or a value is missing.
    """
    table = pd.read_csv(path, dtype={"context": str})
    angles = [name for name in table if name.partition("_")[0] in KINDS]
    joints = len(angles) // 3
    due = [f"{kind}_{joint}" for kind in KINDS for joint in range(1, joints + 1)]
    missing = [name for name in (*KEYS, "repeat", *(due or ("start_1",))) if name not in table]
    if missing:
        raise ValueError(f"{path}: column {missing[0]} is missing")
    values = table[due].apply(pd.to_numeric, errors="coerce").to_numpy(float)
    bad = ~np.isfinite(values).all(axis=1) | table[[*KEYS, "repeat"]].isna().any(axis=1).to_numpy()
    if bad.any():
        raise ValueError(f"{path}: line {bad.argmax() + 2} lacks a number or a name")
    table[due] = np.radians(values)
    return table


def postures(table):
    """Return the postures of a table in rad, shape (repeats, 3, joints): start, end, next."""
    joints = sum(name.startswith("start_") for name in table)
    names = [f"{kind}_{joint}" for kind in KINDS for joint in range(1, joints + 1)]
    return table[names].to_numpy(float).reshape(len(table), 3, joints)


def left_out(table):
    """Return why repeats are left out, by the index of the table; empty for repeats that count.

    - ``copy``: all angles equal those of an earlier repeat of the same person, target and context.
    - ``other movement``: the start or the next posture is nearer to the median end posture of the
      repeats than to its own median, or the end posture is nearer to the median start than to its
      own median.
    """
    why = pd.Series("", table.index)
    for _, of_cell in table.groupby(KEYS):
        values = postures(of_cell)
        start, end, following = np.median(values, axis=0)
        pairs = ((0, start, end), (1, end, start), (2, following, end))
        for kind, own, other in pairs:
            away = np.linalg.norm(values[:, kind] - own, axis=1)
            wrong = away > np.linalg.norm(values[:, kind] - other, axis=1)
            why[of_cell.index[wrong]] = "other movement"
        names = [name for name in of_cell if name.partition("_")[0] in KINDS]
        why[of_cell.index[of_cell.duplicated(names)]] = "copy"
    return why


def contexts_of(table):
    """Return the postures of the repeats in two contexts, by target and person.

    The contexts are another target and rest. Only people with at least two repeats in each context
    are included. Raises ValueError if more than one other target follows a target, or if nobody has
    two contexts.
    """
    contexts = {}
    for target, of_target in table.groupby("target"):
        others = [each for each in of_target.context.unique() if each != REST]
        if len(others) > 1:
            raise ValueError(
                f"target {target} has the contexts {', '.join(others)}; it must have one besides "
                f"{REST}"
            )
        for person, of_person in of_target.groupby("person"):
            both = [postures(of_person[of_person.context == each]) for each in (*others, REST)]
            if len(both) == 2 and min(map(len, both)) > 1:
                contexts.setdefault(target, {})[person] = both
    if not contexts:
        raise ValueError(
            "the table has no person and target with two contexts; at least one needs two repeats "
            f"in which another target follows, and two in which rest ({REST}) follows"
        )
    return contexts


def carried(table):
    """Return the contexts of carry-over, by contrast and person, for :func:`leans`.

    A contrast is a target that is reached from another target (context A) and from rest (context
    B). Carry-over is a lean that is turned round: the posture in which a reach began stands in the
    place of the next posture, so n_A − n_B becomes s_A − s_B, and zeros stand in the place of the
    start. Then ``at_end`` and ``more`` of the leans are the carry-over. Raises ValueError as
    :func:`contexts_of` does.
    """
    contrasts = {}
    for target, before in sorted({*zip(table.target, table.context, strict=True)}):
        if before != REST:
            rows = table[(table.target == target) & table.context.isin([before, REST])]
            contrasts[f"{target} after {before}"] = {
                person: [
                    np.stack([0 * each[:, 0], each[:, 1], each[:, 0]], axis=1) for each in both
                ]
                for person, both in contexts_of(rows)[target].items()
            }
    return contrasts


def leans(contexts, own=False, average=np.mean):
    """Return the leans of people, with a row for each person and target.

    Columns: ``at_end``, ``at_start`` and their difference ``more`` with its interval; ``apart``,
    the distance between the next postures, and ``difference``, the posture difference at the end
    (both in rad).

    n_A − n_B (:func:`coartic.analysis.lean`) is the mean over the other people. If ``own``, it is
    that of the person's own odd and even repeats. ``average`` is the function, mean or median, that
    gives the postures of a person that are compared.
    """
    rows = []
    for target, people in contexts.items():
        ways = {
            person: average(both[0][:, 2], axis=0) - average(both[1][:, 2], axis=0)
            for person, both in people.items()
        }
        for person, both in people.items():
            rng = np.random.default_rng(0)
            others = [way for other, way in ways.items() if other != person]
            if own:
                found = lean(*both, rng)
            elif others:
                pairs = both if average is np.mean else [
                    np.repeat(average(each, axis=0)[None], 2, axis=0) for each in both
                ]  # fmt: skip
                found = lean(*pairs, rng, toward=others)
            else:
                continue
            row = {"person": person, "target": target, "repeats": min(found.more.n)}
            row |= {"more": found.more.value}
            row |= {"low": found.more.low, "high": found.more.high}
            row |= {"at_end": found.at_goal, "at_start": found.at_start, "apart": found.apart}
            ends = [average(each[:, 1], axis=0) for each in both]
            rows.append(row | {"difference": np.linalg.norm(ends[0] - ends[1])})
    return pd.DataFrame(rows)


def people(rows):
    """Return the mean over the targets of each person, and the number of targets.

    Raises ValueError if the lean is not applicable to any person and target.
    """
    applies = rows.dropna(subset="more")
    if applies.empty:
        raise ValueError(
            "the lean is not applicable to any person and target: the mean next postures are "
            f"{rows.apart.median():.2g} rad apart (median), and must be at least 0.1 rad and three "
            "standard errors apart. Are the angles in degrees?"
        )
    numbers = ["more", "at_end", "at_start", "difference", "apart"]
    found = applies.groupby("person")[numbers].mean()
    return found.assign(targets=applies.groupby("person").size())


def sign_flips(values):
    """Return p of the one-sided test by sign flips: the share of flips with as large a mean."""
    values = np.asarray(values, float)
    signs = np.array([*product((1, -1), repeat=len(values))])
    return float((signs @ values >= values.sum() - 1e-12).mean())


def needed(values):
    """Return what the test would have needed to reject.

    ``mean_needed`` is the smallest mean that is enough with the same deviations from the mean.
    ``spread_needed`` is the largest factor of these deviations that is enough with the same mean.
    A value is NaN if none is enough.
    """
    mean = np.mean(values)
    away = np.asarray(values, float) - mean
    found = {
        "mean_needed": (shift for shift in np.arange(0, 1, 0.001)
                        if sign_flips(away + shift) <= LEVEL),
        "spread_needed": (share for share in np.arange(1, 0, -0.01)
                          if sign_flips(mean + share * away) <= LEVEL),
    }  # fmt: skip
    return {name: next(values, np.nan) for name, values in found.items()}


def power(shift, n, studies=20_000):
    """Return the share of simulated studies in which the test rejects, for n values with SD 1.

    Values are normal with mean ``shift``.
    """
    values = np.random.default_rng(1).normal(shift, size=(studies, n))
    signs = np.array([*product((1, -1), repeat=n)], float)
    sums = values @ signs.T
    p = (sums >= sums[:, :1] - 1e-12).mean(axis=1)
    return float((p <= LEVEL).mean())


@cache
def smallest_shift(n):
    """Return the smallest mean, in SDs of n people, that the test finds with 90 % power."""
    low, high = 0.0, 20.0
    while high - low > 0.005:
        middle = (low + high) / 2
        low, high = (low, middle) if power(middle, n) >= POWER else (middle, high)
    return high


def spreads(contexts):
    """Return SDs that the leans of people would have without a lean, not using the leans.

    - ``repeats``: the SD that the variance of the repeats within contexts explains;
    - ``at right angles``: the SD between people of the same difference (end less start) in the
      three directions at right angles to n_A − n_B, in which a lean has no effect. The mean over
      people is subtracted;
    - ``as vectors``: the same, but a person's differences are averaged over targets as vectors.
    """
    variances, across, vectors = {}, {}, {}
    for of_target in contexts.values():
        ways = {
            person: both[0][:, 2].mean(axis=0) - both[1][:, 2].mean(axis=0)
            for person, both in of_target.items()
        }
        for person, both in of_target.items():
            way = np.mean([each for other, each in ways.items() if other != person], axis=0)
            length = np.linalg.norm(way)
            moved = [(each[:, 1] - each[:, 0]) / length for each in both]
            variances.setdefault(person, []).append(
                sum((each @ way / length).var(ddof=1) / len(each) for each in moved)
            )
            # The first column is the direction of n_A − n_B; the others are orthogonal to it.
            basis, triangle = np.linalg.qr(np.column_stack([way, np.eye(len(way))[:, :-1]]))
            basis *= np.sign(np.diag(triangle))
            difference = moved[0].mean(axis=0) - moved[1].mean(axis=0)
            across.setdefault(person, []).append(basis[:, 1:].T @ difference)
            vectors.setdefault(person, []).append(basis[:, 1:] @ across[person][-1])
    within = [np.sum(each) / len(each) ** 2 for each in variances.values()]
    between, joined = (
        np.array([np.mean(each, axis=0) for each in of.values()]).var(axis=0, ddof=1)
        for of in (across, vectors)
    )
    directions = basis.shape[1] - 1
    return {
        "repeats": float(np.mean(within)) ** 0.5,
        "at right angles": between.mean() ** 0.5,
        "as vectors": (joined.sum() / directions) ** 0.5,
    }


def tabulate_power(contexts):
    """Return the smallest lean that is found with 90 % power, for each SD of :func:`spreads`."""
    n = len({person for of_target in contexts.values() for person in of_target})
    shift = smallest_shift(n)
    rows = [
        {"spread": name, "people": n, "sd": sd, "smallest": shift * sd}
        for name, sd in spreads(contexts).items()
    ]
    return pd.DataFrame(rows).set_index("spread")


def tabulate_carry_over_power(contrasts):
    """Return the smallest carry-over that is found with 90 % power, by contrast and over all.

    ``length`` is the mean of |s_A − s_B|, in rad, of the other people's postures. Rows of contrasts
    have the spread that the repeats explain: the longer the way, the smaller the carry-over that
    can be found. The rows of all contrasts have each of :func:`spreads`.
    """
    rows = []
    for name, contrast in {**{name: {name: each} for name, each in contrasts.items()},
                           "all": contrasts}.items():  # fmt: skip
        length = np.mean([
            np.linalg.norm(np.mean([
                both[0][:, 2].mean(axis=0) - both[1][:, 2].mean(axis=0)
                for other, both in of_people.items() if other != person
            ], axis=0))
            for of_people in contrast.values() for person in of_people
        ])  # fmt: skip
        table = tabulate_power(contrast).assign(length=length)
        kept = table if name == "all" else table.loc[["repeats"]]
        rows.append(kept.rename(index=f"{name}, {{}}".format))
    return pd.concat(rows).rename_axis("spread")


def repeats_needed(n, lean_of_people, between, sd, repeats):
    """Return how many repeats of each context give 90 % power for a lean, if contexts alternate.

    The test is a one-sided t test at 5 % over n people. ``between`` is the SD of the lean between
    people. ``sd`` is the SD of a person's value with ``repeats`` repeats. The result is NaN if 200
    repeats are not enough.
    """
    for count in range(2, 201):
        spread = (between**2 + sd**2 * repeats / count) ** 0.5
        edge, shift = stats.t.ppf(0.95, n - 1), lean_of_people / spread * n**0.5
        if stats.nct.sf(edge, n - 1, shift) >= POWER:
            return count
    return np.nan


def tabulate_plan(spread):
    """Return the number of repeats that a lab needs, by the number of people and the lean.

    Column ``alike`` is for people with the same lean, and ``apart`` for people whose leans have a
    standard deviation of half the lean. ``spread`` is the SD of a person's value with ten repeats.
    """
    rows = [
        {"people": n, "lean": share, "alike": repeats_needed(n, share, 0.0, spread, 10),
         "apart": repeats_needed(n, share, share / 2, spread, 10)}
        for n in (7, 12, 20) for share in (0.02, 0.05)
    ]  # fmt: skip
    return pd.DataFrame(rows).set_index("people")


if __name__ == "__main__":
    folder = Path(__file__).parent
    stored = read(folder / "postures.csv")
    counts = contexts_of(stored[left_out(stored) == ""])
    tabulate_power(counts).to_csv(folder / "power.csv", float_format="%.6g", lineterminator="\n")
    stored = read(folder / "carry_over_postures.csv")
    tabulate_carry_over_power(carried(stored[left_out(stored) == ""])).to_csv(
        folder / "carry_over_power.csv", float_format="%.6g", lineterminator="\n"
    )
