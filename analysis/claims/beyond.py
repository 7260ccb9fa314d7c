"""Comparisons that the paper does not make: measured, not judged."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

from analysis.claims.data import BEST, CELLS, Data, MissingError, rewards_of
from analysis.claims.evidence import by_optimum, estimate_of, measured, of_either_optimum
from analysis.claims.one_armed import CONTROLS, context_distance, sacrifice
from analysis.claims.register import Finding
from analysis.claims.statements import decides
from analysis.methods import LEARNER
from analysis.published import Summary, published_cell
from analysis.report.document import Column, Estimate, RestsOn, Row
from analysis.results.optima import OtherArm
from analysis.statistics.equivalence import MARGIN, difference
from analysis.statistics.estimates import SEED, difference_of_means, mean
from analysis.words import NONE, interval

_EQUIVALENT = f"within ± {MARGIN:.0%}"


_CELL = (Column("task", "task"), Column("condition", "condition"))


@decides("learned-rewards-as-printed")
def _as_printed(data: Data) -> Finding:
    rows, verdicts = [], []
    for task, condition in CELLS:
        printed = published_cell(task, condition)
        assert printed is not None
        groups: list[tuple[str, Summary | None, str | None]] = [("all", printed.summary, None)]
        if len(printed.sequences) > 1:
            groups += [(s.hands, s.summary, s.hands) for s in printed.sequences]
        for name, summary, hands in groups:
            own = rewards_of(data.learned(task, condition, hands))
            if summary is None or not len(own):
                continue
            apart = difference(own, summary.mean, summary.sd, summary.runs)
            verdict = None if math.isnan(apart.low) else apart.verdict
            share = apart.estimate / -summary.mean
            values = (
                *(task, condition, name, Estimate(summary.mean, digits=summary.digits)),
                summary.runs,
                *(float(own.mean()), len(own), estimate_of(apart), share, verdict),
            )
            key = (task, LEARNER + condition)
            sources: dict[str, tuple[RestsOn, ...]] = {
                "printed": (summary.source,),
                "printed_runs": (summary.source_of_runs,),
            }
            rows.append(Row(f"{task} {condition} {name}", values, (key,), rests_on=sources))
            if hands is None:
                verdicts.append(f"{task} {condition} {verdict or NONE}")
    both: tuple[RestsOn, ...] = ("runs", "paper")
    columns = (
        *_CELL,
        Column("hands", "hands"),
        Column("printed", "printed", "number", digits=1, rests_on=("paper",)),
        Column("printed_runs", "runs", "number", rests_on=("paper",)),
        Column("ours", "ours", "number", digits=1, rests_on=("runs",)),
        Column("our_runs", "runs", "number", rests_on=("runs",)),
        Column("difference", "difference", "number", digits=1, rests_on=both),
        Column("share", "of the printed", "share", digits=1, rests_on=both),
        Column("verdict", _EQUIVALENT, rests_on=both),
    )
    evidence = "; ".join(verdicts)
    title = "Learned rewards as printed"
    return measured("learned-rewards-as-printed", evidence, title, columns, rows)


@decides("distance-to-optimum")
def _to_the_optimum(data: Data) -> Finding:
    rows, shares = [], []
    for task, condition in CELLS:
        reward = mean(data.rewards(task, condition), seed=SEED)
        arm: OtherArm = "free" if condition in ("EC2", "EC4") else "still"
        best = data.study.optima.get((task, arm))
        if best is None:
            raise MissingError(f"no optimum of {task} is known")
        gap = replace(
            reward,
            estimate=best.reward - reward.estimate,
            low=best.reward - reward.high,
            high=best.reward - reward.low,
        )
        share = gap.estimate / -best.reward
        values = by_optimum(arm, best.reward, estimate_of(gap), share)
        key = (task, LEARNER + condition)
        rows.append(Row(f"{task} {condition}", (task, condition, *values), (key,)))
        shares.append(f"{task} {condition} {share:.1%}")
    both: tuple[RestsOn, ...] = ("runs", "optimum")
    columns = of_either_optimum(
        Column("optimum", "optimum", "number", rests_on=("optimum",)),
        Column("gap", "from it", "number", "ticks", digits=1, rests_on=both),
        Column("gap_share", "of it", "share", digits=1, rests_on=both),
    )
    evidence, title = "; ".join(shares), "Distance to the optimum"
    return measured("distance-to-optimum", evidence, title, (*_CELL, *columns), rows)


_PROPOSALS = {
    "nullspace": "secondary objective in the corrective process's nullspace",
    "biased": "noise biased towards the corrective process's suggestion",
}
"""The paper's proposals for the learner, by what they add to a condition's name."""


@decides("proposals")
def _proposals(data: Data) -> Finding:
    rows, gains = [], []
    for (task, condition), (proposal, change) in itertools.product(BEST, _PROPOSALS.items()):
        own = data.rewards(task, condition)
        other = rewards_of(data.learned(task, f"{condition}-{proposal}"))
        gain = difference_of_means(other, own, seed=SEED)
        cells = tuple(
            (task, f"{LEARNER}{name}") for name in (condition, f"{condition}-{proposal}")
        )
        values = (task, condition, change, estimate_of(gain))
        rows.append(Row(f"{task} {condition} {proposal}", values, cells))
        gains.append(f"{task} {change.split()[0]} {interval(gain)}")
    columns = (
        *_CELL,
        Column("change", "change"),
        Column("gain", "gain in reward", "number", digits=1, rests_on=("runs",)),
    )
    return measured("proposals", "; ".join(gains), "Proposals", columns, rows)


@decides("absent-without-looking-ahead")
def _absent_without_looking_ahead(data: Data) -> Finding:
    parts = []
    for method in (f"{LEARNER}EC1", *CONTROLS):
        try:
            apart, (first, total) = context_distance(data, method), sacrifice(data, method)
        except MissingError:
            words = f"this folder lacks runs of {method} on ascending and descending"
            raise MissingError(words) from None
        parts.append(
            f"{method}: postures at goal 1 {apart:.2f} apart, first movement {first:+.1f} and "
            f"all {total:+.1f} ticks against the initial solution"
        )
    return Finding(None, "; ".join(parts))
