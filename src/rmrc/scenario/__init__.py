"""A scenario: YAML checked whole and turned into frozen sections, SI and radians inside.

    file --reading--> plain values --overrides--> plain values --sections--> Scenario
                      + their places                                + schema (rows, JSON Schema)

Every mistake on the way is kept with its key; what pydantic finds is put into our words by `messages`,
and `places` says where each key stands. So `load` and `loads` either return a `Scenario` or raise one
`ScenarioError` with every mistake, a line each, sorted by place:

    scenarios/x.yaml:7:13: control.inverse.damping.maximum: must be > 0, got -1

To read on: `sections` has the keys, `path` those of the segments of a path, `values` what both are made
of, and `wording` how messages show values.

This package alone knows YAML and pydantic. A section made directly in Python reports a pydantic error;
a file or a text never does.
"""

import copy
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import ValidationError

from rmrc.scenario.aliases import place_of
from rmrc.scenario.keys import Mistake, Origin
from rmrc.scenario.messages import translate
from rmrc.scenario.overrides import override
from rmrc.scenario.path import (
    Arc,
    ArcSegment,
    Hold,
    HoldSegment,
    Line,
    LineSegment,
    Segment,
    Turn,
    TurnSegment,
)
from rmrc.scenario.reading import Document, TextError, parse, read
from rmrc.scenario.schema import SchemaRow, block, inline, json_schema, schema_rows
from rmrc.scenario.sections import (
    ArmSection,
    Check,
    ControlSection,
    DampingSection,
    EncoderSection,
    InverseSection,
    LimitsSection,
    NullspaceSection,
    PlantSection,
    Scenario,
    SecondarySection,
    SlowSection,
    StopSection,
    SweepSection,
    TargetLimitsSection,
    TargetSection,
    TaskSection,
)
from rmrc.scenario.values import Axis, Section, angle
from rmrc.scenario.variation import Variant, variants
from rmrc.scenario.wording import show
from rmrc.support.errors import ScenarioError
from rmrc.support.shipped import found

__all__ = [
    "Arc", "ArcSegment", "ArmSection", "Axis", "Carried", "Check", "ControlSection", "DampingSection",
    "EncoderSection", "Hold", "HoldSegment", "InverseSection", "LimitsSection", "Line", "LineSegment",
    "NullspaceSection", "PlantSection", "Scenario", "SchemaRow", "SecondarySection", "Section", "Segment",
    "SlowSection", "StopSection", "SweepSection", "TargetLimitsSection", "TargetSection", "TaskSection",
    "Template", "Turn", "TurnSegment", "Variant", "angle", "block", "inline", "json_schema", "load", "loads",
    "place_of", "schema_rows", "variants",
]  # fmt: skip


def load(
    path: str | os.PathLike[str],
    overrides: Sequence[str] = (),
    varied: Sequence[str] = (),
) -> Scenario:
    """Read a scenario from a file.

    Args:
        path: The YAML file; messages show it as it is given.
        overrides: `KEY=VALUE` texts that replace values of the file, such as
            `control.inverse.method=inverse` or `arm.start[1]=10 deg`; VALUE is YAML.
        varied: The same of one `Variant`, put on top.

    Returns:
        The checked scenario; `arm.model` is absolute.

    Raises:
        ScenarioError: With all mistakes at once.
    """
    return Template(found(path, "scenarios"), overrides).scenario(varied)


def loads(text: str, source: str = "<text>", overrides: Sequence[str] = ()) -> Scenario:
    """Read a scenario from a text; relative paths start at the working directory.

    Args:
        text: The YAML text.
        source: What messages call it.
        overrides: As in `load`.

    Returns:
        The checked scenario.

    Raises:
        ScenarioError: With all mistakes at once.
    """
    return _scenario(_document(text, source, overrides), Path(), {})


class Carried(NamedTuple):
    """What stands for the files of a scenario where these are not.

    Attributes:
        text: Of the scenario.
        folder: Where its file was.
        models: Files that stand for the models, by the names that the scenario has for them.
    """

    text: str
    folder: Path
    models: Mapping[str, Path]


class Template:
    """A scenario's file, read once, of which any number of variants are made.

    Attributes:
        text: Of the file.

    >>> template = Template("scenarios/line_tracking.yaml", ["control.feedback=5"])
    >>> [template.scenario([f"plant.payload={mass}"]).plant.payload for mass in (0.5, 2)]
    [0.5, 2.0]
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        overrides: Sequence[str] = (),
        carried: Carried | None = None,
    ) -> None:
        """Read the file; what is wrong with its values is told by `scenario`.

        Args:
            path: The YAML file; messages show it as it is given.
            overrides: As in `load`; they hold for all variants.
            carried: What is read instead of the file.

        Raises:
            ScenarioError: There is no such file, or its text cannot be used.
        """
        source = os.fspath(path)
        self._folder = carried.folder if carried else Path(source).parent
        self._models = carried.models if carried else {}
        self.text = carried.text if carried else _text(source)
        self._document = _document(self.text, source, overrides)

    @property
    def models(self) -> list[str]:
        """The names of all models that the file and its sweep have; the file is one without mistakes."""
        data = self._document.value
        vary = (data.get("sweep") or {}).get("vary") or {}
        arms = [data["arm"], *vary.get("arm", ())]
        names = [*(arm["model"] for arm in arms if "model" in arm), *vary.get("arm.model", ())]
        return list(dict.fromkeys(map(str, names)))

    def scenario(self, varied: Sequence[str] = ()) -> Scenario:
        """Return a variant: what `load` returns for the same texts.

        Args:
            varied: `KEY=VALUE` texts of one `Variant`.

        Raises:
            ScenarioError: With all mistakes at once.
        """
        return _scenario(self._varied(varied), self._folder, self._models)

    def written(self, varied: Sequence[str] = ()) -> dict[str, Any]:
        """Return what is written, with the overrides and those of a variant: plain data, unchecked.

        Args:
            varied: As in `scenario`.
        """
        return dict(copy.deepcopy(self._varied(varied).value))

    def _varied(self, varied: Sequence[str]) -> Document:
        document = self._document
        for text in varied:
            document = override(document, text, "--vary")
        return document


def _text(source: str) -> str:
    try:
        return read(source)
    except TextError as error:
        raise ScenarioError(Origin(source).lines([Mistake((), str(error), error.mark)])) from None


def _document(text: str, source: str, overrides: Sequence[str]) -> Document:
    try:
        document = parse(text, source)
    except TextError as error:
        raise ScenarioError(Origin(source).lines([Mistake((), str(error), error.mark)])) from None
    if not isinstance(document.value, dict):
        no_mapping = Mistake((), f"must be a mapping of keys, got {show(document.value)}")
        raise ScenarioError(document.origin.lines(document.mistakes or [no_mapping]))
    for override_text in overrides:
        document = override(document, override_text)
    return document


def _scenario(document: Document, folder: Path, models: Mapping[str, Path]) -> Scenario:
    mistakes = document.mistakes
    try:
        context = {"folder": folder, "models": models}
        scenario = Scenario.model_validate(document.value, context=context, by_alias=True, by_name=False)
    except ValidationError as error:
        mistakes = mistakes + translate(error, document)
    if mistakes:
        raise ScenarioError(document.origin.lines(mistakes))
    scenario._origin = document.origin
    return scenario
