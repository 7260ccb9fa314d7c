"""Table of section *Random tasks*: gaps by family."""

from __future__ import annotations

import itertools
import math
from functools import lru_cache

import numpy as np
import pandas as pd

from coartic.analysis.standings import (
    compared_runs,
    runs_by_method,
)
from coartic.analysis.statistics import (
    Scores,
    other_tasks,
)
from coartic.analysis.study import Study
from coartic.analysis.tables.language import Row, Rows, run_ids, table
from coartic.estimates import (
    Estimate,
)


@lru_cache(maxsize=4)
def _instances(study: Study) -> dict[str, list[str]]:
    """Return a dict that maps each family to the names of its instances.

    Instances are random tasks of a family. Instances without a best known reward, and families
    without any other instance, are left out. The dict is cached: do not change it.
    """
    families: dict[str, list[str]] = {}
    for name in study.optima:
        if (family := study.tasks[name].family) is not None:
            families.setdefault(family, []).append(name)
    return families


@lru_cache(maxsize=4)
def instance_runs(study: Study) -> pd.DataFrame:
    """Return the runs of each method on the instances on which all its runs are solved.

    Instances without a best known reward are left out. Runs are sorted by family and instance, in
    the order of :func:`_instances`. Column ``method`` contains the label of the row of the ranking
    to which the run belongs. The frame is cached: do not change it.
    """
    runs = compared_runs(study)
    names = [*itertools.chain.from_iterable(_instances(study).values())]
    failed = runs.value.isna().groupby([runs.ranked_as, runs.task]).transform("any")
    runs = runs[runs.task.isin(names) & ~failed]
    place = pd.Categorical(runs.task, names)
    runs = runs.assign(place=place, method=runs.ranked_as)
    return runs.sort_values("place", kind="stable")


def gaps_by_family(study: Study, runs: pd.DataFrame) -> Scores:
    """Return a dict that maps each family to a method's gaps on its instances.

    Parameters
    ----------
    study : Study
    runs : DataFrame
        The method's rows of :func:`instance_runs`.

    Returns
    -------
    dict
        Maps each family to a list with an array for each instance: the gaps of the runs on this
        instance, fractions, shape ``(runs,)``. A family is left out if one of its instances with a
        best known reward has no run in ``runs``.
    """
    return {
        str(family): [
            gaps.to_numpy(np.float64) for _, gaps in of_family.groupby("task", sort=False).gap
        ]
        for family, of_family in runs.groupby("family", sort=False)
        if of_family.task.nunique() == len(_instances(study)[str(family)])
    }


@table(
    "Gap to the {reference}, in per cent of it: mean over instances",
    """
    method    | method    |   | tex
    instances | instances
    missing   | missing
    gap[]     | gap (%)   | 1 | tex
    in [*]    | {} (%)    | 1 | tex
    """,
)
def list_family_gaps(study: Study) -> Rows:
    """Yield each method's mean gap on instances, for each family and over families.

    A family *has two arms* if its tasks may be solved with both hands. Only instances with a best
    known reward are used. Columns:

    - ``in FAMILY``: mean gap over the instances of the family, a fraction. It is NaN unless the
      method has runs on all instances of the family, and all these runs are solved;
    - ``gap``: mean of ``in FAMILY`` over all families with two arms. It is NaN if one of them is
      NaN, or if there is no such family;
    - ``instances``: number of instances on which the method has runs and all of them are solved;
    - ``missing``: number of all other instances.

    ``instances`` and ``missing`` count only instances of families with two arms. For a method that
    ran on no such family, they count the instances of the families on which the method ran.
    Intervals are for other tasks of the families. Methods without runs on instances are left out.
    Rows are in ascending order of ``gap``; rows in which it is NaN come last.
    """
    solved_runs, rows, families = instance_runs(study), list[tuple[str, Row]](), _instances(study)
    two_armed = {family for family in families if len(study.tasks[families[family][0]].hands) > 1}
    for method, of_method in runs_by_method(study).items():
        runs, ran = solved_runs[solved_runs.method == method], {*of_method.family.dropna()}
        scores, over = gaps_by_family(study, runs), two_armed if two_armed & ran else ran
        solved = runs[runs.family.isin(over)].task.nunique()
        missing = sum(len(families[family]) for family in over) - solved
        row: Row = {"method": method, "instances": solved, "missing": missing}
        gap = Estimate(math.nan)
        if two_armed and two_armed <= scores.keys():
            gap = other_tasks({family: scores[family] for family in scores if family in two_armed})
        row |= gap.columns("gap")
        for family in families:
            has_all = family in scores
            in_family = other_tasks({family: scores[family]}) if has_all else Estimate(math.nan)
            row |= in_family.columns(f"in {family}")
        if ran:
            rows.append((method, row | run_ids(runs)))
    yield from sorted(rows, key=lambda item: (math.isnan(item[1]["gap"]), item[1]["gap"]))
