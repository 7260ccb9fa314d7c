"""Copy better rewards and sharper bounds from results folders into the shipped data.

    python studies/optima/renew.py results/families results/optima

A folder of ``prove.py`` has proofs; any other folder has runs. Rewards are shipped for the paper's
tasks, under each restriction of the search (``base``, ``other_arm``), and for the first 40 test
instances of each shipped family.
"""

import sys
from pathlib import Path

import shipped

from coartic import CoarticError, builtin_tasks, load_task
from coartic.analysis import load
from coartic.analysis.optima import restrictions
from coartic.tasks.families import shipped_families
from coartic.tasks.optima import task_hash

MAX_INSTANCES = 40
"""Number of instances of each family."""
MADE_BY = "coartic", "commit", "model_code", "python", "date"
"""Facts about a results folder that entries have."""


def ships(task, restriction):
    """Return True if rewards of a task under a restriction (base, other arm) are shipped."""
    if task.family not in shipped_families():
        return task.name in builtin_tasks()
    is_early = task.split == "test" and int(task.name.rpartition("/i")[2]) < MAX_INSTANCES
    return is_early and restriction == shipped.FREE


def take_over(study, known):
    """Copy rewards that the runs of a folder improve into ``known``, and return their number.

    Only the first 500 runs of a method with its parameters on a task count. Raises CoarticError for
    a solution that does not give its reward on the shipped task of this name.
    """
    solutions, changed = study.movements(), 0
    runs = study.stored[study.stored.run_id.isin(solutions)]
    runs = runs[runs.status == "ok"].assign(**restrictions(runs)).astype({"reward": int})
    for key, group in runs.groupby(["task", "base", "other_arm"]):
        name, base, other_arm = map(str, key)
        before, best = known.get((name, base, other_arm), {}), group.loc[group.reward.idxmax()]
        is_better = before.get("reward") is None or best.reward > before["reward"]
        if not is_better or not ships(study.tasks[name], (base, other_arm)):
            continue
        task, made_with = load_task(name), study.made_with
        known[name, base, other_arm] = {
            "task": name,
            "essence": task_hash(task),
            "base": base,
            "other_arm": other_arm,
            "run_ids": [best.run_id],
            "made_by": {fact: made_with[fact] for fact in MADE_BY},
            "reward": int(best.reward),
            "hands": best.hands,
            "bound": before.get("bound"),
            "nodes": before.get("nodes"),
            "searches": group.groupby("method").reward.max().to_dict(),
            "solution": shipped.solution_in_short(task, solutions[best.run_id], int(best.reward)),
        }
        changed += 1
    return changed


def main(folders):
    """Copy improvements of all folders into the shipped data."""
    known = shipped.read()
    try:
        for folder in folders:
            if rows := shipped.read_log(Path(folder)):
                changed = sum(shipped.take_proof(known, row) for row in rows)
                print(f"{folder}: {changed} proofs that say more")
            else:
                print(f"{folder}: {take_over(load(folder), known)} better rewards")
    except CoarticError as error:
        sys.exit(str(error))
    shipped.write(known)


if __name__ == "__main__":
    main(sys.argv[1:])
