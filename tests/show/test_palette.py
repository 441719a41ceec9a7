"""Colors can be told apart by all, on a dark and on a light background."""

from itertools import combinations

import numpy as np
import pytest

from rmrc.analysis.workspace_report import FAMILIES
from rmrc.show import palette

# Linear sRGB as those see it who lack the long or the middle cones (Machado, Oliveira, Fernandes 2009, severity 1).
SIGHTS = {
    "normal": np.eye(3),
    "protan": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deutan": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
}  # fmt: skip
TO_XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)
# The viewer's backgrounds of plots, and that of our picture.
BACKGROUNDS = (0xFFFFFFFF, 0x0D0D0DFF, 0x0D1011FF)


def linear(color):
    channels = np.array([color >> shift & 255 for shift in (24, 16, 8)]) / 255
    return np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)


def lab(light):
    relative = TO_XYZ @ np.clip(light, 0, 1) / (TO_XYZ @ np.ones(3))
    f = np.where(relative > (6 / 29) ** 3, np.cbrt(relative), relative / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def distance(first, second, sight):
    """ΔE of CIE 1976."""
    matrix = np.array(SIGHTS[sight])
    return float(np.linalg.norm(lab(matrix @ linear(first)) - lab(matrix @ linear(second))))


def contrast(first, second):
    """That of WCAG 2."""
    bright, dark = sorted((TO_XYZ[1] @ linear(first), TO_XYZ[1] @ linear(second)), reverse=True)
    return (bright + 0.05) / (dark + 0.05)


PANELS = {
    "rates": (*palette.HUES, palette.GRAY),
    "sigma": (palette.GREEN, palette.MAGENTA, palette.GRAY, palette.SLATE),
    "errors": (palette.GOLD, palette.INDIGO, palette.GRAY),
    "strip": (palette.RED, palette.TEAL, palette.SLATE),
}


@pytest.mark.parametrize("sight", SIGHTS)
@pytest.mark.parametrize("panel", PANELS)
def test_colors_of_a_panel_are_told_apart(panel, sight):
    colors = PANELS[panel]
    for i, first in enumerate(colors):
        for second in colors[:i]:
            assert distance(first, second, sight) >= 20.0, (f"{first:08x}", f"{second:08x}")


@pytest.mark.parametrize("sight", SIGHTS)
def test_families_of_singularities_are_told_apart_on_paper(sight):
    """A pivot stands alone in its map, and shares the color of an elbow."""
    colors = {int(color[1:] + "ff", 16) for color, _ in FAMILIES.values() if color != "black"} | {
        0x1F4E9CFF,
        palette.BLACK,
    }
    for first, second in combinations(colors, 2):
        assert distance(first, second, sight) >= 20.0, (f"{first:08x}", f"{second:08x}")
    assert min(contrast(one, palette.WHITE) for one in colors) >= 3.0


def test_red_and_green_of_equal_lightness_are_not():
    """A negative control: only the simulated sight confuses them."""
    assert distance(0xC05050FF, 0x6F7F00FF, "normal") > 40.0
    assert distance(0xC05050FF, 0x7D7346FF, "protan") < distance(0xC05050FF, 0x7D7346FF, "normal") / 2


def test_all_are_seen_on_the_backgrounds_of_both_themes():
    for colors in PANELS.values():
        for one in colors:
            for background in BACKGROUNDS:
                assert contrast(one, background) >= 3.0, (f"{one:08x}", f"{background:08x}")
    assert contrast(palette.WHITE, 0x0D1011FF) > 15.0  # the path, whose background is ours in both themes
