"""The wheel, built by the command of its page: pure Python with scenarios and models, which runs where no clone is."""

import json
import os
import re
import shutil
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


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """Return the wheel that the command of notebooks/README.md builds, as it stands, in a new clone with a `.venv`."""
    (command,) = re.findall(
        r"^.*pip wheel.*$", (ROOT / "notebooks/README.md").read_text("utf-8"), re.MULTILINE
    )
    clone = tmp_path_factory.mktemp("clone")
    for name in ("src", "models", "scenarios"):
        shutil.copytree(ROOT / name, clone / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "CHANGELOG.md", "LICENSE"):
        shutil.copy(ROOT / name, clone)
    run("-m", "venv", ".venv", cwd=clone)
    done = subprocess.run(["bash", "-c", command], cwd=clone, capture_output=True, text=True, check=False)
    if "hatchling" in done.stderr and "No matching distribution" in done.stderr:
        pytest.skip("there is no package index, from which pip takes what builds a wheel")
    assert done.returncode == 0, done.stderr
    return next(clone.glob("dist/*.whl"))


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
