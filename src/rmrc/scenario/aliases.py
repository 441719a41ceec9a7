"""Other names of keys and choices, so that a message can name the accepted one.

Other tools, papers and people use them. None is accepted: a file has one meaning only.
"""

import re
from collections.abc import Iterator
from functools import cache
from typing import Any

from rmrc.scenario import choices
from rmrc.scenario.schema import schema_rows
from rmrc.scenario.wording import show
from rmrc.support.problems import Key, join

# Other names of choices, by key.
CHOICES: dict[str, dict[str, str]] = {
    **{
        f"control.{one.key}": {option.name: option.others for option in one.options}
        for one in choices.CHOICES
    },
    "plant.kind": {option.name: option.others for option in choices.PLANTS.options},
    "sweep.sampler": {
        "random": "uniform monte_carlo mc rand",
        "sobol": "qmc quasi_random low_discrepancy halton lhs latin_hypercube",
    },
    "task.axes": {
        "x, y, z": "pos position xyz translation linear",
        "rx, ry, rz": "rot rotation orientation angular rpy ori",
        "x, y, z, rx, ry, rz": "all pose full 6d se3",
        "x": "px tx",
        "y": "py ty",
        "z": "pz tz",
        "rx": "wx roll ox",
        "ry": "wy pitch oy",
        "rz": "wz yaw theta oz",
    },
    "target.path": {
        "line": "linear straight lin movel move ptp goto point waypoint segment to",
        "arc": "circle circular circ movec",
        "turn": "rotate rotation orient orientation spin",
        "tilt": "align point_at aim look_at",
        "set": "step setpoint set_point jump",
        "configurations": "joint_path keyframes postures configuration",
        "file": "csv motion recording replay teleop",
        "hold": "wait pause dwell sleep stay stop",
    },
}
CHOICES["control.nullspace.secondary.axes"] = CHOICES["task.axes"]

# Other names of keys.
KEYS = {
    "arm": "robot manipulator",
    "arm.model": "xml mjcf urdf file robot_model model_file model_path",
    "arm.site": "tcp ee end_effector effector tip frame tool_frame",
    "arm.body": "link tip_link ee_link tool_link",
    "arm.packages": "package package_dirs ros_packages",
    "arm.start": "q q0 qpos init initial home joint_positions start_q q_start configuration",
    "arm.encoder.deviation": "std sigma stddev",
    "arm.encoder.resolution": "quantization quantum step lsb",
    "arm.encoder.delay": "latency age dead_time",
    "task": "tasks",
    "task.axes": "axis rows dof dofs",
    "task.length": "characteristic_length",
    "task.weights": "w wx w_x",
    "control": "controller law",
    "control.period": "dt time_step timestep step frequency rate hz ts sample_time cycle",
    "control.feedback": "k kp gain p_gain k_p",
    "control.feedforward": "ff feed_forward",
    "control.inverse": "solver ik algorithm",
    "control.inverse.damping": "dls",
    "control.inverse.damping.maximum": "lambda max lambda_max damping_factor value factor max_damping",
    "control.inverse.damping.below": "epsilon eps threshold",
    "control.inverse.damping.manipulability_below": "w0 w_0",
    "control.inverse.tolerance": "tol rcond",
    "control.nullspace": "null_space redundancy",
    "control.limits.rate": "velocity qdot qdot_max max_rate joint_velocity joint_rate speed"
    " rates velocities max_velocity",
    "control.limits.acceleration": "accel qddot qddot_max max_acceleration",
    "control.limits.jerk": "qdddot max_jerk joint_jerk",
    "control.joint_weights": "wq w_q",
    "target": "trajectory goal reference",
    "target.path": "waypoints points segments pieces",
    "target.limits": "profile constraints",
    "target.limits.velocity": "speed v vmax v_max max_velocity max_speed vel",
    "target.limits.acceleration": "a amax a_max max_acceleration accel acc",
    "target.limits.jerk": "max_jerk",
    "target.limits.angular_velocity": "omega rotation_velocity",
    "target.path.line.to": "end goal point position target",
    "target.path.line.by": "delta offset relative distance",
    "target.path.arc.center": "centre middle c",  # codespell:ignore centre
    "target.path.arc.angle": "degrees sweep",
    "target.path.hold.for": "duration time seconds t",
    "plant": "simulation sim physics dynamics",
    "plant.kind": "type mode",
    "plant.kv": "gain kp kd",
    "plant.timestep": "dt step time_step",
    "plant.payload": "mass load",
    "plant.wrench": "force disturbance external_force",
    "plant.gravity_compensation": "gravcomp gravity_comp",
    "plant.delay": "latency dead_time deadtime transport_delay",
    "plant.jitter": "delay_jitter latency_jitter",
    "plant.loss": "packet_loss drop dropout drop_rate",
    "plant.lag": "time_constant timeconst",
    "plant.backlash": "play deadband dead_band lost_motion gear_play",
    "plant.resonance": "oscillation flexibility",
    "plant.resonance.frequency": "freq f hz natural_frequency",
    "plant.resonance.damping": "zeta damping_ratio",
    "expect": "expected assert checks check expectations",
    "expect.<metric>.below": "less_than max maximum lt < <= at_most upper",
    "expect.<metric>.above": "greater_than min minimum gt > >= at_least lower more_than",
    "expect.<metric>.equals": "equal is value == =",
    "expect.<metric>.within": "tolerance tol",
    "sweep.vary": "grid values",
    "sweep.draw": "random sobol bounds ranges",
    "sweep.samples": "n count",
}

# Keys that do not exist: the reason.
NONE = {
    "target.path.arc.radius": "it is the distance of the center from the end of the previous segment",
    "target.path.line.from": "each segment starts at the end of the previous one",
    "target.path.arc.from": "each segment starts at the end of the previous one",
    "target.path.line.velocity": "all segments have the speed target.limits.velocity",
    "target.path.arc.velocity": "all segments have the speed target.limits.velocity",
    **dict.fromkeys(("description", "title", "comment", "notes", "author"), "write it as a comment: # ..."),
}

# Mappings: the spelling for a value in their place, by the value's type.
INSTEAD: dict[str, dict[type, str]] = {
    "arm": {str: "{{model: {}, site: ...}}"},
    "arm.start": {dict: "the pose under arm.pose, the result of a search from arm.start"},
    "arm.encoder": {float: "{{offset: {}}}", list: "{{offset: {}}}"},
    "arm.stretch": {float: "{{BODY: {}}}"},
    "plant.stretch": {float: "{{BODY: {}}}"},
    "plant.friction": {float: "{{coulomb: {}}}", list: "{{coulomb: {}}}"},
    "task": {list: "{{axes: {}}}", str: "{{axes: [{}]}}"},
    "control": {str: "{{inverse: {{method: {}}}}}"},
    "control.inverse": {str: "{{method: {}}}"},
    "control.inverse.damping": {float: "{{schedule: constant, maximum: {}}}", str: "{{schedule: {}}}"},
    "control.nullspace": {str: "{{objective: {}}}", bool: "{{objective: none}}"},
    "control.nullspace.secondary": {str: "{{site: {}}}"},
    "control.limits": {float: "{{rate: {}}}", list: "{{rate: {}}}", str: "{{on_excess: {}}}"},
    "control.slow": {bool: "control.at_singularity: slow"},
    "control.stop": {bool: "control.at_singularity: stop", float: "{{sigma: {}}}"},
    "target": {list: "{{path: {}}}"},
    "target.limits": {float: "{{velocity: {}}}"},
    "target.path.line": {list: "{{to: {}}}"},
    "target.path.arc": {list: "{{center: {}, angle: 360 deg}}", float: "{{center: [x, y], angle: {}}}"},
    "target.path.turn": {str: "{{axis: z, angle: {}}}", float: "{{axis: z, angle: {}}}", list: "{{to: {}}}"},
    "target.path.line.turn": {str: "{{axis: z, angle: {}}}", float: "{{axis: z, angle: {}}}"},
    "target.path.hold": {float: "{{for: {}}}"},
    "plant": {str: "{{kind: {}}}"},
    "expect": {},
    "expect.<metric>": {float: "{{below: {}}}"},
}

# Lists: an example.
EXAMPLES = {
    "target.path": "[{line: {to: [x, y]}}]",
    "target.path.line.to": "[x, y], or [x, y, z]",
    "target.path.line.by": "[dx, dy], or [dx, dy, dz]",
    "target.path.arc.center": "[x, y], or [x, y, z]",
    "target.path.turn.to": "[w, x, y, z], a quaternion",
    "target.offset": "[dx, dy, dz]",
    "plant.wrench": "[fx, fy, fz, nx, ny, nz]",
    "plant.gravity": "[0, 0, -9.81]",
}


def dotted(key: Key) -> str:
    """Return a key as this module has it: without indices of items, and with one name for all metrics."""
    if len(key) > 1 and key[0] == "expect":
        return join(("expect", "<metric>", *key[2:]))
    return join(tuple(step for step in key if isinstance(step, str)))


def choice(key: Key, value: object) -> str:
    """Return the accepted name of a choice for another name of it, or an empty text."""
    ours = CHOICES.get(dotted(key), {})
    return next((name for name, others in ours.items() if _plain(value) in others.split()), "")


def key_called(key: Key) -> str:
    """Return the accepted name of a key for an unknown one beside it, or an empty text."""
    *above, name = key
    section = dotted(tuple(above))
    for place in _places(str(name), exact=False):
        if place.rpartition(".")[0] == section:
            return place.rpartition(".")[2]
    return ""


def elsewhere(key: Key) -> str:
    """Return the nearest place where a key exists that is unknown where it was found, or an empty text."""
    *above, name = key
    near = dotted(tuple(above)).split(".")
    places = list(_places(str(name), exact=True)) or list(_places(str(name), exact=False))

    def far(place: str) -> tuple[int, int]:
        steps = place.split(".")
        common = next((i for i, (a, b) in enumerate(zip(steps, near, strict=False)) if a != b), len(near))
        return -min(common, len(steps)), len(steps)

    return min(places, key=far, default="")


def place_of(name: str) -> str:
    """Return the key that a single name most likely means, or an empty text."""
    return elsewhere((name,))


def mapping(key: Key, value: object) -> str:
    """Return the mapping to write for a value in its place, or an empty text."""
    forms = INSTEAD.get(dotted(key), {})
    kind: type = float if isinstance(value, int) and not isinstance(value, bool) else type(value)
    if kind not in forms:
        return ""
    if isinstance(value, str):
        ours = next((choice((*key, name), value) for name in ("method", "objective", "kind", "schedule")
                     if choice((*key, name), value)), value)  # fmt: skip
        return forms[kind].format(ours) if len(value) <= 40 else ""
    return forms[kind].format(show(value))


def listing(key: Key, value: object, is_text: bool) -> str:
    """Return the list to write for a value in its place, or an empty text.

    Args:
        key: Key of the list.
        value: A value that is not a list.
        is_text: Whether the items are texts.
    """
    where = dotted(key)
    if where in EXAMPLES:
        return EXAMPLES[where]
    if where.endswith("axes") and isinstance(value, str):
        known = choice(key, value)
        rows = re.findall(r"r?[xyz]", value) if re.fullmatch(r"(?:r?[xyz][\s,;]*)+", value) else []
        return f"[{known or ', '.join(rows)}]" if known or rows else ""
    if isinstance(value, str) and 0 < len(value) <= 60:
        return f"[{', '.join(re.split(r'[,;]? +|[,;]', value.strip('[]() ')))}]" if is_text else ""
    return f"[{show(value)}]" if isinstance(value, int | float) and not is_text else ""


# Spellings that YAML reads as false, true and null.
_YAML = {False: "false", True: "true", None: "null"}


def _plain(value: object) -> str:
    text = _YAML.get(value, "") if value is None or isinstance(value, bool) else str(value)
    return re.sub(r"[\s-]+", "_", text.strip().lower())


def _places(name: str, exact: bool) -> Iterator[str]:
    """Yield the keys that have a name, or an alias of that name."""
    name = _plain(name)
    if exact:
        yield from (place for place in _all() if place.rpartition(".")[2] == name)
    else:
        yield from (place for place, others in KEYS.items() if name in others.split())


@cache
def _all() -> tuple[str, ...]:
    """Return all keys and sections."""
    found: dict[str, Any] = {}
    for row in schema_rows():
        steps = row.key.replace("[]", "").split(".")
        found |= dict.fromkeys(".".join(steps[: i + 1]) for i in range(len(steps)))
    return tuple(found)
