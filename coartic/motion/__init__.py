"""How the robot moves: kernels, the corrective process, and execution of solutions."""
