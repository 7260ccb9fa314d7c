"""Compiled kernels of motion, used by ``coartic.motion``, the learner and posture planning."""
