"""Whether what a results folder holds is whole: its manifest, and each table against the rest.

Tables are made at one go from the records, so what does not fit was cut short or altered
afterwards. Every check raises CoarticError that says what is missing and how it is made anew.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pandas.api.types import is_numeric_dtype

from coartic import CoarticError, Task, hand_sequences
from coartic.errors import NotApplicableError

FORMAT = 3  # of the tables, as benchmarks.tables writes them
ANEW = "start the same `coartic run` again: it makes the tables anew from the records"
SPECIFICATION: dict[str, type] = {
    "suite": str,
    "runs": int,
    "seed": int,
    "trials": int,
    "tasks": dict,
    "methods": dict,
    "cells": list,
    "run_ids": list,
}
"""What the specification of a manifest holds."""
DECLARED = ("title", "citation", "origin", "code")
"""Texts that the specification declares of every method."""
_TEXT = (
    "run_id suite task method variant status reason hands replay_hands initial_hands told "
    "parameters commit code packages"
)
_NUMBERS = (
    "run seed reward replay_reward initial_reward best_trial trials movement_ticks "
    "forward_kinematics jacobians corrective_iterations corrections failed_trials gradients "
    "hessians solver_iterations solution_corrections other_arm_travel proven_bound build_s "
    "solve_s wall_s cpu_s warm process_peak_mb"
)
TEXT: dict[str, tuple[str, ...]] = {
    "runs": tuple(_TEXT.split()),
    "solutions": ("run_id", "hand", "kind"),
    "paths": ("run_id",),
    "learning": ("run_id",),
    "sequences": ("task", "hands", "reason"),
}
"""Columns of text, by table."""
NUMBERS: dict[str, tuple[str, ...]] = {
    "runs": tuple(_NUMBERS.split()),
    "solutions": ("order", "goal", "ticks"),
    "paths": ("order", "waypoint"),
    "learning": ("trial", "reward"),
    "sequences": ("reward",),
}
"""Columns of numbers, by table; solutions and paths have one for each joint besides."""


def damaged(path: Path, why: str) -> NoReturn:
    """Raise CoarticError: a file of a results folder is not whole."""
    raise CoarticError(f"{path} is damaged ({why}); {ANEW}")


def check_manifest(path: Path, manifest: Any) -> None:
    """The manifest has the format of this version, and the keys that are read."""
    if not isinstance(manifest, dict):
        damaged(path, f"it holds a {type(manifest).__name__}, not an object")
    if manifest.get("format") != FORMAT:
        raise CoarticError(
            f"{path.parent}: its tables have format {manifest.get('format')}, this version reads "
            f"{FORMAT}; run the same `coartic run` again to make them anew from the records"
        )
    for key in ("specification", "environment"):
        if not isinstance(manifest.get(key), dict):
            damaged(path, f"it has no {key!r}")
    specification = manifest["specification"]
    for key, kind in SPECIFICATION.items():
        if not isinstance(specification.get(key), kind):
            damaged(path, f"its specification has no {key!r} that is a {kind.__name__}")
    for cell in specification["cells"]:
        if not isinstance(cell, dict) or not {"task", "method", "variant"} <= set(cell):
            damaged(path, "a cell of its specification lacks task, method or variant")
        for what in ("task", "method"):
            if cell[what] not in specification[f"{what}s"]:
                damaged(
                    path, f"its specification has no {what} {cell[what]!r}, which a cell names"
                )
    for name, method in specification["methods"].items():
        for key in DECLARED:
            if not isinstance(method, dict) or not isinstance(method.get(key), str):
                damaged(path, f"its method {name!r} has no {key!r} that is a str")


def check_columns(path: Path, table: pd.DataFrame) -> None:
    """A table has its columns, numbers where numbers are due."""
    name = path.stem
    for column in (*TEXT[name], *NUMBERS[name]):
        if column not in table.columns:
            damaged(path, f"it has no column {column!r}")
    for column in NUMBERS[name]:
        # All missing has no type: no run of the folder has a solution.
        if table[column].notna().any() and not is_numeric_dtype(table[column]):
            damaged(path, f"column {column!r} does not hold numbers")


def check_runs(
    path: Path, runs: pd.DataFrame, planned: list[str], code: Mapping[str, str]
) -> None:
    """Every run of the plan has one row, no other has any, and all of a method are of its code.

    ``code`` is what the manifest declares, by method.
    """
    twice = runs.run_id[runs.run_id.duplicated()]
    if len(twice):
        damaged(path, f"it holds {len(twice)} rows twice, run {twice.iloc[0]} among them")
    known, there = set(planned), set(runs.run_id)
    lost = [run_id for run_id in planned if run_id not in there]
    if lost:
        damaged(path, f"it lacks {len(lost)} of {len(known)} planned runs, {lost[0]} among them")
    foreign = runs.run_id[~runs.run_id.isin(known)]
    if len(foreign):
        damaged(path, f"it holds {len(foreign)} runs that were not planned, {foreign.iloc[0]}")
    for column in ("reward", "hands"):
        if runs.loc[runs.status == "ok", column].isna().any():
            damaged(path, f"a run with a solution has no {column}")
    own = runs.code.eq(runs.method.map(code)).fillna(False)
    if not own.all():
        damaged(
            path,
            f"{int((~own).sum())} rows are of other code than manifest.json declares for their "
            f"methods, run {runs.run_id[~own].iloc[0]} the first of them",
        )


def check_sequences(path: Path, sequences: pd.DataFrame, tasks: Mapping[str, Task]) -> None:
    """Every hand sequence of every task has one row, unless they are too many to list."""
    for name, task in tasks.items():
        own = sorted(sequences.hands[sequences.task == name])
        try:
            due = sorted(hand_sequences(task))
        except NotApplicableError:
            continue
        if own != due:
            damaged(path, f"it has {len(own)} of the {len(due)} hand sequences of {name}")


def check_solutions(
    path: Path, solutions: pd.DataFrame, runs: pd.DataFrame, tasks: Mapping[str, Task]
) -> None:
    """Every solved run, and no other, has movements, on all joints.

    Their ticks add up to its reward, and each is made with the hand of its goal.
    """
    solved = runs[runs.status == "ok"]
    lost = solved.run_id[~solved.run_id.isin(solutions.run_id)]
    if len(lost):
        damaged(
            path, f"it lacks the movements of {len(lost)} runs, {lost.iloc[0]} the first of them"
        )
    _check_joints(path, solutions, solved, tasks)
    ticks = solutions.groupby("run_id", observed=True).ticks.sum().reindex(solved.run_id)
    short = ticks.to_numpy() != -solved.reward.to_numpy(dtype=np.int64)
    if short.any():
        damaged(
            path,
            f"the movements of {int(short.sum())} runs, {solved.run_id[short].iloc[0]} the first "
            "of them, do not add up to their reward",
        )
    if solutions[["goal", "hand"]].isna().any(axis=None):
        damaged(path, "a movement has no goal or no hand")
    hands = dict(zip(solved.run_id, solved.hands, strict=True))
    rows = zip(solutions.run_id, solutions.goal.astype(int), solutions.hand, strict=True)
    strange = [
        run_id
        for run_id, goal, hand in rows
        if hands.get(run_id, "")[goal - 1 : goal].lower() != hand[:1]
    ]
    if strange:
        damaged(
            path,
            f"{len(strange)} movements, of run {strange[0]} first, are not made with the hands "
            "of a solved run",
        )


def check_paths(
    path: Path,
    paths: pd.DataFrame,
    solutions: pd.DataFrame,
    runs: pd.DataFrame,
    tasks: Mapping[str, Task],
) -> None:
    """Every movement along a path has its waypoints, in order and up to its target."""
    keys = ["run_id", "order"]
    due = solutions[solutions.kind == "path"]
    _check_joints(path, paths, runs[runs.run_id.isin(due.run_id)], tasks)
    if (paths.waypoint != paths.groupby(keys, sort=False).cumcount()).any():
        damaged(path, "the waypoints of a movement are not in order, or one is missing")
    targets = due.set_index(keys)
    ends = paths.groupby(keys, sort=False).tail(1).set_index(keys)
    there = ends.reindex(targets.index)
    joints = [name for name in targets if name in ends and name not in NUMBERS["solutions"]]
    apart = ~targets.index.isin(ends.index)
    for name in joints:
        apart |= (targets[name].notna() & (targets[name] != there[name])).to_numpy()
    if apart.any():
        damaged(
            path,
            f"the waypoints of {int(apart.sum())} movements do not lead to their targets, run "
            f"{due.run_id[apart].iloc[0]} among them",
        )


def check_learning(path: Path, learning: pd.DataFrame, runs: pd.DataFrame) -> None:
    """Every solved run has a row for each of its trials, in order."""
    codes, run_ids = pd.factorize(learning.run_id)
    starts = np.flatnonzero(np.diff(codes, prepend=-1))
    lengths = np.diff(np.append(starts, len(codes)))
    if len(starts) != len(run_ids) or not _counts_up(learning.trial, starts, lengths):
        damaged(path, "its trials are not in order, or one is missing")
    solved = runs[runs.status == "ok"]
    rows = pd.Series(lengths, index=pd.Index(run_ids, dtype=object)).reindex(solved.run_id)
    short = rows.fillna(0).to_numpy() != solved.trials.to_numpy(dtype=np.int64)
    if short.any():
        first = solved[short].iloc[0]
        damaged(
            path,
            f"it lacks trials of {int(short.sum())} runs: of run {first.run_id} it has "
            f"{int(rows.fillna(0)[first.run_id])} of {first.trials}",
        )


def _counts_up(trial: pd.Series[int], starts: NDArray[np.intp], lengths: NDArray[np.intp]) -> bool:
    """Whether trials count from 0 within each run."""
    expected = np.arange(len(trial)) - np.repeat(starts, lengths)
    return bool((trial.to_numpy(dtype=np.int64) == expected).all())


def _check_joints(
    path: Path, table: pd.DataFrame, runs: pd.DataFrame, tasks: Mapping[str, Task]
) -> None:
    """Every joint of the tasks' robots has a column, with a number for every row."""
    for name, own in runs.groupby("task", sort=False):
        rows = table[table.run_id.isin(own.run_id)]
        for joint in tasks[str(name)].robot.joint_names:
            if joint not in table.columns:
                damaged(path, f"it has no column {joint!r}")
            if not is_numeric_dtype(table[joint]) or rows[joint].isna().any():
                damaged(path, f"column {joint!r} lacks numbers")
