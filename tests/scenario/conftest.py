import pytest


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A working directory with a model; no test here loads it."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.xml").write_text("<mujoco/>")
    (tmp_path / "motion.csv").touch()
    return tmp_path
