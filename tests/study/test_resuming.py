"""A sweep that goes on trusts nothing that lies there: each kind of damage is one line, and never a short dataset."""

import json
import os
import shutil
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from project import ROOT
from rmrc.study.dataset import as_parquet
from rmrc.study.sweep import Sweep
from rmrc.support.errors import ScenarioError
from wording import says

TEXT = f"""
name: quick
arm: {{model: {ROOT}/models/planar_2link.xml, site: tip, start: [60 deg, -120 deg]}}
task: {{axes: [x, y]}}
target: {{path: [{{line: {{by: [0.004, 0.0]}}}}]}}
sweep: {{draw: {{control.feedback: [1, 20]}}, samples: 32}}
"""
REMOVE = "; … remove … rerun the command …"  # the way out of each: what is wrong is taken away, or the sweep goes elsewhere
MOVE = "; … move … --out"


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """(scenario, its dataset's file, its table)."""
    folder = tmp_path_factory.mktemp("whole")
    path = folder / "quick.yaml"
    path.write_text(TEXT)
    sweep = Sweep(path, folder=folder, threads=1)
    sweep.run()
    return path, sweep.dataset.file, pq.read_table(sweep.dataset.file)


@pytest.fixture(scope="module")
def killed(whole, tmp_path_factory):
    """A sweep of which all parts but the last are there, as if it had been killed: (contents, folder)."""
    path, _, table = whole
    sweep = Sweep(path, folder=tmp_path_factory.mktemp("killed"), threads=1)
    contents = sweep.check()
    for part in range(contents.parts - 1):
        keep(sweep.dataset, contents, table, part)
    return contents, sweep.dataset.folder


@pytest.fixture
def begun(killed, tmp_path):
    """A copy of it: (contents, folder)."""
    return killed[0], Path(shutil.copytree(killed[1], tmp_path / "quick.sweep"))


def keep(dataset, contents, table, part):
    rows = table.slice(contents.indices(part).start, len(contents.indices(part))).to_pylist()
    dataset.keep(part, as_parquet(contents.columns, rows), contents)


def again(whole, tmp_path):
    """Return what the same command says."""
    with pytest.raises(ScenarioError) as caught:
        Sweep(whole[0], folder=tmp_path, threads=1).run(lambda _: pytest.fail("a run was started"))
    line = str(caught.value)
    assert "\n" not in line
    assert not (tmp_path / "quick.sweep.parquet").exists()
    return line


def rewritten(path, change):
    """Have a part as another program would write it: valid Parquet with the same marks."""
    table = pq.read_table(path)
    marks = pq.read_metadata(path).metadata
    changed = change(table)
    pq.write_table(changed.replace_schema_metadata({b"rmrc.sha256": marks[b"rmrc.sha256"]}), path)


def with_value(table, name, row, value):
    column = table[name].to_pylist()
    column[row] = value
    return table.set_column(table.schema.get_field_index(name), table.schema.field(name), pa.array(column))


DAMAGES = {
    "a value": (lambda table: with_value(table, "joint_rate.peak", 0, 1e-9), "… altered … another sweep"),
    "a row less": (lambda table: table.slice(0, len(table) - 1), "… 1 … 2"),
    "a row twice": (
        lambda table: pa.concat_tables([table.slice(0, 1), table.slice(0, 1)]),
        "… runs … 2 to 3",
    ),
    "order": (lambda table: table.take([1, 0]), "… runs … 2 to 3"),
    "a column less": (lambda table: table.drop_columns(["seed"]), "… columns …"),
    "a type": (lambda table: table.set_column(0, "index", table["index"].cast(pa.int32())), "… columns …"),
    "nothing but who wrote it": (lambda table: table, "… altered … another sweep"),
}


@pytest.mark.parametrize("case", DAMAGES)
def test_a_part_that_was_changed_is_named(whole, begun, tmp_path, case):
    change, what = DAMAGES[case]
    part = begun[1] / "part-00000001.parquet"
    rewritten(part, change)
    assert again(whole, tmp_path) == says(f"{part}: {what}{REMOVE}")


def test_the_way_out_that_the_line_names_leads_out(whole, begun, tmp_path):
    part = begun[1] / "part-00000001.parquet"
    rewritten(part, lambda table: table.take([1, 0]))
    assert again(whole, tmp_path) == says(f"{part}: has rows of runs outside 2 to 3{REMOVE}")
    part.unlink()
    Sweep(whole[0], folder=tmp_path, threads=1).run()
    assert (tmp_path / "quick.sweep.parquet").read_bytes() == whole[1].read_bytes()


@pytest.mark.parametrize("at", [0.1, 0.5, 0.9])
def test_one_bit_is_enough(whole, begun, tmp_path, at):
    part = begun[1] / "part-00000003.parquet"
    data = bytearray(part.read_bytes())
    data[int(at * len(data))] ^= 1
    part.write_bytes(data)
    assert again(whole, tmp_path).startswith(f"{part}: ")


@pytest.mark.parametrize("keeps", [0.0001, 0.5, 0.99])
def test_a_torn_part_is_named(whole, begun, tmp_path, keeps):
    part = begun[1] / "part-00000003.parquet"
    data = part.read_bytes()
    part.write_bytes(data[: max(1, int(keeps * len(data)))])
    assert again(whole, tmp_path) == says(f"{part}: … damaged{REMOVE}")


def test_parts_that_were_swapped_are_named(whole, begun, tmp_path):
    one, other = (begun[1] / f"part-0000000{part}.parquet" for part in (1, 4))
    data = one.read_bytes()
    one.write_bytes(other.read_bytes())
    other.write_bytes(data)
    assert again(whole, tmp_path) == says(f"{one}: … runs … 2 to 3{REMOVE}")


def test_a_part_of_another_sweep_with_the_same_columns_and_runs_is_named(whole, begun, tmp_path):
    other = Sweep(whole[0], ["control.period=0.002"], tmp_path / "other", threads=1)
    contents = other.check()
    assert (contents.columns, contents.batch) == (begun[0].columns, begun[0].batch)
    keep(other.dataset, contents, whole[2], 2)
    part = begun[1] / "part-00000002.parquet"
    shutil.copy(other.dataset.folder / part.name, part)
    assert again(whole, tmp_path) == says(f"{part}: … altered … another sweep{REMOVE}")


@pytest.mark.parametrize("target", ["elsewhere", "nowhere"])
def test_a_link_is_no_part(whole, begun, tmp_path, target):
    part = begun[1] / "part-00000002.parquet"
    if target == "elsewhere":
        shutil.copy(part, tmp_path / "elsewhere")
    part.unlink()
    part.symlink_to(tmp_path / target)
    assert again(whole, tmp_path) == says(f"{part}: … not … file{REMOVE}")


def test_a_file_of_others_in_the_folder_is_named_and_never_deleted(whole, begun, tmp_path):
    folder = begun[1]
    for name in ("notes.txt", "part-00000099.parquet"):
        shutil.copy(folder / "part-00000000.parquet", folder / name)
        assert again(whole, tmp_path) == says(f"{folder / name}: … part …{MOVE}")
        (folder / name).unlink()
    (folder / ".part-00000002-0123456789abcdef.parquet").write_bytes(b"torn")  # as kill -9 leaves them
    Sweep(whole[0], folder=tmp_path, threads=1).run()
    assert not folder.exists()
    folder.mkdir()
    (folder / "notes.txt").write_text("mine")
    Sweep(whole[0], folder=tmp_path, threads=1).run()
    assert (folder / "notes.txt").read_text() == "mine"


def altered(plan, change):
    facts = json.loads(plan.read_text())
    change(facts)
    plan.write_text(json.dumps(facts))


PLANS = {
    "runs": lambda facts: facts.update(runs=30),
    "batch": lambda facts: facts.update(batch=3),
    "a column": lambda facts: facts["columns"].pop(),
    "digest": lambda facts: facts.update(digest="0" * 64),
}


@pytest.mark.parametrize("case", PLANS)
def test_a_plan_that_was_changed_is_refused(whole, begun, tmp_path, case):
    altered(begun[1] / "_plan.json", PLANS[case])
    assert again(whole, tmp_path) == says(f"{begun[1]}: … altered{MOVE}")


def test_a_plan_of_a_version_before_digests_is_refused_by_its_runs_or_its_parts(whole, begun, tmp_path):
    plan = begun[1] / "_plan.json"
    altered(plan, lambda facts: (facts.pop("digest"), facts.update(runs=30)))
    assert again(whole, tmp_path) == says(f"{begun[1]}: … 30 runs … 32{MOVE}")
    altered(plan, lambda facts: facts.update(runs=32, batch=1))
    assert again(whole, tmp_path) == says(f"… part-00000000.parquet: … 2 … 1{REMOVE}")


@pytest.mark.parametrize("text", ["", "[" * 100_000, "\xff", '{"runs": ' + "9" * 5000 + "}", "null"])
def test_a_plan_that_is_none_is_refused(whole, begun, tmp_path, text):
    (begun[1] / "_plan.json").write_text(text, "latin-1")
    assert again(whole, tmp_path) == says(f"{begun[1]}: … not … sweep{MOVE}")


def test_parts_without_their_plan_still_count_as_they_are_known_by_their_digest(whole, begun, tmp_path):
    (begun[1] / "_plan.json").unlink()
    ran = []
    Sweep(whole[0], folder=tmp_path, threads=1).run(ran.append)
    assert sum(ran) == len(begun[0].indices(begun[0].parts - 1))
    assert (tmp_path / "quick.sweep.parquet").read_bytes() == whole[1].read_bytes()


WHOLE = {
    "short": (lambda table: table.slice(0, 20), "… 20 … 32 rows"),
    "doubled": (
        lambda table: pa.concat_tables([table.slice(0, 31), table.slice(0, 1)]),
        "… row … once … order",
    ),
    "a column": (lambda table: table.drop_columns(["seed"]), "… columns"),
}


@pytest.mark.parametrize("case", WHOLE)
def test_a_whole_file_that_lacks_rows_is_not_whole(whole, tmp_path, case):
    change, what = WHOLE[case]
    file = tmp_path / "quick.sweep.parquet"
    pq.write_table(change(whole[2]), file)
    with pytest.raises(ScenarioError) as caught:
        Sweep(whole[0], folder=tmp_path)
    assert str(caught.value) == says(f"{file}: {what}{MOVE}")


def test_a_bit_that_turned_in_the_whole_file_is_found_when_it_is_read(whole, tmp_path):
    file = tmp_path / "quick.sweep.parquet"
    group = pq.read_metadata(whole[1]).row_group(0)
    columns = [group.column(i) for i in range(group.num_columns)]
    (page,) = (column.data_page_offset for column in columns if column.path_in_schema == "joint_rate.peak")
    data = bytearray(whole[1].read_bytes())
    data[page - 8] ^= 1  # in the last of the numbers, which are in a page before that of their indices
    file.write_bytes(data)
    with pytest.raises(ScenarioError) as caught:
        Sweep(whole[0], folder=tmp_path).summary()
    assert str(caught.value) == says(f"{file}: … damaged{REMOVE}")


@pytest.mark.skipif(os.name != "posix", reason="exit code and streams of a shell")
def test_the_verb_says_it_in_one_line_and_ends_with_2(whole, begun, tmp_path, rmrc):
    part = begun[1] / "part-00000001.parquet"
    rewritten(part, DAMAGES["a value"][0])
    code, out, err = rmrc("sweep", str(whole[0]), "--out", str(tmp_path))
    assert (code, out) == (2, "")
    assert err == says(f"rmrc: error: {part}: … altered … another sweep{REMOVE}\n")
