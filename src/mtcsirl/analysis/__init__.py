"""From tidy rows to statistics, correlations and verdicts."""
