"""Code that runs in the fork server, from which worker processes are forked.

This module imports Numba, so that workers need not import it themselves. It also connects standard
error to the null device, so that a worker that starts while its parent ends does not print a
traceback. :func:`show_errors` undoes this in a worker.
"""

import os

from coartic.motion.kernels.compile import import_numba

import_numba()
_ERRORS = os.dup(2)
_nobody = os.open(os.devnull, os.O_WRONLY)
os.dup2(_nobody, 2)
os.close(_nobody)


def show_errors() -> None:
    """Connect standard error of this process to the one with which the fork server started."""
    os.dup2(_ERRORS, 2)
