"""Define the settings of the learner, with exploration that leans towards the next goal or not.

On the *dial*, exploration leans further and further towards the next goal.
"""

from coartic import CONDITIONS

FAMILIES = ("one-armed", "two-armed", "aligned", "redundancy", "long")
DRIFTS, NOISES = (0.03, 0.1, 0.3, 1.0), (0.01, 0.05)
TRIALS, RUNS, AFTER = 10_000, 3, (30, 100, 1_000, 10_000)
DIAL = ("0 0.05", *(f"{kappa:g} 0.05 next-goal" for kappa in DRIFTS))
"""The dial: settings with the paper's noise and different drifts towards the next goal."""
PAPER, INFORMED, PLANNER = "0 0.05", "0.3 0.05 next-goal", "1 0.01 next-goal"
"""Settings that claims compare."""
SETTINGS = {
    **{f"0 {sigma}": {"noise_sd": sigma} for sigma in NOISES},
    **{
        f"{kappa:g} {sigma} {direction}": {
            "drift": kappa, "noise_sd": sigma, "direction": direction
        }
        for kappa in DRIFTS for sigma in NOISES for direction in ("next-goal", "stay", "start")
    },
    "1 0": {"drift": 1.0, "noise_sd": 0.0},
    "correction": {"pull": 0.05},
    "hands": {"hand_exploration": "nearest-posture"},
    "all": {"drift": 0.3, "pull": 0.05, "hand_exploration": "nearest-posture"},
    "drawn": {"drift": (0.0, *DRIFTS)},
}  # fmt: skip
"""Fields that differ from the paper's condition (:func:`base_of`)."""
FEW = 1_000
"""Number of trials of settings that are not in :data:`LONG`."""
LONG = (*DIAL, PLANNER, "1 0", "1 0.05 start", "hands", "drawn", "all")
"""Settings with :data:`TRIALS` trials: the dial, and settings whose final gain is compared."""

LESS_NOISE = {"noise_sd": 0.01, "epsilon": 0.4}
NAMED = {
    "paper": {},
    "informed": {"drift": 1.0},
    "drift 1, noise 0.01, epsilon 0.4": {"drift": 1.0, **LESS_NOISE},
    "no drift, noise 0.01, epsilon 0.4": LESS_NOISE,
}
"""Named settings, which are measured on the paper's tasks. Fields are as in :data:`SETTINGS`."""


def base_of(task):
    """Return the paper's condition that explores most on a task: EC1 for one arm, EC4 for two."""
    return CONDITIONS["EC1" if len(task.hands) == 1 else "EC4"]
