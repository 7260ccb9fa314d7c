"""The sentences with which a report begins follow from the data, and change with it."""

import json
import re

import altair as alt
import numpy as np
import pandas as pd
import pytest
from jsonschema import ValidationError

from coartic.analysis.comparisons.overall import ends
from coartic.analysis.comparisons.reached import ALL_TASKS, WAY
from coartic.analysis.figures import ranking
from coartic.analysis.report import answers
from coartic.analysis.report.charts import charts
from coartic.analysis.report.tables.main import MAIN, main_methods, main_verdicts
from tests.support.reports import shown


def standing(method, gap, told, low=float("nan"), high=float("nan")):
    return (ALL_TASKS, method, told, "f", gap, low, high, 20, 0)


TRIAL, FORMULA, NOTHING = ranking.GROUPS


@pytest.mark.parametrize(
    ("rows", "said", "not_said"),
    [
        (
            [
                standing("cma-es/bandit", 1.0, TRIAL, 0.9, 1.1),
                standing("dual-process (EC1, EC4)", 8.0, TRIAL, 7.0, 9.0),
            ],
            ["CMA-ES (bandit) wins: 1.0 %", "surely before", "place 2 of 2, at 8.0 %"],
            ["formula"],
        ),
        (
            [
                standing("dual-process (EC1, EC4)", 2.0, TRIAL, 1.0, 3.0),
                standing("cma-es/bandit", 2.5, TRIAL, 2.0, 4.0),
            ],
            ["learner (EC1, EC4) is ahead: 2.0 %", "not surely before CMA-ES (bandit)"],
            ["place", "wins"],
        ),
        (
            [standing("trajectory-optimisation/path-length", 0.0, FORMULA)],
            ["Told the reward as a formula, trajectory plan (path length) ends 0.0 %"],
            ["wins"],
        ),
    ],
)
def test_who_wins_is_who_has_the_smallest_gap(monkeypatch, traced, rows, said, not_said):
    frame = pd.DataFrame(rows, columns=ranking.Standing._fields)
    monkeypatch.setattr(answers, "standings", lambda study: frame)
    text = answers.winners(traced)
    assert all(words in text for words in said)
    assert not any(words in text for words in not_said)


def test_standings_are_gaps_of_the_methods(traced):
    frame = ranking.standings(traced)
    assert len(frame)
    for row in frame[frame.task != ALL_TASKS].itertuples():
        cell = traced.method_rows[row.task, row.method]
        assert row.gap == pytest.approx(100 * cell.gap_share)
        assert not row.low > row.gap + 1e-9
        assert not row.high < row.gap - 1e-9


def test_what_is_reached_is_counted_run_by_run(traced):
    frame, scale = traced.reached, ends(traced)
    assert len(frame)
    checked = 0
    for (task, method, spend), own in frame.groupby(["task", "method", "spend"]):
        assert (np.diff(own.share) >= 0).all()
        if task == ALL_TASKS or spend != "trials":
            continue
        start, best = scale[task]
        rewards = traced.cells[task, method].rewards
        way = (rewards - start) / (best - start)
        shares = [(way >= target - 1e-9).mean() for target in WAY]
        assert own.share.iloc[-1] == pytest.approx(np.mean(shares))
        checked += 1
    assert checked


def test_verdicts_are_counted(traced):
    text = answers.claims_found(traced)
    judged = [entry.verdict for entry in traced.judged if entry.claim.place]
    if not text:
        assert not {"supported", "not supported"} & set(judged)
        return
    assert f"Of {len(judged)} claims" in text
    count = judged.count("supported")
    assert re.search(rf"\b{count or 'none'} (is|are) supported", text)
    names = [words for words in answers._refuted(traced.judged, traced) if "](#claim-" in words]
    assert len(names) == sum(entry.verdict == "not supported" for entry in traced.judged)


def test_main_tables_have_every_method_and_every_claim(traced):
    methods, verdicts = main_methods(traced), main_verdicts(traced)
    assert (methods.id, verdicts.id) == (MAIN[0], MAIN[2])
    assert len(verdicts.rows) == sum(bool(entry.claim.place) for entry in traced.judged)
    rows = shown(methods)
    for row in ranking.standings(traced).itertuples():
        if row.task == ALL_TASKS:
            assert rows[row.method]["all_tasks"].value == pytest.approx(row.gap)


def test_charts_show_what_the_figures_show(traced):
    standings = ranking.standings(traced)
    found = charts(traced, {"ranking": standings, "price": traced.reached, "other": None})
    assert found.keys() == {"ranking", "price"}
    assert found == charts(traced, {"ranking": standings, "price": traced.reached})
    for text in found.values():
        chart = json.loads(text)
        assert {param["name"] for param in chart["params"]} >= {"task", "told", "family"}
        assert "http" not in json.dumps({**chart, "$schema": ""})
        for values in _all_values(chart):
            del values[2:-2]  # rows are all alike
        alt.LayerChart.from_dict(chart)  # which is checked by the schema of Vega-Lite
    with pytest.raises(ValidationError, match="3 is not"):
        alt.LayerChart.from_dict({"layer": 3})
    drawn = json.loads(found["ranking"])
    lists = [*drawn.get("datasets", {}).values(), *_all_values(drawn)]
    rows = [[value for value in values if not value.get("heading")] for values in lists]
    assert len(standings) in map(len, rows)


def _all_values(chart):
    """Every list of data within a specification."""
    if isinstance(chart, dict):
        if isinstance(chart.get("values"), list):
            yield chart["values"]
        for part in chart.values():
            yield from _all_values(part)
    elif isinstance(chart, list):
        for part in chart:
            yield from _all_values(part)
