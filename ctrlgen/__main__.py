"""Entry point of the command line: signals first, so that an interruption never shows a traceback, then `ctrlgen.cli`."""

from __future__ import annotations

import os
import signal
import sys
from types import FrameType

INTERRUPTED = 130


class _Interruption:
    """Remembers that a signal came, because a library may turn it into an error of its own on the way."""

    seen = False

    def __call__(self, number: int, frame: FrameType | None) -> None:
        self.seen = True
        raise KeyboardInterrupt


def main() -> None:
    """Runs the command line and exits with its status."""
    interruption = _Interruption()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, interruption)
    try:
        from ctrlgen.cli import execute

        status = execute()
    except KeyboardInterrupt:
        status = INTERRUPTED
    except Exception:
        if not interruption.seen:
            raise
        status = INTERRUPTED
    if interruption.seen:
        status = INTERRUPTED
        print("interrupted; nothing was written", file=sys.stderr)
    sys.stdout.flush()
    os._exit(status) if interruption.seen else sys.exit(status)


if __name__ == "__main__":
    main()
