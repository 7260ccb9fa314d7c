"""A good task file, of which bad ones are made."""

GOOD = """
name = "mine"
goals = [[5.0, 1.0], [5.0, 2.0]]
initial_hands = "RR"

[start]
base = [0.0, 0.0]
left = [0.0, 0.0, 0.0, 0.0]
right = [0.0, 0.0, 0.0, 0.0]
"""
