"""Where machine code is kept when nothing can be written; what others may plant is never read."""

import importlib.util
import os
import shutil
import subprocess
import sys
import tempfile

import numba
import pytest
from llvmlite import binding
from numba.core import caching

from project import ROOT
from rmrc.law import jit as compiled
from rmrc.law import keeping, kept

pytestmark = pytest.mark.skipif(os.name != "posix", reason="users and modes")
NOBODY = 65534


@pytest.fixture
def tiny(tmp_path):
    """Return a function: -> a new function of a file of its own, small enough to be compiled in a moment."""
    path = tmp_path / "tiny.py"
    path.write_text("def twice(x):\n    return 2 * x\n")

    def fresh():
        spec = importlib.util.spec_from_file_location("tiny", path)
        module = importlib.util.module_from_spec(spec)
        sys.modules["tiny"] = module
        spec.loader.exec_module(module)
        return module.twice

    yield fresh
    sys.modules.pop("tiny", None)


@pytest.fixture
def nowhere(monkeypatch, tmp_path):
    """A machine on which numba finds no place, and its folder for temporary files; root may write anywhere else."""
    monkeypatch.setattr(caching.CacheImpl, "_locator_classes", [caching.UserProvidedCacheLocator])
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    folder = tmp_path / "tmp"
    folder.mkdir()
    folder.chmod(0o1777)
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


@pytest.mark.usefixtures("nowhere")
def test_numba_itself_cannot_start_without_a_place(tiny):
    """Negative control: the fixture is the fault that is mended."""
    with pytest.raises(RuntimeError, match="no locator available"):
        numba.njit(cache=True)(tiny())


def test_a_folder_of_the_users_own_is_made_and_used_again(nowhere, tiny):
    own = nowhere / f"rmrc-{os.getuid()}"
    with pytest.warns(RuntimeWarning) as heard:
        assert compiled.entry(tiny())(21) == 42
    (warning,) = heard
    assert str(warning.message) == (
        f"machine code is kept in {own}, as neither the package nor HOME can be written; "
        "the variable NUMBA_CACHE_DIR names another folder"
    )
    assert own.stat().st_mode & 0o777 == 0o700
    assert len(list(own.rglob("*.nbc"))) == 1
    with pytest.warns(RuntimeWarning):
        again = compiled.entry(tiny())
    assert again(21) == 42
    assert sum(again.stats.cache_hits.values()) == 1  # the next process does not compile
    assert numba.config.CACHE_DIR == ""


def planted(own, kind):
    """Make something that others could have made before."""
    if kind in ("open", "group"):
        own.mkdir()
        own.chmod(0o777 if kind == "open" else 0o770)
    elif kind == "link":
        (own.parent / "theirs").mkdir(mode=0o700)
        own.symlink_to(own.parent / "theirs")
    elif kind == "file":
        own.write_text("")
    elif kind == "foreign":
        if os.getuid():
            pytest.skip("only root can make folders of others")
        own.mkdir(mode=0o700)
        os.chown(own, NOBODY, NOBODY)
    else:  # the folder for temporary files lets anybody rename
        own.parent.chmod(0o777)


@pytest.mark.parametrize("kind", ["open", "group", "link", "file", "foreign", "not sticky"])
def test_what_others_may_have_planted_is_not_used(nowhere, tiny, kind):
    planted(nowhere / f"rmrc-{os.getuid()}", kind)
    with pytest.warns(
        RuntimeWarning, match=r"machine code cannot be kept: not with the package, in HOME or "
    ):
        entry = compiled.entry(tiny())
    assert entry(21) == 42
    assert entry.stats.cache_path is None
    assert list(nowhere.rglob("*.nbc")) == []


def test_who_has_no_home_has_no_cache_in_the_folder_they_are_in(monkeypatch, tmp_path):
    """A user without an entry in passwd has the home `~`, which is a folder like any other."""
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(os.path, "expanduser", lambda path: path)
    with keeping.known_home():
        assert os.environ["XDG_CACHE_HOME"] == os.devnull
    assert "XDG_CACHE_HOME" not in os.environ
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    with keeping.known_home():
        assert os.environ["XDG_CACHE_HOME"] == str(tmp_path)


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
@pytest.mark.parametrize("content", [b"", b"\x80\x04garbage", None])
def test_a_file_that_is_damaged_is_compiled_again(tmp_path, monkeypatch, tiny, suffix, content):
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "cache"))
    assert compiled.entry(tiny())(21) == 42
    (file,) = (tmp_path / "cache").rglob(f"*.{suffix}")
    data = file.read_bytes()
    file.write_bytes(data[: len(data) // 2] if content is None else content)
    assert compiled.entry(tiny())(21) == 42
    healed = compiled.entry(tiny())
    assert healed(21) == 42
    assert sum(healed.stats.cache_hits.values()) == 1


def test_a_full_disk_costs_time_and_no_run(tmp_path, monkeypatch, tiny):
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "cache"))

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(caching.IndexDataCacheFile, "_save_data", full)
    entry = compiled.entry(tiny())
    with pytest.warns(RuntimeWarning, match=r"machine code cannot be kept in .*: no space left on device; "):
        assert entry(21) == 42


@pytest.fixture
def shipped(tmp_path, monkeypatch, tiny):
    """Return the folder of a package's machine code, which stands for any processor like this one."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "builder"))
    entry = compiled.entry(tiny())
    assert entry(21) == 42
    _, name, features = entry.targetctx.codegen().magic_tuple()
    monkeypatch.setattr(kept, "LEVEL", name)
    monkeypatch.setattr(kept, "FEATURES", features)
    (made,) = (tmp_path / "builder").iterdir()
    monkeypatch.setattr(kept, "SHIPPED", tmp_path / "package")
    # numba names the folder by that of the source and a hash of where that is, the package by the first alone
    shutil.copytree(made, tmp_path / "package" / tmp_path.name)
    (tmp_path / "package" / kept.STAMP).write_text(compiled.SOURCES)
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "user"))
    monkeypatch.setattr(binding, "get_host_cpu_features", lambda: dict.fromkeys(kept.NEEDED, True))
    kept.is_served.cache_clear()
    yield tmp_path / "package"
    kept.is_served.cache_clear()


def test_machine_code_of_the_package_is_not_compiled_and_not_kept_again(shipped, tiny):
    entry = compiled.entry(tiny())
    assert entry(21) == 42
    assert sum(entry.stats.cache_misses.values()) == 0
    assert list(shipped.parent.glob("user/**/*.nbc")) == []


@pytest.mark.parametrize("fault", ["sources", "processor", "wish", "torn", "gone", "function"])
def test_machine_code_of_the_package_that_does_not_serve_is_compiled(shipped, tiny, monkeypatch, fault):
    if fault == "sources":
        (shipped / kept.STAMP).write_text("others")
    elif fault == "processor":
        monkeypatch.setattr(binding, "get_host_cpu_features", lambda: dict.fromkeys(kept.NEEDED[1:], True))
    elif fault == "wish":
        monkeypatch.setattr(numba.config, "CPU_NAME", "generic")
        monkeypatch.setattr(numba.config, "CPU_FEATURES", "")
    elif fault == "torn":
        (file,) = shipped.rglob("*.nbc")
        file.write_bytes(file.read_bytes()[:100])
    elif fault == "gone":
        shutil.rmtree(shipped)
    else:
        source = shipped.parent / "tiny.py"
        source.write_text(source.read_text().replace("2 * x", "x + x"))
    entry = compiled.entry(tiny())
    assert entry(21) == 42
    assert sum(entry.stats.cache_misses.values()) == 1
    assert len(list(shipped.parent.glob("user/**/*.nbc"))) == 1


@pytest.fixture
def read_only(tmp_path):
    """(A copy of the package that cannot be written, a folder for temporary files)."""
    package, temporary = tmp_path / "rmrc", tmp_path / "tmp"
    shutil.copytree(ROOT / "src/rmrc", package, ignore=shutil.ignore_patterns("__pycache__"))
    folders = [package, *(path for path in package.rglob("*") if path.is_dir())]
    for path in folders:
        path.chmod(0o555)
    temporary.mkdir()
    temporary.chmod(0o1777)
    yield package, temporary
    for path in folders:
        path.chmod(0o755)


def python(package, temporary, code):
    """Run a program without a home, by one who can write nowhere else: root gives up to write everywhere."""
    modest = []
    if os.getuid() == 0:
        if shutil.which("setpriv") is None:
            pytest.skip("root can write everywhere")
        modest = ["setpriv", "--bounding-set=-dac_override,-dac_read_search"]
    environment = {
        "PATH": os.environ["PATH"], "PYTHONPATH": str(package.parent), "HOME": os.devnull,
        "TMPDIR": str(temporary), "PYTHONDONTWRITEBYTECODE": "1",
    }  # fmt: skip
    command = [*modest, sys.executable, "-c", code]
    return subprocess.run(
        command, env=environment, cwd=temporary, capture_output=True, text=True, check=False
    )


def test_a_read_only_package_without_a_home_can_be_imported(read_only):
    package, temporary = read_only
    ended = python(package, temporary, "import rmrc.law.svd as s; print(s.__file__)")
    assert (ended.returncode, ended.stdout) == (0, f"{package}/law/svd.py\n"), ended.stderr
    assert "RuntimeWarning: machine code is kept in " in ended.stderr.splitlines()[0]
    assert ended.stderr.count("RuntimeWarning: ") == 1
    assert [path.stat().st_mode & 0o777 for path in temporary.iterdir()] == [0o700]


@pytest.mark.long
def test_a_read_only_package_without_a_home_resolves_rates_and_compiles_once(read_only):
    package, temporary = read_only
    code = (
        "import numpy as np, rmrc, rmrc.law.law as law;"
        "print(rmrc.resolve_rates(np.eye(2), np.ones(2), 'inverse'), sum(law.resolve.stats.cache_hits.values()))"
    )
    hits = []
    for _ in range(2):
        ended = python(package, temporary, code)
        assert ended.returncode == 0, ended.stderr
        assert ended.stdout.startswith("[1. 1.] ")
        hits.append(int(ended.stdout.split()[-1]))
    assert hits == [0, 1]
