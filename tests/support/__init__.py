"""Functions that test modules share: suites that are run, processes, and made-up studies."""
