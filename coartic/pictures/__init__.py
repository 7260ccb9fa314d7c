"""Pictures of the robot, trajectories tick by tick, and films of movements.

Modules here know executed solutions, but not which method found them.
"""
