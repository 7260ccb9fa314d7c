"""Motion of the robot: kernels, corrective process, trials, execution of solutions.

This package knows robot, model and task, but not methods.
"""
