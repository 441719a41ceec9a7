"""Results of a run: columns, running sums, the scorecard, and files."""
