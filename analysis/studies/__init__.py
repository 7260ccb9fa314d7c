"""Studies of our own: each a suite, a few functions, a figure and claims."""
