"""Scenarios that the tests share, and what is wrong with others."""

from pathlib import Path

import pytest

from rmrc.scenario import loads
from rmrc.support.errors import ScenarioError

MINIMAL = """\
name: x
arm: {model: arm.xml, site: tip}
target:
  path:
    - line: {by: [0.1, 0.0]}
"""

# Every key of a scenario, but for those that exclude others, which OTHER_FRAMES have; a test of the schema holds both
# against the schema.
FULL = (Path(__file__).parent / "full.yaml").read_text()


OTHER_FRAMES = (
    ("arm.site=null", "arm.body=link_2"),
    (
        "arm.site=null",
        "arm.tool={body: link_2, position: [0.1, 0, 0], orientation: [1, 0, 0, 0], mass: 0.5, center: [0, 0, 0.1], "
        "inertia: [0.1, 0.1, 0.1]}",
    ),
    ("arm.site=null", "arm.tool={orientation: [90 deg, 0, 0], model: arm.xml, site: tip}"),
)


def full_scenarios():
    """Return scenarios that use every key together."""
    return [loads(FULL), *(loads(FULL, overrides=frame) for frame in OTHER_FRAMES)]


def problems(text, *overrides):
    with pytest.raises(ScenarioError) as caught:
        loads(text, "x.yaml", overrides)
    return str(caught.value).splitlines()


def number_keys(value, key=""):
    """Walk plain data to the key of every number in it."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from number_keys(inner, f"{key}.{name}".removeprefix("."))
    elif isinstance(value, list):
        for i, inner in enumerate(value):
            yield from number_keys(inner, f"{key}[{i}]")
    elif isinstance(value, float):
        yield key


def full_number_keys():
    Path("arm.xml").write_text("<mujoco/>")
    Path("motion.csv").touch()
    return sorted(number_keys(loads(FULL).model_dump(mode="json")))
