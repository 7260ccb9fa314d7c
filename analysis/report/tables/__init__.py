"""The tables that several pages share: frames of the analysis as tables that know their cells.

To add one: a section of ``tables.toml``, which says what it has beside values, a function that
makes its rows, and its call where it is shown (:mod:`coartic.analysis.report.build`).
"""
