"""A scenario, checked against its arm and turned into arrays, before the run starts.

    scenario --prepare_arm--> arm, start --prepare_hardware--> plant, stages --prepare_task--> task
             --prepare_law--> law --prepare_reference--> reference  =  Prepared

Each step checks what it makes. The problems of all steps up to the law are reported together.
"""

import math
from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from rmrc.arm import Arm, load_asked
from rmrc.arm.adapting import check_stretch
from rmrc.law import settings
from rmrc.law.defaults import fitted
from rmrc.law.settings import TaskLaw
from rmrc.law.task import Task, choose
from rmrc.plants.hardware import Hardware
from rmrc.plants.plant import Assumed, Plant
from rmrc.results.metrics import CHATTER_FLOOR
from rmrc.scenario import ArmSection, Problems, Scenario, inline
from rmrc.scenario.choices import PLANTS, POLICIES
from rmrc.scenario.profile import Profile, load_profile
from rmrc.scenario.sections import PROFILE
from rmrc.simulation.configuration import assumed_configuration, true_configuration
from rmrc.simulation.plausibility import Reach, bounds_of, check_points, doubt, reach_of
from rmrc.simulation.reference import Reference
from rmrc.simulation.trajectory import Places, make_reference
from rmrc.support.errors import ModelError, ScenarioError, TargetError, tell_assumed
from rmrc.support.text import brief, listed

Array = NDArray[np.float64]
T = TypeVar("T")

# Arms, tasks and references that a cache keeps: a stretched arm takes a megabyte.
_LATEST = 96
# 285 years [s]; beyond them, nanoseconds do not fit into the 64 bits of a recording's time.
_LONGEST = 9e9


class Cache:
    """The latest arms, tasks and references, which other variants share; for one thread at a time."""

    def __init__(self, *arms: Arm) -> None:
        """Start with some loaded arms.

        Args:
            arms: They replace their files, by the names of their frame and joints; not stretched.
        """
        self._parts: dict[Hashable, Any] = {_names_of(arm): arm for arm in arms}

    def get(self, key: Hashable, make: Callable[[], T]) -> T:
        """Return the part with a key, which is made unless it is among the latest ones."""
        part: T = self._parts.pop(key) if key in self._parts else make()
        self._parts[key] = part  # at the end
        if len(self._parts) > _LATEST:
            del self._parts[next(iter(self._parts))]
        return part


@brief
@dataclass(frozen=True, eq=False)
class Prepared:
    """All data of a world.

    Attributes:
        scenario: As it runs: numbers that it leaves to its arm are those of the arm.
        arm: The arm that it names, as the law knows it.
        qpos: Start configuration of the model, (nq,), the true positions.
        held: Controls and activations of the author's actuators: see `Arm.held`.
        reference: Poses and twists at each control tick.
        task: The task of the site.
        law: The law for the joints.
        hardware: The plant, and the stages between it and the law.
        by_arm: The numbers that come from the arm, in a line; "" if there are none.
    """

    scenario: Scenario
    arm: Arm
    qpos: Array
    held: tuple[Array, Array]
    reference: Reference
    task: Task
    law: TaskLaw = field(repr=False)
    hardware: Hardware = field(repr=False)
    by_arm: str = ""

    @property
    def plant(self) -> Plant:
        """The plant."""
        return self.hardware.plant

    @property
    def starts_outside(self) -> bool:
        """Whether a joint starts outside its limits, so that it comes back first."""
        q, (lower, upper) = self.qpos[self.arm.wiring.qpos], self.arm.position_limit.T
        return bool(((q < lower) | (q > upper)).any())

    @property
    def most_ticks(self) -> int:
        """Largest number of control ticks of the run: more than the path has where it can be slowed."""
        control, ticks = self.scenario.control, self.reference.ticks
        return math.ceil(control.slow.longest * ticks) if POLICIES[control.at_singularity].slows else ticks

    @cached_property
    def true_arm(self) -> Arm:
        """The arm that moves: it differs from the known one if `plant.stretch` says so."""
        return self.arm.stretched(self.plant.stretch) if self.scenario.plant.stretch else self.arm

    @property
    def chatter_floor(self) -> tuple[float, ...]:
        """Acceleration above which a change of sign counts as chatter, (n,); see `rmrc.results.metrics`."""
        floor = np.minimum(self.law.rate_limit, 0.1 * self.law.acceleration_limit)
        return tuple(np.where(np.isfinite(floor), floor, CHATTER_FLOOR).tolist())

    @property
    def assumed(self) -> tuple[Assumed, ...]:
        """The deviations of the run from the model as its author wrote it, and the missing limits."""
        slow = settings.slow_servos(self.law.rate_limit, self.arm) if PLANTS[self.plant.name].own else ""
        texts = (
            self.springs, self.by_arm, _by_profile(self.scenario), _not_shown(self), slow,
            *dict.fromkeys(self.reference.notes),
        )  # fmt: skip
        of_run = (Assumed(text, True) for text in texts if text)
        return (*self.plant.assumed(), *of_run, *_missing_limits(self))

    @property
    def springs(self) -> str:
        """The springs of joints that no actuator compensates, with their torques, in words; "" without."""
        arm = self.arm
        torques = np.abs([arm.rest_torques(q)[1] for q in (self.qpos[arm.wiring.qpos], *arm.span)])
        start, most = torques[0], torques.max(axis=0)
        parts = [
            f"{joint} {start[j]:.3g} {'N' if arm.is_slide[j] else 'N·m'} at the start, up to {most[j]:.3g}"
            for j, joint in enumerate(arm.joints)
            if most[j] and not self.plant.carries_springs[j]
        ]
        return f"springs are not compensated: {'; '.join(parts)}" if parts else ""


def prepare(scenario: Scenario, cache: Cache | None = None) -> Prepared:
    """Load the arm, check everything that needs it, and time the target.

    Args:
        scenario: A scenario.
        cache: Cache of earlier results, extended here.

    Raises:
        ScenarioError: Lists all problems, with file, line and key.
    """
    cache, problems = cache or Cache(), Problems(scenario)
    arm, q, qpos = prepare_arm(scenario, cache, problems)
    hardware = prepare_hardware(scenario, arm, problems)
    task = prepare_task(scenario, arm, cache, problems)
    law, by_arm = prepare_law(scenario, task, q, problems)
    reach = cache.get(("reach", arm), lambda: reach_of(arm))
    # variants, which a search may draw, need no second word
    cache.get(("doubts",), lambda: doubt(scenario, bounds_of(arm, reach)))
    scenario = scenario.fitted(task.length, law.control)
    reference = prepare_reference(scenario, arm, q, reach, cache)
    held = arm.held(scenario.arm.start, qpos, own=PLANTS[scenario.plant.kind].own)
    prepared = Prepared(scenario, arm, qpos, held, reference, task, law, hardware, by_arm)
    problems.extend(_long_run(prepared))
    problems.extend(hardware.plant.excesses(prepared.most_ticks))
    problems.extend(hardware.sent.excesses(prepared.most_ticks))
    problems.raise_any()
    return prepared


# The steps --------------------------------------------------------------------------------------


def prepare_arm(scenario: Scenario, cache: Cache, problems: Problems) -> tuple[Arm, Array, Array]:
    """Return the arm of a scenario, with the joints that are not its own where they start.

    Returns:
        The arm, the joint positions that the law assumes, (n,), and the true start configuration of the
        model, (nq,).

    Raises:
        ScenarioError: There is no such arm, or it is no open chain.
    """
    section = scenario.arm
    try:
        arm = _loaded(section, cache)
        arm.require_open()
    except ModelError as error:
        raise ScenarioError([scenario.problem(f"arm.{error.about}", str(error))]) from None
    tell_assumed(note for note in arm.notes if not getattr(note, "is_obvious", False))
    assumed = assumed_configuration(scenario, arm, problems)
    qpos = true_configuration(scenario, arm, assumed, problems)
    return _with_others(arm, section, assumed, cache), assumed[arm.wiring.qpos], qpos


def prepare_hardware(scenario: Scenario, arm: Arm, problems: Problems) -> Hardware:
    """Return plant and stages of a scenario."""
    plant, hardware = scenario.plant, Hardware(scenario, arm)
    parameters = ["joint_offset", "lag", "backlash", "kv"]
    for name, section, keys in (
        ("arm.encoder", scenario.arm.encoder, ("offset", "deviation", "noise", "resolution")),
        ("plant.friction", plant.friction, ("coulomb", "viscous")),
        ("plant", plant, parameters),
    ):
        for key in keys:
            values = getattr(section, key)
            if isinstance(values, tuple) and len(values) != arm.n:
                problems.add(f"{name}.{key}", settings.wrong_length(len(values), arm))
    try:
        check_stretch(arm.path, arm.model, plant.stretch)
    except ModelError as error:
        problems.add(f"plant.{error.about}", str(error))
    for stage in hardware.stages:
        problems.extend(stage.misfits())
    problems.extend(hardware.plant.misfits())
    return hardware


def prepare_task(scenario: Scenario, arm: Arm, cache: Cache, problems: Problems) -> Task:
    """Return the task of a scenario; variants share it, because finding its rank takes a millisecond."""
    section, weights = scenario.task, scenario.control.joint_weights
    problems.extend(settings.scale_misfits("task.length", (section.length or 1.0,), is_list=False))
    problems.extend(settings.scale_misfits("task.weights", section.weights or ()))
    problems.extend(settings.scale_misfits("control.joint_weights", weights or ()))

    def make() -> Task:
        task = choose(arm, section.axes, section.length, section.frame)
        return replace(task, weights=section.weights, joint_weights=weights)

    return cache.get(("task", arm, section, weights), make)


def prepare_law(scenario: Scenario, task: Task, q: Array, problems: Problems) -> tuple[TaskLaw, str]:
    """Return the law of a scenario that starts at joint positions, (n,), and what comes from the arm.

    Raises:
        ScenarioError: There are problems, of this step or of those before.
    """
    control, arm = scenario.control, task.arm
    problems.extend(_profile_misfits(scenario, arm))
    problems.extend(settings.length_misfits(control, arm))
    problems.extend(settings.method_misfits(control, len(scenario.task.axes), arm))
    problems.extend(settings.second_task_misfits(control, arm))
    problems.extend(settings.slow_misfits(control, arm, arm.path))
    problems.raise_any()
    control, by_arm = fitted(control, task, scenario.task.length)
    return TaskLaw(task, control, q), by_arm


def prepare_reference(scenario: Scenario, arm: Arm, q: Array, reach: Reach, cache: Cache) -> Reference:
    """Return the target of a scenario whose arm starts at joint positions, (n,), and reaches so far.

    Raises:
        ScenarioError: The target cannot be timed, or is too far away.
    """
    target, period, axes = scenario.target, scenario.control.period, scenario.task.axes

    def pose_at(start: Any) -> Array:
        if not isinstance(start, str) and len(start) != arm.n:
            raise TargetError(settings.wrong_length(len(start), arm))
        try:
            return arm.pose(arm.configuration(start)[arm.wiring.qpos])
        except ModelError as error:
            raise TargetError(str(error)) from None

    def make() -> Reference:
        check = partial(check_points, scenario, reach)
        places = Places(arm.base_pose, arm.joints, pose_at, axes, check)
        return make_reference(target, arm.pose(q), period, places)

    # as text, which distinguishes 0.0 from -0.0
    key = "reference", arm, q.tobytes(), target.model_dump_json(), period, axes
    try:
        return cache.get(key, make)
    except TargetError as error:
        name, _, text = str(error).partition(": ")
        raise ScenarioError([scenario.problem(name, text)]) from None


# Their parts ------------------------------------------------------------------------------------


def _names_of(arm: Arm) -> Hashable:
    """Return the key of an arm in a cache: its names in a scenario."""
    frame = dict([arm.frame] if arm.frame else [])
    packages = tuple((name, folder.absolute()) for name, folder in arm.packages)
    of_frame = frame.get("site"), frame.get("body"), frame.get("tool")
    return "arm", arm.path.resolve(), arm.joints, *of_frame, packages


def _loaded(section: ArmSection, cache: Cache) -> Arm:
    """Return the arm of a section, loaded and stretched as it says."""
    of_frame, packages = (section.site, section.body, section.tool), tuple(sorted(section.packages.items()))
    key = "arm", section.model, section.joints, *of_frame, packages
    arm = cache.get(key, lambda: load_asked(section))
    if not section.stretch:
        return arm
    factors = tuple(sorted(section.stretch.items()))
    return cache.get(("stretched", arm, factors), lambda: arm.stretched(section.stretch))


def _with_others(arm: Arm, section: ArmSection, qpos: Array, cache: Cache) -> Arm:
    """Return an arm with the joints that are not its own as in a configuration, (nq,)."""
    mocap = arm.mocap_at(section.start) if arm.model.nmocap else None
    placed = arm.at(qpos, section.others == "free", mocap)
    if placed is arm:
        return arm
    key = "placed", arm, placed.rest.tobytes(), section.others, placed.mocap.tobytes()
    return cache.get(key, lambda: placed)


def expected_profile(scenario: Scenario) -> Profile | None:
    """Return the profile that the commands of a run are checked against."""
    name = scenario.expect.get(PROFILE)
    return load_profile(name) if isinstance(name, str) else None


def _profile_misfits(scenario: Scenario, arm: Arm) -> Iterator[tuple[str, str]]:
    """Yield a profile of another robot, or with conditions for another period."""
    key, period, expected = "expect.profile", scenario.control.period, expected_profile(scenario)
    name = scenario.control.limits.profile
    yield from settings.profile_misfits("control.limits.profile", name, arm)
    if expected is None:
        return
    yield from settings.profile_misfits(key, str(scenario.expect[PROFILE]), arm)
    published = expected.period.value if expected.period else period
    has_differences = bool(expected.acceleration or expected.jerk)
    if expected.joints == arm.n and has_differences and abs(published - period) > 1e-9 * period:
        text = (
            f"{expected.name} bounds the differences of commands that are {published:g} s apart, and "
            f"control.period is {period:g} s; write control.period: {published:g}"
        )
        yield key, text


def _long_run(prepared: Prepared) -> Iterator[tuple[str, str]]:
    """Yield the path of a run that is too long for the time of recordings."""
    ticks, period = prepared.most_ticks, prepared.scenario.control.period
    if not ticks * period < _LONGEST:
        text = (
            f"takes up to {ticks} control periods of {period:g} s, which is more than {_LONGEST:g} s; "
            "raise target.limits, lower control.period or control.slow.longest, or shorten the path"
        )
        yield "target.path", text


# What a run assumes -----------------------------------------------------------------------------


def _missing_limits(prepared: Prepared) -> Iterator[Assumed]:
    """Yield the limits that some joints do not have."""
    arm, law = prepared.arm, prepared.law
    limits = {"rate": law.rate_limit, "acceleration": law.acceleration_limit}
    if prepared.plant.has_physics:
        limits["torque"] = arm.torque_limit
    limits["position"] = np.abs(law.position_limit).max(axis=0)
    for name, limit in limits.items():
        joints = [joint for joint, is_missing in zip(arm.joints, np.isinf(limit), strict=True) if is_missing]
        if joints:
            which = "all joints" if len(joints) == arm.n else listed(joints)
            yield Assumed(f"no {name} limit: {which}", False)


def _not_shown(prepared: Prepared) -> str:
    """Return the warning that a recording cannot show the quantity or time of `look`, or ""."""
    scenario, look = prepared.scenario, prepared.scenario.look
    if look is None:
        return ""
    has = {
        "torque": prepared.plant.has_physics, "pace": POLICIES[scenario.control.at_singularity].slows,
        "belief": prepared.hardware.moves_q,
        "rotation": any(axis.startswith("r") for axis in scenario.task.axes),
    }  # fmt: skip
    if not has.get(look.quantity, True):
        return f"cannot be shown: the run has no {look.quantity}"
    is_late = look.at is not None and look.at > prepared.most_ticks * scenario.control.period
    return f"cannot be shown: the run ends before look.at, {look.at:g} s" if is_late else ""


def _by_profile(scenario: Scenario) -> str:
    """Return the settings of the profile in `control.limits`, except for keys that the scenario sets."""
    control = scenario.control
    if control.limits.profile is None:
        return ""
    profile, settings = load_profile(control.limits.profile), []
    if profile.period and control.period == profile.period.value:
        settings.append(f"control.period {control.period:g}")
    for key, values in profile.limits.items():
        if getattr(control.limits, key) == values:
            is_same = len(set(values)) == 1
            settings.append(f"control.limits.{key} {inline(values[0] if is_same else list(values))}")
    return f"by profile {profile.name}: {', '.join(settings) or 'nothing'}"
