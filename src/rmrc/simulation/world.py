"""One world: its record, its model and data in MuJoCo, and the rows of its run."""

import copy
import ctypes
import threading
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, TypeAlias

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm import Wiring
from rmrc.arm.adapting import set_fields
from rmrc.law.compiling import Method, missing_nothing, uninterrupted
from rmrc.law.joint_motion import return_first
from rmrc.law.limits import by_joint
from rmrc.law.measurement import look_at
from rmrc.law.record import ENGINE_FIELDS, capacity, new_worlds
from rmrc.law.settings import LATE, link
from rmrc.plants import engine
from rmrc.plants.contacts import Contacts, can_touch
from rmrc.plants.plant import Plant
from rmrc.results.columns import COLUMNS, Divergence, widths
from rmrc.simulation.footprint import has_others
from rmrc.simulation.prepare import Prepared
from rmrc.simulation.reference import BLOCK
from rmrc.simulation.ticks import believe, ticks

Array = NDArray[np.float64]

# Groups of a world's record that hold columns, beside `tick`.
_ELSEWHERE = {"sigma": "first", "gain": "first", "damping": "first"}

_Watch = ctypes.CFUNCTYPE(None, ctypes.c_int64)


# A model, the fields in which its copy differs, data of the copy, and the addresses of its arrays.
_Spare: TypeAlias = tuple[mujoco.MjModel, tuple[str, ...], mujoco.MjData, dict[str, int]]
_MOST_SPARES = 4


class _Spares(threading.local):
    """Copies of models, with their data, that no world of this thread uses any more."""

    free: tuple[_Spare, ...] = ()


_spares = _Spares()


def _take(base: mujoco.MjModel, fields: Mapping[str, Array]) -> _Spare:
    """Return a copy of a model with other values in some fields, and data as if new."""
    fitting = [spare for spare in _spares.free if spare[0] is base and spare[1] == tuple(fields)]
    spare = fitting[0] if fitting else (base, tuple(fields), mujoco.MjData(copy.copy(base)), dict[str, int]())
    _spares.free = tuple(other for other in _spares.free if other is not spare)
    set_fields(spare[2].model, fields)
    spare[2].timer.number[:] = 0  # a reset logs the timers of past steps, and its handler may never return
    mujoco.mj_resetData(spare[2].model, spare[2])
    return spare


def compile_for(prepared: Prepared) -> None:
    """Compile or load all that a world of this scenario calls, which takes seconds once.

    Args:
        prepared: The scenario.
    """
    joints = capacity(_room(prepared))
    for field, method in methods(prepared).items():
        if field not in LATE:
            method.address(joints)


def _room(prepared: Prepared) -> int:
    """Return how many joints the record of a world holds: those of the arm, its chain, or its followers."""
    arm = prepared.arm
    return max(arm.n, len(arm.axis_names), len(arm.followers))


def methods(prepared: Prepared) -> Mapping[str, Method]:
    """Return all methods that a world calls, by their fields in its record."""
    misled = {"believe": believe} if prepared.hardware.is_misled else {}
    back = {"move_joints": return_first, "by_joint": by_joint} if prepared.starts_outside else {}
    return {"ticks": ticks, **prepared.law.methods, **prepared.hardware.methods, **misled, **back}


@lru_cache(16)  # variants share it
def words_of_columns(record: np.dtype[np.void], n: int, k: int) -> dict[str, NDArray[np.int64]]:
    """Return the words of a record that hold each column except qpos."""
    empty, words = np.zeros(1, record), {}
    for name, size in widths(n, k, 0).items():
        if name != "qpos":
            field = empty[_ELSEWHERE.get(name, "tick")][name]
            words[name] = (field.ctypes.data - empty.ctypes.data) // 8 + np.arange(size)
    return words


class World:
    """A world during its run, for one thread.

    Attributes:
        prepared: The scenario.
        record: Its record, one element of a structured array.
        methods: All methods that it calls, by their fields in the record.
        rows: Its columns, (most ticks, width).
        positions: All of qpos, (most ticks, nq); None where qpos is q in its order.
        contacts: Contacts of the arm; None where it can touch nothing.
    """

    def __init__(self, prepared: Prepared) -> None:
        """Begin at the start of the scenario."""
        plant, arm, hardware = prepared.plant, prepared.arm, prepared.hardware
        self.prepared = prepared
        base = plant.model()
        wiring = arm.wire(base)
        self._spares = [_take(base, plant.difference(base, wiring))]
        self._data = self._spares[0][2]
        self._records = new_worlds(1, arm.n, _room(prepared))
        world = self.record = self._records[0]
        prepared.law.write(world)
        hardware.write(world)
        self.methods = methods(prepared)
        link(self._records, self.methods)
        self._begin(self._data)
        if not plant.knows_all:
            self._spares.append(_take(base, plant.known(base, wiring)))
            self._begin(self._spares[1][2])
        self._wire(world["engine"], plant, wiring, self._spares[-1][2])
        mujoco.mj_step1(self._data.model, self._data)  # for tables that need the kinematics of the start
        # Compiled code has addresses of these.
        self._referenced: list[Any] = [*plant.wire(world, base, wiring, self._data)]
        self._words = words_of_columns(self._records.dtype, arm.n, int(world["k"]))
        self._sources = np.concatenate([*self._words.values()])
        self.rows = np.empty((prepared.most_ticks, len(self._sources)), np.int64)
        self.positions = np.empty((prepared.most_ticks, base.nq)) if has_others(wiring, base.nq) else None
        self._draw = hardware.chance()
        self._path_end = 0  # the first tick of the path that is not sampled yet
        self._follow(world["engine"])
        self.contacts: Contacts | None = None
        if plant.has_physics and can_touch(base, wiring):
            contacts = self.contacts = Contacts(self._data.model, wiring, self._data)

            def add_contacts(tick: int) -> None:
                with missing_nothing():
                    world["tick"]["status"] |= contacts.status(tick)

            watch = _Watch(add_contacts)
            world["engine"]["watch"] = ctypes.cast(watch, ctypes.c_void_p).value
            self._referenced.append(watch)
        self._error = ""

    def _begin(self, data: mujoco.MjData) -> None:
        """Have data begin where the scenario does."""
        prepared = self.prepared
        data.qpos[:] = prepared.qpos
        for target, values in zip((data.ctrl, data.act), prepared.held, strict=True):
            target[: len(values)] = values
        mocap = prepared.arm.mocap
        data.mocap_pos[:], data.mocap_quat[:] = mocap[:, :3], mocap[:, 3:]

    def _wire(self, group: np.void, plant: Plant, wiring: Wiring, known: mujoco.MjData) -> None:
        """Write addresses and indices of MuJoCo into the group `engine` of the record."""
        data, arm = self._data, self.prepared.arm
        model = data.model
        is_rk4 = model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4  # whose step has no two halves
        for name, struct in (
            ("model", model), ("data", data), ("known_model", known.model), ("known_data", known)
        ):  # fmt: skip
            group[name] = engine.address_of(struct)
        for name, function in (
            ("begin", plant.begins), ("advance", "mj_step" if is_rk4 else "mj_step2"), ("step", "mj_step")
        ):  # fmt: skip
            group[name] = engine.address(function)
        group["substeps"] = plant.substeps
        for name in ENGINE_FIELDS.split():
            number, field = -1 if name.startswith("known_") else 0, name.removeprefix("known_")
            _, _, source, addresses = self._spares[number]
            if field not in addresses:
                addresses[field] = getattr(source, field).ctypes.data
            group[name] = addresses[field]
        group["warning_count"] = data.warning.number.ctypes.data
        group["warning_info"] = data.warning.lastinfo.ctypes.data
        look_at(self.record, data, arm, self.prepared.law.second)
        n, followers = arm.n, len(arm.followers)
        has_drives = bool((wiring.actuator >= 0).all())  # the ideal plant needs none
        group["ctrl_at"][:n] = model.actuator_ctrladr[wiring.actuator] if has_drives else -1
        group["force_at"][:n] = model.actuator_outadr[wiring.actuator] if has_drives else -1
        group["followers"], group["mass_size"], group["body"] = followers, data.M.size, wiring.body
        if model.body_weldid[wiring.base] == 0:
            group["base"] = -1
        group["follows"][:followers] = [follower.leader for follower in arm.followers]
        group["follower_ratio"][:followers] = [follower.ratio for follower in arm.followers]
        group["follower_offset"][:followers] = [follower.offset for follower in arm.followers]
        group["follower_qpos"][:followers] = wiring.follower_qpos
        group["follower_dof"][:followers] = wiring.follower_dof

    def _follow(self, group: np.void) -> None:
        """Write the path, and where the rows of the run are, into the group `engine` of the record."""
        reference = self.prepared.reference
        past = np.zeros((self.prepared.hardware.span + 2, 2 * self.prepared.arm.n + 1))
        group["ticks"], group["path_ticks"] = self.prepared.most_ticks, reference.ticks
        group["record"], group["record_size"] = self._records.ctypes.data, self._records.itemsize // 8
        group["columns"], group["rows"] = self.rows.ctypes.data, len(self.rows)
        group["sources"], group["width"] = self._sources.ctypes.data, len(self._sources)
        group["positions"] = 0 if self.positions is None else self.positions.ctypes.data
        group["past"], group["past_rows"] = past.ctypes.data, len(past)
        self._referenced.append(past)

    # Its run ---------------------------------------------------------------------------------------

    @property
    def done(self) -> int:
        """Number of finished ticks."""
        return int(self.record["engine"]["next"])

    @property
    def is_running(self) -> bool:
        """Whether there is a next tick."""
        group = self.record["engine"]
        return bool(group["diverged"] < 0 and group["next"] < group["ticks"])

    def advance(self, count: int) -> None:
        """Do some ticks: at most so many."""
        group = self.record["engine"]
        group["last"] = min(self.done + min(count, BLOCK - 1), int(group["ticks"]))
        count, tick = int(group["last"]) - self.done, int(self.record["memory"]["path_tick"])
        if tick + count >= self._path_end < group["path_ticks"]:
            self._path = self.prepared.reference.block(tick)
            self._path_end = tick + len(self._path)
            group["reference"] = self._path.ctypes.data - tick * self._path.strides[0]  # of tick 0
        if self._draw:
            self._chance = self._draw(count)
            group["chance"] = self._chance.ctypes.data - self.done * self._chance.strides[0]
        with uninterrupted():
            self._error = engine.run_guarded(int(self.record["methods"]["ticks"]), self._records.ctypes.data)
            if self._error:
                group["diverged"], group["diverged_joint"] = group["next"], -1
            link(self._records, {field: self.methods[field] for field in LATE if field in self.methods})

    def release(self) -> None:
        """Let the next world of this thread use its models; it must not go on."""
        _spares.free = (*self._spares, *_spares.free)[:_MOST_SPARES]

    def end(self) -> None:
        """Have no next tick."""
        self.record["engine"]["ticks"] = self.done

    def columns(self, first: int, last: int) -> dict[str, NDArray[np.generic]]:
        """Return views of the columns of some ticks."""
        end = 0
        columns: dict[str, NDArray[np.generic]] = dict.fromkeys(COLUMNS, np.empty(0))  # in their order
        for name, words in self._words.items():
            table = self.rows[first:last, end : end + len(words)]
            table = table if name == "status" else table.view(np.float64)
            columns[name] = table if COLUMNS[name].width else table[:, 0]
            end += len(words)
        columns["qpos"] = columns["q"] if self.positions is None else self.positions[first:last]
        return columns

    @property
    def divergence(self) -> Divergence | None:
        """Where it stopped being finite."""
        group, period = self.record["engine"], self.prepared.scenario.control.period
        tick, joint = int(group["diverged"]), int(group["diverged_joint"])
        if tick < 0:
            return None
        reason = self._error or "position, rate or command is not finite or beyond 1e10"
        name = self.prepared.arm.joints[joint] if joint >= 0 else ""
        return Divergence(tick, tick * period, name, reason)
