"""Tables of what holds over instances of families of random tasks."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from functools import partial

import numpy as np

from coartic.analysis.generality.exploration import Budget, budgets
from coartic.analysis.generality.precision import DIFFERENCE, RUNS, needed, variance_shares
from coartic.analysis.generality.presence import SIGNS, THERE, presence, recruitment
from coartic.analysis.generality.properties import OUTCOMES, PROPERTIES, what_pays
from coartic.analysis.generality.sample import Sample
from coartic.analysis.generality.scaling import GROWING
from coartic.analysis.markup import escaped
from coartic.analysis.methods import FAMILIES, INITIAL, most_exploring, short_name
from coartic.analysis.report.document import CellKey, Column, DataTable, Estimate, Row
from coartic.analysis.report.tables.layout import LAYOUTS, estimated, finite
from coartic.analysis.statistics.estimates import Inference
from coartic.analysis.statistics.instances import Runs, Scores, other_tasks
from coartic.analysis.study import Study
from coartic.analysis.words import slugs
from coartic.text import counted

LEARNER = FAMILIES["dual-process"]
"""Condition 1 on one arm and 4 on two."""
ALL = "all"
"""Of families, each counting alike."""
_SIGN_NAMES = {
    "hand": "not the quicker hand",
    "arm": "next goal nearer (ticks)",
    "other arm": "waiting arm",
    "first": "first longer (ticks)",
    "whole": "whole shorter (ticks)",
}


def family_tables(study: Study) -> Iterator[DataTable]:
    """All of them that the folder's instances allow, the most telling first."""
    sample = study.instances
    if sample is not None:
        made = (
            gaps_table(sample),
            exploration_table(study, sample),
            _budget_table(sample),
            _presence_table(study, sample),
            _hands_table(study, sample),
            _properties_table(sample),
            _scaling_table(study, sample),
            _variance_table(sample),
            _precision_table(sample),
            _references_table(sample),
        )
        yield from filter(None, made)


def two_armed(sample: Sample) -> tuple[str, ...]:
    """Families whose instances have two hands."""
    families = sample.families.items()
    return tuple(family for family, names in families if len(sample.tasks[names[0]].hands) > 1)


def learner_on(sample: Sample, family: str) -> str:
    """Label of the learner on a family: what explores most."""
    return most_exploring(sample.tasks[sample.families[family][0]])


def learner_gaps(sample: Sample, *, to_bound: bool = False) -> Scores:
    """Gaps of the learner, by family."""
    found: dict[str, Sequence[Runs]] = {}
    for family in sample.families:
        label = learner_on(sample, family)
        found |= dict(sample.gaps(label, families=[family], to_bound=to_bound))
    return found


def over(scores: Scores, families: Sequence[str]) -> Inference | None:
    """Mean over all of some families; None where one has no score."""
    if not families or not set(families) <= scores.keys():
        return None
    return other_tasks({family: scores[family] for family in families})


def gaps_table(sample: Sample) -> DataTable | None:
    """Every method's gap: over families with two arms, and in each family."""
    names, layout = slugs(sample.families), LAYOUTS["family-gaps"]
    columns = {family: f"in_{slug.replace('-', '_')}" for family, slug in names.items()}
    layout = layout.plus(
        Column(name, _named(family), "share", digits=1, rests_on=("runs", "optimum"))
        for family, name in columns.items()
    )
    both, rows = two_armed(sample), []
    for label in (LEARNER, *sample.labels):
        of = partial(learner_gaps, sample) if label == LEARNER else partial(sample.gaps, label)
        scores, to_bound = of(), of(to_bound=True)
        if not scores:
            continue
        means = np.array([float(np.mean(r[0])) for own in scores.values() for r in own])
        found = sum(bool((r[0] <= 0).any()) for own in scores.values() for r in own)
        row = layout.row(
            label,
            None,
            _cells(sample, (label,)),
            method=short_name(label),
            instances=len(means),
            two_arms=estimated(over(scores, both)),
            to_bound=estimated(over(to_bound, both)),
            median=float(np.median(means)),
            worst=float(np.quantile(means, 0.9)),
            better_on=found,
            **{columns[family]: estimated(over(scores, [family])) for family in columns},
        )
        rows.append(row)
    rows[1:] = sorted(rows[1:], key=_gap_of)
    return layout.table(
        rows,
        instances=escaped(_instances(sample)),
        families="one family" if len(sample.families) == 1 else f"{len(sample.families)} families",
    )


def _gap_of(row: Row) -> float:
    """Over families with two arms, those without behind."""
    value = row.values[2]
    return value.value if isinstance(value, Estimate) else math.inf


def _instances(sample: Sample) -> str:
    """``40 test instances``."""
    parts = (counted(count, f"{split} instance") for split, count in sample.splits.items())
    return " and ".join(parts)


def _cells(sample: Sample, labels: Iterable[str], of: str = "") -> tuple[CellKey, ...]:
    """Of a family, or of all; of :data:`LEARNER` those of the condition that stands for it."""
    cells = sample.study.cells
    return tuple(
        (name, own)
        for family, names in sample.families.items()
        if of in ("", family)
        for label in labels
        for own in [learner_on(sample, family) if label == LEARNER else label]
        for name in names
        if (name, own) in cells
    )


def _named(family: str) -> str:
    """Without its version; empty: all of them."""
    return family.partition("/")[0] or ALL


def exploration_table(study: Study, sample: Sample) -> DataTable | None:
    """Pairs of conditions by family, then over all of them."""
    layout, rows = LAYOUTS["family-exploration"], []
    for found in study.contrasts:
        family, gain = _named(found.family), found.difference.estimate
        second = "the initial solution" if found.second == INITIAL else short_name(found.second)
        pair = f"{short_name(found.first)} over {second}"
        row = layout.row(
            f"{pair}, {family}",
            found,
            _cells(sample, (found.first, found.second), found.family),
            contrast=pair,
            family=family,
            gain=estimated(found.difference),
            by_hands=estimated(found.hands),
            by_joints=gain - found.hands.estimate,
        )
        rows.append(row)
    return layout.table(rows)


def _budget_table(sample: Sample) -> DataTable | None:
    found = budgets(sample)
    trials = tuple(dict.fromkeys(row.trials for row in found))
    layout = LAYOUTS["family-budget"].plus(
        Column(
            *(f"after_{n}", f"{n:,} trials".replace(",", " "), "share"),
            digits=1,
            rests_on=("runs", "optimum"),
        )
        for n in trials
    )
    by_place: dict[tuple[str, str, str], dict[int, Budget]] = {}
    for each in found:
        by_place.setdefault((each.label, each.second, each.family), {})[each.trials] = each
    rows = []
    for (label, second, family), own in by_place.items():
        name = short_name(label) + (f" over {short_name(second)}" if second else "")
        row = layout.row(
            f"{name}, {_named(family)}",
            None,
            _cells(sample, filter(None, (label, second)), family),
            method=name,
            family=_named(family),
            instances=max(r.instances for r in own.values()),
            **{f"after_{n}": estimated(own[n].value) if n in own else None for n in trials},
        )
        rows.append(row)
    return layout.table(rows) if len(trials) > 1 else None


def _presence_table(study: Study, sample: Sample) -> DataTable | None:
    layout, rows = LAYOUTS["family-presence"], []
    for found in sorted(presence(sample, study.signs), key=lambda r: list(SIGNS).index(r.sign)):
        if found.family and found.label != learner_on(sample, found.family):
            continue  # of what explores less over all families
        name, label = _SIGN_NAMES[found.sign], short_name(found.label)
        family = _named(found.family)
        row = layout.row(
            f"{name}, {label}, {family}",
            found,
            _cells(sample, (found.label,), found.family),
            signature=name,
            condition=label,
            family=family,
            mean=estimated(found.value),
        )
        rows.append(row)
    there = ", ".join(f"{THERE[sign]:g} ({name})" for sign, name in _SIGN_NAMES.items())
    return layout.table(rows, there=there)


def _hands_table(study: Study, sample: Sample) -> DataTable | None:
    layout, rows = LAYOUTS["family-hands"], []
    for found in recruitment(sample, study.signs):
        condition, family = short_name(found.label), _named(found.family)
        cells = _cells(sample, (found.label,), found.family)
        of = {"condition": condition, "family": family}
        rows.append(layout.row(f"{condition}, {family}", found, cells, **of))
    return layout.table(rows)


def _properties_table(sample: Sample) -> DataTable | None:
    layout, rows = LAYOUTS["family-properties"], []
    for found in what_pays(sample):
        row = layout.row(
            f"{found.name}, {found.outcome}",
            found,
            _cells(sample, (LEARNER,)),
            property=PROPERTIES[found.name],
            effect=estimated(found.effect, 100),
        )
        rows.append(row)
    return layout.table(rows, **OUTCOMES)


def _scaling_table(study: Study, sample: Sample) -> DataTable | None:
    layout, rows = LAYOUTS["family-scaling"], []
    for found in study.growth:
        scale = 100.0 if found.what == "gap" else 1.0
        row = layout.row(
            f"{found.what}, {found.label}",
            found,
            _cells(sample, (found.label,)),
            method=short_name(found.label),
            grows=GROWING[found.what],
            goals=estimated(found.goals, scale),
            joints=estimated(found.joints, scale),
        )
        rows.append(row)
    return layout.table(rows)


def _variance_table(sample: Sample) -> DataTable | None:
    layout, rows = LAYOUTS["family-variance"], []
    for found in variance_shares(sample):
        name, shares = _named(found.family), found.components.shares()
        known = {of: finite(share) for of, share in shares.items()}
        cells = _cells(sample, [n for n in sample.labels if " " not in n], found.family)
        own = {"family": name, "sd": math.sqrt(found.components.total), **known}
        rows.append(layout.row(f"{name}, {found.of}", found, cells, **own))
    return layout.table(rows)


def _precision_table(sample: Sample) -> DataTable | None:
    layout = LAYOUTS["family-precision"].plus(
        Column(f"with_{n}", counted(n, "run"), "number", rests_on=("runs", "optimum"))
        for n in RUNS
    )
    rows = []
    for found in needed(sample):
        pair = f"{short_name(found.first)}, {short_name(found.second)}"
        counts = {f"with_{n}": count for n, count in zip(RUNS, found.needed, strict=True)}
        cells = _cells(sample, (found.first, found.second))
        rows.append(layout.row(pair, found, cells, pair=pair, **counts))
    return layout.table(rows, difference=f"{DIFFERENCE:.0%}")


def _references_table(sample: Sample) -> DataTable | None:
    layout, rows = LAYOUTS["family-references"], []
    for family, names in sample.families.items():
        known = [sample.references[name] for name in names]
        left = [
            (r.bound - r.best) / abs(r.best) for r in known if r.bound is not None and not r.proven
        ]
        beaten = [r.best - r.searched for r in known if r.searched is not None]
        over_ = [ticks for ticks in beaten if ticks > 0]
        splits = dict.fromkeys(str(sample.tasks[name].split) for name in names)
        row = layout.row(
            _named(family),
            None,
            _cells(sample, sample.searches, family),
            family=_named(family),
            split=", ".join(splits),
            instances=len(names),
            proven=sum(r.proven for r in known),
            bounded=sum(r.bound is not None for r in known),
            left=float(np.median(left)) if left else None,
            beaten=len(over_),
            by=max(over_, default=None),
        )
        rows.append(row)
    return layout.table(rows)
