"""A scenario: YAML checked whole and turned into frozen sections, SI and radians inside.

    file --reading--> plain values --changes--> plain values --sections--> Scenario
                      + their places            (a Draft)                  + schema (rows, JSON Schema)

Every problem on the way has its key, its text and its origin; `messages` rewords pydantic's errors, and
`keys` knows the origin of each value. `load` and `loads` either return a `Scenario` or raise one
`ScenarioError` with every problem, one per line, sorted by place:

    scenarios/x.yaml:7:13: control.inverse.damping.maximum: must be > 0, got -1

Further reading: `draft` implements the pipeline above, `changes` replaces values, `sections` defines the
keys,
`path` those of a path's segments, `values` their common parts, and `wording` the display of values in
messages.

Only this package uses YAML and pydantic. A section made directly in Python reports a pydantic error;
a file, a text or a change never does.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rmrc.scenario.changes import Change, Variant, changes_of
    from rmrc.scenario.controls import Controls, ControlSource, read_controls, read_task
    from rmrc.scenario.draft import Carried, Draft, Problems, Scenario, Source, draft_of, load, loads
    from rmrc.scenario.path import (
        Arc,
        ArcSegment,
        ConfigurationsSegment,
        FileSegment,
        Hold,
        HoldSegment,
        Line,
        LineSegment,
        Motion,
        PathFrame,
        Segment,
        Set,
        SetSegment,
        Tilt,
        TiltSegment,
        Turn,
        TurnSegment,
    )
    from rmrc.scenario.schema import SchemaRow, json_schema, schema_rows
    from rmrc.scenario.sections import (
        ArmSection,
        Check,
        ControlSection,
        EncoderSection,
        FrictionSection,
        InverseSection,
        LimitsSection,
        LookSection,
        NullspaceSection,
        PlantSection,
        ResonanceSection,
        SecondarySection,
        StartPose,
        SweepSection,
        TargetLimitsSection,
        TargetSection,
        TaskSection,
        ToolSection,
        TuneSection,
    )
    from rmrc.scenario.values import Axis, Frame, Section, angle
    from rmrc.scenario.variation import grid, variants
    from rmrc.scenario.wording import block, inline

__all__ = [
    "Arc", "ArcSegment", "ArmSection", "Axis", "Carried", "Change", "Check", "ConfigurationsSegment",
    "ControlSection", "ControlSource", "Controls", "Draft", "EncoderSection", "FileSegment", "Frame",
    "FrictionSection", "Hold",
    "HoldSegment", "InverseSection", "LimitsSection", "Line", "LineSegment", "LookSection", "Motion",
    "NullspaceSection", "PathFrame",
    "PlantSection", "Problems", "ResonanceSection", "Scenario", "SchemaRow", "SecondarySection",
    "Section", "Segment", "Set", "SetSegment", "Source", "StartPose", "SweepSection", "TargetLimitsSection",
    "TargetSection", "TaskSection", "Tilt", "TiltSegment", "ToolSection", "TuneSection", "Turn",
    "TurnSegment", "Variant", "angle", "block", "changes_of", "draft_of", "grid", "inline", "json_schema",
    "load", "loads", "read_controls", "read_task", "schema_rows", "variants",
]  # fmt: skip

if not TYPE_CHECKING:  # type checkers use the imports above, and report names that do not exist
    # In order of dependence: making the sections takes a sixth of a second, which few verbs need to spend.
    _MODULES = (
        "values", "wording", "path", "changes", "sections", "schema", "draft", "controls",
        "variation",
    )  # fmt: skip

    def __getattr__(name):
        """Load a public name from the first module that has it."""
        for module in _MODULES if name in __all__ else ():
            names = vars(import_module(f"{__name__}.{module}"))
            if name in names:
                return globals().setdefault(name, names[name])
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

    def __dir__():
        """Return all names, including those not loaded yet."""
        return sorted({*globals(), *__all__} - {"TYPE_CHECKING", "import_module"})
