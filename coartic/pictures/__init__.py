"""Pictures of the robot, movements tick by tick, and films of them."""
