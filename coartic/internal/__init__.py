"""Internal code that the packages share: limits, messages, files and processes.

It does not import tasks, robots or methods.
"""
