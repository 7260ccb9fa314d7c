"""Internal code that the packages share: limits, messages, files and processes.

The modules here do not import tasks, robots or methods.
"""
