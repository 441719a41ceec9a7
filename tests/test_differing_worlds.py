"""Payload, gravity and stretched bodies are what models that are written so have."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from project import ROOT
from rmrc.results.columns import COLUMNS
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation

PLANAR = (ROOT / "models" / "planar_2link.xml").read_text()
REACH = "target.path=[{line: {to: [1.5, 0.2]}}, {line: {to: [1.2, 0.2]}}]"


def run(prepared, threads=1):
    return Simulation(prepared, threads).run()


def assert_same(one, other, rtol=0.0):
    for name in COLUMNS:
        if rtol:
            assert_allclose(one[name], other[name], rtol=rtol, atol=rtol, err_msg=name)
        else:
            assert_array_equal(one[name], other[name], err_msg=name)


def write(folder, *changes):
    """Write the planar arm, changed by hand; return the override that takes it."""
    text = PLANAR.replace('file="common/', f'file="{ROOT}/models/common/')
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / "arm.xml").write_text(text)
    return f"arm.model={folder}/arm.xml"


# Payload ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("fuse", ["false", "true"])
def test_a_payload_is_a_mass_that_is_welded_to_the_site(scenario, tmp_path, fuse):
    mass = '<body name="mass" pos="1 0 0"><inertial pos="0 0 0" mass="2.5" diaginertia="1e-15 1e-15 1e-15"/></body>'
    site = '<site name="tip" pos="1 0 0"/>'
    shared = (REACH, "plant.kv=300", "plant.gravity=[1, -9.81, 2]", "plant.gravity_compensation=false",
              "control.period=0.002")  # fmt: skip
    welded = run([prepare(scenario(write(tmp_path, (site, site + mass)), *shared))])[0]
    model = write(tmp_path, ('angle="radian"', f'angle="radian" fusestatic="{fuse}"'))
    loaded, bare = (run([prepare(scenario(model, *shared, f"plant.payload={m}"))])[0] for m in (2.5, 0))
    # rounding, and what a stiff servo makes of it
    assert_same(loaded, welded, 1e-9)
    assert np.abs(loaded["tau"] - bare["tau"]).max() > 10.0


# Gravity ------------------------------------------------------------------------------------------


def test_gravity_is_that_of_a_model_which_says_so(scenario, tmp_path):
    shared = (REACH, "plant.gravity_compensation=false")
    path = write(tmp_path, ('timestep="0.001"', 'timestep="0.001" gravity="3 -4 1"'))
    theirs = run([prepare(scenario(path, *shared))])[0]
    ours, bare = run([prepare(scenario(*shared, *more)) for more in (["plant.gravity=[3, -4, 1]"], [])])
    assert_same(ours, theirs)
    assert np.abs(ours["tau"] - bare["tau"]).max() > 1.0


# Lengths ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["servo", "torque"])
def test_a_run_is_that_of_a_model_with_these_lengths(scenario, tmp_path, kind):
    inertia = np.array([0.001181411, 0.121463483, 0.121463483])
    link = '1.450473" pos="0.5 0 0" diaginertia="0.001181411 0.121463483 0.121463483"'
    first, second = PLANAR.index(link), PLANAR.rindex(link)
    assert first != second
    numbers = [
        f'1.450473" pos="{0.5 * f} 0 0" diaginertia="{" ".join(map(repr, (f**2 * inertia).tolist()))}"'
        for f in (1.1, 0.9)
    ]
    text = PLANAR.replace(link, numbers[0], 1).replace(link, numbers[1], 1)
    text = text.replace('name="link_2" pos="1 0 0"', 'name="link_2" pos="1.1 0 0"')
    text = text.replace('name="tip" pos="1 0 0"', 'name="tip" pos="0.9 0 0"')
    (tmp_path / "arm.xml").write_text(text.replace('file="common/', f'file="{ROOT}/models/common/'))
    shared = (REACH, f"plant.kind={kind}", "plant.gravity=[0, -9.81, 0]", "plant.gravity_compensation=false", "plant.wrench=[3, 2, 1, 0, 0, 1]",
              "control.period=0.002")  # fmt: skip
    theirs = run([prepare(scenario(f"arm.model={tmp_path}/arm.xml", *shared))])[0]
    ours, _ = run(
        [prepare(scenario(*shared, text)) for text in ("arm.stretch={link_1: 1.1, link_2: 0.9}", "name=own")]
    )
    assert_same(ours, theirs, 1e-8)  # rounding, and what a stiff servo makes of it
