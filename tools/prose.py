"""Check the English of texts: documents, scenarios, help, messages, docstrings and comments.

proselint is the engine. It runs its own checks and the project's rules in `tools/prose.toml` on passages:
paragraphs of Markdown without code, those of notebooks, comments of scenarios, and docstrings, texts and
comments of Python files. Prints each finding, and exits with 1 if there is one. Files or folders as arguments
replace the paths of `tools/prose.toml`.
"""

import argparse
import ast
import io
import json
import re
import sys
import tokenize
import tomllib
from collections.abc import Iterable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import proselint.checks
from markdown_it import MarkdownIt
from proselint.registry import CheckRegistry
from proselint.registry.checks import Check, types
from proselint.registry.checks.engine import Fancy, RegexOptions
from proselint.tools import LintFile

ROOT = Path(__file__).resolve().parent.parent
RULES = ROOT / "tools/prose.toml"

# Stands for code and for values that are put into a text: a noun to every rule.
_CODE = "X"


class Passage(NamedTuple):
    """A text that somebody reads.

    Attributes:
        place: `markdown`, `scenario`, `text`, `docstring`, `private` (a docstring) or `comment`.
        line: Its first line in the file, from 1.
        text: Without markup and code.
    """

    place: str
    line: int
    text: str


def of_markdown(source: str) -> Iterator[Passage]:
    """Yield the paragraphs, headings and cells of Markdown."""
    line = 1
    for token in MarkdownIt("commonmark").enable("table").parse(source):
        line = token.map[0] + 1 if token.map else line
        if token.type == "inline":
            parts = (
                _CODE if one.type == "code_inline" else one.content or " " for one in token.children or ()
            )
            yield Passage("markdown", line, "".join(parts))


def of_notebook(source: str) -> Iterator[Passage]:
    """Yield the passages of a notebook's Markdown cells without equations, with their lines in the cell."""
    for cell in json.loads(source)["cells"]:
        if cell["cell_type"] == "markdown":
            text = "".join(cell["source"])
            yield from of_markdown(re.sub(r"(\$\$?)[^$]+\1", _CODE, text))


def of_comments(source: str) -> Iterator[Passage]:
    """Yield the comments of YAML, lines that follow each other as one."""
    block: list[str] = []
    for number, row in enumerate([*source.splitlines(), ""], 1):
        words = re.search(r"(?:^|\s)#\s?(.*)", row)
        if words:
            block.append(words[1])
        if block and not (words and row.startswith("#")):
            yield Passage("scenario", number - len(block) + bool(words), " ".join(block))
            block = []


def of_python(source: str) -> Iterator[Passage]:
    """Yield the docstrings, texts and comments of a Python file."""
    tree, docstrings = ast.parse(source), set()
    owners = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    for node in ast.walk(tree):
        if isinstance(node, owners) and ast.get_docstring(node):
            docstring: Any = node.body[0]
            docstrings.add(docstring.value)
            is_private = getattr(node, "name", "").startswith("_")
            text = re.sub(r"(?m)^ *>>>(.*\n?)*?(?= *\n|\Z)", "", ast.get_docstring(node) or "")
            text = re.sub(r"(?m)^( +)\w+:", rf"\1{_CODE}:", text)  # names of arguments and attributes
            yield Passage("private" if is_private else "docstring", docstring.lineno, _without_code(text))
    inner = {part for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in node.values}
    covered = docstrings | inner
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            words = "".join(
                str(part.value) if isinstance(part, ast.Constant) else _CODE for part in node.values
            )
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and node not in covered:
            words = node.value
        else:
            continue
        if len(re.findall(r"[A-Za-z]{2,}", words)) > 1:
            yield Passage("text", node.lineno, _without_code(words))
    yield from _comments(source)


def _comments(source: str) -> Iterator[Passage]:
    found = [
        one for one in tokenize.generate_tokens(io.StringIO(source).readline) if one.type == tokenize.COMMENT
    ]
    block: list[tokenize.TokenInfo] = []
    for one, after in pairwise([*found, None]):
        assert one is not None
        block.append(one)
        follows = (
            after and after.start == (one.start[0] + 1, one.start[1]) and after.line.strip().startswith("#")
        )
        if not follows:
            words = " ".join(re.sub(r"^#:? ?", "", each.string) for each in block)
            if not re.match(r"type:|noqa|fmt:|ruff:|mypy:", words):
                yield Passage("comment", block[0].start[0], _without_code(words))
            block = []


def _without_code(text: str) -> str:
    return re.sub(r"``?[^`]*``?", _CODE, text)


READERS = {".md": of_markdown, ".ipynb": of_notebook, ".py": of_python, ".yaml": of_comments}


class Finding(NamedTuple):
    """Words that a rule is about."""

    kind: str
    place: str
    line: int
    words: str
    advice: str

    @property
    def name(self) -> str:
        """Kind and place, as the bounds name them."""
        return f"{self.kind}.{self.place}"


def checks(rules: dict[str, Any]) -> list[Check]:
    """Return the checks of proselint that the project has switched on, and the project's own."""
    registry = CheckRegistry()
    if not registry.checks:
        registry.register_many(proselint.checks.__register__)
    without = rules["proselint"]["without"]
    theirs = [one for one in registry.checks if not any(one.matches_partial(path) for path in without)]
    ours = [
        Check(
            types.ExistenceSimple(pattern),
            Fancy(RegexOptions(multi_line=True)),
            kind,
            rule["advice"].replace("{", "{{").replace("}", "}}"),
        )
        for kind, rule in rules["rules"].items()
        for pattern in rule["patterns"]
    ]
    return theirs + ours


def findings(passages: Iterable[Passage], using: list[Check]) -> Iterator[Finding]:
    """Yield what the checks find in the passages of a file.

    A check reads all passages at once first, and each by itself only if it finds anything there.
    """
    shown = [(one, _content(one.text)) for one in passages]
    together = "\n\n".join(content for _, content in shown)
    using = [check for check in using if any(True for _ in check.check(together))]
    for passage, content in shown:
        for check in using:
            for found in check.check_with_flags(content):
                start, end = found.span
                line = passage.line + passage.text.count("\n", 0, max(start - 1, 0))
                words = " ".join(content[start:end].split())
                yield Finding(found.check_path.split(".")[0], passage.place, line, words, found.message)


def _content(text: str) -> str:
    # phrases go over the ends of lines
    return str(LintFile("passage", re.sub(r"(?<!\n)\n(?!\n)", " ", text)).content)


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("paths", nargs="*", type=Path, help="files or folders; default: those of prose.toml")
    asked = parser.parse_args()
    rules = tomllib.loads(RULES.read_text(encoding="utf-8"))
    using = checks(rules)
    roots = asked.paths or [ROOT / path for path in rules["paths"]]
    files = [file for root in roots for file in (sorted(root.rglob("*")) if root.is_dir() else [root])]
    found = [
        (file, one)
        for file in files
        if file.suffix in READERS and not file.is_relative_to(ROOT / rules["generated"])
        for one in findings(READERS[file.suffix](file.read_text(encoding="utf-8")), using)
    ]
    for file, one in found:
        print(f'{file}:{one.line}: {one.name}: "{one.words}": {one.advice}')
    sys.exit(1 if found else 0)


if __name__ == "__main__":
    main()
