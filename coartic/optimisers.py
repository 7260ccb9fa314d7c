"""Former name of :mod:`coartic.method.optimisers`, until the next version."""

from coartic.internal.lazy import moved

moved(__name__, "coartic.method.optimisers")
