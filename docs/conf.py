"""How Sphinx builds the site: `make docs`.

The source folder is the whole repository, so that links between pages are those that work on GitHub, too.
"""

import os
import re
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT / "src"), str(ROOT / "docs/_ext")]  # of this checkout, not an installed copy

import findable  # noqa: E402

project = "rmrc"
author = "the authors of rmrc"
release = os.environ.get("RMRC_SITE_VERSION", "main")  # tools/site.py sets it
html_title = f"rmrc {release}"

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
include_patterns = [
    "docs/**",
    "notebooks/*.ipynb",
    "notebooks/README.md",
    "benchmarks/README.md",
    "models/README.md",
    "recordings/README.md",
    "scenarios/README.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
]
exclude_patterns = ["docs/_*", ".*", "build", "node_modules", "src", "tests", "**.ipynb_checkpoints"]
root_doc = "docs/index"
source_suffix = {".md": "myst-nb", ".ipynb": "myst-nb"}

myst_enable_extensions = ["dollarmath", "html_image"]
myst_fence_as_directive = ["math"]
html_math_renderer = "mathml"
myst_heading_anchors = 4
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_merge_streams = True

# Docstrings are plain text: `x` is code, |x| a length. Types in them are linked where they have an entry.
default_role = "code"
autodoc_typehints = "description"
autodoc_member_order = "bysource"
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True

# What people search for, and the page that comes first then, besides those whose words it is.
SEARCHED = {
    "docs/choices": ("DLS", "damped least squares", "pseudo-inverse", "pseudoinverse"),
    "docs/franka": ("Franka",),
    "docs/from_simulation_to_your_robot": ("ROS", "ROS 2"),
    "docs/my_robot": ("URDF", "MJCF"),
    "docs/profiles": ("UR", "Universal Robots"),
    "docs/python": ("MoveIt Servo", "servoing"),
    "docs/tune": ("choose lambda", "lambda", "damping factor"),
    "docs/which_method": ("singularity avoidance", "avoid singularities"),
}

ENTRY = re.compile(r"^- \[(.+?)\]\((\S+?)\.(?:md|ipynb)\)", re.MULTILINE)

# Links such as explore.md?NAME#settings: in the site to that page, on GitHub to explore.md.
IN_BROWSER = re.compile(r"\[([^\]]+)\]\(explore\.md\?([\w-]+)(#\S+)?\)")
EXPLORED: set[str] = set()


def add_contents(_: object, page: str, source: list[str]) -> None:
    """Make the tables of contents from the lists of the first page, which GitHub shows as they are."""
    if page == root_doc:
        for part in re.split(r"^## ", source[0], flags=re.MULTILINE)[1:]:
            entries = "\n".join(f"{title} <{target}>" for title, target in ENTRY.findall(part))
            caption = part.partition("\n")[0]
            source[0] += f"\n```{{toctree}}\n:hidden:\n:caption: {caption}\n\n{entries}\n```\n"


def add_words(_: object, page: str, source: list[str]) -> None:
    """Add what people search for to the index of a page, and the textbook to the Python API."""
    title, _, text = source[0].partition("\n")
    words = "".join(f"   ! {word}\n" for word in SEARCHED.get(page, ()))
    if words:
        source[0] = f"{title}\n\n```{{eval-rst}}\n.. index::\n{words}```\n{text}"
    if page == "docs/api":
        modules = sorted(path.stem for path in (ROOT / "src/rmrc/textbook").glob("[a-z]*.py"))
        listed = "".join(f".. automodule:: rmrc.textbook.{module}\n   :members:\n" for module in modules)
        source[0] += f"\n```{{eval-rst}}\n{listed}```\n"


def link_explored(_: object, _page: str, source: list[str]) -> None:
    """Link pages of `rmrc explore`, and note which."""

    def link(found: re.Match[str]) -> str:
        text, name, settings = found.groups("")
        EXPLORED.add(name)
        return f'<a href="../explore/{name}.html{settings}">{text}</a>'

    source[0] = IN_BROWSER.sub(link, source[0])


def write_explored(app: Any, error: Exception | None) -> None:
    """Write the pages of `rmrc explore` that are linked: of lessons, and of shipped scenarios."""
    from rmrc.export.page import read_lesson, write
    from rmrc.scenario import load
    from rmrc.scenario.draft import LESSONS

    if error or app.builder.name != "html":
        return
    folder = Path(app.outdir) / "explore"
    folder.mkdir(exist_ok=True)
    for name in sorted(EXPLORED):
        lesson = read_lesson(name) if name in LESSONS else None
        write(folder / f"{name}.html", load(lesson.scenario if lesson else name), lesson)


def write_math(writer: Any, node: Any) -> None:
    """Write an equation, which is TeX, as MathML."""
    from docutils.nodes import SkipNode
    from latex2mathml.converter import convert

    tex = node.astext().replace(r"\tag", r"\qquad\tag")  # MathML has no place of its own for numbers
    writer.body.append(convert(tex, display="block" if node.tagname == "math_block" else "inline"))
    raise SkipNode


def as_markup(*told: Any) -> None:
    """Turn lengths |x| and, of modules, indented code into what reStructuredText takes for the same."""
    what, lines = told[1], told[-1]
    for i, line in enumerate(lines):
        if not line.lstrip().startswith(">>>"):
            lines[i] = line.replace("|", "\\|")
        if (
            what == "module"
            and line.endswith(":")
            and lines[i + 2 : i + 3]
            and lines[i + 2].startswith("    ")
        ):
            lines[i] += ":"


def setup(app: Any) -> None:
    """Called by Sphinx."""
    app.add_html_math_renderer("mathml", (write_math, None), (write_math, None))
    app.connect("autodoc-process-docstring", as_markup, priority=400)  # before napoleon
    app.connect("source-read", add_contents)
    app.connect("source-read", add_words)
    app.connect("source-read", link_explored)
    app.connect("build-finished", write_explored)
    findable.setup(app)


highlight_language = "none"  # blocks without a language are printed lines

html_theme = "furo"
templates_path = ["_templates"]
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_js_files = ["../../versions.js", "site.js"]
html_search_scorer = str(ROOT / "docs/_static/scorer.js")
html_show_sphinx = False
html_copy_source = False
html_additional_pages = {"index": "redirect.html"}
html_sidebars = {
    "**": [
        "sidebar/brand.html",
        "sidebar/search.html",
        "sidebar/scroll-start.html",
        "sidebar/navigation.html",
        "versions.html",
        "sidebar/scroll-end.html",
    ]
}
