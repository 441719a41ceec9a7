"""What the documents promise is so: commands, keys, links, names, numbers and examples."""

import contextlib
import importlib
import inspect
import io
import pkgutil
import re
import runpy
import shlex
import shutil
import subprocess
import tomllib

import numpy as np
import pytest

import rmrc.textbook
from pages import blocks, page
from project import ROOT, mostly_long
from rmrc.results.expectations import blank
from rmrc.results.scorecard import scorecard
from rmrc.scenario import load, loads, variants
from rmrc.scenario.choices import INVERSES, LIMITS, OBJECTIVES, POLICIES, PRIORITIES, SCHEDULES, Status
from rmrc.show import sheets
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation
from rmrc.study.run import Job
from rmrc.study.sweep import Sweep
from shipped import shipped

FOLDERS = ("docs", "models", "scenarios", "recordings", "benchmarks", "tests", "src", ".ci")
DOCUMENTS = {
    str(path.relative_to(ROOT)): path.read_text("utf-8")
    for pattern in ("*.md", *(f"{folder}/**/*.md" for folder in FOLDERS))
    for path in sorted(ROOT.glob(pattern))
}
README, THEORY = DOCUMENTS["README.md"], page("Theory")
REFERENCES = DOCUMENTS["docs/references.md"]
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
PROJECT = PYPROJECT["project"]

RUN_COMMAND = (
    "python3 -m venv .venv && .venv/bin/pip install -e . && "
    ".venv/bin/python -m rmrc run scenarios/approach_singularity.yaml"
)
TEST_COMMAND = "python3 -m venv .venv && .venv/bin/pip install -e '.[dev]' && .venv/bin/python -m pytest"


def test_the_documents_are_there():
    # Everything below holds for no documents as well.
    assert {"README.md", "CONTRIBUTING.md", "CHANGELOG.md", "docs/theory.md", "models/README.md"} <= set(
        DOCUMENTS
    )


def fenced(text, language):
    return [block for name, block in blocks(text) if name == language]


def section(text, title):
    """Return the text below a heading, up to the next of the same or a higher level."""
    start = re.search(rf"^(#+) {re.escape(title)}$", text, re.MULTILINE)
    assert start, f"no heading {title}"
    rest = text[start.end() :]
    end = re.search(rf"^#{{1,{len(start[1])}}} ", rest, re.MULTILINE)
    return rest[: end.start()] if end else rest


def rows(text):
    """Return the cells of the rows of all markdown tables, headings left out."""
    table = [
        [cell.strip() for cell in re.split(r"(?<!\\)\|", line.strip())[1:-1]]
        for line in text.splitlines()
        if line.startswith("|")
    ]
    rules = [i for i, cells in enumerate(table) if all(set(cell) <= set("-:") for cell in cells)]
    headings = {i for rule in rules for i in (rule - 1, rule)}
    return [cells for i, cells in enumerate(table) if i not in headings]


# Commands ---------------------------------------------------------------------------------------


def test_readme_has_two_commands_before_anything_else_and_each_is_complete():
    commands = fenced(README, "sh")
    assert commands[0] == f"{RUN_COMMAND}\n"
    assert f"{TEST_COMMAND}\n" in commands


def test_ci_runs_the_test_command_of_the_readme_to_the_letter_and_all_that_documents_name():
    lines = [line.strip() for line in (ROOT / ".ci/run").read_text("utf-8").splitlines()]
    # `|| exit`, because bash goes on when a command before the last `&&` fails.
    assert f"{TEST_COMMAND} || exit" in lines
    targets = re.findall(r"^(\w+):", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE)
    for text in DOCUMENTS.values():
        assert {f"{word})" for word in re.findall(r"`\.ci/run (\w+)`", text)} <= {*lines}
        assert {*re.findall(r"`make (\w+)`", text)} <= {*targets}


LINT = ["ruff", "ruff", "codespell"]
STUB = """#!/usr/bin/env bash
echo "$(basename "$0") $*" >> log
case "$(basename "$0") $*" in *FAILS*) exit 7 ;; esac
[ -d .venv ] && exit
mkdir -p .venv/bin
for name in pip python ruff codespell mypy; do cp "$0" .venv/bin/$name; done
"""


FAILS = [
    "python3 -m venv",
    "pip install",
    "ruff check",
    "python -m pytest",
    "ruff format",
    "mypy",
    "codespell",
    None,
]


@pytest.mark.parametrize("fails", mostly_long(FAILS, 3))
def test_ci_fails_if_any_of_its_steps_does(fails, tmp_path):
    (tmp_path / ".ci").mkdir()
    shutil.copy(ROOT / ".ci/run", tmp_path / ".ci/run")
    stub = tmp_path / "bin/python3"
    stub.parent.mkdir()
    stub.write_text(STUB.replace("*FAILS*", f'"{fails}"*' if fails else '"never"'))
    stub.chmod(0o755)
    ended = subprocess.run(
        [tmp_path / ".ci/run"],
        env={"PATH": f"{stub.parent}:/usr/bin:/bin"},
        capture_output=True,
        text=True,
        check=False,
    )
    called = (tmp_path / "log").read_text().splitlines()
    # Types are checked beside the lint: what fails ends its own steps, and nothing runs after both.
    types = [line for line in called if line.startswith("mypy")]
    one_by_one = [line.partition(" ")[0] for line in called if line not in types]
    if fails == "mypy":
        assert ended.returncode != 0 and types
        assert len(one_by_one) <= 3 + len(LINT)
    elif fails:
        assert ended.returncode != 0
        assert one_by_one[-1] == fails.partition(" ")[0]
    else:
        assert ended.returncode == 0, ended.stderr
        assert len(types) == 1
        assert one_by_one == ["python3", "pip", "python", *LINT]
        assert "not run: long" in ended.stdout


# Keys, links and names ---------------------------------------------------------------------------

KEY = re.compile(r"\[([A-Z][a-z]+\d\d)(?=[\],])")


def cited():
    """Return every key that a source, a model, a scenario or a document other than the references uses."""
    texts = [text for name, text in DOCUMENTS.items() if name != "docs/references.md"]
    for folder, suffixes in (("src", (".py",)), ("models", (".xml",)), ("scenarios", (".yaml",))):
        paths = [path for suffix in suffixes for path in (ROOT / folder).rglob(f"*{suffix}")]
        texts += [path.read_text("utf-8") for path in paths]
    return {key for text in texts for key in KEY.findall(text)}


def entries():
    return re.findall(r"^- \*\*\[([A-Z][a-z]+\d\d)\]\*\*", REFERENCES, re.MULTILINE)


def test_every_key_resolves_and_every_reference_is_used():
    assert set(entries()) == cited()


def anchors(text):
    """Return the anchors that GitHub gives to headings."""
    headings = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def broken_links(name, text):
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = re.sub(r"\?.*", "", target).partition("#")  # what follows ? is for the site
        file = (ROOT / name).parent / path if path else ROOT / name
        if not file.exists() or (anchor and anchor not in anchors(file.read_text("utf-8"))):
            yield target


@pytest.mark.parametrize("name", DOCUMENTS)
def test_every_link_leads_somewhere(name):
    assert list(broken_links(name, DOCUMENTS[name])) == []


def missing_names(text):
    """Return the dotted names of rmrc that do not exist."""
    for name in set(re.findall(r"`(rmrc(?:\.\w+)+)`", text)):
        parts = name.split(".")
        for end in range(len(parts), 0, -1):
            try:
                found = importlib.import_module(".".join(parts[:end]))
            except ModuleNotFoundError:
                continue
            for part in parts[end:]:
                found = getattr(found, part, None)
            if found is None:
                yield name
            break


@pytest.mark.parametrize("name", DOCUMENTS)
def test_every_function_that_a_document_names_exists(name):
    assert list(missing_names(DOCUMENTS[name])) == []


def test_every_test_and_file_that_a_document_names_exists():
    sources = "".join(path.read_text("utf-8") for path in (ROOT / "tests").rglob("*.py"))
    tests = {name for text in DOCUMENTS.values() for name in re.findall(r"`(test_\w+)`", text)}
    assert tests
    assert [name for name in tests if f"def {name}(" not in sources] == []
    files = {
        name
        for text in DOCUMENTS.values()
        for name in re.findall(r"`((?:tests|src|docs)/(?!_site)[\w/]+\.\w+)`", text)
    }
    assert [name for name in files if not (ROOT / name).is_file()] == []


def textbook_functions():
    """Yield the public functions of the textbook with their full names."""
    for module in pkgutil.iter_modules(rmrc.textbook.__path__):
        home = importlib.import_module(f"rmrc.textbook.{module.name}")
        for name, value in vars(home).items():
            if inspect.isfunction(value) and value.__module__ == home.__name__ and not name.startswith("_"):
                yield f"{home.__name__}.{name}", value


def test_every_module_of_the_textbook_is_in_the_theory_and_every_function_has_an_example():
    functions = dict(textbook_functions())
    assert len(functions) > 80
    homes = {name.rpartition(".")[0] for name in functions}
    assert [name for name in homes if f"`{name}`" not in THEORY] == []
    assert [name for name, function in functions.items() if ">>>" not in function.__doc__] == []


# Lists that must be complete ---------------------------------------------------------------------


def test_every_status_is_on_its_page_with_its_bit():
    table = {cells[0].strip("`"): int(cells[1]) for cells in rows(page("Statuses"))}
    assert table == {one.name: one.value for one in Status if one}


def test_the_tables_of_the_reference_are_what_is_declared():
    tables = runpy.run_path(str(ROOT / "tools/tables.py"))
    for name, as_declared in tables["PAGES"].items():
        text = DOCUMENTS[f"docs/{name}"]
        assert as_declared(text) == text, "python tools/tables.py --write mends them"
        row = re.search(
            r"^\| `(?:sigma|transpose|name|joint_rate.peak|--quiet).*\n|^\| `-q, .*\n", text, re.MULTILINE
        )[0]
        assert as_declared(text.replace(row, "")) == text  # a row that is lost is seen, and mended


@pytest.mark.parametrize(
    "choices", [INVERSES, SCHEDULES, OBJECTIVES, PRIORITIES, LIMITS], ids=lambda choices: choices.field
)
def test_the_theory_lists_every_choice_with_its_source(choices):
    table = re.search(rf"^\| `control.{choices.key}` \|.*?(?=\n\n)", THEORY, re.MULTILINE | re.DOTALL)[0]
    listed = {line.split("`")[1]: line for line in table.splitlines()[2:]}
    wanted = [one for one in choices.options if not (choices is OBJECTIVES and not one.acts)]
    assert list(listed) == [one.name for one in wanted]
    for one in wanted:
        if choices is not LIMITS and one.source:  # where sources are in the text below
            assert f"[{one.source}]" in listed[one.name], one.name


def test_every_policy_at_a_singularity_is_in_the_theory():
    text = section(THEORY, "At a singularity")
    assert [name for name in POLICIES.names if f"`{name}`" not in text] == []


def test_each_dependency_says_what_it_is_for():
    text = (ROOT / "pyproject.toml").read_text("utf-8")
    lists = [
        PROJECT["dependencies"],
        *PROJECT["optional-dependencies"].values(),
        *PYPROJECT["dependency-groups"].values(),
    ]
    wanted = [one for some in lists for one in some if not one.startswith("rmrc[")]
    assert [
        one for one in wanted if not re.search(rf'^    "{re.escape(one)}",  # \w', text, re.MULTILINE)
    ] == []


def test_every_scenario_and_model_is_in_its_table():
    for folder, suffix in (("scenarios", ".yaml"), ("models", ".xml")):
        text = DOCUMENTS[f"{folder}/README.md"]
        names = [path.stem for path in (ROOT / folder).glob(f"*{suffix}")]
        assert names
        assert [name for name in names if f"({name}{suffix})" not in text and f"`{name}`" not in text] == []


# Examples and numbers ----------------------------------------------------------------------------


def test_the_annotated_scenario_can_be_run(monkeypatch):
    (text,) = fenced(page("Write a scenario"), "yaml")
    monkeypatch.chdir(ROOT / "scenarios")
    prepared = prepare(loads(text))
    figures = set(blank(prepared.arm.joints, prepared.scenario.task.axes))
    assert prepared.scenario.expect.keys() <= figures


def shown(text):
    """Return a line of output without what differs from machine to machine: rounding, and the width of columns."""
    rounding = r"[-+]?\d(?:\.\d+)?e-(?:09|[1-9]\d)\b"
    return " ".join(re.sub(rounding, "rounding", text).split())


def test_the_runs_of_the_sweep_that_the_page_names_are_as_it_says(tmp_path):
    (_, command), (_, printed), *_ = blocks(page("Sweep thousands of variants"))
    lines = printed.splitlines()
    drawn = re.findall(r"--sobol (\S+)=(\S+)\.\.(\S+)", command)
    (samples,) = re.findall(r"--samples (\d+)", command)
    overrides = [f"sweep.draw.{key}=[{low}, {high}]" for key, low, high in drawn]
    path = ROOT / shlex.split(command)[4]
    sweep = Sweep(path, [*overrides, "sweep.sampler=sobol", f"sweep.samples={samples}"], tmp_path)
    assert lines[0] == f"{sweep.scenario.name}: {len(sweep)} runs"
    named = [line for line in lines if line.startswith("run ")]
    for line in named:
        texts = [word.removeprefix("--set=") for word in shlex.split(line) if word.startswith("--set=")]
        assert texts == [str(change) for change in sweep.plan.changes(int(line.split()[1].rstrip(":")))]
    extremes = [line.split() for line in lines if re.match(r"\w+\.\w+ \[", line)]
    for figure, _, *ends in extremes:
        for printed, index in zip(ends[::2], ends[1::2], strict=True):
            (run,) = Simulation([prepare(load(path, map(str, sweep.plan.changes(int(index)))))]).run()
            assert shown(sheets.number(scorecard(run)[figure].value)) == shown(printed)
    assert (len(extremes), len(named)) == (2, 1)


@pytest.mark.parametrize(
    "name", ["from_simulation_to_your_robot", "my_robot", "python", "questions", "textbook"]
)
def test_the_python_examples_of_a_page_print_what_it_says(monkeypatch, capsys, name):
    monkeypatch.chdir(ROOT)
    programs = fenced(DOCUMENTS[f"docs/{name}.md"], "python")
    assert programs
    for block in programs:
        exec(compile(block, f"{name}.md", "exec"), {})
        said = re.findall(r"# (.+)$", block, re.MULTILINE)
        assert capsys.readouterr().out.splitlines() == said


def test_the_python_example_of_the_readme_runs(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)  # it names what is shipped
    (block,) = fenced(README, "python")
    names = {}
    exec(compile(block, "README.md", "exec"), names)
    assert list(tmp_path.iterdir()) == []
    assert names["run"]["qdot_cmd"].shape == (5213, 2)  # ticks of approach_singularity, joints
    assert list(names["runs"]) == ["inverse", "damped"]
    assert names["rows"]["control.feedback"].to_pylist() == [5.0, 10.0, 20.0]
    assert names["tuned"].feasible and names["found"].arm.n == 6


CHAPTERS = section(DOCUMENTS["docs/textbook.md"], "Chapter by chapter")
CHAPTER_ROWS = rows(CHAPTERS)
SESSION = shlex.split(*fenced(CHAPTERS, "sh"))


@pytest.mark.parametrize(
    ("command", "printed"),
    [
        # what moves an arm or searches takes a third of a second each; of the others, one of three
        pytest.param(cells[2].strip("`"), re.findall("`(.*?)`", cells[3]), id=cells[0],
                     marks=[pytest.mark.long] * (cells[2].startswith("`rmrc")
                            and bool(i % 3 or re.match("`rmrc (run|workspace|ik .* --all)", cells[2]))))
        for i, cells in enumerate(CHAPTER_ROWS)
    ],
)  # fmt: skip
def test_a_row_of_the_textbook_prints_what_it_says(rmrc, monkeypatch, tmp_path, command, printed):
    monkeypatch.chdir(ROOT)
    if command.startswith("rmrc "):
        program, *words = shlex.split(command)
        out = ["--out", str(tmp_path)] if words[0] in ("run", "workspace") else []
        code, *answer = rmrc(*words, *out)
        assert (program, code) == ("rmrc", 0), answer
    else:
        assert SESSION[:3] == ["python", "-i", "-c"]
        names = {}
        with np.printoptions(), contextlib.redirect_stdout(io.StringIO()) as spoken:
            exec(SESSION[3], names)
            exec(compile(command, command, "single"), names)  # which shows the value, as the session does
        answer = [spoken.getvalue()]
    assert printed and [text for text in printed if shown(text) not in shown(" ".join(answer))] == []


def test_the_chapters_have_every_erratum_of_the_sources_and_no_other():
    wheres = {cells[0] for cells in rows(DOCUMENTS["docs/errata.md"]) if re.match("[A-D], ", cells[0])}
    assert len(wheres) > 20
    linked = {
        f"{number[0]}, {name}"
        for number, topic, *_ in CHAPTER_ROWS
        for name in re.findall(r"\[([^\]]+)\]\(errata\.md\)", topic)
    }
    assert {where.casefold() for where in wheres} == {name.casefold() for name in linked}


def test_every_public_name_is_on_its_page():
    listed = re.findall(r"`(\w+)`", section(DOCUMENTS["docs/python.md"], "Names"))
    assert set(rmrc.__all__) <= set(listed)
    assert all(getattr(rmrc, name).__doc__ for name in rmrc.__all__)


def test_every_module_of_the_textbook_is_on_its_page():
    listed = re.findall(r"\[`(\w+)`\]", section(DOCUMENTS["docs/textbook.md"], "Modules"))
    assert sorted(listed) == sorted(module.name for module in pkgutil.iter_modules(rmrc.textbook.__path__))


def figures_of(name, *overrides):
    return {figure: one.value for figure, one in shipped(name, *overrides).scorecard.items()}


def agrees(value, printed):
    """Whether a value is the printed number, to half a unit of its last digit and 1 % for other machines."""
    number = re.match(r"(?P<more>> )?(?P<digits>[\d.]+)(?P<power>e-?\d+)?", printed)
    assert number, printed
    scale = float(f"1{number['power'] or ''}")
    wanted = float(number["digits"]) * scale
    if number["more"]:
        return value > wanted
    unit = scale * 10.0 ** -len(number["digits"].partition(".")[2])
    return abs(value - wanted) <= 0.5 * unit + 0.01 * wanted


@pytest.mark.parametrize("every", [4, pytest.param(1, marks=pytest.mark.long)])
def test_numbers_of_the_scenario_table_are_those_that_a_run_gives(every):
    figures = {}
    for link, _, figure, printed in rows(section(DOCUMENTS["scenarios/README.md"], "The scenarios")):
        if link:
            name = re.match(r"\[(\w+)\]", link)[1]
            figures[name] = []
        figures[name].append((figure.strip("`"), printed))
    assert len(figures) > 2 * every and all(figures.values())
    for name in [*figures][::every]:
        found = figures_of(name)
        for figure, printed in figures[name]:
            value = found[figure]
            assert agrees(value, printed), f"{name}: {figure} is {value:.4g}, printed {printed}"


def test_numbers_of_the_first_page_are_those_that_a_run_gives():
    text = section(page("Five minutes"), "The effect of damping")
    names = re.findall(r"`([\w.]+)` \[", text)  # of the columns, each with its unit
    assert names
    for how, *printed in rows(text):
        figures = figures_of("blow_up", *re.findall(r"([\w.]+=[\w.]+)", how))
        for name, number in zip(names, printed, strict=True):
            assert agrees(figures[name], number), f"{how}: {name} is {figures[name]:.4g}, printed {number}"


def test_numbers_of_the_comparison_are_those_that_its_command_gives():
    text = page("Compare methods")
    (command,) = fenced(text, "sh")
    _, path, *varied = re.fullmatch(r".*-m rmrc (compare) (\S+) --vary (\S+)\n", command).groups()
    job = Job(ROOT / path, variants=variants(varied))
    runs = Simulation(job.worlds).run()
    names = re.findall(r"`([\w.]+)` \[", text)
    table = rows(text)
    assert names
    assert [cells[0] for cells in table] == [f"`{variant.label}`" for variant in job.variants]
    for run, (label, *printed) in zip(runs, table, strict=True):
        card = scorecard(run)
        for name, number in zip(names, printed, strict=True):
            assert agrees(card[name].value, number), f"{label}: {name} is {card[name].value:.4g}"
