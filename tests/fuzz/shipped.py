"""The models and scenarios that come with the program, as mutations begin with them."""

import re
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


@cache
def models():
    """Return the texts of the shipped arms by name, sorted, without their comments."""
    paths = sorted((ROOT / "models").glob("*.xml"))
    return {
        path.stem: re.sub(r"<!--.*?-->", "", path.read_text("utf-8"), flags=re.DOTALL).strip()
        for path in paths
    }


@cache
def scenarios():
    """Return the texts of the shipped scenarios by name, sorted."""
    return {path.stem: path.read_text("utf-8") for path in sorted((ROOT / "scenarios").glob("*.yaml"))}


@cache
def model_of(scenario):
    """Return the name of the model that a shipped scenario runs."""
    return re.search(r"models/(\w+)\.xml", scenarios()[scenario])[1]


@cache
def joints(model):
    """Return the names of a model's joints, roughly: of its joint elements that have one."""
    return tuple(dict.fromkeys(re.findall(r'<joint name="([^"]*)"', models()[model])))


@cache
def sites(model):
    """Return the names of a model's sites."""
    return tuple(re.findall(r'<site name="([^"]*)"', models()[model]))


@cache
def bodies(model):
    """Return the names of a model's bodies."""
    return tuple(re.findall(r'<body name="([^"]*)"', models()[model]))
