"""What a run gave: its columns, the running sums of them, the scorecard, and what goes into files."""
