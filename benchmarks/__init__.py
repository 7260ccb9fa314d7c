"""Suites, the runner, and the records it keeps. Imports ``coartic`` and ``baselines``."""
