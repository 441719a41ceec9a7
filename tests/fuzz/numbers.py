"""Extreme numbers that a scenario may have: every one is within what its key allows."""

from rmrc.scenario.choices import INVERSES, LIMITS, OBJECTIVES, PLANTS, POLICIES, SCHEDULES

from . import shipped
from .case import Case

# Between these a run is merely long: millions of ticks that somebody may well want.
LONG = {
    "control.period": ((-8, -5), (1, 8)), "duration": ((1, 6),), "pace": ((-8, -2),), "plant.timestep": ((-14, -5),),
}  # fmt: skip

POSITIVE = (
    "task.length", "control.inverse.cutoff", "control.inverse.rate_bound", "control.inverse.damping.maximum", "control.inverse.damping.below",
    "control.inverse.damping.manipulability_below", "control.inverse.damping.error_gain", "control.limits.rate", "control.limits.acceleration",
    "control.limits.jerk", "control.limits.braking", "control.slow.change", "control.slow.patience", "control.stop.sigma", "control.stop.change", "plant.kv", "plant.bandwidth",
)  # fmt: skip
NOT_NEGATIVE = (
    "control.feedback",
    "control.nullspace.gain",
    "plant.payload",
    "arm.encoder.deviation",
    "control.nullspace.secondary.feedback",
    "control.nullspace.secondary.damping",
)
SHARES = ("control.inverse.tolerance", "control.inverse.gamma")
PACES = ("velocity", "acceleration", "jerk", "angular_velocity", "angular_acceleration", "angular_jerk")
CHOICES = {
    "control.inverse.method": [one.name for one in INVERSES.options if not one.needs_square],
    "control.inverse.damping.schedule": SCHEDULES.names,
    "control.nullspace.objective": [
        name for name in OBJECTIVES.names if name != "rates"
    ],  # which needs a list
    "control.limits.on_excess": LIMITS.names,
    "control.limits.position": ("true", "false"),
    "control.at_singularity": POLICIES.names,
    "control.feedforward": ("true", "false"),
    "plant.kind": PLANTS.names,
    "plant.gravity_compensation": ("true", "false"),
}
ENDS = (
    "5.0e-324",
    "2.2250738585072014e-308",
    "1.0e-300",
    "1.0e-154",
    "1.0e-16",
    "1.0e-9",
    "1.0e-3",
    "1.0",
    "1.0e+3",
    "1.0e+9",
    "1.0e+16",
    "1.0e+154",
    "1.0e+300",
    "1.7976931348623157e+308",
)


def generate(chance):
    """Return a case: a shipped scenario with extreme numbers, all of them allowed."""
    name = chance.pick(list(shipped.scenarios()))
    model = shipped.model_of(name)
    sets = {
        f"target.limits.{pace}": value
        for pace, value in zip(PACES, ("30", "1.0e+4", "1.0e+8") * 2, strict=True)
    }
    if chance.odds(0.3):
        sets["target.path"] = _path(chance)
    for _ in range(chance.weighted({1: 4, 2: 4, 4: 2, 8: 1})):
        key, value = _setting(chance, model)
        sets[key] = value
    verb = chance.weighted({"run": 90, "recorded": 3, "compare": 2, "sweep": 5})
    argv = {
        "run": ["run", "--no-record", *chance.pick(([], ["-q"]))],
        "recorded": ["run"],
        "compare": ["compare", "--no-record", "--vary", f"control.feedback={_positive(chance)},1"],
        "sweep": [
            "sweep",
            "--threads",
            "1",
            "--random",
            f"control.feedback=0..{_positive(chance)}",
            "--samples",
            "2",
        ],
    }[verb]
    argv.append(f"../scenarios/{name}.yaml")
    for key, value in sets.items():
        argv += ["--set", f"{key}={value}"]
    return Case(tuple(argv))


def _positive(chance, long=()):
    """Return the text of a positive number of any size, but for those that only take long."""
    while True:
        text = chance.pick(ENDS) if chance.odds(0.4) else chance.decimal(most=307)
        exponent = int(f"{float(text):e}".partition("e")[2])
        if not any(low <= exponent <= high for low, high in long):
            return text


def _signed(chance):
    return "0.0" if chance.odds(0.1) else chance.pick(("", "-")) + _positive(chance)


def _vector(chance, count):
    return "[" + ", ".join("0.0" if chance.odds(0.3) else _signed(chance) for _ in range(count)) + "]"


def _each(chance, model):
    return "[" + ", ".join(_positive(chance) for _ in shipped.joints(model)) + "]"


def _setting(chance, model):
    """Return a key and the text of a value."""
    keys, value = chance.pick(_SETTINGS)
    return chance.pick(keys(model) if callable(keys) else keys), value(chance, model)


# Keys, and how their values are made; each kind as often as it stands here.
_SETTINGS = (
    *((POSITIVE, lambda chance, _: _positive(chance)),) * 4,
    *((NOT_NEGATIVE, lambda chance, _: "0.0" if chance.odds(0.1) else _positive(chance)),) * 2,
    (SHARES, lambda chance, _: chance.pick(("5.0e-324", "1.0e-300", "1.0e-9", "0.5", "0.9999999999999999"))),
    ([f"target.limits.{pace}" for pace in PACES], lambda chance, _: _positive(chance, LONG["pace"])),
    (["control.period"], lambda chance, _: _positive(chance, LONG["control.period"])),
    (["control.period"], lambda chance, _: chance.pick(("0.002", "0.01", "0.1", "1.0"))),
    (["plant.timestep"], lambda chance, _: _positive(chance, LONG["plant.timestep"])),
    (["plant.timestep"], lambda chance, _: chance.pick(("0.0001", "0.0005", "0.001"))),
    (["plant.wrench"], lambda chance, _: _vector(chance, 6)),
    (["plant.gravity", "target.offset"], lambda chance, _: _vector(chance, 3)),
    (lambda model: [f"arm.stretch.{body}" for body in shipped.bodies(model)], lambda chance, _: _positive(chance)),
    (["control.joint_weights", "control.limits.rate", "control.limits.jerk", "control.limits.braking", "plant.kv"], _each),
    (["arm.encoder.offset", "control.stop.condition"], lambda chance, _: _positive(chance)),
    (["control.slow.longest", "arm.encoder.seed"], lambda chance, _: chance.pick(("1", "2", "1000", "9223372036854775807"))),
    (["control.nullspace.posture"], lambda chance, model: _vector(chance, len(shipped.joints(model)))),
    *(([key], lambda chance, _, values=values: chance.pick(values)) for key, values in CHOICES.items()),
)  # fmt: skip


def _path(chance):
    """Return a path: few pieces or many, tiny or huge."""
    pieces = []
    for _ in range(chance.weighted({1: 5, 2: 3, 4: 1})):
        kind = chance.under(6)
        if kind < 2:
            pieces.append(f"{{line: {{by: {_vector(chance, chance.pick((2, 3)))}}}}}")
        elif kind == 2:
            pieces.append(
                f"{{line: {{to: {_vector(chance, chance.pick((2, 3)))}, turn: {{axis: {_vector(chance, 3)}, angle: {_signed(chance)}}}}}}}"
            )
        elif kind == 3:
            pieces.append(
                f"{{arc: {{center: {_vector(chance, 3)}, axis: {chance.pick(('x', 'y', 'z', _vector(chance, 3)))}, angle: {chance.pick(('', '-'))}{_positive(chance)}}}}}"
            )
        elif kind == 4:
            turn = (
                f"to: {_vector(chance, 4)}"
                if chance.odds(0.4)
                else f"axis: {_vector(chance, 3)}, angle: {_signed(chance)}"
            )
            pieces.append(f"{{turn: {{{turn}}}}}")
        else:
            pieces.append(f"{{hold: {{for: {_positive(chance, LONG['duration'])}}}}}")
    return "[" + ", ".join(pieces * chance.weighted({1: 30, 10: 3, 200: 0.3})) + "]"
