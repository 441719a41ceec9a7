"""What is taken along: a scenario that runs to the same figures, its columns, and its control block."""

from dataclasses import replace
from pathlib import Path

from rmrc.explore.answer import Answer
from rmrc.scenario import block
from rmrc.support.files import written_whole
from rmrc.support.invocation import command

# Of the files; and of the name within, so that to run it leaves alone what the scenario itself left.
SUFFIX, NAMED = ".explore", "-explore"


def save(answer: Answer, folder: Path) -> tuple[Path, Path]:
    """Write NAME.explore.yaml and NAME.explore.npz, each whole or not at all, and return where.

    Args:
        answer: What is saved.
        folder: Made if it is missing.

    Raises:
        OSError: It cannot be written.
    """
    stem = answer.prepared.scenario.name.removesuffix(NAMED)
    scenario = answer.prepared.scenario.set({"name": stem + NAMED})
    said = f"# {answer.prepared.scenario.name} as it was left by `{command('explore')}`"
    told = [f"# {key}: {value}" for key, value in answer.values.items()]
    text = "\n".join([f"{said}; what was changed:" if told else f"{said}, as it was.", *told])
    file, columns = (folder / f"{stem}{SUFFIX}{kind}" for kind in (".yaml", ".npz"))
    replace(answer.run, name=scenario.name).save(columns)
    with written_whole(file) as temporary:
        temporary.write_text(f"{text}\n{scenario.to_yaml()}", "utf-8")
    return file, columns


def control_block(answer: Answer) -> str:
    """Return the section `control` of a setting, without what are defaults, as a scenario has it."""
    control = answer.prepared.scenario.control.model_dump(mode="json", exclude_defaults=True)
    return block({"control": control})
