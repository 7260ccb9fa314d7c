"""Topics of the analysis: each has its table, figure, sentence and claims in one place."""
