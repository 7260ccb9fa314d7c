"""Headline numbers as LaTeX macros, at most a hundred, each with a comment that names its runs.

A macro names a cell of a table, so that ``coartic trace TABLE ROW`` prints the runs behind it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import numpy as np

from coartic.analysis.claims.judgements import counts
from coartic.analysis.methods import is_variant, main_methods, name_of
from coartic.analysis.report import about
from coartic.analysis.report.contents import TABLES
from coartic.analysis.study import Study
from coartic.analysis.table import COLUMNS
from coartic.analysis.topics.coarticulation.shared_goals import shared_goal
from coartic.analysis.topics.comparison import sentences as comparison
from coartic.analysis.topics.paper.sentences import papers_claims, rewards_by_verdict

MOST = 100
_DIGITS = ("Zero", "One", "Two", "Three", "Four", "Five", "Six", "Seven", "Eight", "Nine")
Number = tuple[str, str, str]
"""Name behind ``\\coartic``, text, and a comment that says what it is and where its runs are."""


def numbers_tex(study: Study) -> str:
    """The macros as a file that LaTeX inputs."""
    made = about.provenance(study)
    lines = [
        f"% Headline numbers of suite {made['suite']}, seed {made['seed']}: {made['runs']} runs",
        f"% of coartic {' '.join(filter(None, (made['version'], made['commit'])))}, "
        f"{made['date']}.",
        "% `coartic trace TABLE ROW` prints the runs behind a row that a comment names.",
    ]
    macros: dict[str, str] = {}
    for name, text, comment in numbers(study):
        if text:
            macros.setdefault(name, f"\\newcommand{{\\coartic{name}}}{{{text}}} % {comment}")
    return "\n".join([*lines, *list(macros.values())[:MOST]]) + "\n"


def letters_alone(text: str) -> str:
    """A name in letters alone: ``two-armed-1`` is ``TwoArmedOne``."""
    spelled = re.sub(r"\d", lambda digit: _DIGITS[int(digit[0])].join("  "), text)
    return "".join(word[:1].upper() + word[1:] for word in re.findall("[A-Za-z]+", spelled))


def decimals(value: Any, digits: int) -> str:
    """A number for LaTeX in decimals; empty where there is none or it is infinite."""
    return f"{value:.{digits}f}" if value is not None and np.isfinite(value) else ""


def with_interval(
    name: str, row: Any, column: str, digits: int, scale: float, comment: str
) -> Iterator[Number]:
    """A number and the ends of its interval."""
    for ending, suffix in (("", ""), ("_low", "Low"), ("_high", "High")):
        yield f"{name}{suffix}", decimals(scale * row[f"{column}{ending}"], digits), comment


def numbers(study: Study) -> Iterator[Number]:
    """The headline first: verdicts, running times, gaps; then rewards."""
    if len(judged := papers_claims(study)):
        for verdict_of_claim, count in counts(judged.verdict).items():
            comment = f"claims that are {verdict_of_claim}: table claims"
            yield f"Claims{letters_alone(verdict_of_claim)}", str(count), comment
        for verdict, count in rewards_by_verdict(study).items():
            comment = f"learned rewards of the paper's cells, {verdict}: table published"
            yield f"Rewards{letters_alone(verdict)}", str(count), comment
    if shared := shared_goal(study):
        comment = f"postures at the shared goal: table contexts, row '{shared.row}'"
        yield "PosturesApart", decimals(shared.apart, 2), comment
        yield "PosturesApartSD", decimals(shared.spreads, 1), comment
    learner, rival = comparison.learner_and_rival(study)
    for row in (learner, rival):
        if row is None:
            continue
        of = "Learner" if row is learner else letters_alone(name_of(row.method))
        for level, column in (("Half", "trials_to_half"), ("Quarter", "trials_to_quarter")):
            comment = f"{COLUMNS[column].header} of the targets: table runtimes, row '{row.method}'"
            yield from with_interval(f"{level}{of}", row, column, 0, 1, comment)
    for column, ratio in comparison.ratios(study).items():
        comment = f"ratio of trials, learner over {name_of(rival.method)}: table runtimes"
        yield f"{letters_alone(column).removeprefix('TrialsTo')}Ratio", decimals(ratio, 1), comment
    ranking = TABLES["ranking"](study)
    for label in main_methods(str(m) for m in ranking.index if not is_variant(str(m))):
        comment = f"gap to the optimum, per cent: table ranking, row '{label}'"
        row = ranking.loc[label]
        yield from with_interval(f"Gap{letters_alone(name_of(label))}", row, "gap", 1, 100, comment)
    for name, row in TABLES["published"](study).iterrows():
        of = letters_alone(str(name))
        comment = f"published learned reward: table published, row '{name}'"
        yield f"Published{of}", decimals(row.published, 1), comment
        comment = f"mean learned reward: table published, row '{name}'"
        yield f"Reward{of}", decimals(row.ours, 1), comment
        yield f"Reward{of}SD", decimals(row.ours_sd, 1), comment
    for name, row in TABLES["tasks"](study).iterrows():
        comment = f"best known reward: table tasks, row '{name}'"
        yield f"Optimum{letters_alone(str(name))}", decimals(row.optimum, 0), comment
