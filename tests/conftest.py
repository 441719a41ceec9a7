"""What the tests share: scenarios in a line, the runs that they give, and the command line."""

import sys

import pytest
from hypothesis import settings

from project import ROOT
from rmrc import cli
from rmrc.cli.console import COMPILING
from rmrc.preparation import prepare
from rmrc.scenario import loads
from rmrc.simulation import Simulation

# Compiling on the first example, and two busy cores, must not count as a slow test.
settings.register_profile("rmrc", deadline=None, derandomize=True, print_blob=True)
settings.load_profile("rmrc")

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
def rmrc(tmp_path, monkeypatch, capfd):
    """Return a function: arguments -> (exit code, stdout, stderr), run in an empty folder."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["rmrc", *arguments])
        with pytest.raises(SystemExit) as caught:
            cli.main()
        out, err = capfd.readouterr()
        # said by the first run ever only, which may be any of these
        return caught.value.code, out, err.replace(f"rmrc: {COMPILING}\n", "")

    return call
