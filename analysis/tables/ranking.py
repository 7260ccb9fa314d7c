"""Tables of section *Ranking*: methods, differences and parameters."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from coartic.analysis.methods import (
    EC1,
    EC4,
    are_numbers,
    default_name,
)
from coartic.analysis.optima import relative_gap
from coartic.analysis.standings import (
    PLACES,
    compared_runs,
    ranked_tasks,
    ranking_budget,
    runs_by_method,
    runs_on,
    solved_tasks,
    standings,
)
from coartic.analysis.statistics import (
    bootstrap_test,
    exchange_test,
    holm,
    stratified_test,
)
from coartic.analysis.study import Study, best_after, improvements, shared_cells, solved
from coartic.analysis.tables.language import Row, Rows, run_ids, table
from coartic.estimates import (
    FEWER_RESAMPLES,
    LEVEL,
    MIN_VALUES,
    Estimate,
    mean_of_means,
)
from coartic.internal.text import one_line
from coartic.robot import Array

_EARLY = 1_000
"""Number of trials after which column ``gap_early`` of the ranking reports the gap."""


@lru_cache(maxsize=4)
def _counts_against_learner(study: Study) -> dict[str, dict[str, int]]:
    """Count the individual tasks on which each method is better or worse than the learner.

    The learner is EC1 on a task for one arm, and EC4 on a task for two arms. A task is counted if

    - both methods solved all their runs on the task, and
    - the means of their values differ significantly. The p-values are Holm-adjusted over the tasks
      of the method.

    The test is the two-sided exchange test (:func:`.exchange_test`). For a deterministic method,
    whose value is exact, it is the bootstrap test (:func:`.bootstrap_test`). The tests are not
    paired, although runs with the same number have the same seed.

    Returns
    -------
    dict
        Maps the label of each method to a dict with the numbers of tasks on which it is ``better``
        and ``worse``. A method is left out if there is no test of it, or if even the smallest
        ``least_p`` of its tests (:class:`.Estimate`) would not be significant after the adjustment.
    """
    counts = dict[str, dict[str, int]]()
    for label, stochastic in study.methods.stochastic.items():
        ahead, tests = list[bool](), list[Estimate]()
        for name, task in study.individual_tasks.items():
            learning = EC4 if len(task.hands) > 1 else EC1
            runs, learner = (
                shared_cells(study).get((name, each)) for each in (str(label), learning)
            )
            if runs is None or learner is None or label == learning:
                continue
            rewards, learned = (solved(cell).value.to_numpy(np.float64) for cell in (runs, learner))
            if len(rewards) == len(runs) and len(learned) == len(learner):
                ahead.append(bool(rewards.mean() > learned.mean()))
                if min(len(learned), len(rewards) if stochastic else MIN_VALUES) < MIN_VALUES:
                    tests.append(Estimate(math.nan))
                elif stochastic:
                    tests.append(exchange_test(learned, rewards, "two-sided"))
                else:
                    tests.append(bootstrap_test(learned, float(rewards[0]), "two-sided"))
        least = [test.least_p for test in tests if not math.isnan(test.least_p)]
        if least and len(least) * min(least) < LEVEL:
            sure = [
                better
                for better, p in zip(ahead, holm([test.p for test in tests]), strict=True)
                if p < LEVEL
            ]
            counts[str(label)] = {"better": sum(sure), "worse": len(sure) - sum(sure)}
    return counts


def _mean_gap_after(study: Study, trials: int) -> pd.Series:
    """Return the mean gap of each method after a number of trials, over tasks.

    The gap of a run is the gap of its best trial among the first ``trials`` trials. If the rewards
    of the trials of a run are not stored, the final gap of the run is used. The result is the mean
    over tasks of the mean over runs. It is NaN for a method if one of its runs had not found a
    solution by then, or if the study looks at fewer of its trials (:attr:`.Study.after`). In a
    world with noise, where the best trial so far is partly luck, the result is NaN for all methods.
    The Series is indexed by the labels of the rows of the ranking.
    """
    runs = compared_runs(study)
    if study.is_noisy:
        return pd.Series(math.nan, runs.ranked_as.unique())
    learned = improvements(study)
    best = [
        float(best_after(learned[run_id], trials))
        if not math.isnan(reward) and len(learned.get(run_id, ((),))[0])
        else reward
        for run_id, reward in zip(runs.run_id, runs.reward.astype(float), strict=True)
    ]
    gaps = pd.Series(relative_gap(best, runs.best_known.astype(float)), runs.index)
    if study.after is not None and study.after < trials:
        gaps = gaps.where(runs.hands.notna())  # missing of runs that made more trials
    cells = gaps.groupby([runs.ranked_as, runs.task])
    by_task = cells.mean().where(cells.count() == cells.size())
    methods = by_task.groupby(level=0)
    return methods.mean().where(methods.count() == methods.size())


def _standing_rows(study: Study, *, ranked: bool) -> Rows:
    """Yield the rows of table ``ranking`` or, if ``ranked`` is False, of table ``not-ranked``.

    The rows are in the order of :func:`.standings`.
    """
    rows = standings(study)
    rows = rows[(rows.why == "") == ranked]
    single = [task for task in ranked_tasks(study) if task in study.individual_tasks]
    early = _mean_gap_after(study, _EARLY).to_dict() if ranked and len(rows) else {}
    for label, row in rows.iterrows():
        runs = runs_by_method(study).get(str(label), compared_runs(study)[:0])
        gaps = runs.groupby("task").gap.mean()
        counts = [
            counts
            for name in runs.label.unique()
            if (counts := _counts_against_learner(study).get(name))
        ]
        entries: Row = {"method": label}
        entries |= {name: row[name] for name in ("gap", "gap_low", "gap_high")}
        entries |= {name: row[name] for name in ("information", "note", "runs")}
        entries |= {
            name: sum(count[name] for count in counts) if counts else math.nan
            for name in ("better", "worse")
        }
        entries |= {f"on {task}": gaps.get(task, math.nan) for task in single}
        if ranked:
            names = ("without_gain", "share", "share_low", "share_high")
            entries |= {name: row[name] for name in (*names, *PLACES)}
            entries |= {"gap_early": early[label]}
            entries |= {name: runs[name].mean() for name in ("forward_kinematics", "cpu_s")}
        else:
            entries |= {name: row[name] for name in ("why", "tasks", "failed")}
        yield str(label), entries | run_ids(runs)


@table(
    "Gap and share of the possible gain, means over {tasks}, and gap on each",
    """
    method             | method                            |   | tex
    place              | place
    place_low
    place_high
    separated
    gap[]              | gap (%)                           | 1 | tex
    share[]            | share of the gain (%)             | 0 | tex
    information        | use of the reward
    better             | better than the learner on (tasks)
    worse              | worse on (tasks)
    gap_early
    on *               | {} (%)                            | 1 | tex
    note               | note                              |   | tex
    without_gain
    forward_kinematics
    cpu_s
    runs               | runs
    """,
    with_settings=True,
)
def list_ranking(study: Study) -> Rows:
    """Yield a row for each ranked method (:func:`.standings`), the smallest gap first.

    A row contains means over tasks of the gap, of the share of the possible gain, and of the gap
    after 1,000 trials (``gap_early``). It also contains the gap on each individual task that has a
    best known reward, and mean costs over runs: the number of forward-kinematics evaluations and
    the CPU time (in s). The place is a 95 % interval, and ``separated`` is about the method in the
    next row (:func:`.standings`). Columns ``better`` and ``worse`` are numbers of individual tasks
    on which the method differs significantly from the learner. Gaps and shares are fractions.
    """
    return _standing_rows(study, ranked=True)


@table(
    "Methods that are not ranked",
    """
    method      | method                             |   | tex
    why         | why not                            |   | tex
    gap[]       | gap (%)                            | 1
    information | use of the reward
    better      | better than the learner on (tasks)
    worse       | worse on (tasks)
    on *        | {} (%)                             | 1 | tex
    note        | note                               |   | tex
    tasks       | solved tasks
    runs        | runs
    failed      | failed runs
    """,
    with_settings=True,
)
def list_not_ranked(study: Study) -> Rows:
    """Yield a row for each method that is not ranked (:func:`.standings`), with the reason.

    For each individual task with a best known reward, a row contains the mean gap of the solved
    runs, a fraction. If the method solved all runs on all ranked tasks, but was asked for another
    number of trials than the ranked methods, the row also contains its mean gap over tasks.
    """
    return _standing_rows(study, ranked=False)


@table(
    "Gap of each method less the gap of the one that it is compared with, on the tasks that the "
    "latter solved (positive: the method in the first column is worse; p is corrected over the "
    "comparisons with it, intervals are not)",
    """
    method       | method                   |   | tex
    against      | compared with            |   | tex
    difference[] | difference of gaps (%)   | 1 | tex
    p_holm       | p (corrected)            | p | tex
    tasks        | tasks                    |   | tex
    runs         | runs
    """,
)
def list_differences(study: Study) -> Rows:
    """Yield the difference between each method's mean gap and that of a reference method.

    The difference is the mean gap of the method minus the mean gap of the reference method, a
    fraction. Both means are over the tasks on which the reference method solved all runs. The rows
    with the same reference method are in ascending order of the difference. The reference method is

    - :attr:`.Study.against`, if it is not empty;
    - otherwise, if the study varies parameters and a setting is ranked, the first setting of the
      ranking;
    - otherwise each method from a file in turn, if it solved all its runs on some task. A method
      from a file is compared only with the built-in methods that use the reward in the same way.

    A method is left out if

    - on one of the tasks of the comparison, the method has no runs or a failed run;
    - it was asked for another number of trials than the reference method, unless all numbers of
      trials are ranked together (:func:`.ranking_budget` is None);
    - it is a setting or an ablation of a method that ran (column ``parent`` of
      :attr:`.Study.methods`).

    Intervals are for other runs on the same tasks. The p-values are two-sided
    (:func:`.stratified_test`) and Holm-adjusted over the rows with the same reference method.
    """
    methods, rows = study.methods, standings(study)
    solved_some = [label for label in rows.index if solved_tasks(study, str(label))]
    chosen = [study.against] if study.against else []
    if not study.varied.empty and not study.against:
        chosen = [*rows.index[rows.why == ""][:1]]
    own = [label for label in solved_some if not methods.built_in[label]]
    for against in chosen or own:
        tasks, found = solved_tasks(study, against), list[tuple[Estimate, str]]()
        asked = {*runs_on(study, against, tasks).budget.dropna()}
        alike = methods.built_in & (methods.information == methods.information[against])
        if chosen:
            alike = methods.index != against
        for row in methods.index[alike & (methods.parent == "")].intersection(rows.index):
            runs = runs_on(study, row, tasks) if tasks else compared_runs(study)[:0]
            names = runs.ranked_as.unique()
            name = names[0] if len(names) == 1 else row
            budgets = {*runs.budget.dropna()}
            is_fair = budgets == asked or not (budgets and asked) or ranking_budget(study) is None
            if len(runs) and runs.value.notna().all() and is_fair and name != against:
                gaps = [_gaps_by_task(study, of, tasks) for of in (name, against)]
                found.append((_difference_of_gaps(*gaps), name))
        adjusted = holm([difference.p for difference, _ in found]) if found else []
        in_order = sorted(zip(found, adjusted, strict=True), key=lambda item: item[0][0].value)
        for (difference, name), p in in_order:
            runs = runs_on(study, name, tasks)
            entries: Row = {"method": name, "against": against}
            entries |= {"tasks": len(tasks), "runs": len(runs)}
            entries |= {**difference.columns("difference"), "p_holm": p}
            yield f"{against} {name}", entries | run_ids(runs, runs_on(study, against, tasks))


_Gaps = Sequence[Array | float]
"""A list with an entry for each task: the gaps of a method's runs, shape ``(runs,)``, or a float
that is the exact gap of a deterministic method."""


def _gaps_by_task(study: Study, method: str, tasks: Sequence[str]) -> _Gaps:
    """Return the gaps of a method on each task, in the order of ``tasks``.

    ``method`` is the label of the method or of a row of the ranking, with runs on all tasks in
    ``tasks``. For each task, the result contains an array with the gaps of the runs or, for a
    deterministic method, a float: the exact gap.
    """
    by_task = runs_on(study, method, tasks).groupby("task").gap
    gaps = [by_task.get_group(task).to_numpy(np.float64) for task in tasks]
    return gaps if study.methods.stochastic[method] else [float(of.mean()) for of in gaps]


def _mean_of_gaps(gaps: _Gaps) -> Estimate:
    """Return the mean gap over tasks, with its interval for other runs.

    The result is the mean over tasks of the mean over runs. There is no interval if all gaps are
    exact, or if a sample has fewer than five runs.
    """
    return _sum_of_gaps([(1 / len(gaps), of) for of in gaps])


def _difference_of_gaps(first: _Gaps, second: _Gaps) -> Estimate:
    """Return the mean gap of a first method minus the mean gap of a second method.

    Both means are over the same tasks. The interval is for other runs on these tasks. The p-value
    is that of :func:`.stratified_test`. There is no interval and no p-value if all gaps are exact,
    or if a sample has fewer than five runs.
    """
    parts = [(sign / len(of), gaps) for sign, of in ((1, first), (-1, second)) for gaps in of]
    p = stratified_test([*zip(first, second, strict=True)])
    return replace(_sum_of_gaps(parts), p=p)


def _sum_of_gaps(parts: Sequence[tuple[float, Array | float]]) -> Estimate:
    """Return a weighted sum of mean gaps, with its interval for other runs.

    Each part is a pair: a weight, and either an array with the gaps of the runs on a task or a
    float, the exact gap. There is no interval if all gaps are exact, or if an array has fewer than
    five gaps.
    """
    exact = sum(weight * gaps for weight, gaps in parts if isinstance(gaps, float))
    drawn = [(weight, gaps) for weight, gaps in parts if not isinstance(gaps, float)]
    if not drawn:
        return Estimate(exact)
    weights, samples = zip(*drawn, strict=True)
    sampled = mean_of_means(samples, weights, FEWER_RESAMPLES)
    return Estimate(sampled.value + exact, sampled.low + exact, sampled.high + exact)


class ValueOfParameter(NamedTuple):
    """A value of a parameter that a study varies, with the settings that are compared."""

    value: Any
    labels: list[str]
    """Labels of the settings with this value that are compared (:func:`values_of_parameters`).
    Settings at the same position in the lists of two values of a parameter have equal values of all
    other parameters."""
    at_best: str
    """Label of the compared setting with this value whose other parameters have the same values as
    in the best setting; empty if there is none."""


@lru_cache(maxsize=4)
def values_of_parameters(study: Study) -> dict[str, list[ValueOfParameter]]:
    """Return the values of each varied parameter, with the settings that can be compared.

    The values of a parameter are compared at equal values of all other parameters. Only ranked
    settings are compared. A combination of values of the other parameters is used only if it was
    ranked together with each ranked value of the parameter.

    Returns
    -------
    dict of str to list of ValueOfParameter
        Maps the name of each parameter to its values; numbers are in ascending order. A list is
        empty if no combination can be used, or if only one value is ranked. The dict is empty if
        the study does not vary parameters, or if fewer than two settings are ranked. The dict is
        cached: do not change it.
    """
    ranked = standings(study).query("why == ''").index
    varied = study.varied[study.varied.index.isin(ranked)]
    if len(varied) < 2:
        return {}
    found = dict[str, list[ValueOfParameter]]()
    for parameter in map(str, varied.columns):
        by_others, values = defaultdict[str, dict[str, str]](dict), dict[str, Any]()
        for label, setting in zip(map(str, varied.index), varied.to_dict("records"), strict=True):
            value = setting.pop(parameter)
            values[repr(value)] = value
            by_others[repr(setting)][repr(value)] = label
        complete = [labels for labels in by_others.values() if len(labels) == len(values)]
        at_best = next((labels for labels in complete if ranked[0] in labels.values()), {})
        in_order = [*values]
        if are_numbers(values.values()):
            in_order.sort(key=values.__getitem__)
        found[parameter] = [
            ValueOfParameter(
                values[text], [labels[text] for labels in complete], at_best.get(text, "")
            )
            for text in in_order
            if complete and len(values) > 1
        ]
    return found


def gaps_of_settings(study: Study, labels: Sequence[str]) -> pd.Series:
    """Return the mean gap over settings, for each task and number of a run.

    Runs with the same number on a task have the same seed in all settings. Therefore the mean of
    their gaps is the unit of resampling. ``labels`` are the labels of the settings. The result is a
    Series of fractions, indexed by task and number of the run. A pair of task and number is left
    out if one of the settings has no such run.
    """
    runs = compared_runs(study)
    runs = runs[runs.ranked_as.isin(labels)]
    by_run = runs.groupby(["task", "run"], sort=False).gap.agg(["mean", "size"])
    return by_run["mean"][by_run["size"] == len(labels)]


@table(
    "Gap by value of each varied parameter, means over the values of the other parameters",
    """
    parameter    | parameter                                        |   | tex
    value        | value                                            |   | tex
    gap[]        | gap (%)                                          | 1 | tex
    at_best      | gap at the best setting of the others (%)        | 1 | tex
    difference[] | difference from the best value (%)               | 1 | tex
    p_holm       | p (corrected)                                    | p | tex
    default      | default
    equal
    settings     | settings
    runs         | runs
    """,
)
def list_parameters(study: Study) -> Rows:
    """Yield a row for each value of each varied parameter whose values can be compared.

    :func:`values_of_parameters` says which values can be compared. A parameter is left out if, for
    one of its values, the compared settings have no run number in common on some task. Columns:

    - ``gap``: mean gap over the compared settings with this value and over tasks, a fraction, with
      its interval for other runs on the same tasks;
    - ``at_best``: gap of the setting that has this value, and differs from the setting with the
      smallest gap in this parameter at most. It is NaN if this setting is not compared;
    - ``difference`` and ``p_holm``: difference from the value with the smallest gap, and its
      p-value (:func:`.stratified_test`), Holm-adjusted over the values of the parameter. Both are
      NaN for the value with the smallest gap itself;
    - ``default``: name of the default value (:func:`.default_name`); empty for any other value;
    - ``equal``: True if the parameter has no effect, that is, each run has the same score at all
      values.
    """
    tasks, ranks, methods = ranked_tasks(study), standings(study), study.methods
    for parameter, values in values_of_parameters(study).items():
        samples = list[_Gaps]()
        for value in values:
            gaps = gaps_of_settings(study, value.labels)
            by_task = [gaps[task].to_numpy(np.float64) for task in tasks if task in gaps]
            is_random = any(methods.stochastic[value.labels])
            samples.append(by_task if is_random else [float(of.mean()) for of in by_task])
        if not values or min(map(len, samples)) < len(tasks):  # no run that all settings have
            continue
        estimates = [*map(_mean_of_gaps, samples)]
        best = int(np.argmin([estimate.value for estimate in estimates]))
        differences = [_difference_of_gaps(sample, samples[best]) for sample in samples]
        p = holm([each.p for place, each in enumerate(differences) if place != best])
        p.insert(best, math.nan)
        base = str(methods.method_id[values[0].labels[0]])
        default = study.declared[base].defaults.get(parameter)
        same = _are_equal(study, [value.labels for value in values])
        rows = zip(values, estimates, differences, p, strict=True)
        for place, (value, estimate, difference, adjusted) in enumerate(rows):
            runs = compared_runs(study)
            runs = runs[runs.ranked_as.isin(value.labels)]
            difference = Estimate(math.nan) if place == best else difference
            entries: Row = {"parameter": parameter, "value": one_line(str(value.value))}
            entries |= {**estimate.columns("gap"), **difference.columns("difference")}
            entries["at_best"] = ranks.gap[value.at_best] if value.at_best else math.nan
            entries |= {"p_holm": adjusted, "equal": same}
            is_default = repr(value.value) == repr(default)
            entries["default"] = default_name(base) * is_default
            entries |= {"settings": len(value.labels), "runs": len(runs)}
            yield f"{parameter} {value.value}", entries | run_ids(runs)


def _are_equal(study: Study, settings: Sequence[Sequence[str]]) -> bool:
    """Return True if a parameter has no effect: all its values give the same scores.

    ``settings`` contains a list of labels of settings for each value of the parameter. Settings at
    the same position in two lists differ only in this parameter. Their runs with the same task and
    number are compared by their scores (column ``value`` of :attr:`.Study.runs`).
    """
    by_run = compared_runs(study).set_index(["task", "run"])
    for labels in zip(*settings, strict=True):
        first, *others = (by_run.value[by_run.ranked_as == label].sort_index() for label in labels)
        if not all(first.equals(other) for other in others):
            return False
    return True
