"""Choices and a plant that are declared, with functions of their names, and nothing else: every verb has them."""

import json

import numpy as np
import pyarrow.parquet as pq
import pytest

from rmrc.scenario.choices import Status
from toy import Copy

PARAMETER = """\
    SOFTNESS := Parameter(
        "inverse.softness", "soft: what is added to each singular value", 0.1, "as σ",
        range=lambda seen: (1e-3 * seen.sigma, 0.5 * seen.sigma),
    ),
"""
INVERSE = """\
        Inverse("soft", "1/(σ + softness)", "Somebody99", (SOFTNESS,)),
"""
PLANT = """\
LAGGING = Plant(
    "lagging", "rates that follow with a lag", "",
    (Parameter("follow", "lagging: time constant of the rates", 0.05, "s"),), physics=False,
)

"""
DECLARED = [
    (PARAMETER, "GAIN := "),
    (INVERSE, 'Inverse("damped"'),  # not last: codes are positions
    ('        Schedule("half", "λ_max/2", "", (DAMPING_MAXIMUM,)),\n', 'Schedule("constant"'),
    ('        Choice("unwind", "−gain · q", "", (GAIN,)),\n', 'Choice("posture"'),
    ('        Choice("freeze", "all stand still"),\n', 'Choice("clamp"'),
    ('        Policy("crawl", "all are slower by a factor", "", (CRAWL_SHARE,)),\n', 'Policy("damp"'),
    ('    CRAWL_SHARE := Parameter("crawl.share", "what is left of the rates", 0.5, "1", SHARE),\n', "SLOW_CHANGE :="),
    ('    Group("crawl", "at_singularity crawl: how", "How `at_singularity: crawl` slows the arm."),\n', 'Group("stop"'),
    (PLANT, "PLANTS = "),
]  # fmt: skip
FUNCTIONS = {
    "law/inverses.py": """

@Method
def soft(world: Record, spectrum: Record) -> None:
    for i in range(world.k):
        spectrum.gain[i] = 1.0 / (spectrum.sigma[i] + world.law.inverse_softness)
""",
    "law/damping.py": """

@Method
def half(world: Record, spectrum: Record) -> None:
    spectrum.damping = 0.5 * world.law.inverse_damping_maximum
""",
    "law/nullspace.py": """

@Method
def unwind(world: Record) -> None:
    for j in range(world.n):
        world.scratch.qdot0[j] = -world.law.nullspace_gain * world.state.q[j]
""",
    "law/limits.py": """

@Method
def freeze(world: Record) -> None:
    begin(world)
    for j in range(world.n):
        world.tick.qdot_cmd[j] = 0.0
""",
    "law/policies.py": """

@Method
def crawl(world: Record) -> None:
    for j in range(world.n):
        world.tick.qdot_cmd[j] *= world.law.crawl_share
    world.tick.status |= SLOWED
""",
}  # fmt: skip
LAGGING = '''"""The lagging plant: exact integration of rates that follow what was sent with a time constant."""

import numpy as np

from rmrc.law.compiling import Method, Record
from rmrc.plants.fields import qpos_of
from rmrc.plants.ideal import Ideal


@Method
def read_rates(world: Record) -> None:
    """Read q; the rates are those that it has come to."""
    qpos = qpos_of(world)
    for j in range(world.n):
        world.tick.q[j] = qpos[world.engine.qpos_at[j]]
        world.tick.qdot[j] = world.plant.following[j]
        world.tick.tau[j] = 0.0


@Method
def follow(world: Record) -> None:
    """Come nearer to the rates that were sent, and integrate."""
    plant, qpos = world.plant, qpos_of(world)
    for j in range(world.n):
        plant.following[j] += world.period / (plant.follow + world.period) * (plant.qdot_sent[j] - plant.following[j])
        qpos[world.engine.qpos_at[j]] += world.period * plant.following[j]


class Lagging(Ideal):
    """Integrates rates that lag."""

    name = "lagging"
    sense, obey = read_rates, follow

    def write(self, world: np.void) -> None:
        """Write the time constant."""
        world["plant"]["follow"] = self.section.follow
'''
SCENARIO = """
name: toy
arm: {model: models/planar_2link.xml, site: tip, start: [30 deg, -60 deg]}
task: {axes: [x, y]}
control: {period: 0.02, feedback: 2, inverse: {method: soft, softness: 0.25}}
target: {path: [{line: {to: [1.5, 0.0]}}], limits: {velocity: 0.5}}
plant: {kind: ideal}
"""


@pytest.fixture(scope="module")
def toy(tmp_path_factory):
    """Return a copy of the package with a toy of each kind."""
    copy = Copy(tmp_path_factory.mktemp("toy"))
    for text, before in DECLARED:
        copy.add("scenario/choices.py", text, before)
    for module, text in FUNCTIONS.items():
        with (copy.folder / "rmrc" / module).open("a", encoding="utf-8") as file:
            file.write(text)
    copy.replace("scenario/choices.py", "TORQUE, MODEL)", "TORQUE, MODEL, LAGGING)")
    (copy.folder / "rmrc/plants/lagging.py").write_text(LAGGING, "utf-8")
    copy.add("law/record.py", '        ("follow", f), ("following", f, J),\n', '("qdot_sent", f, J)')
    copy.add("plants/hardware.py", "from rmrc.plants.lagging import Lagging\n", "from rmrc.plants.model")
    copy.replace("plants/hardware.py", "Torque, Model)", "Torque, Model, Lagging)")
    (copy.folder / "toy.yaml").write_text(SCENARIO)
    return copy


KNOWS = """
import json
from rmrc.scenario import schema_rows, json_schema
from rmrc.scenario.choices import record_fields
from rmrc.tuning import space
rows = {row.key: row for row in schema_rows()}
schema = json_schema()["$defs"]
(soft,) = (one for one in space.all_structures() if one.method == "soft" and one.at_singularity == "damp")
print(json.dumps([
    rows["control.inverse.softness"], rows["control.inverse.method"].type, schema["InverseSection"]["properties"]["softness"],
    schema["PlantSection"]["properties"]["kind"]["enum"], [field[0] for field in record_fields()],
    [soft.keys, soft.schedule, "control.inverse.softness" in space.NUMBERS, "soft" in space.WORDS[space.METHOD]],
]))
"""


def test_schema_and_record_have_what_is_declared_and_tune_searches_it(toy):
    ended = toy.python(KNOWS)
    assert ended.returncode == 0, ended.stderr
    row, names, field, plants, fields, searched = json.loads(ended.stdout)
    meaning = "soft: what is added to each singular value"
    assert row == ["control.inverse.softness", "number > 0", "as σ", "0.1", meaning]
    assert "transpose | soft | damped" in names and plants[-1] == "lagging"
    assert field == {
        "default": 0.1, "description": meaning, "exclusiveMinimum": 0, "title": "Softness", "type": "number",
        "unit": "as σ",
    }  # fmt: skip
    assert "inverse_softness" in fields
    assert searched == [["control.inverse.softness", "control.feedback"], "", True, True]


SOLVED = """
import numpy as np, rmrc
J, t = np.diag([1.0, 0.5]), np.ones(2)
print(*rmrc.resolve_rates(J, t, "soft", softness=0.25))
print(*rmrc.resolve_rates(J, t, "damped", schedule="half", damping_maximum=0.2))
"""


@pytest.mark.long
def test_an_inverse_and_a_schedule_that_are_declared_invert(toy):
    ended = toy.python(SOLVED)
    # g = 1/(σ + softness) and σ/(σ² + (λ_max/2)²)
    want = [[1 / 1.25, 1 / 0.75], [1 / 1.01, 0.5 / 0.26]]
    got = [[float(number) for number in line.split()] for line in ended.stdout.splitlines()]
    assert np.array(got) == pytest.approx(np.array(want), rel=1e-14), ended.stderr


@pytest.mark.long
def test_every_verb_does_what_is_declared(toy):
    assert "control.inverse.softness" in toy.rmrc("schema")
    toy.rmrc("run", "toy.yaml", "--out", "run")
    facts = json.loads((toy.folder / "run/toy.json").read_text("utf-8"))
    inverse = facts["scenario"]["control"]["inverse"]
    assert (inverse["method"], inverse["softness"]) == ("soft", 0.25)
    vary = ("--vary", "control.inverse.method=soft,damped", "--vary", "control.inverse.softness=0.05,0.5")
    assert toy.rmrc("compare", "toy.yaml", *vary, "--out", "compare").count("soft") >= 2
    toy.rmrc("sweep", "toy.yaml", *vary, "--out", "sweep")
    (path,) = (toy.folder / "sweep").rglob("*.parquet")
    error = {
        (one["control.inverse.method"], one["control.inverse.softness"]): one["position_error.rms"]
        for one in pq.read_table(path).to_pylist()
    }
    assert error["soft", 0.05] < error["soft", 0.5]  # the softer, the less it follows
    assert error["damped", 0.05] == error["damped", 0.5]
    only = ("--only", "control.inverse.method=soft", "--runs", "20", "--perturbed", "1", "--out", "tune")
    found = toy.rmrc("tune", "toy.yaml", *only)
    assert "method: soft" in found and "softness: " in found


LAGS = """
import numpy as np
from rmrc.scenario import load
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation
for kind in ("lagging", "ideal"):
    run = Simulation([prepare(load("toy.yaml", [f"plant.kind={kind}", "plant.follow=0.1"]))]).run()[0]
    sent, rate, q, off = run["qdot_cmd"], np.zeros(2), run["q"][0].copy(), 0.0
    for t in range(len(run)):  # a recurrence of the commands
        off = max(off, np.abs(run["qdot"][t] - rate).max(), np.abs(run["q"][t] - q).max())
        rate += 0.02 / (0.1 + 0.02) * (sent[t] - rate)
        q += 0.02 * rate
    print(len(run), off)
"""


@pytest.mark.long
def test_a_plant_that_is_declared_moves_the_arm(toy):
    ended = toy.python(LAGS)
    assert ended.returncode == 0, ended.stderr
    (count, lagging), (_, ideal) = (map(float, line.split()) for line in ended.stdout.splitlines())
    assert count > 50 and lagging < 1e-12 and ideal > 1e-3


FIRST = """
from rmrc.scenario import load
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation
for tick, *texts in (
    (1,), (1, "control.at_singularity=crawl", "control.crawl.share=0.25"),
    (1, "control.limits.rate=0.1", "control.limits.on_excess=freeze"),
    (0, "task.axes=[x]"), (0, "task.axes=[x]", "control.nullspace={objective: unwind, gain: 2}"),
):
    run = Simulation([prepare(load("toy.yaml", ["control.period=0.5", *texts]))]).run()[0]
    print(*run["qdot_cmd"][tick], *run["q"][tick], int(run["status"][tick]))
"""


@pytest.mark.long
def test_an_objective_a_limit_and_a_policy_that_are_declared_act(toy):
    ended = toy.python(FIRST)
    assert ended.returncode == 0, ended.stderr
    plain, crawling, frozen, free, unwound = (
        np.array([float(number) for number in line.split()]) for line in ended.stdout.splitlines()
    )
    # at tick 0 the target rests, so that at tick 1 all are still where they began
    assert np.abs(plain[:2]).max() > 0.1
    assert crawling[:2] == pytest.approx(0.25 * plain[:2], rel=1e-14) and int(crawling[-1]) & Status.SLOWED
    assert frozen[:2].tolist() == [0.0, 0.0] and int(frozen[-1]) & Status.RATE_LIMITED
    # what is added is along the null space of the row of x, and is the part of −2 q that lies there
    q = free[2:4]
    row = np.array([-np.sin(q[0]) - np.sin(q[0] + q[1]), -np.sin(q[0] + q[1])])
    along = np.array([-row[1], row[0]]) / np.hypot(*row)
    assert unwound[:2] - free[:2] == pytest.approx(along * (along @ (-2 * q)), abs=1e-12)
