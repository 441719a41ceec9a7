"""Workspaces of shipped arms, each found once: several files look at the same ones."""

import functools

from project import ROOT
from rmrc import arm as arms
from rmrc.analysis.workspace import workspace


def arm_of(name, site=None):
    return arms.load(ROOT / f"models/{name}.xml", site)


@functools.cache
def found(name, site=None, plane=None, cells=100, samples=200_000):
    return workspace(arm_of(name, site), plane, cells=cells, samples=samples)


def chain(path, *parts):
    """Write and load an arm of joints (type, axis, range in degrees or m, the way to it), with a tool at its end."""
    bodies = "".join(
        f'<body pos="{way}"><joint name="j{i}" type="{kind}" axis="{axis}" range="{ends}"/><geom size="0.05"/>'
        for i, (kind, axis, ends, way) in enumerate(parts, 1)
    )
    path.write_text(
        '<mujoco><default><geom contype="0" conaffinity="0"/></default><worldbody>'
        f'{bodies}<site name="tool"/>{"</body>" * len(parts)}</worldbody></mujoco>'
    )
    return arms.load(path)


def gantry(folder):
    slides = ("1 0 0", "0 2"), ("0 1 0", "0 1"), ("0 0 1", "-0.5 0")
    arm = chain(folder / "gantry.xml", *(("slide", axis, ends, "0 0 0") for axis, ends in slides))
    return workspace(arm, cells=60, samples=100_000)
