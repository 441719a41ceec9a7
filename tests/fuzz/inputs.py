"""Hostile inputs: models, scenarios, options and numbers, each made from a class and an index alone."""

import json
import random
import re
import xml.etree.ElementTree as ET
from functools import cache
from typing import NamedTuple

import yaml
from typer.main import get_command

from project import ROOT
from rmrc.cli import app
from rmrc.scenario.choices import INVERSES, LIMITS, OBJECTIVES, PLANTS, POLICIES, SCHEDULES

COMMANDS = get_command(app).commands
MODEL, SCENARIO = "models/fuzz.xml", "scenarios/fuzz.yaml"
REGRESSIONS = sorted((ROOT / "tests/fuzz/regressions").glob("*.json"))

# Texts that some reader takes for a number, or nearly so.
NUMBERS = (
    "0", "-0.0", "1", "-1", "2", "0.5", "5e-324", "1e-300", "1e-12", "1e-6", "1000", "1e9", "1e100", "1e154", "1e300",
    "1.7976931348623157e308", "1e309", "-1e300", "nan", "inf", "-inf", ".nan", "-.inf", "2147483648", "-2147483649",
    "9223372036854775808", "9" * 400, "0x1F", "1_000", "1e", "--1", "1,5", "010", "\u0663", "1e999 deg", "90deg", "true",
)  # fmt: skip
# Names that a terminal, a markup language, a file system or a parser may take for more than a name.
NAMES = (
    "", " ", "\x1b[31mred\x1b[0m", "\x1b]0;title\x07", "a\nb", "a\rb", "\x9b31m", "\x85", "\x7f", "\u202eevil", "\u2028", "\ufeff",
    "[red]x[/red]", "[/]", "[[", "{0}", "%s%n", "a.b", "..", "/", "a\\b", "'\"", "<&>", "e\u0301", "\U0001f600", "-x", "--help",
)  # fmt: skip
BYTES = (
    b"\0", b"\xff\xfe", b"\xef\xbb\xbf", b"\xed\xa0\x80", b"\x1b[2J", b"\x9b", b"\r", b"\t", b"&#0;", b"&#27;", b"-->", b"<!--",
    b"<!DOCTYPE x>", b"\xf0\x9f\x98\x80", b"nan", b"1e999", b"{", b"}", b"[", b"]", b"'", b'"', b": ", b"- ", b"<", b"/>", b"&", b"*a",
)  # fmt: skip
SCALARS = (
    "~", "yes", "017", "0x1F", "1:30", "2026-01-01", ".nan", ".inf", "1e3", "''", r'"\0"', r'"\x1b[31m"', r'"\ud800"', "!!float x",
    "!!binary aGk=", "!!python/object/apply:os.system [id]", "|", "*a", "&a 1", "{}", "[]", "[[]]", "{a: 1, a: 2}", "[1, 2, 3]", "[~]",
    "60 deg", "1e999 deg", "60 degrees", "1e+308", "1e-320", "9" * 400, "[/]", "<<", "%", "@", "home", "x", "[rz, x]", "\u0663",
    "../models", "/dev/null", "..", "a" * 3000,
)  # fmt: skip
ELEMENTS = (
    ("mujoco", '<include file="fuzz.xml"/>'), ("mujoco", '<size nuserdata="1000000000"/>'),
    ("body", '<replicate count="100000" offset="0 0 1"><body><joint/><geom size="0.1"/></body></replicate>'),
    ("body", '<frame pos="nan 0 0"><site name="framed"/></frame>'), ("body", "<freejoint/>"), ("body", '<joint type="ball"/>'),
    ("body", '<inertial mass="nan" pos="0 0 0"/>'), ("body", '<geom size="1e308" mass="1"/>'),
    ("equality", '<joint joint1="JOINT" polycoef="0 nan 0 0 0"/>'), ("equality", '<joint joint1="JOINT" joint2="OTHER"/>'),
    ("equality", '<joint joint1="JOINT" joint2="OTHER" polycoef="1e300 1 1 1 1"/>'), ("equality", '<weld body1="BODY" body2="world"/>'),
    ("actuator", '<position joint="JOINT" kp="nan"/>'), ("actuator", '<velocity joint="JOINT" kv="1e300" ctrlrange="-1 1"/>'),
    ("keyframe", '<key name="home" qpos="nan"/>'), ("keyframe", '<key name="more" qpos="1 2 3 4 5 6 7 8 9"/>'),
    ("contact", '<exclude body1="BODY" body2="BODY"/>'), ("asset", '<hfield name="h" nrow="100000" ncol="100000" size="1 1 1 1"/>'),
    ("asset", '<texture name="t" type="2d" builtin="flat" width="100000" height="100000"/>'), ("sensor", '<user dim="100000000"/>'),
)  # fmt: skip
# Choices of a scenario that are right.
RIGHT = {
    "control.inverse.method": INVERSES.names,
    "control.inverse.damping": [{"schedule": name} for name in SCHEDULES.names],
    "control.nullspace": [{"objective": name} for name in OBJECTIVES.names],
    "control.limits": [{"on_excess": name, "rate": 1.0} for name in LIMITS.names],
    "control.at_singularity": POLICIES.names,
    "task.axes": (["x"], ["y", "x"], ["x", "y", "z"], ["rz"], ["x", "y", "z", "rx", "ry", "rz"]),
    "task.frame": ("world", "base", "site"),
    "arm.pose": ({"position": [0.5, 0.3]}, {"position": [9.0, 9.0, 9.0]}, {"orientation": ["180 deg", 0, 0]}),
    "plant": [{"kind": name} for name in PLANTS.names],
    "target.path": (
        [{"line": {"by": [0.1, 0.0, 0.1]}}], [{"arc": {"center": [0.1, 0.1], "angle": "360 deg"}}], [{"configurations": ["home"]}],
        [{"set": {"by": [0.01, 0.0], "for": 0.05}}], [{"file": {"path": "recorded_motion.csv", "columns": "q"}}], [{"hold": {"for": 0.001}}],
    ),
}  # fmt: skip
# Keys that take any positive number. Those for which a run is merely long are not among them.
POSITIVE = (
    "task.length", "control.inverse.cutoff", "control.inverse.rate_bound", "control.inverse.damping.maximum", "control.inverse.damping.below",
    "control.feedback", "control.nullspace.gain", "control.limits.rate", "control.limits.acceleration", "control.limits.jerk",
    "control.limits.braking", "control.slow.change", "control.stop.sigma", "plant.kv", "plant.bandwidth", "plant.payload", "arm.encoder.offset",
)  # fmt: skip
# Instead of thousands of ticks, dozens: the path as it is, but fast.
FAST = tuple(
    part
    for name, value in (("velocity", "30"), ("acceleration", "1.0e+4"), ("jerk", "1.0e+8"))
    for key in (name, f"angular_{name}")
    for part in ("--set", f"target.limits.{key}={value}")
)
# Values of options by name: right ones, and such as keep a command short or within its folder.
VALUES = {
    "q": ("0.1,0.2,0.3,0.1,0.2,0.3", "0,0", "home"), "to_q": ("0.3,0.3", "0.3,0.3,0.3"), "to": ("0.5,0.5", "0.3,0.1,0.5", "9,9,9"),
    "wrench": ("1,2,3", "1,2,3,4,5,6"), "keyframe": ("home",), "site": ("tip",), "body": ("link_2",), "axes": ("x,y", "x,y,z", "rz"),
    "frame": ("world", "base", "site"), "task_frame": ("world", "base", "site"), "method": ("damped", "newton"), "hold": ("0.3",),
    "set_": ("control.feedback=1", "task.axes=[x]", "plant.kind=servo", "arm.start[9]=1", "control..feedback=1", "=", "a["),
    "vary": ("control.feedback=1,2", "plant.kind=ideal,servo", "control.feedback=", "x=1"), "only": ("control.feedback=20", "x=1", "="),
    "random": ("control.feedback=1..2", "x=1..2", ".."), "sobol": ("control.feedback=1..2", "control.feedback=2"),
    "plane": ("xy", "rz"), "map_": ("sigma_min", "condition"), "delay": ("8ms", "6ms..12ms", ".."), "plant": PLANTS.names,
    "samples": ("2", "1000", "0", "x"), "repeat": ("2", "0", "x"), "runs": ("10", "0", "x"), "perturbed": ("0", "1", "x"), "copies": ("1", "x"),
    "cells": ("10", "0", "x"), "accuracy": ("0.5", "0", "x"), "size": ("64x64", "0x0", "x", "-1x64"), "fps": ("5", "0", "x"),
    "out": ("there", "a/b", "file", "file/below", "/dev/full", "/proc/nothing", "x" * 300, "\x1b[31m", "\udcff"),
    "output": ("a.png", "a.svg", "a.jpg", "", "none/a.png"), "junit": ("a.xml", "", "/dev/full"), "summary": ("a.md", "", "/dev/full"),
    "copy": ("there", "a/b", "", "file", "/proc/nothing", "\x1b[31m"),
}  # fmt: skip
# Verbs and options that would open a viewer, a port, or other processes; and one that compiles for half a minute.
CLOSED = ("replay", "cluster", "threads", "package", "export")


class Case(NamedTuple):
    """An input.

    Attributes:
        argv: What is typed after `rmrc`, in a folder beside copies of `models` and `scenarios`.
        files: Contents of more files by path from the folder above; a path that ends in a slash is a folder.
        encoding: Of stdout and stderr.
        columns: Width of the terminal.
    """

    argv: tuple[str, ...]
    files: dict[str, bytes] = {}  # noqa: RUF012 - no one changes it
    encoding: str = "utf-8"
    columns: str = "80"

    def text(self, **about):
        """Return the input as JSON."""
        files = {path: data.decode("utf-8", "surrogateescape") for path, data in self.files.items()}
        return json.dumps({**about, **self._asdict(), "files": files}, indent=1) + "\n"


def read(text):
    """Return the input of `Case.text`."""
    facts = json.loads(text)
    files = {path: data.encode("utf-8", "surrogateescape") for path, data in facts.pop("files").items()}
    return Case(tuple(facts.pop("argv")), files, **{key: facts[key] for key in Case._fields if key in facts})


def case(name, index):
    """Return the input of a class and an index, always the same; of class "file", the one at a path."""
    if name == "file":
        with open(index, encoding="utf-8") as file:
            return read(file.read())
    return CLASSES[name](random.Random(f"{name}:{index}"))


@cache
def shipped(pattern):
    """Return the names and texts of shipped files."""
    return [(path.stem, path.read_text("utf-8")) for path in sorted(ROOT.glob(pattern))]


def word(rng):
    """Return a number, a name or noise."""
    noise = "".join(chr(rng.randrange(1, 0x250)) for _ in range(rng.randrange(12)))
    return rng.choice((rng.choice(NUMBERS), rng.choice(NAMES), noise))


def spoiled(rng, data):
    """Return bytes of which some are lost, repeated, moved or replaced."""
    for _ in range(rng.randint(1, 3)):
        start = rng.randrange(len(data) + 1)
        end = start + rng.randrange(20)
        middle = rng.choice((b"", rng.choice(BYTES), 2 * data[start:end], data[end:][:40] + data[start:end]))
        data = data[:start] + middle + rng.choice((data[end:], data[end:], data[end:], b""))
    return data


def models(rng):
    """Return a shipped model with faults, and a question about it or a run of it."""
    root = ET.fromstring(rng.choice(shipped("models/*.xml"))[1])
    for _ in range(rng.choice((1, 1, 1, 2, 2, 3, 6))):
        _change(rng, root)
    data = ET.tostring(root).replace(b"\x1b", b"&#27;")
    data = spoiled(rng, data) if rng.random() < 0.15 else data
    verb, *options = rng.choice(
        (
            *(("inspect",), ("inspect", "--json"), ("run", "--no-record")) * 3,
            ("statics", "--wrench", "1,2,3"), ("ik", "--to", "0.5,0.5", "--json"), ("ik", "--to-q", "0.3,0.3", "--all"),
            ("check", "--json"), ("new", "--json", "--force"), ("sweep", "--threads", "1", "--vary", "control.feedback=1,2"),
        )
    )  # fmt: skip
    if verb not in ("run", "sweep"):
        return Case((verb, f"../{MODEL}", *options), {MODEL: data})
    site = next((element.get("name") for element in root.iter("site")), "tip")
    scenario = (
        f"name: fuzz\narm: {{model: ../{MODEL}, site: {site}}}\ncontrol: {{period: 0.002, limits: {{rate: 3.0}}}}\n"
        "target: {path: [{line: {by: [0.001, 0, 0.001]}}, {hold: {for: 0.005}}]}\n"
        f"plant: {{kind: {rng.choice(PLANTS.names)}}}\n"
    )
    return Case((verb, f"../{SCENARIO}", *options), {MODEL: data, SCENARIO: scenario.encode()})


def _change(rng, root):
    """Change a value, an attribute or an element of a model."""
    elements = list(root.iter())
    element = rng.choice([element for element in elements if element.attrib])
    key = rng.choice(sorted(element.attrib))
    parent, child = rng.choice([(parent, child) for parent in elements for child in parent])
    match rng.randrange(-8, 10):
        case rank if rank < 3:  # another arm, and most often no worse than the one before
            factor = rng.choice((0.5, 0.9, 1.1, 2.0) * 3 + (-1.0, 0.0, 1e9, 1e300))
            scaled = lambda number: repr(float(number[0]) * factor)  # noqa: E731
            element.set(key, re.sub(r"(?<![\w.])-?\d+\.?\d*(?![\w.])", scaled, element.get(key)))
        case 3 | 4:
            element.set(key, word(rng).translate(dict.fromkeys(set(range(32)) - {27})))
        case 5:
            del element.attrib[key]
        case 6:
            element.set("name", rng.choice(NAMES[2:10]).translate(dict.fromkeys(set(range(32)) - {27})))
        case 7:
            parent.remove(child)
            parent.extend([child] * rng.choice((0, 2, 40)))
        case _:
            _add(rng, root)


def _add(rng, root):
    """Add an element to the section that it belongs to, or to a body."""
    section, text = rng.choice(ELEMENTS)
    for placeholder, tag in (("JOINT", "joint"), ("OTHER", "joint"), ("BODY", "body")):
        names = [element.get("name", "none") for element in root.iter(tag)]
        text = text.replace(placeholder, rng.choice(names or ["none"]))
    places = [root] if section == "mujoco" else list(root.iter(section)) or [ET.SubElement(root, section)]
    try:
        rng.choice(places).append(ET.fromstring(text))
    except ET.ParseError:  # a name that was changed before
        return


def scenarios(rng):
    """Return a shipped scenario with other values, other words or spoiled bytes, run by a verb."""
    text = rng.choice(shipped("scenarios/*.yaml"))[1]
    tree = yaml.safe_load(text)
    for _ in range(rng.randrange(4)):
        key, values = rng.choice(list(RIGHT.items()))
        section, _, name = key.partition(".")
        *inner, name = name.split(".")
        place = tree.setdefault(section, {})
        for step in inner:
            place = place[step] if isinstance(place.get(step), dict) else place.setdefault(step, {})
        place[name] = rng.choice(values)
    text = yaml.safe_dump(tree, sort_keys=False) if rng.random() < 0.8 else text
    for _ in range(rng.choice((0, 0, 1, 1, 2, 4))):
        words = list(re.finditer(r"[^\s,:\[\]{}]+|[,:\[\]{}]|\n *", text))
        start, end = rng.choice(words).span()
        other = rng.choice((rng.choice(SCALARS), rng.choice(NUMBERS), rng.choice(words)[0], ""))
        text = text[:start] + other + text[end:]
    data = text.encode("utf-8", "surrogatepass")
    data = spoiled(rng, data) if rng.random() < 0.1 else data
    verb = rng.choices(
        (
            ("run", "--no-record"), ("run",), ("compare", "--no-record", "--vary", "control.feedback=1,2"),
            ("sweep", "--threads", "1", "--samples", "2", "--repeat", "1"), ("tune", "--runs", "10", "--perturbed", "0", "--threads", "1"),
        ),
        (84, 4, 4, 6, 1),
    )[0]  # fmt: skip
    return Case((*verb, f"../{SCENARIO}", *FAST), {SCENARIO: data})


def options(rng):
    """Return a verb and its declared options, right and wrong, on shipped files or what is none."""
    verb = rng.choice([name for name in COMMANDS if name not in CLOSED])
    parameters = COMMANDS[verb].params
    names = {parameter.name for parameter in parameters}
    wrong = rng.random() < 0.5
    argv, files = [verb], {"here/file": b"x", "here/log.csv": _log(rng)}
    for parameter in parameters:
        values = VALUES.get(parameter.name, ("1", "0.1", "7"))
        value = rng.choice(values) if parameter.name in VALUES or not wrong else word(rng)
        if parameter.param_type_name == "argument":
            argv.append(_argument(rng, parameter.name) if not wrong or rng.random() < 0.9 else word(rng))
        elif parameter.name not in (*CLOSED, "help") and rng.random() < 0.25:
            argv += [rng.choice(parameter.opts), *([] if parameter.is_flag else [value])]
    short = {"threads": "1", "runs": "10", "samples": "1000" if verb == "workspace" else "2", "cells": "10"}
    for name, value in short.items():
        if name in names and f"--{name}" not in argv:
            argv += [f"--{name}", value]
    argv += FAST if "set_" in names and verb not in ("plot", "report", "render") else ()
    if wrong and rng.random() < 0.3:
        odd = rng.choice(("--", "--help", "--nonsense", "", "--json", "--=", word(rng)))
        argv.insert(rng.randrange(len(argv) + 1), odd)
    typed = (text.replace("\0", "").encode("utf-8", "surrogatepass") for text in argv)
    argv = tuple(data.decode("utf-8", "surrogateescape") for data in typed)
    columns = rng.choice(("1", "0", "200", "x", *["80"] * 20))
    return Case(argv, files, rng.choice(("ascii", "utf-16", *["utf-8"] * 20)), columns)


def _argument(rng, name):
    """Return the file or folder that a verb is about."""
    if name == "log":
        return rng.choice(("log.csv", "log.csv", "none.csv", "file"))
    if name in ("model", "scenario"):
        suffix = {"model": "xml", "scenario": "yaml"}[name]
        return f"../{name}s/{rng.choice(shipped(f'{name}s/*.{suffix}'))[0]}.{suffix}"
    return rng.choice(("file", "none.npz", "../scenarios/null_space.yaml", "/dev/null", "."))


def _log(rng):
    """Return a log of commands and positions, with a cell or two that are odd."""
    rows = [f"{0.01 * i:.2f},{i % 17 * 0.1:.1f},{i % 5 * 0.1:.1f}" for i in range(rng.choice((0, 2, 200)))]
    for _ in range(rng.randrange(3)):
        rows.insert(rng.randrange(len(rows) + 1), f"{rng.choice(NUMBERS)},{word(rng)},")
    return "\n".join(["t,q,qdot_cmd", *rows]).encode("utf-8", "surrogatepass")


def numbers(rng):
    """Return a shipped scenario with extreme numbers, all of them allowed."""
    argv = [rng.choice(("run", "run", "run", "compare")), "--no-record"]
    argv += ["--vary", "control.feedback=0,1"] if argv[0] == "compare" else []
    argv += [f"../scenarios/{rng.choice(shipped('scenarios/*.yaml'))[0]}.yaml", *FAST]
    for _ in range(rng.choice((1, 2, 4, 8))):
        most = rng.choice((3, 6, 16, 307))
        argv += ["--set", f"{rng.choice(POSITIVE)}={rng.uniform(1, 10):.3f}e{rng.randint(-most, most):+d}"]
    if rng.random() < 0.2:
        plane = ", ".join(f"{rng.uniform(-1, 1):.3f}e{rng.randint(-300, 300):+d}" for _ in range(2))
        argv += ["--set", f"target.path=[{{line: {{by: [{plane}]}}}}]"]
    return Case((*argv, "--set", f"plant.kind={rng.choice(PLANTS.names)}"))


CLASSES = {"models": models, "scenarios": scenarios, "options": options, "numbers": numbers}
