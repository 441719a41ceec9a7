"""The site of the documents: every page is in its contents once, and its checks see what is broken."""

import importlib.util
import re
import runpy
import sys

import pytest

from browsers import chromium
from pages import CONTENTS, PAGES, page
from project import ROOT
from rmrc.export.page import contents, read_lesson
from rmrc.scenario import load
from rmrc.scenario.draft import LESSONS

SPEC = importlib.util.spec_from_file_location("site_tool", ROOT / "tools/site.py")
site = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(site)


@pytest.fixture(scope="module")
def conf():
    path = list(sys.path)
    yield runpy.run_path(str(ROOT / "docs/conf.py"))
    sys.path[:] = path


def pages(conf):
    """Return every page of the site but the first one, as the settings include them."""
    found = {path for pattern in conf["include_patterns"] for path in ROOT.glob(pattern.replace("**", "*"))}
    return {path for path in found if path.suffix in conf["source_suffix"]} - {CONTENTS}


def test_every_page_is_in_the_contents_once(conf):
    listed = re.findall(r"^- \[.+?\]\((\S+?)\)", CONTENTS.read_text("utf-8"), re.MULTILINE)
    assert len(listed) == len(PAGES) > 15
    assert sorted(PAGES.values()) == sorted(pages(conf))


def test_the_contents_of_the_sidebar_are_those_of_the_first_page(conf):
    text = "# x\n\n## A\n\n- [One](one.md): 1\n- [Two](../b/two.ipynb)\n\n## B\n\n- [Three](three.md)\n"
    source = [text]
    conf["add_contents"](None, "docs/other", source)
    assert source == [text]
    conf["add_contents"](None, conf["root_doc"], source)
    trees = source[0].removeprefix(text)
    assert re.findall(r":caption: (.+)\n\n((?:.+\n)+?)```", trees) == [
        ("A", "One <one>\nTwo <../b/two>\n"),
        ("B", "Three <three>\n"),
    ]


SEARCHES = "choose lambda|damping factor|DLS|pseudo-inverse|singularity avoidance|UR|Franka|ROS|MoveIt Servo"


def test_what_people_search_for_is_in_the_index_of_one_page(conf):
    """Which the search of the site ranks first, as it does an entry that is the whole query."""
    leads = {word: name for name, words in conf["SEARCHED"].items() for word in words}
    assert {*SEARCHES.split("|")} <= {*leads} and leads["choose lambda"] == leads["lambda"] == "docs/tune"
    assert len(leads) == sum(map(len, conf["SEARCHED"].values()))
    for word, name in leads.items():
        source = [(ROOT / f"{name}.md").read_text("utf-8")]
        conf["add_words"](None, name, source)
        heading, index = re.match(
            r"# (.+)\n\n```{eval-rst}\n\.\. index::\n(.*?)```\n", source[0], re.DOTALL
        ).groups()
        assert heading and f"   ! {word}\n" in index


def test_a_link_to_a_page_with_sliders_sets_what_the_page_has(conf):
    texts = [path.read_text("utf-8") for path in (ROOT / "docs").glob("*.md")]
    links = {link[1:] for text in texts for link in conf["IN_BROWSER"].findall(text)}
    told = set(re.findall(r"explore\.md\?([\w-]+)", page("A page with sliders")))
    assert {*LESSONS} < told and {name for name, _ in links} == told
    for name, settings in links:
        scenario = load(read_lesson(name).scenario if name in LESSONS else name)
        if settings:
            key, value = settings[1:].split("=")
            (control,) = (each for each in contents(scenario, None)[0].controls if each.key == key)
            assert value in [each if isinstance(each, str) else f"{each:g}" for each in control.values]
    source = ["[a](explore.md?b#c=d), [e](explore.md)"]
    conf["link_explored"](None, "docs/x", source)
    assert source == ['<a href="../explore/b.html#c=d">a</a>, [e](explore.md)']


def test_a_broken_link_of_the_site_is_seen(tmp_path):
    (tmp_path / "docs").mkdir()
    good = '<h1 id="here">a</h1><a href="#here">b</a><a href="docs/b.html#there">c</a><a href="https://x.org">d</a>'
    (tmp_path / "a.html").write_text(good)
    (tmp_path / "docs/b.html").write_text(
        '<p id="there"><img src="../a.html"><a href="../a.html#here">a</a><a href="../a.html#k=1">'
    )
    assert list(site.broken(tmp_path)) == []
    (tmp_path / "docs/b.html").write_text(
        '<a href="../a.html#gone"></a><script src="https://x.org/y.js"></script>'
    )
    assert list(site.broken(tmp_path)) == [
        "a.html: docs/b.html#there leads nowhere",
        "docs/b.html: ../a.html#gone leads nowhere",
        "docs/b.html: loads https://x.org/y.js",
    ]


def test_external_links_are_reported_as_broken_only_if_a_server_says_so():
    def one(name, status, info=""):
        return {"uri": f"https://x.org/{name}", "filename": "docs/a.md", "status": status, "info": info}

    fine = [one("a", "working"), one("a", "working"), {**one("", "local"), "uri": "b.html"}]
    assert site.external(fine) == (["external links: 1 fine, 0 moved, 0 broken, 0 no answer"], 0)
    silent = one("b", "broken", "Max retries exceeded")
    assert site.external([*fine, silent])[1] == site.external([one("c", "timeout")])[1] == 2
    gone = one("d", "broken", "404 Client Error: Not Found for url: https://x.org/d")
    lines, code = site.external([*fine, silent, gone, one("e", "redirected", "https://y.org")])
    assert code == 1 and lines[-1] == "external links: 1 fine, 1 moved, 1 broken, 1 no answer"
    assert lines[1].startswith("broken: https://x.org/d in docs/a.md: 404")


def test_every_equation_is_in_one_block_and_its_number_is_used_once():
    """A block with a number is TeX that closes what it opens; the converter itself runs with `make docs`."""
    blocks = re.findall(r"^```math\n(.*?)^```$", page("Theory"), re.MULTILINE | re.DOTALL)
    numbers = [int(number) for block in blocks for number in re.findall(r"\\tag\{(\d+)\}", block)]
    assert len(numbers) > 80 and numbers == sorted(set(numbers))
    for block in blocks:
        assert block.count("{") == block.count("}") and block.count(r"\begin") == block.count(r"\end"), block
    # Markdown takes these as escaped characters, within a line.
    prose = re.sub(r"^```.*?^```$", "", page("Theory"), flags=re.MULTILINE | re.DOTALL)
    assert re.findall(r"\$[^$]*\\[,;|{}_!][^$]*\$", prose) == []


@pytest.mark.browser
def test_the_search_reads_no_page_from_disk(tmp_path):
    script = (ROOT / "docs/_static/site.js").read_text("utf-8")
    text = f"<script>const DOCUMENTATION_OPTIONS = {{ SHOW_SEARCH_SUMMARY: true }};</script><script>{script}</script>"
    (tmp_path / "search.html").write_text(text, "utf-8")
    asked = "DOCUMENTATION_OPTIONS.SHOW_SEARCH_SUMMARY"
    with chromium() as browser:
        shown = browser.new_page()
        shown.goto((tmp_path / "search.html").as_uri())
        assert shown.evaluate(asked) is False
        shown.route("**/*", lambda route: route.fulfill(body=text, content_type="text/html"))
        shown.goto("http://127.0.0.1:9/search.html")
        assert shown.evaluate(asked) is True  # from a server it may


@pytest.mark.browser
def test_a_button_copies_the_command_of_a_row():
    script = (ROOT / "docs/_static/site.js").read_text("utf-8")
    row = "<tr id=a1><td>A1<td>topic<td><code>rmrc inspect planar_2link --q 0,0</code><td>prints</tr>"
    text = f"<div class=versions></div><table>{row}</table><script>{script}</script>"
    with chromium() as browser:
        page = browser.new_context(permissions=["clipboard-read", "clipboard-write"]).new_page()
        page.route("**/*", lambda route: route.fulfill(body=text, content_type="text/html"))
        page.goto("http://127.0.0.1:9/")
        page.click("button.copy")
        page.wait_for_function("document.querySelector('button.copy').textContent === 'copied'")
        copied = page.evaluate("navigator.clipboard.readText()")
    assert copied == "rmrc inspect planar_2link --q 0,0"
