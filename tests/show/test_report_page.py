"""The page of a result: it says what the columns hold, has all in itself, and runs nothing that a file names."""

import base64
import dataclasses
import json
import re
import shutil
from html.parser import HTMLParser
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_palette import SIGHTS, contrast, distance

import rmrc
from browsers import chromium
from project import ROOT, undrawn
from rmrc.results.run import Run, save_runs
from rmrc.scenario import load, loads
from rmrc.show import traces
from rmrc.show.page import Page
from rmrc.show.sheets import Sheet
from rmrc.simulation.prepare import prepare
from rmrc.support.errors import QuestionError
from rmrc.tuning.page import page, report
from wording import says

BLOW_UP = ROOT / "scenarios/blow_up.yaml"


class Parsed(HTMLParser):
    """Tags with their attributes, and the text by the name of the innermost part that has one."""

    def __init__(self, html):
        super().__init__()
        self.tags, self.texts, self._inside = [], {}, []
        self.feed(html)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if "id" in dict(attrs) and tag in ("pre", "script"):
            self._inside.append(dict(attrs)["id"])

    def handle_endtag(self, tag):
        if tag in ("pre", "script") and self._inside:
            self._inside.pop()

    def handle_data(self, data):
        name = self._inside[-1] if self._inside else ""
        self.texts[name] = self.texts.get(name, "") + data

    def all(self, tag):
        return [attributes for name, attributes in self.tags if name == tag]


SVG = '<svg><clipPath id="a"><rect/></clipPath><g clip-path="url(#a)"/></svg>'


def unpacked(text):
    return np.frombuffer(base64.b64decode(text), "<f4")


@pytest.fixture(scope="module")
def left(tmp_path_factory):
    """Return the folder with what run, compare, sweep and tune left."""
    folder = tmp_path_factory.mktemp("left")
    short = load(ROOT / "scenarios/approach_singularity.yaml").set({"control.period": 0.01})
    with undrawn():
        rmrc.run(BLOW_UP, out=folder, record=False)
        rmrc.compare(BLOW_UP, {"control.inverse.method": ["inverse", "damped"]}, out=folder, record=False)
        rmrc.sweep(short, {"control.feedback": [5.0, 10.0, 20.0]}, out=folder, threads=1)
        rmrc.tune(short, runs=8, perturbed=0, ideal=True, out=folder, threads=1)
    return folder


@pytest.fixture(scope="module")
def pages(left):
    """Return the pages of these, as text and parsed."""
    names = {
        "run": "blow_up.npz", "compare": "blow_up.compare.npz",
        "sweep": "approach_singularity.sweep.parquet", "tune": "approach_singularity.tune.parquet",
    }  # fmt: skip
    found = {}
    for kind, name in names.items():
        with pytest.MonkeyPatch.context() as patch:
            if kind != "run":  # enough of a picture: its parts are named alike in each
                patch.setattr("rmrc.show.page.as_svg", lambda _: SVG)
            found[kind] = Parsed(report(left / name, left / f"{kind}.html").read_text("utf-8"))
    return found


@pytest.mark.parametrize("kind", ["run", "compare", "sweep", "tune"])
def test_a_page_asks_for_nothing_and_names_nothing_twice(pages, left, kind):
    found = pages[kind]
    for _, attributes in found.tags:
        for name in ("src", "href", "xlink:href", "action", "srcset"):
            assert attributes.get(name, "#").startswith(("#", "data:"))
    assert "default-src 'none'" in next(a["content"] for a in found.all("meta") if "http-equiv" in a)
    names = [attributes["id"] for _, attributes in found.tags if "id" in attributes]
    assert len(names) == len(set(names))
    used = set(re.findall(r"url\(#([^)]*)\)", (left / f"{kind}.html").read_text("utf-8")))
    assert used <= set(names)  # clip paths of the pictures were renamed with what uses them
    assert (left / f"{kind}.html").stat().st_size < 3_000_000


def test_the_plots_of_a_page_hold_the_columns_and_their_peaks(pages, left):
    run = Run.read(left / "blow_up.npz")
    rates, sigma, *_ = json.loads(pages["run"].texts["traces"])
    rows = np.searchsorted(run["time"], unpacked(rates["time"]).astype(float) - run.period / 2)
    for j, one in enumerate(rates["series"][: len(run.joints)]):
        drawn = unpacked(one["values"])
        np.testing.assert_array_equal(drawn, run["qdot_cmd"][rows, j].astype("<f4"))
        assert np.abs(drawn).max() == np.float32(np.abs(run["qdot_cmd"][:, j]).max())
    assert unpacked(sigma["series"][0]["values"]).min() == np.float32(run["sigma"][:, -1].min())
    peak = run.scorecard["joint_rate_cmd.peak"].value
    assert f"peak {peak:,.0f} rad/s" in pages["run"].texts[""]
    assert rates["range"][1] < 0.01 * peak  # off scale: the limits are seen


@pytest.mark.parametrize(("limit", "told", "lines"), [
    ((3.0, 5.0), "Joint rates; dotted: limits", 4), ((3e5, 5e5), "limits from 300,000 rad/s beyond the plot", 0),
])  # fmt: skip
def test_the_title_of_the_rates_says_where_their_limits_are(left, limit, told, lines):
    run = dataclasses.replace(Run.read(left / "blow_up.npz"), rate_limit=limit)
    rates = traces.of_run(run).panels[0]
    assert rates.title.endswith(told)
    assert len(rates.lines) == lines
    assert rates.unit == "rate [rad/s]"
    mixed = dataclasses.replace(run, is_slide=(False, True))
    assert traces.of_run(mixed).panels[0].unit == "rate [rad/s, m/s]"


def test_what_a_page_gives_to_paste_is_the_scenario_that_ran(pages, left):
    (text,) = [text for name, text in pages["run"].texts.items() if name.startswith("text-")]
    named = text.replace("planar_2link.xml", str(ROOT / "models/planar_2link.xml"))
    assert loads(named).model_dump() == prepare(load(BLOW_UP)).scenario.model_dump()
    assert "gravity_compensation: null" not in text  # as by default
    (text,) = [text for name, text in pages["tune"].texts.items() if name.startswith("text-")]
    best = load(left / "approach_singularity.tune.yaml").control
    base = (
        (ROOT / "scenarios/approach_singularity.yaml").read_text().replace("../models", str(ROOT / "models"))
    )
    assert loads(re.sub(r"(?ms)^control:.*?(?=^\w)", text, base)).control == best


def test_a_page_says_what_the_files_say(pages, left):
    facts = json.loads((left / "blow_up.json").read_text())
    for one in facts["expect"]:
        assert one["text"] in pages["run"].texts[""]
    for line in facts["assumed"]:
        assert line in pages["run"].texts[""]
    assert facts["versions"]["mujoco"] in pages["run"].texts[""]
    assert "3 of 3 runs completed the path" in pages["sweep"].texts[""]
    assert "Recommended: " in pages["tune"].texts[""]


def test_a_page_begins_with_the_verdict_and_has_the_baseline_beside_the_run(left, tmp_path, monkeypatch):
    monkeypatch.setattr("rmrc.show.page.as_svg", lambda _: SVG)
    runs = rmrc.read_runs(left / "blow_up.compare.npz")
    run = dataclasses.replace(runs["damped"], baseline=runs["inverse"])
    run.save(tmp_path / "both.npz")
    facts = json.loads((left / "blow_up.json").read_text())
    (tmp_path / "both.json").write_text(json.dumps({**facts, "verdict": run.verdict}))
    parsed = Parsed(report(tmp_path / "both.npz").read_text("utf-8"))
    assert run.verdict in parsed.texts[""] and "baseline\npeak" in parsed.texts[""]
    panels = json.loads(parsed.texts["traces"])
    rates, errors = (next(one for one in panels if word in one["title"]) for word in ("rates", "error"))
    found = {one["label"]: one for one in rates["series"]}
    for j, name in enumerate(run.joints):
        one = found[f"{name}, baseline"]
        assert np.nanmax(unpacked(one["values"])) == np.float32(runs["inverse"]["qdot_cmd"][:, j].max())
        assert one["light"] == traces.GRAYS[0] and one["dash"] and one["shown"]
        assert not found[f"{name}, plain inverse"]["shown"]
    assert rates["range"][1] < 20.0  # rad/s, so that the run is seen beside 12,000
    assert sum(one["label"].startswith("baseline, ") for one in errors["series"]) == 2
    assert not any("baseline" in one["label"] for one in traces.of_run(runs["damped"]).json()[0]["series"])


@pytest.mark.parametrize("sight", SIGHTS)
def test_curves_of_a_page_are_told_apart_and_no_joint_shares_its_color(left, sight):
    """On both papers of the page, for all color vision: ΔE of 20, contrast of 3; with a baseline."""
    runs = rmrc.read_runs(left / "blow_up.compare.npz")
    run = dataclasses.replace(runs["damped"], baseline=runs["inverse"])
    papers = re.findall(r"--paper: #(\w{6})", (Path(traces.__file__).parent / "assets/page.css").read_text())
    panels = {panel["title"].split(" ")[0]: panel["series"] for panel in traces.of_run(run).json()}
    assert {"Joint", "Smallest", "Tracking"} <= set(panels)
    for theme, paper in zip(("light", "dark"), papers, strict=True):
        colors = {title: {int(one[theme][1:] + "ff", 16) for one in panel} for title, panel in panels.items()}
        for some in colors.values():
            for first, second in combinations(some, 2):
                assert distance(first, second, sight) >= 20.0, (f"{first:08x}", f"{second:08x}")
            assert min(contrast(one, int(paper + "ff", 16)) for one in some) >= 3.0
        joints = colors.pop("Joint")
        assert not joints & (colors["Smallest"] | colors.get("Status", set()))


@pytest.mark.usefixtures("undrawn")
def test_a_sweep_can_be_plotted_and_a_search_is_told_from_it(rmrc, left):
    rows = str(left / "approach_singularity.sweep.parquet")
    assert rmrc("plot", rows, "-o", "x.svg", "--width", "3.5in")[:2] == (0, "wrote x.svg\n")
    code, _, err = rmrc("plot", rows, "--panels", "rates")
    assert (code, err) == (2, says("rmrc: error: --panels: … rates … distributions, keys\n"))
    code, _, err = rmrc("plot", str(left / "approach_singularity.tune.parquet"))
    assert (code, err) == (2, says("rmrc: error: … not of a sweep…\n"))


def test_names_of_a_file_are_text_and_nothing_else(left, tmp_path):
    hostile = ("<img src=x onerror=alert(1)>", '</script><script>alert("&")</script>')
    run = dataclasses.replace(Run.read(left / "blow_up.npz"), joints=hostile)
    run.save(tmp_path / "h.npz")
    facts = json.loads((left / "blow_up.json").read_text())
    (tmp_path / "h.json").write_text(json.dumps({**facts, "name": hostile[1], "assumed": list(hostile)}))
    found = Parsed(report(tmp_path / "h.npz").read_text("utf-8"))
    assert len(found.all("script")) == 2 and not found.all("img")
    assert hostile[0] in found.texts[""]
    assert hostile[1] in [
        one["label"].split(", comm")[0] for one in json.loads(found.texts["traces"])[0]["series"]
    ]


@pytest.mark.usefixtures("pages")
def test_equal_results_give_equal_pages(left, tmp_path):
    again = report(left / "blow_up.npz", tmp_path / "again.html")
    assert again.read_bytes() == (left / "run.html").read_bytes()


def test_runs_of_different_periods_share_an_axis(left):
    fast = Run.read(left / "blow_up.npz")
    slow = dataclasses.replace(
        fast, period=2 * fast.period, columns={name: values[::2] for name, values in fast.columns.items()}
    )
    rates = traces.of_runs({"fast": fast, "slow": slow}).panels[0]
    np.testing.assert_array_equal(rates.time, np.round(fast["time"], 9))
    np.testing.assert_array_equal(np.isnan(rates.traces[1].values), np.arange(len(fast)) % 2 == 1)


@given(st.integers(1, 5000), st.integers(1, 8), st.integers(0, 2**32 - 1))
def test_thinning_keeps_the_extremes_of_every_curve_and_the_room(count, curves, seed):
    values = [np.random.default_rng([seed, i]).normal(size=count) for i in range(curves)]
    rows = traces.kept(values, 2000)
    assert (np.diff(rows) > 0).all() and {0, count - 1} <= set(rows.tolist())
    # the last, shorter span is kept whole: at most as many rows again as there are spans
    assert len(rows) * (curves + 1) <= 2000 + (curves + 1) * (2 + -(-count // 10))
    for one in values:
        assert one[rows].min() == one.min() and one[rows].max() == one.max()


@pytest.mark.parametrize("lane", [0.0, 1.0])
def test_thinning_keeps_the_ends_of_states(lane):
    held = np.full(7000, np.nan)
    held[[2381, *range(4000, 4500)]] = lane
    rows = traces.kept([held], 100)
    assert list(rows) == [0, 2380, 2381, 2382, 3999, 4000, 4499, 4500, 6999]
    assert len(traces.kept([np.where(np.arange(7000) % 2, lane, np.nan)], 100)) <= 100  # too many ends


def test_what_is_no_result_is_refused_in_one_line(rmrc, left, tmp_path):
    (tmp_path / "x.parquet").write_text("no")
    (tmp_path / "x.npz").write_text("no")
    (tmp_path / "x.json").write_text("{}")
    shutil.copy(left / "blow_up.npz", tmp_path / "alone.npz")
    for arguments, told in (
        (["x.parquet"], "x.parquet: … damaged"),
        (["x.npz"], "x.npz: … damaged"),
        (["alone.npz"], "alone.json: … missing next to"),
        (["missing.npz"], "missing.npz: no such file"),
        (["missing.parquet"], "missing.parquet: no such file"),
        (["x.json", "-o", "x.pdf"], "x.pdf: must end in .html"),
    ):
        paths = [str(tmp_path / one) if one[0] != "-" else one for one in arguments]
        code, out, told_of = rmrc("report", *paths)
        assert (code, out) == (2, "")
        assert says(f"rmrc: error: …{told}…\n") == told_of
    empty = dataclasses.replace(
        (run := Run.read(left / "blow_up.npz")), columns={name: one[:0] for name, one in run.columns.items()}
    )
    save_runs(tmp_path / "blow_up.npz", {"blow_up": empty})
    shutil.copy(left / "blow_up.json", tmp_path)
    with pytest.raises(QuestionError, match="no tick"):
        page(tmp_path / "blow_up.npz")


def test_a_table_has_headings_for_rows_and_columns(tmp_path):
    made = Page("p")
    made.table(Sheet("title", ("", "a\nb"), [("row", "1"), ("MISSED", "2")], frozenset({0})))
    made.write(tmp_path / "p.html")
    found = Parsed((tmp_path / "p.html").read_text("utf-8"))
    assert [one["scope"] for one in found.all("th")] == ["col", "row", "row"]
    assert found.all("caption")


@pytest.fixture(scope="module")
def browser():
    with chromium() as found:
        yield found


@pytest.mark.browser
@pytest.mark.long
@pytest.mark.xdist_group("report in a browser")
@pytest.mark.usefixtures("pages")
@pytest.mark.parametrize("kind", ["run", "compare", "sweep", "tune"])
def test_a_browser_shows_a_page_without_complaint(browser, left, kind):
    import axe_playwright_python

    axe = (Path(axe_playwright_python.__path__[0]) / "axe.min.js").read_text("utf-8")
    address, complaints, asked = (left / f"{kind}.html").as_uri(), [], []
    shown = browser.new_page(viewport={"width": 1280, "height": 720})
    shown.on("console", lambda message: complaints.append(message.text))
    shown.on("pageerror", lambda error: complaints.append(str(error)))
    shown.on("request", lambda request: asked.append(request.url))
    for scheme in ("light", "dark"):
        shown.emulate_media(color_scheme=scheme)
        shown.goto(address)
        assert (shown.locator("canvas").count() > 3) is (kind in ("run", "compare"))
        if kind in ("run", "compare"):
            inks = shown.evaluate(
                "[...document.querySelectorAll('canvas')].map(c => new Set(new Uint32Array("
                "c.getContext('2d').getImageData(0, 0, c.width, c.height).data.buffer)).size)"
            )
            assert min(inks) > 3  # none is blank
            shown.locator(".u-over").first.hover(position={"x": 300, "y": 60})
            read = shown.locator(".u-legend tr:first-child .u-value").all_inner_texts()
            assert len(set(read)) == 1 and read[0] != "–"  # one time for all panels
            name = shown.locator(".u-label[role=button]").first
            line = "e => getComputedStyle(e).textDecorationLine"
            for key, pressed, look in (("Enter", "false", "line-through"), (" ", "true", "none")):
                assert name.evaluate(line) != look
                name.focus()
                name.press(key)
                assert (name.get_attribute("aria-pressed"), name.evaluate(line)) == (pressed, look)
            name.press("Enter")  # the rules below hold of a hidden line as well
        shown.evaluate(axe)
        wrong = shown.evaluate("axe.run()")["violations"]
        assert [(one["id"], one["nodes"][0]["html"]) for one in wrong] == []
    assert set(asked) == {address} and complaints == []
    shown.close()


@pytest.mark.browser
@pytest.mark.long
@pytest.mark.xdist_group("report in a browser")
@pytest.mark.usefixtures("pages")
@pytest.mark.parametrize("kind", ["run", "compare"])
def test_the_logarithmic_axis_of_a_page_has_three_powers_of_ten(browser, left, kind):
    """What the page writes on the canvas of the singular values; small ones are not rounded to 0."""
    shown = browser.new_page(viewport={"width": 1280, "height": 720})
    shown.add_init_script("""
        const write = CanvasRenderingContext2D.prototype.fillText;
        CanvasRenderingContext2D.prototype.fillText = function (text, ...rest) {
          (this.canvas.written ||= []).push(text);
          return write.call(this, text, ...rest);
        };""")
    shown.goto((left / f"{kind}.html").as_uri())
    written = shown.evaluate("[...document.querySelectorAll('canvas')].map(c => c.written || [])")
    (sigma,) = [texts for texts in written if any(text.startswith("σ") for text in texts)]
    small = {f"1e-{n}" for n in range(4, 10)} | {"0.001", "0.01", "0.1"}
    assert len(small & set(sigma)) >= 2 and "1" in sigma
    shown.close()
