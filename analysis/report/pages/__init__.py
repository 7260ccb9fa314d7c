"""The pages of ``coartic analyse``: their tables, with what explains them."""
