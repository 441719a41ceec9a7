"""What goes through pyarrow works with any version: `.ci/run` calls this again with the oldest one that is allowed."""

from project import ROOT

SCENARIO = str(ROOT / "scenarios" / "approach_singularity.yaml")


def test_a_run_records_and_a_sweep_has_rows_that_are_read(rmrc, tmp_path):
    assert rmrc("run", SCENARIO, "--quiet")[::2] == (0, "")
    assert (tmp_path / "recordings" / "approach_singularity.rrd").stat().st_size > 100_000
    assert rmrc("sweep", SCENARIO, "--vary", "control.feedback=2,5", "--quiet")[::2] == (0, "")
    rows = "recordings/approach_singularity.sweep.parquet"
    assert rmrc("report", rows)[::2] == (0, "")
    assert rmrc("identify", rows)[0] == 2  # is read as a log, and refused
