"""Answers on disk that no reader sees by accident: JSON, compressed, in base64. Not a secret, a lid."""

from __future__ import annotations

import base64
import json
import zlib
from pathlib import Path
from typing import Any


def seal(path: Path, answer: dict[str, Any]) -> None:
    """Write `answer` under a lid."""
    packed = base64.b64encode(zlib.compress(json.dumps(answer, sort_keys=True).encode(), 9)).decode()
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps({"sealed": packed}) + "\n")


def unseal(path: Path) -> dict[str, Any]:
    """The answer; for the scorer alone."""
    return json.loads(zlib.decompress(base64.b64decode(json.loads(path.read_text())["sealed"])))
