"""The files that verbs take: of which kind they are, and results, for which a scenario is run first."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from rmrc import scenario as scenarios
from rmrc.cli.console import progress
from rmrc.support.errors import QuestionError
from rmrc.support.shipped import Folder, found
from rmrc.support.text import command, visible

# Kinds of files with their suffixes, and the verb that takes them.
KINDS = {
    "a scenario": ((".yaml", ".yml"), "run"),
    "a model": ((".xml", ".mjcf", ".urdf"), "inspect"),
    "a recording": ((".rrd",), "replay"),
    "a result": ((".npz", ".json", ".parquet"), "report"),
}
SHIPPED: dict[str, Folder] = {"a scenario": "scenarios", "a model": "models"}
# Files of `run` and `compare`, and of `sweep` and `tune`.
OF_RUNS, OF_SEARCHES = (".npz", ".rrd", ".json"), (".parquet",)
PICTURES = (".pdf", ".png", ".svg")


def expect(path: Path, *kinds: str) -> Path:
    """Return the file that a verb was given, unless its suffix is that of another kind, or it is a folder.

    Args:
        path: Or the bare name of a shipped file. It need not exist: the reader reports a missing file best.
        kinds: The kinds that the verb takes.

    Raises:
        QuestionError: It is something else; the message names the verb for it.
    """
    for kind in kinds:
        path = found(path, SHIPPED[kind]) if kind in SHIPPED else path
    wanted = " or ".join(kinds)
    if path.is_dir():
        raise QuestionError(f"{visible(str(path))}: is a folder; give {wanted}")
    for kind, (suffixes, verb) in KINDS.items():
        if path.suffix.lower() in suffixes and kind not in kinds and path.exists():
            way = f"use `{command(verb, path)}`, or give {wanted}"
            raise QuestionError(f"{visible(str(path))}: is {kind}; {way}")
    return path


def suffixed(option: str, path: Path | None, suffixes: Sequence[str]) -> Path | None:
    """Return the path of an option, unless it ends otherwise.

    Raises:
        QuestionError: It has another suffix.
    """
    if path is not None and path.suffix not in suffixes:
        raise QuestionError(f"{option} {visible(str(path))}: must end in {' or '.join(suffixes)}")
    return path


def target(source: Path, output: Path | None, suffixes: Sequence[str]) -> Path:
    """Return the file to write: that of `--output`, or beside a result, or in `recordings` for a scenario.

    Raises:
        QuestionError: It has a suffix that cannot be written.
        OSError: It cannot be written.
    """
    from rmrc.support.files import refuse_unwritable

    folder = source if source.suffix in OF_RUNS + OF_SEARCHES else Path("recordings", source.name)
    file = suffixed("--output", output, suffixes) or folder.with_suffix(suffixes[0])
    refuse_unwritable([file])
    return file


@contextmanager
def result_of(source: Path, overrides: Sequence[str], vary: Sequence[str], quiet: bool) -> Iterator[Path]:
    """Yield the columns of a run, or the rows of a sweep or search; a scenario is run first.

    Args:
        source: A result, or a scenario.
        overrides: `KEY=VALUE` texts, for a scenario.
        vary: `KEY=V1,V2,...` texts, for a scenario: its variants are compared.
        quiet: Whether to show no progress.

    Raises:
        QuestionError: The columns are missing, or a result is to be run otherwise.
        ScenarioError: Lists all problems of the scenario.
    """
    if source.suffix in OF_RUNS + OF_SEARCHES:
        if overrides or vary:
            raise QuestionError(f"{source}: is a finished run whose keys cannot change; give the scenario")
        columns = source if source.suffix in OF_SEARCHES else source.with_suffix(".npz")
        if source.exists() and not columns.exists():
            raise QuestionError(
                f"{visible(str(source))}: {visible(columns.name)}, which has the columns, is missing next to "
                f"it; `{command('run', 'SCENARIO')}` writes both"
            )
        yield columns
        return
    from rmrc.study.run import Job

    with TemporaryDirectory() as folder:
        job = Job(source, folder, False, scenarios.variants(vary) if vary else (), overrides)
        with progress(job.name, sum(world.reference.ticks for world in job.worlds), quiet) as on_ticks:
            job.run(on_ticks)
        if job.interrupted:
            raise KeyboardInterrupt
        yield job.files[0]
