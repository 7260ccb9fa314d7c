"""Every signature of coarticulation: how it is measured, what it says, where it is shown.

To add one: a function that computes it, in the file of its concept, a measure of it
(:mod:`~.within` one method's runs on one task, :mod:`~.between` tasks), and a row here. Rows are
in the order of ``signatures.csv``.
"""

from __future__ import annotations

from operator import attrgetter

from analysis.signatures import between, other_arm, within
from analysis.signatures.rows import Signature

MIXED = "length unit, rad"
PER_DIMENSION = ", per root of dimension"
_AGAINST_INITIAL = attrgetter("against_initial")
_AGAINST_SAME_HANDS = attrgetter("against_same_hands")

WITHIN = (
    Signature(
        "first subtask against initial",
        within.first_subtask(_AGAINST_INITIAL),
        "ticks",
        "ticks",
        "less those of the initial solution: the corrective process alone with the task's "
        "initial hands",
        "first subtask",
        table="main-signatures",
        digits=1,
        matrix="first subtask (ticks)",
        macro="FirstSubtask",
    ),
    Signature(
        "total against initial",
        within.whole(_AGAINST_INITIAL),
        "ticks",
        "ticks",
        "the same of the whole solution",
        "total",
        table="main-signatures",
        digits=1,
        matrix="total (ticks)",
    ),
    Signature(
        "first subtask against the same hands",
        within.first_subtask(_AGAINST_SAME_HANDS),
        "ticks",
        "ticks",
        "less those of the corrective process alone with the run's own hands, so that a choice "
        "of hand does not count. Positive, and the total negative: the first subtask is "
        "sacrificed for the whole (Shah, Barto & Fagg 2013)",
        "first subtask",
        table="hands",
        digits=1,
    ),
    Signature(
        "total against the same hands",
        within.whole(_AGAINST_SAME_HANDS),
        "ticks",
        "ticks",
        "the same of the whole solution",
        "total",
        table="hands",
        digits=1,
    ),
    Signature(
        "first subtask sacrificed",
        within.sacrificed,
        "1",
        "share of runs",
        "with the same hands, longer by more than one tick (what a planned movement can lose to "
        "rounding) while the whole is shorter. p: that in the mean over runs both are so, the "
        "larger of two one-tailed bootstrap tests (intersection-union test, Berger 1982)",
        "sacrificed",
        table="main-signatures",
    ),
    Signature(
        "subtask against isolated reach",
        within.against_isolated_reach,
        "ticks",
        "ticks, by goal",
        "positive: done worse than the corrective process does it from the same posture, with "
        "the better hand",
        "against isolated reach",
        table="main-signatures",
        digits=1,
        matrix="against isolated reach (ticks)",
    ),
    Signature(
        "hand entropy",
        within.hand_entropy,
        "bit",
        "bit, 0 to min(G, log₂ runs)",
        "spread of hand sequences over runs; biased downwards for few",
        "hand entropy",
        table="main-signatures",
        matrix="hand entropy (bit)",
    ),
    Signature(
        "hand as in isolation",
        within.as_in_isolation,
        "1",
        "share of runs, by goal",
        "runs that hit it with the hand that is quickest for it by itself; 0: the hand is "
        "chosen for other goals than its own",
        "as in isolation",
        table="hands",
        matrix="hand as in isolation (share)",
    ),
    Signature(
        "hands as the best corrective ones",
        within.as_the_best_corrective,
        "1",
        "share of runs",
        "agreement with the exhaustive search",
        "hands as corrective",
        table="main-signatures",
    ),
    Signature(
        "preshaping of the other arm",
        within.nearer_than_initially(other_arm.preshaping),
        "1",
        "−∞ to 1, by goal",
        "1: the other hand is at its next goal already; 0: no nearer than in the initial "
        "solution. Base and arm both count",
        "all",
        table="other-arm",
        matrix="preshaping",
    ),
    Signature(
        "preshaping seen from the base",
        within.nearer_than_initially(other_arm.preshaping_from_base),
        "1",
        "−∞ to 1, by goal",
        "the same with the base where it is in the initial solution: what lies in the arm's "
        "joints, including the posture that its own last hit left; the rest takes the base",
        "from the base",
        table="other-arm",
    ),
    Signature(
        "preshaping since its last hit",
        within.nearer_than_initially(other_arm.preshaping_since_hit),
        "1",
        "−∞ to ∞, by goal",
        "what the arm did of it while it waited: 0 where it keeps still (EC1 to EC3), whatever "
        "the base does",
        "since its hit",
        table="other-arm",
    ),
    Signature(
        "travel of the other arm",
        within.travel_of_the_other_arm,
        "rad",
        "rad, ≥ 0, by goal",
        "joint travel, hit to hit",
        "other arm's travel",
        table="travel",
        matrix="other arm's travel (rad)",
    ),
    Signature(
        "base reversals",
        within.base_reversals,
        "1",
        "count, ≥ 0, by coordinate",
        "changes of direction by more than 0.01",
        "reversals",
        table="main-signatures",
        matrix="base reversals",
    ),
    Signature(
        "turning angle",
        within.turning,
        "rad",
        "rad, 0 to π, by goal",
        "between the joint-space displacements to and from a goal",
        "turn",
        table="main-signatures",
        digits=3,
        matrix="turning angle (rad)",
    ),
    Signature(
        "hand path SPARC",
        within.smooth,
        "1",
        "−∞ to 0",
        "smoothness (Balasubramanian et al. 2015). **Nearly degenerate here**, as is the jerk: "
        "solutions are straight in joint space at constant speed. Between methods only",
        "SPARC",
        table="main-signatures",
        matrix="SPARC",
        sources=("balasubramanian2015",),
    ),
    Signature(
        "hand path log dimensionless jerk",
        within.smooth,
        "1",
        "−∞ to ∞",
        "smoothness (Hogan & Sternad 2009), larger is smoother",
        "log jerk",
        table="main-signatures",
        matrix="log jerk",
        sources=("hogan2009", "balasubramanian2015"),
    ),
    Signature(
        "V_ucm",
        within.synergies,
        f"squared ({MIXED})",
        "squared units per dimension, ≥ 0, by goal",
        "variance over runs within the uncontrolled manifold (Scholz & Schöner 1999); runs with "
        "the commonest hand sequence",
        "V_ucm",
        table="variance",
        digits=None,
        sources=("scholz1999",),
    ),
    Signature(
        "V_ort",
        within.synergies,
        f"squared ({MIXED})",
        "squared units per dimension, ≥ 0, by goal",
        "variance orthogonal to it",
        "V_ort",
        table="variance",
        digits=None,
        sources=("scholz1999",),
    ),
    Signature(
        "ΔV",
        within.synergies,
        "1",
        "−n/d_ort to n/d_ucm, by goal",
        "(V_ucm − V_ort)/V_tot. A hit confines the hand to the goal's disc: near its bound for "
        "every method",
        "ΔV",
        table="variance",
        sources=("scholz1999",),
    ),
    Signature(
        "ΔV z",
        within.synergies,
        "1",
        "−∞ to ∞, neutral at ½ ln(d_ucm/d_ort), by goal",
        "½ ln[(n/d_ort + ΔV)/(n/d_ucm − ΔV)] (Verrel 2010); jackknife interval and test against "
        "neutral (Miller 1974)",
        "ΔV z",
        table="synergy",
        matrix="ΔV z",
        sources=("verrel2010", "miller1974"),
    ),
)
"""Of one method's runs on one task."""

CONTEXTS = (
    Signature(
        "context distance",
        between.context_distance,
        MIXED,
        "length unit and rad mixed, ≥ 0",
        "between mean postures at the same goal before different successors",
        "distance",
        table="contexts",
        digits=3,
        matrix="context distance",
        macro="ContextDistance",
    ),
    Signature(
        "context dependence",
        between.dependence,
        "pooled SD",
        "pooled within-context SD, ≥ 0",
        "the same, standardised; permutation test over runs. Expected square without effect "
        "1/n₁ + 1/n₂",
        "dependence",
        table="contexts",
        matrix="context dependence (SD)",
        macro="ContextDependence",
    ),
    Signature(
        "motor-equivalent part",
        between.parts,
        MIXED + PER_DIMENSION,
        "as the distance, per root of dimension",
        "the part of that difference that leaves the hand in place (Mattos, Latash and "
        "colleagues)",
        "motor-equivalent",
        table="contexts",
        digits=3,
        matrix="motor-equivalent",
        macro="MotorEquivalent",
    ),
    Signature(
        "non-motor-equivalent part",
        between.parts,
        MIXED + PER_DIMENSION,
        "as the distance, per root of dimension",
        "the part that moves the hand",
        "non-motor-equivalent",
        table="contexts",
        digits=3,
        matrix="moves the hand",
        macro="NonMotorEquivalent",
    ),
    Signature(
        "lead time",
        between.lead,
        "ticks",
        "ticks, ≥ 0",
        "how long before the hit contexts are distinguishable at every tick (after Engel, "
        "Flanders & Soechting 1997). Straight movements from a common start part at once, so "
        "that it is the whole movement wherever there is an effect",
        "lead",
        table="contexts",
        digits=0,
        sources=("engel1997",),
    ),
)
"""Of one goal in two contexts."""

FAMILIES = (
    Signature(
        "locus slope",
        between.slopes,
        "rad per length unit",
        "rad or length unit per length unit, by joint",
        "mean posture at goal g against the position of goal g + 1 (anticipatory) or g − 1 "
        "(carry-over), where at least three tasks of the folder differ in that goal only (after "
        "Lindblom 1963; Sussman, McCaffrey & Matthews 1991). Positions − 2 degrees of freedom, "
        "however many runs there are of each; tasks that are the same but for their name are "
        "one position",
        "slope",
        table="slopes",
        digits=3,
        sources=("sussman1991",),
    ),
    Signature(
        "locus slope norm",
        between.slopes,
        f"{MIXED}, per length unit",
        "mixed, per length unit, ≥ 0",
        "length of the vector of all joints' slopes. Permutation test over positions; with six "
        "p is at least 0.0028",
        "norm",
        table="slopes",
        digits=3,
    ),
)
"""Of tasks that differ in one goal."""

REGISTER = {signature.name: signature for signature in (*WITHIN, *CONTEXTS, *FAMILIES)}
"""All signatures by name."""
