"""The plots of one run: rates, singular values, error, torque, pace, and what the law believes."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Literal

import numpy as np
import rerun.blueprint as rrb

from rmrc.recording.plots import (
    AROUND,
    CLIP,
    FILLED,
    FRAME,
    HEIGHT,
    LINE,
    NUMBER,
    Curve,
    Mark,
    Panel,
    Peak,
    Seen,
    Span,
    below,
    both_ways,
    clipped,
    decades,
    limit_lines,
    rounded,
    ruler,
    spell,
)
from rmrc.results.run import Run
from rmrc.scenario.choices import POLICIES
from rmrc.show.palette import BLACK, GOLD, GRAY, GREEN, LIME, MAGENTA, SLATE, WHITE, hue, mix
from rmrc.simulation.prepare import Prepared
from rmrc.support.spatial import log_rotation, quat_conjugate, quat_multiply

# Relative heights of the plots from the top: the rates, the singular values, tabs, the pace.
SHARES = {"rates": 3.0, "sigma": 2.3, "tabs": 1.8, "pace": 1.5}
# Relative height of the tabs if a scenario asks to look at one of them.
LOOKED_AT = 2.6
# Heights of the times and of a lane in the strip of events [points]; the number of lanes beyond which the
# strip scrolls, and the number beyond which the pace is in a tab.
TIMES, LANE, MOST_LANES, FEW_LANES = 32.0, 40.0, 4, 3
# Least heights, for three numbers on an axis [points].
LEAST = {"sigma": 3.1 * NUMBER, "tabs": 3.6 * NUMBER, "pace": 2.3 * NUMBER}
# Largest number of lines in the legend of the rates; a longer legend scrolls.
MOST_LINES = 8
# Plots that are always there, outside the tabs.
ALONE = ("rates", "sigma")
# Quantities of the whole arm, which the picture shows. For the others, a second picture shows the hand at
# that instant.
OF_THE_ARM = ("joints", "torque")
# Curves that are only drawn, with an axis as long as their largest value.
RANGED = ("error", "belief", "joints", "turn", "turn_error")
# The plots for quantities without a plot of their own.
SEEN_IN = {"status": "rates", "path": "error"}


class Panels:
    """The plots of one world; the ranges of their axes are known when the run is over."""

    def __init__(self, prepared: Prepared, has_baseline: bool = False) -> None:
        """Look at the world.

        Args:
            prepared: The world.
            has_baseline: Whether a baseline runs beside it.
        """
        self.prepared, self.has_baseline = prepared, has_baseline
        arm, scenario = prepared.arm, prepared.scenario
        self._joints = arm.joints
        self._hues = [hue(j) for j in range(arm.n)]
        self.axes = set(scenario.task.axes)
        self.rate_limit = prepared.law.rate_limit
        has_torque = prepared.plant.has_physics
        self.torque_limit = arm.torque_limit if has_torque else np.full(arm.n, np.inf)
        self.damping_below = float(scenario.control.inverse.damping.below or 0.0)
        slides = [bool(one) for one in arm.is_slide]
        self._per = _of_kinds(slides, "rad/s", "m/s")
        self._load = _of_kinds(slides, "N·m", "N")
        self._small = _of_kinds(slides, "mrad", "mm")
        self.has_torque = has_torque
        self.moves_q = prepared.hardware.moves_q
        self.is_slowed = POLICIES[scenario.control.at_singularity].slows
        self.has_second = scenario.control.nullspace.objective == "secondary"
        self._look = scenario.look
        self._degrees = np.where(arm.is_slide, 1.0, np.degrees(1.0))
        self._position = _of_kinds(slides, "deg", "m")
        wanted, has_turns = self._look.quantity if self._look else "", len(self.axes & {"rx", "ry", "rz"}) > 0
        self.sight = SEEN_IN.get(wanted, wanted) if has_turns or wanted != "rotation" else ""
        self.is_of_hand = wanted not in OF_THE_ARM
        lines = arm.n + has_baseline + (self.sight == "rates")
        self._heights = partial(heights, self.is_slowed, self.sight, lines)

    def _steps(self, name: str, seen: Seen | None) -> float:
        """Return the number of axis labels for which a plot of a run that is over has room."""
        end = max(seen.end if seen else 0.0, self.prepared.reference.duration)
        return self._heights(lanes=1 + bool(ruler(end)))[name] / NUMBER

    @property
    def errors(self) -> tuple[str, ...]:
        """Names of the tip's errors, with units."""
        found = [("position [mm]", {"x", "y", "z"}), ("rotation [mrad]", {"rx", "ry", "rz"})]
        return tuple(name for name, axes in found if axes & self.axes)

    def watch(self, seen: Seen, part: Run, derived: dict[str, np.ndarray]) -> None:
        """Note the values of a block."""
        least = 1.0 / np.maximum(part["sigma"][:, -1], 1e-300)
        columns = {name: part[name] for name in ("qdot", "qdot_cmd", "qdot_plain", "tau", "damping", "sigma")}
        asked = {name: derived[name] for name in derived if name in RANGED}
        seen.add(part["time"], columns | asked | {"1/sigma": least})

    def only_if_looked_at(self, part: Run) -> dict[str, np.ndarray]:
        """Return the curves of a block that are only drawn on request of the scenario: (T, width) each."""
        if self.sight == "joints":
            return {"joints": part["q"] * self._degrees}
        if self.sight != "rotation":
            return {}
        start, wanted, actual = self.prepared.reference.pose[0], part["pose_ref"], part["pose"]
        pairs = ((actual, wanted), (wanted, start), (actual, start))
        turns = [log_rotation(quat_multiply(a[..., 3:], quat_conjugate(b[..., 3:]))) for a, b in pairs]
        angles = np.degrees(np.linalg.norm(turns, axis=-1)).T
        return {"turn_error": angles[:, :1], "turn": angles[:, 1:]}

    def look(self, seen: Seen, part: Run, derived: dict[str, np.ndarray]) -> None:
        """Keep the instant to look at, if it is in a block: the requested one, or the worst one."""
        plotted = {
            "rates": part["qdot_cmd"],
            "sigma": derived["logs"][:, -1:] if self.has_second else derived["logs"][:, :1],
            "error": derived["error"],
            "joints": derived.get("joints"),
            "rotation": derived.get("turn"),
            "torque": part["tau"] if self.has_torque else None,
            "pace": part["path_rate"][:, None] if self.is_slowed else None,
            "belief": derived.get("belief"),
        }
        values = plotted.get(self.sight)
        if self._look is None or values is None:
            return
        worth = {
            "sigma": -values[:, 0], "pace": -values[:, 0],
            "rotation": derived.get("turn_error", values)[:, 0],
            "status": (part["status"] != 0).astype(float),
        }.get(self._look.quantity, np.abs(values).max(axis=1))  # fmt: skip
        if self._look.at is not None:
            worth = -np.abs(part["time"] - self._look.at)
        row = int(np.nan_to_num(worth, nan=-np.inf).argmax())
        if seen.mark is None or worth[row] > seen.mark.worth:
            seen.mark = Mark.of(part, row, values, float(worth[row]))

    def mark(self, seen: Seen, found: Mapping[str, Panel]) -> Mark | None:
        """Return the instant to look at, its values within its plot; None if the run ended before it."""
        mark, at = seen.mark, self._look.at if self._look else None
        if mark is None or (at is not None and at > seen.end + self.prepared.scenario.control.period):
            return None
        range_ = found[self.sight].range
        return mark if range_ is None else replace(mark, values=np.clip(mark.values, *range_))

    def marked(self, panel: Panel, mark: Mark) -> Panel:
        """Return the plot to look at, with the mark in it."""
        tints = {"sigma": [SLATE if self.has_second else GREEN], "pace": [GOLD]}.get(self.sight)
        if tints is None:
            tints = list(panel.curves[-1].colors) if self.sight in ("error", "rotation") else self._hues
        names = [mark.text] * len(mark.values)
        return replace(panel, curves=[*panel.curves, Curve("look", "look", names, tints, 7.0, "diamond")])

    def limits(self) -> dict[str, list[float]]:
        """Return the levels of all constant lines, by component."""
        return {
            "rate": limit_lines(self.rate_limit, self._joints, self._hues)[0],
            "torque": limit_lines(self.torque_limit, self._joints, self._hues)[0],
            "epsilon": [float(np.log10(self.damping_below))],
            "joints": [level for level, _ in self._ends()] if self.sight == "joints" else [],
        }

    def _ends(self) -> list[tuple[float, int]]:
        """Return the finite ends of the joints' ranges as they are plotted, each with its color."""
        ends = self.prepared.law.position_limit * self._degrees
        return [(float(end), self._hues[j]) for row in ends for j, end in enumerate(row) if np.isfinite(end)]

    def all(self, seen: Seen | None) -> dict[str, Panel]:
        """Return the plots by name; without ranges during a run.

        Args:
            seen: The extremes of the run, once it is over.
        """
        if seen is None:  # the layout of a killed run: every curve of a layout takes some kilobytes
            return {"rates": self._rates(seen), "sigma": self._sigma(seen)}
        found = {"rates": self._rates(seen), "sigma": self._sigma(seen), "error": self._error(seen)}
        if self.has_torque:
            found["torque"] = self._torque(seen)
        if self.is_slowed:
            found["pace"] = self._pace(seen)
        if self.moves_q:
            found["belief"] = self._belief(seen)
        if self.sight == "joints":
            found["joints"] = self._positions(seen)
        if self.sight == "rotation":
            found["rotation"] = self._rotation(seen)
        return found

    def off_scale(self, seen: Seen) -> dict[str, Peak]:
        """Return the largest rates beyond their plot: the run's own, the plain inverse's, the baseline's."""
        kinds = {"own": ("qdot", "qdot_cmd"), "plain": ("qdot_plain",), "baseline": ("baseline",)}
        found = {kind: seen.peak(*names) for kind, names in kinds.items()}
        top = self._rate_range(seen)[1]
        return {kind: peak for kind, peak in found.items() if peak is not None and abs(peak.value) > top}

    def mark_of(self, peak: Peak, seen: Seen) -> float:
        """Return the mark, in the plot of the rates, of a rate beyond the plot."""
        return float(np.copysign(0.97 * self._rate_range(seen)[1], peak.value))

    def _rate_range(self, seen: Seen) -> tuple[float, float]:
        peak = seen.peak("qdot", "qdot_cmd")
        size = abs(peak.value) if peak else 0.0
        known = self.rate_limit[np.isfinite(self.rate_limit)]
        shown = clipped(size, float(known.max(initial=0.0)), seen.mostly("qdot_cmd"))
        steps = self._steps("rates", seen)
        tight = both_ways(size or shown, steps)
        wide = both_ways(shown, steps)
        return tight if size < shown and wide[1] > CLIP * size else wide

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
        levels, names, colors = limit_lines(self.rate_limit, self._joints, self._hues)
        top = self._rate_range(seen)[1] if seen else np.inf
        beyond = sorted({level for level in levels if level > top})
        if names:
            first, both = self._joints[0], zip(names, levels, strict=True)
            drawn = [name if abs(level) <= top else first for name, level in both]
            curves.append(Curve("limits", "rate", drawn, colors, 1.0, spare=[first]))
        plain = ["plain J⁻¹"] * n
        curves.insert(0, Curve("columns", "columns.plain[]", plain, self._hues, 1.5, spare=self._joints))
        title += ", plain J⁻¹ dashed"
        if self.has_baseline:
            gray, ghost = [mix(one, GRAY, 0.5) for one in self._hues], ["baseline"] * n
            curves.insert(0, Curve("baseline/columns", "columns.dashed[]", ghost, gray, 1.5))
        if seen is None:
            return Panel(title, curves, None, is_key=True)
        if beyond:
            ends = [spell(level) for level in beyond[:: len(beyond) - 1 or 1]]
            title += f"; limit{'s' * (len(ends) > 1)} {' to '.join(ends)} ↑"
        for kind, peak in self.off_scale(seen).items():
            shape: Literal["up", "down"] = "up" if peak.value > 0 else "down"
            which = "" if kind == "own" else f"{kind} "
            whose = [self._joints[peak.which]], [self._hues[peak.which]]
            curves.append(Curve(f"peak/{kind}", "rate", *whose, 6.0, shape))
            title += f"; {which}peak {spell(abs(peak.value))} {'↑' if peak.value > 0 else '↓'}"
        return Panel(title, curves, self._rate_range(seen), is_key=True)

    def _sigma(self, seen: Seen | None) -> Panel:
        k = min(len(self._joints), len(self.axes))
        most = seen.peak("damping") if seen else None
        shared, damping = "σ_min", "λ" if most is None or most.value > 0.0 else "σ_min"
        looks = [(shared, GREEN, 3.5), *[("other σ", LIME, 1.2)] * (k - 1), (damping, MAGENTA, 2.0)]
        looks += [("σ left to 2nd", SLATE, 2.0)] * self.has_second
        names, tints, widths = zip(*looks, strict=True)
        # without room for all: with the name and the color of the first curve
        spare = [shared if name == "other σ" else name for name in names]
        curves = [
            Curve("columns", "columns.logs[]", names, tints, widths, spare=spare),
            Curve("limits", "epsilon", ["ε"], [GRAY], 1.0, spare=[shared]),
        ]
        title = "Singular values σ, damping λ and ε (gray), as log₁₀"
        if seen is None:
            return Panel(title, curves)
        inverse, range_ = seen.peak("1/sigma"), self._decades(seen)
        title += below(1.0 / inverse.value, range_) if inverse else ""
        if self.sunk(seen):
            curves.append(Curve("peak/sigma", "rate", ["σ_min"], [GREEN], 6.0, "down"))
        return Panel(title, curves, range_)

    def _decades(self, seen: Seen) -> tuple[float, float]:
        inverse, top = seen.peak("1/sigma"), seen.peak("sigma")
        least = min(1.0 / inverse.value if inverse else 1.0, self.damping_below)
        return decades(least, top.value if top else 1.0, self._steps("sigma", seen))

    def sunk(self, seen: Seen) -> Peak | None:
        """Return the mark of the least σ_min, at the lower end of its plot, if σ_min is below that end."""
        inverse, (low, high) = seen.peak("1/sigma"), self._decades(seen)
        if inverse is None or not below(1.0 / inverse.value, (low, high)):
            return None
        return replace(inverse, value=low + 0.03 * (high - low))

    def _error(self, seen: Seen | None) -> Panel:
        colors = [GOLD, SLATE] if len(self.errors) == 2 else [GOLD if "position" in self.errors[0] else SLATE]
        peak = seen.peak("error") if seen else None
        range_ = (0.0, rounded(abs(peak.value), self._steps("tabs", seen))) if peak else None
        unit = ", ".join(name.split("[")[1].rstrip("]") for name in self.errors)
        names = [name.split(" ")[0] for name in self.errors]
        curve = Curve("columns", "columns.error[]", names, colors, 2.0)
        alone = "Tip error [mm], rotation gray [mrad]" if len(names) == 2 else ""
        return Panel(f"Tip error [{unit}]", [curve], range_, alone=alone)

    def _torque(self, seen: Seen | None) -> Panel:
        _, names, colors = limit_lines(self.torque_limit, self._joints, self._hues)
        curves = [Curve("columns", "columns.tau[]", self._joints, self._hues, 2.0, spare=["joints"])]
        if names:
            curves.append(Curve("limits", "torque", names, colors, 1.0, spare=["limits"]))
        peak = seen.peak("tau") if seen else None
        if peak is None or seen is None:
            return Panel(f"Torque [{self._load}]", curves, None)
        known = self.torque_limit[np.isfinite(self.torque_limit)]
        shown = clipped(abs(peak.value), float(known.max(initial=0.0)), abs(peak.value))
        beyond = "" if not len(known) or known.max() <= shown else f", limit {spell(float(known.max()))} ↑"
        title = f"Torque [{self._load}]{beyond}"
        return Panel(title, curves, both_ways(shown, self._steps("tabs", seen)))

    def _pace(self, seen: Seen | None) -> Panel:
        curve = Curve("columns", "columns.path_rate", ["ṡ"], [GOLD], 2.5)
        range_ = (0.0, 2.2) if seen else None
        return Panel("Pace ṡ along the path [1 = as planned]", [curve], range_)

    def _positions(self, seen: Seen) -> Panel:
        curves = [Curve("columns", "columns.joints[]", self._joints, self._hues, 3.0, spare=["joints"])]
        ends = self._ends()
        if ends:
            names, tints = ["limits"] * len(ends), [tint for _, tint in ends]
            curves.append(Curve("limits", "joints", names, tints, 1.0))
        peak = seen.peak("joints")
        range_ = both_ways(abs(peak.value), self._steps("tabs", seen)) if peak else None
        return Panel(f"Joint positions [{self._position}], limits thin", curves, range_)

    def _rotation(self, seen: Seen) -> Panel:
        curves = [
            Curve("columns", "columns.turn_error[]", ["error"], [SLATE], 5.0),
            Curve("columns", "columns.turn[]", ["wanted", "actual"], [mix(GOLD, WHITE, 0.5), GOLD], 2.0),
        ]
        peak = seen.peak("turn", "turn_error")
        range_ = (0.0, rounded(abs(peak.value), self._steps("tabs", seen))) if peak else None
        return Panel("Hand turned since the start [deg]", curves, range_)

    def _belief(self, seen: Seen | None) -> Panel:
        peak = seen.peak("belief") if seen else None
        curve = Curve("columns", "columns.belief[]", self._joints, self._hues, 2.0, spare=["joints"])
        range_ = both_ways(abs(peak.value), self._steps("tabs", seen)) if peak else None
        title = f"Joints as believed, less true [{self._small}]"
        return Panel(title, [curve], range_)


def heights(has_pace: bool, sight: str, lines: int, tabs: bool = True, lanes: int = 1) -> dict[str, float]:
    """Return how high the plots are, and the strip below them [points].

    Args:
        has_pace: Whether the pace is among them.
        sight: Name of the plot to look at; "": there is none.
        lines: Lines of the legend that the rates have room for, up to `MOST_LINES`.
        tabs: Whether there are any.
        lanes: Lanes of the strip.
    """
    strip = TIMES + LANE * min(max(lanes, 1.2), MOST_LANES)
    is_below = has_pace and lanes <= FEW_LANES
    shares = {name: share for name, share in SHARES.items() if is_below or name != "pace"}
    is_tab = sight not in ("", *ALONE, *shares)
    shares |= {"tabs": LOOKED_AT if is_tab else shares["tabs"]} if tabs else {}
    points = HEIGHT - strip
    rates = max(points * shares.pop("rates") / (sum(shares.values()) + SHARES["rates"]),
                AROUND + (LINE * min(lines, MOST_LINES) + FRAME) / FILLED)  # fmt: skip
    rates = min(rates, points - sum(LEAST[name] + AROUND for name in shares))
    each = (points - rates) / sum(shares.values())
    found = {name: share * each - AROUND for name, share in shares.items()}
    if any(found[name] < LEAST[name] for name in found):
        spare = (sum(found.values()) - sum(LEAST[name] for name in found)) / sum(shares.values())
        found = {name: LEAST[name] + share * spare for name, share in shares.items()}
    return found | {"rates": rates - AROUND, "strip": strip - AROUND}


def stacked(
    panels: dict[str, Panel], end: float, status: str, lanes: int = 1, first: str = "", time: str = ""
) -> tuple[rrb.Vertical, Span]:
    """Return plots below each other, and the time that they have in common.

    Small ones are in tabs, and the strip of events is at the bottom.

    Args:
        panels: By name.
        end: End of the run [s].
        status: Entity of the strip.
        lanes: Number of lanes of the strip.
        first: The open tab; "": the first.
        time: Entity of the ruler; "": there is none yet.
    """
    is_ruled = bool(time and ruler(end))
    last = ("pace",) if lanes + is_ruled <= FEW_LANES else ()
    tabs = [name for name in panels if name not in (*ALONE, *last)]
    lines = len(panels["rates"].least)
    high = heights("pace" in panels, first, lines, bool(tabs), lanes + is_ruled)
    heights_of = {name: high["tabs" if name in tabs else name] for name in panels}
    fitted = {name: panel.fitted(heights_of[name]) for name, panel in panels.items()}
    numbers = {name: panel.numbers(heights_of[name]) for name, panel in fitted.items()}
    span = Span.of(end, max(panel.legend for panel in fitted.values()), max(numbers.values()))
    views = {name: panel.view(span.axis(span.numbers - numbers[name])) for name, panel in fitted.items()}
    active = tabs.index(first) if first in tabs else 0
    rows: dict[str, rrb.View | rrb.Container] = {name: views[name] for name in ALONE}
    if tabs:
        rows["tabs"] = rrb.Tabs(*(views[name] for name in tabs), active_tab=active)
    rows |= {name: views[name] for name in last if name in views}
    rows["strip"] = rrb.StateTimelineView(
        name="Events", contents=[status, *[time] * is_ruled], time_view=span.under(), titlebar=False
    )
    return rrb.Vertical(*rows.values(), row_shares=[high[name] + AROUND for name in rows]), span


def _of_kinds(slides: Sequence[bool], turning: str, sliding: str) -> str:
    """Return the unit of joints, or both units."""
    return " or ".join(
        unit for unit, is_slide in ((turning, False), (sliding, True)) if is_slide in set(slides)
    )
