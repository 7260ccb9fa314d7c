"""The worlds of study worlds, each with one thing that differs from the paper's."""

from typing import Any, NamedTuple


class World(NamedTuple):
    """A world: constants of its model, radius of the goals, and trials of a run."""

    name: str
    """Name of its folder, and in tables."""
    title: str
    """What differs from the paper's world, on the page."""
    model: dict[str, Any]
    """Constants of the model that differ from the paper's."""
    radius: float | None = None
    """Radius of all goals (in length units); a tenth of it is the tolerance of arrival and of
    correction. None leaves it as it is: 0.1."""
    trials: int = 10_000


WORLDS = {
    world.name: world
    for world in (
        World("paper", "the paper's", {}),
        World("maximum", "maximum norm", {"norm": "maximum"}),
        World("noise-0.01", "motor noise 0.01", {"motor_noise": 0.01}),
        World("base-0.25", "base weight 1/4", {"base_weight": 0.25}),
        World("base-4", "base weight 4", {"base_weight": 4.0}),
        World("radius-0.02", "radius 0.02", {}, 0.02),
        World("radius-0.3", "radius 0.3", {}, 0.3),
        World("base-0.5", "base weight 1/2", {"base_weight": 0.5}),
        World("base-2", "base weight 2", {"base_weight": 2.0}),
        World("radius-0.05", "radius 0.05", {}, 0.05),
    )
}
"""Worlds by name, in the order in which they are run."""
LONG = World("radius-0.02-long", "radius 0.02, 100,000 trials", {}, 0.02, 100_000)
"""A world that is described, not judged."""
CONTROL, CONTROL_OF_PAIRS = "control", "control-pairs"
"""Names of the folders of the planted control, on random tasks and on pairs of tasks."""
CONTROL_SETS = 100
"""Sets of runs of random search that take the learner's place. The runs of a set have numbers after
those of the runs with which the study compares the learner: one on each random task, and
:data:`RUNS_OF_PAIRS` on each task of a pair."""
CONTROL_SETS_OF_PAIRS = 99
"""The same for pairs of tasks. A hundred were registered; a study executes 500 runs of a method on
a task, and the first five are those with which the learner is compared."""
PAPER = ("ascending", "descending", "two-armed-1", "two-armed-2")
FAMILIES = ("one-armed", "two-armed", "aligned")
INSTANCES = "i200..i219"
STAGES = ("one-run", "families", "hill-climbing", "paper")
"""Parts of a world's runs, in the order in which they are made in all worlds."""
RUNS = {"one-run": 1, "families": 3, "paper": 20}
"""Runs of a method on a task of the paper, and on a random one, where CMA-ES has one run."""
RUNS_OF_PAIRS = 5
FULL_AT_FIRST = ("paper", "maximum")
"""Worlds whose random tasks had all runs when the matrix was first made; the others had one."""
