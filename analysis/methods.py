"""Describe methods: their names, groups, colours and markers.

The facts about a method, such as its title, are declared in the class of the method.
:func:`methods_of` returns them as a frame, with a row for each setting of each method.
"""

from __future__ import annotations

import itertools
import json
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from itertools import starmap
from typing import TYPE_CHECKING, Any

from coartic.internal.text import one_line
from coartic.learner.conditions import CONDITIONS, EVERY_CONDITION, INFORMED, METHOD_PREFIX
from coartic.method import Information, Method, built_in_methods
from coartic.runs.rows import LEARNER_ROWS, Ranked, row_names

if TYPE_CHECKING:
    import pandas as pd

    from coartic.runs.method_info import MethodInfo

CONDITION_OF = {f"{METHOD_PREFIX}{name}": name for name in EVERY_CONDITION}
"""Maps the id of each form of the learner to the id of its exploration condition, such as ``EC4``.
Informed conditions and ablations are included."""
LEARNERS = EC1, EC2, EC3, EC4 = tuple(CONDITION_OF)[: len(CONDITIONS)]
"""Ids of the learner under the paper's exploration conditions: EC1 uses only the right arm, and
EC2, EC3 and EC4 use both arms."""
INFORMED_LEARNERS = tuple(f"{METHOD_PREFIX}{name}" for name in INFORMED)
"""Ids of the informed learner, for one arm and for two arms."""
_TWO_ARMS = dict(LEARNER_ROWS.values())
"""Maps the id of each learner for one arm to that of its row's learner for two arms."""
RANDOM_SEARCH = "random-search"
"""Id of random search. Its solution is the best of many trials with random targets."""


COLORS = {
    "ink": "#000000",
    "walnut": "#4a2b18",
    "grape": "#4b2a9b",
    "navy": "#00558f",
    "forest": "#007c52",
    "brick": "#a3182c",
    "rust": "#d55e00",
    "silver": "#8c8c8c",
    "azure": "#5bb8ea",
    "rose": "#dc9fc3",
    "lime": "#8cbf26",
    "amber": "#eba717",
}
"""Maps the name of each colour of methods to its hexadecimal code, from dark to light. ``page.css``
has lighter colours of the same names for a dark page."""
OWN_COLOR, OWN_MARK = "walnut", "star"
"""Colour of the first eleven methods from files, and marker of the first one. (Each setting of a
method counts.) No built-in method has this colour or this marker."""
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
    "hexagon": ("h", (0, (6, 1, 1, 1))),
    "pentagon": ("p", (0, (5, 1, 5, 3))),
}
"""Maps the name of each marker to Matplotlib's codes of the marker and of a line style. Methods
with this marker have lines in this style."""


KNOWN_METHODS: Mapping[str, type[Method]] = built_in_methods()
"""Maps the id of each built-in method to its class, in the order of lists and figures."""
SEARCHES = tuple(name for name in KNOWN_METHODS if name.startswith("optimum/"))
"""Ids of the searches for the optimum. Their results are references, with which methods are
compared; the searches themselves are not ranked."""
_WITHOUT_ARTICLE = ("CMA-ES", "random search", "hill climbing", "posture planning")
"""Names of algorithms that have no article in a sentence."""
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
"""Maps names of parameters to the words that replace them in titles, in front of the value."""


def title_of(method: str | MethodInfo, setting: str = "", *, short: bool = False) -> str:
    """Return the name of a method with its setting, such as ``CMA-ES (other arm still)``.

    Parameters
    ----------
    method : str or MethodInfo
        Id or declaration of the method. For a method from a file, only the declaration contains the
        title; if the id is passed, the name is the id.
    setting : str
        Setting of the method, such as ``sigma=0.1, stop=1``; empty for the default setting.
    short : bool
        True for the short name that the method declares. A method without a declared short name has
        its title as its short name if it is built in, and its id if it is from a file.

    Returns
    -------
    str
        The name, followed by the setting in parentheses if there is one.

    Examples
    --------
    >>> title_of("cma-es/bandit", "sigma=0.1")
    'CMA-ES (σ 0.1)'
    """
    if known := KNOWN_METHODS.get(method if isinstance(method, str) else method.name):
        name = (short and known.facts.short) or known.title
    elif isinstance(method, str):
        name = one_line(method)
    else:
        name = one_line((method.facts.short or method.name) if short else method.title)
    return f"{name} ({describe_setting(setting)})" if setting else name


def subject_of(method: Mapping[str, Any]) -> str:
    """Return the name of a method as the subject of a sentence.

    - The title of a method from a file is put in quotation marks, because users choose it freely.
    - The title of a built-in method gets the article *the*, unless its algorithm is CMA-ES or an
      activity, such as random search.
    - If the title of a built-in method has a comma before the setting, as in ``CMA-ES, hands goal
      by goal``, another comma is added at the end.

    Parameters
    ----------
    method : mapping
        A row of :attr:`.Study.methods`, with ``title``, ``algorithm`` and ``built_in``.
    """
    title = str(method["title"])
    if not method["built_in"]:
        plain_title = title.removesuffix(MARK)
        return f"“{plain_title}”{title[len(plain_title) :]}"
    article = "" if method["algorithm"] in _WITHOUT_ARTICLE else "the "
    comma = "," if "," in title.partition("(")[0] else ""
    return f"{article}{title}{comma}"


def describe_setting(setting: str) -> str:
    """Return a setting as titles show it: ``σ 0.1, stop 1`` for ``sigma=0.1, stop=1``."""
    pairs = (part.partition("=") for part in one_line(setting).split(", "))
    words = (_WORDS.get(key, key + equals) + value for key, equals, value in pairs)
    return ", ".join(words).replace("_", " ")


def describe_values(values: Mapping[str, Any]) -> str:
    """Return the values of parameters as a string, such as ``noise_sd 0.05, epsilon 0.2``.

    ``values`` maps the name of each parameter to its value.
    """
    return ", ".join(f"{name} {one_line(str(value))}" for name, value in values.items())


def default_name(method: str) -> str:
    """Return the word for the default parameters of a method: ``the paper's`` or ``default``.

    The word is ``the paper's`` for the learner under the paper's conditions (:data:`LEARNERS`).
    ``method`` is the id of the method.
    """
    return "the paper's" if method in LEARNERS else "default"


BY_TRIAL, BY_FORMULA, WITHOUT_REWARD = GROUPS = (
    "using the reward of each trial",
    "using the reward as a formula",
    "not using the reward",
)
"""Names of the three groups of methods, which use the reward in different ways."""
LOOKS_OF = {
    BY_TRIAL: (
        ("azure", "grape", "navy", "rose", "silver", "ink"),
        ("triangle", "circle", "inverted-triangle", "hexagon"),
    ),
    BY_FORMULA: (("amber", "brick", "rust"), ("square", "plus", "cross", "pentagon")),
    WITHOUT_REWARD: (("forest", "lime"), ("diamond", "thin-diamond")),
}
"""Maps each group to the colours and the markers of its built-in methods in figures with a line for
each method (:func:`_pairs_of`). No two groups share a colour or a marker, so that both say how a
method uses the reward, as in figures with a row for each method (:data:`KINDS`)."""
KINDS = {
    BY_TRIAL: ("navy", "circle", "blue"),
    BY_FORMULA: ("rust", "square", "orange"),
    WITHOUT_REWARD: ("forest", "diamond", "green"),
}
"""Maps each group to the colour and the marker of its built-in methods in figures with a row for
each method, and to the word for this colour in captions. They are among those of
:data:`LOOKS_OF`."""
MARK = " ‡"
"""Mark after the title of a method for which there are warnings (:attr:`.Study.marks`)."""


def methods_of(
    runs: pd.DataFrame, declared: Mapping[str, MethodInfo], marked: Collection[str] = ()
) -> pd.DataFrame:
    """Return a frame with a row for each setting of each method with runs.

    Built-in methods come first, in the order of :data:`KNOWN_METHODS`. Methods from files follow,
    in the order of the suite. If two conditions of the learner share a row of the ranking
    (:func:`ranked_as`), the frame contains a further row for both together. Except for the titles,
    the columns of this row are those of the condition for two arms.

    Parameters
    ----------
    runs : DataFrame
        A row for each run, in the order of the suite. The columns must include ``label``,
        ``ranked_as``, ``method``, ``setting``, ``task``, ``parameters``, ``information`` and
        ``trials`` (:attr:`.Study.runs`).
    declared : mapping of str to MethodInfo
        Maps the id of each method, without a setting, to its declaration.
    marked : collection of str, optional
        Ids of methods whose titles get :data:`MARK`.

    Returns
    -------
    DataFrame
        The frame is indexed by the label of the method: its id with its setting. The columns are
        those of :attr:`.Study.methods`.
    """
    import pandas as pd  # other parts of this module are used without pandas

    rows, by_label = dict[str, dict[str, Any]](), dict([*runs.groupby("label", sort=False)])
    varied = parameters_varied(runs, declared)
    titles = Counter(map(title_of, declared.values()))
    shorts = Counter(title_of(info, short=True) for info in declared.values())
    for label, of_method in by_label.items():
        method_id, setting = of_method.method.iloc[0], of_method.setting.iloc[0]
        row = of_method.ranked_as.iloc[0]
        named = f" ({describe_setting(setting)})" if setting else ""
        if row in varied.index:
            default_note = f", {default_name(method_id)}" if not setting else ""
            values = dict(zip(varied.columns, varied.loc[row], strict=True))
            named = f" ({describe_values(values)}{default_note})"
        info = declared[method_id]
        known = KNOWN_METHODS.get(method_id) if info.is_ours else None
        facts = known.facts if known else info.facts
        default = method_id if setting else facts.ablation_of
        called = info if titles[title_of(info)] == 1 else method_id  # ids, if titles are the same
        briefly = info if shorts[title_of(info, short=True)] == 1 else method_id
        titled = {
            "title": title_of(called) + named,
            "short_title": title_of(briefly, short=True) + named,
        }
        if "called" in of_method and len(names := {*of_method.called}) == 1 and "" not in names:
            titled = dict.fromkeys(titled, *names)  # the suite gives the name
        mark = MARK if method_id in marked else ""
        parent = default if default in by_label and row not in varied.index else ""
        rows[label] = {
            "method_id": method_id,
            "condition": CONDITION_OF.get(method_id, ""),
            "setting": setting,
            **{name: text + mark for name, text in titled.items()},
            "algorithm": one_line(facts.algorithm or (known.title if known else label)),
            "is_learner": method_id in LEARNERS,
            "is_search": method_id in SEARCHES,
            "information": _group_of(of_method),
            "built_in": info.is_ours,
            "stochastic": info.stochastic,
            "headline": facts.headline,
            "parent": parent,
            "style": LOOKS.get(method_id, ()) if known and not setting else (),
        }
    row_of = dict(zip(runs.label, runs.ranked_as, strict=True))
    for label, joined in runs[runs.ranked_as != runs.label].groupby("ranked_as"):
        parts = [rows[part] for part in by_label if part in {*joined.label}]
        conditions = [part["condition"].split("-")[0] for part in parts]
        row = rows[str(label)] = {**parts[-1]}
        row["parent"] = row_of.get(row["parent"], row["parent"])
        for name in ("title", "short_title"):
            if len(parts) > 1 and all(conditions):
                row[name] = row[name].replace(conditions[-1], f"({', '.join(conditions)})")
            if "called" in joined and (joined.called == label).all():
                row[name] = str(label)
    for label, look in _looks_of(rows):
        rows[label]["style"] = look
    position = {name: number for number, name in enumerate(KNOWN_METHODS)}
    ordered = sorted(rows, key=lambda label: position.get(rows[label]["method_id"], len(position)))
    return pd.DataFrame([rows[label] for label in ordered], ordered).rename_axis("method")


def parameters_varied(runs: pd.DataFrame, declared: Mapping[str, MethodInfo]) -> pd.DataFrame:
    """Return the values of the parameters that a study varies, for each setting.

    Runs of searches for the optimum are ignored. A study varies parameters if

    - all other runs are of one method;
    - the method has at least two settings;
    - each setting was run on all tasks of these runs.

    Parameters
    ----------
    runs : DataFrame
        A row for each run, as in :func:`methods_of`.
    declared : mapping of str to MethodInfo
        Maps the id of each method to its declaration. A parameter that a stored run leaves out has
        the declared default.

    Returns
    -------
    DataFrame
        A row for each setting, indexed by its row of the ranking, and a column for each parameter
        that has at least two values. The parameter with the most values comes first. The rows are
        sorted by the columns that contain only numbers, in ascending order. The frame is empty if
        the study does not vary parameters.
    """
    import pandas as pd

    runs = runs[~runs.method.isin(SEARCHES)]
    tasks = runs.groupby("ranked_as").task.nunique()
    if len({*runs.method}) != 1 or (tasks < runs.task.nunique()).any():
        return pd.DataFrame()
    texts, (method,) = (
        runs.drop_duplicates("ranked_as").set_index("ranked_as").parameters,
        {*runs.method},
    )
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
    """Return the group of a method (one of :data:`GROUPS`) from all its runs.

    The group is

    - ``using the reward of each trial``, if the method declares that it uses the reward of each
      trial, and at least one run made more than one trial;
    - otherwise ``using the reward as a formula``, if the method declares that it uses the formula
      of the reward;
    - otherwise ``not using the reward``.
    """
    information = {kind for text in runs.information.unique() for kind in text.split(", ")}
    if not (runs.trials > 1).any():
        information -= {Information.REWARD_BY_TRIAL.value}
    return _group_with(information)


def _group_with(information: Collection[str]) -> str:
    """Return the group of a method that uses the given kinds of information.

    ``information`` contains values of the enumeration :class:`.Information`.
    """
    if Information.REWARD_BY_TRIAL.value in information:
        return BY_TRIAL
    return BY_FORMULA if Information.REWARD_FORMULA.value in information else WITHOUT_REWARD


def ranked_as(runs: pd.DataFrame) -> pd.Series:
    """Return the name of the row of the ranking to which each run belongs (:func:`.row_names`).

    ``runs`` has columns ``method``, ``setting`` and ``task``, and ``called`` if its suite names
    runs. The result has the index of ``runs``.
    """
    import pandas as pd

    names = ["method", "setting", "task", "called"]
    columns = [runs[name].tolist() if name in runs else [""] * len(runs) for name in names]
    ranked = [*starmap(Ranked, zip(*columns, strict=True))]
    return pd.Series(row_names(ranked), runs.index, name="ranked_as")


def _pairs_of(group: str) -> list[tuple[str, str]]:
    """Return all pairs of a colour and a marker of a group.

    Each pair differs from the previous pair in colour.
    """
    colors, marks = LOOKS_OF[group]
    return [
        (color, marks[(number + turn) % len(marks)])
        for turn in range(len(marks))
        for number, color in enumerate(colors)
    ]


def _looks_of_built_in() -> dict[str, tuple[str, str]]:
    """Return a dict that maps ids of built-in methods to colours and markers.

    The dict contains only the methods that represent their algorithms (``headline`` of
    :class:`.Facts`). Each method takes the first free pair of its group (:func:`_pairs_of`). The
    methods choose in the order of :data:`KNOWN_METHODS`, but the corrective process alone, which
    has no curve, chooses after the others, and learners for one arm choose last: each
    takes the first free pair with the colour of the learner for two arms of its row.
    """
    looks, free = dict[str, tuple[str, str]](), {group: _pairs_of(group) for group in GROUPS}
    headlines = {name: each for name, each in KNOWN_METHODS.items() if each.facts.headline}
    without_curve = {name for name in headlines if name.startswith("corrective-alone/")}
    for name in sorted(headlines, key=lambda name: (name in _TWO_ARMS, name in without_curve)):
        pairs = free[_group_with({kind.value for kind in headlines[name].information})]
        colors = [looks[_TWO_ARMS[name]][0]] if name in _TWO_ARMS else []
        looks[name] = next(pair for pair in pairs if not colors or pair[0] in colors)
        pairs.remove(looks[name])
    return looks


LOOKS = _looks_of_built_in()
"""Maps the id of each built-in method that represents its algorithm to the names of its colour and
its marker."""


def _looks_of(rows: Mapping[str, dict[str, Any]]) -> Iterator[tuple[str, tuple[str, str]]]:
    """Yield the label of each row, with the names of its colour and marker.

    ``rows`` maps labels to dicts of the columns of :attr:`.Study.methods`. Rows of methods from
    files come first.

    - A row that has a ``style`` already keeps it.
    - The first eleven rows of methods from files get the colour :data:`OWN_COLOR`, each with
      another marker.
    - Each other row gets the next free pair of its group. Pairs with a colour that does not occur
      in any ``style`` come first. After the last free pair, the first one is used again.
    """
    fixed = {row["style"] for row in rows.values()}
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
        yield label, row["style"] or (None if row["built_in"] else next(own, None)) or next(others)


def without_settings(rows: pd.DataFrame) -> pd.DataFrame:
    """Leave out the rows that are settings or ablations of a method in another row.

    ``rows`` are rows of :attr:`.Study.methods`. A row is left out if the label in its column
    ``parent`` is in the index of ``rows``. In a study that varies parameters, the settings have no
    parent, and are kept.
    """
    return rows[~rows.parent.isin(rows.index)]


def headline_methods(rows: pd.DataFrame) -> list[str]:
    """Return the labels of the methods that represent their algorithms.

    ``rows`` are rows of :attr:`.Study.methods`. The result contains the rows of
    :func:`without_settings` in which column ``headline`` is True. If there are none, all labels of
    ``rows`` are returned.
    """
    headlines = without_settings(rows)
    headlines = headlines[headlines.headline]
    return [*(headlines if len(headlines) else rows).index]
