"""What is wrong with what came of an input."""

import itertools
import json
import os
import re
import zipfile
from pathlib import Path
from typing import NamedTuple

from .case import HERE

# Of docs/commands.md, and 128 + the number of a signal that stops a run.
DOCUMENTED = {0, 1, 2, 3, 129, 130, 141, 143}
INTERNAL = 70

CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f]")
NAN = re.compile(r"(?<![\w.-])[-+]?nan(?![\w.-])", re.IGNORECASE)
NAMED_NAN = re.compile(rb'="[^"]*nan"', re.IGNORECASE)
TRACE = re.compile(
    r"^Traceback \(most recent call last\)|^Exception ignored|^Exception in thread|Fatal Python error",
    re.MULTILINE,
)
NO_MEMORY = re.compile("^.*not enough memory.*$", re.MULTILINE)
# How numpy says that numbers were too much for it: nothing that a user could make use of.
NUMPY = re.compile(r"^.*(encountered in (\w+|scalar \w+)).*$", re.MULTILINE)
# A file that is being written has such a name beside its own; a part ends so.
UNFINISHED = re.compile(r"/\.[^/]*-[0-9a-f]{16}[^/]*$|\.part$|\.tmp$")

# Figures that a run may leave undefined: of a second task, of paths that do not end where they begin, of no
# standstill, of joints without a limit, of no profile.
UNDEFINED = re.compile(
    r"^(return|secondary_|slip\.)|_joint$|^stuck.longest_time$|^tau.*share_of_limit$|^profile.|^(contact|torque_limited).first_"
)


class Finding(NamedTuple):
    """Something wrong.

    Attributes:
        kind: In a word, by which findings are counted.
        text: What exactly, in a line.
    """

    kind: str
    text: str


def judge(case, outcome, root):
    """Return all that is wrong.

    Args:
        case: The input.
        outcome: What came of it.
        root: The folder of the sandbox, with all that the run left.
    """
    found = [*_ended(outcome), *_printed(case, outcome), *_left(case, outcome)]
    if outcome.code == 0:
        found += _figures(case, outcome, root)
    return found


def was_stopped(outcome):
    """Return whether Ctrl-C ended a run that was under way, and that told how far it was."""
    told = re.search(rb"^rmrc: interrupted (at tick|after|while) ", outcome.err, re.MULTILINE)
    return outcome.code == 130 and told is not None


def signature(finding):
    """Return what two findings of one cause have in common, roughly."""
    text = re.sub(r"'[^']*'|\"[^\"]*\"", "'…'", finding.text)
    text = re.sub(r"[-+]?\d[\d.e+-]*", "0", text)
    return f"{finding.kind}: {text[:160]}"


def _ended(outcome):
    if outcome.error:
        last = _exception(outcome.error)
        kind = "memory" if re.match(r"(\w+\.)*(_Array)?MemoryError|std::bad_alloc", last) else "traceback"
        yield Finding(kind, f"{last[:300]}, {_where(outcome.error)}")
        return
    text = outcome.err.decode("utf-8", "replace")
    if outcome.code == INTERNAL or TRACE.search(text) or TRACE.search(outcome.out.decode("utf-8", "replace")):
        last = _exception(text)
        yield Finding(
            "memory" if "MemoryError" in last else "traceback",
            f"exit code {outcome.code}: {last[:300]}, {_where(text)}",
        )
    elif NO_MEMORY.search(text):
        # That it ends in a line is well, but without the bound of the worker it would have taken all of it.
        yield Finding("memory", f"exit code {outcome.code}: {NO_MEMORY.search(text)[0][:200]}")
    elif outcome.code not in DOCUMENTED:
        yield Finding("exit code", f"undocumented: {outcome.code!r}")
    elif outcome.code not in (0, None) and not outcome.err.strip() and not outcome.out.strip():
        yield Finding("silence", f"exit code {outcome.code} without a word")


def _exception(trace):
    """Return the line of a trace that names the exception, or the last one."""
    lines = trace.strip().splitlines() or [""]
    named = [line for line in lines if re.match(r"[\w.]*(Error|Exception|Interrupt|Exit|bad_alloc)\b", line)]
    return (named or lines)[-1]


def _where(trace):
    """Return the innermost of our own lines in a trace."""
    own = re.findall(r'File "[^"]*/rmrc/([\w/]+\.py)", line (\d+), in (\S+)', trace)
    return "{}:{} in {}".format(*own[-1]) if own else "nowhere of ours"


def _printed(case, outcome):
    for name, data in (("stdout", outcome.out), ("stderr", outcome.err)):
        text = data.decode(case.encoding, "replace")
        wrong = CONTROL.search(text)
        if wrong:
            yield Finding(
                "control",
                f"{_about(text, wrong.start())} on {name}, U+{ord(wrong[0]):04X}: {text[wrong.start() - 40 if wrong.start() > 40 else 0 : wrong.end() + 40]!r}",
            )
        if case.encoding == "utf-8" and "\ufffd" in text and b"\xef\xbf\xbd" not in data:
            at = text.index("\ufffd")
            yield Finding(
                "control",
                f"{_about(text, at)} on {name}, bytes that are no text: {text[max(0, at - 40) : at + 40]!r}",
            )
    told = NUMPY.search(outcome.err.decode(case.encoding, "replace"))
    for line in [*outcome.warnings, *([told[0]] if told else [])][:1]:
        yield Finding("warning", " ".join(line.split())[:300])


def _about(text, at):
    """Return what a line is about: its words before what is wrong with it, but for names and numbers."""
    line = text[text.rfind("\n", 0, at) + 1 : at]
    return (
        " ".join(re.findall(r"(?<![\w./-])[a-z]+:?(?![\w./-])", re.sub(r"[\"'][^\"']*[\"']", "", line)))[:80]
        or "a line"
    )


def _left(case, outcome):
    """Yield files that are left over, or where none should be."""
    folders = tuple(os.path.normpath(f"{HERE}/{folder}") for folder in _folders(case.argv))
    for path in outcome.files:
        if UNFINISHED.search(f"/{path}") and outcome.code in (0, 1, 2, 3):
            yield Finding("file", f"left over: {path!r}"[:300])
        elif path.startswith("tmp/"):
            yield Finding("file", f"temporary: {path!r}"[:300])
        elif not any(
            path == folder or path.startswith(f"{folder}/") or folder.startswith(f"{path}/")
            for folder in folders
        ):
            yield Finding("file", f"outside of --out: {path!r}"[:300])
        else:
            continue
        return
    for path in outcome.gone:
        if not path.startswith(folders):
            yield Finding("file", f"changed or removed: {path!r}"[:300])
            return


def _folders(argv):
    """Return the folders, and the files, that a command may write."""
    yield "recordings"
    if argv[:1] == ("init",):
        yield from argv[1:]
    elif argv[:1] == ("new",):
        yield from (f"{Path(word).stem}.yaml" for word in argv[1:])  # of the model, where no file is named
    for option, value in [
        *itertools.pairwise(argv),
        *(one.split("=", 1) for one in argv if "=" in one),
    ]:
        if option in ("--out", "-o", "--picture"):
            yield value


def _figures(case, outcome, root):
    """Yield numbers that are none, of a command that says that all went well."""
    text = outcome.out.decode(case.encoding, "replace")
    is_answer = not {"--help", "--version"} & {*case.argv}  # of a verb
    if "--json" in case.argv and is_answer and text.strip():
        try:
            json.loads(text, parse_constant=_refuse)
        except ValueError as error:
            yield Finding("nan", f"stdout is no strict JSON: {str(error)[:100]}")
    elif is_answer and not any(NAMED_NAN.search(data) for data in case.files.values()):
        wrong = NAN.search(text)
        if wrong:
            yield Finding("nan", f"on stdout: {text[max(0, wrong.start() - 80) : wrong.end() + 20]!r}")
    for path in outcome.files:
        place = root / path
        if path.endswith(".json"):
            yield from _of_scorecards(path, place)
        elif path.endswith(".npz"):
            yield from _of_columns(path, place)


def _refuse(name):
    raise ValueError(f"{name} is no number")


def _of_scorecards(path, place):
    try:
        facts = json.loads(place.read_text("utf-8"), parse_constant=_refuse)
    except ValueError as error:
        yield Finding("nan", f"{path} is no strict JSON: {str(error)[:100]}")
        return
    for one in facts.get("variants", [facts]) if isinstance(facts, dict) else ():
        if one.get("status") != "complete":
            continue
        for name, value in _leaves(one.get("scorecard", {})):
            if value is None and not UNDEFINED.search(name):
                yield Finding("nan", f"figure {name} of a complete run is undefined")
                return


def _leaves(tree, name=""):
    for key, value in tree.items():
        full = f"{name}.{key}".removeprefix(".")
        if isinstance(value, dict):
            yield from _leaves(value, full)
        else:
            yield full, value


def _of_columns(path, place):
    """Yield columns of a run whose numbers are not finite; those of a search or a map may have gaps."""
    import numpy as np  # the supervisor does without

    try:
        with np.load(place) as columns:
            for name in ("q", "qdot", "qdot_cmd", "pose", "sigma"):
                if (
                    name in columns.files
                    and "facts" in columns.files
                    and not np.isfinite(columns[name]).all()
                ):
                    yield Finding("nan", f"column {name} of {path} is not finite")
    except (OSError, ValueError, zipfile.BadZipFile, KeyError) as error:
        yield Finding("nan", f"{path} cannot be read: {error}"[:200])
