"""Do our own tests and intervals hold what they promise? Simulations, run as commands."""
