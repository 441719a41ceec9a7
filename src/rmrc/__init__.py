"""Resolved motion rate control in MuJoCo.

A scenario names an arm, a control law, a path and the expected results. Run it, compare variants of it, sweep
thousands of them, or search for its best law:

    import rmrc

    run = rmrc.run("approach_singularity")         # a file, the name of a shipped one, or a Scenario
    run["qdot_cmd"]                                # a column: joint rates that were sent, (T, n)
    run.scorecard["position_error.max"].value      # a metric
    rmrc.plot(run, "crossing.pdf")                 # for a paper: path, rates, singular values, errors
    rmrc.render("blow_up", "blow_up.gif")          # a film of the arm, with its rates below

    one = rmrc.load("approach_singularity").set({"control.feedback": 40})
    runs = rmrc.compare(one, {"control.inverse.method": ["damped", "inverse"]})
    rows = rmrc.sweep(one, {"control.feedback": [5, 10, 20]}).to_pandas()
    tuned = rmrc.tune(one)

Questions about an arm take its MJCF file or the name of a shipped one:

    rmrc.inspect("puma560")                        # kinematics at one configuration
    rmrc.ik("planar_2link", [1.0, 1.0]).q          # joint positions of a pose
    rmrc.check("my.xml").findings                  # errors, missing data, assumptions
    rmrc.new("my.xml", out="my.yaml")              # a first scenario for it, which runs as it is

A log of a real arm gives its delay, lag and noise:

    rmrc.identify("log.csv").delay

Nothing is written unless a folder is given. Each name is loaded on first use, because MuJoCo and the compiled
law take a third of a second.
"""

import sys
from importlib import import_module
from typing import TYPE_CHECKING

__version__ = "0.1.0"

if TYPE_CHECKING:
    from rmrc.analysis.check import check
    from rmrc.analysis.identify import identify
    from rmrc.analysis.ik import ik
    from rmrc.analysis.inspection import inspect
    from rmrc.analysis.new import new
    from rmrc.analysis.statics import statics
    from rmrc.analysis.workspace import workspace
    from rmrc.law.controller import Controller
    from rmrc.law.jacobian_law import Law, resolve_rates
    from rmrc.results.run import Run, read_runs
    from rmrc.results.scorecard import Scorecard
    from rmrc.scenario import Scenario, load, loads
    from rmrc.simulation.prepare import Prepared, prepare
    from rmrc.simulation.simulation import Simulation
    from rmrc.study.margins import margins
    from rmrc.study.pictures import plot, render
    from rmrc.study.run import compare, run
    from rmrc.study.study import Study
    from rmrc.study.sweep import sweep
    from rmrc.support.errors import (
        ClusterError,
        DivergenceError,
        ModelError,
        ModelWarning,
        QuestionError,
        RmrcError,
        ScenarioError,
        TargetError,
    )
    from rmrc.tuning.page import report
    from rmrc.tuning.verb import tune

__all__ = [
    "ClusterError", "Controller", "DivergenceError", "Law", "ModelError", "ModelWarning", "Prepared",
    "QuestionError", "RmrcError", "Run", "Scenario", "ScenarioError", "Scorecard", "Simulation", "Study",
    "TargetError", "check", "compare", "identify", "ik", "inspect", "load", "loads", "margins", "new",
    "plot", "prepare", "read_runs", "render", "report", "resolve_rates", "run", "statics", "sweep", "tune",
    "workspace",
]  # fmt: skip

if not TYPE_CHECKING:  # type checkers use the imports above, and report names that do not exist
    _HOMES = {
        "rmrc.analysis.check": ("check",),
        "rmrc.analysis.identify": ("identify",),
        "rmrc.analysis.ik": ("ik",),
        "rmrc.analysis.inspection": ("inspect",),
        "rmrc.analysis.new": ("new",),
        "rmrc.analysis.statics": ("statics",),
        "rmrc.analysis.workspace": ("workspace",),
        "rmrc.law.jacobian_law": ("Law", "resolve_rates"),
        "rmrc.law.controller": ("Controller",),
        "rmrc.results.run": ("Run", "read_runs"),
        "rmrc.results.scorecard": ("Scorecard",),
        "rmrc.scenario": ("Scenario", "load", "loads"),
        "rmrc.simulation.prepare": ("Prepared", "prepare"),
        "rmrc.simulation.simulation": ("Simulation",),
        "rmrc.study.margins": ("margins",),
        "rmrc.study.pictures": ("plot", "render"),
        "rmrc.study.run": ("compare", "run"),
        "rmrc.study.study": ("Study",),
        "rmrc.study.sweep": ("sweep",),
        "rmrc.support.errors": tuple(name for name in __all__ if name.endswith(("Error", "Warning"))),
        "rmrc.tuning.page": ("report",),
        "rmrc.tuning.verb": ("tune",),
    }

    def __getattr__(name):
        """Load a public name from its module."""
        for module, names in _HOMES.items():
            if name in names:
                return globals().setdefault(name, getattr(import_module(module), name))
        # Python suggests the nearest name
        raise AttributeError(f"module 'rmrc' has no attribute {name!r}", name=name, obj=sys.modules[__name__])

    def __dir__():
        """Return all names, including those not loaded yet."""
        return sorted({*globals(), *__all__} - {"TYPE_CHECKING", "import_module", "sys"})
