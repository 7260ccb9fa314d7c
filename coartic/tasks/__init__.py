"""Tasks: what they are, by which names they go, and families of random ones. They know the robot,
and nothing that solves them."""
