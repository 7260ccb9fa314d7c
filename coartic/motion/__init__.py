"""Motion of the robot: kernels, the corrective process, trials, and execution of solutions."""
