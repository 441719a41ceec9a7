"""Recordings that are made anew of what else a run left."""

import json
import os
import shutil
import signal
import subprocess
import sys
from urllib.request import urlopen

import pytest
from rerun.chunk import RrdReader

from processes import started
from project import ROOT, undrawn
from rmrc.recording.single import read_columns
from rmrc.results.run import read_runs
from rmrc.study.rerecording import rerecord
from rmrc.study.verbs import compare, run
from rmrc.support.errors import QuestionError
from wording import says

TEXT = f"""
name: quick
arm: {{model: {ROOT}/models/planar_2link.xml, site: tip, start: [60 deg, -120 deg]}}
task: {{axes: [x, y]}}
control: {{period: 0.01, inverse: {{method: damped}}}}
target: {{path: [{{line: {{by: [0.1, 0.0]}}}}]}}
expect: {{position_error.max: {{below: 0.1}}}}
baseline: {{control.inverse.method: pseudoinverse}}
"""


@pytest.fixture(scope="module")
def left(tmp_path_factory):
    """The folder of what a run and a comparison left."""
    folder = tmp_path_factory.mktemp("left")
    (folder / "quick.yaml").write_text(TEXT)
    with undrawn():
        run(folder / "quick.yaml", out=folder)
        compare(folder / "quick.yaml", {"control.inverse.method": ["damped", "pseudoinverse"]}, out=folder)
    return folder


def texts(path):
    """Every text of a recording, by entity."""
    found = {}
    for chunk in RrdReader(path).stream().filter(content="/text/**"):
        found[chunk.entity_path] = chunk.to_record_batch().column("TextDocument:text").to_pylist()
    assert len(found) >= 3
    return found


def same(path, other, *whose, **kinds):
    mine, theirs = read_columns(path, *whose, **kinds), read_columns(other, *whose, **kinds)
    return mine.keys() == theirs.keys() and all(
        mine[name].tobytes() == theirs[name].tobytes() for name in mine
    )


def test_a_run_is_recorded_anew_with_its_baseline_and_its_texts(left, tmp_path):
    rerecord(left / "quick.npz", tmp_path / "new.rrd")
    assert same(tmp_path / "new.rrd", left / "quick.rrd")
    assert same(tmp_path / "new.rrd", left / "quick.rrd", baseline=True)
    assert texts(tmp_path / "new.rrd") == texts(left / "quick.rrd")


def test_a_comparison_is_recorded_anew_with_its_table(left, tmp_path):
    rerecord(left / "quick.compare.npz", tmp_path / "new.rrd")
    labels = list(read_runs(left / "quick.compare.npz"))
    assert labels == ["damped", "pseudoinverse"]
    for label in labels:
        assert same(tmp_path / "new.rrd", left / "quick.compare.rrd", label)
    assert texts(tmp_path / "new.rrd") == texts(left / "quick.compare.rrd")


def test_without_what_is_needed_it_is_one_line(left, tmp_path):
    shutil.copy(left / "quick.npz", tmp_path)
    with pytest.raises(QuestionError) as caught:
        rerecord(tmp_path / "quick.npz", tmp_path / "new.rrd")
    assert str(caught.value) == says(f"{tmp_path}/quick.json: is missing; …")
    facts = json.loads((left / "quick.json").read_text())
    facts["scenario"]["arm"]["model"] = str(tmp_path / "gone.xml")
    (tmp_path / "quick.json").write_text(json.dumps(facts))
    with pytest.raises(QuestionError) as caught:
        rerecord(tmp_path / "quick.npz", tmp_path / "new.rrd")
    assert str(caught.value) == says(f"{tmp_path}/quick.json: … gone.xml …")
    assert not (tmp_path / "new.rrd").exists()


@pytest.mark.long
def test_the_verb_serves_columns_without_a_recording_and_leaves_nothing(left, tmp_path):
    for name in ("quick.npz", "quick.json"):
        shutil.copy(left / name, tmp_path)
    command = [sys.executable, "-m", "rmrc", "replay", "--web", "--at", "0.1", str(tmp_path / "quick.npz")]
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    environment = {**os.environ, "TMPDIR": str(temporary)}
    with started(command, stdout=subprocess.PIPE, text=True, env=environment) as process:
        url = process.stdout.readline().strip()
        with urlopen(url.partition("?")[0] + "/recording.rrd", timeout=30) as answer:
            (tmp_path / "served.rrd").write_bytes(answer.read())
        process.send_signal(signal.SIGTERM)
        assert process.wait(30) == 143
    assert same(tmp_path / "served.rrd", left / "quick.rrd")
    assert not list(temporary.iterdir()) and not (tmp_path / "quick.rrd").exists()
