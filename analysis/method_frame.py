"""The frame of methods: a row for each method of a study, with what the method is."""

from __future__ import annotations

import itertools
import json
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Set
from typing import TYPE_CHECKING, Any

import pandas as pd

from coartic.analysis.methods import (
    COLORS,
    CONDITION_OF,
    EC1,
    INFORMED_LEARNERS,
    KNOWN_METHODS,
    LEARNERS,
    MARKS,
    SEARCHES,
    title_of,
)
from coartic.internal.text import one_line
from coartic.learner.conditions import CONDITIONS, METHOD_PREFIX
from coartic.method import Information
from coartic.runs.plan import in_words

if TYPE_CHECKING:
    from coartic.runs.method_info import MethodInfo

BY_TRIAL, BY_FORMULA, WITHOUT_REWARD = GROUPS = (
    "using the reward of each trial",
    "using the reward as a formula",
    "not using the reward",
)
"""Groups of methods by their use of the reward."""
OWN_COLOR, OWN_MARK = "walnut", "star"
"""Colour of the first nine methods from files, and mark of the very first: no built-in method has
this colour or this mark."""


MARK = " ‡"
"""Mark behind the title of a method against which something was found (:attr:`.Study.marks`)."""


def methods_of(
    runs: pd.DataFrame, declared: Mapping[str, MethodInfo], marked: Collection[str] = ()
) -> pd.DataFrame:
    """Return a row for each method with its setting, and for each pair of learners that
    :func:`_joined_learners` joins: built-in methods in the order of ``methods.toml``, then methods
    from files in the order of the suite. The row of a pair stands for the runs of the second
    learner, and of the first on other tasks; most columns are as in the row of the second.

    Parameters
    ----------
    runs : DataFrame
        A row for each run, with the columns of :attr:`.Study.runs`, in the order of the suite.
    declared : mapping of str to MethodInfo
        Declaration of each method, by its id without a setting.
    marked : collection of str, optional
        Ids of methods whose titles get :data:`MARK`.

    Returns
    -------
    DataFrame
        By the label of the method, with the columns of :attr:`.Study.methods`.
    """
    rows, by_label = dict[str, dict[str, Any]](), dict([*runs.groupby("label", sort=False)])
    varied, values = parameter_varied(runs)
    shown = Counter(map(title_of, declared.values()))
    for label, of_method in by_label.items():
        base, setting = of_method.method.iloc[0], of_method.setting.iloc[0]
        named = setting
        if label in values:
            which = ", the paper's" if base in LEARNERS else ", default"
            named = in_words({varied: values[label]}) + which * (not setting)
        info = declared[base]
        facts = KNOWN_METHODS.get(base) if info.is_ours else None
        default = base if setting else facts.ablation_of if facts else ""
        called = info if shown[title_of(info)] == 1 else base  # of two names alike: the ids
        under = default if default in by_label and label not in values else ""
        rows[label] = {
            "base": base,
            "condition": CONDITION_OF.get(base, ""),
            "setting": setting,
            "parts": (label,),
            "title": title_of(called, named) + MARK * (base in marked),
            "short": title_of(base, named, short=True) + MARK * (base in marked),
            "algorithm": facts.algorithm if facts else one_line(label),
            "is_learner": base in LEARNERS,
            "is_search": base in SEARCHES,
            "information": _group_of(of_method),
            "built_in": info.is_ours,
            "stochastic": info.stochastic,
            "headline": facts is None or facts.headline,
            "under": under,
            "look": tuple(facts.look) if facts and not setting else (),
        }
    tasks = {label: {*of_method.task} for label, of_method in by_label.items()}
    for label, (one, two) in _joined_learners(tasks):
        conditions = label.partition(" ")[2].replace("-informed", "")
        names = {"title": f"{rows[two]['algorithm']} {conditions}"}
        names["short"] = f"{rows[two]['short'].rpartition(' ')[0]} {conditions}"
        rows[label] = rows[two] | {"parts": (one, two)} | names
    for label, look in _looks_of(rows):
        rows[label]["look"] = look
    place = {name: number for number, name in enumerate(KNOWN_METHODS)}
    ordered = sorted(rows, key=lambda label: place.get(rows[label]["base"], len(place)))
    return pd.DataFrame([rows[label] for label in ordered], ordered).rename_axis("method")


def parameter_varied(runs: pd.DataFrame) -> tuple[str, dict[str, Any]]:
    """Return the name of a parameter and its values by label, from low to high if all are numbers,
    if all runs except searches for the optimum are of one method, with two or more values of this
    parameter, each on all their tasks, and equal others; or else an empty name and no value.
    ``runs`` are as in :func:`methods_of`."""
    runs = runs[~runs.method.isin(SEARCHES)]
    tasks = runs.groupby("label", sort=False).task.nunique()
    texts = runs.drop_duplicates("label").set_index("label").parameters
    by_label = {str(label): json.loads(text) for label, text in texts.items()}
    names = {name for each in by_label.values() for name in each}
    differ = [n for n in names if len({repr(each.get(n)) for each in by_label.values()}) > 1]
    if len({*runs.method}) != 1 or len(differ) != 1 or (tasks < runs.task.nunique()).any():
        return "", {}
    values = {label: each.get(differ[0]) for label, each in by_label.items()}
    if all(type(value) in (int, float) for value in values.values()):
        values = dict(sorted(values.items(), key=lambda each: each[1]))
    return differ[0], values


def _group_of(runs: pd.DataFrame) -> str:
    """Return the group of a method, one of :data:`GROUPS`, from its runs.

    ``using the reward of each trial`` if the method declares this reward and a run made more than
    one trial; or else ``using the reward as a formula`` if it declares the formula; or else ``not
    using the reward``.
    """
    information = {each for text in runs.information.unique() for each in text.split(", ")}
    if (runs.trials > 1).any() and Information.REWARD_BY_TRIAL.value in information:
        return BY_TRIAL
    return BY_FORMULA if Information.REWARD_FORMULA.value in information else WITHOUT_REWARD


def _joined_learners(tasks: Mapping[Any, Set[Any]]) -> Iterator[tuple[str, tuple[str, str]]]:
    """Yield the label of each row that joins two methods of the learner, with their ids: EC1 and a
    condition that draws hands at random; or both informed learners.

    ``tasks``: names of the tasks on which each method ran, by label. A row needs tasks of its
    second method, and tasks of its first on which the second did not run.
    """
    drawing = [x for x in LEARNERS if CONDITIONS[CONDITION_OF[x]].hand_exploration == "random"]
    for one, two in (*((EC1, label) for label in drawing), INFORMED_LEARNERS):
        one_armed, two_armed = (tasks.get(each, set()) for each in (one, two))
        if two_armed and one_armed - two_armed:
            yield joined_label(one, two), (one, two)


def joined_label(one: str, two: str) -> str:
    """Return the label of the row that joins the methods ``one`` and ``two`` (ids) of the learner,
    such as ``dual-process (EC1, EC4)``."""
    return f"{METHOD_PREFIX.rstrip('/')} ({CONDITION_OF[one]}, {CONDITION_OF[two]})"


def with_joined_learners(by_method: dict[Any, pd.DataFrame]) -> dict[Any, pd.DataFrame]:
    """Return runs by label: first the runs of joined learners (:func:`_joined_learners`), by
    :func:`joined_label` (runs of the first method on tasks on which the second did not run, and all
    runs of the second), then the runs of each given method."""
    tasks = {method: {*runs.task} for method, runs in by_method.items()}
    joined = {
        label: pd.concat([by_method[one][~by_method[one].task.isin(tasks[two])], by_method[two]])
        for label, (one, two) in _joined_learners(tasks)
    }
    return joined | by_method


def _looks_of(rows: Mapping[str, dict[str, Any]]) -> Iterator[tuple[str, tuple[str, str]]]:
    """Yield the label of each row with its names of colour and mark: its ``look``, if it has one;
    for the first methods from files :data:`OWN_COLOR` and a mark; for others the next, after the
    last again the first, of the pairs that are in no ``look``, unused colours before others."""
    fixed = {row["look"] for row in rows.values()}
    taken = {look[0] for look in fixed if look}
    colors = [color for color in COLORS if color not in (OWN_COLOR, "ink")]
    colors.sort(key=taken.__contains__)
    marks = [mark for mark in MARKS if mark != OWN_MARK]
    pairs = ((c, marks[(k + shift) % len(marks)]) for shift in range(len(marks))
             for k, c in enumerate(colors))  # fmt: skip
    free = itertools.cycle(pair for pair in pairs if pair not in fixed)
    theirs = itertools.chain(((OWN_COLOR, mark) for mark in MARKS), free)
    for label in sorted(rows, key=lambda label: bool(rows[label]["built_in"])):
        row = rows[label]
        yield label, row["look"] or next(free if row["built_in"] else theirs)


def without_settings(rows: pd.DataFrame) -> pd.DataFrame:
    """Return ``rows``, some rows of :attr:`.Study.methods`, without settings and ablations of
    methods that are in ``rows``, too (column ``under``): values of a varied parameter stay."""
    return rows[~rows.under.isin(rows.index)]


def headline_methods(rows: pd.DataFrame) -> list[str]:
    """Return the labels of the rows that represent their algorithms (column ``headline``), among
    ``rows``, some rows of :attr:`.Study.methods`; all labels if no row does.

    Settings count as in :func:`without_settings`. A row that joins conditions of the learner takes
    the place of all rows of its algorithm; of several such rows only the last counts, with the
    condition that explores most.
    """
    kept = without_settings(rows)
    kept = kept[kept.headline]
    joined = kept[kept.parts.map(len) > 1].groupby("algorithm").tail(1)
    kept = kept[~kept.algorithm.isin(joined.algorithm) | kept.index.isin(joined.index)]
    return [*(kept if len(kept) else rows).index]
