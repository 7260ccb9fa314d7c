"""Answer the questions of a suite: weighted sums of methods' means, tested over tasks.

The unit is the task. A method's value on a task is its mean over runs, and a contrast is a weighted
sum of such values. A cell of a contrast has the tasks of one family in one world.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy import stats

from coartic.analysis.signatures import SIGNATURES
from coartic.analysis.statistics import holm
from coartic.errors import CoarticError
from coartic.estimates import LEVEL, MIN_VALUES, SEED
from coartic.internal.text import pluralize, unknown
from coartic.robot import Array
from coartic.runs.contrasts import Contrast, Place, Term
from coartic.runs.plan import world_title

OF_CURVE = ("ticks", "saved", "gap", "share")
EXACT = ("ticks exact", "saved exact")
UNITS_OF_QUANTITIES = {
    **dict.fromkeys(["ticks", "ticks exact"], "ticks"),
    **dict.fromkeys(["saved", "saved exact"], "ticks saved (%)"),
    "gap": "gap (%)",
    "share": "share of the gain (%)",
    **{name: signature.heading for name, signature in SIGNATURES.items()},
}
"""Maps each quantity of contrasts to its name with its unit. Those of :data:`OF_CURVE` can be read
after some trials; those of :data:`EXACT` are of an execution without motor noise."""
QUANTITIES = tuple(UNITS_OF_QUANTITIES)
MIN_TESTED = 6
"""Smallest number of tasks of a cell that is tested: with five, no sign test reaches 5 %."""
SHOWN, OPPOSITE, OPEN, NOT_TESTED = "shown", "opposite shown", "open", "not tested"
"""The verdicts."""
ALL = "all families"
"""Name of the row with the tasks of all families in a world."""
Cell = dict[str, dict[Term, Place]]
"""Maps each task of a cell to the planned runs of each term of the contrast."""


class Values(NamedTuple):
    """Values of the runs of a method on a task, in the unit of a quantity."""

    amounts: Array
    """Value of each run; NaN for a run that has no such value."""
    failed: bool
    """True if a run failed, so that the method has no mean."""
    run_ids: list[str]


ValuesOf = Callable[[Contrast, Place], Values]
"""Function that returns the values of the runs of a place, in the quantity of a contrast."""


def check_contrasts(
    contrasts: Sequence[Contrast], places: Sequence[Place]
) -> tuple[tuple[Contrast, int], ...]:
    """Return each contrast with its number of cells that are large enough for a test.

    ``places`` are those of the planned runs (:func:`.places_of`). Raises CoarticError if a contrast
    does not fit them.
    """
    checked, names = [], [asked.name for asked in contrasts]
    for asked in contrasts:
        try:
            if names.count(asked.name) > 1:
                raise CoarticError("two contrasts have this name: rename one of them")
            cells = planned_cells(asked, places)
            _check(asked, places, cells)
            checked.append((asked, len(_tested(asked, cells))))
        except CoarticError as error:
            raise CoarticError(f"contrast {asked.name!r}: {error}") from None
    return tuple(checked)


def _check(asked: Contrast, places: Sequence[Place], cells: Mapping[tuple[str, str], Cell]) -> None:
    """Raise CoarticError if a contrast does not fit a plan."""
    if asked.quantity not in QUANTITIES:
        raise CoarticError(unknown("quantity", asked.quantity, QUANTITIES))
    if asked.after and asked.quantity not in OF_CURVE:
        raise CoarticError(f"after reads only {', '.join(OF_CURVE)}, not {asked.quantity!r}")
    rows = {name for place in places for name in (place.row, place.label)}
    families = {place.family for place in places} - {""}
    families |= {family.split("/")[0] for family in families}
    worlds = {place.world for place in places}
    for term in asked.weights:
        if term.method not in rows:
            raise CoarticError(unknown("method", term.method, sorted(rows)))
    for world in [*(asked.worlds or ()), *(term.world for term in asked.weights)]:
        if world is not None and world not in worlds:
            known = ", ".join(map(repr, sorted(worlds)))
            raise CoarticError(f"world {world!r} is not in the suite; its worlds are {known}")
    for family in asked.families or ():
        if family not in families:
            raise CoarticError(unknown("family", family, sorted(families)))
    for task in sorted(asked.named_tasks - {place.task for place in places}):
        raise CoarticError(f"task {task!r} is not in the suite")
    if not cells:
        methods = ", ".join(dict.fromkeys(term.method for term in asked.weights))
        raise CoarticError(f"no task has all of its methods ({methods})")
    used = [place for cell in cells.values() for of_task in cell.values()
            for place in of_task.values()]  # fmt: skip
    counts = sorted({place.runs for place in used if place.stochastic})
    if len(counts) > 1:
        raise CoarticError(
            f"its methods have {' and '.join(map(str, counts))} runs; give all as many, by key "
            "runs of their blocks"
        )
    for place in used if asked.after else ():
        if place.noisy:
            raise CoarticError(
                "after is read off curves of trials, which say nothing in a world with motor "
                "noise: name the other worlds by key worlds"
            )
        if place.trials is not None and (place.trials < (asked.after or 0) or place.stops):
            why = "stop early" if place.stops else f"have {pluralize(place.trials, 'trial')}"
            raise CoarticError(f"after is {asked.after}, but runs of {place.row} {why}")


def planned_cells(asked: Contrast, places: Iterable[Place]) -> dict[tuple[str, str], Cell]:
    """Map the world and the family of each cell of a contrast to its planned runs.

    The family of a task of no family is its name. A contrast across worlds has the names of all its
    worlds as its world. At least one task of a cell has all terms.
    """
    cells = defaultdict[tuple[str, str], Cell](lambda: defaultdict(dict))
    across = " against ".join(
        dict.fromkeys(world_title(term.world or "") for term in asked.weights)
    )
    for place in places:
        for term in asked.terms_at(place):
            world = across if asked.is_across else place.world
            cells[world, place.family or place.task][place.task][term] = place
    whole = len(asked.weights)
    return {key: cell for key, cell in cells.items() if whole in {len(of) for of in cell.values()}}


def _tested(asked: Contrast, cells: Mapping[tuple[str, str], Cell]) -> list[tuple[str, str]]:
    """Return the cells with enough planned tasks for a test."""
    whole = len(asked.weights)
    return [
        key for key, cell in cells.items()
        if asked.expected and sum(len(terms) == whole for terms in cell.values()) >= MIN_TESTED
    ]  # fmt: skip


def rows_of(
    asked: Contrast, places: Sequence[Place], values_of: ValuesOf, cells: int | None = None
) -> Iterator[dict[str, Any]]:
    """Yield the answer of a contrast in each cell (:attr:`.Study.contrasts` lists the entries).

    p is corrected over the number of ``cells``, by default those of ``places``. A contrast of which
    no task has all methods has one row, which says so.
    """
    planned = planned_cells(asked, places)
    tested = _tested(asked, planned)
    count = len(tested) if cells is None else max(cells, len(tested))
    fixed = {place.task for place in places if not place.family}
    values = {key: _values(asked, cell, values_of) for key, cell in planned.items()}
    rows = {
        key: _over_runs(frame) if key[1] in fixed else _over_tasks(asked, frame)
        for key, frame in values.items()
    }
    adjusted = dict(zip(tested, holm([rows[key]["p"] for key in tested], count), strict=True))
    for world in dict.fromkeys(world for world, _ in planned):
        drawn = [values[key] for key in planned if key[0] == world and key[1] not in fixed]
        if len(drawn) > 1:
            rows[world, ALL] = _over_tasks(asked, pd.concat(drawn)) | {"p": np.nan}
    order = {world: None for world, _ in planned}
    for key in [key for world in order for key in rows if key[0] == world]:
        p = adjusted.get(key, np.nan)
        described = key[1] in {*fixed, ALL} or not asked.expected
        words = ("", "") if described else _verdict(rows[key], p, count)
        yield _question(asked) | {
            "world": key[0], "family": key[1], **rows[key], "p_holm": p,
            "verdict": words[0], "note": words[1],
        }  # fmt: skip
    if not planned:
        note = "no task of the folder has all of its methods"
        yield _question(asked) | {
            "world": "", "family": "", **_over_tasks(asked, _values(asked, {}, values_of)),
            "p_holm": np.nan, "verdict": NOT_TESTED if asked.expected else "", "note": note,
        }  # fmt: skip


def _question(asked: Contrast) -> dict[str, Any]:
    """Return the entries of a row that repeat the question."""
    return {"contrast": asked.name, "says": asked.says, "quantity": asked.quantity,
            "expected": asked.expected or ""}  # fmt: skip


def _verdict(row: Mapping[str, Any], p: float, cells: int) -> tuple[str, str]:
    """Return the verdict on a cell, and the note on what limits it."""
    if row["dropped"] > row["tasks"] / 10:
        return NOT_TESTED, f"{pluralize(row['dropped'], 'task')} with failed or missing runs"
    if np.isnan(p) or row["n"] < MIN_TESTED:
        return NOT_TESTED, "too few tasks"
    verdict, no = OPEN, row["n"] - row["yes"] - row["equal"]
    if p < LEVEL and 2 * row["yes"] > row["n"]:
        verdict = SHOWN
    elif p < LEVEL and 2 * no > row["n"]:
        verdict = OPPOSITE
    notes, low, high = [], row["beyond_low"], row["beyond_high"]
    if low * high > 0 and np.sign(low) != {SHOWN: 1, OPPOSITE: -1}.get(verdict, 0):
        notes.append("mean differs from most tasks")
    if 2.0 ** (1 - row["n"]) * cells >= LEVEL:
        notes.append(f"too few tasks for a correction over {pluralize(cells, 'cell')}")
    return verdict, "; ".join(notes)


def _over_tasks(asked: Contrast, by_task: pd.DataFrame) -> dict[str, Any]:
    """Return the numbers of a cell: counts, median and mean over tasks, and the sign test.

    ``beyond_low`` and ``beyond_high`` are the ends of the interval of the mean beyond the bound, in
    the expected direction.
    """
    values = by_task.value.dropna().to_numpy(np.float64)
    beyond = {
        "above": values - asked.bound,
        "below": asked.bound - values,
        "within": asked.bound - np.abs(values),
        None: values,
    }[asked.side]
    yes, no = int((beyond > 0).sum()), int((beyond < 0).sum())
    row = _counts(by_task) | {"yes": yes, "equal": len(values) - yes - no}
    row |= dict(zip(("median", "median_low", "median_high"), _median(values), strict=True))
    row |= dict(zip(("mean", "mean_low", "mean_high"), _mean([values]), strict=True))
    row |= {"beyond_low": np.nan, "beyond_high": np.nan, "p": np.nan}
    if asked.expected and len(values):
        _, row["beyond_low"], row["beyond_high"] = _mean([beyond])
        row["p"] = stats.binomtest(yes, yes + no).pvalue if yes + no else 1.0
    return row


def _over_runs(of_task: pd.DataFrame) -> dict[str, Any]:
    """Return the numbers of a task of no family: the value with its interval over runs."""
    samples = [weight * values for weight, values in of_task.samples.iloc[0]]
    value, low, high = (np.nan,) * 3 if of_task.value.isna().all() else _mean(samples)
    if any(1 < len(sample) < MIN_VALUES for sample in samples):
        low, high = np.nan, np.nan
    row = _counts(of_task) | {"yes": pd.NA, "equal": pd.NA}
    row |= dict.fromkeys(("median", "median_low", "median_high"), np.nan)
    row |= {"mean": value, "mean_low": low, "mean_high": high}
    return row | dict.fromkeys(("beyond_low", "beyond_high", "p"), np.nan)


def _counts(by_task: pd.DataFrame) -> dict[str, Any]:
    """Return the numbers of tasks of a cell, and the ids of its runs."""
    return {
        "tasks": len(by_task),
        "n": int(by_task.value.notna().sum()),
        "dropped": int(by_task.dropped.sum()),
        "not_applicable": int(by_task.not_applicable.sum()),
        "run_ids": " ".join(chain(*by_task.run_ids)),
    }


def _median(values: Array) -> tuple[float, float, float]:
    """Return the median with the ends of its interval, which are NaN for fewer than six values."""
    if not len(values):
        return np.nan, np.nan, np.nan
    if len(values) < MIN_TESTED:
        return float(np.median(values)), np.nan, np.nan
    low, high = stats.quantile_test(values, p=0.5).confidence_interval(1 - LEVEL)
    return float(np.median(values)), float(low), float(high)


def _mean(samples: Sequence[Array]) -> tuple[float, float, float]:
    """Return the sum of the means of samples, with the ends of its BCa interval."""
    value = float(sum(sample.mean() for sample in samples)) if all(map(len, samples)) else np.nan
    drawn = [sample for sample in samples if len(sample) > 1 and np.ptp(sample) > 0]
    if np.isnan(value) or not drawn:
        ends = value if any(len(sample) > 1 for sample in samples) else np.nan
        return value, ends, ends
    fixed = value - sum(sample.mean() for sample in drawn)
    interval = stats.bootstrap(
        drawn,
        lambda *of, axis: fixed + sum(sample.mean(axis=axis) for sample in of),
        method="BCa",
        vectorized=True,
        rng=np.random.default_rng(SEED),
    ).confidence_interval
    return value, float(interval.low), float(interval.high)


def _values(asked: Contrast, cell: Cell, values_of: ValuesOf) -> pd.DataFrame:
    """Return the value of a contrast on each task of a cell.

    Columns are ``task``, ``dropped`` (a run failed or is missing), ``not_applicable`` (a run has no
    such value), ``value``, which is NaN in both cases, ``samples``, the weight and the values of
    the runs of each term, and ``run_ids``.
    """
    rows = []
    for task, terms in cell.items():
        of_terms = {term: values_of(asked, place) for term, place in terms.items()}
        samples = [(term.weight, values.amounts) for term, values in of_terms.items()]
        failed = len(terms) < len(asked.weights) or any(of.failed for of in of_terms.values())
        missing = not failed and any(np.isnan(values).any() for _, values in samples)
        value = np.nan
        if not (failed or missing):
            value = float(sum(weight * values.mean() for weight, values in samples))
        ids = [*chain(*(values.run_ids for values in of_terms.values()))]
        rows.append((task, failed, missing, value, samples, ids))
    names = ["task", "dropped", "not_applicable", "value", "samples", "run_ids"]
    return pd.DataFrame(rows, columns=names).astype({"dropped": bool, "not_applicable": bool})
