"""The notebooks: they run, hold the sources' numbers, and tell right answers to their exercises from wrong ones."""

import json
import re

import matplotlib.pyplot as plt
import numpy as np
import pytest

import rmrc
from project import ROOT
from rmrc import textbook

NOTEBOOKS = {
    path.stem: json.loads(path.read_text("utf-8")) for path in sorted(ROOT.glob("notebooks/*.ipynb"))
}

SLOW = ("03", "07")  # many runs and sampled workspaces


def mistaken(value):
    """Return an answer that is half as large again, or the opposite."""
    if callable(value):
        return lambda *about: mistaken(value(*about))
    return not value if isinstance(value, bool | np.bool_) else 1.5 * np.asarray(value)


def cells(notebook, kind):
    """Return the sources of the cells of a kind by their ids, in order."""
    return {
        cell["id"]: "".join(cell["source"])
        for cell in NOTEBOOKS[notebook]["cells"]
        if cell["cell_type"] == kind
    }


def solution(notebook, number):
    """Return the code in the collapsed solution of an exercise."""
    text = cells(notebook, "markdown")[f"solution-{number}"]
    (code,) = re.findall(
        r"^<details><summary>Solution</summary>\n\n.*^```python\n(.*?)^```\n\n</details>$", text, re.M | re.S
    )
    return code


@pytest.fixture
def pyplot():
    """Keep what a notebook sets of matplotlib and numpy from other tests, and its figures undrawn."""
    with plt.rc_context(), np.printoptions():
        yield
        plt.close("all")


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_only_public_names_are_used(name):
    code = "\n".join(cells(name, "code").values())
    imported = set(re.findall(r"^(?:from|import) .*$", code, re.M))
    assert imported <= {
        "import matplotlib.pyplot as plt", "import numpy as np", "import rmrc", "from rmrc import textbook"
    }  # fmt: skip
    assert set(re.findall(r"\brmrc\.(\w+)", code)) <= set(rmrc.__all__)
    assert all(hasattr(textbook, name) for name in re.findall(r"\btextbook\.(\w+)", code))


@pytest.mark.usefixtures("pyplot")
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.long] * (name[:2] in SLOW)) for name in NOTEBOOKS]
)
def test_it_runs_from_top_to_bottom_and_tells_right_answers_from_wrong_ones(
    name, capsys, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)  # where no model and no scenario is: they come with the package
    names, exercises = {}, []
    for cell, code in cells(name, "code").items():
        exec(compile(code, f"{name}: {cell}", "exec"), names)
        if cell.startswith("check-"):
            exercises.append(int(cell.removeprefix("check-")))
            assert capsys.readouterr().out == "Not answered yet.\n"
            again, right = compile(code, f"{name}: {cell}", "exec"), dict(names)
            exec(solution(name, exercises[-1]), right)
            answers = {key: value for key, value in right.items() if names.get(key) is not value}
            wrong = right | {key: mistaken(value) for key, value in answers.items() if key != "__builtins__"}
            for inner, verdict in ((right, "Right."), (wrong, "Not right yet. ")):
                exec(again, inner)
                assert capsys.readouterr().out.startswith(verdict), (cell, verdict)
        elif cell.startswith("exercise-"):
            assert "..." in code
        capsys.readouterr()
        plt.close("all")
    assert exercises == [1, 2]
    assert not any(tmp_path.iterdir())
