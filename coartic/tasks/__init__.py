"""Tasks: what they are, by which names they go, and families of random ones."""
