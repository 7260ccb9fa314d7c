"""A valid task file, from which tests make invalid ones."""

GOOD = """
name = "mine"
goals = [[5.0, 1.0], [5.0, 2.0]]
initial_hands = "RR"

[start]
base = [0.0, 0.0]
left = [0.0, 0.0, 0.0, 0.0]
right = [0.0, 0.0, 0.0, 0.0]
"""
