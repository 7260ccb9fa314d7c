"""Compiled kernels of motion. Only doors of ``coartic.motion``, the learner's kernel and posture-
based planning read them."""
