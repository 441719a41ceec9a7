"""The page of a result: it says what the columns hold, has all in itself, and runs nothing that a file names."""

import base64
import dataclasses
import json
import re
import shutil
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

import rmrc
from browsers import chromium, widths
from project import ROOT, undrawn
from rmrc.results.run import Run, save_runs
from rmrc.scenario import load, loads
from rmrc.show.panels import lanes, panels
from rmrc.show.sheets import number
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


def unpacked(text):
    return np.frombuffer(base64.b64decode(text), "<f4")


@pytest.fixture(scope="module")
def pages(left):
    """Return the parsed pages of what the verbs left, by verb."""
    short = load(ROOT / "scenarios/approach_singularity.yaml").set({"control.period": 0.01})
    with undrawn():
        rmrc.sweep(short, {"control.feedback": [5.0, 10.0, 20.0]}, out=left, threads=1)
        rmrc.tune(short, runs=8, perturbed=0, ideal=True, out=left, threads=1)
    names = {
        "run": "blow_up.npz", "compare": "blow_up.compare.npz",
        "sweep": "approach_singularity.sweep.parquet", "tune": "approach_singularity.tune.parquet",
    }  # fmt: skip
    written = {verb: report(left / name, left / f"{verb}.html") for verb, name in names.items()}
    return {verb: Parsed(path.read_text("utf-8")) for verb, path in written.items()}


@pytest.fixture(scope="module")
def beside(compared):
    """Return a damped run with the inverse as its baseline."""
    return dataclasses.replace(compared["damped"], baseline=compared["inverse"])


@pytest.mark.parametrize("verb", ["run", "compare", "sweep", "tune"])
def test_a_page_asks_for_nothing_and_names_nothing_twice(pages, left, verb):
    page = pages[verb]
    for _, attributes in page.tags:
        for name in ("src", "href", "xlink:href", "action", "srcset"):
            assert attributes.get(name, "#").startswith(("#", "data:"))
    assert "default-src 'none'" in next(a["content"] for a in page.all("meta") if "http-equiv" in a)
    names = [attributes["id"] for _, attributes in page.tags if "id" in attributes]
    assert len(names) == len(set(names))
    text = (left / f"{verb}.html").read_text("utf-8")
    assert set(re.findall(r"url\(#([^)]*)\)", text)) <= set(names)
    assert {part.split("/")[0] for part in re.findall(r"https?://(\S+)", text)} <= {
        "www.w3.org",
        "github.com",
    }
    assert len(page.all("figure")) == 1 and len(text) < 3_000_000


@pytest.mark.parametrize(("verb", "file"), [("run", "blow_up.npz"), ("compare", "blow_up.compare.npz")])
def test_a_page_has_one_plot_for_each_panel_and_holds_the_columns_with_their_peaks(pages, left, verb, file):
    runs = rmrc.read_runs(left / file)
    data, wanted = json.loads(pages[verb].texts["data"]), panels(runs)
    plots = [attributes["id"] for attributes in pages[verb].all("div") if attributes.get("class") == "plot"]
    assert plots == [f"plot-{i}" for i in range(len(data))]
    assert [plot["title"] for plot in data] == [*(panel.title for panel in wanted), "Status"]
    assert [lane["name"] for lane in data[-1]["lanes"]] == [lane.name for lane in lanes(runs)]
    for plot, panel in zip(data, wanted, strict=False):
        assert tuple(plot["range"]) == panel.range
        for drawn, curve in zip(plot["curves"], panel.curves, strict=True):
            values = (
                np.where(curve.values > 0.0, curve.values, np.nan) if panel.is_logarithmic else curve.values
            )
            rows = np.abs(curve.time[:, None] - unpacked(plot["time"])[None, ::50]).argmin(axis=0)
            np.testing.assert_array_equal(unpacked(drawn["values"])[::50], values[rows].astype("<f4"))
            for peak in (np.nanmin, np.nanmax):
                assert peak(unpacked(drawn["values"])) == np.float32(peak(values))
        for text in panel.beyond:
            assert text in pages[verb].texts[""]


def test_what_a_page_gives_to_paste_is_the_scenario_that_ran(pages, left):
    text = pages["run"].texts["text"]
    named = text.replace("planar_2link.xml", str(ROOT / "models/planar_2link.xml"))
    assert loads(named).model_dump() == prepare(load(BLOW_UP)).scenario.model_dump()
    assert "gravity_compensation: null" not in text  # as by default
    best = load(left / "approach_singularity.tune.yaml").control
    base = (ROOT / "scenarios/approach_singularity.yaml").read_text()
    base = base.replace("../models", str(ROOT / "models"))
    assert loads(re.sub(r"(?ms)^control:.*?(?=^\w)", pages["tune"].texts["text"], base)).control == best


def test_a_page_says_what_the_files_say(pages, left, compared, beside, tmp_path):
    facts = json.loads((left / "blow_up.json").read_text())
    for text in (*(each["text"] for each in facts["expect"]), *facts["assumed"]):
        assert text in pages["run"].texts[""]
    assert "3 of 3 runs completed the path" in pages["sweep"].texts[""]
    assert "Recommended: " in pages["tune"].texts[""]
    beside.save(tmp_path / "both.npz")
    (tmp_path / "both.json").write_text(json.dumps({**facts, "verdict": beside.verdict}))
    page = Parsed(report(tmp_path / "both.npz").read_text("utf-8"))
    assert beside.verdict in page.texts[""] and "baseline\npeak" in page.texts[""]
    for run in compared.values():
        assert number(run.scorecard["chatter"].value) in pages["compare"].texts[""]


def test_names_of_a_file_are_text_and_nothing_else(left, tmp_path):
    hostile = ("<img src=x onerror=alert(1)>", '</script><script>alert("&")</script>')
    run = dataclasses.replace(Run.read(left / "blow_up.npz"), joints=hostile)
    run.save(tmp_path / "h.npz")
    facts = json.loads((left / "blow_up.json").read_text())
    (tmp_path / "h.json").write_text(json.dumps({**facts, "name": hostile[1], "assumed": list(hostile)}))
    page = Parsed(report(tmp_path / "h.npz").read_text("utf-8"))
    assert len(page.all("script")) == 2 and not page.all("img")
    assert hostile[0] in page.texts[""]
    assert hostile[1] in [curve["label"] for curve in json.loads(page.texts["data"])[0]["curves"]]


def test_what_is_no_result_is_refused_in_one_line(rmrc, left, tmp_path):
    (tmp_path / "x.parquet").write_text("no")
    (tmp_path / "torn.npz").write_text("no")
    shutil.copy(left / "blow_up.npz", tmp_path / "alone.npz")
    shutil.copy(left / "blow_up.npz", tmp_path / "other.npz")
    (tmp_path / "other.json").write_text("[]")
    for name, message in (
        ("x.parquet", "x.parquet: … damaged"), ("torn.npz", "torn.npz: … damaged"),
        ("alone.npz", "alone.json: … missing next to"), ("other.npz", "other.json: … damaged"),
        ("missing.npz", "missing.npz: no such file"),
    ):  # fmt: skip
        code, out, err = rmrc("report", str(tmp_path / name))
        assert (code, out, err) == (2, "", says(f"rmrc: error: …{message}…\n"))
    run = Run.read(left / "blow_up.npz")
    empty = dataclasses.replace(run, columns={name: column[:0] for name, column in run.columns.items()})
    save_runs(tmp_path / "blow_up.npz", {"blow_up": empty})
    with pytest.raises(QuestionError, match="no tick"):
        page(tmp_path / "blow_up.npz")


@pytest.fixture(scope="module")
def browser():
    with chromium() as found:
        yield found


@pytest.mark.browser
@pytest.mark.long
@pytest.mark.xdist_group("report in a browser")
@pytest.mark.usefixtures("pages")
@pytest.mark.parametrize("verb", ["run", "compare", "sweep", "tune"])
def test_a_browser_shows_a_page_without_complaint(browser, left, verb):
    import axe_playwright_python

    axe = (Path(axe_playwright_python.__path__[0]) / "axe.min.js").read_text("utf-8")
    address, complaints, asked = (left / f"{verb}.html").as_uri(), [], []
    shown = browser.new_page()
    shown.on("console", lambda message: complaints.append(message.text))
    shown.on("pageerror", lambda error: complaints.append(str(error)))
    shown.on("request", lambda request: asked.append(request.url))
    for scheme in ("light", "dark"):
        shown.set_viewport_size({"width": 1280, "height": 720})
        shown.emulate_media(color_scheme=scheme)
        shown.goto(address)
        assert (shown.locator("canvas").count() > 3) is (verb in ("run", "compare"))
        if verb in ("run", "compare"):
            inks = shown.evaluate(
                "[...document.querySelectorAll('canvas')].map(c => new Set(new Uint32Array("
                "c.getContext('2d').getImageData(0, 0, c.width, c.height).data.buffer)).size)"
            )
            assert min(inks) > 3  # none is blank
            shown.locator(".u-over").first.hover(position={"x": 300, "y": 60})
            read = shown.locator(".u-legend tr:first-child .u-value").all_inner_texts()
            assert len(set(read)) == 1 and read[0] != "–"  # one time for all panels
            name = shown.locator(".u-label[role=button]").first
            name.press("Enter")
            assert name.get_attribute("aria-pressed") == "false"
        columns = "getComputedStyle(document.querySelector('main')).gridTemplateColumns.split(' ').length"
        for width, count in ((1280, 2), (390, 1)):
            shown.set_viewport_size({"width": width, "height": 720})
            assert shown.evaluate(columns) == count
            assert shown.evaluate("document.documentElement.scrollWidth") <= width
            assert all(0 < drawn == room < width for drawn, room in widths(shown))
        shown.evaluate(axe)
        wrong = shown.evaluate("axe.run()")["violations"]
        assert [(one["id"], one["nodes"][0]["html"]) for one in wrong] == []
    assert set(asked) == {address} and complaints == []
    shown.close()
