"""Foreign texts as a terminal can show them."""

import io
import sys
import unicodedata
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
    assert (
        legible.in_ascii(text.encode("ascii", "ignore").decode()) == text.encode("ascii", "ignore").decode()
    )


def test_every_letter_that_the_program_prints_has_a_spelling():
    """None of what stands in the sources or models' texts becomes an escape in a terminal of ASCII."""
    letters = {
        one for path in (ROOT / "src").rglob("*.py") for one in path.read_text("utf-8") if not one.isascii()
    }
    letters -= set("中")
    assert {"σ", "²", "─", "ᵀ", "₀"} <= letters
    escaped = {one: legible.in_ascii(one) for one in letters if "\\" in legible.in_ascii(one)}
    assert escaped == {}


@given(st.text(st.sampled_from("ab \n"), max_size=30_000))
def test_a_line_is_one_and_not_too_long_and_ends_as_the_message_ends(text):
    shown = legible.line(text)
    assert "\n" not in shown
    # A word's length is told behind it, which is some twenty characters more.
    assert len(shown) < legible.LONGEST_LINE + 50
    end = legible.visible(text).rpartition(" ")[2]
    assert len(end) > legible.LONGEST_WORD or shown.endswith(end[-legible.LONGEST_LINE // 2 :])


def test_only_the_value_of_a_long_message_is_cut():
    key, cure = "scenarios/x.yaml:7:13: arm.site: has no site", "; its sites: tip"
    told = legible.line(f'{key} "{"a" * 9000}"{cure}')
    assert told.startswith(f'{key} "aaa') and told.endswith(
        f'…{"a" * 39}" (9,000 characters){cure}'.replace("a" * 39, "a" * 38)
    )


def test_a_path_of_a_usual_length_stays_whole():
    path = Path("/").joinpath(*["folder"] * 60)
    assert legible.line(f"{path}: no such file") == f"{path}: no such file"


def test_the_handler_of_streams_takes_what_no_encoding_has():
    stream = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", errors=legible.IN_ASCII)
    stream.write("\udc80σ")
    stream.flush()
    assert stream.buffer.getvalue() == "\\udc80σ".encode()


def test_unicode_names_greek_letters_as_the_spelling_expects():
    # `λ` alone is named otherwise than it is written.
    assert unicodedata.name("σ") == "GREEK SMALL LETTER SIGMA" and unicodedata.name("λ").endswith("LAMDA")
    assert sys.maxunicode == 0x10FFFF
