"""Code that runs once, in the server from which worker processes are forked.

It imports the compiler. It also disconnects the standard error stream, so that a worker that starts
while its parent ends does not print a traceback. :func:`show_errors` connects the stream again.
"""

import os

from coartic.motion.kernels.compile import import_numba

import_numba()
_ERRORS = os.dup(2)
_nobody = os.open(os.devnull, os.O_WRONLY)
os.dup2(_nobody, 2)
os.close(_nobody)


def show_errors() -> None:
    """Connect this process to the standard error stream of the server."""
    os.dup2(_ERRORS, 2)
