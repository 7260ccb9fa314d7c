"""What was found about coarticulation, in sentences."""

from __future__ import annotations

import math

from coartic.analysis.methods import is_variant, name_of
from coartic.analysis.section import Section
from coartic.analysis.signatures.two_contexts import TwoContexts
from coartic.analysis.study import Study
from coartic.analysis.topics.coarticulation import tables
from coartic.analysis.topics.coarticulation.placebo import difference
from coartic.analysis.topics.failed import failed_runs
from coartic.analysis.words import number, p_value, plural


def answer_contexts(study: Study) -> str:
    """Whether the posture at the goal that two tasks share depends on the next goal, in short."""
    found = difference(study)
    if found is None:
        return ""
    shared, placebo = found.contexts, found.placebo
    goal, apart, p = shared.goal, number(shared.apart, 2), p_value(shared.p)
    lie = f"at goal {goal} base and joints lie {apart} apart"
    if found.too_few:
        text = (
            f"Too few runs to tell whether postures at goal {goal} differ by the next goal "
            f"({plural(shared.n, 'run')})."
        )
    elif found.seen:
        guesses = "" if placebo is None else f"; random guesses {number(placebo.apart, 2)}"
        units = f"{apart} in length units and rad{guesses}"
        whose = f"posture of the {name_of(shared.method)}"
        sd = f"by {number(shared.spreads, 1)} standard deviations of the runs, "
        sd = "" if math.isnan(shared.spreads) else sd
        text = (
            f"Yes: at the same goal {goal} the {whose} differs {sd}depending on the next goal "
            f"({', '.join(filter(None, (p, units)))})."
        )
    elif found.differ and placebo is None:
        text = (
            f"Undecided: {lie}, but there is no placebo to compare with. Add the method "
            "placebo/guesses."
        )
    elif found.differ and placebo is not None:
        text = (
            f"Not shown: {lie}, not significantly more than those of random guesses "
            f"({number(placebo.apart, 2)}; {p_value(found.beyond_p)})."
        )
    else:
        text = (
            f"No significant difference: postures of the {name_of(shared.method)} at goal {goal} "
            f"lie {apart} apart{f' ({p})' if p else ''}."
        )
    cells = [(task.name, shared.method) for task in shared.tasks]
    return text + failed_runs(study, cells, " and are not counted")


def finding_of_contexts(study: Study) -> str:
    """How the posture at the goal that two tasks share depends on the next goal."""
    found = difference(study)
    if found is None:
        return ""
    shared, placebo = found.contexts, found.placebo
    goal, method, runs = shared.goal, name_of(shared.method), plural(shared.n, "run")
    p = "" if math.isnan(shared.p) else f", {p_value(shared.p)}"
    if found.too_few:
        return (
            f"There are too few runs to tell whether the postures at goal {goal} differ by which "
            f"goal comes next ({method}, {runs})."
        )
    if not found.differ:
        return (
            f"The postures in which the {method} hits goal {goal} show no significant difference "
            f"by which goal comes next ({runs}{p})."
        )
    spreads = f", {number(shared.spreads, 1)} times the spread between runs"
    replays = [study.replays(task.name, shared.method) for task in shared.tasks]
    replayed = TwoContexts(replays[0], replays[1], goal, shared.hand)
    text = (
        f"Depending on which goal comes next, the hand hits goal {goal} in almost the same place "
        f"({number(shared.hands_apart, 2)} apart) but in another posture: base and joints lie "
        f"{number(shared.apart, 2)} apart (in length units and rad)"
        f"{'' if math.isnan(shared.spreads) else spreads} ({method}, {runs}{p})"
    )
    if all(replayed.runs):
        text += f"; {number(replayed.apart, 2)} in noiseless replays"
    if placebo is not None:
        text += (
            f". The best of as many random guesses lie {number(placebo.apart, 2)} apart, "
            f"{'significantly' if found.seen else 'not significantly'} less "
            f"({p_value(found.beyond_p)})"
        )
    elif found.selects:
        text += (
            ". Whether this is more than selecting one of many noisy trials shows cannot be said: "
            "this folder has no placebo with as many trials"
        )
    return f"{text}."


def finding_of_signatures(study: Study) -> str:
    """In how many methods the next goal changes more of what leaves the hand in place."""
    rows = tables.contexts(study)
    rows = rows[~rows.method.map(is_variant).astype(bool) & (rows.distance > 0.01)]
    if not len(rows):
        return (
            "How the movements of each method compare with those of the corrective process, goal "
            "by goal."
        )
    larger = int((rows.equivalent > rows.other).sum())
    return (
        f"The next goal changes the joints much more than the hand: in {larger} of {len(rows)} "
        "methods (variants left out) the part of the difference that leaves the hand in place is "
        "the larger one."
    )


COARTICULATION = Section(
    "coarticulation",
    short="Coarticulation",
    title="Does the next goal change the movement?",
    caption="Postures at a goal that two tasks share before they differ",
    finding=finding_of_contexts,
    figure="postures",
    table="contexts",
    note=(
        "Postures are compared in length units and rad. Random guesses are a placebo: they learn "
        "nothing, and the best of many is selected."
    ),
    single=True,
)

SIGNATURES = Section(
    "signatures",
    short="Signatures",
    title="Which signatures of coarticulation does each method show?",
    caption="Signatures of coarticulation, means over goals and runs",
    finding=finding_of_signatures,
    table="signatures",
    note=(
        "Ticks are compared with those of the corrective process with the same hands. A first "
        "movement that gets slower while the whole task gets faster is sacrificed for it. Waiting "
        "hand nearer: share of the way to its next goal that a hand covers while waiting. The CSV "
        "file has tests against random guesses."
    ),
    single=True,
)
