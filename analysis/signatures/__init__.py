"""Signatures of coarticulation in the movements of solutions.

:mod:`~.measures` computes a number for each run, :mod:`~.two_contexts` compares the runs of two
tasks by the tests in :mod:`~.context_tests`.
"""
