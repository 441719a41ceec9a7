"""The law in C gives the rates of `rmrc.Controller.step`, to the bit on x86-64."""

import functools
import platform
import shutil
import subprocess
import sys

import numpy as np
import pytest

from project import ROOT
from rmrc.export import c_law
from rmrc.law.controller import Controller
from rmrc.scenario import load, loads
from rmrc.simulation.prepare import prepare
from rmrc.support.errors import QuestionError

GCC = shutil.which("gcc")
CROSS, QEMU = shutil.which("aarch64-linux-gnu-gcc"), shutil.which("qemu-aarch64")
pytestmark = pytest.mark.skipif(
    GCC is None or platform.machine() != "x86_64", reason="there is no gcc for x86-64 here"
)

# Two joints; a wrist; seven joints; a sliding joint; a policy that slows; an active set.
SCENARIOS = (
    "approach_singularity", "ur5e_wrist", "fr3_elbow", "stanford_wrist", "slow_wrist", "best_within_limits",
)  # fmt: skip
# Of libm and of any C.
ALLOWED = {
    *("memset", "memmove", "atan2", "sin", "cos", "sincos", "pow", "hypot", "sqrt", "floor", "ceil"),
    *("exp", "log", "log10", "fmod"),
}


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    """Return what gives the folder of a scenario's law, made once."""

    @functools.cache
    def folder_of(name):
        folder = tmp_path_factory.mktemp(name)
        verb = (sys.executable, "-m", "rmrc", "export", ROOT / f"scenarios/{name}.yaml", "-o", folder)
        subprocess.run(verb, check=True)
        return folder

    return folder_of


def random_steps(name, ticks):
    """Return the input of random steps, (T, 2 n + 17), and what `Controller.step` makes of it, (T, n + 1).

    The arm obeys. The target is a random pose and twist near the start, and some of it is missing or no number.
    """
    scenario = load(ROOT / f"scenarios/{name}.yaml")
    prepared = prepare(scenario)
    arm, rng = prepared.arm, np.random.default_rng(7)
    n, start = arm.n, prepared.qpos[arm.wiring.qpos]
    controller = Controller(arm, control=scenario)
    controller.reset(start)
    controller.reset()
    period, pose = controller.period, arm.pose(start)
    inputs = np.zeros((ticks, 2 * n + 17))
    q, qdot, has = inputs[:, :n], inputs[:, n : 2 * n], inputs[:, -3:]
    poses, twists, dt = inputs[:, 2 * n : 2 * n + 7], inputs[:, 2 * n + 7 : -4], inputs[:, -4]
    wander = np.repeat(rng.normal(0.0, 0.1, (ticks // 500 + 1, 7)), 500, axis=0)[:ticks]
    poses[:] = pose + wander
    twists[:] = np.repeat(rng.normal(0.0, 0.3, (ticks // 200 + 1, 6)), 200, axis=0)[:ticks]
    poses[rng.random(ticks) < 2e-4, 0] = np.nan
    has[:] = np.repeat(rng.random((ticks // 300 + 1, 3)) < (0.3, 0.8, 0.8), 300, axis=0)[:ticks]
    dt[:] = np.where(rng.random(ticks) < 0.1, period * rng.uniform(0.5, 2.0, ticks), 0.0)
    restarts, noise = rng.random(ticks) < 1e-3, rng.normal(0.0, 1e-4, (ticks, n))
    outputs, position, rates = np.empty((ticks, n + 1)), start.copy(), np.zeros(n)
    status = outputs.view(np.int64)
    for t in range(ticks):
        position = start + 1e3 * noise[t] if restarts[t] else position + period * rates
        q[t], qdot[t] = position, rates + noise[t]
        has_qdot, has_pose, has_twist = has[t]
        command = controller.step(
            q[t],
            qdot[t] if has_qdot else None,
            pose=poses[t] if has_pose else None,
            twist=twists[t] if has_twist else None,
            dt=float(dt[t]) or None,
        )
        outputs[t, :n] = rates = command.qdot_cmd.copy()
        status[t, n] = int(command.status)
    return inputs, outputs


def in_c(folder, inputs, compiler=GCC, law="law.o", runner=()):
    """Return rates and status of these steps in C, (T, n + 1), and what the program says about their time."""
    program = folder / f"ticks_{law}"
    source = ROOT / "tests/export/ticks.c"
    flags = ["-std=gnu11", "-O2", "-Wall", "-Wextra", "-Werror", f"-I{folder}"]
    subprocess.run([compiler, *flags, source, folder / law, "-lm", "-o", program], check=True)
    done = subprocess.run([*runner, program], input=inputs.tobytes(), capture_output=True, check=True)
    return np.frombuffer(done.stdout).reshape(len(inputs), -1), done.stderr.decode()


@pytest.mark.parametrize(
    ("name", "ticks"),
    [
        ("approach_singularity", 20_000),
        *(pytest.param(name, 1_000_000, marks=pytest.mark.long) for name in SCENARIOS),
    ],
)
def test_c_gives_the_rates_of_the_controller_to_the_bit(exported, name, ticks):
    inputs, outputs = random_steps(name, ticks)
    rates, times = in_c(exported(name), inputs)
    assert len(np.unique(outputs.view(np.int64)[:, -1])) > 2  # statuses: the steps do more than one thing
    assert rates.tobytes() == outputs.tobytes()
    print(name, times)


def test_a_change_of_the_input_is_noticed(exported):
    inputs, outputs = random_steps("approach_singularity", 1_000)
    inputs[500, 0] = np.nextafter(inputs[500, 0], 1.0)
    rates, _ = in_c(exported("approach_singularity"), inputs)
    assert rates[:500].tobytes() == outputs[:500].tobytes()
    assert rates.tobytes() != outputs.tobytes()


@pytest.mark.long
@pytest.mark.parametrize("name", SCENARIOS)
@pytest.mark.skipif(CROSS is None or QEMU is None, reason="there is no gcc for aarch64, or no qemu-aarch64")
def test_aarch64_gives_the_same_rates_within_rounding(exported, name):
    """Each step by itself: what follows from a step that differs by rounding may differ by more."""
    inputs, outputs = random_steps(name, 20_000)
    runner = (QEMU, "-L", "/usr/aarch64-linux-gnu")
    rates, _ = in_c(exported(name), inputs, CROSS, "law_aarch64.o", runner)
    off = np.abs(rates[:, :-1] - outputs[:, :-1]) / np.maximum(1.0, np.abs(outputs[:, :-1]))
    assert off.max() <= 1e-12


@pytest.mark.parametrize("law", c_law.OBJECTS)
def test_the_object_needs_memset_memmove_and_libm_alone(exported, law):
    listed = subprocess.run(
        ["nm", exported("approach_singularity") / law], check=True, capture_output=True, text=True
    )
    symbols = [line.split() for line in listed.stdout.splitlines()]
    assert {words[-1] for words in symbols if words[-2] == "U"} <= ALLOWED
    assert {words[-1] for words in symbols if words[-2] == "T"} == {"rmrc_law_init", "rmrc_law_step"}
    assert not {words[-2] for words in symbols} & {*"BbDGgSs"}  # no data that can be written


def test_the_example_builds_without_a_warning_and_moves_the_site(exported):
    """By 0.025 m along x, which 0.05 m/s for half a second is."""
    folder = exported("approach_singularity")
    flags = ["-std=c11", "-O2", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
    subprocess.run([GCC, *flags, "example.c", "law.o", "-lm", "-o", "example"], cwd=folder, check=True)
    done = subprocess.run([folder / "example"], check=True, capture_output=True, text=True)
    prepared = prepare(load(ROOT / "scenarios/approach_singularity.yaml"))
    start = prepared.qpos[prepared.arm.wiring.qpos]
    moved = prepared.arm.pose(np.array(list(map(float, done.stdout.split())))) - prepared.arm.pose(start)
    np.testing.assert_allclose(moved[:3], [0.025, 0.0, 0.0], atol=1e-6)


def test_the_verb_writes_c_alone(rmrc):
    code, out, err = rmrc("export", "approach_singularity", "--to", "rust")
    assert (code, out, err) == (2, "", "rmrc: error: --to must be c, got 'rust'\n")


INTEGRATED = """
name: integrated
arm: {model: MODEL, start: [0.3, 0.9]}
control: {state: integrated}
target: {path: [{hold: {for: 1}}]}
"""


def test_what_c_cannot_carry_is_refused_in_a_line(tmp_path, monkeypatch):
    text = INTEGRATED.replace("MODEL", str(ROOT / "models/planar_2link.xml"))
    with pytest.raises(QuestionError, match=r'control\.state "integrated" cannot be exported'):
        c_law.export(loads(text), tmp_path)
    monkeypatch.setattr("sys.platform", "darwin")
    with pytest.raises(QuestionError, match="objects for Linux, on Linux; this is darwin"):
        c_law.export(load(ROOT / "scenarios/approach_singularity.yaml"), tmp_path)
    assert not list(tmp_path.iterdir())
