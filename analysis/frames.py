"""Compute gaps, shares of the possible gain, means and rankings from a DataFrame of results.

``load(folder).runs`` is such a frame, and you can make your own. Such a frame contains a row for
each run, and the columns

- ``method`` and ``task``;
- ``reward``: negative ticks, NaN for a failed run;
- ``mean_ticks`` and ``motor_noise``, only for runs in a world with noise, whose ``reward`` is NaN;
- ``best_known``: the best known reward of the task, negative ticks;
- ``corrective_best``, only for shares: the reward of the corrective process alone with its best
  hands, negative ticks.

Gaps, shares and rankings are computed from the *value* of each run: its reward, or minus its
``mean_ticks`` in a world with motor noise (:func:`.run_values`). The *gap* of a run is the fraction
``(best known - value) / |best known|``: 0.01 stands for 1 % more ticks than the best known reward.
It is NaN if the value or the best known reward is NaN, and can be negative by chance in a world
with noise. If you have the costs of an ``Objective``, use their negatives as rewards.

The functions raise CoarticError for a frame with wrong rewards:

- A value is neither a finite number nor missing (NaN), or is above 0 (rewards are negative, costs
  positive).
- Without noise, a value is above the best known reward.
- A best known reward is 0.
- The frame has a column ``status``, which is ``ok`` for a run without noise and without a value, or
  is not ``ok`` for a run with a value.

Functions with a result for each method also raise CoarticError if the frame has a column ``world``
that names several worlds.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from pandas.api.types import is_hashable

from coartic.analysis.optima import relative_gap, run_values
from coartic.analysis.statistics import task_mean
from coartic.analysis.words import listed
from coartic.errors import CoarticError
from coartic.estimates import NEGLIGIBLE, Estimate, mean
from coartic.internal.limits import brief_value
from coartic.internal.text import plain, pluralize
from coartic.runs.plan import label_of, world_title

SCORES = ("reward", "best_known")
ZERO = "corrective_best"
"""Column of the reward at which the share of the possible gain is 0."""
MIN_GAIN = 0.01
"""Smallest possible gain for which a share is computed, as a fraction of the best known reward. The
possible gain is the difference between the best known reward and the reward of the corrective
process alone. A smaller gain is a few ticks, so that one tick changes the share much. With noise it
is about as large as the standard errors of these two mean rewards."""
DUPLICATE = (
    "a run must not occur twice (if runs of two sources have the same numbers, add a column seed, "
    "folder or run_id; number the draws of a bootstrap in a column run)"
)
_SOURCES = ("folder", "seed", "run_id", "run")
"""Columns that together identify a run among the runs of one method on one task. Each of these
columns is optional."""


def checked(
    frame: pd.DataFrame,
    *,
    numbers: Sequence[str] = (),
    names: Sequence[str] = (),
    others: Sequence[str] = (),
) -> pd.DataFrame:
    """Check a user's frame, and return a copy of the columns that are asked for.

    If ``numbers`` contains ``reward``, the result has further columns:

    - ``mean_ticks`` and ``motor_noise``, if the frame has them, as columns of numbers;
    - ``value``: the value of the run (:func:`.run_values`), computed from ``reward`` and
      ``mean_ticks``;
    - ``is_noisy``: True for a run whose ``motor_noise`` is above 0; False for all runs if the frame
      does not have ``motor_noise``;
    - ``status``, if the frame has it. The status is checked against the value: for a run with
      status ``ok``, the reward or the mean ticks must be given (for a run with noise both can be
      missing, :func:`.judge`); for a run with any other status, both must be missing.

    Parameters
    ----------
    frame : DataFrame
        The user's frame.
    numbers : sequence of str
        Columns of numbers, or of text that spells numbers. They are returned as float64, with NaN
        for missing numbers.
    names : sequence of str
        Columns without missing values. They are returned as they are.
    others : sequence of str
        Other columns. They are returned as they are.

    Returns
    -------
    DataFrame
        The checked columns, with the index of ``frame``. The levels of the index have no names,
        because such a name could also be the name of a column.

    Raises
    ------
    CoarticError
        - ``frame`` is not a DataFrame, it has no rows, or a column is missing.
        - A value in a column of ``names`` is missing.
        - A value in a column of ``numbers`` is neither a finite number nor missing (NaN).
        - The status of a run contradicts its value.
    """
    if not isinstance(frame, pd.DataFrame):
        raise CoarticError(f"the frame is a {type(frame).__name__}; it must be a pandas.DataFrame")
    has_value, there = "reward" in numbers, {*frame.columns}
    status = ["status"] if has_value and "status" in there else []
    of_noise = [name for name in ("mean_ticks", "motor_noise") if has_value and name in there]
    numbers = [*numbers, *of_noise]
    wanted = [*dict.fromkeys((*names, *others, *status, *numbers))]
    if missing := [name for name in wanted if name not in there]:
        raise CoarticError(
            f"the frame has no column {', '.join(map(inline, missing))}; it needs "
            f"{', '.join(map(inline, wanted))}"
        )
    if not len(frame):
        raise CoarticError("the frame has no rows; it must have at least one")
    columns = frame[wanted].copy()
    columns.index = columns.index.set_names([None] * columns.index.nlevels)
    not_na = "it must be a name; read_csv reads some names as NA, unless keep_default_na=False"
    for name in names:
        refuse_rows(columns, name, columns[name].isna(), not_na)
    for name in numbers:
        try:
            of_name = columns[name].astype("Float64")
            values = of_name.to_numpy(np.float64, na_value=np.nan)
        except (TypeError, ValueError) as error:
            raise CoarticError(
                f"column {inline(name)} has values that are not numbers ({error}); each value must "
                "be a finite number or missing (NaN)"
            ) from None
        refuse_rows(columns, name, np.isinf(values), "it must be a finite number")
        columns[name] = values
    if has_value:
        is_noisy = columns.motor_noise > 0 if "motor_noise" in of_noise else False
        columns = columns.assign(value=run_values(columns), is_noisy=is_noisy)
    if status:
        is_ok = columns.status.astype(object) == "ok"
        rule = "a run must have a reward if its status is ok, and NaN otherwise"
        is_wrong = (is_ok != columns.value.notna()) & ~(is_ok & columns.is_noisy)
        refuse_rows(columns, "status", is_wrong, rule)
    return columns


def inline(name: object) -> str:
    """Return the name of a column as one printable line of at most 2,000 characters."""
    return plain(str(name))


def _names_given(what: str, names: str | Sequence[str]) -> list[str]:
    """Return one or several names of columns as a list.

    A string is treated as one name. Raises CoarticError if ``names`` is neither a string nor an
    iterable of hashable objects. ``what`` is the name of the argument in the error message.
    """
    if isinstance(names, str):
        return [names]
    if not isinstance(names, Iterable) or not all(map(is_hashable, listed := list(names))):
        raise CoarticError(f"{what} is {brief_value(names)}; it must have names of columns")
    return listed


def refuse_rows(frame: pd.DataFrame, column: str, wrong: ArrayLike, needed: str) -> None:
    """Raise CoarticError if at least one row of a frame is wrong.

    Parameters
    ----------
    frame : DataFrame
    column : str
        Column that has the wrong values. The message shows its value in the first wrong row.
    wrong : array_like of bool, shape (rows,)
        True for each wrong row.
    needed : str
        End of the message: what would be right.
    """
    if (rows := np.flatnonzero(np.asarray(wrong, dtype=bool))).size:
        (value,), (row,) = frame[column].iloc[rows[:1]].tolist(), frame.index[rows[:1]].tolist()
        raise CoarticError(
            f"column {inline(column)} has {brief_value(value)} in row {brief_value(row)}: {needed}"
        )


def _with_gaps(columns: pd.DataFrame) -> pd.DataFrame:
    """Return a copy of checked columns with new columns ``gap`` and ``share``.

    gap = (best known - value) / |best known|
    share = (value - zero) / (best known - zero),

    where zero is the reward in column :data:`ZERO`. Gap and share are fractions, and are NaN if the
    value or the best known reward is NaN. Without column :data:`ZERO` there is no column ``share``.
    The share is also NaN if

    - zero is NaN, or is not below the best known reward;
    - zero is less than 1 % below the best known reward (:data:`MIN_GAIN`). In a world with noise,
      this zero is the mean over the runs with this best known reward.

    Raises
    ------
    CoarticError
        - A value or a best known reward is above 0.
        - A best known reward is 0.
        - Without noise, a reward is above the best known reward by more than a rounding error
          (:data:`NEGLIGIBLE`), or zero is above the best known reward. In a world with noise, both
          can happen by chance and are allowed.
    """
    for name in ("reward", "value", "best_known"):
        sign = "a reward must be minus the ticks; for a cost, such as best_cost, use the negative"
        refuse_rows(columns, name, columns[name] > 0, sign)
    share = "a gap is a share of the best known reward, which must be below 0"
    refuse_rows(columns, "best_known", columns.best_known == 0, share)
    excess = (columns.value - columns.best_known).mask(columns.is_noisy)
    highest = "it is above best_known, which must be the highest reward of the task"
    refuse_rows(columns, "reward", excess > NEGLIGIBLE * columns.best_known.abs(), highest)
    columns = columns.assign(gap=relative_gap(columns.value, columns.best_known))
    if ZERO not in columns:
        return columns
    possible = columns.best_known - columns[ZERO]
    refuse_rows(columns, ZERO, (possible < 0) & ~columns.is_noisy, highest)
    of_task = possible.groupby(columns.best_known).transform("mean")  # in noise zeros differ by run
    gain = possible.mask(columns.is_noisy, of_task)
    is_enough = (possible > 0) & ~(gain < MIN_GAIN * columns.best_known.abs())
    possible = possible.where(is_enough)
    return columns.assign(share=(columns.value - columns[ZERO]) / possible)


def _refuse_worlds(frame: pd.DataFrame) -> None:
    """Raise CoarticError if a frame has a column ``world`` with more than one world."""
    if "world" not in {*getattr(frame, "columns", ())}:
        return
    worlds = dict.fromkeys(frame.world.astype(object).where(frame.world.notna(), "").astype(str))
    if len(worlds) > 1:
        first = next(iter(worlds))
        raise CoarticError(
            f"column world has {listed(map(world_title, worlds))}; runs in different worlds "
            f"are not compared. Take those in one world: frame[frame.world == {first!r}]"
        )


def scored(frame: pd.DataFrame, *more: str) -> pd.DataFrame:
    """Check a user's frame of methods on tasks, and return it with gaps and shares.

    Parameters
    ----------
    frame : DataFrame
        The user's frame, with the columns of :func:`ranking`.
    *more : str
        Names of further columns of numbers, which are checked and returned.

    Returns
    -------
    DataFrame
        A copy of the columns that are needed (:func:`checked`), with these new or changed columns:

        - ``gap``, and ``share`` if the frame has ``corrective_best`` (:func:`_with_gaps`);
        - ``method``: name of the method. It includes the setting if the method occurs in the frame
          with several settings;
        - ``task``: number of the task, from 0, in the alphabetical order of the names of tasks;
        - ``key``: number of the run. All rows of one run have the same number. Two rows belong to
          the same run if they agree in method, in task, and in all columns of :data:`_SOURCES` that
          the frame contains. If the frame contains none of these columns, each row is a run of its
          own.

    Raises
    ------
    CoarticError
        - The frame is wrong (:func:`checked`, :func:`_with_gaps`).
        - It has runs in several worlds (column ``world``).
        - A task has more than one ``best_known`` or, without noise, more than one
          ``corrective_best``.
    """
    _refuse_worlds(frame)
    existing = [*getattr(frame, "columns", ())]
    numbers = (*SCORES, *([ZERO] if ZERO in existing else []), *more)
    others = [name for name in ("setting", *_SOURCES) if name in existing]
    columns = _with_gaps(checked(frame, names=("method", "task"), numbers=numbers, others=others))
    number, tasks = pd.factorize(columns.task)
    task = np.argsort(np.argsort([*map(str, tasks)], kind="stable"))[number]  # the order of names
    for name in {"best_known", ZERO} & {*columns}:
        is_ambiguous = columns[name].groupby(task).transform("nunique") > 1
        is_ambiguous &= ~columns.is_noisy | (name != ZERO)  # in noise each run has a zero
        refuse_rows(columns, "task", is_ambiguous, f"the task must have one {name}, not several")
    names = columns.method.to_numpy(object)
    if "setting" in existing:
        settings = columns.setting.astype(object).where(columns.setting.notna(), "").astype(str)
        is_varied = settings.groupby(pd.factorize(names)[0]).transform("nunique") > 1
        labels = np.array([*map(label_of, map(str, names), settings)], dtype=object)
        names = np.where(is_varied, labels, names)
    frame = columns.assign(task=task, method=pd.Series(names, columns.index, dtype=object))
    keys = [name for name in _SOURCES if name in existing]
    run = frame.groupby(["method", "task", *keys], dropna=False, sort=False).ngroup()
    return frame.assign(key=run if keys else np.arange(len(frame)))


def _scored_runs(frame: pd.DataFrame, *more: str) -> pd.DataFrame:
    """Check a frame with one row for each run, and return it as :func:`scored` does.

    Raises CoarticError if the frame is wrong (:func:`scored`), or if two rows belong to one run.
    """
    runs = scored(frame, *more)
    refuse_rows(runs, "method", runs.duplicated("key"), f"{DUPLICATE}; each run must have one row")
    return runs


def shares(frame: pd.DataFrame) -> pd.Series:
    """Return the share of the possible gain that each run reached.

    The share is 0 for a run that is as good as the corrective process alone, and 1 for a run that
    reaches the best known reward.

    Parameters
    ----------
    frame : DataFrame
        A row for each run, with columns ``reward``, ``best_known`` and ``corrective_best``, in
        negative ticks. ``corrective_best`` is the reward of the corrective process alone with its
        best hands; :attr:`.Study.corrective_best` has the exceptions. Runs in a world with motor
        noise have ``mean_ticks`` and ``motor_noise`` instead of a reward.

    Returns
    -------
    Series
        (value - corrective_best) / (best_known - corrective_best) as a fraction, with the index of
        ``frame``. The value of a run is its reward or minus its mean ticks. The share is negative
        if the corrective process alone is better than the run. It is NaN if one of the three
        numbers is NaN, or if nearly nothing can be gained:

        - the best known reward of the run is not above its ``corrective_best``;
        - ``best_known - corrective_best`` is less than 1 % of the best known reward. In a world
          with noise, this is the mean over all runs with the same best known reward.

    Raises
    ------
    CoarticError
        A column is missing, a reward is wrong, or, without noise, ``corrective_best`` is above the
        best known reward.

    Examples
    --------
    >>> frame = pd.DataFrame(
    ...     {"reward": [-319, -300], "best_known": -292, "corrective_best": -319}
    ... )
    >>> shares(frame).round(2).tolist()
    [0.0, 0.7]
    """
    return _with_gaps(checked(frame, numbers=(*SCORES, ZERO))).share.set_axis(frame.index)


def means(
    frame: pd.DataFrame, by: str | Sequence[str], columns: str | Sequence[str]
) -> pd.DataFrame:
    """Return the mean of each group of rows, with its 95 % interval.

    Parameters
    ----------
    frame : DataFrame
        A row for each task or for each run. The rows of a group are a sample of independent values.
    by : str or sequence of str
        Names of the columns whose values define the groups. NaN counts as a value, so that rows
        with NaN form groups, too.
    columns : str or sequence of str
        Names of the columns of numbers whose means are computed. Entries that are NaN are left out
        of a mean.

    Returns
    -------
    DataFrame
        A row for each group, in the order in which the groups first appear in ``frame``. It has

        - the columns in ``by``;
        - ``rows``: the number of rows of the group, including rows with NaN in ``columns``;
        - for each column ``x`` in ``columns``: the mean ``x``, and the ends ``x_low`` and
          ``x_high`` of its 95 % interval (:func:`coartic.analysis.mean`), in the unit of the
          column. The mean is NaN without values, and the ends are NaN with fewer than five values.

    Raises
    ------
    CoarticError
        - ``frame`` is not a DataFrame, it has no rows, or a column is missing.
        - A value in ``columns`` is neither a finite number nor NaN.
        - ``by`` is empty, or ``by`` or ``columns`` does not consist of names.
    ValueError
        A value in ``columns``, other than 0, has an absolute value below 1e-100 or above 1e100.

    Examples
    --------
    >>> frame = pd.DataFrame({"h": [0] * 5 + [1] * 5, "gap": [0.1, 0.2, 0.3, 0.4, 0.5] + [0.1] * 5})
    >>> means(frame, ["h"], ["gap"]).round(2)
       h  rows  gap  gap_low  gap_high
    0  0     5  0.3     0.18      0.42
    1  1     5  0.1     0.10      0.10
    """
    by, columns = _names_given("by", by), _names_given("columns", columns)
    if not by:
        raise CoarticError("by is empty; it must have names of columns")
    values, rows = checked(frame, numbers=columns, others=by), []
    for key, group in values.groupby(by, sort=False, dropna=False, observed=True):
        row = {**dict(zip(by, key, strict=True)), "rows": len(group)}
        for name in columns:
            numbers = group[name].dropna().to_numpy(dtype=np.float64)
            row |= (mean(numbers) if len(numbers) else Estimate(np.nan)).columns(name)
        rows.append(row)
    return pd.DataFrame(rows)


def by_task(frame: pd.DataFrame) -> pd.DataFrame:
    """Return the mean reward, gap and share of each method on each task.

    Parameters
    ----------
    frame : DataFrame
        With columns ``method``, ``task``, ``reward`` and ``best_known`` (negative ticks), and
        optionally ``setting`` and ``corrective_best`` (:func:`ranking`).

    Returns
    -------
    DataFrame
        A row for each pair of task and method, in the order in which the pairs first appear in
        ``frame``:

        - ``task``: name of the task;
        - ``method``: name of the method. It includes the setting if the method occurs in the frame
          with several settings;
        - ``reward``: mean reward, negative ticks (in a world with noise, minus the mean of
          ``mean_ticks``);
        - ``n``: number of solved runs;
        - ``gap``: mean gap, a fraction;
        - ``share``: mean share of the possible gain, a fraction (:func:`shares`); only if the frame
          has ``corrective_best``.

        Each mean leaves out runs without a value in its column. It is NaN if no run is left.

    Raises
    ------
    CoarticError
        A column or a name is missing, a reward is wrong (:func:`shares`), a task has more than one
        best known reward or, without noise, more than one ``corrective_best``, a run has two rows
        (:func:`ranking`), or column ``world`` names several worlds.

    Examples
    --------
    >>> frame = pd.DataFrame(
    ...     {"method": "mine", "task": "ascending", "reward": [-300, -296], "best_known": -292}
    ... )
    >>> by_task(frame).round(3)
            task method  reward  n    gap
    0  ascending   mine  -298.0  2  0.021
    """
    values = _scored_runs(frame).assign(task=frame.task)
    scores = [name for name in ("gap", "share") if name in values]
    groups = values.groupby(["task", "method"], sort=False)
    table = groups.agg(reward=("value", "mean"), n=("value", "count")).join(groups[scores].mean())
    return table.reset_index()


def ranking(frame: pd.DataFrame) -> pd.DataFrame:
    """Rank methods by their mean gap to the best known rewards of tasks.

    A method is ranked if it has runs on all tasks with a best known reward, and all these runs are
    solved.

    Parameters
    ----------
    frame : DataFrame
        A row for each run, with columns ``method``, ``task`` (names, numbers or tuples), ``reward``
        and ``best_known`` (negative ticks). Optional columns:

        - ``setting``: setting of the method. If a method has several settings, the ranking has a
          row for each of them, such as ``"cma-es/bandit sigma=0.1"``;
        - ``ranked_as``: name of the row of the ranking to which the run belongs. It is used instead
          of ``method`` and ``setting``;
        - ``folder``, ``seed``, ``run_id`` and ``run``: together they identify a run of a method on
          a task. A frame without these columns has a run in each row;
        - ``corrective_best``: reward of the corrective process alone with its best hands, which
          shares need (:func:`shares`);
        - ``budget``: the number of trials that was asked for, missing for a method without trials;
        - ``note``: what readers should know about the run; empty or missing if there is nothing;
        - ``mean_ticks`` and ``motor_noise``: a run with ``motor_noise`` above 0 has mean ticks
          instead of a reward;
        - ``world``: name of the run's world, empty for the paper's world. All runs must have the
          same world.

        ``load(folder).runs`` contains all of these columns except ``folder``. If the folder
        contains several worlds, ``load(folder).worlds`` contains a study for each world.

    Returns
    -------
    DataFrame
        A row for each method, indexed by the name of the method. Ranked methods come first, in
        ascending order of their gaps; methods that are not ranked follow. All gaps and shares are
        fractions.

        - ``gap``: mean gap: the mean over tasks of the mean over the runs on each task. It is NaN
          for a method that is not ranked. ``gap_low`` and ``gap_high`` are the ends of its 95 %
          interval for other runs on the same tasks; they are NaN with fewer than five runs on a
          task.
        - ``share``, ``share_low``, ``share_high``: mean share of the possible gain
          (:func:`shares`), over the tasks on which something can be gained. It is NaN for a method
          that is not ranked. ``without_gain`` is the number of the tasks counted in column
          ``tasks`` on which no run has a share. Only for a frame with ``corrective_best``.
        - ``tasks``: number of tasks with a best known reward on which the method has runs, all of
          them solved.
        - ``runs`` and ``failed``: number of runs, and number of failed runs, on all tasks.
        - ``why``: the reason why the method is not ranked, such as ``"1 of 2 tasks"`` or ``"6 of 9
          runs failed"``; empty for a ranked method.
        - ``note``: the notes on the method's runs, joined by semicolons, each note once. Only for a
          frame with ``note``.

        Tasks without a best known reward are left out of mean gaps and mean shares.

    Raises
    ------
    CoarticError
        - A column or a name is missing, or a reward is wrong (:func:`shares`).
        - A task has more than one best known reward or, without noise, more than one
          ``corrective_best``.
        - A run has two rows.
        - Runs have different budgets.
        - Column ``world`` names several worlds.

    Examples
    --------
    >>> frame = pd.DataFrame(
    ...     {"method": ["mine", "mine", "yours"], "task": ["ascending", "descending", "ascending"],
    ...      "reward": [-300, -320, -310], "best_known": [-292, -304, -292]}
    ... )
    >>> ranking(frame)[["gap", "failed", "why"]].round(3)
              gap  failed           why
    method
    mine     0.04       0
    yours     NaN       0  1 of 2 tasks
    """
    existing = {*getattr(frame, "columns", ())}
    if "ranked_as" in existing:
        frame = frame.drop(columns=["method", "setting"], errors="ignore")
        frame = frame.rename(columns={"ranked_as": "method"})
    runs = _scored_runs(frame, *(("budget",) if "budget" in existing else ()))
    if "note" in existing:
        runs["note"] = frame["note"].to_numpy(object)
    asked = sorted(runs.budget.dropna().unique()) if "budget" in existing else []
    if len(asked) > 1:
        budgets = [f"{budget:.0f}" for budget in asked]
        raise CoarticError(
            f"column budget has {' and '.join(budgets)} trials; methods are only ranked with equal "
            "numbers of trials. Rank those with one number, and methods without trials: "
            f"frame[frame.budget.isna() | (frame.budget == {budgets[0]})]"
        )
    known = runs[runs.best_known.notna()]
    tasks = known.task.nunique()
    by_method = dict([*known.groupby("method", sort=False)])
    rows = []
    for method, of_method in runs.groupby("method", sort=False):
        of_tasks = by_method.get(method, known[:0])
        failed = of_tasks.gap.isna()
        solved = of_tasks[~of_tasks.task.isin(of_tasks.task[failed])]
        reasons = [
            (
                f"{of_tasks.task.nunique()} of {pluralize(tasks, 'task')}"
                if of_tasks.task.nunique() < tasks
                else ""
            ),
            (f"{failed.sum()} of {pluralize(len(of_tasks), 'run')} failed" if failed.any() else ""),
            ("no best known reward" if not tasks else ""),
        ]
        why = "; ".join(filter(None, reasons))
        by_task = [part for _, part in solved.groupby("task").gap]
        row = (Estimate(np.nan) if why else task_mean(by_task)).columns("gap")
        if "share" in runs:
            parts = [part for _, part in solved.dropna(subset="share").groupby("task").share]
            row |= (Estimate(np.nan) if why or not parts else task_mean(parts)).columns("share")
            row["without_gain"] = len(by_task) - len(parts)
        counts = {"tasks": len(by_task), "runs": len(of_method)}
        rows.append(row | counts | {"failed": int(of_method.value.isna().sum()), "why": why})
        if "note" in runs:
            rows[-1]["note"] = "; ".join(filter(None, map(str, of_method.note.dropna().unique())))
    methods = pd.Index([*runs.method.unique()], name="method", tupleize_cols=False)
    return pd.DataFrame(rows, methods).sort_values("gap", kind="stable")
