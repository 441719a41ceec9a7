"""The gallery shows every scenario as it is now, with its command, and no picture is stale."""

import importlib.util
import re

from PIL import Image

from project import ROOT

SPEC = importlib.util.spec_from_file_location("gallery", ROOT / "tools/gallery.py")
gallery = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(gallery)
SCENARIOS = sorted((ROOT / "scenarios").glob("*.yaml"))


def test_the_page_has_every_scenario_once_with_its_picture_and_its_command():
    cells = re.findall(r"\| (\[<img .*?) (?=\|)", (ROOT / "docs/gallery.md").read_text("utf-8"))
    commands = {}
    for cell in cells:
        picture, named, command = cell.split("<br>")
        name = re.fullmatch(r"\[(\w+)\]\(../scenarios/\1.yaml\): .+", named)[1]
        shown = f"figures/gallery/{name}.png"
        assert picture == f'[<img src="{shown}" alt="{name}" width="220">]({shown})'
        commands[name] = command
    assert commands == {path.stem: f"`rmrc run {path.stem}`" for path in SCENARIOS}
    assert len(cells) == len(SCENARIOS)


def test_no_picture_is_missing_stale_or_left_over_and_all_are_small():
    stale = [one.stem for one in SCENARIOS if gallery.is_stale(one)]
    assert not stale, "run `python tools/gallery.py --write` where there is OpenGL"
    pictures = sorted((ROOT / "docs/figures/gallery").glob("*.png"))
    assert [path.stem for path in pictures] == [one.stem for one in SCENARIOS]
    assert sum(path.stat().st_size for path in pictures) <= 3e6
    for path in pictures:
        with Image.open(path) as picture:
            assert picture.size == tuple(map(int, gallery.SIZE.split("x")))
