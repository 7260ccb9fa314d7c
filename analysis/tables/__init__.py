"""The tables of the report, by section of the page.

:data:`TABLES` maps the id of each table to the table (:mod:`coartic.analysis.tables.language`).
"""

# isort: off
# TABLES has the order of these imports, which is that of the page.

from coartic.analysis.tables.language import (
    SHORT_ID,
    TABLES,
    Column,
    ShownColumn,
    Table,
    caption_of,
    column_of,
    csv_of,
    csv_of_worlds,
    html_of,
    is_setting,
    latex_of,
    number_text,
    shown_columns,
    table,
)
from coartic.analysis.tables.questions import (
    answer_lines,
    list_contrasts,
    matrix_of,
    needs_executions,
)
from coartic.analysis.tables.ranking import (
    ValueOfParameter,
    gaps_of_settings,
    list_differences,
    list_not_ranked,
    list_parameters,
    list_ranking,
    values_of_parameters,
)
from coartic.analysis.tables.coarticulation import (
    ROUNDING,
    list_contexts,
    list_saved,
    list_signatures,
)
from coartic.analysis.tables.cost import BUDGETS, COSTS, list_learning, list_runtimes
from coartic.analysis.tables.random_tasks import gaps_by_family, instance_runs, list_family_gaps
from coartic.analysis.tables.listings import list_failed, list_methods, list_tasks
# isort: on

SOLUTIONS_ONLY = frozenset(table.id for table in (list_contexts, list_signatures, list_saved))
"""Ids of the tables about solutions, which are not known after some trials of a run."""

__all__ = [
    "BUDGETS",
    "COSTS",
    "ROUNDING",
    "SHORT_ID",
    "SOLUTIONS_ONLY",
    "TABLES",
    "Column",
    "ShownColumn",
    "Table",
    "ValueOfParameter",
    "answer_lines",
    "caption_of",
    "column_of",
    "csv_of",
    "csv_of_worlds",
    "gaps_by_family",
    "gaps_of_settings",
    "html_of",
    "instance_runs",
    "is_setting",
    "latex_of",
    "list_contexts",
    "list_contrasts",
    "list_differences",
    "list_failed",
    "list_family_gaps",
    "list_learning",
    "list_methods",
    "list_not_ranked",
    "list_parameters",
    "list_ranking",
    "list_runtimes",
    "list_saved",
    "list_signatures",
    "list_tasks",
    "matrix_of",
    "needs_executions",
    "number_text",
    "shown_columns",
    "table",
    "values_of_parameters",
]
