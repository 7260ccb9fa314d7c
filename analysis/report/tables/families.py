"""Tables of what holds over instances of families of random tasks."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from coartic.analysis.generality.exploration import budgets
from coartic.analysis.generality.precision import DIFFERENCE, RUNS, needed, variance_shares
from coartic.analysis.generality.presence import SIGNS, THERE, presence, recruitment
from coartic.analysis.generality.properties import OUTCOMES, PROPERTIES, what_pays
from coartic.analysis.generality.sample import CONDITIONS, INITIAL, ONE_ARMED, Sample
from coartic.analysis.generality.scaling import GROWING
from coartic.analysis.markup import escaped
from coartic.analysis.methods import short_name
from coartic.analysis.report.document import CellKey, Column, DataTable, Estimate, Row, Value
from coartic.analysis.report.tables.layout import LAYOUTS, with_interval
from coartic.analysis.statistics.estimates import SEED, Inference
from coartic.analysis.statistics.instances import Runs, Scores, other_tasks
from coartic.analysis.study import Study
from coartic.analysis.words import slugs
from coartic.text import counted

LEARNER = "learner"
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
    return CONDITIONS[-1] if family in two_armed(sample) else ONE_ARMED


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
    return other_tasks({family: scores[family] for family in families}, seed=SEED)


def _shown(found: Inference | None, scale: float = 1.0) -> Value:
    if found is None:
        return None
    return with_interval(*(scale * v for v in (found.estimate, found.low, found.high)))


def gaps_table(sample: Sample) -> DataTable | None:
    """Every method's gap: over families with two arms, and in each family."""
    names, layout = slugs(sample.families), LAYOUTS["family-gaps"]
    columns = {family: f"in_{slug.replace('-', '_')}" for family, slug in names.items()}
    layout = layout.plus(
        Column(name, family.partition("/")[0], "share", digits=1, rests_on=("runs", "optimum"))
        for family, name in columns.items()
    )
    both, rows = two_armed(sample), []
    for label in (LEARNER, *sample.labels):
        joined = label == LEARNER
        scores = learner_gaps(sample) if joined else sample.gaps(label)
        if not scores:
            continue
        to_bound = (
            learner_gaps(sample, to_bound=True) if joined else sample.gaps(label, to_bound=True)
        )
        means = np.array([float(np.mean(r[0])) for own in scores.values() for r in own])
        found = sum(bool((r[0] <= 0).any()) for own in scores.values() for r in own)
        row = layout.row(
            label,
            None,
            _cells(sample, (label,) if not joined else (ONE_ARMED, CONDITIONS[-1]), joined),
            method=LEARNER if joined else short_name(label),
            instances=len(means),
            two_arms=_shown(over(scores, both)),
            to_bound=_shown(over(to_bound, both)),
            median=float(np.median(means)),
            worst=float(np.quantile(means, 0.9)),
            better_on=found,
            **{columns[family]: _shown(over(scores, [family])) for family in columns},
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
    if isinstance(value, Estimate):
        return value.value
    return math.inf


def _instances(sample: Sample) -> str:
    """``40 test instances``."""
    return " and ".join(
        counted(count, f"{split} instance") for split, count in sample.splits.items()
    )


def _cells(
    sample: Sample, labels: Iterable[str], joined: bool = False, families: Sequence[str] = ()
) -> tuple[CellKey, ...]:
    cells = sample.study.cells
    return tuple(
        (name, label)
        for family, names in sample.families.items()
        if not families or family in families
        for label in labels
        if not joined or label == learner_on(sample, family)
        for name in names
        if (name, label) in cells
    )


def exploration_table(study: Study, sample: Sample) -> DataTable | None:
    """Pairs of conditions by family, then over all of them."""
    layout, rows = LAYOUTS["family-exploration"], []
    for found in study.contrasts:
        family = found.family.partition("/")[0] or ALL
        pair = f"{short_name(found.first)} over {_second(found.second)}"
        gain = found.difference.estimate
        row = layout.row(
            f"{pair}, {family}",
            found,
            _cells(
                sample,
                (found.first, found.second),
                families=[found.family] if found.family else (),
            ),
            contrast=pair,
            family=family,
            gain=_shown(found.difference),
            by_hands=_shown(found.hands),
            by_joints=gain - found.hands.estimate,
        )
        rows.append(row)
    return layout.table(rows)


def _second(label: str) -> str:
    return "the initial solution" if label == INITIAL else short_name(label)


def _budget_table(sample: Sample) -> DataTable | None:
    found = budgets(sample)
    trials = tuple(dict.fromkeys(row.trials for row in found))
    layout = LAYOUTS["family-budget"].plus(
        Column(
            f"after_{n}",
            f"{n:,} trials".replace(",", " "),
            "share",
            digits=1,
            rests_on=("runs", "optimum"),
        )
        for n in trials
    )
    rows = []
    for label, second, family in dict.fromkeys((r.label, r.second, r.family) for r in found):
        own = {
            r.trials: r for r in found if (r.label, r.second, r.family) == (label, second, family)
        }
        name = short_name(label) + (f" over {short_name(second)}" if second else "")
        short = family.partition("/")[0]
        row = layout.row(
            f"{name}, {short}",
            None,
            _cells(sample, filter(None, (label, second)), families=[family]),
            method=name,
            family=short,
            instances=max(r.instances for r in own.values()),
            **{f"after_{n}": _shown(own[n].value) if n in own else None for n in trials},
        )
        rows.append(row)
    return layout.table(rows) if len(trials) > 1 else None


def _presence_table(study: Study, sample: Sample) -> DataTable | None:
    layout, rows = LAYOUTS["family-presence"], []
    for found in sorted(presence(sample, study.signs), key=lambda r: list(SIGNS).index(r.sign)):
        if found.family and found.label != learner_on(sample, found.family):
            continue  # of what explores less over all families
        name, label = _SIGN_NAMES[found.sign], short_name(found.label)
        family = found.family.partition("/")[0] or ALL
        row = layout.row(
            f"{name}, {label}, {family}",
            found,
            _cells(sample, (found.label,), families=[found.family] if found.family else ()),
            signature=name,
            condition=label,
            family=family,
            mean=_shown(found.value),
        )
        rows.append(row)
    there = ", ".join(f"{THERE[sign]:g} ({name})" for sign, name in _SIGN_NAMES.items())
    return layout.table(rows, there=there)


def _hands_table(study: Study, sample: Sample) -> DataTable | None:
    layout = LAYOUTS["family-hands"]
    rows = [
        layout.row(
            f"{short_name(found.label)}, {found.family.partition('/')[0]}",
            found,
            _cells(sample, (found.label,), families=[found.family]),
            condition=short_name(found.label),
            family=found.family.partition("/")[0],
        )
        for found in recruitment(sample, study.signs)
    ]
    return layout.table(rows)


def _properties_table(sample: Sample) -> DataTable | None:
    layout, rows = LAYOUTS["family-properties"], []
    for found in what_pays(sample):
        effect = found.effect
        row = layout.row(
            f"{found.name}, {found.outcome}",
            found,
            _cells(sample, (ONE_ARMED, CONDITIONS[-1]), joined=True),
            property=PROPERTIES[found.name],
            outcome=found.outcome,
            effect=with_interval(*(100 * v for v in (effect.slope, effect.low, effect.high))),
        )
        rows.append(row)
    return layout.table(rows, **OUTCOMES)


def _scaling_table(study: Study, sample: Sample) -> DataTable | None:
    layout, rows = LAYOUTS["family-scaling"], []
    for found in study.growth:
        scale, name = 100.0 if found.what == "gap" else 1.0, short_name(found.label)
        goals, joints = (
            with_interval(*(scale * v for v in (effect.slope, effect.low, effect.high)))
            for effect in (found.goals, found.joints)
        )
        row = layout.row(
            f"{found.what}, {found.label}",
            found,
            _cells(sample, (found.label,)),
            method=name,
            grows=GROWING[found.what],
            goals=goals,
            joints=joints,
        )
        rows.append(row)
    return layout.table(rows)


def _variance_table(sample: Sample) -> DataTable | None:
    layout, rows = LAYOUTS["family-variance"], []
    for found in variance_shares(sample):
        name, shares = found.family.partition("/")[0], found.components.shares()
        known = {of: None if math.isnan(share) else share for of, share in shares.items()}
        cells = _cells(sample, [n for n in sample.labels if " " not in n], families=[found.family])
        row = layout.row(
            f"{name}, {found.of}",
            found,
            cells,
            family=name,
            sd=math.sqrt(found.components.total),
            **known,
        )
        rows.append(row)
    return layout.table(rows)


def _precision_table(sample: Sample) -> DataTable | None:
    layout = LAYOUTS["family-precision"].plus(
        Column(f"with_{n}", counted(n, "run"), "number", rests_on=("runs",)) for n in RUNS
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
        open_ = [r for r in known if r.bound is not None and not r.proven]
        beaten = [r.best - r.searched for r in known if r.searched is not None]
        over_ = [ticks for ticks in beaten if ticks > 0]
        short = family.partition("/")[0]
        splits = dict.fromkeys(str(sample.tasks[name].split) for name in names)
        row = layout.row(
            short,
            None,
            _cells(sample, sample.searches, families=[family]),
            family=short,
            split=", ".join(splits),
            instances=len(names),
            proven=sum(r.proven for r in known),
            bounded=sum(r.bound is not None for r in known),
            left=float(np.median([_left(r.best, r.bound) for r in open_])) if open_ else None,
            beaten=len(over_),
            by=max(over_, default=None),
        )
        rows.append(row)
    return layout.table(rows)


def _left(best: int, bound: int | None) -> float:
    return math.nan if bound is None else (bound - best) / abs(best)
