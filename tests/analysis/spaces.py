"""Workspaces of shipped arms, each found once: several files look at the same ones."""

import functools

from project import ROOT
from rmrc import arm as arms
from rmrc.analysis.workspace.workspace import workspace


def arm_of(name, site=None):
    return arms.load(ROOT / f"models/{name}.xml", site)


@functools.cache
def found(name, site=None, plane=None, cells=100, samples=200_000):
    return workspace(arm_of(name, site), plane, cells=cells, samples=samples)
