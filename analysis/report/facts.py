"""The facts in the report's sentences, as dictionaries: rows of tables, chosen and named.

Each function has the name of a section of the page and gives None where the runs say nothing about
it. ``sentences.jinja`` has a macro of that name, which puts the facts into words.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from shlex import quote
from typing import Any

from coartic.analysis.methods import (
    KNOWN_METHODS,
    LEARNER,
    is_learner,
    is_search,
    is_variant,
    main_methods,
    most_exploring,
    name_of,
)
from coartic.analysis.study import CellKey, Study, cached, one_by_one
from coartic.analysis.table import TABLES
from coartic.analysis.topics.comparison.runtimes import halfway
from coartic.analysis.topics.comparison.runtimes import price as price_by_method
from coartic.analysis.topics.comparison.scores import (
    BY_FORMULA,
    BY_TRIAL,
    UNTOLD,
    group_of,
    initial_and_optimum,
    leaders,
)
from coartic.analysis.topics.families.sample import sample
from coartic.analysis.topics.paper.published import RUNS
from coartic.analysis.topics.paper.tables import best_condition
from coartic.learner.learning import TRIALS

Facts = dict[str, Any]


def failed_behind(study: Study, cells: Iterable[CellKey]) -> Facts | None:
    """How many runs of the cells behind an answer failed, and whose; None where none did.

    ``runs`` are all of the methods of which some failed.
    """
    runs, failed = Counter[str](), Counter[str]()
    for task, label in dict.fromkeys(cells):
        cell = study.cells[task, label]
        runs[label] += len(cell.runs)
        failed[label] += len(cell.runs) - len(cell.good)
    who = [label for label in failed if failed[label]]
    if not who:
        return None
    names = " and ".join(map(name_of, who)) if len(who) < 3 else f"{len(who)} methods"
    return {"failed": failed.total(), "runs": sum(runs[label] for label in who), "who": names}


def failed_compared(study: Study, *groups: str) -> Facts | None:
    """:func:`failed_behind` an answer that compares methods on tasks with a known optimum."""
    tasks = initial_and_optimum(study)
    return failed_behind(
        study,
        (
            (task, label)
            for task, label in study.cells
            if task in tasks and not is_variant(label) and not is_search(label)
            if not groups or group_of(study, label) in groups
        ),
    )


@cached
def gain(study: Study) -> Facts | None:
    """The learner on the task on which it improves most; None without it."""
    best: Facts | None = None
    for task in study.tasks:
        label = best_condition(study, task)
        good = None if label is None else study.cells[task, label].good
        if label is None or good is None or not good.initial_reward.mean() < 0:
            continue
        initial, learned = float(good.initial_reward.mean()), float(good.reward.mean())
        share = (learned - initial) / -initial
        if best is None or share > best["share"]:
            best = {"task": task, "label": label, "initial": initial, "learned": learned}
            best |= {"share": share, "method": name_of(label), "title": study.tasks[task].label}
    if best is not None:
        # Ticks by which the first movement is slower than the corrective process's.
        changes = study.trajectories(best["task"], best["label"]).against_same_hands
        best["first"] = float(changes[:, 0].mean()) if len(changes) else math.nan
        best["failed"] = failed_behind(study, [(best["task"], best["label"])])
    return best


@cached
def nearest(study: Study) -> Facts | None:
    """Who comes nearest to the optimum, among those that know as much of the reward.

    Of each algorithm its best form, nearest first, gaps in per cent.
    """
    groups = {}
    for name, group in (("trial", BY_TRIAL), ("formula", BY_FORMULA), ("untold", UNTOLD)):
        rows = leaders(study, group)
        rows = rows.assign(name=list(map(name_of, rows.method)))
        groups[name] = rows.assign(**{of: 100 * rows[of] for of in ("gap", "low", "high")})
    nearest_first = [row for rows in groups.values() for row in rows.to_dict("records")]
    if not nearest_first:
        return None
    by_trial = groups["trial"].to_dict("records")
    places = [place for place, row in enumerate(by_trial) if is_learner(row["method"])]
    optima = study.optima.values()
    return {
        **{name: rows.to_dict("records") for name, rows in groups.items()},
        "best": nearest_first[0],
        "learner": {**by_trial[places[0]], "place": places[0] + 1} if places else None,
        "proven": sum(best.proven for best in optima),
        "tasks": len(optima),
        "settings": sum(map(is_variant, TABLES["variants"](study).method)),
        "from_files": from_files(study),
        "failed": failed_compared(study),
    }


def from_files(study: Study) -> list[Any]:
    """Rows of the ranking of methods that are not built in; ``beside``: whether the learner ran."""
    labels = {label for _, label in study.cells if label.partition(" ")[0] not in KNOWN_METHODS}
    if not labels:
        return []
    rows = TABLES["ranking"](study)
    rows = rows[rows.method.isin(labels) & rows.gap.notna()]
    beside = any(is_learner(label) for _, label in study.cells)
    return rows.assign(gap=100 * rows.gap, beside=beside).to_dict("records")


@cached
def price(study: Study) -> Facts | None:
    """What the learner pays for half of the targets, beside the best rival and the best plan.

    None where the learner did not run on tasks with a known optimum.
    """
    rows = price_by_method(study)
    learners = [label for label in main_methods(map(str, rows.index)) if is_learner(label)]
    if not learners:
        return None
    others = rows[~rows.index.isin([label for label in rows.index if is_learner(str(label))])]
    searches = others[others.knows == BY_TRIAL]
    learner: Any = rows.loc[learners[0]]
    rival: Any = (
        searches.sort_values("reached", ascending=False, kind="stable").iloc[0]
        if len(searches)
        else None
    )
    levels = []
    for level, name in (("a quarter", "trials_to_quarter"), ("half", "trials_to_half")):
        if rival is not None and math.isfinite(learner[name]) and math.isfinite(rival[name]):
            ours, theirs = (
                {"trials": row[name], "low": row[f"{name}_low"], "high": row[f"{name}_high"]}
                for row in (learner, rival)
            )
            times = learner[name] / rival[name]
            levels.append({"level": level, "ours": ours, "theirs": theirs, "times": times})
    plans = others[(others.knows != BY_TRIAL) & (others.reached >= 0.5)].kinematics_to_half
    plan = str(plans.idxmin()) if len(plans) else ""
    ours = halfway(study, learners[0])
    theirs = {} if rival is None else halfway(study, str(rival.name))
    by_task = [
        {"task": study.tasks[name].label, "ours": trials, "theirs": theirs[name]}
        for name, trials in ours.items()
        if name in theirs and name in one_by_one(study)
    ]
    return {
        "learner": learners[0],
        "rival": "" if rival is None else name_of(str(rival.name)),
        "rival_label": "" if rival is None else str(rival.name),
        "levels": levels,
        "ceiling": learner.reached,
        "rival_ceiling": math.nan if rival is None else rival.reached,
        "by_task": by_task,
        "never": math.inf in (*ours.values(), *theirs.values()),
        "plan": name_of(plan) if plan else "",
        "plan_kinematics": plans.min(),
        "plan_seconds": rows.seconds_to_half.get(plan, math.nan),
        "learner_kinematics": learner.kinematics_to_half,
        "learner_seconds": learner.seconds_to_half,
        "failed": failed_compared(study, BY_TRIAL),
    }


@cached
def learning(study: Study) -> list[Facts]:
    """Trials after which half of the gain of the learner that explores most is there, by task."""
    half = TABLES["learning"](study).half_gain
    rows = [(task, f"{name} {most_exploring(task)}") for name, task in study.tasks.items()]
    return [
        {"task": task.label, "hands": len(task.hands), "trials": float(half[row])}
        for task, row in rows
        if row in half.index and half[row] < math.inf
    ]


@cached
def families(study: Study) -> Facts | None:
    """What holds over instances of families of random tasks."""
    instances = sample(study)
    if instances is None:
        return None
    rows = TABLES["family-gaps"](study)
    rows = rows[rows.gap.notna()]
    names = [("the learner" if m == "learner" else name_of(m)) for m in rows.method]
    return {
        "instances": len(instances.references),
        "families": len(instances.families),
        "gaps": rows.assign(name=names, percent=100 * rows.gap).to_dict("records"),
        "proven": sum(reference.proven for reference in instances.references.values()),
    }


@cached
def exploration(study: Study) -> list[Facts]:
    """Contrasts of conditions over all families, in per cent of the best known reward."""
    rows = TABLES["exploration"](study)
    initial = rows.contrast.astype(str).str.endswith("the initial solution")
    rows = rows[(rows.family == "all") & ~initial]
    percent = {name: 100 * rows[name] for name in ("gain", "gain_low", "gain_high")}
    return [
        {str(k): v for k, v in row.items()} for row in rows.assign(**percent).to_dict("records")
    ]


@cached
def limits(study: Study) -> Facts:
    """What the results cannot show, as far as it depends on the folder."""
    runs, made_with = study.runs, study.made_with
    failed = runs[runs.status != "ok"]
    learners = [cell for (_, label), cell in study.cells.items() if label.startswith(LEARNER)]
    trials = {int(n) for cell in learners for n in cell.runs.trials.dropna()}
    fewest = min((len(cell.runs) for cell in learners), default=0)
    tasks = {name: study.tasks[name] for name in study.tasks if name in one_by_one(study)}
    optima = {name: study.optima.get(name) for name in tasks}
    reasons = Counter(map(str, failed.reason.dropna())).most_common(3)
    return {
        "runs": len(runs),
        "failed": len(failed),
        "reasons": [f"{count} × {reason}" for reason, count in reasons],
        "reconstructed": [task.label for task in tasks.values() if task.reconstructed],
        "incumbent": tasks["two-armed-1"].label if "two-armed-1" in tasks else "",
        "trials": sorted(trials) if trials != {TRIALS} else [],
        "paper_trials": TRIALS,
        "few": fewest if fewest < RUNS else 0,
        "paper_runs": RUNS,
        "seed": study.plan.seed,
        "unproven": [
            tasks[name].label for name, best in optima.items() if best and not best.proven
        ],
        "unknown": [tasks[name].label for name, best in optima.items() if best is None],
        "side_by_side": bool(runs.together.fillna(1).max() > 1) if "together" in runs else False,
        "dirty": bool(runs.commit.dropna().astype(str).str.endswith("+").any()),
        "processor": made_with["processor"],
        "cores": made_with["cores"],
    }


@cached
def provenance(study: Study) -> Facts:
    """Which runs, how many, made with what and when."""
    made_with = study.made_with
    return {
        "suite": study.suite,
        "folder": quote(str(study.folder)),
        "runs": len(study.runs),
        "seed": study.plan.seed,
        "version": made_with["coartic"],
        "commit": made_with["commit"]["id"][:12] if made_with["commit"] else "",
        "date": made_with["date"][:10],
    }
