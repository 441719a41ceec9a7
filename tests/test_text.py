"""Foreign texts as a terminal can show them."""

from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from rmrc.support.text import line, visible

ANY = st.text(st.characters())  # lone surrogates as well


@given(ANY)
def test_what_is_visible_can_be_printed_and_says_what_was_there(text):
    shown = visible(text)
    assert shown.isprintable()
    if "\\" not in text:  # Python's own reading of the escapes is the oracle
        whole = "".join(one if one.isascii() else f"\\U{ord(one):08x}" for one in shown)
        assert whole.encode("ascii").decode("unicode_escape") == text


def test_only_the_value_of_a_long_message_is_cut():
    key, cure = "scenarios/x.yaml:7:13: arm.site: has no site", "; its sites: tip"
    cut = line(f'{key} "{"a" * 9000}"{cure}')
    assert cut.startswith(f'{key} "aaa') and cut.endswith(f'…{"a" * 38}" (9,000 characters){cure}')
    path = Path("/").joinpath(*["folder"] * 60)
    assert line(f"{path}: no such file") == f"{path}: no such file"
