"""Statistics of the report: means with intervals, tests, equivalence (docs/statistics.md)."""
