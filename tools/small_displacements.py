"""Draw `docs/figures/small_displacements.png`, or another file, of the textbook's formulas."""

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rmrc.show.figures import save
from rmrc.textbook.two_link import (
    two_link_jacobian_inverse,
    two_link_position,
    two_link_postures,
    two_link_small_displacements,
)

# The tip moves by this much: a part in 2000 of the reach [m].
DISPLACEMENT = 1e-3
# Range of θ₂ [rad]: the exact answer is far from the others at its start, and equals J⁻¹ Δx to the eye at its
# end.
NEAREST, FARTHEST = 0.003, 1.0
STYLES = {"exact": ("-", 3.5, "0.7"), "inverse": ("--", 1.6, "black"), "notes": (":", 2.2, "black")}


def displacements(elbow: np.ndarray, displacement: Sequence[float]) -> dict[str, np.ndarray]:
    """Return [Δq₁, Δq₂] for two links of 1 m at q = (0, θ₂), by each of `STYLES`.

    Args:
        elbow: θ₂ > 0, (N,) [rad].
        displacement: [Δx, Δy] in frame {1}, (2,) [m].

    Returns:
        (N, 2) [rad] each; NaN where the tip would be out of reach.
    """
    lengths, q = (1.0, 1.0), np.stack([np.zeros_like(elbow), elbow], axis=-1)
    wanted = two_link_position(lengths, q) + displacement
    return {
        "exact": two_link_postures(lengths, wanted)[:, 0] - q,
        "inverse": two_link_jacobian_inverse(lengths, q) @ np.asarray(displacement),
        "notes": two_link_small_displacements(lengths, elbow, displacement),
    }


def figure() -> Figure:
    """Return the picture of the joint displacements of a small tip displacement near full reach.

    The tip of two links of 1 m moves in frame {1} by 1 mm towards the base (−x) and across the arm (y). The
    curves are exact, by J⁻¹ Δx, and by the first order in θ₂ [Khatib08]. Along the arm only the exact answer
    stays finite. A millimeter outwards has no answer for θ₂ < 0.06, where it is out of reach.
    """
    picture = Figure(figsize=(10.0, 5.0), layout="constrained")
    panels = picture.subplots(1, 2, sharey=True)
    _panel(panels[0], (-DISPLACEMENT, 0.0), "1 mm towards the base")
    _panel(panels[1], (0.0, DISPLACEMENT), "1 mm across the arm")
    handles, labels = panels[0].get_legend_handles_labels()
    picture.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False, handlelength=4.0)
    picture.suptitle("Two links of 1 m near full reach: what a small displacement of the tip takes")
    return picture


def _panel(axes: Axes, displacement: tuple[float, float], title: str) -> None:
    elbow = np.geomspace(NEAREST, FARTHEST, 200)
    names = {"exact": "exact", "inverse": "J⁻¹ Δx", "notes": "first order in θ₂"}
    for name, both in displacements(elbow, displacement).items():
        style, width, color = STYLES[name]
        axes.plot(
            elbow,
            np.abs(both[:, 0]),
            style,
            linewidth=width,
            color=color,
            label=rf"$|\Delta q_1|$, {names[name]}",
        )
        axes.plot(
            elbow, np.abs(both[:, 1]), style, linewidth=width, color=color, marker="o", markevery=25,
            markersize=5, label=rf"$|\Delta q_2|$, {names[name]}",
        )  # fmt: skip
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel(r"$\theta_2$ [rad]")
    axes.set_ylabel("joint displacement [rad]")
    axes.set_title(title)
    axes.grid(which="major", color="0.9", linewidth=0.8)


if __name__ == "__main__":
    save(figure(), [Path(sys.argv[1])])
