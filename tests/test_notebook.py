"""Results in a notebook: no repr is longer than a screen, tables are HTML, columns and figures go into pandas."""

import html.parser
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib import rc_context

import rmrc
from rmrc.results.run import Runs
from rmrc.support.errors import QuestionError

SCREEN = 24 * 80


class Table(html.parser.HTMLParser):
    """The cells of the rows of a table; tags must close in order."""

    def __init__(self, text):
        super().__init__()
        self.rows, self.open, self.text = [], [], text
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
        run, run.scorecard, Runs(a=run, b=run), prepared, prepared.scenario, prepared.arm, prepared.reference,
        rmrc.inspect("planar_2link"), rmrc.ik("planar_2link", [1.0, 1.0]),
        rmrc.statics("planar_2link", [1, 0, 0, 0, 0, 0]), rmrc.check(prepared.arm.path),
    ]  # fmt: skip
    for answer in answers:
        text = repr(answer)
        assert len(text) <= SCREEN
        assert "\n" not in text
        assert text.startswith(type(answer).__name__)
    assert "line_tracking" in repr(run)


def test_a_scorecard_is_a_table_of_its_defined_figures(run):
    head, *rows = Table(run._repr_html_()).rows
    assert head == ["metric", "value", "unit", "meaning"]
    shown = {row[0]: row[1] for row in rows}
    assert "secondary_error.max_time" in run.scorecard and "secondary_error.max_time" not in shown
    undefined = {
        name
        for name, figure in run.scorecard.items()
        if figure.value == "" or (isinstance(figure.value, float) and np.isnan(figure.value))
    }
    for name, figure in run.scorecard.items():
        if {name, name.removesuffix("_time")} & undefined:
            assert name not in shown
        elif isinstance(figure.value, float):
            assert float(shown[name]) == pytest.approx(figure.value, rel=1e-5)
        else:
            assert shown[name] == str(figure.value)


def test_runs_side_by_side_show_what_differs(run):
    other = rmrc.run(rmrc.load("line_tracking").set({"control.feedback": 5}))
    head, *rows = Table(Runs({"as <it> is": run, "less": other})._repr_html_()).rows
    assert head == ["metric", "unit", "as <it> is", "less"]
    shown = {row[0]: row[2:] for row in rows}
    assert "position_error.max" in shown
    assert "ticks" not in shown  # both have as many
    assert all(set(values) != {"–"} for values in shown.values())  # NaN is not equal to NaN
    assert float(shown["position_error.max"][1]) == pytest.approx(
        other.scorecard["position_error.max"].value, rel=1e-5
    )


@pytest.fixture
def pandas(monkeypatch):
    """Stand in for pandas, which need not be installed: frames that keep what they are given."""

    class DataFrame(SimpleNamespace):
        def __init__(self, data, index):
            super().__init__(data=data, index=index)

        @classmethod
        def from_dict(cls, rows, orient):
            assert orient == "index"
            return cls(rows, list(rows))

    fake = SimpleNamespace(DataFrame=DataFrame, Index=lambda values, name: (name, values))
    monkeypatch.setitem(sys.modules, "pandas", fake)


@pytest.mark.usefixtures("pandas")
def test_columns_and_figures_go_into_pandas(run):
    frame = run.to_pandas()
    assert frame.index[0] == "time"
    np.testing.assert_array_equal(frame.index[1], run["time"])
    np.testing.assert_array_equal(frame.data["qdot_cmd.elbow"], run["qdot_cmd"][:, 1])
    np.testing.assert_array_equal(frame.data["pose.2"], run["pose"][:, 2])
    np.testing.assert_array_equal(frame.data["status"], run["status"])
    assert len(frame.data) == sum(v.reshape(len(run), -1).shape[1] for v in run.columns.values()) - 1
    card = run.scorecard.to_pandas().data
    assert card["position_error.max"]["value"] == run.scorecard["position_error.max"].value
    rows = Runs(a=run).to_pandas().data
    assert rows["a"]["position_error.max"] == run.scorecard["position_error.max"].value


def test_without_pandas_one_line_says_how_to_get_it(run, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    for asked in (run, run.scorecard, Runs(a=run)):
        with pytest.raises(QuestionError, match="pip install pandas"):
            asked.to_pandas()


def test_a_run_draws_itself(run, tmp_path):
    picture = run.plot(tmp_path / "x.svg", panels=["sigma"], width=3.5)
    assert picture.get_figwidth() == 3.5
    assert (tmp_path / "x.svg").stat().st_size > 1000


def test_a_notebook_shows_the_plot_of_a_run_whatever_pyplot_did_before(run, tmp_path):
    with rc_context(
        {"figure.constrained_layout.use": True}
    ):  # moves frames where a figure lets it, with a warning
        picture = run.plot(tmp_path / "x.png", panels=["sigma"])
        places = [axes.get_position().bounds for axes in picture.axes]
        assert picture._repr_png_().startswith(b"\x89PNG")
    assert [axes.get_position().bounds for axes in picture.axes] == places
    assert [axes.get_position().bounds for axes in run.plot(panels=["sigma"]).axes] == places
