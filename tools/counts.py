"""Measure the structure of `src/rmrc`, and fail if it exceeds its bounds.

Prints a table, one row per count with its bound, then details of the counts. Ends with 1 if a bound is
exceeded, so that it can be a step of CI. The counts are:

- Code lines: physical lines with a token that is no comment, line end, indentation or docstring. The
  lines of a long string that is no docstring count, but blank ones in it do not.
- Packages and modules directly in `src/rmrc`, without `__init__` and `__main__`.
- Circles of imports between modules: groups of modules that import each other, each group once. Imports
  within functions count, as they hide a circle and do not resolve it. Those under `if TYPE_CHECKING:` do not
  count, as they never run; the table gives their number.
- Circles of imports between the packages and modules directly in `src/rmrc`: without any, imports
  point one way, and the order is printed from the top down. Here all imports count, including those under
  `if TYPE_CHECKING:`: a module that names a type of another package knows that package. No mark exempts an
  import. `__init__` and `__main__` of `src/rmrc` itself have no place in the order: they are the interface
  of the whole.
- The longest function outside compiled code, from `def` to its last line without the lines of its docstring;
  comments, blank lines and inner functions count.
- The walk from `--vary` to a row: the number of modules that a reader who follows a value from the command
  line to its row must read, listed in WALK. Upward steps of this walk are not counted: calls of something
  above the caller need an import that points up, or a function that is handed down. The row of circles
  between packages bounds the first; the sources do not show the second.

A package's `__init__`, which runs when one of its modules is imported, does not count as an import. The same
holds for `import_module` with a name that is only known at run time, as in `rmrc/__init__.py`.
"""

import argparse
import ast
import io
import signal
import sys
import tokenize
from collections import Counter, deque
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from graphlib import TopologicalSorter
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple, TypeAlias

SOURCE = Path(__file__).resolve().parent.parent / "src" / "rmrc"

MOST_LINES = 39_670
MOST_PACKAGES = 18
MOST_CIRCLES = 0
LONGEST_FUNCTION = 60

# Decorators that compile: those of rmrc.law.jit, and numba's own.
COMPILING = {"compiled", "inlined", "entry", "njit", "jit", "cfunc", "vectorize", "guvectorize"}

# Modules, without `rmrc.`, that handle a value on its way from `rmrc sweep --vary control.feedback=5,10` to a
# row, in the order of their first call; without compiled code, and without modules for words, counts or
# files.
WALK: tuple[str, ...] = (
    "cli.sweep",
    "study.sweep",
    "scenario",
    "scenario.reading",
    "scenario.draft",
    "scenario.changes",
    "scenario.sections",
    "scenario.keys",
    "scenario.values",
    "study.plan",
    "study.study",
    "simulation.prepare",
    "scenario.schema",
    "simulation.simulation",
    "plants.stepping",
    "study.executors",
    "study.rows",
    "results.scorecard",
    "study.dataset",
)

# Number of the longest functions to list.
_TOLD = 5

_NO_CODE = {
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENDMARKER,
}

AnyFunction: TypeAlias = ast.FunctionDef | ast.AsyncFunctionDef
Graph: TypeAlias = dict[str, set[str]]


class Module(NamedTuple):
    """A source file.

    Attributes:
        name: Dotted, such as `rmrc.law.law`; the name of a package is that of its `__init__`.
        path: Path of the file.
        text: Its contents.
        tree: The same, parsed.
    """

    name: str
    path: Path
    text: str
    tree: ast.Module


class Import(NamedTuple):
    """An import of one module by another one of the package.

    Attributes:
        importer: Its name.
        imported: The name of the other.
        kind: `now`, `late` within a function, or `types` under `if TYPE_CHECKING:`.
    """

    importer: str
    imported: str
    kind: str


class Function(NamedTuple):
    """A function outside compiled code.

    Attributes:
        lines: From `def` to its last line, without the docstring.
        name: With its module, and its class if it is a method.
        place: `file:line`.
    """

    lines: int
    name: str
    place: str


class Row(NamedTuple):
    """A row of the table; without a bound it only informs."""

    what: str
    found: int
    bound: int | None = None

    @property
    def is_exceeded(self) -> bool:
        """Whether the count is above its bound."""
        return self.bound is not None and self.found > self.bound


def read_modules(source: Path) -> dict[str, Module]:
    """Return the modules of a package by name, sorted.

    Args:
        source: The folder of the package.
    """
    modules = {}
    for path in sorted(source.rglob("*.py")):
        parts = (source.name, *path.relative_to(source).with_suffix("").parts)
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        text = path.read_text("utf-8")
        modules[name] = Module(name, path, text, ast.parse(text, str(path)))
    return modules


def package_of(name: str) -> str:
    """Return the entry of the source folder that contains a module.

    Example:
        >>> package_of("rmrc.law.law"), package_of("rmrc.run"), package_of("rmrc")
        ('law', 'run', '__init__')
    """
    return [*name.split("."), "__init__"][1]


def packages(modules: Iterable[str]) -> list[str]:
    """Return the packages and modules directly in the source folder, without `__init__` and `__main__`."""
    return sorted({package_of(name) for name in modules} - {"__init__", "__main__"})


# Lines ------------------------------------------------------------------------------------------


def docstring(node: ast.AST) -> ast.expr | None:
    """Return the docstring of a module, class or function, None if it has none."""
    if not isinstance(node, ast.Module | ast.ClassDef | AnyFunction) or not node.body:
        return None
    first = node.body[0]
    is_text = (
        isinstance(first, ast.Expr)
        and isinstance(first.value, ast.Constant)
        and isinstance(first.value.value, str)
    )
    return first.value if is_text and isinstance(first, ast.Expr) else None


def code_lines(module: Module) -> int:
    """Return how many lines of a module hold code."""
    lines = module.text.split("\n")  # as the tokens have them; splitlines splits at form feeds too
    spans = [_span(found, lines) for node in ast.walk(module.tree) if (found := docstring(node))]
    within = {line for (first, _), (last, _) in spans for line in range(first, last + 1)}
    code: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(module.text).readline):
        is_docstring = token.start[0] in within and any(a <= token.start < b for a, b in spans)
        if token.type not in _NO_CODE and not is_docstring:
            code.update(range(token.start[0], token.end[0] + 1))
    return sum(bool(lines[number - 1].strip()) for number in code)


def _span(node: ast.expr, lines: Sequence[str]) -> tuple[tuple[int, int], tuple[int, int]]:
    """Return the start and end of a node in characters, as tokens have them; `ast` counts bytes."""
    last, end = node.end_lineno or node.lineno, node.end_col_offset or 0
    ends = ((node.lineno, node.col_offset), (last, end))
    first, second = ((line, len(lines[line - 1].encode()[:offset].decode())) for line, offset in ends)
    return first, second


# Imports ----------------------------------------------------------------------------------------


def read_imports(modules: Mapping[str, Module]) -> list[Import]:
    """Return which of the modules import which, each pair once per kind."""
    found = set()
    for module in modules.values():
        for node, kind in _statements(module.tree, "now"):
            found |= {Import(module.name, name, kind) for name in _imported(node, module, modules)}
    return sorted(found)


def _statements(node: ast.AST, kind: str) -> Iterator[tuple[ast.Import | ast.ImportFrom, str]]:
    """Yield the import statements within a node, and their kinds."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Import | ast.ImportFrom):
            yield child, kind
        elif isinstance(child, ast.If) and _name(child.test) == "TYPE_CHECKING":
            for one in child.body:
                yield from _statements(ast.Module([one], []), "types")
            for one in child.orelse:
                yield from _statements(ast.Module([one], []), kind)
        else:
            is_late = kind == "now" and isinstance(child, AnyFunction)
            yield from _statements(child, "late" if is_late else kind)


def _imported(node: ast.Import | ast.ImportFrom, module: Module, modules: Collection[str]) -> Iterator[str]:
    """Yield the names of the package's modules that a statement imports."""
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names if alias.name in modules)
        return
    parts = module.name.split(".")
    up = node.level - (module.path.name == "__init__.py")
    base = parts[: len(parts) - up] if node.level else []
    origin = ".".join([*base, *([node.module] if node.module else [])])
    for alias in node.names:
        member = f"{origin}.{alias.name}"
        if member in modules or origin in modules:
            yield member if member in modules else origin


def _name(node: ast.expr) -> str:
    """Return the last name of an expression: `njit` of `njit`, `numba.njit` and `numba.njit(cache=True)`."""
    if isinstance(node, ast.Call):
        return _name(node.func)
    if isinstance(node, ast.Attribute):
        return node.attr
    return node.id if isinstance(node, ast.Name) else ""


def module_graph(modules: Iterable[str], imports: Iterable[Import]) -> Graph:
    """Return the imports of each module at run time, late or not."""
    graph: Graph = {name: set() for name in modules}
    for one in imports:
        if one.kind != "types":
            graph[one.importer].add(one.imported)
    return graph


def package_graph(modules: Iterable[str], imports: Iterable[Import]) -> Graph:
    """Return which others each package, or single module, imports in any way."""
    graph: Graph = {name: set() for name in packages(modules)}
    for one in imports:
        importer, imported = package_of(one.importer), package_of(one.imported)
        if importer != imported and importer in graph and imported in graph:
            graph[importer].add(imported)
    return graph


def circles(graph: Graph) -> list[list[str]]:
    """Return a shortest circle of each group whose members all import each other, perhaps through others.

    Example:
        >>> circles({"a": {"b"}, "b": {"c"}, "c": {"b", "d"}, "d": set()})
        [['b', 'c', 'b']]
    """
    reached = {name: _reached(graph, name) for name in graph}
    groups = {
        frozenset(other for other in reached[name] if name in reached[other])
        for name in graph
        if name in reached[name]
    }
    shortest = (min((_circle(graph, name) for name in sorted(group)), key=len) for group in groups)
    return sorted(shortest)


def _reached(graph: Graph, start: str) -> set[str]:
    """Return everything that a name imports, directly or not."""
    reached: set[str] = set()
    waiting = [start]
    while waiting:
        more = graph[waiting.pop()] - reached
        reached |= more
        waiting += more
    return reached


def _circle(graph: Graph, start: str) -> list[str]:
    """Return the shortest way from a name back to itself, which must exist."""
    ways = deque([[start]])
    seen: set[str] = set()
    while True:
        way = ways.popleft()
        for name in sorted(graph[way[-1]] - seen):
            if name == start:
                return [*way, name]
            seen.add(name)
            ways.append([*way, name])


def order(graph: Graph) -> list[list[str]]:
    """Return the names of a graph without circles from the top down, in steps: none imports its own step.

    Example:
        >>> order({"cli": {"arm", "run"}, "arm": {"errors"}, "run": {"errors"}, "errors": set()})
        [['cli'], ['arm', 'run'], ['errors']]
    """
    sorter = TopologicalSorter(graph)
    sorter.prepare()
    steps: list[list[str]] = []
    while sorter.is_active():
        steps.insert(0, sorted(sorter.get_ready()))
        sorter.done(*steps[0])
    return steps


# Functions --------------------------------------------------------------------------------------


def read_functions(modules: Iterable[Module], source: Path, exempt: Collection[str]) -> list[Function]:
    """Return the functions outside compiled code, the longest first.

    Args:
        modules: Their modules.
        source: The folder to which their places are relative.
        exempt: Dotted names of packages and modules that are compiled whole.
    """
    found: list[Function] = []
    for module in modules:
        if not any(module.name == name or module.name.startswith(f"{name}.") for name in exempt):
            place = module.path.relative_to(source.parent).as_posix()
            found += _functions(module.tree, module.name, place)
    return sorted(found, key=lambda one: (-one.lines, one.name))


def _functions(node: ast.AST, name: str, place: str) -> Iterator[Function]:
    """Yield the functions within a node, and those within them, but no compiled ones."""
    for child in ast.iter_child_nodes(node):
        inner = name
        if isinstance(child, ast.ClassDef | AnyFunction):
            inner = f"{name}.{child.name}"
        if isinstance(child, AnyFunction):
            if any(_name(decorator) in COMPILING for decorator in child.decorator_list):
                continue
            yield Function(function_lines(child), inner, f"{place}:{child.lineno}")
        yield from _functions(child, inner, place)


def function_lines(node: AnyFunction) -> int:
    """Return how many lines a function has, without its decorators and its docstring."""
    text = docstring(node)
    lines = (node.end_lineno or node.lineno) - node.lineno + 1
    return lines - ((text.end_lineno or text.lineno) - text.lineno + 1 if text else 0)


# The table --------------------------------------------------------------------------------------


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the counts; return 1 if one is above its bound, else 0.

    Args:
        arguments: Arguments of the command line; None: those of this process.
    """
    parser = argparse.ArgumentParser(description="Count what a package is made of; 1 if a bound is exceeded.")
    parser.add_argument("--source", type=Path, default=SOURCE, help="the package's folder")
    parser.add_argument(
        "--compiled",
        action="append",
        default=[],
        metavar="PACKAGE",
        help="a package or module, such as law, whose functions are all compiled; repeatable",
    )
    given = parser.parse_args(arguments)
    source = given.source.resolve()
    modules = read_modules(source)
    if source.name not in modules:
        parser.error(f"--source {given.source}: is no package")
    exempt = [f"{source.name}.{name.removeprefix(f'{source.name}.')}" for name in given.compiled]
    if unknown := [name for name in exempt if name not in modules]:
        parser.error(f"--compiled {unknown[0]}: there is no such package or module")
    missing = [name for name in WALK if f"{source.name}.{name}" not in modules]
    if missing and source == SOURCE:
        parser.error(f"WALK names {', '.join(missing)}: there are no such modules; correct it")
    return report(modules, source, exempt)


def report(modules: Mapping[str, Module], source: Path, exempt: Collection[str]) -> int:
    """Print the table and its details; return 1 if a count is above its bound, else 0.

    Args:
        modules: By name.
        source: Their folder.
        exempt: Dotted names of packages and modules that are compiled whole.
    """
    lines: Counter[str] = Counter()
    for module in modules.values():
        lines[package_of(module.name)] += code_lines(module)
    imports = read_imports(modules)
    kinds = Counter(one.kind for one in imports)
    graph = package_graph(modules, imports)
    between_modules, between_packages = circles(module_graph(modules, imports)), circles(graph)
    longest = read_functions(modules.values(), source, exempt)
    rows = [
        Row("code lines", lines.total(), MOST_LINES),
        Row(f"packages and modules in {source.name}", len(graph), MOST_PACKAGES),
        Row("circles between modules", len(between_modules), MOST_CIRCLES),
        Row("circles between packages", len(between_packages), MOST_CIRCLES),
        Row("longest function, not compiled", longest[0].lines if longest else 0, LONGEST_FUNCTION),
        Row("modules from --vary to a row", len(WALK)),
        Row("modules", len(modules)),
        Row("imports between modules", kinds["now"]),
        Row("imports within functions", kinds["late"]),
        Row("imports for types only", kinds["types"]),
    ]
    _print_rows(rows)
    _print_lines(lines)
    for circle in between_modules:
        print("\ncircle of modules:", " -> ".join(circle))
    for circle in between_packages:
        _print_circle(circle, imports)
    if not between_packages:
        print("\norder, from the top down (none imports its own line or above):")
        print("\n".join(f"  {', '.join(step)}" for step in order(graph)))
    print("\nlongest functions, not compiled:")
    for one in longest[:_TOLD]:
        print(f"  {one.lines:6}  {one.name}  {one.place}")
    return int(any(row.is_exceeded for row in rows))


def _print_rows(rows: Sequence[Row]) -> None:
    width = max(len(row.what) for row in rows)
    print(f"{'count':{width}}  {'now':>6}  {'bound':>6}")
    for row in rows:
        bound = "" if row.bound is None else row.bound
        print(f"{row.what:{width}}  {row.found:6}  {bound:>6}{'  exceeded' * row.is_exceeded}")


def _print_lines(lines: Mapping[str, int]) -> None:
    print("\ncode lines of each package or module:")
    for name, count in sorted(lines.items(), key=lambda item: (-item[1], item[0])):
        print(f"  {count:6}  {name}")


def _print_circle(circle: Sequence[str], imports: Iterable[Import]) -> None:
    """Print a circle of packages, with the imports that make each step of it."""
    print("\ncircle of packages:", " -> ".join(circle))
    steps = set(pairwise(circle))
    for one in imports:
        if (package_of(one.importer), package_of(one.imported)) in steps:
            kind = {"now": "", "late": " within a function", "types": " for types only"}[one.kind]
            print(f"  {one.importer} imports {one.imported}{kind}")


if __name__ == "__main__":
    if hasattr(signal, "SIGPIPE"):  # end silently when the reader has seen enough, such as `head`
        signal.signal(signal.SIGPIPE, signal.SIG_DFL)
    sys.exit(main())
