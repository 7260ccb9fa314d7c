"""Pages of ``coartic analyse``: documents of the report's tables."""
