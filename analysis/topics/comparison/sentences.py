"""What was found about methods beside each other, in sentences."""

from __future__ import annotations

from coartic.analysis.section import Section

NEAREST = Section(
    "nearest",
    short="Ranking",
    title="Who comes nearest to the optimum?",
    caption=(
        "Gap to the optimum or, where it is not proven, to the best known reward, in per cent of it"
    ),
    figure="ranking",
    table="ranking",
    note=(
        "Methods are grouped by what they are told and use of the reward: that of each trial "
        "after making it, the formula, or nothing. Intervals are about other runs on these tasks."
        " Better on, worse on: the number of tasks on which the mean reward differs significantly"
        " from that of the paper's learner (EC1 with one arm, EC4 with two), by two-tailed "
        "bootstrap tests that are corrected for the tasks of the method (table against-learner). "
        "Empty: too few runs to tell."
    ),
    single=True,
)

PRICE = Section(
    "price",
    short="Cost",
    title="What does it cost?",
    caption="What it takes to reach a quarter and half of the targets",
    figure="price",
    table="price",
    note=(
        "Kinematics: how often a method computes where the hand is in a posture, a cost of "
        "computing that does not depend on the machine. ∞: not reached within the budget of "
        "trials."
    ),
    single=True,
)

LEARNING = Section(
    "learning",
    short="Learning",
    title="How fast is it learned?",
    caption="Best reward so far, mean over runs (ticks)",
    figure="learning-curves",
    table="learning",
    note="The gain is that on the initial solution. ∞: the run gains nothing.",
    single=True,
)

METHODS = Section(
    "methods",
    short="All methods",
    title="What did every method do on every task?",
    caption="Reward, gap to the optimum, hands and what a run spends (medians)",
    table="methods",
    note=(
        "Every method works on the same robot. Its movements are executed and scored by one "
        "function, which it does not see. Times are seconds of solving."
    ),
    single=True,
)
