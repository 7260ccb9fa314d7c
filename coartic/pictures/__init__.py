"""Pictures of the robot, movements tick by tick, and films of movements. Modules here know executed
solutions, not who found them."""
