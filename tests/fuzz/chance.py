"""Choices that are the same for the same class and index, on every machine and in every version of Python."""

import random

# Texts that some reader takes for a number, or nearly so.
NUMBERS = (
    "0", "-0.0", "1", "-1", "2", "0.5", "1e-320", "5e-324", "1e-300", "1e-12", "1e-6", "1000", "1e6", "1e9", "1e12",
    "1e100", "1e154", "1e200", "1e300", "1.7976931348623157e308", "1e309", "-1e9", "-1e300", "nan", "-nan", "inf",
    "-inf", ".nan", ".inf", "-.inf", "2147483648", "-2147483649", "9223372036854775808", "9" * 400, "0x1F", "1_000",
    "1e", "--1", "+", "1,5", "1d0", "1e+3", "010", "\u0663", "\u00bd", "1 deg", "1e999 deg", "90deg", "true", "null",
)  # fmt: skip

# Names that a terminal, a markup language, a file system or a parser may take for more than a name.
NAMES = (
    "", " ", "\x1b[31mred\x1b[0m", "\x1b]0;title\x07", "a\x07b", "a\nb", "a\rb", "a\tb", "\x9b31m", "\x85", "\x7f",
    "\u202eevil", "\u2028", "\ufeff", "[red]x[/red]", "[/]", "[link=x]y", "[[", "{0}", "{", "%s%n", "a.b", "peak",
    "..", "../../x", "/", "a/b", "a\\b", "'\"", "<&>", "e\u0301", "\U0001f600", "\ud55c\uad6d\uc5b4", "-x",
    "--help", "$HOME", "`id`", "*", "x" * 300, "home", "tip", "world", "0", "true", "~", "a,b", "a=b", "a:b", "#",
)  # fmt: skip


class Chance:
    """A sequence of choices that (class, index) decides."""

    def __init__(self, kind, index):
        # Of `random.Random` only `random()` is used, whose sequence Python promises to keep for a seed of text.
        self._next = random.Random(f"{kind}:{index}").random

    def unit(self):
        """Return a number in [0, 1)."""
        return self._next()

    def odds(self, share):
        """Return whether something of this probability happens."""
        return self._next() < share

    def under(self, count):
        """Return an integer in [0, count)."""
        return int(self._next() * count)

    def between(self, low, high):
        """Return an integer in [low, high]."""
        return low + self.under(high - low + 1)

    def pick(self, options):
        """Return one of the options, all alike."""
        return options[self.under(len(options))]

    def weighted(self, shares):
        """Return a key of a dict of weights."""
        at = self._next() * sum(shares.values())
        for key, share in shares.items():
            at -= share
            if at < 0.0:
                return key
        return key

    def decimal(self, least=-320, most=308, negative=0.0):
        """Return a number as text, its exponent evenly between two.

        Text, because powers of ten differ in their last bit from one C library to the next.
        """
        sign = "-" if self.odds(negative) else ""
        return f"{sign}{1 + self.under(9)}.{self.under(1000):03d}e{self.between(least, most):+d}"

    def number(self):
        """Return the text of a number, odd or not."""
        return self.pick(NUMBERS) if self.odds(0.7) else self.decimal(negative=0.3)

    def name(self):
        """Return a name."""
        return self.pick(NAMES)

    def word(self):
        """Return some text: a name, a number, or noise."""
        kind = self.under(4)
        if kind == 0:
            return self.number()
        if kind == 1:
            return "".join(chr(self.under(0x250)) for _ in range(self.under(12)))
        return self.name()

    def noise(self, most):
        """Return bytes."""
        return bytes(self.under(256) for _ in range(self.under(most) + 1))

    def scratch(self, data):
        """Return bytes with some of them changed, lost, repeated or moved: what no parser expects."""
        for _ in range(self.between(1, 3)):
            data = self._scratched(data)
        if self.odds(0.03):
            data = data.decode("latin-1").encode("utf-16" if self.odds(0.5) else "utf-32")
        return data

    def _scratched(self, data):
        at = self.under(len(data) + 1)
        end = at + self.under(20)
        before, inside, after = data[:at], data[at:end], data[end:]
        kind = self.under(8)
        if kind == 0:
            return before + bytes(byte ^ (1 << self.under(8)) for byte in inside[:1]) + data[at + 1 :]
        if kind == 1:
            return before + self.noise(4) + inside + after
        if kind == 2:
            return data[: self.under(len(data) + 1)]
        if kind == 3:
            return before + after[:40] + inside + after[40:]
        return (
            before
            + inside * self.pick((0, 0, 1, 2, 20))
            + (self.pick(ODD_BYTES) if kind < 6 else b"")
            + after
        )


ODD_BYTES = (
    b"\0", b"\xff\xfe", b"\xef\xbb\xbf", b"\xed\xa0\x80", b"\xc0\x80", b"\x1b[2J", b"\x9b", b"\r", b"\t", b"\x0c", b"\x7f",
    b"&#0;", b"&#27;", b"&#x9b;", b"&amp;lol;", b"<![CDATA[", b"-->", b"<!--", b"<?xml version='1.0'?>", b"<!DOCTYPE x>",
    b"\xe2\x80\xae", b"\xf0\x9f\x98\x80", b"nan", b"1e999", b"%s%n", b"[/]", b"{", b"}", b"[", b"]", b"'", b'"', b": ", b"- ",
    b"<", b">", b"/>", b"&", b"*a", b"!!python/object/apply:os.system [id]", b"---\n", b"...\n",
)  # fmt: skip
