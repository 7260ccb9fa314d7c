"""How movements depend on the goals around them: contexts, moved goals, signatures."""
