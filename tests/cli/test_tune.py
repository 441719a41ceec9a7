"""The verb `tune`: tables, a block to paste, files; mistakes are a line each, and Ctrl-C shows what there is."""

import os
import re
import signal

import pytest

from project import ROOT
from rmrc.tuning.trials import Trials
from wording import says

TEXT = f"""
name: quick
arm: {{model: {ROOT}/models/planar_2link.xml, site: tip, start: [30 deg, -60 deg]}}
task: {{axes: [x, y]}}
control:
  period: 0.02
  feedback: 2
target: {{path: [{{line: {{to: [1.93, 0.0]}}}}], limits: {{velocity: 0.5}}}}
plant: {{kind: ideal}}
"""


@pytest.fixture(autouse=True)
def quick(tmp_path):
    (tmp_path / "quick.yaml").write_text(TEXT)


def lines_of(text):
    return [" ".join(line.split()) for line in text.splitlines() if line.strip()]


def test_it_prints_the_front_a_block_to_paste_and_what_that_costs(rmrc, tmp_path):
    asked = ["tune", "quick.yaml", "--runs", "60", "--perturbed", "1", "--offset", "0.001"]
    code, out, err = rmrc(*asked, "--threads", "1")
    assert (code, err) == (0, "")
    lines = lines_of(out)
    assert re.fullmatch(r"settings \d+ in [5-9]\d runs; \d+ keep the limits on every scenario", lines[1])
    text = " ".join(lines)
    assert "the scenario and 1 perturbed by at most: start 1 deg, target 0.001 m, payload 0 kg" in text
    # nothing is told of the robot: its delay is two periods, and how to tell it stands beside
    assert "robot assumed: delay 0 to 0.04 s, lag 0 to 0.005 s, noise 1e-05 rad" in text
    assert "give yours by --delay, --lag and --noise" in text
    assert "Pareto front" in lines and "recommended" in text
    assert "The setting as written is " in text
    assert lines[-3:] == [f"wrote recordings/quick.tune.{kind}" for kind in ("yaml", "png", "parquet")]
    # what is printed is the scenario's section, and is in the file as well
    block = re.search(r"^control:(?: .*\n|\n(?:  .*\n)+)", out, re.MULTILINE)[0]
    assert block in (tmp_path / "recordings/quick.tune.yaml").read_text()
    pasted = TEXT.replace("control:\n  period: 0.02\n  feedback: 2\n", block)
    (tmp_path / "pasted.yaml").write_text(pasted)
    for file in ("pasted.yaml", "recordings/quick.tune.yaml"):
        assert rmrc("run", file, "--no-record", "--quiet")[0] == 0


def test_nothing_feasible_is_exit_1_and_says_what_is_missed(rmrc, tmp_path):
    limits = ["--set", "control.limits.rate=0.01", "--set", "control.limits.on_excess=none"]
    limits += ["--only", "control.at_singularity=damp"]
    code, out, err = rmrc("tune", "quick.yaml", "--runs", "60", "--perturbed", "0", *limits)
    assert code == 1
    assert err == says("rmrc: … nearest … joint_rate.… rad/s … 0.01 …\n")
    assert lines_of(out)[-1] == "wrote recordings/quick.tune.parquet"
    assert [one.name for one in (tmp_path / "recordings").iterdir()] == ["quick.tune.parquet"]


def test_an_answer_that_recommends_the_setting_as_written_has_a_page(rmrc, tmp_path):
    """The only setting that is allowed is the one as written: it is recommended, and on the front."""
    (tmp_path / "quick.yaml").write_text(
        TEXT.replace("feedback: 2", "feedback: 2\n  inverse: {method: jparse}")
    )
    only = ["--only", "control.inverse.method=jparse", "--only", "control.at_singularity=damp"]
    only += ["--only", "control.inverse.gamma=0.1", "--only", "control.feedback=2"]
    code, out, _ = rmrc("tune", "quick.yaml", "--runs", "30", "--perturbed", "0", "--ideal", *only)
    assert code == 0 and "recommended, as written" in " ".join(out.split())
    assert rmrc("report", "recordings/quick.tune.parquet") == (0, "wrote recordings/quick.tune.html\n", "")
    page = (tmp_path / "recordings/quick.tune.html").read_text()
    assert "Recommended: jparse" in page and "recommended, as written: jparse" in page


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (["--payload", "1"], "--payload: … 0 … ideal … plant.kind"),
        (["--only", "control.inverse.method=dampd"], '--only control.inverse.method: … dampd … "damped"…'),
        (["--delay", "12ms..6ms"], "--delay: … smallest first … 12ms..6ms"),
        (["--ideal", "--noise", "1e-5"], "--ideal: … --noise …"),
    ],
)
def test_bad_input_is_one_line_exit_2_and_nothing_is_run(rmrc, tmp_path, options, line):
    assert rmrc("tune", "quick.yaml", *options) == (2, "", says(f"rmrc: error: {line}\n"))
    assert [one.name for one in tmp_path.iterdir()] == ["quick.yaml"]


@pytest.mark.skipif(os.name != "posix", reason="signals")
@pytest.mark.usefixtures("undrawn")
def test_ctrl_c_shows_what_was_found_so_far(rmrc, tmp_path, monkeypatch):
    run, batches = Trials.run, []

    def stopped(*arguments):
        batches.append(run(*arguments))
        if len(batches) == 3:
            os.kill(os.getpid(), signal.SIGINT)
        return batches[-1]

    monkeypatch.setattr(Trials, "run", stopped)
    code, out, err = rmrc("tune", "quick.yaml", "--runs", "12000", "--threads", "1")
    assert code == 130
    done = int(re.search(r"rmrc: interrupted after (\d+) of 12000 runs\n", err)[1])
    assert 5 <= done < 12000
    assert f" in {done} runs; " in " ".join(lines_of(out))
    assert (tmp_path / "recordings/quick.tune.parquet").is_file()
