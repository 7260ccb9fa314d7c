"""Claims of the paper: their words, their tests, and the verdicts on them."""
