"""Entry point of the command line: signals first, so that an interruption never shows a traceback, then `ctrlgen.app.commands.cli`."""

from __future__ import annotations

import gc
import os
import signal
import sys
from types import FrameType

INTERRUPTED = 130
COLLECTED_AT = (
    20_000  # new objects at which circles of them are looked for; at Python's 700 that is a fourteenth of `ctrlgen run`
)


class Interruption:
    """Remembers that a signal came, because a library may swallow it or turn it into an error of its own."""

    seen = False

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Handles the signal: remembers it and raises KeyboardInterrupt."""
        self.seen = True
        raise KeyboardInterrupt

    def check(self) -> None:
        """Raises KeyboardInterrupt if a signal came, however long ago."""
        if self.seen:
            raise KeyboardInterrupt


def main() -> None:
    """Runs the command line and exits with its status."""
    gc.set_threshold(COLLECTED_AT)
    interruption = Interruption()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, interruption)
    # where a callback swallows the interruption, as one of the import system does, Python prints a traceback of it
    sys.unraisablehook = lambda ignored: None if interruption.seen else sys.__unraisablehook__(ignored)
    try:
        from ctrlgen.app.commands.cli import execute

        status = execute(interruption.check)
    except KeyboardInterrupt:
        status = INTERRUPTED
    except Exception:
        if not interruption.seen:
            raise
        status = INTERRUPTED
    if interruption.seen and status != 0:
        status = INTERRUPTED
        print("interrupted; nothing was written that was not finished", file=sys.stderr)
    sys.stdout.flush()
    sys.stderr.flush()
    if interruption.seen:
        os._exit(status)  # threads of a library may still wait for what was interrupted
    sys.exit(status)


if __name__ == "__main__":
    main()
