"""What each module may import, read from the sources: one owner a library, no circles, imports point down."""

import ast
import graphlib
import sys
from functools import cache

import pytest

from project import ROOT

# From the top down: a module imports what is below its own line, or its neighbors in the same package.
LAYERS = [
    rooms.split() for rooms in (
        "__main__", "cli", "tuning analysis", "study", "export", "recording", "show", "simulation", "logs",
        "plants results", "law", "arm", "scenario textbook", "support",
    )
]  # fmt: skip

# Who may import an outside library. A library that is missing here has no owner, and is refused.
OWNERS = {
    "numpy": ("rmrc",),
    "mujoco": ("rmrc.arm", "rmrc.plants", "rmrc.law.controller", "rmrc.simulation.world", "rmrc.recording"),
    "numba": ("rmrc.law.compiling", "rmrc.export.objects"),
    "llvmlite": ("rmrc.law.compiling", "rmrc.export.objects"),  # comes with numba
    "ruckig": ("rmrc.simulation.trajectory",),
    "yaml": ("rmrc.scenario",),
    "pydantic": ("rmrc.scenario", "rmrc.results.run"),
    "pydantic_core": ("rmrc.scenario",),  # comes with pydantic
    "rerun": ("rmrc.recording",),
    "pyarrow": ("rmrc.study.dataset", "rmrc.recording", "rmrc.logs.tables"),
    "matplotlib": (
        "rmrc.show.figures", "rmrc.show.figure", "rmrc.show.page", "rmrc.study.pictures", "rmrc.tuning.page",
        "rmrc.recording.film", "rmrc.analysis.identify_report", "rmrc.analysis.inspection_figure",
        "rmrc.analysis.workspace_report",
    ),
    "contourpy": ("rmrc.analysis.workspace",),  # comes with matplotlib
    "rich": ("rmrc.cli", "rmrc.show.tables"),
    "typer": ("rmrc.cli",),
    "distributed": ("rmrc.study.dask",),
    "PIL": ("rmrc.recording",),
    "imageio_ffmpeg": ("rmrc.recording.film",),
}  # fmt: skip

SLOW = {"rerun", "matplotlib", "dask", "distributed", "pyarrow", "imageio_ffmpeg"}
# Modules of ours that load these, or rich; only who shows something loads them.
PICTURES = (*OWNERS["matplotlib"], *OWNERS["rich"], *OWNERS["rerun"])
# A run whose columns alone are read, as for a picture, does without numba.
WITHOUT_NUMBA = {("rmrc.results.run", "rmrc.results.scorecard"), ("rmrc.law.task", "rmrc.law.kinematics")}


def read_sources():
    """Return the text of every module of rmrc by its dotted name."""
    sources = {}
    for path in (ROOT / "src/rmrc").rglob("*.py"):
        parts = path.relative_to(ROOT / "src").with_suffix("").parts
        sources[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path.read_text("utf-8")
    return sources


SOURCES = read_sources()
assert {"rmrc", "rmrc.cli", "rmrc.law.law", "rmrc.textbook.chains"} <= SOURCES.keys()  # else all rules hold


def is_within(module, *packages):
    return any(module == package or module.startswith(f"{package}.") for package in packages)


@cache
def imports(module, text, modules):
    """Return (imported module, whether inside a function) of a source; rmrc's own by their full names.

    A package's name stands for its __init__; `from package import x` for the module x if there is one.
    """
    is_package = any(is_within(other, module) and other != module for other in modules)
    package = (module if is_package else module.rpartition(".")[0]).split(".")
    imported, waiting = [], [(ast.parse(text), False)]
    while waiting:
        node, is_late = waiting.pop()
        is_late = is_late or isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        children = list(ast.iter_child_nodes(node))
        if module == "rmrc":  # its public names have homes above it: checkers are told where
            children = [child for child in children if not isinstance(child, ast.If)]
        waiting += [(child, is_late) for child in children]
        if isinstance(node, ast.Import):
            imported += [(alias.name, is_late) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            parents = package[: len(package) - node.level + 1] if node.level else []
            origin = ".".join([*parents, *([node.module] if node.module else [])])
            members = [f"{origin}.{alias.name}" for alias in node.names]
            imported += [(member if member in modules else origin, is_late) for member in members]
    return imported


def all_imports(sources):
    """Yield (module, imported module, whether inside a function) of all sources."""
    for module, text in sources.items():
        for name, late in imports(module, text, frozenset(sources)):
            yield module, name, late


def room(module):
    return ".".join(module.split(".")[1:2])


def layer(module):
    """Return how far down a module is; `rmrc` itself is the last, and -1 is one that no layer has."""
    depths = [depth for depth, rooms in enumerate(LAYERS) if room(module) in rooms]
    return depths[0] if depths else len(LAYERS) if module == "rmrc" else -1


def is_outside(name):
    return name.partition(".")[0] not in {*sys.stdlib_module_names, "rmrc"}


# The rules: each takes sources by module name, and yields what is wrong -------------------------


def one_owner_a_library(sources):
    for module, name, _ in all_imports(sources):
        if is_outside(name) and not is_within(module, *OWNERS.get(name.partition(".")[0], ())):
            yield f"{module} imports {name}, which is not its own"


def every_module_has_a_layer(sources):
    yield from (f"{module} is in no layer; give it one in LAYERS" for module in sources if layer(module) < 0)


def imports_point_down(sources):
    for module, name, _ in all_imports(sources):
        if is_within(name, "rmrc") and room(name) != room(module) and layer(name) <= layer(module):
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


def only_what_is_slow_is_imported_late(sources):
    for module, name, late in all_imports(sources):
        # The verbs of the command line load what they need; nobody else waits for the pictures.
        is_verb = is_within(module, "rmrc.cli") and is_within(name, "rmrc")
        is_slow = is_within(name, *PICTURES) or name.partition(".")[0] in SLOW
        if late and not is_verb and not is_slow and (module, name) not in WITHOUT_NUMBA:
            yield f"{module} imports {name} inside a function"


def the_textbook_stands_alone(sources):
    """The second opinion must not ask the first: of rmrc it knows errors and rotations, else numpy."""
    known = ("rmrc.textbook", "rmrc.support.errors", "rmrc.support.spatial", "numpy")
    for module, name, _ in all_imports(sources):
        is_foreign = is_outside(name) or is_within(name, "rmrc")
        if is_within(module, "rmrc.textbook") and is_foreign and not is_within(name, *known):
            yield f"{module} imports {name}"


# Each rule with a fault that breaks it.
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


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
def test_sources_keep_the_rule_and_a_planted_fault_breaks_it(rule):
    assert list(rule(SOURCES)) == []
    module, text = RULES[rule]
    assert list(rule({**SOURCES, module: f"{SOURCES.get(module, '')}\n{text}\n"})) != []
