"""Workspaces of shipped arms, each found once: several files look at the same ones."""

import functools

import numpy as np

from project import ROOT
from rmrc import arm as arms
from rmrc.analysis.workspace.workspace import workspace


def arm_of(name, site=None):
    return arms.load(ROOT / f"models/{name}.xml", site)


def found(name, site=None, plane=None, through=None, cells=100, samples=20_000, worst=False):
    return _found(name, site, plane, through, cells, samples, worst)


@functools.cache
def _found(name, site, plane, through, cells, samples, worst):
    point = through and np.array(through)
    return workspace(arm_of(name, site), plane, through=point, cells=cells, samples=samples, worst=worst)
