"""Former name of :mod:`coartic.pictures.film`, until the next version."""

from coartic.internal.lazy import moved

moved(__name__, "coartic.pictures.film")
