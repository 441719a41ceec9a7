"""Texts from elsewhere in a form for terminals: no control characters, not too long, in any encoding.

A file, a model, MuJoCo or an option may hold anything. Characters that would move the cursor, reverse the
direction of writing or show nothing are written as escapes.
"""

import codecs
import re
import unicodedata
from collections.abc import Iterable

# Characters of a value in a message: two of them and the words between them fill two lines of a terminal.
LONGEST = 80

# Characters of a message, and of one word in it, which may be a path: longer ones are cut in the middle.
LONGEST_LINE, LONGEST_WORD = 2000, 500

# The name of the error handler for streams, see `codecs.register_error`.
IN_ASCII = "rmrc.in_ascii"


def visible(text: str, keep: str = "") -> str:
    r"""Return a text with each character that cannot be printed as its escape.

    Args:
        text: Any text.
        keep: Characters that stay as they are, such as a line feed.

    >>> print(visible("red\x1b[31m, é and σ"))
    red\x1b[31m, é and σ
    """
    if text.isprintable():
        return text
    return "".join(one if one.isprintable() or one in keep else _escape(one) for one in text)


def shortened(text: str, most: int = LONGEST) -> str:
    """Return a text of about this many characters: without its middle, and with its length.

    Args:
        text: A text that may be too long; quotes around it stay.
        most: A text of up to this many characters stays as it is.

    >>> shortened('"' + "a" * 10_000 + '"', 10)
    '"aaa…aaa" (10,000 characters)'
    """
    if len(text) <= most:
        return text
    half = (most - 1) // 2
    is_quoted = text[0] == text[-1] and text[0] in "\"'"
    return f"{text[:half]}…{text[-half:]} ({len(text) - 2 * is_quoted:,} characters)"


def line(text: str) -> str:
    """Return a message as one printable line: its long words cut in their middle, then the message itself.

    A message begins with the problem and ends with the remedy, so both stay.
    """
    text = visible(text)
    if len(text) <= LONGEST_WORD:
        return text
    long = rf'"[^"\s]{{{LONGEST_WORD},}}"|[^"\s]{{{LONGEST_WORD},}}(?<![:;,.])'
    text = re.sub(long, lambda match: shortened(match[0]), text)
    if len(text) <= LONGEST_LINE:
        return text
    return f"{text[: LONGEST_LINE // 2]} … {text[-LONGEST_LINE // 2 :]}"


def quoted(text: str) -> str:
    """Return an option's value as Python writes a text, its middle left out if it is long.

    >>> print(quoted("1,2"))
    '1,2'
    """
    return shortened(repr(text))


def listed(names: Iterable[str], most: int = 20) -> str:
    """Return names with commas between them, only the first ones if there are many.

    >>> listed(["a", "b", "c", "d"], 2)
    'a, b and 2 more'
    """
    names = [shortened(visible(name)) for name in names]
    if len(names) <= most:
        return ", ".join(names)
    return f"{', '.join(names[:most])} and {len(names) - most:,} more"


def escaped(text: str) -> str:
    """Return one line that Markdown shows unchanged."""
    return re.sub(r"([\\|*`<\[\]])", r"\\\1", " ".join(text.split()))


def in_ascii(text: str) -> str:
    """Return a text in legible ASCII: `sigma` for σ, `^2` for ², `-` for a rule of a table.

    >>> in_ascii("κ = σ₁/σ_min, rad/s²")
    'kappa = sigma_1/sigma_min, rad/s^2'
    """
    spelled = "".join(one if one.isascii() else _spelled(one) for one in text)
    return re.sub(r"(?<=\^-)\^", "", spelled)  # of 1/s as s^-1


def _escape(character: str) -> str:
    return character.encode("unicode_escape").decode("ascii")


def _spelled(character: str) -> str:
    if character in _SPELLED:
        return _SPELLED[character]
    if unicodedata.combining(character):  # an accent on the letter before
        return ""
    name = unicodedata.name(character, "")
    if "BOX DRAWINGS" in name:
        return "-" if "HORIZONTAL" in name and "VERTICAL" not in name else "|"
    if match := re.fullmatch(r"GREEK (SMALL|CAPITAL) LETTER ([A-Z]+)", name):
        return match[2].lower() if match[1] == "SMALL" else match[2].capitalize()
    plain = unicodedata.normalize("NFKD", character)
    if match := re.match(r"<(super|sub)>", unicodedata.decomposition(character)):
        plain = f"{'^' if match[1] == 'super' else '_'}{plain}"
    plain = "".join(_SPELLED.get(one, one) for one in plain if not unicodedata.combining(one))
    return plain if plain.isascii() and plain else _escape(character)


_SPELLED = {
    "·": "*", "×": "x", "−": "-", "–": "-", "—": "-", "…": "...", "±": "+/-", "°": "deg", "→": "->",
    "←": "<-", "↑": "^", "↓": "v", "✅": "[ok]", "❌": "[failed]",
    "⁺": "^+", "≥": ">=", "≤": "<=", "≈": "~", "≠": "!=", "∞": "inf", "•": "*",
    "“": '"', "”": '"', "‘": "'", "’": "'",
    "λ": "lambda", "Λ": "Lambda", "━": "-", "╸": "-", "╺": "-",
    "∥": "||", "√": "sqrt", "∑": "sum", "Σ": "Sum", "½": "1/2", "⁄": "/", "§": "section ",
    "‖": "||", "∛": "cbrt", "∂": "d", "∇": "grad ", "⊗": "(x)", "⊕": "(+)", "∏": "prod", "∫": "integral ",
    "µ": "u", "⌊": "floor(", "⌋": ")", "ᶦ": "^I",
}  # fmt: skip


def _encode(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return in_ascii(error.object[error.start : error.end]), error.end


codecs.register_error(IN_ASCII, _encode)
