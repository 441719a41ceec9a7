"""Thousands of variants of a scenario: planned by index, run in batches on all cores, kept as a Parquet file.

`plan` says which runs there are, each known by its index, with `sobol` for points that fill a cube evenly;
`columns` says what a row has, `shards` makes rows of some runs, `crew` has threads do so and `cluster` other
machines, to which a `parcel` goes; `dataset` keeps the rows on disk, `summary` and `records` look at them,
and `sweep` is all of it together.
"""
