"""rmrc beside others who resolve motion rates: mink, pink, the Robotics Toolbox, J-PARSE, loops in numpy.

    pip install -e '.[peers]'
    python benchmarks/peers.py > docs/peers.md

What is not installed is left out, and the page says so. `peer_cases.py` has what is the same for everyone,
`peer_loops.py` the lines that a user of each writes.
"""

import argparse
import ast
import functools
import hashlib
import inspect
import itertools
import json
import logging
import multiprocessing
import platform
import textwrap
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from importlib import metadata, util
from pathlib import Path
from typing import NamedTuple

import numpy as np
import peer_cases
import peer_loops
from peer_cases import CHATTER_FLOOR, PERIOD, ROOT, Case, cases, drive, measure

GAINS, DAMPINGS = (10.0, 50.0, 500.0), (0.01, 0.05, 0.2)
CONSTANT = {"inverse.damping.schedule": "constant"}
SMOOTH, OPTIMAL = {"limits.acceleration": 30.0}, {"limits.on_excess": "optimal"}
SHARED, LIMITS_FIRST = {"limits.on_excess": "sns"}, {"limits.on_excess": "reverse_priority"}
JPARSE, BEYOND_LIMITS = {"inverse.method": "jparse"}, {"limits.position": False}
KEEP_OUT = {"at_singularity": "keep_out"}
# More of ours, each tried with the whole grid.
MORE = (
    CONSTANT,
    {"inverse.metric": "inertia"},
    JPARSE,
    JPARSE | {"inverse.push.position": 2.0, "inverse.push.rotation": 2.0},
    OPTIMAL | CONSTANT,
    OPTIMAL | SMOOTH,
    OPTIMAL | {"limits.acceleration": 100.0},
    SHARED | CONSTANT,
    SHARED | SMOOTH,
    LIMITS_FIRST | CONSTANT,
    LIMITS_FIRST | SMOOTH,
    KEEP_OUT,
    KEEP_OUT | SMOOTH,
    {"at_singularity": "singularity_consistent"},
    BEYOND_LIMITS | CONSTANT,
    BEYOND_LIMITS | JPARSE,
)
# And the ways of others, with the numbers of their documentation.
ALONE = BEYOND_LIMITS | {"feedforward": False}
WAYS = (
    *({"gain": K, **BEYOND_LIMITS, "inverse.method": "pseudoinverse"} for K in GAINS),
    {"gain": 2.0, "damping": 0.1, **BEYOND_LIMITS, **JPARSE},
    {"gain": 1.0, **ALONE, "inverse.method": "pseudoinverse"},
    *({"gain": K, "damping": 0.01, **ALONE, **CONSTANT} for K in (1.0, 9.5)),
    *({"gain": 1.0, "damping": d, "feedforward": False, **CONSTANT} for d in (0.05, 0.2)),
    # one limit for all joints, as mjctrl has it: that of the Stanford arm's boom
    *({"gain": K, "damping": d, **CONSTANT, "limits.rate": 0.75} for K, d in ((9.5, 0.01), (500.0, 0.2))),
)
# Column: what it is, and a difference that is none.
COLUMNS = {
    "peak rate": ("rad/s or m/s", 1e-3), "rms rate": ("of all joints together", 1e-3),
    "mm": ("largest error of position", 1e-3), "mrad": ("largest error of orientation", 1e-3),
    "end mm": ("error at the end of the return leg", 1e-3), "end mrad": ("", 1e-3),
    "peak acc": ("of commands, rad/s² or m/s²", 1e-1), "rms acc": ("", 1e-2),
    "chatter": ("reversals of a joint's acceleration a second", 0.5),
    "over": ("beyond position limits, mrad or mm", 1e-1),
}  # fmt: skip
# So far beyond a position limit [mrad or mm] is more than what the stiff servos lag behind.
OUTSIDE = 1.0
# So many times our error is no longer the same task.
FOLLOWS = 2.0
# By how much more a figure may be and still be as good.
ALIKE = 1.02


class Peer(NamedTuple):
    """A row of the tables: its loop, its package, and the settings that are tried."""

    name: str
    loop: Callable[..., object]
    settings: tuple[dict[str, object], ...]

    @property
    def is_ours(self) -> bool:
        """Whether it is rmrc."""
        return self.loop is peer_loops.Rmrc

    def start(self, case: Case, setting: dict[str, object]) -> Callable[..., np.ndarray]:
        """Return the `step` of its loop at the start of a case."""
        told = {"control": control(setting)} if self.is_ours else setting
        return self.loop(case.arm, case.start.copy(), **told).step


def control(setting: dict[str, object]) -> dict[str, object]:
    """Return a section `control` with a K, a λ and further keys: λ for all that has the units of σ."""
    dotted = {"feedback": setting["gain"]} if "gain" in setting else {}
    if "damping" in setting:
        damping = setting["damping"]
        dotted |= {"inverse.damping.maximum": damping, "inverse.damping.below": 2 * damping}
        dotted |= {"inverse.gamma": damping, "keep_out.sigma": damping}
    section: dict[str, object] = {}
    for key, value in (dotted | {key: setting[key] for key in setting if key not in GRID}).items():
        *way, last = key.split(".")
        functools.reduce(lambda at, name: at.setdefault(name, {}), way, section)[last] = value
    return section


GRID = ("gain", "damping")


def grid(**fixed: object) -> tuple[dict[str, object], ...]:
    """Return the settings that everyone is tried with."""
    return tuple({"gain": K, "damping": d, **fixed} for K, d in itertools.product(GAINS, DAMPINGS))


def peers() -> Iterator[tuple[str, Peer]]:
    """Yield each peer with its package, ours first."""
    forward = {"feedforward": 1.0}
    more = tuple(one for keys in MORE for one in grid(**keys))
    for peer in (
        Peer("rmrc as written", peer_loops.Rmrc, ({},)),
        Peer("rmrc, same grid", peer_loops.Rmrc, grid()),
        Peer(OURS, peer_loops.Rmrc, grid() + more + WAYS),
        Peer("numpy DLS as written", peer_loops.Numpy, ({},)),
        Peer("numpy DLS", peer_loops.Numpy, grid()),
        Peer("mjctrl as written", peer_loops.Mjctrl, ({},)),
        Peer("mjctrl", peer_loops.Mjctrl, grid()),
        Peer("mink as documented", peer_loops.MinkExample, ({},)),
        Peer("mink", peer_loops.Mink, grid()),
        Peer("pink as documented", peer_loops.PinkExample, ({},)),
        Peer("pink", peer_loops.Pink, grid()),
        Peer("pink, acceleration limit", peer_loops.PinkAccelerating, grid()),
        Peer("J-PARSE as documented", peer_loops.Jparse, ({},)),
        Peer("J-PARSE", peer_loops.Jparse, grid()),
        Peer("Toolbox as documented", peer_loops.Toolbox, ({},)),
        Peer("Toolbox", peer_loops.Toolbox, tuple({"gain": K, **forward} for K in GAINS)),
        Peer("NEO as documented", peer_loops.Neo, ({},)),
        Peer("NEO", peer_loops.Neo, tuple({"gain": K, **forward} for K in GAINS)),
    ):
        yield peer.loop.package, peer


OURS = "rmrc, more methods"
IMPORTS = {
    "pin-pink": "pink",
    "roboticstoolbox-python": "roboticstoolbox",
    "jparse-robotics": "jparse_robotics",
}


def installed(package: str) -> bool:
    """Say whether a package is there."""
    return util.find_spec(IMPORTS.get(package, package)) is not None


def run(case: Case, peer: Peer, setting: dict[str, object]) -> dict[str, float] | str:
    """Return the figures of one run, or why there are none."""
    logging.disable(logging.WARNING)  # pink warns at each step that begins beyond a limit by rounding
    try:
        return measure(case, drive(case, peer.start(case, setting)))
    except Exception as error:  # a peer's own: it stops its user's loop
        return f"{type(error).__name__}: {error}"


def error_of(figures: dict[str, float]) -> float:
    """Return what a setting is chosen by: errors, a meter as bad as a radian."""
    return float(np.hypot(figures["mm"], figures["mrad"]))


def keeps(figures: dict[str, float]) -> bool:
    """Say whether a run keeps the limits, comes back, and does not chatter."""
    return (
        figures["rate over"] < 1e-3
        and figures["end mm"] + figures["end mrad"] < 1.0
        and figures["chatter"] < 2.0
        and figures["over"] < OUTSIDE
    )


def best(found: list[dict[str, float]]) -> int:
    """Return which setting wins: the least error, within 2 % the least peak of acceleration, then of rate."""
    kept = [i for i, one in enumerate(found) if keeps(one)] or list(range(len(found)))
    within = ALIKE * min(error_of(found[i]) for i in kept)
    return min(
        (i for i in kept if error_of(found[i]) <= within),
        key=lambda i: (found[i]["peak acc"], found[i]["peak rate"]),
    )


def lines_of(loop: type) -> int:
    """Return how many statements a class has, with those that it inherits, but for docstrings."""
    seen, count = set(), 0
    for one in [base for base in loop.__mro__ if base is not object]:
        (tree,) = ast.parse(textwrap.dedent(inspect.getsource(one))).body
        methods = [node for node in tree.body if isinstance(node, ast.FunctionDef) and node.name not in seen]
        seen |= {node.name for node in methods} - {"__init__"}
        count += sum(
            isinstance(node, ast.stmt) and not is_text(node) for one in methods for node in ast.walk(one)
        )
    return count


def is_text(node: ast.stmt) -> bool:
    """Say whether a statement is a docstring."""
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


class Row(NamedTuple):
    """What a table says of a peer."""

    peer: Peer
    setting: dict[str, object]
    figures: dict[str, float]


@functools.cache
def version_of(loop: type) -> str:
    """Return what the figures of a loop depend on: its package, its lines, the cases, and our own sources."""
    texts = [inspect.getsource(peer_cases), *(inspect.getsource(one) for one in loop.__mro__[:-1])]
    if loop is peer_loops.Rmrc:
        texts += [path.read_text() for path in sorted((ROOT / "src/rmrc").rglob("*.py"))]
    return f"{metadata.version(loop.package)} {hashlib.sha256(''.join(texts).encode()).hexdigest()[:12]}"


class Keep:
    """Results in a file, so that what has run need not run again; by the version of what ran."""

    def __init__(self, path: Path | None) -> None:
        self.path = path
        self.found = json.loads(path.read_text()) if path and path.exists() else {}
        self.written = len(self.found)

    def run(self, case: Case, peer: Peer, setting: dict[str, object]) -> dict[str, float] | str:
        """Return the figures of a run, of today or of before."""
        name = f"{peer.loop.__name__} {version_of(peer.loop)}"
        key = f"{case.name}|{name}|{json.dumps(setting, sort_keys=True)}"
        if key not in self.found:
            self.found[key] = run(case, peer, setting)
        return self.found[key]

    def all(self, case: Case, peer: Peer) -> list[tuple[dict[str, object], dict[str, float] | str]]:
        """Return the figures of all settings of a peer."""
        return [(setting, self.run(case, peer, setting)) for setting in peer.settings]

    def save(self) -> None:
        """Write the file, if there is more to keep."""
        if self.path and len(self.found) > self.written:
            self.path.write_text(json.dumps(self.found, indent=0))
            self.written = len(self.found)


def tried(number: int, path: Path | None) -> dict[str, dict[str, float] | str]:
    """Return the results of all peers in a case that are not in a file."""
    keep = Keep(path)
    known = keep.found.copy()
    for package, peer in peers():
        if installed(package):
            keep.all(cases()[number], peer)
    return {key: value for key, value in keep.found.items() if key not in known}


def try_ahead(keep: Keep, shown: list[Case], jobs: int) -> None:
    """Run everything on so many processors; what is left for one are the times."""
    numbers = [number for number, one in enumerate(cases()) if one in shown]
    with ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn")) as pool:
        for found in pool.map(tried, numbers, [keep.path] * len(numbers)):
            keep.found |= found
            keep.save()


def row_of(case: Case, peer: Peer, keep: Keep) -> Row | str:
    """Return a peer's best run of a case, or why all of its runs stopped."""
    tried = keep.all(case, peer)
    ran = [(setting, figures) for setting, figures in tried if isinstance(figures, dict)]
    if not ran:
        return str(tried[0][1])
    return Row(peer, *ran[best([figures for _, figures in ran])])


def is_led(value: float, ours: float, floor: float) -> bool:
    """Say whether a figure is better than ours by more than 2 %."""
    return ours > ALIKE * value and ours - value > floor


def leads(theirs: dict[str, float], ours: dict[str, float]) -> list[str]:
    """Return the columns in which figures are ahead of ours."""
    return [name for name, (_, floor) in COLUMNS.items() if is_led(theirs[name], ours[name], floor)]


class Verdict(NamedTuple):
    """How a row of others stands: where it leads our row, and our setting that it leads in fewest columns."""

    row: Row
    ahead: list[str]
    setting: dict[str, object]
    figures: dict[str, float]
    left: list[str]


def judge(row: Row, ours: Row, tried: list[tuple[dict[str, object], dict[str, float]]]) -> Verdict:
    """Return how a row stands against ours, and against all that was tried of ours."""

    def worst(one: tuple[dict[str, object], dict[str, float]]) -> tuple[int, float]:
        found = leads(row.figures, one[1])
        return len(found), max((one[1][name] / max(row.figures[name], 1e-9) for name in found), default=0.0)

    setting, figures = min([(ours.setting, ours.figures), *tried], key=worst)
    ahead = leads(row.figures, ours.figures)
    return Verdict(row, ahead, setting, figures, leads(row.figures, figures))


def words(ours: Row, verdicts: list[Verdict]) -> Iterator[str]:
    """Yield which rows ours leaves no column, which another setting of ours does, and which none does."""
    behind = [one.row.peer.name for one in verdicts if not one.ahead]
    if behind:
        yield f"Our row is as good in every column as {', '.join(behind)}."
    for one in verdicts:
        if not one.ahead:
            continue
        said = (
            f"{one.row.peer.name} is ahead of our row in {against(one.ahead, one.row.figures, ours.figures)}"
        )
        aside = remarks(one.row, ours)
        if not one.left:
            yield f"{said}{aside}. With {told(one.setting)}, rmrc is as good in every column."
        else:
            nearest = against(one.left, one.row.figures, one.figures)
            yield f"**{said}**{aside}. The nearest of our settings, {told(one.setting)}, lacks {nearest}."


def against(names: list[str], theirs: dict[str, float], ours: dict[str, float]) -> str:
    """Return columns with both figures."""
    return ", ".join(f"{name} {theirs[name]:.3g} (ours {ours[name]:.3g})" for name in names)


def remarks(row: Row, ours: Row) -> str:
    """Return what a row's lead costs: its error, its place beyond a limit."""
    found, share = [], error_of(row.figures) / error_of(ours.figures)
    if share > ALIKE:
        found.append(f"{share:.3g} times our error")
    if row.figures["over"] > OUTSIDE > ours.figures["over"]:
        found.append(f"{row.figures['over']:.3g} mrad or mm beyond a joint's limit")
    if row.figures["end mm"] + row.figures["end mrad"] > 1.0:
        found.append("not back at the end")
    return f", with {' and '.join(found)}" if found else ""


def told(setting: dict[str, object]) -> str:
    """Return a setting in words."""
    hidden = {"feedforward": 1.0}  # of the Toolbox, in every row but its documented one
    texts = [
        f"{key.split('.')[-1]} {value:g}" if isinstance(value, float) else f"{key.split('.')[-1]} {value}"
        for key, value in setting.items()
        if hidden.get(key) != value
    ]
    return ", ".join(texts) or "defaults"


class Table(NamedTuple):
    """A case: its lines, how the rows of others stand, and who stops with every setting."""

    case: Case
    lines: list[str]
    verdicts: list[Verdict]
    rows: list[Row]
    stopped: list[str]

    @property
    def ours(self) -> Row:
        """Our row."""
        return next(row for row in self.rows if row.peer.name == OURS)


def table(case: Case, keep: Keep) -> Table:
    """Return the table of a case."""
    lines = [f"\n### {case.name[0].upper()}{case.name[1:]}\n\n{case.what}\n"]
    names = ["", "setting", *COLUMNS]
    lines += ["| " + " | ".join(names) + " |", "|" + "---|" * 2 + "---:|" * (len(names) - 2)]
    rows, stopped = [], {}
    for package, peer in peers():
        if not installed(package):
            continue
        row = row_of(case, peer, keep)
        if isinstance(row, str):
            stopped[peer.name] = row
            continue
        keep.save()
        rows.append(row)
        figures = [
            f"{max(row.figures[name], 0.0):.3g}" if abs(row.figures[name]) > floor / 10 else "0"
            for name, (_, floor) in COLUMNS.items()
        ]
        over = "" if row.figures["rate over"] < 1e-3 else " (rates over their limits)"
        lines.append(f"| {peer.name}{over} | {told(row.setting)} | " + " | ".join(figures) + " |")
    (ours,) = (row for row in rows if row.peer.name == OURS)
    tried = [pair for pair in keep.all(case, ours.peer) if isinstance(pair[1], dict)]
    verdicts = [judge(row, ours, tried) for row in rows if not row.peer.is_ours]
    said = [*(f"{name} stops: {why}." for name, why in stopped.items()), *words(ours, verdicts)]
    lines.append("\n" + "\n".join(f"- {text}" for text in said))
    return Table(case, lines, verdicts, rows, [*stopped])


def summary(tables: list[Table]) -> Iterator[str]:
    """Yield how many rows of others each case has, and which lead all settings of ours in a column."""
    yield "| case | rows of others | our row is as good | another setting of rmrc is | none of rmrc is |"
    yield "|---|---:|---:|---:|---|"
    for one in tables:
        named = [ahead(verdict, one) for verdict in one.verdicts if verdict.left]
        row = sum(not verdict.ahead for verdict in one.verdicts)
        another = len(one.verdicts) - row - len(named)
        yield f"| {one.case.name} | {len(one.verdicts)} | {row} | {another} | {'; '.join(named)} |"


def ahead(verdict: Verdict, one: Table) -> str:
    """Return in which columns a row leads all settings of ours, and what that costs."""
    return f"{verdict.row.peer.name}: {', '.join(verdict.left)}{remarks(verdict.row, one.ours)}"


def does_the_task(row: Row, ours: Row) -> bool:
    """Say whether a row follows, stays within the limits, and comes back."""
    follows = error_of(row.figures) <= FOLLOWS * error_of(ours.figures)
    return (
        follows and row.figures["over"] <= OUTSIDE and row.figures["end mm"] + row.figures["end mrad"] <= 1.0
    )


def totals(tables: list[Table]) -> Iterator[str]:
    """Yield how the rows of others stand in all cases together, and those that none of ours is as good as."""
    every = [(verdict, one) for one in tables for verdict in one.verdicts]
    same = [(verdict, one) for verdict, one in every if does_the_task(verdict.row, one.ours)]

    def counts(pairs: list[tuple[Verdict, Table]]) -> str:
        behind, left = (sum(not one.ahead for one, _ in pairs), sum(bool(one.left) for one, _ in pairs))
        others = len(pairs) - behind - left
        return (
            f"our row is as good as {behind}, another single setting of rmrc as {others}, "
            f"and {left} lead every setting of rmrc in some column"
        )

    task = f"at most {FOLLOWS:g} times our error, within the limits, back at the end"
    yield f"Of the {len(same)} that do the task ({task}), {counts(same)}."
    for verdict, one in same:
        if verdict.left:
            yield f"**Better than ours** is {ahead(verdict, one)}, in {one.case.name}."
    away = [pair for pair in every if not any(pair[0] is verdict for verdict, _ in same)]
    yield f"Of the {len(away)} others, {counts(away)}. The table names the columns and the cost."
    for name in dict.fromkeys(name for one in tables for name in one.stopped):
        where = [one.case.name for one in tables if name in one.stopped]
        yield f"{name} stops with an error at every setting in {'; '.join(where)}, and has no row there."


# Steps that are timed together, as a clock costs as much as a fast step, and how often everyone has its turn.
TIMED, ROUNDS = 100, 12


def times(one: Table) -> dict[str, np.ndarray]:
    """Return microseconds of this thread a step, in turns: each peer a hundred ticks of our run."""
    case = one.case
    (ours,) = (row for row in one.rows if row.peer.name == OURS)
    track = drive(case, ours.peer.start(case, ours.setting))
    steps = {row.peer.name: row.peer.start(case, row.setting) for row in one.rows}
    found: dict[str, list[float]] = {name: [] for name in steps}
    for k in range(ROUNDS):
        first = k * (case.ticks - TIMED) // ROUNDS
        told = [
            (track.q[i], track.qdot[i], case.poses[i], case.twists[i], case.poses[i + 1])
            for i in range(first, first + TIMED)
        ]
        for name, step in list(steps.items()):
            try:
                started = time.thread_time()
                for each in told:
                    step(*each)
                found[name].append((time.thread_time() - started) / TIMED * 1e6)
            except Exception:  # a peer's own: it has no time
                del steps[name], found[name]
    return {name: np.array(values) for name, values in found.items()}


def timing(shown: dict[str, dict[str, np.ndarray]]) -> Iterator[str]:
    """Yield the times of a step on each arm, and who is faster than we are."""
    yield "| µs a step, least; median | " + " | ".join(shown) + " |"
    yield "|---|" + "---:|" * len(shown)
    for name in dict.fromkeys(name for found in shown.values() for name in found):
        cells = (
            f"{found[name].min():.1f}; {np.median(found[name]):.1f}" if name in found else ""
            for found in shown.values()
        )
        yield f"| {name} | " + " | ".join(cells) + " |"


def speed(shown: dict[str, dict[str, np.ndarray]]) -> str:
    """Return what a step takes of everyone on all arms, and who is faster than we are."""
    if not shown:
        return "Steps are timed on the crossings at 1°, and none is among these cases."
    least: dict[str, list[float]] = {}
    for name, values in ((name, values) for found in shown.values() for name, values in found.items()):
        least.setdefault(name, []).append(float(values.min()))
    others = [
        f"{name} {min(values):.0f} to {max(values):.0f} µs"
        for name, values in sorted(least.items(), key=lambda item: min(item[1]))
        if not name.startswith("rmrc") and not name.endswith(("documented", "written"))
    ]
    faster = {
        name: None
        for found in shown.values()
        for name, values in found.items()
        if not name.startswith("rmrc") and is_led(values.min(), found[OURS].min(), 0.1)
    }
    ours = f"{min(least[OURS]):.1f} to {max(least[OURS]):.1f} µs"
    return (
        f"A step of rmrc takes {ours} with kinematics, the least of {ROUNDS} rounds on each of {len(shown)} "
        f"arms; {', '.join(others)}. Faster than rmrc: {', '.join(faster) or 'none'}."
    )


def versions() -> Iterator[str]:
    """Yield a line a package."""
    for package in dict.fromkeys(["mujoco", "numpy", "daqp", *(package for package, _ in peers())]):
        if installed(package):
            yield f"| {package} | {metadata.version(package)} |"
        else:
            yield f"| {package} | not installed: left out |"


def statements() -> Iterator[str]:
    """Yield how many statements the user of each loop writes."""
    yield "| loop | statements of its user |\n|---|---:|"
    named = {peer.loop: peer.name for package, peer in peers() if installed(package)}
    named[peer_loops.Rmrc] = "rmrc"
    counts = {
        name: lines_of(loop) for loop, name in named.items() if not name.endswith(("documented", "written"))
    }
    yield from (f"| {name} | {count} |" for name, count in counts.items())
    yield f"\nThe shortest is that of {min(counts, key=lambda name: counts[name])}. {STATEMENTS}"


STATEMENTS = (
    "The count omits `toolbox_robot`, which makes an arm of the Robotics Toolbox from an MJCF file for its "
    "loop and NEO's."
)


def page(keep: Keep, only: list[str], jobs: int) -> Iterator[str]:
    """Yield the page."""
    ours = next(peer for _, peer in peers() if peer.name == OURS)
    shown = [one for one in cases() if not only or any(one.name.startswith(name) for name in only)]
    if jobs > 1:
        try_ahead(keep, shown, jobs)
    tables = [table(one, keep) for one in shown]
    times_of = {one.case.name.split(", ")[1]: times(one) for one in tables if " 1°" in one.case.name}
    rows = sum(len(one.verdicts) for one in tables)
    yield HEAD.format(cases=len(tables), all=len(cases()), rows=rows)
    left_out = [one.name for one in cases() if one not in shown]
    if left_out:
        yield f"- Left out by `--only`: {'; '.join(left_out)}."
    yield from (f"- {text}" for text in (*totals(tables), speed(times_of)))
    yield INTRODUCTION.format(
        settings=len(grid()), more=len(MORE), ways=len(WAYS), ours=len(ours.settings), period=1e3 * PERIOD,
        gains=", ".join(f"{K:g}" for K in GAINS), dampings=", ".join(f"{d:g}" for d in DAMPINGS),
        floor=CHATTER_FLOOR,
    )  # fmt: skip
    yield "| package | version |\n|---|---|"
    yield from versions()
    yield f"| Python | {platform.python_version()} |"
    yield "\n## Who leads\n"
    yield from summary(tables)
    yield "\n## Time and lines\n"
    yield from timing(times_of)
    yield ""
    yield from statements()
    yield "\n## Figures"
    for one in tables:
        yield from one.lines


HEAD = """# Comparison with other libraries

rmrc and other libraries for resolved motion rates, on the same arms and paths. A program prints this page:

```sh
pip install -e '.[peers]'
python benchmarks/peers.py > docs/peers.md
```

The other libraries have {rows} rows in {cases} of {all} cases. "As good" is no worse by more than 2 % in any
column.
"""

INTRODUCTION = """
**Equal conditions.** All loops use our models of the arms, each without fingers, its base at the origin,
without weight and friction, with a stiff rate servo on each joint, in MuJoCo at {period:g} ms. A path is
one screw, there and back in 2 s each. At each tick a loop gets the joint positions, the reference pose now
and at the end of the period, and the mean twist between them; it returns joint rates. A loop without limits
of its own scales its rates down to the limits of the joints, in one additional line. The loop has no delay
and no noise. The best gains are therefore higher than a real robot tolerates: [From simulation to your
robot](from_simulation_to_your_robot.md) finds a realistic one.

**Settings.** "As documented" has the numbers of a library's own example. Each other row has the best of one
grid of {settings} settings for everyone: feedback K of {gains} /s and damping λ of {dampings} (λ² where a
library needs that, γ of J-PARSE; the Toolbox's pseudoinverse has none, and NEO keeps its own, because its
steps take long). "rmrc, more methods" tries the same grid with {more} more methods, and {ways} settings
that imitate the others: {ours} settings in all. The best has the least error, where a meter counts as a
radian; of settings within 2 % of it, it is the one with the least peak acceleration, which is also the rule
of `rmrc tune`. A setting that exceeds the limits, chatters or does not come back
counts only if all settings do.

**Columns.** Peak of one joint's rate and root mean square of all joints' together, as commanded [rad/s or
m/s]; largest error of position [mm] and of orientation [mrad], and both at the end of the return leg; peak
and root mean square of the commands' acceleration [rad/s² or m/s²]; chatter, reversals of a joint's
acceleration beyond {floor:g} rad/s² [1/s]; the largest distance of a joint beyond its
position limit [mrad or mm]. A value below its column's floor is printed as 0.

**Who leads.** A row leads in a column if it is better by more than 2 %. "Our row" is "rmrc, more methods".
It cannot lead in all columns at once, because less error needs faster joints. Therefore the page
compares each row of others first with our row, and then with each single setting of rmrc. A setting is "as
good" if the row leads it in no column. The page also compares rows with a larger error than ours, and names
their error. Different rows may need different settings of rmrc: no single one is as good as all rows at once.
"""


def main() -> None:
    """Print the page."""
    parser = argparse.ArgumentParser(description="rmrc beside others who resolve motion rates")
    parser.add_argument("--keep", type=Path, help="a JSON file of results: what it has does not run again")
    parser.add_argument("--only", action="append", default=[], help="cases whose names begin so")
    parser.add_argument("--jobs", type=int, default=1, help="processors; times are taken by one alone")
    arguments = parser.parse_args()
    for line in page(Keep(arguments.keep), arguments.only, arguments.jobs):
        print(line, flush=True)


if __name__ == "__main__":
    main()
