"""What holds for each verb: one grammar, help that fits a screen, exit codes, and one line for each mistake."""

import errno
import json
import re
import subprocess
import sys

import pytest
import typer

import rmrc as package
from pages import page
from project import ROOT
from rmrc import cli
from rmrc import scenario as scenarios
from wording import says

VERBS = typer.main.get_command(cli.app).commands
TWO = str(ROOT / "models/planar_2link.xml")
QUICK = f"""
name: quick
arm: {{model: {TWO}, site: tip, start: [60 deg, -120 deg]}}
task: {{axes: [x, y]}}
target: {{path: [{{line: {{by: [0.01, 0.0]}}}}]}}
"""


@pytest.fixture(autouse=True)
def quick(tmp_path):
    (tmp_path / "quick.yaml").write_text(QUICK)


# Help -------------------------------------------------------------------------------------------


def test_the_help_fits_a_screen_and_names_every_verb_and_where_the_exit_codes_are(rmrc, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    code, out, _ = rmrc("--help")
    lines = out.splitlines()
    assert code == 0 and len(lines) <= 24 and max(map(len, lines)) <= 80
    first = ["run", "compare", "tune", "check", "new", "replay"]
    begin = lines.index("Commands:") + 1
    assert [line.split()[0] for line in lines[begin : begin + 6]] == first
    assert set(VERBS) <= set(re.findall(r"\w+", out)) and "docs/commands.md" in out
    table = page("Commands").partition("| exit code |")[2].partition("\n\n")[0]
    codes = re.findall(r"^\| ([0-9]+) \|", table, re.MULTILINE)
    assert codes == ["0", "1", "2", "3", "70", "129", "130", "141", "143"]
    assert all(re.search(rf"\b{code}  ", cli.__doc__) for code in codes)
    code, out, err = rmrc()
    assert (code, out) == (2, "") and "Commands:" in err


@pytest.mark.parametrize("verb", VERBS)
def test_a_help_is_whole_and_the_options_of_all_verbs_have_one_meaning(rmrc, monkeypatch, verb):
    monkeypatch.setenv("COLUMNS", "60")
    code, out, _ = rmrc(verb, "--help")
    assert code == 0 and max(map(len, out.splitlines())) <= 60
    options = {opt: param for param in VERBS[verb].params for opt in param.opts}
    assert all(opt in out for opt in options)
    assert ("--output" in options) == ("-o" in options) and ("--quiet" in options) == ("-q" in options)
    assert "--out" not in options or options["--out"].metavar == "FOLDER"
    shows = verb in ("plot", "report", "render", "replay", "export", "explore")  # they answer nothing
    assert ("--json" in options) != shows and (
        "--quiet" in options or verb in ("replay", "schema", "examples")
    )


# Answers ----------------------------------------------------------------------------------------

CALLS = {
    "run": ("run", "quick.yaml"),
    "compare": ("compare", "quick.yaml", "--vary", "control.feedback=5,10"),
    "sweep": ("sweep", "quick.yaml", "--vary", "control.feedback=5,10"),
    "tune": ("tune", "quick.yaml", "--runs", "10", "--perturbed", "0", "--ideal"),
    "examples": ("examples",),
    "schema": ("schema",),
    "inspect": ("inspect", TWO),
    "statics": ("statics", TWO, "--wrench", "0,-1,0"),
    "new": ("new", TWO),
}


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("verb", CALLS)
def test_each_answer_is_json_as_well_and_quiet_prints_nothing(rmrc, tmp_path, verb):
    code, out, _ = rmrc(*CALLS[verb], "--json")
    facts = json.loads(out, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
    assert code == 0
    for file in facts.pop("files", ()):
        assert (tmp_path / file).is_file()
    if verb in ("run", "compare"):
        file = tmp_path / f"recordings/quick{'.compare' * (verb == 'compare')}.json"
        assert facts == json.loads(file.read_text("utf-8"))
    if verb in ("sweep", "tune"):
        rows = facts["rows"]
        assert len(rows) == 2 if verb == "sweep" else any(row["role"] for row in rows)
        assert verb == "tune" or [row["control.feedback"] for row in rows] == [5.0, 10.0]
    if "-q" in {opt for param in VERBS[verb].params for opt in param.opts}:
        force = ["--force"] * (verb == "new")
        assert rmrc(*CALLS[verb], "-q", *force)[:2] == (0, "")


@pytest.mark.parametrize("verb", ["plot", "report"])  # `render` needs OpenGL, and has the same code
def test_a_result_and_a_scenario_and_the_name_of_a_shipped_one_are_shown(rmrc, tmp_path, verb):
    assert rmrc("run", "quick.yaml", "-q")[0] == 0
    suffix = {"plot": ".pdf", "report": ".html"}[verb]
    for source in ("quick.npz", "quick.rrd"):
        code, out, err = rmrc(verb, f"recordings/{source}")
        assert (code, out, err) == (0, f"wrote recordings/quick{suffix}\n", "")
    assert rmrc(verb, "line_tracking", "-o", f"own{suffix}", "-q", "--set", "name=other") == (0, "", "")
    assert (tmp_path / f"own{suffix}").is_file()
    (tmp_path / "recordings/quick.npz").unlink()
    for words, line in (
        (["recordings/quick.rrd"], "recordings/quick.rrd: quick.npz… missing … run SCENARIO`…"),
        (["quick.yaml", "-o", "x.gif"], f"--output x.gif: … {suffix}…"),
        ([TWO], f"{TWO}: … model … `rmrc inspect {TWO}`…"),
    ):
        assert rmrc(verb, *words) == (2, "", says(f"rmrc: error: {line}\n"))


# Mistakes ---------------------------------------------------------------------------------------

MISTAKES = {
    "a model": (["run", "model.xml"], "model.xml: … model… `rmrc inspect model.xml`… a scenario"),
    "a scenario": (["check", "quick.yaml"], "quick.yaml: … scenario… `rmrc run quick.yaml`… a model"),
    "columns": (["run", "x.npz"], "x.npz: … result… `rmrc report x.npz`… a scenario"),
    "a folder": (["run", "."], ".: … folder… a scenario"),
    "an unknown option": (["run", "quick.yaml", "--method", "x"], "…--method…; see rmrc run --help"),
    "no number": (["tune", "quick.yaml", "--perturbed", "x"], "…'--perturbed'…; see rmrc tune --help"),
    "beyond a bound": (["inspect", TWO, "--length", "inf"], "--length … 1e-06 and 1e+06… inf"),
    "no choice": (["workspace", TWO, "--map", "w"], "…'--map'… 'w' … 'sigma_min', 'manipulability'…"),
    "a package": (["inspect", TWO, "--package", "a=gone"], "--package … NAME=FOLDER … 'a=gone'"),
}  # fmt: skip


@pytest.mark.parametrize("case", MISTAKES)
def test_a_mistake_is_one_line_with_the_way_out(rmrc, tmp_path, case):
    for name in ("model.xml", "x.npz", "x.rrd"):
        (tmp_path / name).touch()
    arguments, line = MISTAKES[case]
    code, out, err = rmrc(*arguments)
    assert (code, out, err) == (2, "", says(f"rmrc: error: {line}\n"))


@pytest.mark.parametrize("name", ["[red]", "a\x1b[31mb", "a\u202eb", "a\nb"])
def test_texts_of_others_are_no_markup_and_have_their_control_characters_visible(rmrc, tmp_path, name):
    model = (ROOT / "models/planar_2link.xml").read_text("utf-8").replace("common/", f"{ROOT}/models/common/")
    (tmp_path / f"{name}.xml").write_text(model)
    (tmp_path / f"{name}.yaml").write_text("name: [")
    for words in (["inspect", f"{name}.xml"], ["run", f"{name}.yaml"], ["run", f"{name}.xml"], [name]):
        _, out, err = rmrc(*words)
        assert (out + err).replace("\n", "").isprintable() and err.count("\n") <= 1
        assert name.encode("unicode_escape").decode() in (out + err).replace("\\x0a", "\\n")


def test_of_a_long_value_the_middle_is_cut(rmrc):
    for words in (["--set", f"control.inverse.method={'a' * 10_000}"], [f"--{'a' * 10_000}"]):
        code, _, err = rmrc("run", "quick.yaml", *words)
        assert code == 2 and err.count("\n") == 1 and len(err) < 1000


# Exit codes -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("error", "code", "line"),
    [
        (MemoryError("55 GB"), 2, "rmrc: error: not enough memory (55 GB); ask for less at a time"),
        (OSError(errno.ENOSPC, "No space left on device"), 2, "rmrc: error: output: no space left on device"),
        (PermissionError(errno.EACCES, "Permission denied", "a/b.json"), 2, "rmrc: error: a/b.json: permission"),
        (KeyboardInterrupt(), 130, "rmrc: interrupted"),
    ],
    ids=lambda value: type(value).__name__,
)  # fmt: skip
def test_what_is_not_a_bug_is_one_line(rmrc, monkeypatch, error, code, line):
    monkeypatch.setattr("rmrc.cli.os.dup2", lambda *_: None)  # stdout is of the test
    monkeypatch.setattr(scenarios, "json_schema", lambda: (_ for _ in ()).throw(error))
    got, out, err = rmrc("schema", "--json")
    assert (got, out) == (code, "")
    assert err.startswith(line) and err.count("\n") == 1


def test_a_bug_exits_70_with_its_trace(rmrc, monkeypatch):
    monkeypatch.setattr(scenarios, "json_schema", lambda: 1 / 0)
    code, out, err = rmrc("schema", "--json")
    assert (code, out) == (70, "") and err.startswith("Traceback (most recent call last):\n")
    assert f"this is a bug in rmrc {package.__version__}" in err


@pytest.mark.parametrize(
    ("line", "code", "err"),
    [
        ("schema --json | sleep 0; exit ${PIPESTATUS[0]}", 141, b""),
        ("inspect planar_2link | sleep 0; exit ${PIPESTATUS[0]}", 141, b""),
        ("schema > /dev/full", 2, b"rmrc: error: output: no space left on device\n"),
    ],
)
def test_a_process_ends_as_other_tools_do(tmp_path, line, code, err):
    words = ["bash", "-c", f"{sys.executable} -m rmrc {line}"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (code, err)
