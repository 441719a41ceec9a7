"""rmrc beside others who resolve motion rates: mink, pink, the Robotics Toolbox, J-PARSE, loops in numpy.

    pip install -e '.[peers]'
    python benchmarks/peers.py --keep peers.json > docs/peers.md

What is not installed is left out, and the page says so. `peer_cases.py` has what is the same for everyone,
`peer_loops.py` the lines that a user of each writes.
"""

import argparse
import ast
import inspect
import itertools
import json
import logging
import platform
import textwrap
from collections.abc import Callable, Iterator
from importlib import metadata, util
from pathlib import Path
from typing import NamedTuple

import numpy as np
import peer_loops
from peer_cases import CHATTER_FLOOR, PERIOD, Case, cases, drive, measure, step_times

GAINS, DAMPINGS = (10.0, 50.0, 500.0), (0.01, 0.05, 0.2)
# More of ours, each tried with the whole grid.
MORE = (
    {},
    {"inverse.damping.schedule": "constant"},
    {"inverse.method": "jparse"},
    {"limits.acceleration": 30.0},
    {"limits.acceleration": 30.0, "inverse.damping.schedule": "constant"},
    {"limits.on_excess": "redistribute"},
    {"limits.on_excess": "optimal", "inverse.damping.schedule": "constant"},
    {"limits.on_excess": "optimal", "limits.acceleration": 30.0},
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


def grid(**fixed: object) -> tuple[dict[str, object], ...]:
    """Return the settings that everyone is tried with."""
    return tuple({"gain": K, "damping": d, **fixed} for K, d in itertools.product(GAINS, DAMPINGS))


def peers() -> Iterator[tuple[str, Peer]]:
    """Yield each peer with its package, ours first."""
    forward = {"feedforward": 1.0}
    for peer in (
        Peer("rmrc as written", peer_loops.Rmrc, ({},)),
        Peer("rmrc, same grid", peer_loops.Rmrc, grid()),
        Peer("rmrc, more methods", peer_loops.Rmrc, tuple(one for more in MORE for one in grid(more=more))),
        Peer("numpy DLS as written", peer_loops.Numpy, ({},)),
        Peer("numpy DLS", peer_loops.Numpy, grid()),
        Peer("mjctrl as written", peer_loops.Mjctrl, ({},)),
        Peer("mjctrl", peer_loops.Mjctrl, grid()),
        Peer("mink as documented", peer_loops.MinkExample, ({},)),
        Peer("mink", peer_loops.Mink, grid()),
        Peer("pink as documented", peer_loops.PinkExample, ({},)),
        Peer("pink", peer_loops.Pink, grid()),
        Peer("J-PARSE as documented", peer_loops.Jparse, ({},)),
        Peer("J-PARSE", peer_loops.Jparse, grid()),
        Peer("Toolbox as documented", peer_loops.Toolbox, ({},)),
        Peer("Toolbox", peer_loops.Toolbox, tuple({"gain": K, **forward} for K in GAINS)),
        Peer("NEO as documented", peer_loops.Neo, ({},)),
        Peer("NEO", peer_loops.Neo, tuple({"gain": K, **forward} for K in GAINS)),
    ):
        yield peer.loop.package, peer


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
    try:
        step = peer.loop(case.arm, case.start.copy(), **setting).step
        return measure(case, drive(case, step))
    except Exception as error:  # a peer's own: it stops its user's loop
        return f"{type(error).__name__}: {error}"


def times(case: Case, peer: Peer, setting: dict[str, object]) -> tuple[float, float]:
    """Return the least time of a step and the median, along the run of a setting [µs]."""
    track = drive(case, peer.loop(case.arm, case.start.copy(), **setting).step)
    found = step_times(case, peer.loop(case.arm, case.start.copy(), **setting).step, track)
    return float(found.min()), float(np.median(found))


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
    times: tuple[float, float]


class Keep:
    """Results in a file, so that what has run need not run again; by the version of what ran."""

    def __init__(self, path: Path | None) -> None:
        self.path = path
        self.found = json.loads(path.read_text()) if path and path.exists() else {}

    def run(self, case: Case, peer: Peer, setting: dict[str, object]) -> dict[str, float] | str:
        """Return the figures of a run, of today or of before."""
        return self.of("", run, case, peer, setting)

    def times(self, case: Case, peer: Peer, setting: dict[str, object]) -> tuple[float, float]:
        """Return the least time of a step and the median [µs]."""
        return tuple(self.of("µs|", times, case, peer, setting))

    def of(self, kind: str, find: Callable, case: Case, peer: Peer, setting: dict[str, object]) -> object:
        """Return what is found of a run, and keep it."""
        version = f"{peer.loop.__name__} {metadata.version(peer.loop.package)}"
        key = f"{kind}{case.name}|{version}|{json.dumps(setting, sort_keys=True)}"
        if key not in self.found:
            self.found[key] = find(case, peer, setting)
        return self.found[key]

    def save(self) -> None:
        """Write the file."""
        if self.path:
            self.path.write_text(json.dumps(self.found, indent=0))


def row_of(case: Case, peer: Peer, keep: Keep) -> Row | str:
    """Return a peer's best run of a case, or why all of its runs stopped."""
    tried = [(setting, keep.run(case, peer, setting)) for setting in peer.settings]
    ran = [(setting, figures) for setting, figures in tried if isinstance(figures, dict)]
    if not ran:
        return str(tried[0][1])
    setting, figures = ran[best([figures for _, figures in ran])]
    return Row(peer, setting, figures, keep.times(case, peer, setting))


def is_led(value: float, ours: float, floor: float) -> bool:
    """Say whether a figure is better than ours by more than 2 %."""
    return ours > ALIKE * value and ours - value > floor


def leads(row: Row, ours: dict[str, float]) -> list[str]:
    """Return the columns in which a row is ahead of figures of ours."""
    return [name for name, (_, floor) in COLUMNS.items() if is_led(row.figures[name], ours[name], floor)]


def words(rows: list[Row], all_ours: list[tuple[dict[str, object], dict[str, float]]]) -> Iterator[str]:
    """Yield where a peer's best is ahead of ours, and whether another setting of ours leaves it no column."""
    (ours,) = (row for row in rows if row.peer.name == OURS)
    behind, outside = [], []
    for row in rows:
        if row.peer.loop.package != "rmrc" and is_led(row.times[0], ours.times[0], 0.1):
            yield f"**{row.peer.name} takes {row.times[0]:.1f} µs a step (ours {ours.times[0]:.1f})**."
        ahead = leads(row, ours.figures)
        if row.peer.loop.package == "rmrc" or len(row.peer.settings) == 1 or not ahead:
            continue
        share = error_of(row.figures) / error_of(ours.figures)
        if row.figures["over"] > OUTSIDE > ours.figures["over"]:
            outside.append(f"{row.peer.name} ({row.figures['over']:.3g})")
            continue
        if share > FOLLOWS:
            behind.append(f"{row.peer.name} ({share:.1f})")
            continue
        shown = ", ".join(f"{name} {row.figures[name]:.3g} (ours {ours.figures[name]:.3g})" for name in ahead)
        text = f"**{row.peer.name} is ahead in {shown}**, with {share:.2f} times our error."
        setting, left = min(
            ((one, leads(row, found)) for one, found in all_ours), key=lambda pair: len(pair[1])
        )
        if left:
            lacks = f"the nearest, {told(setting)}, lacks {', '.join(left)}"
            yield f"{text} None of our settings is as good in all columns; {lacks}."
        else:
            yield f"{text} With {told(setting)} rmrc is as good in every column."
    if outside:
        yield f"Ahead in a column, but so far beyond a joint's limit [mrad or mm]: {', '.join(outside)}."
    if behind:
        yield f"Slower or smoother, but with so many times our error: {', '.join(behind)}."


def told(setting: dict[str, object]) -> str:
    """Return a setting in words."""
    texts = [
        f"{key} {value:g}"
        for key, value in setting.items()
        if isinstance(value, float) and key != "feedforward"
    ]
    more = setting.get("more") or {}
    return (
        ", ".join([*texts, *(f"{key.split('.')[-1]} {value}" for key, value in more.items())]) or "defaults"
    )


OURS = "rmrc, more methods"


def table(case: Case, keep: Keep) -> Iterator[str]:
    """Yield the lines of a case."""
    yield f"\n## {case.name[0].upper()}{case.name[1:]}\n\n{case.what}\n"
    names = ["", "setting", *COLUMNS, "µs min", "µs median"]
    yield "| " + " | ".join(names) + " |"
    yield "|" + "---|" * 2 + "---:|" * (len(names) - 2)
    rows, stopped = [], []
    for package, peer in peers():
        if not installed(package):
            continue
        row = row_of(case, peer, keep)
        if isinstance(row, str):
            stopped.append(f"{peer.name} stops: {row}.")
            continue
        rows.append(row)
        keep.save()
        figures = [
            f"{max(row.figures[name], 0.0):.3g}" if abs(row.figures[name]) > floor / 10 else "0"
            for name, (_, floor) in COLUMNS.items()
        ]
        over = "" if row.figures["rate over"] < 1e-3 else " (rates over their limits)"
        yield (
            f"| {peer.name}{over} | {told(row.setting)} | "
            + " | ".join([*figures, *(f"{t:.1f}" for t in row.times)])
            + " |"
        )
    keep.save()
    tried = [peer for _, peer in peers() if peer.loop is peer_loops.Rmrc]
    all_ours = [(one, keep.run(case, peer, one)) for peer in tried for one in peer.settings]
    said = list(words(rows, [pair for pair in all_ours if isinstance(pair[1], dict)]))
    yield "\n" + "\n".join(
        f"- {text}"
        for text in [*stopped, *said] or ["No peer's best is ahead of ours in any column by more than 2 %."]
    )


def versions() -> Iterator[str]:
    """Yield a line a package."""
    for package in dict.fromkeys(["mujoco", "numpy", "daqp", *(package for package, _ in peers())]):
        if installed(package):
            yield f"| {package} | {metadata.version(package)} |"
        else:
            yield f"| {package} | not installed: left out |"


def page(keep: Keep, only: list[str]) -> Iterator[str]:
    """Yield the page."""
    yield INTRODUCTION.format(
        settings=len(grid()), more=len(MORE) - 1, ours=len(grid()) * len(MORE), period=1e3 * PERIOD,
        gains=", ".join(f"{K:g}" for K in GAINS), dampings=", ".join(f"{d:g}" for d in DAMPINGS),
        floor=CHATTER_FLOOR,
    )  # fmt: skip
    yield "| package | version |\n|---|---|"
    yield from versions()
    yield f"| Python | {platform.python_version()} |"
    yield "\n| loop | statements of its user |\n|---|---:|"
    shown = [peer for package, peer in peers() if installed(package) and len(peer.settings) > 1]
    counts = {peer.name: lines_of(peer.loop) for peer in shown if peer.name != OURS}
    yield from (f"| {name} | {count} |" for name, count in counts.items())
    yield f"\nThe shortest is that of {min(counts, key=lambda name: counts[name])}."
    for case in cases():
        if not only or any(case.name.startswith(name) for name in only):
            yield from table(case, keep)


INTRODUCTION = """# Beside others

What rmrc does on the same arms and paths as others who resolve motion rates. This page is what a program
prints:

```sh
pip install -e '.[peers]'
python benchmarks/peers.py > docs/peers.md
```

**The same for everyone.** Our models of the arms, each without fingers, its base at the origin, without
weight and friction, with a stiff rate servo on each joint, in MuJoCo at {period:g} ms. A path is one screw,
there and back in 2 s each. At each tick a loop is told where the joints are, which pose is wanted now and
at the end of the period, and the mean twist until then; it returns joint rates. Loops without limits of
their own scale their rates down to the limits of the joints, in one line of their user's. There is no delay
and no noise here, so that gains win which no robot bears: [from simulation to your
robot](from_simulation_to_your_robot.md) says which one does.

**Settings.** "As documented" has the numbers of a library's own example. Each other row has the best of one
grid of {settings} settings for everyone: feedback K of {gains} /s and damping λ of {dampings} (λ² where a
library wants that, γ of J-PARSE; the Toolbox's pseudoinverse has none, and NEO keeps its own, as a step of
it takes so long). "rmrc, more methods" tries the same grid with {more} more ways of rmrc's, {ours} settings
in all. The best has the least error, a meter as bad as a radian; of settings within 2 % of it the one with
the least peak of acceleration. Settings that leave the limits, chatter or do not come back count only
where all do.

**Columns.** Peak of one joint's rate and root mean square of all joints' together, as commanded [rad/s or
m/s]; largest error of position [mm] and of orientation [mrad], and both at the end of the return leg; peak
and root mean square of the commands' acceleration [rad/s² or m/s²]; chatter, reversals of a joint's
acceleration beyond {floor:g} rad/s² [1/s]; how far a joint was beyond its position limit [mrad or mm]; time
of this thread for a step, kinematics included [µs]. What is smaller than its column's floor is 0. Where a
peer is ahead of "rmrc, more methods" by more than 2 % it is said below the table, with its error, and
whether a setting of ours is as good as it in every column.
"""


def main() -> None:
    """Print the page."""
    parser = argparse.ArgumentParser(description="rmrc beside others who resolve motion rates")
    parser.add_argument("--keep", type=Path, help="a JSON file of results: what it has does not run again")
    parser.add_argument("--only", action="append", default=[], help="cases whose names begin so")
    arguments = parser.parse_args()
    logging.disable(logging.WARNING)  # pink warns at each step that begins beyond a limit by rounding
    for line in page(Keep(arguments.keep), arguments.only):
        print(line, flush=True)


if __name__ == "__main__":
    main()
