"""Typeset the equations of the theory, which are plain text there: indented blocks become MathML.

The notation is that of the page: `x_i`, `x_i+1` and `x_{i+1}` have subscripts, `x²`, `xᵀ` and `x^{…}`
superscripts, `a/b` is a fraction of the terms beside the bar, `[a; b]` a column, `[[a, b], [c, d]]` a
matrix; words are words.
"""

import re
import unicodedata
from html import escape
from typing import NamedTuple

BLOCK = re.compile(r"(?<=\n\n)(?:    .*\n)+(?=\n|\Z)")
NUMBER = re.compile(r" +\((\d+)\)(?:  (\w.*))?$")
SOURCE = re.compile(r"(?: {2,}|^ +)((?:\[[A-Z][a-z]+\d\d[^\]]*\](?:, )?)+)$")
RAISED = dict(zip("⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁺ᵀ", "0123456789−+T", strict=True))
LOWERED = dict(zip("₀₁₂₃₄₅₆₇₈₉", "0123456789", strict=True))
ACCENTS = {"\u0307": "˙", "\u0308": "¨", "\u20db": "⃛", "\u0302": "^", "\u0304": "¯"}
FENCES = {"(": ")", "[": "]", "{": "}", "⌈": "⌉", "⌊": "⌋", "‖": "‖", "|": "|"}
SIGNS = {"-": "−", "<=": "≤", ">=": "≥", "..": "…", "Σ": "∑", "Π": "∏"}
FUNCTIONS = set(re.findall(r"\w+", "sin cos tan cot exp log det min max sign argmin clip skew Rot Trans"))
# Words of two letters; other pairs are products.
SHORT = set(re.findall(r"\w+", "kv kp rz rx ry Re Im at of so or is by in it no to up as do if be an on"))
WHOLE = ("pose_error", "error_gain")
FORMS = ("prefix", "postfix")
CORNERS = "".join([*RAISED, *LOWERED])
LETTER = rf"[^\W\d_{CORNERS}½ΣΠ][\u0300-\u036f\u20d0-\u20ff]*"
TOKEN = re.compile(
    rf"Δ(?=qdot)|{'|'.join(WHOLE)}|(?:qdot\d?|atan2)(?![a-z])|(?:{LETTER})+|\d+(?:\.\d+)?|`[^`]*`|[{''.join(RAISED)}]+|[{''.join(LOWERED)}]+|"
    r"\.\.|<=|>=|\s+|."
)
INDEX = re.compile(r"[+-]1(?!\d)|,(?=[a-z](?![a-z]))|_(?=\w)")


class Part(NamedTuple):
    """A part of a line: MathML of a kind."""

    kind: str  # word, name, group, sign, space or bar
    shown: str


def tag(name: str, *inner: str, **given: str) -> str:
    """Return an element."""
    attributes = "".join(f' {key}="{value}"' for key, value in given.items())
    return f"<{name}{attributes}>{''.join(inner)}</{name}>"


def letters(text: str) -> list[Part]:
    """Return letters that stand together: a function, a word, or a product of letters with their accents."""
    each = re.findall(LETTER, text)
    if text in WHOLE:
        return [Part("word", tag("mtext", text.replace("_", " ")))]
    if text.startswith("qdot"):
        return [
            Part(
                "name",
                tag("msub", letters("q̇")[0].shown, tag("mn", text[4:]))
                if text[4:]
                else letters("q̇")[0].shown,
            )
        ]
    if text in FUNCTIONS or text == "atan2":
        return [Part("name", tag("mi", text))]
    if len(each) > 2 or text in SHORT:
        return [Part("word", tag("mtext", escape(text)))]
    parts = []
    for one in each:
        base, *marks = unicodedata.normalize("NFD", one)
        shown = tag("mi", escape(base))
        for mark in marks:
            shown = tag("mover", shown, tag("mo", ACCENTS[mark]), accent="true")
        parts.append(Part("name", shown))
    return parts


class Line:
    """A line of an equation, read from left to right."""

    def __init__(self, text: str) -> None:
        """Split a text into its tokens."""
        self.tokens, self.at = TOKEN.findall(text), 0

    def next(self) -> str:
        """Return the token that is still to be read, or nothing."""
        return self.tokens[self.at] if self.at < len(self.tokens) else ""

    def take(self) -> str:
        """Return that token, and go on."""
        self.at += 1
        return str(self.tokens[self.at - 1])

    def parts(self, closing: str = "") -> list[Part]:
        """Return the parts up to a token that closes a group, which is left."""
        found: list[Part] = []
        while self.next() and self.next() != closing:
            token = self.take()
            if token.isspace():
                found.append(Part("space", ""))
            elif token == "/":
                found.append(Part("bar", tag("mo", "/")))
            elif token.startswith("`"):
                found.append(Part("word", tag("mtext", escape(token.strip("`")))))
            elif token in FENCES and (token not in "‖|" or token in self.tokens[self.at :]):
                found.append(self.with_corners(Part("group", self.group(token))))
            elif token in ("√", "∛"):
                (under,) = self.parts_of_one()
                name, *root = ("msqrt",) if token == "√" else ("mroot", tag("mn", "3"))
                found.append(Part("name", tag(name, bare(under), *root)))
            else:
                *before, last = self.simple(token)
                found += [*before, self.with_corners(last)]
        return found

    def parts_of_one(self) -> list[Part]:
        """Return the next token or group alone, with its corners."""
        token = self.take()
        return [
            self.with_corners(Part("group", self.group(token)) if token in FENCES else self.simple(token)[-1])
        ]

    def simple(self, token: str) -> list[Part]:
        """Return the parts of a token that is no group."""
        if re.match(LETTER, token):
            return letters(token)
        if token[0] in RAISED:  # it belongs to the letter behind it, a frame
            return [Part("name", tag("msup", tag("mi"), tag("mn", *(RAISED[one] for one in token))))]
        if token[0].isdecimal() or token == "½":
            return [Part("name", tag("mn", token))]
        return [Part("sign", tag("mo", escape(SIGNS.get(token, token))))]

    def group(self, opening: str) -> str:
        """Return the text between two fences: a matrix, a column, or anything."""
        start = self.at
        inner = self.parts(FENCES[opening])
        text = "".join(self.tokens[start : self.at])
        self.at += 1
        rows: list[list[str]] = []
        if opening == "[" and text.startswith("["):
            rows = [split(one, ",") for one in re.findall(r"\[([^\[\]]*)\]", text)]
        elif opening == "[" and ";" in text:
            rows = [[one] for one in split(text, ";")]
        cells = ([tag("mtd", typeset(cell)) for cell in one] for one in rows)
        shown = tag("mtable", *(tag("mtr", *one) for one in cells)) if rows else joined(inner)
        grows = str(bool(re.search("mfrac|mtable|munder|msqrt|mroot", shown))).lower()
        ends = (
            tag("mo", one, form=form, stretchy=grows)
            for one, form in zip((opening, FENCES[opening]), FORMS, strict=True)
        )
        return shown.join(ends).join(("<mrow>", "</mrow>"))

    def with_corners(self, part: Part) -> Part:
        """Return a part with the subscript and the superscript that follow it."""
        below, above = "", ""
        if self.next() == "_" and self.at + 1 < len(self.tokens):
            self.take()
            below = self.index()
        elif self.next()[:1] in LOWERED:
            below = tag("mn", *(LOWERED[one] for one in self.take()))
        if self.next()[:1] in RAISED:
            above = tag("mn", *(RAISED[one] for one in self.take()))
        elif self.next() == "^":
            self.take()
            above = self.index()
        elif self.next() in ("*", "'"):
            above = tag("mo", self.take().replace("'", "′"))
            if self.next() == "'":
                self.take()
                above = tag("mo", "″")
        if not below and not above:
            return part
        kind = "name" if part.kind == "sign" else part.kind
        name = {(True, False): "msub", (False, True): "msup", (True, True): "msubsup"}[
            bool(below), bool(above)
        ]
        if "∑" in part.shown or "⊕" in part.shown:
            name = name.replace("msub", "munder").replace("sup", "over")
        return Part(kind, tag(name, part.shown, *filter(None, (below, above))))

    def index(self) -> str:
        """Return the index after `_` or `^`."""
        if self.next() == "{":
            self.take()
            inner = joined(self.parts("}"))
            self.take()
            return inner
        sign = [Part("sign", tag("mo", "−"))] if self.next() in ("-", "−") and self.take() else []
        if self.next() == "(":
            self.take()
            inner = joined([*sign, *self.parts(")")])
            self.take()
            return inner
        found = [*sign, *self.simple(self.take())]
        while self.at < len(self.tokens):
            if self.next()[0] in LOWERED:
                found.append(Part("name", tag("mn", *(LOWERED[one] for one in self.take()))))
            elif INDEX.match("".join(self.tokens[self.at : self.at + 2])):
                found += [
                    Part("sign", tag("mo", SIGNS.get(self.next(), self.take()))),
                    *self.simple(self.take()),
                ]
            elif self.next().isdecimal() or (
                found[-1].shown.startswith("<mn") and re.match(LETTER, self.next())
            ):
                found += self.simple(self.take())
            else:
                break
        return joined(found)


def split(text: str, at: str) -> list[str]:
    """Return the pieces of a text between those separators that are in no bracket."""
    pieces, depth = [""], 0
    for one in text:
        depth += (one in "([") - (one in ")]")
        if one == at and not depth:
            pieces.append("")
        else:
            pieces[-1] += one
    return [piece.strip() for piece in pieces]


def bare(part: Part) -> str:
    """Return a group in parentheses without these, which a bar or a root stands for."""
    inside = re.fullmatch(r"<mrow><mo[^>]*>\((?:</mo>)(.*)<mo[^>]*>\)</mo></mrow>", part.shown)
    return inside[1] if inside and part.kind == "group" else part.shown


def joined(parts: list[Part]) -> str:
    """Return parts as one element, with fractions for bars, and the spaces that words need."""
    parts = list(parts)
    while (bar := next((i for i, one in enumerate(parts) if one.kind == "bar"), None)) is not None:
        first, last = bar - 1, bar + 1
        while first > 0 and parts[first].kind == "space":
            first -= 1
        while last + 1 < len(parts) and parts[last].kind == "space":
            last += 1
        above, below = parts[max(first, 0)], parts[min(last, len(parts) - 1)]
        if first < 0 or last >= len(parts) or "word" in (above.kind, below.kind) or above.kind == "sign":
            parts[bar] = Part("sign", tag("mo", "/"))
            continue
        over, under = bare(above), bare(below)
        if (
            above.kind == "group" and first and parts[first - 1].kind in ("name", "word")
        ):  # f(x), without a space
            first -= 1
            over = parts[first].shown + above.shown
        if last + 1 < len(parts) and parts[last + 1].kind == "group" and parts[last].kind in ("name", "word"):
            under = below.shown + parts[last + 1].shown
            last += 1
        parts[first : last + 1] = [Part("name", tag("mfrac", tag("mrow", over), tag("mrow", under)))]
    shown = []
    for i, one in enumerate(parts):
        around = {near.kind for near in (*parts[max(i - 1, 0) : i], *parts[i + 1 : i + 2])}
        shown.append(tag("mspace", width="0.35em") if one.kind == "space" and "word" in around else one.shown)
    return tag("mrow", *shown)


def typeset(text: str) -> str:
    """Return the MathML of a text, without `<math>`."""
    return joined(Line(text).parts())


def equation(line: str) -> str:
    """Return a line as a row of a table: what it is about, the equation, its source and its number."""
    line = line.rstrip()
    number = NUMBER.search(line)
    line = line[: number.start()] if number else line
    source = SOURCE.search(line)
    line = line[: source.start()] if source else line
    goes_on = line.startswith("     ")
    cells = re.split(r" {2,}", re.sub(r" +\+ +", " + ", line.strip())) if line.strip() else []
    side, at, rest = cells[0].partition(" = ") if cells else ("", "", "")
    if at and not goes_on and len(side) < 24 and "(" not in side[:1]:
        cells[:1] = [side, f"= {rest}"]
    elif len(cells) < 2 or goes_on:
        cells.insert(0, "")
    shown = [tag("math", typeset(one), displaystyle="true") if one else "" for one in cells or [""]]
    if re.fullmatch(r"[a-z]{3,}(_[a-z]{3,})*", cells[0]) and not cells[1].startswith("="):
        shown[0] = tag("code", cells[0])  # the name of a choice
    first, *others = shown
    label = f'<a id="eq-{number[1]}"></a>({number[1]})' if number else ""
    notes = " ".join(filter(None, (escape(source[1]) if source else "", label)))
    return tag("tr", tag("td", first), tag("td", "<span></span>".join(others)), tag("td", notes))


def typeset_page(text: str) -> str:
    """Return a page with its equations, the indented blocks, as MathML."""
    return BLOCK.sub(
        lambda block: (
            '<table class="equations">' + "".join(map(equation, block[0].splitlines())) + "</table>\n"
        ),
        text,
    )
