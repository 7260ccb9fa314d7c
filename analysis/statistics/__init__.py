"""Statistics of the report: means with intervals, tests, running times (docs/statistics.md)."""
