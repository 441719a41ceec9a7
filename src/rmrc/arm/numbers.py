"""Every number of a compiled model is finite, and none is so large that its powers are not.

MuJoCo compiles a NaN or an infinity of a file without an error, and its steps then give nonsense.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm.names import KINDS, called, count
from rmrc.support.errors import ModelError

# The largest length or position [m, rad]: those are kept to 1e-10. The largest other number: its tenth
# power is finite, and no equation here has a higher one.
FARTHEST, LARGEST = 1e6, 1e30

# MJCF's attribute for a field `kind_rest`, `rest`, where it has another name.
_ATTRIBUTES = {
    "body_quat": "orientation",
    "body_ipos": "inertial pos",
    "body_iquat": "inertial orientation",
    "body_mass": "mass of its inertial or geoms",
    "body_inertia": "inertia of its inertial or geoms",
    "jnt_actfrcrange": "actuatorfrcrange",
    "jnt_solref": "solreflimit",
    "jnt_solimp": "solimplimit",
    "jnt_stiffnesspoly": "stiffness",
    "dof_dampingpoly": "damping",
    "dof_solref": "solreffriction",
    "dof_solimp": "solimpfriction",
    "geom_quat": "orientation",
    "geom_fluid": "fluidcoef",
    "site_quat": "orientation",
    "cam_quat": "orientation",
    "eq_data": "data (anchor, relpose, polycoef)",
    "tendon_lengthspring": "springlength",
    "tendon_solref_lim": "solreflimit",
    "tendon_solimp_lim": "solimplimit",
    "tendon_solref_fri": "solreffriction",
    "tendon_solimp_fri": "solimpfriction",
    "actuator_gainprm": "gainprm (kp, kv)",
    "actuator_biasprm": "biasprm (kp, kv)",
    "qpos0": "ref",
    "qpos_spring": "springref",
}  # fmt: skip

# Fields that MuJoCo computes from others: reported last, as the cause is mostly another field. A plane's box
# ends at 1e10.
_DERIVED = (
    "actuator_acc0", "actuator_length0", "actuator_lengthrange", "body_invweight0", "body_subtreemass",
    "bvh_aabb", "dof_M0", "dof_invweight0", "dof_length", "geom_aabb", "geom_rbound", "stat.",
    "tendon_invweight0", "tendon_length0", "tendon_lengthspring",
)  # fmt: skip

# Lengths and positions, by the ends of their field names.
_LENGTHS = ("_pos", "_ipos", "mesh_vert", "geom_size", "site_size", "qpos0", "key_qpos")

# Fields that MuJoCo normalizes, which fails where squares are not finite or all entries are zero.
_UNITS, _ROUNDING = ("jnt_axis", "body_quat", "body_iquat", "site_quat", "geom_quat"), 1e-6

_SHOWN = 8


def check(path: Path, model: mujoco.MjModel) -> None:
    """Check every float of a model.

    Args:
        path: Its file.
        model: The compiled model.

    Raises:
        ModelError: One is NaN or infinite, or too large to compute with; it names element and attribute.
    """
    fields = sorted(_floats(model), key=lambda field: (field[0].startswith(_DERIVED), field[0]))
    # one look at all numbers is nearly always enough for those without a bound of their own
    if np.abs(np.concatenate([values for _, values in fields], axis=None)).max() <= LARGEST:
        fields = [field for field in fields if field[0].endswith((*_LENGTHS, *_UNITS))]
    for name, values in fields:
        # of computed fields, check only for NaN and infinity: one may be the square of a valid number
        most = np.inf if name.startswith(_DERIVED) else FARTHEST if name.endswith(_LENGTHS) else LARGEST
        wrong = ~(np.isfinite(values) & (np.abs(values) <= most))
        if wrong.any():
            row = int(np.argwhere(wrong)[0][0]) if values.ndim else 0
            bound = f"within ±{most:g}" if most < np.inf and np.isfinite(values[wrong]).all() else "finite"
            raise ModelError(f"{path}: {_place(model, name, row)} must be {bound}, got {_shown(values, row)}")
        if name.endswith(_UNITS) and values.size:
            lengths = np.linalg.norm(values, axis=-1)
            row = int(np.argmax(np.abs(lengths - 1.0)))
            if abs(lengths[row] - 1.0) > _ROUNDING:
                what = f"cannot be scaled to a length of 1, got {_shown(values, row)}; write numbers near 1"
                raise ModelError(f"{path}: {_place(model, name, row)} {what}")


def _floats(structure: Any, prefix: str = "") -> Iterator[tuple[str, NDArray[np.float64]]]:
    """Iterate over all float fields of a model, its options and statistics, by name."""
    for name, member in vars(type(structure)).items():
        value = getattr(structure, name) if isinstance(member, property) else None
        if isinstance(value, float) or (isinstance(value, np.ndarray) and value.dtype.kind == "f"):
            yield prefix + name, np.asarray(value)
        elif type(value).__module__.startswith("mujoco."):  # options, statistics, visual settings
            yield from _floats(value, f"{prefix}{name}.")


def _place(model: mujoco.MjModel, field: str, row: int) -> str:
    """Return the element and the attribute of a row of a field: `joint "elbow": stiffness`."""
    section, dot, rest = field.partition(".")
    if dot:
        words = {"opt": "option", "stat": "statistic", "vis": "visual"}
        return f"{words.get(section, section)} {rest.replace('global_', 'global').replace('.', ' ')}"
    kind, _, rest = field.partition("_")
    if kind == "wrap":
        return f"{called(model, 'tendon', _owner(model.tendon_adr, row))}: coef or sidesite"
    attribute = _ATTRIBUTES.get(field, rest)
    if kind == "dof":
        kind, row = "jnt", int(model.dof_jntid[row])
    elif field in ("qpos0", "qpos_spring"):
        kind, row = "jnt", _owner(model.jnt_qposadr, row)
    elif kind == "numeric":
        row = _owner(model.numeric_adr, row)
    elif kind == "mesh" and rest == "vert":
        row = _owner(model.mesh_vertadr, row)
    if kind not in KINDS or row >= count(model, kind):
        return f"MuJoCo's field {field}[{row}]"
    return f"{called(model, kind, row)}: {attribute}"


def _owner(first: NDArray[np.int32], row: int) -> int:
    """Return which element has a row, given the first row of each."""
    return int(np.searchsorted(first, row, side="right")) - 1


def _shown(values: NDArray[np.float64], row: int) -> str:
    of_row = np.atleast_1d(values[row] if values.ndim else values).ravel()
    text = " ".join(f"{value:g}" for value in of_row[:_SHOWN])
    return f"{text} ..." if len(of_row) > _SHOWN else text
