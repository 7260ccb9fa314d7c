"""What was found on random tasks, in sentences."""

from __future__ import annotations

from coartic.analysis.section import Section

FAMILIES = Section(
    "families",
    short="Random tasks",
    title="What holds on random tasks?",
    caption="Gap to the best known reward, in per cent of it: mean over instances",
    figure="gaps-by-family",
    table="family-gaps",
)

EXPLORATION = Section(
    "exploration",
    short="Exploration",
    title="Does more exploration pay on random tasks?",
    caption="More exploration against less, in per cent of the best known reward",
    table="exploration",
    note=(
        "By hands: the part of the gain that comes from the hand sequences, if each run had the "
        "best reward that is known for its hands."
    ),
)

SIGNS = Section(
    "signs",
    short="Signs",
    title="Does coarticulation show on random tasks?",
    caption="Signs of coarticulation over instances",
    table="family-signs",
)
