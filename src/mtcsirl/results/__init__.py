"""What came of the runs: tidy rows, statistics, correlations, the paper's numbers."""
