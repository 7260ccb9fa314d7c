"""What stored runs say: comparisons and figures. Imports ``coartic`` and reads records.

``analysis.load(folder)`` reads a results folder.
"""

from analysis.study import Study, load

__all__ = ["Study", "load"]
