"""Runs as they are planned and stored. The room knows a method by its name, version and
parameters, not how it works."""
