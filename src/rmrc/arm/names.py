"""Names of the elements of a compiled model, for messages, and checks that they are fit for these."""

import unicodedata
from pathlib import Path
from typing import Any, NamedTuple

import mujoco

from rmrc.support.errors import ModelError

# These characters end lines and pages too, or reverse the direction of the rest of a line.
_CONTROLS = frozenset("\u2028\u2029\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")
_SHOWN = 40


class Kind(NamedTuple):
    """A kind of element in MuJoCo's arrays.

    Attributes:
        word: Word in messages, as in MJCF.
        body: Field with the body of each; "" for kinds without bodies.
    """

    word: str
    body: str = ""


# By the prefix of their fields.
KINDS = {
    "body": Kind("body"),
    "jnt": Kind("joint", "jnt_bodyid"),
    "geom": Kind("geom", "geom_bodyid"),
    "site": Kind("site", "site_bodyid"),
    "cam": Kind("camera", "cam_bodyid"),
    "light": Kind("light", "light_bodyid"),
    "flex": Kind("flex"),
    "mesh": Kind("mesh"),
    "skin": Kind("skin"),
    "hfield": Kind("hfield"),
    "tex": Kind("texture"),
    "mat": Kind("material"),
    "pair": Kind("contact pair"),
    "exclude": Kind("contact exclude"),
    "eq": Kind("equality"),
    "tendon": Kind("tendon"),
    "actuator": Kind("actuator"),
    "sensor": Kind("sensor"),
    "numeric": Kind("numeric"),
    "text": Kind("text"),
    "tuple": Kind("tuple"),
    "key": Kind("key"),
    "plugin": Kind("plugin"),
}


def count(model: mujoco.MjModel, kind: str) -> int:
    """Return how many elements of a kind a model has."""
    return len(_addresses(model, kind))


def called(model: mujoco.MjModel, kind: str, i: int) -> str:
    """Return an element in words: `joint "elbow"`, or `geom 3 of body "arm"` for an unnamed one.

    Args:
        model: A model with checked names.
        kind: Prefix of its fields.
        i: Its number.
    """
    word, body = KINDS[kind]
    name = _name(bytes(model.names), _addresses(model, kind)[i]).decode()
    if name:
        return f'{word} "{_cut(name)}"'
    return f"{word} {i}" + (f" of {called(model, 'body', int(getattr(model, body)[i]))}" if body else "")


def check(path: Path, model: mujoco.MjModel) -> None:
    """Check that all names are plain text, safe to print on a terminal and to write into files.

    Raises:
        ModelError: One has a control character, or is no UTF-8.
    """
    names = bytes(model.names)
    try:
        if not any(_controls(each) for each in set(names.decode()) - {"\0"}):
            return
    except UnicodeDecodeError:
        pass
    for kind, (word, _) in KINDS.items():
        for i, address in enumerate(_addresses(model, kind)):
            _check_name(path, f"{word} {i}", _name(names, address))
    _check_name(path, "the model itself", _name(names, 0))


def _check_name(path: Path, element: str, name: bytes) -> None:
    shown = _cut(repr(name.decode("utf-8", "backslashreplace"))[1:-1])
    try:
        control = next((each for each in name.decode() if _controls(each)), "")
    except UnicodeDecodeError:
        raise ModelError(f'{path}: the name of {element} must be UTF-8, got "{shown}"; rename it') from None
    if control:
        what = f'must have no control character, got U+{ord(control):04X} in "{shown}"; rename it'
        raise ModelError(f"{path}: the name of {element} {what}")


def _controls(character: str) -> bool:
    return character in _CONTROLS or unicodedata.category(character) in ("Cc", "Cs")


def _cut(name: str) -> str:
    return name if len(name) <= _SHOWN else f"{name[: _SHOWN - 3]}..."


def _addresses(model: Any, kind: str) -> list[int]:
    """Return where the names of a kind begin among all names."""
    addresses: list[int] = getattr(model, f"name_{kind}adr").tolist()
    return addresses


def _name(names: bytes, address: int) -> bytes:
    return names[address : names.index(b"\0", address)]
