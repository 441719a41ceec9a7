"""What compiled code and MuJoCo's engine do together: errors, Ctrl-C, and machine code that arms share."""

import os
import signal
import threading

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from project import ROOT
from rmrc.results.columns import COLUMNS
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation

PLANAR = (
    (ROOT / "models/planar_2link.xml").read_text().replace('file="common/', f'file="{ROOT}/models/common/')
)
HOLD = "target.path=[{hold: {for: 100}}]"


def touching(path, memory="-1"):
    """Write a planar arm whose tip soon comes to many balls; return the override that takes it."""
    balls = "".join(f'<geom size=".2" pos="1.15 .18 {0.001 * i}"/>' for i in range(60))
    text = PLANAR.replace("<worldbody>", f'<size memory="{memory}"/><worldbody>{balls}', 1)
    ball = '<geom type="sphere" size=".05" pos="1 0 0" contype="1" conaffinity="1"/>'
    path.write_text(text.replace('<site name="tip"', f'{ball}<site name="tip"'))
    return f"arm.model={path}"


def test_an_error_of_the_engine_ends_its_world_and_no_other(scenario, tmp_path, monkeypatch):
    good = prepare(scenario(touching(tmp_path / "good.xml")))
    # a stack with too little room for the contacts, which the engine ends the process for
    cramped = prepare(scenario(touching(tmp_path / "cramped.xml", "10K")))
    (alone,) = Simulation([good]).run()
    assert alone.is_complete and alone.touching
    monkeypatch.chdir(tmp_path)
    before, bad, after = Simulation([good, cramped, good], 3).run()
    assert "mj_stackAlloc: out of memory" in bad.divergence.reason and "\n" not in bad.divergence.reason
    assert 0 < len(bad) == bad.divergence.tick < bad.planned
    for name in COLUMNS:
        assert_array_equal(before[name], alone[name])
        assert_array_equal(after[name], alone[name])
    assert_array_equal(bad["time"], alone["time"][: len(bad)])
    assert not list(tmp_path.glob("*.TXT"))  # the engine's log


def test_ctrl_c_in_a_run_that_looks_for_contacts_keeps_what_was_recorded(scenario, tmp_path):
    # Nearly all Python of such a run is called by compiled code, which cannot raise.
    simulation = Simulation([prepare(scenario(touching(tmp_path / "arm.xml"), HOLD))])
    for _ in range(2):  # it goes on where it was, and can be interrupted again
        timer = threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT))
        timer.start()
        with pytest.raises(KeyboardInterrupt):
            simulation.run()
        timer.join()
    (run,) = simulation.runs()
    assert 0 < len(run) < run.planned and run.divergence is None
    assert_array_equal(run["time"], run.period * np.arange(len(run)))
