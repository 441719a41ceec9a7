"""The parts of a model that are not the arm: which of its joints its actuators hold, and which are locked.

Joints beside the arm stay where a run starts. An actuator that works like a spring about its control holds
its joints. Joints that none holds are locked in a copy of the model, unless they follow moving joints by an
equality, or belong to a floating object, such as a cube on a table, or to a flex.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from functools import cached_property
from itertools import combinations, pairwise
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm.wiring import joints_of, soft_bodies
from rmrc.support.errors import ModelError

Array = NDArray[np.float64]

# Inertia [kg·m² or kg] and damping [N·m·s/rad or N·s/m] of a locked joint: 1 kN·m turns it at 1e-12 rad/s,
# and a robot's inertia is negligible beside it. With 1e8 and more, MuJoCo's contact solver stops too early:
# 4e-3 rad off with 1e9. A model that disables damping has the larger inertia instead: 1 kN·m then turns it by
# 2e-6 rad in a minute.
LOCKED_INERTIA, LOCKED_DAMPING, UNDAMPED_INERTIA = 1e6, 1e15, 1e12

# The most pairs of bodies that are kept from touching; the model holds each as an exclude.
MOST_PAIRS = 100_000

# MuJoCo's arrays hold plain integers, which its enums do not equal.
_FREE = int(mujoco.mjtJoint.mjJNT_FREE)
_JOINT_TARGETS = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
_TENDON, _SITE = int(mujoco.mjtTrn.mjTRN_TENDON), int(mujoco.mjtTrn.mjTRN_SITE)
_CRANK = int(mujoco.mjtTrn.mjTRN_SLIDERCRANK)
_FIXED_GAIN, _SPRING = int(mujoco.mjtGain.mjGAIN_FIXED), int(mujoco.mjtBias.mjBIAS_AFFINE)
_STATELESS, _INTEGRATOR = int(mujoco.mjtDyn.mjDYN_NONE), int(mujoco.mjtDyn.mjDYN_INTEGRATOR)
_FILTERS = (int(mujoco.mjtDyn.mjDYN_FILTER), int(mujoco.mjtDyn.mjDYN_FILTEREXACT))
_EQUAL_JOINTS, _EQUAL_TENDONS = int(mujoco.mjtEq.mjEQ_JOINT), int(mujoco.mjtEq.mjEQ_TENDON)
_HOLDS_BODIES = (int(mujoco.mjtEq.mjEQ_CONNECT), int(mujoco.mjtEq.mjEQ_WELD))
_WRAPS_JOINT = int(mujoco.mjtWrap.mjWRAP_JOINT)
_WRAPS_SITE = int(mujoco.mjtWrap.mjWRAP_SITE)
_WRAPS_GEOM = (int(mujoco.mjtWrap.mjWRAP_SPHERE), int(mujoco.mjtWrap.mjWRAP_CYLINDER))
_SITE_OBJECT = int(mujoco.mjtObj.mjOBJ_SITE)


class Others:
    """Joints and actuators of a model that are not an arm's, by their ids.

    Attributes:
        model: The author's model.
        replaced: Actuators that act on joints of the arm and on no other.
        kept: All other actuators, in order.
    """

    def __init__(self, model: mujoco.MjModel, joints: Sequence[int], site: int) -> None:
        """Examine a model.

        Args:
            model: The author's model.
            joints: Joints of the arm, and their followers.
            site: The site that they move.
        """
        self.model, self._own, self._site = model, frozenset(int(joint) for joint in joints), site
        pulls = [self._found_pulled(i) for i in range(model.nactuator)]
        self.replaced = frozenset(i for i, pulled in enumerate(pulls) if pulled and pulled <= self._own)
        self.kept = tuple(i for i in range(model.nactuator) if i not in self.replaced)
        self._pulls = pulls

    @cached_property
    def addresses(self) -> NDArray[np.intp]:
        """Addresses in qpos of all joints that are not the arm's."""
        own = [_addresses(self.model, joint) for joint in self._own]
        return np.setdiff1d(np.arange(self.model.nq), np.concatenate(own))

    @cached_property
    def locked(self) -> frozenset[int]:
        """Joints without an actuator that holds them, a moving leader, a floating root or a flex."""
        model = self.model
        held = (self._pulls[i] for i in self.kept if self.holds(i))
        moving = self._own.union(*held, self._floating())
        below = self._between(int(model.site_bodyid[self._site]), 0) - moving
        links = [linked - below for linked in self._equalities().values()]
        grown = True
        while grown:
            grown = False
            for linked in links:
                if not linked <= moving and not linked.isdisjoint(moving):
                    moving, grown = moving | linked, True
        return frozenset(range(model.njnt)) - moving

    def is_linear(self, actuator: int) -> bool:
        """Return whether an actuator's length changes in constant proportion to its joints."""
        model, transmission = self.model, int(self.model.actuator_trntype[actuator])
        target = int(model.actuator_trnid[actuator, 0])
        if transmission != _TENDON:
            return transmission in _JOINT_TARGETS
        first = int(model.tendon_adr[target])
        parts = model.wrap_type[first : first + int(model.tendon_num[target])]
        return bool((parts == _WRAPS_JOINT).all())

    def pulled(self, actuator: int) -> frozenset[int]:
        """Return the joints on which an actuator acts."""
        return self._pulls[actuator]

    def holds(self, actuator: int) -> bool:
        """Return whether a constant control holds an actuator's joints: it acts as a spring about that."""
        model = self.model
        return bool(
            model.actuator_gaintype[actuator] == _FIXED_GAIN
            and model.actuator_biastype[actuator] == _SPRING
            and model.actuator_dyntype[actuator] in (_STATELESS, _INTEGRATOR, *_FILTERS)
            and model.actuator_ctrlnum[actuator] == 1
            and abs(model.actuator_gainprm[actuator, 0]) > mujoco.mjMINVAL
            and model.actuator_biasprm[actuator, 1] < 0.0
        )

    def controls(
        self, qpos: Array, ctrl: Array | None, act: Array | None, every: bool = False
    ) -> tuple[Array, Array]:
        """Return controls and activations of the kept actuators, in their order.

        If the keyframe has none, an actuator that can hold gets values at which it gives no force at the
        start: gain · u + bias₀ + bias₁ · length = 0, within its range.

        Args:
            qpos: Start configuration of the model, (nq,).
            ctrl: Controls of the keyframe, (nu,), or None if it has none.
            act: Its activations, (na,), or None.
            every: Whether to return those of all actuators.
        """
        model = self.model
        data = mujoco.MjData(model)
        mujoco.mj_resetCtrl(model, data)
        controls = np.array(data.ctrl if ctrl is None else ctrl)
        states = np.array(data.act if act is None else act)
        if ctrl is None or act is None:
            data.qpos[:] = qpos
            for find in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_tendon, mujoco.mj_transmission):
                find(model, data)
            for i in filter(self.holds, self.kept):
                length = float(data.actuator_length[model.actuator_outadr[i]])
                self._hold(i, length, controls, states, ctrl, act)
        if every:
            return controls, states
        return (
            _spans(controls, model.actuator_ctrladr, model.actuator_ctrlnum, self.kept),
            _spans(states, model.actuator_actadr, model.actuator_actnum, self.kept),
        )

    def _hold(
        self, i: int, length: float, controls: Array, states: Array, ctrl: Array | None, act: Array | None
    ) -> None:
        """Write the control and activation of one actuator, unless a keyframe gives them."""
        model = self.model
        at = int(model.actuator_ctrladr[i])
        state = int(model.actuator_actadr[i] + model.actuator_actnum[i] - 1)
        bias = model.actuator_biasprm[i]
        wanted = -(bias[0] + bias[1] * length) / model.actuator_gainprm[i, 0]
        kind = model.actuator_dyntype[i]
        if kind == _INTEGRATOR:  # its control is a rate
            if act is None:
                states[state] = _within(wanted, model.actuator_actlimited[i], model.actuator_actrange[i])
            return
        if kind in _FILTERS and ctrl is None and act is not None:
            wanted = act[state]
        if ctrl is None:
            controls[at] = _within(wanted, model.actuator_ctrllimited[i], model.actuator_ctrlrange[i])
        if kind in _FILTERS and act is None:
            states[state] = controls[at]

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
        locked = self.locked
        is_undamped = spec.option.disableflags & mujoco.mjtDisableBit.mjDSBL_DAMPER
        inertia = UNDAMPED_INERTIA if is_undamped else LOCKED_INERTIA
        for joint in (one for one in spec.joints if one.id in locked):
            joint.armature, joint.damping, joint.stiffness = inertia, [LOCKED_DAMPING, 0, 0], [0, 0, 0]
            joint.springdamper, joint.frictionloss = [0, 0], 0.0
            joint.limited = joint.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE
        for tendon in spec.tendons:
            if self.along(tendon.id) <= locked:
                tendon.limited, tendon.frictionloss = mujoco.mjtLimited.mjLIMITED_FALSE, 0.0
        still = {i for i, linked in self._equalities().items() if linked <= locked}
        for equality in spec.equalities:
            if equality.id in still:
                equality.active = False
        self._keep_apart(spec, path)

    def _keep_apart(self, spec: mujoco.MjSpec, path: Path) -> None:
        """Exclude contacts between bodies that only locked joints connect."""
        model = self.model
        carrier = np.arange(model.nbody)
        for b in range(1, model.nbody):
            if self.locked.issuperset(joints_of(model, b)):
                carrier[b] = carrier[model.body_parentid[b]]
        weld, known = model.body_weldid, {int(signature) for signature in model.exclude_signature}
        collides = (model.geom_contype | model.geom_conaffinity) != 0
        groups: dict[int, list[int]] = {}
        for b in np.unique(model.geom_bodyid[collides]):
            groups.setdefault(int(carrier[b]), []).append(int(b))
        alike = (Counter(weld[group].tolist()).values() for group in groups.values())
        if sum(sum(counts) ** 2 - sum(n * n for n in counts) for counts in alike) > 2 * MOST_PAIRS:
            raise ModelError(
                f"{path}: has {len(self.locked)} joints to lock, with more than {MOST_PAIRS} pairs of "
                "bodies that could touch; use arm.others: free, or remove bodies that are not part of the "
                "robot"
            )
        names = {body.id: _named(body) for body in spec.bodies}
        for group in groups.values():
            for a, b in combinations(group, 2):
                if weld[a] != weld[b] and (a << 16) + b not in known:
                    spec.add_exclude(bodyname1=names[a], bodyname2=names[b])
        geoms = {geom.name: int(carrier[model.geom_bodyid[geom.id]]) for geom in spec.geoms}
        for pair in list(spec.pairs):
            if geoms[pair.geomname1] == geoms[pair.geomname2]:
                spec.delete(pair)

    def _floating(self) -> frozenset[int]:
        """Joints of trees with a free joint at their root, and of the points of a flex."""
        model = self.model
        soft = {joint for body in soft_bodies(model) for joint in joints_of(model, body)}
        trees = {int(model.body_rootid[model.jnt_bodyid[j]]) for j in np.flatnonzero(model.jnt_type == _FREE)}
        hang = (j for j in range(model.njnt) if int(model.body_rootid[model.jnt_bodyid[j]]) in trees)
        return frozenset(hang) | soft

    def _found_pulled(self, i: int) -> frozenset[int]:
        model = self.model
        kind, (first, second) = int(model.actuator_trntype[i]), model.actuator_trnid[i]
        if kind in _JOINT_TARGETS:
            return frozenset([int(first)])
        if kind == _TENDON:
            return self.along(int(first))
        if kind in (_SITE, _CRANK):
            return self._between(*(int(model.site_bodyid[s]) if s >= 0 else 0 for s in (first, second)))
        return frozenset()

    def along(self, tendon: int) -> frozenset[int]:
        """Return the joints that change the length of a tendon."""
        model = self.model
        parts = range(model.tendon_adr[tendon], model.tendon_adr[tendon] + model.tendon_num[tendon])
        kinds, ids = model.wrap_type, model.wrap_objid
        of_joints = frozenset(int(ids[w]) for w in parts if kinds[w] == _WRAPS_JOINT)
        bodies = [
            int(model.site_bodyid[ids[w]] if kinds[w] == _WRAPS_SITE else model.geom_bodyid[ids[w]])
            for w in parts
            if kinds[w] in (_WRAPS_SITE, *_WRAPS_GEOM)
        ]
        return of_joints.union(*(self._between(a, b) for a, b in pairwise(bodies)))

    def _equalities(self) -> dict[int, frozenset[int]]:
        """Return the joints that each active equality links."""
        return {
            int(i): linked
            for i in np.flatnonzero(self.model.eq_active0)
            if (linked := frozenset(self._linked(int(i))))
        }

    def _linked(self, i: int) -> Iterator[int]:
        model = self.model
        kind, ids = int(model.eq_type[i]), [int(model.eq_obj1id[i]), int(model.eq_obj2id[i])]
        if kind in _HOLDS_BODIES:
            if model.eq_objtype[i] == _SITE_OBJECT:
                ids = [int(model.site_bodyid[s]) for s in ids]
            yield from self._between(*ids)
        for one in (one for one in ids if one >= 0):
            if kind == _EQUAL_JOINTS:
                yield one
            elif kind == _EQUAL_TENDONS:
                yield from self.along(one)

    def _between(self, a: int, b: int) -> frozenset[int]:
        """Return the joints that move one body relative to another."""
        return frozenset(self._above(a) ^ self._above(b))

    def _above(self, body: int) -> set[int]:
        model, joints = self.model, set[int]()
        while body > 0:
            joints.update(joints_of(model, body))
            body = int(model.body_parentid[body])
        return joints


def _addresses(model: mujoco.MjModel, joint: int) -> NDArray[np.intp]:
    first = model.jnt_qposadr[joint]
    return np.arange(first, model.jnt_qposadr[joint + 1] if joint + 1 < model.njnt else model.nq)


def _within(value: float, is_limited: bool, ends: Array) -> float:
    return float(np.clip(value, *ends)) if is_limited else float(value)


def _named(body: mujoco.MjsBody) -> str:
    body.name = body.name or f"rmrc:body{body.id}"
    return str(body.name)


def _spans(values: Array, first: NDArray[np.int32], count: NDArray[np.int32], chosen: Sequence[int]) -> Array:
    """Return the values of some actuators; each has a number of values from its first one on."""
    return values[[k for i in chosen for k in range(first[i], first[i] + count[i])]]
