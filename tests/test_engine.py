"""What compiled code and MuJoCo's engine do together: errors, Ctrl-C, and machine code that arms share."""

import os
import signal
import subprocess
import sys
import threading

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from project import ROOT
from rmrc.plants.contacts import Contacts
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


@pytest.mark.parametrize("threads", [1, 3])
def test_an_error_of_the_engine_ends_its_world_and_no_other(scenario, tmp_path, monkeypatch, threads):
    good = prepare(scenario(touching(tmp_path / "good.xml")))
    # a stack with too little room for the contacts, which the engine ends the process for
    cramped = prepare(scenario(touching(tmp_path / "cramped.xml", "10K")))
    (alone,) = Simulation([good]).run()
    assert alone.is_complete and alone.touching
    monkeypatch.chdir(tmp_path)
    before, bad, after = Simulation([good, cramped, good], threads).run()
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


def test_an_error_in_a_look_for_contacts_ends_the_run(scenario, tmp_path, monkeypatch):
    simulation = Simulation([prepare(scenario(touching(tmp_path / "arm.xml")))])

    def fail(*_):
        raise ZeroDivisionError

    with monkeypatch.context() as patched:
        patched.setattr(Contacts, "status", fail)
        with pytest.raises(ZeroDivisionError):
            simulation.run()
    assert simulation.run()[0].is_complete  # and no other is left over


SHARED = r"""
from pathlib import Path
from rmrc.law import compiling
from rmrc.scenario import loads
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation

PLANAR = "arm: {model: models/planar_2link.xml, site: tip, start: [60 deg, -120 deg]}\ntask: {axes: [x, y]}"
STANFORD = "arm: {model: models/stanford.xml, site: tool, start: home}\ntask: {axes: [x, y, z, rx, ry, rz]}"
made, make = [], compiling.Method._make
compiling.Method._make = lambda method, capacity: made.append(method.function.__name__) or make(method, capacity)
for arm, *overrides in (PLANAR,), (STANFORD,), (STANFORD, "control.inverse.method=jparse"):
    made.clear()
    before = set(compiling.cache_folder().rglob("*"))
    text = f"name: test\n{arm}\ntarget: {{path: [{{line: {{by: [0.02, 0.02]}}}}]}}"
    (run,) = Simulation([prepare(loads(text, overrides=overrides))]).run()
    assert run.is_complete
    print(len(set(compiling.cache_folder().rglob("*")) - before), *made)
"""


def test_an_arm_of_another_shape_compiles_nothing():
    done = subprocess.run(
        [sys.executable, "-c", SHARED], cwd=ROOT, capture_output=True, text=True, check=True
    )
    first, second, other = (line.split() for line in done.stdout.splitlines())
    assert {"ticks", "control", "damped"} < set(first)
    assert second == ["0"]  # neither compiles nor loads
    assert set(other[1:]) == {"jparse", "undamped"}  # another inverse does, and nothing else
