"""Describe methods: facts about the built-in methods, and a frame of the methods of a study.

Each method declares its facts itself. :func:`methods_of` returns the frame.
"""

from __future__ import annotations

import itertools
import json
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

from coartic.internal.text import one_line
from coartic.learner.conditions import CONDITIONS, EVERY_CONDITION, INFORMED, METHOD_PREFIX
from coartic.method import Information, Method, built_in_methods

if TYPE_CHECKING:
    import pandas as pd

    from coartic.runs.method_info import MethodInfo

CONDITION_OF = {f"{METHOD_PREFIX}{name}": name for name in EVERY_CONDITION}
"""Ids of the learner's conditions, including informed ones and ablations, by id of the method."""
LEARNERS = EC1, EC2, EC3, EC4 = tuple(CONDITION_OF)[: len(CONDITIONS)]
"""Ids of the learner under the paper's conditions: EC1 for one arm, and EC2, EC3 and EC4 for two
arms."""
INFORMED_LEARNERS = tuple(f"{METHOD_PREFIX}{name}" for name in INFORMED)
"""Ids of the informed learner, for one arm and for two arms."""
RANKED_TOGETHER = {EC1: (EC4, EC3), INFORMED_LEARNERS[0]: INFORMED_LEARNERS[1:]}
"""Ids of conditions for two arms by the id of the condition for one arm with which the first of
them that ran has one row in the ranking."""
RANDOM_SEARCH = "random-search"
"""Id of random search, which selects the best of random targets around corrective postures."""


COLORS = {
    "ink": "#000000",
    "walnut": "#4a2b18",
    "grape": "#4b2a9b",
    "navy": "#00558f",
    "forest": "#007c52",
    "rust": "#d55e00",
    "silver": "#8c8c8c",
    "azure": "#5bb8ea",
    "rose": "#dc9fc3",
    "amber": "#eba717",
}
"""Colours of methods by name, from dark to light. ``page.css`` has lighter ones for a dark page."""
OWN_COLOR, OWN_MARK = "walnut", "star"
"""Colour of the first nine methods from files, and marker of the first one. No built-in method has
this colour or this marker."""
ORDER = ("azure", "rust", "navy", "rose", "ink", "grape", "silver", "amber", "forest")
"""Colours of the built-in methods of a group, in the order of these methods."""
MARKS: dict[str, Any] = {
    "star": ("*", "-"),
    "diamond": ("D", (0, (9, 1.5))),
    "circle": ("o", (0, (1, 1.2))),
    "triangle": ("^", (0, (3, 1, 1, 1, 1, 1))),
    "square": ("s", (0, (4, 1.5))),
    "inverted-triangle": ("v", (0, (2, 2))),
    "plus": ("P", (0, (5, 1.2, 1, 1.2))),
    "cross": ("X", (0, (7, 1, 3, 1))),
    "thin-diamond": ("d", "-"),
}
"""Markers of methods as Matplotlib names them, each with the dash of the method's lines."""


KNOWN_METHODS: Mapping[str, type[Method]] = built_in_methods()
"""Classes of the built-in methods by id, in the order of lists and figures."""
SEARCHES = tuple(name for name in KNOWN_METHODS if name.startswith("optimum/"))
"""Ids of the searches for the optimum, which are references and not compared with methods."""
_WITHOUT_ARTICLE = ("CMA-ES", "random search", "hill climbing", "posture planning")
"""Algorithms whose names have no article in a sentence."""
_WORDS = {
    "other_arm": "other arm ",
    "noise_sd": "σ ",
    "epsilon": "ε ",
    "hands": "hands ",
    "sigma": "σ ",
    "stop": "stop ",
    "spread": "spread ",
    "sequence": "hands ",
}
"""Words that stand before the values of parameters."""


def title_of(method: str | MethodInfo, setting: str = "", *, short: bool = False) -> str:
    """Return the name of a method with its setting, such as ``CMA-ES (other arm still)``.

    Parameters
    ----------
    method : str or MethodInfo
        Id or declaration. For a method from a file, the name is the title in its declaration; if
        only the id is passed, the name is the id.
    setting : str
        Setting of the method, such as ``sigma=0.1, stop=1``; it may be empty.
    short : bool
        True for the short name, if the method has one. Otherwise the short name is the title of a
        built-in method, and the id of a method from a file.
    """
    if known := KNOWN_METHODS.get(method if isinstance(method, str) else method.name):
        name = (short and known.facts.short) or known.title
    elif isinstance(method, str):
        name = one_line(method)
    else:
        name = one_line((method.facts.short or method.name) if short else method.title)
    return f"{name} ({setting_in_words(setting)})" if setting else name


def subject_of(method: Mapping[str, Any]) -> str:
    """Return the name of a method as the subject of a sentence.

    A method from a file has a free title, which gets quotation marks. Other names get an article,
    except names of activities, such as random search, and CMA-ES. A name that contains a comma,
    such as ``CMA-ES, hands goal by goal``, ends in one.

    Parameters
    ----------
    method : mapping
        Row of :attr:`.Study.methods`: its ``title``, ``algorithm``, and whether it is ``built_in``.
    """
    title = str(method["title"])
    if not method["built_in"]:
        plain_title = title.removesuffix(MARK)
        return f"“{plain_title}”{title[len(plain_title) :]}"
    article = "" if method["algorithm"] in _WITHOUT_ARTICLE else "the "
    comma = "," if "," in title.partition("(")[0] else ""
    return f"{article}{title}{comma}"


def setting_in_words(setting: str) -> str:
    """Return a setting, such as ``sigma=0.1, stop=1``, as titles have it: ``σ 0.1, stop 1``."""
    pairs = (part.partition("=") for part in one_line(setting).split(", "))
    words = (_WORDS.get(key, key + equals) + value for key, equals, value in pairs)
    return ", ".join(words).replace("_", " ")


def values_in_words(values: Mapping[str, Any]) -> str:
    """Return values of varied parameters in words, such as ``noise_sd 0.05, epsilon 0.2``.

    Parameters have the names under which a suite sets them.
    """
    return ", ".join(f"{name} {one_line(str(value))}" for name, value in values.items())


def default_name(method: str) -> str:
    """Return what the default of a method's parameter (its id) is: *the paper's* or *default*."""
    return "the paper's" if method in LEARNERS else "default"


BY_TRIAL, BY_FORMULA, WITHOUT_REWARD = GROUPS = (
    "using the reward of each trial",
    "using the reward as a formula",
    "not using the reward",
)
"""Groups of methods by their use of the reward."""
LOOKS_OF = {
    BY_TRIAL: ("azure", ("diamond", "circle", "triangle")),
    BY_FORMULA: ("amber", ("square", "inverted-triangle", "plus")),
    WITHOUT_REWARD: ("azure", ("cross", "thin-diamond")),
}
"""First colour and all markers of the built-in methods by group. The groups begin at different
colours, so that the shortest-path plan differs from the learners and searches that figures compare
with it."""
KINDS = {
    BY_TRIAL: ("navy", "circle", "blue"),
    BY_FORMULA: ("rust", "square", "orange"),
    WITHOUT_REWARD: ("forest", "diamond", "green"),
}
"""Colour, marker and name of the colour of the built-in methods of a group, in figures that have a
row for each method."""
MARK = " ‡"
"""Mark after the title of a method for which there are warnings (:attr:`.Study.marks`)."""


def methods_of(
    runs: pd.DataFrame, declared: Mapping[str, MethodInfo], marked: Collection[str] = ()
) -> pd.DataFrame:
    """Return a frame of the methods that have runs, with a row for each setting.

    Built-in methods come first, in the order of :data:`.MODULES`, then methods from files, in the
    order of the suite. If two conditions of the learner are ranked as one (:func:`ranked_as`), they
    have a further row, with most columns of the second condition.

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
        The index is the label of the method. The columns are those of :attr:`.Study.methods`.
    """
    import pandas as pd  # other parts of this module are used without pandas

    rows, by_label = dict[str, dict[str, Any]](), dict([*runs.groupby("label", sort=False)])
    varied = parameters_varied(runs, declared)
    titles = Counter(map(title_of, declared.values()))
    shorts = Counter(title_of(info, short=True) for info in declared.values())
    for label, of_method in by_label.items():
        base, setting = of_method.method.iloc[0], of_method.setting.iloc[0]
        named = f" ({setting_in_words(setting)})" * bool(setting)
        if label in varied.index:
            default_note = f", {default_name(base)}" * (not setting)
            values = dict(zip(varied.columns, varied.loc[label], strict=True))
            named = f" ({values_in_words(values)}{default_note})"
        info = declared[base]
        known = KNOWN_METHODS.get(base) if info.is_ours else None
        facts = known.facts if known else info.facts
        default = base if setting else facts.ablation_of
        called = info if titles[title_of(info)] == 1 else base  # ids, if titles are the same
        briefly = info if shorts[title_of(info, short=True)] == 1 else base
        under = default if default in by_label and label not in varied.index else ""
        rows[label] = {
            "base": base,
            "condition": CONDITION_OF.get(base, ""),
            "setting": setting,
            "title": title_of(called) + named + MARK * (base in marked),
            "short": title_of(briefly, short=True) + named + MARK * (base in marked),
            "algorithm": one_line(facts.algorithm or (known.title if known else label)),
            "is_learner": base in LEARNERS,
            "is_search": base in SEARCHES,
            "information": _group_of(of_method),
            "built_in": info.is_ours,
            "stochastic": info.stochastic,
            "headline": facts.headline,
            "under": under,
            "look": LOOKS.get(base, ()) if known and not setting else (),
        }
    for label, joined in runs[runs.ranked_as != runs.label].groupby("ranked_as"):
        second = rows[max(joined.label, key=[*KNOWN_METHODS].index)]
        conditions = str(label).partition(" ")[2].replace("-informed", "")
        names = {"title": f"{second['algorithm']} {conditions}"}
        names["short"] = f"{second['short'].rpartition(' ')[0]} {conditions}"
        rows[str(label)] = second | names
    for label, look in _looks_of(rows):
        rows[label]["look"] = look
    position = {name: number for number, name in enumerate(KNOWN_METHODS)}
    ordered = sorted(rows, key=lambda label: position.get(rows[label]["base"], len(position)))
    return pd.DataFrame([rows[label] for label in ordered], ordered).rename_axis("method")


def parameters_varied(runs: pd.DataFrame, declared: Mapping[str, MethodInfo]) -> pd.DataFrame:
    """Return the values of the parameters that a study varies.

    A study varies parameters if, apart from searches for the optimum, all runs are of one method,
    each of its settings was run on all tasks, and there are at least two settings.

    Parameters
    ----------
    runs, declared
        As in :func:`methods_of`. Stored runs leave most parameters out that have their default,
        which is then the declared one.

    Returns
    -------
    DataFrame
        A row for each label and a column for each parameter with at least two values. The parameter
        with most values comes first. Rows are in ascending order of the columns that have only
        numbers. The frame is empty if the study does not vary parameters.
    """
    import pandas as pd

    runs = runs[~runs.method.isin(SEARCHES)]
    tasks = runs.groupby("label").task.nunique()
    if len({*runs.method}) != 1 or (tasks < runs.task.nunique()).any():
        return pd.DataFrame()
    texts, (method,) = runs.drop_duplicates("label").set_index("label").parameters, {*runs.method}
    complete = [declared[method].defaults | json.loads(text) for text in texts]
    values = pd.DataFrame(complete, texts.index.astype(str), dtype=object)
    counts = values.map(repr).nunique().sort_values(ascending=False, kind="stable")
    varied = [*counts.index[counts > 1]]
    numbers = [name for name in varied if are_numbers(values[name])]
    values = values[varied].where(values[varied].notna(), None)
    return (
        values.sort_values(numbers, kind="stable")
        if numbers
        else values
        if varied
        else pd.DataFrame()
    )


def are_numbers(values: Iterable[object]) -> bool:
    """Return True if all values are integers or floats, and not booleans."""
    return all(type(value) in (int, float) for value in values)


def _group_of(runs: pd.DataFrame) -> str:
    """Return the group of a method, one of :data:`GROUPS`, from its runs.

    - ``using the reward of each trial``, if the method declares this and a run made more than one
      trial;
    - otherwise ``using the reward as a formula``, if the method declares this;
    - otherwise ``not using the reward``.
    """
    information = {kind for text in runs.information.unique() for kind in text.split(", ")}
    if not (runs.trials > 1).any():
        information -= {Information.REWARD_BY_TRIAL.value}
    return _group_with(information)


def _group_with(information: Collection[str]) -> str:
    """Return the group of a method that uses kinds of information (values of Information)."""
    if Information.REWARD_BY_TRIAL.value in information:
        return BY_TRIAL
    return BY_FORMULA if Information.REWARD_FORMULA.value in information else WITHOUT_REWARD


def ranked_as(runs: pd.DataFrame) -> pd.Series:
    """Return the name of the row of the ranking in which each run counts.

    The name is the run's label (column ``label``), with one exception: if one condition of the
    learner ran on tasks for one arm, and another condition on other tasks, for two arms, both have
    the same name (:func:`joined_label`).
    """
    tasks = {label: {*of_method.task} for label, of_method in runs.groupby("label")}
    names = runs.label
    for one, others in RANKED_TOGETHER.items():
        for two in others:
            if one in tasks and two in tasks and not tasks[one] & tasks[two]:
                names = names.mask(names.isin([one, two]), joined_label(one, two))
                break
    return names


def joined_label(one: str, two: str) -> str:
    """Return the label of the row of two learners (ids), such as ``dual-process (EC1, EC4)``."""
    return f"{METHOD_PREFIX.rstrip('/')} ({CONDITION_OF[one]}, {CONDITION_OF[two]})"


def _pairs_of(group: str) -> list[tuple[str, str]]:
    """Return the looks of a group: all pairs of a colour and one of the group's markers.

    Pairs that follow each other differ in both.
    """
    first, marks = LOOKS_OF[group]
    begin = ORDER.index(first)
    return [
        (color, marks[(number + turn) % len(marks)])
        for turn in range(len(marks))
        for number, color in enumerate(ORDER[begin:] + ORDER[:begin])
    ]


def _looks_of_built_in() -> dict[str, tuple[str, str]]:
    """Return the colour and the marker of each built-in method that represents its algorithm.

    In each group (:data:`GROUPS`) the methods get the pairs of :func:`_pairs_of` in their order. A
    condition for one arm has the colour of the condition for two arms with which it is ranked.
    """
    looks, free = dict[str, tuple[str, str]](), {group: _pairs_of(group) for group in GROUPS}
    headlines = {name: each for name, each in KNOWN_METHODS.items() if each.facts.headline}
    for name in sorted(headlines, key=RANKED_TOGETHER.__contains__):
        pairs = free[_group_with({kind.value for kind in headlines[name].information})]
        colors = [looks[two][0] for two in RANKED_TOGETHER.get(name, ())[:1]]
        looks[name] = next(pair for pair in pairs if not colors or pair[0] in colors)
        pairs.remove(looks[name])
    return looks


LOOKS = _looks_of_built_in()
"""Names of colour and marker of the built-in methods that represent their algorithms, by id."""


def _looks_of(rows: Mapping[str, dict[str, Any]]) -> Iterator[tuple[str, tuple[str, str]]]:
    """Yield the label of each row with the names of its colour and marker.

    - A row with a ``look`` keeps it.
    - The first nine methods from files have :data:`OWN_COLOR` and a marker.
    - Other rows have the next free pair of their group, those with unused colours first. After the
      last pair, the first is used again.
    """
    fixed = {row["look"] for row in rows.values()}
    taken = {look[0] for look in fixed if look}
    free = {
        group: itertools.cycle(
            sorted(
                (pair for pair in _pairs_of(group) if pair not in fixed),
                key=lambda pair: pair[0] in taken,
            )
        )
        for group in GROUPS
    }
    own = ((OWN_COLOR, mark) for mark in MARKS)
    for label in sorted(rows, key=lambda label: bool(rows[label]["built_in"])):
        row = rows[label]
        others = free[row["information"]]
        yield label, row["look"] or (None if row["built_in"] else next(own, None)) or next(others)


def without_settings(rows: pd.DataFrame) -> pd.DataFrame:
    """Return rows without the settings and ablations of methods that are also in ``rows``.

    ``rows`` are rows of :attr:`.Study.methods`; their column ``under`` is used. Values of a varied
    parameter are not left out.
    """
    return rows[~rows.under.isin(rows.index)]


def headline_methods(rows: pd.DataFrame) -> list[str]:
    """Return the labels of the rows that represent their algorithms, or all labels if none does.

    ``rows`` are rows of :attr:`.Study.methods`; their column ``headline`` is used. Settings and
    ablations are left out as in :func:`without_settings`.
    """
    headlines = without_settings(rows)
    headlines = headlines[headlines.headline]
    return [*(headlines if len(headlines) else rows).index]
