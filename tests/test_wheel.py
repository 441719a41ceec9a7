"""The wheel: pure Python with the scenarios and models, which runs where no clone is."""

import json
import os
import subprocess
import sys
import zipfile

import numpy as np
import pytest

from project import ROOT

pytestmark = pytest.mark.long  # it builds, and the installed law is compiled anew

PACKAGE = {
    str(path.relative_to(ROOT / "src"))
    for path in (ROOT / "src/rmrc").rglob("*")
    if path.is_file() and path.parent.name != "__pycache__"
}
EXAMPLES = {
    f"rmrc/_examples/{path.relative_to(ROOT)}"
    for path in [*(ROOT / "models").rglob("*.xml"), *(ROOT / "scenarios").glob("*.*[lv]")]
}


def run(*command, cwd, **environment):
    environment = {**os.environ, **environment}
    done = subprocess.run(
        [sys.executable, *command], cwd=cwd, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def pip(*words, cwd):
    return run("-m", "pip", *words, "--no-deps", "--no-index", "--disable-pip-version-check", cwd=cwd)


def wheel_of(source, out):
    pip("wheel", str(source), "--no-build-isolation", "-w", str(out), cwd=out)
    return next(out.glob("*.whl"))


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    return wheel_of(ROOT, tmp_path_factory.mktemp("out"))


def test_a_wheel_is_pure_and_small_and_has_the_package_with_its_examples_alone(wheel):
    names = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    assert names == PACKAGE | EXAMPLES
    assert wheel.name.endswith("-py3-none-any.whl") and wheel.stat().st_size < 3_000_000


def test_an_installed_wheel_runs_a_shipped_scenario_from_anywhere(wheel, tmp_path):
    site, here = tmp_path / "site", tmp_path / "here"
    here.mkdir()
    pip("install", str(wheel), "--target", str(site), cwd=tmp_path)

    def call(*words, path=site):
        return run("-m", "rmrc", *words, cwd=here, PYTHONPATH=str(path))

    listed = {file["path"] for files in json.loads(call("examples", "--json")).values() for file in files}
    assert {str(site / "rmrc/_examples" / name) for name in ("models/ur5e.xml", "scenarios/blow_up.yaml")} < {
        *listed
    }
    assert json.loads(call("inspect", "puma560", "--json"))["model"].startswith(str(site))
    call("run", "line_tracking", "--no-record", "--out", "installed")
    call("run", "line_tracking", "--no-record", "--out", "clone", path=ROOT / "src")
    installed, clone = (np.load(here / out / "line_tracking.npz") for out in ("installed", "clone"))
    np.testing.assert_array_equal(installed["qdot_cmd"], clone["qdot_cmd"])
