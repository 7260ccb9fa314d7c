"""Signatures of coarticulation: how a method's solutions move, beyond their reward.

One concept a file; each signature is a pure function of arrays or of tick-by-tick
trajectories. :func:`signatures_frame` applies them all to a results folder.
"""

from analysis.signatures.register import signatures_frame

__all__ = ["signatures_frame"]
