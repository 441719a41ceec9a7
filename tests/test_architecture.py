"""What each module may import, read from the sources: one owner a library, no circles, imports point down."""

import ast
import graphlib
import re
import sys
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
SOURCE = ROOT / "src"

# From the top down: a module imports what is below its own line, or its neighbors in the same package.
LAYERS = (
    ("rmrc.__main__",),
    ("rmrc.cli",),
    ("rmrc.tuning", "rmrc.analysis"),
    ("rmrc.study",),
    ("rmrc.film",),
    ("rmrc.export",),
    ("rmrc.recording",),
    ("rmrc.show",),
    ("rmrc.simulation",),
    ("rmrc.logs",),
    ("rmrc.plants", "rmrc.results"),
    ("rmrc.law",),
    ("rmrc.arm",),
    ("rmrc.scenario", "rmrc.textbook"),
    ("rmrc.support",),
    ("rmrc",),
)

# Who may import an outside library. A library that is missing here has no owner, and is refused.
OWNERS = {
    "numpy": ("rmrc",),
    "mujoco": (
        "rmrc.arm",
        "rmrc.plants",
        "rmrc.law.controller",
        "rmrc.simulation.world",
        "rmrc.film",
    ),
    "numba": ("rmrc.law.compiling", "rmrc.export.objects"),
    "llvmlite": ("rmrc.law.compiling", "rmrc.export.objects"),  # comes with numba
    "ruckig": ("rmrc.simulation.trajectory",),
    "yaml": ("rmrc.scenario",),
    "pydantic": ("rmrc.scenario", "rmrc.results.run"),
    "pydantic_core": ("rmrc.scenario",),  # comes with pydantic
    "rerun": ("rmrc.recording",),
    "pyarrow": ("rmrc.study.dataset", "rmrc.recording", "rmrc.logs.tables"),
    "matplotlib": (
        *(
            "rmrc.show.figures",
            "rmrc.show.figure",
            "rmrc.show.page",
            "rmrc.study.pictures",
            "rmrc.tuning.page",
            "rmrc.film.film",
        ),
        *(
            "rmrc.analysis.identify.report",
            "rmrc.analysis.inspect.figure",
            "rmrc.analysis.workspace.report",
        ),
    ),
    "contourpy": ("rmrc.analysis.workspace.workspace",),  # comes with matplotlib
    "rich": (
        "rmrc.cli",
        "rmrc.show.tables",
        "rmrc.show.terminal",
    ),
    "typer": ("rmrc.cli",),
    "distributed": ("rmrc.study.dask",),
    "pandas": ("rmrc.results.notebook",),
    "PIL": ("rmrc.film",),
    "imageio_ffmpeg": ("rmrc.film.encode",),
}

SLOW = {"rerun", "matplotlib", "dask", "distributed", "pyarrow", "imageio_ffmpeg", "pandas"}

# Modules of ours that load these, or rich; only who shows something loads them.
PICTURES = ("rmrc.film", *OWNERS["matplotlib"]) + OWNERS["rich"] + OWNERS["rerun"]


def read_sources():
    """Return the text of every module of rmrc by its dotted name."""
    sources = {}
    for path in (SOURCE / "rmrc").rglob("*.py"):
        parts = path.relative_to(SOURCE).with_suffix("").parts
        sources[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path.read_text("utf-8")
    return sources


SOURCES = read_sources()


def is_within(module, package):
    return module == package or module.startswith(f"{package}.")


parsed = cache(ast.parse)


@cache
def imports(module, text, modules):
    """Return (imported module, whether inside a function) of a source; rmrc's own by their full names.

    A package's name stands for its __init__; `from package import x` for the module x if there is one.
    """
    is_package = any(is_within(other, module) and other != module for other in modules)
    package = module if is_package else module.rpartition(".")[0]
    found = []
    waiting = [(parsed(text), False)]
    while waiting:
        node, is_late = waiting.pop()
        is_late = is_late or isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
        waiting += [
            (child, is_late)
            for child in ast.iter_child_nodes(node)
            if isinstance(child, ast.stmt | ast.match_case | ast.excepthandler)
            # the public names of `rmrc` have homes above it: checkers are told where, and tests hold that
            and not (module == "rmrc" and is_for_checkers(child))
        ]
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            parents = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            origin = ".".join([*parents, *([node.module] if node.module else [])])
            members = [f"{origin}.{alias.name}" for alias in node.names]
            names = [member if member in modules else origin for member in members]
        found += [(name, is_late) for name in names]
    return found


def is_for_checkers(node):
    return isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"


def all_imports(sources):
    """Yield (module, imported module, whether inside a function) of all sources."""
    modules = frozenset(sources)
    for module, text in sources.items():
        for name, late in imports(module, text, modules):
            yield module, name, late


def layer(module):
    """Return how far down a module is, -1 for one that no layer has."""
    for depth, names in enumerate(LAYERS):
        if any(module == name or (name != "rmrc" and is_within(module, name)) for name in names):
            return depth
    return -1


def package_of(module):
    """Return the part of rmrc that a module belongs to: rmrc.law for rmrc.law.law."""
    return ".".join(module.split(".")[:2])


# The rules: each takes sources by module name, and yields what is wrong -------------------------


def one_owner_a_library(sources):
    for module, name, _ in all_imports(sources):
        library = name.partition(".")[0]
        if library in sys.stdlib_module_names or library == "rmrc":
            continue
        if not any(is_within(module, owner) for owner in OWNERS.get(library, ())):
            yield f"{module} imports {library}, which is not its own"


def every_module_has_a_layer(sources):
    for module in sources:
        if layer(module) < 0:
            yield f"{module} is in no layer; give it one in LAYERS"


def imports_point_down(sources):
    for module, name, _ in all_imports(sources):
        if not is_within(name, "rmrc") or package_of(name) == package_of(module):
            continue
        if layer(name) <= layer(module):
            yield f"{module} imports {name}, which is not below it"


def no_circles(sources):
    graph = {module: set() for module in sources}
    for module, name, _ in all_imports(sources):
        if name in sources:
            graph[module].add(name)
    try:
        graphlib.TopologicalSorter(graph).prepare()
    except graphlib.CycleError as error:
        yield "circle: " + " -> ".join(error.args[1])


# A run whose columns alone are read, as for a picture, does without numba.
WITHOUT_NUMBA = {("rmrc.results.run", "rmrc.results.scorecard"), ("rmrc.law.task", "rmrc.law.kinematics")}


def only_what_is_slow_is_imported_late(sources):
    for module, name, late in all_imports(sources):
        # The verbs of the command line load what they need; nobody else waits for the pictures.
        is_verb = is_within(module, "rmrc.cli") and is_within(name, "rmrc")
        if (
            late
            and (module, name) not in WITHOUT_NUMBA
            and not (
                is_verb or any(is_within(name, one) for one in PICTURES) or name.partition(".")[0] in SLOW
            )
        ):
            yield f"{module} imports {name} inside a function"


def the_textbook_stands_alone(sources):
    """The second opinion must not ask the first: of rmrc it knows errors and rotations, else numpy."""
    allowed = ("rmrc.textbook", "rmrc.support.errors", "rmrc.support.spatial", "numpy")
    for module, name, _ in all_imports(sources):
        is_ours = is_within(module, "rmrc.textbook")
        is_known = name.partition(".")[0] in sys.stdlib_module_names or any(
            is_within(name, one) for one in allowed
        )
        if is_ours and not is_known:
            yield f"{module} imports {name}"


RULES = {
    one_owner_a_library: ("rmrc.cli", "def run():\n    import mujoco"),
    every_module_has_a_layer: ("rmrc.somewhere", ""),
    imports_point_down: ("rmrc.law.law", "from ..simulation import prepare"),
    no_circles: ("rmrc.law.svd", "from .inverses import gains"),
    only_what_is_slow_is_imported_late: (
        "rmrc.results.run",
        "class A:\n    def f(self):\n        import json",
    ),
    the_textbook_stands_alone: ("rmrc.textbook.planar", "from rmrc.arm import Arm"),
}


@cache
def found(rule):
    """Return what of the sources breaks a rule."""
    return list(rule(SOURCES))


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
def test_sources_keep_the_rule(rule):
    assert found(rule) == []


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
def test_a_planted_fault_breaks_the_rule(rule):
    module, text = RULES[rule]
    planted = {**SOURCES, module: f"{SOURCES.get(module, '')}\n{text}\n"}
    assert set(rule(planted)) > {*found(rule)}


def test_the_sources_are_there():
    # All rules above hold for an empty folder as well.
    assert {"rmrc", "rmrc.cli", "rmrc.law.law", "rmrc.plants.plant", "rmrc.textbook.dh"} <= set(SOURCES)


# Of any text: a path that exists on one machine only ---------------------------------------------

TEXTS = {".py", ".md", ".toml", ".yaml", ".yml", ".xml", ".sh", ""}
HERE_ONLY = re.compile(r"(?<![\w.:/~}])/(?:tmp|home|root|work|mnt|Users|workspace)(?:/|\b)")


def texts():
    """Return every text file of the project, generated folders left out."""
    folders = ("src", "tests", "tools", "models", "scenarios", "docs", "benchmarks", ".ci")
    files = [path for path in ROOT.iterdir() if path.is_file()] + [ROOT / "recordings/README.md"]
    files += [path for folder in folders for path in (ROOT / folder).rglob("*") if path.is_file()]
    hidden = {p for p in files if "__pycache__" in p.parts or any(".egg-info" in part for part in p.parts)}
    caches = {p for p in files if any(part.endswith("_cache") for part in p.parts)}
    return sorted(p for p in set(files) - hidden - caches if p.suffix in TEXTS and p.name != ".git")


def machine_paths(text):
    return [line for line in text.splitlines() if HERE_ONLY.search(line)] if HERE_ONLY.search(text) else []


def test_no_file_names_a_folder_of_one_machine():
    paths = texts()
    assert {ROOT / "README.md", ROOT / ".ci/run", Path(__file__)} <= set(paths)  # the search finds files
    found = {str(path.relative_to(ROOT)): machine_paths(path.read_text("utf-8")) for path in paths}
    assert {name: lines for name, lines in found.items() if lines} == {}


@pytest.mark.parametrize("folder", ["tmp", "home", "root", "work", "Users"])
def test_a_folder_of_one_machine_is_seen(folder):
    assert machine_paths(f'see "/{folder}/somebody/notes.md"') != []
    assert machine_paths(f"cd /{folder}") != []
    assert machine_paths(f"rad/{folder} or docs/{folder}/x") == []
