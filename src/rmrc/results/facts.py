"""The facts of a result, as a JSON file: what came out, of what, and made with which versions."""

import json
import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

from rmrc.results.columns import Divergence
from rmrc.results.run import Run
from rmrc.results.scorecard import Outcome, Scorecard
from rmrc.scenario import Scenario
from rmrc.support.files import written_whole

# What decides the bits and the looks of a result.
LIBRARIES = ("rmrc", "mujoco", "numba", "numpy", "ruckig", "rerun-sdk")


def status_of(divergence: Divergence | None, is_complete: bool, interrupted: bool = False) -> str:
    """Return `complete`, `diverged`, `interrupted`, or `unfinished` for a run whose time was up."""
    if divergence:
        return "diverged"
    if is_complete:
        return "complete"
    return "interrupted" if interrupted else "unfinished"


def run_facts(
    status: str,
    run: Run,
    card: Scorecard,
    outcomes: tuple[Outcome, ...],
    scenario: Scenario,
    assumed: Sequence[str] = (),
) -> dict[str, Any]:
    """Return what is known about one run, ready for strict JSON.

    Args:
        status: How it ended, by `status_of`.
        run: As far as it came.
        card: Its figures.
        outcomes: Of the expectations.
        scenario: That was run.
        assumed: Of its arm, in words.
    """
    return {
        "status": status,
        "divergence": run.divergence and asdict(run.divergence),
        "scorecard": card.nested(),
        "expect": [outcome.facts() for outcome in outcomes],
        "assumed": list(assumed),
        "scenario": scenario.model_dump(mode="json"),
    }


def versions(*more: str) -> dict[str, str]:
    """Return the versions of what decides the bits of a result.

    Args:
        more: Libraries beside those that decide every run.
    """
    return {"python": platform.python_version()} | {lib: version(lib) for lib in (*LIBRARIES, *more)}


def save(path: Path, facts: Mapping[str, Any], *more: str) -> None:
    """Write facts and the versions of the libraries that decide them, whole or not at all.

    Args:
        path: Of the file; its folder is made if needed.
        facts: Strict JSON.
        more: Libraries beside those that decide every run.
    """
    text = json.dumps({**facts, "versions": versions(*more)}, indent=2, ensure_ascii=False, allow_nan=False)
    with written_whole(path) as temporary:
        temporary.write_text(f"{text}\n", "utf-8")
