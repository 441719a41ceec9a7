"""Runs of scenario variants: one to files, a few side by side, thousands as rows of a Parquet file.

`study` prepares, checks and runs variants in pieces. `executors` distributes the pieces over threads, and
`dask` over other machines, which receive a `parcel`. `run` runs a scenario, or a few variants of it, and writes
files. For thousands of runs, `plan` lists the runs by index, with `sobol`
for evenly distributed points; `rows` makes one row per result, `dataset` stores the rows on disk, `summary`
and `picks` evaluate them, and `sweep` combines all of this.
"""
