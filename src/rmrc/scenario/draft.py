"""A scenario and its source: plain values from a file, options or Python, validated as a whole.

A change is validated locally: only the sections on the way to its value are rebuilt. A refused change is
validated again as a whole, so that all messages have one source.
"""

import copy
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache, cached_property, reduce
from pathlib import Path
from typing import Any, NamedTuple, Self, TypeAlias

from pydantic import PrivateAttr, ValidationError

from rmrc.scenario.changes import Change, Unread, applied, changes_of, put, read_change, read_setting
from rmrc.scenario.keys import SourceMap, in_order, split
from rmrc.scenario.messages import translate
from rmrc.scenario.profile import SHIPPED
from rmrc.scenario.reading import Document, TextError, parse, read
from rmrc.scenario.sections import (
    PROFILE,
    ControlSection,
    SecondarySection,
    Sections,
    TaskSection,
    is_section,
    parse_key,
)
from rmrc.scenario.values import Section
from rmrc.scenario.wording import block, show
from rmrc.support import shipped
from rmrc.support.brief import cut
from rmrc.support.errors import ScenarioError
from rmrc.support.problems import Key, Origin, Problem, join

# Changes that a draft keeps apart from its source: as many as a variant has.
_MOST_CHANGES = 100


def _nothing() -> "Draft":
    return Draft(Document({}, SourceMap()))


class Scenario(Sections):
    """All inputs of a run: frozen, validated, in SI units and radians.

    >>> one = load("scenarios/line_tracking.yaml")
    >>> [one.set({"plant.payload": mass}).plant.payload for mass in (0.5, 2)]
    [0.5, 2.0]
    """

    _draft: "Draft" = PrivateAttr(default_factory=_nothing)

    def __repr__(self) -> str:
        """Return its keys and values, as many as fit on a screen."""
        return cut(super().__repr__())

    @property
    def draft(self) -> "Draft":
        """Its source; for one made in Python, its own values."""
        if not self._draft.is_something:
            self._draft = Draft(Document(self.model_dump(mode="json"), SourceMap()))
        return self._draft

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Return a copy as pydantic makes it; a copy with other values counts as made in Python."""
        found = super().model_copy(update=update, deep=deep)
        if update:
            found._draft = _nothing()
        return found

    def locate(self, key: str) -> str:
        """Return where a key was given, as the start of a message.

        Args:
            key: A dotted key, such as `control.inverse.damping.maximum`, `arm.start[1]` or
                `expect.joint_rate.peak`.

        Returns:
            Where its value starts, counted from 1, or its nearest parent if it is absent, as
            `scenarios/x.yaml:7:13: control.inverse.damping.maximum`; `--set KEY` if it was set
            so; the key alone if the scenario was made in Python.
        """
        return self._draft.document.sources.locate(parse_key(key))

    def problem(self, key: str, text: str) -> Problem:
        """Return the problem of a value, with the place where it was given.

        Args:
            key: Of the value, dotted.
            text: The problem in words.
        """
        return self._draft.document.sources.problem(parse_key(key), text)

    def changed(self, *changes: Change) -> "Scenario":
        """Return the scenario with other values; later changes win.

        Raises:
            ScenarioError: Lists all problems at once.
        """
        draft = self.draft.changed(*changes)
        try:
            found: Scenario = _changed(self, _tree(changes), draft.context)
        except (_RefusedError, TextError, ValidationError):
            return draft.scenario()
        found._draft = draft
        return found

    def fitted(self, length: float, control: ControlSection) -> "Scenario":
        """Return the scenario with the numbers that come from its arm; its source stays as it is written."""
        task = self.task.model_copy(update={"length": length})
        found = self.model_copy(update={"task": task, "control": control})
        found._draft = self._draft
        return found

    def set(self, values: Mapping[str, object]) -> "Scenario":
        """Return the scenario with other values: `scenario.set({"control.feedback": 40})`.

        Args:
            values: By dotted key, such as `arm.start[1]`, each as a file would have it.

        Raises:
            ScenarioError: Lists all problems at once.
            ValueError: A key is not valid.
        """
        return self.changed(*changes_of(values))

    @property
    def baseline_changes(self) -> tuple[Change, ...]:
        """Changes that make its baseline; empty without one.

        Sections are merged with its own; any other mapping replaces the existing one. Deeper keys come later.
        """
        if not self.baseline:
            return ()
        sources, found = self._draft.document.sources, list[Change]()

        def add(values: Mapping[str, Any], at: Key, written: Key) -> None:
            for name, value in values.items():
                key, place = (*at, *split(name)), (*written, name)
                if isinstance(value, Mapping) and is_section(key):
                    add(value, key, place)
                else:
                    told = sources.origin(place).of(join(("baseline", *key)))
                    found.append(Change(key, value, Origin(told, key=join(key))))

        add(self.baseline, (), ("baseline",))
        accepted = {name: check for name, check in self.expect.items() if name == PROFILE}
        own = Change(("expect",), accepted), Change(("baseline",), {})
        return (*sorted(found, key=lambda one: len(one.key)), *own)

    def to_yaml(self) -> str:
        """Return the complete scenario as it runs: all defaults, SI numbers, an absolute path.

        `rmrc.scenario.loads` reads it back to an equal scenario.
        """
        return block(self.model_dump(mode="json"), width=80)


class Carried(NamedTuple):
    """Replacements for the files of a scenario on a machine without them.

    Attributes:
        folder: Where its file was.
        models: Files that stand for models and recorded motions, and folders for those of packages, by the
            names that the scenario has for them.
    """

    folder: Path
    models: Mapping[str, Path] = {}


def _motions(value: Any) -> Iterator[Any]:
    """Yield the paths of recorded motions in values of `target`."""
    if isinstance(value, dict):
        file = value.get("file")
        if isinstance(file, dict) and "path" in file:
            yield file["path"]
    inner = value.values() if isinstance(value, dict) else value if isinstance(value, list | tuple) else ()
    for one in inner:
        yield from _motions(one)


def _profiles(value: Any) -> Iterator[str]:
    """Yield the names of profiles in values of `control` and `expect`."""
    if isinstance(value, dict) and isinstance(value.get(PROFILE), str):
        yield value[PROFILE]
    inner = value.values() if isinstance(value, dict) else value if isinstance(value, list | tuple) else ()
    for one in inner:
        yield from _profiles(one)


class Draft:
    """Values of a scenario and their origins; they may be invalid, and changes may correct them.

    Any two compare equal: the source of a scenario does not affect its meaning.
    """

    def __init__(
        self, document: Document, files: Carried | None = None, changes: Sequence[Change] = ()
    ) -> None:
        """Keep the values.

        Args:
            document: The values as written.
            files: Locations of its files; None: paths start at the working directory, and files are not
                checked until they are used.
            changes: Changes applied to it.
        """
        self._written, self._files, self._changes = document, files, tuple(changes)

    def __eq__(self, other: object) -> bool:
        """Return whether the other is a draft as well."""
        return isinstance(other, Draft)

    __hash__ = None  # type: ignore[assignment]

    @cached_property
    def document(self) -> Document:
        """The values with all changes."""
        return reduce(applied, self._changes, self._written)

    @property
    def is_something(self) -> bool:
        """Whether there are any values."""
        return bool(self._written.value or self._changes)

    @property
    def source(self) -> str:
        """Name of the file in messages; "" without one."""
        return self._written.sources.source

    @property
    def folder(self) -> Path:
        """Where relative paths start."""
        return self._files.folder if self._files else Path()

    @property
    def context(self) -> Mapping[str, Any] | None:
        """Validation context with the files."""
        return self._files and self._files._asdict()

    @property
    def models(self) -> list[str]:
        """The names of all models that the draft and its sweep have; it is one without mistakes."""
        data = self.document.value
        vary = (data.get("sweep") or {}).get("vary") or {}
        arms = [data["arm"], *vary.get("arm", ())]
        names = [*(arm["model"] for arm in arms if "model" in arm), *vary.get("arm.model", ())]
        tools = [*(arm.get("tool") for arm in arms), *vary.get("arm.tool", ())]
        held = [tool["model"] for tool in tools if tool and tool.get("model")] + list(
            vary.get("arm.tool.model", ())
        )
        return list(dict.fromkeys(map(str, filter(None, [*names, *held]))))

    @property
    def packages(self) -> list[dict[str, str]]:
        """The folders of packages that its arms and its sweep have, by their names; as `models`."""
        data = self.document.value
        vary = (data.get("sweep") or {}).get("vary") or {}
        arms = [data["arm"], *vary.get("arm", ())]
        given = [*(arm.get("packages") for arm in arms), *vary.get("arm.packages", ())]
        inner = [
            (name.removeprefix("arm.packages."), vary[name])
            for name in vary
            if name.startswith("arm.packages.")
        ]
        given += [{name: folder} for name, folders in inner for folder in folders]
        return [{name: str(folder) for name, folder in one.items()} for one in given if one]

    @property
    def motions(self) -> list[str]:
        """The names of all recorded motions that the draft and its sweep have; it is one without mistakes."""
        data = self.document.value
        vary = (data.get("sweep") or {}).get("vary") or {}
        swept = [values for name, values in vary.items() if name.startswith("target")]
        names = [file for values in (data["target"], *swept) for file in _motions(values)]
        names += [one for name in vary if name.endswith(".file.path") for one in vary[name]]
        return list(dict.fromkeys(map(str, names)))

    @property
    def profiles(self) -> list[str]:
        """The names of all files of profiles that the draft and its sweep have; as `motions`."""
        data = self.document.value
        vary = (data.get("sweep") or {}).get("vary") or {}
        told = [data.get("control"), data.get("expect")]
        told += [values for name, values in vary.items() if name.startswith(("control", "expect"))]
        names = [one for values in told for one in _profiles(values)]
        names += [one for name in vary if name.endswith(f".{PROFILE}") for one in vary[name] if one]
        return [name for name in dict.fromkeys(names) if name not in SHIPPED]

    def files(self) -> tuple[Path, ...]:
        """Return all files and folders that the draft and its sweep name; it is one without mistakes."""
        return tuple(dict.fromkeys(self._places().values()))

    def moved(self, root: Path) -> "Draft":
        """Return the draft with each file /a/b at root/a/b."""
        places = {name: root / path.relative_to(path.anchor) for name, path in self._places().items()}
        return self.carried(Carried(self.folder, places))

    def _places(self) -> dict[str, Path]:
        folders = [folder for some in self.packages for folder in some.values()]
        names = [*self.models, *self.motions, *self.profiles, *folders]
        return {name: (self.folder / name).resolve() for name in names}

    def carried(self, files: Carried) -> "Draft":
        """Return the draft with files at other locations."""
        return Draft(self._written, files, self._changes)

    def changed(self, *changes: Change) -> "Draft":
        """Return the draft with other values; later changes win."""
        base = self if len(self._changes) < _MOST_CHANGES else Draft(self.document, self._files)
        return Draft(base._written, base._files, (*base._changes, *changes))

    def overridden(self, texts: Iterable[str]) -> "Draft":
        """Return the draft with `KEY=VALUE` texts of `--set`."""
        return self.changed(*map(read_setting, texts))

    def given(self, key: str, text: str, option: str) -> "Draft":
        """Return the draft with the value of an option that has a key of its own.

        Args:
            key: The key that the option changes, such as `sweep.vary.control.feedback`.
            text: The value as YAML.
            option: Name of the key in messages, such as `--vary control.feedback`.
        """
        steps = parse_key(key)
        return self.changed(read_change(steps, text, Origin(option, key=join(steps))))

    def values(self) -> dict[str, Any]:
        """Return a copy of the values: plain data, unchecked."""
        return dict(copy.deepcopy(self.document.value))

    def scenario(self) -> Scenario:
        """Return the scenario.

        Raises:
            ScenarioError: Lists all problems at once.
        """
        document = self.document
        problems = document.problems
        try:
            found = Scenario.model_validate(
                document.value, context=self.context, by_alias=True, by_name=False
            )
        except ValidationError as error:
            problems = problems + translate(error, document.sources, Scenario)
        if problems:
            raise ScenarioError(in_order(problems))
        found._draft = self
        return found


class Problems:
    """Problems of a scenario, collected so that one error reports all of them."""

    def __init__(self, scenario: Scenario) -> None:
        """Begin with none."""
        self._scenario, self._found = scenario, list[Problem]()

    def add(self, key: str, text: str) -> None:
        """Add the problem of a value; the key is dotted."""
        self._found.append(self._scenario.problem(key, text))

    def extend(self, found: Iterable[tuple[str, str]]) -> None:
        """Add problems of several values: a dotted key and a text each."""
        for key, text in found:
            self.add(key, text)

    def raise_any(self) -> None:
        """Raise the collected problems, if any.

        Raises:
            ScenarioError: With all of them.
        """
        if self._found:
            raise ScenarioError(self._found)


Source: TypeAlias = Scenario | Draft | str | os.PathLike[str]
"""A scenario, its file, or the name of a shipped one."""


def draft_of(source: Source, overrides: Iterable[str] = ()) -> Draft:
    """Return a draft: of a file, of a scenario, or a draft itself.

    Args:
        source: The YAML file, which messages show as given; or a scenario or a draft.
        overrides: `KEY=VALUE` texts that replace values, such as `control.inverse.method=inverse` or
            `arm.start[1]=10 deg`; VALUE is YAML.

    Raises:
        ScenarioError: There is no such file, or its text cannot be used.
    """
    if isinstance(source, Draft):
        return source.overridden(overrides)
    if isinstance(source, Scenario):
        return source.draft.overridden(overrides)
    name = os.fspath(shipped.found(source, "scenarios"))
    try:
        text = read(name)
    except TextError as error:
        raise ScenarioError([error.problem(name)]) from None
    return Draft(document_of(text, name), Carried(_absolute(Path(name).parent))).overridden(overrides)


def load(path: str | os.PathLike[str], overrides: Iterable[str] = ()) -> Scenario:
    """Read a scenario from a file.

    Args:
        path: The YAML file; messages show it as it is given.
        overrides: As in `draft_of`.

    Returns:
        The checked scenario; `arm.model` is absolute.

    Raises:
        ScenarioError: With all mistakes at once.
    """
    return draft_of(path, overrides).scenario()


def loads(text: str, source: str = "<text>", overrides: Iterable[str] = ()) -> Scenario:
    """Read a scenario from a text; relative paths start at the working directory.

    Args:
        text: The YAML text.
        source: Its name in messages.
        overrides: As in `draft_of`.

    Returns:
        The checked scenario.

    Raises:
        ScenarioError: With all mistakes at once.
    """
    return Draft(document_of(text, source), Carried(_absolute(Path()))).overridden(overrides).scenario()


def _absolute(folder: Path) -> Path:
    """Return a folder as an absolute path, because a scenario may change long after it was read."""
    try:
        return folder.absolute()
    except OSError:  # the working directory is gone
        return folder


def document_of(text: str, source: str) -> Document:
    """Return the values of a YAML text, which is a mapping.

    Raises:
        ScenarioError: It cannot be read, or is not a mapping.
    """
    try:
        document = parse(text, source)
    except TextError as error:
        raise ScenarioError([error.problem(source)]) from None
    if not isinstance(document.value, dict):
        wrong = document.sources.problem((), f"must be a mapping of keys, got {show(document.value)}")
        raise ScenarioError(in_order(document.problems) or [wrong])
    return document


# Changes of sections that are there ----------------------------------------------------------------


class _RefusedError(Exception):
    """A change cannot be made of the sections alone."""


class _Tree(dict[str | int, Any]):
    """New values below a section: each is a value, or another tree."""


# Keys that a section sorts together, so that none can be changed without the others as they were written.
_TOGETHER: Mapping[type, frozenset[str]] = {
    TaskSection: frozenset(("axes", "weights")),
    SecondarySection: frozenset(("axes", "to")),
}


def _tree(changes: Sequence[Change]) -> _Tree:
    root = _Tree()
    for key, value, _, _ in changes:
        if isinstance(value, Unread):
            raise _RefusedError
        at = root
        for depth, step in enumerate(key[:-1], 1):
            below = at.setdefault(step, _Tree())
            if not isinstance(below, _Tree):  # a key within a value that was changed before
                at[step] = put(below, key, value, depth)
                break
            at = below
        else:
            if isinstance(at.get(key[-1]), _Tree):  # the replaced value may still be refused
                raise _RefusedError
            at[key[-1]] = value
    return root


def _changed(node: Any, tree: _Tree, context: Mapping[str, Any] | None) -> Any:
    """Return a node with new values in it; sections on the way are checked again, others stay as they are."""
    items: Any
    if isinstance(node, Section):
        if isinstance(node, ControlSection) and _is_of_profile(node, tree):
            raise _RefusedError
        if not _TOGETHER.get(type(node), frozenset()).isdisjoint(tree):
            raise _RefusedError
        items = {alias: node.__dict__[name] for alias, name in _names(type(node))}
        items = {alias: value for alias, value in items.items() if value is not None}
    elif isinstance(node, tuple):
        items = dict(enumerate(node))
        if not items.keys() >= tree.keys():
            raise _RefusedError
    elif isinstance(node, dict | None):
        items = dict(node or {})
    else:
        raise _RefusedError
    for step, below in tree.items():
        items[step] = _changed(items.get(step), below, context) if isinstance(below, _Tree) else below
    if isinstance(node, Section):
        return type(node).model_validate(items, context=context, by_alias=True, by_name=False)
    return list(items.values()) if isinstance(node, tuple) else items


def _is_of_profile(control: ControlSection, tree: _Tree) -> bool:
    """Whether a change sets a key of a profile, and thus depends on the keys written beside it."""
    if control.limits.profile is not None:
        return not tree.keys().isdisjoint(("limits", "period"))
    limits = tree.get("limits")
    return isinstance(limits, dict) and PROFILE in limits


@cache
def _names(kind: type[Section]) -> tuple[tuple[str, str], ...]:
    """Return the keys of a section and the names of their fields."""
    return tuple((field.alias or name, name) for name, field in kind.model_fields.items())
