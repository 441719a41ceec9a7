"""Foreign texts as a terminal can show them."""

import io
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from project import ROOT
from rmrc.support import legible

ANY = st.text(st.characters())  # lone surrogates as well


@given(ANY)
def test_what_is_visible_can_be_printed_and_says_what_was_there(text):
    shown = legible.visible(text)
    assert shown.isprintable()
    if "\\" not in text:  # Python's own reading of the escapes is the oracle
        whole = "".join(one if one.isascii() else f"\\U{ord(one):08x}" for one in shown)
        assert whole.encode("ascii").decode("unicode_escape") == text


@given(ANY)
def test_ascii_has_no_other_letters_and_leaves_its_own(text):
    assert legible.in_ascii(text).isascii()
    plain = text.encode("ascii", "ignore").decode()
    assert legible.in_ascii(plain) == plain


def test_every_letter_that_the_program_prints_has_a_spelling():
    """None of what stands in the sources or models' texts becomes an escape in a terminal of ASCII."""
    sources = (path.read_text("utf-8") for path in (ROOT / "src").rglob("*.py"))
    letters = {one for text in sources for one in text if not one.isascii()} - set("中")
    assert {"σ", "²", "─", "ᵀ", "₀"} <= letters
    assert {one for one in letters if "\\" in legible.in_ascii(one)} == set()


def test_only_the_value_of_a_long_message_is_cut():
    key, cure = "scenarios/x.yaml:7:13: arm.site: has no site", "; its sites: tip"
    line = legible.line(f'{key} "{"a" * 9000}"{cure}')
    assert line.startswith(f'{key} "aaa') and line.endswith(f'…{"a" * 38}" (9,000 characters){cure}')
    path = Path("/").joinpath(*["folder"] * 60)
    assert legible.line(f"{path}: no such file") == f"{path}: no such file"


def test_the_handler_of_streams_takes_what_no_encoding_has():
    stream = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", errors=legible.IN_ASCII)
    stream.write("\udc80σ")
    stream.flush()
    assert stream.buffer.getvalue() == "\\udc80σ".encode()
