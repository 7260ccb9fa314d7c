"""Tables of tasks, of methods and of failed runs."""

from __future__ import annotations

import math

import numpy as np

from coartic.analysis.running_times import (
    solve_times,
)
from coartic.analysis.study import Study, shared_cells, solved, typical_run
from coartic.analysis.tables.language import SHORT_ID, Row, Rows, named, run_ids, table
from coartic.analysis.words import (
    commonest,
    marked,
    tally,
)
from coartic.estimates import (
    standard_deviation,
)
from coartic.motion.execution import initial_reward


@table(
    "Tasks with their initial and best possible rewards (ticks)",
    """
    task       | task            |   | tex
    arms       | arms            |   | tex
    base       | base            |   | tex
    initial    | initial         |   | tex
    best_hands | best hands
    optimum    | best known      |   | tex
    source     | best known from
    bound      | proven bound    |   | tex
    """,
)
def list_tasks(study: Study) -> Rows:
    """Yield the best known reward of each task, and the rewards of the corrective process alone.

    There is a row for each individual task. Columns ``initial`` and ``best_hands`` are the rewards
    of the corrective process alone with the initial hands of the task and with the best hands. A
    reward is missing if the corrective process does not complete the task with these hands.
    ``best_hands`` is also missing if the task has more than 4,096 hand sequences. In a world with
    noise, ``initial`` is missing, and ``best_hands`` is :attr:`.Study.corrective_best`. Columns
    ``optimum``, ``source`` and ``bound`` are the best known reward, its source and its proven bound
    (:class:`.BestKnown`). All rewards are negative ticks.
    """
    for name, task in study.individual_tasks.items():
        best, locked = study.optima.get(name), " and ".join(task.locked_base)
        alone = study.sequences(name).reward.dropna()
        with_best = float(alone.max()) if len(alone) else math.nan
        initial = None if study.is_noisy else initial_reward(task, study.models[name])
        row: Row = {
            "task": marked(task),
            "arms": len(task.hands),
            "base": f"locked in {locked}" if locked else "free",
            "initial": initial,
            "best_hands": study.corrective_best[name] if study.is_noisy else with_best,
            "optimum": best.reward if best else None,
            "source": best.source if best else None,
            "bound": best.bound if best else None,
            "run_ids": best.run_id if best else "",
        }
        yield name, row


@table(
    "Reward, gap to the {reference}, hands and runs, and costs of a run (medians)",
    """
    task               | task                           |   | tex
    method             | method                         |   | tex
    runs               | runs                           |   | tex
    solved
    reward±            | reward                         | 1 | tex
    reward_median
    gap                | gap (%)                        | 1 | tex
    hands              | hands                          |   | tex
    trials             | trials                         |   | tex
    forward_kinematics | forward-kinematics evaluations
    solve_s            | solving time (s)
    median_run         | median run
    """,
    with_settings=True,
)
def list_methods(study: Study) -> Rows:
    """Yield the rewards, hands and median costs of each method on each individual task.

    Rewards are negative ticks; in a world with noise they are minus the mean ticks of a run. Within
    a task, searches for the optimum come first, and the other methods follow. Both groups are in
    descending order of the mean reward. Column ``gap`` is the mean gap of the solved runs, a
    fraction. Column ``hands`` lists the hand sequences of the solved runs with their frequencies
    (:func:`.tally`), or contains the hand sequence of the only solved run. Column ``median_run``
    contains the first eight characters of the id of the solved run whose score is nearest to the
    median; the entry is missing if no run is solved.
    """
    places, rows = {task: place for place, task in enumerate(study.individual_tasks)}, []
    for (task, label), runs in shared_cells(study).items():
        if task not in places:
            continue
        good = solved(runs)
        hands = good.hands.dropna()  # missing after some trials of longer runs
        rewards = good.value.to_numpy(np.float64)
        row = named(study, runs) | {
            "solved": len(good),
            "reward": rewards.mean() if len(good) else math.nan,
            "reward_sd": standard_deviation(rewards),
            "reward_median": np.median(rewards) if len(good) else math.nan,
            "gap": good.gap.mean(),
            "hands": tally(hands) if len(hands) > 1 else "".join(hands),
            "trials": runs.trials.astype(float).median(),
            "forward_kinematics": runs.forward_kinematics.astype(float).median(),
            "solve_s": solve_times(good).astype(float).median(),
            "median_run": typical_run(good)[:SHORT_ID] if len(good) else None,
        }
        below = -row["reward"] if len(good) else math.inf
        rows.append(((places[task], not study.methods.is_search[label], below), label, row))
    for (place, *_), label, row in sorted(rows, key=lambda item: item[0]):
        yield f"{[*places][place]} {label}", row


@table(
    "Runs without a solution",
    """
    task    | task
    method  | method
    failed  | failed runs
    runs    | runs
    reasons | reasons
    """,
)
def list_failed(study: Study) -> Rows:
    """Yield the number of failed runs of each method on each task, with reasons.

    There is a row for each pair of a task and a method with at least one failed run. Column
    ``reasons`` contains the three most frequent reasons with their numbers of runs.
    """
    for (task, label), runs in shared_cells(study).items():
        if len(solved(runs)) < len(runs):
            failed = runs[runs.status != "ok"]
            reasons = "; ".join(commonest(failed.reason.fillna("")))
            row = named(study, runs) | {"failed": len(failed), "reasons": reasons}
            yield f"{task} {label}", row | run_ids(failed)
