"""Tasks, their names, families of random tasks, and best known rewards.

This package imports the robot and its motion, but no method.
"""
