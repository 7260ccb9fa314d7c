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

import numpy as np
from coartic.analysis.topics.comparison.groups import BY_FORMULA, BY_TRIAL, UNTOLD, group_of

from coartic.analysis.claims.judge import Judged, counts, judged
from coartic.analysis.methods import (
    CONDITIONS,
    KNOWN_METHODS,
    LEARNER,
    is_learner,
    is_search,
    is_variant,
    main_methods,
    most_exploring,
    name_of,
)
from coartic.analysis.signatures.between import TwoContexts
from coartic.analysis.signatures.context import smallest_p
from coartic.analysis.signatures.register import placebo_of, selects, shared_goal
from coartic.analysis.statistics.estimates import LEVEL
from coartic.analysis.study import CellKey, Study, cached, one_by_one
from coartic.analysis.table import TABLES
from coartic.analysis.topics.comparison.runtimes import halfway
from coartic.analysis.topics.comparison.runtimes import price as price_by_method
from coartic.analysis.topics.comparison.scores import initial_and_optimum, leaders
from coartic.analysis.topics.families.sample import sample
from coartic.analysis.topics.human import judge
from coartic.analysis.topics.paper.published import RUNS, TRIALS
from coartic.analysis.topics.paper.rewards import beside_paper
from coartic.analysis.topics.paper.tables import best_condition

Facts = dict[str, Any]
PENALTIES = {"joints": "costly joints", "region": "a costly disc", "distinct": "postures alike"}
"""Terms of a penalty in words."""
FURTHER = {"2": "the second", "3": "the third", "4": "the fourth", "5+": "the others together"}
"""Goals ahead beyond the first in words."""


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


def failed_of(study: Study, label: str) -> Facts | None:
    """:func:`failed_behind` an answer about one method."""
    return failed_behind(study, (cell for cell in study.cells if cell[1] == label))


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
def coarticulation(study: Study) -> Facts | None:
    """How the posture at the first goal that two tasks share depends on the next goal."""
    shared = shared_goal(study)
    if shared is None:
        return None
    # A method whose runs differ by chance takes a test.
    tested = study.plan.methods[study.cells[shared.tasks[0].name, shared.method].method].stochastic
    differ = shared.p < LEVEL if tested else shared.apart > 0
    chosen = selects(study, shared.method)
    placebo = placebo_of(study, shared) if chosen else None
    beyond = math.nan if placebo is None else shared.p_beyond(placebo)
    replays = [study.replays(task.name, shared.method) for task in shared.tasks]
    replayed = TwoContexts(replays[0], replays[1], shared.goal, shared.hand)
    return {
        "goal": shared.goal,
        "method": name_of(shared.method),
        "runs": sum(map(len, shared.postures)),
        "apart": shared.apart,
        "hands_apart": shared.hands_apart,
        "spreads": shared.spreads,
        "p": shared.p,
        "tested": tested,
        "differ": differ,
        "seen": differ and (not chosen or beyond < LEVEL),
        "too_few": tested and not smallest_p(*map(len, shared.runs)) < LEVEL,
        "no_placebo": chosen and placebo is None,
        "placebo": math.nan if placebo is None else placebo.apart,
        "beyond": beyond,
        "replayed": replayed.apart if all(replayed.runs) else math.nan,
        "row": f"{shared.tasks[0].name} {shared.method} goal {shared.goal} {shared.hand}",
        "failed": failed_behind(study, [(task.name, shared.method) for task in shared.tasks]),
    }


@cached
def slopes(study: Study) -> Facts | None:
    """The joint that follows a moved goal most, at a goal before it: of the learner if it ran.

    ``seen``: whether the whole posture surely follows; places where it does come first.
    """
    rows = TABLES["slopes"](study)
    rows = rows[(rows.kind == "anticipatory") & rows.slope.notna()]
    # A method that selects its solution from trials has to exceed the placebo as well.
    chosen = [selects(study, str(label)) for label in rows.method]
    beyond = (rows.p_placebo < LEVEL) | ~np.array(chosen, dtype=bool)
    rows = rows.assign(seen=(rows.p_holm < LEVEL) & beyond, size=rows.slope.abs())
    for label in (*CONDITIONS, *main_methods(rows.method)):
        of_method = rows[rows.method == label].sort_values(["seen", "size"])
        for row in of_method.tail(1).to_dict("records"):
            words = {"method": name_of(label), "joint": str(row["joint"]).replace("_", " ")}
            failed = {"failed": failed_of(study, label)}
            return {str(key): value for key, value in row.items()} | words | failed
    return None


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
def paper(study: Study) -> Facts | None:
    """What became of the paper's rewards and claims; None without its tasks and families."""
    entries = [entry for entry in judged(study) if entry.claim.place]
    if not entries or not (beside_paper(study) or any(entry.run_ids for entry in entries)):
        return None
    rows = [row for row in beside_paper(study) if not row["hands"]]
    rewards = Counter(row["verdict"] for row in rows)
    return {
        # Undecided, though 0 is not in the interval.
        "off": [
            {
                **{f"by{key}": row[f"difference{key}"] for key in ("", "_low", "_high")},
                "condition": row["cell"].label.removeprefix(LEARNER),
                "task": study.tasks[row["cell"].task].label,
            }
            for row in rows
            if row["verdict"] == "undecided"
            and (row["difference_low"] > 0 or row["difference_high"] < 0)
        ],
        "rewards": {name: rewards[name] for name in ("equivalent", "undecided", "different")},
        **verdicts_of(entries),
        "failed": failed_behind(study, (cell for e in entries for cell in e.finding.failed)),
    }


@cached
def claims(study: Study) -> Facts | None:
    """The verdicts on the paper's claims, or on ours where the folder is one of our studies."""
    entries = judged(study)
    return verdicts_of(entries) if entries and entries[0].claim.suite else paper(study)


def verdicts_of(entries: list[Judged]) -> Facts:
    """How many claims have each verdict, and whether most are decided.

    ``central``: by verdict, the claims that carry the paper's point; ``others``: counts of the
    others that count.
    """
    counted = [entry for entry in entries if not entry.claim.uncounted]
    central: dict[str, list[str]] = {}
    for entry in counted:
        if entry.claim.short:
            central.setdefault(entry.verdict, []).append(entry.claim.short)
    by_verdict = counts(entries)
    return {
        "claims": by_verdict,
        "central": central,
        "others": counts(entry for entry in counted if not entry.claim.short),
        "judged": len(counted),
        "uncounted": len(entries) - len(counted),
        # With few runs or trials most claims cannot be judged.
        "decided": 2 * by_verdict["undecided"] < len(counted),
    }


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
def hands(study: Study) -> Facts:
    """Tasks on which the learner's best condition ends with other hands than it began with."""
    changes, tasks = [], 0
    for name, task in study.tasks.items():
        label = best_condition(study, name)
        good = study.cells[name, label].good if label else None
        if good is not None and good.initial_hands.notna().any():
            tasks += 1
            before, most_frequent = good.initial_hands.dropna().iloc[0], list(good.hands.mode())
            if before not in most_frequent:
                change = f"{before} to {' or '.join(most_frequent)}"
                changes.append({"task": task.label, "change": change})
    return {"changes": changes, "tasks": tasks}


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
def signatures(study: Study) -> Facts | None:
    """In how many methods the next goal changes more of what leaves the hand in place."""
    rows = TABLES["contexts"](study)
    rows = rows[~rows.method.map(is_variant).astype(bool) & (rows.distance > 0.01)]
    larger = int((rows.equivalent > rows.other).sum())
    return {"larger": larger, "methods": len(rows)} if len(rows) else {}


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
def horizon(study: Study) -> Facts | None:
    """Gaps of the planner by goals ahead over random tasks, and what goals gain on tasks that have
    them."""
    rows = TABLES["horizon"](study)
    rows = rows[rows.group == "all"]
    if not len(rows):
        return None
    columns = [f"{name}{end}" for name in ("gap", "gain") for end in ("", "_low", "_high")]
    each = rows.assign(**100 * rows[columns]).to_dict("records")
    return {
        "tasks": each[0]["tasks"],
        "by_h": {row["h"]: row for row in each},
        "further": [
            row | {"words": words}
            for row in each
            if (words := FURTHER.get(row["h"])) and not math.isnan(row["gain"])
        ],
    }


@cached
def stops(study: Study) -> list[Facts] | None:
    """What postures are worth to the next goal when passing and with a full stop, by times.

    Of minimum-jerk plans on random tasks with one arm.
    """
    rows = TABLES["stops"](study)
    jerk = rows[(rows.group == "random, one arm") & rows.method.str.endswith("/jerk")]
    both = []
    for timing, words in (("free", "free"), ("fixed", "equal")):
        at = jerk[jerk.timing == timing].set_index("stop")
        if {0.0, 1.0} <= set(at.index):
            both.append({"times": words, "passing": at.loc[0.0], "stopping": at.loc[1.0]})
    return both or None


@cached
def objectives(study: Study) -> Facts | None:
    """Regrets at the largest weight, by penalty, and where trial and error overtakes."""
    rows = TABLES["objectives"](study)
    if not len(rows):
        return None
    last = rows[rows.weight == rows.weight.max()]
    by_term = {term: part.set_index("who") for term, part in last.groupby("term", sort=False)}
    crossings = TABLES["crossings"](study)
    return {
        "tasks": int(rows.tasks.max()),
        "weight": rows.weight.max(),
        "penalties": [
            {"term": PENALTIES[str(term)], "regret": part.regret.to_dict()}
            for term, part in by_term.items()
        ],
        "crossings": [
            {**row, "term": PENALTIES[row["term"]]}
            for row in crossings[crossings.who == "learner"].to_dict("records")
        ],
    }


@cached
def human(study: Study) -> Facts | None:
    """How often the learner agrees with findings about people, and where it could differ."""
    rows = judge.judged(study).drop_duplicates(["finding", "model"])
    if not len(rows):
        return None
    learner = rows[rows.model == "learner"].verdict.value_counts().to_dict()
    return {"learner": learner, "findings": len(judge.FINDINGS), **judge.separating(study)}


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
