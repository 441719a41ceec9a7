"""The arm of a scenario: its model, the controlled frame, the start and the encoders."""

from typing import Annotated, Literal

from pydantic import AfterValidator

from rmrc.scenario import values as types
from rmrc.scenario.values import Choice, Exclusive, Section, key
from rmrc.support.spatial import quat_from_rpy


class EncoderSection(Section):
    """Errors of the arm's encoders: the controller uses their readings instead of the true q.

    Attributes:
        offset: constant offset added to the true position by the encoders, one for all joints or one per
            joint
        deviation: standard deviation of a random addition to `offset`, one for all joints or one per joint;
            drawn once from a normal distribution
        noise: standard deviation of white noise, drawn at every tick, one for all joints or one per joint
        resolution: step to which readings are rounded, one for all joints or one per joint; 0: no rounding
        delay: age of a reading when the controller uses it
        seed: seed of the random offsets and noise
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
        position: position: [x, y], which keeps z, or [x, y, z]; null: as at `start`
        orientation: orientation: roll, pitch and yaw about fixed x, y and z, or a quaternion w x y z; null:
            unconstrained
        frame: reference frame: world; base, the body that carries the first joint
    """

    counts = ((("position", "orientation"), 1, 2),)
    position: types.Vector | None = key(None, "m")
    orientation: Orientation | None = key(None, "rad or 1")
    frame: Literal["world", "base"] = "world"


class ToolSection(Choice):
    """Tool: a frame on a body of the arm, optionally with a mass or another model attached.

    Attributes:
        body: body that carries the tool; null: the default end-effector frame
        position: position of the tool frame, in the frame of its carrier
        orientation: orientation of the tool frame in the frame of its carrier: roll, pitch and yaw about
            fixed x, y and z, or a quaternion w x y z; null: that of its carrier
        mass: mass; null: none
        center: center of mass in the tool frame; null: its origin
        inertia: principal moments of inertia about the center of mass, along the tool axes; null: point mass
        model: MJCF or URDF file of a tool to attach; null: none
        site: end effector (TCP) site in that model; null: chosen as for an arm
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
        model: MJCF or URDF file; relative paths start at the scenario's folder
        site: end effector (TCP): the controlled MuJoCo site; null, without `body` and `tool`: the site of the
            hand
        body: body whose frame is controlled instead of a site
        tool: tool whose frame is controlled instead of a site
        packages: folders of the packages named in a URDF, by package name; other packages are searched above
            the file
        start: start configuration: a keyframe's name, or one position per joint
        pose: start pose of the site; inverse kinematics from `start` finds the joint positions; null: start
            at `start`
        joints: actuated joints; null: all joints between the base and the site
        others: passive joints, without an actuator in the model: `hold` locks them at `start`, `free` lets
            them move; a body on a free joint apart from the arm always moves freely
        encoder: encoder errors
        stretch: factor on all lengths of a body, by body name: positions of its bodies, sites, joints and
            shapes, and their sizes; the mass stays the same, and the inertia scales with the square of the
            factor; the controller knows it, unlike `plant.stretch`
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
