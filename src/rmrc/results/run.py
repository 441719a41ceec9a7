"""A run: what it recorded, its figures, and its file."""

import json
import math
from functools import cached_property
from pathlib import Path

import numpy as np

from rmrc.law.task import WORLD_VIEW, View
from rmrc.results.columns import ADDED, COLUMNS, Divergence, Recorded, completed
from rmrc.results.scorecard import Scorecard, scorecard
from rmrc.scenario.profile import Profile
from rmrc.support.files import written_whole


class Run(Recorded):
    """What one world did: `run["qdot_cmd"]` is a column, `run.scorecard["tau.peak"].value` a figure."""

    @cached_property
    def scorecard(self) -> Scorecard:
        """The figures of the run, as far as it came."""
        return scorecard(self)

    def save(self, path: Path) -> None:
        """Write all columns and the facts about them to an npz file, whole or not at all."""
        facts = {
            "name": self.name,
            "joints": self.joints,
            "is_slide": self.is_slide,
            "axes": self.axes,
            "length": self.length,
            "period": self.period,
            "planned": self.planned,
            "divergence": self.divergence and vars(self.divergence),
            "wall_time": self.wall_time,
            "weights": self.weights,
            "touching": self.touching,
            "resting": self.resting,
            "torque_limit": [limit if math.isfinite(limit) else None for limit in self.torque_limit],
            "chatter_floor": self.chatter_floor,
            "units": {name: column.unit for name, column in COLUMNS.items()},
        }
        if self.view.frame != "world":
            facts["view"] = self.view
        if self.profile is not None:
            facts["profile"] = self.profile.model_dump(mode="json")
        with written_whole(path) as temporary, temporary.open("wb") as file:
            np.savez(file, **self.columns, facts=np.array(json.dumps(facts)))  # type: ignore[arg-type]

    @classmethod
    def read(cls, path: Path) -> "Run":
        """Return the run in a file that `save` wrote."""
        with np.load(path, allow_pickle=False) as file:
            facts = json.loads(str(file["facts"]))
            columns = completed({name: file[name] for name in COLUMNS if name in file or name not in ADDED})
        if "tau_gravity" not in columns:
            columns["tau_gravity"] = np.full_like(columns["tau"], math.nan)
        divergence = facts["divergence"] and Divergence(**facts["divergence"])
        # files from before these were kept have neither
        limits = (math.inf if limit is None else limit for limit in facts.get("torque_limit", ()))
        frame, base, free = facts.get("view", WORLD_VIEW)
        view = View(frame, tuple(base), free)
        profile = Profile.model_validate(facts["profile"]) if "profile" in facts else None
        return cls(
            facts["name"], tuple(facts["joints"]), tuple(facts["is_slide"]), tuple(facts["axes"]),
            facts["length"], facts["period"], columns, facts["planned"], divergence,
            facts["wall_time"], tuple(facts.get("weights", ())), tuple(limits), view,
            tuple(facts.get("touching", ())), tuple(map(tuple, facts.get("resting", ()))),
            tuple(facts.get("chatter_floor", ())), profile,
        )  # fmt: skip
