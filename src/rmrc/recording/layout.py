"""The layout of a recording: picture and texts at the left, plots and statuses at the right."""

from collections.abc import Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from rmrc.recording.picture import Array, Picture
from rmrc.recording.plots import Plot
from rmrc.recording.scene import FORCE_EQUAL, FORCE_LONGEST, VELOCITY_SECONDS

# The viewer's vertical angle of view; width over height of the picture in a window of 1280 × 720 points.
VIEW_ANGLE, VIEW_ASPECT = np.radians(55.0), 0.95
# Relative heights of the rates, of σ and λ, of the tabs with all other plots, and of a lane of the strip,
# with room for so many.
RATES, SIGMA, TABS, LANE, MOST_LANES = 3.0, 2.2, 1.9, 0.55, 5

LEGEND = f"""\
| in the picture | is |
|---|---|
| **thin line**, **white ball** | path of the target, and the target now |
| **trail**, **ball** | end effector (tip), past and now; **red** near a singularity |
| **green ellipsoid** | velocities at unit-norm joint rates, {VELOCITY_SECONDS:g} s · σ_i; **flat**: lost |
| **pink wires** | forces at unit-norm joint torques, c/σ_i |
| **double arrow** | direction lost first (u_min), thin: its rotation; **red** as σ_min goes to 0 |
| **pale arm** | the arm as the controller sees it; gray: the baseline; in one color: another run |

Both are equal at σ = {FORCE_EQUAL:g} of the reach; pink is {FORCE_LONGEST:g} of it at most. σ_i here are \
those of the task's translations, with its rotations held. Links, axes and curves have the joints' colors.
"""


def layout(pictures: Sequence[Picture], plots: Sequence[Plot], texts: Sequence[str]) -> rrb.Blueprint:
    """Return the whole layout, without the viewer's own panels.

    Args:
        pictures: All runs in the picture.
        plots: The plots: rates, σ and λ, and others.
        texts: Titles of the texts.
    """
    rates, sigma, *others = plots
    shown = next((i for i, plot in enumerate(others) if plot.instants), 0)
    lanes = 1 if pictures[0].is_alone else len(pictures)
    right = rrb.Vertical(
        rates.view(),
        sigma.view(),
        rrb.Tabs(*(plot.view() for plot in others), active_tab=shown),
        rrb.StateTimelineView(contents="/status/**", time_view=rates.time_axis(), titlebar=False),
        row_shares=[RATES, SIGMA, TABS, LANE * (0.7 + min(lanes, MOST_LANES))],
    )
    documents = [rrb.TextDocumentView(origin=f"/text/{title.lower()}", name=title) for title in texts]
    numbers = [rrb.TextDocumentView(origin="/now", titlebar=False)] * pictures[0].is_alone
    shares = [7.0, *[1.15] * len(numbers), 2.1]
    left = rrb.Vertical(picture_view(pictures), *numbers, rrb.Tabs(*documents), row_shares=shares)
    return rrb.Blueprint(
        rrb.Horizontal(left, right, column_shares=[8, 12]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline="sim_time", play_state="playing", loop_mode="all"),
    )


def picture_view(pictures: Sequence[Picture]) -> rrb.Spatial3DView:
    """Return the picture of all runs, dark in both themes."""
    prefixes, normal = [picture.stream.prefix for picture in pictures], pictures[0].scene.normal
    points = np.vstack([picture.scene.points(picture.frames) for picture in pictures])
    begin, now = rrb.TimeRangeBoundary.infinite(), rrb.TimeRangeBoundary.cursor_relative()
    until_now = rrb.VisibleTimeRanges([rrb.VisibleTimeRange("sim_time", start=begin, end=now)])
    floor = rr.components.Plane3D.XY.with_distance(float(points[:, 2].min()))
    roots = ("arm", "believed", "target", "tip")
    return rrb.Spatial3DView(
        name=pictures[0].prepared.scenario.name,
        contents=[f"/{prefix}{root}/**" for prefix in prefixes for root in roots],
        overrides={f"{prefix}tip/trail": until_now for prefix in prefixes},
        eye_controls=eye(points, normal),
        line_grid=rrb.LineGrid3D(plane=floor, color=[255, 255, 255, 30]),
        background=rrb.Background(kind=rrb.BackgroundKind.SolidColor, color=[13, 16, 17]),
    )


def eye(points: Array, normal: int | None) -> rrb.EyeControls3D:
    """Return the eye that has all points (p, 3) in its frame.

    It sees a planar arm almost along its normal axis, and others obliquely.
    """
    toward = {None: (0.75, -1.0, 0.55), 0: (1.0, -0.2, 0.2), 1: (0.2, -1.0, 0.2), 2: (0.0, -0.25, 1.0)}
    back = np.array(toward[normal]) / np.linalg.norm(toward[normal])
    right = np.cross([0.0, 0.0, 1.0], back) / np.linalg.norm(back[:2])
    axes = np.array([right, np.cross(back, right), back])
    seen = points @ axes.T
    middle = (seen.min(axis=0) + seen.max(axis=0)) / 2
    across = (np.abs(seen - middle)[:, :2] / [VIEW_ASPECT, 1.0]).max(axis=1)
    distance = (across / np.tan(VIEW_ANGLE / 2) + (seen - middle)[:, 2]).max()
    center = middle @ axes
    return rrb.EyeControls3D(position=center + distance * back, look_target=center, eye_up=(0, 0, 1))
