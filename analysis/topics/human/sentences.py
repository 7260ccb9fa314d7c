"""What was found about models beside people, in sentences."""

from __future__ import annotations

from coartic.analysis.section import Section

HUMAN = Section(
    "human",
    short="People",
    title="Do the models behave like people?",
    caption="Findings about people, and which models agree with them",
    figure="human",
    table="human",
    note=(
        "Each finding is put to the robot as an inequality that was written down before any model"
        " was judged (analysis/topics/human/human.toml). A model agrees or disagrees where the "
        "whole interval over tasks lies on one side of the bound. Silent: nothing follows for the"
        " model; table human-effects says why. * The verdict follows from how the model is built."
        " Models whose solution is picked from trials agree only beyond random guesses. There is "
        "no total score: a row that tells models apart is worth more than a sum."
    ),
)
