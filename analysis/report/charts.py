"""Charts to explore, as specifications of Vega-Lite, of the data that printed figures show.

Altair states them; Vega draws them in the reader's browser, from a bundle that is part of the
page (``html.py``). Text and axes have the page's ink, so that light and dark need no other chart.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import altair as alt
import pandas as pd
from altair.utils.schemapi import debug_mode

from coartic.analysis.comparisons.methods import INFORMED, UNTOLD, informed
from coartic.analysis.comparisons.progress import SPENDS
from coartic.analysis.comparisons.reached import ALL_TASKS
from coartic.analysis.figures import style
from coartic.analysis.figures.frontier import NAMES
from coartic.analysis.figures.price import look_alike, main_methods
from coartic.analysis.figures.ranking import GROUPS, Standing, learner
from coartic.analysis.methods import family_of, spoken_name
from coartic.analysis.study import Study
from coartic.text import json_text

_ANY = "all"
_ROW, _TALL = 11, 200  # pixels: of a row, of the curves
_APART = 7.0  # per cent of the axis between names at its end
_INK = "currentColor"
_CONFIG: Any = {
    "background": "transparent",
    "font": "system-ui, -apple-system, Segoe UI, Roboto, Liberation Sans, sans-serif",
    "view": {"stroke": "transparent"},
    "axis": {
        **{"labelColor": _INK, "titleColor": _INK, "domainColor": _INK, "tickColor": _INK},
        **{"labelFontSize": 11, "titleFontSize": 11, "titleFontWeight": "normal"},
        **{"gridColor": _INK, "gridOpacity": 0.12, "labelLimit": 260},
    },
    "legend": {
        **{"labelColor": _INK, "titleColor": _INK, "labelFontSize": 11, "titleFontSize": 11},
        **{"titleFontWeight": "normal", "labelLimit": 240},
    },
    "header": {"labelColor": _INK, "titleColor": _INK},
}


def charts(study: Study, shown: Mapping[str, pd.DataFrame]) -> dict[str, str]:
    """Specifications as JSON by the id of the figure whose data they show."""
    makers: dict[str, Callable[[Study, pd.DataFrame], Any]] = {
        "ranking": ranking_chart,
        "price": price_chart,
    }
    # That they are valid does not depend on the runs; to check it takes as long as all else.
    with debug_mode(False):
        return {
            name: json_text(make(study, shown[name]).to_dict(validate=False), allow_nan=False)
            for name, make in makers.items()
            if name in shown
        }


def ranking_chart(study: Study, data: pd.DataFrame) -> Any:
    """Gap of every method with its interval; by task, by family, by what a method is told."""
    chosen = _choices(list(dict.fromkeys(map(str, data.task))), data.told, data.family)
    every = _chosen(_ranked(data), chosen)
    base = every.transform_filter("!datum.heading")
    order = alt.EncodingSortField("place", op="min", order="ascending")
    bold: Any = {
        "condition": {"test": "indexof(datum.label, 'learner') === 0", "value": "bold"},
        "value": "normal",
    }
    shown = f"indexof({json_text(list(GROUPS))}, datum.label) < 0 ? datum.label : ''"
    axis = alt.Axis(grid=False, ticks=False, labelFontWeight=bold, labelExpr=shown)
    y: Any = alt.Y("name:N", sort=order, title=None, axis=axis)
    labels = list(dict.fromkeys(map(str, data.method)))
    color = _colors(labels, style.looks([look_alike(label) for label in labels]))
    tips = _tips(alt.Tooltip("gap:Q", title="gap to the optimum (%)", format=".2f"))
    x: Any = alt.X("gap:Q", scale=alt.Scale(padding=24), title="gap to the optimum (%)")
    lines = base.mark_rule(strokeWidth=2.5).encode(x=alt.X("low:Q"), x2="high:Q", y=y, color=color)
    marks = base.mark_point(filled=True, size=45, opacity=1).encode(
        x=x, y=y, color=color, tooltip=tips,
        shape=alt.Shape("learner:N", legend=None,
                        scale=alt.Scale(domain=[False, True], range=["circle", "diamond"])),
    )  # fmt: skip
    ends = "max(datum.gap, isValid(datum.high) ? datum.high : datum.gap)"
    text = base.transform_calculate(end=ends).mark_text(
        align="left", dx=7, color=_INK, fontSize=10.5
    )
    text = text.encode(x=alt.X("end:Q"), y=y, text=alt.Text("gap:Q", format=".1f"))
    heading = every.transform_filter("datum.heading")
    heading = heading.transform_aggregate(methods="count()", groupby=["name", "told", "place"])
    heading = heading.mark_text(
        align="left", x=4, color=_INK, fontSize=10.5, fontWeight="bold", limit=0
    )
    heading = heading.encode(y=y, text=alt.Text("told:N"))
    zero = _chart([{"x": 0}]).mark_rule(strokeDash=[2, 3], color=_INK)
    parts = alt.layer(zero.encode(x=alt.X("x:Q")), lines, marks, text, heading)
    told_first = [told for told in GROUPS if (data.told == told).any()]
    said = f"Gap to the optimum by method; {'; '.join(told_first)}."
    return _finished(parts, alt.Step(_ROW), said, *chosen)


def _ranked(data: pd.DataFrame) -> list[dict[str, Any]]:
    """What is drawn of every method and task, and a row above each group with its name."""
    rows = list(map(Standing._make, data.itertuples(index=False, name=None)))
    values = [
        {
            **{"task": row.task, "name": spoken_name(row.method), "id": row.method},
            **{"place": 1000 * GROUPS.index(row.told) + float(row.gap)},
            **{"told": row.told, "family": row.family, "runs": row.runs},
            **{"gap": _number(row.gap), "low": _number(row.low), "high": _number(row.high)},
            "interval": "none: run once"
            if math.isnan(row.low)
            else f"{row.low:.2f} to {row.high:.2f}",
            "learner": learner(str(row.method)),
        }
        for row in rows
    ]
    headings = [
        {
            **{"task": task, "told": told, "family": family, "name": told},
            **{"heading": True, "place": 1000 * GROUPS.index(told) - 1},
        }
        for task, told, family in dict.fromkeys((row.task, row.told, row.family) for row in rows)
    ]
    return values + headings


def price_chart(study: Study, data: pd.DataFrame) -> Any:
    """Levels of reward reached within a budget; by task, family, what is told, and spend."""
    told_of = _told(study)
    tasks = list(dict.fromkeys(map(str, data.task)))
    tasks.sort(key=lambda task: task != ALL_TASKS)
    labels = list(dict.fromkeys(map(str, data.method)))
    looks = style.looks([look_alike(label) for label in labels])
    spends = [spend for spend in SPENDS if (data.spend == spend).any()]
    names = [NAMES[name] for name in spends]
    against = alt.binding_select(options=spends, labels=names, name="Against ")
    spend = alt.param(name="spend", value=spends[0], bind=against)
    chosen = (*_choices(tasks, told_of.values(), map(family_of, labels)), spend)
    every = alt.param(name="every", value=False, bind=alt.binding_checkbox(name="All methods "))
    near = alt.selection_point(
        name="near", fields=["name"], on="pointerover", clear="pointerout", empty=False
    )
    base = _chosen(_reached(data, told_of), chosen[:3])
    base = base.transform_filter("datum.spend === spend")
    base = base.transform_filter("every || datum.main || family !== 'all'")
    ends = base
    base = base.transform_flatten(["budget", "share", "low", "high"])
    base = base.transform_calculate(
        interval="isValid(datum.low) ? format(datum.low, '.0f') + ' to ' + "
        "format(datum.high, '.0f')  + ' %' : 'none: too few runs'"
    )
    color, dash = _colors(labels, looks), _dashes(labels, looks)
    axis = alt.Axis(format="~s", tickCount=6, grid=False)
    x: Any = alt.X("budget:Q", scale=alt.Scale(type="log", nice=False), title=None, axis=axis)
    y: Any = alt.Y(
        "share:Q", title="levels of reward reached (%)", scale=alt.Scale(domain=[0, 100])
    )
    band = base.mark_area(interpolate="step-after").encode(
        x=x, y=alt.Y("low:Q"), y2="high:Q", color=color,
        opacity=alt.condition(near, alt.value(0.35), alt.value(0.12)),
    )  # fmt: skip
    line = base.mark_line(interpolate="step-after").encode(
        x=x, y=y, color=color, strokeDash=dash,
        strokeWidth=alt.condition(near, alt.value(4), alt.value(1.8)),
    )  # fmt: skip
    tips = _tips(
        alt.Tooltip("budget:Q", title="spent", format=".3~s"),
        alt.Tooltip("share:Q", title="levels of reward reached (%)", format=".0f"),
    )
    points = base.mark_point(size=90, opacity=0, filled=True).encode(
        x=x, y=y, color=color, tooltip=tips
    ).add_params(near)  # fmt: skip
    last = (
        ends.transform_filter("isValid(datum.label)")
        .mark_text(align="left", dx=4, fontSize=10.5)
        .encode(x=alt.X("end:Q"), y=alt.Y("label:Q"), text="name:N", color=color)
    )
    half = _chart([{"y": 50}]).mark_rule(strokeDash=[2, 3], color=_INK, opacity=0.6)
    layers = alt.layer(half.encode(y=alt.Y("y:Q")), band, line, points, last, _spend_title())
    said = "Share of levels of reward reached within a budget, by method."
    return _finished(layers, _TALL, said, *chosen, every)


def _reached(data: pd.DataFrame, told_of: Mapping[str, str]) -> list[dict[str, Any]]:
    """The curve of every method, task and spend, with a place for its name where it is shown."""
    main = _main(data)
    positive = data[data.budget > 0].groupby("spend").budget
    edges = {str(name): (float(own.min()), float(own.max())) for name, own in positive}
    values: list[dict[str, Any]] = []
    keys = ["task", "method", "spend"]
    for (task, method, spend), own in data.groupby(keys, sort=False):
        least, most = edges[str(spend)]
        known = own.low.notna().all()
        values.append(
            {
                **{"task": task, "name": spoken_name(str(method)), "id": method, "spend": spend},
                **{"told": told_of[str(method)], "family": family_of(str(method))},
                **{"main": method in main, "runs": int(own.runs.iloc[0])},
                "end": _number(most),
                "budget": [_number(max(b, least / 2)) for b in own.budget],
                "share": [_number(100 * share) for share in own.share],
                "low": [_number(100 * low) if known else None for low in own.low],
                "high": [_number(100 * high) if known else None for high in own.high],
            }
        )
    for place in {(value["task"], value["spend"]) for value in values}:
        _placed([v for v in values if (v["task"], v["spend"]) == place and v["main"]])
    return values


def _main(data: pd.DataFrame) -> set[str]:
    """Of each family the method that reaches most in all its trials; of more there is no room."""
    shown = data[(data.spend == SPENDS[0]) & data.method.isin(main_methods(data))]
    ends = dict(zip(map(str, shown.method), map(float, shown.share), strict=True))  # the last
    best: dict[str, str] = {}
    for method in sorted(ends, key=lambda method: -ends[method]):
        best.setdefault(family_of(method), method)
    return set(best.values())


def _colors(labels: Sequence[str], looks: Mapping[str, Any]) -> Any:
    """A colour a method, by its spoken name."""
    colors = (looks[look_alike(label)].color for label in labels)
    paints = [_INK if color == style.INK else color for color in colors]
    scale = alt.Scale(domain=[spoken_name(label) for label in labels], range=paints)
    return alt.Color("name:N", scale=scale, legend=None)


def _dashes(labels: Sequence[str], looks: Mapping[str, Any]) -> Any:
    """The dashes of a method, by its spoken name."""
    names = [spoken_name(label) for label in labels]
    dashes = (looks[look_alike(label)].dash for label in labels)
    lines = [[1, 0] if dash == style.SOLID else list(dash[1]) for dash in dashes]
    return alt.StrokeDash("name:N", scale=alt.Scale(domain=names, range=lines), legend=None)


def _spend_title() -> Any:
    """The title of the axis below, which says what was chosen: no title of an axis can."""
    words = f"({json_text(NAMES)})[spend] + ' (logarithmic; left edge: none)'"
    title = _chart([{}]).transform_calculate(words=words)
    title = title.mark_text(
        x=alt.expr("width / 2"), y=_TALL + 30, color=_INK, fontSize=11, limit=0
    )
    return title.encode(text="words:N")


def _placed(values: list[dict[str, Any]]) -> None:
    """Heights of the names of curves at their ends, so that none covers another."""
    lowest = -math.inf
    ordered = sorted(values, key=lambda value: value["share"][-1])
    for value in ordered:
        lowest = value["label"] = max(value["share"][-1], lowest + _APART)
    highest = 100.0
    for value in reversed(ordered):
        value["label"] = _number(min(value["label"], highest))
        highest = value["label"] - _APART


def _choices(tasks: list[str], told: Iterable[str], families: Iterable[str]) -> tuple[Any, ...]:
    known = set(told)
    groups = [words for words in (*INFORMED.values(), UNTOLD) if words in known]
    choices = {"task": tasks, "told": [_ANY, *groups], "family": [_ANY, *dict.fromkeys(families)]}
    return tuple(
        alt.param(
            name=name,
            value=options[0],
            bind=alt.binding_select(options=options, name=f"{name.capitalize()} "),
        )
        for name, options in choices.items()
    )


def _chosen(values: list[dict[str, Any]], chosen: Iterable[Any]) -> Any:
    chart = _chart(tuple(values))  # which Altair does not copy whenever it copies a chart
    for name in (param.param.name for param in chosen):
        any_of_them = "" if name == "task" else f"{name} === 'all' || "
        chart = chart.transform_filter(f"{any_of_them}datum.{name} === {name}")
    return chart


def _chart(values: Sequence[dict[str, Any]]) -> Any:
    return alt.Chart(alt.InlineData(values=values))


def _finished(chart: Any, height: Any, said: str, *params: Any) -> Any:
    """As wide as there is room, with what can be chosen and a description."""
    chart = chart.properties(width="container", height=height)
    return chart.add_params(*params).configure(**_CONFIG).properties(description=said)


def _tips(*own: Any) -> list[Any]:
    """What is said of a mark: its method, its own values, and what is behind them."""
    interval = alt.Tooltip("interval:N", title="95 % interval")
    behind = map(alt.Tooltip, ("runs:Q", "told:N", "id:N"))
    return [alt.Tooltip("name:N", title="method"), *own, interval, *behind]


def _told(study: Study) -> dict[str, str]:
    """What methods know of the reward by label, those over all tasks as their parts."""
    found = {label: informed(row.told) for (_, label), row in study.method_rows.items()}
    of_parts = study.scores.drop_duplicates("method")
    joint = zip(map(str, of_parts.method), map(str, of_parts.label), strict=True)
    return {**{name: found[label] for name, label in joint}, **found}


def _number(value: float) -> float | None:
    """With four figures, which is more than are seen."""
    return None if math.isnan(value) else float(f"{value:.4g}")
