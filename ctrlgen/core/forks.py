"""Work of this process divided among forks of it: they begin with all that it holds, and send back results alone.

    results = in_forks(function, items, jobs=2)

For many short pieces of work on large objects that cannot be sent, such as compiled models. Longer work that can be sent is
for `ctrlgen.core.parallel`.
"""

from __future__ import annotations

import io
import multiprocessing
import os
import pickle
import signal
import sys
import warnings
from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection, wait
from typing import Any, TypeVar, cast

Item = TypeVar("Item")
Result = TypeVar("Result")
JOBS_VARIABLE = "CTRLGEN_JOBS"
INDEX_BYTES = 4


def usable_cores() -> int:
    """Processes that one diagnosis may use: the variable CTRLGEN_JOBS, else one per core; 1 on other systems than Linux, and in a
    process that is itself a worker."""
    if not sys.platform.startswith("linux") or multiprocessing.parent_process() is not None:
        return 1  # Windows has no fork, and system libraries of macOS do not survive one
    given = os.environ.get(JOBS_VARIABLE, "")
    return max(int(given), 1) if given.isdecimal() else len(os.sched_getaffinity(0))


def in_forks(
    function: Callable[[Item], Result],
    items: Sequence[Item],
    jobs: int,
    begun: Callable[[Item], None] = lambda item: None,
    shared: Sequence[Any] = (),
) -> list[Result]:
    """[function(item) ...] in the order of the items, in at most `jobs` forks; with one job or one item in this process.

    `begun` is called here as each item begins. Objects in `shared` that are parts of a result are not sent but are those of this
    process. What `function` changes otherwise is lost with its fork. Work whose fork dies, or whose result cannot be sent, is done
    here. Raises what an item raises, the first in order.
    """
    if min(jobs, len(items)) < 2:
        results = []
        for item in items:
            begun(item)
            results.append(function(item))
        return results
    waiting, give = os.pipe()
    for k in range(len(items)):
        os.write(give, k.to_bytes(INDEX_BYTES, "little"))
    os.close(give)
    context = multiprocessing.get_context("fork")
    workers: dict[Connection, Any] = {}
    answers: dict[int, tuple[bool, Any]] = {}  # whether it has a result, and the result or what was raised
    try:
        for _ in range(min(jobs, len(items))):
            receive, send = context.Pipe(duplex=False)
            worker = context.Process(target=_work, args=(function, items, waiting, send, shared), daemon=True)
            with warnings.catch_warnings():
                # of threads that the fork does not have: it computes, and takes none of their locks
                warnings.simplefilter("ignore", DeprecationWarning)
                worker.start()
            send.close()
            workers[receive] = worker
        while workers:
            for receive in cast(list[Connection], wait(list(workers))):
                try:
                    k, message = receive.recv()
                except (EOFError, OSError):  # it ended, or was killed while it sent
                    workers.pop(receive).join()
                    continue
                if message is None:
                    begun(items[k])
                elif message:
                    answers[k] = _Unpickler(io.BytesIO(message), shared).load()
    finally:
        os.close(waiting)
        for worker in workers.values():
            worker.terminate()
    results = []
    for k, item in enumerate(items):
        done, result = answers[k] if k in answers else (True, function(item))
        if not done:
            raise cast(Exception, result)
        results.append(result)
    return results


def _work(
    function: Callable[[Any], Any], items: Sequence[Any], waiting: int, send: Connection, shared: Sequence[Any]
) -> None:
    """The life of one fork: it takes items until none waits."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    while index := os.read(waiting, INDEX_BYTES):
        k = int.from_bytes(index, "little")
        send.send((k, None))
        try:
            outcome: tuple[bool, Any] = True, function(items[k])
        except Exception as error:  # told where the work was given
            outcome = False, error
        send.send((k, _pickled(outcome, shared)))
    send.close()
    os._exit(0)  # nothing of the parent's, such as a buffer that its threads hold, is flushed twice


def _pickled(outcome: tuple[bool, Any], shared: Sequence[Any]) -> bytes:
    """What is sent of an outcome; nothing where it cannot be."""
    file = io.BytesIO()
    try:
        _Pickler(file, shared).dump(outcome)
    except Exception:  # pickle raises what the object's own code raises
        return b""
    return file.getvalue()


class _Pickler(pickle.Pickler):
    """Sends the place of a shared object instead of the object."""

    def __init__(self, file: io.BytesIO, shared: Sequence[Any]) -> None:
        super().__init__(file, pickle.HIGHEST_PROTOCOL)
        self.place = {id(thing): k for k, thing in enumerate(shared)}

    def persistent_id(self, thing: Any) -> int | None:
        return self.place.get(id(thing))


class _Unpickler(pickle.Unpickler):
    """Puts the shared object in its place."""

    def __init__(self, file: io.BytesIO, shared: Sequence[Any]) -> None:
        super().__init__(file)
        self.shared = shared

    def persistent_load(self, place: Any) -> Any:
        return self.shared[place]
