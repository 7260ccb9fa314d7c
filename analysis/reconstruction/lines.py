"""What is printed of a task, line by line, beside fresh runs of it or of a reconstruction."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

import pandas as pd

from coartic import CONDITIONS, CoarticError, load_task
from coartic.analysis.reconstruction.constraints import RewardIs, sequences_of, try_sequences
from coartic.analysis.reconstruction.scoring import Compared, Figure, Learned, compared, learned
from coartic.analysis.reconstruction.targets import conditions_of, constraints_of, tests_of
from coartic.analysis.statistics import equivalence
from coartic.tasks.members import task_of
from coartic.tasks.readings import condition_under, load_readings, model_under, task_under

SHARES = 0.25
"""Margin of shares of runs."""
_SEEDS = 800_000_000  # of these runs begin here: they have selected nothing


def lines(
    names: Sequence[str],
    *,
    readings: Sequence[str] = (),
    runs: int = 100,
    trials: int = 10_000,
    jobs: int = 2,
    progress: Callable[[str], None] = lambda text: None,
) -> pd.DataFrame:
    """A row a task (or member) and printed figure.

    Columns ``task``, ``figure``, ``printed``, ``sd`` (printed), ``ours``, ``our_sd``, ``runs``
    (those that the figure rests on), ``low`` and ``high`` (of the difference) and ``verdict``
    of equivalence: means within 1 %, shares within :data:`SHARES`. SDs and orders have no margin:
    ``distance`` says by how many standard errors they, and all others, are off. Raises
    CoarticError for a task of which nothing is printed.
    """
    chosen, rows = load_readings(readings), []
    model, fields = model_under(chosen), condition_under(chosen)
    for name in names:
        task, plain = task_under(chosen, load_task(name)), task_of(name) or name
        conditions = {c: replace(CONDITIONS[c], **fields) for c in conditions_of(plain)}
        if not conditions:
            raise CoarticError(f"the paper prints nothing of task {name!r}")
        given = [c for c in constraints_of(load_task(plain)) if isinstance(c, RewardIs)]
        if given:
            goals = task.goal_array[None]
            tried = try_sequences(task, sequences_of(given), goals, model=model, jobs=1)
            for constraint in given:
                reward = float(tried.reward(constraint.hands)[0])
                same = bool(constraint.holds(tried)[0])
                rows.append({
                    "task": name, "figure": f"{constraint.hands}, corrective process alone",
                    "printed": constraint.value, "ours": reward, "runs": 1,
                    "verdict": "same" if same else "different",
                })  # fmt: skip
        cells = {}
        for label, condition in conditions.items():
            cells[label] = learned(
                task,
                condition,
                range(_SEEDS, _SEEDS + runs),
                model=model,
                trials=trials,
                jobs=jobs,
            )
            progress(f"{name}, {label}: {runs} runs")
        rows += [
            {"task": name, **dict(_line(each, cells))} for each in compared(tests_of(plain), cells)
        ]
    return pd.DataFrame(rows)


def _line(each: Compared, cells: Mapping[str, Learned]) -> Iterator[tuple[str, object]]:
    test = each.test
    yield "figure", test.label
    yield "ours", each.ours
    yield "distance", each.distance
    if not isinstance(test, Figure):
        return
    yield "printed", test.value
    cell = cells[test.condition]
    own = cell.with_hands(test.hands)
    yield "runs", cell.runs if test.kind == "share" else len(own)
    if test.kind == "mean":
        yield "sd", math.nan if test.sd is None else test.sd
        yield "our_sd", float(own.std(ddof=1)) if len(own) > 1 else math.nan
    if test.kind == "sd" or (test.kind == "mean" and len(own) < 2):
        return
    if test.kind == "mean":
        found = equivalence.difference(own, test.value, test.sd, test.runs)
    else:
        theirs = round(test.value * test.runs), test.runs
        found = equivalence.shares((len(own), cell.runs), theirs, SHARES)
    yield "low", found.low
    yield "high", found.high
    yield "verdict", found.verdict
