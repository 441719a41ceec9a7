"""Thousands of variants of a scenario: planned by index, run in batches on all cores, kept as a Parquet file."""
