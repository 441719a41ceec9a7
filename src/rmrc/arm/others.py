"""The parts of a model that are not the arm: which of its joints its actuators hold, and which are locked.

Joints beside the arm stay where a run starts. An actuator that works like a spring about its control holds
its joints. Joints that none holds are locked in a copy of the model, unless they follow moving joints by an
equality, or belong to a floating object, such as a cube on a table, or to a flex.
"""

from collections.abc import Sequence
from functools import cached_property
from itertools import combinations, islice
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm.actuators import EVERYWHERE, DriveKind, Ends, kind_of, moments_of, terms_of
from rmrc.arm.wiring import Wiring, dense, joints_above, joints_of, soft_bodies
from rmrc.support.errors import ModelError
from rmrc.support.text import listed

Array = NDArray[np.float64]

# Inertia [kg·m² or kg] and damping [N·m·s/rad or N·s/m] of a locked joint: 1 kN·m turns it at 1e-12 rad/s,
# and a robot's inertia is negligible beside it. With 1e8 and more, MuJoCo's contact solver stops too early:
# 4e-3 rad off with 1e9. A model that disables damping has the larger inertia instead: 1 kN·m then turns it by
# 2e-6 rad in a minute.
LOCKED_INERTIA, LOCKED_DAMPING, UNDAMPED_INERTIA = 1e6, 1e15, 1e12
# Less than this in a Jacobian is rounding.
_ROUNDING = 1e-12

# With moments scaled to a largest one of 1, less than this is rounding.
_RANK = 1e-9
# The most pairs of bodies that are kept from touching; the model holds each as an exclude.
MOST_PAIRS = 100_000


class Others:
    """Joints and actuators of a model that are not an arm's, by their ids.

    Attributes:
        model: The author's model.
        own: Joints of the arm, and their followers.
        pulled: The joints on which each actuator acts.
        along: The joints that change the length of each tendon.
        is_linear: Whether the length of each actuator changes in constant proportion to its joints.
        replaced: Actuators that act on joints of the arm and on no other.
        kept: All other actuators, in order.
    """

    def __init__(self, model: mujoco.MjModel, wiring: Wiring) -> None:
        """Examine a model.

        Args:
            model: The author's model.
            wiring: Indices of the arm in it.
        """
        self.model, self._body = model, wiring.body
        self.own = frozenset([*wiring.joint.tolist(), *wiring.follower_joint.tolist()])
        data, rng = mujoco.MjData(model), np.random.default_rng(0)
        moments = []
        for _ in range(2):  # nothing is at rest in MuJoCo's Jacobians by chance
            mujoco.mj_integratePos(model, data.qpos, rng.uniform(-0.5, 0.5, model.nv), 1.0)
            mujoco.mj_fwdKinematics(model, data)
            mujoco.mj_transmission(model, data)
            moments.append(moments_of(model, data))
        lengths = dense(data.ten_J, model.ten_J_rownnz, model.ten_J_rowadr, model.ten_J_colind, model.nv)
        self.pulled, self.along = self._joints(moments[0]), self._joints(lengths)
        self.is_linear = [np.allclose(a, b, atol=_ROUNDING) for a, b in zip(*moments, strict=True)]
        self.replaced = frozenset(i for i, joints in enumerate(self.pulled) if joints and joints <= self.own)
        self.kept = tuple(i for i in range(model.nactuator) if i not in self.replaced)

    def _joints(self, jacobian: Array) -> list[frozenset[int]]:
        """Return the joints that each row of a Jacobian, (..., nv), depends on."""
        return [frozenset(self.model.dof_jntid[np.abs(row) > _ROUNDING].tolist()) for row in jacobian]

    @cached_property
    def addresses(self) -> NDArray[np.intp]:
        """Addresses in qpos of all joints that are not the arm's."""
        return np.setdiff1d(np.arange(self.model.nq), self.model.jnt_qposadr[list(self.own)])

    def holds(self, actuator: int) -> bool:
        """Return whether a constant control holds an actuator's joints: it acts as a spring about that."""
        return kind_of(self.model, actuator) in (DriveKind.POSITION, DriveKind.INTVELOCITY)

    @cached_property
    def held(self) -> frozenset[int]:
        """Joints that an actuator beside the arm holds."""
        return frozenset().union(*(self.pulled[i] for i in self.kept if self.holds(i)))

    @cached_property
    def locked(self) -> frozenset[int]:
        """Joints without an actuator that holds them, a moving leader, a floating root or a flex."""
        model, root = self.model, self.model.body_rootid[self.model.jnt_bodyid]
        floats = np.isin(root, root[model.jnt_type == mujoco.mjtJoint.mjJNT_FREE])
        floats |= np.isin(model.jnt_bodyid, list(soft_bodies(model)))
        moving = self.own | self.held | set(np.flatnonzero(floats).tolist())
        below = self._between(self._body, 0) - moving
        links = [joints - below for joints in self._equalities().values()]
        while (grown := moving.union(*(joints for joints in links if joints & moving))) != moving:
            moving = grown
        return frozenset(range(model.njnt)) - moving

    def controls(self, data: mujoco.MjData, ctrl: Array | None, act: Array | None) -> tuple[Array, Array]:
        """Return controls, (nu,), and activations, (na,), of all actuators.

        If the keyframe has none, a kept actuator that can hold gets values at which it gives no force at the
        start: gain · u + bias₀ + bias₁ · length = 0, within its range.

        Args:
            data: Data at the start, with its transmissions.
            ctrl: Controls of the keyframe, (nu,), or None if it has none.
            act: Its activations, (na,), or None.
        """
        model = self.model
        mujoco.mj_resetCtrl(model, data)
        controls = np.array(data.ctrl if ctrl is None else ctrl)
        states = np.array(data.act if act is None else act)
        for i in (i for i in self.kept if self.holds(i)):
            integrates, place = kind_of(model, i) == DriveKind.INTVELOCITY, model.actuator_ctrladr[i]
            terms = terms_of(model, i, DriveKind.POSITION)
            wanted = terms.scale * data.actuator_length[model.actuator_outadr[i]] + terms.offset
            wanted = np.clip(wanted, *(terms.state if integrates else terms.control))
            if ctrl is None and not integrates:  # else its control is a rate
                controls[place] = wanted
            if act is None and model.actuator_actnum[i]:
                last = model.actuator_actadr[i] + model.actuator_actnum[i] - 1
                states[last] = wanted if integrates else controls[place]
        return controls, states

    def lock(self, spec: mujoco.MjSpec, path: Path) -> None:
        """Lock joints in a specification from which the model was compiled.

        No limit, spring, equality, tendon or contact acts on them, as MuJoCo gives constraints any force that
        they need.

        Args:
            spec: Changed.
            path: Path of the model's file.

        Raises:
            ModelError: Too many bodies could touch.
        """
        locked, off = self.locked, mujoco.mjtLimited.mjLIMITED_FALSE
        is_undamped = spec.option.disableflags & mujoco.mjtDisableBit.mjDSBL_DAMPER
        inertia = UNDAMPED_INERTIA if is_undamped else LOCKED_INERTIA
        for joint in (joint for joint in spec.joints if joint.id in locked):
            joint.armature, joint.damping, joint.stiffness = inertia, [LOCKED_DAMPING, 0, 0], [0, 0, 0]
            joint.springdamper, joint.frictionloss = [0, 0], 0.0
            joint.limited = joint.actfrclimited = off
        for tendon in (tendon for tendon in spec.tendons if self.along[tendon.id] <= locked):
            tendon.limited, tendon.frictionloss = off, 0.0
        still = {i for i, joints in self._equalities().items() if joints and joints <= locked}
        for equality in (equality for equality in spec.equalities if equality.id in still):
            equality.active = False
        self._keep_apart(spec, path)

    def _keep_apart(self, spec: mujoco.MjSpec, path: Path) -> None:
        """Exclude contacts between bodies that only locked joints connect."""
        model, carrier = self.model, np.arange(self.model.nbody)
        for b in range(1, model.nbody):
            if self.locked.issuperset(joints_of(model, b)):
                carrier[b] = carrier[model.body_parentid[b]]
        collides = (model.geom_contype | model.geom_conaffinity) != 0
        bodies, weld = np.unique(model.geom_bodyid[collides]), model.body_weldid
        groups = (bodies[carrier[bodies] == each].tolist() for each in np.unique(carrier[bodies]))
        pairs = (pair for group in groups for pair in combinations(group, 2))
        apart = list(islice((pair for pair in pairs if weld[pair[0]] != weld[pair[1]]), MOST_PAIRS + 1))
        if len(apart) > MOST_PAIRS:
            why = f"{len(self.locked)} joints to lock, and more than {MOST_PAIRS} pairs of bodies could touch"
            way = "use arm.others: free, or remove bodies that are not part of the robot"
            raise ModelError(f"{path}: has {why}; {way}")
        names = {}
        for body in spec.bodies:
            body.name = names[body.id] = body.name or f"rmrc:body{body.id}"
        for a, b in apart:
            spec.add_exclude(bodyname1=names[a], bodyname2=names[b])

    def _equalities(self) -> dict[int, frozenset[int]]:
        """Return the joints that each active equality links, except for those of a flex."""
        model, links = self.model, dict[int, frozenset[int]]()
        for i in np.flatnonzero(model.eq_active0).tolist():
            kind, ends = model.eq_type[i], [int(model.eq_obj1id[i]), int(model.eq_obj2id[i])]
            objects = [end for end in ends if end >= 0]
            if kind <= int(mujoco.mjtEq.mjEQ_WELD):  # or connect
                at_sites = model.eq_objtype[i] == mujoco.mjtObj.mjOBJ_SITE
                links[i] = self._between(*(model.site_bodyid[ends].tolist() if at_sites else ends))
            elif kind == mujoco.mjtEq.mjEQ_JOINT:
                links[i] = frozenset(objects)
            elif kind == mujoco.mjtEq.mjEQ_TENDON:
                links[i] = frozenset().union(*(self.along[end] for end in objects))
        return links

    def _between(self, a: int, b: int) -> frozenset[int]:
        """Return the joints that move one body relative to another."""
        return frozenset(joints_above(self.model, a)) ^ frozenset(joints_above(self.model, b))


# The arm's drives ---------------------------------------------------------------------------------


class Servo(NamedTuple):
    """A servo of one joint, in constant proportion: its control is slope · (position or rate) + offset.

    Attributes:
        command: Kind of its command.
        joint: The joint, by its place in the arm.
        slope: Control for each unit of the joint's position or rate.
        offset: Control at 0.
        position: Least and largest position that it takes as a command [rad or m].
        rate: Least and largest rate [rad/s or m/s].
    """

    command: DriveKind
    joint: int
    slope: float
    offset: float
    position: Ends
    rate: Ends


class OwnDrives:
    """The author's actuators that act on an arm's joints and on no others.

    A motor moves joints without a servo. Beside a servo it keeps its control, and so do actuators of other
    kinds.

    Attributes:
        kinds: Kind of the command of each actuator, by its id.
        idle: Ids of actuators that act on the arm's joints and get no commands.
    """

    def __init__(self, model: mujoco.MjModel, others: Others, F: Array) -> None:
        """Examine the actuators of a model.

        Args:
            model: The author's model.
            others: Its parts that are not the arm.
            F: Rates of all joints of the model for unit rates of the arm's, (nv, n).
        """
        self._model, self._others, self._F = model, others, F
        kinds = {i: kind for i in sorted(others.replaced) if (kind := kind_of(model, i)) is not None}
        motors = {i for i, kind in kinds.items() if kind == DriveKind.MOTOR}
        served = frozenset().union(*(others.pulled[i] for i in kinds.keys() - motors))
        beside = {i for i in motors if not served.isdisjoint(others.pulled[i])}
        self.kinds = {i: kind for i, kind in kinds.items() if i not in beside}
        self.idle = tuple(sorted(others.replaced - self.kinds.keys()))

    def moments(self, data: mujoco.MjData) -> Array:
        """Return the rate of length of each actuator at unit rate of each joint, (d, n)."""
        return np.asarray(moments_of(self._model, data)[list(self.kinds)] @ self._F)

    def servos(self, data: mujoco.MjData, q: Array) -> dict[int, Servo]:
        """Return the servos that move one joint each in constant proportion, by their ids.

        Args:
            data: Data at a configuration, with its transmissions.
            q: Positions of the arm's joints there, (n,).
        """
        model, servos = self._model, dict[int, Servo]()
        for row, (i, kind) in zip(self.moments(data), self.kinds.items(), strict=True):
            driven = np.flatnonzero(np.abs(row) > _RANK * np.abs(row).max())
            if kind == DriveKind.MOTOR or len(driven) != 1 or not self._others.is_linear[i]:
                continue
            j, terms = int(driven[0]), terms_of(model, i, kind)
            slope = float(terms.scale * row[j])
            length = float(data.actuator_length[model.actuator_outadr[i]])
            start = terms.offset + terms.scale * length - slope * q[j]  # control or activation at q = 0
            position = _ends(terms.state, slope, start)
            if kind == DriveKind.POSITION:
                offset, rate, (low, high) = start, EVERYWHERE, _ends(terms.control, slope, start)
                position = max(low, position[0]), min(high, position[1])
            else:
                offset = terms.offset if kind == DriveKind.VELOCITY else 0.0
                rate = _ends(terms.control, slope, offset)
            servos[i] = Servo(kind, j, slope, offset, position, rate)
        return servos

    def undriven(self, data: mujoco.MjData) -> list[int]:
        """Return the joints of the arm that the actuators cannot move one by one, by their indices.

        Args:
            data: Data at a configuration, with its transmissions.
        """
        moments = [row / size for row in self.moments(data) if (size := np.abs(row).max()) > mujoco.mjMINVAL]
        _, sigma, right = np.linalg.svd(np.reshape(moments, (-1, self._F.shape[1])))
        free = np.abs(right[int((sigma > _RANK).sum()) :]).max(axis=0, initial=0.0)
        return np.flatnonzero(free > _RANK).tolist()

    def named(self, actuators: Sequence[int]) -> str:
        """Return the names of actuators, or their numbers, as a list."""
        return listed(self._model.actuator(i).name or f"actuator{i}" for i in actuators)


def _ends(ends: Ends, slope: float, offset: float) -> Ends:
    """Return least and largest value whose control, slope · value + offset, is between two ends."""
    first, last = sorted((end - offset) / slope for end in ends)
    return first, last
