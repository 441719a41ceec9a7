"""The arm of a scenario: its model, the controlled frame, the start and the encoders."""

from typing import Annotated, Literal

from pydantic import AfterValidator

from rmrc.scenario import values as types
from rmrc.scenario.values import Choice, Exclusive, Section, key
from rmrc.support.spatial import quat_from_rpy


class EncoderSection(Section):
    """Errors of the arm's encoders: the controller uses their readings instead of the true q.

    Attributes:
        offset: constant offset of the readings
        deviation: standard deviation of a random, constant addition to `offset`
        noise: standard deviation of white noise per tick
        resolution: step to which readings are rounded; 0: none
        delay: age of a reading in use
        seed: seed of random offsets and noise
    """

    offset: types.AngleOrEach = key(0.0, "rad or m")
    deviation: types.NotNegativeAngleOrEach = key(0.0, "rad or m")
    noise: types.NotNegativeAngleOrEach = key(0.0, "rad or m")
    resolution: types.NotNegativeAngleOrEach = key(0.0, "rad or m")
    delay: types.NotNegative = key(0.0, "s")
    seed: types.Seed = 0


Orientation = Annotated[
    tuple[types.Angle, ...],
    types.count(3, 4),
    AfterValidator(lambda values: values if len(values) == 3 else types.directed(values)),
]
"""Roll, pitch and yaw about fixed x, y and z, or a quaternion w x y z."""


class StartPose(Choice):
    """Pose of the site at the start.

    Attributes:
        position: [x, y] (z stays) or [x, y, z]; null: as at `start`
        orientation: roll, pitch, yaw about fixed x, y, z, or quaternion w x y z; null: free
        frame: reference frame; base: the body that carries the first joint
    """

    counts = ((("position", "orientation"), 1, 2),)
    position: types.Vector | None = key(None, "m")
    orientation: Orientation | None = key(None, "rad or 1")
    frame: Literal["world", "base"] = "world"


class ToolSection(Choice):
    """Tool: a frame on a body of the arm, optionally with a mass or another model attached.

    Attributes:
        body: body that carries the tool; null: the arm's end effector
        position: position of the tool frame on it
        orientation: orientation of the tool frame on it, as `arm.pose.orientation`; null: parallel
        mass: mass; null: none
        center: center of mass in the tool frame; null: its origin
        inertia: principal moments about the center of mass, along the tool axes; null: point mass
        model: MJCF or URDF file of a tool to attach; null: none
        site: end effector site in that model; null: chosen as for an arm
    """

    counts = ((("mass", "model"), 0, 1),)
    needs = (("center", "mass"), ("inertia", "mass"), ("site", "model"))
    body: types.Text | None = None
    position: types.Point = key((0.0, 0.0, 0.0), "m")
    orientation: Orientation | None = key(None, "rad or 1")
    mass: types.NotNegative | None = key(None, "kg")
    center: types.Point | None = key(None, "m")
    inertia: types.Moments | None = key(None, "kg·m²")
    model: types.ModelFile | None = None
    site: types.Text | None = None

    @property
    def rotation(self) -> tuple[float, ...]:
        """Orientation of the tool frame, as a quaternion w x y z."""
        values = self.orientation or (1.0, 0.0, 0.0, 0.0)
        return values if len(values) == 4 else tuple(quat_from_rpy(values).tolist())


class ArmSection(Exclusive):
    """The arm: model, end effector and start configuration.

    Attributes:
        model: MJCF or URDF file, relative to the scenario's folder
        site: end effector (TCP) site; null: that of the hand, unless `body` or `tool` is given
        body: body whose frame is controlled instead of a site
        tool: tool whose frame is controlled instead of a site
        packages: folder of a URDF's package; null: searched above the file
        start: start configuration: a keyframe's name, or one position per joint
        pose: start pose of the site; inverse kinematics from `start` finds the joint positions; null: start
            at `start`
        joints: actuated joints; null: all between base and site
        others: joints without an actuator: `hold` locks them at `start`, `free` lets them move
        encoder: encoder errors
        stretch: factor on all lengths of a body, known to the controller; mass stays, inertia grows with its
            square
    """

    counts = ((("site", "body", "tool"), 0, 1),)
    model: types.ModelFile
    site: types.Text | None = None
    body: types.Text | None = None
    tool: ToolSection | None = None
    packages: dict[str, types.Folder] = key({})
    start: types.NameOrPositions = key("home", "rad or m")
    pose: StartPose | None = None
    joints: types.Names | None = None
    others: Literal["hold", "free"] = "hold"
    encoder: EncoderSection = EncoderSection()
    stretch: dict[str, types.Positive] = key({}, "1")
