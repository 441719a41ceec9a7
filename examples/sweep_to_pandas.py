"""Run many variants of a scenario on all cores, and look at the rows as a table."""

import rmrc

# Each value of a key with each of 8 evenly spread samples of another one: 40 runs.
rows = rmrc.sweep(
    "approach_singularity",
    {"control.inverse.damping.maximum": [0.02, 0.05, 0.1, 0.2, 0.3]},
    sobol={"control.feedback": (5, 40)},
    samples=8,
)
print(f"{rows.num_rows} runs, {rows.num_columns} columns, all complete: {set(rows['status'].to_pylist())}")

# A row has the varied keys, the end of the run and every metric of its scorecard. The table is Arrow's, which
# pandas, polars and duckdb take; its schema has the unit and the meaning of each column.
error = rows.schema.field("position_error.max")
print(f"position_error.max: {error.metadata[b'meaning'].decode()} [{error.metadata[b'unit'].decode()}]")
try:
    frame = rows.to_pandas()
    print(frame.groupby("control.inverse.damping.maximum")["position_error.max"].max())
except ModuleNotFoundError:
    print("pandas is not installed; the same by Arrow:")
    print(rows.group_by("control.inverse.damping.maximum").aggregate([("position_error.max", "max")]))
