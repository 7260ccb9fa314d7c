"""Signatures of coarticulation: how a method's solutions move, beyond their reward.

:mod:`~.register` has them all; the other files have what they are computed from.
"""
