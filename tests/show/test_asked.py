"""Pictures of verbs in the width and the letters that a user asks for: those of a journal's column."""

import re
from itertools import pairwise

import pytest
from matplotlib.figure import Figure

from project import mostly_long
from rmrc.show.asked import ASKED, Asked, sized
from rmrc.show.figures import save
from rmrc.tuning.page import front_figure
from rmrc.tuning.space import METHOD

METHODS = ("damped", "filtered", "inverse", "jparse", "pseudoinverse", "selective", "truncated")


def sizes(path):
    """Return the width of an SVG [in] and the sizes of its letters [pt], which are written as px."""
    text = path.read_text("utf-8")
    width = float(re.search(r'<svg [^>]*?width="([0-9.]+)pt"', text)[1]) / 72
    return width, {float(size) for size in re.findall(r"font-size: ([0-9.]+)px", text)} | {
        float(size) for size in re.findall(r"font: ([0-9.]+)px", text)
    }


def front(path):
    points = [
        {
            METHOD: name,
            "error": error,
            "peak_rate": 1.9,
            "feasible": True,
            "role": None,
            "on_front": error < 2e-3,
        }
        for name in METHODS
        for error in (1e-3, 5e-3)
    ]
    points[0]["role"] = "recommended"
    save(front_figure("x", points), [path])


@pytest.mark.parametrize(
    ("draw", "width", "font"),
    [(front, 3.5, 8.0), (front, 7.16, 9.0)],
)
def test_a_picture_is_as_wide_as_asked_with_letters_that_can_be_read(tmp_path, draw, width, font):
    with sized(width, font):
        draw(tmp_path / "x.svg")
    found, letters = sizes(tmp_path / "x.svg")
    assert found == pytest.approx(width, abs=0.001)
    smaller = {round(0.7 * size, 6) for size in (font, font - 1.0)}  # superscripts and subscripts
    assert {font} <= letters <= {font, font - 1.0} | smaller
    assert ASKED.get() == Asked()  # nothing is left of what was asked


@pytest.mark.parametrize("verb", mostly_long(["inspect", "workspace"], 2))
def test_verbs_take_the_options(rmrc, tmp_path, verb):
    more = ["--cells", "30", "--out", str(tmp_path)] if verb == "workspace" else []
    path = tmp_path / "x.svg"
    code, _, err = rmrc(verb, "planar_2link", *more, "-o", str(path), "--width", "88mm", "--font", "8")
    assert (code, err.count("error")) == (0, 0)
    width, letters = sizes(path)
    assert width == pytest.approx(88 / 25.4, abs=0.001)
    assert letters <= {7.0, 8.0, 5.6}
    code, _, err = rmrc(verb, "planar_2link", *more, "-o", str(path), "--width", "88")
    assert code == 2
    assert "must be a length between 2in and 40in, such as 3.5in" in err


def test_methods_that_do_the_same_are_told_apart(monkeypatch, tmp_path):
    drawn = []
    monkeypatch.setattr(Figure, "savefig", lambda self, *_, **__: drawn.append(self))
    front(tmp_path / "x.png")
    (axes,) = drawn[0].get_axes()
    rings = [line for line in axes.get_lines() if line.get_label() in METHODS]
    assert [line.get_label() for line in rings] == list(METHODS)
    around = [line.get_markersize() for line in rings]
    assert all(later < earlier for earlier, later in pairwise(around))  # within each other
    assert {line.get_markerfacecolor() for line in rings} == {"none"}
    assert len({(line.get_color(), line.get_marker()) for line in rings}) == len(METHODS)
