"""Two results folders beside each other: what differs between them, and in which results."""

from __future__ import annotations

import hashlib
import json
import math
from pathlib import Path
from typing import Any

import pandas as pd

from coartic import CoarticError
from coartic.analysis.statistics.equivalence import MARGIN, verdict, welch
from coartic.analysis.statistics.estimates import (
    FEWEST,
    difference_of_means,
    interval,
    paired_by_seed,
)
from coartic.analysis.statistics.hypotheses import bootstrap_test, holm, sign_flip_test
from coartic.analysis.study import CellRuns, Study, load
from coartic.robot import Array

_WORDS = {"title", "description", "provenance"}
"""Keys of a task that change no result."""


def load_pair(first: Path, second: Path) -> tuple[Study, Study]:
    """Two results folders that can be compared.

    Raises CoarticError for one folder given twice, and as :func:`coartic.analysis.load` does.
    """
    if first.exists() and second.exists() and first.samefile(second):
        raise CoarticError(
            f"{first} and {second} are the same folder. Name two, such as results/old results/new."
        )
    return load(first), load(second)


def differences(first: Study, second: Study) -> pd.DataFrame:
    """What was asked for and where it was run, as far as it differs.

    Columns ``what``, ``a``, ``b``.
    """
    a, b = facts_of(first), facts_of(second)
    rows = [
        (name, a.get(name, "–"), b.get(name, "–"))
        for name in dict.fromkeys([*a, *b])
        if a.get(name) != b.get(name)
    ]
    return pd.DataFrame(rows, columns=["what", "a", "b"])


def compared_cells(first: Study, second: Study) -> pd.DataFrame:
    """Every cell that both folders have, in the order of A's plan.

    ``runs_a`` and ``runs_b``; ``identical``: runs with the same seed and the same status, joints,
    ticks and rewards of all trials, of those ``shared``; mean rewards ``reward_a`` and
    ``reward_b``, of the runs that are compared; ``difference`` of B less A with its 95 % BCa
    interval, paired by seed where at least three are shared; ``p`` of a two-tailed test (pairs:
    sign flips) after Holm's correction over all cells; ``verdict``: identical, equivalent within
    1 %, undecided, different, too few
    runs, or not compared; ``remarks``.
    """
    ours, theirs = facts_of(first), facts_of(second)
    rows = [
        {
            "task": task,
            "method": label,
            **_compared(
                cell, second.cells[task, label], ours[f"task {task}"] == theirs[f"task {task}"]
            ),
        }
        for (task, label), cell in first.cells.items()
        if (task, label) in second.cells
    ]
    columns = ["task", "method", "runs_a", "runs_b", "shared", "identical", "reward_a", "reward_b"]
    columns += ["difference", "difference_low", "difference_high", "p", "verdict", "remarks"]
    frame = pd.DataFrame(rows, columns=columns)
    return frame.assign(p=holm(frame.p.astype(float).tolist()))


def _compared(a: CellRuns, b: CellRuns, same_task: bool) -> dict[str, Any]:
    results = [dict(zip(cell.runs.seed, cell.runs.result, strict=True)) for cell in (a, b)]
    shared = results[0].keys() & results[1].keys()
    row: dict[str, Any] = {
        "runs_a": len(a.runs),
        "runs_b": len(b.runs),
        "shared": len(shared),
        "identical": sum(results[0][seed] == results[1][seed] for seed in shared),
        "p": math.nan,
        "verdict": "not compared",
        "remarks": _remarks(a, b),
    }
    if not same_task:
        return row | {"identical": 0, "remarks": "the tasks of this name differ"}
    if len(a.good) < len(a.runs) or len(b.good) < len(b.runs) or not len(a.good):
        return row
    row |= {"reward_a": a.rewards.mean(), "reward_b": b.rewards.mean(), "difference": 0.0}
    # A method that draws nothing has one result, whatever the seed.
    alike = not shared and len({*a.good.result, *b.good.result}) == 1
    if alike or row["identical"] == len(a.good) == len(b.good):
        return row | {"verdict": "identical"}
    x, y = paired_by_seed(a.good, b.good)
    samples: tuple[Array, Array | float] = (b.rewards, a.rewards)
    if len(x) >= FEWEST:
        samples = y - x, 0.0
        row |= {"reward_a": x.mean(), "reward_b": y.mean()}
    difference = difference_of_means(*samples)
    test = sign_flip_test(y - x) if len(x) >= FEWEST else bootstrap_test(*samples, "two-sided")
    few = min(len(a.good), len(b.good)) < FEWEST
    agreement = verdict(welch(*samples), MARGIN * abs(a.rewards.mean()))
    return row | {
        **interval("difference", difference),
        "p": test.p,
        "verdict": "too few runs" if few else agreement,
    }


def _remarks(a: CellRuns, b: CellRuns) -> str:
    parts = [
        f"{side} solved {len(cell.good)} of {len(cell.runs)}"
        for side, cell in (("A", a), ("B", b))
        if len(cell.good) < len(cell.runs)
    ]
    if len(a.runs) and len(b.runs):
        ours, theirs = (json.loads(cell.runs.parameters.iloc[0]) for cell in (a, b))
        parts += [
            f"{name} {ours.get(name, 'absent')} in A, {theirs.get(name, 'absent')} in B"
            for name in sorted(ours.keys() | theirs.keys())
            if ours.get(name) != theirs.get(name)
        ]
    return "; ".join(parts)


def facts_of(study: Study) -> dict[str, str]:
    """What a folder's runs were asked for and made with: tasks, code and libraries by their names.

    Tasks go by a hash of what changes their results.
    """
    plan, made_with = study.plan, study.made_with
    commit = made_with["commit"]
    facts = {
        "suite": plan.suite,
        "seed": plan.seed,
        "runs a cell": plan.runs,
        "trials": plan.trials,
        "time limit (s)": plan.time_limit_s,
        "trial budget": plan.trial_budget,
        "runs": len(study.runs),
        "coartic": made_with["coartic"],
        "commit": commit and commit["id"][:12] + " with changes" * commit["dirty"],
        "code of the model": made_with["model_code"],
        "Python": made_with["python"],
        "platform": made_with["platform"],
        "processor": made_with["processor"],
        "cores": made_with["cores"],
    }
    for name, task in plan.tasks.items():
        text = json.dumps(task.model_dump(mode="json", exclude=_WORDS), sort_keys=True)
        facts[f"task {name}"] = f"definition {hashlib.sha256(text.encode()).hexdigest()[:8]}"
    facts |= {f"code of {name}": method.code for name, method in plan.methods.items()}
    facts |= {f"library {name}": version for name, version in made_with["packages"].items()}
    return {name: "–" if value is None else str(value) for name, value in facts.items()}
