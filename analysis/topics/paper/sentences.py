"""What became of the paper's rewards and claims, in sentences."""

from __future__ import annotations

from coartic.analysis.section import Section

PAPER = Section(
    "paper",
    short="Paper",
    title="Are the paper's rewards reproduced?",
    caption="Learned rewards, published and ours (ticks)",
    figure="published",
    table="published",
    note=(
        "EC1 to EC4 are the paper's exploration conditions. EC1 explores the right arm only, EC2 "
        "both arms with the closest hand, EC3 the choice of hand as well but not the waiting arm,"
        " EC4 all of these. LRLR means left, right, left, right hand. † marks tasks whose goals "
        "the paper does not print: these rewards helped to choose ours, so their agreement is no "
        "evidence."
    ),
    single=True,
)

CLAIMS = Section(
    "claims",
    short="Claims",
    title="Do the claims hold?",
    caption="Claims; open one to see its evidence",
    table="claims",
    note=(
        "p is corrected for the number of claims (Holm). Some claims of the paper rest on goals "
        "that it does not print: the third column says in how many of the sets of goals that fit "
        "its text a claim holds. A claim that our goals support, but at most half of these sets, "
        "depends on the goals. Rewards are those of the best trial of a run; a replay makes what "
        "was learned once more, without noise and exploration."
    ),
)

HANDS = Section(
    "hands",
    short="Hands",
    title="Which hands are chosen?",
    caption="Learned rewards by hand sequence, published and ours (ticks)",
    figure="recruitment",
    table="hands",
    single=True,
)
