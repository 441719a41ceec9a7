"""The notebooks: they run, hold the sources' numbers, and tell right answers to their exercises from wrong ones."""

import ast
import json
import re

import matplotlib.pyplot as plt
import numpy as np
import pytest

import rmrc
from project import ROOT, mostly_long
from rmrc import textbook

NOTEBOOKS = {
    path.stem: json.loads(path.read_text("utf-8")) for path in sorted(ROOT.glob("notebooks/*.ipynb"))
}

# A typical mistake for each exercise: a transpose, a sign, an inverse in its place, another unit.
MISTAKES = {
    "01_moving_frames": (
        "def omega_of(R, t, h=1e-5):\n"
        "    S = R(t).T @ (R(t + h) - R(t - h)) / (2 * h)\n"  # along the axes that turn
        "    return np.array([S[2, 1], S[0, 2], S[1, 0]])",
        "beta_deg = np.arcsin(0.1)",
    ),
    "02_jacobian_and_frames": (
        "def hinge_and_slide(q):\n"
        "    r, c, s = 1 + q[1], np.cos(q[0]), np.sin(q[0])\n"
        "    return np.array([[-r * s, c], [r * c, s], [1, 1]])",  # the slide turns the link
        "def moved(J, P):\n    return np.vstack([J[:3] - np.cross(J[3:].T, P).T, J[3:]])",
    ),
    "03_singularities_and_workspace": (
        "best_elbow_deg = 180",
        "def is_singular(J, tolerance=1e-9):\n    return np.linalg.det(J @ J.T) <= tolerance",
    ),
    "04_statics_and_duality": (
        "def holding_torques(J, wrench):\n    return J.T @ wrench",
        "free_force_deg = 120",
    ),
    "05_redundancy_and_null_space": (
        "def cheapest(J, w):\n    return np.linalg.pinv(J)",
        "rates_at_rest = [0.1, 0, 0]",
    ),
    "06_screws": (
        "def hinge_screw(axis, point):\n    return np.concatenate([axis, np.cross(axis, point)])",
        "def moved_screw(screw, R, t):\n    return np.concatenate([R @ screw[:3], R @ screw[3:] + t])",
    ),
    "07_newton_and_errors": (
        "def newton_step(q, goal):\n    return q + np.linalg.solve(J(q), k(q) - goal)",
        "largest_error = 0.001 * 2",
    ),
    "08_whitney_through_a_singularity": (
        "def damped_rates(J, twist, damping):\n"
        "    return J.T @ np.linalg.solve(J @ J.T + damping * np.eye(len(J)), twist)",
        "least_damping = 0.1",
    ),
}  # fmt: skip


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


def test_there_is_one_for_each_chapter_and_each_is_in_the_lists():
    assert [name[:2] for name in NOTEBOOKS] == [f"{i:02}" for i in range(1, 9)]
    for page in ("notebooks/README.md", "docs/textbook.md"):
        listed = re.findall(
            r"^\| \[[^]]+\]\((?:\.\./notebooks/)?(\w+)\.ipynb\)", (ROOT / page).read_text("utf-8"), re.M
        )
        assert listed == list(NOTEBOOKS), page


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_only_public_names_are_used(name):
    tree = ast.parse("\n".join(cells(name, "code").values()))
    imported = {
        (getattr(node, "module", None), alias.name)
        for node in ast.walk(tree)
        if isinstance(node, ast.Import | ast.ImportFrom)
        for alias in node.names
    }
    assert imported <= {
        (None, "numpy"), (None, "matplotlib.pyplot"), (None, "rmrc"), ("rmrc", "textbook")
    }  # fmt: skip
    asked = [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name)
    ]
    assert {node.attr for node in asked if node.value.id == "rmrc"} <= set(rmrc.__all__)
    assert all(hasattr(textbook, node.attr) for node in asked if node.value.id == "textbook")
    assert not any(node.attr.startswith("_") for node in ast.walk(tree) if isinstance(node, ast.Attribute))


@pytest.mark.usefixtures("pyplot")
@pytest.mark.parametrize("name", mostly_long(NOTEBOOKS, 2))
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
            again = compile(code, f"{name}: {cell}", "exec")
            for answer, verdict in (
                (solution(name, exercises[-1]), "Right."),
                (MISTAKES[name][exercises[-1] - 1], "Not right yet. "),
            ):
                inner = dict(names)
                exec(answer, inner)
                exec(again, inner)
                assert capsys.readouterr().out.startswith(verdict), (cell, verdict)
        elif cell.startswith("exercise-"):
            assert "..." in code
        capsys.readouterr()
        plt.close("all")
    assert exercises == [1, 2]
    assert not any(tmp_path.iterdir())


@pytest.mark.long
@pytest.mark.parametrize("name", NOTEBOOKS)
def test_jupyter_runs_it_and_shows_each_figure_once_without_a_warning(name, tmp_path):
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    notebook = nbformat.read(ROOT / f"notebooks/{name}.ipynb", as_version=4)
    nbformat.validate(notebook)
    nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": tmp_path}}).execute()
    for cell in notebook.cells:
        shown = cell.get("outputs", [])
        assert [one.text for one in shown if one.get("name") == "stderr"] == []
        pictures = [one for one in shown if "image/png" in one.get("data", {})]
        assert len(pictures) == ("plt.show()" in cell.source or ".plot(panels=" in cell.source)
