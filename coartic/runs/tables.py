"""The tables of a results folder: what follows from its manifest and the records of its plan.

``runs.parquet`` has one row a run, ``solutions.parquet`` one row a movement of each run's
solution, ``paths.parquet`` one row a waypoint of movements that follow a path,
``learning.parquet`` one row a trial, ``sequences.parquet`` one row per task and hand
sequence of the corrective process alone. :func:`row_groups` makes them piece by piece, so that
a million runs need no more memory than a thousand; those who read a folder make them again and
compare, so a table never says anything that its records do not.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Annotated, Any, Literal

import numpy as np
import pyarrow as pa
from pydantic import Field

from coartic.errors import NotApplicableError
from coartic.method import Information, Meter
from coartic.model import MotionModel
from coartic.motion.initial import hand_sequences, ranked_sequences
from coartic.runs.record import RECORD_FORMAT, Asked, Environment, Record, corrections_of, run_seeds
from coartic.runs.scores import PlainMovement
from coartic.runs.stored import Count, Plain, Reason, Seed, TaskContent, Values, content_hash
from coartic.tasks.readings import load_readings, model_under
from coartic.tasks.task import parse_task
from coartic.text import Line

FORMAT: Literal[8] = 8  # of manifest and tables; raised when one of them changes its meaning

RUNS = pa.schema(
    [
        ("run_id", pa.string()),
        ("suite", pa.string()),
        ("task", pa.string()),
        ("method", pa.string()),
        ("variant", pa.string()),  # parameters that differ from the method's defaults
        ("label", pa.string()),  # the method with its variant
        ("run", pa.int32()),  # 0-based
        ("seed", pa.int64()),
        ("status", pa.string()),  # ok, infeasible, solver-failed, timeout, crashed
        ("reason", pa.string()),  # empty where status is ok
        ("hands", pa.string()),  # of the solution, such as LRLR
        ("reward", pa.int64()),  # of the solution, executed and scored by the harness
        ("replay_reward", pa.int64()),  # one noiseless greedy trial with what was learned
        ("replay_hands", pa.string()),
        ("initial_reward", pa.int64()),  # trial 0 of a learner
        ("initial_hands", pa.string()),
        ("best_trial", pa.int64()),  # first trial with the solution's reward, if any
        *((name, pa.int64()) for name in Meter.COUNTS),
        ("solution_corrections", pa.int64()),  # corrective movements the solution needed
        ("early_corrections", pa.int64()),  # in a learner's first tenth of trials after trial 0
        ("late_corrections", pa.int64()),  # in the last tenth
        ("other_arm_travel", pa.float64()),  # of the arm that is not chosen, rad
        ("proven_bound", pa.int64()),  # reward that no solution exceeds, where proven
        ("told", pa.string()),  # what the method was told, comma-separated
        ("parameters", pa.string()),  # all of them, JSON
        ("build_s", pa.float64()),
        ("solve_s", pa.float64()),
        ("wall_s", pa.float64()),
        ("cpu_s", pa.float64()),
        ("warm", pa.bool_()),  # the process had run this method before
        ("together", pa.int32()),  # runs performed side by side; times are equal shares
        ("process_peak_mb", pa.float64()),  # of the worker so far, all its runs included
        ("commit", pa.string()),
        ("code", pa.string()),  # hash of the code that produced the result
        ("packages", pa.string()),  # hash of Python's and all libraries' versions
        ("result", pa.string()),  # hash of status, solutions, rewards of all trials, bound
    ]
)
LARGEST_MANIFEST = 1 << 28
"""Bytes of a manifest."""
TIMINGS = (
    "build_s",
    "solve_s",
    "wall_s",
    "cpu_s",
    "warm",
    "together",
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


LEARNING = pa.schema(
    [
        ("run_id", pa.dictionary(pa.int32(), pa.string())),
        ("trial", pa.int32()),
        ("reward", pa.int32()),
    ]
)
GROUP_RUNS, GROUP_TRIALS, GROUP_WAYPOINTS = 5_000, 1_000_000, 50_000
"""At so many runs, trials or waypoints a row group of the tables ends; a run is in one of them."""

TABLES = ("runs", "solutions", "paths", "learning", "sequences")
"""Names of the tables."""


class DeclaredMethod(Plain):
    """What a method declares of itself, and where it comes from."""

    title: Line
    citation: Line
    told: tuple[Information, ...]
    secondary: tuple[Line, ...]
    stochastic: bool
    """Whether its cells have as many runs as the plan says; the others have one."""
    defaults: Values
    """Its parameters; None for one that has no default."""
    origin: Line
    code: Line


class PlannedCell(Plain):
    """One method with parameters on one task, and its runs in order."""

    task: Line
    method: Line
    variant: Reason
    parameters: Values
    """What the suite says of its parameters."""
    complete: Values
    """All of them, as its runs have them."""
    runs: Count | None = None
    """Where they are not the plan's."""

    @property
    def label(self) -> str:
        """The method with its variant."""
        return label_of(self.method, self.variant)


class Plan(Plain):
    """What a suite asked for, all of it."""

    suite: Line
    runs: Count
    seed: Seed
    trials: Count
    readings: tuple[Line, ...]
    """Readings of the paper that are not the default, as ``ties=right``."""
    tasks: dict[Line, TaskContent]
    methods: dict[Line, DeclaredMethod]
    cells: tuple[PlannedCell, ...]

    @property
    def model(self) -> MotionModel:
        """The constants of movement under these readings."""
        return model_under(load_readings(self.readings))


class PlanLimits(Plain):
    """Bounds that runs were performed under."""

    time_s: Annotated[float, Field(gt=0)] | None
    trials: Annotated[int, Field(gt=0)] | None


class Manifest(Plain):
    """``manifest.json``: what was asked for and with what it was made."""

    format: Literal[8] = FORMAT
    specification: Plan
    limits: PlanLimits
    environment: Environment
    records: Annotated[str, Field(pattern="^([0-9a-f]{64})?$")]
    """:attr:`coartic.runs.packs.Packs.digest` of what the tables were made of."""
    tables: dict[Line, Annotated[str, Field(pattern="^[0-9a-f]{64}$")]]
    """SHA-256 of each table's file, by its name."""

    def run_ids(self, cell: PlannedCell) -> list[str]:
        """Ids of a cell's runs, in their order."""
        plan = self.specification
        method = plan.methods[cell.method]
        asked = Asked(
            format=RECORD_FORMAT,
            task=plan.tasks[cell.task],
            method=cell.method,
            parameters=cell.complete,
            model=plan.model._asdict(),
            trial_budget=self.limits.trials,
        )
        runs = cell.runs or plan.runs
        seeds = run_seeds(plan.seed, cell.task, runs if method.stochastic else 1)
        return [f"{key}-{method.code}" for key in asked.keys(seeds)]

    def seal(self) -> str:
        """Hash of the whole content, kept beside it: a changed manifest is noticed."""
        return content_hash(self.model_dump(mode="json"))

    def text(self) -> str:
        """The file's text."""
        content = {**self.model_dump(mode="json"), "seal": self.seal()}
        return json.dumps(content, indent=2, ensure_ascii=False) + "\n"


def trials_in(parameters: Mapping[str, Any]) -> int:
    """Trials that a run with these parameters makes; 0 where they do not say."""
    trials = parameters.get("trials")
    return trials if type(trials) is int and trials > 0 else 0


def variant_of(parameters: Mapping[str, Any], defaults: Mapping[str, Any]) -> str:
    """Parameters that differ from the method's defaults, such as ``noise_sd=0.1``."""
    return ", ".join(
        f"{name}={value}"
        for name, value in parameters.items()
        if name not in defaults or value != defaults[name]
    )


def label_of(method: str, variant: str) -> str:
    """A method with its variant, as everything names it that has no room for both."""
    return f"{method} {variant}".strip()


Planned = tuple[PlannedCell, Record]
"""A run of a plan."""


def schemas(plan: Plan) -> dict[str, pa.Schema]:
    """Columns of the tables by name, in the order of :data:`TABLES`."""
    robots = [parse_task(task, "manifest").robot for task in plan.tasks.values()]
    names = dict.fromkeys(name for robot in robots for name in robot.joint_names)
    joints = pa.schema([(name, pa.float64()) for name in _ordered(names)])
    return {
        "runs": RUNS,
        "solutions": pa.unify_schemas([SOLUTIONS, joints]),
        "paths": pa.unify_schemas([PATHS, joints]),
        "learning": LEARNING,
        "sequences": SEQUENCES,
    }


def row_groups(plan: Plan, runs: Iterable[Planned]) -> Iterator[tuple[str, pa.Table]]:
    """The tables' row groups, none of them empty, by name, each table's in order.

    ``runs`` are those of the plan in its order; each is let go before the next is taken.
    """
    columns = schemas(plan)
    group = _Group(plan.suite, columns)
    for cell, record in runs:
        if group.is_full_with(record):
            yield from group.tables()
            group = _Group(plan.suite, columns)
        group.add(cell, record)
    yield from group.tables()
    sequences = [
        row for task in plan.tasks.values() for row in _sequence_rows(json.dumps(task), plan.model)
    ]
    if sequences:
        yield "sequences", pa.Table.from_pylist(sequences, schema=SEQUENCES)


class _Group:
    """Rows of some runs, on their way into tables."""

    def __init__(self, suite: str, columns: Mapping[str, pa.Schema]) -> None:
        self._suite, self._columns = suite, columns
        self._rows: dict[str, list[dict[str, Any]]] = {"runs": [], "solutions": [], "paths": []}
        self._rewards: dict[str, pa.Array] = {}
        self._trials = 0

    def is_full_with(self, record: Record) -> bool:
        """Whether one more run is too much; any run is good as the first."""
        rows, trials = self._rows, self._trials + len(record.rewards)
        full = len(rows["runs"]) == GROUP_RUNS or len(rows["paths"]) >= GROUP_WAYPOINTS
        return full or (bool(self._trials) and trials > GROUP_TRIALS)

    def add(self, cell: PlannedCell, record: Record) -> None:
        """One more run."""
        self._rows["runs"].append(_run_row(self._suite, cell, record))
        self._rows["solutions"] += _solution_rows(record)
        self._rows["paths"] += _path_rows(record)
        if record.rewards:
            self._rewards[record.run_id] = pa.array(record.rewards, pa.int32())
            self._trials += len(record.rewards)

    def tables(self) -> Iterator[tuple[str, pa.Table]]:
        """Those that have rows."""
        for name, rows in self._rows.items():
            if rows:
                yield name, pa.Table.from_pylist(rows, schema=self._columns[name])
        if self._rewards:
            yield "learning", _learning_table(self._rewards)


def parquet_options(name: str) -> dict[str, Any]:
    """How a table is best written."""
    if name != "learning":
        return {"compression": "zstd"}
    return {
        "compression": "zstd",
        "use_dictionary": ["run_id"],
        "column_encoding": {"trial": "DELTA_BINARY_PACKED", "reward": "DELTA_BINARY_PACKED"},
    }


def _run_row(suite: str, cell: PlannedCell, record: Record) -> dict[str, Any]:
    solution, replay, initial = record.solution, record.replay, record.initial
    specification, environment = record.specification, record.environment
    commit, by_trial = environment.commit, corrections_of(record)
    return {
        "run_id": record.run_id,
        "suite": suite,
        "task": cell.task,
        "method": cell.method,
        "variant": cell.variant,
        "label": cell.label,
        "run": record.run,
        "seed": specification.seed,
        "status": record.status,
        "reason": record.reason,
        "hands": solution and solution.hands,
        "reward": solution and solution.reward,
        "replay_reward": replay and replay.reward,
        "replay_hands": replay and replay.hands,
        "initial_reward": initial and initial.reward,
        "initial_hands": initial and initial.hands,
        "best_trial": _best_trial(record),
        **(vars(record.meter) if record.meter else dict.fromkeys(vars(Meter()))),
        "solution_corrections": solution and solution.corrections,
        "early_corrections": by_trial and by_trial[1],
        "late_corrections": by_trial and by_trial[-1],
        "other_arm_travel": solution and solution.other_arm_travel,
        "proven_bound": record.bound,
        "told": ", ".join(record.told),
        "parameters": json.dumps(specification.parameters, sort_keys=True),
        "wall_s": record.timing.wall_s,
        "cpu_s": record.timing.cpu_s,
        "warm": record.timing.warm,
        "together": record.timing.together,
        "process_peak_mb": record.timing.process_peak_mb,
        "commit": commit and commit.id + ("+" if commit.dirty else ""),
        "code": record.code,
        "packages": content_hash([environment.python, environment.packages])[:8],
        "result": record.digest(),
    }


def _best_trial(record: Record) -> int | None:
    if record.solution is None or record.solution.reward not in record.rewards:
        return None
    return record.rewards.index(record.solution.reward)


def _solution_rows(record: Record) -> Iterator[dict[str, Any]]:
    joints = record.task.robot.joint_names
    for order, row in enumerate(_movements(record)):
        yield {
            "run_id": record.run_id,
            "order": order,
            "goal": row.goal,
            "hand": row.hand,
            "kind": row.kind,
            "ticks": row.ticks,
            **dict(zip(joints, row.target or (), strict=True)),
        }


def _path_rows(record: Record) -> Iterator[dict[str, Any]]:
    joints = record.task.robot.joint_names
    for order, row in enumerate(_movements(record)):
        for index, point in enumerate(row.waypoints or ()):
            place = {"run_id": record.run_id, "order": order, "waypoint": index}
            yield place | dict(zip(joints, point, strict=True))


def _movements(record: Record) -> tuple[PlainMovement, ...]:
    return () if record.solution is None else record.solution.movements


def _ordered(joints: Iterable[str]) -> list[str]:
    """Joint names in the order of q, whichever robots they come from."""

    def key(name: str) -> tuple[int, int, str]:
        part, _, number = name.rpartition("_")
        return ("base", "left", "right").index(part), int(number) if number.isdigit() else 0, name

    return sorted(joints, key=key)


def _learning_table(rewards: Mapping[str, pa.Array]) -> pa.Table:
    lengths = [len(own) for own in rewards.values()]
    ids = pa.DictionaryArray.from_arrays(
        pa.array(np.repeat(np.arange(len(rewards), dtype=np.int32), lengths)),
        pa.array(rewards.keys(), pa.string()),
    )
    trials = pa.array(np.concatenate([np.arange(n, dtype=np.int32) for n in lengths]))
    return pa.table([ids, trials, pa.chunked_array(rewards.values())], schema=LEARNING)


@lru_cache(maxsize=64)
def _sequence_rows(content: str, model: MotionModel) -> Sequence[dict[str, Any]]:
    """The corrective process alone on a task, one row per hand sequence, best first."""
    task = parse_task(json.loads(content), "manifest")
    try:
        trials = ranked_sequences(task, hand_sequences(task), model=model)
    except NotApplicableError:
        return ()  # more sequences than anyone would list
    return [
        {"task": task.name, "hands": hands, "reward": execution.reward, "reason": execution.reason}
        for hands, execution in trials
    ]
