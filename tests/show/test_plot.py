"""The figures of runs: what their panels show is what the columns hold, in sizes that a journal takes."""

import dataclasses
import re

import mujoco
import numpy as np
import pytest
from scipy.linalg import null_space

from project import ROOT
from rmrc.results.run import Run
from rmrc.scenario import load
from rmrc.show.figure import SPANS, plot
from rmrc.show.figures import skeleton
from rmrc.simulation.prepare import prepare
from rmrc.study.run import run as run_scenario
from rmrc.support.spatial import AXES


def panel_of(runs, name, **options):
    (axes,) = plot(runs, panels=[name], **options).get_axes()
    return axes


def heading(axes):
    return axes.get_legend().get_title().get_text().split("\n")


def curve(axes, label):
    (line,) = [line for line in axes.get_lines() if line.get_label() == label]
    return line.get_xydata()


def test_what_is_drawn_are_the_columns_and_no_peak_is_lost(compared):
    run = compared["inverse"]
    rates, sigma = (panel_of(run, name) for name in ("rates", "sigma"))
    for j, name in enumerate(run.joints):
        for label, column in ((name, "qdot"), (f"{name}, cmd", "qdot_cmd")):
            drawn = curve(rates, label)
            assert len(drawn) <= 2 * SPANS + 10
            assert (drawn[:, 1].min(), drawn[:, 1].max()) == (
                run[column][:, j].min(),
                run[column][:, j].max(),
            )
            assert (run[column][np.searchsorted(run["time"], drawn[:, 0]), j] == drawn[:, 1]).all()
    assert curve(sigma, "σ_min")[:, 1].min() == run["sigma"][:, -1].min()
    peak = run.scorecard["joint_rate_cmd.peak"].value
    title, *beyond = heading(rates)
    assert title == "Joint rates [rad/s]" and f"peak {peak:,.0f}" in " ".join(beyond)
    assert rates.get_ylim()[1] < 0.01 * peak  # 12,658: far off the scale, which shows the limits
    limits = {line.get_ydata()[0] for line in rates.get_lines() if len(set(line.get_ydata())) == 1}
    assert {5.0, -5.0} <= limits  # of the model
    low, high = sigma.get_ylim()
    assert sum(low <= tick <= high for tick in sigma.get_yticks()) >= 3


@pytest.mark.parametrize(("what", "width"), [("comparison", 3.5), ("run", 7.16)])
def test_nothing_in_a_figure_covers_anything_else_or_is_cut(compared, width, what):
    run = compared["damped"]
    long = dataclasses.replace(
        run,
        joints=("a_rather_long_name_of_a_joint", "another_one_that_is_long"),
        baseline=compared["inverse"],
    )
    figure = plot({"a_long_label": run, **compared} if what == "comparison" else long, width=width)
    figure.draw_without_rendering()
    boxes = [axes.get_tightbbox() for axes in figure.get_axes()]
    for i, box in enumerate(boxes):
        assert figure.bbox.x0 <= box.x0 and box.x1 <= figure.bbox.x1 and box.y1 <= figure.bbox.y1
        assert box.y0 >= figure.bbox.y0
        for other in boxes[:i]:
            across = min(box.x1, other.x1) - max(box.x0, other.x0)
            assert across <= 0 or min(box.y1, other.y1) - max(box.y0, other.y0) <= 1.0  # a pixel


@pytest.mark.parametrize(("width", "font"), [(3.5, 8.0), (7.16, 9.0)])
def test_a_picture_has_the_width_asked_and_letters_that_can_be_read(compared, tmp_path, width, font):
    plot(compared["inverse"], tmp_path / "run.svg", width=width, font=font)
    text = (tmp_path / "run.svg").read_text("utf-8")
    assert float(re.search(r'<svg [^>]*?width="([0-9.]+)pt"', text)[1]) == pytest.approx(72 * width, abs=0.1)
    sizes = {float(size) for size in re.findall(r"font(?:-size)?: ([0-9.]+)px", text)}
    small = max(min(7.0, font), font - 1.0)
    # They are pt, though written px. Superscripts are smaller by 0.7, as in any mathematics.
    assert {font} <= sizes <= {font, small, round(0.7 * font, 6), round(0.7 * small, 6)}


def test_fonts_are_embedded_as_journals_want_them(compared, tmp_path):
    plot(compared["inverse"], tmp_path / "x.pdf", panels=["sigma"])
    content = (tmp_path / "x.pdf").read_bytes()
    assert b"/FontFile2" in content and b"/Type3" not in content


def ellipses_of(axes):
    """Return outlines of ellipses on a path, the time for which they stand [s], and how they are called."""
    name, _, time = axes.patches[0].get_label().rpartition(", ")
    return [patch.get_path().vertices for patch in axes.patches], float(time.removesuffix(" s")), name


def test_ellipses_on_the_path_are_those_of_the_jacobian(compared):
    run = compared["inverse"]
    outlines, time, name = ellipses_of(panel_of(run, "path"))
    assert len(outlines) >= 3 and name == "velocity ellipse"  # all of it: the task is in the plane
    checked = 0
    for outline in outlines:
        center = (outline.min(axis=0) + outline.max(axis=0)) / 2
        row = np.linalg.norm(run["pose"][:, :2] - center, axis=1).argmin()
        first, second = run["q"][row, 0], run["q"][row].sum()
        if abs(np.sin(second - first)) < 0.1:
            continue  # where the inverse below is none
        J = np.array([
            [-np.sin(first) - np.sin(second), -np.sin(second)], [np.cos(first) + np.cos(second), np.cos(second)]
        ])  # fmt: skip
        rates = np.linalg.solve(J, (outline - center).T / time)
        np.testing.assert_allclose(np.linalg.norm(rates, axis=0), 1.0, rtol=2e-3)  # a tick beside the row
        checked += 1
    assert checked >= 2
    bare = dataclasses.replace(run, screws=(), leaders=(), joint_scale=())
    assert not panel_of(bare, "path").patches and len(panel_of(bare, "arm").get_lines()) == 2  # paths alone


QUICK = {"plant.kind": "ideal", "control.period": 0.02, "control.inverse.method": "damped"}
SPATIAL = {
    "a slide and joint weights": (
        "stanford_wrist", {"task.length": 0.3, "control.joint_weights": [1, 2, 3, 4, 5, 6]},
    ),
    "some rows along axes of the site": ("puma_elbow", {"task.frame": "site", "task.axes": ["x", "z", "ry"]}),

}  # fmt: skip


@pytest.mark.parametrize("case", SPATIAL)
def test_an_ellipse_of_a_spatial_arm_is_the_shadow_of_the_ellipsoid_that_mujoco_gives(tmp_path, case):
    """The width of {M q̇ : ‖q̇‖ = 1} along d is ‖Mᵀ d‖, with M of MuJoCo, along rates that hold the rotations."""
    name, changes = SPATIAL[case]
    prepared = prepare(load(ROOT / f"scenarios/{name}.yaml").set({**QUICK, **changes}))
    run_scenario(prepared.scenario).save(tmp_path / "kept.npz")
    run, model = Run.read(tmp_path / "kept.npz"), prepared.true_arm.model
    path = panel_of(run, "path")
    outlines, time, named = ellipses_of(path)
    assert named == "velocity ellipsoid, shadow"
    assert len(outlines) >= 2
    weights = np.array(changes.get("control.joint_weights", np.ones(len(run.joints))))
    scale = np.where(run.is_slide, run.length, 1.0) / np.sqrt(weights)
    rows, data = [AXES.index(axis) for axis in run.axes], mujoco.MjData(model)
    wiring = prepared.true_arm.wiring
    plane = ["xyz".index(label()[1]) for label in (path.get_xlabel, path.get_ylabel)]
    centers = [(outline.min(axis=0) + outline.max(axis=0)) / 2 for outline in outlines]
    for outline, center in zip(outlines, centers, strict=True):
        off, misses = np.linalg.norm(run["pose"][:, plane] - center, axis=1), []
        for row in np.flatnonzero(off < 1e-12):  # one, or more where it rests
            data.qpos[:] = run["qpos"][row]
            mujoco.mj_forward(model, data)
            J = np.zeros((6, model.nv))
            mujoco.mj_jacSite(model, data, J[:3], J[3:], wiring.site)
            J = J[:, wiring.dof] * scale
            R = data.site_xmat[wiring.site].reshape(3, 3) if run.view.frame == "site" else np.eye(3)
            J[:3], J[3:] = R.T @ J[:3], R.T @ J[3:]
            moved, held = [row for row in rows if row < 3], [row for row in rows if row > 2]
            M = J[moved] @ (null_space(J[held], rcond=1e-6) if held else np.eye(len(run.joints)))
            M = R[:, moved] @ M
            angle = np.linspace(0.0, np.pi, 40)
            d = np.zeros((3, 40))
            d[plane] = np.cos(angle), np.sin(angle)
            wide = ((outline - center) @ d[plane]).max(axis=0) / time
            # the outline has 73 points: between two it is inside by a part of 1 - cos(2.5 deg)
            misses.append(np.abs(wide - np.linalg.norm(M.T @ d, axis=0)).max() / np.abs(wide).max())
            check_skeleton(run, row, data, model.dof_jntid[wiring.dof], data.site_xpos[wiring.site])
        assert min(misses) < 1.5e-3


def check_skeleton(run, row, data, joints, tip):
    """Compare the drawn arm with MuJoCo's: its points are on the axes of the joints, and a slide is along its own."""
    points = skeleton(run, row)
    np.testing.assert_allclose(points[-1], tip, atol=1e-9)
    for j, joint in enumerate(joints):
        axis = data.xaxis[joint]
        off = points[j + 1] - points[j] if run.is_slide[j] else points[j] - data.xanchor[joint]
        np.testing.assert_allclose(np.cross(axis, off), 0.0, atol=1e-9)
        if run.is_slide[j]:
            np.testing.assert_allclose(off @ axis, run["q"][row, j], atol=1e-9)
