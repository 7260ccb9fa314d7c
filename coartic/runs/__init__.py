"""Runs as they are planned and stored.

Modules here know a method by its name, version and parameters, not how it works.
"""
