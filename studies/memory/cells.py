"""Compute mean gains and signatures for each task, method, number of trials and dose of memory."""

import numpy as np
import pandas as pd

MEASURES = {
    "gain": "gain (ticks)",
    "first": "first movement slower (ticks)",
    "arm": "next goal nearer (ticks)",
    "other arm": "idle hand nearer (share)",
}
"""Gain and signatures, with the labels of their axes. The gain counts from the corrective process
alone with its best hands."""
KEEPS = ("postures", "targets")
NAMES = {
    "dual-process/EC1": "learner",
    "dual-process/EC4": "learner",
    "dual-process/EC1-informed": "informed learner",
    "dual-process/EC4-informed": "informed learner",
    "random-search": "random search",
    "hill-climbing": "hill climbing",
    "cma-es/bandit": "CMA-ES",
    "posture-based/two-goals": "posture planning",
    "posture-qp/goals-ahead": "posture QP",
}
CONTEXTS = ("ascending", "descending")
"""Tasks with the same first goal."""
POSTURE = ["at_x", "at_y", *(f"at_{joint}" for joint in range(1, 5))]
"""Columns of the posture at goal 1: base (in length units) and joints of the right arm (in rad)."""
TRIALS = 10_000
MIN_SHARE = 0.1


def measure_runs(study):
    """Return the solved runs with gain and signatures; ``group``: family, or task of the paper."""
    runs = study.runs[study.runs.status == "ok"]
    return runs.assign(
        group=runs.family.str.partition("/")[0].fillna(runs.task),
        name=runs.method.map(NAMES),
        gain=runs.reward.astype(float) - runs.corrective_best,
        **{name: study.signature(name) for name in MEASURES if name != "gain"},
    )


def measure_cells(runs):
    """Return means over runs, with a row for each task, method and number of trials.

    Random search has a row for each number of stages and each content of memory (``postures`` or
    ``targets``). Its mean is a mean over the hand sequences of the learner, weighted by the numbers
    of the learner's runs. Row ``compared`` is the learner with 10,000 trials, only with its runs
    that have these hands.
    """
    rows, measures = [], [*MEASURES]
    for (group, task), of_task in runs.groupby(["group", "task"], sort=False):
        learner = of_task[(of_task.name == "learner") & (of_task.trials == TRIALS)]
        shares = learner.hands.value_counts(normalize=True)
        shares = shares[shares >= MIN_SHARE]
        key = {"group": group, "task": task}
        compared = learner[learner.hands.isin(shares.index)][measures].mean()
        rows.append(key | {"name": "compared", "trials": TRIALS} | compared.to_dict())
        search = of_task[of_task.name == "random search"]
        for (stages, keep), of_dose in search.groupby(["stages", "keep"], sort=False):
            by_hands = of_dose.groupby("hands")[measures].mean()
            if {*shares.index} <= {*by_hands.index}:
                of_hands = by_hands.loc[shares.index]
                weights = of_hands.notna().mul(shares, axis=0)  # of hands with the signature
                means = (of_hands * weights).sum() / weights.sum()
                for kept in KEEPS if stages == 1 else (keep,):
                    names = {"name": kept, "trials": TRIALS, "stages": int(stages)}
                    rows.append(key | names | means.to_dict())
        others = of_task[of_task.name != "random search"]
        for (name, trials), of_cell in others.groupby(["name", "trials"], sort=False, dropna=False):
            names = {"name": name, "trials": trials}
            rows.append(key | names | of_cell[measures].mean().to_dict())
    return pd.DataFrame(rows).fillna({"stages": 0, "trials": 0}).astype({"stages": int})


def groups_of(cells, measure):
    """Return lists of the families that have a measure: all of them, and each by itself."""
    there = cells[cells.task.str.contains("/") & cells[measure].notna()]
    there = there[there[measure].groupby(there.group).transform("any")]  # 0 with one arm
    families = [*dict.fromkeys(there.group)]
    return {"all": families} | {family: [family] for family in families}


def measure_postures(study, runs):
    """Return the runs on :data:`CONTEXTS` with the posture in which each hits goal 1."""
    rows = []
    of_contexts = runs[runs.task.isin(CONTEXTS)]
    for (task, label), of_label in of_contexts.groupby(["task", "label"], sort=False):
        executed = study.executed(task, label)
        arm = executed.task.robot.joints("right")
        hits = executed.configurations[:, 0]
        hits = pd.DataFrame(np.hstack([hits[:, :2], hits[:, arm]]), executed.run_ids, POSTURE)
        rows.append(of_label.join(hits, on="run_id"))
    return pd.concat(rows)


def postures(rows):
    """Return the postures of rows on the two :data:`CONTEXTS`, shape ``(runs, 6)`` each."""
    return [rows.loc[rows.task == task, POSTURE].to_numpy(float) for task in CONTEXTS]


def distance(groups):
    """Return the distance between the mean postures of two groups."""
    return float(np.linalg.norm(groups[0].mean(axis=0) - groups[1].mean(axis=0)))


def rows_of_contexts(study, runs):
    """Return the runs from which table ``contexts`` is made, with a row for each run.

    They are runs of the learner, and of random search with each dose of memory.
    """
    is_learner = (runs.name == "learner") & (runs.trials == TRIALS)
    rows = measure_postures(study, runs[is_learner | (runs.name == "random search")])
    return rows[["label", "task", "run", "gain", *POSTURE]].set_index("label")


def tabulate_contexts(rows):
    """Tabulate the posture difference at the first goal of :data:`CONTEXTS`, by method.

    The table also has the mean gain on both tasks. ``rows`` are those of
    :func:`rows_of_contexts`.
    """
    table = {
        label: {
            "runs": len(of_label) // 2,
            "gain": of_label.groupby("task").gain.mean().mean(),
            "distance": distance(postures(of_label)),
        }
        for label, of_label in rows.groupby("label", sort=False)
    }
    return pd.DataFrame.from_dict(table, orient="index").rename_axis("label")
