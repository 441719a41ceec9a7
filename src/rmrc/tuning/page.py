"""`rmrc.report`: the report page of a verb's output, and that of a search."""

import json
from os import PathLike
from pathlib import Path

from rmrc.show import run_page
from rmrc.show.page import Page
from rmrc.show.run_page import versions
from rmrc.study import sweep_report
from rmrc.study.dataset import Table, about_of, read_table
from rmrc.study.swept import Swept
from rmrc.support.files import reading
from rmrc.tuning.answer import sheets
from rmrc.tuning.figure import front_figure


def page(path: Path) -> Page:
    """Return the page of a run, a comparison, a sweep or a search.

    Args:
        path: The `.npz` of `run` or `compare`, or the `.parquet` of `sweep` or `tune`.

    Raises:
        OSError: It cannot be read.
        QuestionError: It is another kind of file, or damaged.
    """
    with reading(path, "an output of run, compare, sweep or tune"):
        if path.suffix != ".parquet":
            return run_page.page(path)
        table = read_table(path)
        is_search = "on_front" in table.column_names
        return _of_search(table) if is_search else sweep_report.page(Swept.of(path, table))


def report(result: str | PathLike[str], path: str | PathLike[str] | None = None) -> Path:
    """Write one self-contained HTML page of a verb's output: verdict, metrics, plots, blocks to copy.

    Args:
        result: `NAME.npz` of `run` or `compare`, with its `.json`, `NAME.sweep.parquet` or
            `NAME.tune.parquet`.
        path: The page; None: the path of the result with the suffix `.html`.

    Returns:
        The page.

    Raises:
        OSError: A file cannot be read or written.
        QuestionError: The result is another kind of file, or damaged.
    """
    written = Path(result).with_suffix(".html") if path is None else Path(path)
    page(Path(result)).write(written)
    return written


def _of_search(table: Table) -> Page:
    answer = json.loads(about_of(table))
    facts, *tables = sheets(answer)
    verdict = "No tried setting keeps the limits."
    if answer["named"]:
        best = answer["named"][0]
        verdict = (
            f"Recommended: {best['words']} ({best['numbers']}), with an error of "
            f"{1e3 * best['error']:.3g} mm at a peak rate of {best['peak_rate']:.3g} rad/s."
        )
    made = Page(f"Tuning of {answer['name']}", verdict)
    if answer["block"]:
        made.section("To paste", "The recommended control section.")
        made.code(answer["block"], "Copy the block")
    made.section("Trials")
    made.table(facts)
    if answer["named"]:
        made.section("Error against peak rate")
        made.figure(
            front_figure(answer, table.to_pylist()), "Settings that keep the limits, and the Pareto front"
        )
    for sheet in tables:
        made.table(sheet)
    made.section("Notes")
    made.items(answer["lines"])
    made.section("Made with")
    made.table(versions(answer["versions"]))
    return made
