"""An MJCF file as an arm: a chain of joints to a site, every name resolved once.

Any model will do: the chain is found from the site, the limits are read from joints and actuators,
and `adapted` gives each joint of the chain the one actuator that a plant needs. Nothing here steps
the physics.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.errors import ModelError, did_you_mean
from rmrc.spatial import matrix_to_quat

Array = NDArray[np.float64]

# MuJoCo's arrays hold plain integers, which its enums do not equal.
HINGE, SLIDE = int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)
JOINT_EQUALITY = int(mujoco.mjtEq.mjEQ_JOINT)
DRIVES_JOINT = int(mujoco.mjtTrn.mjTRN_JOINT)
NO_BIAS, NO_DYNAMICS = int(mujoco.mjtBias.mjBIAS_NONE), int(mujoco.mjtDyn.mjDYN_NONE)
SHAPES = {
    int(mujoco.mjtGeom.mjGEOM_SPHERE): "sphere",
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): "capsule",
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): "cylinder",
    int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): "ellipsoid",
    int(mujoco.mjtGeom.mjGEOM_BOX): "box",
    int(mujoco.mjtGeom.mjGEOM_MESH): "mesh",
}

# A screw's slide points along its hinge to what eight digits of an axis in a file leave of 1 − cos.
PARALLEL = 1e-9

# A NaN in an MJCF file compiles without an error, so these are looked at.
MUST_BE_FINITE = ("body_pos", "body_quat", "body_mass", "body_inertia", "jnt_axis", "jnt_pos",
                  "jnt_range", "site_pos", "site_quat", "qpos0", "dof_damping", "dof_armature")  # fmt: skip


@dataclass(frozen=True)
class Shape:
    """A visible geometry, fixed to a body.

    Attributes:
        name: Its name in the model, or its number.
        body: Index into the body poses.
        kind: `sphere`, `capsule`, `cylinder`, `ellipsoid`, `box` or `mesh`.
        size: MuJoCo's half sizes, (3,) [m].
        pose: In the body's frame, [p, quat w x y z], (7,).
        rgba: Color, (4,), 0 to 1.
        vertices: Of a mesh, (v, 3) [m].
        faces: Of a mesh, (f, 3).
    """

    name: str
    body: int
    kind: str
    size: Array
    pose: Array
    rgba: Array
    vertices: Array
    faces: NDArray[np.int32]


@dataclass(frozen=True)
class Travel:
    """The slide of a screw joint: an equality of the model makes it follow its hinge.

    position = offset + ratio · (position of the hinge)

    Attributes:
        name: Of the slide.
        hinge: Which joint of the arm it follows.
        ratio: [m/rad]
        offset: [m]
        pitch: Way along the hinge's axis: ± ratio, as the slide points along it or back [m/rad].
    """

    name: str
    hinge: int
    ratio: float
    offset: float
    pitch: float


@dataclass(frozen=True)
class Chain:
    """The arm's geometry with all its joints at 0: what forward kinematics needs, and no more.

    Attributes:
        axis: Unit vector of each joint, in the world, (n, 3).
        step: From a point on the axis before (the first: the world's origin) to one on this axis, (n, 3) [m].
        tip_step: From the last of these points to the site, (3,) [m].
        tip_quat: Orientation of the site, (4,).
    """

    axis: Array
    step: Array
    tip_step: Array
    tip_quat: Array


@dataclass(frozen=True)
class Wiring:
    """Where the arm is found in a model that MuJoCo compiled: four kinds of index, never mixed up.

    Attributes:
        joint: Joint ids, (n,).
        qpos: Addresses in qpos, (n,).
        dof: Addresses in qvel, (n,).
        actuator: Actuator ids, (n,); -1 where the model has none.
        travel_qpos: Addresses in qpos of the slides of screw joints, in the order of `Arm.travels`.
        travel_dof: Their addresses in qvel.
        site: Site id.
        body: Id of the body that carries the site.
    """

    joint: NDArray[np.int64]
    qpos: NDArray[np.int64]
    dof: NDArray[np.int64]
    actuator: NDArray[np.int64]
    travel_qpos: NDArray[np.int64]
    travel_dof: NDArray[np.int64]
    site: int
    body: int


@dataclass(frozen=True, eq=False)
class Arm:
    """A chain of hinge, slide and screw joints from the world to a site.

    A screw joint is a hinge with a slide along its axis that follows it by an equality of the model; the
    hinge's angle is its position.

    Attributes:
        path: The MJCF file.
        site: Name of the controlled site.
        joints: Names, from the world outward, n of them.
        is_slide: Whether each joint slides, (n,).
        travels: The slides of screw joints.
        position_limit: Lower and upper, (n, 2) [rad or m]; infinite where the model has none.
        rate_limit: (n,) [rad/s or m/s]; infinite where the model has none.
        torque_limit: (n,) [N·m or N]; infinite where the model has none.
        keyframes: Configurations by name, each (nq,).
        model: The model as its author wrote it.
    """

    path: Path
    site: str
    joints: tuple[str, ...]
    is_slide: NDArray[np.bool_]
    travels: tuple[Travel, ...]
    position_limit: Array
    rate_limit: Array
    torque_limit: Array
    keyframes: Mapping[str, Array]
    model: mujoco.MjModel
    _spec: mujoco.MjSpec

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joints)

    @cached_property
    def _data(self) -> mujoco.MjData:
        """State of the author's model, at `home` but for the arm's joints."""
        data = mujoco.MjData(self.model)
        data.qpos[:] = self.configuration("home")
        return data

    @cached_property
    def wiring(self) -> Wiring:
        """Indices in the author's model."""
        return self.wire(self.model)

    def wire(self, model: mujoco.MjModel) -> Wiring:
        """Resolve the names of the arm in a model that was compiled from the author's."""
        return _wire(model, self.joints, [travel.name for travel in self.travels], self.site)

    @property
    def pitch(self) -> Array:
        """Way along its axis for a turn of each joint, (n,) [m/rad]: 0 but for screw joints."""
        pitch = np.zeros(self.n)
        for travel in self.travels:
            pitch[travel.hinge] = travel.pitch
        return pitch

    @cached_property
    def inertia(self) -> Array:
        """Inertia that each joint feels alone at `home`, (n,) [kg·m² or kg]: the diagonal of M."""
        self._kinematics(self.configuration("home")[self.wiring.qpos])
        mujoco.mj_makeM(self.model, self._data)
        full = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, self._data, full)
        return np.diag(self._followed(self._followed(full).T))

    @cached_property
    def chain(self) -> Chain:
        """Geometry with all joints of the arm at 0, and those that are not the arm's at `home`."""
        self._kinematics(np.zeros(self.n))
        axis, anchor = self._data.xaxis[self.wiring.joint], self._data.xanchor[self.wiring.joint]
        tip = self._data.site_xpos[self.wiring.site]
        return Chain(
            axis=np.array(axis),
            step=np.diff(anchor, axis=0, prepend=np.zeros((1, 3))),
            tip_step=tip - anchor[-1],
            tip_quat=matrix_to_quat(self._data.site_xmat[self.wiring.site].reshape(3, 3)),
        )

    def configuration(self, start: str | Sequence[float] | Array) -> Array:
        """Return all of qpos, (nq,), for a keyframe's name or for positions of the arm's joints (n,).

        Args:
            start: Where there is no keyframe `home`, that name means the model's zero position.

        Raises:
            ModelError: No such keyframe.
        """
        if isinstance(start, str):
            if start not in self.keyframes and start != "home":
                known = ", ".join(sorted(self.keyframes)) or "none"
                hint = did_you_mean(start, self.keyframes)
                raise ModelError(
                    f'{self.path}: has no keyframe "{start}"{hint}; its keyframes: {known}', "start"
                )
            qpos = np.array(self.keyframes.get(start, self.model.qpos0))
            self._place(qpos, qpos[self.wiring.qpos])
            return qpos
        qpos = np.array(self.keyframes.get("home", self.model.qpos0))
        self._place(qpos, start)
        return qpos

    def _place(self, qpos: Array, q: Sequence[float] | Array) -> None:
        qpos[self.wiring.qpos] = q
        for address, travel in zip(self.wiring.travel_qpos, self.travels, strict=True):
            qpos[address] = travel.offset + travel.ratio * qpos[self.wiring.qpos[travel.hinge]]

    def _followed(self, columns: Array) -> Array:
        """Return the columns of the arm's joints, (..., n), from those of the model, (..., nv)."""
        own = columns[..., self.wiring.dof]
        for address, travel in zip(self.wiring.travel_dof, self.travels, strict=True):
            own[..., travel.hinge] += travel.ratio * columns[..., address]
        return own

    def sampled(self, count: int, seed: int = 0) -> Array:
        """Return random joint positions, (count, n), the same at every call, evenly between the limits.

        A joint without limits is taken half a turn, or π meters, to either side of `home`.
        """
        home = self.configuration("home")[self.wiring.qpos]
        lower, upper = self.position_limit.T
        within = np.isfinite(lower) & np.isfinite(upper)
        lower, upper = np.where(within, lower, home - np.pi), np.where(within, upper, home + np.pi)
        return np.random.default_rng(seed).uniform(lower, upper, (count, self.n))

    @property
    def sites(self) -> tuple[str, ...]:
        """Names of all sites of the model that have one."""
        return tuple(name for i in range(self.model.nsite) if (name := self.model.site(i).name))

    @property
    def idle(self) -> tuple[str, ...]:
        """Names of the joints that move the controlled site and are not driven."""
        known = {*self.joints, *(travel.name for travel in self.travels)}
        return tuple(name for name in _chain(self.path, self.model, self.site) if name not in known)

    def moves(self, site: str) -> NDArray[np.bool_]:
        """Return which joints of the arm move a site, (n,): those between the world and its body."""
        above, body = set(), int(self.model.site_bodyid[self.model.site(site).id])
        while body > 0:
            above.add(body)
            body = int(self.model.body_parentid[body])
        return np.array([int(self.model.jnt_bodyid[joint]) in above for joint in self.wiring.joint])

    def pose(self, q: Sequence[float] | Array, site: str | None = None) -> Array:
        """Return a site's pose in the world, [p, quat w x y z], (7,), at joint positions (n,).

        Args:
            q: Joint positions.
            site: Name of a site; None for the one that is controlled.
        """
        self._kinematics(q)
        i = self.wiring.site if site is None else self.model.site(site).id
        return np.concatenate(
            [self._data.site_xpos[i], matrix_to_quat(self._data.site_xmat[i].reshape(3, 3))]
        )

    def jacobian(self, q: Sequence[float] | Array) -> Array:
        """Return J (6, n), rows [v; ω] of the site along world axes, by `mj_jacSite`."""
        self._kinematics(q)
        full = np.zeros((6, self.model.nv))
        mujoco.mj_jacSite(self.model, self._data, full[:3], full[3:], self.wiring.site)
        return self._followed(full)

    def rest_torques(self, q: Sequence[float] | Array) -> tuple[Array, Array]:
        """Return what the drives give at rest against gravity, and against springs, (n,) each [N·m or N].

        What the model itself compensates of gravity is taken off. Joints not of the arm are at `home`.
        """
        self._kinematics(q)
        mujoco.mj_fwdPosition(self.model, self._data)
        mujoco.mj_fwdVelocity(self.model, self._data)
        weight = self._data.qfrc_bias - self._data.qfrc_gravcomp
        return self._followed(weight), self._followed(-self._data.qfrc_spring)

    @property
    def friction(self) -> Array:
        """Dry friction that can bear a part of a drive's load at rest, (n,) [N·m or N]."""
        loss = np.array(self.model.dof_frictionloss[self.wiring.dof])
        for address, travel in zip(self.wiring.travel_dof, self.travels, strict=True):
            loss[travel.hinge] += abs(travel.ratio) * self.model.dof_frictionloss[address]
        return loss

    def frames(self, q: Array) -> tuple[Array, Array]:
        """Return what moves, for joint positions (T, n).

        Returns:
            Poses of all bodies in the world, (T, nbody, 7), and Jacobians of the site, (T, 6, n).
        """
        poses, jacobians = np.empty((len(q), self.model.nbody, 7)), np.empty((len(q), 6, self.n))
        for row, jacobian, positions in zip(poses, jacobians, q, strict=True):
            jacobian[:] = self.jacobian(positions)
            row[:, :3], row[:, 3:] = self._data.xpos, self._data.xquat
        return poses, jacobians

    @property
    def base(self) -> int:
        """Id of the body that carries the first joint's: the world, or what stands on it."""
        return int(self.model.body_parentid[self.model.jnt_bodyid[self.wiring.joint[0]]])

    @property
    def body_names(self) -> list[str]:
        """Names of all bodies, the world first; a body without one goes by its number."""
        return [self.model.body(b).name or f"body{b}" for b in range(self.model.nbody)]

    @property
    def is_fixed(self) -> NDArray[np.bool_]:
        """Which bodies are fixed to the world, (nbody,)."""
        fixed: NDArray[np.bool_] = self.model.body_weldid == 0
        return fixed

    def _kinematics(self, q: Sequence[float] | Array) -> None:
        self._place(self._data.qpos, q)
        mujoco.mj_fwdKinematics(self.model, self._data)

    def adapted(self, plant: str, kv: Array, timestep: float, gravity_compensation: bool) -> mujoco.MjModel:
        """Compile the model with one actuator of the plant's kind on each joint of the arm.

        Actuators of other joints stay. The law limits the rates, so that the controls are not clamped
        here; torque limits are kept. Sensors are off, as nothing reads them. The integrator is
        `implicitfast`: servos of the stiffness that tracking needs blow up under Euler.

        Args:
            plant: `ideal`, `servo` or `torque`.
            kv: Gain of each rate servo, (n,) [N·m·s/rad or N·s/m].
            timestep: MuJoCo's step [s].
            gravity_compensation: Whether the arm's bodies float, as with balanced or compensated arms.
        """
        spec = self._spec.copy()
        for key in list(spec.keys):  # their controls no longer fit; `configuration` has their positions
            spec.delete(key)
        self._replace_actuators(spec, plant, kv)
        if gravity_compensation:
            root = self.model.jnt_bodyid[self.wiring.joint[0]]
            for body in spec.bodies:
                if self._descends(body.id, root):
                    body.gravcomp = 1.0
        option = spec.option
        option.timestep = timestep
        option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
        option.disableflags |= mujoco.mjtDisableBit.mjDSBL_SENSOR
        if plant == "ideal":  # only kinematics are computed
            option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        return spec.compile()

    def _replace_actuators(self, spec: mujoco.MjSpec, plant: str, kv: Array) -> None:
        for actuator in list(spec.actuators):
            if actuator.target in self.joints:
                spec.delete(actuator)
        for joint, gain, limit in zip(self.joints, kv, self.torque_limit, strict=True):
            actuator = spec.add_actuator(
                name=f"rate:{joint}", target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT
            )
            if plant == "torque":
                actuator.set_to_motor()
            else:
                actuator.set_to_velocity(kv=gain)
            if np.isfinite(limit):
                actuator.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
                actuator.forcerange = [-limit, limit]

    def _descends(self, body: int, root: int) -> bool:
        while body > root:
            body = self.model.body_parentid[body]
        return bool(body == root)

    def shapes(self) -> list[Shape]:
        """Return the visible geometries of the model, planes left out."""
        shapes = []
        for i in range(self.model.ngeom):
            geom = self.model.geom(i)
            kind = SHAPES.get(int(geom.type[0]))
            # groups 3 to 5 are hidden by MuJoCo's own viewer, collision geometry by custom
            if kind is None or geom.group[0] > 2 or geom.rgba[3] == 0.0:
                continue
            rgba = geom.rgba if geom.matid[0] < 0 else self.model.mat_rgba[geom.matid[0]]
            vertices, faces = self._mesh(int(geom.dataid[0])) if kind == "mesh" else _NO_MESH
            shapes.append(
                Shape(
                    geom.name or f"geom{i}", int(geom.bodyid[0]), kind, np.array(geom.size),
                    np.concatenate([geom.pos, geom.quat]), np.array(rgba, np.float64), vertices, faces,
                )
            )  # fmt: skip
        return shapes

    def _mesh(self, mesh: int) -> tuple[Array, NDArray[np.int32]]:
        model = self.model
        first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        vertices = np.array(model.mesh_vert[first : first + count], np.float64)
        first, count = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
        return vertices, np.array(model.mesh_face[first : first + count], np.int32)


_NO_MESH = (np.empty((0, 3)), np.empty((0, 3), np.int32))


def load(path: Path, site: str | None = None, joints: Sequence[str] | None = None) -> Arm:
    """Read an MJCF file and find the arm in it.

    Args:
        path: The file.
        site: Name of the site to control; None for the one that the most joints move, the last of several.
        joints: Names of the joints to drive, all on the chain to the site; None for all of them.

    Raises:
        ModelError: The file, the site or a joint is missing or will not do.
    """
    if not path.is_file():
        raise ModelError(f"{path}: no such model file{did_you_mean(path.name, _siblings(path))}")
    quiet_log()
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        model = spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        raise ModelError(f"{path}: {one_line(error)}") from None
    for field in MUST_BE_FINITE:
        if not np.isfinite(getattr(model, field)).all():
            raise ModelError(f"{path}: {field} is not finite everywhere; look for nan or inf in the file")
    site = _site(path, model, site)
    chain = _chain(path, model, site)
    travels = _travels(path, model, chain)
    own = [name for name in chain if name not in travels]
    names = tuple(own) if joints is None else tuple(joints)
    for name in names:
        if name in travels:
            raise ModelError(
                f'{path}: joint "{name}" follows "{own[travels[name].hinge]}" by an equality; drive that one',
                "joints",
            )
        if name not in own:
            raise ModelError(
                f'{path}: no hinge or slide joint "{name}" on the chain to site "{site}"'
                f"{did_you_mean(name, own)}; the chain: {', '.join(own)}",
                "joints",
            )
    outward = [name for name in own if name in names]
    if outward != list(names):
        raise ModelError(
            f"{path}: joints must be listed once each, from the world outward, got [{', '.join(names)}]; "
            f"write [{', '.join(outward)}]",
            "joints",
        )
    followed = tuple(
        replace(travel, hinge=names.index(own[travel.hinge]))
        for travel in travels.values()
        if own[travel.hinge] in names
    )
    joint = np.array([model.joint(name).id for name in names])
    return Arm(
        path=path,
        site=site,
        joints=names,
        is_slide=model.jnt_type[joint] == SLIDE,
        travels=followed,
        position_limit=_position_limit(model, names, followed),
        rate_limit=np.array([_rate_limit(model, i) for i in joint]),
        torque_limit=np.array([_torque_limit(model, i) for i in joint]),
        keyframes={model.key(i).name: np.array(model.key(i).qpos) for i in range(model.nkey)},
        model=model,
        _spec=spec,
    )


def _wire(model: mujoco.MjModel, joints: Sequence[str], travels: Sequence[str], site: str) -> Wiring:
    ids = np.array([model.joint(name).id for name in joints])
    slides = np.array([model.joint(name).id for name in travels], np.int64)
    drives = {
        int(model.actuator_trnid[i, 0]): i
        for i in range(model.nu)
        if model.actuator_trntype[i] == DRIVES_JOINT
    }
    return Wiring(
        joint=ids,
        qpos=model.jnt_qposadr[ids].astype(np.int64),
        dof=model.jnt_dofadr[ids].astype(np.int64),
        actuator=np.array([drives.get(int(i), -1) for i in ids]),
        travel_qpos=model.jnt_qposadr[slides].astype(np.int64),
        travel_dof=model.jnt_dofadr[slides].astype(np.int64),
        site=model.site(site).id,
        body=int(model.site_bodyid[model.site(site).id]),
    )


def quiet_log() -> None:
    """Keep MuJoCo from writing MUJOCO_LOG.TXT into the user's directory; we read its counters."""
    config = mujoco.MjLogConfig.get()
    config.logto_file = False
    config.logto_console = False
    config.set()


def one_line(error: Exception) -> str:
    """Return a foreign error's text on one line."""
    return " ".join(str(error).split())


def _siblings(path: Path) -> list[str]:
    return [p.name for p in path.parent.glob("*.xml")] if path.parent.is_dir() else []


def _site(path: Path, model: mujoco.MjModel, wanted: str | None) -> str:
    """Return the site that is wanted, or the one that the most joints move."""
    sites = [model.site(i).name for i in range(model.nsite)]
    if wanted is None and any(sites):
        named: list[str] = [name for name in reversed(sites) if name]
        return max(named, key=lambda name: len(_joints_above(model, name)))
    if wanted is None or wanted not in sites:
        known = ", ".join(filter(None, sites)) or "none"
        missing = "no site with a name" if wanted is None else f'no site "{wanted}"'
        hint = did_you_mean(wanted or "", sites)
        raise ModelError(f"{path}: has {missing}{hint}; its sites: {known}", "site")
    return wanted


def _joints_above(model: mujoco.MjModel, site: str) -> list[int]:
    """Return the joints between the world and a site, the last first."""
    joints: list[int] = []
    body = int(model.site_bodyid[model.site(site).id])
    while body > 0:
        first = model.body_jntadr[body]
        joints += reversed(range(first, first + model.body_jntnum[body]))
        body = int(model.body_parentid[body])
    return joints


def _chain(path: Path, model: mujoco.MjModel, site: str) -> list[str]:
    chain: list[str] = []
    for i in _joints_above(model, site):
        joint = model.joint(i)
        if joint.type[0] not in (HINGE, SLIDE):
            raise ModelError(
                f'{path}: joint "{joint.name}" on the chain to site "{site}" is a ball or free '
                "joint; only hinge and slide joints can be driven at a rate"
            )
        if not joint.name:
            body = model.body(int(model.jnt_bodyid[i])).name
            raise ModelError(f'{path}: a joint of body "{body}" has no name; give it one')
        chain.append(joint.name)
    if not chain:
        raise ModelError(f'{path}: no joint moves site "{site}"; choose a site on a moving body', "site")
    return chain[::-1]


def _travels(path: Path, model: mujoco.MjModel, chain: Sequence[str]) -> dict[str, Travel]:
    """Return the slides of screw joints by name; `hinge` counts the joints of the chain that follow none.

    Raises:
        ModelError: A joint of the chain follows another in any other way, which no Jacobian here knows.
    """
    data = mujoco.MjData(model)
    mujoco.mj_fwdKinematics(model, data)
    leaders: dict[str, tuple[str, NDArray[np.float64]]] = {}
    for i in np.flatnonzero((model.eq_type == JOINT_EQUALITY) & (model.eq_active0 == 1)):
        follower = model.joint(int(model.eq_obj1id[i])).name
        leader = model.joint(int(model.eq_obj2id[i])).name if model.eq_obj2id[i] >= 0 else ""
        if follower in chain:
            leaders[follower] = leader, np.array(model.eq_data[i, :5])
    own = [name for name in chain if name not in leaders]
    travels = {}
    for follower, (leader, polynomial) in leaders.items():
        slide, hinge = model.joint(follower), model.joint(leader) if leader in own else None
        along = 0.0
        if hinge is not None and abs(chain.index(leader) - chain.index(follower)) == 1:
            along = float(data.xaxis[hinge.id] @ data.xaxis[slide.id])
        is_screw = hinge is not None and (hinge.type[0], slide.type[0]) == (HINGE, SLIDE)
        if not (is_screw and abs(abs(along) - 1.0) < PARALLEL and not polynomial[2:].any()):
            raise ModelError(
                f'{path}: joint "{follower}" follows "{leader}" by an equality; on the chain to a site that '
                "may only make a screw: a slide along the axis of the hinge beside it, polycoef a b 0 0 0"
            )
        start, ratio = polynomial[0] + model.qpos0[slide.qposadr[0]], float(polynomial[1])
        offset = float(start - ratio * model.qpos0[model.joint(leader).qposadr[0]])
        travels[follower] = Travel(
            follower, own.index(leader), ratio, offset, ratio if along > 0.0 else -ratio
        )
    return travels


def _position_limit(model: mujoco.MjModel, joints: Sequence[str], travels: Sequence[Travel]) -> Array:
    """Return the range of each joint, (n, 2); a screw joint also ends where its slide does."""

    def limit(name: str) -> Array:
        joint = model.joint(name).id
        return np.array(model.jnt_range[joint] if model.jnt_limited[joint] else [-np.inf, np.inf])

    limits = np.array([limit(name) for name in joints])
    for travel in travels:
        if travel.ratio != 0.0:
            ends = np.sort((limit(travel.name) - travel.offset) / travel.ratio)
            limits[travel.hinge] = (
                max(limits[travel.hinge, 0], ends[0]),
                min(limits[travel.hinge, 1], ends[1]),
            )
    return limits


def _actuators(model: mujoco.MjModel, joint: int) -> list[int]:
    return [
        i
        for i in range(model.nu)
        if model.actuator_trntype[i] == DRIVES_JOINT and model.actuator_trnid[i, 0] == joint
    ]


def _rate_limit(model: mujoco.MjModel, joint: int) -> float:
    """The smaller end of a rate servo's control range: only such a control is a rate."""
    limits = [
        np.abs(model.actuator_ctrlrange[i]).min() / abs(model.actuator_gear[i, 0])
        for i in _actuators(model, joint)
        if model.actuator_ctrllimited[i]
        and model.actuator_biasprm[i, 1] == 0.0
        and model.actuator_biasprm[i, 2] < 0.0
        and model.actuator_dyntype[i] == NO_DYNAMICS
    ]
    return float(min(limits, default=np.inf))


def _torque_limit(model: mujoco.MjModel, joint: int) -> float:
    """The tightest of the joint's and its actuators' force ranges, and of a motor's control range."""
    limits = [np.inf]
    if model.jnt_actfrclimited[joint]:
        limits.append(np.abs(model.jnt_actfrcrange[joint]).min())
    for i in _actuators(model, joint):
        gear = abs(model.actuator_gear[i, 0])
        if model.actuator_forcelimited[i]:
            limits.append(np.abs(model.actuator_forcerange[i]).min() * gear)
        is_motor = model.actuator_biastype[i] == NO_BIAS
        if is_motor and model.actuator_ctrllimited[i]:
            gain = abs(model.actuator_gainprm[i, 0])
            limits.append(np.abs(model.actuator_ctrlrange[i]).min() * gain * gear)
    return float(min(limits))
