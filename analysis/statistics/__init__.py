"""Estimates with intervals, tests, and equivalence; docs/statistics.md says which is used where."""
