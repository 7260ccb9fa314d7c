"""The report's tables: each is a function of a study that returns a DataFrame.

The index names the rows, ``run_ids`` the runs behind each. A column that ends in ``_low``,
``_high`` or ``_sd`` belongs to the one before. A table that the runs do not allow is empty.

To add one, write a function with the decorator :func:`~.table.table` in a module of this package.
"""

from importlib import import_module
from pkgutil import iter_modules

from coartic.analysis.tables.coarticulation import all_signatures, contexts, signatures, slopes
from coartic.analysis.tables.comparison import learning, methods, price, ranking, variants
from coartic.analysis.tables.families import exploration, family_gaps, family_signs
from coartic.analysis.tables.paper import claims, hands, published, tasks
from coartic.analysis.tables.table import COLUMNS, TABLES, Column

for _module in iter_modules(__path__, f"{__name__}."):
    import_module(_module.name)

__all__ = [
    "COLUMNS", "TABLES", "Column", "all_signatures", "claims", "contexts", "exploration",
    "family_gaps", "family_signs", "hands", "learning", "methods", "price", "published",
    "ranking", "signatures", "slopes", "tasks", "variants",
]  # fmt: skip
