import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rmrc.recording.events import FLICKER, LETTERS, Strip, room, ruled, words
from rmrc.scenario.choices import Status
from rmrc.show.palette import of_status

STATES = st.lists(
    st.tuples(st.floats(1e-3, 5.0), st.sampled_from([0, 1, 2, 4, 8, 3, 16, 64])), min_size=1, max_size=FLICKER
)


def strip_of(states):
    """A strip and its end."""
    strip, begin = Strip(), np.cumsum([0.0, *(length for length, _ in states)])
    strip.add(begin[:-1], np.array([state for _, state in states]))
    return strip, float(begin[-1])


def color_at(pieces, time):
    """The color of the last of (begin, color) that begins by then."""
    return [color for begin, color in pieces if begin <= time + 1e-12][-1]


@given(STATES)
def test_each_color_lasts_as_long_as_its_state_and_each_text_has_room(states):
    """At every instant the strip has the color of what holds there, so that no label lengthens a state."""
    strip, end = strip_of(states)
    labels = strip.labels(end)
    begins = [label.time for label in labels]
    assert begins[0] == 0.0 and (np.diff([*begins, end]) >= 0.0).all()
    changes = np.cumsum([0.0, *(length for length, _ in states)])
    true = list(zip(changes[:-1], [of_status(one) for _, one in states], strict=True))
    drawn = [(label.time, label.color) for label in labels]
    instants = np.unique([*changes[:-1], *begins])
    assert all(color_at(drawn, time) == color_at(true, time) for time in instants)
    for label, until in zip(labels, [*begins[1:], end], strict=True):
        if label.text != " " and len(labels) > 1:
            assert until - label.time >= room(label.text) * end / LETTERS * (1.0 - 1e-9), labels
    assert any(label.text != " " for label in labels)


@given(STATES)
def test_a_state_of_the_lane_has_one_text_and_one_color(states):
    labels = strip_of(states)[0].labels(strip_of(states)[1])
    looks = {(label.state, label.text, label.color) for label in labels}
    assert len(looks) == len({state for state, *_ in looks})


def test_short_states_are_told_on_a_neighbor_with_an_arrow_to_them():
    strip, end = strip_of([(4.0, 0), (0.02, 1), (0.03, 2), (5.95, 0)])
    free, short, after = strip.labels(end)
    assert (free.time, free.text, short.time, short.text) == (0.0, "free", 4.0, " ")
    assert (after.time, after.text) == (pytest.approx(4.05), f"← {words(2)} 30 ms +1 · free")
    strip, end = strip_of([(9.9, 0), (0.1, 1)])  # at the end: the arrow leads to the right
    free, told, last = strip.labels(end)
    assert (told.text, told.color, last.time) == (f"{words(1)} 100 ms →", free.color, pytest.approx(9.9))
    strip, end = strip_of([(5.0, 0), (5.0, 1)])  # negative control: both have room
    assert [label.text for label in strip.labels(end)] == ["free", words(1)]


def test_what_is_told_leaves_out_what_holds_beside_it_if_that_is_shorter():
    """A short time of a jerk limit within a long stop."""
    stopped = Status.STOPPED
    strip, end = strip_of([(3.0, 0), (0.1, stopped | Status.JERK_LIMITED), (2.0, stopped), (3.0, 0)])
    assert [label.text for label in strip.labels(end, 90.0)][1] == "jerk limited 100 ms →"


def test_the_shortest_text_names_the_grave_state():
    grave = Status.RATE_LIMITED | Status.SINGULAR | Status.TORQUE_LIMITED
    strip, end = strip_of([(4.0, 0), (0.1, grave), (3.0, 0)])
    told = ["free", "singular 100 ms →", " ", "free"]  # where there is room for what both parts are
    assert [label.text for label in strip.labels(end, 60.0)] == told


def test_states_that_flicker_are_one_in_the_color_of_the_gravest():
    flicker = [(0.1, Status.SINGULAR), (0.1, 0)] * 20
    strip, end = strip_of([(4.0, 0), *flicker, (4.0, 0)])
    free, shared, _ = strip.labels(end)
    assert (shared.time, shared.text) == (4.0, "singular 2000 ms")
    assert shared.color == of_status(Status.SINGULAR) != free.color


def test_a_ruler_has_alternating_shades():
    labels = ruled((0.0, 2.0, 4.0))
    assert [label.text for label in labels] == ["0 s", "2 s", "4 s"]
    assert labels[0].color == labels[2].color != labels[1].color


def test_a_free_part_with_an_arrow_says_that_it_is_free():
    """A shorter text leaves room for it; where there is none even so, the arrow alone remains."""
    strip, end = strip_of([(0.1, Status.RATE_LIMITED | Status.SINGULAR), (3.0, 0)])
    assert strip.labels(end, 60.0)[-1].text == "← rate limited, singular 100 ms · free"
    assert strip.labels(end, 30.0)[-1].text == "← singular 100 ms · free"
    assert strip.labels(end, 24.0)[-1].text == "← singular 100 ms"  # negative control
