"""A scenario, checked against its arm and turned into arrays, before anything moves."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rmrc import arm as arms
from rmrc.arm import Arm
from rmrc.control.records import Method, Objective, OnExcess, Schedule, world_type
from rmrc.errors import ModelError, ScenarioError, TargetError
from rmrc.plant import Plant
from rmrc.scenario import Scenario
from rmrc.spatial import AXES
from rmrc.target import Reference, make_reference


@dataclass(frozen=True, eq=False)
class Prepared:
    """All that a world needs.

    Attributes:
        scenario: As written.
        arm: The arm that it names.
        qpos: Where the model starts, (nq,).
        reference: Poses and twists at each control tick.
    """

    scenario: Scenario
    arm: Arm
    qpos: NDArray[np.float64]
    reference: Reference

    @property
    def substeps(self) -> int:
        """MuJoCo's steps in a control period."""
        return round(self.scenario.control.period / self.scenario.plant.timestep)

    @property
    def kv(self) -> NDArray[np.float64]:
        """Gains of the rate servos, (n,).

        Without a number of the scenario's it is inertia over timestep: a rate error is then gone after one
        step. Less tracks worse, and much more makes servos chatter when they reach their torque limits.
        """
        kv = self.scenario.plant.kv
        return np.broadcast_to(
            self.arm.inertia / self.scenario.plant.timestep if kv is None else kv, self.arm.n
        )

    @property
    def batch_key(self) -> object:
        """What worlds must have in common to be stepped together."""
        plant = self.scenario.plant
        physics = (tuple(self.kv), plant.timestep, plant.gravity_compensation, self.substeps)
        kinematics = (plant.kind, self.arm.path.resolve(), self.arm.site, self.arm.joints)
        return kinematics + (physics if plant.kind != "ideal" else ())


def prepare(scenario: Scenario, known: dict[object, Arm] | None = None) -> Prepared:
    """Load the arm, check everything that needs it, and time the target.

    Args:
        scenario: A scenario.
        known: Arms that were loaded before; those loaded here are added.

    Raises:
        ScenarioError: All that is wrong, with file, line and key.
    """
    arm = _load_arm(scenario, {} if known is None else known)
    problems = _Problems(scenario)
    qpos = _start(scenario, arm, problems)
    _check_lengths(scenario, arm, problems)
    _check_method(scenario, arm, problems)
    problems.raise_any()
    q = qpos[arm.wiring.qpos]
    try:
        reference = make_reference(
            scenario.target.path, scenario.target.limits, arm.pose(q), scenario.control.period
        )
    except TargetError as error:
        key, _, text = str(error).partition(": ")
        raise ScenarioError([f"{scenario.locate(key)}: {text}"]) from None
    return Prepared(scenario, arm, qpos, reference)


class _Problems:
    def __init__(self, scenario: Scenario) -> None:
        self.scenario, self.lines = scenario, list[str]()

    def add(self, key: str, message: str) -> None:
        self.lines.append(f"{self.scenario.locate(key)}: {message}")

    def raise_any(self) -> None:
        if self.lines:
            raise ScenarioError(self.lines)


def _load_arm(scenario: Scenario, known: dict[object, Arm]) -> Arm:
    section = scenario.arm
    path = Path(section.model)
    key = (path.resolve(), section.site, section.joints)
    if key not in known:
        try:
            known[key] = arms.load(path, section.site, section.joints)
        except ModelError as error:
            raise ScenarioError([f"{scenario.locate(f'arm.{error.about}')}: {error}"]) from None
    return known[key]


def _start(scenario: Scenario, arm: Arm, problems: _Problems) -> NDArray[np.float64]:
    start = scenario.arm.start
    if not isinstance(start, str) and len(start) != arm.n:
        problems.add("arm.start", _wrong_length(len(start), arm))
        start = "home"
    try:
        qpos = arm.configuration(start)
    except ModelError as error:
        problems.add("arm.start", str(error))
        return np.array(arm.model.qpos0)
    for j, position in enumerate(qpos[arm.wiring.qpos]):
        lower, upper = arm.position_limit[j]
        if not lower <= position <= upper:
            unit = "m" if arm.is_slide[j] else "rad"
            key = "arm.start" if isinstance(start, str) else f"arm.start[{j}]"
            problems.add(
                key,
                f'joint "{arm.joints[j]}" must start within its limits '
                f"[{lower:.6g}, {upper:.6g}] {unit}, got {position:.6g}",
            )
    return qpos


def _check_lengths(scenario: Scenario, arm: Arm, problems: _Problems) -> None:
    control = scenario.control
    for key, values in (
        ("control.joint_weights", control.joint_weights),
        ("control.nullspace.posture", control.nullspace.posture),
        ("control.limits.rate", control.limits.rate),
        ("plant.kv", scenario.plant.kv),
    ):
        if isinstance(values, tuple) and len(values) != arm.n:
            problems.add(key, _wrong_length(len(values), arm))


def _wrong_length(got: int, arm: Arm) -> str:
    return f"must have {arm.n} values, one for each joint ({', '.join(arm.joints)}), got {got}"


def _check_method(scenario: Scenario, arm: Arm, problems: _Problems) -> None:
    m = len(scenario.task.axes)
    if scenario.control.inverse.method == "inverse" and m != arm.n:
        problems.add(
            "control.inverse.method",
            f'"inverse" needs as many task axes as joints, got {m} axes and {arm.n} joints; '
            'choose other task.axes, or "pseudoinverse" or "damped"',
        )


def world_record(prepared: Prepared, reference: int) -> np.void:
    """Return the record of one world with every parameter of its scenario.

    Args:
        prepared: The world.
        reference: Index of its reference in the batch.
    """
    scenario, arm = prepared.scenario, prepared.arm
    task, control, n = scenario.task, scenario.control, prepared.arm.n
    m = len(task.axes)
    world = np.zeros(1, world_type(n))
    world["n"], world["m"], world["k"] = n, m, min(m, n)
    world["reference"], world["ticks"] = reference, len(prepared.reference.time)
    world["diverged"] = -1
    rows = np.array([AXES.index(axis) for axis in task.axes])
    world["row"][0, :m] = rows
    # S_x = W_x^½, linear rows over L;  S_q = W_q^-½, sliding joints times L
    weights = np.ones(m) if task.weights is None else np.array(task.weights)
    world["row_scale"][0, :m] = np.sqrt(weights) / np.where(rows < 3, task.length, 1.0)
    weights = np.ones(n) if control.joint_weights is None else np.array(control.joint_weights)
    world["joint_scale"][0, :n] = np.where(arm.is_slide, task.length, 1.0) / np.sqrt(weights)

    world["period"], world["feedback"] = control.period, control.feedback
    world["feedforward"] = float(control.feedforward)
    inverse, damping = control.inverse, control.inverse.damping
    world["method"], world["tolerance"] = Method[inverse.method.upper()], inverse.tolerance
    world["schedule"] = Schedule[damping.schedule.upper()]
    world["damping_maximum"], world["damping_below"] = damping.maximum, damping.below
    nullspace = control.nullspace
    world["objective"] = Objective[nullspace.objective.upper()]
    world["objective_gain"] = nullspace.gain
    start = prepared.qpos[arm.wiring.qpos]
    world["posture"][0, :n] = start if nullspace.posture is None else nullspace.posture
    limits = control.limits
    world["rate_limit"][0, :n] = arm.rate_limit if limits.rate is None else limits.rate
    world["on_excess"] = OnExcess[limits.on_excess.upper()]

    plant = scenario.plant
    world["plant"], world["bandwidth"] = Plant[plant.kind.upper()], plant.bandwidth
    world["wrench"] = plant.wrench
    return world[0]  # type: ignore[no-any-return]
