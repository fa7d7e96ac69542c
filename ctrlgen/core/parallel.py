"""Independent items of work, in processes of this computer or on a dask.distributed scheduler.

    for index, result in run_all(function, items, scheduler=None, jobs=None): ...

A result depends on its item alone, not on the order, the number of workers or the computer. An item that raises gives a
`Failure`; the items of a worker that dies are run again.
"""

from __future__ import annotations

import itertools
import logging
import os
import pickle
import signal
import threading
import traceback
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from multiprocessing import get_context, parent_process
from typing import Any

from ctrlgen.core.errors import Fault, InputError

_ONE_ITEM = threading.Lock()  # one item at a time in a process: the caches of a diagnosis are not shared
RENEWED = (
    50  # items of a process, after which all are begun anew: a diagnosis leaves 0.7 MB behind, and an import takes 2 s
)
MOST_DEATHS = 3  # of the worker that runs an item, before the item is given up
THREAD_VARIABLES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
NO_DASK = "dask[distributed] is not installed; pip install 'ctrlgen[dask]', or leave --scheduler out"
SCHEDULER_TIMEOUT = "10 s"  # for its first answer
SCHEDULER_GONE = "is gone; what is finished stays, and the same command goes on with the rest when it is there again"
AHEAD = (
    256  # items that a scheduler has at a time: enough for as many workers, and a million items wait here, not there
)

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Failure:
    """Why an item has no result: `what` in one line, `details` with the traceback."""

    what: str
    details: str = ""


def run_all(
    function: Callable[[Any], Any],
    items: Sequence[Any],
    scheduler: str | None = None,
    jobs: int | None = None,
    progress: Progress | None = None,
) -> Iterator[tuple[int, Any]]:
    """Yields (index, function(item)) as each item is finished; a `Failure` instead of the result where it raised or was lost.

    `scheduler` is the address of a dask.distributed scheduler, whose workers need ctrlgen installed and see the same
    files. Without it `jobs` processes of this computer run the items, one per core unless given; 0 runs them in this
    process. `progress` is called with the number of finished items and of all. Raises InputError where the scheduler
    does not answer, is lost, or the function cannot be sent to another process.
    """
    items = list(items)
    if scheduler is not None:
        results = _on_dask(function, items, scheduler)
    elif jobs == 0:
        results = ((k, guarded(function, item)) for k, item in enumerate(items))
    else:
        _check_sendable(function, items)
        results = _on_processes(function, items, max(1, min(jobs or os.cpu_count() or 1, len(items))))
    for done, pair in enumerate(results, 1):
        if progress is not None:
            progress(done, len(items))
        yield pair


def guarded(function: Callable[[Any], Any], item: Any) -> Any:
    """function(item) with one BLAS thread; its exception as a `Failure`."""
    from threadpoolctl import threadpool_limits

    try:
        with _ONE_ITEM, threadpool_limits(1):
            return function(item)
    except Exception as error:  # whatever one item raises must not end the others
        return Failure(str(error) or type(error).__name__, traceback.format_exc())


def sendable(*things: Any) -> bool:
    """Whether these can be sent to another process; functions defined in a notebook or inside a function cannot."""
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
    """Gives a worker one BLAS thread, leaves Ctrl-C to its parent, and ends it with that: one that was killed tells its workers nothing."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for name in THREAD_VARIABLES:
        os.environ[name] = "1"
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


class _Pool:
    """Worker processes, all of them replaced when one dies."""

    def __init__(self, jobs: int) -> None:
        self.jobs = jobs
        self.begin()

    def begin(self) -> None:
        """Starts `jobs` new processes."""
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
    """Runs the items with only as many submitted as there are processes, so that those lost with a process are known.

    An item that was running when a process died runs again with no other item beside it, so that the one that kills its
    process is found.
    """
    waiting, alone = deque(range(len(items))), deque[int]()
    deaths: Counter[int] = Counter()
    running: dict[Future[Any], int] = {}
    pool, begun = _Pool(jobs), 0
    try:
        while waiting or alone or running:
            if begun >= RENEWED * jobs and not running:
                pool.end()
                pool.begin()
                begun = 0
            most = 0 if begun >= RENEWED * jobs else 1 if alone else jobs
            while (alone or waiting) and len(running) < most:
                k = alone.popleft() if alone else waiting.popleft()
                begun += 1
                try:
                    running[pool.processes.submit(guarded, function, items[k])] = k
                except BrokenProcessPool as error:  # a process died while it had nothing to do
                    stillborn: Future[Any] = Future()
                    stillborn.set_exception(error)
                    running[stillborn] = k
                    break
            finished, lost = _wait(running)
            yield from finished
            if finished:
                continue
            pool.end()
            pool.begin()
            for k in lost:
                deaths[k] += 1
                if deaths[k] < MOST_DEATHS:
                    alone.append(k)
                else:
                    yield (
                        k,
                        Failure(
                            f"its process died {MOST_DEATHS} times; check that there is enough memory, or use fewer jobs"
                        ),
                    )
    finally:
        pool.end()


def _wait(running: dict[Future[Any], int]) -> tuple[list[tuple[int, Any]], set[int]]:
    """Waits for an item: (index, result) of those that finished; or, where a process died, the items lost with it."""
    if not running:
        return [], set()
    done, _ = wait(running, return_when=FIRST_COMPLETED)
    finished = []
    for future in done:
        error = future.exception()
        if isinstance(error, BrokenProcessPool):
            continue
        k = running.pop(future)
        finished.append((k, Failure(f"its result cannot be sent back: {error}") if error else future.result()))
    if finished:
        return finished, set()
    lost = set(running.values())
    running.clear()
    return [], lost


def _identity(thing: Any) -> Any:
    return thing


def _on_dask(function: Callable[[Any], Any], items: list[Any], address: str) -> Iterator[tuple[int, Any]]:
    """The results of the items as they are finished; the scheduler runs those of a dead worker again."""
    try:
        from distributed import Client, as_completed
    except ImportError:
        raise InputError("--scheduler", [Fault(address, NO_DASK)]) from None
    try:
        client = Client(address, timeout=SCHEDULER_TIMEOUT, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        lines = str(error).strip().splitlines() or ["no answer"]
        raise InputError("--scheduler", [Fault(address, f"does not answer ({lines[0]})")]) from None
    # what it tells of a lost scheduler is said below
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
    with client:
        shared = client.submit(_identity, function, pure=False)  # sent once; sent again where its worker dies
        waiting, futures = iter(enumerate(items)), {}

        def submitted(most: int) -> list[Any]:
            """The futures of the next items."""
            new = {
                client.submit(guarded, shared, item, pure=False, retries=0, key=f"ctrlgen-{os.urandom(6).hex()}-{k}"): k
                for k, item in itertools.islice(waiting, most)
            }
            futures.update(new)
            return list(new)

        try:
            with client.as_current():
                finished = as_completed(submitted(AHEAD))
            for future in finished:
                k = futures.pop(future)
                fault = future.exception()
                yield k, future.result() if fault is None else Failure(str(fault) or type(fault).__name__)
                finished.update(submitted(1))
        except CancelledError:  # of every future, once the connection is lost
            raise InputError("--scheduler", [Fault(address, SCHEDULER_GONE)]) from None
        finally:
            client.cancel(list(futures))
