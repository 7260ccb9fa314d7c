"""The tables of a results folder: their columns, and how they are written.

``runs.parquet`` has one row a run, ``solutions.parquet`` one row a movement of each
run's best trial, ``learning.parquet`` one row a trial, ``sequences.parquet`` one row
per task and hand sequence of the corrective process alone. ``manifest.json`` says
what was run, where and with what.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from benchmarks.runner import RunRecord
from coartic import CoarticError

FORMAT = 1  # of the tables below; raised when a column changes its meaning
FILES = (
    "runs.parquet",
    "solutions.parquet",
    "learning.parquet",
    "sequences.parquet",
    "manifest.json",
)

RUNS = pa.schema(
    [
        ("run_id", pa.string()),
        ("suite", pa.string()),
        ("task", pa.string()),
        ("method", pa.string()),
        ("run", pa.int32()),  # 0-based
        ("seed", pa.int64()),
        ("status", pa.string()),  # ok, infeasible, crashed
        ("reason", pa.string()),  # empty where status is ok
        ("hands", pa.string()),  # of the best trial, such as LRLR
        ("reward", pa.int64()),  # learned reward: the best trial's
        ("replay_reward", pa.int64()),  # one noiseless greedy trial with the final tables
        ("replay_hands", pa.string()),
        ("initial_reward", pa.int64()),  # trial 0
        ("initial_hands", pa.string()),
        ("best_trial", pa.int64()),
        ("trials", pa.int64()),
        ("movement_ticks", pa.int64()),
        ("forward_kinematics", pa.int64()),
        ("jacobians", pa.int64()),
        ("corrective_iterations", pa.int64()),
        ("corrections", pa.int64()),
        ("failed_trials", pa.int64()),
        ("wall_s", pa.float64()),
        ("cpu_s", pa.float64()),
    ]
)
SOLUTIONS = pa.schema(
    [
        ("run_id", pa.string()),
        ("order", pa.int32()),  # 0-based, over the trial
        ("goal", pa.int32()),  # 1-based
        ("hand", pa.string()),
        ("kind", pa.string()),  # learned, corrective, planned
        ("ticks", pa.int64()),
    ]
)
SEQUENCES = pa.schema(
    [
        ("task", pa.string()),
        ("hands", pa.string()),
        ("reward", pa.int64()),
        ("reason", pa.string()),
    ]
)


def prepare_folder(folder: Path, *, overwrite: bool) -> None:
    """Make sure results can be written, before any work is done.

    Raises CoarticError where the folder holds results already or cannot be written.
    """
    present = [name for name in FILES if (folder / name).exists()]
    if present and not overwrite:
        raise CoarticError(
            f"{folder} already holds results ({', '.join(present)}); "
            "choose another --out, or add --overwrite to replace them"
        )
    probe = folder / f".writable-{os.getpid()}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise CoarticError(f"cannot write to {folder}: {error.strerror or error}") from None


def write_results(
    folder: Path,
    records: Sequence[RunRecord],
    sequences: Sequence[dict[str, Any]],
    manifest: dict[str, Any],
) -> None:
    """Write all tables, then put them in place together."""
    tables = {
        "runs.parquet": pa.Table.from_pylist([record.row for record in records], schema=RUNS),
        "solutions.parquet": _solutions_table(records),
        "learning.parquet": _learning_table(records),
        "sequences.parquet": pa.Table.from_pylist(list(sequences), schema=SEQUENCES),
    }
    waiting = []
    try:
        for name, table in tables.items():
            waiting.append(folder / f".{name}.part")
            pq.write_table(table, waiting[-1], compression="zstd", **_encoding(name))
        waiting.append(folder / ".manifest.json.part")
        text = json.dumps({"format": FORMAT, **manifest}, indent=2, ensure_ascii=False)
        waiting[-1].write_text(text + "\n", encoding="utf-8")
        for path in waiting:
            os.replace(path, folder / path.name.removeprefix(".").removesuffix(".part"))
    except OSError as error:
        raise CoarticError(f"cannot write to {folder}: {error.strerror or error}") from None
    finally:
        for path in waiting:
            path.unlink(missing_ok=True)


def _solutions_table(records: Sequence[RunRecord]) -> pa.Table:
    rows = [movement for record in records for movement in record.movements]
    joints = dict.fromkeys(key for row in rows for key in row if key not in SOLUTIONS.names)
    schema = SOLUTIONS
    for name in _ordered(joints):
        schema = schema.append(pa.field(name, pa.float64()))
    return pa.Table.from_pylist(rows, schema=schema)


def _ordered(joints: Iterable[str]) -> list[str]:
    """Joint names in the order of q, whichever robots they come from."""

    def key(name: str) -> tuple[int, int, str]:
        part, _, number = name.rpartition("_")
        return ("base", "left", "right").index(part), int(number) if number.isdigit() else 0, name

    return sorted(joints, key=key)


def _learning_table(records: Sequence[RunRecord]) -> pa.Table:
    started = [record for record in records if record.rewards is not None]
    lengths = [0 if record.rewards is None else len(record.rewards) for record in started]
    ids = pa.DictionaryArray.from_arrays(
        pa.array(np.repeat(np.arange(len(started), dtype=np.int32), lengths)),
        pa.array([record.row["run_id"] for record in started], pa.string()),
    )
    empty = [np.zeros(0, dtype=np.int64)]
    rewards = np.concatenate(empty + [r.rewards for r in started if r.rewards is not None])
    failed = np.concatenate(empty + [~r.completed for r in started if r.completed is not None])
    trials = np.concatenate(empty + [np.arange(length) for length in lengths])
    return pa.table(
        {
            "run_id": ids,
            "trial": pa.array(trials, pa.int32()),
            "reward": pa.array(rewards, pa.int32(), mask=failed.astype(bool)),
        }
    )


def _encoding(name: str) -> dict[str, Any]:
    if name != "learning.parquet":
        return {}
    return {
        "use_dictionary": ["run_id"],
        "column_encoding": {"trial": "DELTA_BINARY_PACKED", "reward": "DELTA_BINARY_PACKED"},
    }
