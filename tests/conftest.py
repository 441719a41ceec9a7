"""What the tests share: scenarios in a line, the runs that they give, and the command line."""

import copy
import functools
import gc
import os
import signal
import sys

import pytest
import typer.main
from hypothesis import settings
from xdist.scheduler import LoadGroupScheduling

import project
from project import ROOT
from rmrc import arm, cli
from rmrc.arm import loading
from rmrc.scenario import loads, reading
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation

# Modules and items, which are most of what collecting makes, stay: looking for garbage among them takes a fifth of it.
gc.disable()

# A shell starts what runs in the background deaf to Ctrl-C, and `nohup` what it runs to SIGHUP; so would be the
# processes that tests start.
signal.signal(signal.SIGINT, signal.default_int_handler)
if os.name == "posix":
    signal.signal(signal.SIGHUP, signal.SIG_DFL)

# How wide the terminal of the tests is must not decide what they see; xdist tells it to its processes.
os.environ.pop("COLUMNS", None)

# Compiling on the first example, and two busy cores, must not count as a slow test.
settings.register_profile("rmrc", deadline=None, derandomize=True, print_blob=True, max_examples=6)
# `--hypothesis-profile=many` has more.
settings.register_profile("many", settings.get_profile("rmrc"), max_examples=200)
settings.load_profile("rmrc")


def once(read):
    """Return what reads each file of `models/` once, which takes MuJoCo 10 ms, and gives a copy to whoever asks."""
    known = functools.cache(read)

    @functools.wraps(read)
    def copied(path, packages=None):
        if packages or path.resolve().parent != ROOT / "models":
            return read(path, packages)
        found = known(path)
        return found._replace(spec=found.spec.copy(), model=copy.copy(found.model))

    return copied


def shared(load):
    """Return what finds each arm of `models/` once: tests share it, as the worlds of a sweep do."""
    known = functools.cache(load)

    @functools.wraps(load)
    def found(path, site=None, joints=None, *, tool=None, packages=None, **more):
        if tool or packages or path.resolve().parent != ROOT / "models":
            return load(path, site, joints, tool=tool, packages=packages, **more)
        return known(path, site, None if joints is None else tuple(joints), **more)

    return found


loading.read = once(loading.read)
loading.load = arm.load = shared(loading.load)


# Nodes of a YAML text, which nobody changes, take PyYAML milliseconds.
reading._composed = functools.cache(reading._composed)

# Typer makes all commands anew for each call of the command line, which takes longer than most calls.
typer.main.get_command = functools.cache(typer.main.get_command)


# In the name of each test of clusters.
CLUSTER = "/test_cluster"
# Files whose tests share what takes seconds to make, and which each of two processes would else make for itself.
SHARING = (
    "/test_report_page.py", "/test_sweep.py", "/test_workspace.py", "/test_film.py", "/test_peers_page.py",
    "/test_scenarios.py", "/test_browser.py", "/test_plot.py",
)  # fmt: skip
# Files whose tests share what those of another make: runs of shipped scenarios, workspaces.
LIKEWISE = {"/test_docs.py": "/test_scenarios.py", "/test_figures.py": "/test_workspace.py"}


def pytest_collection_modifyitems(items):
    """Start with the tests of clusters, which one process has all of, and then what needs no law, for the other."""
    items.sort(
        key=lambda item: (
            CLUSTER not in item.nodeid,
            item.path.parent.name not in ("textbook", "scenario"),
        )
    )


def pytest_collection_finish():
    """Look for garbage again, but rarely: most of what is loaded by now stays."""
    gc.enable()
    gc.set_threshold(10_000, 20, 1000)


class OneCluster(LoadGroupScheduling):
    """Gives all tests of clusters to one process, which starts one for them, and so those that share something else.

    As their mark `xdist_group` asks for; but xdist 3.8 writes it where pytest 9.2 does not look.
    """

    def _split_scope(self, nodeid):
        groups = [group for group in (CLUSTER, *SHARING, *LIKEWISE) if group in nodeid]
        return LIKEWISE.get(groups[0], groups[0]) if groups else super()._split_scope(nodeid)


def pytest_xdist_make_scheduler(config, log):
    return OneCluster(config, log) if config.getvalue("dist") == "loadgroup" else None


BASE = """
name: test
arm: {model: models/planar_2link.xml, site: tip, start: [60 deg, -120 deg]}
task: {axes: [x, y]}
target: {path: [{line: {by: [0.3, 0.2]}}]}
"""


@pytest.fixture
def scenario(monkeypatch):
    """Return a function: overrides -> scenario, from a 2-link arm that moves along a line."""
    monkeypatch.chdir(ROOT)
    return lambda *overrides: loads(BASE, overrides=overrides)


@pytest.fixture
def simulate(scenario):
    """Return a function: overrides -> (prepared, run)."""

    def run(*overrides):
        prepared = prepare(scenario(*overrides))
        return prepared, Simulation([prepared]).run()[0]

    return run


@pytest.fixture
def undrawn():
    """Leave pictures empty, each of which takes longer than most verbs: for tests of something else."""
    with project.undrawn():
        yield


@pytest.fixture
def rmrc(tmp_path, monkeypatch, capfd):
    """Return a function: arguments -> (exit code, stdout, stderr), run in an empty folder."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["rmrc", *arguments])
        with pytest.raises(SystemExit) as caught:
            cli.main()
        out, err = capfd.readouterr()
        return caught.value.code, out, project.told(err)

    return call
