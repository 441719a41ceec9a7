"""Verdicts never say what the columns deny: of all shipped scenarios in test_scenarios.py, of other runs here."""

import dataclasses

from rmrc.results.columns import Divergence
from rmrc.results.scorecard import warnings
from rmrc.scenario.choices import Status
from shipped import shipped
from verdicts import denied

RUN = shipped("approach_singularity")


def test_a_verdict_tells_how_far_a_run_came():
    half = {name: column[: len(RUN) // 2] for name, column in RUN.columns.items()}
    cut = dataclasses.replace(RUN, columns=half)
    diverged = dataclasses.replace(cut, divergence=Divergence(3, 0.003, "elbow", "too fast"))
    for run in (cut, diverged):
        assert denied(run.verdict, run) == []
        assert set(denied(RUN.verdict, run)) & {"end", "share", "divergence"}
    nothing = dataclasses.replace(RUN, columns={name: column[:0] for name, column in half.items()})
    assert nothing.verdict == "Ended before the first tick was recorded."


def test_events_are_told_in_a_line_each_unless_they_are_expected():
    status = RUN["status"].copy()
    status[:] = 0
    status[5:20] = Status.STUCK | Status.CONTACT | Status.TORQUE_LIMITED | Status.SLIPPED
    limits = {"torque_limit": (1.0,) * len(RUN.joints), "touching": ("link", "floor")}
    run = dataclasses.replace(RUN, columns={**RUN.columns, "status": status}, **limits)
    lines = list(warnings(run.scorecard, ()))
    assert [line.split(": ")[1] for line in lines] == ["STUCK", "CONTACT", "TORQUE_LIMITED", "SLIPPED"]
    assert "contact.first_bodies link – floor" in lines[1] and all("expect" in line for line in lines)
    assert (
        list(
            warnings(
                run.scorecard, ["stuck.longest", "contact.time", "torque_limited.time", "status_time.SLIPPED"]
            )
        )
        == []
    )
