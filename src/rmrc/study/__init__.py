"""Runs of scenario variants: one to files, a few side by side, thousands as rows of a Parquet file.

`study` prepares and runs variants. `run` runs a scenario, or a few variants of it, and writes files. For
thousands of runs, `plan` lists them by index, `runs` runs some of them on a thread or, by `dask`, on another
machine, `rows` makes one row per result, and `dataset` stores the rows; `sweep` leads all of these. `verbs`
has the functions for users.
"""
