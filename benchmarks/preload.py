"""The compiler, imported once by the server from which worker processes are forked."""

from coartic.motion.compile import import_numba

import_numba()
