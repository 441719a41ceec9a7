"""Machine code is kept on disk, and found again by types: what numba tells apart is never the same kind."""

import re
from itertools import combinations
from pathlib import Path

import numba
import numpy as np
import pytest

import rmrc
from project import ROOT
from records import Unscaled, blank
from rmrc.analysis import survey
from rmrc.analysis.workspace import folds
from rmrc.arm import load
from rmrc.law import controller, descent, jit, law, step, svd
from rmrc.law.jit import _kind
from rmrc.law.record import ADDRESSES, records, tick_type
from rmrc.plants import blocks, lockstep, model, torque
from rmrc.results import tally
from rmrc.results.scorecard import scorecard
from rmrc.scenario import Scenario
from rmrc.simulation import reference
from rmrc.simulation.prepare import prepare, world_records
from rmrc.simulation.simulation import Simulation

MOVES = (reference.sample, lockstep.tick, blocks.block, torque.computed_torque, tally.add)
EXAMINES = (
    law.resolve,
    survey.examine,
    survey.locate,
    folds.scan,
    descent.reach,
    svd.svd_alone,
)
DRIVES = (model.settle, model.tell_drives, model.tell_motors)
STEPS = (step.step,)


def kept(function):
    """Return the files of an entry's machine code."""
    module = function.__module__.rpartition(".")[2]
    return list(Path(function.stats.cache_path).glob(f"{module}.{function.__name__}-*.nbc"))


@pytest.mark.compiles
def test_what_moves_a_world_is_kept_on_disk(simulate):
    _, run = simulate("plant.kind=torque", "target.path=[{line: {by: [0.01, 0]}}]")
    assert scorecard(run)["position_error.end"].value > 0
    simulate("plant.kind=ideal", "target.path=[{line: {by: [0.01, 0]}}]")  # which runs in blocks
    assert [entry for entry in MOVES if not kept(entry)] == []


@pytest.mark.compiles
def test_what_examines_an_arm_is_kept_on_disk():
    arm = load(ROOT / "models/planar_2link.xml")
    assert rmrc.resolve_rates(np.eye(2), np.ones(2), "inverse").tolist() == [1.0, 1.0]
    assert rmrc.workspace(arm, cells=10, samples=100).free.reached.any()
    assert rmrc.ik(arm, [1.0, 1.0]).found
    assert svd.cold_svd(np.diag([2.0, 1.0]))[1].tolist() == [2.0, 1.0]
    assert [entry for entry in EXAMINES if not kept(entry)] == []


OF_LAW = [one for one in jit._APARTS if one.field in {field.name for field in ADDRESSES}]
# By modules, in two parts that take equally long; `Controller.warm_up` has compiled the rest.
ROOMS = [
    {"limits", "optimal", "jerk"},
    {"policies", "priority", "nullspace", "inertia", "damping", "inverses", "registers", "law"},
]
WARMED_UP = {"rest", "stops"}


def room(one):
    return one.function.__module__.rpartition(".")[2]


def test_runs_and_controllers_share_what_few_laws_need(scenario):
    assert {room(one) for one in OF_LAW} == WARMED_UP.union(*ROOMS)
    alone, own = records(2, [Unscaled(2, 2)]), world_records([prepare(scenario("plant.kind=ideal"))], [0])
    controlled = controller.Controller(load(ROOT / "models/planar_2link.xml"))._worlds
    of_law = {jit._law_type(numba.typeof(worlds).dtype) for worlds in (alone, own, controlled)}
    assert len(of_law) == 1
    (known,) = of_law
    assert {one.field for one in OF_LAW} < known.fields.keys() < {*own.dtype.names}
    for worlds in (alone, own, controlled):
        assert all(worlds.dtype.fields[name][1] == known.offset(name) for name in known.fields)
    assert numba.typeof(own) != numba.typeof(controlled)  # negative control


@pytest.mark.compiles
@pytest.mark.parametrize("rooms", ROOMS, ids=["limits", "others"])
def test_what_few_laws_need_is_kept_on_disk(rooms):
    worlds, ticks = records(2, [Unscaled(2, 2)]), np.zeros(1, tick_type(2))
    types_of = {"worlds": numba.typeof(worlds), "ticks": numba.typeof(ticks)}
    found = [one for one in OF_LAW if room(one) in rooms]
    assert all(jit._found(one, (_kind(worlds), _kind(ticks)), types_of) for one in found)
    assert [one.function for one in found if not kept(jit._entry_apart(one.function))] == []


@pytest.mark.compiles
def test_what_a_controller_takes_is_kept_on_disk():
    controller.Controller(load(ROOT / "models/planar_2link.xml")).warm_up()
    assert [entry for entry in STEPS if not kept(entry)] == []


@pytest.mark.compiles
def test_what_tells_the_authors_drives_is_kept_on_disk():
    for name in ("position", "motor"):
        path = ROOT / f"tests/models/drives/{name}.xml"
        scenario = Scenario.model_validate({
            "name": name, "arm": {"model": path, "site": "hand"}, "task": {"axes": ("x", "z")},
            "control": {"period": 0.004}, "target": {"path": ({"hold": {"for": 0.02}},)},
            "plant": {"kind": "model"},
        })  # fmt: skip
        Simulation([prepare(scenario)]).run()
    assert [entry for entry in DRIVES if not kept(entry)] == []


def test_what_compiles_comes_first(request):
    compiles = [item.get_closest_marker("compiles") is not None for item in request.session.items]
    assert compiles == sorted(compiles, reverse=True)
    assert not request.config.option.loadscopereorder  # which puts the group of the tests of clusters first


def test_every_entry_is_one_of_these():
    sources = [path.read_text("utf-8") for path in (ROOT / "src/rmrc").rglob("*.py")]
    entries = [
        name for text in sources for name in re.findall(r"^@(?:long_)?entry\ndef (\w+)", text, re.MULTILINE)
    ]
    assert sorted(entries) == sorted(entry.__name__ for entry in (*MOVES, *EXAMINES, *DRIVES, *STEPS))


def test_arguments_that_are_of_one_kind_are_of_one_type():
    table = np.zeros((4, 4))
    shown = table.view()
    shown.flags.writeable = False
    misaligned = np.ndarray((2,), np.float64, np.zeros(17, np.uint8)[1:].data)
    worlds = records(2, [Unscaled(2, 2)], [Unscaled(2, 2)])
    arguments = [
        0, 2**63, 0.0, False, (1, 2), (1, 2.0), table, table.T, table[::2], table[:, ::2], shown, table[0],
        misaligned, table.astype(np.float32), worlds, worlds[0], blank(3, 9)[0][0],
        np.zeros(2, tick_type(2)), np.zeros((2, 2), tick_type(2)),
    ]  # fmt: skip
    for one, other in combinations(arguments, 2):
        assert (_kind(one) == _kind(other)) <= (numba.typeof(one) == numba.typeof(other)), (one, other)
    # negative control: what has another value or another memory alone is of one kind
    assert (
        _kind(table.copy()) == _kind(table) and _kind(worlds[1]) == _kind(worlds[0]) and _kind(7) == _kind(0)
    )
