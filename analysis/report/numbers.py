"""Headline numbers as LaTeX macros, at most a hundred, each with a comment that names its runs.

A macro names a cell of a table, so that ``coartic trace TABLE ROW`` prints the runs behind it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import Any

import pandas as pd

from coartic.analysis import tables
from coartic.analysis.methods import is_learner, is_variant, main_methods, name_of
from coartic.analysis.report import facts
from coartic.analysis.study import Study

MOST = 100
_DIGITS = ("Zero", "One", "Two", "Three", "Four", "Five", "Six", "Seven", "Eight", "Nine")
Number = tuple[str, str, str]
"""Name behind ``\\coartic``, text, and what it is with where its runs are."""


def numbers_tex(study: Study) -> str:
    """The macros as a file that LaTeX inputs."""
    about = facts.made(study)
    lines = [
        f"% Headline numbers of suite {about['suite']}, seed {about['seed']}: {about['runs']} runs",
        f"% of coartic {' '.join(filter(None, (about['version'], about['commit'])))}, "
        f"{about['date']}.",
        "% `coartic trace TABLE ROW` prints the runs behind a row that a comment names.",
    ]
    taken: set[str] = set()
    for name, text, comment in _numbers(study):
        if text and name not in taken and len(taken) < MOST:
            taken.add(name)
            lines.append(f"\\newcommand{{\\coartic{name}}}{{{text}}} % {comment}")
    return "\n".join(lines) + "\n"


def letters(text: str) -> str:
    """A name in letters alone: ``two-armed-1`` is ``TwoArmedOne``."""
    spelled = re.sub(r"\d", lambda digit: _DIGITS[int(digit[0])].join("  "), text)
    return "".join(word[:1].upper() + word[1:] for word in re.findall("[A-Za-z]+", spelled))


def plain(value: float, digits: int) -> str:
    """A number for LaTeX in decimals; empty for NaN, and for what is infinite."""
    return "" if math.isnan(value) or math.isinf(value) else f"{value:.{digits}f}"


def _with_interval(
    name: str, row: pd.Series, column: str, digits: int, scale: float, comment: str
) -> Iterator[Number]:
    for ending, suffix in (("", ""), ("_low", "Low"), ("_high", "High")):
        if f"{column}{ending}" in row:
            yield f"{name}{suffix}", plain(scale * float(row[f"{column}{ending}"]), digits), comment


def _numbers(study: Study) -> Iterator[Number]:
    """The headline first: gaps, prices, verdicts; then rewards."""
    yield from _headline(study)
    ranking = tables.ranking(study)
    for label in main_methods(str(m) for m in ranking.index if not is_variant(str(m))):
        row: Any = ranking.loc[label]
        comment = f"gap to the optimum, per cent: table ranking, row '{label}'"
        yield from _with_interval(f"Gap{letters(name_of(label))}", row, "gap", 1, 100, comment)
    for name, row in tables.published(study).iterrows():
        of = letters(str(name))
        comment = f"published learned reward: table published, row '{name}'"
        yield f"Published{of}", plain(_float(row.published), 1), comment
        comment = f"mean learned reward: table published, row '{name}'"
        yield f"Reward{of}", plain(row.ours, 1), comment
        yield f"Reward{of}SD", plain(row.ours_sd, 1), comment
    for name, row in tables.tasks(study).iterrows():
        comment = f"best known reward: table tasks, row '{name}'"
        yield f"Optimum{letters(str(name))}", plain(_float(row.optimum), 0), comment


def _float(value: Any) -> float:
    return math.nan if value is None or pd.isna(value) else float(value)


def _headline(study: Study) -> Iterator[Number]:
    paper, price, shared = facts.paper(study), facts.price(study), facts.coarticulation(study)
    if paper:
        for verdict, count in paper.claims.items():
            comment = f"claims that are {verdict}: table claims"
            yield f"Claims{letters(verdict)}", str(count), comment
        for verdict in ("equivalent", "undecided", "different"):
            comment = f"learned rewards of the paper's cells, {verdict}: table published"
            yield f"Rewards{letters(verdict)}", str(paper.rewards[verdict]), comment
    if shared:
        row = f"{shared.goal.tasks[0].name} {shared.goal.method} goal {shared.goal.goal} "
        comment = f"postures at the shared goal: table contexts, row '{row}{shared.goal.hand}'"
        yield "PosturesApart", plain(shared.goal.apart, 2), comment
        yield "PosturesApartSD", plain(shared.goal.spreads, 1), comment
    if price:
        prices = tables.price(study)
        labels = main_methods(map(str, prices.index))
        learner = next((label for label in labels if is_learner(label)), "")
        for label in filter(None, (learner, _labelled(prices, price.rival))):
            of = "Learner" if label == learner else letters(price.rival)
            comment = f"trials to half of the targets: table price, row '{label}'"
            prices_of: Any = prices.loc[label]
            yield from _with_interval(f"Half{of}", prices_of, "trials_to_half", 0, 1, comment)
            comment = f"trials to a quarter of the targets: table price, row '{label}'"
            yield from _with_interval(f"Quarter{of}", prices_of, "trials_to_quarter", 0, 1, comment)
        for at in price.levels:
            of = "Half" if at["level"] == 0.5 else "Quarter"
            comment = f"ratio of trials, learner over {price.rival}: table price"
            yield f"{of}Ratio", plain(at["times"], 1), comment


def _labelled(prices: pd.DataFrame, name: str) -> str:
    return next((str(label) for label in prices.index if name_of(str(label)) == name), "")
