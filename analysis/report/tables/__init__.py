"""The report's tables: frames of the analysis as tables that know their cells."""

from analysis.report.tables.claims import claims_table
from analysis.report.tables.common import table_ids
from analysis.report.tables.contexts import contexts_table, slopes_tables
from analysis.report.tables.cost import (
    READING_OF_COST,
    areas_table,
    pareto_table,
    targets_table,
)
from analysis.report.tables.methods import methods_table, overall_table, reading_of_methods
from analysis.report.tables.pairs import cost_table, pairwise_table, reading_of_pairs
from analysis.report.tables.paper import exhaustive_table, published_table, sequences_table
from analysis.report.tables.signatures import signatures_tables

__all__ = [
    "READING_OF_COST",
    "areas_table",
    "claims_table",
    "contexts_table",
    "cost_table",
    "exhaustive_table",
    "methods_table",
    "overall_table",
    "pairwise_table",
    "pareto_table",
    "published_table",
    "reading_of_methods",
    "reading_of_pairs",
    "sequences_table",
    "signatures_tables",
    "slopes_tables",
    "table_ids",
    "targets_table",
]
