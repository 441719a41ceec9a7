"""Draw the pictures of `docs/gallery.md`, one for every shipped scenario.

    python tools/gallery.py            lists missing and stale pictures, and ends with 1 if there are any
    python tools/gallery.py --write    draws them

A picture has a stamp in it: a hash of the scenario, without comments, expectations and `look`, and of
the files that it names. It is stale if these have changed. Drawing needs OpenGL, checking does not.
"""

import argparse
import hashlib
import json
import sys
from collections.abc import Iterator
from pathlib import Path

import yaml
from PIL import Image, PngImagePlugin

ROOT = Path(__file__).resolve().parent.parent
SCENARIOS, PICTURES = ROOT / "scenarios", ROOT / "docs/figures/gallery"
# Width and height of a picture, and its colors: 20 kB.
SIZE, COLORS = "420x420", 96


def stamp(scenario: Path) -> str:
    """Return a hash of the contents of a picture: the scenario and the files beside it that it names."""
    values = yaml.safe_load(scenario.read_text("utf-8"))
    for unseen in ("expect", "look"):
        values.pop(unseen, None)
    digest = hashlib.sha256(json.dumps(values, sort_keys=True, default=str).encode())
    for name in sorted(set(_texts(values))):
        file = scenario.parent / name
        if file.suffix in (".xml", ".urdf", ".csv") and file.is_file():
            digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


def _texts(values: object) -> Iterator[str]:
    """Yield all texts within values."""
    if isinstance(values, str):
        yield values
    elif isinstance(values, dict | list):
        for one in values.values() if isinstance(values, dict) else values:
            yield from _texts(one)


def picture(scenario: Path) -> Path:
    """Return the path of a scenario's picture."""
    return PICTURES / f"{scenario.stem}.png"


def is_stale(scenario: Path) -> bool:
    """Return whether the picture of a scenario is missing, or has another stamp."""
    if not picture(scenario).is_file():
        return True
    with Image.open(picture(scenario)) as image:
        return image.info.get("stamp") != stamp(scenario)


def draw(scenario: Path) -> None:
    """Draw the picture of a scenario, in few colors, with its stamp."""
    from rmrc import render

    path = picture(scenario)
    width, height = map(int, SIZE.split("x"))
    render(scenario, path, size=(width, height))
    known = PngImagePlugin.PngInfo()
    known.add_text("stamp", stamp(scenario))
    with Image.open(path) as image:
        few = image.convert("RGB").quantize(COLORS, dither=Image.Dither.NONE)
    few.save(path, "PNG", optimize=True, pnginfo=known)


def main() -> int:
    """Draw what is missing or stale, or report it; return 1 if there is anything to report."""
    parser = argparse.ArgumentParser(description="The pictures of all scenarios.")
    parser.add_argument("--write", action="store_true", help="draw missing and stale pictures")
    is_writing = parser.parse_args().write
    scenarios = sorted(SCENARIOS.glob("*.yaml"))
    stale = [scenario for scenario in scenarios if is_stale(scenario)]
    extra = sorted(set(PICTURES.glob("*.png")) - {picture(scenario) for scenario in scenarios})
    if is_writing:
        for scenario in stale:
            draw(scenario)
            print(f"drew {picture(scenario).relative_to(ROOT)}")
        for path in extra:
            path.unlink()
        return 0
    wrong = [f"{picture(scenario).relative_to(ROOT)}: missing or stale" for scenario in stale]
    wrong += [f"{path.relative_to(ROOT)}: of no scenario" for path in extra]
    print("\n".join(wrong))
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
