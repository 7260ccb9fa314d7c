"""Tasks, the names under which they are found, and families of random tasks.

This package imports the robot and its motion, but no method.
"""
