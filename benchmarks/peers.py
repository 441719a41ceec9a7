"""rmrc beside others who resolve motion rates: mink, pink, the Robotics Toolbox, J-PARSE, loops in numpy.

    pip install -e '.[peers]'
    python benchmarks/peers.py

It writes every number to docs/peers.csv, and from that file the tables of docs/peers.md; `--page` writes the
tables alone. It prints the counts that the words of the page have. What is not installed is left out.
`peer_cases.py` has what is the same for everyone, `peer_loops.py` the lines that a user of each writes.
"""

import argparse
import csv
import functools
import itertools
import logging
import multiprocessing
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from importlib import util
from pathlib import Path
from typing import NamedTuple

import numpy as np
import peer_loops
from peer_cases import ROOT, Case, cases, drive, measure

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
# Columns of the file, each with a difference that is none.
COLUMNS = {
    "peak rate": 1e-3, "rms rate": 1e-3, "mm": 1e-3, "mrad": 1e-3, "end mm": 1e-3, "end mrad": 1e-3,
    "peak acc": 1e-1, "rms acc": 1e-2, "chatter": 0.5, "over": 1e-1,
}  # fmt: skip
HEADINGS = ("case", "row", "setting", *COLUMNS, "verdict")
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


class Row(NamedTuple):
    """What a table says of a peer."""

    peer: Peer
    setting: dict[str, object]
    figures: dict[str, float]


def is_led(value: float, ours: float, floor: float) -> bool:
    """Say whether a figure is better than ours by more than 2 %."""
    return ours > ALIKE * value and ours - value > floor


def leads(theirs: dict[str, float], ours: dict[str, float]) -> list[str]:
    """Return the columns in which figures are ahead of ours."""
    return [name for name, floor in COLUMNS.items() if is_led(theirs[name], ours[name], floor)]


def verdict(row: Row, ours: Row, tried: list[tuple[dict[str, object], dict[str, float]]]) -> str:
    """Return what is as good as a row of others in every column: our row, another setting, or none of ours.

    Of settings that a row is ahead of, the nearest counts: it lacks the fewest columns, and then the least.
    """

    def lack(figures: dict[str, float]) -> tuple[int, float]:
        ahead = leads(row.figures, figures)
        return len(ahead), max((figures[name] / max(row.figures[name], 1e-9) for name in ahead), default=0.0)

    if not leads(row.figures, ours.figures):
        return "our row"
    setting, figures = min([(ours.setting, ours.figures), *tried], key=lambda pair: lack(pair[1]))
    ahead = leads(row.figures, figures)
    return f"ahead: {', '.join(ahead)}{remarks(row, ours)}" if ahead else f"setting: {told(setting)}"


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


def rows_of(number: int) -> list[tuple[str, ...]]:
    """Return the rows of a case for the file, ours first."""
    case, rows, tried = cases()[number], list[Row](), []
    stopped = list[tuple[str, ...]]()
    for package, peer in peers():
        if not installed(package):
            continue
        results = [(setting, run(case, peer, setting)) for setting in peer.settings]
        ran = [(setting, figures) for setting, figures in results if isinstance(figures, dict)]
        if not ran:
            stopped.append((case.name, peer.name, *[""] * (1 + len(COLUMNS)), f"stops: {results[0][1]}"))
            continue
        rows.append(Row(peer, *ran[best([figures for _, figures in ran])]))
        if peer.name == OURS:
            tried = ran
    (ours,) = (row for row in rows if row.peer.name == OURS)
    return [line(case, row, "" if row.peer.is_ours else verdict(row, ours, tried)) for row in rows] + stopped


def line(case: Case, row: Row, verdict: str) -> tuple[str, ...]:
    """Return a row of the file; a value below its column's floor is 0."""
    figures = [
        f"{max(row.figures[name], 0.0):.3g}" if abs(row.figures[name]) > floor / 10 else "0"
        for name, floor in COLUMNS.items()
    ]
    over = "" if row.figures["rate over"] < 1e-3 else " (rates over their limits)"
    return case.name, row.peer.name + over, told(row.setting), *figures, verdict


# The page ---------------------------------------------------------------------------------------

CSV, PAGE = ROOT / "docs/peers.csv", ROOT / "docs/peers.md"
# The situations, by what the names of their cases begin with.
SITUATIONS = {
    "Far from any singularity": ("far",),
    "To 5 mm before full reach": ("reach -5",),
    "To 1 mm beyond reach": ("reach +1",),
    "Past a singularity at 1°": ("wrist 1°", "shoulder 1°"),
    "Past a singularity at 0.1°": ("wrist 0.1°", "shoulder 0.1°"),
    "Beyond a joint limit": ("joint limit", "boom limit"),
}
# Rows of the tables; the others are in the file alone.
SHOWN = ("rmrc, same grid", OURS, "numpy DLS", "mjctrl", "mink", "pink", "J-PARSE", "Toolbox", "NEO")


def follows(row: dict[str, str], ours: dict[str, str]) -> bool:
    """Say whether a row of the file follows, stays within the limits, and comes back."""
    errors = [np.hypot(float(one["mm"]), float(one["mrad"])) for one in (row, ours)]
    back = float(row["end mm"]) + float(row["end mrad"]) <= 1.0
    return bool(errors[0] <= FOLLOWS * errors[1]) and float(row["over"]) <= OUTSIDE and back


def counts(rows: list[dict[str, str]]) -> dict[str, dict[str, int]]:
    """Return how many rows of others our row, another setting and none of ours are as good as.

    Rows that do the task, as `follows` says, are counted apart from the others.
    """
    ours = {row["case"]: row for row in rows if row["row"] == OURS}
    found = {name: dict.fromkeys(("our row", "setting", "ahead"), 0) for name in ("task", "others")}
    for row in rows:
        if row["setting"] and row["verdict"]:
            does = "task" if follows(row, ours[row["case"]]) else "others"
            found[does][row["verdict"].partition(":")[0]] += 1
    return found


def cell(row: dict[str, str] | None) -> str:
    """Return the error and the peak rate of a row."""
    return f"{np.hypot(float(row['mm']), float(row['mrad'])):.3g}; {row['peak rate']}" if row else "stops"


def tables(rows: list[dict[str, str]]) -> str:
    """Return the tables of the page, from the rows of the file."""
    ran = [row for row in rows if row["setting"]]
    names, lines = list(dict.fromkeys(row["case"] for row in rows)), list[str]()
    found = {(row["row"].partition(" (")[0], row["case"]): row for row in ran}
    for title, begins in SITUATIONS.items():
        cases = [case for case in names if case.startswith(begins)]
        headings = [case if len(begins) > 1 else case.partition(", ")[2] for case in cases]
        lines += [f"## {title}", "", "| | " + " | ".join(headings) + " |", "|---|" + "---:|" * len(cases)]
        alike: dict[str, list[str]] = {}
        for name in SHOWN:
            cells = " | ".join(cell(found.get((name, case))) for case in cases)
            alike.setdefault(cells, []).append(name)
        lines += [f"| {'; '.join(libraries)} | {cells} |" for cells, libraries in alike.items()] + [""]
    return "\n".join(lines)


def main() -> None:
    """Run everything and write the file, or write the tables alone."""
    parser = argparse.ArgumentParser(description="rmrc beside others who resolve motion rates")
    parser.add_argument("--page", action="store_true", help="write the tables from the file that is there")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--out", type=Path, default=ROOT / "docs", help="folder of peers.csv and peers.md")
    arguments = parser.parse_args()
    file = arguments.out / CSV.name
    if not arguments.page:
        with ProcessPoolExecutor(arguments.jobs, multiprocessing.get_context("spawn")) as pool:
            found = [row for rows in pool.map(rows_of, range(len(cases()))) for row in rows]
        with file.open("w", encoding="utf-8", newline="") as opened:
            csv.writer(opened, lineterminator="\n").writerows([HEADINGS, *found])
    with file.open(encoding="utf-8", newline="") as opened:
        rows = list(csv.DictReader(opened))
    words, _, _ = PAGE.read_text("utf-8").partition(f"## {next(iter(SITUATIONS))}\n")
    (arguments.out / PAGE.name).write_text(words + tables(rows), "utf-8")
    print(counts(rows))


if __name__ == "__main__":
    main()
