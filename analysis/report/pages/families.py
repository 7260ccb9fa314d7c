"""What holds beyond the paper's tasks: a sentence of data, figures, and tables by family."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

from coartic.analysis.generality.exploration import Contrast
from coartic.analysis.generality.precision import DIFFERENCE, RUNS, needed
from coartic.analysis.generality.sample import Sample
from coartic.analysis.markup import escaped
from coartic.analysis.methods import CONDITIONS, EC2, EC3, EC4, INITIAL, short_name
from coartic.analysis.report.document import Block, Bullets, Section
from coartic.analysis.report.tables.families import (
    family_tables,
    learner_gaps,
    over,
)
from coartic.analysis.statistics.estimates import Inference
from coartic.analysis.study import Study
from coartic.analysis.words import NARROW_SPACE, interval, true_minus, typographic
from coartic.text import counted

TITLE = "Beyond the paper's tasks"
_FEW = 10
"""Instances of a family below which no word is said of it."""
_STEEP = 1.5
"""Exponent above which a method is named; one of 1 is growth in proportion."""


def families_section(study: Study, figures: Sequence[Block]) -> Section:
    """The section of a report; without blocks for a folder without instances of families."""
    sample = study.instances
    if sample is None:
        return Section("families", TITLE)
    said = Bullets(tuple(_sentences(study, sample)))
    tables = (replace(table, folded=True) for table in family_tables(study))
    blocks = (said, *figures, *tables)
    return Section("families", TITLE, blocks, finding=_in_a_sentence(sample))


def _in_a_sentence(sample: Sample) -> str:
    """What is measured, and the score that speaks about other tasks."""
    families = ", ".join(
        f"{family.partition('/')[0]} {len(names)}" for family, names in sample.families.items()
    )
    splits = " and ".join(f"{count} {split}" for split, count in sample.splits.items())
    parts = []
    learner = over(learner_gaps(sample), list(sample.families))
    if learner is not None:
        parts.append(f"the learner (EC1 on one arm, EC4 on two) stays {_share(learner)} behind")
    others = []
    for label in sample.labels:
        own = sample.gaps(label)
        if " " not in label and label not in CONDITIONS:
            found = over(own, list(sample.families))
            if found is not None:
                others.append((found.estimate, f"{short_name(label)} {_share(found)}"))
    text = "; ".join([*parts, *(words for _, words in sorted(others))])
    tasks = counted(sum(sample.splits.values()), "random task")
    return (
        escaped(
            f"On {tasks} ({splits}; {families}), as a share of the best known "
            f"reward, families counting alike: {text}."
            if text
            else f"{tasks} ({splits}; {families})."
        )
        + " Intervals are about other tasks of these families."
    )


def _sentences(study: Study, sample: Sample) -> Iterator[str]:
    by_pair = {(c.first, c.second): c for c in study.contrasts if not c.family}
    by_pair |= {
        (c.first, c.second): c for c in study.contrasts if (c.first, c.second) not in by_pair
    }
    yield from _exploration(study, by_pair)
    yield from _grown(study, sample)
    yield from _known(sample)
    yield from _seen(sample)


def _exploration(study: Study, by_pair: dict[tuple[str, str], Contrast]) -> Iterator[str]:
    for first, second, what in (
        (EC3, EC2, "Random hands with the other arm still"),
        (EC4, EC3, "The other arm's joints as well"),
        (EC4, EC2, "Random hands in place of the closest, all joints explored"),
    ):
        found = by_pair.get((first, second))
        if found is None:
            continue
        own = [c for c in study.contrasts if (c.first, c.second) == (first, second) and c.family]
        own = [c for c in own if c.instances >= _FEW]
        worse = [c.family.partition("/")[0] for c in own if c.difference.high < 0]
        better = [c.family.partition("/")[0] for c in own if c.difference.low > 0]
        parts = [f"better in {', '.join(better)}"] * bool(better)
        parts += [f"worse in {', '.join(worse)}"] * bool(worse)
        apart = f"; by family {' and '.join(parts) or 'told apart in none'}" if own else ""
        median, joints = (
            true_minus(f"{100 * part:+z.1f}")
            for part in (found.median, found.difference.estimate - found.hands.estimate)
        )
        yield escaped(
            f"{what} ({short_name(first)} over {short_name(second)}): "
            f"{_share(found.difference, '+')} on average, median {median} (by the hands that are "
            f"learned {_share(found.hands, '+')}, by joints {joints}); better on {found.better}, "
            f"worse on {found.worse} of {counted(found.instances, 'instance')}{apart}."
        )


def _grown(study: Study, sample: Sample) -> Iterator[str]:
    """What a goal more costs methods without variants, the learner under one condition alone."""
    left_out = {INITIAL, EC2, EC3, *sample.searches}
    rows = [g for g in study.growth if not (" " in g.label or g.label in left_out)]
    rows = [g for g in rows if not math.isnan(g.goals.estimate)]  # goals that do not vary
    gaps, powers = (
        sorted((g for g in rows if g.what == what), key=lambda g: g.goals.estimate)
        for what in ("gap", "kinematics")
    )
    if gaps and powers:
        said = ", ".join(f"{short_name(g.label)} {_points(g.goals)}" for g in gaps)
        steep = [g for g in powers if g.goals.low > _STEEP]
        flat = [g.goals.estimate for g in powers if g not in steep]
        like = [f"{min(flat):.1f} to {max(flat):.1f}"] * bool(flat)
        like += [f"{interval(g.goals)} ({short_name(g.label)})" for g in steep]
        yield escaped(
            f"Within families a goal more goes with so many points more of gap: {said}. "
            f"Evaluations of kinematics grow with the number of goals to the power of "
            f"{', '.join(like)}."
        )


def _points(found: Inference) -> str:
    low, point, high = (
        true_minus(f"{100 * value:z.1f}") for value in (found.low, found.estimate, found.high)
    )
    return f"{point} [{low}, {high}]"


def _known(sample: Sample) -> Iterator[str]:
    known = sample.references.values()
    proven = sum(r.proven for r in known)
    bounded = sum(r.bound is not None for r in known)
    beaten = sum(r.searched is not None and r.best > r.searched for r in known)
    found = over(learner_gaps(sample, to_bound=True), list(sample.families))
    most = (
        f"; to it the learner's gap, as a share of the bound, is {_share(found)}"
        if found is not None
        else ""
    )
    if bounded:
        yield escaped(
            f"The best known reward is proven to be the optimum on {proven} of "
            f"{counted(len(known), 'instance')}, on {bounded - proven} others a bound is proven "
            f"that it does not reach{most}. Gaps to the optimum lie between the two."
        )
    if any(r.searched is not None for r in known):
        yield f"Some method found more than the search for the optimum on {beaten}."


def _seen(sample: Sample) -> Iterator[str]:
    """How many instances show a small difference, for the closest rivals."""
    rows = needed(sample)
    if not rows:
        return
    place = RUNS.index(10)
    counts = sorted(row.needed[place] for row in rows)
    text = (
        f"A difference of {100 * DIFFERENCE:.0f}{NARROW_SPACE}% between two methods would be seen "
        f"with {counts[len(counts) // 2]} instances of 10 runs for half of the pairs of methods "
        f"(fewest {counts[0]}, most {counts[-1]})"
    )
    own = next((row for row in rows if {row.first, row.second} == {EC3, EC4}), None)
    if own is not None:
        text += (
            f"; between EC4 and EC3 with {own.needed[place]}, with {own.needed[0]} of one run, "
            f"with {own.needed[-1]} of {RUNS[-1]}"
        )
    yield escaped(f"{text}.")


def _share(found: Inference, sign: str = "") -> str:
    """In per cent with its interval."""

    def number(value: float) -> str:
        return typographic(f"{100 * value:{sign}.1f}")

    text = number(found.estimate)
    if found.low < found.high:
        text += f" [{number(found.low)}, {number(found.high)}]"
    return f"{text}{NARROW_SPACE}%"
