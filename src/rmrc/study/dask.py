"""The pieces of a study on Dask distributed: `--cluster tcp://HOST:PORT`, or `local:N` worker processes here.

Each worker receives the parcel once and a few hundred bytes per piece, and returns rows as Parquet. Dask
schedules the pieces, and reruns those of a lost worker.
"""

import asyncio
import hashlib
import logging
import platform
import re
import signal
import threading
import time
import warnings
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError, wait
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from importlib import metadata, util
from multiprocessing import resource_tracker
from pathlib import Path
from typing import Any, NamedTuple, cast

from rmrc.results import facts
from rmrc.scenario import inline
from rmrc.study.executors import Crew, Work
from rmrc.study.parcel import Parcel, Unpacked
from rmrc.study.study import Checked
from rmrc.support.errors import ClusterError, RmrcError, ScenarioError

# Timeouts [s]: to reach a scheduler; to have the first workers; until all of them are given up.
_ANSWER, _WORKERS, _GONE = 10.0, 10.0, 60.0
# Seconds between two checks for finished pieces; each worker has a next piece ready.
_MOMENT = 0.02
# Seconds between two checks that results being fetched still exist.
_LOOK = 0.2
# Pieces whose results are fetched at once: tens of megabytes of rows.
_AT_ONCE = 100
# Parcels that a worker keeps, with their models: of this sweep and of the previous one.
_KEPT = 2
_GOES_ON = "the rows so far are kept; rerun the command to resume"
_LOST = f"the scheduler is lost; {_GOES_ON}"
# Loggers that write errors to stderr that are reported here in one line.
_TALKERS = ("distributed", "distributed.client", "tornado.application", "asyncio")


class Address(NamedTuple):
    """Address of the workers.

    Attributes:
        text: The address as given.
        here: Number of processes to start here; 0: connect to a scheduler.
    """

    text: str
    here: int

    @classmethod
    def read(cls, text: str) -> "Address":
        """Return the address of a text.

        Raises:
            ClusterError: The text is not an address, or Dask is not installed.
        """
        local = re.fullmatch(r"local:([1-9]\d{0,3})", text)
        if not (local or re.fullmatch(r"(tcp|tls)://[^\s/]+:\d{1,5}", text)):
            raise ClusterError(
                "--cluster: must be tcp://HOST:PORT or tls://HOST:PORT of a Dask scheduler, or local:N for N "
                f"worker processes on this machine, got {inline(text)}"
            )
        if util.find_spec("distributed") is None:
            raise ClusterError("--cluster: needs Dask, which is not installed: pip install 'rmrc[cluster]'")
        return cls(text, int(local[1]) if local else 0)


class _Sent(NamedTuple):
    """Data and requirements of every worker."""

    parcel: Parcel
    like: Mapping[str, str]


@contextmanager
def opened(address: Address, parcel: Parcel) -> Iterator[Crew]:
    """Yield the workers of a cluster; at the end release them, or end those started here.

    Args:
        address: Their address.
        parcel: Their work.

    Raises:
        ClusterError: It does not respond, has no workers, or they differ from this process.
    """
    from distributed import Client
    from distributed.utils import sync

    with ExitStack() as stack:
        stack.enter_context(_silence())
        loop = stack.enter_context(_loop())
        at: Any = stack.enter_context(_processes(address.here, loop)) if address.here else address.text
        try:
            if not address.here:
                sync(loop, _greet, address.text, callback_timeout=_ANSWER)
            with _deaf(signal.SIGTERM):  # it responds, so this is short; nothing could close half a client
                client = Client(at, timeout=_ANSWER, set_as_default=False, loop=loop)
                stack.callback(_closed, client.close, _ANSWER)
        except TypeError:  # for tls:// without the files that it needs
            told = "needs certificates; set distributed.comm.tls in Dask's configuration"
            raise _refused(address, told) from None
        except (OSError, ValueError, asyncio.CancelledError) as error:
            told = f"no Dask scheduler responds there ({_brief(error)}); start one with `dask scheduler`, "
            raise _refused(address, f"{told}or check for a firewall") from None
        crew = _Cluster(client, address)
        crew.wait_for_workers()
        crew.refuse_unlike()
        crew.send(parcel)
        yield crew


async def _greet(address: str) -> None:
    """Connect to a scheduler with a timeout: the client itself would wait forever for a silent one."""
    from distributed import Security
    from distributed.comm.core import connect

    comm = await connect(address, timeout=_ANSWER, **Security().get_connection_args("client"))
    await comm.close()


class _Cluster:
    """The workers of a cluster."""

    def __init__(self, client: Any, address: Address) -> None:
        self._client, self._address, self._like = client, address, _likeness()
        self._room, self._looked, self._there = 2, 0.0, time.monotonic()

    @contextmanager
    def _reaching(self) -> Iterator[None]:
        """Report a scheduler that no longer responds as lost."""
        try:
            yield
        except RmrcError:
            raise
        except (OSError, RuntimeError):
            raise _refused(self._address, _LOST) from None

    def wait_for_workers(self) -> None:
        patience = _GONE if self._address.here else _WORKERS
        try:
            self._client.wait_for_workers(1, timeout=patience)
        except TimeoutError:
            way_out = "" if self._address.here else f"; start some with `dask worker {self._address.text}`"
            raise _refused(self._address, f"has no workers after {patience:.0f} s{way_out}") from None
        except (OSError, RuntimeError):
            raise _refused(self._address, _LOST) from None

    def refuse_unlike(self) -> None:
        """Refuse workers with missing or different versions, and a scheduler without rmrc."""
        with self._reaching():
            try:
                self._client.run_on_scheduler(metadata.version, "rmrc")
            except metadata.PackageNotFoundError:
                raise _refused(self._address, _nothing("the scheduler")) from None
            # every worker can unpickle it, as it comes with Python
            versions = self._client.run(metadata.version, "rmrc", on_error="return")
            lacking = {name: one for name, one in versions.items() if isinstance(one, Exception)}
            theirs: dict[str, Any] = lacking or self._client.run(_likeness, on_error="return")
        for name, found in theirs.items():
            lacks = isinstance(found, Exception)
            problem = _nothing(f"worker {name}") if lacks else _unlike(name, found, self._like)
            if problem:
                raise _refused(self._address, problem)

    @property
    def room(self) -> int:
        """Number of pieces in progress: two per thread, one running and one ready."""
        now = time.monotonic()
        if now - self._looked > 1.0:
            self._looked = now
            with self._reaching():
                threads = sum(self._client.nthreads(callback_timeout=_ANSWER).values())
            self._there = now if threads else self._there
            if now - self._there > _GONE:
                raise _refused(self._address, f"has had no workers for {_GONE:.0f} s; start some; {_GOES_ON}")
            self._room = max(2, 2 * threads)
        return self._room

    def send(self, parcel: Parcel) -> None:
        self._sent = self.shared(_Sent(parcel, self._like))

    def shared(self, value: object) -> object:
        # A task, not scattered data, which is lost with the only worker that has it.
        return self._client.submit(_same, value, pure=False)

    def submit(self, work: object, pieces: Sequence[range], _: threading.Event) -> Iterable[Any]:
        with self._reaching():
            futures: list[Any] = self._client.map(_work, pieces, sent=self._sent, work=work, pure=False)
        return futures

    def ended(self, running: Mapping[Any, range]) -> Iterator[tuple[Any, Any]]:
        time.sleep(_MOMENT)
        ended = sorted((one for one in running if one.done()), key=lambda one: one.status != "finished")
        for first in range(0, len(ended), _AT_ONCE):
            some = ended[first : first + _AT_ONCE]
            try:
                found = self._gathered(some)
            except (Exception, asyncio.CancelledError):  # each future reports its own error
                found = (self._result(one, running[one]) for one in some)
            if found is None:
                return
            yield from zip(some, found, strict=True)

    def _gathered(self, some: Sequence[Any]) -> Iterable[Any] | None:
        """Return the results of finished pieces, or None if a worker disappeared with some of them.

        Dask itself would wait here until other workers have repeated them, and there may be none.
        """

        async def gather() -> Any:
            return await self._client.gather(some, asynchronous=True)

        fetched = asyncio.run_coroutine_threadsafe(gather(), self._client.loop.asyncio_loop)
        while not wait([fetched], _LOOK).done:
            if not all(one.done() for one in some):
                fetched.cancel()
                return None
        return cast(Iterable[Any], fetched.result())

    def _result(self, future: Any, indices: range) -> Any:
        from distributed import KilledWorker

        which = f"runs {indices.start} to {indices.stop - 1}"
        try:
            return future.result()
        except ClusterError as error:
            raise _refused(self._address, f"{error}; {_GOES_ON}") from None
        except RmrcError:
            raise
        except KilledWorker:
            told = f"{which} ended every worker that started them; check whether it has enough memory"
        except (ImportError, AttributeError) as error:  # on a worker that came later
            self.refuse_unlike()
            told = f"a worker cannot load rmrc ({_brief(error)})"
        except (OSError, MemoryError, CancelledError, asyncio.CancelledError) as error:
            if getattr(future, "status", "") != "error":
                raise _refused(self._address, _LOST) from None
            told = f"a worker could not do {which} ({_brief(error)})"  # such as a full disk there
        raise _refused(self._address, f"{told}; {_GOES_ON}")


def _refused(address: Address, text: str) -> ClusterError:
    return ClusterError(f"--cluster {address.text}: {text}")


def _brief(error: BaseException) -> str:
    """Return another's error on one short line."""
    text = re.sub(r"^in <.*?>: ", "", " ".join(str(error).split())) or type(error).__name__
    return text if len(text) <= 100 else f"{text[:100]} ..."


def _nothing(who: str) -> str:
    package = f"rmrc[cluster]=={metadata.version('rmrc')}"
    return f"{who} has no rmrc; install the same version there: pip install '{package}'"


def _unlike(name: str, theirs: Mapping[str, str], ours: Mapping[str, str]) -> str:
    """Return the differences of a worker from the client, or ""."""
    differ = [
        f"{what} {theirs.get(what, 'none')}, here {own}"
        for what, own in ours.items()
        if theirs.get(what) != own
    ]
    if not differ:
        return ""
    return (
        f"worker {name} has {' and '.join(differ)}: its rows would differ in their bits; install the same "
        "version"
    )


@cache
def _likeness() -> dict[str, str]:
    """Return the properties of this process that determine the bits of a row."""
    folder = Path(__file__).parents[1]
    sources = hashlib.sha256()
    for file in sorted(folder.rglob("*.py")):
        sources.update(file.relative_to(folder).as_posix().encode() + b"\0" + file.read_bytes())
    return {
        **facts.versions("distributed"),
        "processor": platform.machine(),
        "sources of rmrc": sources.hexdigest()[:8],
    }


# On the workers ----------------------------------------------------------------------------------

_unpacking = threading.Lock()
_unpacked: OrderedDict[str, Unpacked] = OrderedDict()


def _same(value: object) -> object:
    return value


def _work(indices: range, sent: _Sent, work: Work[Any]) -> Any:
    """Run a piece, with the models already compiled in this process."""
    from distributed import get_worker

    with _unpacking:
        if sent.parcel.digest not in _unpacked:
            problem = _unlike(get_worker().address, _likeness(), sent.like)
            if problem:
                raise ClusterError(problem)
            # Dask removes it as well, even if this process has no time for it
            _unpacked[sent.parcel.digest] = Unpacked(sent.parcel, get_worker().local_directory)
            while len(_unpacked) > _KEPT:
                _unpacked.popitem(last=False)
        _unpacked.move_to_end(sent.parcel.digest)
        mine = _unpacked[sent.parcel.digest]
    try:
        found = work(mine.study, indices, threading.Event())
    except ScenarioError as error:
        raise ScenarioError(map(mine.told, error.problems)) from None
    if isinstance(found, Checked):
        found.problems = {mine.told(one): many for one, many in found.problems.items()}
    return found


# Processes here ----------------------------------------------------------------------------------


@contextmanager
def _loop() -> Iterator[Any]:
    """Yield the event loop of a thread with Ctrl-C and SIGHUP blocked.

    A terminal sends these signals to all its processes. This thread starts the workers, which inherit the
    blocked signals; this process then ends them.
    """
    from distributed.utils import LoopRunner

    resource_tracker.ensure_running()  # otherwise it would unblock them
    runner = LoopRunner()
    with _deaf():
        runner.start()
    try:
        yield runner.loop
    finally:
        _closed(runner.stop)


@contextmanager
def _processes(count: int, loop: Any) -> Iterator[Any]:
    """Yield a cluster of processes of one thread each on this machine, which end with this one."""
    from distributed import LocalCluster

    with ExitStack() as stack:
        with _deaf(signal.SIGTERM):  # a half-made cluster could not be closed
            cluster = LocalCluster(
                n_workers=0,
                threads_per_worker=1,
                host="127.0.0.1",
                dashboard_address=None,
                silence_logs=logging.CRITICAL,
                memory_limit=None,
                loop=loop,
            )
            stack.callback(_closed, cluster.close, _ANSWER)
        cluster.scale(count)
        yield cluster


@contextmanager
def _deaf(*more: int) -> Iterator[None]:
    """Block Ctrl-C and SIGHUP in this thread until the end, and permanently in processes that it starts.

    Args:
        more: Other signals to block.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGHUP, *more})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _silence() -> Iterator[None]:
    """Keep Dask from logging errors that are reported here in one line, and harmless events."""
    loggers = [logging.getLogger(name) for name in _TALKERS]
    before = [logger.level for logger in loggers]
    with warnings.catch_warnings():
        # This module compares versions itself, and a parcel with large meshes is sent once.
        warnings.filterwarnings("ignore", module="distributed")
        for logger in loggers:
            logger.setLevel(logging.CRITICAL + 1)
        try:
            yield
        finally:
            for logger, level in zip(loggers, before, strict=True):
                logger.setLevel(level)


def _closed(close: Callable[..., object], *arguments: object) -> None:
    """Close an object that may already be lost."""
    with suppress(OSError, RuntimeError, asyncio.CancelledError):
        close(*arguments)
