"""Results in a notebook: no repr is longer than a screen, and a run draws itself."""

import pytest
from matplotlib import rc_context

import rmrc
from rmrc.results.run import Runs

SCREEN = 24 * 80


@pytest.fixture(scope="module")
def run():
    return rmrc.run("line_tracking")


def test_no_repr_is_longer_than_a_screen(run):
    prepared = rmrc.prepare(rmrc.load("line_tracking"))
    answers = [
        run,
        run.scorecard,
        Runs(a=run, b=run),
        prepared,
        prepared.scenario,
        prepared.arm,
        prepared.reference,
    ]
    for answer in answers:
        text = repr(answer)
        assert len(text) <= SCREEN and "\n" not in text and text.startswith(type(answer).__name__)
    assert "line_tracking" in repr(run)


def test_a_run_draws_itself_whatever_pyplot_did_before(run, tmp_path):
    picture = run.plot(tmp_path / "x.svg", panels=["sigma"], width=3.5)
    assert picture.get_figwidth() == 3.5 and (tmp_path / "x.svg").stat().st_size > 1000
    with rc_context({"figure.constrained_layout.use": False, "figure.autolayout": True}):
        again = run.plot(tmp_path / "y.svg", panels=["sigma"], width=3.5)
        assert again._repr_png_().startswith(b"\x89PNG")
    assert (tmp_path / "x.svg").read_bytes() == (tmp_path / "y.svg").read_bytes()
