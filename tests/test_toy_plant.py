"""A plant and a stage that are added as CONTRIBUTING says, to a copy of the package: the verbs know them."""

import json

import numpy as np
import pyarrow.parquet as pq
import pytest
from numpy.testing import assert_allclose

from toy import Copy
from wording import says

DECLARATION = """
LAGGING = Plant(
    "lagging", "rates that follow with a lag", "",
    (Parameter("follow", "lagging: time constant of the rates", 0.05, "s"),), physics=False,
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
    share = world.period / (world.follow + world.period)
    for j in range(world.n):
        world.lagging_rate[j] += share * (world.qdot_sent[j] - world.lagging_rate[j])
        state[world.qpos_column[j]] += world.period * world.lagging_rate[j]


class Lagging(Ideal):
    """Integrates rates that lag."""

    name = "lagging"
    sense, obey = staticmethod(read_rates), staticmethod(follow)
    fields = (Field("follow"),)
    memory = (Field("lagging_rate", size=(JOINTS,)),)

    def write(self, world: np.void) -> None:
        """Write the time constant."""
        world["follow"] = self.section.follow
'''

KEY = """    hold: Positive = key("how many control periods each command holds", 1.0, "1")
"""
STAGE = '''"""Commands that are taken only now and then."""

from collections.abc import Iterator

import numpy as np

from rmrc.law.jit import Record, compiled
from rmrc.law.record import Field
from rmrc.plants.stage import Stage


@compiled
def send_first(world: Record, out: Record, past: Record, t: int) -> None:
    """Send what was commanded at the first of some ticks."""
    first = past[(t - t % world.hold) % len(past)]
    for j in range(world.n):
        world.qdot_sent[j] = first.qdot_cmd[j]


class Hold(Stage):
    """Commands that hold for some control periods."""

    slot, uses, change = "sent", "is_held", staticmethod(send_first)
    fields = (Field("is_held", np.int64), Field("hold", np.int64))

    @property
    def is_used(self) -> bool:
        """Whether some command is not taken."""
        return self.scenario.plant.hold > 1.0

    @property
    def span(self) -> int:
        """How many ticks a command holds beyond its own."""
        return round(self.scenario.plant.hold) - 1

    def write(self, world: np.void) -> None:
        """Write for how many ticks."""
        world["is_held"], world["hold"] = self.is_used, self.span + 1

    def misfits(self) -> Iterator[tuple[str, str]]:
        """Yield commands that hold for too long."""
        if self.scenario.plant.hold > 1000.0:
            yield "plant.hold", f"must be at most 1000, got {self.scenario.plant.hold:g}"
'''

SCENARIO = """
name: toy
arm: {model: models/planar_2link.xml, site: tip, start: [60 deg, -120 deg]}
task: {axes: [x, y]}
control: {period: 0.002}
target: {path: [{line: {by: [0.05, 0.05]}}]}
plant: {kind: lagging}
"""
ASKED = """
import sys
from rmrc.cli import main
for words in ("", "--json"):
    sys.argv = ["rmrc", "schema", *words.split()]
    try:
        main()
    except SystemExit as ended:
        print(f"\\x1f{ended.code}\\x1f", end="")
from rmrc.scenario import load
from rmrc.simulation.prepare import prepare
for text in ("plant.follow=-1", "plant.hold=2000"):
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
    (folder / "rmrc/plants/hold.py").write_text(STAGE, "utf-8")
    copy.add("plants/stages.py", "from rmrc.plants.hold import Hold\n", before="from rmrc.plants.response ")
    edit(copy, "plants/stages.py", ("(Encoders, ", "(Encoders, Hold, "))
    (folder / "toy.yaml").write_text(SCENARIO, "utf-8")
    return copy


@pytest.fixture(scope="module")
def toy(tmp_path_factory):
    """Return such a copy."""
    return with_toys(tmp_path_factory.mktemp("toy"))


def test_it_is_in_the_schema_and_in_messages(toy):
    ended = toy.python(ASKED)
    assert ended.returncode == 0, ended.stderr
    schema, first, declared, second, refused = ended.stdout.split("\x1f")
    assert (first, second) == ("0", "0")
    assert "time constant of the rates" in schema and "plant.follow " in schema
    kinds = json.loads(declared)["$defs"]["PlantSection"]["properties"]["kind"]
    assert kinds["enum"] == ["ideal", "servo", "torque", "model", "lagging"]
    assert kinds["description"].endswith("the model's own actuators, or rates that follow with a lag")
    assert refused.splitlines() == [
        says("--set plant.follow: … 0 … -1"),
        "--set plant.hold: must be at most 1000, got 2000",
    ]


@pytest.mark.long  # the same of an inverse without its function is tried in tests/test_toy_choices.py
@pytest.mark.parametrize(
    ("module", "old", "new"),
    [
        ("plants/kinds.py", "Model, Lagging)", "Model)"),
        ("scenario/choices.py", "MODEL, LAGGING)", "MODEL)"),
        ("plants/lagging.py", 'name = "lagging"', 'name = "laging"'),
    ],
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
    assert_lags(run("slower", "plant.follow=0.1"), lag=0.1)
    with pytest.raises(AssertionError):
        assert_lags(run("ideal", "plant.kind=ideal"), lag=0.05)
    assert_lags(run("held", "plant.hold=4"), lag=0.05, hold=4)

    ideal = run("ideal_held", "plant.kind=ideal", "plant.hold=4")
    moved = np.diff(ideal["q"], axis=0)
    assert_allclose(moved, 0.002 * held(ideal["qdot_cmd"], 4)[:-1], rtol=0, atol=1e-15)  # rounding of q

    kinds = "plant.kind=ideal,lagging,servo"
    toy.rmrc("compare", "toy.yaml", "--vary", kinds, "--out", "out", "--no-record", "-q")
    compared = json.loads((toy.folder / "out/toy.compare.json").read_text())
    error = {one["label"]: one["scorecard"]["position_error"]["max"] for one in compared["variants"]}
    toy.rmrc("sweep", "toy.yaml", "--vary", "plant.follow=0.01,0.05,0.1", "--out", "out", "-q")
    rows = pq.read_table(toy.folder / "out/toy.sweep.parquet").to_pydict()
    assert rows["plant.follow"] == [0.01, 0.05, 0.1]
    peaks = rows["position_error.max"]
    assert error["ideal"] < peaks[0] < peaks[1] < peaks[2]  # the slower, the worse
    assert peaks[1] == error["lagging"]


def held(commands, ticks):
    """Return the first of so many commands in the place of each."""
    return np.repeat(commands[::ticks], ticks, axis=0)[: len(commands)]


def assert_lags(columns, lag, hold=1, period=0.002):
    """Hold rates and positions against a recurrence of the commands."""
    sent = held(columns["qdot_cmd"], hold)
    rate, q = np.zeros(sent.shape[1]), columns["q"][0].copy()
    for t in range(len(sent)):
        # a rounding in a thousand ticks each, and what they add up to
        assert_allclose(columns["qdot"][t], rate, rtol=0, atol=1e-12)
        assert_allclose(columns["q"][t], q, rtol=0, atol=1e-12)
        rate += period / (lag + period) * (sent[t] - rate)
        q += period * rate
