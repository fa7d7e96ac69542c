"""Headless Chromium by its debugging pipe: opens pages of a folder, tells what the console says, how wide they are, what a script finds.

Nothing but the standard library and Debian's `chromium`. The protocol: JSON messages that end with a zero byte, to the browser's file
descriptor 3, from its 4 (chromedevtools.github.io/devtools-protocol).
"""

from __future__ import annotations

import base64
import fcntl
import json
import os
import select
import shutil
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

CHROMIUM = next(
    (found for name in ("chromium", "chromium-browser", "google-chrome") if (found := shutil.which(name))), None
)
FLAGS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-extensions",
    "--hide-scrollbars",
    "--remote-debugging-pipe",
    "--host-resolver-rules=MAP:*:~NOTFOUND",
]
FREE = 10  # file descriptors from here on are nobody's in the child
PATIENCE = 30  # seconds for one answer: a page with every script takes less than one


class Browser:
    """One browser with one page, of a size and in a colour scheme."""

    def __init__(self) -> None:
        assert CHROMIUM
        self.folder = tempfile.TemporaryDirectory()
        from_us, self.to = os.pipe()
        self.of, to_us = os.pipe()
        # above the two numbers that the browser expects
        ends = [fcntl.fcntl(end, fcntl.F_DUPFD, FREE) for end in (from_us, to_us)]

        def as_expected() -> None:
            for end, number in zip(ends, (3, 4), strict=True):
                os.dup2(end, number)

        command = [CHROMIUM, *FLAGS, f"--user-data-dir={self.folder.name}", "about:blank"]
        self.process = subprocess.Popen(command, pass_fds=(3, 4), preexec_fn=as_expected, stderr=subprocess.DEVNULL)
        for end in ends:
            os.close(end)
        os.close(from_us)
        os.close(to_us)
        self.buffer, self.count, self.events = b"", 0, []
        (target,) = [t for t in self.ask("Target.getTargets")["targetInfos"] if t["type"] == "page"]
        self.session = None
        self.session = self.ask("Target.attachToTarget", targetId=target["targetId"], flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log"):
            self.ask(f"{domain}.enable")

    session: str | None = None

    def close(self) -> None:
        self.process.terminate()
        self.process.wait(PATIENCE)
        os.close(self.to)
        os.close(self.of)
        self.folder.cleanup()

    def _message(self) -> dict[str, Any]:
        end = time.monotonic() + PATIENCE
        while b"\0" not in self.buffer:
            ready, _, _ = select.select([self.of], [], [], max(0.0, end - time.monotonic()))
            part = os.read(self.of, 1 << 20) if ready else b""
            if not part:
                raise TimeoutError("Chromium does not answer")
            self.buffer += part
        first, _, self.buffer = self.buffer.partition(b"\0")
        return json.loads(first)

    def ask(self, method: str, **params: Any) -> dict[str, Any]:
        """The answer to one command; what is told meanwhile is kept in `events`."""
        self.count += 1
        asked = {"id": self.count, "method": method, "params": params} | (
            {"sessionId": self.session} if self.session else {}
        )
        os.write(self.to, json.dumps(asked).encode() + b"\0")
        while True:
            told = self._message()
            if told.get("id") == self.count:
                assert "error" not in told, (method, told["error"])
                return told["result"]
            self.events.append(told)

    def open(self, path: Path, width: int = 1280, height: int = 900, dark: bool = False, media: str = "") -> list[str]:
        """Loads a page; what its console said: errors, warnings, refused requests, exceptions."""
        self.ask("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.ask("Emulation.setEmulatedMedia", media=media, features=[scheme])
        self.events = []
        self.ask("Page.navigate", url=path.resolve().as_uri())
        while not any(e.get("method") == "Page.loadEventFired" for e in self.events):
            self.events.append(self._message())
        self.run("new Promise(done => setTimeout(done, 150))")
        return [said for e in self.events if (said := _said(e))]

    def run(self, script: str) -> Any:
        """The value of an expression on the page, awaited."""
        options = {"returnByValue": True, "awaitPromise": True}
        found = self.ask("Runtime.evaluate", expression=script, **options)
        assert "exceptionDetails" not in found, found["exceptionDetails"]
        return found["result"].get("value")

    def picture(self, path: Path, whole: bool = False) -> None:
        """A screenshot as PNG, of the screen or of the whole page."""
        data = self.ask("Page.captureScreenshot", format="png", captureBeyondViewport=whole)["data"]
        path.write_bytes(base64.b64decode(data))

    def printed(self, path: Path) -> None:
        """The page as PDF."""
        path.write_bytes(base64.b64decode(self.ask("Page.printToPDF", printBackground=True)["data"]))


def _said(event: dict[str, Any]) -> str:
    params = event.get("params", {})
    if event.get("method") == "Runtime.exceptionThrown":
        return str(params["exceptionDetails"])
    if event.get("method") == "Runtime.consoleAPICalled" and params["type"] in ("error", "warning", "assert"):
        return str(params["args"])
    if event.get("method") == "Log.entryAdded" and params["entry"]["level"] in ("error", "warning"):
        return str(params["entry"]["text"])
    return ""
