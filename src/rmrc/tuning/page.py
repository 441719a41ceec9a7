"""`rmrc.report`: the report page of a verb's output, and that of a search."""

import json
from os import PathLike
from pathlib import Path

from rmrc.show import run_page
from rmrc.show.page import Page
from rmrc.show.run_page import versions
from rmrc.study import sweep_page
from rmrc.study.dataset import Left, read_left
from rmrc.support.files import reading
from rmrc.tuning.answer import named, numbers, sheets, words
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
        left = read_left(path)
        return _of_search(left) if "on_front" in left.rows else sweep_page.page(path, left)


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


def _of_search(left: Left) -> Page:
    about = json.loads(left.about)
    rows = [dict(zip(left.rows, row, strict=True)) for row in zip(*left.rows.values(), strict=True)]
    facts, *tables = sheets(about, rows)
    verdict, best = "No tried setting keeps the limits.", next(iter(named(rows)), None)
    if best:
        result = f"{1e3 * best['error']:.3g} mm at a peak rate of {best['peak_rate']:.3g} rad/s"
        verdict = f"Recommended: {words(best)} ({numbers(best)}), with an error of {result}."
    made = Page(f"Tuning of {about['name']}", verdict)
    if best:
        made.section("To paste", "The recommended control section.")
        made.code(about["block"], "Copy the block")
    made.section("Trials")
    made.table(facts)
    if best:
        made.section("Error against peak rate")
        made.figure(front_figure(about["name"], rows), "Settings that keep the limits, and the Pareto front")
    for table in tables:
        made.table(table)
    made.section("Notes")
    made.items(about["lines"])
    made.section("Made with")
    made.table(versions(about["versions"]))
    return made
