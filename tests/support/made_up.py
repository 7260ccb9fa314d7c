"""Build made-up studies from rows of runs, rewards of trials and solutions."""

import ast
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from pathlib import Path

import pandas as pd

from coartic import load_task
from coartic.analysis.methods import KNOWN_METHODS
from coartic.analysis.optima import BestKnown
from coartic.analysis.study import Study
from coartic.model import model_from
from coartic.runs.method_info import BUILT_IN, MethodInfo
from coartic.runs.plan import Cell, Job
from coartic.runs.record import NOISE_RULE

MADE_WITH = {
    "coartic": "0", "model_code": "code", "commit": {"id": "abc4567", "dirty": True},
    "python": "3", "packages": {}, "platform": "here", "processor": "one", "cores": 2,
    "date": "today", "command": [],
}  # fmt: skip


class MadeUp(Study):
    """A study some of whose parts are made up.

    Parts can be values, as in ``MadeUp(study, optima=...)``, or methods, as in ``MadeUp(study,
    executed=made(...))``.
    """

    def __init__(self, study, **parts):
        runs = vars(study).get("runs", study.stored)  # includes changes by a test
        super().__init__(study.folder, study.plan, study.made_with, runs)
        for name in parts:
            assert isinstance(getattr(Study, name, None), cached_property) or hasattr(study, name)
        vars(self).update(parts)


def change_runs(study, name, value, where=slice(None)):
    """Change a column of the runs that a study stores. ``study.runs`` is a copy."""
    runs = study.runs
    runs.loc[where, name] = value
    vars(study)["runs"] = runs


def made(values):
    """Return a method that looks up values by its arguments; those of replays end in ``True``."""
    return lambda *key, replay=False: values[(*key, replay) if replay else key]


def made_up_optima(*tasks):
    """Return proven optima of some tasks, for ``MadeUp(results, optima=...)``.

    They do not depend on the shipped optima, which change with the goals of two-armed tasks.
    """
    best = {"ascending": -292, "two-armed-1": -465, "two-armed-2": -306}
    return {task: BestKnown(best[task], best[task]) for task in tasks}


def row(method, reward, *, task="two-armed-1", run=0, setting="", **more):
    return {
        "task": task, "method": method, "setting": setting, "run": run, "seed": run,
        "status": "ok" if reward is not None else "infeasible", "reason": "", "reward": reward,
        "run_id": f"{task}-{method}-{setting}-{run}{more.get('world', '')}", "hands": "LRLR",
        "noise_rule": NOISE_RULE,
        "world": "", "mean_ticks": None, "failed_executions": None, "practice": None,
        "information": "corrective process, reward by trial", "parameters": "{}", "trials": 10,
        "reached": None, "movement_ticks": 5000, "forward_kinematics": 1_234_567,
        "solver_iterations": 0, "build_s": 0.5, "solve_s": 0.25, "wall_s": 1.0, "cpu_s": 0.5,
        "warm": run > 0, "together": 1,
        "date": "2026-01-01 00:00:00", "called": "",
        "solution_corrections": 0, "early_corrections": 30, "late_corrections": 20,
        "other_arm_travel": 0.0, **more,
    }  # fmt: skip


def runs_of(task, method, rewards, **more):
    """Return rows of the runs of a cell. A list in ``more`` has a value for each run."""
    return [
        row(method, reward, task=task, run=run,
            **{name: of[run] if isinstance(of, list) else of for name, of in more.items()})
        for run, reward in enumerate(rewards)
    ]  # fmt: skip


def runs_in_noise(task, method, ticks, world="motor_noise=0.01", **more):
    """Return rows of the runs of a cell in a world with noise, whose mean ticks are given.

    Those of a failed run are None.
    """
    of_noise = {
        "mean_ticks": ticks, "trials": 10,
        "failed_executions": [None if each is None else 0 for each in ticks],
        "status": ["infeasible" if each is None else "ok" for each in ticks],
        "practice": "[330, 325, 322, null, 320, 318, 317, 316, 315, 314]",
    }  # fmt: skip
    return runs_of(task, method, [None] * len(ticks), world=world, **{**of_noise, **more})


def declared(method, deterministic=()):
    """Return a declaration of a method. Planners and ``deterministic`` are not stochastic."""
    planners = "trajectory-optimisation", "corrective-alone"
    stochastic = not method.startswith((*planners, *deterministic))
    origin = BUILT_IN if method in KNOWN_METHODS else "file.py"
    return MethodInfo(method, method, "", (), stochastic, {}, origin, "")


def _values_in(words):
    """Return the values in words such as ``sigma=0.1, norm=maximum``, by name."""
    values = {}
    for key, value in (item.split("=") for item in words.split(", ") if item):
        with suppress(ValueError):  # the value is a string
            value = ast.literal_eval(value)
        values[key] = value
    return values


def study_of(rows, tasks=(), *, deterministic=(), **parts):
    """Return a study of rows of runs, with made-up parts.

    Tasks that are not in ``tasks`` are loaded by name.
    """
    runs = pd.DataFrame(rows).reset_index(drop=True)
    runs = runs.astype({"reward": "Int64"})
    by_name, plan = {task.name: task for task in tasks}, []
    keys = ["task", "method", "setting", "world"]
    for (name, method, *texts), _ in runs.groupby(keys, sort=False):
        parameters, constants = map(_values_in, texts)
        task = by_name.get(name) or load_task(name)
        info = declared(method, deterministic)
        cell = Cell(task, info, parameters, model=model_from(constants))
        plan.append(Job(cell, 0, range(3), suite="paper"))
    parts = {"rewards": lambda: iter(()), **parts}
    return MadeUp(Study(Path("made-up"), plan, MADE_WITH, runs), **parts)


def study_of_rewards(rewards, **parts):
    """Return a study of ``{(task, method): rewards}`` with proven optima.

    The reward of a failed run is None.
    """
    rows = [run for cell, of in rewards.items() for run in runs_of(*cell, of)]
    optima = made_up_optima(*{task for task, _ in rewards})
    return study_of(rows, **{"optima": optima, **parts})


def study_of_solutions(cells, rows=None, replays=(), **parts):
    """Return a study whose executed runs are ``cells``, a list of ``Solutions``.

    ``Solutions`` without runs stand for a failed run.
    """
    if rows is None:
        rows = [run for cell in cells for run in runs_of(
            cell.task.name, cell.label, [-300] * len(cell.runs) or [None],
            hands=[getattr(run, "hands", "LRLR") for run in cell.runs] or "")]  # fmt: skip
    ids = dict[tuple[str, str], list[str]]()
    for run in rows:
        if run["status"] == "ok":
            label = f"{run['method']} {run['setting']}".strip()
            ids.setdefault((run["task"], label), []).append(run["run_id"])

    def identified(cell):
        key = cell.task.name, cell.label
        return key, replace(cell, run_ids=tuple(ids.get(key, ())[: len(cell.runs)]))

    executed = dict(map(identified, cells))
    executed |= {(*key, True): replace(cell, runs=(), run_ids=()) for key, cell in executed.items()}
    executed |= {(*key, True): cell for key, cell in map(identified, replays)}
    return study_of(rows, [cell.task for cell in cells], executed=made(executed), **parts)
