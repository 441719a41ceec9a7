"""Runs of scenario variants: one to files, a few side by side, thousands as rows of a Parquet file.

`study` prepares and runs variants. `batch` runs a few variants and writes files: `run` for one scenario,
`compare` for its variants. For thousands of runs, `plan` lists the runs by index, with `sobol` for evenly
distributed points; `runs` checks and runs them in one process, and `dask` in others, which receive all files;
`rows` names the columns, `dataset` stores the rows on disk, `swept` sums them up, and `sweep` combines this.
"""
