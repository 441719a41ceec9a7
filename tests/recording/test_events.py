import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rmrc.recording.events import Strip, room, words

STATES = st.lists(
    st.tuples(st.floats(1e-3, 5.0), st.sampled_from([0, 1, 2, 4, 8, 3, 16, 64])), min_size=1, max_size=12
)


def strip_of(states):
    """A strip and its end."""
    strip, begin = Strip(), np.cumsum([0.0, *(length for length, _ in states)])
    strip.add(begin[:-1], np.array([state for _, state in states]))
    return strip, float(begin[-1])


@given(STATES)
def test_labels_are_in_order_and_have_room_but_for_the_last(states):
    strip, end = strip_of(states)
    labels = strip.labels(end)
    begins = [label.time for label in labels]
    assert begins[0] == 0.0 and (np.diff([*begins, end]) >= 0.0).all()
    for label, until in zip(labels[:-1], begins[1:], strict=True):
        assert until - label.time >= room(label.text) * end * (1.0 - 1e-9), labels


def test_a_long_state_keeps_its_place_and_short_ones_share_a_label_with_their_times():
    strip, end = strip_of([(4.0, 0), (0.02, 1), (0.03, 2), (5.95, 0)])
    free, short, after = strip.labels(end)
    assert (free.time, free.text, after.text, short.time) == (0.0, "free", "free", 4.0)
    assert short.text == f"{words(2)} 30 ms +1"


def test_a_short_last_state_is_lengthened_where_there_is_room_before_it():
    strip, end = strip_of([(9.9, 0), (0.1, 1)])
    last = strip.labels(end)[-1]
    assert words(1) in last.text and end - last.time == pytest.approx(room(last.text) * end)
    strip, end = strip_of([(5.0, 0), (5.0, 1)])  # negative control: it has room
    assert strip.labels(end)[-1].time == 5.0
