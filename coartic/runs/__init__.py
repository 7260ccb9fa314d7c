"""Runs as they are planned and stored.

Modules of this package use a method's name, version and parameters, but not its code.
"""
