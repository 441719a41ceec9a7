"""What an inspection found, as JSON for machines."""

from typing import Any

import numpy as np

from rmrc.analysis.inspect.inspection import Inspection

KEYS = {
    "model": "the file",
    "site": "the point in question",
    "joints": "name, kind, unit, q, limits [lower, upper], room to the nearer one; null where there is none",
    "pose": "position [m] in the world; quaternion w x y z; zyz: Z-Y-Z angles [rad]",
    "frame": "along whose axes jacobian is: world, site or base; its rotation in the world",
    "jacobian": "6 x n, rows v_x v_y v_z w_x w_y w_z of the site's origin",
    "disagreement": "largest entry of the difference from MuJoCo's J, by route",
    "task": "rows, why these, length [m]",
    "determinant": "of the task's rows of J along world axes; null if they are not square",
    "sigma": "singular values of the task's rows, falling",
    "rank": "by_singular_values; by_minors, null if not counted",
    "condition": "kappa; null where the rank is lost",
    "manipulability": "w",
    "lost": "twist: the task direction that cannot move; wrench: costs no torque; words",
    "nearly_lost": "sigma; joint_motion of norm 1 and the twist that it gives; words",
    "self_motions": "joint_motion that does not move the task; twist of the site; words",
    "ellipsoids": "rows; directions as rows of numbers; half axes of velocity and force, null if infinite",
    "euler_rates": "E with w = E (alpha', beta', gamma'); the analytic jacobian, null where singular; words",
    "tip_error": "joints, deviation of x y z rx ry rz, covariance, worst translation and rotation; or null",
    "statics": "wrench, equilibrium and equivalent torques, reactions, their points, disagreement; or null",
    "warnings": "in words",
}
"""What each key holds: SI, radians; vectors along world axes but for `jacobian`; all numbers are finite."""


def facts(found: Inspection) -> dict[str, Any]:
    """Return an inspection as strict JSON, by `KEYS`; what is infinite or undefined is null."""
    arm, task, error, balance = found.arm, found.task, found.tip_error, found.balance
    values = {
        "model": str(arm.path),
        "site": arm.site,
        "joints": [
            {
                "name": arm.joints[i],
                "kind": arm.kinds[i],
                "unit": arm.units[i],
                "q": found.q[i],
                "limits": arm.position_limit[i],
                "room": found.room[i],
            }
            for i in range(arm.n)
        ],
        "pose": {"position": found.pose[:3], "quaternion": found.pose[3:], "zyz": found.angles},
        "frame": {"name": found.frame, "rotation": found.R_world_frame},
        "jacobian": found.jacobian,
        "disagreement": dict(found.disagreement),
        "task": {"rows": task.axes, "why": found.why, "length": task.length},
        "determinant": found.determinant,
        "sigma": found.sigma,
        "rank": {"by_singular_values": found.rank, "by_minors": found.rank_by_minors},
        "condition": found.condition,
        "manipulability": found.manipulability,
        "lost": [{"twist": one.twist, "wrench": one.wrench, "words": one.words} for one in found.lost],
        "nearly_lost": [
            {"sigma": one.sigma, "joint_motion": one.motion, "twist": one.twist, "words": one.words}
            for one in found.slow
        ],
        "self_motions": [
            {"joint_motion": one.motion, "twist": one.twist, "words": one.words} for one in found.standing
        ],
        "ellipsoids": [
            {
                "rows": one.rows,
                "directions": one.velocity.axes.T,
                "velocity": one.velocity.half_axes,
                "force": one.force.half_axes,
            }
            for one in found.ellipsoids
        ],
        "euler_rates": {
            "E": found.E,
            "analytic_jacobian": found.analytic_jacobian,
            "words": found.angles_in_words,
        },
        "tip_error": error
        and {
            "joints": error.joints,
            "deviation": error.deviation,
            "covariance": error.covariance,
            "worst_translation": error.worst_translation,
            "worst_rotation": error.worst_rotation,
        },
        "statics": balance
        and {
            "wrench": balance.wrench,
            "equilibrium": balance.equilibrium,
            "equivalent": balance.equivalent,
            "reactions": balance.reaction_world,
            "points": balance.frames[:, :3, 3],
            "disagreement": balance.disagreement,
        },
        "warnings": found.warnings,
    }
    plain: dict[str, Any] = _plain(values)
    return plain


def _plain(value: Any) -> Any:
    """Return dicts, lists, texts and finite numbers; null for all that is not finite."""
    if isinstance(value, dict):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    if isinstance(value, float):
        return float(value) if np.isfinite(value) else None
    return value
