"""The size of the project stays at or below these ceilings, which are lowered as the code shrinks."""

import ast
import io
import tokenize

from project import ROOT

SOURCE_LINES = 22_910
SOURCE_MODULES = 182
TEST_LINES = 20_000

# Tokens that make no line a line of code.
LAYOUT = {
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENDMARKER,
}
DOCUMENTED = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef


def code_lines(text):
    """Return the number of lines of a source that are no docstring, no comment and not blank."""
    lines = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in LAYOUT:
            lines.update(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, DOCUMENTED) and ast.get_docstring(node) is not None:
            docstring = node.body[0]
            lines.difference_update(range(docstring.lineno, docstring.end_lineno + 1))
    return len(lines)


def code_lines_of(folder):
    return sum(code_lines(path.read_text("utf-8")) for path in (ROOT / folder).rglob("*.py"))


def test_only_code_is_counted():
    source = (
        '"""Module."""\n\n# comment\ndef f(x):\n    """Return\n    x."""\n    return (\n        x\n    )\n'
    )
    assert code_lines(source) == 4


def test_the_size_is_below_its_ceilings():
    assert code_lines_of("src/rmrc") <= SOURCE_LINES
    assert len(list((ROOT / "src/rmrc").rglob("*.py"))) <= SOURCE_MODULES
    assert code_lines_of("tests") <= TEST_LINES
