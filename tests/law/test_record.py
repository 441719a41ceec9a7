"""Who owns what of a world's record: each Writer changes its own fields, and no field has two owners or none."""

import numpy as np
import pytest

from rmrc.law.descent import Bounds
from rmrc.law.record import ADDRESSES, MEASUREMENT, MEMORY, SCRATCH, Field, records
from rmrc.plants.hardware import Hardware
from rmrc.plants.servo import Servo
from rmrc.plants.torque import Torque
from rmrc.plants.wiring import WIRING
from rmrc.simulation.prepare import prepare, world_records, writers
from rmrc.simulation.simulation import Simulation

# A second task, and the plant that has all that others have, so that every field is written.
OVERRIDES = (
    "arm.model=models/planar_3link.xml",
    "arm.start=home",
    "plant.kind=torque",
    "control.nullspace={objective: secondary, secondary: {site: wrist, axes: [x]}}",
    "control.limits.jerk=1000",
    "control.inverse.metric=inertia",
    "plant.resonance.frequency=20",
    "target.path=[{line: {by: [0.01, 0]}}]",
)
COMPUTED = {field.name for field in (*MEASUREMENT, *MEMORY, *SCRATCH, *ADDRESSES, *Hardware.memory)}


@pytest.fixture
def prepared(scenario):
    return prepare(scenario(*OVERRIDES))


def names(fields):
    return {field.name for field in fields}


def differing(one, other):
    return {name for name in one.dtype.names if one[name].tobytes() != other[name].tobytes()}


def changed_by(writer, record):
    """Return the names of the fields that a Writer changes in a record full of a pattern."""
    full = record.copy()
    full.view(np.uint8)[:] = np.random.default_rng(0).integers(1, 256, full.nbytes)
    before = full.copy()
    writer.write(full[0])
    return differing(full, before)


def test_each_writer_changes_its_fields_and_no_others(prepared):
    record, owners = world_records([prepared], [0]), writers(prepared, 0)
    of_servos = names(Servo.fields) - names(Torque.fields)  # the world's plant is another
    for writer in owners:
        assert changed_by(writer, record) == names(writer.fields) - of_servos, type(writer)
    bounds = Bounds(np.array([[-1.0, 1.0], [-2.0, 2.0], [-3.0, 3.0]]))
    assert changed_by(bounds, records(3, [prepared.task, bounds])) == names(bounds.fields)


def test_a_writer_that_writes_what_is_not_its_own_is_seen(prepared):
    class Meddler:
        fields = (Field("own"),)

        def write(self, world):
            world["own"] = world["period"] = 1.0

    record = records(3, [*writers(prepared, 0), Meddler()])
    assert changed_by(Meddler(), record) == {"own", "period"}


def test_every_field_but_what_is_computed_has_one_owner(prepared):
    owned = [field.name for writer in writers(prepared, 0) for field in writer.fields]
    record = world_records([prepared], [0])
    assert sorted([*owned, *names(WIRING), *COMPUTED]) == sorted(record.dtype.names)
    # negative control: two owners are refused
    with pytest.raises(ValueError, match="more than once"):
        records(3, [prepared.task, prepared.law, prepared.task])


def test_what_a_batch_writes_is_its_wiring_and_what_a_run_writes_is_computed(prepared):
    before = world_records([prepared], [0])
    simulation = Simulation([prepared])
    worlds = simulation._shards[0].batch.worlds
    assert {"qpos_column", "lever"} <= differing(worlds, before) <= names((*WIRING, *ADDRESSES))
    wired = worlds.copy()
    simulation.run()
    # of what has an owner, only how far the world comes
    assert {"u", "q", "A"} <= differing(worlds, wired) <= {*COMPUTED, "ticks", "diverged", "diverged_joint"}


def test_a_record_starts_as_its_fields_say():
    class Counter:
        fields = (Field("count", np.int64, start=-1),)

        def write(self, world):
            assert world["count"] == -1

    record = records(9, [Counter()], [Counter()])
    assert record["count"].tolist() == [-1, -1] and record["pace"].tolist() == [1.0, 1.0]
    assert record["u"].shape == (2, 6, 16) and not record["u"].any()
