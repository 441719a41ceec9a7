"""The figures of runs: what their panels show is what the columns hold, in sizes that a journal takes."""

import dataclasses
import re

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import null_space

from project import ROOT, mostly_long, undrawn
from rmrc.results.run import Run, read_runs
from rmrc.scenario import load
from rmrc.show.axes import GRAY, NAMES, OVER_TIME, SPANS, thinned
from rmrc.show.plot import plot
from rmrc.simulation.prepare import prepare
from rmrc.study.pictures import plot as plot_any
from rmrc.study.run import compare
from rmrc.study.run import run as run_scenario
from rmrc.study.sweep import sweep
from rmrc.support.errors import QuestionError
from rmrc.support.spatial import AXES
from wording import says

TIMED = [name for name in NAMES if name in OVER_TIME]


@pytest.fixture(scope="module")
def left(tmp_path_factory):
    """Return the folder with the files of one run, and the run."""
    folder = tmp_path_factory.mktemp("run")
    run = run_scenario(ROOT / "scenarios/blow_up.yaml")
    run.save(folder / "blow_up.npz")
    return folder, run


def axes_of(picture, label):
    (axes,) = [axes for axes in picture.get_axes() if label in axes.get_ylabel()]
    return axes


def curve(axes, label):
    (line,) = [line for line in axes.get_lines() if line.get_label() == label]
    return line.get_xydata()


def test_what_is_drawn_are_the_columns_and_no_peak_is_lost(left):
    run = left[1]
    picture = plot(run)
    rates = axes_of(picture, "rate")
    for j, name in enumerate(run.joints):
        drawn = curve(rates, name)
        assert drawn[:, 1].max() == run["qdot"][:, j].max()
        assert drawn[:, 1].min() == run["qdot"][:, j].min()
        rows = np.searchsorted(run["time"], drawn[:, 0])
        assert (run["qdot"][rows, j] == drawn[:, 1]).all()
    assert (
        curve(axes_of(picture, r"\sigma$ [1]"), r"$\sigma_{\min}$")[:, 1].min() == run["sigma"][:, -1].min()
    )
    peak = run.scorecard["joint_rate_cmd.peak"].value
    (told,) = [text.get_text() for text in rates.texts]
    assert f"peak {peak:,.0f} rad/s" in told  # 12,658: far off the scale, which shows the limits
    assert rates.get_ylim()[1] < 0.01 * peak
    limits = {line.get_ydata()[0] for line in rates.get_lines() if len(set(line.get_ydata())) == 1}
    assert limits == {5.0, -5.0}  # of the model


def test_errors_along_and_across_add_up_to_the_error(left):
    run = left[1]
    axes = axes_of(plot(run, panels=["error"]), "error")
    along, across = (curve(axes, label) for label in ("along the path [mm]", "across [mm]"))
    rows = np.intersect1d(along[:, 0], across[:, 0])
    split = [part[np.isin(part[:, 0], rows), 1] for part in (along, across)]
    wanted = 1e3 * np.linalg.norm(run["pose_error"][np.isin(run["time"], rows), :2], axis=1)
    np.testing.assert_allclose(np.hypot(*split), wanted, rtol=1e-9, atol=1e-9)  # rounding of nanometers
    assert split[1].max() > 10.0  # negative control: the tip does leave the line


def test_the_wanted_path_of_a_tip_that_only_turns_is_a_mark(left):
    """A line through one point alone is not seen; and along no path there is no error."""
    run = left[1]
    (dashed,) = [
        line for line in path_of(plot(run, panels=["path"])).get_lines() if line.get_label() == "wanted"
    ]
    assert (dashed.get_linestyle(), dashed.get_marker()) == ("--", "None")
    resting = dataclasses.replace(run, columns={**run.columns, "pose_ref": run["pose_ref"].copy()})
    resting.columns["pose_ref"][:] = run["pose_ref"][0]
    for picture in (
        plot(resting, panels=["path"]),
        plot({"one": resting, "other": resting}, panels=["path"]),
    ):
        (mark,) = [line for line in path_of(picture).get_lines() if line.get_label().startswith("wanted")]
        assert mark.get_marker() == "+"
        assert mark.get_markersize() >= 6.0
        axes = path_of(picture)
        first, second = ("xyz".index(label[1]) for label in (axes.get_xlabel(), axes.get_ylabel()))
        assert mark.get_xydata().tolist() == [run["pose_ref"][0, [first, second]].tolist()]
    names = [line.get_label() for line in axes_of(plot(resting, panels=["error"]), "error").get_lines()]
    assert names == ["position [mm]"]


def path_of(picture):
    return next(axes for axes in picture.get_axes() if re.fullmatch(r"\$[xyz]\$ \[m\]", axes.get_ylabel()))


@given(st.integers(1, 5 * SPANS), st.integers(0, 2**32 - 1))
def test_thinning_keeps_the_ends_and_the_peaks(count, seed):
    time, values = np.arange(count) * 1e-3, np.random.default_rng(seed).standard_normal(count)
    at, kept = thinned(time, values)
    assert len(at) <= 2 * SPANS + 10
    assert (np.diff(at) > 0).all()
    assert (kept == values[np.searchsorted(time, at)]).all()
    assert (kept.min(), kept.max()) == (values.min(), values.max())
    assert (at[0], at[-1] >= time[-1] - 5e-3) == (0.0, True)


@pytest.mark.parametrize(
    ("width", "inches"), mostly_long([("88mm", 88 / 25.4), ("3.5in", 3.5), ("7.16in", 7.16)], 3)
)
def test_a_picture_has_the_width_asked_and_letters_that_can_be_read(rmrc, left, width, inches):
    folder, _ = left
    code, out, err = rmrc("plot", str(folder / "blow_up.npz"), "-o", str(folder / "x.svg"), "--width", width)
    assert (code, err) == (0, "")
    assert out == f"wrote {folder / 'x.svg'}\n"
    text = (folder / "x.svg").read_text("utf-8")
    assert float(re.search(r'<svg [^>]*?width="([0-9.]+)pt"', text)[1]) == pytest.approx(
        72 * inches, abs=0.01
    )
    sizes = {float(size) for size in re.findall(r"font-size: ([0-9.]+)px", text)}
    # They are pt, though written px. Subscripts of symbols are smaller by 0.7, as in any mathematics.
    assert {7.0, 8.0} <= sizes <= {7.0, 8.0, 4.9, 5.6}


def test_fonts_are_embedded_as_journals_want_them(rmrc, left):
    folder, _ = left
    assert rmrc("plot", str(folder / "blow_up.npz"), "--panels", "sigma")[0] == 0
    content = (folder / "blow_up.pdf").read_bytes()
    assert b"/FontFile2" in content
    assert b"/Type3" not in content


def test_every_panel_can_be_drawn_alone_and_all_share_one_time(left):
    run = left[1]
    for name in NAMES:
        assert len(plot(run, panels=[name], width=3.5).get_axes()) == 1
    picture = plot(run, panels=TIMED)
    assert {axes.get_xlim() for axes in picture.get_axes()} == {(0.0, float(run["time"][-1]))}
    shown = [axes.xaxis.get_tick_params()["labelbottom"] for axes in picture.get_axes()]
    assert shown == [*[False] * (len(TIMED) - 1), True]


def test_a_file_from_before_limits_were_kept_is_drawn_without_them(left, tmp_path):
    run = left[1]
    dataclasses.replace(run, rate_limit=(), damping_below=0.0).save(tmp_path / "old.npz")
    old = Run.read(tmp_path / "old.npz")
    assert (
        plot(old, panels=["rates"]).get_axes()[0].get_yscale() == "symlog"
    )  # where a peak would hide the rest


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    """Return the file that a comparison left, and its runs."""
    folder = tmp_path_factory.mktemp("compared")
    methods = {"control.inverse.method": ["inverse", "damped"]}
    with undrawn():
        runs = compare(ROOT / "scenarios/blow_up.yaml", methods, out=folder, record=False)
    return folder / "blow_up.compare.npz", runs


def test_a_comparison_is_kept_bit_for_bit_and_has_a_curve_per_variant(compared):
    path, runs = compared
    kept = read_runs(path)
    assert list(kept) == list(runs) == ["inverse", "damped"]
    for label, run in runs.items():
        for name, column in run.columns.items():
            np.testing.assert_array_equal(kept[label].columns[name], column, strict=True)
    with pytest.raises(QuestionError, match="holds 2 runs"):
        Run.read(path)
    rates = axes_of(plot(kept, panels=["rates"]), r"\dot q")
    for label, run in runs.items():
        assert curve(rates, label)[:, 1].max() == run.scorecard["joint_rate_cmd.peak"].value
    assert rates.get_yscale() == "log"  # one blows up, and the other is still to be seen
    lanes = {text.get_text() for text in axes_of(plot(kept, panels=["status"]), "").get_yticklabels()}
    assert {"inverse: singular", "damped: damped"} <= lanes


@pytest.mark.usefixtures("undrawn")  # a comparison is drawn above
def test_the_verb_draws_a_comparison(rmrc, compared):
    path = compared[0]
    code, out, err = rmrc("plot", str(path.with_suffix(".json")), "-o", "both.svg", "--panels", "rates,g")
    assert (code, out, err) == (0, "wrote both.svg\n", "")


WRONG = {
    "no columns": (["{folder}/alone.json"], "alone.npz … missing …; `rmrc run SCENARIO` …"),
    "damaged": (["{folder}/torn.npz"], "… columns of a run, … damaged: …"),
    "panel": (
        ["{folder}/blow_up.npz", "--panels", "rate"],
        '--panels: … rate … path, rates, … did you mean "rates"?',
    ),
    "twice": (["{folder}/blow_up.npz", "--panels", "rates,rates"], "--panels: … rates … twice…"),
    "width": (["{folder}/blow_up.npz", "--width", "3"], "…--width … 2in … 3.5in … 3…"),
    "narrow": (["{folder}/blow_up.npz", "--width", "1mm"], "…--width… 2in … 40in … 1mm…"),
    "kind of picture": (["{folder}/blow_up.npz", "-o", "x.gif"], "--output x.gif: … .pdf … .png … .svg"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_mistake_is_one_line(rmrc, left, case):
    folder, _ = left
    (folder / "x.yaml").write_text("name: x\n", "utf-8")
    (folder / "alone.json").write_text("{}", "utf-8")
    (folder / "torn.npz").write_bytes((folder / "blow_up.npz").read_bytes()[:5000])
    arguments, message = WRONG[case]
    code, out, err = rmrc("plot", *(text.format(folder=folder) for text in arguments))
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert err == says(f"rmrc: error: … {message.format(folder=folder)}\n")


def test_what_is_no_run_is_refused_in_python_too(tmp_path):
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    with pytest.raises(QuestionError, match=r"other\.npz"):
        Run.read(tmp_path / "other.npz")


def ellipses_of(axes):
    """Return outlines of ellipses on a path, the time for which they stand [s], and how they are called."""
    name, _, time = axes.patches[0].get_label().rpartition(", ")
    return [patch.get_path().vertices for patch in axes.patches], float(time.removesuffix(" s")), name


def test_ellipses_on_the_path_are_those_of_the_jacobian(left):
    run = left[1]
    (path,) = plot(run, panels=["path"]).get_axes()
    outlines, time, name = ellipses_of(path)
    assert len(outlines) >= 3
    assert name == "velocity ellipse"  # all of it: the task is in the plane
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


QUICK = {"plant.kind": "ideal", "control.period": 0.02, "control.inverse.method": "damped"}
SPATIAL = {
    "a slide and joint weights": (
        "stanford_wrist", {"task.length": 0.3, "control.joint_weights": [1, 2, 3, 4, 5, 6]},
    ),
    "axes of the site": ("ur5e_wrist", {"task.frame": "site"}),
    "some rows along axes of the site": ("puma_elbow", {"task.frame": "site", "task.axes": ["x", "z", "ry"]}),
    "translations alone": ("puma_elbow", {"task.axes": ["x", "y", "z"]}),
}  # fmt: skip


@pytest.mark.parametrize("case", SPATIAL)
def test_an_ellipse_of_a_spatial_arm_is_the_shadow_of_the_ellipsoid_that_mujoco_gives(tmp_path, case):
    """The width of {M q̇ : ‖q̇‖ = 1} along d is ‖Mᵀ d‖, with M of MuJoCo, along rates that hold the rotations."""
    name, changes = SPATIAL[case]
    prepared = prepare(load(ROOT / f"scenarios/{name}.yaml").set({**QUICK, **changes}))
    run_scenario(prepared.scenario).save(tmp_path / "kept.npz")
    run, model = Run.read(tmp_path / "kept.npz"), prepared.true_arm.model
    (path,) = plot(run, panels=["path"]).get_axes()
    outlines, time, named = ellipses_of(path)
    assert named == "velocity ellipsoid, shadow"
    assert len(outlines) >= 2
    weights = np.array(changes.get("control.joint_weights", np.ones(len(run.joints))))
    scale = np.where(run.is_slide, run.length, 1.0) / np.sqrt(weights)
    rows, data = [AXES.index(axis) for axis in run.axes], mujoco.MjData(model)
    plane = ["xyz".index(label()[1]) for label in (path.get_xlabel, path.get_ylabel)]
    centers = [(outline.min(axis=0) + outline.max(axis=0)) / 2 for outline in outlines]
    for outline, center in zip(outlines, centers, strict=True):
        off, misses = np.linalg.norm(run["pose"][:, plane] - center, axis=1), []
        for row in np.flatnonzero(off < 1e-12):  # one, or more where it rests
            data.qpos[:] = run["qpos"][row]
            mujoco.mj_forward(model, data)
            J, site = np.zeros((6, model.nv)), prepared.true_arm.wiring.site
            mujoco.mj_jacSite(model, data, J[:3], J[3:], site)
            J = J[:, prepared.true_arm.wiring.dof] * scale
            R = data.site_xmat[site].reshape(3, 3) if run.view.frame == "site" else np.eye(3)
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
        assert min(misses) < 1.5e-3


def test_a_tip_that_only_turns_has_no_path_unless_it_is_asked_for(left):
    run = run_scenario(load(ROOT / "scenarios/three_roll.yaml").set({"control.period": 0.02}))
    assert not any("[m]" in axes.get_ylabel() for axes in plot(run).get_axes())
    figure = plot(run, panels=["path"], width=3.5)
    figure.draw_without_rendering()
    assert figure.get_axes()[0].get_tightbbox().x0 >= 0.0
    held = dataclasses.replace(left[1], columns={name: one[:1] for name, one in left[1].columns.items()})
    assert any("[m]" in axes.get_ylabel() for axes in plot(held).get_axes())  # its ellipse tells


def test_a_run_without_screws_has_no_ellipses(left):
    run, bare = left[1], {"screws": (), "leaders": (), "joint_scale": ()}
    (path,) = plot(dataclasses.replace(run, **bare), panels=["path"]).get_axes()
    assert not path.patches


def rates_of(run, **changes):
    """Return the panel of rates of a run with another column or limit, and what is written in it."""
    columns = dict(run.columns) | changes.pop("columns", {})
    axes = axes_of(plot(dataclasses.replace(run, columns=columns, **changes), panels=["rates"]), r"\dot q")
    return axes, "\n".join(text.get_text() for text in axes.texts)


def test_what_the_plain_inverse_asks_is_dashed_and_its_peak_is_written(compared):
    run = compared[1]["damped"]
    asked = 10.0 * run["qdot_cmd"]
    asked[100, 1] = -512.0
    axes, told = rates_of(run, columns={"qdot_plain": asked})
    assert "asks 512 rad/s ↑ (elbow)" in told
    dashed = [line for line in axes.get_lines() if line.get_linestyle() == "--" and len(line.get_xdata()) > 2]
    drawn = [line.get_ydata() for line in dashed]
    assert any((values == -512.0).any() for values in drawn)
    assert axes.get_ylim()[1] < 20.0  # the others are still seen
    axes, told = rates_of(run, columns={"qdot_plain": run["qdot_cmd"]})
    assert "asks" not in told  # the same curve
    axes, told = rates_of(run, columns={"qdot_plain": np.full_like(asked, np.nan)})
    assert "asks" not in told  # a file from before it was kept


def test_a_baseline_is_dashed_and_gray_and_its_peak_is_written(compared):
    run, other = compared[1]["damped"], compared[1]["inverse"]
    axes, told = rates_of(run, baseline=other)
    peak = np.abs(other["qdot_cmd"]).max()
    joint = other.joints[np.abs(other["qdot_cmd"]).max(axis=0).argmax()]
    assert f"baseline commands {peak:,.0f} rad/s ↑ ({joint})" in told
    gray = [line.get_ydata() for line in axes.get_lines() if line.get_color() == GRAY]
    assert len(gray) == len(run.joints) and max(np.abs(one).max() for one in gray) == peak
    assert axes.get_ylim()[1] < 20.0  # the others are still seen
    axes, told = rates_of(run)
    assert "baseline" not in told and GRAY not in [line.get_color() for line in axes.get_lines()]


def test_a_limit_far_above_the_rates_is_told_and_does_not_flatten_them(compared):
    run = compared[1]["damped"]
    axes, told = rates_of(run, rate_limit=(100.0, 100.0))
    assert "limit 100 rad/s ↑" in told
    assert axes.get_ylim()[1] < 10.0


def test_legends_of_long_names_stay_within_the_figure(left):
    run = dataclasses.replace(left[1], joints=("a_rather_long_name_of_a_joint", "another_one_that_is_long"))
    picture = plot(run, panels=["rates", "sigma"], width=3.5)
    picture.draw_without_rendering()
    for axes in picture.get_axes():
        assert axes.get_legend().get_window_extent().x1 <= picture.bbox.x1


def test_a_rotation_error_far_above_those_of_the_position_is_within_its_panel(compared):
    runs = {}
    for (label, run), size in zip(compared[1].items(), (0.5e-6, 0.02), strict=True):
        off = np.zeros_like(run["pose_error"])
        off[:, 0], off[:, 5] = size * (1.0 - 0.5 * np.sin(run["time"])), 0.9 * np.sin(run["time"])
        columns = run.columns | {"pose_error": off}
        runs[label] = dataclasses.replace(run, columns=columns, axes=("x", "rz"))
    axes = axes_of(plot(runs, panels=["error"]), "error")
    peaks = [1e3 * np.abs(run["pose_error"][:, 5]).max() for run in runs.values()]
    assert axes.get_yscale() == "log"  # of the positions, which are below 100 mm
    assert 100.0 < max(peaks) <= axes.get_ylim()[1]


def test_an_arm_that_locks_within_its_limits_is_drawn_to_scale(compared):
    run = compared[1]["damped"]
    locked = {name: np.where(run["time"][:, None] < 1.0, run[name], 0.0) for name in ("qdot", "qdot_cmd")}
    assert rates_of(run, columns=locked)[0].get_yscale() == "linear"
    assert rates_of(run, columns=locked, rate_limit=())[0].get_yscale() == "symlog"  # without limits, by peak


@pytest.mark.parametrize("what", mostly_long(["comparison", "run"], 2))
@pytest.mark.parametrize("width", mostly_long([3.5, 7.16], 2))
def test_nothing_in_a_figure_covers_anything_else_or_is_cut(compared, width, what):
    run = compared[1]["damped"]
    long = dataclasses.replace(run, joints=("a_rather_long_name_of_a_joint", "another_one_that_is_long"))
    drawn = {"a_long_label": run, **compared[1]} if what == "comparison" else long
    figure = plot(drawn, width=width)
    figure.draw_without_rendering()
    boxes = [axes.get_tightbbox() for axes in figure.get_axes()]
    for i, box in enumerate(boxes):
        assert figure.bbox.x0 <= box.x0 and box.x1 <= figure.bbox.x1 and box.y1 <= figure.bbox.y1
        assert box.y0 >= figure.bbox.y0
        for other in boxes[:i]:
            across = min(box.x1, other.x1) - max(box.x0, other.x0)
            assert across <= 0 or min(box.y1, other.y1) - max(box.y0, other.y0) <= 1.0  # a pixel


def test_a_logarithmic_axis_has_its_powers_as_letters(left):
    axes = axes_of(plot(left[1], panels=["sigma"]), r"\sigma$ [1]")
    low, high = axes.get_ylim()
    powers = [tick for tick in axes.get_yticks() if low <= tick <= high]
    assert len(powers) >= 3
    for tick in powers:
        text = axes.yaxis.get_major_formatter()(tick)
        raised = text.removeprefix("10").translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789"))
        assert 10.0 ** int(raised) == pytest.approx(tick)


def test_python_draws_a_sweep_from_its_rows_or_its_file_as_the_verb_does(rmrc, tmp_path):
    feedback = {"control.feedback": [5, 10, 20]}
    with undrawn():
        rows = sweep(ROOT / "scenarios/line_tracking.yaml", feedback, out=tmp_path, threads=1)
    (file,) = tmp_path.glob("*.parquet")
    first = plot_any(rows, tmp_path / "rows.svg", ["keys"])
    plot_any(file, tmp_path / "file.svg", ["keys"])
    assert rmrc("plot", str(file), "-o", str(tmp_path / "verb.svg"), "--panels", "keys")[0] == 0
    texts = [(tmp_path / f"{name}.svg").read_bytes() for name in ("rows", "file", "verb")]
    assert texts[0] == texts[1] == texts[2]
    assert len(first.get_axes()) == 1
