"""Exports of the page: a scenario with the same results, its columns, and its control block."""

from dataclasses import replace
from pathlib import Path

from rmrc.explore.answer import Answer
from rmrc.scenario import block
from rmrc.support.files import written_whole
from rmrc.support.invocation import command

# Endings of the file names and of the scenario's name: a run of it keeps the files of the original.
SUFFIX, NAMED = ".explore", "-explore"


def save(answer: Answer, folder: Path) -> tuple[Path, Path]:
    """Write NAME.explore.yaml and NAME.explore.npz, each whole or not at all, and return their paths.

    Args:
        answer: The answer to save.
        folder: The folder, which is created if it is missing.

    Raises:
        OSError: A file cannot be written.
    """
    stem = answer.prepared.scenario.name.removesuffix(NAMED)
    scenario = answer.prepared.scenario.set({"name": stem + NAMED})
    said = f"# {answer.prepared.scenario.name} as it was left by `{command('explore')}`"
    told = [f"# {key}: {value}" for key, value in answer.values.items()]
    text = "\n".join([f"{said}; changes:" if told else f"{said}, as it was.", *told])
    file, columns = (folder / f"{stem}{SUFFIX}{kind}" for kind in (".yaml", ".npz"))
    replace(answer.run, name=scenario.name).save(columns)
    with written_whole(file) as temporary:
        temporary.write_text(f"{text}\n{scenario.to_yaml()}", "utf-8")
    return file, columns


def control_block(answer: Answer) -> str:
    """Return the section `control` of a setting in the form of a scenario, without defaults."""
    control = answer.prepared.scenario.control.model_dump(mode="json", exclude_defaults=True)
    return block({"control": control})
