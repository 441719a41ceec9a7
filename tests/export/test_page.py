"""The page of a scenario: what it computes is what `rmrc run` computes, with any settings.

The scripts of the page run in Node, without a page around them. The oracle is `rmrc.run` of the scenario that the
page gives to copy, with MuJoCo's kinematics in place of the chain's.
"""

import base64
import json
import random
import shutil
import subprocess

import numpy as np
import pytest

import rmrc
from rmrc.export import page
from rmrc.export.contents import contents

NODE = shutil.which("node")
# Scenarios with 2, 3, 6 and 7 joints.
SOME = "approach_singularity", "null_space", "ur5e_wrist", "fr3_elbow"
COLUMNS = "time", "q", "qdot_cmd", "pose", "pose_ref", "pose_error", "sigma", "damping", "path_rate"
DRIVER = """
import {readFileSync} from "node:fs";
const {data, law, addresses} = JSON.parse(readFileSync(0, "utf8"));
const course = new Course(new WebAssembly.Module(readFileSync(law)), data), settings = new Settings(data);
const text = (values) => Buffer.from(Float64Array.from(values).buffer).toString("base64");
console.log(JSON.stringify(addresses.map((address) => {
  settings.read(address);
  const run = course.run(settings), ticks = Array.from({length: run.count}, (_, k) => k);
  const columns = Object.fromEntries(NAMES.map((name) => [name, text(ticks.flatMap((k) => [...run.row(name, k)]))]));
  return {yaml: settings.yaml, columns, status: ticks.map(run.status), address: String(new URLSearchParams(settings.changes))};
})));
"""


def courses(data, addresses, folder):
    """Return what the scripts of the page make of settings: the scenario to copy, its columns and statuses."""
    if NODE is None:
        pytest.skip("there is no Node here")
    program = folder / "run.mjs"
    names = f"const NAMES = {json.dumps(COLUMNS)};\n"
    program.write_text("\n".join([names, *(file.read_text() for file in page.SCRIPTS[:3]), DRIVER]))
    question = json.dumps({"data": data, "law": str(page.ROOM / "law.wasm"), "addresses": addresses})
    done = subprocess.run(
        [NODE, program], input=question, capture_output=True, text=True, timeout=300, check=False
    )
    assert not done.stderr, done.stderr
    return json.loads(done.stdout)


def largest(run, columns, status):
    """Return the largest differences of columns from those of a run, over max(1, |value|); infinite of other lengths."""
    if len(status) != len(run):
        return dict.fromkeys(COLUMNS, np.inf)
    differences = {"status": float((run["status"] != status).sum())}
    for name in COLUMNS:
        values, wanted = columns[name].reshape(run[name].shape).copy(), run[name]
        if name == "pose":  # a rotation has two quaternions
            values[:, 3:] *= np.sign((values[:, 3:] * wanted[:, 3:]).sum(axis=1, keepdims=True))
        differences[name] = float((np.abs(values - wanted) / np.maximum(1.0, np.abs(wanted))).max())
    return differences


def check(course):
    """Check a course against `rmrc.run`: within 1e-9, or what 1e-13 at the start makes of the run."""
    scenario = rmrc.scenario.loads(course["yaml"])
    run = rmrc.run(scenario)
    start = run["q"][0].tolist()
    columns = {name: np.frombuffer(base64.b64decode(text)) for name, text in course["columns"].items()}
    differences = largest(run, columns, course["status"])
    if max(differences.values()) < 1e-9:
        return True
    nearby = rmrc.run(scenario.set({"arm.start": [start[0] + 1e-13, *start[1:]]}))
    moved = largest(run, nearby.columns, nearby["status"])
    assert max(moved.values()) > 1e-9, (course["address"], differences)
    return False


@pytest.mark.parametrize("name", SOME)
def test_any_settings_run_in_the_page_as_the_scenario_that_it_gives_to_copy(name, tmp_path):
    data = contents(rmrc.load(name))[1]
    rng, controls = random.Random(name), data["controls"]
    addresses = [""]
    for _ in range(6):
        chosen = {each["key"]: rng.choice(each["values"]) for each in controls if rng.random() < 0.3}
        chosen["target.speed"] = rng.choice(data["paths"])["speed"]
        addresses.append("&".join(f"{key}={value}" for key, value in chosen.items() if value is not None))
    assert (
        sum(check(course) for course in courses(data, addresses, tmp_path)) > len(addresses) / 2
    )  # the others are chaotic
