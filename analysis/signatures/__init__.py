"""Signatures of coarticulation: how a method's solutions move, beyond their reward.

:mod:`~.measures` gives one number for each run, :mod:`~.two_contexts` compares the runs of two
tasks.
"""
