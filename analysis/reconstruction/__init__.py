"""What the paper does not print of the two-armed tasks: searched, scored, kept as an ensemble."""
