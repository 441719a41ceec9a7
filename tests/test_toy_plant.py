"""A plant and a stage that are added as CONTRIBUTING says, to a copy of the package: the verbs know them."""

import json

import numpy as np
import pyarrow.parquet as pq
import pytest
from numpy.testing import assert_allclose

from project import mostly_long
from toy import Copy
from wording import says

DECLARATION = """
LAGGING = Plant(
    "lagging", "rates that follow with a lag", "",
    (Parameter("lag", "lagging: time constant of the rates", 0.05, "s"),), physics=False,
)

"""
PLANT = '''"""The lagging plant: exact integration of rates that follow what was sent with a time constant."""

import numpy as np

from rmrc.law.jit import Array, Record, compiled
from rmrc.law.record import JOINTS, Field
from rmrc.plants.ideal import Ideal


@compiled
def read_rates(world: Record, out: Record, state: Array, force: Array) -> None:
    """Read q; the rates are those that it has come to."""
    for j in range(world.n):
        out.q[j] = state[world.qpos_column[j]]
        out.qdot[j] = world.lagging_rate[j]
        out.tau[j] = 0.0


@compiled
def follow(world: Record, out: Record, state: Array) -> None:
    """Come nearer to the rates that were sent, and integrate."""
    share = world.period / (world.lag + world.period)
    for j in range(world.n):
        world.lagging_rate[j] += share * (world.qdot_sent[j] - world.lagging_rate[j])
        state[world.qpos_column[j]] += world.period * world.lagging_rate[j]


class Lagging(Ideal):
    """Integrates rates that lag."""

    name = "lagging"
    sense, obey = staticmethod(read_rates), staticmethod(follow)
    fields = (Field("lag"),)
    memory = (Field("lagging_rate", size=(JOINTS,)),)

    def write(self, world: np.void) -> None:
        """Write the time constant."""
        world["lag"] = self.section.lag
'''

KEY = """    delay: NotNegative = key("time from a command to the plant, in whole control periods", 0.0, "s")
"""
STAGE = '''"""Commands that arrive late."""

from collections.abc import Iterator

import numpy as np

from rmrc.law.jit import Record, compiled
from rmrc.law.record import JOINTS, Field
from rmrc.plants.stage import Stage


@compiled
def send_late(world: Record, out: Record) -> None:
    """Send what was commanded so many ticks ago, at first nothing."""
    for j in range(world.n):
        for late in range(world.delay):
            world.on_the_way[late, j], world.qdot_sent[j] = world.qdot_sent[j], world.on_the_way[late, j]


class Delay(Stage):
    """A delay of whole control periods between law and plant."""

    slot, uses, change = "sent", "delay", staticmethod(send_late)
    fields = (Field("delay", np.int64),)
    memory = (Field("on_the_way", size=(16, JOINTS)),)

    def write(self, world: np.void) -> None:
        """Write the delay in ticks."""
        world["delay"] = round(self.scenario.plant.delay / self.scenario.control.period)

    def misfits(self) -> Iterator[tuple[str, str]]:
        """Yield delays of more ticks than a record holds."""
        if self.scenario.plant.delay > 16 * self.scenario.control.period:
            yield "plant.delay", f"must be at most 16 control periods, got {self.scenario.plant.delay:g} s"
'''

SCENARIO = """
name: toy
arm: {model: models/planar_2link.xml, site: tip, start: [60 deg, -120 deg]}
task: {axes: [x, y]}
control: {period: 0.002}
target: {path: [{line: {by: [0.05, 0.05]}}]}
plant: {kind: lagging}
"""
REFUSED = """
from rmrc.scenario import load
from rmrc.simulation.prepare import prepare
for text in ("plant.lag=-1", "plant.delay=1.0"):
    try:
        prepare(load("toy.yaml", [text]))
    except ValueError as error:
        print(error)
"""


def edit(copy, module, *changes):
    """Replace the only place of each text of a module."""
    path = copy.folder / "rmrc" / module
    text = path.read_text("utf-8")
    for old, new in changes:
        assert text.count(old) == 1
        text = text.replace(old, new)
    path.write_text(text, "utf-8")


def with_toys(folder):
    """Return a copy of the package that has the toy plant and the toy stage, and a scenario."""
    copy = Copy(folder)
    copy.add("scenario/choices.py", DECLARATION, before="PLANTS = ")
    edit(copy, "scenario/choices.py", ("TORQUE, MODEL)", "TORQUE, MODEL, LAGGING)"))
    (folder / "rmrc/plants/lagging.py").write_text(PLANT, "utf-8")
    copy.add("plants/kinds.py", "from rmrc.plants.lagging import Lagging\n", before="from rmrc.plants.plant")
    edit(copy, "plants/kinds.py", ("Torque, Model)", "Torque, Model, Lagging)"))

    copy.add("scenario/sections.py", KEY, before="wrench: Wrench = key(")
    (folder / "rmrc/plants/late.py").write_text(STAGE, "utf-8")
    copy.add("plants/stages.py", "from rmrc.plants.late import Delay\n", before="from rmrc.plants.stage ")
    edit(copy, "plants/stages.py", ("(Encoders, Integral)", "(Encoders, Integral, Delay)"))
    (folder / "toy.yaml").write_text(SCENARIO, "utf-8")
    return copy


@pytest.fixture(scope="module")
def toy(tmp_path_factory):
    """Return such a copy."""
    return with_toys(tmp_path_factory.mktemp("toy"))


def test_it_is_in_the_schema_and_in_messages(toy):
    schema = toy.rmrc("schema")
    assert "time constant of the rates" in schema and "plant.lag " in schema
    kinds = json.loads(toy.rmrc("schema", "--json"))["$defs"]["PlantSection"]["properties"]["kind"]
    assert kinds["enum"] == ["ideal", "servo", "torque", "model", "lagging"]
    assert kinds["description"].endswith("the model's own actuators, or rates that follow with a lag")
    ended = toy.python(REFUSED)
    assert ended.stdout.splitlines() == [
        says("--set plant.lag: … 0 … -1"),
        "--set plant.delay: must be at most 16 control periods, got 1 s",
    ], ended.stderr


@pytest.mark.parametrize(
    ("module", "old", "new"),
    mostly_long(
        [
            ("plants/kinds.py", "Model, Lagging)", "Model)"),
            ("scenario/choices.py", "MODEL, LAGGING)", "MODEL)"),
            ("plants/lagging.py", 'name = "lagging"', 'name = "laging"'),
        ],
        3,
    ),
    ids=["class", "declaration", "name"],
)
def test_what_is_forgotten_is_said_at_import(tmp_path, module, old, new):
    copy = with_toys(tmp_path)
    edit(copy, module, (old, new))
    ended = copy.python("import rmrc.plants.kinds")
    assert ended.returncode == 1
    assert "ImportError: plants are declared as ('ideal', 'servo', 'torque', 'model'" in ended.stderr


@pytest.mark.long
def test_verbs_run_it(toy):
    def run(name, *overrides):
        texts = [text for one in (f"name={name}", *overrides) for text in ("--set", one)]
        toy.rmrc("run", "toy.yaml", "--out", "out", "--no-record", "-q", *texts)
        with np.load(toy.folder / f"out/{name}.npz") as columns:
            return dict(columns)

    assert_lags(run("lagging"), lag=0.05)
    assert_lags(run("slower", "plant.lag=0.1"), lag=0.1)
    with pytest.raises(AssertionError):
        assert_lags(run("ideal", "plant.kind=ideal"), lag=0.05)
    assert_lags(run("late", "plant.delay=0.008"), lag=0.05, delay=4)

    ideal_late = run("ideal_late", "plant.kind=ideal", "plant.delay=0.008")
    sent, moved = ideal_late["qdot_cmd"], np.diff(ideal_late["q"], axis=0)
    assert_allclose(moved[4:], 0.002 * sent[:-5], rtol=0, atol=1e-15)  # rounding of q
    assert not moved[:4].any()

    kinds = "plant.kind=ideal,lagging,servo"
    toy.rmrc("compare", "toy.yaml", "--vary", kinds, "--out", "out", "--no-record", "-q")
    compared = json.loads((toy.folder / "out/toy.compare.json").read_text())
    error = {one["label"]: one["scorecard"]["position_error"]["max"] for one in compared["variants"]}
    toy.rmrc("sweep", "toy.yaml", "--vary", "plant.lag=0.01,0.05,0.1", "--out", "out", "-q")
    rows = pq.read_table(toy.folder / "out/toy.sweep.parquet").to_pydict()
    assert rows["plant.lag"] == [0.01, 0.05, 0.1]
    peaks = rows["position_error.max"]
    assert error["ideal"] < peaks[0] < peaks[1] < peaks[2]  # the slower, the worse
    assert peaks[1] == error["lagging"]


def assert_lags(columns, lag, delay=0, period=0.002):
    """Hold rates and positions against a recurrence of the commands."""
    sent = np.zeros_like(columns["qdot_cmd"])
    sent[delay:] = columns["qdot_cmd"][: len(sent) - delay]
    rate, q = np.zeros(sent.shape[1]), columns["q"][0].copy()
    for t in range(len(sent)):
        # a rounding in a thousand ticks each, and what they add up to
        assert_allclose(columns["qdot"][t], rate, rtol=0, atol=1e-12)
        assert_allclose(columns["q"][t], q, rtol=0, atol=1e-12)
        rate += period / (lag + period) * (sent[t] - rate)
        q += period * rate
