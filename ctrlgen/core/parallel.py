"""Many independent pieces of work: on this computer's processes, or on a dask.distributed scheduler.

    for index, result in run_all(function, items, scheduler=None, jobs=None): ...

One interface, one promise: results depend on the item alone, not on their order, the number of workers or where they
ran; an item that fails is a `Failure` of its own; a worker that dies loses nothing, its items are run again.
"""

from __future__ import annotations

import os
import pickle
import signal
import threading
import traceback
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from multiprocessing import get_context
from typing import Any

from ctrlgen.core.errors import Fault, InputError

_ONE = threading.Lock()
DEATHS = 3  # of its worker, after which an item is given up
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
DASK = "dask[distributed] is not installed; pip install 'ctrlgen[dask]', or leave --scheduler out"
PATIENCE = "10 s"  # for a scheduler to answer

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Failure:
    """Why an item has no result: `what` in one line, `details` with its place in the code."""

    what: str
    details: str = ""


def run_all(
    function: Callable[[Any], Any],
    items: Sequence[Any],
    scheduler: str | None = None,
    jobs: int | None = None,
    progress: Progress | None = None,
) -> Iterator[tuple[int, Any]]:
    """(index, function(item)) of every item as each is done; a `Failure` in its place where it raised or was lost.

    `scheduler` is the address of a dask.distributed one, whose workers must have ctrlgen and see the same files;
    otherwise `jobs` processes of this computer, one a core by default, or none, here, for 0. `progress` is called with
    the number done and of all. Raises InputError where the scheduler does not answer or the work cannot be sent.
    """
    items = list(items)
    if scheduler is not None:
        found = _on_dask(function, items, scheduler)
    elif jobs == 0:
        found = ((k, guarded(function, item)) for k, item in enumerate(items))
    else:
        _check_sendable(function, items)
        found = _on_processes(function, items, max(1, min(jobs or os.cpu_count() or 1, len(items))))
    for done, pair in enumerate(found, 1):
        if progress is not None:
            progress(done, len(items))
        yield pair


def guarded(function: Callable[[Any], Any], item: Any) -> Any:
    """function(item) with one BLAS thread; its exception as a `Failure`."""
    from threadpoolctl import threadpool_limits

    try:
        with _ONE, threadpool_limits(1):  # one item at a time in a process: the caches of a diagnosis are not shared
            return function(item)
    except Exception as error:  # whatever one item raises must not end the others
        said = str(error) or type(error).__name__
        return Failure(said, traceback.format_exc())


def sendable(*things: Any) -> bool:
    """Whether these can go to another process: functions written in a script's own lines cannot."""
    try:
        pickle.dumps(things)
    except Exception:  # pickle raises what the object's own code raises
        return False
    return True


def _check_sendable(function: Callable[[Any], Any], items: list[Any]) -> None:
    if items and not sendable(function, items[0]):
        what = (
            "cannot be sent to another process (a lambda, or a function inside another?); use jobs = 0 to run it here"
        )
        raise InputError("run_all", [Fault("function", what)])


def _begin_worker() -> None:
    """One thread for BLAS; Ctrl-C is the parent's to deal with."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for name in THREADS:
        os.environ[name] = "1"


class _Pool:
    """Worker processes that are begun anew when one of them dies."""

    def __init__(self, jobs: int) -> None:
        self.jobs = jobs
        self.begin()

    def begin(self) -> None:
        """Fresh processes."""
        self.processes = ProcessPoolExecutor(self.jobs, get_context("spawn"), _begin_worker)

    def end(self) -> None:
        """Ends the processes at once, whatever they do."""
        running = list((getattr(self.processes, "_processes", None) or {}).values())
        self.processes.shutdown(wait=False, cancel_futures=True)
        for process in running:
            process.terminate()
        for process in running:
            process.join(timeout=10)


def _on_processes(function: Callable[[Any], Any], items: list[Any], jobs: int) -> Iterator[tuple[int, Any]]:
    """Only as many items are handed out as there are processes, so that those lost with a process are known.

    An item that was running when a process died runs again, alone until it is known which of them it was.
    """
    left, alone = deque(range(len(items))), deque[int]()
    deaths: Counter[int] = Counter()
    running: dict[Future, int] = {}
    pool = _Pool(jobs)
    try:
        while left or alone or running:
            room = 1 if alone else jobs
            while (alone or left) and len(running) < room:
                k = alone.popleft() if alone else left.popleft()
                try:
                    running[pool.processes.submit(guarded, function, items[k])] = k
                except BrokenProcessPool as error:  # a process died while it had nothing to do
                    stillborn: Future = Future()
                    stillborn.set_exception(error)
                    running[stillborn] = k
                    break
            lost = _lost(pool, running)
            if isinstance(lost, list):
                yield from lost
                continue
            pool.end()
            pool.begin()
            for k in lost:
                deaths[k] += 1
                if deaths[k] < DEATHS:
                    alone.append(k)
                else:
                    yield k, Failure(f"its process died {DEATHS} times; is there memory enough?")
    finally:
        pool.end()


def _lost(pool: _Pool, running: dict[Future, int]) -> list[tuple[int, Any]] | set[int]:
    """Waits: a list of what was finished; or, where a process died, the set of items that were lost with it."""
    if not running:
        return set()
    done, _ = wait(running, return_when=FIRST_COMPLETED)
    found = []
    for future in done:
        error = future.exception()
        if isinstance(error, BrokenProcessPool):
            continue
        k = running.pop(future)
        found.append((k, Failure(f"its result cannot be sent: {error}") if error else future.result()))
    if found:
        return found
    lost = set(running.values())
    running.clear()
    return lost


def _same(thing: Any) -> Any:
    return thing


def _on_dask(function: Callable[[Any], Any], items: list[Any], address: str) -> Iterator[tuple[int, Any]]:
    """The scheduler runs again what a dead worker had; the results of finished items are fetched as they come."""
    try:
        from distributed import Client, as_completed
    except ImportError:
        raise InputError("--scheduler", [Fault(address, DASK)]) from None
    try:
        client = Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        said = str(error).strip().splitlines() or ["no answer"]
        raise InputError("--scheduler", [Fault(address, f"does not answer ({said[0]})")]) from None
    with client:
        shared = client.submit(_same, function, pure=False)  # kept once, and made again where a worker dies with it
        futures = {
            client.submit(guarded, shared, item, pure=False, retries=0, key=f"ctrlgen-{os.urandom(6).hex()}-{k}"): k
            for k, item in enumerate(items)
        }
        try:
            with client.as_current():
                finished = as_completed(list(futures))
            for future in finished:
                k = futures.pop(future)
                fault = future.exception()
                yield k, future.result() if fault is None else Failure(str(fault) or type(fault).__name__)
        finally:
            client.cancel(list(futures))
