"""An arm: a chain of joints to a site, with every name resolved once. Nothing here steps the physics."""

import copy
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any, TypeAlias

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm import adapting
from rmrc.arm.compiling import compiled
from rmrc.arm.equalities import Follower, motion
from rmrc.arm.geometry import Chain, Proportions, find_masses, proportions
from rmrc.arm.location import Location, locate, moved
from rmrc.arm.mounting import NamedFrame
from rmrc.arm.others import Others, OwnDrives, Servo
from rmrc.arm.wiring import SLIDE, Wiring, joint_name, joints_above, wire
from rmrc.support.errors import ModelError, QuestionError, did_you_mean
from rmrc.support.spatial import Array, matrix_to_quat
from rmrc.support.text import brief, listed, shortened

# What an arm with other positions of other joints has in common with it.
_SHARED = {"wiring", "motion", "others", "drives", "servos", "_untextured"}
# Number of the last compiled plant models that an arm keeps: few sweeps use more in turn.
_MOST_MODELS = 8
Positions: TypeAlias = Sequence[float] | Array | mujoco.MjData
"""Positions of an arm: of its joints, (n,), of all joints of its model, (nq,), or MuJoCo's data with them."""


@brief
@dataclass(frozen=True, eq=False)
class Arm:
    """A chain of hinge, slide and screw joints from the world to a site.

    Joints that follow one of them by an equality of the model move with it: stages of a telescope, mimic
    joints. A screw joint is a hinge with a slide along its axis that follows it.

    Attributes:
        path: The MJCF or URDF file.
        site: Name of the controlled site.
        joints: Names, from the world outward, n of them.
        axis_names: Names of the joints on the axes of the chain, outward: its own, and their followers.
        is_slide: Whether each joint slides, (n,).
        followers: Joints that follow its joints, on the chain or not.
        ties: Other constraints of the model on its joints, in words; with any, the arm is no open chain.
        position_limit: Lower and upper, (n, 2) [rad or m]; infinite where the model has none.
        rate_limit: (n,) [rad/s or m/s]; infinite where the model has none.
        torque_limit: (n,) [N·m or N]; infinite where the model has none.
        keyframes: Configurations by name, each (nq,).
        model: The model as its author wrote it, except for stretched bodies.
        frame: Key of a scenario's `arm` that names the controlled frame, and its value; None where only the
            default names it.
        packages: Names and folders of a URDF's packages that were given.
        notes: Assumptions where the file leaves something open, one line each.
        home: Number of the keyframe that is `home`; None without one.
        is_urdf: Whether the file is a URDF, which has no keyframes and actuators.
        stretch: Factor on all lengths of a body, by its name.
        frees_others: Whether those that no actuator holds are free to move in a plant, or locked.
    """

    path: Path
    site: str
    joints: tuple[str, ...]
    axis_names: tuple[str, ...]
    is_slide: NDArray[np.bool_]
    followers: tuple[Follower, ...]
    position_limit: Array
    rate_limit: Array
    torque_limit: Array
    keyframes: Mapping[str, Array]
    model: mujoco.MjModel
    _spec: mujoco.MjSpec | None
    _links: Mapping[str, Follower] = field(default_factory=dict)
    frame: NamedFrame | None = None
    packages: tuple[tuple[str, Path], ...] = ()
    notes: tuple[str, ...] = ()
    ties: tuple[str, ...] = ()
    home: int | None = None
    is_urdf: bool = False
    stretch: Mapping[str, float] = field(default_factory=dict)
    frees_others: bool = False
    _rest: Array | None = None
    _mocap: Array | None = None
    _adapted: dict[object, mujoco.MjModel] = field(default_factory=dict, repr=False)

    def __deepcopy__(self, _: object) -> "Arm":
        """Return itself: nothing changes an arm."""
        return self

    def __getstate__(self) -> dict[str, Any]:
        """Return what can be pickled. MuJoCo's specification cannot: no plant is made of such an arm."""
        return {f.name: getattr(self, f.name) for f in fields(self)} | {"_spec": None, "_adapted": {}}

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joints)

    # Its parts in the model ---------------------------------------------------------------------

    @cached_property
    def wiring(self) -> Wiring:
        """Indices in the author's model."""
        return self.wire(self.model)

    def wire(self, model: mujoco.MjModel) -> Wiring:
        """Resolve the names of the arm in a model compiled from the author's."""
        return wire(model, self.joints, [each.name for each in self.followers], self.axis_names, self.site)

    @cached_property
    def motion(self) -> Array:
        """F, (nv, n): the rates of all joints of the model for unit rates of the arm's."""
        return motion(self.model, self.joints, self.followers)

    @cached_property
    def others(self) -> Others:
        """The parts of the model that are not the arm."""
        return Others(self.model, self.wiring)

    @cached_property
    def drives(self) -> OwnDrives:
        """The author's actuators that move the arm."""
        return OwnDrives(self.model, self.others, self.motion)

    @cached_property
    def servos(self) -> dict[int, Servo]:
        """Its servos that move one joint each, by the ids of the actuators."""
        home = self.configuration("home")
        return self.drives.servos(self.data_at(home), home[self.wiring.qpos])

    @cached_property
    def servo_limits(self) -> tuple[Array, Array]:
        """Ends of the positions that the servos of each joint take, (2, n), and largest rates, (n,)."""
        (lower, upper), rates = np.tile([[-np.inf], [np.inf]], self.n), np.full(self.n, np.inf)
        for j, (low, high), rate in ((each.joint, each.position, each.rate) for each in self.servos.values()):
            lower[j], upper[j] = max(lower[j], low), min(upper[j], high)
            rates[j] = min(rates[j], *np.abs(rate))
        return np.array([lower, upper]), rates

    @property
    def pitch(self) -> Array:
        """Translation along its axis for each radian that a joint turns, (n,) [m/rad].

        It is 0 for a hinge, inf for a slide, and else the pitch of a screw, as in `rmrc.textbook.chains`.
        """
        pitch = np.where(self.is_slide, np.inf, 0.0)
        for each in self.followers:
            pitch[each.leader] += each.pitch
        return pitch

    @property
    def kinds(self) -> tuple[str, ...]:
        """`hinge`, `slide` or `screw` of each joint."""
        return tuple("slide" if np.isinf(h) else "screw" if h else "hinge" for h in self.pitch)

    @property
    def units(self) -> tuple[str, ...]:
        """`rad` or `m`: unit of each joint's position."""
        return tuple("m" if slides else "rad" for slides in self.is_slide)

    @property
    def comes_round(self) -> NDArray[np.bool_]:
        """Which joints return to the same configuration after a whole turn, (n,).

        They are hinges without a screw whose followers turn whole turns as well.
        """
        slides = self.model.jnt_type[self.model.dof_jntid, None] == SLIDE
        turns = np.where(slides, 0.0, np.round(self.motion))
        return np.asarray((self.motion == turns).all(axis=0))

    @property
    def sites(self) -> tuple[str, ...]:
        """Names of all sites of the model that have a name."""
        return tuple(name for i in range(self.model.nsite) if (name := self.model.site(i).name))

    @property
    def body_names(self) -> list[str]:
        """Names of all bodies, the world first; a body without a name has its number."""
        return [self.model.body(b).name or f"body{b}" for b in range(self.model.nbody)]

    def idle(self, site: str | None = None) -> tuple[str, ...]:
        """Return the joints that move a site, or the controlled one, and not with the arm, outward."""
        above = self._above(site or self.site)[::-1]
        return tuple(joint_name(self.model, i) for i in above if i not in self.others.own)

    def moves(self, site: str) -> NDArray[np.bool_]:
        """Return which axes of the chain move a site, (ℓ,): those between the world and its body."""
        return np.isin(self.wiring.axis, self._above(site))

    def _above(self, site: str) -> list[int]:
        return joints_above(self.model, int(self.model.site(site).bodyid[0]))

    def require_open(self) -> None:
        """Refuse an arm that is no open chain, which no law here can control.

        Raises:
            ModelError: An equality ties it.
        """
        if self.ties:
            verb = "ties" if len(self.ties) == 1 else "tie"
            why = f"{self.path}: {listed(self.ties)} {verb} the arm, which is then no open chain"
            raise ModelError(f'{why}; set active="false" there in a copy of the model, or remove it', "model")

    # Configurations -----------------------------------------------------------------------------

    @cached_property
    def rest(self) -> Array:
        """Positions of the joints that are not the arm's, in a whole configuration, (nq,)."""
        return self.configuration("home") if self._rest is None else self._rest

    @cached_property
    def mocap(self) -> Array:
        """Poses of the mocap bodies, (nmocap, 7)."""
        return self.mocap_at("home") if self._mocap is None else self._mocap

    def mocap_at(self, start: str | Sequence[float]) -> Array:
        """Return the poses of the mocap bodies, (nmocap, 7), for a start of `held`."""
        data, key = mujoco.MjData(self.model), self._key_of(start)
        if key is not None:
            mujoco.mj_resetDataKeyframe(self.model, data, key)
        return np.hstack([data.mocap_pos, data.mocap_quat])

    def at(self, qpos: Array, frees_others: bool = False, mocap: Array | None = None) -> "Arm":
        """Return the arm with other positions of the joints that are not its own; itself if none changes.

        Kinematics, statics and inertias are those of the returned arm. The compiled model is shared.

        Args:
            qpos: A configuration of the model, (nq,); positions of the arm's own joints are ignored.
            frees_others: Whether joints that no actuator holds are free to move in a plant.
            mocap: Poses of the mocap bodies, (nmocap, 7); None: as they are.
        """
        elsewhere, mocap = self.others.addresses, self.mocap if mocap is None else mocap
        rest = self.rest.copy()
        rest[elsewhere] = qpos[elsewhere]
        is_here = np.array_equal(rest, self.rest) and np.array_equal(mocap, self.mocap)
        if is_here and frees_others == self.frees_others:
            return self
        arm = replace(self, _rest=rest, _mocap=mocap, frees_others=frees_others)
        vars(arm).update({name: vars(self)[name] for name in vars(self).keys() & _SHARED})
        return arm

    def configuration(self, start: str | Positions) -> Array:
        """Return all of qpos of the arm's model, (nq,), for a keyframe's name or for positions.

        Args:
            start: Without a keyframe `home`, that name means the model's zero position. With positions of the
                arm's joints, (n,), the other joints rest. An array (nq,) is returned as it is: where nq is n,
                both mean the same. Of MuJoCo's data of another model, the arm's joints count, by their names.

        Raises:
            ModelError: There is no such keyframe, or the data lack a joint of the arm.
            QuestionError: It is no array of finite numbers of these shapes.
        """
        if isinstance(start, str):
            if start not in self.keyframes and start != "home":
                names, hint = listed(sorted(self.keyframes)) or "none", did_you_mean(start, self.keyframes)
                text = f'{self.path}: has no keyframe "{start}"{hint}; its keyframes: {names}'
                raise ModelError(text, "start")
            qpos = self.keyframes.get(start, self.model.qpos0)
            return self.placed(qpos, qpos[self.wiring.qpos])
        if isinstance(start, mujoco.MjData):
            is_own = start.model is self.model
            return np.array(start.qpos) if is_own else self.placed(self.rest, self.positions(start))
        try:
            values = np.array(start, np.float64)
        except (TypeError, ValueError):
            values = np.array(np.nan)
        if not np.isfinite(values).all():
            raise QuestionError(f"q must be finite numbers, got {shortened(repr(start))}")
        if values.shape not in ((self.model.nq,), (self.n,)):
            raise QuestionError(f"q must be {self.forms}, got {values.shape}")
        return values if len(values) == self.model.nq else self.placed(self.rest, values)

    @property
    def forms(self) -> str:
        """The forms of positions, in words."""
        whole = f"all of qpos, ({self.model.nq},), " if self.model.nq != self.n else ""
        return f"({self.n},), {whole}or mujoco.MjData of a model with the arm"

    def positions(self, q: Any) -> Any:
        """Return positions of the arm's joints, (..., n), in any of their forms; anything else as it is.

        Args:
            q: Those positions; configurations of the arm's model, (..., nq); MuJoCo's data of any model with
                the arm; or a list of such data.

        Raises:
            ModelError: The data lack a joint of the arm.
        """
        if isinstance(q, mujoco.MjData):
            return q.qpos[q.model.jnt_qposadr[self.located(q.model).joint]]
        if isinstance(q, Sequence) and q and all(isinstance(each, mujoco.MjData) for each in q):
            return np.array([self.positions(each) for each in q])
        with suppress(ValueError):  # rows of different lengths
            if np.shape(q)[-1:] == (self.model.nq,):
                return np.asarray(q)[..., self.wiring.qpos]
        return q

    def located(self, model: mujoco.MjModel, *sites: str) -> Location:
        """Return where another model has the arm, and some of its sites.

        Raises:
            ModelError: The model lacks a joint, or the body of a site.
        """
        return locate(self, model, sites)

    def placed(self, qpos: Array, q: Sequence[float] | Array) -> Array:
        """Return a configuration of the model, (nq,), with the arm's joints moved to q, (n,)."""
        there, q = np.array(qpos), np.asarray(q)
        there[self.wiring.qpos] = q
        for address, each in zip(self.wiring.follower_qpos, self.followers, strict=True):
            there[address] = each.offset + each.ratio * q[each.leader]
        for name, link in self._links.items():  # followers of joints that are not the arm's
            leader = there[self.model.jnt_qposadr[link.leader]] if link.leader >= 0 else 0.0
            there[self.model.joint(name).qposadr[0]] = link.offset + link.ratio * leader
        return there

    @property
    def span(self) -> tuple[Array, Array]:
        """Lower and upper ends of the joints' ranges, (n,) each.

        For a joint without limits the range is half a turn, or π meters, to either side of `home`.
        """
        home = self.configuration("home")[self.wiring.qpos]
        lower, upper = self.position_limit.T
        within = np.isfinite(lower) & np.isfinite(upper)
        return np.where(within, lower, home - np.pi), np.where(within, upper, home + np.pi)

    def sampled(self, count: int, seed: int = 0) -> Array:
        """Return random joint positions, (count, n), the same at every call, uniform within `span`."""
        return np.random.default_rng(seed).uniform(*self.span, (count, self.n))

    @cached_property
    def proportions(self) -> Proportions:
        """Its proportions, from which a law has its length and its damping."""
        return proportions(*self.span, self.is_slide, self.jacobian)

    # Controls at a start ------------------------------------------------------------------------

    def held(self, start: str | Sequence[float], qpos: Array, own: bool = False) -> tuple[Array, Array]:
        """Return controls and activations of the actuators that are not the arm's, as `adapted` orders them.

        They are those of the keyframe. If it has none, each actuator that can hold its joints does.

        Args:
            start: A keyframe's name, or positions of the arm's joints. Positions go with the keyframe `home`
                if the other joints are where it has them, and with none if not.
            qpos: Start configuration of the model, (nq,).
            own: Whether to include the arm's own actuators. They have the keyframe's values if the arm is at
                its positions, and NaN if not: `rmrc.plants.model` then finds values that hold the arm.
        """
        if not (self.others.kept or own):
            return np.empty(0), np.empty(0)
        model, is_named = self.model, isinstance(start, str)
        is_there = qpos == self.configuration(start if isinstance(start, str) else "home")
        key = self._key_of(start) if is_named or is_there[self.others.addresses].all() else None
        frame = None if key is None else self._written.keys[key]
        written = [np.array(v) if len(v) else None for v in ((frame.ctrl, frame.act) if frame else ((), ()))]
        data, ids = self._moved(qpos), np.arange(model.nactuator)
        mujoco.mj_transmission(model, data)
        controls = self.others.controls(data, *written)
        owners = np.repeat(ids, model.actuator_ctrlnum), np.repeat(ids, model.actuator_actnum)
        if not own:
            ctrl, act = (v[np.isin(o, self.others.kept)] for v, o in zip(controls, owners, strict=True))
            return ctrl, act
        for values, owner, keyed in zip(controls, owners, written, strict=True):
            if keyed is None or not is_there.all():
                values[np.isin(owner, self.drives.idle)] = 0.0
                values[np.isin(owner, list(self.drives.kinds))] = np.nan
        return controls

    def _key_of(self, start: str | Sequence[float]) -> int | None:
        """Return the number of a start's keyframe: by its name, or the one that replaces `home`."""
        name = start if isinstance(start, str) else "home"
        keys = (i for i in range(self.model.nkey) if self.model.key(i).name == name)
        return self.home if name == "home" and self.home is not None else next(keys, None)

    # Kinematics ---------------------------------------------------------------------------------

    def data_at(self, qpos: Array) -> mujoco.MjData:
        """Return new data of the author's model at a configuration, (nq,): kinematics and transmissions."""
        data = mujoco.MjData(self.model)
        data.qpos[:], data.mocap_pos[:], data.mocap_quat[:] = qpos, self.mocap[:, :3], self.mocap[:, 3:]
        mujoco.mj_fwdKinematics(self.model, data)
        mujoco.mj_transmission(self.model, data)
        return data

    @cached_property
    def _data(self) -> mujoco.MjData:
        return self.data_at(self.rest)

    def _moved(self, q: Positions) -> mujoco.MjData:
        self._data.qpos[:] = self.configuration(q)
        mujoco.mj_fwdKinematics(self.model, self._data)
        return self._data

    def pose(self, q: Positions, site: str | None = None) -> Array:
        """Return a site's pose in the world, [p, quat w x y z], (7,).

        Args:
            q: Joint positions, (n,) or (nq,), as in `configuration`; or MuJoCo's data of any model with the
                arm, whose positions count, those of all joints and mocap bodies, and so the base's.
            site: Name of a site; None: the controlled site.
        """
        if isinstance(q, mujoco.MjData):
            return self.located(q.model, site or self.site).pose(moved(q))
        i, data = self.wiring.site if site is None else self.model.site(site).id, self._moved(q)
        return np.concatenate([data.site_xpos[i], matrix_to_quat(data.site_xmat[i].reshape(3, 3))])

    def jacobian(self, q: Positions) -> Array:
        """Return J (6, n), rows [v; ω] of the site along world axes; q is as in `pose`."""
        if isinstance(q, mujoco.MjData):
            return self.located(q.model, self.site).jacobian(moved(q))
        full = np.zeros((6, self.model.nv))
        mujoco.mj_jacSite(self.model, self._moved(q), full[:3], full[3:], self.wiring.site)
        return np.asarray(full @ self.motion)

    def frames(self, qpos: Array) -> tuple[Array, Array]:
        """Return the moving frames for configurations of the model, (T, nq).

        Returns:
            Poses of all bodies in the world, (T, nbody, 7), and Jacobians of the site, (T, 6, n).
        """
        data, full = self.data_at(self.rest), np.zeros((len(qpos), 6, self.model.nv))
        poses = np.empty((len(qpos), self.model.nbody, 7))
        for configuration, pose, rows in zip(qpos, poses, full, strict=True):
            data.qpos[:] = configuration
            mujoco.mj_fwdKinematics(self.model, data)
            mujoco.mj_jacSite(self.model, data, rows[:3], rows[3:], self.wiring.site)
            pose[:] = np.hstack([data.xpos, data.xquat])
        return poses, np.asarray(full @ self.motion)

    @property
    def base_pose(self) -> Array:
        """Pose of the base in the world, [p, quat w x y z], (7,), with the other joints at rest."""
        return self.base_at(self.rest)

    def base_at(self, q: Positions) -> Array:
        """Return the pose of the base in the world, (7,); q is as in `pose`."""
        if isinstance(q, mujoco.MjData):
            return self.located(q.model).base_pose(moved(q))
        data, base = self._moved(q), self.wiring.base
        return np.concatenate([data.xpos[base], data.xquat[base]])

    @cached_property
    def chain(self) -> Chain:
        """Geometry with all joints of the arm at 0 and the other joints at rest."""
        data, joint, site = self._moved(np.zeros(self.n)), self.wiring.axis, self.wiring.site
        rows, anchor = self.motion[self.model.jnt_dofadr[joint]], np.array(data.xanchor[joint])
        leader = np.abs(rows).argmax(axis=1)
        pitch = np.where(np.isin(joint, self.wiring.joint), self.pitch[leader], 0.0)
        pitch[self.model.jnt_type[joint] == SLIDE] = np.inf
        step, tip = np.diff(anchor, axis=0, prepend=np.zeros((1, 3))), data.site_xpos[site] - anchor[-1]
        quat, axis = matrix_to_quat(data.site_xmat[site].reshape(3, 3)), np.array(data.xaxis[joint])
        return Chain(self.axis_names, leader, rows.sum(axis=1), pitch, axis, step, tip, quat)

    def behind(self, site: str) -> tuple[int, Array, Array]:
        """Return the place of a site behind the chain, with all joints of the arm at 0.

        Returns:
            The last axis that moves it, the vector from the point on that axis to the site, (3,) [m], and the
            orientation of the site, (4,).
        """
        last = int(np.flatnonzero(self.moves(site))[-1])
        pose = self.pose(np.zeros(self.n), site)
        return last, pose[:3] - self._data.xanchor[self.wiring.axis[last]], pose[3:]

    # Statics and inertia ------------------------------------------------------------------------

    def rest_torques(self, q: Positions) -> tuple[Array, Array]:
        """Return the actuator loads at rest from gravity and from springs, (n,) each [N·m or N].

        The model's own gravity compensation is subtracted, unless it is by actuators of the joints. Joints
        that are not the arm's are at rest.
        """
        data = self._moved(q)
        mujoco.mj_fwdPosition(self.model, data)
        mujoco.mj_fwdVelocity(self.model, data)
        passive = np.where(self.model.jnt_actgravcomp[self.model.dof_jntid], 0.0, data.qfrc_gravcomp)
        return (data.qfrc_bias - passive) @ self.motion, -data.qfrc_spring @ self.motion

    @property
    def weights(self) -> Array:
        """Weight of each body as each joint of the model bears it, (njnt, nbody, 3) [N].

        The share that the model compensates is left out, unless it does so by that joint's actuators.
        """
        model, is_off = self.model, self.model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY
        share = 1.0 - np.where(model.jnt_actgravcomp[:, None], 0.0, model.body_gravcomp)
        return np.asarray((share * model.body_mass)[:, :, None] * model.opt.gravity * (not is_off))

    @cached_property
    def inertia(self) -> Array:
        """Inertia that each joint alone moves at `home`, (n,) [kg·m² or kg]: the diagonal of M."""
        M, data = np.zeros((self.model.nv, self.model.nv)), self._moved(self.configuration("home"))
        mujoco.mj_makeM(self.model, data)
        mujoco.mj_fullM(self.model, data, M)
        return np.diag(self.motion.T @ M @ self.motion)

    @cached_property
    def masses(self) -> dict[str, NDArray[Any]]:
        """The masses that the joints move, with all of them at 0 and the other joints at rest."""
        return find_masses(self.model, self._moved(np.zeros(self.n)), self.motion)

    # Other models -------------------------------------------------------------------------------

    @property
    def _written(self) -> mujoco.MjSpec:
        """The specification of the model.

        Raises:
            ModelError: Only a compiled model is known.
        """
        if self._spec is None:
            why = "a plant needs the model's file or an MjSpec, not a compiled model"
            raise ModelError(f"{self.path}: {why}")
        return self._spec

    @cached_property
    def _untextured(self) -> mujoco.MjModel:
        return compiled(self.path, adapting.without_textures(self._written))

    def stretched(self, stretch: Mapping[str, float]) -> "Arm":
        """Return the arm with some bodies larger.

        For a body with factor f, all lengths about its frame's origin are multiplied by f: positions of
        bodies, sites, joints and geoms on it, and sizes of geoms. Its mass stays, so its inertia is
        multiplied by f². Ranges of joints and limits stay. The returned model has no textures.

        Args:
            stretch: Factor of each body, by its name.

        Raises:
            ModelError: No such body, or it cannot be stretched.
        """
        adapting.check_stretch(self.path, self.model, stretch)
        model = copy.copy(self._untextured)
        adapting.set_fields(model, adapting.stretched_fields(model, stretch))
        return replace(self, model=model, stretch={**self.stretch, **stretch})

    def adapted(
        self, drive: adapting.Drive, timestep: float, gravity_compensation: bool, *, loaded: bool = False
    ) -> mujoco.MjModel:
        """Return the model with the actuators of a plant: see `rmrc.arm.adapting`.

        It is compiled once for equal requests, and no caller may write to it. Lengths are the author's even
        if bodies are stretched: worlds with different factors share this model.

        Args:
            drive: The kind of actuators; "own" for the author's, with his integrator; None for a plant
                without physics, which only needs kinematics.
            timestep: MuJoCo's step [s].
            gravity_compensation: Whether the weight of the arm's bodies is compensated, as in a balanced arm.
            loaded: Whether a body without mass is added at the site, to be given the mass of a payload;
                nothing compensates its weight.
        """
        key = drive, timestep, gravity_compensation, loaded, self.frees_others
        if key not in self._adapted:
            if len(self._adapted) == _MOST_MODELS:
                self._adapted.pop(next(iter(self._adapted)), None)
            self._adapted[key] = adapting.adapted(self, adapting.without_textures(self._written), *key[:4])
        return self._adapted[key]
