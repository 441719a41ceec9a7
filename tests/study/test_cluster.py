"""A sweep on Dask: the bits of the threads, whatever happens to the workers; real processes, real signals."""

import os
import re
import shutil
import signal
import threading
import time

import dask
import pytest
from distributed import Client, LocalCluster

from project import ROOT, mostly_long
from rmrc.results import facts
from rmrc.scenario import draft_of
from rmrc.study import dask as cluster
from rmrc.study.parcel import pack
from rmrc.study.sweep import Sweep
from rmrc.support.errors import ClusterError, ScenarioError
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


def project(folder):
    """Write a scenario beside its models, of which one includes a file and has a mesh; return its path."""
    models = folder / "models"
    shutil.copytree(ROOT / "models/common", models / "common")
    text = (ROOT / "models/planar_2link.xml").read_text()
    (models / "planar_2link.xml").write_text(text)
    (models / "shapes").mkdir()
    (models / "shapes/tetrahedron.obj").write_text(
        "v 0 0 0\nv .1 0 0\nv 0 .1 0\nv 0 0 .1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    )
    asset = '<asset><mesh name="t" file="shapes/tetrahedron.obj"/></asset><worldbody><geom type="mesh" mesh="t" pos="0 0 -2"/></worldbody>'
    (models / "meshed.xml").write_text(text.replace("</mujoco>", f"{asset}</mujoco>"))
    (folder / "scenarios").mkdir()
    path = folder / "scenarios/quick.yaml"
    path.write_text(TEXT.replace("ABSOLUTE", str(models / "meshed.xml")))
    return path


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return project(tmp_path_factory.mktemp("project"))


@pytest.fixture(scope="module")
def whole(path, tmp_path_factory):
    """Return the bytes of the file that one thread makes."""
    sweep = Sweep(path, folder=tmp_path_factory.mktemp("whole"), threads=1)
    sweep.run()
    return sweep.dataset.file.read_bytes()


@pytest.fixture(scope="module")
def workers():
    """Two worker processes, with their scheduler."""
    with cluster._silence(), cluster._loop() as loop, cluster._processes(2, loop) as processes:
        processes.sync(processes._correct_state)
        yield processes


@pytest.mark.long
def test_rows_have_the_bits_of_one_thread_with_threads_and_with_workers_that_see_no_file(
    path, whole, workers, tmp_path
):
    two = Sweep(path, folder=tmp_path / "two", threads=2)
    two.run()
    assert two.dataset.file.read_bytes() == whole
    sweep, counted = Sweep(path, folder=tmp_path / "out", cluster=workers.scheduler_address), []
    models, hidden = path.parents[1] / "models", tmp_path / "hidden"
    with sweep:
        sweep.check()
        models.rename(hidden)  # the workers have them
        try:
            assert sweep.run(counted.append).done == sum(counted) == RUNS
        finally:
            hidden.rename(models)
    assert sweep.dataset.file.read_bytes() == whole


def test_workers_that_see_no_file_make_the_same_bytes_though_one_of_them_is_killed(
    path, whole, workers, tmp_path
):
    sweep = Sweep(path, folder=tmp_path, cluster=workers.scheduler_address)
    killed, (models, hidden) = [], (path.parents[1] / "models", path.parents[1] / "hidden")

    def kill(_):
        if not killed:
            killed.append(next(iter(workers.workers.values())).pid)
            os.kill(killed[0], signal.SIGKILL)

    with sweep:
        sweep.check()
        models.rename(hidden)  # the workers have them
        try:
            assert sweep.run(kill).done == RUNS
        finally:
            hidden.rename(models)
    assert killed
    assert sweep.dataset.file.read_bytes() == whole
    assert [entry.name for entry in tmp_path.iterdir()] == ["quick.sweep.parquet"]


VARY = {
    "control.feedback": "[5, -1]",
    "arm.model": "[../models/planar_2link.xml, ../models/planar_2lnk.xml]",
    "arm.joints": "[null, [elbow, knee]]",
}
FEW = [f"sweep.vary={{{', '.join(f'{key}: {values}' for key, values in VARY.items())}}}", "sweep.draw={}"]
MANY = ["sweep.draw={control.inverse.damping.maximum: [-1, 1]}", "sweep.samples=90"]


@pytest.mark.parametrize(("overrides", "told"), mostly_long([(FEW, 10), (MANY, 21)], 2), ids=["few", "many"])
def test_the_check_finds_the_same_on_the_workers_and_says_it_in_the_same_words(
    path, workers, tmp_path, overrides, told
):
    found = []
    for name, where in (("here", {"threads": 1}), ("there", {"cluster": workers.scheduler_address})):
        with pytest.raises(ScenarioError) as caught:
            Sweep(path, overrides, tmp_path / name, **where).check()
        found.append(str(caught.value).splitlines())
    assert found[0] == found[1]
    assert len(found[0]) <= told
    if overrides is FEW:
        models = path.parents[1] / "models"
        assert says(f'… "{models}/planar_2lnk.xml" … "planar_2link.xml"…') in found[0]
        assert says(f'… {models}/planar_2link.xml: … "knee" … "tip" … shoulder, elbow') in found[0]
    else:
        assert found[0][-1] == says("… more … other runs")


@pytest.mark.long
def test_the_check_of_a_sound_sweep_tells_the_same_contents_on_the_workers(path, workers, tmp_path):
    here, there = ({"threads": 1}, {"cluster": workers.scheduler_address})
    contents = [
        Sweep(path, (), tmp_path / name, **where).check() for name, where in (("a", here), ("b", there))
    ]
    assert contents[0] == contents[1]


@pytest.mark.parametrize(
    ("text", "got"), [("local:0", "local:0"), ("nobody", "nobody"), ("http://a:1", "http://a:1"), ("tcp://a", "tcp://a")]
)  # fmt: skip
def test_an_address_that_is_none_is_refused_with_its_forms(path, tmp_path, text, got):
    with pytest.raises(ClusterError) as caught:
        Sweep(path, folder=tmp_path, cluster=text)
    told = f"--cluster: … tcp://HOST:PORT or tls://HOST:PORT … Dask … local:N … {got}"
    assert str(caught.value) == says(told)


def test_without_dask_one_line_says_how_to_install_it(path, tmp_path, monkeypatch):
    monkeypatch.setattr(cluster.util, "find_spec", lambda _: None)
    with pytest.raises(ClusterError) as caught:
        Sweep(path, folder=tmp_path, cluster="local:2")
    assert str(caught.value) == "--cluster: needs Dask, which is not installed: pip install 'rmrc[cluster]'"


def test_nobody_who_answers_is_a_line(path, tmp_path, monkeypatch):
    monkeypatch.setattr(cluster, "_ANSWER", 0.3)
    with pytest.raises(
        ClusterError, match=r"^--cluster tcp://127.0.0.1:9: no Dask scheduler responds there \("
    ):
        Sweep(path, folder=tmp_path, cluster="tcp://127.0.0.1:9").check()


def test_tls_without_certificates_is_a_line(path, tmp_path):
    with pytest.raises(ClusterError) as caught:
        Sweep(path, folder=tmp_path, cluster="tls://127.0.0.1:9").check()
    assert str(caught.value) == (
        "--cluster tls://127.0.0.1:9: needs certificates; set distributed.comm.tls in Dask's configuration"
    )


@pytest.mark.parametrize("late", [False, True], ids=["at the start", "one that comes later"])
def test_a_worker_with_another_version_is_refused_by_name(path, workers, tmp_path, monkeypatch, late):
    real = facts.versions("distributed")
    monkeypatch.setattr(cluster.facts, "versions", lambda *_: {**real, "mujoco": "3.9.9"})
    if late:
        monkeypatch.setattr(cluster._Cluster, "refuse_unlike", lambda _: None)
        # another parcel, which no worker has accepted before
        (copy := path.with_name("late.yaml")).write_text(path.read_text())
        path = copy
    cluster._likeness.cache_clear()
    try:
        with pytest.raises(ClusterError) as caught:
            Sweep(path, folder=tmp_path, cluster=workers.scheduler_address).check()
    finally:
        cluster._likeness.cache_clear()
    refused = f"--cluster {workers.scheduler_address}: worker tcp://127.0.0.1:"
    what = f" has mujoco {real['mujoco']}, here 3.9.9: its rows would differ in their bits; install the same version"
    line = str(caught.value).removesuffix("; the rows so far are kept; rerun the command to resume")
    assert line.startswith(refused)
    assert re.sub(r"^\d+", "", line.removeprefix(refused)) == what


def _end(*_, **__):
    os._exit(1)


@pytest.mark.long
def test_runs_that_end_every_worker_end_the_sweep_with_a_line(path, tmp_path, monkeypatch):
    with dask.config.set({"distributed.scheduler.allowed-failures": 0}):
        sweep = Sweep(path, folder=tmp_path, cluster="local:1")
        sweep.check()
        monkeypatch.setattr(cluster, "_work", _end)
        with pytest.raises(ClusterError) as caught:
            sweep.run()
    assert re.fullmatch(
        r"--cluster local:1: runs \d+ to \d+ ended every worker that started them; check whether it has enough memory"
        "; the rows so far are kept; rerun the command to resume",
        str(caught.value),
    )


def _full(*_, **__):
    raise OSError(28, "No space left on device")


def test_a_worker_whose_disk_is_full_is_not_called_a_lost_scheduler(path, workers, tmp_path, monkeypatch):
    sweep = Sweep(path, folder=tmp_path, cluster=workers.scheduler_address)
    monkeypatch.setattr(cluster, "_work", _full)
    with pytest.raises(ClusterError) as caught:
        sweep.check()
    assert re.fullmatch(
        rf"--cluster {workers.scheduler_address}: a worker could not do runs \d+ to \d+ "
        r"\(\[Errno 28\] No space left on device\); the rows so far are kept; rerun the command to resume",
        str(caught.value),
    )


def _first_fails(indices, **_):
    return indices.start or _full()


def test_what_ended_beside_a_piece_that_failed_comes_before_the_failure(path, workers, monkeypatch):
    monkeypatch.setattr(cluster, "_work", _first_fails)
    address = cluster.Address.read(workers.scheduler_address)
    pieces = [range(i, i + 1) for i in range(4)]
    with cluster.opened(address, pack(draft_of(path))) as crew:
        running = dict(zip(crew.submit("check", pieces, threading.Event()), pieces, strict=True))
        while not all(one.done() for one in running):
            time.sleep(0.01)
        ended = crew.ended(running)
        assert [next(ended)[1] for _ in range(3)] == [1, 2, 3]
        with pytest.raises(ClusterError, match="could not do runs 0 to 0 "):
            next(ended)


def _start_of(indices, **_):
    return indices.start


def test_what_a_worker_took_with_it_is_not_waited_for_and_comes_once(monkeypatch):
    monkeypatch.setattr(cluster, "_work", _start_of)
    pieces = [range(i, i + 1) for i in range(3)]
    with (
        cluster._silence(),
        LocalCluster(n_workers=1, processes=False, dashboard_address=":0", silence_logs=50) as here,
        Client(here, set_as_default=False) as client,
    ):
        crew = cluster._Cluster(client, cluster.Address(here.scheduler_address, 0))
        crew._sent = crew.shared(None)
        running = dict(zip(crew.submit("check", pieces, threading.Event()), pieces, strict=True))
        while not all(one.done() for one in running):
            time.sleep(0.01)
        gather, (worker,) = client.gather, here.workers.values()

        async def after_its_end(some, **options):
            await worker.close()
            return await gather(some, **options)

        monkeypatch.setattr(client, "gather", after_its_end)
        assert list(crew.ended(running)) == []
        monkeypatch.undo()
        here.scale(2)  # another beside the one that is gone
        found = {}
        while len(found) < len(running):
            time.sleep(0.01)
            some = dict(crew.ended({one: indices for one, indices in running.items() if one not in found}))
            assert found.keys().isdisjoint(some)
            found |= some
        assert sorted(found.values()) == [0, 1, 2]
