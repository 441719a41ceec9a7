"""The report page of a sweep: ends of its runs, extremes of its metrics, and a picture."""

import json
from pathlib import Path

from rmrc.show.page import Page
from rmrc.show.run_page import versions
from rmrc.show.sheets import Sheet, number
from rmrc.study.dataset import Left
from rmrc.study.sweep_figure import plot
from rmrc.study.swept import Swept

# Width of the picture [in], and its font size [pt].
WIDTH, LETTERS = 9.6, 9.0


def page(path: Path, left: Left) -> Page:
    """Return the page of a sweep.

    Args:
        path: The `.parquet` file of `sweep`.
        left: Its contents.

    Raises:
        QuestionError: It is another kind of file, or has no rows.
    """
    swept = Swept.of(path, left)
    ends, extremes = swept.sheets()
    complete, count = swept.rows["status"].count("complete"), len(swept.rows["index"])
    page = Page(ends.title, f"{complete} of {count} runs completed the path.")
    page.section("End of the runs")
    page.table(Sheet("", ends.headings, ends.rows))
    page.section("Extremes")
    page.table(extremes)
    page.section("Settings of these runs")
    rows = sorted({i for pair in swept.extremes().values() for i in pair})
    settings = [tuple(_text(swept.rows[key][i]) for key in ("index", *swept.varied)) for i in rows]
    page.table(Sheet("", ("run", *swept.varied), settings))
    if swept.figures:
        page.section("Distributions of the metrics, and the first one over the varied keys")
        page.figure(
            plot(swept, None, width=WIDTH, font=LETTERS), "Number of runs by value, and one dot per run"
        )
    page.section("Made with")
    page.table(versions(json.loads(swept.rows["versions"][0])))
    return page


def _text(value: object) -> str:
    return number(value) if isinstance(value, float) else str(value)
