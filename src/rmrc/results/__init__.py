"""Results of a run: columns, metrics, the scorecard, and files."""
