"""What the report says: the numbers in its sentences, worked out once.

Each function gives the facts of one section, or None where the runs say nothing about it. The
sentences stand in ``sentences.jinja``.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from coartic.analysis import tables
from coartic.analysis.claims.judge import counts, judged
from coartic.analysis.comparisons.methods import BY_FORMULA, BY_TRIAL, UNTOLD
from coartic.analysis.comparisons.paper import paper_rows
from coartic.analysis.comparisons.reached import Crossing
from coartic.analysis.comparisons.reached import price as price_by_method
from coartic.analysis.comparisons.standings import leaders
from coartic.analysis.generality.exploration import contrasts
from coartic.analysis.generality.sample import one_by_one, sample
from coartic.analysis.methods import (
    CONDITIONS,
    LEARNER,
    is_learner,
    is_variant,
    main_methods,
    name_of,
)
from coartic.analysis.published import RUNS, TRIALS
from coartic.analysis.signatures.between import TwoContexts
from coartic.analysis.signatures.register import signatures
from coartic.analysis.signatures.shared_goal import shared_goal
from coartic.analysis.statistics.estimates import LEVEL
from coartic.analysis.study import Study, cached
from coartic.analysis.words import listed

Rows = list[dict[str, Any]]
"""Rows of a table."""


@dataclass(frozen=True)
class Coarticulation:
    """How the posture at one goal depends on the next."""

    goal: TwoContexts
    method: str
    runs: int
    tested: bool
    """Whether it takes a test: the method's runs differ by chance."""

    @property
    def seen(self) -> bool:
        """Whether postures differ by more than chance."""
        return self.goal.p < LEVEL if self.tested else self.goal.apart > 0

    @property
    def too_few(self) -> bool:
        """Whether there are too few runs for the test."""
        return self.tested and math.isnan(self.goal.p)


@cached
def coarticulation(study: Study) -> Coarticulation | None:
    """Of the first goal that two tasks share."""
    goal = shared_goal(study)
    if goal is None:
        return None
    method = study.cells[goal.tasks[0].name, goal.method].method
    tested = study.plan.methods[method].stochastic
    return Coarticulation(goal, name_of(goal.method), sum(map(len, goal.postures)), tested)


@dataclass(frozen=True)
class Moved:
    """The joint that follows a moved goal most, at the goal before it."""

    method: str
    joint: str
    goal: int
    moving: int
    slope: float
    """Length unit or rad per length unit that the goal moves."""
    low: float
    high: float

    @property
    def seen(self) -> bool:
        """Whether the interval leaves out 0."""
        return self.low > 0 or self.high < 0


@cached
def moved(study: Study) -> Moved | None:
    """Of the paper's learner, or of the first other method; None where no goal moves."""
    frame = signatures(study)
    frame = frame[(frame.signature == "locus slope") & frame.value.notna()]
    frame = frame[frame.goal < frame.moving]
    for label in (*CONDITIONS, *main_methods(frame.label)):
        own = frame[frame.label == label].sort_values("value", key=abs)
        if len(own):
            row = own.iloc[-1]
            joint = str(row.joint).replace("_", " ")
            return Moved(name_of(label), joint, int(row.goal), int(row.moving), row.value,
                         row.low, row.high)  # fmt: skip
    return None


@dataclass(frozen=True)
class Gain:
    """The learner on the task on which it improves most."""

    task: str
    method: str
    initial: float
    learned: float
    first: float
    """Ticks by which the first movement is slower than the corrective process's with the same
    hands; NaN where that completes the task with none."""
    runs: int


@cached
def gain(study: Study) -> Gain | None:
    """None without the paper's learner."""
    found: dict[float, Gain] = {}
    for task in study.tasks:
        label = tables.best_condition(study, task)
        if label is None:
            continue
        good = study.cells[task, label].good
        initial, learned = float(good.initial_reward.mean()), float(good.reward.mean())
        changes = study.trajectories(task, label).against_same_hands
        first = float(changes[:, 0].mean()) if len(changes) else math.nan
        if initial < 0:
            own = Gain(study.tasks[task].label, name_of(label), initial, learned, first, len(good))
            found.setdefault((learned - initial) / -initial, own)
    return found[max(found)] if found else None


@dataclass(frozen=True)
class Paper:
    """What became of the paper's learned rewards and claims."""

    rewards: Counter[str]
    """Cells by verdict, of those whose reward is printed."""
    claims: Mapping[str, int]
    """Claims by verdict."""
    independent: Mapping[str, int]
    """The same of the claims on tasks that are printed in full."""
    names: list[str]
    """Not supported, in the paper's words."""
    general: bool
    """Whether the claims are those on families of random tasks alone."""

    @property
    def judged(self) -> int:
        """Claims by which our goals were not chosen."""
        return sum(self.claims.values()) - self.claims["used to choose the goals"]

    @property
    def decided(self) -> bool:
        """Whether most claims could be judged: with few runs or trials they cannot."""
        return 2 * self.claims["undecided"] < self.judged


@cached
def paper(study: Study) -> Paper | None:
    """None where the folder has neither the paper's tasks nor families."""
    rewards = Counter(row.verdict for row in paper_rows(study) if row.verdict is not None)
    entries = judged(study)
    asked = [entry for entry in entries if entry.run_ids or entry.claim.cells]
    general = bool(entries) and all(entry.claim.families for entry in entries)
    if not paper_rows(study) and not any(entry.run_ids for entry in asked):
        return None
    return Paper(
        rewards,
        dict[str, int](counts(entries).items()),
        dict[str, int](counts(entry for entry in entries if not entry.claim.fitted).items()),
        [entry.claim.statement for entry in entries if entry.verdict == "not supported"],
        general,
    )


@dataclass(frozen=True)
class Nearest:
    """Who comes nearest to the optimum, among those that know as much of the reward."""

    trial: Rows
    """The best form of each algorithm that learns by trial, nearest first."""
    formula: Rows
    untold: Rows
    proven: int
    tasks: int

    @property
    def best(self) -> dict[str, Any] | None:
        """The nearest of those that learn by trial, or of those that plan."""
        return next(iter([*self.trial, *self.formula, *self.untold]), None)

    @property
    def learner(self) -> dict[str, Any] | None:
        """The paper's learner, with its ``place``."""
        for place, row in enumerate(self.trial, 1):
            if is_learner(row["method"]):
                return {**row, "place": place}
        return None


@cached
def nearest(study: Study) -> Nearest | None:
    """None where no method has a known gap."""
    by_trial, by_formula, untold = (
        _leaders(study, group) for group in (BY_TRIAL, BY_FORMULA, UNTOLD)
    )
    known = [best for (_, arm), best in study.optima.items() if arm == "free"]
    proven = sum(best.proven for best in known)
    found = Nearest(by_trial, by_formula, untold, proven, len(known))
    return found if found.best else None


def _leaders(study: Study, group: str) -> Rows:
    """Rows of :func:`~.standings.leaders` with their names, gaps in per cent."""
    rows = leaders(study, group)
    rows = rows.assign(**{name: 100 * rows[name] for name in ("gap", "low", "high")})
    return _records(rows.assign(name=[name_of(method) for method in rows.method]))


def _records(frame: pd.DataFrame) -> Rows:
    rows: Rows = frame.to_dict("records")  # type: ignore[assignment]
    return rows


@dataclass(frozen=True)
class Price:
    """What the learner pays for half of the targets, beside the best rival and the best plan."""

    learner: str
    rival: str
    levels: list[dict[str, Any]]
    """For a quarter and half of the targets: ``level``, ``ours`` and ``theirs`` (crossings in
    trials), and ``times`` (the ratio, with its interval)."""
    ceiling: float
    """Share of targets that the learner reaches in the end."""
    rival_ceiling: float
    plan: str
    """The cheapest planner that reaches half; empty without one."""
    plan_kinematics: float
    learner_kinematics: float


@cached
def price(study: Study) -> Price | None:
    """None where the learner did not run on tasks with a known optimum."""
    rows = price_by_method(study)
    learners = [label for label in main_methods(map(str, rows.index)) if is_learner(label)]
    if not learners:
        return None
    learner: Any = rows.loc[learners[0]]
    others = [label for label in rows.index if not is_learner(str(label))]
    rivals = rows[(rows.knows == BY_TRIAL) & rows.index.isin(others)]
    rival: Any = rivals.sort_values("reached", kind="stable").iloc[-1] if len(rivals) else None
    levels = []
    for level, name in ((0.25, "trials_to_quarter"), (0.5, "trials_to_half")):
        ours, theirs = (
            Crossing(*(row[f"{name}{end}"] for end in ("", "_low", "_high")))
            for row in (learner, learner if rival is None else rival)
        )
        if rival is not None and math.isfinite(ours.budget) and math.isfinite(theirs.budget):
            times = ours.budget / theirs.budget
            levels.append({"level": level, "ours": ours, "theirs": theirs, "times": times})
    plans = rows[(rows.knows != BY_TRIAL) & (rows.reached >= 0.5)].kinematics_to_half
    plan = "" if plans.empty else str(plans.idxmin())
    return Price(
        name_of(learners[0]),
        "" if rival is None else name_of(str(rival.name)),
        levels,
        learner.reached,
        math.nan if rival is None else rival.reached,
        name_of(plan) if plan else "",
        plans.get(plan, math.nan),
        learner.kinematics_to_half,
    )


@cached
def hands(study: Study) -> list[dict[str, str]]:
    """Tasks on which the learner's best condition ends with other hands than it began with."""
    changes = []
    for task in study.tasks:
        label = tables.best_condition(study, task)
        good = study.cells[task, label].good if label else None
        if good is None or not len(good.initial_hands.dropna()):
            continue
        before, after = good.initial_hands.dropna().iloc[0], good.hands.mode().iloc[0]
        if before != after:
            changes.append({"task": study.tasks[task].label, "before": before, "after": after})
    return changes


@cached
def pace(study: Study) -> list[dict[str, Any]]:
    """Trials after which half of the learner's gain is there, by task: its best condition."""
    rows = tables.learning(study)
    found = []
    for task in study.tasks:
        row = f"{task} {tables.best_condition(study, task)}"
        if row in rows.index:
            trials = float(rows.half_gain[row])
            found.append({"task": study.tasks[task].label.lower(), "trials": trials})
    return found


@cached
def equivalence(study: Study) -> dict[str, int] | None:
    """In how many methods the next goal changes more of what leaves the hand in place."""
    rows = tables.contexts(study)
    rows = rows[[not is_variant(str(label)) for label in rows.method]] if len(rows) else rows
    rows = rows[rows.distance > 0.01] if len(rows) else rows
    if not len(rows):
        return None
    return {"larger": int((rows.equivalent > rows.other).sum()), "methods": len(rows)}


@dataclass(frozen=True)
class Families:
    """What holds over instances of families of random tasks."""

    instances: int
    families: int
    runs: int
    gaps: list[dict[str, Any]]
    """Methods over families with two arms, nearest first."""
    proven: int


@cached
def families(study: Study) -> Families | None:
    """None without instances."""
    instances = sample(study)
    if instances is None:
        return None
    rows = tables.family_gaps(study)
    rows = rows[rows.gap.notna()]
    names = [("the learner" if m == "learner" else name_of(m)) for m in rows.method]
    gaps = _records(rows.assign(name=names, percent=100 * rows.gap))
    proven = sum(known.proven for known in instances.references.values())
    runs = int(study.runs.task.isin(list(instances.tasks)).sum())
    return Families(len(instances.references), len(instances.families), runs, gaps, proven)


@cached
def more_exploration(study: Study) -> list[dict[str, Any]]:
    """Contrasts of conditions over all families, in per cent of the best known reward."""
    return [
        {
            "pair": f"{name_of(found.first)} over {name_of(found.second)}",
            "gain": 100 * found.difference.estimate,
            "low": 100 * found.difference.low,
            "high": 100 * found.difference.high,
            "better": found.better,
            "instances": found.instances,
        }
        for found in contrasts(study)
        if not found.family and found.second in CONDITIONS
    ]


@cached
def limits(study: Study) -> dict[str, Any]:
    """What the results cannot show, as far as it depends on the folder."""
    runs, plan = study.runs, study.plan
    failed = runs[runs.status != "ok"]
    reasons = Counter(map(str, failed.reason.dropna()))
    learners = [cell for (_, label), cell in study.cells.items() if label.startswith(LEARNER)]
    trials = {int(n) for cell in learners for n in cell.runs.trials.dropna()}
    unproven = [
        study.tasks[task].label
        for (task, arm), best in study.optima.items()
        if arm == "free" and not best.proven and task in one_by_one(study)
    ]
    unknown = [
        task.label
        for name, task in study.tasks.items()
        if (name, "free") not in study.optima and name in one_by_one(study)
    ]
    ours = sorted({len(cell.runs) for cell in learners})
    commits = {str(commit).rstrip("+") for commit in runs.commit.dropna()}
    return {
        "runs": len(runs),
        "failed": len(failed),
        "reasons": [f"{count} × {reason}" for reason, count in reasons.most_common(3)],
        "failed_trials": int(np.nansum(runs.failed_trials.to_numpy(float, na_value=math.nan))),
        "reconstructed": [
            t.label for n, t in study.tasks.items() if t.reconstructed and n in one_by_one(study)
        ],
        "incumbent": study.tasks["two-armed-1"].label if "two-armed-1" in study.tasks else "",
        "trials": sorted(trials) if trials and trials != {TRIALS} else [],
        "paper_trials": TRIALS,
        "few": ours[0] if ours and ours[0] < RUNS else 0,
        "paper_runs": RUNS,
        "seed": plan.seed,
        "unproven": listed(unproven) if unproven else "",
        "unknown": listed(unknown) if unknown else "",
        "side_by_side": bool(runs.together.fillna(1).max() > 1) if "together" in runs else False,
        "commits": len(commits),
        "dirty": bool(runs.commit.dropna().astype(str).str.endswith("+").any()),
        "processor": study.made_with["processor"],
        "cores": study.made_with["cores"],
    }


@cached
def made(study: Study) -> dict[str, Any]:
    """Which runs, how many, made with what and when."""
    plan, made_with = study.plan, study.made_with
    return {
        "suite": plan.suite,
        "folder": study.folder,
        "runs": len(study.runs),
        "failed": int((study.runs.status != "ok").sum()),
        "tasks": len(study.tasks),
        "methods": len({label for _, label in study.cells}),
        "trials": plan.trials,
        "seed": plan.seed,
        "version": made_with["coartic"],
        "commit": made_with["commit"]["id"][:12] if made_with["commit"] else "",
        "date": made_with["date"][:10],
        "most_runs": int(pd.Series([len(c.runs) for c in study.cells.values()]).max() or 0),
    }
