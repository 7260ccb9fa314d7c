"""Signatures of coarticulation: how a method's solutions move, beyond their reward.

One concept a file; each signature is a pure function of arrays or of tick-by-tick trajectories.
:mod:`~.register` lists them and applies them to a study.
"""
