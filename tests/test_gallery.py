"""The gallery shows every scenario as it is now: its page is what the tool writes, and no picture is stale."""

import importlib.util
import re

from PIL import Image

from pages import page
from project import ROOT

SPEC = importlib.util.spec_from_file_location("gallery", ROOT / "tools/gallery.py")
gallery = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(gallery)
SCENARIOS = sorted((ROOT / "scenarios").glob("*.yaml"))


def test_the_page_lists_every_scenario_with_its_picture_and_its_command():
    text = (ROOT / "docs/gallery.md").read_text("utf-8")
    assert text == gallery.page()
    for scenario in SCENARIOS:
        name = scenario.stem
        assert f"\n## {name}\n" in text
        assert f"(figures/gallery/{name}.png)" in text
        assert f"rmrc render {name} -o {name}.png" in text


def test_no_picture_is_missing_stale_or_left_over_and_all_are_small():
    stale = [one.stem for one in SCENARIOS if gallery.is_stale(one)]
    assert not stale, "run `python tools/gallery.py --write` where there is OpenGL"
    pictures = sorted((ROOT / "docs/figures/gallery").glob("*.png"))
    assert [path.stem for path in pictures] == [one.stem for one in SCENARIOS]
    assert sum(path.stat().st_size for path in pictures) <= 3e6
    for path in pictures:
        with Image.open(path) as picture:
            assert picture.size == tuple(map(int, gallery.SIZE.split("x")))


def test_a_stamp_follows_what_is_seen_and_not_comments_or_expectations(tmp_path):
    (tmp_path / "arm.xml").write_text("<mujoco/>", "utf-8")
    scenario = tmp_path / "x.yaml"

    def stamp(text):
        scenario.write_text(text, "utf-8")
        return gallery.stamp(scenario)

    first = stamp("# a\narm: {model: arm.xml}\nexpect: {a: 1}\n")
    assert stamp("# b\narm: {model: arm.xml}\nexpect: {a: 2}\n") == first
    assert stamp("arm: {model: arm.xml, start: home}\n") != first
    (tmp_path / "arm.xml").write_text("<mujoco model='b'/>", "utf-8")
    assert stamp("arm: {model: arm.xml}\n") != first


def test_the_film_of_the_readme_is_a_small_one_and_has_its_command_on_the_first_page():
    assert "docs/figures/blow_up.gif" in (ROOT / "README.md").read_text("utf-8").partition("\n## ")[0]
    command = re.search(r"`rmrc (render [^`]*-o docs/figures/blow_up.gif[^`]*)`", page("Five minutes"))[1]
    assert f"-m rmrc {command}\n" in (ROOT / "Makefile").read_text("utf-8")
    film = ROOT / "docs/figures/blow_up.gif"
    assert film.stat().st_size <= 2e6
    with Image.open(film) as frames:
        assert frames.n_frames > 20
