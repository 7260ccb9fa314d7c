"""Motion of the robot: kernels, the corrective process, trials, and execution of solutions. It
knows robot, model and task, and no method."""
