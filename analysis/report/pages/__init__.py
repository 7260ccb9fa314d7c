"""The pages of ``coartic analyse``: documents of the report's tables, with what explains them."""
