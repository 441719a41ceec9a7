"""Pictures of the textbook's formulas show what the words beside them say."""

import numpy as np
from numpy.testing import assert_allclose

from rmrc.show.textbook_figures import DISPLACEMENT, STYLES, displacements, figure, small_displacements
from rmrc.textbook.two_link import two_link_position

ELBOW = np.array([0.003, 0.01, 0.1, 1.0])


def test_the_exact_answer_moves_the_tip_by_what_was_asked():
    for wanted in ((-DISPLACEMENT, 0.0), (0.0, DISPLACEMENT)):
        q = np.stack([0.0 * ELBOW, ELBOW], axis=-1)
        exact = displacements(ELBOW, wanted)["exact"]
        moved = two_link_position((1, 1), q + exact) - two_link_position((1, 1), q)
        assert_allclose(moved, np.broadcast_to(wanted, moved.shape), atol=1e-12)


def test_all_agree_where_they_should_and_differ_where_they_must():
    along = displacements(ELBOW, (-DISPLACEMENT, 0.0))
    # Far away J⁻¹ is right to first order in 1 mm; near full reach it asks for ten times too much.
    assert_allclose(along["inverse"][-1], along["exact"][-1], rtol=2e-3)
    assert np.all(np.abs(along["inverse"][0]) > 10.0 * np.abs(along["exact"][0]))
    # The notes' approximation is that of J⁻¹, but for a part θ₂.
    assert np.all(np.abs(along["notes"] / along["inverse"] - 1.0).max(axis=1)[:3] < ELBOW[:3])
    across = displacements(ELBOW, (0.0, DISPLACEMENT))
    for each in across.values():
        assert np.all(np.abs(each) < 2.0 * DISPLACEMENT)


def test_outwards_there_is_no_answer_near_full_reach():
    # 2 − 2 cos(θ₂/2) = 1 mm at θ₂ = 0.0632
    exact = displacements(np.array([0.063, 0.064]), (DISPLACEMENT, 0.0))["exact"]
    assert np.isnan(exact[0]).all() and np.isfinite(exact[1]).all()


def test_curves_differ_without_colors_and_words_name_axes_and_units(tmp_path):
    picture = figure()
    for axes in picture.axes:
        assert (axes.get_xlabel(), axes.get_ylabel()) == (r"$\theta_2$ [rad]", "joint displacement [rad]")
        looks = {(line.get_linestyle(), line.get_marker()) for line in axes.lines}
        assert len(axes.lines) == len(looks) == 2 * len(STYLES)
    small_displacements([tmp_path / "a.svg"])
    assert (tmp_path / "a.svg").read_text("utf-8").startswith("<?xml")
