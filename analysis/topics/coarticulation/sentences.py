"""What was found about coarticulation, in sentences."""

from __future__ import annotations

from coartic.analysis.section import Section

COARTICULATION = Section(
    "coarticulation",
    short="Coarticulation",
    title="Does the next goal change the movement?",
    caption="Postures at a goal that two tasks share before they differ",
    figure="postures",
    table="contexts",
    note=(
        "Postures are compared in length units and rad. Random guesses are a placebo: they learn "
        "nothing, and the best of many is selected. Lead: how many ticks before the hit the two "
        "movements begin to differ."
    ),
    single=True,
)

SIGNATURES = Section(
    "signatures",
    short="Signatures",
    title="Which signatures of coarticulation does each method show?",
    caption="Signatures of coarticulation, means over goals and runs",
    table="signatures",
    note=(
        "Ticks are compared with those of the corrective process with the same hands. A first "
        "movement that gets slower while the whole task gets faster is sacrificed for it. Waiting"
        " hand nearer: the share of the distance to its next goal that a hand covers while it "
        "waits. The CSV file has tests against random guesses."
    ),
    single=True,
)

SLOPES = Section(
    "slopes",
    short="Moved goals",
    title="How does the posture follow a goal that moves?",
    caption="Slopes of postures at the goal beside the one that moves",
    table="slopes",
    note=("Slopes are in length units and rad of the posture per length unit that the goal moves."),
    single=True,
)
