"""An arm: a chain of joints to a site, with every name resolved once. Nothing here steps the physics."""

import copy
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any, TypeAlias

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm.adapting import Adaptations, Drive, Own, descends
from rmrc.arm.chain import Chain, kinds_of
from rmrc.arm.compiling import compiled
from rmrc.arm.differences import check_stretch, stretched_fields
from rmrc.arm.drives import OwnDrives, Servo
from rmrc.arm.followers import Follower, Link
from rmrc.arm.location import Location, copy_joint, locate, moved
from rmrc.arm.masses import Masses, find_masses
from rmrc.arm.mounting import NamedFrame
from rmrc.arm.others import Others
from rmrc.arm.proportions import Proportions, proportions
from rmrc.arm.shapes import Shape, visible
from rmrc.arm.wiring import SLIDE, Wiring, find_chain, joint_name, joints_above, wire
from rmrc.support.brief import brief
from rmrc.support.errors import ModelError, QuestionError, did_you_mean
from rmrc.support.legible import listed, shortened
from rmrc.support.spatial import matrix_to_quat

Array = NDArray[np.float64]

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
        is_slide: Whether each joint slides, (n,).
        followers: Joints that follow its joints, on the chain or not.
        ties: Other constraints of the model on its joints, in words; with any, the arm is no open chain.
        position_limit: Lower and upper, (n, 2) [rad or m]; infinite where the model has none.
        rate_limit: (n,) [rad/s or m/s]; infinite where the model has none.
        torque_limit: (n,) [N·m or N]; infinite where the model has none.
        keyframes: Configurations by name, each (nq,).
        model: The model as its author wrote it, except for stretched bodies.
        variant: Options that change the model beside the file: a tool, folders of packages.
        frame: Key of a scenario's `arm` that names the controlled frame, and its value; None where only the
            default names it.
        packages: Names and folders of a URDF's packages that were given.
        notes: Assumptions where the file leaves something open, one line each.
        home: Number of the keyframe that is `home`; None without one.
        stretch: Factor on all lengths of a body, by its name.
        rest: Positions of the joints that are not the arm's, in a whole configuration, (nq,); None: `home`.
        frees_others: Whether those that no actuator holds are free to move in a plant, or locked.
        mocap: Poses of the mocap bodies, (nmocap, 7); None: as at `home`.
    """

    path: Path
    site: str
    joints: tuple[str, ...]
    is_slide: NDArray[np.bool_]
    followers: tuple[Follower, ...]
    position_limit: Array
    rate_limit: Array
    torque_limit: Array
    keyframes: Mapping[str, Array]
    model: mujoco.MjModel
    _spec: mujoco.MjSpec | None
    _links: Mapping[str, Link] = field(default_factory=dict)
    variant: Hashable = ()
    frame: NamedFrame | None = None
    packages: tuple[tuple[str, Path], ...] = ()
    notes: tuple[str, ...] = ()
    ties: tuple[str, ...] = ()
    home: int | None = None
    stretch: Mapping[str, float] = field(default_factory=dict)
    rest: Array | None = None
    frees_others: bool = False
    mocap: Array | None = None
    _adapted: dict[object, mujoco.MjModel] = field(default_factory=dict, repr=False)

    def __copy__(self) -> "Arm":
        """Return itself: nothing changes an arm."""
        return self

    def __deepcopy__(self, _: object) -> "Arm":
        """Return itself."""
        return self

    def __getstate__(self) -> dict[str, Any]:
        """Return what can be pickled. MuJoCo's specification cannot: no plant is made of such an arm."""
        state = {one.name: getattr(self, one.name) for one in fields(self)}
        return state | {"_spec": None, "_adapted": {}}

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joints)

    @cached_property
    def _data(self) -> mujoco.MjData:
        """State of the author's model, at rest except the arm's joints."""
        data = mujoco.MjData(self.model)
        data.qpos[:] = self._rest
        self.place_mocap(data)
        return data

    @cached_property
    def _rest(self) -> Array:
        return self.configuration("home") if self.rest is None else self.rest

    @cached_property
    def others(self) -> Others:
        """The parts of the model that are not the arm."""
        wiring = self.wiring
        return Others(self.model, [*wiring.joint, *wiring.follower_joint], wiring.site)

    @cached_property
    def drives(self) -> OwnDrives:
        """The author's actuators that move the arm."""
        return OwnDrives(self.model, self.others, self.wiring, self.followers)

    @cached_property
    def servos(self) -> dict[int, Servo]:
        """Its servos that move one joint each, by the ids of the actuators."""
        return self.drives.servos(self.configuration("home"))

    @property
    def servo_positions(self) -> Array:
        """Least and largest position that the servos of each joint take, (2, n); infinite without a range."""
        ends = np.array([self.n * [-np.inf], self.n * [np.inf]])
        for servo in self.servos.values():
            ends[0, servo.joint] = max(ends[0, servo.joint], servo.position[0])
            ends[1, servo.joint] = min(ends[1, servo.joint], servo.position[1])
        return ends

    @property
    def servo_rates(self) -> Array:
        """Largest rate that the servos of each joint take both ways, (n,); infinite without a range."""
        most = np.full(self.n, np.inf)
        for servo in self.servos.values():
            most[servo.joint] = min(most[servo.joint], *np.abs(servo.rate))
        return most

    def place_mocap(self, data: mujoco.MjData) -> None:
        """Set the mocap bodies to their poses at the start of a run."""
        if self.model.nmocap:
            poses = self.mocap_now
            data.mocap_pos[:], data.mocap_quat[:] = poses[:, :3], poses[:, 3:]

    @cached_property
    def mocap_now(self) -> Array:
        """Poses of the mocap bodies, (nmocap, 7)."""
        return self.mocap_at("home") if self.mocap is None else self.mocap

    def mocap_at(self, start: str | Sequence[float]) -> Array:
        """Return the poses of the mocap bodies, (nmocap, 7), for a start of `held`."""
        if not self.model.nmocap:
            return np.empty((0, 7))
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
        mocap = self.mocap if mocap is None or np.array_equal(mocap, self.mocap_now) else mocap
        rest, elsewhere = np.array(self._rest), self.others.addresses
        rest[elsewhere] = qpos[elsewhere]
        if frees_others == self.frees_others and np.array_equal(rest, self._rest) and mocap is self.mocap:
            return self
        arm = replace(self, rest=rest, frees_others=frees_others, mocap=mocap)
        shared = ("wiring", "axis_names", "others", "drives", "servos", "idle", "_bare_spec", "_untextured")
        vars(arm).update({name: vars(self)[name] for name in shared if name in vars(self)})
        return arm

    @cached_property
    def wiring(self) -> Wiring:
        """Indices in the author's model."""
        return self.wire(self.model)

    def wire(self, model: mujoco.MjModel) -> Wiring:
        """Resolve the names of the arm in a model compiled from the author's."""
        return wire(model, self.joints, [one.name for one in self.followers], self.axis_names, self.site)

    @property
    def pitch(self) -> Array:
        """Translation along its axis for each radian that a joint turns, (n,) [m/rad].

        It is 0 for a hinge, inf for a slide, and else the pitch of a screw, as in `rmrc.textbook.screws`.
        """
        pitch = np.where(self.is_slide, np.inf, 0.0)
        for one in self.followers:
            if one.is_screw:
                pitch[one.leader] = one.pitch
        return pitch

    @property
    def leads(self) -> NDArray[np.bool_]:
        """Which joints have followers, (n,), not counting the slide of a screw."""
        return np.isin(np.arange(self.n), [one.leader for one in self.followers if not one.is_screw])

    @property
    def units(self) -> tuple[str, ...]:
        """`rad` or `m`: unit of each joint's position."""
        return tuple("m" if slides else "rad" for slides in self.is_slide)

    @property
    def comes_round(self) -> NDArray[np.bool_]:
        """Which joints return to the same configuration after a whole turn, (n,).

        They are hinges without a screw whose followers turn whole turns as well.
        """
        comes = np.asarray(self.pitch == 0.0)
        for joint, one in zip(self.wiring.follower_joint, self.followers, strict=True):
            slides = self.model.jnt_type[joint] == SLIDE
            comes[one.leader] &= one.ratio == (0.0 if slides else round(one.ratio))
        return comes

    @property
    def kinds(self) -> tuple[str, ...]:
        """`hinge`, `slide` or `screw` of each joint."""
        return kinds_of(self.pitch)

    @cached_property
    def inertia(self) -> Array:
        """Inertia that each joint alone moves at `home`, (n,) [kg·m² or kg]: the diagonal of M."""
        self._kinematics(self.configuration("home")[self.wiring.qpos])
        mujoco.mj_makeM(self.model, self._data)
        full = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, self._data, full)
        return np.diag(self._followed(self._followed(full).T))

    @cached_property
    def masses(self) -> Masses:
        """The masses that the joints move, with all of them at 0 and the other joints at rest."""
        self._kinematics(np.zeros(self.n))
        return find_masses(self.model, self._data, self.wiring, self.followers)

    @cached_property
    def axis_names(self) -> tuple[str, ...]:
        """Names of the joints on the axes of the chain, outward: its own, and their followers."""
        moving = {*self.joints, *(one.name for one in self.followers if not one.is_screw)}
        return tuple(name for name in find_chain(self.path, self.model, self.site) if name in moving)

    @cached_property
    def chain(self) -> Chain:
        """Geometry with all joints of the arm at 0 and the other joints at rest."""
        self._kinematics(np.zeros(self.n))
        names, joint = self.axis_names, self.wiring.axis
        following = {one.name: one for one in self.followers}
        leaders = np.array(
            [one.leader if (one := following.get(name)) else self.joints.index(name) for name in names]
        )
        axis, anchor = self._data.xaxis[joint], self._data.xanchor[joint]
        tip = self._data.site_xpos[self.wiring.site]
        pitch = np.where(self.model.jnt_type[joint] == SLIDE, np.inf, 0.0)
        is_own = np.array([name not in following for name in names])
        return Chain(
            names=names,
            leader=leaders,
            ratio=np.array([one.ratio if (one := following.get(name)) else 1.0 for name in names]),
            pitch=np.where(is_own, self.pitch[leaders], pitch),
            axis=np.array(axis),
            step=np.diff(anchor, axis=0, prepend=np.zeros((1, 3))),
            tip_step=tip - anchor[-1],
            tip_quat=matrix_to_quat(self._data.site_xmat[self.wiring.site].reshape(3, 3)),
        )

    def configuration(self, start: str | Positions) -> Array:
        """Return all of qpos of the arm's model, (nq,), for a keyframe's name or for positions.

        Args:
            start: Without a keyframe `home`, that name means the model's zero position. With positions of the
                arm's joints, (n,), the other joints rest. An array (nq,) is returned as it is: where nq is n,
                both mean the same. Of MuJoCo's data, joints count by their names; those that the data lack
                rest.

        Raises:
            ModelError: There is no such keyframe, or the data lack a joint of the arm.
            QuestionError: It is no array of finite numbers of these shapes.
        """
        if isinstance(start, str):
            if start not in self.keyframes and start != "home":
                known = listed(sorted(self.keyframes)) or "none"
                hint = did_you_mean(start, self.keyframes)
                raise ModelError(
                    f'{self.path}: has no keyframe "{start}"{hint}; its keyframes: {known}', "start"
                )
            qpos = np.array(self.keyframes.get(start, self.model.qpos0))
            self._place(qpos, qpos[self.wiring.qpos])
            return qpos
        qpos = np.array(self._rest)
        if isinstance(start, mujoco.MjData):
            self.located(start.model)  # or refuse
            for joint in range(self.model.njnt):
                copy_joint(start, self.model, joint, qpos)
            return qpos
        try:
            values = np.array(start, np.float64)
        except (TypeError, ValueError):
            raise QuestionError(f"q must be numbers, got {shortened(repr(start))}") from None
        if values.shape not in (qpos.shape, (self.n,)):
            raise QuestionError(f"q must be {self.forms}, got {values.shape}")
        if not np.isfinite(values).all():
            raise QuestionError(f"q must be finite, got {shortened(str(values.tolist()))}")
        if values.shape == qpos.shape:
            return values
        self._place(qpos, values)
        return qpos

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
        try:
            is_whole = np.shape(q)[-1:] == (self.model.nq,)
        except ValueError:  # rows of different lengths
            return q
        return np.asarray(q)[..., self.wiring.qpos] if is_whole else q

    def located(self, model: mujoco.MjModel, *sites: str) -> Location:
        """Return where another model has the arm, and some of its sites.

        Raises:
            ModelError: The model lacks a joint, or the body of a site.
        """
        try:
            return locate(model, self.joints, self.axis_names, self.model, sites)
        except KeyError as error:
            text = " ".join(str(error).strip("'\"").split())
            raise ModelError(f"the model of the data lacks a part of {self.path}: {text}") from None

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
        elsewhere = self.others.addresses
        is_home = np.array_equal(qpos[elsewhere], self.configuration("home")[elsewhere])
        name = start if isinstance(start, str) else "home" if is_home else None
        keys = self._written.keys
        stands_for = {key.name: key for key in keys}
        if self.home is not None:
            stands_for["home"] = keys[self.home]
        key = stands_for.get(name) if name else None
        given = (None, None) if key is None else (list(key.ctrl), list(key.act))
        ctrl, act = (np.array(values) if values else None for values in given)
        ctrl, act = self.others.controls(qpos, ctrl, act, every=own)
        if own:
            stands = key is not None and np.array_equal(qpos, self.configuration(name or "home"))
            self.drives.forget(ctrl, act, *(bool(values) and stands for values in given))
        return ctrl, act

    def moves_at(self, start: str | Sequence[float]) -> bool:
        """Return whether the keyframe of a start, see `held`, has velocities."""
        key = self._key_of(start)
        return key is not None and bool(self.model.key_qvel[key].any())

    def _key_of(self, start: str | Sequence[float]) -> int | None:
        """Return the number of a start's keyframe: by its name, or the one that replaces `home`."""
        name = start if isinstance(start, str) else "home"
        if name == "home" and self.home is not None:
            return self.home
        return next((i for i in range(self.model.nkey) if self.model.key(i).name == name), None)

    def placed(self, qpos: Array, q: Array) -> Array:
        """Return a configuration of the model, (nq,), with the arm's joints moved to q, (n,)."""
        there = np.array(qpos)
        self._place(there, q)
        return there

    def _place(self, qpos: Array, q: Sequence[float] | Array) -> None:
        qpos[self.wiring.qpos] = q
        for address, one in zip(self.wiring.follower_qpos, self.followers, strict=True):
            qpos[address] = one.offset + one.ratio * qpos[self.wiring.qpos[one.leader]]
        for name, link in self._links.items():  # followers of joints that are not the arm's
            leader = qpos[self.model.jnt_qposadr[link.leader]] if link.leader >= 0 else 0.0
            qpos[self.model.joint(name).qposadr[0]] = link.offset + link.ratio * leader

    def _followed(self, columns: Array) -> Array:
        """Return the columns of the arm's joints, (..., n), from the model's, (..., nv)."""
        own = columns[..., self.wiring.dof]
        for address, one in zip(self.wiring.follower_dof, self.followers, strict=True):
            own[..., one.leader] += one.ratio * columns[..., address]
        return own

    @property
    def followed_dofs(self) -> tuple[list[int], Array]:
        """Addresses in qvel of all joints that move with the arm, and their ratios to the arm's joints."""
        rows = [np.eye(self.n), *(one.ratio * np.eye(self.n)[[one.leader]] for one in self.followers)]
        return [*self.wiring.dof.tolist(), *self.wiring.follower_dof.tolist()], np.concatenate(rows)

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

    @property
    def sites(self) -> tuple[str, ...]:
        """Names of all sites of the model that have a name."""
        return tuple(name for i in range(self.model.nsite) if (name := self.model.site(i).name))

    def require_open(self) -> None:
        """Refuse an arm that is no open chain, which no law here can control.

        Raises:
            ModelError: An equality ties it.
        """
        if self.ties:
            raise ModelError(
                f"{self.path}: {listed(self.ties)} {'ties' if len(self.ties) == 1 else 'tie'} the arm, which "
                'is then no open chain; set active="false" there in a copy of the model, or remove it',
                "model",
            )

    @cached_property
    def idle(self) -> tuple[str, ...]:
        """Names of the joints that move the controlled site and are not actuated."""
        return self.idle_before(self.site)[::-1]

    def moves(self, site: str) -> NDArray[np.bool_]:
        """Return which axes of the chain move a site, (ℓ,): those between the world and its body."""
        body = int(self.model.site_bodyid[self.model.site(site).id])
        return np.isin(self.wiring.axis, joints_above(self.model, body))

    def behind(self, site: str) -> tuple[int, Array, Array]:
        """Return the place of a site behind the chain, with all joints of the arm at 0.

        Returns:
            The last axis that moves it, the vector from the point on that axis to the site, (3,) [m], and the
            orientation of the site, (4,).
        """
        last = int(np.flatnonzero(self.moves(site))[-1])
        pose = self.pose(np.zeros(self.n), site)
        return last, pose[:3] - self._data.xanchor[self.wiring.axis[last]], pose[3:]

    def idle_before(self, site: str) -> tuple[str, ...]:
        """Return the names of joints between the world and a site that do not move with the arm's, inward."""
        above = joints_above(self.model, int(self.model.site_bodyid[self.model.site(site).id]))
        known = {*self.wiring.joint.tolist(), *self.wiring.follower_joint.tolist()}
        return tuple(joint_name(self.model, i) for i in above if i not in known)

    def pose(self, q: Positions, site: str | None = None) -> Array:
        """Return a site's pose in the world, [p, quat w x y z], (7,).

        Args:
            q: Joint positions, (n,) or (nq,), as in `configuration`; or MuJoCo's data of any model with the
                arm, whose positions count, those of all joints and mocap bodies, and so the base's.
            site: Name of a site; None: the controlled site.
        """
        if isinstance(q, mujoco.MjData):
            return self.located(q.model, site or self.site).pose(moved(q))
        self._kinematics(q)
        i = self.wiring.site if site is None else self.model.site(site).id
        return np.concatenate(
            [self._data.site_xpos[i], matrix_to_quat(self._data.site_xmat[i].reshape(3, 3))]
        )

    def jacobian(self, q: Positions) -> Array:
        """Return J (6, n), rows [v; ω] of the site along world axes; q is as in `pose`."""
        if isinstance(q, mujoco.MjData):
            return self.located(q.model, self.site).jacobian(moved(q), self.chain)
        self._kinematics(q)
        full = np.zeros((6, self.model.nv))
        mujoco.mj_jacSite(self.model, self._data, full[:3], full[3:], self.wiring.site)
        return self._followed(full)

    def rest_torques(self, q: Positions) -> tuple[Array, Array]:
        """Return the actuator loads at rest from gravity and from springs, (n,) each [N·m or N].

        The model's own gravity compensation is subtracted. Joints that are not the arm's are at rest.
        """
        self._kinematics(q)
        mujoco.mj_fwdPosition(self.model, self._data)
        mujoco.mj_fwdVelocity(self.model, self._data)
        weight = self._data.qfrc_bias - self._data.qfrc_gravcomp
        return self._followed(weight), self._followed(-self._data.qfrc_spring)

    @property
    def has_springs(self) -> bool:
        """Whether there is a spring in the model."""
        model = self.model
        springs = (
            model.jnt_stiffness, model.jnt_stiffnesspoly, model.tendon_stiffness, model.tendon_stiffnesspoly
        )  # fmt: skip
        is_off = model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_SPRING
        return not is_off and any(np.any(stiffness) for stiffness in springs)

    def most_spring_torques(self, q: Array) -> Array:
        """Return the largest actuator loads from springs, (n,), at q and with a joint at an end of its range.

        The range of a joint without limits is half a turn, or π meters, to either side.
        """
        lower, upper = self.position_limit.T
        ends = np.where(np.isfinite(lower), lower, q - np.pi), np.where(np.isfinite(upper), upper, q + np.pi)
        places = [q, *(np.where(np.arange(self.n) == j, end, q) for j in range(self.n) for end in ends)]
        torques: Array = np.max([np.abs(self.rest_torques(place)[1]) for place in places], axis=0)
        return torques

    @property
    def damping(self) -> Array:
        """Damping of each joint at rest, (n,) [N·m·s/rad or N·s/m]."""
        damping = np.array(self.model.dof_damping[self.wiring.dof])
        for address, one in zip(self.wiring.follower_dof, self.followers, strict=True):
            damping[one.leader] += one.ratio**2 * self.model.dof_damping[address]
        return damping

    @property
    def friction(self) -> Array:
        """Dry friction that can carry a part of an actuator's load at rest, (n,) [N·m or N]."""
        loss = np.array(self.model.dof_frictionloss[self.wiring.dof])
        for address, one in zip(self.wiring.follower_dof, self.followers, strict=True):
            loss[one.leader] += abs(one.ratio) * self.model.dof_frictionloss[address]
        return loss

    def frames(self, qpos: Array) -> tuple[Array, Array]:
        """Return the moving frames for configurations of the model, (T, nq).

        Returns:
            Poses of all bodies in the world, (T, nbody, 7), and Jacobians of the site, (T, 6, n).
        """
        model, data, site = self.model, self._data, self.wiring.site
        poses, full = np.empty((len(qpos), model.nbody, 7)), np.zeros((len(qpos), 6, model.nv))
        places, turns, moves, spins = poses[..., :3], poses[..., 3:], full[:, :3], full[:, 3:]
        for i, configuration in enumerate(qpos):
            data.qpos[:] = configuration
            mujoco.mj_fwdKinematics(model, data)
            mujoco.mj_jacSite(model, data, moves[i], spins[i], site)
            places[i], turns[i] = data.xpos, data.xquat
        data.qpos[:] = self._rest
        return poses, self._followed(full)

    @property
    def base(self) -> int:
        """Id of the body that carries the first joint's body: the world, or a body on it."""
        return self.wiring.base

    @property
    def base_pose(self) -> Array:
        """Pose of the base in the world, [p, quat w x y z], (7,), with the other joints at rest."""
        return self.base_at(self._rest)

    def base_at(self, q: Positions) -> Array:
        """Return the pose of the base in the world, (7,); q is as in `pose`."""
        if isinstance(q, mujoco.MjData):
            return self.located(q.model).base_pose(moved(q))
        self._kinematics(q)
        return np.concatenate([self._data.xpos[self.base], self._data.xquat[self.base]])

    @property
    def body_names(self) -> list[str]:
        """Names of all bodies, the world first; a body without a name has its number."""
        return [self.model.body(b).name or f"body{b}" for b in range(self.model.nbody)]

    @property
    def is_balanced(self) -> bool:
        """Whether gravity acts on no joint of the arm: there is none, or the model compensates all of it."""
        model, root = self.model, int(self.model.jnt_bodyid[self.wiring.joint[0]])
        heavy = [b for b in range(root, model.nbody) if model.body_mass[b] > 0.0 and self._descends(b, root)]
        return not model.opt.gravity.any() or all(model.body_gravcomp[b] == 1.0 for b in heavy)

    @property
    def is_fixed(self) -> NDArray[np.bool_]:
        """Which bodies are fixed to the world, (nbody,)."""
        fixed: NDArray[np.bool_] = self.model.body_weldid == 0
        return fixed

    @property
    def _written(self) -> mujoco.MjSpec:
        """The specification of the model.

        Raises:
            ModelError: Only a compiled model is known.
        """
        if self._spec is None:
            raise ModelError(
                f"{self.path}: a plant needs the model's file or an MjSpec, not a compiled model"
            )
        return self._spec

    @cached_property
    def _bare_spec(self) -> mujoco.MjSpec:
        """The author's model without textures, which take nearly all of its memory and time to compile."""
        spec = self._written.copy()
        for material in spec.materials:
            material.textures = [""] * len(material.textures)
        for texture in list(spec.textures):
            spec.delete(texture)
        return spec

    @cached_property
    def _untextured(self) -> mujoco.MjModel:
        return compiled(self.path, self._bare_spec.copy())

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
        check_stretch(self.path, self.model, stretch)
        model = copy.copy(self._untextured)
        for name, values in stretched_fields(model, stretch).items():
            getattr(model, name)[:] = values
        arm = replace(self, model=model, stretch={**self.stretch, **stretch})
        mujoco.mj_setConst(model, arm._data)
        arm._data.qpos[:] = arm._rest
        return arm

    def _kinematics(self, q: Positions) -> None:
        self._data.qpos[:] = self.configuration(q)
        mujoco.mj_fwdKinematics(self.model, self._data)

    def adapted(
        self, drive: Drive | Own | None, timestep: float, gravity_compensation: bool, *, loaded: bool = False
    ) -> mujoco.MjModel:
        """Return the model with the actuators of a plant: one on each joint of the arm, its own, or none.

        It is compiled once for equal requests, and no caller may write to it.

        Actuators that also act on other joints stay, before the added ones, in their order. The author's
        defaults for actuators do not apply to the added ones: a control of 1 is 1 rad/s or N·m. Controls are
        not clamped here, because the law limits the rates; torque limits are kept. Other joints that no
        actuator holds are locked, unless `frees_others`. Sensors are off, as nothing reads them. The
        integrator is `implicitfast`, because servos stiff enough for tracking are unstable under Euler. If
        joints follow others, it is `discrete`, also for the author's own actuators, and the equalities that
        hold the followers are as stiff as the timestep bears; for own actuators, where he wrote no softness.
        Lengths are the author's even if bodies are stretched: worlds with different factors share this model.

        Args:
            drive: The kind of actuators; "own" for the author's, with his integrator; None for a plant
                without physics, which only needs kinematics.
            timestep: MuJoCo's step [s].
            gravity_compensation: Whether the weight of the arm's bodies is compensated, as in a balanced arm.
            loaded: Whether a body without mass is added at the site, to be given the mass of a payload;
                nothing compensates its weight.
        """
        asked = drive, timestep, gravity_compensation, loaded, self.frees_others
        return self._adaptations.get(*asked)

    @cached_property
    def _adaptations(self) -> Adaptations:
        return Adaptations(
            self.path, self.model, self._bare_spec, self.others, self.joints,
            frozenset(one.name for one in self.followers), self.torque_limit, self.site, self._adapted,
        )  # fmt: skip

    def _descends(self, body: int, root: int) -> bool:
        return descends(self.model, body, root)

    def shapes(self) -> list[Shape]:
        """Return the visible geoms of the model, without planes."""
        return visible(self.model, self.stretch)
