"""The figures. Each is drawn by a function of a study, in :data:`FIGURES` by its id.

To add one, write a function with the decorator :func:`~.plot.figure` in a module of this package.
"""

from importlib import import_module
from pkgutil import iter_modules

from coartic.analysis.figures.plot import FIGURES, Plot, save

for _module in iter_modules(__path__, f"{__name__}."):
    import_module(_module.name)

__all__ = ["FIGURES", "Plot", "save"]
