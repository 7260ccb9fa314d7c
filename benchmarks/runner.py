"""Runs the cells of a suite: every method executed, scored and verified alike."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray

from baselines.corrective_alone import every_sequence
from benchmarks.suites import Cell
from coartic import PAPER, CoarticError, LearningRun, NotApplicableError, Task, learn
from coartic.compiled import source_fingerprint
from coartic.frames import movement_rows, run_row


@dataclass(frozen=True)
class Plan:
    """Everything a set of results depends on."""

    suite: str
    cells: tuple[Cell, ...]
    runs: int
    trials: int
    seed: int

    @property
    def tasks(self) -> list[Task]:
        """The tasks of the cells, each once."""
        return list({cell.task.name: cell.task for cell in self.cells}.values())

    def specification(self) -> dict[str, Any]:
        """The plan as plain data."""
        return {
            "suite": self.suite,
            "runs": self.runs,
            "trials": self.trials,
            "seed": self.seed,
            "model": PAPER._asdict(),
            "tasks": {task.name: task.model_dump(mode="json") for task in self.tasks},
            "methods": {cell.method: asdict(cell.condition) for cell in self.cells},
            "cells": [{"task": cell.task.name, "method": cell.method} for cell in self.cells],
        }


@dataclass(frozen=True)
class RunRecord:
    """What is kept of one run."""

    row: dict[str, Any]
    movements: list[dict[str, Any]] = field(default_factory=list)
    rewards: NDArray[np.int64] | None = None
    """Reward per trial; None where the run never started."""
    completed: NDArray[np.bool_] | None = None


def run_seed(root: int, task: str, run: int) -> int:
    """Seed of one run, from the suite's seed, the task and the run's number alone.

    Every method gets the same seed for the same task and run, so runs are paired.
    """
    words = np.frombuffer(hashlib.sha256(task.encode()).digest()[:16], dtype="<u4")
    sequence = np.random.SeedSequence(root, spawn_key=(*map(int, words), run))
    return int(sequence.generate_state(1, np.uint64)[0] >> np.uint64(1))


def run_id(cell: Cell, seed: int, trials: int) -> str:
    """Hash of everything one run depends on, the model's code included."""
    specification = {
        "task": cell.task.model_dump(mode="json"),
        "method": cell.method,
        "parameters": asdict(cell.condition),
        "model": PAPER._asdict(),
        "trials": trials,
        "seed": seed,
        "code": source_fingerprint(),
    }
    text = json.dumps(specification, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def execute_plan(plan: Plan, *, jobs: int = -1) -> Iterator[RunRecord]:
    """Run everything, in the plan's order; records come as they are done.

    ``jobs`` threads work at once, -1 for one per core. The kernels hold no lock.
    """
    work = [(cell, run) for cell in plan.cells for run in range(plan.runs)]
    records: Iterator[RunRecord] = Parallel(n_jobs=jobs, prefer="threads", return_as="generator")(
        delayed(_one)(plan, cell, run) for cell, run in work
    )
    return records


def _one(plan: Plan, cell: Cell, run: int) -> RunRecord:
    seed = run_seed(plan.seed, cell.task.name, run)
    head = {
        "run_id": run_id(cell, seed, plan.trials),
        "suite": plan.suite,
        "task": cell.task.name,
        "method": cell.method,
        "run": run,
        "seed": seed,
    }
    try:
        result = learn(cell.task, cell.condition, seed=seed, trials=plan.trials)
        status, reason = _verify(result)
    except NotApplicableError as error:
        return RunRecord({**head, "status": "infeasible", "reason": str(error)})
    except Exception as error:  # a run that breaks is data; the others go on
        return RunRecord(
            {**head, "status": "crashed", "reason": f"{type(error).__name__}: {error}"}
        )
    row = {**run_row(result), **head, "status": status, "reason": reason}
    movements = [
        {"run_id": head["run_id"], **movement}
        for movement in movement_rows(cell.task, result.solution)
    ]
    return RunRecord(row, movements, result.rewards, result.completed)


def _verify(result: LearningRun) -> tuple[str, str]:
    """Execute the best trial apart from the learner; a difference is a failed run."""
    if result.status == "ok":
        again = result.execute()
        if again.reward != result.reward or again.hands != result.hands:
            raise CoarticError(
                f"the best trial re-executes to {again.reward} with {again.hands}, "
                f"recorded were {result.reward} with {result.hands}"
            )
    return result.status, result.reason


def corrective_sequences(tasks: Sequence[Task]) -> list[dict[str, Any]]:
    """The corrective process alone, one row per task and hand sequence, best first."""
    rows: list[dict[str, Any]] = []
    for task in tasks:
        try:
            trials = every_sequence(task)
        except NotApplicableError:
            continue  # more sequences than anyone would list
        rows.extend(
            {
                "task": task.name,
                "hands": trial.hands,
                "reward": trial.execution.reward,
                "reason": trial.execution.reason,
            }
            for trial in trials
        )
    return rows
