"""What a verb does when it cannot be heard: other encodings, a full disk, a closed pipe, and its exit codes."""

import errno
import io
import json
import os
import subprocess
import sys

import pytest

import rmrc as package
from project import ROOT, mostly_long
from rmrc import scenario as scenarios
from rmrc.cli import streams

TWO = str(ROOT / "models/planar_2link.xml")
QUICK = f"""
name: quick
arm: {{model: {TWO}, site: tip, start: [60 deg, -120 deg]}}
task: {{axes: [x, y]}}
target: {{path: [{{line: {{by: [0.05, 0.0]}}}}]}}
"""


@pytest.fixture(autouse=True)
def quick(tmp_path):
    (tmp_path / "quick.yaml").write_text(QUICK)


def broken(error):
    def fail(*_):
        raise error

    return fail


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (MemoryError("55 GB"), 2, "rmrc: error: not enough memory (55 GB); ask for less at a time"),
        (OSError(errno.ENOSPC, "No space left on device"), 2, "rmrc: error: a file cannot be written: no space left on device"),
        (PermissionError(errno.EACCES, "Permission denied", "a/b.json"), 2, "rmrc: error: a/b.json: permission denied"),
        (KeyboardInterrupt(), 130, "rmrc: interrupted"),
    ],
    ids=lambda value: type(value).__name__,
)  # fmt: skip
def test_what_is_not_a_bug_is_one_line(rmrc, monkeypatch, error, code, said):
    monkeypatch.setattr(scenarios, "json_schema", broken(error))
    got, out, err = rmrc("schema", "--json")
    assert (got, out) == (code, "")
    assert err.startswith(said) and err.count("\n") == 1


def endless(n=0):
    return endless(n + 1)


@pytest.mark.parametrize("kind", ["RuntimeError", "RecursionError", "OSError"])
def test_a_bug_exits_70_with_its_trace_and_how_to_report_it(rmrc, monkeypatch, kind):
    # An error of the system that is about no file and no disk is a mistake of ours.
    fail = {
        "RuntimeError": broken(RuntimeError("no \x1b[31m idea")),
        "RecursionError": endless,
        "OSError": broken(OSError(errno.EINVAL, "Invalid argument")),
    }
    monkeypatch.setattr(scenarios, "json_schema", fail[kind])
    code, out, err = rmrc("schema", "--json")
    assert (code, out) == (70, "")
    assert (
        err.startswith("Traceback (most recent call last):\n") and f"\n{kind}: " in err and "\x1b" not in err
    )
    assert len(err.splitlines()) < 100
    bug, report = err.splitlines()[-2:]
    assert bug == f"rmrc: internal error: this is a bug in rmrc {package.__version__}, not in your input"
    assert report.startswith("rmrc: report it") and report.endswith("rmrc --version")


def test_a_full_disk_behind_stdout_is_one_line_and_exit_2_and_all_files_are_there(
    rmrc, tmp_path, monkeypatch
):
    with open("/dev/full", "w") as full:
        monkeypatch.setattr(sys, "stdout", full)
        code, _, err = rmrc("run", "quick.yaml")
    assert (code, err) == (2, "rmrc: error: stdout cannot be written: no space left on device\n")
    names = ["quick.json", "quick.npz", "quick.rrd"]
    assert sorted(path.name for path in (tmp_path / "recordings").iterdir()) == names


@pytest.mark.parametrize("arguments", [["schema"], ["inspect", TWO], ["--help"], ["--version"]])
def test_a_pipe_that_its_reader_closed_is_silent_and_exits_141(rmrc, monkeypatch, arguments):
    read, write = os.pipe()
    os.close(read)
    with os.fdopen(write, "w") as pipe:
        monkeypatch.setattr(sys, "stdout", pipe)
        code, _, err = rmrc(*arguments)
        monkeypatch.undo()
    assert (code, err) == (141, "")


PROCESSES = {
    "a full disk": (
        "schema > /dev/full",
        2,
        b"rmrc: error: stdout cannot be written: no space left on device\n",
    ),
    "nothing read": ("schema --json | sleep 0; exit ${PIPESTATUS[0]}", 141, b""),
    "no stdout": ("schema >&-", 2, b"rmrc: error: stdout cannot be written: it is closed\n"),
    "no stderr": ("run nothing.yaml 2>&-", 2, b""),
    "no stderr, but a full one": ("run nothing.yaml 2>/dev/full", 2, b""),
}


@pytest.mark.parametrize(
    "case", [*mostly_long(list(PROCESSES)[:-1], len(PROCESSES), PROCESSES), list(PROCESSES)[-1]]
)
def test_a_process_ends_as_other_tools_do(tmp_path, case):
    """As in a shell, with all that the interpreter does at its own end."""
    line, code, err = PROCESSES[case]
    done = subprocess.run(
        ["bash", "-c", f"{sys.executable} -m rmrc {line}"], cwd=tmp_path, capture_output=True, check=False
    )
    assert (done.returncode, done.stderr) == (code, err)


SHOWN = {
    "schema": ["schema"],
    "inspect": ["inspect", TWO],
    "statics": ["statics", TWO, "--wrench", "0,-1,0"],
    "ik": ["ik", TWO, "--to", "1,1", "--method", "newton"],
    "a mistake": ["run", "quick.yaml", "--set", "arm.site=σέ中"],
}


PLAIN = {}


@pytest.fixture
def plainly(rmrc):
    """Return a function: words -> what the command line gives in UTF-8, asked for once."""

    def asked(*words):
        if words not in PLAIN:
            PLAIN[words] = rmrc(*words)
        return PLAIN[words]

    return asked


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "cp437"])
@pytest.mark.parametrize("case", SHOWN)
def test_no_encoding_of_a_terminal_is_an_error(rmrc, plainly, monkeypatch, case, encoding):
    out, err = (io.TextIOWrapper(io.BytesIO(), encoding=encoding) for _ in range(2))
    with monkeypatch.context() as patch:
        patch.setattr(sys, "stdout", out)
        patch.setattr(sys, "stderr", err)
        code, _, _ = rmrc(*SHOWN[case])
    plain_code, plain, plain_err = plainly(*SHOWN[case])
    assert code == plain_code == (2 if case == "a mistake" else 0)
    shown, said = (stream.buffer.getvalue().decode(encoding) for stream in (out, err))
    # What the encoding does not have is there as an escape; tables have other rules.
    assert bool(shown) == bool(plain)
    assert said == plain_err.encode(encoding, "backslashreplace").decode(encoding)


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "utf-8"])
def test_json_is_the_same_facts_in_any_encoding(rmrc, plainly, monkeypatch, encoding):
    out = io.TextIOWrapper(io.BytesIO(), encoding=encoding)
    with monkeypatch.context() as patch:
        patch.setattr(sys, "stdout", out)
        rmrc("schema", "--json")
    _, plain, _ = plainly("schema", "--json")
    assert json.loads(out.buffer.getvalue().decode(encoding)) == json.loads(plain)
    assert not plain.isascii()  # there is something that ASCII has not


@pytest.mark.long  # what is printed in ASCII is above
def test_a_process_in_the_c_locale_prints_what_it_has(tmp_path):
    environment = {
        **os.environ,
        "LC_ALL": "C",
        "PYTHONUTF8": "0",
        "PYTHONCOERCECLOCALE": "0",
        "PYTHONIOENCODING": "",
    }
    done = subprocess.run(
        [sys.executable, "-m", "rmrc", "schema"],
        cwd=tmp_path, env=environment, capture_output=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, b"")
    assert done.stdout.isascii() and b"\\u03c3_min" in done.stdout


def test_what_is_printed_goes_where_stdout_goes_and_comes_back():
    before = sys.stdout, sys.stderr
    with streams.patient() as output:
        print("heard", file=sys.stderr)
        assert sys.stdout is not before[0]
    assert (sys.stdout, sys.stderr) == before
    assert not output.is_closed and output.problem is None
