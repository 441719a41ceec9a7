"""The plots of one run: rates, singular values, error, torque, pace, and what the law believes."""

from collections.abc import Sequence
from typing import Literal

import numpy as np
import rerun.blueprint as rrb

from rmrc.recording.plots import (
    MORE_STEPS,
    Curve,
    Panel,
    Peak,
    Seen,
    both_ways,
    clipped,
    decades,
    limit_lines,
    over_time,
    rounded,
    spell,
    under_time,
)
from rmrc.results.run import Run
from rmrc.scenario.choices import POLICIES
from rmrc.show.palette import BLACK, GOLD, GRAY, GREEN, MAGENTA, SLATE, WHITE, hue, mix
from rmrc.simulation.prepare import Prepared

# Of the plots from the top: the rates, the singular values, tabs, the pace, the strip.
SHARES = {"rates": 3.0, "sigma": 2.3, "tabs": 1.8, "pace": 1.5, "strip": 1.05}


class Panels:
    """The plots of one world; the ranges of their axes are known when the run is over."""

    def __init__(self, prepared: Prepared, has_baseline: bool = False) -> None:
        """Look at the world.

        Args:
            prepared: The world.
            has_baseline: Whether one runs beside it.
        """
        self.prepared, self.has_baseline = prepared, has_baseline
        arm, scenario = prepared.arm, prepared.scenario
        self._joints = arm.joints
        self._hues = [hue(j) for j in range(arm.n)]
        self.axes = set(scenario.task.axes)
        self.rate_limit = prepared.law.rate_limit
        has_torque = prepared.plant.has_physics
        self.torque_limit = arm.torque_limit if has_torque else np.full(arm.n, np.inf)
        self.damping_below = scenario.control.inverse.damping.below
        slides = [bool(one) for one in arm.is_slide]
        self._per = _of_kinds(slides, "rad/s", "m/s")
        self._load = _of_kinds(slides, "N·m", "N")
        self._small = _of_kinds(slides, "mrad", "mm")
        self.has_torque = has_torque
        self.is_slowed = POLICIES[scenario.control.at_singularity].slows
        self.has_second = scenario.control.nullspace.objective == "secondary"

    @property
    def errors(self) -> tuple[str, ...]:
        """What the tip may be off by, with units."""
        found = [("position [mm]", {"x", "y", "z"}), ("rotation [mrad]", {"rx", "ry", "rz"})]
        return tuple(name for name, axes in found if axes & self.axes)

    def watch(self, seen: Seen, part: Run, derived: dict[str, np.ndarray]) -> None:
        """Note what a block shows."""
        names = ("qdot", "qdot_cmd", "qdot_arrived", "qdot_plain", "tau", "path_rate")
        seen.add(part["time"], {name: part[name] for name in names} | derived)
        seen.add(part["time"], {"1/sigma": 1.0 / np.maximum(part["sigma"][:, -1], 1e-300)})
        seen.add(part["time"], {"sigma": part["sigma"]})

    def limits(self) -> dict[str, list[float]]:
        """Return the levels of all lines that do not move, by component."""
        return {
            "rate": limit_lines(self.rate_limit, self._joints, self._hues)[0],
            "torque": limit_lines(self.torque_limit, self._joints, self._hues)[0],
            "epsilon": [float(np.log10(self.damping_below))],
        }

    def all(self, seen: Seen | None) -> dict[str, Panel]:
        """Return the plots by name; without ranges while a run goes on.

        Args:
            seen: What the run shows, once it is over.
        """
        found = {"rates": self._rates(seen), "sigma": self._sigma(seen), "error": self._error(seen)}
        if seen is None:
            return found  # that of a run that is killed: a layout takes 100 kB
        if self.has_torque:
            found["torque"] = self._torque(seen)
        if self.is_slowed:
            found["pace"] = self._pace(seen)
        if self.prepared.hardware.moves_q:
            found["belief"] = self._belief(seen)
        return found

    def off_scale(self, seen: Seen) -> dict[str, Peak]:
        """Return the largest rates beyond their plot: own, of the plain inverse, of the baseline."""
        kinds = {"own": ("qdot", "qdot_cmd"), "plain": ("qdot_plain",), "baseline": ("baseline",)}
        found = {kind: seen.peak(*names) for kind, names in kinds.items()}
        top = self._rate_range(seen)[1]
        return {kind: peak for kind, peak in found.items() if peak is not None and abs(peak.value) > top}

    def mark_of(self, peak: Peak, seen: Seen) -> float:
        """Return where the plot of the rates marks one that it does not show."""
        return float(np.copysign(0.97 * self._rate_range(seen)[1], peak.value))

    def _rate_range(self, seen: Seen) -> tuple[float, float]:
        peak = seen.peak("qdot", "qdot_cmd")
        size = abs(peak.value) if peak else 0.0
        known = self.rate_limit[np.isfinite(self.rate_limit)]
        shown = clipped(size, float(known.max(initial=0.0)), seen.mostly("qdot_cmd"))
        return both_ways(shown, MORE_STEPS)

    def _rates(self, seen: Seen | None) -> Panel:
        pale, n = [mix(one, WHITE, 0.5) for one in self._hues], len(self._joints)
        curves = [
            Curve("columns", "columns.qdot[]", self._joints, self._hues, 4.0),
            Curve("columns", "columns.qdot_cmd[]", self._joints, pale, 1.3),
        ]
        title = f"Joint rates [{self._per}], commanded thin"
        if not self.prepared.hardware.is_direct:
            dark = [mix(one, BLACK, 0.35) for one in self._hues]
            curves.append(Curve("columns", "columns.qdot_arrived[]", self._joints, dark, 2.2))
            title += ", arriving dark"
        _, names, colors = limit_lines(self.rate_limit, self._joints, self._hues)
        if names:
            curves.append(Curve("limits", "rate", names, colors, 1.0))
        curves.insert(0, Curve("columns", "curves.plain[]", ["plain J⁻¹"] * n, self._hues, 1.5))
        title += ", plain J⁻¹ dashed"
        if self.has_baseline:
            gray = [mix(one, GRAY, 0.5) for one in self._hues]
            curves.insert(0, Curve("baseline/columns", "curves.dashed[]", ["baseline"] * n, gray, 1.5))
        columns = frozenset({"qdot", "qdot_cmd", "qdot_plain"})
        if seen is None:
            return Panel(title, curves, None, columns)
        for kind, peak in self.off_scale(seen).items():
            shape: Literal["up", "down"] = "up" if peak.value > 0 else "down"
            which = "" if kind == "own" else f"{kind} "
            text = f"{spell(abs(peak.value))} {'↑' if peak.value > 0 else '↓'}"
            curves.append(Curve(f"peak/{kind}", "rate", [text], [self._hues[peak.which]], 6.0, shape))
            title += f"; {which}peak {text}"
        return Panel(title, curves, self._rate_range(seen), columns)

    def _sigma(self, seen: Seen | None) -> Panel:
        k = min(len(self._joints), len(self.axes))
        others = [mix(GRAY, GREEN, 0.5 * i / k) for i in range(k - 1)]
        curves = [
            Curve("columns", "curves.log_sigma[]", ["other σ"] * (k - 1), others, 1.2),
            Curve("columns", "curves.log_sigma_min[]", ["σ_min"], [GREEN], 3.5),
            Curve("columns", "curves.log_damping[]", ["λ"], [MAGENTA], 2.0),
            Curve("limits", "epsilon", ["ε"], [GRAY], 1.0),
        ]
        if k == 1:
            del curves[0]
        least = largest = None
        if seen is not None:
            inverse, top = seen.peak("1/sigma"), seen.peak("sigma")
            least = min(1.0 / inverse.value if inverse else 1.0, self.damping_below)
            largest = top.value if top else 1.0
        if self.has_second:
            curves.append(Curve("columns", "curves.log_secondary[]", ["σ left to 2nd"], [SLATE], 2.0))
        range_ = None if least is None or largest is None else decades(least, largest)
        columns = frozenset({"sigma", "damping", "secondary_sigma", "condition"})
        return Panel("Singular values σ and damping λ, as log₁₀", curves, range_, columns)

    def _error(self, seen: Seen | None) -> Panel:
        colors = [GOLD, SLATE] if len(self.errors) == 2 else [GOLD if "position" in self.errors[0] else SLATE]
        peak = seen.peak("error") if seen else None
        range_ = (0.0, rounded(abs(peak.value))) if peak else None
        unit = ", ".join(name.split("[")[1].rstrip("]") for name in self.errors)
        names = [name.split(" ")[0] for name in self.errors]
        curve = Curve("columns", "curves.error[]", names, colors, 2.0)
        return Panel(f"Tip error [{unit}]", [curve], range_, frozenset({"pose_error", "pose", "pose_ref"}))

    def _torque(self, seen: Seen | None) -> Panel:
        _, names, colors = limit_lines(self.torque_limit, self._joints, self._hues)
        curves = [Curve("columns", "columns.tau[]", self._joints, self._hues, 2.0)]
        if names:
            curves.append(Curve("limits", "torque", names, colors, 1.0))
        peak = seen.peak("tau") if seen else None
        if peak is None or seen is None:
            return Panel(f"Torque [{self._load}]", curves, None, frozenset({"tau", "tau_gravity"}))
        known = self.torque_limit[np.isfinite(self.torque_limit)]
        shown = clipped(abs(peak.value), float(known.max(initial=0.0)), abs(peak.value))
        beyond = "" if not len(known) or known.max() <= shown else f", limit {spell(float(known.max()))} ↑"
        title = f"Torque [{self._load}]{beyond}"
        return Panel(title, curves, both_ways(shown), frozenset({"tau", "tau_gravity"}))

    def _pace(self, seen: Seen | None) -> Panel:
        curve = Curve("columns", "columns.path_rate", ["ṡ"], [GOLD], 2.5)
        range_ = (0.0, 2.05) if seen else None
        return Panel("Pace ṡ along the path [1 = as planned]", [curve], range_, frozenset({"path_rate"}))

    def _belief(self, seen: Seen | None) -> Panel:
        peak = seen.peak("belief") if seen else None
        curve = Curve("columns", "curves.belief[]", self._joints, self._hues, 2.0)
        range_ = both_ways(abs(peak.value)) if peak else None
        title = f"Joints as believed, less true [{self._small}]"
        return Panel(title, [curve], range_, frozenset({"q_believed"}))


def stacked(
    panels: dict[str, Panel], end: float, status: str, lanes: int = 1, first: str = ""
) -> rrb.Vertical:
    """Return plots below each other: small ones in tabs, and the strip of events at the bottom.

    Args:
        panels: By name.
        end: Of the run [s].
        status: Entity of the strip.
        lanes: That it has.
        first: Which of the tabs is open; "": the first.
    """
    axis = over_time(end)
    views = {name: panel.view(axis) for name, panel in panels.items()}
    alone = [name for name in ("rates", "sigma") if name in views]
    tabs = [name for name in views if name not in {*alone, "pace"}]
    rows: list[tuple[str, rrb.View | rrb.Container]] = [(name, views[name]) for name in alone]
    active = tabs.index(first) if first in tabs else 0
    rows.append(("tabs", rrb.Tabs(*(views[name] for name in tabs), active_tab=active)))
    if "pace" in views:
        rows.append(("pace", views["pace"]))
    strip = rrb.StateTimelineView(name="Events", contents=[status], time_view=under_time(end), titlebar=False)
    rows.append(("strip", strip))
    shares = SHARES | {"strip": min(2.4, SHARES["strip"] + 0.42 * (lanes - 1))}  # more lanes are scrolled
    return rrb.Vertical(*(view for _, view in rows), row_shares=[shares[name] for name, _ in rows])


def _of_kinds(slides: Sequence[bool], turning: str, sliding: str) -> str:
    """Return the unit of joints, or both units."""
    return " or ".join(
        unit for unit, is_slide in ((turning, False), (sliding, True)) if is_slide in set(slides)
    )
