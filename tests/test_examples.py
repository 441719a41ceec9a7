"""The programs in `examples`: each runs from anywhere, says what its page says, and leaves nothing."""

import re
import runpy

import pytest

from project import ROOT

EXAMPLES = sorted((ROOT / "examples").glob("*.py"))

# What each says: figures of scenarios/README.md; statics and areas by hand, 10 N times 1 + cos(1 rad) and cos(1 rad),
# 72 pi and (9^2 - 27) 135 deg / 2.
SAYS = {
    "run": ["least singular value: 0.0097"],
    "compare": [r"inverse, 20\s+1265\d rad/s", r"damped, 20\s+3.1\d+ rad/s"],
    "sweep_to_pandas": ["40 runs, .* all complete: {'complete'}"],
    "tune": ["recommended: ", "method: (damped|filtered)"],
    "inspect_arm": ["rank 5", "cannot turn about", r"\[ 90. -90.\]", r"\[15.403  5.403\]", "6[2-5] of 22[4-8] m²"],
    "log_an_arm": [r"^t,q_shoulder,q_elbow,qdot_cmd_shoulder,qdot_cmd_elbow\n0.000,"],
    "own_loop": [r"5213 ticks, the bits of `rmrc run`: True", "least singular value: 0.0018"],
    "robot_driver": ["1500 commands at 500 Hz", r"100 states lost: braked from 1\.00 to 0\.[0-4]\d rad/s",
                     r"largest acceleration [1-4]\.\d\d of 4 rad/s²; at the goal within 0\.\d mm"],
    "environment": ["goal 0: .* reached: True", "goal 1: .* reached: True", "goal 2: .* reached: True"],
    "batch": [r"64 arms of 7 joints; rates \(64, 7\), status \(64,\)", r"largest error \d.\de-[01]\d; 0 limited"],
    "coming_from": [r"as with mink: 0\.\d\d mm", r"as with pink, the goal as a matrix: 0\.\d\d mm",
                    r"as with Robotics Toolbox: v is met within \d.\de-1\d"],
    "test_my_robot": ["passed: test_the_commands_keep", "passed: test_the_hand", "passed: test_a_feedback"],
}  # fmt: skip


@pytest.mark.parametrize(
    "path",
    [
        pytest.param(path, marks=[pytest.mark.long] * (path.stem in ("tune", "sweep_to_pandas")))
        for path in EXAMPLES
    ],
    ids=lambda path: path.stem,
)
def test_an_example_runs_and_says_what_it_should(path, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(path), run_name="__main__")
    out, err = capsys.readouterr()
    assert [text for text in SAYS[path.stem] if not re.search(text, out)] == []
    assert err == ""
    assert list(tmp_path.iterdir()) == []
