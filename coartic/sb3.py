"""Former name of :mod:`coartic.gym.stable_baselines`, until the next version."""

from coartic.internal.lazy import moved

moved(__name__, "coartic.gym.stable_baselines")
