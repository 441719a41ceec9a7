"""The law in WebAssembly gives the columns of `rmrc run`, in Node; and it is the law of these sources."""

import base64
import json
import math
import shutil
import subprocess

import numpy as np
import pytest

from browsers import chromium
from project import ROOT
from rmrc.export import artifact
from rmrc.export.image import image, offset
from rmrc.export.page import path_of
from rmrc.results.columns import COLUMNS
from rmrc.scenario import load, loads
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation

NODE = shutil.which("node")

# A start that differs by 1e-13 moves their runs by more than 1e-9.
CHAOTIC = {"blow_up", "puma_shoulder", "stanford_shoulder"}
NEEDS_MUJOCO = {"wrong_lengths"}
SCENARIOS = sorted({file.stem for file in (ROOT / "scenarios").glob("*.yaml")} - CHAOTIC - NEEDS_MUJOCO)
FEW = ("example_5_5", "helical_crank", "slow_wrist", "so101_five_joints", "recorded_motion")

# Columns that a singularity magnifies.
MAGNIFIED = {"qdot_plain", "condition", "u_min", "v_min", "tau"}

# All stages of the ideal plant.
STAGES = """
name: stages
arm: {model: MODEL, site: tool, start: home, encoder: {noise: 1.0e-6, resolution: 1.0e-6, delay: 0.003}}
plant: {kind: ideal, delay: 0.004, lag: 0.01, jitter: 0.002, loss: 0.05}
control: CONTROL
target: {path: [{line: {by: [0.2, 0.1, 0.1]}}]}
"""

# What the shipped scenarios leave out.
LAWS = (
    "{inverse: {metric: inertia}, nullspace: {objective: secondary, secondary: {site: flange, axes: [z]}}}",
    "{limits: {acceleration: 10, jerk: 500, on_excess: redistribute}, nullspace: {objective: joint_limits}}",
    "{at_singularity: keep_out, limits: {on_excess: optimal}, nullspace: {objective: manipulability}}",
    "{at_singularity: singularity_consistent, inverse: {method: jparse}, limits: {rate: 2}}",
    "{inverse: {method: selectively_damped}, limits: {on_excess: sns}}",
)

# The columns of all ticks of a world, by name, as base64.
SCRIPT = (
    artifact.FILE.with_name("law.mjs").read_text("utf-8").replace("export class", "class")
    + """
function columnsOf(law, {image, path, ticks}) {
  const world = new World(law, image);
  const text = (values) => btoa(Array.from(new Uint8Array(Float64Array.from(values).buffer),
    (code) => String.fromCharCode(code)).join(""));
  const read = () => {
    const run = world.run(path, [], ticks), all = Array.from({length: run.count}, (_, k) => k);
    const columns = Object.keys(image.columns).map((name) =>
      [name, text(all.flatMap((k) => (name === "status" ? [run.status(k)] : [...run.row(name, k)])))]);
    return Object.fromEntries([...columns, ["qpos", text(world.array("positions").slice(0, run.count * image.nq))]]);
  };
  const columns = read();
  if (JSON.stringify(read()) !== JSON.stringify(columns)) throw new Error("the second run differs from the first");
  return columns;
}
"""
)
IN_NODE = """
import fs from "node:fs";
const [wasm, ...files] = process.argv.slice(2), law = new WebAssembly.Module(fs.readFileSync(wasm));
for (const file of files)
  fs.writeFileSync(`${file}.columns`, JSON.stringify(columnsOf(law, JSON.parse(fs.readFileSync(file)))));
"""
IN_CHROMIUM = """({law, world}) => {
  const bytes = Uint8Array.from(atob(law), (letter) => letter.charCodeAt(0));
  return columnsOf(new WebAssembly.Module(bytes), world);
}"""


def ideal(name):
    return prepare(load(ROOT / f"scenarios/{name}.yaml", ("plant.kind=ideal",)))


def in_node(folder, *worlds):
    """Return the columns of worlds in Node."""
    if NODE is None:
        pytest.skip("there is no Node here")
    files = [folder / f"{i}.json" for i, _ in enumerate(worlds)]
    for file, world in zip(files, worlds, strict=True):
        file.write_text(json.dumps(world))
    program = folder / "run.mjs"
    program.write_text(SCRIPT + IN_NODE)
    done = subprocess.run([NODE, program, artifact.FILE, *files], check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return [columns_of(json.loads(file.with_suffix(".json.columns").read_text())) for file in files]


def columns_of(texts):
    return {
        name: np.frombuffer(bytearray(base64.b64decode(text)))
        for name, text in texts.items()
        if name in COLUMNS
    }


def start(prepared):
    """Return the image of a world, its path, and its largest number of ticks."""
    return {"image": image(prepared), "path": path_of(prepared), "ticks": prepared.most_ticks}


def differences(run, columns):
    """Return the largest difference of each column, over max(1, |value|); NaN equals NaN."""
    wanted = {name: np.array(run[name], np.float64) for name in columns}
    ticks = len(wanted["time"])
    there = {name: values.reshape(wanted[name].shape) for name, values in columns.items()}
    # q and −q are one rotation, (u, v) and (−u, −v) one singular direction
    there["pose"][:, 3:] *= signs(there["pose"][:, 3:], wanted["pose"][:, 3:])
    sign = signs(there["u_min"], wanted["u_min"])
    there["u_min"] *= sign
    there["v_min"] *= sign
    assert ticks > 0
    most = {}
    for name, values in wanted.items():
        same = (values == there[name]) | (np.isnan(values) & np.isnan(there[name]))
        with np.errstate(invalid="ignore"):
            off = np.abs(values - there[name]) / np.maximum(1.0, np.abs(values))
        most[name] = np.where(same, 0.0, np.where(np.isnan(off), math.inf, off)).max(initial=0.0)
    return most


def signs(vectors, others):
    """Return the sign of the product of each row of two, (T, 1)."""
    return np.where(np.sum(vectors * others, axis=1, keepdims=True) < 0.0, -1.0, 1.0)


def assert_equal(run, columns):
    for name, most in differences(run, columns).items():
        assert most <= (1e-6 if name in MAGNIFIED else 1e-9), (name, most)


def check(folder, prepared):
    (run,) = Simulation([prepared]).run()
    (columns,) = in_node(folder, start(prepared))
    assert columns["time"].size == len(run["time"])
    assert_equal(run, columns)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name in FEW else pytest.mark.long) for name in SCENARIOS]
)
def test_node_gives_the_columns_of_a_run(tmp_path, name):
    check(tmp_path, ideal(name))


@pytest.mark.browser
def test_chromium_gives_the_columns_of_every_run():
    law = base64.b64encode(artifact.FILE.read_bytes()).decode()
    with chromium() as browser:
        shown = browser.new_page()
        shown.add_script_tag(content=SCRIPT)
        for name in SCENARIOS:
            prepared = ideal(name)
            (run,) = Simulation([prepared]).run()
            columns = columns_of(shown.evaluate(IN_CHROMIUM, {"law": law, "world": start(prepared)}))
            assert columns["time"].size == len(run["time"]), name
            assert_equal(run, columns)


@pytest.mark.parametrize("law", LAWS)
def test_node_gives_the_columns_of_stages_and_parts_that_few_worlds_have(tmp_path, law):
    text = STAGES.replace("MODEL", str(ROOT / "models/fr3.xml")).replace("CONTROL", law)
    check(tmp_path, prepare(loads(text)))


def test_a_changed_constant_of_the_image_is_noticed(tmp_path):
    """A feedback that is larger by a millionth changes the columns by more than the tolerance."""
    prepared = ideal("helical_crank")
    (run,) = Simulation([prepared]).run()
    world = start(prepared)
    (array,) = (each for each in world["image"]["arrays"] if each["name"] == "record")
    record = bytearray(base64.b64decode(array["values"]))
    numbers = np.frombuffer(record, np.float64)
    numbers[offset("task", "feedback") // 8] *= 1.0 + 1e-6
    array["values"] = base64.b64encode(record).decode()
    (columns,) = in_node(tmp_path, world)
    assert max(differences(run, columns).values()) > 1e-9


def test_the_artifact_is_that_of_the_sources():
    """Otherwise: run tools/law_wasm.py."""
    assert artifact.FILE.read_bytes().endswith(b"\x07sources" + artifact.digest())


def test_a_changed_constant_of_the_law_changes_the_digest(monkeypatch):
    before = artifact.digest()
    monkeypatch.setattr("rmrc.law.svd.RANK_FLOOR", 1.1e-14)
    assert artifact.digest() != before
