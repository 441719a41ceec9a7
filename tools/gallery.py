"""Write `docs/gallery.md`: every shipped scenario with its picture, its point and its command.

    python tools/gallery.py            lists missing and stale parts, and ends with 1 if there are any
    python tools/gallery.py --write    draws missing and stale pictures, and writes the page

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
SCENARIOS, PICTURES, PAGE = ROOT / "scenarios", ROOT / "docs/figures/gallery", ROOT / "docs/gallery.md"
# Width and height of a picture, and its colors: 20 kB.
SIZE, COLORS = "420x420", 96
HEAD = """# Gallery

Every scenario that comes with the program, where its arm is nearest to a singularity: the arm by MuJoCo's
renderer, with the wanted path (dark), the trail (red near a singularity) and the velocity ellipsoid of the
tip (green), and below it the joint rates against their limits. The command below a picture draws it; with an
output that ends in `.gif` it makes the film. `python tools/gallery.py --write` writes this page.

"""
ENTRY = """## {name}

[![{name}](figures/gallery/{name}.png)](../scenarios/{name}.yaml)

{point}

```sh
.venv/bin/python -m rmrc render {name} -o {name}.png --size {size}
```
"""


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


def point(scenario: Path) -> str:
    """Return the first sentence of a scenario's first comment."""
    lines = scenario.read_text("utf-8").partition("\nname:")[0].splitlines()
    text = " ".join(line.strip("# ") for line in lines).strip()
    end = next(
        (i for i in range(len(text)) if text[i] == "." and text[i + 1 : i + 2] in ("", " ")), len(text)
    )
    return text[: end + 1].replace("|", "\\|")


def page() -> str:
    """Return the text of the page."""
    scenarios = sorted(SCENARIOS.glob("*.yaml"))
    entries = (ENTRY.format(name=one.stem, point=point(one), size=SIZE) for one in scenarios)
    return HEAD + "\n".join(entries)


def main() -> int:
    """Write the page, or report missing and stale parts; return 1 if there are any."""
    parser = argparse.ArgumentParser(description="The page of all scenarios and their pictures.")
    parser.add_argument(
        "--write", action="store_true", help="draw missing and stale pictures, and write the page"
    )
    is_writing = parser.parse_args().write
    scenarios = sorted(SCENARIOS.glob("*.yaml"))
    stale = [one for one in scenarios if is_stale(one)]
    extra = sorted(set(PICTURES.glob("*.png")) - {picture(one) for one in scenarios})
    if is_writing:
        for one in stale:
            draw(one)
            print(f"drew {picture(one).relative_to(ROOT)}")
        for path in extra:
            path.unlink()
        PAGE.write_text(page(), "utf-8")
        return 0
    wrong = [f"{picture(one).relative_to(ROOT)}: missing or stale" for one in stale]
    wrong += [f"{path.relative_to(ROOT)}: of no scenario" for path in extra]
    if not PAGE.is_file() or PAGE.read_text("utf-8") != page():
        wrong.append(f"{PAGE.relative_to(ROOT)}: is not what this writes")
    print("\n".join(wrong))
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
