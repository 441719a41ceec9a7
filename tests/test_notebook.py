"""Results in a notebook: no repr is longer than a screen, scorecards are HTML tables, a run draws itself."""

import html.parser

import pytest
from matplotlib import rc_context

import rmrc
from rmrc.results.run import Runs
from rmrc.results.scorecard import json_value

SCREEN = 24 * 80


class Table(html.parser.HTMLParser):
    """The cells of the rows of a table; tags must close in order."""

    def __init__(self, text):
        super().__init__()
        self.rows, self.open = [], []
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag, attrs):  # noqa: ARG002 (as the parser calls it)
        self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        elif tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open[-1] in ("td", "th"):
            self.rows[-1][-1] += data


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


def test_a_scorecard_is_a_table_of_its_defined_figures(run):
    head, *rows = Table(run._repr_html_()).rows
    assert head == ["metric", "value", "unit", "meaning"]
    wanted = {
        name: figure.value for name, figure in run.scorecard.items() if json_value(figure.value) is not None
    }
    assert [row[0] for row in rows] == list(wanted)
    for name, shown, *_ in rows:
        value = wanted[name]
        assert shown == value if isinstance(value, str) else float(shown) == pytest.approx(value, rel=1e-5)


def test_runs_side_by_side_show_what_differs(run):
    other = rmrc.run(rmrc.load("line_tracking").set({"control.feedback": 5}))
    head, *rows = Table(Runs({"as <it> is": run, "less": other})._repr_html_()).rows
    assert head == ["metric", "unit", "as <it> is", "less"]
    shown = {row[0]: row[2:] for row in rows}
    assert "ticks" not in shown and all(set(texts) != {"–"} for texts in shown.values())
    error = other.scorecard["position_error.max"].value
    assert float(shown["position_error.max"][1]) == pytest.approx(error, rel=1e-5)


def test_a_run_draws_itself_whatever_pyplot_did_before(run, tmp_path):
    picture = run.plot(tmp_path / "x.svg", panels=["sigma"], width=3.5)
    assert picture.get_figwidth() == 3.5 and (tmp_path / "x.svg").stat().st_size > 1000
    with rc_context({"figure.constrained_layout.use": True}):  # moves frames where a figure lets it
        picture = run.plot(panels=["sigma"])
        places = [axes.get_position().bounds for axes in picture.axes]
        assert picture._repr_png_().startswith(b"\x89PNG")
    assert [axes.get_position().bounds for axes in picture.axes] == places
