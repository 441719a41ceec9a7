"""What needs no picture loads neither rerun nor matplotlib, and so runs on a machine without them."""

import subprocess
import sys

from project import ROOT

PROGRAM = """
import sys
for name in ("rerun", "matplotlib"):
    sys.modules[name] = None  # an import of it fails
from rmrc.cli import main
for line in sys.argv[1:]:
    sys.argv = ["rmrc", *line.split()]
    try:
        main()
    except SystemExit as ended:
        print("ended", ended.code)
"""
SCENARIO, ARM = f"{ROOT}/scenarios/approach_singularity.yaml", f"{ROOT}/models/ur5e.xml"
LINES = [
    f"run {SCENARIO} --no-record",
    f"compare {SCENARIO} --vary control.feedback=2,5 --no-record",
    f"sweep {SCENARIO} --vary control.feedback=2,5",
    f"inspect {ARM}",
    f"check {ARM}",
    f"new {ARM} -o ur5e.yaml",
    "schema",
]


def ended(folder, *lines):
    command = [sys.executable, "-c", PROGRAM, *lines]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300, check=True)
    return [
        int(line.split()[1]) for line in done.stdout.splitlines() if line.startswith("ended ")
    ], done.stderr


def test_verbs_without_a_picture_need_neither_and_others_name_what_is_missing(tmp_path):
    pictures = [
        f"run {SCENARIO}",
        "plot recordings/approach_singularity.npz",
        f"tune {SCENARIO} --runs 30 --only control.inverse.method=damped --ideal",
    ]
    codes, err = ended(tmp_path, *LINES, *pictures)
    assert codes == [0] * len(LINES) + [2, 2, 2]
    assert err.count("rmrc: error: rerun is not installed") == 1
    assert err.count("rmrc: error: matplotlib is not installed") == 2
    assert (tmp_path / "recordings/approach_singularity.tune.yaml").exists()  # all but the picture is there
