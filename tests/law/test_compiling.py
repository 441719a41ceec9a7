"""Machine code: its cache tells the truth and lies where nobody else can write; late methods; threads."""

import ctypes
import os
import shutil
import signal
import subprocess
import sys
import tempfile

import numba
import pytest

from project import ROOT
from rmrc.law import compiling
from rmrc.law.compiling import Method
from rmrc.law.record import new_worlds

PACKAGE = ROOT / "src/rmrc"
NOBODY = 65534
on_posix = pytest.mark.skipif(os.name != "posix", reason="users and modes")

# What it prints: λ of a schedule whose helper is in svd.py, and a gain of a late inverse whose helper is in damping.py.
PROGRAM = """
import ctypes
from rmrc.law.damping import manipulability
from rmrc.law.inverses import filtered
from rmrc.law.record import new_worlds
from rmrc.support.errors import heard_by

worlds = new_worlds(1, 2)
law, first = worlds["law"], worlds["first"]
worlds["k"], first["sigma"][:, :2] = 2, (0.5, 0.25)
law["inverse_damping_maximum"], law["inverse_damping_below"] = 1.0, 0.5
law["inverse_damping_manipulability_below"] = 1.0
records = worlds.ctypes.data, first.ctypes.data
with heard_by(print):
    manipulability.entry(8)(*records)
    late = filtered.address_at_need(8)
    ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)(late)(*records)
print(first["damping"][0], first["gain"][0, 1])
"""
HEARD = "compiling the control law (once; kept for the next time) ..."


def printed(source, cache):
    """Return the lines that the program prints in a new process, with the package in a folder."""
    return subprocess.run(
        [sys.executable, "-c", PROGRAM],
        env=os.environ | {"NUMBA_CACHE_DIR": str(cache), "PYTHONPATH": str(source)},
        capture_output=True, text=True, check=True,
    ).stdout.splitlines()  # fmt: skip


def replace(path, text, by):
    source = path.read_text("utf-8")
    assert source.count(text) == 1
    path.write_text(source.replace(text, by), "utf-8")


def test_the_cache_tells_the_truth(tmp_path):
    """An edit of a helper in another file shows in the next process; without one, it compiles nothing."""
    source, cache = tmp_path / "source", tmp_path / "cache"
    shutil.copytree(PACKAGE, source / "rmrc", ignore=shutil.ignore_patterns("__pycache__"))
    # λ = 1 − 1/8, and σ/(σ² + λ(σ)²) with λ² = 1 − (1/2)²
    before = [HEARD, f"0.875 {0.25 / (0.25**2 + 0.75)}"]
    assert printed(source, cache) == before
    made = {path: path.stat().st_mtime_ns for path in cache.rglob("*.nb[ci]")}
    assert made
    assert printed(source, cache) == before[1:]
    assert {path: path.stat().st_mtime_ns for path in cache.rglob("*.nb[ci]")} == made

    replace(source / "rmrc/law/svd.py", "found = 1.0\n", "found = 2.0\n")
    after = f"0.75 {before[1].split()[1]}"
    assert printed(source, cache) == [HEARD, after]
    replace(
        source / "rmrc/law/damping.py", "return 0.0 if ratio >= 1.0 else", "return 0.0 if ratio >= 0.0 else"
    )
    assert printed(source, cache) == [HEARD, "0.75 4.0"]


def test_the_cache_is_named_after_every_module_with_compiled_functions(tmp_path, monkeypatch):
    shutil.copytree(PACKAGE, tmp_path / "rmrc", ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(compiling, "__file__", str(tmp_path / "rmrc/law/compiling.py"))
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    texts = {path: path.read_text("utf-8") for path in (tmp_path / "rmrc").rglob("*.py")}
    modules = [path for path, text in texts.items() if "@compiled" in text or "@Method" in text]
    assert len(modules) > 20
    first = found_folder()
    for path in [*modules, tmp_path / "rmrc/scenario/choices.py"]:
        path.write_text(texts[path] + "# edited\n", "utf-8")
        assert found_folder() != first, path
        path.write_text(texts[path], "utf-8")
    assert found_folder() == first


# Methods -----------------------------------------------------------------------------------------


def count_joints(world):
    world.rank = world.n + 1


def lack_a_name(world):
    world.rank = missing_function(world)  # noqa: F821 - numba refuses it


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """A cache that is empty."""
    monkeypatch.setattr(compiling, "cache_folder", lambda: tmp_path)
    return tmp_path


def call_at(address, worlds):
    ctypes.CFUNCTYPE(None, ctypes.c_void_p)(address)(worlds.ctypes.data)


def test_a_late_method_is_compiled_when_it_is_called(cache):
    worlds, method = new_worlds(1, 3), Method(count_joints)
    address = method.address_at_need(8)
    assert not list(cache.iterdir())
    for _ in range(2):
        worlds["rank"] = 0
        call_at(address, worlds)
        assert worlds["rank"] == 4
    assert len(list(cache.rglob("*.nbc"))) == 1
    # From now on it needs no call of Python.
    assert method.address_at_need(8) == method.address(8) != address


@pytest.mark.usefixtures("cache")
def test_an_exception_in_a_late_method_is_raised_after_the_call():
    worlds = new_worlds(1, 3)
    compiling.raise_missed()  # nothing is waiting
    call_at(Method(lack_a_name).address_at_need(8), worlds)
    with pytest.raises(numba.TypingError, match="missing_function"):
        compiling.raise_missed()
    compiling.raise_missed()


# Signals -----------------------------------------------------------------------------------------


@on_posix
def test_the_handler_of_a_signal_runs_at_once_and_what_it_raises_is_raised_after_the_work():
    came = []

    def note(number, _):
        came.append(number)
        raise InterruptedError

    @compiling.uninterrupted()
    def work():
        signal.raise_signal(signal.SIGUSR1)
        assert came == [signal.SIGUSR1]
        came.append("done")

    before = signal.signal(signal.SIGUSR1, note)
    try:
        with pytest.raises(InterruptedError):
            work()
        assert came == [signal.SIGUSR1, "done"] and signal.getsignal(signal.SIGUSR1) is note
    finally:
        signal.signal(signal.SIGUSR1, before)


# The folder --------------------------------------------------------------------------------------


@pytest.fixture
def nowhere(monkeypatch, tmp_path):
    """A machine whose HOME cannot be written, and its folder for temporary files."""
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file/cache"))
    folder = tmp_path / "tmp"
    folder.mkdir()
    folder.chmod(0o1777)
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


def found_folder():
    """Return the folder as a new process finds it."""
    return compiling.cache_folder.__wrapped__()


@on_posix
def test_a_folder_of_the_user_is_made_and_used_again(nowhere):
    folder = nowhere / f"rmrc-{os.getuid()}"
    first = found_folder()
    assert first.parent == folder and folder.stat().st_mode & 0o777 == 0o700
    assert found_folder() == first


def test_a_named_folder_comes_first_and_holds_the_latest_sources(monkeypatch, tmp_path):
    named = tmp_path / "named"
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(named))
    for age in range(12):
        (named / f"old{age}").mkdir(parents=True)
        os.utime(named / f"old{age}", (1e9 - age, 1e9 - age))
    folder = found_folder()
    assert set(named.iterdir()) == {folder, *(named / f"old{age}" for age in range(8))}


def plant(folder, way):
    """Make something that others could have made before."""
    if way == "open":
        folder.mkdir()
        folder.chmod(0o770)
    elif way == "link":
        (folder.parent / "theirs").mkdir(mode=0o700)
        folder.symlink_to(folder.parent / "theirs")
    elif way == "file":
        folder.write_text("")
    elif way == "foreign":
        if os.getuid():
            pytest.skip("only root can make folders of others")
        folder.mkdir(mode=0o700)
        os.chown(folder, NOBODY, NOBODY)
    else:  # the folder for temporary files lets anybody rename
        folder.parent.chmod(0o777)


@on_posix
@pytest.mark.parametrize("way", ["open", "link", "file", "foreign", "not sticky"])
def test_what_others_may_have_planted_is_not_used(nowhere, way):
    plant(nowhere / f"rmrc-{os.getuid()}", way)
    with pytest.warns(RuntimeWarning, match="machine code cannot be kept: neither HOME nor "):
        assert found_folder() is None
