"""Statistics: estimates, tests, equivalence, sizes of samples, several tasks together."""
