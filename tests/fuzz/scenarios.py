"""Scenario texts: shipped ones with keys, values, structure and bytes changed."""

import json
import re

import yaml

from rmrc.scenario.choices import INVERSES, LIMITS, OBJECTIVES, PLANTS, POLICIES, SCHEDULES

from . import shipped
from .case import Case

PATH = "scenarios/fuzz.yaml"

# Instead of thousands of ticks, dozens: the path as it is, but fast.
FAST = (
    "--set",
    "target.limits={velocity: 30, acceleration: 1.0e+4, jerk: 1.0e+8, "
    "angular_velocity: 30, angular_acceleration: 1.0e+4, angular_jerk: 1.0e+8}",
)

SCALARS = (
    "~", "null", "yes", "no", "on", "true", "True", "0o17", "017", "0x1F", "1:30", "2026-01-01", ".nan", ".inf", "-.INF", "1e3",
    "1e+3", "1_000", "''", '""', r'"\0"', r'"\x1b[31m"', r'"\ud800"', r'"\u202e"', r'"\x9b"', '"a\\tb"', "!!float x", "!!int 3",
    "!!binary aGk=", "!!set {a}", "!!python/object/apply:os.system [id]", "!x y", "|", ">", "*a", "&a", "&a 1", "?", "-", "{}", "[]",
    "[[]]", "{a: }", "{a: 1, a: 2}", "[1, 2, 3]", "[1, 2]", "[0, 0, 0]", "[~]", '"60 deg"', "60 deg", "1e999 deg", "nan deg", "60 degrees",
    "-0.0", "0", "-1", "1", "2", "1.5", "1e+308", "-1e+308", "1e-320", "1e+400", "9" * 400, "[red]x[/red]", "[/]", "=", "<<", "%", "@", "`",
    "home", "tip", "damped", "inverse", "x", "[x]", "[x, x]", "[rz, x]", "slow", "stop", "servo", "torque", "model", "redistribute", "\u0663", "\u00bd",
    "\ud55c", "{line: {by: [1, 0]}}", "[{hold: {for: 0.01}}]", "../models/fuzz.xml", "../models", "/dev/null", "/dev/zero", "..", "a" * 3000,
)  # fmt: skip

KEYS = (
    "name", "arm", "model", "site", "start", "joints", "encoder", "offset", "deviation", "seed", "stretch", "task", "axes", "length",
    "weights", "control", "period", "inverse", "method", "tolerance", "cutoff", "gamma", "rate_bound", "damping", "schedule",
    "maximum", "below", "manipulability_below", "error_gain", "feedback", "feedforward", "joint_weights", "nullspace", "objective",
    "gain", "posture", "rates", "secondary", "to", "priority", "limits", "rate", "acceleration", "position", "braking", "on_excess",
    "at_singularity", "slow", "change", "patience", "longest", "stop", "sigma", "condition", "target", "path", "line", "by", "turn",
    "axis", "angle", "arc", "center", "hold", "for", "velocity", "jerk", "angular_velocity", "plant", "kind", "kv", "bandwidth",
    "timestep", "gravity_compensation", "payload", "gravity", "wrench", "expect", "above", "equals", "within", "sweep", "vary", "draw",
    "frame", "tilt", "set", "configurations", "file", "columns", "from", "speed", "pose", "orientation", "body", "tool", "rpy", "quat", "mass",
    "inertia", "base", "others", "packages", "friction_compensation", "sampler", "samples", "repeat", "<<", "", "?", "1", "null", "[x]", "\x1b[31m", "[red]", "a.b", "joint_rate.peak", "__class__",
)  # fmt: skip


def generate(chance):
    """Return a case: a scenario with something wrong with it, run one way or another."""
    name = chance.pick(list(shipped.scenarios()))
    text = shipped.scenarios()[name]
    kind = chance.weighted({"lines": 25, "words": 30, "structure": 35, "bytes": 8, "monster": 4})
    if kind == "structure":
        text = _structured(chance, yaml.safe_load(text))
    elif kind == "monster":
        text = _monster(chance, text)
    else:
        text = re.sub(r"(?m)^ *#.*\n", "", text) if chance.odds(0.8) else text
        change = {"lines": _change_line, "words": _change_word, "bytes": lambda _, same: same}[kind]
        for _ in range(chance.weighted({1: 6, 2: 3, 4: 1})):
            text = change(chance, text)
    data = text.encode("utf-8", "surrogatepass")
    if kind == "bytes":
        data = chance.scratch(data)
    fast = FAST if chance.odds(0.9) else ()
    verb = chance.weighted({"run": 84, "recorded": 4, "compare": 3, "sweep": 6, "tune": 1.5})
    argv = {
        "run": ("run", "--no-record", *chance.pick(((), ("-q",)))),
        "recorded": ("run",),
        "compare": ("compare", "--no-record", "--vary", "control.feedback=1,2"),
        "sweep": ("sweep", "--threads", "1", "--samples", "2", "--repeat", "1"),
        "tune": ("tune", "--runs", "3", "--perturbed", "0", "--threads", "1"),
    }[verb]
    return Case((*argv, f"../{PATH}", *fast), {PATH: data})


def _change_line(chance, text):
    """Drop, repeat, move, indent or cut a line, or add one."""
    lines = text.splitlines(keepends=True) or ["\n"]
    at = chance.under(len(lines))
    match chance.under(8):
        case 0 | 1:
            del lines[at]
        case 2:
            lines.insert(at, lines[at])
        case 3:
            lines.insert(chance.under(len(lines)), lines.pop(at))
        case 4:
            lines[at] = " " * chance.between(1, 3) + lines[at]
        case 5:
            lines[at] = lines[at].lstrip(" ")
        case 6:
            lines[at] = lines[at][: chance.under(len(lines[at]) + 1)]
        case _:
            lines.insert(at, f"{' ' * chance.under(5)}{chance.pick(KEYS)}: {chance.pick(SCALARS)}\n")
    return "".join(lines)


def _change_word(chance, text):
    """Put something else for a word: a key, a number, a bracket."""
    words = list(re.finditer(r"[^\s,:\[\]{}]+|[,:\[\]{}]", text))
    if not words:
        return chance.pick(SCALARS)
    word = chance.pick(words)
    kind = chance.under(7)
    if kind < 3:
        new = chance.pick(SCALARS)
    elif kind == 3:
        new = chance.number()
    elif kind == 4:
        new = chance.pick(KEYS)
    elif kind == 5:
        new = chance.pick(words)[0]
    else:
        new = chance.pick(
            (
                "",
                word[0] + word[0][-1],
                word[0].upper(),
                word[0][:-1],
                f"&a {word[0]}",
                "*a",
                f"!!str {word[0]}",
                json.dumps(word[0]),
            )
        )
    return text[: word.start()] + new + text[word.end() :]


def _structured(chance, tree):
    """Change the values of a scenario, and write them in YAML's own brackets."""
    if chance.odds(0.6):  # another scenario, and most often a right one
        for _ in range(chance.between(1, 4)):
            _choose(chance, tree)
    for _ in range(chance.weighted({0: 5, 1: 6, 2: 3, 5: 1})):
        tree = _mutated(chance, tree)
    if isinstance(tree, dict) and chance.odds(0.9):
        return "".join(f"{_written(chance, key)}: {_written(chance, value)}\n" for key, value in tree.items())
    return _written(chance, tree)


# Values that are right, by key.
RIGHT = {
    "control.inverse.method": INVERSES.names,
    "control.inverse.damping": [{"schedule": name} for name in SCHEDULES.names if name != SCHEDULES.default],
    "control.nullspace": [{"objective": name} for name in OBJECTIVES.names if name not in ("none", "rates")],
    "control.limits": [*({"on_excess": name, "rate": 1.0} for name in LIMITS.names), {"acceleration": 5.0}, {"rate": 0.1}],
    "control.at_singularity": POLICIES.names,
    "control.feedback": (0.0, 5.0, 500.0),
    "control.period": (0.002, 0.01, 0.05),
    "control.feedforward": (False,),
    "task.axes": (["x"], ["x", "y"], ["y", "x"], ["x", "y", "z"], ["rz"], ["x", "y", "rz"], ["rx", "ry", "rz"], ["x", "y", "z", "rx", "ry", "rz"]),
    "task.length": (0.1, 10.0),
    "task.frame": ("world", "base", "site"),
    "target.frame": ("world", "base", "site", "start"),
    "target.offset": ([0.01, 0.0], [0.0, 0.0, -0.1]),
    "arm.encoder": ({"offset": 0.01}, {"deviation": "1 deg", "seed": 3}),
    "arm.start": ("home",),
    "arm.pose": (
        {"position": [0.5, 0.3]}, {"position": [0.4, 0.1, 0.5], "orientation": ["180 deg", 0, 0]}, {"orientation": [1, 0, 0, 0.1]},
        {"position": [0.3, 0.0, 0.2], "frame": "base"}, {"position": [9.0, 9.0, 9.0]},
    ),
    "arm.site": (None,),
    "arm.body": ("link_2", "link_6", "link1"),
    "arm.tool": (
        {"position": [0.1, 0.0, 0.0]}, {"body": "link_2", "mass": 0.5, "center": [0.0, 0.1, 0.0]}, {"rpy": [0, "90 deg", 0]},
        {"quat": [1, 1, 0, 0], "mass": 1.0, "inertia": [0.1, 0.1, 0.1]}, {"model": "../models/torus_3r.xml"},
    ),
    "arm.base": ("fixed", "free"),
    "arm.others": ("hold", "free"),
    "arm.packages": ({}, {"a": "."}, {"a": "../models"}),
    "plant.friction_compensation": (True, False),
    "plant": (*({"kind": name} for name in PLANTS.names), {"kind": "servo", "payload": 2.0, "gravity": [0.0, -9.81, 0.0]}),
    "plant.wrench": ([10.0, 0.0, -10.0, 0.0, 1.0, 0.0],),
    "target.path": (
        [{"line": {"by": [0.1, 0.0, 0.1]}}, {"line": {"by": [-0.1, 0.0]}}],
        [{"arc": {"center": [0.1, 0.1], "angle": "360 deg"}}],
        [{"turn": {"axis": "z", "angle": "90 deg"}}, {"hold": {"for": 0.05}}],
        [{"line": {"to": [9.0, 9.0], "turn": {"to": [0.0, 1.0, 0.0, 0.0]}}}],
        [{"hold": {"for": 0.001}}],
        [{"line": {"by": [0.05, 0.0, 0.05], "frame": "site", "tilt": {"to": "z"}}}, {"tilt": {"axis": "x", "to": [0, 1, 0], "frame": "base"}}],
        [{"set": {"by": [0.01, 0.0], "for": 0.05}}, {"set": {"turn": {"axis": "z", "angle": 0.1}, "for": 0.02}}],
        [{"configurations": ["home", [0.1, 0.2]]}], [{"configurations": ["home"]}, {"hold": {"for": 0.02}}],
        [{"file": {"path": "recorded_motion.csv", "from": "start", "speed": "auto"}}], [{"file": {"path": "recorded_motion.csv", "columns": "q"}}],
    ),
    "expect": ({}, {"sigma.min": {"above": 0.0}}, {"position_error.max": {"below": 0.001}}),
}  # fmt: skip


def _choose(chance, tree):
    """Set a key of a scenario to a value that may well be meant."""
    key = chance.pick(list(RIGHT))
    *sections, last = key.split(".")
    for section in sections:
        tree = tree.setdefault(section, {})
        if not isinstance(tree, dict):
            return
    tree[last] = chance.pick(RIGHT[key])


class Raw(str):
    """A text that is written as it is."""


def _mutated(chance, tree):
    """Return a tree with one value, key or item of it changed."""
    if isinstance(tree, dict) and tree and chance.odds(0.85):
        return _mutated_mapping(chance, tree)
    if isinstance(tree, list) and tree and chance.odds(0.85):
        return _mutated_list(chance, tree)
    kind = chance.under(10)
    if kind < 5:
        return Raw(chance.pick(SCALARS))
    if kind == 5:
        return Raw(chance.decimal(negative=0.3))
    if kind == 6:
        return [tree] * chance.between(1, 4)
    if kind == 7:
        return {Raw(chance.pick(KEYS)): tree}
    return Raw(json.dumps(chance.word()))


def _mutated_mapping(chance, tree):
    key, other = chance.pick(list(tree)), Raw(chance.pick(KEYS))
    match chance.under(12):
        case 0:
            return {one: value for one, value in tree.items() if one != key}
        case 1:
            return {other if one == key else one: value for one, value in tree.items()}
        case 2:
            return {**tree, Raw(f"{key} "): Raw(chance.pick(SCALARS))}  # given twice
        case 3:
            return {**tree, other: Raw(chance.pick(SCALARS))}
        case 4:
            return {**tree, other: tree[key]}
        case _:
            return {**tree, key: _mutated(chance, tree[key])}


def _mutated_list(chance, tree):
    at = chance.under(len(tree))
    match chance.under(8):
        case 0:
            return tree[:at] + tree[at + 1 :]
        case 1:
            return tree[:at] + [tree[at]] * chance.pick((2, 2, 3, 30)) + tree[at:]
        case 2:
            return [*tree, Raw(chance.pick(SCALARS))]
        case 3:
            return [tree]
        case _:
            return [*tree[:at], _mutated(chance, tree[at]), *tree[at + 1 :]]


def _written(chance, value):
    if isinstance(value, Raw):
        return str(value)
    if isinstance(value, dict):
        return (
            "{"
            + ", ".join(f"{_written(chance, key)}: {_written(chance, inner)}" for key, inner in value.items())
            + "}"
        )
    if isinstance(value, list):
        return "[" + ", ".join(_written(chance, inner) for inner in value) + "]"
    return json.dumps(value)


def _monster(chance, text):
    """Return a text that is small but grows, deep, long, or no scenario at all."""
    count = chance.pick((60, 1000, 20_000, 300_000))
    many = "".join(f"&a{i} [{f'*a{i - 1}, ' * 9}]\n- " for i in range(1, 12))
    return chance.pick(
        (
            f"{text}\nx: {'[' * count}{']' * count}\n", f"{text}\n{'{a: ' * count}", f"- &a0 [x]\n- {many}x\n", f"&a [*a]\n{text}", "&a {a: *a}\n",
            f"{text}\nexpect: {{{', '.join(f'joint_rate.peak{i}: {{below: 1}}' for i in range(min(count, 5000)))}}}\n", f"x: {'a' * count}\n", "# " * count,
            f"{text}---\n{text}", f"%YAML 9.9\n---\n{text}", f"%TAG ! x\n---\n{text}", f"\ufeff{text}", text.replace("\n", "\r\n"), text.replace("\n", "\r"),
            text.replace(" ", "\t"), text.replace(" ", "\u00a0"), "", "\n", "# nothing\n", "~", "[]", "{}", "1", "'", "x", "\x1b[2J", "? a\n: b\n", "? [a]\n: b\n",
            f"base: &b\n{re.sub('(?m)^', '  ', text)}\n<<: *b\n", f"<<: [{{name: a}}, {{name: b}}]\n{text}", f"<<: 1\n{text}", "name: fuzz\n" * min(count, 1000),
            "target: {path: [" + "{hold: {for: 0.0001}}, " * min(count, 2000) + "]}\n" + re.sub(r"(?ms)^target:.*?(?=^\w|\Z)", "", text), "-\n" * count, ": " * count,
        )
    )  # fmt: skip
