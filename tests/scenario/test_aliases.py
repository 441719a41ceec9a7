"""What other tools and people write, told in one line that names what to write here: all of it is then accepted."""

import re
from typing import get_args

import pytest
import yaml
from scenario_texts import MINIMAL, problems

from rmrc.scenario import aliases, loads
from rmrc.scenario.path import SEGMENTS
from rmrc.scenario.sections import Check, Sections
from rmrc.scenario.units import UNITS, instead
from rmrc.scenario.values import Section
from wording import says


def kinds(annotation):
    """Return the sections in a type."""
    if isinstance(annotation, type) and issubclass(annotation, Section):
        return [annotation]
    return [kind for inner in get_args(annotation) for kind in kinds(inner)]


def every_field(section=Sections, above=""):
    """Yield every key with its field, walked from the sections: another way than the schema's rows."""
    for name, field in section.model_fields.items():
        key = f"{above}.{field.alias or name}".removeprefix(".")
        if key == "expect":
            key = "expect.<metric>"
            yield "expect", field
        yield key, field
        for kind in kinds(field.annotation):
            if kind in SEGMENTS.values():
                yield from every_field(kind, "target.path")
            else:
                yield from every_field(kind, key)


FIELDS = dict(every_field())


def options(annotation):
    """Return the texts that a literal type allows."""
    return {value for value in get_args(annotation) if isinstance(value, str)} | {
        value for inner in get_args(annotation) if not isinstance(inner, str) for value in options(inner)
    }


@pytest.mark.parametrize("key", aliases.CHOICES)
def test_the_choices_that_have_other_names_are_choices_of_their_key(key):
    allowed = set(SEGMENTS) if key == "target.path" else options(FIELDS[key].annotation)
    for ours, others in aliases.CHOICES[key].items():
        assert set(ours.split(", ")) <= allowed
        # Another name that is a choice would never be looked up; one of two choices would be told at random.
        assert not set(others.split()) & allowed
        for other, names in aliases.CHOICES[key].items():
            assert other == ours or not set(names.split()) & set(others.split())


@pytest.mark.parametrize("key", [*aliases.KEYS, *aliases.INSTEAD, *aliases.EXAMPLES])
def test_the_keys_that_have_other_names_are_keys(key):
    assert key in FIELDS


def test_a_key_is_not_another_name_of_one_beside_it():
    for key, others in aliases.KEYS.items():
        above = key.rpartition(".")[0]
        beside = {one.rpartition(".")[2] for one in FIELDS if one.rpartition(".")[0] == above}
        assert not beside & set(others.split()), key


SPELLED = [
    pytest.param(f"{key}={other}", ours, marks=[pytest.mark.long] if i else [])
    for key, names in aliases.CHOICES.items()
    if key != "target.path" and not key.endswith("axes")
    for ours, others in names.items()
    for i, other in enumerate(others.split())
]


@pytest.mark.parametrize(("override", "ours"), SPELLED)
def test_another_name_of_a_choice_is_told_ours_which_is_accepted(override, ours):
    (problem,) = problems(MINIMAL, override)
    assert problem == says(f"--set … ; … {ours}")
    key = override.partition("=")[0]
    rates = ["control.nullspace.rates=[1]"] if ours == "rates" else []
    assert loads(MINIMAL, overrides=[*rates, f"{key}={ours}"])


WRITE = re.compile(r" (\{[^{}]*\}|\[[^]]*\])$")
NATURAL = [
    "control.inverse.damping=0.1",
    "control.inverse=dls",
    "control.nullspace=off",
    "plant=kinematic",
    "target.limits=0.5",
    "expect.joint_rate.peak=3",
    "task.axes=xy",
    "task.axes=x",
    "task.axes=x y rz",
    "task.axes=pose",
    "plant.gravity=-9.81",
]


@pytest.mark.parametrize("override", NATURAL)
def test_what_a_message_says_to_write_can_be_written(override):
    (problem,) = problems(MINIMAL, override)
    written = WRITE.search(problem)[1]
    key = override.partition("=")[0]
    assert loads(MINIMAL, overrides=[f"{key}={written}"])


@pytest.mark.parametrize("unit", UNITS)
def test_a_quantity_in_its_own_unit_is_told_as_a_number_that_yaml_reads(unit):
    factor, of = UNITS[unit]
    told = instead(f"3 {unit}", of)
    number = re.search(r"[\d.]+(?:e[+-]?\d+)?(?: deg)?", told)[0]
    if of == "rad":  # in degrees, which a scenario takes
        assert float(number.removesuffix(" deg")) == pytest.approx(
            3 * factor * 180 / 3.141592653589793, rel=1e-6
        )
    else:  # seven digits are told
        assert yaml.safe_load(number) == pytest.approx(3 * factor, rel=1e-6)


@pytest.mark.parametrize("text", ["fast", "3 apples", "1/0", "", "pi/0", "1e999 mm", "mm", "--1 mm"])
def test_of_what_is_no_quantity_nothing_is_told(text):
    assert instead(text, "m") == ""


@pytest.mark.parametrize("other", aliases.KEYS["expect.<metric>.below"].split())
def test_other_names_of_a_bound_are_told(other):
    assert other not in Check.model_fields
    (problem,) = problems(MINIMAL, f"expect={{a.b: {{'{other}': 1, above: 0}}}}")
    assert problem == says('--set … "below"')
