"""Build the site of the documents into `docs/_site`, a folder for each version: the working tree and tags.

Prints each broken link of the built pages, and ends with 1 if there is one.
"""

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

ROOT = Path(__file__).resolve().parent.parent
SITE = ROOT / "docs/_site"
HERE = "main"  # the working tree
INDEX = """<!doctype html>
<html lang="en">
<meta charset="utf-8"><meta name="viewport" content="width=device-width">
<meta name="color-scheme" content="light dark">
<title>rmrc: versions of the documents</title>
<body style="font: 1.1rem/1.6 system-ui; max-width: 40rem; margin: 2rem auto; padding: 0 1rem">
<h1>rmrc</h1>
<p>The documents of each version:</p>
<ul>
{}
</ul>
"""


def sphinx(tree: Path, version: str, builder: str, out: Path, *options: str) -> None:
    """Run Sphinx over the documents of a checkout; warnings are errors."""
    doctrees = ROOT / "build/docs" / version
    command = [sys.executable, "-m", "sphinx", "--builder", builder, "--conf-dir", str(tree / "docs")]
    command += ["--fresh-env", "--fail-on-warning", "--quiet", *options, "--doctree-dir", str(doctrees)]
    command += [str(tree), str(out)]
    own = {"RMRC_SITE_VERSION": version, "PYTHONPATH": str(tree / "src")}  # which the notebooks import
    subprocess.run(command, check=True, env={**os.environ, **own})


def build(version: str) -> None:
    """Build one version: of the working tree, or of a tag in a checkout of its own."""
    if version == HERE:
        return sphinx(ROOT, version, "html", SITE / version)
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / version
        subprocess.run(["git", "worktree", "add", "--detach", "-q", str(tree), version], cwd=ROOT, check=True)
        try:
            sphinx(tree, version, "html", SITE / version)
        finally:
            subprocess.run(["git", "worktree", "remove", "--force", str(tree)], cwd=ROOT, check=True)


def write_versions() -> list[str]:
    """Write the list of all versions that are built, newest first, as a page and for the pages; return it."""

    def age(name: str) -> tuple[bool, list[int]]:
        return name == HERE, [int(part) for part in re.findall(r"\d+", name)]

    built = sorted((path.parent.name for path in SITE.glob("*/searchindex.js")), key=age, reverse=True)
    items = "\n".join(f'<li><a href="{one}/docs/index.html">{one}</a></li>' for one in built)
    (SITE / "index.html").write_text(INDEX.format(items), "utf-8")
    (SITE / "versions.js").write_text(f"const RMRC_VERSIONS = {json.dumps(built)};\n", "utf-8")
    return built


class Page(HTMLParser):
    """The links of a page, its loaded files, and the names of its places."""

    def __init__(self, text: str) -> None:
        """Read the text of a page."""
        super().__init__()
        self.links: list[str] = []
        self.loads: list[str] = []
        self.places: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note the places and links of one tag."""
        given = dict(attrs)
        self.places |= {value for key in ("id", "name") if (value := given.get(key))}
        to = given.get("href") if tag in ("a", "link") else given.get("src")
        if to is not None and given.get("rel") != "canonical":
            (self.links if tag == "a" else self.loads).append(to)


def broken(folder: Path) -> Iterator[str]:
    """Yield each link of a folder's pages that leads nowhere, and all that they load from elsewhere."""
    pages = {path: Page(path.read_text("utf-8")) for path in sorted(folder.rglob("*.html"))}
    for path, page in pages.items():
        for to in page.links + page.loads:
            parts = urlsplit(to)
            if parts.scheme or parts.netloc:
                if to in page.loads and parts.scheme != "data":
                    yield f"{path.relative_to(folder)}: loads {to}"
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            place = "" if "=" in parts.fragment else unquote(parts.fragment)  # no place: settings of a page
            if not target.is_file() or (place and target in pages and place not in pages[target].places):
                yield f"{path.relative_to(folder)}: {to} leads nowhere"


def external(found: list[dict[str, Any]]) -> tuple[list[str], int]:
    """Return a line for each external link that is not in order, with a count at the end, and the exit code.

    The code is 1 if a server says that a page is not there, and 2 if some servers gave no answer at all.

    Args:
        found: The records of Sphinx's linkcheck.
    """
    lines, count = [], Counter[str]()
    for uri, one in sorted({one["uri"]: one for one in found}.items()):
        if urlsplit(uri).scheme not in ("http", "https"):
            continue
        state = {"working": "fine", "redirected": "moved"}.get(one["status"], "no answer")
        if one["status"] == "broken" and re.search(r"(Client|Server) Error|Anchor", one["info"]):
            state = "broken"
        count[state] += 1
        if state != "fine":
            info = one["info"].partition(" (Caused by")[0]
            lines.append(f"{state}: {uri} in {one['filename']}: {info}")
    counts = ", ".join(f"{count[state]} {state}" for state in ("fine", "moved", "broken", "no answer"))
    return [*lines, f"external links: {counts}"], 1 if count["broken"] else 2 if count["no answer"] else 0


def check_external() -> int:
    """Ask the network for the external links, print those that fail, and return the exit code."""
    out = ROOT / "build/links"
    (out / "output.json").unlink(missing_ok=True)
    try:  # the notebooks need not run for their links
        sphinx(ROOT, HERE, "linkcheck", out, "-D", "nb_execution_mode=off", "-D", "linkcheck_timeout=10")
    except subprocess.CalledProcessError:
        if not (out / "output.json").exists():
            raise
    lines, code = external(
        [json.loads(line) for line in (out / "output.json").read_text("utf-8").splitlines()]
    )
    print(*lines, sep="\n")
    return code


def main(arguments: list[str] | None = None) -> int:
    """Build, or ask the network for the external links; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else None)
    parser.add_argument("versions", nargs="*", default=[HERE], help=f"tags, or {HERE}: the working tree")
    parser.add_argument(
        "--external", action="store_true", help="check external links instead, over the network"
    )
    asked = parser.parse_args(arguments)
    try:
        if asked.external:
            return check_external()
        SITE.mkdir(exist_ok=True)
        for version in asked.versions:
            build(version)
    except subprocess.CalledProcessError as error:
        print(f"{' '.join(map(str, error.cmd))}: exit code {error.returncode}", file=sys.stderr)
        return 1
    print(f"{SITE / 'index.html'}: {', '.join(write_versions())}")
    wrong = list(broken(SITE))
    print(*wrong, sep="\n", end="\n" * bool(wrong))
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
