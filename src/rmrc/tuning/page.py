"""`rmrc.report`: the report page of a verb's output."""

from os import PathLike
from pathlib import Path

from rmrc.show import run_page
from rmrc.show.page import Page
from rmrc.study import sweep_page
from rmrc.study.dataset import read_left
from rmrc.support.files import reading
from rmrc.tuning import tune_page


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
        return tune_page.page(path, left) if "on_front" in left.rows else sweep_page.page(path, left)


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
