"""The dual-process learner.

This package imports tasks, motion and the base class of methods, but no other method.
"""
