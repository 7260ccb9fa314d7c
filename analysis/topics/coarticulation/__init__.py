"""How movements depend on the goals around them: contexts, signatures."""
