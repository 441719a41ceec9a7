"""Variants of a scenario, run: one to files, a few beside each other, thousands as rows of a Parquet file.

`run` is one scenario from file to files, and `compare` a few variants as one batch. For thousands, `plan`
says which runs there are, each known by its index, with `sobol` for points that fill a cube evenly;
`columns` says what a row has, `shards` makes rows of some runs, `executors` has threads do so and `dask`
other machines, to which a `bundle` goes; `dataset` keeps the rows on disk, `summary` and `picks` look at
them, and `sweep` is all of it together.
"""
