"""Resolved motion rate control in MuJoCo.

The names below are all that a notebook needs; each is loaded when it is first used, because MuJoCo and
the compiled law take a third of a second.

    scenario = rmrc.load("scenarios/approach_singularity.yaml")   # rmrc.scenario
    prepared = rmrc.prepare(scenario)                             # rmrc.preparation
    (run,) = rmrc.Simulation([prepared]).run()                    # rmrc.simulation
    figures = rmrc.scorecard.scorecard(run)                       # a module; import it
    swept = rmrc.Sweep(Path("scenarios/x.yaml")).run()             # rmrc.sweep.sweep
    tuned = rmrc.tune("scenarios/approach_singularity.yaml")      # rmrc.tuning.tuning
    rates = rmrc.resolve_rates(J, twist, "damped")                # rmrc.control.law
    arm = rmrc.arm.load(Path("models/stanford.xml"))              # a module; import it
    found = rmrc.inspect_arm(arm, q)                              # rmrc.analysis.inspection
    borne = rmrc.balance(arm, q, wrench)                          # rmrc.analysis.statics
    costs = rmrc.wrench_costs(arm, q)                             # the same
    held = rmrc.hold(arm, q, wrench)                              # rmrc.holding
    found = rmrc.solve_ik(task, rmrc.goal_pose(task, values))     # rmrc.analysis.inverse_kinematics
    postures = rmrc.find_postures(task, goal)                     # rmrc.analysis.postures
    found = rmrc.workspace(arm)                                   # rmrc.analysis.workspace
"""

from importlib import import_module

__version__ = "0.1.0"

_HOMES = {
    "load": "rmrc.scenario",
    "loads": "rmrc.scenario",
    "prepare": "rmrc.preparation",
    "Simulation": "rmrc.simulation",
    "Run": "rmrc.run",
    "Sweep": "rmrc.sweep.sweep",
    "tune": "rmrc.tuning.tuning",
    "resolve_rates": "rmrc.control.law",
    "inspect_arm": "rmrc.analysis.inspection",
    "balance": "rmrc.analysis.statics",
    "wrench_costs": "rmrc.analysis.statics",
    "hold": "rmrc.holding",
    "goal_pose": "rmrc.analysis.inverse_kinematics",
    "solve_ik": "rmrc.analysis.inverse_kinematics",
    "solve_many": "rmrc.analysis.inverse_kinematics",
    "find_postures": "rmrc.analysis.postures",
    "workspace": "rmrc.analysis.workspace",
}


def __getattr__(name: str) -> object:
    """Load a public name from the module that it lives in."""
    if name not in _HOMES:
        raise AttributeError(f"module 'rmrc' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)
