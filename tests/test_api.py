"""What `import rmrc` gives: complete under tab, typed, nothing loaded before it is used, no traces in a process."""

import ast
import importlib
import subprocess
import sys
import textwrap

import rmrc
from project import ROOT
from rmrc.results.scorecard import scorecard

TREE = ast.parse((ROOT / "src/rmrc/__init__.py").read_text("utf-8"))
# As a checker reads them: the names by where they are from.
(FOR_CHECKERS,) = (
    node for node in TREE.body if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
)
IMPORTED = {alias.name: node.module for node in FOR_CHECKERS.body for alias in node.names}


def python(code, cwd=None):
    """Return what a new process prints."""
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)], cwd=cwd, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_every_name_is_there_and_is_what_a_checker_takes_it_for():
    assert sorted(IMPORTED) == sorted(rmrc.__all__)
    for name, module in IMPORTED.items():
        assert getattr(rmrc, name) is getattr(importlib.import_module(module), name)


def test_a_scenario_is_read_without_the_law_and_the_command_line_imported_without_slow_libraries():
    code = "import rmrc, sys; rmrc.load('blow_up'); print(*sys.modules); import rmrc.cli; print(*sys.modules)"
    read, imported = (set(line.split()) for line in python(code).splitlines())
    assert "pydantic" in read and "typer" in imported
    assert not {"numba", "mujoco", "pyarrow", "rerun", "matplotlib", "typer", "rich"} & read
    assert not {"rerun", "matplotlib", "mujoco", "numba"} & imported


def test_importing_loads_nothing_but_the_standard_library_and_has_all_names_under_tab():
    code = "import sys; before = set(sys.modules); import rmrc; print(*(set(sys.modules) - before)); print(*dir(rmrc))"
    loaded, listed = python(code).splitlines()
    outside = {name.partition(".")[0] for name in loaded.split()} - set(sys.stdlib_module_names)
    assert outside <= {"rmrc"} and "rmrc.support" not in loaded
    assert set(rmrc.__all__) <= set(listed.split())


def test_a_run_has_columns_and_figures(simulate):
    _, run = simulate()
    assert isinstance(run, rmrc.Run)
    assert run["qdot_cmd"].shape == (len(run), 2)
    assert repr(dict(run.scorecard)) == repr(dict(scorecard(run)))  # NaN among them
    assert run.scorecard is run.scorecard
    # what only metrics and pictures need is not under tab
    assert not {"chatter_floor", "leaders", "touching"} & set(dir(run))
    assert {"joints", "columns", "scorecard", "verdict", "baseline", "plot"} <= set(dir(run))


# What a process has that a library must leave as it is, before and after each verb.
LEFT = """
import logging, os, signal, sys, threading, warnings
import numpy, numba

def state():
    return {
        "signals": [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)],
        "switch interval": sys.getswitchinterval(),
        "numba": {name: value for name, value in vars(numba.config).items() if name.isupper()},
        "numpy": (numpy.geterr(), numpy.get_printoptions(), numpy.random.get_state()[1].tolist()),
        "warnings": (list(warnings.filters), warnings.showwarning),
        "logging": (logging.root.level, list(logging.root.handlers)),
        "hooks": (sys.excepthook, sys.unraisablehook, threading.excepthook),
        "environment": (dict(os.environ), os.getcwd(), sys.argv, sys.path, sys.stdout, sys.stderr),
        "threads": threading.enumerate(),
        "files": os.listdir(),
    }

def say(what):
    for name, value in state().items():
        if value != before[name]:
            print(what, name)

before = state()
"""
BRIEF = "rmrc.load('line_tracking').set({'control.period': 0.01, 'control.feedback': 40, 'target.path': [{'line': {'by': [0.02, 0.0]}}]})"
CALLS = (
    "run('line_tracking')",
    f"sweep({BRIEF}, {{'control.feedback': [5, 10]}}, threads=2)",
    "check('planar_2link')",
)


def test_nothing_in_a_callers_process_is_changed(tmp_path):
    called = "".join(f"rmrc.{call}\nsay('''{call}''')\n" for call in CALLS)
    # negative control: what we change ourselves is seen
    changed = "sys.setswitchinterval(1.0); open('x', 'w').close(); say('we')"
    said = python(f"{LEFT}\nimport rmrc\n{called}{changed}", tmp_path).splitlines()
    assert said == ["we switch interval", "we files"]
