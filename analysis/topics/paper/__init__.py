"""What the paper prints and claims, and what these runs say of it."""
