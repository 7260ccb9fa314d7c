"""Pictures of the robot, trajectories tick by tick, and films of movements.

The modules do not use the methods that found the solutions.
"""
