"""A scenario: YAML checked whole and turned into frozen sections, SI and radians inside.

    file --reading--> plain values --changes--> plain values --sections--> Scenario
                      + their places            (a Draft)                  + schema (rows, JSON Schema)

A document has the plain values and knows where each was given, so every problem on the way has its key, its
text and its origin; `messages` rewords pydantic's errors. `load` and `loads` either return a `Scenario` or
raise one `ScenarioError` with every problem, one per line, sorted by place:

    scenarios/x.yaml:7:13: control.inverse.damping.maximum: must be > 0, got -1

Further reading: `draft` implements the pipeline above, `changes` replaces values, `sections` puts the keys
of `arm`, `task`, `control`, `target`, `plant`, `expect` and `sweep` together, `values` has their common
parts, and `wording` shows values in messages.

Only this package uses YAML and pydantic. A section made directly in Python reports a pydantic error;
a file, a text or a change never does.
"""

from rmrc.scenario.changes import Change, Variant, changes_of, grid, variants
from rmrc.scenario.control import ControlSection, LimitsSection, SecondarySection, TaskSection
from rmrc.scenario.draft import (
    ControlSource,
    Draft,
    Problems,
    Scenario,
    Source,
    draft_of,
    load,
    loads,
    read_controls,
    read_task,
)
from rmrc.scenario.reading import block, inline
from rmrc.scenario.schema import SchemaRow, json_schema, schema_rows
from rmrc.scenario.sections import ArmSection, Check, PlantSection, StartPose
from rmrc.scenario.target import Segment, TargetLimitsSection, TargetSection
from rmrc.scenario.values import Frame, angle

__all__ = [
    "ArmSection", "Change", "Check", "ControlSection", "ControlSource", "Draft", "Frame", "LimitsSection",
    "PlantSection", "Problems", "Scenario", "SchemaRow", "SecondarySection", "Segment",
    "Source", "StartPose", "TargetLimitsSection", "TargetSection", "TaskSection", "Variant", "angle", "block",
    "changes_of", "draft_of", "grid", "inline", "json_schema", "load", "loads", "read_controls",
    "read_task", "schema_rows", "variants",
]  # fmt: skip
