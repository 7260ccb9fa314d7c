"""Reward against what it costs: anytime curves, targets, Pareto sets."""
