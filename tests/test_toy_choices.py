"""An inverse that is added the way CONTRIBUTING says, and nothing else, is in every verb."""

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
FUNCTION = """\
@inlined
def soft(world: Record, asked: Array, sigma: Array, v: Array, damped: float, gain: Array) -> None:
    \"\"\"Write 1/(σ + softness).\"\"\"
    for i in range(world.k):
        gain[i] = 1.0 / (sigma[i] + world.inverse_softness)


"""
OTHERS = {
    "scenario/choices.py": [
        ('        Schedule("half", "λ_max/2", "", (DAMPING_MAXIMUM,)),\n', 'Schedule("constant"'),
        ('        Choice("unwind", "−gain · q", "", (GAIN,)),\n', 'Choice("posture"'),
        ('        Choice("freeze", "all stand still"),\n', 'Choice("clamp"'),
        ('        Policy("crawl", "all are slower by a factor", "", (CRAWL_SHARE,)),\n', 'Policy("damp"'),
        ('    CRAWL_SHARE := Parameter("crawl.share", "what is left of the rates", 0.5, "1", SHARE),\n', "SLOW_CHANGE :="),
        ('    Group("crawl", "at_singularity crawl: how", "How `at_singularity: crawl` slows the arm."),\n', 'Group("stop"'),
    ],
    "law/damping.py": [("""\
@inlined
def half(world: Record, asked: Array, sigma: Array) -> float:
    return float(0.5 * world.inverse_damping_maximum)


""", "scheduled = ")],
    "law/nullspace.py": [("""\
@inlined
def unwind(world: Record, tick: Record, qdot0: Array) -> None:
    for j in range(world.n):
        qdot0[j] = -world.nullspace_gain * world.q[j]


""", "wished_rates = ")],
    "law/limits.py": [("""\
@inlined
def freeze(world: Record, tick: Record, acting: int) -> int:
    for j in range(world.n):
        tick.qdot_cmd[j] = 0.0
    return acting


""", "confine_by_choice = ")],
    "law/policies.py": [("""\
@inlined
def crawl(world: Record, tick: Record) -> int:
    for j in range(world.n):
        tick.qdot_cmd[j] *= world.crawl_share
    return SLOWED


""", "near_singularity = ")],
}  # fmt: skip
SCENARIO = """
name: toy
arm: {model: models/planar_2link.xml, site: tip, start: [30 deg, -60 deg]}
task: {axes: [x, y]}
control: {period: 0.02, feedback: 2, inverse: {method: soft, softness: 0.25}}
target: {path: [{line: {to: [1.5, 0.0]}}], limits: {velocity: 0.5}}
plant: {kind: ideal}
"""


def declared(folder):
    """Return a copy of the package that has a toy inverse, but for its function."""
    copy = Copy(folder)
    copy.add("scenario/choices.py", PARAMETER, before="GAIN := ")
    copy.add("scenario/choices.py", INVERSE, before='Inverse("damped"')  # not last: codes are positions
    return copy


KNOWS = """
import json
from rmrc.scenario import loads, schema_rows, json_schema
from rmrc.scenario.choices import INVERSES, record_fields
from rmrc.tuning import space
rows = {row.key: row for row in schema_rows()}
schema = json_schema()["$defs"]["InverseSection"]["properties"]
(soft,) = (one for one in space.all_structures() if one.method == "soft" and one.at_singularity == "damp")
print(json.dumps([
    rows["control.inverse.softness"], rows["control.inverse.method"].type, schema["softness"],
    schema["method"]["enum"], [field[0] for field in record_fields()],
    [soft.keys, soft.schedule, "control.inverse.softness" in space.NUMBERS, "soft" in space.WORDS[space.METHOD]],
]))
"""


@pytest.mark.long  # tests/test_toy_plant.py reads the schema of such a copy, tests/law/test_dispatch.py calls a toy choice
def test_schema_and_record_have_what_is_declared_and_tune_searches_it(tmp_path):
    copy = declared(tmp_path)
    copy.add("law/inverses.py", FUNCTION, before="gains = ")
    ended = copy.python(KNOWS)
    assert ended.returncode == 0, ended.stderr
    row, kinds, field, names, fields, searched = json.loads(ended.stdout)
    meaning = "soft: what is added to each singular value"
    assert row == ["control.inverse.softness", "number > 0", "as σ", "0.1", meaning]
    assert "transpose | soft | damped" in kinds and "soft" in names
    assert field == {
        "default": 0.1, "description": meaning, "exclusiveMinimum": 0, "title": "Softness", "type": "number",
        "unit": "as σ",
    }  # fmt: skip
    assert "inverse_softness" in fields
    assert searched == [["control.inverse.softness", "control.feedback"], "", True, True]


@pytest.mark.long  # tests/law/test_dispatch.py says the same of a toy choice in its own module
@pytest.mark.parametrize("has", ["none", "of other arguments"])
def test_an_inverse_without_its_function_cannot_be_imported(tmp_path, has):
    copy = declared(tmp_path)
    if has != "none":
        copy.add("law/inverses.py", FUNCTION.replace("damped: float, ", ""), before="gains = ")
    wanted = (
        "ImportError: rmrc.law.inverses must have a compiled function soft(world, asked, sigma, v, damped, gain), "
        "which control.inverse.method: soft stands for"
    )
    ended = copy.python("import rmrc.law.inverses")
    assert ended.returncode == 1 and ended.stderr.splitlines()[-1] == wanted


@pytest.fixture(scope="module")
def toy(tmp_path_factory):
    """Return a copy of the package with a toy of each kind."""
    copy = declared(tmp_path_factory.mktemp("toy"))
    copy.add("law/inverses.py", FUNCTION, before="gains = ")
    for module, texts in OTHERS.items():
        for text, before in texts:
            copy.add(module, text, before)
    (copy.folder / "toy.yaml").write_text(SCENARIO)
    return copy


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
