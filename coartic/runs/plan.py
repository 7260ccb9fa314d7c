"""The runs that a suite asks for, with their ids and seeds."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Annotated, Any

import numpy as np
from pydantic import Field, TypeAdapter

from coartic.internal.limits import MOST_RUNS
from coartic.learner.conditions import METHOD_PREFIX
from coartic.model import PAPER
from coartic.runs.method_info import MethodInfo
from coartic.tasks.task import Task, parse_task

SEARCH = "optimum/"
"""Ids of the searches for the optimum begin so; they alone may state a bound."""


@dataclass(frozen=True)
class Cell:
    """One method with parameters on one task."""

    task: Task
    method: MethodInfo
    parameters: dict[str, Any] = field(default_factory=dict)
    """The parameters that the suite sets."""
    complete: dict[str, Any] = field(default_factory=dict)
    """All parameters, once the cell is part of a plan."""
    runs: Annotated[int, Field(ge=0, le=MOST_RUNS)] = 1

    @property
    def setting(self) -> str:
        """Parameters that differ from the method's defaults, such as ``noise_sd=0.1``."""
        defaults = self.method.defaults
        return ", ".join(
            f"{name}={value}"
            for name, value in self.parameters.items()
            if name not in defaults or value != defaults[name]
        )

    @property
    def label(self) -> str:
        """The method with its setting."""
        return label_of(self.method.name, self.setting)


_MODEL_THEN = {
    "arrival_tick": 1,
    "corrective_arrival": False,
    "first_step": False,
    "whole_last_step": False,
}
_LEARNER_THEN = {
    "equal_distance": "random",
    "first_trial": "learns",
    "state": "previous-hand",
    "ties": "left",
    "unknown_target": "corrects",
}
"""Readings of the paper that versions 1.0 and 1.1 stored, with the values that are the rule now.
They are a part of the hash with which the id of a run begins, so that runs of then count as runs of
now."""


def dropped(method: str) -> dict[str, Any]:
    """Parameters of a method that earlier versions stored, and this version does not have."""
    if method.startswith("posture-qp/"):
        return {"modelling": "none"}
    return _LEARNER_THEN if method.startswith(METHOD_PREFIX) else {}


def parameters_from(method: str, text: str) -> dict[str, Any]:
    """Stored parameters of a method that it still has. Raises ValueError for what is no table."""
    stored = json.loads(text)
    if not isinstance(stored, dict):
        raise ValueError(f"parameters are {stored!r}")
    return {name: value for name, value in stored.items() if name not in dropped(method)}


@dataclass(frozen=True)
class Specification:
    """Everything that the results of a run depend on, apart from its seed."""

    task: Task
    method: str
    code: str
    """Hash of the method's code."""
    information: tuple[str, ...]
    parameters: dict[str, Any]
    """All parameters of the method."""
    trial_budget: int | None
    """Most trials of one run, without the search for initial hands."""

    @cached_property
    def definition(self) -> dict[str, Any]:
        """The task as plain data."""
        return self.task.model_dump(mode="json")

    @cached_property
    def asked(self) -> str:
        """Hash of all this but the code.

        A time limit is not part of it: it decides whether there is a result, not which.
        """
        return hash_of(
            {
                "task": self.definition,
                "method": self.method,
                "parameters": self.parameters | dropped(self.method),
                "model": PAPER._asdict() | _MODEL_THEN,
                "trial_budget": self.trial_budget,
            }
        )

    def to_row(self) -> dict[str, Any]:
        """Its row of table ``settings``."""
        return {
            "asked": self.asked,
            "code": self.code,
            "task": self.task.name,
            "definition": self.definition,
            "method": self.method,
            "parameters": json.dumps(self.parameters, ensure_ascii=False, sort_keys=True),
            "model": PAPER._asdict(),
            "trial_budget": self.trial_budget,
            "information": ", ".join(self.information),
        }

    @classmethod
    def from_row(cls, row: Mapping[str, Any], source: str) -> Specification:
        """A specification from its row. Raises TaskError, which names the ``source``, and
        ValueError as :meth:`check`."""
        specification = cls(
            task=parse_task(json.loads(row["definition"]), source),
            method=row["method"],
            code=row["code"],
            information=tuple(filter(None, row["information"].split(", "))),
            parameters=parameters_from(row["method"], row["parameters"]),
            trial_budget=row["trial_budget"],
        )
        specification.check(row["asked"])
        return specification

    def check(self, asked: str) -> None:
        """Raises ValueError where it was stored with another hash."""
        if asked != self.asked:
            raise ValueError(
                f"{self.method} on {self.task.name} was another specification when it was run: the "
                "version of coartic that ran it reads it"
            )

    def run_id(self, suite_seed: int, number: int) -> str:
        """The id of a run: a hash of specification, seed and number, then that of the code."""
        text = f"{self.asked} {suite_seed} {number}"
        return f"{hashlib.sha256(text.encode()).hexdigest()[:16]}-{self.code}"


@dataclass(frozen=True)
class Plan:
    """All runs that a suite asks for."""

    suite: str
    seed: int
    runs: int
    """Runs of a cell, where the suite does not say otherwise and the seed matters."""
    trials: int
    """Most trials of a run."""
    time_limit_s: Annotated[float, Field(allow_inf_nan=False)] | None
    """CPU time of one run."""
    trial_budget: int | None
    """Trials of one run, without the search for initial hands."""
    cells: tuple[Cell, ...]

    @cached_property
    def tasks(self) -> dict[str, Task]:
        """Tasks by name."""
        return {cell.task.name: cell.task for cell in self.cells}

    @cached_property
    def methods(self) -> dict[str, MethodInfo]:
        """Methods by id."""
        return {cell.method.name: cell.method for cell in self.cells}

    @property
    def size(self) -> int:
        """Number of runs."""
        return sum(cell.runs for cell in self.cells)

    @cached_property
    def specifications(self) -> tuple[Specification, ...]:
        """The specification of each cell."""
        return tuple(
            Specification(
                task=cell.task,
                method=cell.method.name,
                code=cell.method.code,
                information=cell.method.information,
                parameters=cell.complete,
                trial_budget=self.trial_budget,
            )
            for cell in self.cells
        )

    def to_rows(self) -> dict[str, list[dict[str, Any]]]:
        """Its rows by table; that of a cell has the row of its specification, not its number."""
        tasks = self.tasks.items()
        names = [each.name for each in fields(MethodInfo) if each.name != "where"]
        return {
            "suite": [{"name": self.suite, **{name: getattr(self, name) for name in _OF_SUITE}}],
            "tasks": [{"name": name, "definition": t.model_dump(mode="json")} for name, t in tasks],
            "methods": [{name: getattr(m, name) for name in names} for m in self.methods.values()],
            "cells": [
                {
                    "position": position,
                    "setting": self.specifications[position].to_row(),
                    "variant": cell.setting,
                    "parameters": cell.parameters,
                    "runs": cell.runs,
                }
                for position, cell in enumerate(self.cells)
            ],
        }

    @classmethod
    def from_rows(cls, rows: Mapping[str, Sequence[Mapping[str, Any]]], source: str) -> Plan:
        """A plan from its rows by table; those of cells with the columns of their specifications,
        whose parameters are ``complete``. Raises ValueError for what no plan has, and
        TaskError, which names the ``source``."""
        tasks = {
            row["name"]: parse_task(json.loads(row["definition"]), source) for row in rows["tasks"]
        }
        methods = {
            row["name"]: {
                **row,
                **{
                    name: json.loads(row[name]) for name in ("information", "secondary", "defaults")
                },
            }
            for row in rows["methods"]
        }
        (suite,) = rows["suite"]
        asked = {"suite": suite["name"], **{name: suite[name] for name in _OF_SUITE}}
        asked["cells"] = [
            {"task": tasks[row["task"]], "method": methods[row["method"]], "runs": row["runs"]}
            | {n: parameters_from(row["method"], row[n]) for n in ("parameters", "complete")}
            for row in rows["cells"]
        ]
        plan: Plan = TypeAdapter(cls).validate_python(asked)
        for row, cell, specification in zip(
            rows["cells"], plan.cells, plan.specifications, strict=True
        ):
            if row["variant"] != cell.setting:
                raise ValueError(f"setting {row['variant']!r} is not that of its parameters")
            specification.check(row["asked"])
        if len({row["setting"] for row in rows["cells"]}) < len(plan.cells):
            raise ValueError("two cells have one specification")
        return plan

    def run_id(self, position: int, number: int) -> str:
        """The id of a run of the cell at this position."""
        return self.specifications[position].run_id(self.seed, number)


_OF_SUITE = ("seed", "runs", "trials", "time_limit_s", "trial_budget")


def run_seed(suite_seed: int, task: str, number: int) -> int:
    """The seed of a run, from the suite's seed, the task's name and the run's number alone.

    Every method gets the same seed for the same task and run, so runs are paired.
    """
    words = np.frombuffer(hashlib.sha256(task.encode()).digest()[:16], dtype="<u4")
    sequence = np.random.SeedSequence(suite_seed, spawn_key=(*map(int, words), number))
    return int(sequence.generate_state(1, np.uint64)[0] >> np.uint64(1))


def hash_of(content: Any) -> str:
    """SHA-256 of plain data."""
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def trials_in(parameters: Mapping[str, Any]) -> int:
    """Trials that a run with these parameters makes; 0 where they do not say."""
    trials = parameters.get("trials")
    return trials if type(trials) is int and trials > 0 else 0


def label_of(method: str, setting: str) -> str:
    """A method with its setting, as everything names it that has no room for both."""
    return f"{method} {setting}".strip()
