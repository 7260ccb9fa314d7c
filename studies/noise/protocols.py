"""Make the runs and executions of study noise.

    PYTHONPATH=studies python studies/noise/protocols.py results/noise

The script has three parts:

1. ``practised``: solutions that suite ``families`` ships, found without noise, are executed with
   noise: as they aim, and at the postures in which they hit.
2. ``answers``: the next actions of runs of this suite that practised in noise are executed again.
3. ``memory``: the learner is run, then random search in stages with the learner's hands. The best
   trials of random search are executed.

The noise of a run's executions has the seed with which suites judge the run. Each task has a file
of rows. Existing files and stored runs are not made again, so an interrupted command can be
repeated. All takes about 20 minutes of CPU time.
"""

import json
import lzma
import sqlite3
import sys
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
from order import LABELS, NOISE, WORLD

from coartic import Movement, execute, execute_noisy
from coartic.analysis import load
from coartic.benchmarks.runner import run_suite
from coartic.motion.initial_hands import best_hands
from coartic.runs.plan import judge_seed
from coartic.runs.record import movement_from

HERE = Path(__file__).parent
REPEATS = 100
"""Executions of a solution."""
HEAVY_TAIL = "cma-es/bandit"
FAMILIES = ("one-armed", "two-armed", "aligned", "redundancy", "long")
SHIPPED = HERE.parents[1] / "benchmarks" / "shipped"
STAGES = (1, 2, 4, 10, 30, 100, 1_000)
COLUMNS = ["task", "method", "setting", "run", "reward", "best_known"]
"""Columns of runs that the rows of executions also have."""


def shipped_families(folder):
    """Return the study of the shipped results of suite ``families``, with all its worlds."""
    database = folder / "families" / "runs.sqlite"
    if not database.exists():
        database.parent.mkdir(parents=True, exist_ok=True)
        database.write_bytes(lzma.decompress((SHIPPED / "families.sqlite.xz").read_bytes()))
    return load(database.parent)


def solutions_of(folder, run_ids):
    """Return the movements of runs of a results folder by run id."""
    query = "SELECT json_extract(movements, '$.solution') FROM results WHERE run_id = ?"
    with closing(sqlite3.connect(folder / "runs.sqlite")) as database:
        texts = {run_id: database.execute(query, (run_id,)).fetchone()[0] for run_id in run_ids}
    return {key: tuple(map(movement_from, json.loads(text))) for key, text in texts.items()}


def executions(task, solutions, numbers, noise, repeats, **more):
    """Execute solutions, and return a row for each.

    ``solutions`` and the ``numbers`` of their runs are by run id. A row has the mean ticks over
    executions, the standard error of this mean and the number of failed executions, each of which
    counts as twice the ticks of the corrective process with its best hands. ``more`` are further
    columns.
    """
    seeds = [judge_seed(0, task.name, int(numbers[run_id])) for run_id in solutions]
    ticks = execute_noisy(task, solutions.values(), noise, repeats, seeds)
    failures = np.isnan(ticks)
    if failures.any():
        ticks = np.where(failures, 2.0 * best_hands(task)[1], ticks)
    rows = {
        "run_id": [*solutions],
        "motor_noise": noise,
        **more,
        "ticks": ticks.mean(axis=1),
        "error": ticks.std(axis=1) / np.sqrt(repeats),
        "failures": failures.sum(axis=1),
    }
    return pd.DataFrame(rows)


def to_postures(task, solution):
    """Return movements straight to the postures in which a solution hits the goals."""
    made = execute(task, solution)
    sides = [{"L": "left", "R": "right"}[hand] for hand in made.hands]
    return tuple(
        Movement(goal, side, "learned", q)
        for goal, (side, q) in enumerate(zip(sides, made.configurations, strict=True), start=1)
    )


def off_centre(task, solution):
    """Return the median distance of a solution's aims from the centres of the goals, in radii."""
    aims = [
        np.hypot(*task.robot.forward_kinematics(each.target, each.hand) - task.goals[each.goal - 1])
        for each in solution
        if each.kind != "corrective" and each.target is not None
    ]
    return float(np.median(aims)) / task.radius if aims else np.nan


def random_tasks(study):
    """Return the study's folder and runs, and its tasks of :data:`FAMILIES`."""
    tasks = {key: task for key, task in study.tasks.items() if key.partition("/")[0] in FAMILIES}
    return SimpleNamespace(folder=study.folder, runs=study.runs, tasks=tasks)


def by_task(study, folder, labels, rows_of):
    """Write a file of rows for each task that has no file yet.

    ``rows_of(task, solutions, numbers)`` makes the rows. ``solutions`` and ``numbers`` have the
    solutions and the numbers of the solved runs whose label is in ``labels``, by run id.
    """
    runs = study.runs[study.runs.label.isin(labels) & (study.runs.status == "ok")]
    folder.mkdir(parents=True, exist_ok=True)
    for name, task in study.tasks.items():
        file = folder / f"{name.replace('/', '.')}.csv"
        if file.exists():
            continue
        of_task = runs[runs.task == name].set_index("run_id")
        if of_task.empty:
            continue
        solutions = solutions_of(study.folder, of_task.index)
        columns = [column for column in [*COLUMNS, "mean_ticks"] if column in of_task]
        rows = rows_of(task, solutions, of_task.run).join(of_task[columns], on="run_id")
        unfinished = file.with_suffix(".part")
        rows.to_csv(unfinished, index=False)
        unfinished.replace(file)
        print(folder.name, name, len(solutions), flush=True)


def execute_practised(study, folder, repeats=REPEATS):
    """Execute solutions that were found without noise with two kinds of targets.

    - ``T``: the targets of the solution;
    - ``P``: the postures in which it hits the goals in one execution without noise.

    Rows without noise have the ticks of both, and how far ``T`` is off the centre of the goals.
    """

    def rows_of(task, solutions, numbers):
        hits = {run_id: to_postures(task, each) for run_id, each in solutions.items()}
        off = {run_id: off_centre(task, each) for run_id, each in solutions.items()}
        return pd.concat([
            executions(task, of_kind, numbers, noise, repeats if noise else 1, target=kind)
            for kind, of_kind in (("T", solutions), ("P", hits)) for noise in (0.0, NOISE)
        ]).assign(off=lambda rows: rows.run_id.map(off))  # fmt: skip

    by_task(random_tasks(study), folder, LABELS, rows_of)


def execute_answers(study, folder, repeats=REPEATS, more=4 * REPEATS):
    """Execute the next actions of runs that practised in noise, as the suite does.

    Those of CMA-ES, whose ticks have a heavy tail, are executed ``more`` times.
    """
    tasks = random_tasks(study)
    for part, labels, number in (
        ("answers", {*LABELS} - {HEAVY_TAIL}, repeats), ("answers-of-cma-es", {HEAVY_TAIL}, more),
    ):  # fmt: skip

        def rows_of(task, solutions, numbers, number=number):
            return executions(task, solutions, numbers, NOISE, number)

        by_task(tasks, folder / part, labels, rows_of)


def run_blocks(name, description, folder, text):
    """Make the missing runs of a suite with the blocks in ``text``, and return its study."""
    head = f'name = "{name}"\ntitle = "{description}"\ndescription = "{description}"\n'
    file = folder.with_suffix(".toml")
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(f"{head}runs = 3\ntrials = 10_000\ntime_limit_s = 3600\n{text}", "utf-8")
    print(run_suite(file, folder), flush=True)
    return load(folder)


def block(tasks, method, **how):
    """Return a block of a suite."""
    names = ", ".join(f'"{task}"' for task in tasks)
    lines = [f"{key} = {value}" for key, value in how.items()]
    return "\n".join(["\n[[blocks]]", f"tasks = [{names}]", f'methods = ["{method}"]', *lines, ""])


def run_memory(folder, instances="i160..i179", repeats=REPEATS):
    """Run the learner and random search in stages, and execute the best trials.

    Random search has the hands of the learner.
    """
    tasks = {
        "EC1": ["ascending", "descending", f"one-armed/v1/{instances}"],
        "EC4": [f"two-armed/v1/{instances}"],
    }
    text = "".join(block(names, f"dual-process/{rule}") for rule, names in tasks.items())
    study = run_blocks("noise-memory", "Stages of random search", folder, text)
    learner = study.runs[study.runs.method.str.startswith("dual-process/")]
    for task, of_task in learner.groupby("task", sort=False):
        hands = sorted({*of_task.hands.dropna()})
        names = "[" + ", ".join(f'"{each}"' for each in hands) + "]"
        for grid in (f"hands = {names}", f"hands = {names}, stages = {[*STAGES[1:]]}, "
                     'keep = ["postures", "targets"]'):  # fmt: skip
            text += block([task], "random-search", grid=f"{{ {grid} }}")
    study = run_blocks("noise-memory", "Stages of random search", folder, text)
    by_task(
        study,
        folder.parent / "memory-executed",
        [label for label in study.methods.index if label.startswith("random-search")],
        lambda task, solutions, numbers: pd.concat([
            executions(task, solutions, numbers, noise, repeats if noise else 1)
            for noise in (0.0, 0.005, 0.01, 0.02)
        ]),
    )  # fmt: skip


def main(folder="results/noise", *parts):
    """Make the named parts, or all of them, one after the other."""
    folder = Path(folder)
    parts = parts or ("practised", "answers", "memory")
    if {"practised", "answers"} & {*parts}:
        worlds = shipped_families(folder).worlds
    if "practised" in parts:
        execute_practised(worlds[""], folder / "practised")
    if "answers" in parts:
        execute_answers(worlds[WORLD], folder)
    if "memory" in parts:
        run_memory(folder / "memory")


if __name__ == "__main__":
    main(*sys.argv[1:])
