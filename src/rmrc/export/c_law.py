"""The law of a scenario for programs in C: an object for x86-64 and one for aarch64, and how to call them.

The record of a `Controller` before its first step, with the addresses of its methods, is a constant in the
object. `rmrc_law_init` copies it into the caller's memory; a step reads and writes nothing else.
"""

import math
import sys
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from string import Template

import numpy as np

import rmrc
from rmrc.export.objects import name_of, object_file, program
from rmrc.law.compiling import Method, Record, at
from rmrc.law.controller import Controller
from rmrc.law.record import POSE, TWIST, field_offset
from rmrc.law.step import PLACED, RATES, TIMED, step
from rmrc.law.svd import copy
from rmrc.scenario import Scenario
from rmrc.scenario.choices import Status
from rmrc.simulation.prepare import prepare
from rmrc.support.errors import QuestionError
from rmrc.support.files import write_text, written_whole

OBJECTS = {"law.o": "x86_64-unknown-linux-gnu", "law_aarch64.o": "aarch64-unknown-linux-gnu"}
INIT, STEP = "rmrc_law_init", "rmrc_law_step"

# What a step finds, its group and field in the record, and what it is.
_PLACES = {
    "Q_CMD": ("input", "q_cmd", "positions, the integral of the rates, for joints that take these, (n)"),
    "POSE": ("tick", "pose", "pose of the site [x y z, quat w x y z]"),
    "POSE_ERROR": ("tick", "pose_error", "error of position and rotation along the axes of the task, (6)"),
    "SIGMA": ("first", "sigma", "singular values, falling, (min(rows of the task, n))"),
    "DAMPING": ("first", "damping", "lambda"),
    "MANIPULABILITY": ("tick", "manipulability", "product of the singular values"),
    "CONDITION": ("tick", "condition", "ratio of the largest singular value to the smallest"),
    "PATH_RATE": ("tick", "path_rate", "periods by which to advance the target, 1 or less"),
}


@Method
def receive(world: Record, q: int, qdot: int, pose: int, twist: int, dt: float) -> None:
    """Take the input of a step from addresses, of which those of qdot, pose and twist may be 0."""
    state, tick, bits = world.state, world.tick, PLACED
    copy(at(q, world.n), state.q, world.n)
    for j in range(world.n):
        state.qdot[j] = math.nan
    if qdot != 0:
        bits |= RATES
        copy(at(qdot, world.n), state.qdot, world.n)
    if pose != 0:
        bits |= POSE
        copy(at(pose, 7), tick.pose_ref, 7)
    if twist != 0:
        bits |= TWIST
        copy(at(twist, 6), tick.twist_ref, 6)
    if dt != 0.0:
        bits |= TIMED
        world.input.dt = dt
    world.input.given = bits


def export(scenario: Scenario, folder: Path) -> list[Path]:
    """Write the law of a scenario into a folder; return the files.

    Args:
        scenario: The scenario.
        folder: The folder, made if missing.

    Raises:
        QuestionError: This system, or the law of this scenario, cannot be exported.
        ScenarioError: The scenario has a fault.
    """
    if sys.platform != "linux":
        raise QuestionError(f"export writes objects for Linux, on Linux; this is {sys.platform}")
    if scenario.control.state == "integrated":
        raise QuestionError(
            'control.state "integrated" cannot be exported, as a step takes the positions that it gets: '
            "leave it out, and pass the words from RMRC_LAW_Q_CMD on as q"
        )
    prepared = prepare(scenario)
    arm, start = prepared.arm, prepared.qpos[prepared.arm.wiring.qpos]
    controller = Controller(arm, control=scenario)
    controller.reset(start)
    if controller.unseen:
        raise QuestionError(f"{arm.path}: {controller.unseen}, and C has no MuJoCo; actuate the joint")
    world, methods = controller.beginning()
    code = program([*methods.values(), step, receive], world["limits"]["rate"].shape[-1])
    texts = {
        "name": scenario.name,
        "version": rmrc.__version__,
        "arm": arm.path.name,
        "n": str(arm.n),
        "joints": ", ".join(arm.joints).replace("*/", "* /"),  # a name must not end the comment
        "words": str(world.nbytes // 8),
        "period": repr(controller.period),
        "start": ", ".join(map(repr, start.tolist())),
        "places": "\n".join(
            f"  RMRC_LAW_{name} = {_word(world, group, field)}, /* {text} */"
            for name, (group, field, text) in _PLACES.items()
        ),
        "statuses": "\n".join(f"  RMRC_LAW_{bit.name} = {int(bit)}," for bit in Status),
    }
    entries, written = _entries(world, methods), list[Path]()
    for source in sorted(files("rmrc.export").joinpath("c").iterdir(), key=lambda file: file.name):
        written.append(folder / source.name)
        write_text(written[-1], Template(source.read_text("utf-8")).safe_substitute(texts))
    for name, triple in OBJECTS.items():
        written.append(folder / name)
        with written_whole(written[-1]) as temporary:
            temporary.write_bytes(object_file(code, triple, (INIT, STEP), entries))
    return written


def _entries(world: np.void, methods: Mapping[str, Method]) -> str:
    """Return the functions of `law.h` in the language of LLVM, with the record of a world as a constant."""
    words = list(map(str, np.frombuffer(world.tobytes(), np.int64)))
    for field, method in methods.items():
        words[_word(world, "methods", field)] = f'ptrtoint (ptr @"{name_of(method)}" to i64)'
    names = sorted(set(map(name_of, methods.values())))
    declared = "\n".join(f'declare void @"{name}"(...)' for name in names)
    inputs = ("q", "qdot", "pose", "twist")
    taken = "\n".join(f"  %{name}_at = ptrtoint ptr %{name} to i64" for name in inputs)
    passed = ", ".join(f"i64 %{name}_at" for name in inputs)
    return f"""{declared}
declare void @"{name_of(step)}"(ptr)
declare void @"{name_of(receive)}"(ptr, i64, i64, i64, i64, double)
declare ptr @memmove(ptr, ptr, i64)
@start = internal constant [{len(words)} x i64] [{", ".join(f"i64 {word}" for word in words)}]
define void @{INIT}(ptr %state) {{
  %same = call ptr @memmove(ptr %state, ptr @start, i64 {world.nbytes}) nobuiltin
  ret void
}}
define i64 @{STEP}(ptr %state, ptr %q, ptr %qdot, ptr %pose, ptr %twist, double %dt, ptr %qdot_cmd) {{
{taken}
  call void @"{name_of(receive)}"(ptr %state, {passed}, double %dt)
  call void @"{name_of(step)}"(ptr %state)
  %rates = getelementptr i64, ptr %state, i64 {_word(world, "tick", "qdot_cmd")}
  call ptr @memmove(ptr %qdot_cmd, ptr %rates, i64 {8 * int(world["n"])})
  %place = getelementptr i64, ptr %state, i64 {_word(world, "tick", "status")}
  %status = load i64, ptr %place
  ret i64 %status
}}
"""


def _word(world: np.void, group: str, field: str) -> int:
    """Return the index of the first word of a field."""
    return field_offset(world.dtype, group, field) // 8
