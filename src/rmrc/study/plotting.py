"""`rmrc.plot`: the picture of a verb's output or result."""

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path

from matplotlib.figure import Figure

from rmrc.results.run import Run, read_runs
from rmrc.show.plot import plot as plot_runs
from rmrc.study import sweep_report
from rmrc.study.dataset import Table
from rmrc.study.swept import Swept
from rmrc.support.errors import QuestionError
from rmrc.support.legible import quoted


def plot(
    result: Run | Mapping[str, Run] | Table | str | PathLike[str],
    path: str | PathLike[str] | None = None, panels: Sequence[str] = (),
    width: float = 7.16, font: float = 8.0,
) -> Figure:  # fmt: skip
    """Draw a run, several side by side, or a sweep; the function behind `rmrc plot`.

    Args:
        result: A run; runs by label, as `compare` returns them; the rows that `sweep` returns; or the file of
            either, `NAME.npz` or `NAME.sweep.parquet`.
        path: File to write atomically: `.png`, `.svg` or `.pdf`; None: no file.
        panels: Panels among path, rates, sigma, error, torque, pace, status and g, in this order from the
            top; for a sweep, distributions and keys; none: all that have data.
        width: Width of the figure [in]: 3.5 and 7.16 are one and two columns of a journal.
        font: Font size [pt].

    Returns:
        The figure, which a notebook shows.

    Raises:
        OSError: A file cannot be read or written.
        QuestionError: The file is of another kind, or damaged; or it has no data to draw.
    """
    to = None if path is None else Path(path)
    if isinstance(result, str | PathLike):
        file = Path(result)
        result = Swept.of(file) if file.suffix == ".parquet" else read_runs(file)
    elif not isinstance(result, Run | Mapping):
        result = Swept.of(Path("the table"), result)
    if isinstance(result, Swept):
        return sweep_report.plot(result, to, panels, width, font)
    runs = {result.name: result} if isinstance(result, Run) else result
    for label, run in runs.items():
        if not len(run):
            raise QuestionError(f"{quoted(label)} has no ticks to draw")
    return plot_runs(runs, to, panels, width, font)
