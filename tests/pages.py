"""The documents by their titles in the contents, `docs/index.md`, wherever they lie."""

import re

from project import ROOT

CONTENTS = ROOT / "docs/index.md"
PAGES = {
    title: (CONTENTS.parent / target).resolve()
    for title, target in re.findall(r"^- \[(.+?)\]\((\S+?)\)", CONTENTS.read_text("utf-8"), re.MULTILINE)
}


def page(title):
    """Return the text of a page."""
    return PAGES[title].read_text("utf-8")


def blocks(text):
    """Return the language and the text of each fenced block."""
    return re.findall(r"^```(\w*)\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
