"""Declarations of methods, and runs as they are planned and stored.

Only :mod:`~coartic.runs.method_info` imports the code of methods. The other modules use the
declarations.
"""
