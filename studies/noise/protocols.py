"""Make the runs and executions of study noise.

    python studies/noise/protocols.py results/noise

The script has four parts, one for each question:

1. ``order``: the shipped solutions of the suites ``comparison`` and ``families`` are executed with
   motor noise.
2. ``why``: shipped solutions with straight movements are executed with three kinds of targets:
   their own, the postures in which they hit, and these postures moved to the goal's centre.
3. ``memory``: the learner is run, then random search in stages with the learner's hands. The best
   trials of random search are executed.
4. ``learning``: methods practise without noise and with noise. Their best trials and next actions
   are executed.

Each solution is executed 100 times. Each task has a file of rows. Existing files and stored runs
are not made again, so an interrupted command can be repeated. All takes about an hour of CPU time.
"""

import lzma
import sys
from pathlib import Path

import numpy as np
import pandas as pd

from coartic import Movement, correct, execute, execute_noisy
from coartic.analysis import load
from coartic.benchmarks.runner import run_suite

HERE = Path(__file__).parent
LEVELS = (0.0, 0.002, 0.005, 0.01, 0.02)
"""Standard deviations of the motor noise, in rad and length units."""
AFTER = 0.01
"""Motor noise of questions 2 and 4."""
REPEATS = 100
FAMILIES = ("one-armed", "two-armed", "aligned", "redundancy", "long")
SHIPPED = HERE.parents[1] / "benchmarks" / "shipped"
NO_METHOD = "optimum/search"
STRAIGHT = (
    *("dual-process/EC1", "dual-process/EC4", "dual-process/EC1-informed"),
    *("dual-process/EC4-informed", "hill-climbing", "random-search", "cma-es/bandit"),
    "posture-based/two-goals",
)
"""Methods of question 2. They aim at configurations and move straight."""
STAGES = (1, 2, 4, 10, 30, 100, 1_000)
COLUMNS = ["task", "method", "setting", "run", "reward", "best_known"]
"""Columns of runs that the rows of executions also have."""


def shipped(suite, folder):
    """Return the study of a suite's shipped results."""
    if suite == "comparison":
        return load("shipped").worlds[""]
    database = folder / suite / "runs.sqlite"
    if not database.exists():
        database.parent.mkdir(parents=True, exist_ok=True)
        database.write_bytes(lzma.decompress((SHIPPED / f"{suite}.sqlite.xz").read_bytes()))
    return load(database.parent)


def seed_of(run_id):
    """Return the seed with which the solution of a run is executed: the hash in the run's id."""
    return int(run_id.partition("-")[0], 16)


def executions(task, solutions, levels, repeats=REPEATS, kinds=(False, True), **more):
    """Execute solutions, and return a row for each solution, level and kind of noise.

    ``solutions`` are by run id. A row has the mean and the standard deviation of the ticks over
    executions that did not fail, and the number of failures. ``more`` are further columns.
    """
    seeds, rows = [*map(seed_of, solutions)], []
    for level in levels:
        for dependent in kinds if level else (False,):
            ticks = execute_noisy(
                task, solutions.values(), level, repeats, seeds, signal_dependent=dependent
            )
            for run_id, of_run in zip(solutions, ticks, strict=True):
                made = of_run[~np.isnan(of_run)]
                rows.append(
                    {
                        "run_id": run_id,
                        "motor_noise": level,
                        "signal_dependent": dependent,
                        **more,
                        "ticks": made.mean() if made.size else np.nan,
                        "sd": made.std() if made.size else np.nan,
                        "failures": repeats - made.size,
                    }
                )
    return pd.DataFrame(rows)


def to_postures(task, solution, *, at_centre):
    """Return movements straight to the postures in which a solution hits the goals.

    With ``at_centre``, the corrective process first moves these postures until the hand is at the
    centre of the goal, within its tolerance of 0.01. A posture from which it does not converge is
    not changed.
    """
    made = execute(task, solution)
    movements = []
    for goal, (q, hand, place) in enumerate(
        zip(made.configurations, made.hands, task.goals, strict=True), start=1
    ):
        side = {"L": "left", "R": "right"}[hand]
        if at_centre:
            found = correct(task.robot, q, side, place, locked_base=task.locked_base)
            q = found.q if found.converged else q
        movements.append(Movement(goal, side, "learned", q))
    return tuple(movements)


def off_centre(task, solution):
    """Return the median distance of a solution's aims from the centres of the goals, in radii."""
    aims = [
        np.hypot(*task.robot.forward_kinematics(each.target, each.hand) - task.goals[each.goal - 1])
        for each in solution
        if each.kind != "corrective" and each.target is not None
    ]
    return float(np.median(aims)) / task.radius if aims else np.nan


def by_task(study, folder, methods, rows_of):
    """Write a file of rows for each task that has no file yet.

    ``rows_of(task, solutions)`` makes the rows. ``solutions`` has the solutions of the methods for
    which ``methods`` is True, by run id.
    """
    runs, movements = study.runs[study.runs.method.map(methods)], study.movements()
    folder.mkdir(parents=True, exist_ok=True)
    for name, task in study.tasks.items():
        file = folder / f"{name.replace('/', '.')}.csv"
        if file.exists() or (task.family and task.family.partition("/")[0] not in FAMILIES):
            continue
        of_task = runs[(runs.task == name) & (runs.status == "ok")].set_index("run_id")
        solutions = {run_id: movements[run_id] for run_id in of_task.index}
        if not solutions:
            continue
        rows = rows_of(task, solutions).join(of_task[COLUMNS], on="run_id")
        unfinished = file.with_suffix(".part")
        rows.to_csv(unfinished, index=False)
        unfinished.replace(file)
        print(folder.name, name, len(solutions), flush=True)


def execute_order(study, folder, levels=LEVELS, repeats=REPEATS):
    """Execute all solutions of a study at all levels of noise (question 1)."""
    by_task(
        study,
        folder,
        lambda method: method != NO_METHOD,
        lambda task, solutions: executions(task, solutions, levels, repeats),
    )


def execute_why(study, folder, repeats=REPEATS):
    """Execute straight solutions with three kinds of targets (question 2).

    - ``T``: the targets of the solution;
    - ``P``: the postures in which the solution hits the goals;
    - ``C``: these postures, moved to the centres of the goals.
    """

    def rows_of(task, solutions):
        targets = {
            "T": solutions,
            "P": {k: to_postures(task, each, at_centre=False) for k, each in solutions.items()},
            "C": {k: to_postures(task, each, at_centre=True) for k, each in solutions.items()},
        }
        rows = [
            executions(task, of_kind, (0.0, AFTER), repeats, (False,), target=kind)
            for kind, of_kind in targets.items()
        ]
        off = {run_id: off_centre(task, each) for run_id, each in solutions.items()}
        return pd.concat(rows).assign(off=lambda of: of.run_id.map(off))

    by_task(study, folder, lambda method: method in STRAIGHT, rows_of)


def run_blocks(name, description, folder, text, method_files=()):
    """Make the missing runs of a suite with the blocks in ``text``, and return its study."""
    head = f'name = "{name}"\ntitle = "{description}"\ndescription = "{description}"\n'
    file = folder.with_suffix(".toml")
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(f"{head}runs = 3\ntrials = 10_000\ntime_limit_s = 3600\n{text}", "utf-8")
    print(run_suite(file, folder, method_files=method_files), flush=True)
    return load(folder)


def block(tasks, method, **how):
    """Return a block of a suite."""
    names = ", ".join(f'"{task}"' for task in tasks)
    lines = [f"{key} = {value}" for key, value in how.items()]
    return "\n".join(["\n[[blocks]]", f"tasks = [{names}]", f'methods = ["{method}"]', *lines, ""])


def run_memory(folder, instances="i160..i179"):
    """Run the learner and random search in stages, and execute the best trials (question 3).

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
        lambda method: method == "random-search",
        lambda task, solutions: executions(
            task, solutions, (0.0, 0.005, 0.01, 0.02), kinds=[False]
        ),
    )


def run_learning(folder, instances="i160..i169"):
    """Run methods that practise without noise and with noise, and execute them (question 4).

    Their best trials and their next actions are executed.
    """
    noisy = float(np.hypot(0.05, AFTER))
    one_arm = [["ascending", "descending"], [f"one-armed/v1/{instances}"]]
    two_arms = [["two-armed-1", "two-armed-2"]]
    two_arms.append([f"{family}/v1/{instances}" for family in FAMILIES if family != "one-armed"])
    text = ""
    for rule, groups in (("EC1", one_arm), ("EC4", two_arms)):
        for runs, tasks in zip((20, 3), groups, strict=True):
            text += block(tasks, f"dual-process/{rule}", runs=runs,
                          grid=f"{{ noise_sd = [0.05, {noisy!r}] }}")  # fmt: skip
            text += block(
                tasks, "hill-climbing", runs=runs, grid=f"{{ sigma = [0.05, {noisy!r}] }}"
            )
            stages = f"sigma = [0.05, {noisy!r}], stages = [1, 100, 1_000]"
            text += block(tasks, "random-search", runs=runs, grid=f"{{ {stages} }}")
            text += block(tasks, "cma-es/in-noise", runs=runs,
                          grid=f"{{ motor_noise = [0.0, {AFTER}] }}")  # fmt: skip
    files = [HERE / "in_noise.py"]
    study = run_blocks("noise-learning", "Learning in motor noise", folder, text, files)
    execute_learned(study, folder.parent / "learning-executed")
    told = study.runs[(study.runs.method == "cma-es/in-noise") & (study.runs.setting == "")]
    text = ""
    for task, of_task in told.groupby("task", sort=False):
        hands = of_task.hands.value_counts().index[0]
        text += block([task], "cma-es/noise-handler", runs=len(of_task),
                      parameters=f'{{ hands = "{hands}" }}')  # fmt: skip
    folder = folder.with_name("handler")
    study = run_blocks("noise-handler", "Learning with a noise handler", folder, text, files)
    execute_learned(study, folder.parent / "handler-executed")


def execute_learned(study, folder):
    """Execute the best trials and the next actions of a study's runs (question 4)."""
    replays = study.movements("replay")

    def rows_of(task, solutions):
        following = {
            run_id: replays.get(run_id) or to_postures(task, solution, at_centre=False)
            for run_id, solution in solutions.items()
        }
        parts = {"best trial": solutions, "next action": following}
        return pd.concat(
            [
                executions(task, of_kind, (0.0, AFTER), kinds=[False], action=kind)
                for kind, of_kind in parts.items()
            ]
        )

    by_task(study, folder, lambda method: True, rows_of)


def main(folder="results/noise"):
    """Make all runs and executions, one question after the other."""
    folder = Path(folder)
    for suite in ("comparison", "families"):
        execute_order(shipped(suite, folder), folder / "order")
    execute_why(shipped("families", folder), folder / "why")
    run_memory(folder / "memory")
    run_learning(folder / "learning")


if __name__ == "__main__":
    main(*sys.argv[1:])
