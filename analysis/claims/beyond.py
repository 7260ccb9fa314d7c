"""Comparisons that the paper does not make: measured, not judged."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

from coartic.analysis.claims.data import BEST, CELLS, Data, MissingError, rewards_of
from coartic.analysis.claims.evidence import by_optimum, layout, measured
from coartic.analysis.claims.one_armed import CONTROLS, context_distance, sacrifice
from coartic.analysis.claims.register import Finding
from coartic.analysis.claims.statements import decides
from coartic.analysis.methods import EC1, LEARNER
from coartic.analysis.published import Summary, published_cell
from coartic.analysis.report.document import Estimate, RestsOn
from coartic.analysis.report.tables.layout import estimated
from coartic.analysis.results.optima import OtherArm
from coartic.analysis.statistics.equivalence import MARGIN, difference
from coartic.analysis.statistics.estimates import difference_of_means, mean
from coartic.analysis.words import NONE, interval


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
            row = layout("learned-rewards-as-printed").row(
                f"{task} {condition} {name}",
                cells=[(task, LEARNER + condition)],
                task=task,
                condition=condition,
                hands=name,
                printed=Estimate(summary.mean, digits=summary.digits),
                printed_runs=summary.runs,
                ours=float(own.mean()),
                our_runs=len(own),
                difference=estimated(apart),
                share=apart.estimate / -summary.mean,
                verdict=verdict,
            )
            sources: dict[str, tuple[RestsOn, ...]] = {
                "printed": (summary.source,),
                "printed_runs": (summary.source_of_runs,),
            }
            rows.append(replace(row, rests_on=sources))
            if hands is None:
                verdicts.append(f"{task} {condition} {verdict or NONE}")
    return measured("learned-rewards-as-printed", "; ".join(verdicts), rows, margin=MARGIN)


@decides("distance-to-optimum")
def _to_the_optimum(data: Data) -> Finding:
    rows, shares = [], []
    for task, condition in CELLS:
        reward = mean(data.rewards(task, condition))
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
        values = by_optimum(arm, optimum=best.reward, gap=estimated(gap), gap_share=share)
        cells = [(task, LEARNER + condition)]
        row = layout("distance-to-optimum").row(
            f"{task} {condition}", cells=cells, task=task, condition=condition, **values
        )
        rows.append(row)
        shares.append(f"{task} {condition} {share:.1%}")
    return measured("distance-to-optimum", "; ".join(shares), rows)


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
        gain = difference_of_means(other, own)
        cells = [(task, LEARNER + name) for name in (condition, f"{condition}-{proposal}")]
        row = layout("proposals").row(
            f"{task} {condition} {proposal}",
            cells=cells,
            task=task,
            condition=condition,
            change=change,
            gain=estimated(gain),
        )
        rows.append(row)
        gains.append(f"{task} {change.split()[0]} {interval(gain)}")
    return measured("proposals", "; ".join(gains), rows)


@decides("absent-without-looking-ahead")
def _absent_without_looking_ahead(data: Data) -> Finding:
    parts = []
    for method in (EC1, *CONTROLS):
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
