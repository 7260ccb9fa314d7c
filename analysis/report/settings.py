"""Make the finding of a study that varies parameters.

The finding says which setting is best, and how each parameter changes the gap.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pandas as pd

from coartic.analysis.methods import (
    are_numbers,
    default_name,
    describe_values,
    subject_of,
    title_of,
)
from coartic.analysis.standings import (
    has_few_runs,
    ranked_tasks,
    ranking_budget,
    reference,
    standings,
)
from coartic.analysis.study import Study
from coartic.analysis.tables import list_differences, list_parameters, values_of_parameters
from coartic.analysis.words import interval, listed, number
from coartic.estimates import LEVEL, MIN_VALUES

TOO_FEW = f" (too few runs to test, which needs {MIN_VALUES})"
MAX_NAMED = 3
"""Largest number of settings that the finding names because their gaps do not differ significantly
from the gap of the best setting. Further settings are counted."""


def answer_on_parameters(study: Study) -> list[str]:
    """Return the finding of a study that varies parameters, as a list of lines.

    Returns
    -------
    list of str
        - A line on the best setting: its gap; the settings that do not differ significantly from it
          or, if there are none, the setting that comes next; the default setting; and the
          parameters of which another value is better on average.
        - For each parameter, a line on how much its values change the gap
          (:func:`.list_parameters`).
        - If there are settings that are worse than the corrective process alone with its best
          hands, a line with their number.

        The list is empty if no setting is ranked.
    """
    rows = standings(study).query("why == ''")
    if not len(rows):
        return []
    effects = [_effect_of(study, str(parameter)) for parameter in study.varied.columns]
    return [*filter(None, [_best_setting(study, rows), *effects, _settings_behind(study, rows)])]


def _best_setting(study: Study, rows: pd.DataFrame) -> str:
    """Return sentences on the best setting.

    ``rows`` contains the ranked settings in order, the best one first.
    """
    best, base = str(rows.index[0]), str(rows.method_id.iloc[0])
    method = {**rows.iloc[0], "title": title_of(study.declared[base])}
    others = list_differences(study)
    is_alike = (others.p_holm >= LEVEL) | (others.difference == 0)
    alike, unlike = others.method[is_alike].tolist(), others.method[~is_alike].tolist()
    sentences = [
        f"The best setting of {subject_of(method)} is {_words(study, best)}: its gap "
        f"to the {reference(study, ranked_tasks(study))} is "
        f"{interval(rows.loc[best], 'gap', scale=100, unit=' %')}."
    ]
    named = alike[:MAX_NAMED] or unlike[:1]
    with_gaps = [f"{_words(study, label)} ({_gap_of(rows.gap[label])})" for label in named]
    if alike:
        if more := alike[MAX_NAMED:]:
            with_gaps.append(f"and {len(more)} more (up to {_gap_of(max(rows.gap[more]))})")
        sentences.append(f"It cannot be told apart from {'; '.join(with_gaps)}.")
    elif unlike:
        few = TOO_FEW if has_few_runs(study, [best, *named], ranked_tasks(study)) else ""
        sentences.append(f"The next is {with_gaps[0]}{few}.")
    for label in {*rows.index[rows.setting == ""]} - {best, *named}:
        subject = f"The {default_name(base).removeprefix('the ')} setting"
        gap = _gap_of(rows.gap[label])
        sentences.append(f"{subject}, {_words(study, label)}, has a gap of {gap}.")
    table, best_of = list_parameters(study), study.varied.loc[best]
    worse = []
    for parameter, values in table.groupby("parameter", sort=False):
        by_value = dict(zip(values.value, values.gap, strict=True))
        least = min(by_value, key=by_value.__getitem__)
        p = dict(zip(values.value, values.p_holm, strict=True)).get(str(best_of[str(parameter)]))
        is_chance = p is not None and p >= LEVEL
        if not is_chance and by_value.get(str(best_of[str(parameter)]), 0.0) > by_value[least]:
            worse.append(f"{parameter} is best at {least}")
    if worse:
        sentences.append(
            "It is not made of the best value of each parameter: on average over the others, "
            f"{listed(worse)}."
        )
    return " ".join(sentences)


def _effect_of(study: Study, parameter: str) -> str:
    """Return a sentence on how much the values of a parameter change the gap.

    If the values cannot be compared, the sentence says so.
    """
    table = list_parameters(study)
    rows = table[table.parameter == parameter]
    if not len(rows):
        return (
            f"{parameter}: its values are not compared, because they did not run with the same "
            "values of the other parameters."
        )
    compared = values_of_parameters(study)[parameter]
    subject = f"{parameter}, {_range_of([value.value for value in compared])}:"
    if rows.equal.all():
        return f"{subject} changes nothing; every run has the same reward at each value."
    apart, on_average, at_best = f"{_points(rows.gap)} points", "", ""
    if others := [name for name in study.varied.columns if name != parameter]:
        on_average = f" on average over {'the other parameters' if others[1:] else others[0]}"
        if rows.at_best.notna().all():
            values = "their best values" if others[1:] else "its best value"
            at_best = f"{_points(rows.at_best)} at {values}"
    alike, is_tested = rows.value[rows.p_holm >= LEVEL].tolist(), rows.p_holm.notna().any()
    if len(alike) == len(rows) - 1:
        shown = f"{subject} no difference is shown{on_average} (gaps are {apart} apart"
        return f"{shown}{f', and {at_best}' if at_best else ''})."
    change = f"the gap by {apart}{on_average}{f', and by {at_best}' if at_best else ''}"
    labels = [label for value in compared for label in value.labels]
    is_few = not is_tested and has_few_runs(study, labels, ranked_tasks(study))
    few = TOO_FEW if is_few else ""
    least = f"it is smallest at {rows.value.iloc[int(rows.gap.argmin())]}"
    least += f", which cannot be told apart from {listed(alike)}" if alike else ""
    return f"{subject} changes {change}{few}; {least}."


def _settings_behind(study: Study, rows: pd.DataFrame) -> str:
    """Return a sentence on the ranked settings that are worse than the corrective process.

    ``rows`` are the ranked settings. The corrective process acts alone, with its best hands. A
    setting is worse if its mean share of the possible gain is below 0. The result is the empty
    string if there is no such setting.
    """
    behind = rows[rows.share < 0]
    if not len(behind):
        return ""
    count, budget = len(behind), ranking_budget(study)
    hands = "its best hands"
    if any(not len(study.sequences(task)) for task in ranked_tasks(study)):
        hands = "its best hands, or the initial ones of tasks with too many sequences,"
    who = f"{count} of {len(rows)} settings stay{'s' if count == 1 else ''}"
    who = f"All {count} settings stay" if count == len(rows) else who
    trials = f" in {number(budget)} trials" if budget else ""
    open_ones = int((behind.share_high >= 0).sum())
    chance = f", {open_ones} of them within chance" if open_ones else ""
    chance = ", within chance" if open_ones == count else chance
    return f"{who} behind the corrective process with {hands}{trials}{chance}."


def _words(study: Study, label: str) -> str:
    """Return the values of the varied parameters in the setting ``label`` in words."""
    return describe_values(dict(zip(study.varied.columns, study.varied.loc[label], strict=True)))


def _gap_of(gap: float) -> str:
    """Return a gap, which is a fraction, as a string in per cent."""
    return f"{number(100 * gap, 1)} %"


def _points(gaps: pd.Series) -> str:
    """Return the largest minus the smallest gap (fractions) as a string, in percentage points."""
    return number(100 * float(gaps.max() - gaps.min()), 1)


def _range_of(values: Sequence[Any]) -> str:
    """Return the values of a parameter in words.

    At least three numbers become a range, such as ``0.02 to 0.2``. Otherwise, up to four values are
    listed, and more values are only counted, such as ``5 values``.
    """
    if are_numbers(values) and len(values) > 2:
        return f"{values[0]} to {values[-1]}"
    return listed(map(str, values)) if len(values) <= 4 else f"{len(values)} values"
