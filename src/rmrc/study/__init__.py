"""Variants of a scenario, run: one to files, a few beside each other, thousands as rows of a Parquet file.

`study` prepares variants, checks them and runs them in pieces, whoever asks; `executors` has threads work on
the pieces, and `dask` other machines, to which a `parcel` goes. `batch` runs a few of them and leaves files:
`run` one scenario, and `compare` its variants. For thousands, `plan` says which runs there are, each known by
its index, with `sobol` for points that fill a cube evenly; `rows` makes a row of what came of each, `dataset`
keeps the rows on disk, `summary` and `picks` look at them, and `sweep` is all of it together.
"""
