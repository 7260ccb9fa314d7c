"""Nine worlds: three levels of motor noise, both norms, and weights of the base by lot."""

import numpy as np

from coartic import MotionModel

_LOT = np.random.default_rng(2)
_SHORT = {"max_iterations": 150, "gain": 0.06, "correction_tolerance": 0.08}
"""Corrections that take longer fail, so that tests are quick."""
WORLDS = [
    MotionModel(
        motor_noise=motor_noise,
        norm=norm or str(_LOT.choice(["euclidean", "maximum"])),
        base_weight=float(_LOT.choice([0.25, 1.0, 4.0])),
        **_SHORT,
    )
    for motor_noise in (0.0, 0.01, 0.03)
    for norm in ("euclidean", "maximum", None)
]


def named(model):
    """Name of a world for a test's id."""
    return f"{model.motor_noise}-{model.norm}-{model.base_weight}"
