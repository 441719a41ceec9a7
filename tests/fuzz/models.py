"""Models: shipped ones with attributes, elements, names and bytes changed, and what is asked about them."""

import re
import xml.etree.ElementTree as ET
from xml.sax.saxutils import escape

from rmrc.scenario.choices import PLANTS

from . import shipped
from .case import Case
from .vocabulary import ATTRIBUTES, ELEMENTS

PATH = "models/fuzz.xml"
FILE = f"../{PATH}"

NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", re.ASCII)


def generate(chance):
    """Return a case: a model with something wrong with it, and a question or a run."""
    name = chance.pick(list(shipped.models()))
    if chance.odds(0.12):
        data = chance.scratch(shipped.models()[name].encode())
    elif chance.odds(0.03):
        data = _monster(chance).encode("utf-8", "surrogatepass")
    else:
        root = ET.fromstring(shipped.models()[name])
        for _ in range(chance.weighted({1: 5, 2: 3, 3: 1, 6: 1})):
            _mutate(chance, root, name)
        data = _text(chance, root).encode("utf-8", "surrogatepass")
        if chance.odds(0.03):
            data = chance.scratch(data)
    return _asked(chance, name, data)


def _asked(chance, name, data):
    """Return what is asked about a model."""
    sites = [*shipped.sites(name), "more"]
    verb = chance.weighted(
        {
            "inspect": 62,
            "run": 14,
            "statics": 8,
            "ik": 8,
            "hold": 2,
            "compare": 1,
            "sweep": 2,
            "workspace": 0.7,
            "all": 2,
        }
    )
    asked = {
        "inspect": ["inspect", FILE, *chance.pick(([], [], ["--json"], ["--json"], ["--joint-error", "0.01", "--wrench", "1,2,3"]))],
        "statics": ["statics", FILE, "--wrench", "1,2,3,4,5,6", *chance.pick(([], ["--json"], ["--gravity"]))],
        "hold": ["statics", FILE, "--wrench", "0,0,1", "--hold", "0.2", *chance.pick(([], ["--json"]))],
        "ik": ["ik", FILE, "--to", "0.5,0.5", *chance.pick(([], ["--json"], ["--axes", "x,y"], ["--no-limits"]))],
        "all": ["ik", FILE, "--to-q", ",".join(["0.3"] * chance.between(1, 6)), "--all"],
        "workspace": ["workspace", FILE, "--cells", "10", "--samples", "1000", "-q"],
    }.get(verb)  # fmt: skip
    files = {PATH: data}
    if asked is None:
        plant = chance.pick((*PLANTS.names, PLANTS.default))
        files["scenarios/fuzz.yaml"] = (
            f"name: fuzz\narm: {{model: {FILE}, site: {chance.pick(sites)}}}\n"
            f"control: {{period: 0.002, limits: {{rate: 3.0}}}}\n"
            f"target: {{path: [{{line: {{by: [0.001, 0, 0.001]}}}}, {{hold: {{for: 0.005}}}}]}}\n"
            f"plant: {{kind: {plant}}}\n"
        ).encode()
        more = {
            "run": chance.pick(([], ["--no-record"], ["--no-record"], ["--no-record"])),
            "compare": ["--no-record", "--vary", "control.feedback=1,2"],
            "sweep": ["--threads", "1", "--vary", "control.feedback=1,2"],
        }[verb]
        asked = [verb, "../scenarios/fuzz.yaml", *more]
    elif chance.odds(0.2) and "--site" not in asked:
        asked += ["--site", chance.pick(sites)]
    return Case(tuple(asked), files)


def _mutate(chance, root, name):
    chance.weighted(_KINDS)(chance, root, name)


def _elements(root):
    return list(root.iter())


def _parents(root):
    return [(parent, child) for parent in root.iter() for child in parent]


def _with_attributes(chance, root):
    return chance.pick([element for element in root.iter() if element.attrib])


def _change_value(chance, root, _):
    """Give an attribute, or a number of it, another value."""
    element = _with_attributes(chance, root)
    key = chance.pick(sorted(element.attrib))
    parts = element.attrib[key].split()
    numbers = [i for i, part in enumerate(parts) if NUMBER.fullmatch(part)]
    if numbers and chance.odds(0.5):  # another arm, and no worse than the one before
        at, factor = chance.pick(numbers), chance.pick((0.5, 0.9, 1.1, 2.0, -1.0, 0.0))
        parts[at] = repr(float(parts[at]) * factor)
        element.set(key, " ".join(parts))
    elif numbers and chance.odds(0.6):
        parts[chance.pick(numbers)] = chance.number()
        element.set(key, " ".join(parts))
    elif numbers and chance.odds(0.5):
        scale = chance.pick((0.0, -1.0, 1e-9, 1e-3, 10.0, 1e3, 1e9, 1e150, 1e300))
        element.set(
            key, " ".join(repr(float(part) * scale) if i in numbers else part for i, part in enumerate(parts))
        )
    elif chance.odds(0.5):
        element.set(key, " ".join(parts * chance.between(2, 4)) if chance.odds(0.5) else " ".join(parts[:-1]))
    else:
        element.set(key, chance.word())


def _extreme(chance, root, _):
    """Give an attribute that means something here an extreme value."""
    element = chance.pick([one for one in root.iter() if one.tag in ATTRIBUTES])
    known = ATTRIBUTES[element.tag]
    key = chance.pick(list(known))
    element.set(key, chance.pick(known[key]) if chance.odds(0.6) else chance.number())


def _drop_attribute(chance, root, _):
    element = _with_attributes(chance, root)
    del element.attrib[chance.pick(sorted(element.attrib))]


def _foreign_attribute(chance, root, _):
    """Give an element an attribute of another, or one that does not exist."""
    known = ATTRIBUTES[chance.pick(list(ATTRIBUTES))]
    key = chance.pick(list(known)) if chance.odds(0.7) else "nonsense"
    chance.pick(_elements(root)).set(key, chance.word())


def _rename(chance, root, _):
    """Give something another name; sometimes wherever it is named."""
    named = [
        (one, key)
        for one in root.iter()
        for key in ("name", "joint", "class", "site", "model", "file")
        if key in one.attrib
    ]
    element, key = chance.pick(named)
    before, after = element.attrib[key], chance.name()
    if chance.odds(0.5):
        element.set(key, after)
        return
    for one in root.iter():
        for other, value in one.attrib.items():
            if value == before:
                one.set(other, after)


def _retag(chance, root, _):
    chance.pick(_elements(root)).tag = chance.pick(
        sorted(ATTRIBUTES) if chance.odds(0.7) else ("frame", "freejoint", "nonsense", "motor")
    )


def _remove(chance, root, _):
    parent, child = chance.pick(_parents(root))
    parent.remove(child)


def _repeat(chance, root, _):
    parent, child = chance.pick(_parents(root))
    for _ in range(chance.weighted({1: 8, 2: 2, 40: 1})):
        parent.append(child)


def _move(chance, root, _):
    parent, child = chance.pick(_parents(root))
    own = set(map(id, child.iter()))
    parent.remove(child)
    others = [one for one in root.iter() if id(one) not in own] or [root]
    chance.pick(others).append(child)


def _exchange(chance, root, _):
    """Exchange two elements of one parent."""
    parent, child = chance.pick(_parents(root))
    parent.remove(child)
    parent.insert(chance.under(len(parent) + 1), child)


def _add(chance, root, name):
    """Add an element, in the section that it belongs to, or in a body."""
    where, text = chance.pick(ELEMENTS)
    joints = shipped.joints(name) or ("none",)
    for word, options in (
        ("JOINT", joints),
        ("OTHER", joints),
        ("BODY", shipped.bodies(name)),
        ("SITE", shipped.sites(name)),
    ):
        text = text.replace(word, chance.pick(options))
    text = text.replace("SELF", "fuzz.xml")
    places = [one for one in root.iter() if one.tag == where]
    if not places:
        places = [ET.SubElement(root, where)]
    place = root if where == "mujoco" else chance.pick(places)
    # Control characters are not for this parser; they are written as they are.
    added = ET.fromstring(text.replace("\x1b", "ESC"))
    for one in added.iter():
        for key, value in one.attrib.items():
            one.set(key, value.replace("ESC", "\x1b"))
    place.insert(chance.under(len(place) + 1), added)


def _retype(chance, root, _):
    """Make a joint another kind of joint."""
    joints = [one for one in root.iter() if one.tag in ("joint", "freejoint")]
    if joints:
        chance.pick(joints).set("type", chance.pick(("slide", "hinge", "ball", "free")))


def _deepen(chance, root, _):
    """Put an element into many of its kind."""
    parent, child = chance.pick(_parents(root))
    parent.remove(child)
    tag = chance.pick(("body", "body", "frame", child.tag, "default"))
    for _ in range(chance.weighted({1: 4, 5: 4, 60: 2, 300: 0.3})):
        parent = ET.SubElement(parent, tag)
    parent.append(child)


def _list_long(chance, root, _):
    """Make a list of numbers far too long, or a text."""
    element = _with_attributes(chance, root)
    key = chance.pick(sorted(element.attrib))
    element.set(
        key, " ".join([chance.number()] * chance.pick((10, 100, 1000))) if chance.odds(0.7) else "x" * 20_000
    )


_KINDS = {
    _change_value: 40, _extreme: 22, _drop_attribute: 5, _foreign_attribute: 3, _rename: 8, _retag: 2, _remove: 6, _repeat: 4,
    _move: 4, _exchange: 2, _add: 20, _retype: 4, _deepen: 2, _list_long: 2,
}  # fmt: skip


def _monster(chance):
    """Return a text that is small but grows, or is deep, or is no model at all."""
    count = chance.pick((100, 1000, 20_000))
    return chance.pick(
        (
            "<mujoco><worldbody>" + "<body><joint/><geom size='1'/>" * min(count, 1000) + "</body>" * min(count, 1000) + "</worldbody></mujoco>",
            "<mujoco><worldbody>" + "<body>" * count + "<site name='tip'/>" + "</body>" * count + "</worldbody></mujoco>",
            "<mujoco>" + "<default class='a'>" * count + "</default>" * count + "</mujoco>",
            '<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]><mujoco model="&b;"/>',
            "<mujoco/>", "", " ", "<", "<mujoco", "<mujoco></mujoc>", "[]", "name: fuzz", "\0" * count, "<a/>" * count,
            "<mujoco><worldbody>" + "<geom size='1'/>" * min(count, 1000) + "<site name='tip'/></worldbody></mujoco>",
            "<mujoco><worldbody><body><joint axis='0 0 1'/><geom size='1' mass='1'/><site name='tip'/></body></worldbody></mujoco>",
            "<mujoco><worldbody><replicate count='1000000000'><geom size='1'/></replicate></worldbody></mujoco>",
            "<mujoco><worldbody><replicate count='1000'><replicate count='1000'><geom size='1'/></replicate></replicate></worldbody></mujoco>",
            "<mujoco><include file='fuzz.xml'/></mujoco>", "<mujocoinclude/>", "<mujoco model='" + "x" * count + "'/>",
            "<robot name='r'><link name='a'/></robot>", "<mujoco>" + "<!-- " * count, "<?xml version='1.0' encoding='utf-16'?><mujoco/>",
        )
    )  # fmt: skip


def _text(chance, root):
    """Write a tree as it is: no parser need like its names."""
    raw = chance.odds(0.5)
    parts = []

    def write(element):
        parts.append(f"<{element.tag}")
        parts.extend(f' {key}="{_quoted(value, raw)}"' for key, value in element.attrib.items())
        if len(element):
            parts.append(">")
            for child in element:
                write(child)
            parts.append(f"</{element.tag}>\n")
        else:
            parts.append("/>\n")

    write(root)
    return "".join(parts)


def _quoted(value, raw):
    text = escape(value, {'"': "&quot;"})
    if raw:
        return text
    return re.sub("[\x00-\x1f\x7f-\x9f]", lambda found: f"&#{ord(found[0])};", text)
