"""The runs of a sweep on Dask: `--cluster tcp://HOST:PORT`, or `local:N` worker processes here.

Each worker gets the parcel once, and returns rows. Dask distributes the runs, and repeats those of a lost
worker.
"""

import asyncio
import logging
import re
import signal
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager, suppress
from importlib import util
from multiprocessing import resource_tracker
from pathlib import Path
from threading import Event, Lock
from typing import Any

from rmrc.scenario import inline
from rmrc.study.runs import Parcel, Rows, Runs
from rmrc.support import process
from rmrc.support.errors import ClusterError
from rmrc.support.text import shortened

# Seconds: to reach a scheduler; without a worker until they are given up; between two looks for a stop.
_ANSWER, _GONE, _LOOK = 10.0, 30.0, 0.2
_RESUME = "finished rows are kept; rerun the command to resume"


def refuse(address: str) -> None:
    """Refuse an address of no cluster.

    Raises:
        ClusterError: The text is not an address, or Dask is not installed.
    """
    if not re.fullmatch(r"local:[1-9]\d{0,3}|(tcp|tls)://[^\s/]+:\d{1,5}", address):
        forms = "tcp://HOST:PORT or tls://HOST:PORT of a Dask scheduler, or local:N for N processes here"
        raise ClusterError(f"--cluster: must be {forms}, got {inline(address)}")
    if util.find_spec("distributed") is None:
        raise ClusterError("--cluster: needs Dask, which is not installed: pip install 'rmrc[cluster]'")


def results(address: str, parcel: Parcel, pieces: Sequence[Sequence[int]], stop: Event) -> Iterator[Rows]:
    """Yield the rows of pieces as they finish; after a stop, none.

    Args:
        address: Address of the cluster.
        parcel: Inputs of the runs.
        pieces: Indices of the runs.
        stop: Event that ends the work.

    Raises:
        ClusterError: It does not respond, has no workers, or is lost.
    """
    from distributed import as_completed
    from distributed.comm.core import CommClosedError

    problem = ""
    with ExitStack() as stack:
        try:
            client = stack.enter_context(_client(address))
        except Exception as error:  # whatever Dask raises
            problem = f"no Dask scheduler responds there ({_reason(error)}); start `dask scheduler`"
            raise ClusterError(f"--cluster {address}: {problem}, or check for a firewall") from None
        try:
            # a task, not scattered data, which is lost with the only worker that has it
            sent = client.submit(lambda parcel: parcel, parcel, pure=False)
            tasks = [client.submit(_work, sent, sent.key, piece, pure=False) for piece in pieces]
            finished, seen = as_completed(tasks, client.loop), time.monotonic()
            del tasks  # so that rows are freed once they are yielded
            while finished.count() and not stop.wait(_LOOK):
                for task in finished.next_batch(block=False):
                    yield task.result()
                    seen = time.monotonic()
                seen = time.monotonic() if client.nthreads() else seen
                if time.monotonic() - seen > _GONE:
                    problem = f"no workers for {_GONE:.0f} s; start `dask worker {address}`"
                    break
        except (CancelledError, CommClosedError):
            problem = "the scheduler is lost"
        except Exception as error:  # whatever a worker raises
            problem = f"a run failed ({_reason(error)})"
    if problem:
        raise ClusterError(f"--cluster {address}: {problem}; {_RESUME}")


def _reason(error: Exception) -> str:
    """Return an error on one short line."""
    return shortened(" ".join(f"{type(error).__name__}: {error}".split()), 320)


@contextmanager
def _client(address: str) -> Iterator[Any]:
    """Yield a client of a scheduler, or of processes of one thread each here, which end with this one."""
    from distributed import Client, LocalCluster

    with ExitStack() as stack:
        logging.disable()  # Dask logs what is reported here in one line
        stack.callback(logging.disable, logging.NOTSET)
        place: Any = address
        if address.startswith("local:"):
            with ExitStack() as masked:
                if hasattr(signal, "pthread_sigmask"):  # signals of a terminal, not for the workers
                    resource_tracker.ensure_running()  # which would unblock them
                    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGHUP})
                    masked.callback(signal.pthread_sigmask, signal.SIG_SETMASK, before)
                place = LocalCluster(
                    n_workers=int(address.removeprefix("local:")), threads_per_worker=1, host="127.0.0.1",
                    dashboard_address="127.0.0.1:0", silence_logs=logging.CRITICAL, memory_limit=None,
                )  # fmt: skip
            stack.callback(_close, place)
        else:
            asyncio.run(_greet(address))
        client = Client(place, timeout=_ANSWER, set_as_default=False)
        stack.callback(_close, client)
        yield client


async def _greet(address: str) -> None:
    """Connect to a scheduler with a timeout: the client itself would wait forever for a silent one."""
    from distributed import Security
    from distributed.comm.core import connect

    opened = connect(address, timeout=_ANSWER, **Security().get_connection_args("client"))
    await (await asyncio.wait_for(opened, _ANSWER)).close()


def _close(opened: Any) -> None:
    """Close a client or a cluster, which may be lost."""
    with suppress(OSError, RuntimeError, CancelledError):
        opened.close(_ANSWER)


# On the workers ----------------------------------------------------------------------------------

_unpacking, _runs = Lock(), dict[str, Runs]()


def _work(parcel: Parcel, key: str, piece: Sequence[int]) -> Rows:
    """Return the rows of some runs, with the files unpacked once into Dask's own temporary folder."""
    from distributed import get_worker

    process.ends_with_job = True
    with _unpacking:
        if key not in _runs:
            root = Path(tempfile.mkdtemp(prefix="rmrc-", dir=get_worker().local_directory)).resolve()
            parcel.unpack(root)
            _runs.clear()
            _runs[key] = Runs(parcel, root)
        runs = _runs[key]
    return runs.rows(piece, Event())
