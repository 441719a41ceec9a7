"""Typesets the equations of the notebooks as MathML, which browsers show without a script or the network."""

from typing import Any, NoReturn

from docutils import nodes
from latex2mathml.converter import convert


def inline(writer: Any, node: nodes.Element) -> NoReturn:
    """Write an equation within a line."""
    writer.body.append(convert(node.astext()))
    raise nodes.SkipNode


def alone(writer: Any, node: nodes.Element) -> NoReturn:
    """Write an equation on lines of its own, which a narrow page scrolls."""
    writer.body.append(f'<div class="equation">{convert(node.astext(), display="block")}</div>')
    raise nodes.SkipNode


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx."""
    app.add_html_math_renderer("mathml", (inline, None), (alone, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
