"""What the server from which worker processes are forked does once: it imports the compiler, and
keeps its standard error stream apart. A worker that begins while its parent ends prints no
traceback; :func:`show_errors` gives a worker the stream back."""

import os

from coartic.motion.compile import import_numba

import_numba()
_ERRORS = os.dup(2)
_nobody = os.open(os.devnull, os.O_WRONLY)
os.dup2(_nobody, 2)
os.close(_nobody)


def show_errors() -> None:
    """Connect this process to the standard error stream of the server."""
    os.dup2(_ERRORS, 2)
