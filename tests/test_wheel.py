"""The wheel: it has the scenarios and models, and runs where no clone is."""

import json
import os
import shutil
import subprocess
import sys
import tarfile
import zipfile

import numpy as np
import pytest
from llvmlite import binding

from project import ROOT
from rmrc.law import kept

pytestmark = pytest.mark.long  # it builds, and the installed law is compiled anew

SHIPPED = {
    f"rmrc/_examples/{path.relative_to(ROOT)}"
    for path in [*(ROOT / "models").rglob("*.xml"), *(ROOT / "scenarios").glob("*.*[lv]")]
}


def run(*command, cwd, **environment):
    done = subprocess.run(
        [sys.executable, *command],
        cwd=cwd,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def pip(*words, cwd):
    return run("-m", "pip", *words, "--no-deps", "--no-index", "--disable-pip-version-check", cwd=cwd)


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """Return a wheel and a source distribution, of a copy of this clone that was built in before."""
    clone, out = tmp_path_factory.mktemp("clone"), tmp_path_factory.mktemp("out")
    for name in ("pyproject.toml", "setup.py", "MANIFEST.in", "README.md", "LICENSE", "CHANGELOG.md"):
        shutil.copy(ROOT / name, clone)
    for name in ("src", "models", "scenarios", "tools"):
        shutil.copytree(ROOT / name, clone / name, ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
    gone = clone / "build/lib/rmrc/_examples/scenarios/gone.yaml"
    gone.parent.mkdir(parents=True)
    gone.touch()
    run("-c", f"from setuptools import build_meta; build_meta.build_sdist({str(out)!r})", cwd=clone)
    pip("wheel", ".", "--no-build-isolation", "-w", str(out), cwd=clone)
    (wheel,), (source,) = out.glob("*.whl"), out.glob("*.tar.gz")
    return wheel, source


def names(wheel):
    return set(zipfile.ZipFile(wheel).namelist())


def test_a_wheel_has_all_scenarios_and_models_and_nothing_that_is_gone(built):
    wheel, _ = built
    assert {name for name in names(wheel) if "_examples" in name} == SHIPPED
    assert {"rmrc/py.typed", "rmrc/law/law.py"} <= names(wheel)


def test_a_wheel_of_the_source_distribution_is_the_same(built, tmp_path):
    wheel, source = built
    with tarfile.open(source) as archive:
        archive.extractall(tmp_path, filter="data")
    (folder,) = tmp_path.iterdir()
    pip("wheel", ".", "--no-build-isolation", "-w", str(tmp_path / "out"), cwd=folder)
    (again,) = (tmp_path / "out").glob("*.whl")
    assert names(again) == names(wheel)


def test_an_installed_wheel_runs_a_shipped_scenario_from_anywhere(built, tmp_path):
    wheel, _ = built
    site, here = tmp_path / "site", tmp_path / "here"
    here.mkdir()
    pip("install", str(wheel), "--target", str(site), cwd=tmp_path)

    def call(*words, **environment):
        return run("-m", "rmrc", *words, cwd=here, **{"PYTHONPATH": str(site), **environment})

    found = json.loads(call("examples", "--json"))
    paths = {one["path"] for files in found.values() for one in files}
    beside = {
        "models/common/world.xml", "models/mechanisms/planar_3rpr.xml", "scenarios/recorded_motion.csv",
        "scenarios/arm_log.csv",
    }  # fmt: skip
    assert paths == {str(site / name) for name in SHIPPED} - {
        str(site / "rmrc/_examples" / name) for name in beside
    }
    call("run", "line_tracking", "--no-record", NUMBA_CACHE_DIR=str(tmp_path / "compiled"))
    features = binding.get_host_cpu_features()
    if all(features.get(name) for name in kept.NEEDED):
        assert list((tmp_path / "compiled").rglob("*.nbc")) == []  # all came with the package
    assert sorted(path.name for path in (here / "recordings").iterdir()) == [
        "line_tracking.json",
        "line_tracking.npz",
    ]
    assert json.loads(call("inspect", "puma560", "--json"))["model"].startswith(str(site))
    call("init", "mine")
    call("run", "mine/scenarios/line_tracking.yaml", "--no-record", "--out", "again")
    call("run", "line_tracking", "--no-record", "--out", "clone", PYTHONPATH=str(ROOT / "src"))
    first, *others = (np.load(here / out / "line_tracking.npz") for out in ("recordings", "again", "clone"))
    for other in others:
        assert first["qdot_cmd"].tobytes() == other["qdot_cmd"].tobytes()
