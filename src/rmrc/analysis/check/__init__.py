"""Whether a model is ready to be used: its errors, missing data, and assumptions about it."""
