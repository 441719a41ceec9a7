"""One world: its record, its model and data in MuJoCo, and the rows of its run."""

import copy
import ctypes
import threading
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm import Wiring
from rmrc.arm.differences import field_of, set_fields
from rmrc.law.compiling import Method, callback, raise_missed
from rmrc.law.record import ENGINE_FIELDS, capacity, new_worlds
from rmrc.law.settings import LATE, link
from rmrc.plants import engine
from rmrc.plants.contacts import Contacts, can_touch
from rmrc.plants.plant import Difference, Plant
from rmrc.results.columns import COLUMNS, Divergence
from rmrc.simulation.footprint import has_others
from rmrc.simulation.layout import layout
from rmrc.simulation.prepare import Prepared
from rmrc.simulation.ticks import believe, follow_path, measure_second, ticks

Array = NDArray[np.float64]

_Watch = ctypes.CFUNCTYPE(None, ctypes.c_int64)


class _Models(threading.local):
    """The last models of this thread that no world uses, with data, for the next world of the same arm."""

    MOST = 4

    def __init__(self) -> None:
        self._free: list[_OwnModel] = []

    def take(self, base: mujoco.MjModel, fields: Difference, place: int) -> "_OwnModel":
        """Return a model with some different fields, and data as if new.

        Args:
            base: The model that worlds share.
            fields: Its different fields.
            place: 0 for the model that is stepped, 1 for the one that a plant knows.
        """
        same = (own for own in self._free if own.base is base and own.place == place)
        own = next(same, None)
        if own is None:
            own = _OwnModel(base, place)
        else:
            self._free.remove(own)
        own.differ(fields)
        return own

    def release(self, models: Sequence["_OwnModel"]) -> None:
        """Keep models that their world no longer uses."""
        self._free = [*models, *self._free][: self.MOST]


class _OwnModel:
    """A model of one thread.

    Attributes:
        base: The model whose copy it is.
        place: What it is for.
        model: The copy.
        data: Its data.
    """

    def __init__(self, base: mujoco.MjModel, place: int) -> None:
        self.base, self.place, self.model = base, place, copy.copy(base)
        self.data = mujoco.MjData(self.model)
        self._different = set[str]()

    def differ(self, fields: Difference) -> None:
        """Give fields other values than those of the base, and reset the data."""
        before = {name: field_of(self.base, name) for name in self._different}
        set_fields(self.model, self.data, before | dict(fields))
        self._different = set(fields)
        mujoco.mj_resetData(self.model, self.data)


def _adds_contacts(record: np.void, contacts: Contacts) -> Callable[[int], None]:
    """Return a function that adds a contact to the status of a tick."""

    def watch(tick: int) -> None:
        record["tick"]["status"] |= contacts.status(tick)

    return watch


_models = _Models()


def compile_for(prepared: Prepared) -> None:
    """Compile or load all that a world of this scenario calls, which takes seconds once.

    Args:
        prepared: The scenario.
    """
    joints = capacity(max(prepared.arm.n, len(prepared.arm.axis_names)))
    for field, method in _methods(prepared).items():
        if field not in LATE:
            method.address(joints)


def _methods(prepared: Prepared) -> Mapping[str, Method]:
    """Return all methods that a world calls, by their fields in its record."""
    methods = {"ticks": ticks, "path": follow_path, **prepared.law.methods, **prepared.hardware.methods}
    if prepared.law.second is not None:
        methods["second"] = measure_second
    if prepared.hardware.is_misled:
        methods["believe"] = believe
    return methods


class World:
    """A world during its run, for one thread.

    Attributes:
        prepared: The scenario.
        rows: The last rows of its columns, (rows, width): tick t is in row t modulo rows.
        positions: All of qpos for these ticks, (rows, nq); None where qpos is q in its order.
        contacts: Contacts of the arm; None where it can touch nothing.
    """

    def __init__(self, prepared: Prepared, rows: int) -> None:
        """Begin at the start of the scenario.

        Args:
            prepared: The scenario.
            rows: How many ticks to hold.
        """
        plant, arm, hardware = prepared.plant, prepared.arm, prepared.hardware
        self.prepared = prepared
        base = plant.model()
        wiring = arm.wire(base)
        own = _models.take(base, plant.difference(base, wiring), 0)
        self._model, self._data = own.model, own.data
        self._records = new_worlds(1, arm.n, len(arm.axis_names))
        world = self._record = self._records[0]
        prepared.law.write(world)
        hardware.write(world)
        self._methods = _methods(prepared)
        link(self._records, self._methods)
        self._begin(self._data)
        known = own
        if not plant.knows_all:
            known = _models.take(base, plant.known(base, wiring), 1)
            self._begin(known.data)
        self._wire(world["engine"], plant, wiring, known)
        mujoco.mj_step1(self._model, self._data)  # for tables that need the kinematics of the start
        self._own_models = [own] if known is own else [own, known]
        # Compiled code has addresses of these.
        self._referenced: list[Any] = [*plant.wire(world, base, wiring, self._data)]
        joints = world["limits"]["rate"].shape[0]
        self._layout = layout(joints, arm.n, int(world["k"]))
        self.rows = np.empty((rows, len(self._layout.sources)), np.int64)
        self.positions = np.empty((rows, base.nq)) if has_others(wiring, base.nq) else None
        self._follow(world["engine"])
        self.contacts: Contacts | None = None
        if plant.has_physics and can_touch(base, wiring):
            self.contacts = Contacts(self._model, wiring, self._data)
            watch = _Watch(callback(_adds_contacts(world, self.contacts)))
            world["engine"]["watch"] = ctypes.cast(watch, ctypes.c_void_p).value
            self._referenced.append(watch)
        self._error = ""

    def _begin(self, data: mujoco.MjData) -> None:
        """Have data begin where the scenario does."""
        prepared = self.prepared
        data.qpos[:] = prepared.qpos
        for target, values in zip((data.ctrl, data.act), prepared.held, strict=True):
            target[: len(values)] = values
        mocap = prepared.arm.mocap_now
        if len(mocap):
            data.mocap_pos[:], data.mocap_quat[:] = mocap[:, :3], mocap[:, 3:]

    def _wire(self, group: np.void, plant: Plant, wiring: Wiring, known: _OwnModel) -> None:
        """Write addresses and indices of MuJoCo into the group `engine` of the record."""
        model, data, arm = self._model, self._data, self.prepared.arm
        is_rk4 = model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4  # whose step has no two halves
        group["model"], group["data"] = engine.model_address(model), engine.data_address(data)
        group["known_model"], group["known_data"] = (
            engine.model_address(known.model), engine.data_address(known.data)
        )  # fmt: skip
        for name, function in (
            ("begin", plant.begins), ("advance", "mj_step" if is_rk4 else "mj_step2"), ("step", "mj_step")
        ):  # fmt: skip
            group[name] = engine.address(function)
        group["substeps"] = plant.substeps
        beside = {
            "warning_count": data.warning.number, "warning_info": data.warning.lastinfo,
            "known_bias": known.data.qfrc_bias, "known_passive": known.data.qfrc_passive,
            "known_gravcomp": known.data.qfrc_gravcomp, "known_M": known.data.M,
            "known_qpos": known.data.qpos, "known_qvel": known.data.qvel,
        }  # fmt: skip
        for name in ENGINE_FIELDS:
            array = beside.get(name)
            group[name] = (getattr(data, name) if array is None else array).ctypes.data
        for name in ("nq", "nv", "nu", "nbody", "njnt", "nsite"):
            group[name] = getattr(model, name)
        n, axes, followers = arm.n, len(wiring.axis), len(arm.followers)
        has_drives = bool((wiring.actuator >= 0).all())  # the ideal plant needs none
        group["joint"][:axes], group["qpos_at"][:n], group["dof"][:n] = wiring.axis, wiring.qpos, wiring.dof
        group["ctrl_at"][:n] = model.actuator_ctrladr[wiring.actuator] if has_drives else -1
        group["force_at"][:n] = model.actuator_outadr[wiring.actuator] if has_drives else -1
        group["site_id"], group["body"][0] = wiring.site, wiring.body
        group["base"] = -1 if arm.is_fixed[arm.base] else wiring.base
        group["followers"], group["mass_size"] = followers, data.M.size
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
        group["pieces"], group["piece_count"] = reference.pieces.ctypes.data, len(reference.pieces)
        group["motions"], group["motion_rows"] = reference.rows.ctypes.data, len(reference.rows)
        group["record"], group["record_size"] = self._records.ctypes.data, self._records.itemsize // 8
        group["columns"], group["rows"] = self.rows.ctypes.data, len(self.rows)
        group["sources"], group["width"] = self._layout.sources.ctypes.data, self.rows.shape[1]
        group["positions"] = 0 if self.positions is None else self.positions.ctypes.data
        group["past"], group["past_rows"] = past.ctypes.data, len(past)
        self._referenced += [reference, past]

    # Its run ---------------------------------------------------------------------------------------

    @property
    def done(self) -> int:
        """Number of finished ticks."""
        return int(self._record["engine"]["next"])

    @property
    def is_running(self) -> bool:
        """Whether there is a next tick."""
        group = self._record["engine"]
        return bool(group["diverged"] < 0 and group["next"] < group["ticks"])

    def advance(self, count: int) -> None:
        """Do at most so many ticks, and none that would write a row of the first of them again."""
        group = self._record["engine"]
        room = len(self.rows) - self.done % len(self.rows)
        group["last"] = min(self.done + min(count, room), int(group["ticks"]))
        self._error = engine.run_guarded(int(self._record["methods"]["ticks"]), self._records.ctypes.data)
        if self._error:
            group["diverged"], group["diverged_joint"] = group["next"], -1
        link(self._records, {field: self._methods[field] for field in LATE if field in self._methods})
        raise_missed()

    def release(self) -> None:
        """Let the next world of this thread use its models; it must not go on."""
        _models.release(self._own_models)

    def end(self) -> None:
        """Have no next tick."""
        self._record["engine"]["ticks"] = self.done

    def columns(self, first: int, last: int) -> dict[str, NDArray[np.generic]]:
        """Return views of the columns of some ticks that are held, in consecutive rows."""
        begin = first % len(self.rows)
        rows = slice(begin, begin + last - first)
        columns = self._layout.columns(self.rows[rows])
        columns["qpos"] = columns["q"] if self.positions is None else self.positions[rows]
        return {name: columns[name] for name in COLUMNS}

    @property
    def divergence(self) -> Divergence | None:
        """Where it stopped being finite."""
        group, period = self._record["engine"], self.prepared.scenario.control.period
        tick, joint = int(group["diverged"]), int(group["diverged_joint"])
        if tick < 0:
            return None
        reason = self._error or "position, rate or command is not finite or beyond 1e10"
        name = self.prepared.arm.joints[joint] if joint >= 0 else ""
        return Divergence(tick, tick * period, name, reason)

    @property
    def warnings(self) -> dict[str, int]:
        """Number of MuJoCo's warnings, by their names."""
        counts = enumerate(self._data.warning.number)
        return {
            mujoco.mjtWarning(kind).name.removeprefix("mjWARN_"): int(count)
            for kind, count in counts
            if count
        }
