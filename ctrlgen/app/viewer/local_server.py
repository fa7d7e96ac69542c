"""Serves the pages on the loopback address until Ctrl-C."""

from __future__ import annotations

import errno
import os
import socket
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from ctrlgen.app.viewer.viewed_folders import ViewedFolders
from ctrlgen.core.errors import Fault, InputError

HOST = "127.0.0.1"
PORT = 8765  # where nothing else is known to listen; another one where it is taken
NO_SERVER = "starlette and uvicorn are not installed; pip install 'ctrlgen[view]'"


def serve(folders: list[Path], port: int | None, ready: Callable[[str], None]) -> None:
    """Shows `folders` until Ctrl-C; `ready` is called with the address. Port 0: any that is free; None: `PORT`, or any where it is taken.

    Raises InputError for folders that are none, a port that is taken, and where what serves pages is not installed.
    """
    shown = ViewedFolders(folders)
    try:
        import uvicorn

        from ctrlgen.app.viewer.web_pages import pages
    except ModuleNotFoundError:
        raise InputError("ctrlgen view", [Fault("extra", NO_SERVER)]) from None
    listening = listen(port)
    # its own log is for services; no proxy stands before it
    config = uvicorn.Config(
        pages(shown),
        http="h11",
        ws="none",
        loop="asyncio",
        lifespan="off",
        log_level="error",
        access_log=False,
        proxy_headers=False,
        server_header=False,
        timeout_graceful_shutdown=1,
    )
    with listening, suppress(KeyboardInterrupt):  # the way to end it
        ready(f"http://{HOST}:{listening.getsockname()[1]}/")
        uvicorn.Server(config).run(sockets=[listening])


def listen(port: int | None) -> socket.socket:
    """A socket on the loopback address. Raises InputError."""
    wanted = [PORT, 0] if port is None else [port]
    for k, number in enumerate(wanted):
        listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        try:
            if os.name == "posix":  # on Windows it would let two programs listen at one port
                listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listening.bind((HOST, number))
            listening.listen(64)
            return listening
        except OSError as error:
            listening.close()
            if k + 1 < len(wanted) and error.errno in (errno.EADDRINUSE, errno.EACCES):
                continue
            what = "is taken" if error.errno == errno.EADDRINUSE else f"cannot be used ({error.strerror})"
            raise InputError(
                "--port", [Fault(str(number), f"{what}; name another one, or 0 for any that is free")]
            ) from None
    raise AssertionError
