"""A scenario, checked against its arm and turned into arrays, before the run starts."""

import math
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from rmrc import arm as arms
from rmrc.arm import Arm
from rmrc.arm.differences import check_stretch
from rmrc.law import fit
from rmrc.law.law import TaskLaw
from rmrc.law.record import Writer, records
from rmrc.law.task import Task
from rmrc.plants.encoders import Encoders
from rmrc.plants.hardware import Hardware
from rmrc.plants.lockstep import Course
from rmrc.plants.plant import Assumed, Plant
from rmrc.plants.wiring import WIRING
from rmrc.results.tally import CHATTER_FLOOR
from rmrc.scenario import ArmSection, Problems, Scenario, angle, inline
from rmrc.scenario.choices import PLANTS, POLICIES
from rmrc.scenario.profile import Profile, load_profile
from rmrc.scenario.sections import PROFILE
from rmrc.simulation.reference import Reference
from rmrc.simulation.start import start_positions
from rmrc.simulation.trajectory import Places, make_reference
from rmrc.support.brief import brief
from rmrc.support.errors import ModelError, ScenarioError, TargetError
from rmrc.support.legible import listed
from rmrc.support.notices import tell, tell_assumed
from rmrc.support.spatial import AXES

T = TypeVar("T")


class _Recent(Generic[T]):
    """The latest results, by their keys."""

    def __init__(self, most: int, found: Mapping[object, T] | None = None) -> None:
        self._most, self._found = most, dict(found or {})

    def get(self, key: object, find: Callable[[], T]) -> T:
        if key not in self._found:
            found = find()
            if len(self._found) >= self._most:
                del self._found[next(iter(self._found))]
        else:
            found = self._found.pop(key)
        self._found[key] = found  # at the end
        return found


class Cache:
    """Cache of prepared parts of scenarios: arms, references, tasks.

    Only the latest results are kept. For one thread at a time.
    """

    def __init__(self, *arms: Arm) -> None:
        """Start with some loaded arms.

        Args:
            arms: They replace their files, by the names of their frame and joints; not stretched.
        """
        # Stretched arms and references take a megabyte each, and their users keep them anyway.
        self._arms = _Recent[Arm](32, {_key(arm): arm for arm in arms})
        self._references, self._tasks = _Recent[Reference](32), _Recent[Task](256)
        self._hardware = _Recent[Hardware](32)

    def arm(self, section: ArmSection) -> Arm:
        """Return the arm of a section, loaded and stretched as it says.

        Raises:
            ModelError: See `rmrc.arm.load` and `Arm.stretched`.
        """
        more = section.body, section.tool, section.base, tuple(sorted(section.packages.items()))
        key = section.model, section.site, section.joints, *more
        own = self._arms.get(key, lambda: arms.load_asked(section))
        if not section.stretch:
            return own
        return self._arms.get(
            (key, tuple(sorted(section.stretch.items()))), lambda: own.stretched(section.stretch)
        )

    def placed(self, arm: Arm, section: ArmSection, qpos: NDArray[np.float64]) -> Arm:
        """Return an arm with the joints that are not its own as in a configuration, (nq,)."""
        mocap = arm.mocap_at(section.start) if arm.model.nmocap else None
        placed = arm.at(qpos, section.others == "free", mocap)
        if placed.rest is None or placed is arm:
            return placed
        there = b"" if placed.mocap is None else placed.mocap.tobytes()
        return self._arms.get((arm, placed.rest.tobytes(), section.others, there), lambda: placed)

    def reference(self, scenario: Scenario, arm: Arm, q: NDArray[np.float64]) -> Reference:
        """Return the target of a scenario whose arm starts at joint positions q, (n,).

        Raises:
            TargetError: See `make_reference`.
        """
        target, period = scenario.target, scenario.control.period
        # as text, which distinguishes 0.0 from -0.0
        key = (arm, q.tobytes(), target.model_dump_json(), period)

        def pose_at(configuration: str | Sequence[float] | NDArray[np.float64]) -> NDArray[np.float64]:
            if not isinstance(configuration, str) and len(configuration) != arm.n:
                raise TargetError(fit.wrong_length(len(configuration), arm))
            try:
                return arm.pose(arm.configuration(configuration)[arm.wiring.qpos])
            except ModelError as error:
                raise TargetError(str(error)) from None

        def timed() -> Reference:
            places = Places(arm.base_pose, arm.joints, pose_at)
            return make_reference(
                target.path, target.limits, arm.pose(q), period, target.offset, target.frame, places
            )

        return self._references.get(key, timed)

    def task(self, scenario: Scenario, arm: Arm) -> Task:
        """Return the task of a scenario; finding its rank takes a millisecond."""
        section, joint_weights = scenario.task, scenario.control.joint_weights
        key = (arm, section.axes, section.length, section.weights, joint_weights, section.frame)
        rows = np.array([AXES.index(axis) for axis in section.axes])
        return self._tasks.get(
            key, lambda: Task(arm, rows, section.length, section.weights, joint_weights, section.frame)
        )

    def hardware(self, scenario: Scenario, arm: Arm) -> Hardware:
        """Return the hardware of a scenario; variants whose sections `arm` and `plant` are the same share it.

        Of the section `control`, plants and stages read only what the key has.
        """
        control = scenario.control
        read = control.period, control.state, control.rate_filter
        # the hardware keeps these sections, so that no others get their addresses
        key = (arm, *map(id, (scenario.arm, scenario.plant, control.nullspace)), *read)
        return self._hardware.get(key, lambda: Hardware(scenario, arm))


def _key(arm: Arm) -> Hashable:
    """Return the key of an arm for `Cache.arm`: its names in a scenario."""
    named = dict([arm.frame] if arm.frame else [])
    frame = named.get("site"), arm.joints, named.get("body"), named.get("tool"), "fixed"
    return arm.path.resolve(), *frame, tuple((name, folder.absolute()) for name, folder in arm.packages)


@brief
@dataclass(frozen=True, eq=False)
class Prepared:
    """All data of a world.

    Attributes:
        scenario: As written.
        arm: The arm that it names, as the law knows it.
        qpos: Start configuration of the model, (nq,), the true positions.
        held: Controls and activations of the author's actuators: see `Arm.held`.
        reference: Poses and twists at each control tick.
        cache: Parts that it shares with others.
    """

    scenario: Scenario
    arm: Arm
    qpos: NDArray[np.float64]
    held: tuple[NDArray[np.float64], NDArray[np.float64]]
    reference: Reference
    cache: Cache = field(default_factory=Cache, repr=False)

    @cached_property
    def hardware(self) -> Hardware:
        """The plant, and the stages between it and the law."""
        return self.cache.hardware(self.scenario, self.arm)

    @property
    def plant(self) -> Plant:
        """The plant."""
        return self.hardware.plant

    @property
    def most_ticks(self) -> int:
        """Largest number of control ticks of the run: more than the path has where it can be slowed."""
        control, ticks = self.scenario.control, self.reference.ticks
        return math.ceil(control.slow.longest * ticks) if POLICIES[control.at_singularity].slows else ticks

    @cached_property
    def task(self) -> Task:
        """The task of the site."""
        return self.cache.task(self.scenario, self.arm)

    @cached_property
    def law(self) -> TaskLaw:
        """The law for the joints."""
        return TaskLaw(self.task, self.scenario.control, self.qpos[self.arm.wiring.qpos] - self.joint_offset)

    @property
    def encoder_offset(self) -> NDArray[np.float64]:
        """Offset of the encoders' readings, (n,)."""
        return Encoders(self.scenario, self.arm).offset

    @property
    def joint_offset(self) -> NDArray[np.float64]:
        """Offset of the true joint positions from those that the law assumes, (n,)."""
        return np.full(self.arm.n, self.scenario.plant.joint_offset)

    @cached_property
    def true_arm(self) -> Arm:
        """The arm that moves: it differs from the known one if `plant.stretch` says so."""
        return self.arm.stretched(self.plant.stretch) if self.scenario.plant.stretch else self.arm

    @cached_property
    def chatter_floor(self) -> tuple[float, ...]:
        """Acceleration above which a change of sign counts as chatter, (n,); see `rmrc.results.tally`."""
        floor = np.minimum(self.law.rate_limit, 0.1 * self.law.acceleration_limit)
        return tuple(np.where(np.isfinite(floor), floor, CHATTER_FLOOR).tolist())

    @cached_property
    def expected_profile(self) -> Profile | None:
        """The profile that the commands are checked against."""
        name = self.scenario.expect.get(PROFILE)
        return load_profile(name) if isinstance(name, str) else None

    @cached_property
    def assumed(self) -> tuple[Assumed, ...]:
        """The deviations of the run from the model as its author wrote it, and the missing limits."""
        arm, law, physics = self.arm, self.law, self.plant.has_physics
        limits = {
            "rate": law.rate_limit,
            "acceleration": law.acceleration_limit,
            "torque": arm.torque_limit if physics else np.zeros(arm.n),
            "position": np.abs(law.position_limit).max(axis=0),
        }
        missing = []
        for name, limit in limits.items():
            joints = [joint for joint, one in zip(arm.joints, limit, strict=True) if np.isinf(one)]
            if joints:
                which = "all joints" if len(joints) == arm.n else listed(joints)
                missing.append(Assumed(f"no {name} limit: {which}", False))
        if arm.moves_at(self.scenario.arm.start):
            missing.append(Assumed("a start at rest: the keyframe's velocities are ignored", True))
        return (*self.plant.assumed(), *self._by_profile(), *self._unseen(), *missing)

    def _unseen(self) -> Iterator[Assumed]:
        """Yield warnings that a recording cannot show the quantity or time of `look`."""
        look, slows = self.scenario.look, POLICIES[self.scenario.control.at_singularity].slows
        if look is None:
            return
        has = {
            "torque": self.plant.has_physics, "pace": slows, "belief": self.hardware.moves_q,
            "rotation": any(axis.startswith("r") for axis in self.scenario.task.axes),
        }  # fmt: skip
        end = self.most_ticks * self.scenario.control.period
        if not has.get(look.quantity, True):
            yield Assumed(f"cannot be shown: the run has no {look.quantity}", True)
        elif look.at is not None and look.at > end:
            yield Assumed(f"cannot be shown: the run ends before look.at, {look.at:g} s", True)

    def _by_profile(self) -> Iterator[Assumed]:
        """Yield the settings of the profile in `control.limits`, except for keys that the scenario sets."""
        control = self.scenario.control
        if control.limits.profile is None:
            return
        profile, texts = load_profile(control.limits.profile), []
        if profile.period and control.period == profile.period.value:
            texts.append(f"control.period {control.period:g}")
        for key, values in profile.limits.items():
            if getattr(control.limits, key) == values:
                same = len(set(values)) == 1
                texts.append(f"control.limits.{key} {inline(values[0] if same else list(values))}")
        yield Assumed(f"by profile {profile.name}: {', '.join(texts) or 'nothing'}", True)

    def with_encoder_seed(self, seed: int) -> "Prepared":
        """Return the same world with encoder offsets drawn anew, without loading or timing anything again.

        Args:
            seed: Replaces `arm.encoder.seed`.
        """
        return replace(self, scenario=self.scenario.set({"arm.encoder.seed": seed}))


def prepare(scenario: Scenario, cache: Cache | None = None) -> Prepared:
    """Load the arm, check everything that needs it, and time the target.

    Args:
        scenario: A scenario.
        cache: Cache of earlier results, extended here.

    Raises:
        ScenarioError: Lists all problems, with file, line and key.
    """
    cache = cache or Cache()
    try:
        arm = cache.arm(scenario.arm)
        arm.require_open()
    except ModelError as error:
        raise ScenarioError([scenario.problem(f"arm.{error.about}", str(error))]) from None
    tell_assumed(note for note in arm.notes if note != arm.obvious or scenario.arm.site is None)
    problems = Problems(scenario)
    believed = _start(scenario, arm, problems)
    arm = cache.placed(arm, scenario.arm, believed)
    _check_profiles(scenario, arm, problems)
    _check_lengths(scenario, arm, problems)
    _check_stretch(scenario, arm, problems)
    qpos = _true_start(scenario, arm, believed, problems)
    _check_scales(scenario, problems)
    hardware = cache.hardware(scenario, arm)
    for stage in hardware.stages:
        problems.extend(stage.misfits())
    problems.extend(fit.method_misfits(scenario.control, len(scenario.task.axes), arm))
    problems.extend(fit.second_task_misfits(scenario.control, arm))
    problems.extend(fit.slow_misfits(scenario.control, arm, arm.path))
    problems.extend(hardware.plant.misfits())
    problems.raise_any()
    _doubt_start(scenario, arm)
    try:
        reference = cache.reference(scenario, arm, believed[arm.wiring.qpos])
    except TargetError as error:
        key, _, text = str(error).partition(": ")
        raise ScenarioError([scenario.problem(key, text)]) from None
    held = arm.held(scenario.arm.start, qpos, own=PLANTS[scenario.plant.kind].own)
    prepared = Prepared(scenario, arm, qpos, held, reference, cache)
    vars(prepared)["hardware"] = hardware  # found before
    _check_duration(prepared, problems)
    problems.extend(hardware.excesses(prepared.most_ticks))
    problems.raise_any()
    return prepared


def _start(scenario: Scenario, arm: Arm, problems: Problems) -> NDArray[np.float64]:
    start = scenario.arm.start
    if not isinstance(start, str) and len(start) != arm.n:
        problems.add("arm.start", fit.wrong_length(len(start), arm))
        start = "home"
    try:
        qpos = arm.configuration(start)
    except ModelError as error:
        problems.add("arm.start", f"{error}{_positions_instead(start, arm)}")
        return np.array(arm.model.qpos0)
    for j, position in enumerate(qpos[arm.wiring.qpos]):
        lower, upper = arm.position_limit[j]
        if not lower <= position <= upper:
            key = "arm.start" if isinstance(start, str) else f"arm.start[{j}]"
            problems.add(
                key,
                f'joint "{arm.joints[j]}" must start within its limits [{lower:.6g}, {upper:.6g}] '
                f"{arm.units[j]}, got {position:.6g}{_in_degrees(arm, j, position)}",
            )
    if scenario.arm.pose is not None:
        own = [*arm.wiring.qpos, *arm.wiring.follower_qpos]
        try:
            placed = arm.at(qpos)
            q = start_positions(placed, scenario.arm.pose, qpos[arm.wiring.qpos], scenario.task.length)
        except TargetError as error:
            problems.add("arm.pose", str(error))
        else:
            qpos[own] = arm.configuration(q)[own]
    return qpos


def _check_stretch(scenario: Scenario, arm: Arm, problems: Problems) -> None:
    try:
        check_stretch(arm.path, arm.model, scenario.plant.stretch)
    except ModelError as error:
        problems.add(f"plant.{error.about}", str(error))


def _true_start(
    scenario: Scenario, arm: Arm, believed: NDArray[np.float64], problems: Problems
) -> NDArray[np.float64]:
    """Return the true configuration, (nq,), of an arm with the positions that the law assumes."""
    offset = scenario.plant.joint_offset
    if not np.any(offset) or (isinstance(offset, tuple) and len(offset) != arm.n):
        return believed
    q = believed[arm.wiring.qpos] + offset
    for name, position, (lower, upper), unit in zip(
        arm.joints, q, arm.position_limit, arm.units, strict=True
    ):
        if not lower <= position <= upper:
            problems.add(
                "plant.joint_offset",
                f'puts joint "{name}" at {position:.6g} {unit} at the start, beyond its limits [{lower:.6g}, '
                f"{upper:.6g}] {unit}; lower it, or start elsewhere",
            )
    return arm.placed(believed, q)


def _in_degrees(arm: Arm, j: int, position: float) -> str:
    """Return the hint for a position beyond a turn that would be within the limits in degrees."""
    lower, upper = arm.position_limit[j]
    if arm.is_slide[j] or abs(position) <= math.tau or not lower <= math.radians(position) <= upper:
        return ""
    return f"; for degrees write {position:.6g} deg"


def _doubt_start(scenario: Scenario, arm: Arm) -> None:
    """Warn of a joint without limits that starts beyond a turn, as if it were in degrees."""
    start = scenario.arm.start
    for j, position in enumerate(() if isinstance(start, str) else start):
        if way := _in_degrees(arm, j, position):
            key = f"arm.start[{j}]"
            turns = f"{position:.6g} rad are {abs(position) / math.tau:.3g} turns"
            tell(f"warning: {scenario.locate(key)}: {turns}{way}", once=key)


def _positions_instead(start: object, arm: Arm) -> str:
    """Return the hint for positions in place of a keyframe's name."""
    if not isinstance(start, str):
        return ""
    if start.strip().lower() in ("zero", "zeros", "null"):
        return f"; write [{', '.join('0' for _ in arm.joints)}] for all joints at zero"
    try:
        angle(start)
    except ValueError:
        return ""
    return f"; write [{', '.join([start.strip()] * arm.n)}], a position for each joint"


def _check_profiles(scenario: Scenario, arm: Arm, problems: Problems) -> None:
    """Refuse a profile of another robot, or with conditions for another period."""
    limits, expected = scenario.control.limits.profile, scenario.expect.get(PROFILE)
    for key, name in (("control.limits.profile", limits), ("expect.profile", expected)):
        if not isinstance(name, str):
            continue
        profile, period = load_profile(name), scenario.control.period
        if profile.joints != arm.n:
            problems.extend(fit.profile_misfits(key, name, arm))
            continue
        published = profile.period.value if profile.period else period
        differs = abs(published - period) > 1e-9 * period
        if key == "expect.profile" and differs and (profile.acceleration or profile.jerk):
            problems.add(
                key,
                f"{profile.name} bounds the differences of commands that are {published:g} s apart, and "
                f"control.period is {period:g} s; write control.period: {published:g}",
            )


def _check_lengths(scenario: Scenario, arm: Arm, problems: Problems) -> None:
    for key, values in (
        ("arm.encoder.offset", scenario.arm.encoder.offset),
        ("arm.encoder.deviation", scenario.arm.encoder.deviation),
        ("arm.encoder.noise", scenario.arm.encoder.noise),
        ("arm.encoder.resolution", scenario.arm.encoder.resolution),
        ("plant.friction.coulomb", scenario.plant.friction.coulomb),
        ("plant.friction.viscous", scenario.plant.friction.viscous),
        ("plant.joint_offset", scenario.plant.joint_offset),
        ("plant.lag", scenario.plant.lag),
        ("plant.backlash", scenario.plant.backlash),
        *((f"plant.{one.key}", getattr(scenario.plant, one.key)) for one in PLANTS.parameters),
    ):
        if isinstance(values, tuple) and len(values) != arm.n:
            problems.add(key, fit.wrong_length(len(values), arm))
    problems.extend(fit.length_misfits(scenario.control, arm))


def _check_scales(scenario: Scenario, problems: Problems) -> None:
    task = scenario.task
    problems.extend(fit.scale_misfits("task.length", (task.length,), is_list=False))
    problems.extend(fit.scale_misfits("task.weights", task.weights or ()))
    problems.extend(fit.scale_misfits("control.joint_weights", scenario.control.joint_weights or ()))


# 285 years [s]; beyond them, nanoseconds do not fit into 64 bits.
_LONGEST = 9e9


def _check_duration(prepared: Prepared, problems: Problems) -> None:
    """Refuse a run that is too long for the time of recordings, 64 bits of nanoseconds."""
    period = prepared.scenario.control.period
    if not prepared.most_ticks * period < _LONGEST:
        problems.add(
            "target.path",
            f"takes up to {prepared.most_ticks} control periods of {period:g} s, which is more than "
            f"{_LONGEST:g} s; raise target.limits, lower control.period or control.slow.longest, or shorten "
            "the path",
        )


def writers(prepared: Prepared, reference: int) -> tuple[Writer, ...]:
    """Return the Writers of a world's record.

    Args:
        prepared: The world.
        reference: Index of its reference in the batch.
    """
    course = Course(reference, prepared.reference.ticks, prepared.most_ticks)
    return prepared.task, prepared.law, course, prepared.hardware


def world_records(prepared: Sequence[Prepared], references: Sequence[int]) -> NDArray[np.void]:
    """Return the records of worlds whose arms have the same joints, (w,): by `writers`, not yet wired."""
    beside = (*WIRING, *Hardware.memory)
    arm = prepared[0].arm
    every = list(map(writers, prepared, references))
    # a Writer of several worlds writes the record of the first, which the others copy
    sharing: dict[int, tuple[Writer, list[int]]] = {}
    for w, writer in ((w, writer) for w, of_world in enumerate(every) for writer in of_world):
        sharing.setdefault(id(writer), (writer, []))[1].append(w)
    own = [[one for one in of_world if sharing[id(one)][1][0] == w] for w, of_world in enumerate(every)]
    made = records(arm.n, *own, beside=beside, axes=arm.n + len(arm.followers))
    for writer, (first, *others) in sharing.values():
        for name in (one.name for one in writer.fields if others):
            made[name][others] = made[name][first]
    return made
