"""A sweep on Dask: the bytes of the threads, whatever happens to the workers; real processes, real signals."""

import os
import shutil
import signal

import pytest

from project import ROOT
from rmrc.study import dask as cluster
from rmrc.study.sweep import Sweep
from rmrc.support.errors import ClusterError
from wording import says

pytestmark = pytest.mark.xdist_group("cluster")

TEXT = """
name: quick
arm: {model: ../models/planar_2link.xml, site: tip, start: [60 deg, -120 deg], encoder: {deviation: 0.1 deg}}
task: {axes: [x, y]}
target: {path: [{line: {by: [0.004, 0.0]}}]}
sweep:
  vary: {arm.model: [../models/planar_2link.xml, ABSOLUTE]}
  draw: {control.feedback: [1, 20]}
  samples: 24
"""
RUNS = 48


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """Return a scenario beside its models."""
    folder = tmp_path_factory.mktemp("project")
    (folder / "scenarios").mkdir()
    shutil.copytree(ROOT / "models/common", folder / "models/common")
    for name in ("planar_2link.xml", "other.xml"):
        shutil.copy(ROOT / "models/planar_2link.xml", folder / "models" / name)
    path = folder / "scenarios/quick.yaml"
    path.write_text(TEXT.replace("ABSOLUTE", str(folder / "models/other.xml")))
    return path


@pytest.fixture(scope="module")
def whole(path, tmp_path_factory):
    """Return the bytes of the file that one thread makes."""
    sweep = Sweep(path, folder=tmp_path_factory.mktemp("whole"), threads=1)
    sweep.run()
    return sweep.dataset.file.read_bytes()


@pytest.fixture(scope="module")
def workers():
    """Two worker processes, with their scheduler."""
    with cluster._client("local:2") as client:
        yield client.cluster


def test_workers_that_see_no_file_make_the_same_bytes_though_one_of_them_is_killed(
    path, whole, workers, tmp_path
):
    sweep = Sweep(path, folder=tmp_path, cluster=workers.scheduler_address)
    killed, (models, hidden) = [], (path.parents[1] / "models", path.parents[1] / "hidden")

    def kill(_):
        if not killed:
            killed.append(next(iter(workers.workers.values())).pid)
            os.kill(killed[0], signal.SIGKILL)

    sweep.check()
    models.rename(hidden)  # the workers have them
    try:
        sweep.run(kill)
    finally:
        hidden.rename(models)
    assert killed and len(sweep.dataset.done) == RUNS
    assert sweep.dataset.file.read_bytes() == whole
    assert [entry.name for entry in tmp_path.iterdir()] == ["quick.sweep.parquet"]


def test_without_dask_one_line_says_how_to_install_it(path, tmp_path, monkeypatch):
    monkeypatch.setattr(cluster.util, "find_spec", lambda _: None)
    with pytest.raises(ClusterError) as caught:
        Sweep(path, folder=tmp_path, cluster="local:2")
    assert str(caught.value) == "--cluster: needs Dask, which is not installed: pip install 'rmrc[cluster]'"


def _full(*_):
    raise OSError(28, "No space left on device")


def test_what_fails_on_a_worker_is_a_line(path, workers, tmp_path, monkeypatch):
    monkeypatch.setattr(cluster, "_work", _full)
    with pytest.raises(ClusterError) as caught:
        Sweep(path, folder=tmp_path, cluster=workers.scheduler_address).run()
    assert str(caught.value) == says(
        f"--cluster {workers.scheduler_address}: … No space left on device… rerun the command to resume"
    )


@pytest.mark.parametrize(
    ("address", "line"),
    [
        ("tcp://a", "--cluster: … tcp://HOST:PORT or tls://HOST:PORT … Dask … local:N … tcp://a"),
        (
            "tcp://127.0.0.1:9",
            "--cluster tcp://127.0.0.1:9: no Dask scheduler responds there … `dask scheduler`…",
        ),
    ],
)
def test_an_address_where_no_scheduler_responds_is_a_line(path, tmp_path, monkeypatch, address, line):
    monkeypatch.setattr(cluster, "_ANSWER", 0.3)
    with pytest.raises(ClusterError) as caught:
        Sweep(path, folder=tmp_path, cluster=address).run()
    assert str(caught.value) == says(line)
