"""Machine code: its cache tells the truth and lies where nobody else can write; late methods; threads."""

import ctypes
import math
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import numba
import pytest

from project import ROOT
from rmrc.law import compiling
from rmrc.law.compiling import Method
from rmrc.law.record import new_worlds
from rmrc.support.notices import heard_by

PACKAGE = ROOT / "src/rmrc"
NOBODY = 65534
on_posix = pytest.mark.skipif(os.name != "posix", reason="users and modes")

# What it prints: λ of a schedule whose helper is in svd.py, and a gain of a late inverse whose helper is in damping.py.
PROGRAM = """
import ctypes
from rmrc.law.damping import manipulability
from rmrc.law.inverses import filtered
from rmrc.law.record import new_worlds
from rmrc.support.notices import heard_by

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
    assert len(modules) > 30
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


@pytest.mark.usefixtures("cache")
def test_threads_share_the_machine_code_of_a_method():
    method, start = Method(count_joints), Barrier(2)

    def address(_):
        start.wait()
        return method.address(8)

    with ThreadPoolExecutor(2) as threads:
        first, second = threads.map(address, range(2))
    assert first == second
    assert Method(count_joints).address(8) != first  # another object makes its own


# Signals -----------------------------------------------------------------------------------------


class AlarmError(Exception):
    """What the handler of a signal raises."""


@pytest.fixture
def alarms():
    """Have SIGALRM raise in the main thread."""

    def ring(*_):
        raise AlarmError

    before = signal.signal(signal.SIGALRM, ring)
    yield ring
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    assert signal.getsignal(signal.SIGALRM) is ring  # the handlers are those of the caller again
    signal.signal(signal.SIGALRM, before)


def spin(world):
    for _ in range(world.m):
        world.tick.time += math.sin(world.tick.time)
    compiling.call(world.methods.give_way, world)


@on_posix
@pytest.mark.usefixtures("cache", "alarms")
def test_a_signal_before_a_late_method_is_compiled_is_raised_after_the_call():
    """It comes while compiled code runs, so its handler runs at the entry of the function that compiles."""
    worlds, loop = new_worlds(1, 3), Method(spin).entry(8)
    worlds["m"] = 20_000_000  # a tenth of a second and more
    for is_held in (True, False):
        worlds["methods"]["give_way"], worlds["rank"] = Method(count_joints).address_at_need(8), 0
        lost = []
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(sys, "unraisablehook", lambda what: lost.append(what.exc_type))  # noqa: B023
            signal.setitimer(signal.ITIMER_REAL, 0.02)
            if is_held:
                with pytest.raises(AlarmError), compiling.uninterrupted():
                    loop(worlds.ctypes.data)
                assert worlds["rank"] == 4 and not lost
            else:  # negative control: it is lost, and so is the call
                loop(worlds.ctypes.data)
                assert worlds["rank"] == 0 and lost == [AlarmError]


@on_posix
def test_a_handler_runs_at_once_and_may_set_another_one():
    came = []

    def note(number, _):
        came.append(number)
        signal.signal(number, signal.SIG_DFL)
        raise AlarmError

    @compiling.uninterrupted()
    def work():
        signal.raise_signal(signal.SIGUSR1)
        assert came == [signal.SIGUSR1]
        with compiling.uninterrupted():  # raises nothing yet
            pass
        came.append("done")

    before = signal.signal(signal.SIGUSR1, note)
    try:
        with pytest.raises(AlarmError):
            work()
        assert came == [signal.SIGUSR1, "done"]
        assert signal.getsignal(signal.SIGUSR1) == signal.SIG_DFL
    finally:
        signal.signal(signal.SIGUSR1, before)


# A process in which nothing is compiled yet forks: each child is interrupted at another moment.
INTERRUPTED = """
import os, signal, sys, time
from rmrc.law import compiling
from rmrc.law.inverses import damped, filtered, truncated
from rmrc.law.record import new_worlds

class AlarmError(Exception): pass

def ring(*_): raise AlarmError

compiling.tell = lambda _: None
signal.signal(signal.SIGALRM, ring)
start = time.monotonic()
pid = os.fork()
if not pid:
    damped.entry(8)
    os._exit(0)
os.waitpid(pid, 0)
took = time.monotonic() - start
failed = []
for k in range(int(sys.argv[1])):
    pid = os.fork()
    if not pid:
        compiling.cache_folder = lambda: None
        signal.setitimer(signal.ITIMER_REAL, (k + 0.5) / int(sys.argv[1]) * took)
        raised = False
        try:
            damped.entry(8)
            time.sleep(10 * took + 1.0)
        except AlarmError:
            raised = True
        try:
            worlds = new_worlds(1, 2)
            worlds["k"], worlds["first"]["sigma"][:, :2] = 2, (0.5, 0.25)
            records = worlds.ctypes.data, worlds["first"].ctypes.data
            for method in damped, truncated, filtered:
                method.entry(8)(*records)
                raised = raised and worlds["first"]["gain"][0, 0] == 2.0
        except BaseException as error:
            print(repr(error)[:200], flush=True)
            os._exit(1)
        os._exit(0 if raised else 1)
    if os.waitpid(pid, 0)[1]:
        failed.append(k)
print(failed)
"""


def interrupted(moments, cache):
    return subprocess.run(
        [sys.executable, "-W", "ignore", "-c", INTERRUPTED, str(moments)],
        env=os.environ | {"NUMBA_CACHE_DIR": str(cache)}, capture_output=True, text=True, check=True,
    )  # fmt: skip


@on_posix
@pytest.mark.parametrize("moments", [4, pytest.param(60, marks=pytest.mark.long)])
def test_a_signal_at_any_moment_of_compiling_leaves_numba_able_to_compile(tmp_path, moments):
    done = interrupted(moments, tmp_path / "cache")
    assert done.stdout == "[]\n", done.stdout + done.stderr
    assert done.stderr == ""


# A controller is interrupted in its first step, and does the next one.
FIRST_STEP = """
import signal, sys
import rmrc

class AlarmError(Exception): pass

def ring(*_): raise AlarmError

signal.signal(signal.SIGALRM, ring)
one = rmrc.Controller("planar_2link", period=0.001)
q, is_raised = one.arm.configuration("home"), False
signal.setitimer(signal.ITIMER_REAL, float(sys.argv[1]))
try:
    one.step(q, twist=[0.1, 0, 0, 0, 0, 0])
except AlarmError:
    is_raised = True
print(is_raised, one.step(q, twist=[0.1, 0, 0, 0, 0, 0]).status.name)
"""


@on_posix
@pytest.mark.long
@pytest.mark.parametrize("moment", [0.1, 1.0, 2.0, 3.3, 5.0])
def test_a_signal_in_the_first_step_leaves_the_next_working(tmp_path, moment):
    done = subprocess.run(
        [sys.executable, "-c", FIRST_STEP, str(moment)], env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)},
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stdout == "True OK\n", done.stderr


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
    if way in ("open", "group"):
        folder.mkdir()
        folder.chmod(0o777 if way == "open" else 0o770)
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
@pytest.mark.parametrize("way", ["open", "group", "link", "file", "foreign", "not sticky"])
def test_what_others_may_have_planted_is_not_used(nowhere, way):
    plant(nowhere / f"rmrc-{os.getuid()}", way)
    with pytest.warns(RuntimeWarning, match="machine code cannot be kept: neither HOME nor "):
        assert found_folder() is None


@on_posix
def test_who_has_no_home_has_no_cache_in_the_folder_they_are_in(nowhere, monkeypatch):
    """A user without an entry in passwd has the home `~`, which is a folder like any other."""
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setattr(os.path, "expanduser", lambda path: path)
    assert found_folder().parent == nowhere / f"rmrc-{os.getuid()}"


def test_without_a_folder_it_is_compiled_and_told(monkeypatch):
    monkeypatch.setattr(compiling, "cache_folder", lambda: None)
    worlds, told = new_worlds(1, 3), []
    with heard_by(told.append):
        Method(count_joints).entry(8)(worlds.ctypes.data)
    assert worlds["rank"] == 4
    assert told == ["compiling the control law (this time and each other time; it cannot be kept) ..."]
