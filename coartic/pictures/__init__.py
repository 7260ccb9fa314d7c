"""Pictures of the robot, movements tick by tick, and films of them. They know executed solutions,
not who found them."""
