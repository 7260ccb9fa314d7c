"""Methods beside each other: gaps, running times, learning curves."""
