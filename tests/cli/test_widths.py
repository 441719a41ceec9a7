"""At any width of a terminal no word is broken inside: what is printed at 200 columns is there, whole, at 80 and 60."""

import io
import re
import typing

import pytest
import typer
from rich.console import Console

from pages import page
from project import ROOT, mostly_long
from rmrc import cli
from rmrc.cli.console import _Screen

VERBS = typer.main.get_command(cli.app).commands
PUMA, TWO = str(ROOT / "models/puma560.xml"), str(ROOT / "models/planar_2link.xml")
QUICK = f"""
name: quick
arm: {{model: {TWO}, site: tip, start: [60 deg, -120 deg]}}
task: {{axes: [x, y]}}
target: {{path: [{{line: {{by: [0.05, 0.0]}}}}]}}
expect: {{position_error.max: {{below: 0.001}}, joint_rate.shoulder.peak: {{below: 3}}}}
"""
PRINTING = {
    "run": ["run", "quick.yaml", "--no-record"],
    "run, six joints": ["run", str(ROOT / "scenarios/slow_wrist.yaml"), "--no-record", "--set", "target.path=[{hold: {for: 0.01}}]"],
    "check": ["check", PUMA],
    "new": ["new", TWO, "-o", "mine.yaml"],
    "identify": ["identify", str(ROOT / "scenarios/arm_log.csv")],
    "inspect": ["inspect", PUMA, "--joint-error", "0.1 deg", "--wrench", "1,2,3"],
    "statics": ["statics", PUMA, "--wrench", "1,-200,3,4,5,6", "--gravity"],
    "ik": ["ik", PUMA, "--to-q", "0.1,0.2,0.3,0.4,0.5,0.6", "--iterates"],
    "ik --all": ["ik", TWO, "--to", "1,0.5", "--all"],
    "workspace": ["workspace", TWO, "--cells", "20"],
    "workspace --over": ["workspace", TWO, "--over", "shoulder,elbow", "--cells", "20"],
    "sweep": ["sweep", "quick.yaml", "--vary", "control.feedback=5,10", "--vary", "plant.payload=0,1"],
    "tune": ["tune", "quick.yaml", "--runs", "12", "--perturbed", "0", "--set", "plant.kind=ideal", "--set", "control.period=0.01"],
    "margins": ["margins", "quick.yaml", "--accuracy", "0.5", "--set", "plant.kind=ideal", "--set", "control.period=0.01"],
    "schema": ["schema"],
}  # fmt: skip


@pytest.fixture
def drawn(rmrc, tmp_path, monkeypatch):
    """Return a function: arguments -> (function: width -> what a terminal of that width shows)."""
    (tmp_path / "quick.yaml").write_text(QUICK)
    printed = []
    monkeypatch.setattr(_Screen, "print", lambda _, *objects, **options: printed.append((objects, options)))
    monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)

    def run(*arguments):
        code, _, err = rmrc(*arguments)
        assert code in (0, 1), err
        assert printed

        def at(width):
            console = _Screen(file=io.StringIO(), width=width)
            for objects, options in printed:
                # The method that was replaced above.
                super(_Screen, console).print(*objects, **options)
            return console.file.getvalue()

        return at

    return run


def words(text):
    """Return the words of a text, rules of tables left out."""
    return {word for word in text.split() if not re.fullmatch("[─━]+", word)}


# Tables that others have the like of.
LIKE_OTHERS = {"run, six joints", "ik --all", "workspace"}


@pytest.mark.parametrize("case", mostly_long(PRINTING, 1, LIKE_OTHERS))
@pytest.mark.usefixtures("undrawn")
def test_no_word_that_a_verb_prints_is_broken(drawn, case):
    if case == "schema":
        from rmrc.scenario import schema_rows
        from rmrc.show import tables

        def at(width):
            console = _Screen(file=io.StringIO(), width=width)
            Console.print(console, tables.schema(schema_rows()))  # that of ours was replaced
            return console.file.getvalue()
    else:
        at = drawn(*PRINTING[case])
    whole = words(at(200))
    for width in (80, 60):
        shown = at(width)
        assert whole - words(shown) == set()
        # Paths and commands are not wrapped by us; everything else stays within the terminal.
        tables_only = [line for line in shown.splitlines() if not line.startswith(("wrote ", "look at it"))]
        assert max(map(len, tables_only)) <= width


HELPS = {}


@pytest.fixture
def help_of(rmrc, monkeypatch):
    """Return a function: verb, width -> the help as a terminal of that width shows it, printed once."""

    def shown(verb, width):
        if (verb, width) not in HELPS:
            monkeypatch.setenv("COLUMNS", str(width))
            code, HELPS[verb, width], _ = rmrc(*filter(None, [verb]), "--help")
            assert code == 0
        return HELPS[verb, width]

    return shown


@pytest.mark.parametrize("verb", ["", *VERBS])
def test_no_word_of_a_help_is_broken_or_cut(help_of, verb):
    shown = {}
    for width in (200, 80, 60):
        shown[width] = help_of(verb, width)
        assert max(map(len, shown[width].splitlines())) <= width
        assert "..." not in shown[width].replace(",...", "").replace("[ARGS]...", "")
    for width in (80, 60):
        assert words(shown[200]) - words(shown[width]) == set()


@pytest.mark.parametrize("width", [0, 1, 5, 12, 19])
def test_a_terminal_of_next_to_no_columns_is_no_bug(rmrc, monkeypatch, width):
    monkeypatch.setenv("COLUMNS", str(width))
    code, shown, err = rmrc("inspect", f"{ROOT}/models/planar_rp.xml")
    assert (code, err) == (0, "")
    assert "pivot" in shown


def sources(verb):
    """Yield the help of each parameter of a verb as its source has it; old names of options are hidden."""
    function = next(one.callback for one in cli.app.registered_commands if one.callback.__name__ == verb)
    for name, hint in typing.get_type_hints(function, include_extras=True).items():
        if name != "return":
            (parameter,) = hint.__metadata__
            if not parameter.hidden:
                yield parameter.help


@pytest.mark.parametrize("width", [60, 80, 200])
@pytest.mark.parametrize("verb", VERBS)
def test_a_help_says_what_its_source_says(help_of, verb, width):
    text = " ".join(help_of(verb, width).split())
    for help_ in sources(verb):
        assert " ".join(help_.split()) in text
    if verb == "tune":  # what rich took for markup
        assert "[m]" in text and "[kg]" in text


def test_the_list_of_verbs_and_the_exit_codes_are_in_the_help(rmrc):
    _, shown, _ = rmrc("--help")
    table = page("Commands").partition("| exit code |")[2].partition("\n\n")[0]
    codes = re.findall(r"^\| ([0-9]+) \|", table, re.MULTILINE)
    assert codes == ["0", "1", "2", "3", "70", "129", "130", "141", "143"]
    for code in codes:
        assert re.search(rf"\b{code}  ", shown), code
        assert re.search(rf"\b{code}  ", cli.__doc__), code
    for verb, command in VERBS.items():
        assert verb in shown and command.help.split("\n")[0].split(";")[0] in " ".join(shown.split())
