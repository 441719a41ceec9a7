"""Resolved motion rate control in MuJoCo.

The names below are all that a notebook needs; each is loaded when it is first used, because MuJoCo and
the compiled law take a third of a second.

    scenario = rmrc.load("scenarios/approach_singularity.yaml")   # rmrc.scenario
    prepared = rmrc.prepare(scenario)                             # rmrc.simulation.prepare
    (run,) = rmrc.Simulation([prepared]).run()                    # rmrc.simulation.simulation
    figures = rmrc.results.scorecard.scorecard(run)                       # a module; import it
    swept = rmrc.Sweep(Path("scenarios/x.yaml")).run()             # rmrc.study.sweep
    tuned = rmrc.tune("scenarios/approach_singularity.yaml")      # rmrc.tuning.tune
    rates = rmrc.resolve_rates(J, twist, "damped")                # rmrc.law.controller
    arm = rmrc.arm.load(Path("models/stanford.xml"))              # a module; import it
    found = rmrc.inspect("models/stanford.xml")                   # rmrc.analysis.inspect.inspection
    found = rmrc.ik("models/stanford.xml", to_q=q)                # rmrc.analysis.ik.ik
    found = rmrc.statics("models/stanford.xml", wrench, hold=2)   # rmrc.analysis.statics.statics
    borne = rmrc.balance(arm, q, wrench)                          # rmrc.analysis.statics.balance
    costs = rmrc.wrench_costs(arm, q)                             # the same
    found = rmrc.solve_ik(task, rmrc.goal_pose(task, values))     # rmrc.analysis.ik.solve
    postures = rmrc.find_postures(task, goal)                     # rmrc.analysis.ik.postures
    found = rmrc.workspace("models/stanford.xml")                 # rmrc.analysis.workspace.workspace
"""

from importlib import import_module

__version__ = "0.1.0"

_HOMES = {
    "load": "rmrc.scenario",
    "loads": "rmrc.scenario",
    "prepare": "rmrc.simulation.prepare",
    "Simulation": "rmrc.simulation.simulation",
    "Run": "rmrc.results.run",
    "Sweep": "rmrc.study.sweep",
    "tune": "rmrc.tuning.tune",
    "resolve_rates": "rmrc.law.controller",
    "inspect": "rmrc.analysis.inspect.inspection",
    "ik": "rmrc.analysis.ik.ik",
    "statics": "rmrc.analysis.statics.statics",
    "balance": "rmrc.analysis.statics.balance",
    "wrench_costs": "rmrc.analysis.statics.balance",
    "goal_pose": "rmrc.analysis.ik.solve",
    "solve_ik": "rmrc.analysis.ik.solve",
    "solve_many": "rmrc.analysis.ik.solve",
    "find_postures": "rmrc.analysis.ik.postures",
    "workspace": "rmrc.analysis.workspace.workspace",
}


def __getattr__(name: str) -> object:
    """Load a public name from the module that it lives in."""
    if name not in _HOMES:
        raise AttributeError(f"module 'rmrc' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)
