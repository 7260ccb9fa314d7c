"""Tables of our own studies: how far ahead a planner looks, stops at goals, wrong objectives, and
models beside people."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np
import pandas as pd

from coartic import Task, Trajectory
from coartic.analysis.claims.studies import (
    ALL_GOALS,
    HORIZONS,
    PLANNER,
    gaps_by_horizon,
    goals_ahead,
    solved_cells,
)
from coartic.analysis.human.judge import FINDINGS, judged
from coartic.analysis.human.measures import MODELS, run_ids
from coartic.analysis.signatures.signs import SIGNS
from coartic.analysis.signatures.subtasks import turning_angles
from coartic.analysis.statistics.estimates import interval, mean
from coartic.analysis.studies import objectives as regrets
from coartic.analysis.studies.objectives import TERMS, WHO, advantage, on_random_tasks
from coartic.analysis.study import CellRuns, Study, cached
from coartic.analysis.tables.table import Row, Rows, runs_of, table
from coartic.analysis.words import in_brackets, number
from coartic.robot import Array
from coartic.tasks.task import MOST_GOALS

BASES = ("free", "on a rail", "fixed")
"""How the base can move, by the number of directions in which it is locked."""
KINDS: dict[str, Callable[[Task], str]] = {
    "family": lambda task: str(task.family).partition("/")[0],
    "goals": lambda task: str(len(task.goals)) if len(task.goals) <= 5 else "6 or more",
    "arms": lambda task: ("one", "two")[len(task.hands) - 1],
    "links": lambda task: str(len(task.robot.right_links)),
    "base": lambda task: BASES[len(task.locked_base)],
}
"""What tasks are told apart by."""
BEYOND = "5+"
"""All goals beyond the fourth goal ahead."""
STEPS: tuple[tuple[str, int | str, int | None, int], ...] = (
    ("0", 0, None, 0),
    *((str(h), h, h - 1, h) for h in (1, 2, 3, 4)),
    (BEYOND, ALL_GOALS, 4, 5),
    (ALL_GOALS, ALL_GOALS, None, 0),
)
"""Rows of the table of horizons: name, horizon, the one before it that its gain is over, and goals
that a task must have ahead."""
ENOUGH = 0.9
"""Share of the tasks that have a horizon on which it must have been run to be shown."""
SMOOTH = "trajectory-optimisation/"
NEAR = 3
"""Ticks before and after a hit between which the path's turn at the goal is measured."""
SHARED = ("ascending", "descending")
"""The paper's tasks that differ after the first goal."""


@cached
def planner_cells(study: Study) -> dict[tuple[str, str, str, int], CellRuns]:
    """Cells of the planner by task, hands, costs and horizon, at most the goals less one."""
    cells = {}
    for cell, parameters in solved_cells(study, PLANNER):
        horizon = min(parameters["horizon"], len(study.tasks[cell.task].goals) - 1)
        cells[cell.task, parameters["hands"], parameters["costs"], horizon] = cell
    return cells


def cells_at(study: Study, gaps: pd.DataFrame, horizon: int | str) -> list[CellRuns]:
    """The planner's cells behind a column of gaps, whose rows are tasks, hands and costs.

    Hands that are given with all goals in view are those that were planned.
    """
    ahead = MOST_GOALS if horizon == ALL_GOALS else int(horizon)
    cells = planner_cells(study)
    keys = ((*place, min(ahead, len(study.tasks[place[0]].goals) - 1)) for place in gaps.index)
    there = (cells.get(key) or cells.get((key[0], "planned", *key[2:])) for key in keys)
    return [cell for cell in there if cell is not None]


def groups(study: Study) -> Iterator[tuple[str, str, pd.DataFrame]]:
    """Kinds of tasks and of planners, each with its gaps by horizon.

    A planner that has its hands given, or dear joints, follows the plain one on the same tasks.
    """
    every = gaps_by_horizon(study)
    parts = dict(list(every.groupby(["hands", "costs"], sort=False)))
    plain = parts.pop(("planned", "none"), every[:0])
    yield "all", "all", plain
    names = plain.index.get_level_values("task")
    for kind, value_of in KINDS.items():
        for value, part in plain.groupby(np.array([value_of(study.tasks[n]) for n in names])):
            yield kind, str(value), part
    given = [("given", part) for (hands, _), part in parts.items() if hands == "optimal"]
    dear = [(f"{costs} dear", part) for (_, costs), part in parts.items() if costs != "none"]
    for kind, plainly, others in (("hands", "planned", given), ("costs", "equal", dear)):
        tasks = {name for _, part in others for name in part.index.get_level_values("task")}
        if others:
            yield kind, plainly, plain[names.isin(tasks)]
        for planner, part in others:
            yield kind, planner, part


@table("group, value, h, tasks, gap[], gain[], seconds")
def horizon(study: Study) -> Rows:
    """Gap of the planner by goals ahead, and what the last of these goals gains, as shares.

    Over the tasks of a group that have so many goals ahead. ``h`` of 5+ are those beyond the fourth
    together; all is over all tasks, whatever they have.
    """
    for group, value, every in groups(study):
        ahead = goals_ahead(study, every)
        for name, h, before, fewest in STEPS:
            rows = every[ahead >= fewest]
            if before is not None and enough(rows[before]):
                rows = rows[rows[before].notna()]
            elif name == BEYOND:
                continue
            if not enough(rows[h]):
                continue
            rows = rows[rows[h].notna()]
            cells = cells_at(study, rows, h)
            row: Row = {"group": group, "value": value, "h": name, "tasks": len(rows)}
            row |= mean_of("gap", rows[h] / 100)
            if before is not None:
                row |= mean_of("gain", (rows[before] - rows[h]) / 100)
            row["seconds"] = float(np.mean([cell.good.cpu_s.mean() for cell in cells]))
            yield f"{group} {value} h={name}", row | runs_of(*cells)


def enough(gaps: pd.Series) -> bool:
    """Whether a horizon was run on enough of the tasks that have it to be shown."""
    return bool(gaps.notna().mean() > ENOUGH)  # without tasks it is NaN


@table("sign, words, h, tasks, mean[], to_come[]")
def horizon_signs(study: Study) -> Rows:
    """Signs of coarticulation of the planner by goals ahead, means over tasks that have more, and
    what they gain by all goals."""
    gaps = gaps_by_horizon(study).query("hands == 'planned' and costs == 'none'")
    ahead = goals_ahead(study, gaps)
    cells = {h: cells_at(study, gaps, h) for h in HORIZONS}
    for name, sign in SIGNS.items():
        of_task = {
            h: {
                cell.task: mean_or_nan(sign.of(study.trajectories(cell.task, cell.label)))
                for cell in at_horizon
            }
            for h, at_horizon in cells.items()
        }
        for h in HORIZONS:
            more = gaps.index[(ahead > h) if h != ALL_GOALS else (ahead > 0)]
            names = more.get_level_values("task")
            values = pd.DataFrame({"here": of_task[h], "all": of_task[ALL_GOALS]})
            values = values[values.index.isin(names)].dropna()
            if len(values):
                row: Row = {"sign": name, "words": sign.words, "h": str(h), "tasks": len(values)}
                row |= mean_of("mean", values.here)
                if h != ALL_GOALS:
                    row |= mean_of("to_come", values["all"] - values.here)
                of_tasks = [cell for cell in cells[h] if cell.task in values.index]
                yield f"{name} h={h}", row | runs_of(*of_tasks)


def mean_or_nan(values: Sequence[float] | Array) -> float:
    """The mean of the values that there are; NaN without any."""
    there = np.asarray(values, dtype=np.float64)
    there = there[~np.isnan(there)]
    return float(there.mean()) if len(there) else math.nan


@cached
def stop_values(study: Study) -> pd.DataFrame:
    """What plans that stop at goals, and what stands beside them, show on each task.

    Columns ``group`` (kind of task), ``method``, ``timing``, ``stop``, ``goals_per_stop``,
    ``task``, ``cell``; ``nearer``, ``first``: signs of coarticulation in ticks; ``turn``: mean
    turn of the path at goals that others follow, rad; ``posture`` at the first goal. Empty where
    nothing stops.
    """
    rows: list[Row] = []
    for method in dict.fromkeys(method for _, method in study.cells):
        if not method.startswith((SMOOTH, PLANNER)):
            continue
        for cell, parameters in solved_cells(study, method.partition(" ")[0]):
            if cell.label == method:
                runs = study.trajectories(cell.task, cell.label)
                rows.append(
                    {
                        "group": group_of(study.tasks[cell.task]),
                        "method": cell.method,
                        "timing": parameters.get("timing", ""),
                        "stop": float(parameters.get("stop", math.nan)),
                        "goals_per_stop": parameters.get("stop_every", 1),
                        "task": cell.task,
                        "cell": cell,
                        "nearer": mean_or_nan(SIGNS["arm"].of(runs)),
                        "first": mean_or_nan(SIGNS["first"].of(runs)),
                        "turn": mean_or_nan(np.concatenate(list(map(turns, runs.runs)))),
                        "posture": runs.runs[0].execution.configurations[0],
                    }
                )
    frame = pd.DataFrame(rows)
    return frame if len(frame) and (frame.stop > 0).any() else frame[:0]


def group_of(task: Task) -> str:
    """Kind of a task: random ones by their arms, the paper's one-armed ones together."""
    if task.family is not None:
        return f"random, {KINDS['arms'](task)} arm{'s' * (len(task.hands) - 1)}"
    return "ascending, descending" if task.name in SHARED else task.name


def turns(run: Trajectory) -> Array:
    """Angles by which the path in joint space turns at goals that others follow, rad, (G - 1,).

    0 passes smoothly, NaN beside a movement of no length. Movements have a constant speed in this
    model, so that of a plan's velocities their direction alone is left.
    """
    last = len(run.configurations) - 1
    around = ((max(hit - NEAR, 0), hit, min(hit + 1 + NEAR, last)) for hit in run.hits[:-1])
    return np.array([turning_angles(run.configurations[list(rows)])[0] for rows in around])


@table(
    "group, method, timing, stop, goals_per_stop, tasks, nearer[], less[], first[], turn[], apart",
)
def stops(study: Study) -> Rows:
    """What of coarticulation is left where a smooth plan stops at goals: means over tasks."""
    keys = ["group", "method", "timing", "stop", "goals_per_stop"]
    frame = stop_values(study)
    for at, rows in frame.groupby(keys, sort=False, dropna=False) if len(frame) else ():
        row: Row = {**dict(zip(keys, at, strict=True)), "tasks": len(rows)}
        for name in ("nearer", "first", "turn"):
            row |= mean_of(name, rows[name])
        by_task = rows.set_index("task")
        if row["stop"] > 0:
            passing = frame[(frame[keys[:3]] == list(at[:3])).all(axis=1) & (frame.stop == 0)]
            row |= mean_of("less", passing.set_index("task").nearer - by_task.nearer)
        if set(SHARED) <= set(by_task.index):
            first, second = (by_task.posture[name] for name in SHARED)
            row["apart"] = float(np.linalg.norm(first - second))
        stop = "" if math.isnan(row["stop"]) else f" stop={row['stop']:g}"
        every = f" every {row['goals_per_stop']}" if row["goals_per_stop"] > 1 else ""
        name = f"{row['group']} {row['method']} {row['timing']}".strip() + stop + every
        yield name, row | runs_of(*rows.cell)


def mean_of(name: str, values: pd.Series) -> Row:
    """The mean over tasks that have a value, with its interval, as columns of a table."""
    there = values.dropna().to_numpy(dtype=np.float64)
    return interval(name, mean(there)) if len(there) else {}


@table("term, weight, who, tasks, regret[], helps[]")
def objectives(study: Study) -> Rows:
    """Regret under the true reward by penalty, its weight and who, means over random tasks.

    In per cent of the best known reward. ``helps``: by how much less the learner from the plan of
    ticks regrets than the learner from the corrective process.
    """
    frame = on_random_tasks(study)
    if not (frame.weight > 0).any():
        return
    for term in TERMS:
        helped = advantage(study, "from plan", "learner", term)
        for (weight, who), rows in sorted(
            frame[frame.term == term].groupby(["weight", "who"]),
            key=lambda part: (part[0][0], list(WHO).index(str(part[0][1]))),
        ):
            row: Row = {"term": term, "weight": weight, "who": who, "tasks": len(rows)}
            row |= mean_of("regret", rows.regret)
            if who == "from plan" and weight in helped.columns:
                row |= mean_of("helps", helped[weight])
            yield f"{term} {weight:g} {who}", row | runs_of(*rows.cell)


@table("term, who, tasks, crossing[]")
def crossings(study: Study) -> Rows:
    """The weight from which trial and error regrets less than the planner that believes in ticks.

    Infinite: beyond the largest weight, if at all.
    """
    frame = on_random_tasks(study)
    for at in regrets.crossings(study).to_dict("records"):
        row: Row = {str(name): value for name, value in at.items()}
        of_both = frame[(frame.term == row["term"]) & frame.who.isin([row["who"], "ticks"])]
        cells = {id(cell): cell for cell in of_both.cell}
        yield f"{row['term']} {row['who']}", row | runs_of(*cells.values())


@table("finding, of *")
def human(study: Study) -> Rows:
    """Whether each model agrees with each finding, by how much; a star: it is built so."""
    for name, rows in judged(study).groupby("finding", sort=False):
        finding = FINDINGS[str(name)]
        verdicts: Row = {"finding": finding.statement}
        for model, of_model in rows.groupby("model", sort=False):
            verdicts[f"of {model}"] = in_words(of_model)
        runs = (run_ids(study, model, finding.where) for model in MODELS)
        yield str(name), verdicts | {"run_ids": " ".join(runs)}


def in_words(tests: pd.DataFrame) -> str:
    """A model's verdict on a finding, with the effect of each test."""
    first = tests.iloc[0]
    verdict = f"{first.verdict}{' *' if first.built_in else ''}"
    there = tests[tests.tasks > 0].drop_duplicates("measure")
    effects = [
        f"{number(value, 2)} {in_brackets(low, high, 2)}".strip()
        for value, low, high in zip(there.value, there.low, there.high, strict=True)
    ]
    return f"{verdict}: {'; '.join(effects)}" if effects else verdict


@table(
    "finding, model, measure, bound, value[], tasks, over_guesses[], of_test, verdict, built_in, "
    "because"
)
def human_effects(study: Study) -> Rows:
    """What each model shows of each finding, with its interval over tasks; why it is silent.

    Of models whose solutions are picked from trials, also by how much it exceeds random guesses.

    The second test of one measure has its bound in the row's name.
    """
    frame = judged(study).rename(columns={"low": "value_low", "high": "value_high"})
    second = frame.duplicated(["finding", "model", "measure"])
    for row, again in zip(frame.itertuples(), second, strict=True):
        finding, model = str(row.finding), str(row.model)
        values: Row = {column: getattr(row, column) for column in frame.columns}
        ids = run_ids(study, model, FINDINGS[finding].where) if row.tasks else ""
        name = f"{finding} {model} {row.measure}{f' {row.bound}' if again else ''}"
        yield name, values | {"run_ids": ids}
