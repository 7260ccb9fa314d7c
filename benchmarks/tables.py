"""The tables of a results folder, made from the records of its plan.

``runs.parquet`` has one row a run, ``solutions.parquet`` one row a movement of each
run's solution, ``paths.parquet`` one row a waypoint of movements that follow a path,
``learning.parquet`` one row a trial, ``sequences.parquet`` one row per task and hand
sequence of the corrective process alone. ``manifest.json`` says what was asked for.
The records under ``records/`` are the source; all of this can be made again from them.
"""

from __future__ import annotations

import io
import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from benchmarks.harness import meter_of
from benchmarks.specification import content_hash
from benchmarks.store import write_atomically
from benchmarks.suites import Cell
from coartic import CoarticError, NotApplicableError, Task, hand_sequences
from coartic.initial import ranked_sequences
from coartic.learner import METHOD_PREFIX
from coartic.method import Meter

FORMAT = 3  # of the tables below; raised when a column changes its meaning

RUNS = pa.schema(
    [
        ("run_id", pa.string()),
        ("suite", pa.string()),
        ("task", pa.string()),
        ("method", pa.string()),
        ("variant", pa.string()),  # parameters that differ from the method's defaults
        ("run", pa.int32()),  # 0-based
        ("seed", pa.int64()),
        ("status", pa.string()),  # ok, infeasible, solver-failed, timeout, crashed
        ("reason", pa.string()),  # empty where status is ok
        ("hands", pa.string()),  # of the solution, such as LRLR
        ("reward", pa.int64()),  # of the solution, executed and scored by the harness
        ("replay_reward", pa.int64()),  # one noiseless greedy trial with the final tables
        ("replay_hands", pa.string()),
        ("initial_reward", pa.int64()),  # trial 0
        ("initial_hands", pa.string()),
        ("best_trial", pa.int64()),
        *((name, pa.int64()) for name in Meter.COUNTS),
        ("solution_corrections", pa.int64()),  # corrective movements the solution needed
        ("other_arm_travel", pa.float64()),  # of the arm that is not chosen, rad
        ("proven_bound", pa.int64()),  # reward that no solution exceeds, where proven
        ("told", pa.string()),  # what the method was told, comma-separated
        ("parameters", pa.string()),  # all of them, JSON
        ("build_s", pa.float64()),
        ("solve_s", pa.float64()),
        ("wall_s", pa.float64()),
        ("cpu_s", pa.float64()),
        ("warm", pa.bool_()),  # the process had run this method before
        ("process_peak_mb", pa.float64()),  # of the worker so far, all its runs included
        ("commit", pa.string()),
        ("code", pa.string()),  # hash of the code that produced the result
        ("packages", pa.string()),  # hash of Python's and all libraries' versions
    ]
)
TIMINGS = (
    "build_s",
    "solve_s",
    "wall_s",
    "cpu_s",
    "warm",
    "process_peak_mb",
    "commit",
    "packages",
)
"""Columns of ``runs.parquet`` that may differ between two runs of one specification."""

SOLUTIONS = pa.schema(
    [
        ("run_id", pa.string()),
        ("order", pa.int32()),  # 0-based, over the trial
        ("goal", pa.int32()),  # 1-based
        ("hand", pa.string()),
        ("kind", pa.string()),  # learned, corrective, planned, path
        ("ticks", pa.int64()),
    ]
)
PATHS = pa.schema([("run_id", pa.string()), ("order", pa.int32()), ("waypoint", pa.int32())])
SEQUENCES = pa.schema(
    [
        ("task", pa.string()),
        ("hands", pa.string()),
        ("reward", pa.int64()),
        ("reason", pa.string()),
    ]
)


def write_tables(
    folder: Path,
    suite: str,
    planned: Sequence[tuple[Cell, dict[str, Any]]],
    manifest: dict[str, Any],
) -> None:
    """Write all tables of a plan from its records, each atomically.

    Raises CoarticError where the disk does not take them.
    """
    records = [record for _, record in planned]
    tasks = list({cell.task.name: cell.task for cell, _ in planned}.values())
    solutions = [
        {"run_id": record["run_id"], **movement}
        for record in records
        for movement in record["solution"]
    ]
    tables = {
        "runs.parquet": pa.Table.from_pylist(
            [_run_row(suite, cell, record) for cell, record in planned], schema=RUNS
        ),
        "solutions.parquet": _joint_table(
            [{k: v for k, v in row.items() if k != "waypoints"} for row in solutions], SOLUTIONS
        ),
        "paths.parquet": _joint_table(_path_rows(solutions), PATHS),
        "learning.parquet": _learning_table(records),
        "sequences.parquet": pa.Table.from_pylist(_sequence_rows(tasks), schema=SEQUENCES),
    }
    text = json.dumps({"format": FORMAT, **manifest}, indent=2, ensure_ascii=False) + "\n"
    try:
        for name, table in tables.items():
            sink = io.BytesIO()
            pq.write_table(table, sink, compression="zstd", **_encoding(name))
            write_atomically(folder / name, sink.getvalue())
        write_atomically(folder / "manifest.json", text.encode())
    except OSError as error:
        raise CoarticError(f"cannot write to {folder}: {error.strerror or error}") from None


def _run_row(suite: str, cell: Cell, record: dict[str, Any]) -> dict[str, Any]:
    specification, score, details = record["specification"], record["score"], record["details"]
    commit = record["environment"]["commit"]
    timing = record["timing"]
    return {
        **(_learner_columns(details) if cell.method.startswith(METHOD_PREFIX) else {}),
        "run_id": record["run_id"],
        "suite": suite,
        "task": cell.task.name,
        "method": cell.method,
        "variant": cell.variant,
        "run": record["run"],
        "seed": specification["seed"],
        "status": record["status"],
        "reason": record["reason"],
        "hands": score and score["hands"],
        "reward": score and score["reward"],
        "solution_corrections": score and score["corrections"],
        "other_arm_travel": score and score["other_arm_travel"],
        "proven_bound": details.get("proven_bound"),
        **meter_of(record),
        "told": ", ".join(record["told"]),
        "parameters": json.dumps(specification["parameters"], sort_keys=True),
        "wall_s": timing["wall_s"],
        "cpu_s": timing["cpu_s"],
        "warm": timing["warm"],
        "process_peak_mb": timing["process_peak_mb"],
        "commit": commit and commit["id"] + ("+" if commit["dirty"] else ""),
        "code": record["code"],
        "packages": content_hash(
            [record["environment"]["python"], record["environment"]["packages"]]
        )[:8],
    }


def _learner_columns(details: dict[str, Any]) -> dict[str, Any]:
    names = ("replay_reward", "replay_hands", "initial_reward", "initial_hands", "best_trial")
    return {name: details.get(name) for name in names}


def _path_rows(solutions: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    return [
        {"run_id": row["run_id"], "order": row["order"], "waypoint": index, **point}
        for row in solutions
        for index, point in enumerate(row.get("waypoints") or ())
    ]


def _joint_table(rows: list[dict[str, Any]], schema: pa.Schema) -> pa.Table:
    """A table with one further column per joint that its rows have."""
    joints = dict.fromkeys(key for row in rows for key in row if key not in schema.names)
    for name in _ordered(joints):
        schema = schema.append(pa.field(name, pa.float64()))
    return pa.Table.from_pylist(rows, schema=schema)


def _ordered(joints: Iterable[str]) -> list[str]:
    """Joint names in the order of q, whichever robots they come from."""

    def key(name: str) -> tuple[int, int, str]:
        part, _, number = name.rpartition("_")
        return ("base", "left", "right").index(part), int(number) if number.isdigit() else 0, name

    return sorted(joints, key=key)


def _learning_table(records: Sequence[dict[str, Any]]) -> pa.Table:
    rewards = [pa.array(record["rewards"], pa.int32()) for record in records]
    lengths = [len(array) for array in rewards]
    ids = pa.DictionaryArray.from_arrays(
        pa.array(np.repeat(np.arange(len(records), dtype=np.int32), lengths)),
        pa.array([record["run_id"] for record in records], pa.string()),
    )
    trials = np.concatenate([np.zeros(0, np.int64), *(np.arange(n) for n in lengths)])
    return pa.table(
        {
            "run_id": ids,
            "trial": pa.array(trials, pa.int32()),
            "reward": pa.chunked_array(rewards, pa.int32()),
        }
    )


def _sequence_rows(tasks: Sequence[Task]) -> list[dict[str, Any]]:
    """The corrective process alone, one row per task and hand sequence, best first."""
    rows: list[dict[str, Any]] = []
    for task in tasks:
        try:
            trials = ranked_sequences(task, hand_sequences(task))
        except NotApplicableError:
            continue  # more sequences than anyone would list
        rows.extend(
            {
                "task": task.name,
                "hands": hands,
                "reward": execution.reward,
                "reason": execution.reason,
            }
            for hands, execution in trials
        )
    return rows


def _encoding(name: str) -> dict[str, Any]:
    if name != "learning.parquet":
        return {}
    return {
        "use_dictionary": ["run_id"],
        "column_encoding": {"trial": "DELTA_BINARY_PACKED", "reward": "DELTA_BINARY_PACKED"},
    }
